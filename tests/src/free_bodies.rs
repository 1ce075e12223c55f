//! Reactions from bodies by themselves: every frame gets an unknown wrench from its parent, and all balances of forces and
//! moments are solved at once, so that what they do not say shows as a null space.
//!
//! Wrenches are in the axes of the base, moments about its origin. Nothing is shared with the mill: motion comes from
//! Taylor series of poses, inertia from pseudo-inertias, and no equation is projected.

use modelmill_codegen::{ModelEvaluator, ReactionPrograms};
use modelmill_spec::{DriveKind, FrameIdx, Mechanism, ModelSymbol, PointIdx};
use nalgebra::{DMatrix, DVector, Matrix3, Matrix4, Vector3};

use crate::base_parameters::{base, nominal};
use crate::laws::{ACCURACY, Case, motion};
use crate::mechanics::{Jet, Numbers};

/// Singular values, relative to the largest, that count as zero, and shares that count as none.
const NOTHING: f64 = 1e-9;

/// Force and moment about the base's origin.
type Wrench = (Vector3<f64>, Vector3<f64>);

/// All balances of a mechanism at one state.
struct Balances {
    matrix: DMatrix<f64>,
    needed: DVector<f64>,
    /// Where the unknown forces of loops begin, and those of drives.
    loops: usize,
    drives: usize,
}

fn turning(change: &Matrix4<f64>, pose: &Matrix4<f64>) -> Matrix4<f64> {
    change * pose.try_inverse().expect("a pose")
}

/// Velocity of the point at the base's origin, and angular velocity.
fn twist(change: &Matrix4<f64>, pose: &Matrix4<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let t = turning(change, pose);
    let omega = Vector3::new(t[(2, 1)], t[(0, 2)], t[(1, 0)]);
    (t.fixed_view::<3, 1>(0, 3).into(), omega)
}

fn value(jets: &[Jet; 3], order: usize) -> Vector3<f64> {
    Vector3::from_fn(|i, _| jets[i].0[order])
}

/// What bodies need for their motion, frame by frame.
fn inertial(numbers: &Numbers<'_>, poses: &[[Matrix4<f64>; 3]]) -> Vec<Wrench> {
    let gravity = numbers.gravity();
    let mut needed = vec![(Vector3::zeros(), Vector3::zeros()); poses.len()];
    for (frame, inertia) in numbers.bodies() {
        let [x, _, a] = poses[frame];
        // The fourth column of the acceleration of free fall belongs to the points' own ones.
        let fall = Matrix4::from_fn(|i, j| if i < 3 && j == 3 { gravity[i] } else { 0.0 });
        let a = a - fall;
        let force = (a * inertia).fixed_view::<3, 1>(0, 3).into_owned();
        let product = x * inertia * a.transpose();
        let moment = Vector3::new(
            product[(1, 2)] - product[(2, 1)],
            product[(2, 0)] - product[(0, 2)],
            product[(0, 1)] - product[(1, 0)],
        );
        needed[frame].0 += force;
        needed[frame].1 += moment;
    }
    for (frame, mass, force_at, moment_at) in numbers.lumps() {
        let [x, _, a] = poses[frame];
        let lifted = |at: [f64; 3]| -> Vector3<f64> { (a * Vector3::from(at).push(1.0)).xyz() - gravity };
        let force = mass * lifted(force_at);
        let rotation: Matrix3<f64> = x.fixed_view::<3, 3>(0, 0).into();
        let origin: Vector3<f64> = x.fixed_view::<3, 1>(0, 3).into();
        let arm = rotation * Vector3::from(moment_at);
        needed[frame].0 += force;
        needed[frame].1 += origin.cross(&force) + mass * arm.cross(&lifted(moment_at));
    }
    needed
}

