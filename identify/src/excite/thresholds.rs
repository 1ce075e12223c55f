//! Thresholds of excitation: the numbers that decide what is reported of effects along a motion. Each states what it
//! bounds, its unit, and how it was chosen. Numbers that only set an accuracy, a grid or the effort of a search stay
//! where they are used.

/// A column is in the span of others if at most this share of it remains after the projection (1). By judgement.
pub(super) const SEPARATION_SPAN_TOLERANCE: f64 = 1e-9;

/// A difference up to this share of the effect (1) is rounding: the other side explains the same. By judgement.
pub const SEPARATION_ROUNDING: f64 = 1e-6;
