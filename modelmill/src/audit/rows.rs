//! Rows of a model at some samples of a segment, with further columns for each drive: friction, inertia and an
//! offset. If a model lacks these, their force would be attributed to something else.

use modelmill_codegen::{ModelEvaluator, MotionStates};
use modelmill_identify::{ChannelRegressor, float_to_count};
use nalgebra::DMatrix;

use crate::model::Model;
use crate::segment::RecordingSegment;

/// Number of further columns of a drive: rate, its sign, acceleration, an offset, friction with the square of the
/// rate, and friction that differs by direction.
const MORE: usize = 6;
/// Differences are taken over this fraction of a period of the highest frequency at which forces follow the motion.
const REACH: f64 = 1.0 / 16.0;

/// The rows of a model at some samples.
pub(crate) struct AuditRows {
    /// Times of the samples, s.
    pub(crate) time: Vec<f64>,
    /// The regressor and the further columns.
    pub(crate) regressor: ChannelRegressor,
    /// Positions, rates and accelerations of the drives, `[order][drive][sample]`.
    pub(crate) motion: [Vec<Vec<f64>>; 3],
}

impl AuditRows {
    /// The rows at some samples; `None` if a pose has no solution, or a value is not finite.
    pub(crate) fn new(model: &Model, data: &RecordingSegment, samples: &[usize]) -> Option<Self> {
        let around = DriveStencil::new(model, data, samples)?;
        let rows = around.rows(model, data, samples)?;
        let n = around.rates[1].len();
        let mut accelerations = vec![Vec::with_capacity(samples.len()); n];
        for (d, accelerations) in accelerations.iter_mut().enumerate() {
            accelerations.extend((0..samples.len()).map(|i| around.extra_columns(d, i).values[2]));
        }
        let [_, rates, _] = around.rates;
        let [_, time, _] = around.times;
        Some(Self {
            time,
            regressor: ChannelRegressor::new(&rows, n),
            motion: [around.positions, rates, accelerations],
        })
    }

