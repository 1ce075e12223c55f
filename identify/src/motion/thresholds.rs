//! Thresholds of the preparation: the numbers that decide how a motion is smoothed, and what is reported of it. Each
//! states what it bounds, its unit, and how it was chosen. Numbers that only set an accuracy or a grid stay where they
//! are used.

use std::ops::Range;

// --- Times of samples

/// Times that differ from an even grid by at most this share of a step count as even (1). By judgement.
pub(super) const EVEN_TIMES_TOLERANCE: f64 = 1e-4;

/// Most decimals that times may be rounded to; with more they count as not rounded. By judgement.
pub(super) const ROUNDED_MOST_DECIMALS: i32 = 9;

/// Rounded times differ from an even grid by at most this, units of their last decimal. Rounding causes 0.5, and the
/// line through rounded times has a small error itself. By judgement, above 0.5.
pub(super) const ROUNDED_TIMES_TOLERANCE: f64 = 0.55;

/// A gap is interpolated by the spline if it is at most this part of a period of the highest frequency of the forces
/// (1). By judgement.
pub(super) const BRIDGED_GAP_PART: f64 = 0.5;

/// A step of time above this multiple of the median lacks samples (1). By judgement.
pub(super) const MISSING_SAMPLE_STEP: f64 = 1.5;

/// A step of time below this multiple of the median is short (1). By judgement.
pub(super) const SHORT_STEP: f64 = 0.5;

/// Times jitter if more than one step in this many is short. By judgement.
pub(super) const JITTER_ONE_IN: usize = 100;

/// Times jitter if there are also fewer than this many steps that lack samples for each short step. By judgement.
pub(super) const JITTER_LONG_STEPS_PER_SHORT: usize = 2;

/// If times jitter, a step lacks samples only above this multiple of the step that mirrors the shortest one at the
/// median (1). By judgement.
pub(super) const JITTER_STEP_MARGIN: f64 = 1.05;

// --- Band of the motion

/// Share of the power of a position below the highest frequency of its motion (1). Positions decide and not rates,
/// because noise of a clock or an encoder is a large part of rates. By judgement.
pub(super) const MOTION_POWER_SHARE: f64 = 0.999;

/// Ratio of the band of forces to that of positions (1): forces contain accelerations, products of rates, and
/// reversals of friction. By judgement.
pub(super) const FORCE_BAND_FACTOR: f64 = 20.0;

/// Highest band of forces, as a share of the sampling rate (1). By judgement.
pub(super) const BAND_HIGHEST_SHARE: f64 = 0.2;

/// Least number of periods of the band in the recording. By judgement.
pub(super) const BAND_FEWEST_PERIODS: f64 = 4.0;

// --- Cut-off

/// Samples below which no cut-off is chosen from the spectra. By judgement.
pub(super) const CUTOFF_FEWEST_SAMPLES: usize = 32;

/// A band of the spectrum contains motion if its power exceeds the noise by this factor (1). In the narrowest bands
/// noise exceeds it about once in a thousand. By judgement.
pub(super) const MOTION_NOISE_RATIO: f64 = 4.0;

/// Highest cut-off as a share of the sampling rate (1). Above it central differences attenuate more than the filter. By
/// judgement.
pub(super) const CUTOFF_HIGHEST_SHARE: f64 = 0.2;

/// Least number of periods of the cut-off in the recording. By judgement.
pub(super) const CUTOFF_FEWEST_PERIODS: f64 = 4.0;

/// The highest cut-off is chosen whose expected error of the accelerations is at most this multiple of the smallest
/// (1). By judgement.
pub(super) const CUTOFF_ERROR_RATIO: f64 = 1.25;

/// A cut-off is also allowed if the square of its expected error, relative to the acceleration, is at most this for
/// each signal (1): an error of 0.03 %. By judgement.
pub(super) const CUTOFF_NEGLIGIBLE_SQUARE: f64 = 1e-7;

/// The cut-off if no motion exceeds the noise, as a share of the sampling rate (1). By judgement.
pub(super) const CUTOFF_WITHOUT_MOTION_SHARE: f64 = 0.1;

/// Dropped samples at each end, periods of the cut-off: the transients fall tenfold in each, to 0.1 % of the
/// acceleration. By judgement.
pub(super) const TRIMMED_PERIODS: f64 = 3.0;

/// At most one sample in this many is dropped at each end. By judgement.
pub(super) const TRIM_ONE_IN: f64 = 6.0;

