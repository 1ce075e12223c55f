//! Thresholds of the identification: the numbers that decide what is reported of an estimate, and which instruments are
//! refused. Each states what it bounds, its unit, and how it was chosen. Numbers that only set an accuracy or a grid
//! stay where they are used.

/// Instruments are weak if their smallest canonical correlation with the regressor (1) is below this value. By
/// judgement.
pub(super) const WEAK_INSTRUMENT_CORRELATION: f64 = 0.2;

/// A base parameter has an impossible sign if it is more than this many standard deviations beyond zero. By judgement.
pub(super) const IMPOSSIBLE_SIGN_SIGMAS: f64 = 2.0;

/// The base parameter that sensor faults change most is named if they change it by at least this many standard
/// deviations. By judgement.
pub(super) const FAULT_INFLUENCE_LEAST_SIGMAS: f64 = 1.0;

/// Largest difference between the times of instruments and recording, smallest steps of the recording. A larger one is
/// not rounding. By judgement.
pub(super) const INSTRUMENT_TIME_TOLERANCE_STEPS: f64 = 0.01;

/// Periods that a recording must last for instruments from another period. By judgement.
pub(super) const INSTRUMENT_FEWEST_PERIODS: f64 = 1.5;

/// Steps of the recording that such a period must last. By judgement.
pub(super) const INSTRUMENT_PERIOD_FEWEST_STEPS: f64 = 2.0;

/// A sample is one period away if it is at most this many steps from that time; otherwise the recording has a gap. By
/// judgement.
pub(super) const INSTRUMENT_PERIOD_TOLERANCE_STEPS: f64 = 0.75;