/// What rods need at their ends, as particles along them: the drive, and the forces at its two points.
fn rods(numbers: &Numbers<'_>, mechanism: &Mechanism, motion: &[Jet]) -> Vec<(PointIdx, Vector3<f64>)> {
    let gravity = numbers.gravity();
    let mut forces = Vec::new();
    for (drive, [second, first, mass]) in numbers.rods() {
        let DriveKind::Linear { from, to } = mechanism.drives[drive].kind else {
            panic!("a rod lies along a linear drive");
        };
        let (a, b) = (numbers.point_motion(motion, from), numbers.point_motion(motion, to));
        let d: [Jet; 3] = std::array::from_fn(|i| b[i] - a[i]);
        let square = (0..3).fold(Jet::constant(0.0), |sum, i| sum + d[i] * d[i]);
        let per_length = square.sqrt().recip();
        let outer = [0.5 * (second - first), 0.5 * (second + first)];
        let (mut total, mut moment) = (Vector3::zeros(), Vector3::zeros());
        let direction: Vector3<f64> = value(&d, 0).normalize();
        for (at, particle) in [(-1.0, outer[0]), (0.0, mass - second), (1.0, outer[1])] {
            let scale = Jet::constant(at) * per_length;
            let place: [Jet; 3] = std::array::from_fn(|i| a[i] + scale * d[i]);
            let force = particle * (value(&place, 2) - gravity);
            total += force;
            moment += at * direction.cross(&force);
        }
        // Square to the rod at its second point, so that the moment about the first one is made.
        let length = value(&d, 0).norm();
        let at_second = moment.cross(&direction) / length;
        forces.push((from, total - at_second));
        forces.push((to, at_second));
    }
    forces
}

/// Velocity and rate of turn of a frame.
type Twist = (Vector3<f64>, Vector3<f64>);

/// Twists of all frames for each coordinate by itself.
fn unit_twists(numbers: &Numbers<'_>, motion: &[Jet]) -> Vec<Vec<Twist>> {
    let of_one = |i: usize| {
        let one = motion.iter().enumerate();
        let one: Vec<Jet> = one
            .map(|(k, q)| Jet([q.0[0], f64::from(u8::from(k == i)), 0.0]))
            .collect();
        let moved = numbers.motions(&one);
        moved.iter().map(|[x, v, _]| twist(v, x)).collect()
    };
    (0..motion.len()).map(of_one).collect()
}

/// Equations of the joints, below those of the frames: along its own motion a joint supplies what its drive does, less what
/// effects take.
fn joints_give_way(
    mechanism: &Mechanism,
    twists: &[Vec<Twist>],
    effects: &[f64],
    drives: usize,
    matrix: &mut DMatrix<f64>,
    needed: &mut DVector<f64>,
) {
    let n_frames = mechanism.frames.len();
    for (i, twists) in twists.iter().enumerate() {
        let r = 6 * (n_frames - 1) + i;
        for frame in 1..n_frames {
            let (v, omega) = twists[frame];
            let (vp, omega_p) = twists[mechanism.frames[frame].parent.0];
            for k in 0..3 {
                matrix[(r, 6 * (frame - 1) + k)] += v[k] - vp[k];
                matrix[(r, 6 * (frame - 1) + 3 + k)] += omega[k] - omega_p[k];
            }
        }
        needed[r] -= effects[i];
        for (d, drive) in mechanism.drives.iter().enumerate() {
            if matches!(drive.kind, DriveKind::Joint(c) if c.0 == i) {
                matrix[(r, drives + d)] -= 1.0;
            }
        }
    }
}

/// A coupling supplies what follows with a force, and takes it, times the factor, from what is followed.
fn couplings_carry(mechanism: &Mechanism, motion: &[Jet], first: usize, matrix: &mut DMatrix<f64>) {
    let value = |symbol| match symbol {
        ModelSymbol::Coordinate(i) => motion[i.0].0[0],
        other => mechanism.symbol_nominal(other),
    };
    let joints = 6 * (mechanism.frames.len() - 1);
    for (column, coupling) in (first..).zip(&mechanism.couplings) {
        matrix[(joints + coupling.coordinate.0, column)] -= 1.0;
        for (i, slope) in coupling.slopes(&value) {
            matrix[(joints + i.0, column)] += slope;
        }
    }
}

