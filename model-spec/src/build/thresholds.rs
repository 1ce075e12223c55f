//! Limits of plausible values.

use std::f64::consts::TAU;

/// Largest nominal value of an angle that is believed, rad: one turn. Nobody describes a pose or a fixed angle by more,
/// while angles in degrees are nearly always larger. By judgement.
pub(super) const LARGEST_ANGLE: f64 = TAU;

/// Largest limit of an angle that is believed, rad: four turns, as for joints that reach far around. Limits of 30
/// degrees and more are larger. By judgement.
pub(super) const LARGEST_ANGLE_LIMIT: f64 = 4.0 * TAU;

/// Limits above this value stand for no limit at all and are not judged, rad. By judgement.
pub(super) const NO_LIMIT: f64 = 1000.0;
