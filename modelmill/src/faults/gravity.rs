//! Direction of gravity: a machine that is mounted on its side, upside down, or with another base frame than that of
//! the model file.
//!
//! With nominal masses the forces are linear in the three components of gravity, which are a least squares problem with
//! friction and an offset of every drive. The model is derived again with the direction that was found.

use modelmill_boundary::message;
use modelmill_boundary::text::Remedy;
use modelmill_codegen::ModelEvaluator;
use modelmill_identify::ScaledNormalEquations;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::bench::{FaultBench, HypothesisErrors, RIDGE};
use super::correction::{FaultCorrection, ForceChange, MotionChange};
use super::thresholds::{
    GRAVITY_AXIS_TOLERANCE_RAD, GRAVITY_FEWEST_DRIVES, GRAVITY_LEAST_ANGLE_RAD, GRAVITY_LEAST_GAIN_OF_DRIVE,
    GRAVITY_LEAST_NOMINAL_ERROR, GRAVITY_MOST_NOMINAL_ERROR, GRAVITY_MOST_UNCERTAINTY, GRAVITY_SIZE_TOLERANCE,
};
use super::{FaultSubject, RecordingFaultKind, SuspectedFault, judge};
use crate::model::Model;
use crate::text::table::significant;

/// Columns of friction and offset of a drive: rate, its sign, and a constant.
const FRICTION: usize = 3;
/// Times the drives are weighted by their residuals.
const ROUNDS: usize = 3;
/// Successive samples that are taken as one independent value.
const CORRELATED: f64 = 10.0;
/// Names of the axes of the base.
const AXES: [&str; 3] = ["x", "y", "z"];

/// A direction of gravity that explains a recording.
pub(super) struct GravityFinding {
    /// The fault.
    pub(super) fault: SuspectedFault,
    /// Sum of the logarithms by which fitted errors and errors with nominal values fall.
    pub(super) score: f64,
}

/// The direction of gravity of a recording, if it clearly differs from that of the model; `None` otherwise, and if it
/// cannot be determined.
pub(super) fn find_direction(
    subject: &FaultSubject<'_>,
    bench: &FaultBench<'_>,
    before: &HypothesisErrors,
) -> Option<GravityFinding> {
    let model = subject.model;
    let nominal = bench.nominal()?;
    let given = Vector3::from(model.gravity());
    // Drives with a vertical axis carry no weight, so the mean of all would hide the others.
    let poor = before.nominal.iter().flatten().flatten();
    let is_poor = poor.filter(|error| **error > GRAVITY_LEAST_NOMINAL_ERROR).count() >= GRAVITY_FEWEST_DRIVES;
    // The pose of a free body contains the direction already.
    let has_free_bodies = model.joint_coordinates().len() < model.active_coordinates().len();
    if !is_poor || has_free_bodies || given.norm() == 0.0 {
        return None;
    }
    // A motion about one pose cannot separate gravity from offsets of the drives; then only the opposite direction is
    // tried, which the errors below accept or reject.
    let solved = GravityRows::new(model, bench, nominal, given)?.solve(given.norm());
    let found = solved.unwrap_or(-given);
    let is_sized = (found.norm() / given.norm() - 1.0).abs() < GRAVITY_SIZE_TOLERANCE;
    if !is_sized || found.angle(&given) < GRAVITY_LEAST_ANGLE_RAD {
        return None;
    }
    let direction = nearest_axis(found.normalize());
    let gravity: [f64; 3] = (given.norm() * direction).into();
    // The complete model decides, since another direction may have other base parameters.
    let corrected = model.with_gravity(gravity).ok()?;
    let other = bench.with_model(&corrected);
    let errors = other.errors(&other.rows(&MotionChange::None)?, &ForceChange::default());
    let [fit_gain, nominal_gain] = [errors.fit_gain(before), errors.nominal_gain(before)];
    let is_explained = errors
        .mean_nominal()
        .is_some_and(|error| error < GRAVITY_MOST_NOMINAL_ERROR);
    if nominal_gain < GRAVITY_LEAST_GAIN_OF_DRIVE * bench.forces().len() as f64 || !is_explained {
        return None;
    }
    let digits = gravity.map(|g| significant(g, 4)).join(", ");
    Some(GravityFinding {
        fault: SuspectedFault {
            kind: RecordingFaultKind::GravityDirection,
            at: vec!["base".to_owned()],
            recordings: vec![subject.raw.file().to_owned()],
            clause: format!(
                "gravity points along {} of the base and not along {} as in the model file",
                direction_text(direction),
                direction_text(given.normalize())
            ),
            advice: message!(
                "check how the machine is mounted, and set {} to [{digits}]",
                Remedy::edit("gravity")
            ),
            evidence: judge::evidence_text(before, &errors, true),
            fit_gain,
            correction: Some(FaultCorrection::Gravity(gravity)),
        },
        score: fit_gain + nominal_gain,
    })
}

