//! Thresholds of mass properties from CAD programs. Each states what it bounds, its unit, and how it was chosen.

/// Products of inertia below this share of the largest moment count as zero (1), so that their sign has no effect.
/// Reports print 5 to 12 digits. By judgement.
pub(super) const ZERO_PRODUCT: f64 = 1e-9;

/// A sign convention explains a report if what it leaves is below this share of the largest product (1). By judgement,
/// above the rounding of a report with three digits.
pub(super) const EXPLAINED_PRODUCT: f64 = 0.02;

/// The other convention is excluded if it leaves this many times more (1). By judgement.
pub(super) const SIGN_CONTRAST: f64 = 10.0;

/// Two statements of one inertia may differ by this share of the largest moment (1). By judgement, above the rounding of
/// a report with three digits.
pub(super) const INERTIA_AGREEMENT: f64 = 0.01;

/// Principal moments may miss the triangle inequality, or fall below zero, by this share of the largest moment (1).
/// A thin plate fulfils it with equality, and values are rounded to a few digits. By judgement.
pub(super) const TRIANGLE_SLACK: f64 = 2e-3;

/// Two statements of one value count as the same up to this share (1): conversions of units round.
pub(super) const SAME_VALUE: f64 = 1e-9;

/// Moments of inertia below this number of units of their last printed place are remarked (1): three digits, so that
/// rounding changes them by at most 0.5 %. By judgement.
pub(super) const FEWEST_UNITS: f64 = 100.0;

/// Densities of solid parts, kg/m^3: from plastic foam and hollow sheet metal to tungsten (19 300) and osmium (22 600).
pub(super) const DENSITIES: std::ops::RangeInclusive<f64> = 100.0..=25_000.0;
