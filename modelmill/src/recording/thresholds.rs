//! Thresholds of reading and preparing recordings: the numbers that decide which recordings are refused, which force
//! peaks are outliers, and which smoothing is chosen. Each states what it bounds, its unit, and how it was chosen.
//! Numbers that only set an accuracy or a grid stay where they are used.

/// Largest difference of the length of a recorded quaternion from 1 (1). A larger one is not rounding, but another
/// column. By judgement.
pub(super) const QUATERNION_LENGTH_TOLERANCE: f64 = 0.02;

/// The mechanism itself causes a force peak, which is no outlier, where a drive needs more than this many times the
/// force that it needs at the samples around (1). By judgement.
pub(super) const LEVERAGE_PEAK_RATIO: f64 = 3.0;

/// Samples of a window of a recording; with fewer no smoothing is chosen. By judgement.
pub(super) const WINDOW_FEWEST_SAMPLES: usize = 40;

/// Rows for each column of the regressor; with fewer no smoothing is chosen. By judgement.
pub(super) const SMOOTHING_ROWS_PER_COLUMN: usize = 3;

/// A smoothing or decimation must lower the error by more than this share (1) to be preferred to one that smooths or
/// decimates more, and a Fourier series to be preferred to a low-pass. By judgement.
pub(super) const SMOOTHING_LEAST_GAIN: f64 = 0.005;

/// Residuals that differ by less than this share (1) are called equal in the note on the choice. By judgement.
pub(super) const SAME_RESIDUAL_TOLERANCE: f64 = 1e-3;

// --- Delays and wrong columns

/// Exchanged columns and wrong signs are not suspected if a delay lowers the errors by at least this share of the sum of
/// logarithms by which the correction of the columns does (1). By judgement.
pub(super) const DELAY_LEAST_SHARE_OF_GAIN: f64 = 0.7;
