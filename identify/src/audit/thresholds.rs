//! Thresholds of the audit: numbers that decide which faults of a recording are reported. Each states what it bounds,
//! its unit, and how it was chosen. Numbers that only set an accuracy or a grid stay where they are used.

use std::f64::consts::PI;
use std::ops::Range;

// --- Single signals

/// Changes that a signal must have before its rate of update is examined. By judgement.
pub(super) const SLOW_UPDATE_FEWEST_CHANGES: usize = 20;

/// A signal is updated at a lower rate if more than this share of the distances between its changes are equal (1). By
/// judgement.
pub(super) const SLOW_UPDATE_SHARE: f64 = 0.9;

/// Angles beyond this value are probably in degrees, rad: two turns to each side. By judgement.
pub(super) const LARGE_ANGLE_RAD: f64 = 4.0 * PI;

/// Windows of a recording over which the top speed of a coordinate is taken.
pub(super) const TOP_SPEED_WINDOWS: usize = 500;

/// A coordinate that is slower than this share of its top speed (1) does not move while a force is constant. By
/// judgement.
pub(super) const MOVING_LEAST_SPEED_SHARE: f64 = 0.02;

/// Least number of samples at a limit for a saturated force. By judgement.
pub(super) const FEWEST_AT_LIMIT: usize = 8;

/// Samples of equal force in a row below which they do not count as samples at a limit. By judgement.
pub(super) const EXACT_LIMIT_SHORTEST_RUN: usize = 3;

/// An exact limit must have more than this many times the samples of the next value. The crest of a wave has 2.4 times
/// as many samples at its last step as at the one before. By judgement, above this number.
pub(super) const LIMIT_CROWDING: usize = 3;

/// Samples of a recording below which a noisy limit is not searched. By judgement.
pub(super) const NOISY_LIMIT_FEWEST_SAMPLES: usize = 20 * FEWEST_AT_LIMIT;

/// One sample in this many must lie around the level of a noisy limit. By judgement.
pub(super) const NOISY_LIMIT_ONE_IN: usize = 100;

/// At most one sample in this many may lie beyond a noisy limit. By judgement.
pub(super) const BEYOND_LIMIT_ONE_IN: usize = 1000;

/// Half width of the band around a limit, standard deviations of white noise. By judgement.
pub(super) const LIMIT_BAND_SIGMAS: f64 = 5.0;

/// Half width of the band around a limit, widths of the interval that has the samples of the limit. The larger of both
/// half widths counts. By judgement.
pub(super) const LIMIT_BAND_WIDTHS: f64 = 2.0;

/// Largest half width of the band, as a share of the limit (1). Plateaus by friction are wider. By judgement.
pub(super) const LIMIT_BAND_MOST_SHARE: f64 = 0.01;

/// Least product of slope and length of a plateau, half widths of the band. The top of a parabola has 8. By judgement,
/// above this number.
pub(super) const PLATEAU_STEEPNESS: f64 = 30.0;

// --- Columns

/// Largest relative deviation from 1 of the ratio of a rate to the derivative of its position (1). Drift and coarse
/// sampling cause a few per cent. By judgement, above these.
pub(super) const RATE_RATIO_TOLERANCE: f64 = 0.1;

/// Largest share of a rate's integral that the position may leave unexplained, as a ratio of rms values (1). By
/// judgement.
pub(super) const RATE_MOST_MISFIT: f64 = 0.3;

/// Columns share one warning if their ratios differ by less than this share (1). By judgement.
pub(super) const SAME_RATIO_TOLERANCE: f64 = 0.05;

/// Samples that a position must have before a rate is compared with it. By judgement.
pub(super) const RATE_FEWEST_SAMPLES: usize = 16;

/// A rate is compared with a position only if the squared steps of the position are at most this share of its squared
/// deviations from the mean (1). Otherwise the position is mostly noise. By judgement.
pub(super) const RATE_MOST_NOISE: f64 = 0.5;

/// Steps of time from this on are too long for a recording of forces, s. By judgement.
pub(super) const LONGEST_STEP_S: f64 = 0.5;

/// Steps of time up to this are too short for a recording of forces, s. By judgement.
pub(super) const SHORTEST_STEP_S: f64 = 2e-6;

/// A step of an angle is a full turn if it differs from one by less than this, rad. By judgement.
pub(super) const WRAP_TOLERANCE_RAD: f64 = 0.5;

/// The same for an angle in degrees, degrees. By judgement.
pub(super) const WRAP_TOLERANCE_DEG: f64 = 20.0;

/// A full turn counts as a wrapped angle if it exceeds this many median steps (1). By judgement.
pub(super) const WRAP_LEAST_STEPS: f64 = 10.0;

// --- Clock

/// Least relative clock error that is reported (1). A smaller one may be the scale of a sensor, or its noise. By
/// judgement.
pub(super) const MIN_CLOCK_ERROR: f64 = 0.005;

/// A coordinate agrees with a clock error if it shows more than this share of it (1). If the clock drifts, coordinates
/// that move at different times show different errors. By judgement.
pub(super) const CLOCK_AGREEMENT_SHARE: f64 = 0.4;

/// Of three coordinates at least this many must agree with a clock error. By judgement.
pub(super) const CLOCK_AGREEING_OF_THREE: usize = 2;

/// Ratios of a change of position to the integral of its rate that may be clock errors (1). Others are unit errors,
/// which are reported elsewhere. By judgement.
pub(super) const CLOCK_RATIOS: Range<f64> = 0.9..1.1;

/// A rate explains its position if the square of their correlation exceeds this (1). Otherwise the clock is not the
/// reason for a difference. By judgement.
pub(super) const CLOCK_SQUARED_CORRELATION: f64 = 0.95;

