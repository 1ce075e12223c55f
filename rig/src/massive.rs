//! Effects with mass: rods along drives, masses at points, masses that moments see elsewhere, and a tilted base.
//!
//! The motion of the bodies goes in; forces and moments that the bodies must supply besides come out, or gravity.
//! Source: Newton and Euler's equations of a slender rod that a pivot holds at one point and a slide across itself
//! at another.
//!
//! Decision: a rod, a tool or a tilted base acts on the bodies here and is no term at a drive, so that friction by
//! load includes it.

use nalgebra::{Matrix3, Vector3};

use crate::dynamics::base;
use crate::effect::{Effect, Law, Place};
use crate::kinematics::Motion;
use crate::pair::Anchor;
use crate::pose::BodyMotion;
use crate::rig::Rig;

/// Gravity as the bodies of a rig with all its effects feel it, m/s^2.
pub(crate) fn gravity(rig: &Rig) -> Vector3<f64> {
    let mut gravity = rig.gravity;
    for effect in &rig.effects {
        if let Law::GravityTilt { tx, ty, tz } = effect.law {
            gravity = turn(Vector3::new(tx, ty, tz)).transpose() * gravity;
        }
    }
    gravity
}

/// The rotation of a rotation vector (O. Rodrigues 1840).
fn turn(by: Vector3<f64>) -> Matrix3<f64> {
    let angle = by.norm();
    if angle == 0.0 {
        return Matrix3::identity();
    }
    let k = (by / angle).cross_matrix();
    Matrix3::identity() + k * libm::sin(angle) + k * k * (1.0 - libm::cos(angle))
}

/// Calls `add` with each body, a force on it and its moment about the body's origin, which an effect needs for the
/// motion of its masses.
pub(crate) fn supply(
    rig: &Rig,
    effect: &Effect,
    motion: &Motion,
    gravity: &Vector3<f64>,
    add: &mut impl FnMut(usize, Vector3<f64>, Vector3<f64>),
) {
    let mut push = |anchor: &Anchor, force: Vector3<f64>| {
        if let Some(body) = anchor.body {
            add(
                body,
                force,
                (motion.bodies[body].R_WB * anchor.at).cross(&force),
            );
        }
    };
    match effect.law {
        Law::PointMass { m } => {
            for place in &effect.places {
                if let Some(anchor) = point(rig, *place) {
                    let a = moves(motion, &anchor).acceleration(&anchor.at);
                    push(&anchor, m * (a - gravity));
                }
            }
        }
        Law::LumpedMassPlacement { m } => {
            let [true_place, seen] = effect.places[..] else {
                return;
            };
            if let (Some(from), Some(to)) = (point(rig, true_place), point(rig, seen))
                && let Some(body) = from.body
            {
                let moves = &motion.bodies[body];
                let moment = |at: &Vector3<f64>| {
                    (moves.R_WB * at).cross(&(moves.acceleration(at) - gravity))
                };
                add(
                    body,
                    Vector3::zeros(),
                    m * (moment(&to.at) - moment(&from.at)),
                );
            }
        }
        Law::RodInertia { m, c, I } => {
            for place in &effect.places {
                if let Some(pair) = place.pair(rig) {
                    let [pivot, slide] = rod(motion, [&pair.from, &pair.to], m, c, I, gravity);
                    push(&pair.from, pivot);
                    push(&pair.to, slide);
                }
            }
        }
        _ => {}
    }
}

/// Forces that a rod needs at its pivot and, across itself, at its slide.
fn rod(
    motion: &Motion,
    ends: [&Anchor; 2],
    m: f64,
    c: f64,
    inertia: f64,
    gravity: &Vector3<f64>,
) -> [Vector3<f64>; 2] {
    let [one, two] = ends.map(|anchor| {
        let moves = moves(motion, anchor);
        [
            moves.place(&anchor.at),
            moves.velocity(&anchor.at),
            moves.acceleration(&anchor.at),
        ]
    });
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
    // The rod does not turn about itself, so that its angular acceleration is u x u''.
    let alpha = u.cross(&udd);
    let force = m * (one[2] + c * udd - gravity);
    let moment = c * u.cross(&force) + inertia * alpha;
    let slide = moment.cross(&u) / length;
    [force - slide, slide]
}

fn moves(motion: &Motion, anchor: &Anchor) -> BodyMotion {
    anchor.body.map_or_else(base, |body| motion.bodies[body])
}

fn point(rig: &Rig, place: Place) -> Option<Anchor> {
    match place {
        Place::Point(at) => Some(rig.points.get(at)?.anchor),
        _ => None,
    }
}

/// Energy of all masses that effects add, J, beside the potential zero at the base frame's origin.
pub(crate) fn energy(rig: &Rig, motion: &Motion, gravity: &Vector3<f64>) -> f64 {
    let mut sum = 0.0;
    for effect in &rig.effects {
        for place in &effect.places {
            match effect.law {
                Law::PointMass { m } => {
                    if let Some(anchor) = point(rig, *place) {
                        let moves = moves(motion, &anchor);
                        sum += m
                            * (0.5 * moves.velocity(&anchor.at).norm_squared()
                                - gravity.dot(&moves.place(&anchor.at)));
                    }
                }
                Law::RodInertia { m, c, I } => {
                    if let Some(pair) = place.pair(rig) {
                        let [one, two] = [&pair.from, &pair.to].map(|anchor| {
                            let moves = moves(motion, anchor);
                            [moves.place(&anchor.at), moves.velocity(&anchor.at)]
                        });
                        let d = two[0] - one[0];
                        let u = d / d.norm();
                        let dd = two[1] - one[1];
                        let ud = (dd - u.dot(&dd) * u) / d.norm();
                        sum += 0.5 * m * (one[1] + c * ud).norm_squared()
                            + 0.5 * I * ud.norm_squared()
                            - m * gravity.dot(&(one[0] + c * u));
                    }
                }
                _ => {}
            }
        }
    }
    sum
}
