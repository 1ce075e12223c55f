//! Dead bands of force readings: a drive whose reading is exactly zero for most of the time, again and again. A run goes
//! in; the drives with a dead band come out.

use super::thresholds::{DEAD_BAND_FEWEST_INTERVALS, DEAD_BAND_LEAST_SHARE, DEAD_BAND_LONGEST_SHARE};
use crate::motion::PreparedRun;

/// A force reading with a dead band.
#[derive(Clone, Debug, PartialEq)]
pub struct DeadBand {
    /// Index of the drive.
    pub drive: usize,
    /// Share of the samples that read exactly zero (1).
    pub share: f64,
    /// Smallest reading besides zero, N or N m.
    pub least: f64,
}

impl PreparedRun {
    /// Drives whose readings have a dead band. One long interval of zeros is none, but a reading that fails.
    pub fn dead_bands(&self) -> Vec<DeadBand> {
        let forces = self.force.iter().flatten().enumerate();
        forces.filter_map(|(drive, force)| dead_band(drive, force)).collect()
    }
}

/// The dead band of one force; `None` without one.
fn dead_band(drive: usize, force: &[f64]) -> Option<DeadBand> {
    let least = force.iter().map(|f| f.abs()).filter(|f| *f > 0.0).reduce(f64::min)?;
    let (mut zeros, mut intervals, mut longest, mut length) = (0_usize, 0_usize, 0_usize, 0_usize);
    for value in force {
        if *value != 0.0 {
            length = 0;
            continue;
        }
        zeros += 1;
        intervals += usize::from(length == 0);
        length += 1;
        longest = longest.max(length);
    }
    let share = zeros as f64 / force.len() as f64;
    let is_dead = share >= DEAD_BAND_LEAST_SHARE
        && intervals >= DEAD_BAND_FEWEST_INTERVALS
        && (longest as f64) < DEAD_BAND_LONGEST_SHARE * zeros as f64;
    is_dead.then_some(DeadBand { drive, share, least })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dead_band_is_neither_a_failed_reading_nor_a_small_force() {
        let force = |threshold: f64| -> Vec<f64> {
            let values = (0..3000).map(|i| (0.05 * f64::from(i)).sin());
            values.map(|f| if f.abs() < threshold { 0.0 } else { f }).collect()
        };
        let found = dead_band(2, &force(0.9)).expect("a dead band");
        assert!((found.share - 0.71).abs() < 0.02 && found.least >= 0.9, "{found:?}");
        assert_eq!(dead_band(0, &force(0.3)), None);
        let mut fails = force(0.0);
        fails[1200..].fill(0.0);
        assert_eq!(dead_band(0, &fails), None);
        assert_eq!(dead_band(0, &[0.0; 100]), None);
    }
}
