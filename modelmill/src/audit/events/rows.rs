//! The residual in which a first look searches events: the rows of the model, with friction, inertia and an offset of
//! every drive added, and the motion of the drives.

use modelmill_codegen::ModelEvaluator;
use modelmill_identify::{ChannelRegressor, PreparedRun, float_to_count};
use nalgebra::DMatrix;

use super::fit::fit_without_events;
use super::regimes::standing_mask;
use super::smoothing::sample_quantile;
use super::trace::ResidualTrace;
use crate::audit::thresholds::{EVENT_FEWEST_SAMPLES, LONGEST_SMEAR_S, SLOWEST_ANGULAR_RATE, SLOWEST_LINEAR_RATE};
use crate::model::Model;
use crate::segment::RecordingSegment;
use crate::segment::picked_states::{PickedStates, rate_sign};

/// Samples per second that are evaluated in a run of usual length.
const FINE_PER_S: f64 = 120.0;
/// Number of samples of a short run that are evaluated, and largest number in a run of usual length.
const SAMPLES: [usize; 2] = [4000, 12_000];
/// Samples per second that are evaluated in a long run.
const COARSE_PER_S: f64 = 25.0;
/// Number of further columns of a drive: rate, its sign, acceleration, an offset, friction with the square of the
/// rate, and friction that differs by direction.
const FRICTION_COLUMNS: usize = 6;
/// Smear of a run whose motion was not filtered, s.
const UNFILTERED_SMEAR_S: f64 = 0.05;

/// The residual of a segment of a recording; `None` if there are no forces or too few samples, or if
/// the model cannot be fitted.
pub(super) fn residual_trace(model: &Model, data: &RecordingSegment) -> Option<ResidualTrace> {
    // Without forces there is no residual, and effects that depend on the load cannot be evaluated.
    let forces = data.run.force.as_deref()?;
    let samples = evaluated_samples(&data.run.time)?;
    let rows = EventRows::new(model, data, &samples)?;
    let measured: Vec<Vec<f64>> = forces.iter().map(|force| local_medians(force, &samples)).collect();
    let is_measured = (0..measured.len())
        .map(|d| samples.iter().map(|k| data.run.is_force_measured(d, *k)).collect())
        .collect();
    let prepared = &data.run.prepared;
    // A series chosen automatically represents the motion up to noise: it smears nothing.
    let cutoff = prepared.cutoff_hz.filter(|_| prepared.period.is_none());
    let smear = cutoff.map_or(UNFILTERED_SMEAR_S, f64::recip);
    let mut trace = ResidualTrace {
        time: samples.iter().map(|k| data.run.time[*k]).collect(),
        motion: rows.motion,
        residual: measured.clone(),
        measured,
        is_measured,
        slowest: (0..forces.len()).map(|d| slowest_rate(model, d)).collect(),
        smear: smear.min(LONGEST_SMEAR_S),
    };
    fit_without_events(&mut trace, &rows.regressor)?;
    Some(trace)
}

/// The samples of a run that are evaluated, at even distances; `None` if there are too few.
fn evaluated_samples(time: &[f64]) -> Option<Vec<usize>> {
    let duration = time.last()? - time.first()?;
    if time.len() < EVENT_FEWEST_SAMPLES || duration <= 0.0 {
        return None;
    }
    let usual = float_to_count(FINE_PER_S * duration).clamp(SAMPLES[0], SAMPLES[1]);
    let wanted = usual.max(float_to_count(COARSE_PER_S * duration));
    Some((0..time.len()).step_by((time.len() / wanted).max(1)).collect())
}

/// The median of a signal about each of some samples, over their distance: single outliers are no events.
fn local_medians(values: &[f64], samples: &[usize]) -> Vec<f64> {
    let half = samples.get(1).map_or(0, |second| (second - samples[0]) / 2);
    let window = |k: usize| k.saturating_sub(half)..(k + half + 1).min(values.len());
    let medians = samples.iter().map(|k| {
        if half == 0 {
            values[*k]
        } else {
            sample_quantile(values[window(*k)].to_vec(), 0.5)
        }
    });
    medians.collect()
}