/// Samples below which repeated samples are not searched. By judgement.
pub(super) const REPEATED_FEWEST_SAMPLES: usize = 100;

/// Moving positions below which repeated samples are not searched, because a single position may repeat by chance. By
/// judgement.
pub(super) const REPEATED_FEWEST_POSITIONS: usize = 2;

/// Share of repeated samples above which they are reported (1). By judgement.
pub(super) const REPEATED_LEAST_SHARE: f64 = 0.02;

/// The share of repeated samples must also exceed the limit by this many times the share that occurs by chance (1). By
/// judgement.
pub(super) const REPEATED_CHANCE_FACTOR: f64 = 3.0;

// --- Positions

/// Neighbours of a sample are compared with a cubic only if they take at most this many times the usual time (1): one or
/// two lost samples do no harm, a longer gap does. By judgement.
pub(super) const NEIGHBOURHOOD_MOST_SPAN: f64 = 1.25;

/// Faults of positions are searched only in recordings with at least this many times the neighbours on one side of a
/// jump. By judgement.
pub(super) const POSITION_FAULT_NEIGHBOURHOODS: usize = 20;

/// Share of the largest rate below which a coordinate is slow (1). By judgement.
pub(super) const SLOW_RATE_SHARE: f64 = 0.1;

/// Share of the largest rate above which a coordinate is fast (1). By judgement.
pub(super) const FAST_RATE_SHARE: f64 = 0.4;

/// Least ratio of the errors at fast motion to those at slow motion for jitter (1). By judgement.
pub(super) const JITTER_MIN_ERROR_GROWTH: f64 = 3.0;

/// Least correlation of the time errors of two coordinates for jitter (1). By judgement.
pub(super) const JITTER_MIN_AGREEMENT: f64 = 0.7;

/// Samples at which both of two coordinates must be fast before their time errors are compared. By judgement.
pub(super) const JITTER_FEWEST_SAMPLES: usize = 30;

/// Least number of jumps for backlash. By judgement.
pub(super) const BACKLASH_FEWEST_JUMPS: usize = 3;

/// Least size of a jump, robust standard deviations of the estimated jumps. By judgement.
pub(super) const BACKLASH_JUMP_SIGMAS: f64 = 8.0;

/// Least size of the jumps, encoder steps: the steps themselves are no backlash. By judgement.
pub(super) const BACKLASH_ENCODER_STEPS: f64 = 8.0;

/// Least size of the jumps as a share of the travel (1). By judgement.
pub(super) const BACKLASH_TRAVEL_SHARE: f64 = 5e-5;

/// Jumps have the same size if they differ from the median by less than this share of it (1). By judgement.
pub(super) const BACKLASH_SIZE_TOLERANCE: f64 = 0.35;

/// Of five jumps at least this many must have the same size. By judgement.
pub(super) const BACKLASH_ALIKE_OF_FIVE: usize = 4;

/// Of five pairs of neighbouring jumps at least this many must have opposite signs. By judgement.
pub(super) const BACKLASH_ALTERNATING_OF_FIVE: usize = 4;

// --- Forces

/// Residuals beyond this many standard deviations count less in a robust fit: Huber's bound for 95 % efficiency under
/// normal residuals (the value of `estimate::HUBER_BOUND`).
pub(super) const AUDIT_HUBER_BOUND_SIGMAS: f64 = 1.345;

/// Half width of the interval of a delay, standard deviations: Student's factor for 99 %, both sides, with 19 degrees
/// of freedom, one less than `BLOCKS` of `delay`. By definition.
pub(super) const DELAY_STUDENT_FACTOR: f64 = 2.861;

/// A shift far from zero must lower the mean logarithm of the relative residuals by more than this (1). By judgement.
pub(super) const FAR_SHIFT_MIN_IMPROVEMENT: f64 = 0.05;

/// Least uncertainty of a delay, steps of the recording. By judgement.
pub(super) const DELAY_RESOLUTION_STEPS: f64 = 0.05;

// --- Rates that lag positions

/// Samples of a recording below which the delay of rates is not estimated. By judgement.
pub(super) const LATE_RATE_FEWEST_SAMPLES: usize = 200;

/// Least delay of a rate, samples. Differences of neighbouring positions are late by up to one. By judgement, above it.
pub(super) const LATE_RATE_LEAST_STEPS: f64 = 2.0;

/// Longest delay of a rate, s. A longer one is a fault of the clock or another column. By judgement.
pub(super) const LATE_RATE_LONGEST_S: f64 = 0.3;

/// The delay must explain this share of the squared difference between position and integral of the rate (1). By
/// judgement; 0.97 to 0.99 on beyond/rates-filtered.
pub(super) const LATE_RATE_EXPLAINED: f64 = 0.6;

/// The rate of one coordinate must change within its delay by more than this share of its size, as rms values (1). On
/// panda recorded rates with 0.015 predict forces better than positions do; beyond/rates-filtered has 0.07 to 0.13,
/// machines/tiago 0.12.
pub(super) const LATE_RATE_LEAST_CHANGE: f64 = 0.04;

// --- Dead bands of forces

/// Share of exact zeros of a reading with a dead band (1). The wrist of machines/tiago has 0.84 to 0.88; a force of a few
/// quantisation steps has less. By judgement, between them.
pub(super) const DEAD_BAND_LEAST_SHARE: f64 = 0.5;

/// Intervals of zeros that a dead band makes at least. By judgement.
pub(super) const DEAD_BAND_FEWEST_INTERVALS: usize = 10;

/// The longest interval has less than this share of all zeros (1); a reading that fails has one long interval. By
/// judgement.
pub(super) const DEAD_BAND_LONGEST_SHARE: f64 = 0.5;
