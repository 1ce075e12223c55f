//! Bounds within which motions of a rig count as equal: rounding, or what the gaps that its joints may have amount to.

use modelmill_rig::Rig;

/// Rates out of the plane (m/s, rad/s), gaps of joints (m) and differences of positions (m) and angles (rad) above this
/// are faults of a rig whose joints close, not rounding.
pub(crate) const TOLERANCE: f64 = 1e-6;

/// A loop of the model that is cut at one joint has there the gaps of all its joints; most loops have four.
const JOINTS_OF_LOOP: f64 = 4.0;

/// Hinges of a body that are closer than this, m, do not determine how far gaps turn it.
const LEAST_LENGTH: f64 = 1e-6;

/// Largest distance of two points that count as one, m.
pub(crate) fn distance_tolerance(rig: &Rig) -> f64 {
    TOLERANCE.max(JOINTS_OF_LOOP * rig.gap_tolerance)
}

/// Largest difference between the angles of a body and of another that rotates alike, rad. A gap turns a body the more,
/// the closer its hinges are to each other.
pub(crate) fn angle_tolerance(rig: &Rig, body: usize) -> f64 {
    let length = length_between_hinges(rig, body);
    if length < LEAST_LENGTH {
        return TOLERANCE;
    }
    TOLERANCE.max(JOINTS_OF_LOOP * rig.gap_tolerance / length)
}

/// Largest rate out of the plane of motion, m/s or rad/s, at rates of coordinates up to 1: gaps tilt bodies as they turn
/// them.
pub(crate) fn rate_tolerance(rig: &Rig) -> f64 {
    let bodies = (0..rig.bodies.len()).map(|body| angle_tolerance(rig, body));
    bodies.fold(TOLERANCE, f64::max)
}

/// The largest distance between two hinges of a body, m; 0 if it has one only.
fn length_between_hinges(rig: &Rig, body: usize) -> f64 {
    let hinges = (0..rig.joints.len()).filter_map(|joint| rig.hinge(joint)).flatten();
    let places: Vec<_> = hinges
        .filter(|place| place.body == Some(body))
        .map(|place| place.at)
        .collect();
    let distances = places.iter().flat_map(|a| places.iter().map(move |b| (a - b).norm()));
    distances.fold(0.0, f64::max)
}
