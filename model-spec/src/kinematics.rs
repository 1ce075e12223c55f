//! Poses of frames and points in the base frame at the nominal values, in double precision, and their derivatives.
//!
//! A mechanism goes in; positions and Jacobians by all coordinates come out, for the checks of the nominal pose.

use crate::exact::{CoordinateIdx, ModelSymbol};
use crate::mechanism::{FrameAxis, FrameStep, Mechanism, PointIdx};

/// Components along the axes of the base frame.
pub(crate) type Vec3 = [f64; 3];

/// The motion of one coordinate between a frame and its parent.
pub(crate) struct PathMotion {
    /// The coordinate.
    pub(crate) coordinate: CoordinateIdx,
    /// Factor of the coordinate in the angle or length.
    pub(crate) factor: f64,
    /// True for a rotation about the axis, false for a translation along it.
    pub(crate) is_rotation: bool,
    /// Unit vector in the base frame.
    pub(crate) axis: Vec3,
    /// A point on the axis in the base frame, m.
    pub(crate) origin: Vec3,
}

/// A frame in the base frame, and the motions between its parent and it.
pub(crate) struct FramePose {
    /// Rotation R_WF by rows; its columns are the axes of the frame.
    pub(crate) rotation: [Vec3; 3],
    /// Origin in the base frame, m.
    pub(crate) origin: Vec3,
    /// Motions in the order of the steps.
    pub(crate) motions: Vec<PathMotion>,
}

/// Poses of all frames at the nominal values, in the order of the mechanism.
pub(crate) fn frame_poses(mechanism: &Mechanism) -> Vec<FramePose> {
    let value = |symbol: ModelSymbol| mechanism.symbol_nominal(symbol);
    let mut poses: Vec<FramePose> = Vec::with_capacity(mechanism.frames.len());
    // Each frame starts at its parent's pose, because parents come first.
    for (i, frame) in mechanism.frames.iter().enumerate() {
        let (mut rotation, mut origin) = if i == 0 {
            ([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], [0.0; 3])
        } else {
            let parent = &poses[frame.parent.0];
            (parent.rotation, parent.origin)
        };
        let mut own = Vec::new();
        for step in &frame.steps {
            match step {
                FrameStep::Rotate(axis, angle) => {
                    // The axis is a column of the rotation before this step.
                    let direction = column(&rotation, *axis);
                    for &(symbol, factor) in &angle.terms {
                        if let ModelSymbol::Coordinate(coordinate) = symbol {
                            own.push(PathMotion {
                                coordinate,
                                factor: f64::from(factor),
                                is_rotation: true,
                                axis: direction,
                                origin,
                            });
                        }
                    }
                    rotate(&mut rotation, *axis, angle.evaluate(&value));
                }
                FrameStep::Translate(axis, length) => {
                    let direction = column(&rotation, *axis);
                    for (coordinate, factor) in &length.coordinates {
                        own.push(PathMotion {
                            coordinate: *coordinate,
                            factor: crate::print::to_f64(factor),
                            is_rotation: false,
                            axis: direction,
                            origin,
                        });
                    }
                    let distance = length.evaluate(&value);
                    for k in 0..3 {
                        origin[k] += distance * direction[k];
                    }
                }
                // Loops and drives do not reach across a free body, so no derivatives by its coordinates are needed.
                FrameStep::Free(body) => {
                    let of = |i: CoordinateIdx| mechanism.coordinates[i.0].nominal;
                    origin = body.position.map(of);
                    rotation = rotation_from_quaternion(body.quaternion.map(of));
                }
            }
        }
        poses.push(FramePose {
            rotation,
            origin,
            motions: own,
        });
    }
    poses
}

/// The rotation of a quaternion w, x, y, z, by rows. The quaternion need not have length one, but must not be zero.
pub(crate) fn rotation_from_quaternion([w, x, y, z]: [f64; 4]) -> [Vec3; 3] {
    // The factor normalises the quaternion.
    let per = 2.0 / (w * w + x * x + y * y + z * z);
    [
        [
            1.0 - per * (y * y + z * z),
            per * (x * y - w * z),
            per * (x * z + w * y),
        ],
        [
            per * (x * y + w * z),
            1.0 - per * (x * x + z * z),
            per * (y * z - w * x),
        ],
        [
            per * (x * z - w * y),
            per * (y * z + w * x),
            1.0 - per * (x * x + y * y),
        ],
    ]
}

/// The direction of an axis of a frame, from its rotation.
fn column(rotation: &[Vec3; 3], axis: FrameAxis) -> Vec3 {
    let j = match axis {
        FrameAxis::X => 0,
        FrameAxis::Y => 1,
        FrameAxis::Z => 2,
    };
    [rotation[0][j], rotation[1][j], rotation[2][j]]
}

/// Multiplies a rotation from the right by an elementary rotation about one of its axes.
fn rotate(rotation: &mut [Vec3; 3], axis: FrameAxis, angle: f64) {
    let (sin, cos) = angle.sin_cos();
    // The two columns that the rotation mixes, in cyclic order.
    let (j, k) = match axis {
        FrameAxis::X => (1, 2),
        FrameAxis::Y => (2, 0),
        FrameAxis::Z => (0, 1),
    };
    for row in rotation {
        let (first, second) = (row[j], row[k]);
        row[j] = first * cos + second * sin;
        row[k] = second * cos - first * sin;
    }
}

/// A point's position in the base frame, m.
pub(crate) fn position(mechanism: &Mechanism, poses: &[FramePose], point: PointIdx) -> Vec3 {
    let value = |symbol: ModelSymbol| mechanism.symbol_nominal(symbol);
    let point = &mechanism.points[point.0];
    let pose = &poses[point.frame.0];
    let local = [0, 1, 2].map(|k| point.at[k].evaluate(&value));
    std::array::from_fn(|k| pose.origin[k] + (0..3).map(|j| pose.rotation[k][j] * local[j]).sum::<f64>())
}

/// Derivative of a point's position by each coordinate: three rows with one column per coordinate.
///
/// `at` is the position at which the point is taken, in the base frame, m.
pub(crate) fn jacobian(mechanism: &Mechanism, poses: &[FramePose], point: PointIdx, at: Vec3) -> [Vec<f64>; 3] {
    let mut rows = [0, 1, 2].map(|_| vec![0.0; mechanism.coordinates.len()]);
    // Only the motions on the chain from the point's frame to the base move it.
    let mut frame = mechanism.points[point.0].frame.0;
    while frame != 0 {
        for moved in &poses[frame].motions {
            // Velocity for a rate of one: axis x arm for rotations, the axis for translations.
            let velocity = if moved.is_rotation {
                let arm: Vec3 = std::array::from_fn(|k| at[k] - moved.origin[k]);
                cross(moved.axis, arm)
            } else {
                moved.axis
            };
            for k in 0..3 {
                rows[k][moved.coordinate.0] += moved.factor * velocity[k];
            }
        }
        frame = mechanism.frames[frame].parent.0;
    }
    rows
}

/// The cross product.
fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}
