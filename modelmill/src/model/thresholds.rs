//! Limits of the figures by which wrong signs and units of a model file show.

use std::ops::RangeInclusive;

/// Magnitudes of gravity that occur on the Earth, m/s^2: 9.764 to 9.834, and 10 as a round number. Wrong units and
/// other planets are outside.
pub(super) const EARTH_GRAVITY: RangeInclusive<f64> = 9.75..=10.0;

/// Components of gravity below this share of its magnitude count as zero where its direction is named. By judgement.
pub(super) const SMALL_COMPONENT: f64 = 0.01;

/// Number of random poses from which the size of a mechanism is taken. By judgement.
pub(super) const SIZE_POSES: usize = 40;
