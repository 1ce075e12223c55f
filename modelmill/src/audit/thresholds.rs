//! Thresholds of the audit: the numbers that decide which faults of a recording are reported with a model. Each states
//! what it bounds, its unit, and how it was chosen. Numbers that only set an accuracy or a grid stay where they are
//! used.

use std::ops::Range;

// --- Samples

/// Samples that a recording must exceed to be checked with the model. By judgement.
pub(super) const AUDIT_FEWEST_SAMPLES: usize = 100;

// --- Forces compared with the nominal values

/// Magnitude of the correlation with the nominal forces (1) below which nothing is said of a force: friction and wrong
/// nominal values may be the cause. By judgement.
pub(super) const NOMINAL_LEAST_CORRELATION: f64 = 0.8;

/// Ratios of nominal to measured force that may be those of a gear (1): motor torques before the gear. At smaller
/// ratios nominal values may be wrong, at larger ones the unit. By judgement.
pub(super) const GEAR_RATIOS: Range<f64> = 12.0..250.0;

// --- Contacts and pushes
//
// Chosen on made arms of six joints by another program (moving, slow, point to point; with and without pushes of 5 to
// 100 % of a drive's force), on shared/data/machines and on the other measured sets, unless stated otherwise.

/// Samples that a run must have; in shorter runs no events are searched. By judgement.
pub(super) const EVENT_FEWEST_SAMPLES: usize = 100;

/// A drive or coordinate that is slower than this share of its maximum rate stands still (1).
pub(super) const STANDSTILL_RATE_SHARE: f64 = 0.01;

/// A revolute joint that is slower stands still whatever its maximum rate, rad/s. By judgement.
pub(super) const SLOWEST_ANGULAR_RATE: f64 = 1e-3;

/// A prismatic joint that is slower stands still whatever its maximum rate, m/s. By judgement.
pub(super) const SLOWEST_LINEAR_RATE: f64 = 1e-4;

/// A standstill lasts at least this long, s; otherwise it is a reversal.
pub(super) const STANDSTILL_SHORTEST_S: f64 = 0.3;

/// Slow motion of less than this time within a standstill does not end it, s: a push moves a drive that is held.
pub(super) const STANDSTILL_LONGEST_GAP_S: f64 = 0.4;

/// A drive that is slower than this share of its maximum rate (1) may be reversing. Its residual then neither starts
/// nor ends an event.
pub(super) const SLOW_RATE_SHARE: f64 = 0.05;

/// Time about a switch of friction in which the residual shows no contact, in units of the smear of the smoothing.
pub(super) const SWITCH_SMEARS: f64 = 0.5;

/// Time at either end of a run in which the residual shows no contact, in units of the smear of the smoothing.
pub(super) const RUN_END_SMEARS: f64 = 0.75;

/// Longest smear of the smoothing that is assumed, s: a low cut-off follows from a slow motion, and its switches of
/// friction are slow as well. By judgement.
pub(super) const LONGEST_SMEAR_S: f64 = 0.2;

/// A reading that stays exactly the same for this time while its drive moves is frozen, s.
pub(super) const FROZEN_SHORTEST_S: f64 = 0.1;

/// A reading has a dead band if one value is in more than this share of the samples in motion (1). Two readings of
/// TIAGo are 0 in 84 to 88 % of the samples.
pub(super) const DEAD_BAND_LEAST_SHARE: f64 = 0.3;

/// Times over which residuals are smoothed, s: the short one keeps start and end, in the long one small forces stand
/// out.
pub(super) const SHORT_MEAN_S: f64 = 0.04;
pub(super) const LONG_MEAN_S: f64 = 0.2;
pub(super) const SLOW_MEAN_S: f64 = 0.7;

/// Time in motion that a drive must have for a level of its residual, s. By judgement.
pub(super) const LEVEL_FEWEST_S: f64 = 1.0;

/// The level of a residual is at least this share of the rms force (1): no model is more accurate. By judgement.
pub(super) const LEVEL_LEAST_FORCE_SHARE: f64 = 1e-3;

/// The level of a residual is at most this many deviations by its median (1): events raise its upper quantile.
pub(super) const LEVEL_MOST_RATIO: f64 = 2.0;

/// Residuals beyond this many levels are left out of the next fit (1).
pub(super) const FIT_CUT_DEVIATIONS: f64 = 2.5;

/// A drive is fitted in motion only if this share of its samples is usable (1); what stands out is not left out if
/// less would stay.
pub(super) const FIT_LEAST_SHARE: f64 = 0.25;

