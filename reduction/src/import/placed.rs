//! Poses, angles and axes, in the conventions of robot descriptions and of model files.

use nalgebra::{Matrix3, Quaternion, Rotation3, Unit, UnitQuaternion, Vector3};

/// A pose in a frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DescriptionPose {
    /// Position, m.
    pub(crate) p: Vector3<f64>,
    /// Rotation matrix: columns are the own axes in the frame.
    pub(crate) r: Matrix3<f64>,
}

impl DescriptionPose {
    /// The pose of the frame itself.
    pub(crate) fn identity() -> Self {
        Self {
            p: Vector3::zeros(),
            r: Matrix3::identity(),
        }
    }

    /// The pose with a position in m and roll, pitch and yaw in rad.
    pub(crate) fn from_xyz_rpy(xyz: [f64; 3], rpy: [f64; 3]) -> Self {
        Self {
            p: Vector3::from(xyz),
            r: rotation(rpy),
        }
    }

    /// The pose `next`, given in this pose, in the frame of this pose.
    pub(crate) fn compose(&self, next: &Self) -> Self {
        Self {
            p: self.p + self.r * next.p,
            r: self.r * next.r,
        }
    }

    /// The pose of the frame in this pose.
    pub(crate) fn inverse(&self) -> Self {
        let r = self.r.transpose();
        Self { p: -(r * self.p), r }
    }
}

/// The rotation matrix for an angle in rad about a unit vector.
pub(crate) fn rotation_about(axis: &Vector3<f64>, angle: f64) -> Matrix3<f64> {
    Rotation3::from_axis_angle(&Unit::new_unchecked(*axis), angle).into_inner()
}

/// The rotation matrix `Rz(yaw) Ry(pitch) Rx(roll)`, angles in rad.
pub(crate) fn rotation([roll, pitch, yaw]: [f64; 3]) -> Matrix3<f64> {
    rotation_about(&Vector3::z(), yaw) * rotation_about(&Vector3::y(), pitch) * rotation_about(&Vector3::x(), roll)
}

/// The rotation matrix of a quaternion w, x, y, z of any length; none if it is zero.
pub(crate) fn rotation_from_quaternion([w, x, y, z]: [f64; 4]) -> Option<Matrix3<f64>> {
    let quaternion = Quaternion::new(w, x, y, z);
    let length = quaternion.norm();
    (length > 1e-12 && length.is_finite()).then(|| {
        UnitQuaternion::from_quaternion(quaternion)
            .to_rotation_matrix()
            .into_inner()
    })
}

/// Roll, pitch and yaw of a rotation matrix, rad, with full precision also if pitch is near a right angle.
pub(crate) fn roll_pitch_yaw(r: &Matrix3<f64>) -> [f64; 3] {
    // The pitch from the first column; its cosine is positive.
    let pitch = (-r[(2, 0)]).atan2(r[(0, 0)].hypot(r[(1, 0)]));
    // At a pitch of a right angle only the sum of roll and yaw is defined, and the two entries are rounding.
    let roll = if r[(2, 1)].hypot(r[(2, 2)]) < 1e-14 {
        0.0
    } else {
        r[(2, 1)].atan2(r[(2, 2)])
    };
    // The yaw from the other two columns with the roll removed.
    let (sin, cos) = roll.sin_cos();
    let yaw = (sin * r[(0, 2)] - cos * r[(0, 1)]).atan2(cos * r[(1, 1)] - sin * r[(1, 2)]);
    [roll, pitch, yaw]
}

/// The expression of `n*pi/12` in lowest terms.
pub(crate) fn twelfths_of_pi(n: f64) -> String {
    #[allow(clippy::cast_possible_truncation, reason = "at most 48")]
    let n = n as i64;
    // The greatest common divisor with 12.
    let common = (1..=12).rev().find(|d| n % d == 0 && 12 % d == 0).unwrap_or(1);
    match (n / common, 12 / common) {
        (0, _) => "0".to_owned(),
        (1, 1) => "pi".to_owned(),
        (-1, 1) => "-pi".to_owned(),
        (n, 1) => format!("{n}*pi"),
        (1, d) => format!("pi/{d}"),
        (-1, d) => format!("-pi/{d}"),
        (n, d) => format!("{n}*pi/{d}"),
    }
}

/// The name of a coordinate axis, or else `z` and the rotation that maps z to the direction. None for a zero vector.
pub(crate) fn named_axis(direction: &Vector3<f64>) -> Option<(&'static str, Matrix3<f64>)> {
    let length = direction.norm();
    if !(length > 0.0 && length.is_finite()) {
        return None;
    }
    // A coordinate axis in either direction needs no rotation.
    let unit = direction / length;
    for (k, names) in [["x", "-x"], ["y", "-y"], ["z", "-z"]].into_iter().enumerate() {
        let others = unit[(k + 1) % 3].hypot(unit[(k + 2) % 3]);
        if others < 1e-13 {
            return Some((names[usize::from(unit[k] < 0.0)], Matrix3::identity()));
        }
    }
    let turned = Rotation3::rotation_between(&Vector3::z(), &unit)?;
    Some(("z", turned.into_inner()))
}

/// The smallest rotation that turns one direction into another; `None` if one has no length. For opposite directions it
/// is half a turn about a perpendicular axis.
pub(crate) fn rotation_between_axes(from: &Vector3<f64>, to: &Vector3<f64>) -> Option<Matrix3<f64>> {
    let (from, to) = (from.try_normalize(0.0)?, to.try_normalize(0.0)?);
    let turn = nalgebra::Rotation3::rotation_between(&from, &to);
    Some(turn.map_or_else(
        || {
            let least = from.iamin();
            let across = from.cross(&Vector3::ith(least, 1.0)).normalize();
            2.0 * across * across.transpose() - Matrix3::identity()
        },
        nalgebra::Rotation3::into_inner,
    ))
}
