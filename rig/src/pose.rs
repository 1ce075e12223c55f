//! Poses, rates and accelerations of bodies, each body by itself: maximal coordinates.
//!
//! An orientation is a unit quaternion. A step adds half the rotation vector times the quaternion, which is exact to
//! first order and needs only a square root, so that every machine computes the same bits. Source: R. Featherstone,
//! "Rigid Body Dynamics Algorithms" (2008), section 2 (rates of points of a body).

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

/// Position of a body's frame in the base frame W: origin, m, and orientation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyPose {
    /// The frame's origin.
    pub p_WB_W: Vector3<f64>,
    /// Rotates vectors of the body into the base frame.
    pub q_WB: UnitQuaternion<f64>,
}

impl BodyPose {
    /// The base frame itself.
    pub fn identity() -> Self {
        Self {
            p_WB_W: Vector3::zeros(),
            q_WB: UnitQuaternion::identity(),
        }
    }

    /// From an origin, m, and roll, pitch and yaw, rad: `Rz(yaw) Ry(pitch) Rx(roll)`.
    pub fn from_xyz_rpy(xyz: Vector3<f64>, rpy: Vector3<f64>) -> Self {
        let about = |axis: usize, angle: f64| {
            let mut part = Vector3::zeros();
            part[axis] = libm::sin(angle / 2.0);
            UnitQuaternion::new_normalize(Quaternion::from_parts(libm::cos(angle / 2.0), part))
        };
        Self {
            p_WB_W: xyz,
            q_WB: about(2, rpy[2]) * about(1, rpy[1]) * about(0, rpy[0]),
        }
    }

    /// The pose after a small displacement of the origin and a small rotation, both in the base frame.
    pub(crate) fn displaced_by(&self, by: &Vector3<f64>, turn: &Vector3<f64>) -> Self {
        let half = Quaternion::from_parts(0.0, turn * 0.5);
        let q = self.q_WB.into_inner();
        Self {
            p_WB_W: self.p_WB_W + by,
            q_WB: UnitQuaternion::new_normalize(q + half * q),
        }
    }
}

/// A body in motion, all in the base frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyMotion {
    /// Pose.
    pub pose: BodyPose,
    /// Orientation as a matrix.
    pub R_WB: Matrix3<f64>,
    /// Velocity of the frame's origin, m/s.
    pub v_WB_W: Vector3<f64>,
    /// Angular velocity, rad/s.
    pub w_WB_W: Vector3<f64>,
    /// Acceleration of the frame's origin, m/s^2.
    pub a_WB_W: Vector3<f64>,
    /// Angular acceleration, rad/s^2.
    pub alpha_WB_W: Vector3<f64>,
}

impl BodyMotion {
    /// A body at standstill.
    pub(crate) fn at_standstill(pose: BodyPose) -> Self {
        Self {
            pose,
            R_WB: pose.q_WB.to_rotation_matrix().into_inner(),
            v_WB_W: Vector3::zeros(),
            w_WB_W: Vector3::zeros(),
            a_WB_W: Vector3::zeros(),
            alpha_WB_W: Vector3::zeros(),
        }
    }

    /// Position in the base frame of a point with position `p` in the body's frame, m.
    pub fn point_position(&self, p: &Vector3<f64>) -> Vector3<f64> {
        self.pose.p_WB_W + self.R_WB * p
    }

    /// Velocity in the base frame of a point with position `p` in the body's frame, m/s.
    pub fn point_velocity(&self, p: &Vector3<f64>) -> Vector3<f64> {
        self.v_WB_W + self.w_WB_W.cross(&(self.R_WB * p))
    }

    /// Acceleration in the base frame of a point with position `p` in the body's frame, m/s^2.
    pub fn point_acceleration(&self, p: &Vector3<f64>) -> Vector3<f64> {
        let arm = self.R_WB * p;
        self.a_WB_W + self.alpha_WB_W.cross(&arm) + self.centripetal(&arm)
    }

    /// The part of the acceleration at the end of an arm that depends on the angular velocity.
    pub(crate) fn centripetal(&self, arm: &Vector3<f64>) -> Vector3<f64> {
        self.w_WB_W.cross(&self.w_WB_W.cross(arm))
    }
}