/// An event exceeds the level of its drive by this factor somewhere (1).
pub(super) const EVENT_OPENING_DEVIATIONS: f64 = 5.0;

/// An event reaches as far as its residual exceeds the level by this factor (1).
pub(super) const EVENT_CLOSING_DEVIATIONS: f64 = 2.0;

/// An event also exceeds this share of the drive's rms force (1).
pub(super) const EVENT_LEAST_FORCE_SHARE: f64 = 0.02;

/// A lull below the level belongs to the event about it if it is shorter, s.
pub(super) const EVENT_LONGEST_LULL_S: f64 = 0.06;

/// Samples that show no contact belong to the event about them if they last less, s.
pub(super) const EVENT_LONGEST_BRIDGE_S: f64 = 0.3;

/// An event that lasts less at half of its height is not reported, s: hits of a limit switch last 0.06 s, and 0.04 s at
/// half of their height.
pub(super) const SHORTEST_EVENT_S: f64 = 0.04;

/// Samples that show no contact are at most this share of an event (1): of one that is weak, and of one that is strong.
pub(super) const EVENT_LONGEST_MASKED_SHARE: [f64; 2] = [0.6, 0.85];

/// A segment is strong if it exceeds the level of its drive by this factor (1): its samples may be few, and without
/// similar states a sudden start and end are enough.
pub(super) const SUDDEN_LEAST_DEVIATIONS: f64 = 10.0;

/// Events are reported only if they last less than this share of the run together (1): otherwise it cannot be known
/// what is the rule and what the exception. By judgement.
pub(super) const EVENTS_MOST_DURATION_SHARE: f64 = 0.6;

/// The mean residual of an event exceeds the noise within it by this many standard deviations (1).
pub(super) const LOCAL_NOISE_LEAST_DEVIATIONS: f64 = 8.0;

/// Errors of the time stamps that count as possible: half a sample, but at most this time, s. By judgement: clocks of
/// loggers jitter by some milliseconds.
pub(super) const TIME_ERROR_MOST_S: f64 = 0.005;

/// A switch of friction is near the start or end of an event if there is less time between them, s.
pub(super) const SWITCH_NEAR_S: f64 = 0.05;

/// An event of a single drive about its reversal is longer, s: TIAGo and a double pendulum have residuals of 0.2 to
/// 0.6 s there.
pub(super) const STICK_LONGEST_S: f64 = 0.62;

/// Or its force exceeds this multiple of the dry friction (1). By judgement.
pub(super) const STICK_MOST_FRICTIONS: f64 = 6.0;

/// At a switch of friction an event of a single drive exceeds this share of its dry friction (1). The KUKA KR300 and
/// the Cloos have such residuals.
pub(super) const SWITCH_FRICTION_SHARE: f64 = 1.0;

/// Friction is no cause of a segment whose residual changes by this share of its force (1) at start and end, if it stands
/// out by the first factor (1) and is shown for the most part, or by the second one. Residuals of friction of measured
/// arms stand out by up to 11 where they are shown, and by 31 where they are hidden.
pub(super) const SHARP_LEAST_CONTRAST: f64 = 0.75;
pub(super) const SHARP_LEAST_DEVIATIONS: f64 = 12.5;
pub(super) const SHARP_HIDDEN_LEAST_DEVIATIONS: f64 = 60.0;

/// Beyond this factor (1) half of the contrast is enough, since no friction of measured arms stands out so far.
pub(super) const HUGE_LEAST_DEVIATIONS: f64 = 100.0;

/// Weight of the jerk among the states of a drive (1): its noise is large.
pub(super) const JERK_WEIGHT: f64 = 0.5;

/// Samples are neighbours in state if their distance is below this many standard deviations of the states. By
/// judgement.
pub(super) const NEIGHBOUR_MOST_DISTANCE_SIGMAS: f64 = 1.0;

/// Of all visits of similar states those are compared whose distance is at most this multiple of the nearest one (1), or
/// below this many standard deviations. By judgement.
pub(super) const VISIT_MOST_DISTANCE_RATIO: f64 = 2.0;
pub(super) const VISIT_NEAR_SIGMAS: f64 = 0.3;

/// A residual repeats with the motion if its neighbours in state have at least this share of it on average (1). By
/// judgement.
pub(super) const REPEATED_LEAST_MEAN_SHARE: f64 = 0.4;

/// A residual repeats also if the rms of its neighbours in state is at least this share of it (1).
pub(super) const REPEATED_LEAST_RMS_SHARE: f64 = 0.6;

