//! Thresholds of the interpretation: the numbers that decide what is reported of solutions for physical parameters.
//! Each states what it bounds, its unit, and how it was chosen. Numbers that only set an accuracy stay where they are
//! used.

/// A solution is multiple, and has no standard deviations, if the smallest singular value of its scaled Jacobian is
/// below this share of the largest one (1). By judgement.
pub(super) const MULTIPLE_SOLUTION_RATIO: f64 = 1e-12;

/// Singular values of the Jacobian, scaled by the values of the unknowns and with rows of norm 1, below which a
/// direction changes no base parameter (1). By judgement.
pub(super) const FREE_DIRECTION_SINGULAR_VALUE: f64 = 1e-10;

/// Minima whose values differ by at most this part of their size (1), which is six digits, are the same. By judgement.
pub(super) const SAME_MINIMUM_PART: f64 = 1e-6;

/// Part of the nominal value that is added to the size of a value when minima are compared (1), for values near zero.
/// By judgement.
pub(super) const SAME_MINIMUM_NOMINAL_PART: f64 = 1e-3;

/// A point is no minimum if its gradient is above this share of the product of Jacobian and error (1). By judgement.
pub(super) const MINIMUM_MOST_GRADIENT: f64 = 1e-6;

/// A point with a whitened error up to this (1) is a solution, whatever its gradient. By judgement.
pub(super) const SOLUTION_MOST_ERROR: f64 = 1e-9;
