//! Thresholds of the comparison of runs: the numbers that decide which changes between runs are reported. Each states
//! what it bounds, its unit, and how it was chosen. Numbers that only set an accuracy or a grid stay where they are
//! used.

/// A base parameter has changed if its difference from the first run exceeds this many standard deviations. By
/// judgement.
pub(super) const PARAMETER_CHANGE_SIGMAS: f64 = 4.0;

/// A change must move one of the drives by more than this share of its rms force (1): smaller changes are within the
/// errors of any model. By judgement.
pub(super) const CHANGE_LEAST_FORCE_SHARE: f64 = 4e-3;

/// Noise that is assumed in every run in addition, as a share of a drive's rms force (1): no model is more accurate. By
/// judgement.
pub(super) const NOISE_FLOOR_SHARE: f64 = 1e-3;

/// Additional price of a changed scale in the search, in values: friction changes every day, but sensors, torque
/// constants and gears hardly ever. It decides if both explain the same, as at a drive whose only force is its own
/// friction. By judgement.
pub(super) const SCALE_CHANGE_RARITY: f64 = 0.2;

/// The mass of a load is known, and its mass and centre are given, if it exceeds this many of its standard deviations.
/// By judgement.
pub(super) const KNOWN_VALUE_SIGMAS: f64 = 3.0;

/// Pushes with less time between them are one, s. By judgement.
pub(super) const PUSH_LONGEST_GAP_S: f64 = 0.25;

/// Share of the length of an event (1) that is excluded before and after it as well. By judgement.
pub(super) const PUSH_MARGIN_SHARE: f64 = 0.2;

/// Steps of parameters that begin at most this many runs apart belong to one change point. By judgement.
pub(super) const CHANGE_POINT_RUNS: usize = 1;