/// A segment is no law of the state if at least this share of its comparable samples has no such neighbours (1). By
/// judgement.
pub(super) const ALONE_LEAST_SHARE: f64 = 0.5;

/// A sudden start or end changes the residual by more than this share of the force of the event (1).
pub(super) const EDGE_LEAST_SHARE: f64 = 0.5;

/// Meanwhile the state changes by less than this many of its standard deviations (1).
pub(super) const EDGE_MOST_DISTANCE_SIGMAS: f64 = 0.5;

/// Times over which the level of the force is taken on either side of a step at standstill, s.
pub(super) const STEP_WINDOWS_S: [f64; 2] = [0.1, 0.25];

/// Time after and before a motion in which no step is a push, s: friction changes its direction there.
pub(super) const STANDSTILL_END_MARGIN_S: f64 = 0.15;

/// Time at standstill from which the usual steps of a force are known, s: with less, no push at standstill is reported. By
/// judgement.
pub(super) const STANDSTILL_FEWEST_S: f64 = 0.8;

/// A step at standstill exceeds the usual change of the force by this factor (1).
pub(super) const STEP_LEAST_DEVIATIONS: f64 = 4.0;

/// It also exceeds this share of the rms force of its drive (1): the KUKA KR300 has steps of 0.02 at standstill.
pub(super) const STEP_LEAST_FORCE_SHARE: f64 = 0.035;

/// Ratio of the larger to the smaller of the two steps of a push, at most (1).
pub(super) const STEP_MOST_RATIO: f64 = 1.67;

/// After a push the force is back at its level before by more than this share of the step (1).
pub(super) const STEP_LEAST_RETURN: f64 = 0.5;

/// Segments of drives with less time between them are one event, s.
pub(super) const EVENT_GAP_S: f64 = 0.05;

/// Drives agree in time if starts and ends differ by less than this time, s, plus this share of the event (1).
pub(super) const GROUP_TIME_TOLERANCE_S: f64 = 0.15;
pub(super) const GROUP_TIME_SHARE: f64 = 0.2;

/// A drive takes part in an event if it stands out by this share of the deviations of the strongest drive (1).
pub(super) const GROUP_LEAST_DEVIATION_SHARE: f64 = 0.2;

/// Of several drives that stand out clearly one changes its residual at start and end by this share of its force (1).
pub(super) const GROUP_LEAST_CONTRAST: f64 = 0.5;

/// The drive that shows an event, which is not hidden and begins and ends at once, stands out by this share of the
/// deviations of the strongest drive (1).
pub(super) const SHOWN_LEAST_DEVIATION_SHARE: f64 = 0.8;

/// A drive with other times takes part if it stands out by this factor (1) and overlaps with the strongest drive for
/// this share of the shorter one of both (1): a reversal hides the start or the end of a push from one drive.
pub(super) const GROUP_CLEAR_DEVIATIONS: f64 = 10.0;
pub(super) const GROUP_LEAST_OVERLAP: f64 = 0.7;

/// An event of a single drive exceeds this share of its rms force (1).
pub(super) const ALONE_LEAST_FORCE_SHARE: f64 = 0.03;

/// An event of a single drive in motion stands out by this factor (1), unless it is large: wrists of the Panda have
/// residuals of friction of 8 to 9.5.
pub(super) const ALONE_LEAST_DEVIATIONS: f64 = 10.0;

/// Share of the samples of an event of a single drive that may show no contact (1), unless it is large: the KUKA KR300
/// and a double pendulum have residuals about reversals that are hidden by 0.34 or more.
pub(super) const ALONE_MOST_MASKED_SHARE: f64 = 0.33;

/// It may be hidden if it stands out by this factor (1): those of the KUKA KR300 stand out by up to 24.
pub(super) const HIDDEN_LEAST_DEVIATIONS: f64 = 28.0;

/// A brief event of several drives stands out by this factor (1): the Cloos has residuals of 8 for 0.06 s.
pub(super) const FAINT_HIT_MOST_DEVIATIONS: f64 = 12.0;

/// An event of a single drive that stands out by less than this factor (1) is faint. At its start and end the residual
/// changes by at least the given share of its force (1), as a push does and an error of the model does not.
pub(super) const FAINT_MOST_DEVIATIONS: f64 = 60.0;
pub(super) const FAINT_LEAST_CONTRAST: f64 = 0.6;

/// An event of a single drive that lasts less, s, stands out by this factor (1): smoothing leaves such residuals about a
/// fast reversal of another drive.
pub(super) const FAINT_SHORTEST_S: f64 = 0.14;
pub(super) const FAINT_SHORT_LEAST_DEVIATIONS: f64 = 15.0;

