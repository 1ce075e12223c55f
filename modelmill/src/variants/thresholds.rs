//! Thresholds of the comparison of variants: the numbers that decide which differences between two models are reported.
//! Each states what it bounds, its unit, and how it was chosen. Numbers that only set an accuracy or a grid stay where
//! they are used.

/// A difference of forces up to this share of the larger rms force (1) has no cause. Below it is rounding. By
/// judgement.
pub(super) const FORCE_DIFFERENCE_LEAST_SHARE: f64 = 1e-8;

/// A limit is exceeded if more than this share of it is used beyond it (1). Below it is rounding. By judgement.
pub(super) const LIMIT_TOLERANCE: f64 = 1e-9;

/// A summand is left out of the causes of a difference if its share, and the part of it by its value, are both below
/// this (1). Below it is rounding. By judgement.
pub(super) const CAUSE_LEAST_SHARE: f64 = 1e-12;
