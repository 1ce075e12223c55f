//! A rig: bodies, joints, drives, effects and sensors, checked and ready for simulation.

use nalgebra::{Matrix3, Vector3};

use crate::effect::RigEffect;
use crate::pair::{BodyAnchor, PairFunction};
use crate::pose::BodyPose;
use crate::sensor::RigSensors;

/// A full-body description of a machine. [`crate::load`] reads one.
#[derive(Clone, Debug, PartialEq)]
pub struct Rig {
    /// Name.
    pub name: String,
    /// What it is, in one line; may be empty.
    pub title: String,
    /// Acceleration of gravity in the base frame, m/s^2.
    pub gravity: Vector3<f64>,
    /// Bodies.
    pub bodies: Vec<RigBody>,
    /// Named places on bodies and on the base.
    pub points: Vec<RigPoint>,
    /// Masses concentrated at points.
    pub lumped_masses: Vec<RigLumpedMass>,
    /// Joints.
    pub joints: Vec<RigJoint>,
    /// Coordinates that the trajectory prescribes, one per degree of freedom.
    pub coordinates: Vec<RigCoordinate>,
    /// Drives, one per degree of freedom.
    pub drives: Vec<RigDrive>,
    /// Friction and other effects.
    pub effects: Vec<RigEffect>,
    /// Sampling and errors of the sensors.
    pub sensors: RigSensors,
    /// Seed of the noise, if the user requests none.
    pub seed: u64,
    /// Largest gap that joints may have after they are closed as far as possible, m or rad. 0, the value of every rig
    /// that is read: joints must close up to rounding.
    pub gap_tolerance: f64,
}

impl Rig {
    /// The two points between which a linear drive acts; `None` for a drive in a joint.
    pub fn ends_of_drive(&self, drive: usize) -> Option<[BodyAnchor; 2]> {
        let pair = &self.drives.get(drive)?.measures;
        pair.is_distance().then_some([pair.from, pair.to])
    }

    /// The places of a revolute joint on its two bodies; `None` for other joints.
    pub fn hinge(&self, joint: usize) -> Option<[BodyAnchor; 2]> {
        let pair = self.joints.get(joint)?.motion.as_ref()?;
        pair.is_angle().then_some([pair.from, pair.to])
    }

    /// The coordinate that measures a joint.
    pub fn coordinate_of_joint(&self, joint: usize) -> Option<usize> {
        let pair = self.joints.get(joint)?.motion.as_ref()?;
        self.coordinates.iter().position(|c| &c.measures == pair)
    }

    /// The coordinate that a drive moves directly, because both measure the same.
    pub fn coordinate_of_drive(&self, drive: usize) -> Option<usize> {
        let pair = &self.drives.get(drive)?.measures;
        self.coordinates.iter().position(|c| &c.measures == pair)
    }
}

/// A rigid body.
#[derive(Clone, Debug, PartialEq)]
pub struct RigBody {
    /// Name.
    pub name: String,
    /// Pose of its frame in the nominal configuration.
    pub nominal: BodyPose,
    /// Mass, kg.
    pub mass: f64,
    /// Centre of mass in the body's frame, m.
    pub centre: Vector3<f64>,
    /// Inertia about the centre of mass along the body's axes, kg m^2.
    pub inertia: Matrix3<f64>,
}

/// A named place on a body or on the base.
#[derive(Clone, Debug, PartialEq)]
pub struct RigPoint {
    /// Name.
    pub name: String,
    /// The place.
    pub anchor: BodyAnchor,
}

/// A mass at a point of a body.
#[derive(Clone, Debug, PartialEq)]
pub struct RigLumpedMass {
    /// Mass, kg.
    pub mass: f64,
    /// The place where it acts in the balance of forces.
    pub at: BodyAnchor,
    /// The place, in the body's frame, m, where it acts in the balance of moments about the body's frame. For a real
    /// mass both places are the same. Some reduced models use two places, and a rig can copy them.
    pub moment_at: Vector3<f64>,
}

/// A joint as the equations that it imposes.
#[derive(Clone, Debug, PartialEq)]
pub struct RigJoint {
    /// Name.
    pub name: String,
    /// Functions of the poses, each with its constant value.
    pub(crate) equations: Vec<(PairFunction, f64)>,
    /// Its coordinate, if it has exactly one: an angle or a displacement.
    pub(crate) motion: Option<PairFunction>,
}

/// A coordinate that the trajectory prescribes.
#[derive(Clone, Debug, PartialEq)]
pub struct RigCoordinate {
    /// Name, which is that of its column.
    pub name: String,
    /// What it measures.
    pub(crate) measures: PairFunction,
}

/// A drive.
#[derive(Clone, Debug, PartialEq)]
pub struct RigDrive {
    /// Name, which is that of its column.
    pub name: String,
    /// Its own length or angle; a positive force or torque increases it.
    pub(crate) measures: PairFunction,
}
