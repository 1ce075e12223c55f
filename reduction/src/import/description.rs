//! A robot as all formats describe it: links in a tree, joints, closures, couplings.

use nalgebra::{Matrix3, Vector3};

use super::placed::DescriptionPose;

/// A robot description.
#[derive(Default)]
pub(crate) struct RobotDescription {
    pub(crate) name: String,
    /// The format, for people.
    pub(crate) format: &'static str,
    /// Acceleration of gravity in world axes, m/s^2; none where the format does not say it.
    pub(crate) gravity: Option<Vector3<f64>>,
    /// Parents stand before their children.
    pub(crate) links: Vec<DescriptionLink>,
    pub(crate) closures: Vec<DescriptionClosure>,
    pub(crate) couplings: Vec<DescriptionCoupling>,
    pub(crate) straight_drives: Vec<StraightDrive>,
    /// Values of joints from which loops are closed, by name of the joint.
    pub(crate) pose: Vec<(String, f64)>,
    /// What was left out or made up.
    pub(crate) remarks: Vec<String>,
}

/// A link and how it moves on its parent.
pub(crate) struct DescriptionLink {
    pub(crate) name: String,
    /// None is the world.
    pub(crate) parent: Option<usize>,
    /// In the frame of the parent where every joint has its `zero`.
    pub(crate) at: DescriptionPose,
    /// One after the other; none where the link is fixed to its parent.
    pub(crate) joints: Vec<DescriptionJoint>,
    pub(crate) inertial: DescriptionInertia,
}

/// What a link weighs; all zero where the description gives nothing.
#[derive(Clone, Copy)]
pub(crate) struct DescriptionInertia {
    pub(crate) mass: f64,
    /// The centre of mass and the axes of `inertia` in the frame of the link.
    pub(crate) at: DescriptionPose,
    /// About the centre of mass, kg m^2.
    pub(crate) inertia: Matrix3<f64>,
}

impl Default for DescriptionInertia {
    fn default() -> Self {
        Self {
            mass: 0.0,
            at: DescriptionPose::identity(),
            inertia: Matrix3::zeros(),
        }
    }
}

/// How a joint moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DescriptionJointKind {
    Revolute,
    Prismatic,
    Ball,
    Free,
}

/// A joint of a link.
#[derive(Clone)]
pub(crate) struct DescriptionJoint {
    pub(crate) name: String,
    /// Line in the description.
    pub(crate) line: u32,
    pub(crate) kind: DescriptionJointKind,
    /// A point of the axis in the frame of the link.
    pub(crate) anchor: Vector3<f64>,
    /// Direction in the axes of the link; its length does not matter.
    pub(crate) axis: Vector3<f64>,
    /// Value of the coordinate at the pose that the description gives.
    pub(crate) zero: f64,
    pub(crate) range: Option<[f64; 2]>,
    pub(crate) rate: Option<f64>,
    pub(crate) force: Option<[f64; 2]>,
    pub(crate) damping: f64,
    pub(crate) friction: f64,
    /// Inertia of the rotor as felt at the joint.
    pub(crate) armature: f64,
    pub(crate) stiffness: f64,
    /// Where the spring is at rest.
    pub(crate) rest: f64,
    pub(crate) is_driven: bool,
}

impl DescriptionJoint {
    pub(crate) fn new(name: String, kind: DescriptionJointKind, line: u32) -> Self {
        Self {
            name,
            line,
            kind,
            anchor: Vector3::zeros(),
            axis: Vector3::z(),
            zero: 0.0,
            range: None,
            rate: None,
            force: None,
            damping: 0.0,
            friction: 0.0,
            armature: 0.0,
            stiffness: 0.0,
            rest: 0.0,
            is_driven: kind != DescriptionJointKind::Free,
        }
    }
}

/// What a closure holds together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ClosureConstraint {
    /// The origins of two frames.
    Origins,
    /// The origins and the x axes: a hinge about x.
    Axes,
    /// All of both frames.
    Frames,
}

/// Two places of links that coincide.
pub(crate) struct DescriptionClosure {
    pub(crate) name: String,
    pub(crate) line: u32,
    /// Link (none is the world) and a frame in it.
    pub(crate) ends: [(Option<usize>, DescriptionPose); 2],
    pub(crate) constraint: ClosureConstraint,
}

/// One joint follows another: `q = ratio*(q of the other) + offset`.
pub(crate) struct DescriptionCoupling {
    pub(crate) line: u32,
    pub(crate) joint: String,
    /// None holds the joint at `offset`.
    pub(crate) leader: Option<String>,
    pub(crate) ratio: f64,
    pub(crate) offset: f64,
}

/// A drive along the straight line between two points of links.
pub(crate) struct StraightDrive {
    pub(crate) name: String,
    /// What the format calls the line itself.
    pub(crate) tendon: String,
    pub(crate) line: u32,
    /// Link (none is the world) and a point in its frame; a force that pushes moves the second from the first.
    pub(crate) ends: [(Option<usize>, Vector3<f64>); 2],
    pub(crate) force: Option<[f64; 2]>,
    pub(crate) damping: f64,
    pub(crate) friction: f64,
    pub(crate) armature: f64,
}
