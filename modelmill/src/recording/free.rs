//! Free bodies and undriven rows in recordings: quaternions whose sign may change from sample to sample, twists that
//! are recorded or computed from the pose, and forces that are zero because no drive acts.

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, Remedy};
use modelmill_identify::{PreparedRun, RecordingNote, SignalRecording as Raw, StatePreparation};
use modelmill_spec::{FrameStep, FreeBody, Mechanism, TwistAxes};

use super::thresholds::QUATERNION_LENGTH_TOLERANCE;
use crate::error::{Error, Outcome};
use crate::model::Model;

/// The free bodies of a mechanism.
pub(crate) fn free_bodies(mechanism: &Mechanism) -> impl Iterator<Item = &FreeBody> {
    let steps = mechanism.frames.iter().flat_map(|frame| &frame.steps);
    steps.filter_map(|step| match step {
        FrameStep::Free(body) => Some(body),
        _ => None,
    })
}

/// Completes a raw recording: quaternions of unit length with continuous sign, and zero forces where no drive acts
/// and no force was measured. The notes state what was added.
///
/// Fails when a quaternion is far from unit length, or when a twist is incomplete.
pub(super) fn complete(model: &Model, raw: &mut Raw) -> Outcome<Vec<RecordingNote>> {
    let mechanism = &model.derivation.mechanism;
    // Free bodies first: their poses are needed for the forces.
    for body in free_bodies(mechanism) {
        let names = body.quaternion.map(|i| mechanism.coordinates[i.0].name.as_str());
        // Missing columns are reported when states are prepared.
        if names.iter().all(|name| raw.has_column(name)) {
            normalise_quaternions(raw, names)?;
        }
        check_twist(mechanism, body, raw)?;
        fill_scalar_part(mechanism, body, raw);
    }
    let mut notes = Vec::new();
    // A row without drive needs a force, which is zero.
    let mut zero = Vec::new();
    for (row, drive) in mechanism
        .drives
        .iter()
        .enumerate()
        .filter(|(_, drive)| !drive.is_driven)
    {
        // Actuators stand in the equations in place of forces, which are not read even if they were recorded.
        if mechanism.is_servo_row(row) || mechanism.is_signal_row(row) {
            raw.set_column(&drive.name, vec![0.0; raw.samples()]);
        } else if !raw.has_column(&drive.name) && mechanism.shared_drives.is_empty() {
            raw.set_column(&drive.name, vec![0.0; raw.samples()]);
            zero.push(format!("`{}`", drive.name));
        }
    }
    // The note states the assumption of zero forces.
    if !zero.is_empty() {
        notes.push(RecordingNote::info(format!(
            "{} has no column {}: no drive acts there, and no other force, such as a contact force, is assumed.",
            raw.file(),
            zero.join(", ")
        )));
    }
    Ok(notes)
}

/// Scales quaternions to unit length, and changes the sign of those opposite to the one before.
///
/// Fails when a quaternion is far from unit length.
fn normalise_quaternions(raw: &mut Raw, names: [&str; 4]) -> Outcome {
    let mut columns: Vec<Vec<f64>> = Vec::new();
    for name in names {
        columns.push(raw.column(name)?.to_vec());
    }
    // The sign of the first sample is kept.
    let mut last = [0.0; 4];
    for sample in 0..raw.samples() {
        let here: [f64; 4] = std::array::from_fn(|k| columns[k][sample]);
        // A length far from one is a wrong column, no rounding.
        let length = here.iter().map(|x| x * x).sum::<f64>().sqrt();
        if (length - 1.0).abs() > QUATERNION_LENGTH_TOLERANCE {
            let line = raw.line(sample).unwrap_or(0);
            return Err(Error::input(message!(
                "{}: the quaternion `{}` in line {line} has the length {length:.4}, and that of a unit quaternion is 1; check \
                 which columns are its components ({})",
                raw.file(),
                names.join("`, `"),
                Remedy::option(OptionName::Columns)
            )));
        }
        // q and -q are the same orientation; the sign follows the sample before.
        let side: f64 = here.iter().zip(&last).map(|(a, b)| a * b).sum();
        let scale = if side < 0.0 { -1.0 / length } else { 1.0 / length };
        for (k, column) in columns.iter_mut().enumerate() {
            column[sample] *= scale;
            last[k] = column[sample];
        }
    }
    for (name, column) in names.into_iter().zip(columns) {
        raw.set_column(name, column);
    }
    Ok(())
}

