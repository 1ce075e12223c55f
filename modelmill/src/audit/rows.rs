//! Rows of a model at some samples of a stretch, with what drives do besides: friction, inertia and an offset of each, since
//! where a model lacks these their force would pass for something else.

use modelmill_codegen::{ModelEvaluator, MotionStates};
use modelmill_identify::ChannelRegressor;
use nalgebra::DMatrix;

use crate::model::Model;
use crate::stretch::RecordingSegment;

/// Columns of a drive besides the model's: rate, its sign, acceleration, an offset, and friction that grows with the square of the
/// rate or differs by direction.
const MORE: usize = 6;
/// Differences reach over this part of a period of the highest frequency at which forces follow the motion.
const REACH: f64 = 1.0 / 16.0;

/// A model at some samples.
pub(super) struct AuditRows {
    /// Times of the samples, s.
    pub(super) time: Vec<f64>,
    /// The regressor and the further columns.
    pub(super) regressor: ChannelRegressor,
    /// Positions, rates and accelerations of the drives, `[order][drive][sample]`.
    pub(super) motion: [Vec<Vec<f64>>; 3],
}

impl AuditRows {
    /// `None` where the mechanism has no answer at one of the samples.
    pub(super) fn new(model: &Model, data: &RecordingSegment, samples: &[usize]) -> Option<Self> {
        let around = DriveStencil::new(model, data, samples)?;
        let mut rows = regressor(model, data, samples)?;
        around.add_extra_columns(&mut rows, |further| further.values);
        let n = around.rates[1].len();
        let mut accelerations = vec![Vec::with_capacity(samples.len()); n];
        for (d, accelerations) in accelerations.iter_mut().enumerate() {
            accelerations.extend((0..samples.len()).map(|i| around.extra_columns(d, i).values[2]));
        }
        let [_, rates, _] = around.rates;
        let [_, time, _] = around.times;
        rows.iter().all(|x| x.is_finite()).then(|| Self {
            time,
            regressor: ChannelRegressor::new(&rows, n),
            motion: [around.positions, rates, accelerations],
        })
    }

    /// The regressor and the further columns if gravity pulled the other way.
    pub(super) fn with_reversed_gravity(
        model: &Model,
        data: &RecordingSegment,
        samples: &[usize],
    ) -> Option<ChannelRegressor> {
        let around = DriveStencil::new(model, data, samples)?;
        let mut rows = regressor_with_reversed_gravity(model, data, samples)?;
        around.add_extra_columns(&mut rows, |further| further.values);
        let is_finite = rows.iter().all(|x| x.is_finite());
        is_finite.then(|| ChannelRegressor::new(&rows, around.rates[1].len()))
    }

    /// The slope in time of the regressor and the further columns, per s.
    pub(super) fn slope(
        model: &Model,
        data: &RecordingSegment,
        samples: &[usize],
    ) -> Option<ChannelRegressor> {
        let around = DriveStencil::new(model, data, samples)?;
        let n = around.rates[1].len();
        let [earlier, _, later] = &around.samples;
        let mut slope = regressor(model, data, later)? - regressor(model, data, earlier)?;
        for mut column in slope.column_iter_mut() {
            for (row, change) in column.iter_mut().enumerate() {
                *change /= around.span(row / n);
            }
        }
        around.add_extra_columns(&mut slope, |further| further.slopes);
        let is_finite = slope.iter().all(|x| x.is_finite());
        is_finite.then(|| ChannelRegressor::new(&slope, n))
    }
}

/// What the drives do at samples, at those before and at those after them.
struct DriveStencil {
    samples: [Vec<usize>; 3],
    times: [Vec<f64>; 3],
    /// At the samples themselves.
    positions: Vec<Vec<f64>>,
    rates: [Vec<Vec<f64>>; 3],
}

/// Further columns of a drive at a sample, and their slopes in time.
struct ExtraDriveColumns {
    values: [f64; MORE],
    slopes: [f64; MORE],
}

impl DriveStencil {
    fn new(model: &Model, data: &RecordingSegment, samples: &[usize]) -> Option<Self> {
        let last = data.samples().checked_sub(1)?;
        let reach = reach(data);
        let before = samples.iter().map(|k| k.saturating_sub(reach)).collect();
        let after = samples.iter().map(|k| (k + reach).min(last)).collect();
        let samples = [before, samples.to_vec(), after];
        let n = model.derivation.mechanism.drives.len();
        let mut drives = Vec::new();
        for samples in &samples {
            let evaluator = ModelEvaluator::new(&model.derivation);
            let found = SampledStates::new(data, samples)
                .with_states(|states| evaluator.drive_motion(states));
            // Positions come first, rates behind them, the Jacobian last.
            let mut positions = found.ok()?;
            positions.truncate(2 * n);
            let rates = positions.split_off(n);
            drives.push((positions, rates));
        }
        let [(_, before), (positions, rates), (_, after)] = drives.try_into().ok()?;
        let of = |samples: &Vec<usize>| samples.iter().map(|k| data.run.time[*k]).collect();
        Some(Self {
            times: samples.each_ref().map(of),
            samples,
            positions,
            rates: [before, rates, after],
        })
    }