impl Balances {
    fn new(mechanism: &Mechanism, numbers: &Numbers<'_>, motion: &[Jet]) -> Self {
        let n = motion.len();
        let n_frames = mechanism.frames.len();
        let poses = numbers.motions(motion);
        let twists = unit_twists(numbers, motion);
        let pins: Vec<Vec<Vector3<f64>>> = mechanism
            .loops
            .iter()
            .map(|l| pin(mechanism, numbers, motion, &twists, l.joins))
            .collect();
        let n_pins: usize = pins.iter().map(Vec::len).sum();
        let loops = 6 * (n_frames - 1);
        let moments = loops + 3 * mechanism.loops.len();
        let drives = moments + n_pins;
        let couplings = drives + mechanism.drives.len();
        let n_unknowns = couplings + mechanism.couplings.len();
        let n_rows = 6 * (n_frames - 1) + n;
        let mut matrix = DMatrix::zeros(n_rows, n_unknowns);
        let mut needed = DVector::zeros(n_rows);
        let row = |frame: usize| (frame != 0).then(|| 6 * (frame - 1));
        for (frame, (force, moment)) in inertial(numbers, &poses).into_iter().enumerate() {
            let Some(r) = row(frame) else { continue };
            for k in 0..3 {
                needed[r + k] += force[k];
                needed[r + 3 + k] += moment[k];
            }
            let parent = row(mechanism.frames[frame].parent.0);
            for k in 0..6 {
                matrix[(r + k, r + k)] += 1.0;
                if let Some(parent) = parent {
                    matrix[(parent + k, r + k)] -= 1.0;
                }
            }
        }
        let frame_of = |p: PointIdx| -> FrameIdx { mechanism.points[p.0].frame };
        let mut push = |column: usize, point: PointIdx, force: &Vector3<f64>| {
            let at = value(&numbers.point_motion(motion, point), 0);
            if let Some(r) = row(frame_of(point).0) {
                let moment = at.cross(force);
                for k in 0..3 {
                    matrix[(r + k, column)] += force[k];
                    matrix[(r + 3 + k, column)] += moment[k];
                }
            }
        };
        for (l, closed) in mechanism.loops.iter().enumerate() {
            for k in 0..3 {
                let unit = Vector3::ith(k, 1.0);
                push(loops + 3 * l + k, closed.joins[0], &unit);
                push(loops + 3 * l + k, closed.joins[1], &-unit);
            }
        }
        for (d, drive) in mechanism.drives.iter().enumerate() {
            if let DriveKind::Linear { from, to } = drive.kind {
                let ends = [from, to].map(|p| value(&numbers.point_motion(motion, p), 0));
                let direction = (ends[1] - ends[0]).normalize();
                push(drives + d, to, &direction);
                push(drives + d, from, &-direction);
            }
        }
        for (point, force) in rods(numbers, mechanism, motion) {
            let at = value(&numbers.point_motion(motion, point), 0);
            if let Some(r) = row(frame_of(point).0) {
                let moment = at.cross(&force);
                for k in 0..3 {
                    needed[r + k] += force[k];
                    needed[r + 3 + k] += moment[k];
                }
            }
        }
        let mut column = moments;
        for (closed, axes) in mechanism.loops.iter().zip(&pins) {
            for axis in axes {
                for (point, sign) in closed.joins.into_iter().zip([1.0, -1.0]) {
                    if let Some(r) = row(frame_of(point).0) {
                        for k in 0..3 {
                            matrix[(r + 3 + k, column)] += sign * axis[k];
                        }
                    }
                }
                column += 1;
            }
        }
        couplings_carry(mechanism, motion, couplings, &mut matrix);
        let effects = numbers.effects_on_joints(motion);
        joints_give_way(mechanism, &twists, &effects, drives, &mut matrix, &mut needed);
        Self {
            matrix,
            needed,
            loops,
            drives,
        }
    }

    /// One solution, and what may be added to it.
    fn solve(&self) -> (DVector<f64>, Vec<DVector<f64>>) {
        let (rows, columns) = self.matrix.shape();
        let padded = self.matrix.clone().resize(rows.max(columns), columns, 0.0);
        let needed = self.needed.clone().resize_vertically(rows.max(columns), 0.0);
        let svd = padded.svd(true, true);
        let limit = NOTHING * svd.singular_values.amax();
        let mut solution = svd.solve(&needed, limit).expect("both factors");
        // What the decomposition lacks in digits, refinement gives back.
        for _ in 0..3 {
            let rest = &self.needed - &self.matrix * &solution;
            let rest = rest.resize_vertically(rows.max(columns), 0.0);
            solution += svd.solve(&rest, limit).expect("both factors");
        }
        let v = svd.v_t.expect("asked for");
        let null = (0..columns).filter(|k| svd.singular_values[*k] <= limit);
        (solution, null.map(|k| v.row(k).transpose()).collect())
    }
}