/// Refuses a twist of which only some components are recorded, and accelerations without the velocities that they
/// change.
///
/// Fails when components are missing; the message names all of them.
fn check_twist(mechanism: &Mechanism, body: &FreeBody, raw: &Raw) -> Outcome {
    let name = |i: usize| mechanism.coordinates[i].name.as_str();
    // Velocity and angular velocity are tested separately: all three components, or none.
    for half in twist_halves(body) {
        let [rates, accelerations] = ["_d", "_dd"].map(|suffix| {
            let recorded = half
                .iter()
                .filter(|i| raw.has_column(&format!("{}{suffix}", name(**i))));
            recorded.count()
        });
        // Components are recorded together or not at all.
        let is_whole = |n: usize| n == 0 || n == 3;
        if is_whole(rates) && is_whole(accelerations) && (accelerations == 0 || rates == 3) {
            continue;
        }
        // The message names all components.
        let of = |suffix: &str| half.map(|i| format!("`{}{suffix}`", name(i))).join(", ");
        return Err(Error::input(message!(
            "{}: a free body's velocity and acceleration are recorded by all their components: expected {}, with {} or without \
             ({}), or none of them",
            raw.file(),
            of("_d"),
            of("_dd"),
            Remedy::option(OptionName::Columns)
        )));
    }
    Ok(())
}

/// Derivatives of the quaternion's scalar part where those of the other parts are recorded: the angular velocity has
/// three components, so the fourth column is not read. Without the column its derivatives would be computed by a
/// filter, which the forces would have to pass as well.
fn fill_scalar_part(mechanism: &Mechanism, body: &FreeBody, raw: &mut Raw) {
    let name = |k: usize| mechanism.coordinates[body.quaternion[k].0].name.as_str();
    for suffix in ["_d", "_dd"] {
        if raw.has_column(&format!("{}{suffix}", name(1))) {
            raw.set_column(&format!("{}{suffix}", name(0)), vec![0.0; raw.samples()]);
        }
    }
}

/// Indices of the coordinates whose rates are the velocity, and of those whose rates are the angular velocity.
fn twist_halves(body: &FreeBody) -> [[usize; 3]; 2] {
    let [_, x, y, z] = body.quaternion;
    [body.position, [x, y, z]].map(|half| half.map(|i| i.0))
}

/// The prepared runs of a recording, in which the rates of free bodies are their twist.
pub(super) fn runs(model: &Model, raw: &Raw, preparation: &StatePreparation) -> Outcome<Vec<PreparedRun>> {
    let mechanism = &model.derivation.mechanism;
    // The preparation treats the pose like any other coordinates.
    let mut runs = raw.runs_with(&model.active_coordinates(), &model.row_names(), preparation)?;
    for body in free_bodies(mechanism) {
        let [velocity, angular] = twist_halves(body).map(|half| {
            let name = &mechanism.coordinates[half[0]].name;
            raw.has_column(&format!("{name}_d"))
        });
        for run in &mut runs {
            set_twist(mechanism, body, run, [velocity, angular]);
        }
    }
    Ok(runs)
}

