//! Positions of points and gaps of loops at given coordinates. A mechanism goes in once; its geometry is then
//! evaluated many times, as the limits of planned motions require.

use crate::exact::{CoordinateIdx, ModelSymbol};
use crate::kinematics::{Vec3, rotation_from_quaternion};
use crate::mechanism::{
    CoordinateCoupling, CouplingFunction, DriveKind, FrameAxis, FrameStep, FreeBody, Mechanism, PointIdx,
};

/// The geometry of a mechanism at the constants of its file.
#[derive(Clone, Debug)]
pub struct Kinematics {
    /// Number of coordinates, passive ones included.
    n_coordinates: usize,
    /// Frames with the index of the parent and the steps from it.
    frames: Vec<(usize, Vec<NumericStep>)>,
    /// Points with the index of the frame and the position in it, m.
    points: Vec<(usize, Vec3)>,
    /// Pairs of points that coincide.
    loops: Vec<[usize; 2]>,
    /// Coordinates that follow others.
    couplings: Vec<NumericCoupling>,
    /// Values of the constants and parameters in functions of couplings.
    fixed: FixedValues,
}

/// Values of the symbols that do not move.
#[derive(Clone, Debug)]
struct FixedValues {
    /// Those of the constants, in the order of the file.
    constants: Vec<f64>,
}

/// A coordinate that follows others: `offset + sum of factor * coordinate + function`.
#[derive(Clone, Debug)]
struct NumericCoupling {
    /// The index of the coordinate that follows.
    coordinate: usize,
    /// Indices of the coordinates of the affine part with their factors.
    terms: Vec<(usize, f64)>,
    /// The constant part, rad or m.
    offset: f64,
    /// The part that is not affine.
    function: Option<CouplingFunction>,
}

/// One step from a parent frame to its child.
#[derive(Clone, Debug)]
enum NumericStep {
    /// A rotation or translation.
    One(ElementaryMotion),
    /// The motion of a free body.
    Free(FreeBody),
}

/// One elementary motion: `offset + sum of factor * coordinate` about or along an axis.
#[derive(Clone, Debug)]
struct ElementaryMotion {
    /// 0, 1, 2 for x, y, z.
    axis: usize,
    /// True for a rotation, false for a translation.
    is_rotation: bool,
    /// The constant part, rad or m.
    offset: f64,
    /// Indices of coordinates with their factors.
    coordinates: Vec<(usize, f64)>,
}

/// Poses of all frames at given coordinates.
#[derive(Clone, Debug)]
pub struct MechanismPoses {
    /// In the order of the mechanism.
    frames: Vec<FramePlacement>,
    /// The coordinates, rad and m.
    coordinates: Vec<f64>,
}

/// A frame at given coordinates, all in the axes of the base frame.
#[derive(Clone, Debug)]
pub struct FramePlacement {
    /// Rotation by rows; its columns are the axes of the frame.
    pub rotation: [[f64; 3]; 3],
    /// Origin, m.
    pub origin: [f64; 3],
    /// The joints between its parent and this frame, in the order of its steps.
    pub joint_axes: Vec<CoordinateAxis>,
    /// Positions after each translation from the parent's origin, m, each with the number of `joint_axes` before it.
    pub translations: Vec<([f64; 3], usize)>,
}

/// How a coordinate moves a frame relative to its parent.
#[derive(Clone, Copy, Debug)]
pub struct CoordinateAxis {
    /// Position of the coordinate in [`Mechanism::coordinates`].
    pub coordinate: usize,
    /// Factor of the coordinate.
    pub factor: f64,
    /// True for a rotation about the axis, false for a translation along it.
    pub is_rotation: bool,
    /// Unit vector along the axis.
    pub axis: [f64; 3],
    /// A point on the axis, m.
    pub origin: [f64; 3],
}

impl MechanismPoses {
    /// The frames in the order of the file, the base first.
    pub fn frames(&self) -> &[FramePlacement] {
        &self.frames
    }
}

impl FixedValues {
    /// The value of a symbol at given coordinates; couplings contain no parameters.
    fn value(&self, symbol: ModelSymbol, coordinates: &[f64]) -> f64 {
        match symbol {
            ModelSymbol::Constant(i) => self.constants[i.0],
            ModelSymbol::Coordinate(i) => coordinates[i.0],
            ModelSymbol::Parameter(_) | ModelSymbol::Place(_) => f64::NAN,
        }
    }
}