/// Axes about which a pin that closes a planar loop could transmit a moment; none for a loop in space.
fn pin(
    mechanism: &Mechanism,
    numbers: &Numbers<'_>,
    motion: &[Jet],
    twists: &[Vec<(Vector3<f64>, Vector3<f64>)>],
    joins: [PointIdx; 2],
) -> Vec<Vector3<f64>> {
    let pose: Vec<f64> = motion.iter().map(|q| q.0[0]).collect();
    let gaps = DMatrix::from_fn(3, motion.len(), |k, i| {
        let one = crate::mechanics::along(&pose, i);
        let [a, b] = joins.map(|p| value(&numbers.point_motion(&one, p), 1));
        a[k] - b[k]
    });
    let svd = gaps.clone().svd(true, false);
    let u = svd.u.expect("asked for");
    // Of three singular values at most, one must be zero and two not.
    let sizes: Vec<f64> = svd.singular_values.iter().copied().collect();
    let largest = sizes.iter().copied().fold(0.0, f64::max);
    let regular: Vec<usize> = (0..sizes.len()).filter(|k| sizes[*k] > NOTHING * largest).collect();
    let [a, b] = regular[..] else {
        return Vec::new();
    };
    let axes = [a, b].map(|k| Vector3::from_fn(|i, _| u[(i, k)]));
    let normal = axes[0].cross(&axes[1]);
    let frames = joins.map(|p| mechanism.points[p.0].frame.0);
    let turns_in_plane = twists.iter().all(|of| {
        let relative = of[frames[0]].1 - of[frames[1]].1;
        relative.cross(&normal).norm() <= NOTHING
    });
    if turns_in_plane { axes.to_vec() } else { Vec::new() }
}

/// What was found on a mechanism.
#[derive(Clone, Copy, Debug, Default)]
pub struct Found {
    /// Largest relative error.
    pub error: f64,
    /// Components that are told.
    pub told: usize,
    /// Components that are not.
    pub left_out: usize,
}

impl Case {
    /// Reactions are those of bodies by themselves; what is told is all that these determine, and nothing else.
    pub fn reactions_hold_every_body(&self) -> Result<Found, String> {
        let mechanism = self.mechanism();
        let reactions = self.derivation.reactions().map_err(|e| self.breach(&e.to_string()))?;
        let evaluator = ModelEvaluator::new(&self.derivation);
        let numbers = Numbers::new(mechanism, nominal(mechanism));
        let p_min = base(&self.derivation, &nominal(mechanism));
        let mut found = Found::default();
        let mut moved: Vec<f64> = Vec::new();
        for i in 0..self.sample.len().min(6) {
            let one = self.sample.only(i);
            let motion = motion(&evaluator, mechanism, &one);
            let values = evaluator
                .reactions(&reactions, &one.states())
                .map_err(|e| self.breach(&e.to_string()))?;
            let balances = Balances::new(mechanism, &numbers, &motion);
            let (solution, null) = balances.solve();
            let rest = &balances.matrix * &solution - &balances.needed;
            let scale = solution.amax() + balances.needed.amax() + 1e-9;
            if rest.amax() > ACCURACY * scale {
                return Err(self.breach(&format!("bodies cannot be held: {:.1e}", rest.amax())));
            }
            if mechanism.effects.is_empty() {
                let forces = evaluator
                    .inverse_dynamics(&one.states(), &p_min)
                    .map_err(|e| self.breach(&e.to_string()))?;
                for (d, force) in forces.iter().enumerate() {
                    let error = (solution[balances.drives + d] - force[0]).abs() / scale;
                    if error.is_nan() || error > ACCURACY * 10.0 {
                        return Err(self.breach(&format!("drive {d}: error {error:.1e}")));
                    }
                }
            }
            let components = components(mechanism, &numbers, &motion, &reactions, &balances);
            moved.resize(components.len(), 0.0);
            for (k, (what, place, row)) in components.iter().enumerate() {
                let size = row.norm().max(1e-9);
                let free = null.iter().map(|n| row.dot(n).abs() / size);
                let free = free.fold(0.0, f64::max);
                moved[k] = moved[k].max(free);
                let Some(place) = place else { continue };
                if free > 1e-6 {
                    return Err(self.breach(&format!("{what} is reported but not determined ({free:.1e})")));
                }
                let error = (row.dot(&solution) - values[*place][0]).abs() / (scale * size.max(1.0));
                found.error = found.error.max(error);
                if error.is_nan() || error > 100.0 * ACCURACY {
                    let expected = row.dot(&solution);
                    return Err(self.breach(&format!(
                        "{what} is {}, bodies by themselves say {expected}, error {error:.1e}",
                        values[*place][0]
                    )));
                }
            }
            found.told = components.iter().filter(|c| c.1.is_some()).count();
            found.left_out = components.len() - found.told;
            if values.len() != found.told {
                return Err(self.breach("components have no place, or one place has two"));
            }
            for ((what, place, _), free) in components.iter().zip(&moved) {
                if place.is_none() && *free < 1e-7 {
                    return Err(self.breach(&format!("{what} is determined but not told ({free:.1e})")));
                }
            }
        }
        Ok(found)
    }
}

