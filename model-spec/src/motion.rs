//! Where points are at given coordinates, and how loops move with them: a mechanism goes in once, and is asked many
//! times, as limits of planned motion need it.

use crate::exact::{CoordinateIdx, ModelSymbol};
use crate::kinematics::{Vec3, rotation_from_quaternion};
use crate::mechanism::{DriveKind, FrameAxis, FrameStep, FreeBody, Mechanism, PointIdx};

/// The geometry of a mechanism with the file's constants.
#[derive(Clone, Debug)]
pub struct Kinematics {
    n_coordinates: usize,
    frames: Vec<(usize, Vec<NumericStep>)>,
    points: Vec<(usize, Vec3)>,
    loops: Vec<[usize; 2]>,
    couplings: Vec<FollowerCoordinate>,
}

/// A coordinate that follows others: `offset + sum of factor * other`.
#[derive(Clone, Debug)]
struct FollowerCoordinate {
    coordinate: usize,
    terms: Vec<(usize, f64)>,
    offset: f64,
}

/// One step on the way to a frame.
#[derive(Clone, Debug)]
enum NumericStep {
    One(ElementaryMotion),
    Free(FreeBody),
}

/// One elementary motion: `offset + sum of factor * coordinate` about or along an axis.
#[derive(Clone, Debug)]
struct ElementaryMotion {
    axis: usize,
    is_rotation: bool,
    offset: f64,
    coordinates: Vec<(usize, f64)>,
}

/// All frames at given coordinates.
#[derive(Clone, Debug)]
pub struct MechanismPoses {
    frames: Vec<FramePlacement>,
}

/// A frame at given coordinates, all in the axes of the base frame.
#[derive(Clone, Debug)]
pub struct FramePlacement {
    /// Row by row; its columns are the frame's axes.
    pub rotation: [[f64; 3]; 3],
    /// m
    pub origin: [f64; 3],
    /// The joints between its parent and this frame, in the order of its steps.
    pub joint_axes: Vec<CoordinateAxis>,
    /// Where translations led on the way from the parent's origin, m, and how many of `moved` lay behind by then.
    pub translations: Vec<([f64; 3], usize)>,
}

/// How a coordinate moves a frame against its parent.
#[derive(Clone, Copy, Debug)]
pub struct CoordinateAxis {
    /// Position of the coordinate in [`Mechanism::coordinates`].
    pub coordinate: usize,
    /// By what the coordinate is multiplied.
    pub factor: f64,
    /// Whether it turns about the axis; else it slides along it.
    pub is_rotation: bool,
    /// Unit vector.
    pub axis: [f64; 3],
    /// Where the joint is reached, m.
    pub origin: [f64; 3],
}

impl MechanismPoses {
    /// The frames in the order of the file, the base first.
    pub fn frames(&self) -> &[FramePlacement] {
        &self.frames
    }
}

impl Kinematics {
    /// The geometry, ready to be asked.
    pub fn new(mechanism: &Mechanism) -> Self {
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
            loops: mechanism
                .loops
                .iter()
                .map(|l| [l.joins[0].0, l.joins[1].0])
                .collect(),
            couplings: mechanism
                .couplings
                .iter()
                .map(|coupling| FollowerCoordinate {
                    coordinate: coupling.coordinate.0,
                    terms: coupling
                        .terms
                        .iter()
                        .map(|(i, factor)| (i.0, factor.evaluate(&value)))
                        .collect(),
                    offset: coupling.offset.evaluate(&value),
                })
                .collect(),
        }
    }

    /// All frames at given coordinates, rad and m, in the order of the file; one for each (asserted).
    pub fn poses(&self, coordinates: &[f64]) -> MechanismPoses {
        assert_eq!(
            coordinates.len(),
            self.n_coordinates,
            "one value for each coordinate"
        );
        let mut frames: Vec<FramePlacement> = Vec::with_capacity(self.frames.len());
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
        MechanismPoses { frames }
    }

    /// A point's position in the base frame, m.
    pub fn point_position(&self, poses: &MechanismPoses, point: PointIdx) -> [f64; 3] {
        self.position(poses, point.0)
    }

    fn position(&self, poses: &MechanismPoses, point: usize) -> Vec3 {
        let (frame, at) = &self.points[point];
        let pose = &poses.frames[*frame];
        std::array::from_fn(|k| {
            pose.origin[k] + (0..3).map(|j| pose.rotation[k][j] * at[j]).sum::<f64>()
        })
    }

    /// How far apart the two points of each loop are, m: three numbers for each loop; then by how much each coordinate that
    /// follows others is off, rad or m, at the coordinates that the poses were made of.
    pub fn gaps(&self, poses: &MechanismPoses, coordinates: &[f64]) -> Vec<f64> {
        let ends = |l: &[usize; 2]| l.map(|point| self.position(poses, point));
        let of_loops = self.loops.iter().flat_map(|l| {
            let [a, b] = ends(l);
            [0, 1, 2].map(|k| a[k] - b[k])
        });
        let of_couplings = self.couplings.iter().map(|follower| {
            let terms = follower.terms.iter();
            let followed: f64 = terms.map(|(i, factor)| factor * coordinates[*i]).sum();
            coordinates[follower.coordinate] - followed - follower.offset
        });
        of_loops.chain(of_couplings).collect()
    }

    /// Derivative of [`Self::gaps`] by all coordinates, one row for each gap.
    pub fn gap_jacobian(&self, poses: &MechanismPoses) -> Vec<Vec<f64>> {
        let mut rows = vec![vec![0.0; self.n_coordinates]; 3 * self.loops.len()];
        for (l, ends) in self.loops.iter().enumerate() {
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
            for (i, factor) in &follower.terms {
                row[*i] -= factor;
            }
            rows.push(row);
        }
        rows
    }

    /// Shows each coordinate that moves a point, with the point's velocity for a rate of one, joint by joint.
    fn visit_point_rates(
        &self,
        poses: &MechanismPoses,
        point: usize,
        show: &mut dyn FnMut(usize, Vec3),
    ) {
        let at = self.position(poses, point);
        let mut frame = self.points[point].0;
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

    /// Derivative of a drive's angle or length by all coordinates: a row of J. No loop may tie the coordinates.
    pub fn drive_slopes(&self, poses: &MechanismPoses, kind: DriveKind) -> Vec<f64> {
        let mut row = vec![0.0; self.n_coordinates];
        match kind {
            DriveKind::Joint(i) => row[i.0] = 1.0,
            DriveKind::Linear { from, to } => {
                let ends = [from, to].map(|point| self.position(poses, point.0));
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

/// Multiplies from the right by an elementary rotation.
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
            let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
                .join(format!("models/{name}.toml"));
            let mechanism = crate::load_file(&path).unwrap().mechanism;
            let kinematics = Kinematics::new(&mechanism);
            let mut q: Vec<f64> = mechanism.coordinates.iter().map(|c| c.nominal).collect();
            let expected = loop_gaps(&mechanism);
            let close = |a: &[f64], b: &[f64], by: f64| {
                a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < by)
            };
            let poses = kinematics.poses(&q);
            assert!(
                close(&kinematics.gaps(&poses, &q), &expected.values, 1e-12),
                "{name}"
            );
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
                let slope: Vec<f64> = high
                    .iter()
                    .zip(&low)
                    .map(|(a, b)| (a - b) / (2.0 * step))
                    .collect();
                let column: Vec<f64> = rows.iter().map(|row| row[i]).collect();
                assert!(close(&column, &slope, 1e-8), "{name}, coordinate {i}");
            }
        }
    }
}
