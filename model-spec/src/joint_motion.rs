//! How a coordinate moves what stands behind its joint, and what follows from that: units, and what a drive carries.

use crate::kinds::PlaceLoad;
use crate::mechanism::{DriveKind, JointCoordinate};
use crate::unit::UnitDimension;

/// Kind of motion of a coordinate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CoordinateMotion {
    /// Angle in rad.
    Revolute,
    /// Length in m.
    Prismatic,
    /// Component of the vector part of a free body's unit quaternion. Its rate is the body's angular velocity about the same
    /// axis, in rad/s, and not the component's own derivative.
    Quaternion,
    /// The scalar part, which has no rate of its own.
    QuaternionScalar,
}

impl CoordinateMotion {
    /// Whether the coordinate is an angle in rad; else it is a length in m.
    pub fn is_angle(self) -> bool {
        match self {
            Self::Revolute => true,
            Self::Prismatic | Self::Quaternion | Self::QuaternionScalar => false,
        }
    }

    /// Whether the coordinate is a length in m.
    pub fn is_length(self) -> bool {
        self == Self::Prismatic
    }

    /// Whether it is a component of a quaternion.
    pub fn is_quaternion(self) -> bool {
        matches!(self, Self::Quaternion | Self::QuaternionScalar)
    }

    /// Whether a rate belongs to the coordinate; else its place among the rates and accelerations is not read.
    pub fn has_rate(self) -> bool {
        self != Self::QuaternionScalar
    }

    /// The field's word for the joint.
    pub fn name(self) -> &'static str {
        match self {
            Self::Revolute => "revolute",
            Self::Prismatic => "prismatic",
            Self::Quaternion => "quaternion, vector part",
            Self::QuaternionScalar => "quaternion, scalar part",
        }
    }

    /// The unit of the coordinate.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Revolute => "rad",
            Self::Prismatic => "m",
            Self::Quaternion | Self::QuaternionScalar => "1",
        }
    }

    /// What acts on the coordinate.
    pub fn place_load(self) -> PlaceLoad {
        if self.is_length() {
            PlaceLoad::Force
        } else {
            PlaceLoad::Torque
        }
    }

    /// The dimension of the coordinate.
    pub(crate) fn dimension(self) -> UnitDimension {
        if self.is_length() {
            UnitDimension::LENGTH
        } else {
            UnitDimension::ONE
        }
    }
}

impl DriveKind {
    /// What a drive of this kind carries, among the coordinates of its mechanism.
    pub fn place_load(self, coordinates: &[JointCoordinate]) -> PlaceLoad {
        match self {
            Self::Joint(i) => coordinates
                .get(i.0)
                .map_or(PlaceLoad::Torque, |one| one.motion.place_load()),
            Self::Linear { .. } => PlaceLoad::Force,
        }
    }

    /// The unit of the force or torque of a drive of this kind.
    pub fn force_unit(self, coordinates: &[JointCoordinate]) -> &'static str {
        match self.place_load(coordinates) {
            PlaceLoad::Torque => "N m",
            _ => "N",
        }
    }
}
