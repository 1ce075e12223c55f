//! Motion of all bodies from prescribed coordinates: Gauss-Newton on the joints' equations, rates and
//! accelerations from their derivatives.
//!
//! The equations may be redundant, as those of parallel cranks are: each is kept, the least-squares solution
//! of all is taken, and a residual says that they contradict each other.
//! The QR decomposition with column pivoting reveals whether they determine the motion at all.
//! Source: E. Haug, "Computer Aided Kinematics and Dynamics of Mechanical Systems" (1989), sections 3.6 and 9.6.

use std::fmt;

use nalgebra::linalg::ColPivQR;
use nalgebra::{DMatrix, DVector, Dyn, Vector3};

use crate::pair::{Derived, Pair};
use crate::pose::{BodyMotion, Pose};
use crate::rig::Rig;

/// Steps of Gauss-Newton before a pose is given up.
const MOST_STEPS: usize = 40;
/// A step below this, m or rad, ends the search: convergence is quadratic, and this is rounding.
const SMALLEST_STEP: f64 = 1e-11;
/// Joints may gape by this much, m or rad.
const LARGEST_GAP: f64 = 1e-9;
/// A pivot below this share of the largest says that a body can move by itself.
const RANK_TOLERANCE: f64 = 1e-8;
/// Coordinates move at most this far, m or rad, between two poses of a continuation.
const CONTINUATION_STEP: f64 = 0.04;

/// Values of the coordinates with their derivatives at one time; one entry per coordinate of the rig.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// Values, rad or m.
    pub q: Vec<f64>,
    /// First derivatives.
    pub qd: Vec<f64>,
    /// Second derivatives.
    pub qdd: Vec<f64>,
}

/// Why there is no motion for a state.
#[derive(Clone, Debug, PartialEq)]
pub enum PoseError {
    /// The joints cannot be closed with these values of the coordinates.
    OutOfReach {
        /// The joint, or the coordinate, that gapes most.
        at: String,
        /// By how much, m or rad.
        gap: f64,
    },
    /// The coordinates do not determine the motion: a singular pose, or a body that nothing holds.
    Undetermined {
        /// The body that is freest to move.
        body: String,
    },
    /// The drives cannot move the mechanism here: no forces of theirs balance a load.
    DrivesDeadlocked,
}

impl fmt::Display for PoseError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OutOfReach { at, gap } => write!(
                f,
                "the joints do not close: `{at}` gapes by {gap:.2e}; keep the trajectory inside the workspace, and \
                 check the points of this joint"
            ),
            Self::Undetermined { body } => write!(
                f,
                "joints and coordinates do not determine the motion: `{body}` is free to move; keep clear of \
                 singular poses, or hold it by a joint"
            ),
            Self::DrivesDeadlocked => write!(
                f,
                "the drives have no leverage here: no forces of theirs balance the load; keep clear of this pose"
            ),
        }
    }
}

impl std::error::Error for PoseError {}

/// Motion of all bodies at one time.
#[derive(Clone, Debug)]
pub struct Motion {
    /// One per body of the rig.
    pub bodies: Vec<BodyMotion>,
    /// Rates of all bodies per unit rate of each coordinate: column `k` is the least-squares solution of the
    /// differentiated joints with coordinate `k` at rate one, six rows per body.
    pub(crate) rates_per_coordinate: DMatrix<f64>,
}

/// Follows a rig from pose to pose.
#[derive(Clone, Debug)]
pub struct Tracker<'r> {
    rig: &'r Rig,
    base: BodyMotion,
    /// The joints' equations with the names of their joints, then the coordinates.
    equations: Vec<(Pair, f64)>,
    names: Vec<&'r str>,
    /// Where the bodies were last, and the coordinates there.
    poses: Vec<Pose>,
    last: Vec<f64>,
}

