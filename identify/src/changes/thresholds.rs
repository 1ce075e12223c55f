//! Thresholds of changes between runs: numbers that decide what is reported as a change. Each states what it bounds,
//! its unit, and how it was chosen. Numbers that only set an accuracy stay where they are used.

/// A column is dependent if its squared residual after a fit of the others is below this share of it (1). By judgement.
pub(super) const CHANGE_INDEPENDENCE_TOLERANCE: f64 = 1e-7;

/// Coefficients of scaled columns below this (1) are not counted as a dependence, which would make a value
/// undetermined. By judgement.
pub(super) const WEAK_DEPENDENCE: f64 = 1e-3;

/// Price of a value of a change, in units of the logarithm of the number of rows (1). 1 is Schwarz' criterion, which is
/// valid for white noise; the residual of real runs is never quite white. By judgement.
pub(super) const CHANGE_VALUE_PRICE: f64 = 3.0;

/// Share of a change's gain that must be confirmed on blocks that were not fitted (1). By judgement.
pub(super) const MIN_VALIDATION_SHARE: f64 = 0.3;

/// A change must explain this many times the differences within one run (1), since the motions of two runs have less in
/// common than parts of one run. On four real arms this removes every false change, at the price of small true ones
/// where the model is poor.
pub(super) const MIN_SPREAD_RATIO: f64 = 2.0;

/// A change must be this many standard deviations from zero (1). Standard deviations count noise only: parts of one run
/// show many errors of the model, but not those along the other motion. By judgement.
pub(super) const MIN_SIGNIFICANCE: f64 = 12.0;

/// Changes whose cost differs by less than this share of the gain (1) are indistinguishable. By judgement.
pub(super) const RIVAL_TOLERANCE: f64 = 0.02;

/// The gain of the best of some changes within one run counts only above a bound that chance exceeds with a probability
/// of one in this many (1), for all changes together. By judgement.
pub(super) const CHANCE_GAIN_RARITY: f64 = 10.0;

/// Values that a segment of a series must have at least: a single outlying value is no lasting change. By definition.
pub(super) const SEGMENT_FEWEST_VALUES: usize = 2;

/// A value of a series is an outlier if it differs from both neighbours by this many standard deviations (1). A nearer
/// value does not gain enough for a segment with a neighbour. By judgement.
pub(super) const LONE_VALUE_DEVIATIONS: f64 = 3.5;

/// Price of a lasting change in a series, in units of the logarithm of the number of values (1). By judgement.
pub(super) const SEGMENT_PRICE: f64 = 3.0;

/// Runs of fewer blocks show no scatter of their estimates. By judgement: the scatter of three values is hardly known.
pub(super) const JACKKNIFE_FEWEST_BLOCKS: usize = 4;
