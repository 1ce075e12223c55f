//! Sensors that died: a reading that stands still while others move.

use serde::{Deserialize, Serialize};

/// A reading stands still for so much more of a recording than it does on sound machines.
const FROZEN_MARGIN: f64 = 0.2;

/// A sensor whose reading stood still.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SensorFault {
    /// What messages call the recording.
    pub recording: String,
    /// The coordinate or drive.
    pub of: String,
    /// Whether it is a drive's force; the forces of that drive then count in no equation.
    pub is_force: bool,
    /// For how long its reading stood still at a stretch, as a part of the recording.
    pub still: f64,
    /// From when on, s.
    pub since: f64,
}

/// How long a reading stood still.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrozenReading {
    /// The first sample of the longest stretch of equal readings.
    pub from: usize,
    /// How many samples that is.
    pub samples: usize,
}

impl FrozenReading {
    /// The longest stretch of equal readings.
    pub fn from_values(values: &[f64]) -> Self {
        let mut longest = Self {
            from: 0,
            samples: 0,
        };
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

    /// The longest stretch of equal readings, as a part of all.
    pub fn longest_share(values: &[f64]) -> f64 {
        Self::from_values(values).samples as f64 / values.len().max(1) as f64
    }
}

/// Which sensors died; `columns` are the readings of coordinates and drives, each with for how long it stands still on sound
/// machines, in order of time.
pub(crate) fn sensor_faults(
    recording: &str,
    time: &[f64],
    columns: &[(&str, bool, &[f64], f64)],
) -> Vec<SensorFault> {
    let n = time.len();
    let mut faults = Vec::new();
    for (k, (name, is_force, values, usual)) in columns.iter().enumerate() {
        let silence = FrozenReading::from_values(values);
        let still = silence.samples as f64 / n.max(1) as f64;
        if still <= usual + FROZEN_MARGIN {
            continue;
        }
        let within = silence.from..silence.from + silence.samples;
        // Where nothing moves, nothing died: the machine stands.
        let moves = columns
            .iter()
            .enumerate()
            .any(|(other, (_, is_force, values, usual))| {
                let of = &values[within.clone()];
                other != k
                    && !is_force
                    && FrozenReading::from_values(of).samples as f64 / of.len().max(1) as f64
                        <= usual + FROZEN_MARGIN
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
        let dead: Vec<f64> = (0..100)
            .map(|i| if i < 60 { moving[i] } else { 0.0 })
            .collect();
        let still = vec![1.0; 100];
        let look = |q: &[f64], f: &[f64]| {
            sensor_faults("r", &time, &[("q", false, q, 0.05), ("f", true, f, 0.05)])
        };
        assert_eq!(look(&moving, &moving), []);
        let found = look(&moving, &dead);
        assert_eq!(
            (found.len(), found[0].of.as_str(), found[0].still),
            (1, "f", 0.4)
        );
        assert!((found[0].since - 0.6).abs() < 1e-12);
        // A machine that stands has no dead sensors.
        assert_eq!(look(&still, &still), []);
        assert_eq!(FrozenReading::from_values(&[]).samples, 0);
        assert!((FrozenReading::longest_share(&[1.0, 2.0, 2.0, 3.0]) - 0.5).abs() < 1e-12);
    }
}
