//! A walk along the motion of a mechanism, from the nominal pose through all poses that are connected with it. Every
//! pose closes all loops, in all their equations and on the branch of the nominal pose.
//!
//! Each step goes along the tangent of the motion and is then closed by Newton's method. Steps become shorter near a
//! pose at which branches meet, so that no such pose is passed. Dead points of drives are passed, because the motion is
//! smooth there. Mechanisms that are always near such poses, such as planar ones tilted by rounded digits, take steps
//! by the rate at which the distance to such poses falls.

use modelmill_algebra::field::RandomStream;
use modelmill_spec::Mechanism;
use nalgebra::{DMatrix, DVector};

use super::all::KinematicLoops;
use super::closure::LoopClosure;
use super::magnitude;
use super::numeric_poses::{NumericLoops, uniform_symmetric};
use crate::expr::{ExprId, Graph};

/// Longest step, in rad or relative to the size of the loops.
const LONGEST_STEP: f64 = 0.15;
/// Longest step as a share of the least singular value of the loops' derivatives, which measures how near branches
/// meet.
const STEP_SHARE: f64 = 0.5;
/// Nearer than this to a pose where branches meet, the walk turns back.
const BRANCH_DISTANCE: f64 = 2e-3;
/// The same as a share of the distance at the nominal pose, if this is nearer: mechanisms with loops of unequal size are
/// always near such poses.
const NOMINAL_BRANCH_SHARE: f64 = 0.3;
/// A step was too long if it reduces the least singular value to less than this share.
const ACCEPTED_DECREASE: f64 = 0.25;
/// How far the active coordinates may move from the nominal pose, in rad or relative to the size of the loops.
const WALK_RANGE: f64 = 2.0;
/// Number of steps between two poses that are returned.
const STEPS_PER_POSE: usize = 6;
/// Residuals below this share of the size of the loops count as closed.
const CLOSED: f64 = 1e-12;
/// The same for files with rounded lengths, where dependent equations cannot close exactly.
pub(crate) const NEARLY_CLOSED: f64 = 1e-7;
/// Least singular value by the passive coordinates, relative to the largest, above which they count as determined:
/// below it their rates are mostly rounding errors.
const SINGULAR_RATIO: f64 = 1e-3;
/// The same as a share of the value at the nominal pose, if this is lower.
const NOMINAL_SINGULAR_SHARE: f64 = 0.1;

/// The state of a walk: its pose, its direction, and what it compares residuals and steps with.
pub(crate) struct PoseWalk<'a> {
    /// Residuals of all loops and their derivatives by all coordinates.
    loops: NumericLoops<'a>,
    /// The value that counts as one for each coordinate: 1 rad, or the size of the loops in m.
    units: Vec<f64>,
    /// Indices of the active coordinates.
    active: Vec<usize>,
    /// Indices of the passive coordinates.
    passive: Vec<usize>,
    /// The size of the loop that each equation belongs to, m: small loops count as much as large ones.
    sizes: Vec<f64>,
    /// Size of the largest loop, m.
    length: f64,
    /// The nominal pose with all loops closed, rad or m.
    nominal: Vec<f64>,
    /// The current pose, rad or m.
    q: Vec<f64>,
    /// The direction of the last step, in units of the coordinates.
    heading: Option<DVector<f64>>,
    /// Longest next step where steps depend on the rate at which branches come nearer; `None` otherwise.
    trusted: Option<f64>,
    /// Least singular value at which the walk turns back.
    near: f64,
    /// Least relative singular value by the passive coordinates at which a pose is returned.
    dead: f64,
}

/// The loops' equations linearised at a pose.
struct LoopTangent {
    /// Residuals relative to the sizes of the loops.
    residual: DVector<f64>,
    /// Right singular vectors, one per row, as many as there are passive coordinates: directions that open the loops.
    across: DMatrix<f64>,
    /// Maps a residual to the step along these directions that closes the loops.
    closing: DMatrix<f64>,
    /// The least of their singular values relative to the largest.
    least: f64,
}

