//! A tilted base: gravity is rotated in its frame, and forces are linear in gravity.

use super::column::ForceColumn;

/// Smaller angles are treated as zero, rad.
const STRAIGHT: f64 = 1e-9;

/// A tilt of the base as a candidate; its parameters are angles, rad.
#[derive(Clone, Debug, PartialEq)]
pub struct TiltCandidate {
    /// Gravity in the frame of a level base, m/s^2.
    pub gravity: [f64; 3],
    /// The axis of each parameter: 0, 1, 2 for x, y, z.
    pub axes: Vec<usize>,
    /// Change of the forces with gravity along x, y and z, per m/s^2.
    pub components: [ForceSensitivity; 3],
}

/// Change of the forces with one number of the model, per unit of that number.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ForceSensitivity {
    /// Change of every column of the base, in their order.
    pub base: Vec<ForceColumn>,
    /// Change of the forces of fixed parameters.
    pub fixed: ForceColumn,
}

impl TiltCandidate {
    /// Change of gravity per radian of each parameter, m/(s^2 rad), between a level base and one tilted by `angles`
    /// (rad). Differences that add up to the complete change, so that the result is exact at the angles; derivatives
    /// where an angle is zero.
    #[must_use]
    pub fn directions(&self, angles: &[f64]) -> Vec<[f64; 3]> {
        let mut directions = vec![[0.0; 3]; self.axes.len()];
        let mut now = self.gravity;
        // The base is rotated by Rz Ry Rx, so gravity in its frame is rotated by the inverse, first about z.
        for axis in [2, 1, 0] {
            let Some(k) = self.axes.iter().position(|a| *a == axis) else {
                continue;
            };
            if angles[k].abs() < STRAIGHT {
                directions[k] = rotation_derivative(now, axis);
            } else {
                let turned = rotate_vector(now, axis, angles[k]);
                directions[k] = std::array::from_fn(|c| (turned[c] - now[c]) / angles[k]);
                now = turned;
            }
        }
        directions
    }
}

/// Coordinates of a fixed vector in a frame that has been rotated by an angle (rad) about an axis.
fn rotate_vector(vector: [f64; 3], axis: usize, angle: f64) -> [f64; 3] {
    let (sin, cos) = angle.sin_cos();
    let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut turned = vector;
    turned[i] = cos * vector[i] + sin * vector[j];
    turned[j] = cos * vector[j] - sin * vector[i];
    turned
}

/// Their derivative with respect to the angle, at zero.
fn rotation_derivative(vector: [f64; 3], axis: usize) -> [f64; 3] {
    let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut slope = [0.0; 3];
    slope[i] = vector[j];
    slope[j] = -vector[i];
    slope
}

#[cfg(test)]
mod tests {
    use nalgebra::{Rotation3, Vector3};

    use super::*;

    /// Directions times angles are the complete change, compared with nalgebra's rotations; small angles agree with
    /// zero.
    #[test]
    fn directions_add_up_to_gravity_that_turned() {
        let gravity = [1.0, -9.0, 3.0];
        let tilt = |axes: Vec<usize>| TiltCandidate {
            gravity,
            axes,
            components: std::array::from_fn(|_| ForceSensitivity::default()),
        };
        let [x, y, z] = [0.3, -0.2, 0.7];
        let base = Rotation3::from_euler_angles(x, y, z);
        let expected = base.inverse() * Vector3::from(gravity) - Vector3::from(gravity);
        let directions = tilt(vec![0, 1, 2]).directions(&[x, y, z]);
        let sum: Vector3<f64> = (directions.iter().zip([x, y, z]))
            .map(|(d, angle)| angle * Vector3::from(*d))
            .sum();
        assert!((sum - expected).norm() < 1e-14, "{sum} {expected}");
        for axis in 0..3 {
            let [none, little] = [0.0, 1e-7].map(|a| tilt(vec![axis]).directions(&[a])[0]);
            let distance = (Vector3::from(none) - Vector3::from(little)).norm();
            assert!(distance < 1e-6, "{none:?} {little:?}");
        }
    }
}