/// The axis of the base that a direction is near to, or the direction itself.
fn nearest_axis(direction: Vector3<f64>) -> Vector3<f64> {
    let mut axis = Vector3::zeros();
    axis[direction.iamax()] = direction[direction.iamax()].signum();
    if axis.angle(&direction) < GRAVITY_AXIS_TOLERANCE_RAD {
        axis
    } else {
        direction
    }
}

/// A direction as an axis, `-z`, or as three components.
fn direction_text(direction: Vector3<f64>) -> String {
    let place = direction.iamax();
    if (direction[place].abs() - 1.0).abs() < 1e-6 {
        let sign = if direction[place] < 0.0 { "-" } else { "" };
        return format!("{sign}{}", AXES[place]);
    }
    let components: Vec<String> = direction.iter().map(|x| format!("{x:.2}")).collect();
    format!("({})", components.join(", "))
}

/// Forces of gravity along each axis of the base, and the measured forces without the rest of the model.
struct GravityRows {
    /// Columns by drive: forces for 1 m/s^2 along each of `axes`, then friction and offset. Columns of axes along which
    /// gravity has no effect are zero.
    columns: Vec<DMatrix<f64>>,
    /// Three orthogonal axes in the base frame, one per column: those along which gravity has no effect are among them.
    axes: Matrix3<f64>,
    /// Gravity in the model file along each of these axes, m/s^2.
    given: Vector3<f64>,
    /// Measured forces minus those of motion with nominal values, by drive.
    measured: Vec<DVector<f64>>,
}

impl GravityRows {
    /// The rows; `None` if a pose has no solution or a derivation fails.
    fn new(model: &Model, bench: &FaultBench<'_>, nominal: &[f64], given: Vector3<f64>) -> Option<Self> {
        let n = bench.forces().len();
        let coordinates = model.active_coordinates().len();
        let standstill = MotionChange::Scale((0..coordinates).map(|i| (i, [1.0, 0.0, 0.0])).collect());
        let forces = |model: &Model, change: &MotionChange, values: &[f64]| {
            bench.with_states(change, |states| {
                ModelEvaluator::new(&model.derivation)
                    .inverse_dynamics(states, values)
                    .ok()
            })
        };
        let moving = forces(model, &MotionChange::None, nominal)?;
        let standing = forces(model, &standstill, nominal)?;
        // Against the direction of the file, so that forces other than gravity can be separated.
        let size = given.norm();
        let signs = given.map(|g| if g > 0.0 { -1.0 } else { 1.0 });
        let mut along = Vec::new();
        for axis in 0..3 {
            let mut gravity = [0.0; 3];
            gravity[axis] = signs[axis] * size;
            let turned = model.with_gravity(gravity).ok()?;
            along.push(forces(&turned, &standstill, &turned.values)?);
        }
        // Shares of the file's gravity in the three directions; their sum is at most -1.
        let shares = Vector3::from_fn(|k, _| given[k] * signs[k] / size);
        let drives = bench.with_states(&MotionChange::None, |states| {
            ModelEvaluator::new(&model.derivation).drive_motion(states).ok()
        })?;
        let samples = bench.samples();
        let (mut columns, mut measured) = (Vec::new(), Vec::new());
        for d in 0..n {
            let mut of_drive = DMatrix::zeros(samples, 3 + FRICTION);
            let mut left = DVector::zeros(samples);
            for i in 0..samples {
                let sum: f64 = (0..3).map(|k| shares[k] * along[k][d][i]).sum();
                // Springs and offsets act at standstill too.
                let other = (standing[d][i] - sum) / (1.0 - shares.sum());
                for k in 0..3 {
                    of_drive[(i, k)] = signs[k] * (along[k][d][i] - other) / size;
                }
                let rate = drives[n + d][i];
                of_drive[(i, 3)] = rate;
                of_drive[(i, 4)] = if rate == 0.0 { 0.0 } else { rate.signum() };
                of_drive[(i, 5)] = 1.0;
                left[i] = bench.forces()[d][i] - (moving[d][i] - standing[d][i]) - other;
            }
            columns.push(of_drive);
            measured.push(left);
        }
        let axes = independent_axes(&mut columns);
        Some(Self {
            columns,
            axes,
            given: axes.tr_mul(&given),
            measured,
        })
    }