impl<'r> Tracker<'r> {
    /// Starts at the nominal configuration, closed exactly.
    ///
    /// Fails when the joints do not close there, or do not determine the pose.
    pub fn new(rig: &'r Rig) -> Result<Self, PoseError> {
        let base = BodyMotion::at_rest(Pose::identity());
        let poses: Vec<Pose> = rig.bodies.iter().map(|body| body.nominal).collect();
        let at_rest: Vec<BodyMotion> = poses.iter().map(|p| BodyMotion::at_rest(*p)).collect();
        let joints = rig.joints.iter();
        let mut equations: Vec<(Pair, f64)> =
            joints.clone().flat_map(|j| j.equations.clone()).collect();
        let mut names: Vec<&str> = joints
            .flat_map(|j| j.equations.iter().map(|_| j.name.as_str()))
            .collect();
        let mut last = Vec::new();
        for coordinate in &rig.coordinates {
            let value = coordinate.measures.derive(&at_rest, &base).value;
            equations.push((coordinate.measures, value));
            names.push(&coordinate.name);
            last.push(value);
        }
        let mut tracker = Self {
            rig,
            base,
            equations,
            names,
            poses,
            last,
        };
        let q = tracker.last.clone();
        tracker.close(&q)?;
        Ok(tracker)
    }

    /// Values of the coordinates at the pose where the tracker stands.
    pub fn coordinates(&self) -> &[f64] {
        &self.last
    }

    /// The motion of all bodies for a state near the last one, or anywhere that can be reached from there
    /// along a straight line in the coordinates.
    ///
    /// Fails when the joints cannot be closed there or do not determine the motion.
    pub fn follow(&mut self, state: &State) -> Result<Motion, PoseError> {
        let far = state
            .q
            .iter()
            .zip(&self.last)
            .enumerate()
            .map(|(k, (to, from))| self.rig.coordinates[k].measures.difference(*to, *from))
            .fold(0.0, |most: f64, step| most.max(step.abs()));
        // Small steps keep to the assembly in which the rig is drawn.
        let n_steps = (far / CONTINUATION_STEP).min(1e4).ceil();
        let from = self.last.clone();
        let mut step = 1.0;
        while step < n_steps {
            let q: Vec<f64> = from
                .iter()
                .zip(&state.q)
                .enumerate()
                .map(|(k, (from, to))| {
                    let whole = self.rig.coordinates[k].measures.difference(*to, *from);
                    from + whole * step / n_steps
                })
                .collect();
            self.close(&q)?;
            step += 1.0;
        }
        let qr = self.close(&state.q)?;
        Ok(self.differentiate(state, &qr))
    }

    /// Gauss-Newton from the last poses to those where joints are closed and coordinates have values `q`.
    fn close(&mut self, q: &[f64]) -> Result<Factored, PoseError> {
        let n_joint = self.equations.len() - q.len();
        for (equation, value) in self.equations[n_joint..].iter_mut().zip(q) {
            equation.1 = *value;
        }
        let mut poses = self.poses.clone();
        let mut outcome = None;
        for _ in 0..MOST_STEPS {
            let bodies: Vec<BodyMotion> = poses.iter().map(|p| BodyMotion::at_rest(*p)).collect();
            let derived = self.derive(&bodies);
            let factored = self.factor(&derived)?;
            let mut residual = DVector::zeros(self.equations.len());
            for (i, ((pair, target), derived)) in self.equations.iter().zip(&derived).enumerate() {
                residual[i] = pair.difference(derived.value, *target);
            }
            let gap = residual.iamax();
            outcome = Some((self.names[gap], residual[gap].abs()));
            let mut step = factored.solve(DMatrix::from_column_slice(
                residual.len(),
                1,
                residual.as_slice(),
            ));
            let length = step.amax();
            if !length.is_finite() {
                break;
            }
            if length < SMALLEST_STEP {
                if residual[gap].abs() > LARGEST_GAP {
                    break;
                }
                self.poses = poses;
                q.clone_into(&mut self.last);
                return Ok(factored);
            }
            // A step over more than half a radian leaves the region where the gradient means anything.
            if length > 0.5 {
                step *= 0.5 / length;
            }
            for (b, pose) in poses.iter_mut().enumerate() {
                let part = |at: usize| -Vector3::new(step[at], step[at + 1], step[at + 2]);
                *pose = pose.displaced(&part(6 * b), &part(6 * b + 3));
            }
        }
        let (at, gap) = outcome.unwrap_or(("", f64::INFINITY));
        Err(PoseError::OutOfReach {
            at: at.to_owned(),
            gap,
        })
    }

