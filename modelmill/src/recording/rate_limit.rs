//! Commands as servos with a limited rate follow them. A recording goes in; its commands are replaced by those that the servo
//! reaches.
//!
//! Decision: the limit acts on the samples as recorded, before any low-pass. A low-pass rounds the corners of a limited
//! command, but a limit would not make these corners out of a filtered one. Full turns are added before: a jump from pi to
//! -pi is no motion.

use modelmill_identify::{RecordingNote, SignalRecording as Raw};
use modelmill_spec::{Mechanism, ModelActuator};

/// Replaces the commands of actuators with a `rate_limit`, and returns a note for each command that exceeds its limit.
/// Commands of drives with a measured force are not used, and commands that cannot be read are reported where they are used.
pub(super) fn limit_commands(mechanism: &Mechanism, raw: &mut Raw) -> Vec<RecordingNote> {
    let mut notes = Vec::new();
    for actuator in &mechanism.actuators {
        let Some(limit) = actuator
            .rate_limit
            .filter(|_| is_command_used(mechanism, actuator, raw))
        else {
            continue;
        };
        if actuator.has_position_error() {
            raw.unwrap_angles(&[(actuator.signal.clone(), actuator.motion.is_angle())]);
        }
        let (Ok(time), Ok(command)) = (raw.column("t"), raw.column(&actuator.signal)) else {
            continue;
        };
        let (reached, command) = (limit_rate(time, command, limit), command.to_vec());
        let n_limited = command
            .iter()
            .zip(&reached)
            .filter(|(a, b)| a.to_bits() != b.to_bits())
            .count();
        if n_limited > 0 {
            notes.push(RecordingNote::info(format!(
                "`{}` in {} exceeds the `rate_limit` of its actuator; at {n_limited} of {} samples it is replaced by the command \
                 that the servo has reached.",
                actuator.signal,
                raw.file(),
                command.len()
            )));
            raw.set_column(&actuator.signal, reached);
        }
    }
    notes
}

/// Whether the force of a drive is computed from the command of an actuator.
fn is_command_used(mechanism: &Mechanism, actuator: &ModelActuator, raw: &Raw) -> bool {
    let is_measured = mechanism.servo_forces.is_empty() && raw.has_column(&mechanism.drives[actuator.drive.0].name);
    raw.has_column(&actuator.signal) && !is_measured
}

/// The values that follow `command` with at most `limit` per second.
fn limit_rate(time: &[f64], command: &[f64], limit: f64) -> Vec<f64> {
    let mut reached: Vec<f64> = Vec::with_capacity(command.len());
    for (k, wanted) in command.iter().enumerate() {
        let next = match k.checked_sub(1) {
            Some(last) => {
                let largest = limit * (time[k] - time[last]).max(0.0);
                let step = wanted - reached[last];
                // A step within the limit ends exactly at the command.
                if step.abs() <= largest {
                    *wanted
                } else {
                    reached[last] + largest.copysign(step)
                }
            }
            None => *wanted,
        };
        reached.push(next);
    }
    reached
}

#[cfg(test)]
mod tests {
    use super::limit_rate;
    use crate::model::Model;
    use crate::recording::RecordingOptions;

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
rate_limit = 3
"#;

    /// The command of a recording after it was read, and the notes on it.
    fn read_command(columns: &[(&str, Vec<f64>)]) -> (Vec<f64>, usize) {
        let model = Model::from_text("servo.toml", SERVO).unwrap();
        let columns = columns
            .iter()
            .map(|(name, values)| ((*name).to_owned(), values.clone()));
        let read = model.read_recording_of_table("log", columns.collect(), &RecordingOptions::default());
        let read = read.unwrap();
        let n_notes = read
            .raw()
            .notes()
            .iter()
            .filter(|note| note.says.in_library_words().contains("rate_limit"))
            .count();
        (read.raw().column("motor_command").unwrap().to_vec(), n_notes)
    }

    /// A wrapped command is limited as the same command without jumps, and one that no force is computed from is not.
    #[test]
    fn jumps_of_full_turns_are_no_motion_and_measured_forces_need_no_command() {
        let time: Vec<f64> = (0..400).map(|k| 0.01 * f64::from(k)).collect();
        let angle: Vec<f64> = time
            .iter()
            .map(|t| 2.0 * t + if *t > 2.0 { 0.5 } else { 0.0 })
            .collect();
        let turn = std::f64::consts::TAU;
        let wrapped: Vec<f64> = angle.iter().map(|q| q - turn * (q / turn).round()).collect();
        let columns = |command: &[f64]| {
            [
                ("t", time.clone()),
                ("q", angle.clone()),
                ("motor_command", command.to_vec()),
            ]
        };
        let (plain, n) = read_command(&columns(&angle));
        assert_eq!(n, 1);
        let (unwrapped, n) = read_command(&columns(&wrapped));
        assert_eq!(n, 1);
        for (a, b) in plain.iter().zip(&unwrapped) {
            assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
        let mut measured = columns(&angle).to_vec();
        measured.push(("motor", vec![0.1; 400]));
        assert_eq!(read_command(&measured).1, 0);
    }

    #[test]
    fn a_step_becomes_a_ramp_that_ends_at_the_command() {
        let time = [0.0, 0.1, 0.2, 0.3, 0.5, 0.6];
        let reached = limit_rate(&time, &[0.0, 1.0, 1.0, 1.0, 1.0, 0.9], 2.0);
        for (value, expected) in reached.iter().zip([0.0, 0.2, 0.4, 0.6, 1.0, 0.9]) {
            assert!((value - expected).abs() < 1e-12, "{reached:?}");
        }
        // A command within the limit is unchanged, to the last bit.
        let slow = [0.1, 0.15, 0.2, 0.2, 0.3, 0.35];
        assert_eq!(limit_rate(&time, &slow, 2.0), slow);
    }
}
