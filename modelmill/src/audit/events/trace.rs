//! The residual of a fit along one run, with the motion of its drives: what events are found in.

use modelmill_identify::float_to_count;

/// The residual of a fit along one run, with the motion of its drives.
#[derive(Clone, Debug)]
pub(crate) struct ResidualTrace {
    /// Times of the samples, s.
    pub(crate) time: Vec<f64>,
    /// Positions, rates and accelerations of the drives, `[order][drive][sample]`; rates and accelerations are 0 at
    /// standstill.
    pub(crate) motion: [Vec<Vec<f64>>; 3],
    /// Measured forces, `[drive][sample]`, N or N m.
    pub(crate) measured: Vec<Vec<f64>>,
    /// Measured minus fitted forces, `[drive][sample]`, N or N m.
    pub(crate) residual: Vec<Vec<f64>>,
    /// Whether each force was measured and used, `[drive][sample]`.
    pub(crate) is_measured: Vec<Vec<bool>>,
    /// Rate below which a drive stands still whatever its maximum rate, rad/s or m/s.
    pub(crate) slowest: Vec<f64>,
    /// Time over which smoothing spreads a switch of friction, s.
    pub(crate) smear: f64,
}

impl ResidualTrace {
    /// Number of samples.
    pub(super) fn samples(&self) -> usize {
        self.time.len()
    }

    /// Number of drives.
    pub(super) fn drives(&self) -> usize {
        self.measured.len()
    }

    /// Samples per second.
    pub(super) fn sample_rate(&self) -> f64 {
        let n = self.time.len();
        (n - 1) as f64 / (self.time[n - 1] - self.time[0])
    }

    /// The number of samples in a time, at least `fewest`.
    pub(super) fn sample_count(&self, seconds: f64, fewest: usize) -> usize {
        float_to_count(seconds * self.sample_rate()).max(fewest)
    }

    /// Root mean square of the measured force of a drive, N or N m.
    pub(super) fn force_rms(&self, drive: usize) -> f64 {
        let force = &self.measured[drive];
        (force.iter().map(|f| f * f).sum::<f64>() / force.len().max(1) as f64).sqrt()
    }

    /// The fitted force of a drive, N or N m.
    pub(super) fn fitted_force(&self, drive: usize) -> Vec<f64> {
        let pairs = self.measured[drive].iter().zip(&self.residual[drive]);
        pairs.map(|(measured, rest)| measured - rest).collect()
    }
}
