//! Full turns between the command and the position of an angle.
//!
//! Commands and positions go in, both without jumps; out comes the constant number of turns between them. A command of
//! 350 degrees and a position of -10 degrees are the same pose. An error beyond half a turn for a part of the time is
//! real: servos with a gear turn several times.

use modelmill_spec::ModelActuator;

/// The angle that is to be added to the command of an actuator, rad: full turns, so that its usual error is below half a
/// turn. Zero for signals that are no angles.
pub(super) fn turn_offset(actuator: &ModelActuator, signal: &[f64], position: &[f64]) -> f64 {
    if !actuator.has_position_error() || !actuator.motion.is_angle() {
        return 0.0;
    }
    let mut errors: Vec<f64> = signal.iter().zip(position).map(|(a, b)| a - b).collect();
    errors.retain(|error| error.is_finite());
    if errors.iter().all(|error| error.abs() < std::f64::consts::PI) {
        return 0.0;
    }
    errors.sort_by(f64::total_cmp);
    let usual = errors.get(errors.len() / 2).copied().unwrap_or(0.0);
    -std::f64::consts::TAU * (usual / std::f64::consts::TAU).round()
}

/// A sentence on turns that were added to the command of an actuator, rad; `None` if there are none.
pub(super) fn turn_sentence(actuator: &ModelActuator, turns: f64) -> Option<String> {
    let count = (turns / std::f64::consts::TAU).round();
    (count != 0.0).then(|| {
        format!(
            "full turns ({count}) were added to `{}`, so that the usual position error of the servo is below half a turn; \
             correct the command if a larger error is real",
            actuator.signal
        )
    })
}

#[cfg(test)]
mod tests {
    use super::turn_offset;
    use crate::model::Model;

    const SERVO: &str = r#"
schema = 1
name = "servo"
[parameters]
J = { unit = "kg m^2" }
[coordinates]
q = { nominal = 0 }
[[frame]]
name = "rotor"
on = "base"
joint = { revolute = "q", axis = "z" }
[[part]]
on = "rotor"
linear = { ZZ = "J" }
[[drive]]
name = "motor"
joint = "q"
[[actuator]]
drive = "motor"
kind = "position_servo"
kp = 5
"#;

    #[test]
    fn only_the_usual_error_is_moved_by_full_turns() {
        let model = Model::from_text("servo.toml", SERVO).unwrap();
        let actuator = &model.actuators()[0];
        // Errors of up to 5 rad, such as after a step of several turns of a gear, are real.
        let position = vec![0.0; 5];
        assert!(turn_offset(actuator, &[0.1, 0.2, 5.0, 4.0, -0.1], &position).abs() < 1e-12);
        let turn = std::f64::consts::TAU;
        let moved = [turn + 0.1, turn - 0.2, turn + 5.0, turn, turn];
        assert!((turn_offset(actuator, &moved, &position) + turn).abs() < 1e-12);
    }
}