impl NumericCoupling {
    /// Evaluates the constants of a coupling.
    fn new(coupling: &CoordinateCoupling, fixed: &FixedValues) -> Self {
        let value = |symbol: ModelSymbol| fixed.value(symbol, &[]);
        let terms = coupling.terms.iter();
        NumericCoupling {
            coordinate: coupling.coordinate.0,
            terms: terms.map(|(i, factor)| (i.0, factor.evaluate(&value))).collect(),
            offset: coupling.offset.evaluate(&value),
            function: coupling.function.clone(),
        }
    }

    /// The value of the coordinate that follows, rad or m.
    fn value(&self, fixed: &FixedValues, coordinates: &[f64]) -> f64 {
        let moved = self.terms.iter().map(|(i, factor)| factor * coordinates[*i]);
        let function = self.function.as_ref().map_or(0.0, |function| {
            function.value.evaluate(&|symbol| fixed.value(symbol, coordinates))
        });
        self.offset + moved.sum::<f64>() + function
    }

    /// Its derivatives by the coordinates that it follows, with their indices.
    fn slopes(&self, fixed: &FixedValues, coordinates: &[f64]) -> Vec<(usize, f64)> {
        let of_function = self.function.iter().flat_map(|function| {
            let slope = |i| (function.value).slope(i, &|symbol| fixed.value(symbol, coordinates));
            function.leaders.iter().map(move |i| (i.0, slope(*i)))
        });
        self.terms.iter().copied().chain(of_function).collect()
    }
}

impl Kinematics {
    /// Evaluates all constants of a mechanism; only coordinates remain variable.
    pub fn new(mechanism: &Mechanism) -> Self {
        // With coordinates of zero only the constant part of an angle or length remains.
        let value = |symbol: ModelSymbol| match symbol {
            ModelSymbol::Coordinate(_) => 0.0,
            other => mechanism.symbol_nominal(other),
        };
        let axis = |axis: &FrameAxis| match axis {
            FrameAxis::X => 0,
            FrameAxis::Y => 1,
            FrameAxis::Z => 2,
        };
        let moves = |step: &FrameStep| match step {
            FrameStep::Free(body) => NumericStep::Free(*body),
            FrameStep::Rotate(about, angle) => NumericStep::One(ElementaryMotion {
                axis: axis(about),
                is_rotation: true,
                offset: angle.evaluate(&value),
                coordinates: angle
                    .terms
                    .iter()
                    .filter_map(|(symbol, n)| match symbol {
                        ModelSymbol::Coordinate(i) => Some((i.0, f64::from(*n))),
                        _ => None,
                    })
                    .collect(),
            }),
            FrameStep::Translate(along, length) => NumericStep::One(ElementaryMotion {
                axis: axis(along),
                is_rotation: false,
                offset: length.evaluate(&value),
                coordinates: length
                    .coordinates
                    .iter()
                    .map(|(i, factor)| (i.0, crate::print::to_f64(factor)))
                    .collect(),
            }),
        };
        let fixed = FixedValues {
            constants: mechanism.constants.iter().map(|one| one.value).collect(),
        };
        Self {
            n_coordinates: mechanism.coordinates.len(),
            frames: mechanism
                .frames
                .iter()
                .map(|frame| (frame.parent.0, frame.steps.iter().map(moves).collect()))
                .collect(),
            points: mechanism
                .points
                .iter()
                .map(|p| (p.frame.0, [0, 1, 2].map(|k| p.at[k].evaluate(&value))))
                .collect(),
            loops: mechanism.loops.iter().map(|l| [l.joins[0].0, l.joins[1].0]).collect(),
            couplings: (mechanism.couplings.iter())
                .map(|coupling| NumericCoupling::new(coupling, &fixed))
                .collect(),
            fixed,
        }
    }