impl<'a> PoseWalk<'a> {
    /// Starts at the nominal pose; `None` if no closed pose is found there.
    pub(crate) fn new(graph: &mut Graph, mechanism: &'a Mechanism, loops: &KinematicLoops) -> Option<Self> {
        let residual = all_residuals(loops);
        let all: Vec<usize> = (0..mechanism.coordinates.len()).collect();
        let numeric = NumericLoops::for_unknowns(graph, mechanism, &residual, all.clone(), &[]);
        let nominal = numeric.declared_nominal_pose();
        let sizes = residual_loop_sizes(graph, mechanism, loops);
        // The size of the largest loop; couplings have no length, and loops that others close have no equations.
        let of_lengths =
            (loops.closures.iter()).filter(|c| c.explicit_coordinates().is_empty() && !c.residual.is_empty());
        let of_lengths = of_lengths.map(|c| magnitude::nominal_magnitude(graph, mechanism, &c.residual));
        let length = of_lengths.reduce(f64::max).unwrap_or(1.0);
        let mut walk = Self {
            length,
            units: all.iter().map(|i| numeric.coordinate_unit(*i)).collect(),
            active: loops.active.clone(),
            passive: loops.passive.clone(),
            sizes,
            q: nominal.clone(),
            nominal,
            heading: None,
            trusted: None,
            near: BRANCH_DISTANCE,
            dead: SINGULAR_RATIO,
            loops: numeric,
        };
        walk.measure_couplings(loops)?;
        // The pose in the file is only as exact as its digits, so it is closed first.
        walk.q = walk.close_loops(walk.q.clone())?;
        walk.nominal.clone_from(&walk.q);
        // Near a branch point, steps and limits are relative to the nominal pose.
        let least = walk.loop_tangent(&walk.q)?.least;
        if NOMINAL_BRANCH_SHARE * least < walk.near {
            walk.trusted = Some(STEP_SHARE * least);
            walk.near = NOMINAL_BRANCH_SHARE * least;
        }
        walk.dead = walk.dead.min(NOMINAL_SINGULAR_SHARE * walk.relative_singular_value()?);
        Some(walk)
    }

    /// The next pose at which the passive coordinates are determined; `None` if the walk makes no progress.
    pub(crate) fn next_pose(&mut self, stream: &mut RandomStream) -> Option<Vec<f64>> {
        // Steps that are tried before the walk is given up.
        const TRIES: usize = 400;
        let mut steps = 0;
        for _ in 0..TRIES {
            match self.take_step(stream) {
                Some(()) => steps += 1,
                // The next step goes back, with a random part to the side.
                None => self.heading = self.heading.take().map(|h| -h),
            }
            if steps >= STEPS_PER_POSE && self.is_determined() {
                return Some(self.q.clone());
            }
        }
        None
    }

    /// The value that counts as one for a coordinate: 1 rad, or the size of the loops in m.
    pub(crate) fn coordinate_unit(&self, coordinate: usize) -> f64 {
        self.units[coordinate]
    }

    /// The size of the largest loop, m.
    pub(crate) fn loop_size(&self) -> f64 {
        self.length
    }

    /// What each residual is compared with: the size of its loop, m.
    pub(crate) fn residual_sizes(&self) -> &[f64] {
        &self.sizes
    }

