//! Limits of the figures by which wrong signs and units of a model file show.

use std::ops::RangeInclusive;

/// Magnitudes of gravity that occur on the Earth, m/s^2: 9.764 to 9.834, and 10 as a round number. Wrong units and
/// other planets are outside.
pub(super) const EARTH_GRAVITY: RangeInclusive<f64> = 9.75..=10.0;

/// Components of gravity below this share of its magnitude count as zero where its direction is named. By judgement.
pub(super) const SMALL_COMPONENT: f64 = 0.01;

/// Number of random poses from which the size of a mechanism is taken. By judgement.
pub(super) const SIZE_POSES: usize = 40;

/// Relative difference of two nominal values of a base parameter below which they count as equal. Sums of some terms in
/// another order differ by 1e-15 to 1e-13; values that users write have at most 10 digits.
pub(super) const EQUAL_VALUES: f64 = 1e-12;

/// Least length of a mechanism along an axis, relative to the largest one, that is printed; shorter ones are printed as
/// 0. By judgement: rounding of some hundred frames in double precision stays below 1e-13, and no machine is measured
/// to 1e-12 of its size.
pub(super) const ROUNDING_OF_SIZE: f64 = 1e-12;