    /// The regressor and the further columns at samples of several segments, the rows of one segment behind those of
    /// another; `None` as for [`Self::new`].
    pub(crate) fn joined_regressor<'a>(
        model: &Model,
        segments: impl Iterator<Item = &'a RecordingSegment>,
        samples: &[Vec<usize>],
    ) -> Option<ChannelRegressor> {
        let mut joined: Option<DMatrix<f64>> = None;
        for (data, samples) in segments.zip(samples) {
            let rows = DriveStencil::new(model, data, samples)?.rows(model, data, samples)?;
            joined = Some(match joined {
                None => rows,
                Some(above) => {
                    let (top, more) = (above.nrows(), rows.nrows());
                    let mut both = above.resize_vertically(top + more, 0.0);
                    both.rows_mut(top, more).copy_from(&rows);
                    both
                }
            });
        }
        Some(ChannelRegressor::new(&joined?, model.derivation.mechanism.drives.len()))
    }

    /// The time derivative of the regressor and the further columns, per s.
    pub(super) fn slope(model: &Model, data: &RecordingSegment, samples: &[usize]) -> Option<ChannelRegressor> {
        let around = DriveStencil::new(model, data, samples)?;
        let n = around.rates[1].len();
        // The regressor is differentiated by differences, the further columns by their own formulas.
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

/// Motion of the drives at samples, and at the samples before and after them, for differences.
struct DriveStencil {
    /// Indices of the samples before, at and after.
    samples: [Vec<usize>; 3],
    /// Their times, s.
    times: [Vec<f64>; 3],
    /// Positions of the drives at the samples, rad or m.
    positions: Vec<Vec<f64>>,
    /// Rates of the drives before, at and after, rad/s or m/s.
    rates: [Vec<Vec<f64>>; 3],
}

/// Further columns of a drive at a sample, and their time derivatives.
struct ExtraDriveColumns {
    /// The columns, in the order of [`MORE`].
    values: [f64; MORE],
    /// Their time derivatives, per s.
    slopes: [f64; MORE],
}

impl DriveStencil {
    /// Evaluates the drives; `None` if a pose has no solution.
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
            let found = SampledStates::new(data, samples).with_states(|states| evaluator.drive_motion(states));
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

    /// The regressor of a model with the further columns, rows interleaved per sample; `None` if a pose has no solution,
    /// or a value is not finite.
    fn rows(&self, model: &Model, data: &RecordingSegment, samples: &[usize]) -> Option<DMatrix<f64>> {
        let mut rows = regressor(model, data, samples)?;
        self.add_extra_columns(&mut rows, |further| further.values);
        rows.iter().all(|x| x.is_finite()).then_some(rows)
    }

    /// The time between the samples before and after sample `i`, s.
    fn span(&self, i: usize) -> f64 {
        self.times[2][i] - self.times[0][i]
    }

    /// The further columns of drive `d` at sample `i`, by differences of its rate.
    fn extra_columns(&self, d: usize, i: usize) -> ExtraDriveColumns {
        let [t_before, t, t_after] = self.times.each_ref().map(|times| times[i]);
        let [v_before, v, v_after] = self.rates.each_ref().map(|rates| rates[d][i]);
        let step = self.span(i);
        let acceleration = (v_after - v_before) / step;
        // At the ends of a recording one of the neighbours is the sample itself.
        let slopes = [(v - v_before, t - t_before), (v_after - v, t_after - t)]
            .map(|(change, step)| if step > 0.0 { change / step } else { acceleration });
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

    /// Appends the further columns of all drives, or their derivatives as `chosen` selects, behind those of the model.
    fn add_extra_columns(&self, rows: &mut DMatrix<f64>, chosen: impl Fn(ExtraDriveColumns) -> [f64; MORE]) {
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

/// Number of samples to either side over which differences are taken.
fn reach(data: &RecordingSegment) -> usize {
    let time = &data.run.time;
    let rate = (time.len() - 1) as f64 / (time[time.len() - 1] - time[0]);
    let band = data.run.prepared.band_hz.unwrap_or(rate);
    let reach = float_to_count(REACH * rate / band);
    reach.clamp(1, time.len().max(2) / 2)
}

/// The regressor at some samples, rows interleaved by drive; `None` if a pose has no solution.
fn regressor(model: &Model, data: &RecordingSegment, samples: &[usize]) -> Option<DMatrix<f64>> {
    let evaluator = ModelEvaluator::new(&model.derivation);
    let found = SampledStates::new(data, samples).with_states(|states| evaluator.regressor(states));
    found.ok()
}

/// States at some samples, with the load.
struct SampledStates {
    /// Positions, rates and accelerations, `[order][coordinate][sample]`.
    motion: [Vec<Vec<f64>>; 3],
    /// Measured forces, `[drive][sample]`.
    load: Vec<Vec<f64>>,
}

impl SampledStates {
    /// The states of a segment at some samples.
    fn new(data: &RecordingSegment, samples: &[usize]) -> Self {
        Self {
            motion: [&data.run.q, &data.run.qd, &data.run.qdd].map(|all| select_samples(all, samples)),
            load: select_samples(data.run.force.as_deref().unwrap_or(&[]), samples),
        }
    }

    /// Calls a function with the states.
    fn with_states<R>(&self, evaluate: impl FnOnce(&MotionStates<'_>) -> R) -> R {
        evaluate(&MotionStates {
            q: slices(&self.motion[0]),
            qd: slices(&self.motion[1]),
            qdd: slices(&self.motion[2]),
            load: slices(&self.load),
        })
    }
}

/// Columns as slices.
fn slices(columns: &[Vec<f64>]) -> Vec<&[f64]> {
    columns.iter().map(Vec::as_slice).collect()
}

/// The values of columns at some samples.
pub(super) fn select_samples(columns: &[Vec<f64>], samples: &[usize]) -> Vec<Vec<f64>> {
    let pick = |column: &Vec<f64>| samples.iter().map(|k| column[*k]).collect();
    columns.iter().map(pick).collect()
}
