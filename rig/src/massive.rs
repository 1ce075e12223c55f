//! Effects with mass: rods along drives, masses at points, masses with another place in the moments, and a tilted base.
//!
//! The motion of the bodies goes in. The additional forces and moments on the bodies, or gravity, come out.
//! Source: Newton and Euler's equations of a slender rod with a pivot at one point and a guide along the rod
//! at another.
//!
//! Decision: a rod, a tool or a tilted base acts on the bodies here and is no term at a drive, so that friction by
//! load includes it.

use nalgebra::{Matrix3, Vector3};

use crate::dynamics::base_motion;
use crate::effect::{RigEffect, RigLaw, RigPlace};
use crate::kinematics::RigMotion;
use crate::pair::BodyAnchor;
use crate::pose::BodyMotion;
use crate::rig::Rig;

/// Gravity that acts on the bodies of a rig with all its effects, in the base frame, m/s^2.
pub(crate) fn gravity(rig: &Rig) -> Vector3<f64> {
    let mut gravity = rig.gravity;
    for effect in &rig.effects {
        if let RigLaw::GravityTilt { tx, ty, tz } = effect.law {
            gravity = rotation_from_vector(Vector3::new(tx, ty, tz)).transpose() * gravity;
        }
    }
    gravity
}

/// The rotation matrix of a rotation vector (O. Rodrigues 1840).
fn rotation_from_vector(by: Vector3<f64>) -> Matrix3<f64> {
    let angle = by.norm();
    if angle == 0.0 {
        // R = 1 + K sin(angle) + K^2 (1 - cos(angle)), with K the cross-product matrix of the unit axis.
        return Matrix3::identity();
    }
    let k = (by / angle).cross_matrix();
    Matrix3::identity() + k * libm::sin(angle) + k * k * (1.0 - libm::cos(angle))
}

/// Calls `add` with each body, a force on it in N and its moment about the body's origin in N m, which an effect needs
/// for the motion of its masses.
pub(crate) fn inertial_forces(
    rig: &Rig,
    effect: &RigEffect,
    motion: &RigMotion,
    gravity: &Vector3<f64>,
    add: &mut impl FnMut(usize, Vector3<f64>, Vector3<f64>),
) {
    // A force at a place of a body acts on the body with its moment about the body's origin; the base takes any force.
    let mut push = |anchor: &BodyAnchor, force: Vector3<f64>| {
        if let Some(body) = anchor.body {
            add(body, force, (motion.bodies[body].R_WB * anchor.at).cross(&force));
        }
    };
    match effect.law {
        RigLaw::PointMass { m } => {
            for place in &effect.places {
                // Newton: m (a - g) at each place.
                if let Some(anchor) = point_anchor(rig, *place) {
                    let a = anchor_motion(motion, &anchor).point_acceleration(&anchor.at);
                    push(&anchor, m * (a - gravity));
                }
            }
        }
        RigLaw::LumpedMassPlacement { m } => {
            let [true_place, seen] = effect.places[..] else {
                return;
            };
            // The force stays the same; only its moment is that of the mass at the second point instead of the first.
            if let (Some(from), Some(to)) = (point_anchor(rig, true_place), point_anchor(rig, seen))
                && let Some(body) = from.body
            {
                let moves = &motion.bodies[body];
                let moment = |at: &Vector3<f64>| (moves.R_WB * at).cross(&(moves.point_acceleration(at) - gravity));
                add(body, Vector3::zeros(), m * (moment(&to.at) - moment(&from.at)));
            }
        }
        RigLaw::RodInertia { m, c, I } => {
            for place in &effect.places {
                // A rod goes from the first point of a drive to the second.
                if let Some(pair) = place.pair(rig) {
                    let [pivot, slide] = rod_forces(motion, [&pair.from, &pair.to], m, c, I, gravity);
                    push(&pair.from, pivot);
                    push(&pair.to, slide);
                }
            }
        }
        _ => {}
    }
}

/// Forces that a rod needs at its pivot and, perpendicular to itself, at its guide, N.
fn rod_forces(
    motion: &RigMotion,
    ends: [&BodyAnchor; 2],
    m: f64,
    c: f64,
    inertia: f64,
    gravity: &Vector3<f64>,
) -> [Vector3<f64>; 2] {
    let [one, two] = ends.map(|anchor| {
        let moves = anchor_motion(motion, anchor);
        [
            moves.point_position(&anchor.at),
            moves.point_velocity(&anchor.at),
            moves.point_acceleration(&anchor.at),
        ]
    });
    // Vector from the pivot to the guide, with its rate and acceleration.
    let [d, dd, ddd] = [0, 1, 2].map(|k| two[k] - one[k]);
    let length = d.norm();
    if length == 0.0 {
        return [Vector3::zeros(); 2];
    }
    // Direction with its derivatives: d = length * u.
    let u = d / length;
    let rate = u.dot(&dd);
    let ud = (dd - rate * u) / length;
    let acceleration = ud.dot(&dd) + u.dot(&ddd);
    let udd = (ddd - acceleration * u - 2.0 * rate * ud) / length;
    // The rod does not rotate about itself, so its angular acceleration is u x u''.
    let alpha = u.cross(&udd);
    // Newton's equation for the centre, at distance c from the pivot, and Euler's equation about the pivot.
    let force = m * (one[2] + c * udd - gravity);
    let moment = c * u.cross(&force) + inertia * alpha;
    // The guide balances the moment by a force perpendicular to the rod; the pivot takes the rest of the force.
    let slide = moment.cross(&u) / length;
    [force - slide, slide]
}

/// The motion of the body that carries a place.
fn anchor_motion(motion: &RigMotion, anchor: &BodyAnchor) -> BodyMotion {
    anchor.body.map_or_else(base_motion, |body| motion.bodies[body])
}

/// The place of a point; `None` for other places and unknown indices.
fn point_anchor(rig: &Rig, place: RigPlace) -> Option<BodyAnchor> {
    match place {
        RigPlace::Point(at) => Some(rig.points.get(at)?.anchor),
        _ => None,
    }
}

/// Energy of all masses of effects, J; the potential energy is zero at the base frame's origin.
pub(crate) fn energy(rig: &Rig, motion: &RigMotion, gravity: &Vector3<f64>) -> f64 {
    let mut sum = 0.0;
    for effect in &rig.effects {
        for place in &effect.places {
            match effect.law {
                RigLaw::PointMass { m } => {
                    if let Some(anchor) = point_anchor(rig, *place) {
                        let moves = anchor_motion(motion, &anchor);
                        // Kinetic energy minus the potential of gravity.
                        sum += m
                            * (0.5 * moves.point_velocity(&anchor.at).norm_squared()
                                - gravity.dot(&moves.point_position(&anchor.at)));
                    }
                }
                RigLaw::RodInertia { m, c, I } => {
                    if let Some(pair) = place.pair(rig) {
                        let [one, two] = [&pair.from, &pair.to].map(|anchor| {
                            let moves = anchor_motion(motion, anchor);
                            [moves.point_position(&anchor.at), moves.point_velocity(&anchor.at)]
                        });
                        // Direction of the rod and its rate.
                        let d = two[0] - one[0];
                        let u = d / d.norm();
                        let dd = two[1] - one[1];
                        let ud = (dd - u.dot(&dd) * u) / d.norm();
                        sum += 0.5 * m * (one[1] + c * ud).norm_squared() + 0.5 * I * ud.norm_squared()
                            - m * gravity.dot(&(one[0] + c * u));
                    }
                }
                _ => {}
            }
        }
    }
    sum
}
