//! Thresholds of the estimation: numbers that decide what is reported of parameters. Each states what it bounds, its
//! unit, and how it was chosen. Numbers that only set an accuracy stay where they are used.

/// Singular values of the column-scaled regressor below this fraction of the largest one (dimensionless) count as zero.
/// By judgement: rounding causes about 1e-15; larger values are information, and the standard deviations show how weak
/// it is.
pub const RANK_TOLERANCE: f64 = 1e-11;

/// Columns whose norm is below this fraction of the largest one's (1) are rounding noise and count as zero: scaled to
/// norm 1 they would look like information. By judgement.
pub(super) const NOISE_COLUMN_TOLERANCE: f64 = 1e-12;

/// Entries of unit null vectors below this (1) are rounding: the parameter is outside of the undetermined direction. By
/// judgement.
pub(super) const PARTICIPATION_TOLERANCE: f64 = 1e-6;

/// Equations per parameter below which the influences of samples cancel too much to be summed over lags. By judgement.
pub const FEWEST_ROWS: usize = 20;

/// Huber's bound, in standard deviations (dimensionless); residuals beyond it are outliers. Chosen for 95 % efficiency
/// under normal residuals; the function is that of P. J. Huber, Ann. Math. Statist. 35 (1964).
pub const HUBER_BOUND: f64 = 1.345;

/// Parameters whose relative standard deviation is at most this (1) are essential without a test. By judgement.
pub(super) const ESSENTIAL_WELL_DETERMINED: f64 = 0.1;

/// A set of parameters is not left out if its probability by chance is below this (1). By judgement.
pub(super) const ESSENTIAL_SIGNIFICANCE: f64 = 0.05;

/// Canonical correlations between instruments and regressor up to this (1) contain no information. By judgement.
pub(super) const INSTRUMENT_LEAST_CORRELATION: f64 = 1e-6;

/// Directions of the rows whose singular value is at most this share of the largest one (1) are rounding, and determine
/// no physical parameter. By judgement.
pub(super) const PHYSICAL_SPAN_TOLERANCE: f64 = 1e-10;

/// A physical parameter is determined individually if at most this share of its unit vector lies outside of the span of
/// the rows (1). By judgement.
pub(super) const INDIVIDUAL_MOST_OUTSIDE: f64 = 1e-6;
