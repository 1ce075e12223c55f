//! Rows of a model at some samples of a stretch, with what drives do besides: friction, inertia and an offset of each, since
//! where a model lacks these their force would pass for something else.

use modelmill_codegen::{Evaluator, States};
use modelmill_identify::ByChannel;
use nalgebra::DMatrix;

use crate::model::Model;
use crate::stretch::Stretch;

/// Columns of a drive besides the model's: rate, its sign, acceleration, an offset, and friction that grows with the square of the
/// rate or differs by direction.
const MORE: usize = 6;
/// Differences reach over this part of a period of the highest frequency at which forces follow the motion.
const REACH: f64 = 1.0 / 16.0;

/// A model at some samples.
pub(super) struct Rows {
    /// Times of the samples, s.
    pub(super) time: Vec<f64>,
    /// The regressor and the further columns.
    pub(super) regressor: ByChannel,
    /// Their slope in time, per s.
    pub(super) slope: ByChannel,
    /// Positions, rates and accelerations of the drives, `[order][drive][sample]`.
    pub(super) motion: [Vec<Vec<f64>>; 3],
}

impl Rows {
    /// `None` where the mechanism has no answer at one of the samples.
    pub(super) fn new(model: &Model, data: &Stretch, samples: &[usize]) -> Option<Self> {
        let last = data.samples().checked_sub(1)?;
        let reach = reach(data);
        let before: Vec<usize> = samples.iter().map(|k| k.saturating_sub(reach)).collect();
        let after: Vec<usize> = samples.iter().map(|k| (k + reach).min(last)).collect();
        let [w_before, w, w_after] =
            [&before, samples, &after].map(|samples| Values::new(model, data, samples));
        let (w_before, w, w_after) = (w_before?, w?, w_after?);
        let time = &data.run.time;
        let n = w.rates.len();
        let width = w.regressor.ncols();
        let mut regressor = w
            .regressor
            .clone()
            .resize_horizontally(width + MORE * n, 0.0);
        let mut accelerations = vec![Vec::with_capacity(samples.len()); n];
        let mut slope = DMatrix::zeros(regressor.nrows(), regressor.ncols());
        let span = |i: usize| time[after[i]] - time[before[i]];
        for k in 0..width {
            let later = w_after.regressor.column(k);
            let earlier = w_before.regressor.column(k);
            let changes = later.iter().zip(&earlier).enumerate();
            let slopes = changes.map(|(row, (later, earlier))| (later - earlier) / span(row / n));
            for (to, slope) in slope.column_mut(k).iter_mut().zip(slopes) {
                *to = slope;
            }
        }
        for (i, sample) in samples.iter().enumerate() {
            let [t_before, t, t_after] = [before[i], *sample, after[i]].map(|k| time[k]);
            let step = t_after - t_before;
            for d in 0..n {
                let row = i * n + d;
                let [v_before, v, v_after] =
                    [&w_before, &w, &w_after].map(|values| values.rates[d][i]);
                let acceleration = (v_after - v_before) / step;
                accelerations[d].push(acceleration);
                let slopes = [(v - v_before, t - t_before), (v_after - v, t_after - t)].map(
                    |(change, step)| {
                        if step > 0.0 {
                            change / step
                        } else {
                            acceleration
                        }
                    },
                );
                let jerk = 2.0 * (slopes[1] - slopes[0]) / step;
                let sign = if v == 0.0 { 0.0 } else { v.signum() };
                let values = [v, sign, acceleration, 1.0, v * v.abs(), v.abs()];
                let changes = [
                    acceleration,
                    0.0,
                    jerk,
                    0.0,
                    2.0 * v.abs() * acceleration,
                    sign * acceleration,
                ];
                for k in 0..MORE {
                    let at = (row, width + MORE * d + k);
                    regressor[at] = values[k];
                    slope[at] = changes[k];
                }
            }
        }
        let is_finite = [&regressor, &slope]
            .iter()
            .all(|m| m.iter().all(|x| x.is_finite()));
        is_finite.then(|| Self {
            time: samples.iter().map(|k| time[*k]).collect(),
            regressor: ByChannel::new(&regressor, n),
            slope: ByChannel::new(&slope, n),
            motion: [w.positions, w.rates, accelerations],
        })
    }
}

/// Samples to either side over which differences are taken.
fn reach(data: &Stretch) -> usize {
    let time = &data.run.time;
    let rate = (time.len() - 1) as f64 / (time[time.len() - 1] - time[0]);
    let band = data.run.prepared.band_hz.unwrap_or(rate);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a few samples"
    )]
    let reach = (REACH * rate / band) as usize;
    reach.clamp(1, time.len().max(2) / 2)
}

/// The regressor, and positions and rates of the drives, at some samples.
struct Values {
    regressor: DMatrix<f64>,
    positions: Vec<Vec<f64>>,
    rates: Vec<Vec<f64>>,
}

impl Values {
    fn new(model: &Model, data: &Stretch, samples: &[usize]) -> Option<Self> {
        let states = [&data.run.q, &data.run.qd, &data.run.qdd].map(|all| picked(all, samples));
        let load = picked(data.run.force.as_deref().unwrap_or(&[]), samples);
        let states = States {
            q: states[0].iter().map(Vec::as_slice).collect(),
            qd: states[1].iter().map(Vec::as_slice).collect(),
            qdd: states[2].iter().map(Vec::as_slice).collect(),
            load: load.iter().map(Vec::as_slice).collect(),
        };
        let evaluator = Evaluator::new(&model.derivation);
        let regressor = evaluator.regressor(&states).ok()?;
        let n = model.derivation.mechanism.drives.len();
        // Positions come first, rates behind them, the Jacobian last.
        let mut positions = evaluator.drives(&states).ok()?;
        positions.truncate(2 * n);
        let rates = positions.split_off(n);
        Some(Self {
            regressor,
            positions,
            rates,
        })
    }
}

/// Columns at some samples.
pub(super) fn picked(columns: &[Vec<f64>], samples: &[usize]) -> Vec<Vec<f64>> {
    let pick = |column: &Vec<f64>| samples.iter().map(|k| column[*k]).collect();
    columns.iter().map(pick).collect()
}