    /// The vector of gravity in the base frame, m/s^2; `None` if a component is uncertain relative to `size`. A component
    /// without effect, such as that normal to the plane of a planar arm, is that of the model file.
    fn solve(&self, size: f64) -> Option<Vector3<f64>> {
        let n = self.columns.len();
        let width = 3 + FRICTION * n;
        let place = |d: usize, k: usize| if k < 3 { k } else { k + FRICTION * d };
        let mut weights: Vec<f64> = self.measured.iter().map(weight_of).collect();
        let mut values = DVector::zeros(width);
        let mut last = None;
        for _ in 0..ROUNDS {
            let mut normal = DMatrix::zeros(width, width);
            let mut right = DVector::zeros(width);
            for (d, columns) in self.columns.iter().enumerate() {
                let own = columns.tr_mul(columns);
                let own_right = columns.tr_mul(&self.measured[d]);
                for j in 0..own.ncols() {
                    right[place(d, j)] += weights[d] * own_right[j];
                    for i in 0..own.nrows() {
                        normal[(place(d, i), place(d, j))] += weights[d] * own[(i, j)];
                    }
                }
            }
            let solver = ScaledNormalEquations::new(normal, RIDGE)?;
            values = solver.solve(&right);
            last = Some(solver);
            for (d, columns) in self.columns.iter().enumerate() {
                let own = DVector::from_fn(columns.ncols(), |k, _| values[place(d, k)]);
                weights[d] = weight_of(&(&self.measured[d] - columns * own));
            }
        }
        let solver = last?;
        // Weights are inverse variances, but neighbouring samples are not independent.
        let is_certain = (0..3).all(|k| {
            let mut unit = DVector::zeros(width);
            unit[k] = 1.0;
            let variance = solver.solve(&unit)[k];
            (CORRELATED * variance.max(0.0)).sqrt() < GRAVITY_MOST_UNCERTAINTY * size
        });
        let has_effect = |k: usize| self.columns.iter().any(|of| of.column(k).amax() > 0.0);
        let along = Vector3::from_fn(|k, _| if has_effect(k) { values[k] } else { self.given[k] });
        is_certain.then(|| self.axes * along)
    }
}

/// Replaces the first three columns of each drive, which belong to the axes of the base, by those of orthogonal axes that
/// have independent effects, and returns these axes. Columns that only rounding fills become zero.
fn independent_axes(columns: &mut [DMatrix<f64>]) -> Matrix3<f64> {
    /// Squared size of a column relative to the largest, up to which it is rounding.
    const ROUNDING: f64 = 1e-20;
    let gram = |of: &DMatrix<f64>| {
        of.columns(0, 3)
            .tr_mul(&of.columns(0, 3))
            .fixed_view::<3, 3>(0, 0)
            .into_owned()
    };
    let axes = columns
        .iter()
        .map(gram)
        .sum::<Matrix3<f64>>()
        .symmetric_eigen()
        .eigenvectors;
    let mut squares = Vector3::zeros();
    for of in &mut *columns {
        let turned = of.columns(0, 3) * axes;
        squares += Vector3::from_fn(|k, _| turned.column(k).norm_squared());
        of.columns_mut(0, 3).copy_from(&turned);
    }
    for k in (0..3).filter(|k| squares[*k] <= ROUNDING * squares.max()) {
        for of in &mut *columns {
            of.column_mut(k).fill(0.0);
        }
    }
    axes
}

/// The inverse of the mean square; 0 for a force of zero.
fn weight_of(force: &DVector<f64>) -> f64 {
    let square = force.norm_squared() / force.len().max(1) as f64;
    if square > 0.0 { square.recip() } else { 0.0 }
}
