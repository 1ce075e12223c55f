//! The kind of motion of a coordinate, and its consequences: units, and the load of a drive.

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
    /// Component of the vector part of a free body's unit quaternion. Its rate is the body's angular velocity about
    /// the same axis, in rad/s, and not the derivative of the component.
    Quaternion,
    /// The scalar part of such a quaternion, which has no rate of its own.
    QuaternionScalar,
}

impl CoordinateMotion {
    /// Whether the coordinate is an angle in rad.
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

    /// Whether the coordinate has a rate. If not, its entries in vectors of rates and accelerations are ignored.
    pub fn has_rate(self) -> bool {
        self != Self::QuaternionScalar
    }

    /// The common name of such a joint.
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

    /// Whether a force or a torque acts on the coordinate.
    ///
    /// The vector part of a quaternion carries a torque, dual to its angular velocity.
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
    /// Whether a drive of this kind has a force or a torque; `coordinates` are those of its mechanism.
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
