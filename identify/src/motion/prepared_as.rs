//! The record of how states were prepared from a recording.

use serde::{Deserialize, Serialize};

/// How states were prepared from a recording.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct PreparationRecord {
    /// Cut-off of the low-pass, Hz, if anything was filtered.
    pub cutoff_hz: Option<f64>,
    /// Order in one direction of Butterworth's filter, if that was the low-pass.
    #[serde(skip)]
    pub butterworth_order: Option<usize>,
    /// Whether the cut-off was chosen from the signal instead of given.
    pub cutoff_chosen: bool,
    /// Highest frequency at which forces are compared in addition to the raw figures, Hz.
    #[serde(default)]
    pub band_hz: Option<f64>,
    /// Period of the Fourier series of the motion, s, if a series was used.
    #[serde(default)]
    pub period: Option<f64>,
    /// Coordinates whose rates or accelerations were prepared.
    pub coordinates: Vec<String>,
    /// Samples dropped at the start and at the end.
    pub trimmed: (usize, usize),
    /// Whether the caller requested them, instead of the filter.
    #[serde(default, rename = "trim_asked_for")]
    pub trim_requested: bool,
    /// Decimation that the regression applies to the columns of the regressor and to the forces
    /// ([`crate::decimate_table`]). The columns here are not decimated.
    pub decimate: usize,
    /// Whether the decimation was chosen instead of given.
    #[serde(default)]
    pub decimate_chosen: bool,
}