    /// Poses of all frames at given coordinates, rad and m.
    ///
    /// Panics unless there is one value for each coordinate.
    pub fn poses(&self, coordinates: &[f64]) -> MechanismPoses {
        assert_eq!(coordinates.len(), self.n_coordinates, "one value for each coordinate");
        let mut frames: Vec<FramePlacement> = Vec::with_capacity(self.frames.len());
        // Parents come first, so each frame starts at its parent's pose.
        for (i, (parent, moves)) in self.frames.iter().enumerate() {
            let (rotation, origin) = if i == 0 {
                let unity = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
                (unity, [0.0; 3])
            } else {
                (frames[*parent].rotation, frames[*parent].origin)
            };
            let mut pose = FramePlacement {
                rotation,
                origin,
                joint_axes: Vec::new(),
                translations: Vec::new(),
            };
            for step in moves {
                let step = match step {
                    NumericStep::One(step) => step,
                    NumericStep::Free(body) => {
                        let of = |i: CoordinateIdx| coordinates[i.0];
                        pose.origin = body.position.map(of);
                        pose.rotation = rotation_from_quaternion(body.quaternion.map(of));
                        continue;
                    }
                };
                // The axis of a step is a column of the rotation that the steps before it give.
                let direction: Vec3 = std::array::from_fn(|k| pose.rotation[k][step.axis]);
                let mut amount = step.offset;
                for (coordinate, factor) in &step.coordinates {
                    amount += factor * coordinates[*coordinate];
                    pose.joint_axes.push(CoordinateAxis {
                        coordinate: *coordinate,
                        factor: *factor,
                        is_rotation: step.is_rotation,
                        axis: direction,
                        origin: pose.origin,
                    });
                }
                if step.is_rotation {
                    rotate_columns(&mut pose.rotation, step.axis, amount);
                } else {
                    for k in 0..3 {
                        pose.origin[k] += amount * direction[k];
                    }
                    pose.translations.push((pose.origin, pose.joint_axes.len()));
                }
            }
            frames.push(pose);
        }
        MechanismPoses {
            frames,
            coordinates: coordinates.to_vec(),
        }
    }

    /// A point's position in the base frame, m.
    pub fn point_position(&self, poses: &MechanismPoses, point: PointIdx) -> [f64; 3] {
        self.position(poses, point.0)
    }

    /// A point's position in the base frame, m, by the index of the point.
    fn position(&self, poses: &MechanismPoses, point: usize) -> Vec3 {
        let (frame, at) = &self.points[point];
        let pose = &poses.frames[*frame];
        std::array::from_fn(|k| pose.origin[k] + (0..3).map(|j| pose.rotation[k][j] * at[j]).sum::<f64>())
    }

    /// The residuals of the constraints at the coordinates of the poses. First come the differences of the two points
    /// of each loop, m, three per loop. Then comes the difference of each coordinate that follows others from its
    /// value, rad or m.
    pub fn gaps(&self, poses: &MechanismPoses, coordinates: &[f64]) -> Vec<f64> {
        let ends = |l: &[usize; 2]| l.map(|point| self.position(poses, point));
        let of_loops = self.loops.iter().flat_map(|l| {
            let [a, b] = ends(l);
            [0, 1, 2].map(|k| a[k] - b[k])
        });
        let of_couplings = self
            .couplings
            .iter()
            .map(|follower| coordinates[follower.coordinate] - follower.value(&self.fixed, coordinates));
        of_loops.chain(of_couplings).collect()
    }

    /// Derivative of [`Self::gaps`] by all coordinates, one row per gap.
    pub fn gap_jacobian(&self, poses: &MechanismPoses) -> Vec<Vec<f64>> {
        let mut rows = vec![vec![0.0; self.n_coordinates]; 3 * self.loops.len()];
        for (l, ends) in self.loops.iter().enumerate() {
            // The gap is the first point minus the second one.
            for (point, sign) in ends.iter().zip([1.0, -1.0]) {
                self.visit_point_rates(poses, *point, &mut |coordinate, velocity| {
                    for k in 0..3 {
                        rows[3 * l + k][coordinate] += sign * velocity[k];
                    }
                });
            }
        }
        for follower in &self.couplings {
            let mut row = vec![0.0; self.n_coordinates];
            row[follower.coordinate] = 1.0;
            for (i, slope) in follower.slopes(&self.fixed, &poses.coordinates) {
                row[i] -= slope;
            }
            rows.push(row);
        }
        rows
    }