    /// The time from before a sample to after it, s.
    fn span(&self, i: usize) -> f64 {
        self.times[2][i] - self.times[0][i]
    }

    fn extra_columns(&self, d: usize, i: usize) -> ExtraDriveColumns {
        let [t_before, t, t_after] = self.times.each_ref().map(|times| times[i]);
        let [v_before, v, v_after] = self.rates.each_ref().map(|rates| rates[d][i]);
        let step = self.span(i);
        let acceleration = (v_after - v_before) / step;
        let slopes =
            [(v - v_before, t - t_before), (v_after - v, t_after - t)].map(|(change, step)| {
                if step > 0.0 {
                    change / step
                } else {
                    acceleration
                }
            });
        let jerk = 2.0 * (slopes[1] - slopes[0]) / step;
        let sign = if v == 0.0 { 0.0 } else { v.signum() };
        ExtraDriveColumns {
            values: [v, sign, acceleration, 1.0, v * v.abs(), v.abs()],
            slopes: [
                acceleration,
                0.0,
                jerk,
                0.0,
                2.0 * v.abs() * acceleration,
                sign * acceleration,
            ],
        }
    }

    /// Puts what is chosen of the further columns behind those of the model.
    fn add_extra_columns(
        &self,
        rows: &mut DMatrix<f64>,
        chosen: impl Fn(ExtraDriveColumns) -> [f64; MORE],
    ) {
        let (n, width) = (self.rates[1].len(), rows.ncols());
        let owned = std::mem::replace(rows, DMatrix::zeros(0, 0));
        *rows = owned.resize_horizontally(width + MORE * n, 0.0);
        for d in 0..n {
            for i in 0..self.times[1].len() {
                let values = chosen(self.extra_columns(d, i));
                for (k, value) in values.into_iter().enumerate() {
                    rows[(i * n + d, width + MORE * d + k)] = value;
                }
            }
        }
    }
}

/// Samples to either side over which differences are taken.
fn reach(data: &RecordingSegment) -> usize {
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

/// The regressor at some samples, rows interleaved.
fn regressor(model: &Model, data: &RecordingSegment, samples: &[usize]) -> Option<DMatrix<f64>> {
    let evaluator = ModelEvaluator::new(&model.derivation);
    let found = SampledStates::new(data, samples).with_states(|states| evaluator.regressor(states));
    found.ok()
}

/// The regressor if gravity pulled the other way: what columns are at rest is gravity's, or an effect's of which a fit knows no
/// sign.
pub(super) fn regressor_with_reversed_gravity(
    model: &Model,
    data: &RecordingSegment,
    samples: &[usize],
) -> Option<DMatrix<f64>> {
    let evaluator = ModelEvaluator::new(&model.derivation);
    let at_rest = SampledStates::new(data, samples).at_standstill();
    let at_rest = at_rest
        .with_states(|states| evaluator.regressor(states))
        .ok()?;
    Some(regressor(model, data, samples)? - 2.0 * at_rest)
}

/// States at some samples.
struct SampledStates {
    motion: [Vec<Vec<f64>>; 3],
    load: Vec<Vec<f64>>,
}

impl SampledStates {
    fn new(data: &RecordingSegment, samples: &[usize]) -> Self {
        Self {
            motion: [&data.run.q, &data.run.qd, &data.run.qdd]
                .map(|all| select_samples(all, samples)),
            load: select_samples(data.run.force.as_deref().unwrap_or(&[]), samples),
        }
    }

    /// The same poses at rest.
    fn at_standstill(mut self) -> Self {
        let [_, rates, accelerations] = &mut self.motion;
        for column in rates.iter_mut().chain(accelerations) {
            column.fill(0.0);
        }
        self
    }

    fn with_states<R>(&self, evaluate: impl FnOnce(&MotionStates<'_>) -> R) -> R {
        evaluate(&MotionStates {
            q: slices(&self.motion[0]),
            qd: slices(&self.motion[1]),
            qdd: slices(&self.motion[2]),
            load: slices(&self.load),
        })
    }
}

fn slices(columns: &[Vec<f64>]) -> Vec<&[f64]> {
    columns.iter().map(Vec::as_slice).collect()
}

/// Columns at some samples.
pub(super) fn select_samples(columns: &[Vec<f64>], samples: &[usize]) -> Vec<Vec<f64>> {
    let pick = |column: &Vec<f64>| samples.iter().map(|k| column[*k]).collect();
    columns.iter().map(pick).collect()
}
