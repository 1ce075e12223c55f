//! A robot description independent of the format: a tree of links with joints, loop closures and couplings. The readers
//! of the formats produce it; `model_text` writes the model file from it.

use nalgebra::{Matrix3, Vector3};

use super::placed::DescriptionPose;

/// A robot description.
#[derive(Default)]
pub(crate) struct RobotDescription {
    /// Name of the robot.
    pub(crate) name: String,
    /// Name of the format, for messages.
    pub(crate) format: &'static str,
    /// Acceleration of gravity in world axes, m/s^2; none if the format does not specify it.
    pub(crate) gravity: Option<Vector3<f64>>,
    /// Links; parents stand before their children.
    pub(crate) links: Vec<DescriptionLink>,
    /// Loop closures.
    pub(crate) closures: Vec<DescriptionClosure>,
    /// Joints that follow others.
    pub(crate) couplings: Vec<DescriptionCoupling>,
    /// Drives between two points.
    pub(crate) straight_drives: Vec<StraightDrive>,
    /// Values of joints from which loops are closed, by name of the joint; rad or m.
    pub(crate) pose: Vec<(String, f64)>,
    /// What was left out or assumed; one sentence each.
    pub(crate) remarks: Vec<String>,
}

/// A link, its pose and its joints to the parent.
pub(crate) struct DescriptionLink {
    /// Name in the description.
    pub(crate) name: String,
    /// Index of the parent; none is the world.
    pub(crate) parent: Option<usize>,
    /// Pose in the frame of the parent while every joint has its value `zero`.
    pub(crate) at: DescriptionPose,
    /// Joints in sequence; empty if the link is fixed to its parent.
    pub(crate) joints: Vec<DescriptionJoint>,
    /// Mass and inertia.
    pub(crate) inertial: DescriptionInertia,
}

/// Mass and inertia of a link; all zero if the description specifies none.
#[derive(Clone, Copy)]
pub(crate) struct DescriptionInertia {
    /// Mass, kg.
    pub(crate) mass: f64,
    /// The centre of mass and the axes of `inertia` in the frame of the link.
    pub(crate) at: DescriptionPose,
    /// About the centre of mass, in the axes of `at`, kg m^2.
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

/// Kind of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DescriptionJointKind {
    /// One rotation about the axis.
    Revolute,
    /// One translation along the axis.
    Prismatic,
    /// Three rotations about the anchor.
    Ball,
    /// Six degrees of freedom: a body that is not connected to its parent.
    Free,
}

/// A joint of a link.
#[derive(Clone)]
pub(crate) struct DescriptionJoint {
    /// Name in the description.
    pub(crate) name: String,
    /// Line in the description.
    pub(crate) line: u32,
    /// Kind of motion.
    pub(crate) kind: DescriptionJointKind,
    /// A point of the axis in the frame of the link, m.
    pub(crate) anchor: Vector3<f64>,
    /// Direction in the axes of the link, of any length.
    pub(crate) axis: Vector3<f64>,
    /// Value of the coordinate at the pose of the description, rad or m.
    pub(crate) zero: f64,
    /// Limits of the position, rad or m. Limits that are not in ascending order are reported and left out.
    pub(crate) range: Option<[f64; 2]>,
    /// Largest rate, rad/s or m/s.
    pub(crate) rate: Option<f64>,
    /// Limits of the drive's force, N m or N.
    pub(crate) force: Option<[f64; 2]>,
    /// Viscous friction, N m s/rad or N s/m.
    pub(crate) damping: f64,
    /// Coulomb friction, N m or N.
    pub(crate) friction: f64,
    /// Inertia of the rotor reflected to the joint, kg m^2 or kg.
    pub(crate) armature: f64,
    /// Stiffness of a spring, N m/rad or N/m.
    pub(crate) stiffness: f64,
    /// Position at which the spring is relaxed, rad or m.
    pub(crate) rest: f64,
    /// Whether a drive acts on it.
    pub(crate) is_driven: bool,
    /// The controller of its drive.
    pub(crate) servo: Option<JointServo>,
}

/// A controller that is part of a drive: `kp*(command - position) - kd*rate`, or `kd*(command - rate)` without `kp`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct JointServo {
    /// Name of the actuator, under which simulators record its command; empty if it has none.
    pub(crate) name: String,
    /// Stiffness, N m/rad or N/m; `None` for a controller of the rate.
    pub(crate) kp: Option<f64>,
    /// Damping, N m s/rad or N s/m.
    pub(crate) kd: f64,
    /// Delay of the command, s.
    pub(crate) delay: f64,
    /// Largest force, N m or N.
    pub(crate) saturation: Option<f64>,
}

impl DescriptionJoint {
    /// A joint about or along z of the link, driven unless it is free, without limits and losses.
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
            servo: None,
        }
    }

    /// Whether its position, its rate or the force of its drive has limits.
    pub(crate) fn has_limits(&self) -> bool {
        self.range.is_some() || self.rate.is_some() || self.force.is_some()
    }
}

/// Which parts of two frames a closure makes equal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ClosureConstraint {
    /// The origins of two frames.
    Origins,
    /// The origins and the x axes: a hinge about x.
    Axes,
    /// Origins and all axes: a rigid connection.
    Frames,
}

/// A loop closure: two frames of links that coincide fully or in part.
pub(crate) struct DescriptionClosure {
    /// Name in the description, or made from the names of both ends.
    pub(crate) name: String,
    /// Line in the description.
    pub(crate) line: u32,
    /// Link (none is the world) and a frame in it.
    pub(crate) ends: [(Option<usize>, DescriptionPose); 2],
    /// Which parts of the frames coincide.
    pub(crate) constraint: ClosureConstraint,
}

/// One joint follows another: `q = ratio*(q of the other) + offset`.
pub(crate) struct DescriptionCoupling {
    /// Line in the description.
    pub(crate) line: u32,
    /// Name of the joint that follows.
    pub(crate) joint: String,
    /// Name of the joint that it follows; none fixes it at `offset`.
    pub(crate) leader: Option<String>,
    /// Factor of the leader's coordinate.
    pub(crate) ratio: f64,
    /// Constant part, rad or m.
    pub(crate) offset: f64,
}

/// A drive along the straight line between two points of links.
pub(crate) struct StraightDrive {
    /// Name of the actuator.
    pub(crate) name: String,
    /// Name of the tendon.
    pub(crate) tendon: String,
    /// Line in the description.
    pub(crate) line: u32,
    /// Link (none is the world) and a point in its frame, m. A positive force pushes the points apart.
    pub(crate) ends: [(Option<usize>, Vector3<f64>); 2],
    /// Limits of the force, N.
    pub(crate) force: Option<[f64; 2]>,
    /// Viscous friction, N s/m.
    pub(crate) damping: f64,
    /// Coulomb friction, N.
    pub(crate) friction: f64,
    /// Inertia reflected to the length of the line, kg.
    pub(crate) armature: f64,
}
