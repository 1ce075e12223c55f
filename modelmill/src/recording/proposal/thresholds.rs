//! Thresholds of the proposal of columns: the numbers that decide what is paired. Each states what it bounds, its unit,
//! and how it was chosen.

/// Least magnitude of the correlation between a signal and the differences of another one of which it is the rate (1).
/// By judgement.
pub(super) const RATE_LEAST_CORRELATION: f64 = 0.9;

/// As [`RATE_LEAST_CORRELATION`], for signals whose names do not say what they are (1). By judgement.
pub(super) const NAMELESS_LEAST_CORRELATION: f64 = 0.98;

/// Differences of positions are taken over this time to either side, s. By judgement.
pub(super) const STENCIL_SPAN: f64 = 0.02;

/// Least share of steps in which a time increases (1). By judgement.
pub(super) const TIME_LEAST_SHARE: f64 = 0.9;

/// Steps of a time up to this one are taken for seconds, s; the limits of smaller units follow from it. By judgement: no
/// usual sampling rate is near 6.7 Hz or 6.7 kHz, but many logs have 10 Hz, 1 kHz or 5 kHz.
pub(super) const LONGEST_LIKELY_STEP: f64 = 0.15;

/// Least similarity of names that are paired without other evidence, from 0 to 1. By judgement.
pub(super) const NAME_LEAST_SIMILARITY: f64 = 0.3;

/// Largest relative difference of a factor between units from that of a known pair of units (1). By judgement.
pub(super) const UNIT_TOLERANCE: f64 = 0.1;

/// Least share of a force that the model must explain for a pair without names (1). By judgement.
pub(super) const FIT_LEAST_SHARE: f64 = 0.6;

/// A better explained column than the one with the right name is mentioned from this difference of shares on (1). By
/// judgement.
pub(super) const FIT_MARGIN: f64 = 0.3;

/// Angles beyond this magnitude are probably degrees, rad: two turns. It is larger than the bound of the search for faults,
/// which compares both units with the forces, whereas here nothing else decides. By judgement.
pub(super) const LARGEST_ANGLE: f64 = 4.0 * std::f64::consts::PI;

/// Most samples that the model is compared with. By judgement.
pub(super) const FIT_MOST_SAMPLES: usize = 1000;

/// Least magnitude of a negative correlation with the forces of the nominal parameters for a remark on the sign (1). By
/// judgement.
pub(super) const SIGN_LEAST_CORRELATION: f64 = 0.8;
