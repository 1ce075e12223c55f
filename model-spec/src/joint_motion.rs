//! How a coordinate moves what stands behind its joint, and what follows from that: units, and what a drive carries.

use crate::kinds::Carries;
use crate::mechanism::{Coordinate, DriveKind};
use crate::unit::Dimension;

/// Kind of motion of a coordinate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// Angle in rad.
    Revolute,
    /// Length in m.
    Prismatic,
}

impl Motion {
    /// Whether the coordinate is an angle in rad; else it is a length in m.
    pub fn is_angle(self) -> bool {
        match self {
            Self::Revolute => true,
            Self::Prismatic => false,
        }
    }

    /// The field's word for the joint.
    pub fn name(self) -> &'static str {
        match self {
            Self::Revolute => "revolute",
            Self::Prismatic => "prismatic",
        }
    }

    /// The unit of the coordinate.
    pub fn unit(self) -> &'static str {
        if self.is_angle() { "rad" } else { "m" }
    }

    /// What acts on the coordinate.
    pub fn carries(self) -> Carries {
        if self.is_angle() {
            Carries::Torque
        } else {
            Carries::Force
        }
    }

    /// The dimension of the coordinate.
    pub(crate) fn dimension(self) -> Dimension {
        if self.is_angle() {
            Dimension::ONE
        } else {
            Dimension::LENGTH
        }
    }
}

impl DriveKind {
    /// What a drive of this kind carries, among the coordinates of its mechanism.
    pub fn carries(self, coordinates: &[Coordinate]) -> Carries {
        match self {
            Self::Joint(i) => coordinates
                .get(i.0)
                .map_or(Carries::Torque, |one| one.motion.carries()),
            Self::Linear { .. } => Carries::Force,
        }
    }

    /// The unit of the force or torque of a drive of this kind.
    pub fn force_unit(self, coordinates: &[Coordinate]) -> &'static str {
        match self.carries(coordinates) {
            Carries::Torque => "N m",
            _ => "N",
        }
    }
}