/// Replaces derivatives of a pose by the twist and its derivative, separately for velocity and angular velocity, unless
/// they were recorded.
fn set_twist(mechanism: &Mechanism, body: &FreeBody, run: &mut PreparedRun, recorded: [bool; 2]) {
    // States contain the independent coordinates only.
    let at = |i: usize| {
        let before = mechanism.coordinates[..i].iter();
        before.filter(|c| !c.passive).count()
    };
    let quaternion = body.quaternion.map(|i| at(i.0));
    let [position, vector] = twist_halves(body).map(|half| half.map(at));
    for sample in 0..run.time.len() {
        let of = |columns: &[Vec<f64>], i: usize| columns[i][sample];
        let q = quaternion.map(|i| of(&run.q, i));
        // The orientation converts between the axes of body and base.
        let turn = BodyRotation::new(q);
        let (mut omega, mut alpha) = (vector.map(|i| of(&run.qd, i)), vector.map(|i| of(&run.qdd, i)));
        // Angular velocity and acceleration from the quaternion.
        if !recorded[1] {
            // q' = q w / 2 in body axes, w' likewise; a change of the length of q is removed.
            let square: f64 = q.iter().map(|x| x * x).sum();
            let [first, second] = [&run.qd, &run.qdd]
                .map(|of_order| imaginary(q, quaternion.map(|i| of(of_order, i))).map(|x| 2.0 * x / square));
            let growth: f64 = quaternion.iter().zip(q).map(|(i, x)| of(&run.qd, *i) * x).sum();
            let shrink = 2.0 * growth / square;
            omega = first;
            alpha = std::array::from_fn(|k| second[k] - shrink * first[k]);
            if body.angular == TwistAxes::World {
                (omega, alpha) = (turn.to_base(omega), turn.to_base(alpha));
            }
        }
        // Velocities in body axes: the derivative in a rotating frame subtracts omega x v.
        let (mut velocity, mut acceleration) = (position.map(|i| of(&run.qd, i)), position.map(|i| of(&run.qdd, i)));
        if !recorded[0] && body.linear == TwistAxes::Body {
            let omega = match body.angular {
                TwistAxes::Body => omega,
                TwistAxes::World => turn.to_body(omega),
            };
            velocity = turn.to_body(velocity);
            let carried = cross(omega, velocity);
            let inside = turn.to_body(acceleration);
            acceleration = std::array::from_fn(|k| inside[k] - carried[k]);
        }
        // The rates of x, y, z of the quaternion are replaced by the angular velocity; that of w is
        // not used.
        for k in 0..3 {
            run.qd[vector[k]][sample] = omega[k];
            run.qdd[vector[k]][sample] = alpha[k];
            run.qd[position[k]][sample] = velocity[k];
            run.qdd[position[k]][sample] = acceleration[k];
        }
        run.qd[quaternion[0]][sample] = 0.0;
        run.qdd[quaternion[0]][sample] = 0.0;
    }
}

/// The vector part of the product of the conjugate of the first quaternion and the second, both w, x, y, z.
fn imaginary([w, x, y, z]: [f64; 4], [a, b, c, d]: [f64; 4]) -> [f64; 3] {
    [
        w * b - a * x - (y * d - z * c),
        w * c - a * y - (z * b - x * d),
        w * d - a * z - (x * c - y * b),
    ]
}

/// The cross product.
fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        a[j] * b[k] - a[k] * b[j]
    })
}

/// The rotation matrix from the body's axes to the base's, by rows.
struct BodyRotation([[f64; 3]; 3]);

impl BodyRotation {
    /// The matrix of a quaternion w, x, y, z of any length.
    fn new([w, x, y, z]: [f64; 4]) -> Self {
        let v = [x, y, z];
        let per = 2.0 / (w * w + x * x + y * y + z * z);
        // Rodrigues' formula for each axis.
        let column = |j: usize| {
            let mut axis = [0.0; 3];
            axis[j] = 1.0;
            let once = cross(v, axis);
            let twice = cross(v, once);
            std::array::from_fn::<f64, 3, _>(|i| axis[i] + per * (w * once[i] + twice[i]))
        };
        let columns = [0, 1, 2].map(column);
        Self(std::array::from_fn(|i| columns.map(|column| column[i])))
    }

    /// A vector in the axes of the base.
    fn to_base(&self, v: [f64; 3]) -> [f64; 3] {
        self.0.map(|row| (0..3).map(|k| row[k] * v[k]).sum())
    }

    /// A vector in the axes of the body.
    fn to_body(&self, v: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|k| (0..3).map(|i| self.0[i][k] * v[i]).sum())
    }
}
