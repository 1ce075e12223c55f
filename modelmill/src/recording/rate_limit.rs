//! Commands as servos with a limited rate follow them. A recording goes in; its commands are replaced by those that the servo
//! reaches.
//!
//! Decision: the limit acts on the samples as recorded, before any low-pass. A low-pass rounds the corners of a limited
//! command, but a limit would not make these corners out of a filtered one.

use modelmill_identify::{RecordingNote, SignalRecording as Raw};
use modelmill_spec::Mechanism;

use crate::error::Outcome;

/// Replaces the commands of actuators with a `rate_limit`, and returns a note for each command that exceeds its limit.
///
/// Fails when the recording has no time.
pub(super) fn limit_commands(mechanism: &Mechanism, raw: &mut Raw) -> Outcome<Vec<RecordingNote>> {
    let mut notes = Vec::new();
    for actuator in &mechanism.actuators {
        let Some(limit) = actuator.rate_limit.filter(|_| raw.has_column(&actuator.signal)) else {
            continue;
        };
        let command = raw.column(&actuator.signal)?.to_vec();
        let reached = limit_rate(raw.column("t")?, &command, limit);
        let n_limited = command
            .iter()
            .zip(&reached)
            .filter(|(a, b)| a.to_bits() != b.to_bits())
            .count();
        if n_limited > 0 {
            notes.push(RecordingNote::info(format!(
                "`{}` exceeds the `rate_limit` of its actuator; at {n_limited} of {} samples it is replaced by the command that the \
                 servo has reached.",
                actuator.signal,
                command.len()
            )));
            raw.set_column(&actuator.signal, reached);
        }
    }
    Ok(notes)
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
