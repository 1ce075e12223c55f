//! Places, angles and axes as URDF has them and as model files want them.

use nalgebra::{Matrix3, Vector3};

use crate::urdf_file::Pose;

/// Where something is in a frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Placed {
    pub(crate) p: Vector3<f64>,
    pub(crate) r: Matrix3<f64>,
}

impl Placed {
    pub(crate) fn identity() -> Self {
        Self {
            p: Vector3::zeros(),
            r: Matrix3::identity(),
        }
    }

    pub(crate) fn from_pose(pose: &Pose) -> Self {
        Self {
            p: pose.xyz,
            r: rotation(pose.rpy),
        }
    }

    pub(crate) fn then(&self, next: &Self) -> Self {
        Self {
            p: self.p + self.r * next.p,
            r: self.r * next.r,
        }
    }
}

/// `Rz(yaw) Ry(pitch) Rx(roll)`.
fn rotation([roll, pitch, yaw]: [f64; 3]) -> Matrix3<f64> {
    let about = |axis: Vector3<f64>, angle: f64| {
        nalgebra::Rotation3::from_axis_angle(&nalgebra::Unit::new_unchecked(axis), angle)
            .into_inner()
    };
    about(Vector3::z(), yaw) * about(Vector3::y(), pitch) * about(Vector3::x(), roll)
}

/// Roll, pitch and yaw of a rotation; roll is zero where only its sum with yaw counts.
pub(crate) fn roll_pitch_yaw(r: &Matrix3<f64>) -> [f64; 3] {
    let pitch = (-r[(2, 0)]).clamp(-1.0, 1.0).asin();
    if r[(2, 0)].abs() > 1.0 - 1e-12 {
        return [0.0, pitch, (-r[(0, 1)]).atan2(r[(1, 1)])];
    }
    [
        r[(2, 1)].atan2(r[(2, 2)]),
        pitch,
        r[(1, 0)].atan2(r[(0, 0)]),
    ]
}

/// A multiple of a twelfth of pi as an expression.
pub(crate) fn twelfths(n: f64) -> String {
    #[allow(clippy::cast_possible_truncation, reason = "at most 48")]
    let n = n as i64;
    let common = (1..=12)
        .rev()
        .find(|d| n % d == 0 && 12 % d == 0)
        .unwrap_or(1);
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

/// The name of an axis, or z and the rotation that turns z into it.
pub(crate) fn axis(direction: &Vector3<f64>) -> Option<(&'static str, Matrix3<f64>)> {
    let length = direction.norm();
    if !(length > 0.0 && length.is_finite()) {
        return None;
    }
    let unit = direction / length;
    for (k, names) in [["x", "-x"], ["y", "-y"], ["z", "-z"]]
        .into_iter()
        .enumerate()
    {
        if unit[k].abs() > 1.0 - 1e-12 {
            return Some((names[usize::from(unit[k] < 0.0)], Matrix3::identity()));
        }
    }
    let turned = nalgebra::Rotation3::rotation_between(&Vector3::z(), &unit)?;
    Some(("z", turned.into_inner()))
}