// --- Periods

/// Samples below which no period is searched. By judgement.
pub(super) const PERIOD_FEWEST_SAMPLES: usize = 16;

/// Mean square difference of two motions one period apart above which it is no period; unrelated motions have 1 (1). By
/// judgement.
pub(super) const PERIOD_MOST_DIFFERENCE: f64 = 2e-3;

/// A motion has left its start if its mean square difference from it exceeds this; unrelated motions have 1 (1). By
/// judgement.
pub(super) const PERIOD_LEFT_DIFFERENCE: f64 = 0.3;

/// A motion may have returned if its mean square difference is below this; unrelated motions have 1 (1). By judgement.
pub(super) const PERIOD_RETURNED_DIFFERENCE: f64 = 0.1;

/// Shortest period that may be requested, steps of the recording. By judgement.
pub(super) const PERIOD_SHORTEST_STEPS: f64 = 4.0;

/// Longest period that may be requested, durations of the recording. By judgement.
pub(super) const PERIOD_LONGEST_DURATIONS: f64 = 1.5;

/// A force between two samples further apart than this is not compared between periods, steps of the recording. By
/// judgement.
pub(super) const PHASE_MOST_STEPS: f64 = 1.5;

/// A step of a force above this multiple of the median step is a jump (1). By judgement.
pub(super) const FORCE_JUMP_RATIO: f64 = 8.0;

/// Where a force jumps from one sample to the next, it is not known between these shares of the way (1). By judgement.
pub(super) const FORCE_JUMP_INTERIOR: Range<f64> = 0.02..0.98;

// --- Fourier series

/// Samples below which no series is searched. By judgement.
pub(super) const SERIES_FEWEST_SAMPLES: usize = 64;

/// Samples for each column of a series below which it is not fitted. By judgement.
pub(super) const SERIES_SAMPLES_PER_COLUMN: usize = 2;

/// Most harmonics of a motion. By judgement.
pub(super) const SERIES_MOST_HARMONICS: usize = 100;

/// Highest harmonic of a motion, as a share of the sampling rate (1). By judgement.
pub(super) const SERIES_HIGHEST_SHARE: f64 = 0.2;

/// A signal could continue at its end with its start if they differ by at most this many of its largest steps (1). By
/// judgement.
pub(super) const SERIES_CLOSED_STEPS: f64 = 3.0;

/// They must also differ by at most this share of the range of the signal (1). By judgement; a coarse encoder or a fast
/// motion makes steps of some per cent.
pub(super) const SERIES_CLOSED_SHARE: f64 = 0.1;

/// A line is significant if its power exceeds the mean of the noise by this factor (1). White noise does so once in
/// three million. By judgement.
pub(super) const MIN_LINE_POWER_RATIO: f64 = 15.0;

/// A residual is white if the mean of its lower band exceeds the noise by at most this many standard deviations (1). By
/// judgement.
pub(super) const WHITE_MEAN_SIGMAS: f64 = 5.0;

/// A series with more harmonics is not a planned motion, but fits any motion; the forces must decide then. By
/// judgement.
pub(super) const PLANNED_MOST_HARMONICS: f64 = 25.5;

/// If the residual of a requested series exceeds this share of a motion, the series does not fit (1). By judgement.
pub(super) const MAX_SERIES_RESIDUAL: f64 = 1e-2;

// --- Encoders and standstill

/// Positions are quantised only if at least one step in this many is zero. By judgement.
pub(super) const ENCODER_EQUAL_ONE_IN: usize = 10;

/// A step is an integer multiple of an encoder step if it differs from one by less than this, encoder steps. By
/// judgement.
pub(super) const ENCODER_STEP_TOLERANCE: f64 = 0.02;

/// Positions are quantised if at least this share of their steps are integer multiples of one step (1). By judgement.
pub(super) const ENCODER_ON_GRID_SHARE: f64 = 0.99;

/// Encoder steps are reported if their noise exceeds this share of the accelerations (1). By judgement.
pub(super) const ENCODER_NOISE_SHARE: f64 = 0.005;

/// A coordinate is at standstill if its rate is at most this share of the fastest (1). By judgement.
pub(super) const STANDSTILL_RATE_SHARE: f64 = 0.01;

/// Standstill is reported if more than one sample in this many has it. A motion that reverses sometimes is slow for one
/// or two percent of its time. By judgement, above these.
pub(super) const STANDSTILL_ONE_IN: usize = 10;
