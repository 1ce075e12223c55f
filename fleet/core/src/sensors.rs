//! Detects dead sensors: readings of a recording go in, sensors with a constant reading while others change come out.

use serde::{Deserialize, Serialize};

/// Share of a recording by which the constant interval of a dead sensor exceeds that of the reference recordings.
const FROZEN_MARGIN: f64 = 0.2;

/// A sensor with a constant reading.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SensorFault {
    /// Name of the recording.
    pub recording: String,
    /// The coordinate or drive.
    pub of: String,
    /// Whether it is a drive's force; that drive is then left out of all equations of the recording.
    pub is_force: bool,
    /// Longest interval with a constant reading, as a share of the recording.
    pub still: f64,
    /// Start of this interval, s.
    pub since: f64,
}

/// The longest interval with a constant reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrozenReading {
    /// Index of its first sample.
    pub from: usize,
    /// Number of its samples.
    pub samples: usize,
}

impl FrozenReading {
    /// The longest interval of equal values.
    pub fn from_values(values: &[f64]) -> Self {
        let mut longest = Self { from: 0, samples: 0 };
        let mut from = 0;
        for at in 0..=values.len() {
            let ends = at == values.len() || values[at].to_bits() != values[from].to_bits();
            if ends {
                if at - from > longest.samples {
                    longest = Self {
                        from,
                        samples: at - from,
                    };
                }
                from = at;
            }
        }
        longest
    }

    /// The longest interval of equal values, as a share of all values.
    pub fn longest_share(values: &[f64]) -> f64 {
        Self::from_values(values).samples as f64 / values.len().max(1) as f64
    }
}

/// The dead sensors of a recording. `columns` are the coordinates and drives: name, whether it is a force, the values
/// in order of time, and the share of a reference recording with a constant reading.
pub(crate) fn sensor_faults(recording: &str, time: &[f64], columns: &[(&str, bool, &[f64], f64)]) -> Vec<SensorFault> {
    let n = time.len();
    let mut faults = Vec::new();
    for (k, (name, is_force, values, usual)) in columns.iter().enumerate() {
        let silence = FrozenReading::from_values(values);
        let still = silence.samples as f64 / n.max(1) as f64;
        if still <= usual + FROZEN_MARGIN {
            continue;
        }
        let within = silence.from..silence.from + silence.samples;
        // If no coordinate moves in this interval, the machine is at standstill and the sensor is not dead.
        let moves = columns.iter().enumerate().any(|(other, (_, is_force, values, usual))| {
            let of = &values[within.clone()];
            other != k
                && !is_force
                && FrozenReading::from_values(of).samples as f64 / of.len().max(1) as f64 <= usual + FROZEN_MARGIN
        });
        if moves {
            faults.push(SensorFault {
                recording: recording.to_owned(),
                of: (*name).to_owned(),
                is_force: *is_force,
                still,
                since: time.get(silence.from).copied().unwrap_or(0.0),
            });
        }
    }
    faults
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reading_that_stands_still_while_others_move_is_a_fault() {
        let time: Vec<f64> = (0..100).map(|i| 0.01 * f64::from(i)).collect();
        let moving: Vec<f64> = time.iter().map(|t| (7.0 * t).sin()).collect();
        let dead: Vec<f64> = (0..100).map(|i| if i < 60 { moving[i] } else { 0.0 }).collect();
        let still = vec![1.0; 100];
        let look = |q: &[f64], f: &[f64]| sensor_faults("r", &time, &[("q", false, q, 0.05), ("f", true, f, 0.05)]);
        assert_eq!(look(&moving, &moving), []);
        let found = look(&moving, &dead);
        assert_eq!((found.len(), found[0].of.as_str(), found[0].still), (1, "f", 0.4));
        assert!((found[0].since - 0.6).abs() < 1e-12);
        // A machine that stands has no dead sensors.
        assert_eq!(look(&still, &still), []);
        assert_eq!(FrozenReading::from_values(&[]).samples, 0);
        assert!((FrozenReading::longest_share(&[1.0, 2.0, 2.0, 3.0]) - 0.5).abs() < 1e-12);
    }
}
