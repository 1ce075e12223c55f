//! Instruments from commands: the part of the measured motion that follows from the commands alone.
//!
//! Encoder noise stands in the signals (`command - position`) and in the regressor at once, so that least squares is
//! biased. A motion that is computed from the commands has none of that noise. It is a sum of lagged commands, fitted
//! to the measured motion: a finite impulse response of the closed loop. Source: A. Janot, P.-O. Vandanjon, M. Gautier,
//! "A generic instrumental variable approach for industrial robot identification", IEEE Trans. CST 22 (2014), who
//! simulate the closed loop, which needs known gains.
//!
//! Known masses fix the scale of all other values. Where their forces are small, instruments of the unknown columns alone
//! are weak for the scale, and all values come out too small by one factor. The known part of the equations along the
//! commanded motion is therefore an instrument of its own, for each drive: two-stage least squares with more instruments
//! than unknowns. Source: P. Young, "Recursive Estimation and Time-Series Analysis" (2011), section 7.

use nalgebra::{DMatrix, DVector};

use super::ServoModel;
use super::thresholds::{INSTRUMENT_LAGS, INSTRUMENT_RIDGE, PROJECTION_RIDGE};
use crate::segment::RecordingSegment;
use modelmill_spec::{ActuatorKind, ModelActuator};

/// A command as positions, rates and accelerations by sample.
type CommandMotion = [Vec<f64>; 3];

/// The segment with the motion of all joints replaced by the part that follows from the commands; `None` without
/// commands.
pub(super) fn commanded_segment(servo: &ServoModel, segment: &RecordingSegment) -> Option<RecordingSegment> {
    let actuators = servo.actuators();
    let commands: Vec<CommandMotion> = actuators
        .iter()
        .filter(|actuator| actuator.kind.is_commanded())
        .map(|actuator| command_motion(servo, actuator, segment))
        .collect();
    if commands.is_empty() {
        return None;
    }
    let time = &segment.run.time;
    // Features by derivative: a constant for positions only, then each command at each lag.
    let features = [0, 1, 2].map(|order: usize| {
        let mut columns = vec![vec![f64::from(u8::from(order == 0)); time.len()]];
        for command in &commands {
            columns.extend(INSTRUMENT_LAGS.iter().map(|lag| lagged(time, &command[order], *lag)));
        }
        columns
    });
    let mut instruments = segment.clone();
    let signals: Vec<usize> = actuators
        .iter()
        .map(|actuator| servo.signal_position(actuator))
        .collect();
    for i in (0..segment.run.q.len()).filter(|i| !signals.contains(i)) {
        let run = &segment.run;
        let fitted = fit_motion(&features, [&run.q[i], &run.qd[i], &run.qdd[i]])?;
        let [q, qd, qdd] = fitted;
        instruments.run.q[i] = q;
        instruments.run.qd[i] = qd;
        instruments.run.qdd[i] = qdd;
    }
    Some(instruments)
}

/// The command of an actuator as a motion; the command of a velocity is integrated.
fn command_motion(servo: &ServoModel, actuator: &ModelActuator, segment: &RecordingSegment) -> CommandMotion {
    let i = servo.signal_position(actuator);
    let run = &segment.run;
    if actuator.kind != ActuatorKind::VelocityServo {
        return [run.q[i].clone(), run.qd[i].clone(), run.qdd[i].clone()];
    }
    let mut position = vec![0.0; run.time.len()];
    for k in 1..position.len() {
        let step = run.time[k] - run.time[k - 1];
        position[k] = position[k - 1] + 0.5 * step * (run.q[i][k] + run.q[i][k - 1]);
    }
    [position, run.q[i].clone(), run.qd[i].clone()]
}

/// A column some time before, with its first value before its start; linear between samples.
fn lagged(time: &[f64], column: &[f64], lag: f64) -> Vec<f64> {
    let last = time.len() - 1;
    time.iter()
        .map(|t| {
            let t = t - lag;
            if t <= time[0] || last == 0 {
                return column[0];
            }
            let b = time.partition_point(|x| *x < t).clamp(1, last);
            let s = (t - time[b - 1]) / (time[b] - time[b - 1]);
            column[b - 1] + s * (column[b] - column[b - 1])
        })
        .collect()
}

/// The motion as a sum of features, with the same factors for position, rate and acceleration.
fn fit_motion(features: &[Vec<Vec<f64>>; 3], motion: [&[f64]; 3]) -> Option<CommandMotion> {
    let n = features[0].len();
    let mut normal: DMatrix<f64> = DMatrix::zeros(n, n);
    let mut right: DVector<f64> = DVector::zeros(n);
    for (columns, measured) in features.iter().zip(motion) {
        // Each derivative has the same weight, whatever its size.
        let mean = measured.iter().sum::<f64>() / measured.len().max(1) as f64;
        let spread = measured.iter().map(|x| (x - mean).powi(2)).sum::<f64>();
        if spread == 0.0 {
            continue;
        }
        for a in 0..n {
            right[a] += dot(&columns[a], measured) / spread;
            for b in a..n {
                let product = dot(&columns[a], &columns[b]) / spread;
                normal[(a, b)] += product;
                if a != b {
                    normal[(b, a)] += product;
                }
            }
        }
    }
    let ridge = INSTRUMENT_RIDGE * normal.trace();
    for a in 0..n {
        normal[(a, a)] += ridge;
    }
    let factors = normal.cholesky()?.solve(&right);
    let sum = |columns: &[Vec<f64>]| {
        let mut total = vec![0.0; columns[0].len()];
        for (column, factor) in columns.iter().zip(factors.iter()) {
            for (slot, x) in total.iter_mut().zip(column) {
                *slot += factor * x;
            }
        }
        total
    };
    Some(features.each_ref().map(|columns| sum(columns)))
}

/// The part of the regressor that follows from instruments, by rows as the regressor: the first stage of two-stage least
/// squares. `known` is the known part of the equations along the commanded motion; its rows belong to `n_rows` drives
/// in turn, each of which is an instrument of its own. `None` if the instruments depend on each other.
pub(super) fn project_on_instruments(
    instruments: &[f64],
    known: &[f64],
    regressor: &[f64],
    n_rows: usize,
) -> Option<Vec<f64>> {
    let rows = known.len();
    if rows == 0 || regressor.is_empty() {
        return None;
    }
    let n = regressor.len() / rows;
    let width = n + n_rows;
    // Columns have unit norm, so that the ridge has the same effect on all.
    let mut z = DMatrix::zeros(rows, width);
    for (i, (row, value)) in instruments.chunks_exact(n).zip(known).enumerate() {
        for (k, x) in row.iter().enumerate() {
            z[(i, k)] = *x;
        }
        z[(i, n + i % n_rows)] = *value;
    }
    for mut column in z.column_iter_mut() {
        let norm = column.norm();
        if norm > 0.0 {
            column /= norm;
        }
    }
    let w = DMatrix::from_row_slice(rows, n, regressor);
    let mut normal = z.tr_mul(&z);
    for k in 0..width {
        normal[(k, k)] += PROJECTION_RIDGE;
    }
    let factors = normal.cholesky()?.solve(&z.tr_mul(&w));
    let projected = z * factors;
    Some(projected.transpose().as_slice().to_vec())
}

/// The scalar product of two columns.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}