    /// Makes one step; `None` if it would come too near a branch point, or too far from the nominal pose.
    fn take_step(&mut self, stream: &mut RandomStream) -> Option<()> {
        let n = self.q.len();
        let here = self.loop_tangent(&self.q)?;
        // A random direction with a preference for the last one, projected onto the tangent of the motion.
        let mut towards = DVector::from_fn(n, |_, _| uniform_symmetric(stream));
        if let Some(heading) = &self.heading {
            towards += heading;
        }
        towards -= here.across.transpose() * (&here.across * &towards);
        let size = towards.amax();
        if size < 1e-9 {
            return None;
        }
        // The walk does not turn back by itself.
        if self.heading.as_ref().is_some_and(|h| h.dot(&towards) < 0.0) {
            towards = -towards;
        }
        let step = towards / size;
        // Random lengths keep the walk from returning to the same poses.
        let length = self.step_length(&here, &step)? * (0.65 + 0.35 * uniform_symmetric(stream));
        let there: Vec<f64> = (0..n).map(|i| self.q[i] + length * step[i] * self.units[i]).collect();
        // The step is closed; a large correction means that it was too long.
        let closed = self.close_loops(there.clone())?;
        let by = |a: &[f64], b: &[f64], i: usize| ((a[i] - b[i]) / self.units[i]).abs();
        let is_far = (0..n).any(|i| by(&closed, &there, i) > 0.5 * length)
            || (self.active.iter()).any(|i| by(&closed, &self.nominal, *i) > WALK_RANGE);
        let least = self.loop_tangent(&closed)?.least;
        let has_fallen = self.trusted.is_some() && least < ACCEPTED_DECREASE * here.least;
        if is_far || least < self.near || has_fallen {
            self.trusted = self.trusted.map(|_| 0.5 * length);
            return None;
        }
        self.trusted = self.trusted.map(|_| 2.0 * length);
        self.q = closed;
        self.heading = Some(step);
        Some(())
    }

    /// The longest step that may be made in a direction, in units of the coordinates.
    fn step_length(&self, here: &LoopTangent, step: &DVector<f64>) -> Option<f64> {
        /// A small step, in units of the coordinates.
        const SMALL: f64 = 1e-4;
        let sure = STEP_SHARE * here.least;
        let Some(trusted) = self.trusted else {
            return Some(LONGEST_STEP.min(sure));
        };
        // As far as the least singular value would fall by a fixed share if it changed at the present rate.
        let after = |by: f64| -> Option<f64> {
            let moved = (0..self.q.len()).map(|i| self.q[i] + by * step[i] * self.units[i]);
            Some(self.loop_tangent(&moved.collect::<Vec<_>>())?.least)
        };
        let changes = [after(SMALL)?, after(-SMALL)?].map(|least| (least - here.least).abs());
        let reach = sure * SMALL / changes[0].max(changes[1]).max(f64::MIN_POSITIVE);
        Some(LONGEST_STEP.min(sure.max(reach.min(trusted))))
    }

    /// Sets the sizes of couplings: the norm of the row of derivatives, since a coupling has no length.
    fn measure_couplings(&mut self, loops: &KinematicLoops) -> Option<()> {
        let (_, jacobian) = self.loops.linearise(&self.nominal)?;
        let mut row = 0;
        for closure in &loops.closures {
            for k in row..row + closure.residual.len() {
                if closure.follower.is_some() {
                    let row = jacobian.row(k);
                    let squares = row.iter().zip(&self.units).map(|(x, unit)| (x * unit).powi(2));
                    self.sizes[k] = squares.sum::<f64>().sqrt();
                }
            }
            row += closure.residual.len();
        }
        Some(())
    }

    /// The nearest pose at which all loops are closed, by Newton's method with the least change; `None` if it does not
    /// converge.
    fn close_loops(&self, mut q: Vec<f64>) -> Option<Vec<f64>> {
        // Largest number of Newton steps.
        const ROUNDS: usize = 12;
        // A shorter step, in units of the coordinates, changes nothing.
        const STILL: f64 = 1e-12;
        for _ in 0..ROUNDS {
            let here = self.loop_tangent(&q)?;
            if here.residual.is_empty() || here.residual.amax() <= CLOSED {
                return Some(q);
            }
            let is_nearly_closed = here.residual.amax() <= NEARLY_CLOSED;
            let step = here.closing * here.residual;
            // Rounded lengths leave a residual that no step reduces further.
            if is_nearly_closed && step.amax() <= STILL {
                return Some(q);
            }
            for (i, dx) in step.iter().enumerate() {
                q[i] -= dx * self.units[i];
            }
        }
        None
    }

