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

/// Largest length that is believed, m. Few machines have a link this long, while lengths of links in mm are nearly always
/// larger. By judgement.
pub(super) const LARGEST_LENGTH: f64 = 50.0;

/// A periodic table ends at least this far before the argument at which it repeats, rad: a last point closer to it is the
/// first point once more. Well above the rounding of 2 pi to a few digits. By judgement.
pub(super) const TABLE_CLOSURE: f64 = 1e-3;

/// Largest distance between neighbouring points of a periodic table, as a multiple of the mean distance (1). Trigonometric
/// polynomials through points with larger gaps swing far out of the table. By judgement.
pub(super) const LARGEST_TABLE_GAP: f64 = 1.5;

/// A nominal pose whose distance from a fold is below this is reported, rad; for lengths it is multiplied by
/// [`FOLD_LENGTH_SHARE`] and the size of the mechanism. At one hundredth of a radian, passive rates are some ten times those in
/// the middle of the motion. By judgement.
pub(super) const FOLD_DISTANCE: f64 = 0.01;

/// The length that counts as much as a radian at a fold, as a share of the size of the mechanism (1). The moving part of a
/// mechanism is often smaller than the distance of its frames from the base. By judgement.
pub(super) const FOLD_LENGTH_SHARE: f64 = 0.1;

/// Step of the differences that measure the distance from a fold, rad; for lengths as [`FOLD_DISTANCE`]. Small against that,
/// and large against rounding. By judgement.
pub(super) const FOLD_STEP: f64 = 1e-5;
