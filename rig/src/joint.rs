//! Kinds of joints: each is a set of functions of two bodies' poses that are constant.
//!
//! A place on both bodies and an axis in the base frame go in; the equations and the joint's own coordinate come
//! out. Source: E. Haug, "Computer Aided Kinematics and Dynamics of Mechanical Systems" (1989), table 9.4.

use nalgebra::Vector3;

use crate::pair::{BodyAnchor, PairFunction, PairQuantity};
use crate::pose::{BodyMotion, BodyPose};

/// The motion that a joint allows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RigJointKind {
    /// No motion.
    Fixed,
    /// Rotation about the axis.
    Revolute,
    /// Displacement along the axis.
    Prismatic,
    /// Rotation about the axis and displacement along it.
    Cylindrical,
    /// Rotation about the place.
    Spherical,
    /// Displacement in the plane perpendicular to the axis, and rotation about the axis.
    Planar,
    /// A point of the second body is on a line of the first.
    PointOnLine,
}

impl RigJointKind {
    /// Names in rig files.
    pub(crate) const NAMES: [&'static str; 7] = [
        "fixed",
        "revolute",
        "prismatic",
        "cylindrical",
        "spherical",
        "planar",
        "point_on_line",
    ];

    /// The kind of a name.
    pub(crate) fn from_name(name: &str) -> Option<Self> {
        // In the order of `NAMES`.
        const KINDS: [RigJointKind; 7] = [
            RigJointKind::Fixed,
            RigJointKind::Revolute,
            RigJointKind::Prismatic,
            RigJointKind::Cylindrical,
            RigJointKind::Spherical,
            RigJointKind::Planar,
            RigJointKind::PointOnLine,
        ];
        let at = Self::NAMES.iter().position(|known| *known == name)?;
        Some(KINDS[at])
    }
}

/// Equations of a joint, each with its constant value, and its coordinate if it has exactly one.
///
/// `axis` is a unit vector in the base frame while the bodies are at `poses`.
pub(crate) fn equations(
    kind: RigJointKind,
    from: BodyAnchor,
    to: BodyAnchor,
    axis: &Vector3<f64>,
    poses: [BodyPose; 2],
) -> (Vec<(PairFunction, f64)>, Option<PairFunction>) {
    let (u, v) = perpendicular_axes(axis);
    // `on` gives a direction of the base frame in the frame of either body.
    let on = |side: usize, direction: &Vector3<f64>| poses[side].q_WB.inverse() * direction;
    let pair = |shape| PairFunction { from, to, shape };
    // The two places coincide.
    let coincident = || [Vector3::x(), Vector3::y(), Vector3::z()].map(|n| pair(PairQuantity::Component(n)));
    // The place on the second body is on the axis of the first.
    let on_line = || [&u, &v].map(|n| pair(PairQuantity::Along(on(0, n))));
    // The axes of both bodies are parallel.
    let parallel = || [&u, &v].map(|n| pair(PairQuantity::Cosine(on(0, n), on(1, axis))));
    // The bodies do not rotate relative to each other: three pairs of perpendicular directions.
    let locked = || [(&u, &v), (&v, axis), (axis, &u)].map(|(a, b)| pair(PairQuantity::Cosine(on(0, a), on(1, b))));
    let mut held: Vec<PairFunction> = Vec::new();
    let mut motion = None;
    match kind {
        RigJointKind::Fixed => {
            held.extend(coincident());
            held.extend(locked());
        }
        RigJointKind::Revolute => {
            held.extend(coincident());
            held.extend(parallel());
            motion = Some(pair(PairQuantity::Angle {
                axis: on(0, axis),
                x: on(0, &u),
                x_to: on(1, &u),
                offset: 0.0,
            }));
        }
        RigJointKind::Prismatic => {
            held.extend(on_line());
            held.extend(locked());
            motion = Some(pair(PairQuantity::Along(on(0, axis))));
        }
        RigJointKind::Cylindrical => {
            held.extend(on_line());
            held.extend(parallel());
        }
        RigJointKind::Spherical => held.extend(coincident()),
        RigJointKind::Planar => {
            held.push(pair(PairQuantity::Along(on(0, axis))));
            held.extend(parallel());
        }
        RigJointKind::PointOnLine => held.extend(on_line()),
    }
    (held.into_iter().map(|pair| (pair, 0.0)).collect(), motion)
}

/// Sets the value that a joint's coordinate has while the bodies are at `poses`.
pub(crate) fn set_nominal(motion: &mut PairFunction, nominal: f64, poses: &[BodyPose]) {
    let bodies: Vec<BodyMotion> = poses.iter().map(|pose| BodyMotion::at_standstill(*pose)).collect();
    let base = BodyMotion::at_standstill(BodyPose::identity());
    let value = motion.derive(&bodies, &base).value;
    match &mut motion.shape {
        PairQuantity::Angle { offset, .. } => *offset += nominal - value,
        // The anchor of the second body moves along the axis, in which direction the joint is not constrained.
        PairQuantity::Along(axis) => {
            let turned = |body: Option<usize>| body.map_or(base.pose.q_WB, |b| poses[b].q_WB);
            let axis_W = turned(motion.from.body) * *axis;
            motion.to.at += turned(motion.to.body).inverse() * axis_W * (nominal - value);
        }
        PairQuantity::Component(_) | PairQuantity::Cosine(..) | PairQuantity::Distance => {}
    }
}

/// Two unit vectors that form a right-handed triad with a unit vector.
fn perpendicular_axes(axis: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let mut other = Vector3::zeros();
    other[axis.iamin()] = 1.0;
    let v = axis.cross(&other).normalize();
    (v.cross(axis), v)
}
