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

/// Widest median filters that must fit into the samples of a run; in shorter runs no events are searched. By judgement.
pub(super) const EVENT_FEWEST_FILTER_WIDTHS: usize = 40;

/// The usual residual of a drive is the one that this share of the run stays below (1). By judgement.
pub(super) const USUAL_RESIDUAL_SHARE: f64 = 0.8;

/// An event exceeds the usual residual by this factor (1). By judgement.
pub(super) const EVENT_RESIDUAL_FACTOR: f64 = 5.0;

/// An event also exceeds this share of the drive's rms force (1). By judgement.
pub(super) const EVENT_LEAST_FORCE_SHARE: f64 = 0.02;

/// A lull belongs to the event about it if it is shorter than this many widths of the median filter. By judgement.
pub(super) const EVENT_LULL_FILTER_WIDTHS: usize = 2;

/// An event that lasts less is not reported, s. By judgement.
pub(super) const SHORTEST_EVENT_S: f64 = 0.1;

/// Most events of a run; if there are more, they are a property of the machine, and none is reported. By judgement.
pub(super) const MOST_EVENTS: usize = 4;

/// Events are reported only if they last less than this share of the run together (1). By judgement.
pub(super) const EVENTS_MOST_DURATION_SHARE: f64 = 0.15;

/// A drive that is slower than this share of its maximum rate (1) may be reversing. Its residual then neither starts
/// nor ends an event. By judgement.
pub(super) const EVENT_REVERSAL_RATE_SHARE: f64 = 0.1;

/// Samples are neighbours in state if their distance is below this many standard deviations of the states. By
/// judgement.
pub(super) const NEIGHBOUR_MOST_DISTANCE_SIGMAS: f64 = 1.0;

/// A residual repeats with the motion if its neighbours in state have at least this share of it on average (1). By
/// judgement.
pub(super) const REPEATED_LEAST_RESIDUAL_SHARE: f64 = 0.4;

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

/// A delay of a single drive must lower the residual of the drive by more than this share (1). By judgement.
pub(super) const SINGLE_DELAY_LEAST_GAIN: f64 = 0.03;

/// The note on a delay is a warning if the delay lowers the residual by more than this share (1). By judgement.
pub(super) const DELAY_WARNING_GAIN: f64 = 0.1;

/// Drives that must each show a common delay on their own; all of them if there are fewer. By judgement.
pub(super) const COMMON_DELAY_FEWEST_DRIVES: usize = 2;

/// Single drives are delayed only if the half width of one of the other drives is below this share of the delay (1):
/// that drive shows that the common clock is right. By judgement.
pub(super) const PROMPT_DRIVE_MOST_HALF_WIDTH: f64 = 0.5;