/// Every component of the reactions: what it is, its place among the outputs, and what it is in the unknowns.
fn components(
    mechanism: &Mechanism,
    numbers: &Numbers<'_>,
    motion: &[Jet],
    reactions: &ReactionPrograms,
    balances: &Balances,
) -> Vec<(String, Option<usize>, DVector<f64>)> {
    let n = balances.matrix.ncols();
    let joint_pose = |name: &str, coordinates: &[String]| -> (usize, Matrix4<f64>) {
        let frame = mechanism.frames.iter().position(|f| f.name == name);
        let frame = frame.or_else(|| {
            let of = name.split_once('.').map_or(name, |(frame, _)| frame);
            mechanism.frames.iter().position(|f| f.name == of)
        });
        let frame = frame.expect("named after a frame");
        let coordinate = mechanism
            .coordinates
            .iter()
            .position(|c| c.name == coordinates[0])
            .expect("a coordinate");
        (frame, numbers.pose_behind(motion, frame, coordinate))
    };
    let mut all = Vec::new();
    for joint in &reactions.joints {
        let (frame, pose) = joint_pose(&joint.name, &joint.coordinates);
        let origin: Vector3<f64> = pose.fixed_view::<3, 1>(0, 3).into();
        let first = 6 * (frame - 1);
        for k in 0..3 {
            let axis: Vector3<f64> = pose.fixed_view::<3, 1>(0, k).into();
            let mut row = DVector::zeros(n);
            for j in 0..3 {
                row[first + j] = axis[j];
            }
            all.push((format!("{}.F{k}", joint.name), joint.force[k], row));
        }
        for k in 0..3 {
            let axis: Vector3<f64> = pose.fixed_view::<3, 1>(0, k).into();
            let mut row = DVector::zeros(n);
            // axis . (M - o x F) = axis . M - (axis x o) . F
            let arm = axis.cross(&origin);
            for j in 0..3 {
                row[first + 3 + j] = axis[j];
                row[first + j] = -arm[j];
            }
            all.push((format!("{}.M{k}", joint.name), joint.moment[k], row));
        }
    }
    for (l, closed) in reactions.loops.iter().enumerate() {
        let of = reactions.joints.iter().find(|j| j.name == closed.axes);
        let of = of.expect("loops lie beside joints that are told");
        let (_, pose) = joint_pose(&of.name, &of.coordinates);
        for k in 0..3 {
            let axis: Vector3<f64> = pose.fixed_view::<3, 1>(0, k).into();
            let mut row = DVector::zeros(n);
            for j in 0..3 {
                row[balances.loops + 3 * l + j] = axis[j];
            }
            all.push((format!("{}.F{k}", closed.name), closed.force[k], row));
        }
    }
    all
}