/// The rate of a drive that is standstill in any case, rad/s or m/s.
pub(crate) fn slowest_rate(model: &Model, drive: usize) -> f64 {
    if model.force_unit(drive) == "N" {
        SLOWEST_LINEAR_RATE
    } else {
        SLOWEST_ANGULAR_RATE
    }
}

/// Rows of a model at some samples, with further columns for each drive, and the motion of the drives. Coordinates at
/// standstill have no rate: the noise of their readings would switch friction.
struct EventRows {
    /// The regressor and the further columns.
    regressor: ChannelRegressor,
    /// Positions, rates and accelerations of the drives, `[order][drive][sample]`.
    motion: [Vec<Vec<f64>>; 3],
}

impl EventRows {
    /// Evaluates the model; `None` if a pose has no solution or a value is not finite.
    fn new(model: &Model, data: &RecordingSegment, samples: &[usize]) -> Option<Self> {
        let run = &data.run;
        let time: Vec<f64> = samples.iter().map(|k| run.time[*k]).collect();
        let states = standing_states(model, run, samples, &time);
        let rows = ModelEvaluator::new(&model.derivation)
            .regressor(&states.as_motion())
            .ok()?;
        let motion = motion_of_drives(model, &states, &time)?;
        let [_, rates, accelerations] = &motion;
        let rows = with_friction_columns(rows, rates, accelerations);
        rows.iter().all(|x| x.is_finite()).then(|| Self {
            regressor: ChannelRegressor::new(&rows, model.row_names().len()),
            motion,
        })
    }
}

/// The states of a run at some samples. Coordinates at standstill have no rate: the noise of their readings would switch
/// friction.
pub(crate) fn standing_states(model: &Model, run: &PreparedRun, samples: &[usize], time: &[f64]) -> PickedStates {
    let n = time.len();
    let per_second = (n - 1) as f64 / (time[n - 1] - time[0]);
    let mut states = PickedStates::new(run, samples);
    let types = model.active_coordinate_types();
    for ((rate, acceleration), (_, is_angle)) in states.qd.iter_mut().zip(&mut states.qdd).zip(types) {
        let slowest = if is_angle {
            SLOWEST_ANGULAR_RATE
        } else {
            SLOWEST_LINEAR_RATE
        };
        let standing = standing_mask(rate, per_second, slowest);
        for (i, _) in standing.iter().enumerate().filter(|(_, stands)| **stands) {
            rate[i] = 0.0;
            acceleration[i] = 0.0;
        }
    }
    states
}

/// Positions, rates and accelerations of the drives at some states, `[order][drive][sample]`; `None` at a pose without
/// solution.
pub(crate) fn motion_of_drives(model: &Model, states: &PickedStates, time: &[f64]) -> Option<[Vec<Vec<f64>>; 3]> {
    let [positions, rates] = states.drive_motion(model)?;
    let accelerations = rates.iter().map(|rate| time_derivative(rate, time)).collect();
    Some([positions, rates, accelerations])
}

/// The derivative of a signal by central differences, one-sided at the ends.
fn time_derivative(values: &[f64], time: &[f64]) -> Vec<f64> {
    let last = values.len() - 1;
    let slope = |i: usize| {
        let (a, b) = (i.saturating_sub(1), (i + 1).min(last));
        (values[b] - values[a]) / (time[b] - time[a])
    };
    (0..values.len()).map(slope).collect()
}

/// Appends friction, inertia and an offset of every drive to interleaved rows.
fn with_friction_columns(rows: DMatrix<f64>, rates: &[Vec<f64>], accelerations: &[Vec<f64>]) -> DMatrix<f64> {
    let (n, width) = (rates.len(), rows.ncols());
    let mut rows = rows.resize_horizontally(width + FRICTION_COLUMNS * n, 0.0);
    for d in 0..n {
        for (i, (v, acceleration)) in rates[d].iter().zip(&accelerations[d]).enumerate() {
            let values = [*v, rate_sign(*v), *acceleration, 1.0, v * v.abs(), v.abs()];
            for (k, value) in values.into_iter().enumerate() {
                rows[(i * n + d, width + FRICTION_COLUMNS * d + k)] = value;
            }
        }
    }
    rows
}
