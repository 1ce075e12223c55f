//! What was done to a recording on its way to states.

use serde::{Deserialize, Serialize};

/// What was done on the way from the recording to the states.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct PreparationRecord {
    /// Cut-off of the low-pass, Hz, when anything was filtered.
    pub cutoff_hz: Option<f64>,
    /// Whether the cut-off was chosen from the signal rather than given.
    pub cutoff_chosen: bool,
    /// Up to which frequency forces are compared beside the raw figures, Hz.
    #[serde(default)]
    pub band_hz: Option<f64>,
    /// Period of the Fourier series that the motion was taken for, s, if it was.
    #[serde(default)]
    pub period: Option<f64>,
    /// Coordinates whose rates or accelerations were prepared.
    pub coordinates: Vec<String>,
    /// Samples dropped at the start and at the end.
    pub trimmed: (usize, usize),
    /// Whether the caller asked for those, rather than the filter.
    #[serde(default)]
    pub trim_asked_for: bool,
    /// The parallel decimation that the regression is to apply to the columns of the regressor
    /// and to the forces ([`crate::decimate_table`]); the columns here are not decimated.
    pub decimate: usize,
    /// Whether the decimation was chosen rather than asked for.
    #[serde(default)]
    pub decimate_chosen: bool,
}
