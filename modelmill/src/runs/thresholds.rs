//! Thresholds of the comparison of runs: the numbers that decide which changes between runs are reported. Each states
//! what it bounds, its unit, and how it was chosen. Numbers that only set an accuracy or a grid stay where they are
//! used.

/// A base parameter has changed if its difference from the first run exceeds this many standard deviations, which
/// include the scatter between blocks. Of 29 pairs of runs of a simulated UR5 without any change, with quick, slow and
/// pausing motions, none has one beyond.
pub(super) const PARAMETER_CHANGE_SIGMAS: f64 = 6.0;

/// A change must have a value of more than this many standard deviations, which include the scatter between blocks. By
/// judgement: less than for noise alone (12), since the scatter contains errors of the model.
pub(super) const CHANGE_VALUE_SIGMAS: f64 = 5.0;

/// The model leaves too much of a drive's rms force unexplained for a comparison if it is more than this share (1). By
/// judgement: rigid models of real arms without friction leave up to 0.47.
pub(super) const MOST_UNEXPLAINED_SHARE: f64 = 0.5;

/// Above this share of a drive's rms force (1) that stays unexplained, a change must move the drive by more than this share.
/// By judgement: below it, noise of real sensors is usual.
pub(super) const LARGE_UNEXPLAINED_SHARE: f64 = 0.2;

/// Dry friction is negative, and a scale far from -1, by more than this many standard deviations. By judgement.
pub(super) const NEGATIVE_FRICTION_SIGMAS: f64 = 2.0;

/// A negative scale of a force within this distance of -1 (1) is a turned sign. By judgement.
pub(super) const TURNED_SCALE_TOLERANCE: f64 = 0.2;

/// A drive could not show a change if only one of more than this share of its rms force (1) would be reported. By
/// judgement.
pub(super) const UNDETECTABLE_FORCE_SHARE: f64 = 0.5;

/// Two runs cannot be compared with fewer equations than this many for each base parameter. By judgement.
pub(super) const ROWS_PER_PARAMETER: f64 = 2.0;

/// A drive is at standstill below this share of its usual largest speed (1). A simulated UR5 whose joints stick between
/// samples is identified exactly with it.
pub(super) const RUN_STANDSTILL_SHARE: f64 = 0.03;

/// A drive that moves in less than this share of the equations (1) stands, and keeps all of them. By judgement.
pub(super) const STANDING_FEWEST_MOVING_SHARE: f64 = 0.1;

/// A rate is noise if it reverses more often than this many times per period of the cut-off (1). White noise of
/// positions reverses 1.5 times, and a motion twice per period of its own.
pub(super) const NOISE_REVERSALS_PER_CUTOFF: f64 = 1.2;

/// Rates below this are rounding, rad/s or m/s. By judgement: no drive moves by less than 0.1 mm a day.
pub(super) const ROUNDING_RATE: f64 = 1e-9;

/// Cut-off that is assumed for recorded rates, as a share of the sampling rate (1). By judgement.
pub(super) const RECORDED_CUTOFF_SHARE: f64 = 0.1;

/// Largest number of windows of a run in which recorded rates are compared with positions. By judgement.
pub(super) const TIME_BASE_WINDOWS: usize = 8;

/// Fewest samples of such a window. By judgement.
pub(super) const TIME_BASE_FEWEST_SAMPLES: usize = 60;

/// A time base is reported as changed if its factor differs from 1 by more than this (1). By judgement: drifts of real
/// clocks are below 1e-4.
pub(super) const TIME_BASE_LEAST_ERROR: f64 = 1e-3;

/// A time base is reported as changed if its factor differs from 1 by this many standard deviations. By judgement.
pub(super) const TIME_BASE_SIGMAS: f64 = 5.0;

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

/// Steps of parameters that begin at most this many runs apart belong to one change point. By judgement.
pub(super) const CHANGE_POINT_RUNS: usize = 1;