/// The deviations of all drives of an event, as root of their sum of squares, are at least this (1).
pub(super) const EVENT_LEAST_POWER: f64 = 5.0;

/// An event of a single drive that is shorter is brief, s.
pub(super) const BRIEF_EVENT_S: f64 = 0.075;

/// A brief event exceeds the level of its drive by this factor (1), and this share of its rms force (1). Measured arms
/// have residuals of 10 levels for 0.07 s, simulated light wrists of 33 for 0.1 s; hits of a limit switch have 500.
pub(super) const BRIEF_LEAST_DEVIATIONS: f64 = 50.0;
pub(super) const BRIEF_LEAST_FORCE_SHARE: f64 = 0.05;

/// Forces are left out before and after an event as well: for this share of its length (1), since the start and the end of
/// a force that rises slowly hardly exceed the usual residual, and for at least this time, s. Half of a sine lasts longer
/// at its foot than at half of its height by a quarter at each side. By judgement.
pub(super) const EVENT_MARGIN_SHARE: f64 = 0.2;
pub(super) const EVENT_LEAST_MARGIN_S: f64 = 0.15;

/// A drive counts with at most this many deviations (1). By judgement.
pub(super) const MOST_COUNTED_DEVIATIONS: f64 = 40.0;

// --- Delays

/// Longest delay that is searched, s. By judgement.
pub(super) const LONGEST_DELAY_S: f64 = 0.25;

/// Longest delay that is searched, steps of the recording; the longer of both counts, for recordings with few samples
/// per second. By judgement.
pub(super) const LONGEST_DELAY_STEPS: f64 = 64.0;

/// Longest delay that is searched, as a share of the recording (1); it bounds both of the others. By judgement.
pub(super) const LONGEST_DELAY_SHARE: f64 = 0.1;

/// Samples at which a drive is slower than this share of its maximum rate (1) are not used: friction near reversals
/// causes an apparent delay. By judgement.
pub(super) const DELAY_REVERSAL_RATE_SHARE: f64 = 0.1;

/// A delay of all drives must exceed this many half widths of its interval, since model errors are not random. Two
/// drives differ in their delay, or a drive is delayed at all, only from this many on. By judgement.
pub(super) const DELAY_LEAST_HALF_WIDTHS: f64 = 1.5;

/// The same for a drive that alone is delayed: missing laws often act on one drive. By judgement.
pub(super) const SINGLE_DELAY_LEAST_HALF_WIDTHS: f64 = 3.0;

/// Shortest delay of all drives that is reported, steps of the recording. By judgement.
pub(super) const DELAY_LEAST_STEPS: f64 = 0.2;

/// Shortest delay of single drives that is reported, steps of the recording. By judgement.
pub(super) const SINGLE_DELAY_LEAST_STEPS: f64 = 0.3;

/// Delays that differ by less are equal whatever their intervals, steps of the recording. By judgement.
pub(super) const SAME_DELAY_TOLERANCE_STEPS: f64 = 0.1;

/// A delay of all drives must lower the residual by more than this share (1). By judgement.
pub(super) const DELAY_LEAST_GAIN: f64 = 0.003;

/// With the delay the residual is below this share of the force (1): where the model explains little, the delay is no
/// more than a part of the fit. By judgement.
pub(super) const DELAY_MOST_RESIDUAL: f64 = 0.5;

/// A delay is long beyond this time, s, and this many steps of the recording. It must lower the residual by more than
/// this share (1): a double pendulum without delay has 0.14 at 248 ms.
pub(super) const LONG_DELAY_S: f64 = 0.05;
pub(super) const LONG_DELAY_STEPS: f64 = 2.5;
pub(super) const LONG_DELAY_LEAST_GAIN: f64 = 0.3;

/// A delay of a single drive must lower the residual of the drive by more than this share (1). By judgement.
pub(super) const SINGLE_DELAY_LEAST_GAIN: f64 = 0.03;

/// The note on a delay is a warning if the delay lowers the residual by more than this share (1). By judgement.
pub(super) const DELAY_WARNING_GAIN: f64 = 0.1;

/// Drives that must each show a common delay on their own; all of them if there are fewer. By judgement.
pub(super) const COMMON_DELAY_FEWEST_DRIVES: usize = 2;

/// Single drives are delayed only if the half width of one of the other drives is below this share of the delay (1):
/// that drive shows that the common clock is right. By judgement.
pub(super) const PROMPT_DRIVE_MOST_HALF_WIDTH: f64 = 0.5;
