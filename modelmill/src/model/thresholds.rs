//! Limits of gravity, mass and size, the figures in which wrong signs and units of a model file are visible.

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

/// Largest difference of two forces at one state, relative to the sum of the magnitudes of their summands, that counts as
/// rounding. Programs that were factored differently differ by 1e-15 to 1e-11, and loops are closed to 1e-10. A length of
/// 1 m that changes by 0.01 mm changes forces by some 1e-5.
pub(super) const EQUAL_FORCES: f64 = 1e-7;

/// Distances from the nominal pose, rad (half of it for lengths, m), at which a state for comparing equations is tried, in
/// this order: far from it most terms differ, near it closed loops are still reachable. By judgement.
pub(super) const SAMPLE_DISTANCES: [f64; 6] = [0.7, 0.3, 0.1, 0.03, 0.01, 0.0];