    /// Residuals of all loops, each relative to the size of its own, and their derivatives in units of the coordinates.
    fn linearise(&self, q: &[f64]) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let (mut residual, mut jacobian) = self.loops.linearise(q)?;
        for (mut column, unit) in jacobian.column_iter_mut().zip(&self.units) {
            column *= *unit;
        }
        for (i, size) in self.sizes.iter().enumerate() {
            residual[i] /= size;
            jacobian.row_mut(i).scale_mut(size.recip());
        }
        Some((residual, jacobian))
    }

    /// The linearised loops at a pose; `None` if they are singular there.
    fn loop_tangent(&self, q: &[f64]) -> Option<LoopTangent> {
        let (residual, jacobian) = self.linearise(q)?;
        // Only as many singular values as there are passive coordinates belong to independent equations.
        let (rank, n) = (self.passive.len(), q.len());
        if rank == 0 {
            return Some(LoopTangent {
                closing: DMatrix::zeros(n, residual.len()),
                across: DMatrix::zeros(0, n),
                residual,
                least: 1.0,
            });
        }
        let svd = jacobian.svd(true, true);
        let (u, v) = (svd.u?, svd.v_t?);
        let mut order: Vec<usize> = (0..svd.singular_values.len()).collect();
        order.sort_by(|a, b| svd.singular_values[*b].total_cmp(&svd.singular_values[*a]));
        order.truncate(rank);
        let largest = svd.singular_values[*order.first()?];
        let least = svd.singular_values[*order.last()?];
        if order.len() < rank || least <= f64::EPSILON * largest {
            return None;
        }
        let across = v.select_rows(&order);
        // The pseudoinverse of the loops, restricted to those directions.
        let mut closing = across.transpose();
        for (mut column, k) in closing.column_iter_mut().zip(&order) {
            column /= svd.singular_values[*k];
        }
        Some(LoopTangent {
            closing: closing * u.select_columns(&order).transpose(),
            across,
            residual,
            least: least / largest,
        })
    }

    /// Whether the passive coordinates are determined by the others with a margin to singular poses.
    fn is_determined(&self) -> bool {
        self.relative_singular_value().is_some_and(|x| x > self.dead)
    }

    /// The least singular value by the passive coordinates relative to the largest.
    fn relative_singular_value(&self) -> Option<f64> {
        if self.passive.is_empty() {
            return Some(1.0);
        }
        // Dependent equations have singular values of zero, so only the largest ones count.
        let (_, jacobian) = self.linearise(&self.q)?;
        let jacobian = jacobian.select_columns(&self.passive);
        let mut values: Vec<f64> = jacobian.singular_values().iter().copied().collect();
        values.sort_by(|a, b| b.total_cmp(a));
        Some(values.get(self.passive.len() - 1)? / values[0])
    }
}

/// The size of the loop that each of [`all_residuals`] belongs to, m; 1 for couplings.
fn residual_loop_sizes(graph: &mut Graph, mechanism: &Mechanism, loops: &KinematicLoops) -> Vec<f64> {
    let of_one = |closure: &LoopClosure| {
        let size = match closure.follower {
            Some(_) => 1.0,
            None => magnitude::nominal_magnitude(graph, mechanism, &closure.residual),
        };
        vec![size; closure.residual.len()]
    };
    loops.closures.iter().flat_map(of_one).collect()
}

/// The residuals of all loops, including those that depend on others.
pub(crate) fn all_residuals(loops: &KinematicLoops) -> Vec<ExprId> {
    let closures = loops.closures.iter();
    closures.flat_map(|c| c.residual.iter().copied()).collect()
}
