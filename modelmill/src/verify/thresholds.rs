//! Limits that `verify` uses where a user states none. Each states what it bounds, its unit, and how it was chosen.

/// Most rms error of a drive, in % of its rms force, in addition to its noise. By judgement: rigid models with
/// friction reach 3 to 10 % on industrial robots.
pub(crate) const DEFAULT_ERROR_PERCENT: f64 = 10.0;

/// A new effect is reported as missing above this probability (1): more likely present than not. By definition.
pub(crate) const DEFAULT_PROBABILITY: f64 = 0.5;

/// An estimate outside the default interval is a failure if it differs from the value of the model by more than this
/// many standard deviations (1). The diagnosis uses the same bound for parameters that differ from the file. By
/// judgement.
pub(crate) const DEFAULT_SIGMAS: f64 = 5.0;

/// An estimate may differ from the value of the model by this part of the value (1). By judgement: friction of one
/// machine changes by this much from day to day.
pub(crate) const DEFAULT_RELATIVE_DIFFERENCE: f64 = 0.1;

/// An estimate may differ from the value of the model by as much as changes the force of every drive by at most this
/// part of its rms value (1). By judgement: a fifth of [`DEFAULT_ERROR_PERCENT`].
pub(crate) const DEFAULT_FORCE_SHARE: f64 = 0.02;

/// Standard deviations on either side of an estimate within which its true value lies (1): 95 % for a normal
/// distribution.
pub(crate) const INTERVAL_SIGMAS: f64 = 2.0;