    /// Calls `show` for each joint that moves a point: its coordinate, and the velocity of the point for a rate of
    /// one.
    fn visit_point_rates(&self, poses: &MechanismPoses, point: usize, show: &mut dyn FnMut(usize, Vec3)) {
        let at = self.position(poses, point);
        let mut frame = self.points[point].0;
        // Follows the chain from the point's frame to the base.
        while frame != 0 {
            for moved in &poses.frames[frame].joint_axes {
                let axis = moved.axis;
                let velocity = if moved.is_rotation {
                    let arm: Vec3 = std::array::from_fn(|k| at[k] - moved.origin[k]);
                    [
                        axis[1] * arm[2] - axis[2] * arm[1],
                        axis[2] * arm[0] - axis[0] * arm[2],
                        axis[0] * arm[1] - axis[1] * arm[0],
                    ]
                } else {
                    axis
                };
                show(moved.coordinate, velocity.map(|x| moved.factor * x));
            }
            frame = self.frames[frame].0;
        }
    }

    /// Derivative of a drive's angle or length by all coordinates: one row of the drives' Jacobian.
    ///
    /// All coordinates count as independent: loops and couplings are not considered.
    pub fn drive_slopes(&self, poses: &MechanismPoses, kind: DriveKind) -> Vec<f64> {
        let mut row = vec![0.0; self.n_coordinates];
        match kind {
            DriveKind::Joint(i) => row[i.0] = 1.0,
            DriveKind::Linear { from, to } => {
                let ends = [from, to].map(|point| self.position(poses, point.0));
                // The rate of a length is the velocity of the end relative to the start along the line.
                let along: Vec3 = std::array::from_fn(|k| ends[1][k] - ends[0][k]);
                let length = along.iter().map(|x| x * x).sum::<f64>().sqrt();
                for (point, sign) in [(from, -1.0), (to, 1.0)] {
                    self.visit_point_rates(poses, point.0, &mut |coordinate, velocity| {
                        let slope: f64 = along.iter().zip(velocity).map(|(a, v)| a * v).sum();
                        row[coordinate] += sign * slope / length;
                    });
                }
            }
        }
        row
    }
}

/// Multiplies a rotation from the right by an elementary rotation about one of its axes.
fn rotate_columns(rotation: &mut [Vec3; 3], axis: usize, angle: f64) {
    let (sin, cos) = angle.sin_cos();
    let (j, k) = ((axis + 1) % 3, (axis + 2) % 3);
    for row in rotation {
        let (first, second) = (row[j], row[k]);
        row[j] = first * cos + second * sin;
        row[k] = second * cos - first * sin;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::loop_gaps;

    #[test]
    fn agrees_with_the_nominal_pose_and_with_differences() {
        for name in ["spidermill", "three_rrr", "four_bar", "panda"] {
            let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("models/{name}.toml"));
            let mechanism = crate::load_file(&path).unwrap().mechanism;
            let kinematics = Kinematics::new(&mechanism);
            let mut q: Vec<f64> = mechanism.coordinates.iter().map(|c| c.nominal).collect();
            let expected = loop_gaps(&mechanism);
            let close =
                |a: &[f64], b: &[f64], by: f64| a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < by);
            let poses = kinematics.poses(&q);
            assert!(close(&kinematics.gaps(&poses, &q), &expected.values, 1e-12), "{name}");
            // Away from the nominal pose, against differences.
            for (i, value) in q.iter_mut().enumerate() {
                *value += 0.1 + 0.03 * f64::from(u8::try_from(i).unwrap());
            }
            let rows = kinematics.gap_jacobian(&kinematics.poses(&q));
            for i in 0..q.len() {
                let step = 1e-6;
                let mut moved = |by: f64| {
                    let old = q[i];
                    q[i] += by;
                    let gaps = kinematics.gaps(&kinematics.poses(&q), &q);
                    q[i] = old;
                    gaps
                };
                let (high, low) = (moved(step), moved(-step));
                let slope: Vec<f64> = high.iter().zip(&low).map(|(a, b)| (a - b) / (2.0 * step)).collect();
                let column: Vec<f64> = rows.iter().map(|row| row[i]).collect();
                assert!(close(&column, &slope, 1e-8), "{name}, coordinate {i}");
            }
        }
    }
}