    /// Rates and accelerations at the closed pose.
    fn differentiate(&self, state: &State, factored: &Factored) -> Motion {
        let n_equations = self.equations.len();
        let n_dof = state.q.len();
        let n_joint = n_equations - n_dof;
        let mut unit = DMatrix::zeros(n_equations, n_dof);
        for k in 0..n_dof {
            unit[(n_joint + k, k)] = 1.0;
        }
        let rates_per_coordinate = factored.solve(unit);
        let mut rates = DVector::zeros(rates_per_coordinate.nrows());
        for (k, qd) in state.qd.iter().enumerate() {
            rates.axpy(*qd, &rates_per_coordinate.column(k), 1.0);
        }
        let mut bodies: Vec<BodyMotion> = self
            .poses
            .iter()
            .map(|pose| BodyMotion::at_rest(*pose))
            .collect();
        let part = |of: &[f64], at: usize| Vector3::new(of[at], of[at + 1], of[at + 2]);
        for (b, body) in bodies.iter_mut().enumerate() {
            body.v_WB_W = part(rates.as_slice(), 6 * b);
            body.w_WB_W = part(rates.as_slice(), 6 * b + 3);
        }
        let mut right = DMatrix::zeros(n_equations, 1);
        for (i, derived) in self.derive(&bodies).iter().enumerate() {
            let prescribed = if i < n_joint { 0.0 } else { state.qdd[i - n_joint] };
            right[i] = prescribed - derived.bias;
        }
        let accelerations = factored.solve(right);
        for (b, body) in bodies.iter_mut().enumerate() {
            body.a_WB_W = part(accelerations.as_slice(), 6 * b);
            body.alpha_WB_W = part(accelerations.as_slice(), 6 * b + 3);
        }
        Motion {
            bodies,
            rates_per_coordinate,
        }
    }

    fn derive(&self, bodies: &[BodyMotion]) -> Vec<Derived> {
        self.equations
            .iter()
            .map(|(pair, _)| pair.derive(bodies, &self.base))
            .collect()
    }

    fn factor(&self, derived: &[Derived]) -> Result<Factored, PoseError> {
        let n = 6 * self.rig.bodies.len();
        // Rows of zeros complete a matrix with too few equations; its rank then tells.
        let mut jacobian = DMatrix::zeros(self.equations.len().max(n), n);
        for (i, ((pair, _), derived)) in self.equations.iter().zip(derived).enumerate() {
            derived.scatter(pair, |column, value| jacobian[(i, column)] += value);
        }
        let qr: ColPivQR<f64, Dyn, Dyn> = ColPivQR::new(jacobian.clone());
        let r: DMatrix<f64> = qr.r();
        let largest = r[(0, 0)].abs();
        let smallest = (0..n).fold(f64::INFINITY, |least: f64, i| least.min(r[(i, i)].abs()));
        if smallest > RANK_TOLERANCE * largest {
            return Ok(Factored { qr, r, n_equations: self.equations.len() });
        }
        // The direction that costs no equation anything: which body moves most in it?
        let svd = jacobian.svd(false, true);
        let body = svd.v_t.map_or(0, |v_t| {
            let least = svd.singular_values.imin();
            (0..n)
                .max_by(|i, j| v_t[(least, *i)].abs().total_cmp(&v_t[(least, *j)].abs()))
                .unwrap_or(0)
                / 6
        });
        Err(PoseError::Undetermined {
            body: self.rig.bodies[body].name.clone(),
        })
    }
}

/// The gradient of all equations, decomposed.
struct Factored {
    qr: ColPivQR<f64, Dyn, Dyn>,
    r: DMatrix<f64>,
    n_equations: usize,
}

impl Factored {
    /// Least-squares solutions, one per column of the right-hand side.
    fn solve(&self, right: DMatrix<f64>) -> DMatrix<f64> {
        let n = self.r.ncols();
        let mut right = right.resize_vertically(self.n_equations.max(n), 0.0);
        self.qr.q_tr_mul(&mut right);
        let mut x = right.rows(0, n).into_owned();
        let solvable = self.r.solve_upper_triangular_mut(&mut x);
        debug_assert!(solvable, "the rank was checked");
        self.qr.p().inv_permute_rows(&mut x);
        x
    }
}
