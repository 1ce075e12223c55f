//! How states are prepared from a recording.

use serde::{Deserialize, Serialize};

/// Where derivatives come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DerivativeSource {
    /// Recorded derivative columns are taken as they are; only missing ones are prepared.
    #[default]
    RecordedFirst,
    /// Every derivative is prepared from the positions, whatever the file holds.
    Positions,
}

/// How positions become smooth positions, rates and accelerations.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SmoothingMethod {
    /// A Fourier series where the run is periodic and the series leaves nothing but noise, or less of the forces on held-out
    /// time, unless a cut-off is given; Butterworth's low-pass otherwise.
    #[default]
    Automatic,
    /// Butterworth's low-pass run both ways, then central differences: the field's standard.
    Butterworth,
    /// Local polynomials (Savitzky-Golay) of the width that suits the cut-off.
    SavitzkyGolay,
    /// A Fourier series up to the cut-off; the period, s, is found from the positions when absent.
    Fourier {
        /// The period, s.
        period: Option<f64>,
    },
}

/// How states are prepared from a recording. [`StatePreparation::default`] suits a file of positions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct StatePreparation {
    /// Cut-off of the low-pass on the positions, Hz; chosen from the signal when absent.
    pub cutoff_hz: Option<f64>,
    /// Order of the Butterworth filter in one direction.
    pub order: usize,
    /// Samples dropped at the start and at the end; when absent, three periods of the
    /// cut-off at both ends if anything was filtered (the transient falls tenfold in each, and
    /// reaches 0.1 % of the acceleration), at most a sixth of the recording; none otherwise.
    pub trim: Option<(usize, usize)>,
    /// Every how many samples one is kept, after the parallel filter on all columns of the
    /// regressor and on the force; 1 keeps all.
    pub decimate: usize,
    /// Which derivatives are prepared.
    pub source: DerivativeSource,
    /// How they are prepared.
    pub smoothing: SmoothingMethod,
    /// Up to which frequency forces are compared beside the raw figures, Hz; the cut-off, or what the motion reaches, when
    /// absent.
    pub band_hz: Option<f64>,
    /// Whether cut-off, smoothing and decimation were chosen by what they leave of the forces rather than asked for.
    #[serde(skip)]
    pub chosen: bool,
    /// Whether states are prepared without a look at whether the motion repeats itself: for thousands of recordings that are
    /// prepared alike.
    #[serde(skip)]
    pub unexamined: bool,
}

impl Default for StatePreparation {
    fn default() -> Self {
        Self {
            cutoff_hz: None,
            order: 4,
            trim: None,
            decimate: 1,
            source: DerivativeSource::RecordedFirst,
            smoothing: SmoothingMethod::Automatic,
            band_hz: None,
            chosen: false,
            unexamined: false,
        }
    }
}

impl StatePreparation {
    /// The recipe of the EMPS reference: order 4 at 100 Hz, the first 49 samples dropped,
    /// decimation by 10. As many are dropped at the end, where differences are one-sided: with
    /// one or two bad accelerations left there the error rises from 4.04 to 4.3 %, while any
    /// number from 5 on gives the same.
    pub fn emps() -> Self {
        Self {
            cutoff_hz: Some(100.0),
            trim: Some((49, 49)),
            decimate: 10,
            source: DerivativeSource::Positions,
            ..Self::default()
        }
    }
}
