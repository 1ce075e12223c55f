//! Motion of all bodies from prescribed coordinates: Gauss-Newton on the joints' equations, rates and
//! accelerations from their derivatives.
//!
//! The equations may be redundant, as those of parallel cranks are. All of them are kept, their least-squares solution
//! is used, and the residual shows whether they contradict each other.
//! Along a trajectory an inverse is kept from pose to pose and solutions are refined (chord method).
//! The QR decomposition with column pivoting shows whether they determine the motion.
//! Source: E. Haug, "Computer Aided Kinematics and Dynamics of Mechanical Systems" (1989), sections 3.6 and 9.6.
//!
//! Decision: a decomposition per Newton step took most of the time of a run. Only the residual decides whether a
//! pose is reached; slow progress requests a new inverse, whose rank is checked.

use std::fmt;

use nalgebra::linalg::ColPivQR;
use nalgebra::{DMatrix, DVector, Dyn, Vector3};

use crate::pair::{PairDerivatives, PairFunction};
use crate::pose::{BodyMotion, BodyPose};
use crate::rig::Rig;

/// Largest number of Gauss-Newton steps for a pose.
const MOST_STEPS: usize = 40;
/// A shorter step, m or rad, ends the iteration: convergence is quadratic, and the rest is rounding.
const SMALLEST_STEP: f64 = 1e-11;
/// A step, or a refinement, that is not shorter than this share of the one before requires a new inverse.
const SLOWEST: f64 = 0.2;
/// Rates are refined until their change is below this share.
const REFINED: f64 = 1e-13;
/// Largest residual of a closed joint, m or rad.
const LARGEST_GAP: f64 = 1e-9;
/// A pivot below this share of the largest means that a body can move by itself.
const RANK_TOLERANCE: f64 = 1e-8;
/// The same if lengths contradict each other by a few percent.
const CONTRADICTION: f64 = 0.03;
/// Coordinates move at most this far, m or rad, between two poses of a continuation.
const CONTINUATION_STEP: f64 = 0.04;

/// Values of the coordinates with their derivatives at one time; one entry per coordinate of the rig.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RigState {
    /// Values, rad or m.
    pub q: Vec<f64>,
    /// First derivatives.
    pub qd: Vec<f64>,
    /// Second derivatives.
    pub qdd: Vec<f64>,
}

/// Why a state has no motion.
#[derive(Clone, Debug, PartialEq)]
pub enum RigPoseError {
    /// The joints cannot be closed with these values of the coordinates.
    OutOfReach {
        /// The joint, or the coordinate, with the largest residual.
        at: String,
        /// The residual, m or rad.
        gap: f64,
    },
    /// The coordinates do not determine the motion: a singular pose, or a body without joints.
    Undetermined {
        /// The body with the largest undetermined motion.
        body: String,
    },
    /// There are more coordinates than the joints leave degrees of freedom.
    TooManyCoordinates {
        /// Number of degrees of freedom.
        freedoms: usize,
        /// Number of coordinates.
        coordinates: usize,
        /// Whether there would be enough degrees of freedom if small gaps of joints were accepted, as where parallel
        /// bodies differ slightly in length.
        enough_with_gaps: bool,
    },
    /// The drives cannot balance a load at this pose.
    DrivesDeadlocked,
}

impl fmt::Display for RigPoseError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OutOfReach { at, gap } => write!(
                f,
                "the joints do not close: the gap at `{at}` is {gap:.2e}; keep the trajectory inside the workspace, \
                 and check the points of this joint"
            ),
            Self::Undetermined { body } => write!(
                f,
                "joints and coordinates do not determine the motion: `{body}` is free to move; avoid singular poses, \
                 or fix it with a joint"
            ),
            Self::TooManyCoordinates {
                freedoms,
                coordinates,
                enough_with_gaps: false,
            } => write!(
                f,
                "the joints leave fewer degrees of freedom ({freedoms}) than there are coordinates ({coordinates}); give as \
                 many coordinates and drives as there are degrees of freedom"
            ),
            Self::TooManyCoordinates {
                freedoms, coordinates, ..
            } => write!(
                f,
                "the joints leave fewer degrees of freedom ({freedoms}) than there are coordinates ({coordinates}), because \
                 lengths contradict each other slightly; make bodies that move alike, such as parallel cranks, equally \
                 long, or accept gaps of joints"
            ),
            Self::DrivesDeadlocked => write!(f, "the drives cannot balance a load at this pose; avoid this pose"),
        }
    }
}

impl std::error::Error for RigPoseError {}

/// Motion of all bodies at one time.
#[derive(Clone, Debug)]
pub struct RigMotion {
    /// One per body of the rig.
    pub bodies: Vec<BodyMotion>,
    /// Rates of all bodies per unit rate of each coordinate: column `k` is the least-squares solution of the
    /// differentiated joints with coordinate `k` at rate one, six rows per body.
    pub(crate) rates_per_coordinate: DMatrix<f64>,
}

/// Computes the motion of a rig from pose to pose.
#[derive(Clone, Debug)]
pub struct RigTracker<'r> {
    /// The rig.
    rig: &'r Rig,
    /// The base as a body at standstill.
    base: BodyMotion,
    /// The joints' equations with the names of their joints, then the coordinates.
    equations: Vec<(PairFunction, f64)>,
    /// Name of the joint or coordinate of every equation.
    names: Vec<&'r str>,
    /// Last poses of the bodies.
    poses: Vec<BodyPose>,
    /// Coordinates at these poses, rad or m.
    last: Vec<f64>,
    /// Rates per unit rate of each coordinate at the last pose, from which the next pose is predicted.
    slopes: Option<DMatrix<f64>>,
    /// Inverse of the gradient at a pose nearby.
    inverse: Option<GradientInverse>,
    /// The joint, or the coordinate, with the largest residual at the last pose, and this residual in m or rad.
    gap: (&'r str, f64),
}

impl<'r> RigTracker<'r> {
    /// Starts at the nominal configuration, with all joints closed.
    ///
    /// Fails if the joints do not close there, leave fewer degrees of freedom than coordinates, or do not determine the
    /// pose together with these.
    pub fn new(rig: &'r Rig) -> Result<Self, RigPoseError> {
        let base = BodyMotion::at_standstill(BodyPose::identity());
        let poses: Vec<BodyPose> = rig.bodies.iter().map(|body| body.nominal).collect();
        let at_rest: Vec<BodyMotion> = poses.iter().map(|p| BodyMotion::at_standstill(*p)).collect();
        let joints = rig.joints.iter();
        let mut equations: Vec<(PairFunction, f64)> = joints.clone().flat_map(|j| j.equations.clone()).collect();
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
            slopes: None,
            inverse: None,
            gap: ("", 0.0),
        };
        let q = tracker.last.clone();
        tracker.close_joints(&q)?;
        // Lengths that contradict each other take degrees of freedom away; with gaps, the residual of each pose decides.
        if rig.gap_tolerance == 0.0 {
            tracker.check_freedoms()?;
        }
        Ok(tracker)
    }

    /// Checks the number of coordinates: more coordinates than degrees of freedom would contradict each other as soon
    /// as the rig moves. The rank of the joints' equations can only be lower at a special pose, so no valid rig is
    /// refused.
    fn check_freedoms(&self) -> Result<(), RigPoseError> {
        let n = 6 * self.rig.bodies.len();
        let coordinates = self.last.len();
        let n_joint = self.equations.len() - coordinates;
        let bodies: Vec<BodyMotion> = self.poses.iter().map(|p| BodyMotion::at_standstill(*p)).collect();
        let mut jacobian: DMatrix<f64> = DMatrix::zeros(n_joint.max(n), n);
        for (i, (pair, _)) in self.equations[..n_joint].iter().enumerate() {
            let derived = pair.derive(&bodies, &self.base);
            derived.scatter(pair, |column, value| jacobian[(i, column)] += value);
        }
        let r: DMatrix<f64> = ColPivQR::new(jacobian).r();
        let freedoms_at = |tolerance: f64| {
            let held = (0..n).filter(|i| r[(*i, *i)].abs() > tolerance * r[(0, 0)].abs());
            n - held.count()
        };
        let freedoms = freedoms_at(RANK_TOLERANCE);
        if coordinates > freedoms {
            return Err(RigPoseError::TooManyCoordinates {
                freedoms,
                coordinates,
                enough_with_gaps: freedoms_at(CONTRADICTION) >= coordinates,
            });
        }
        Ok(())
    }

    /// The largest displacement of a body's centre of mass from its pose in the file, m.
    pub fn largest_displacement(&self) -> f64 {
        let pairs = self.rig.bodies.iter().zip(&self.poses);
        let place = |pose: &BodyPose, at: &Vector3<f64>| pose.q_WB * at + pose.p_WB_W;
        let moves = pairs.map(|(body, pose)| (place(pose, &body.centre) - place(&body.nominal, &body.centre)).norm());
        moves.fold(0.0, f64::max)
    }

    /// Values of the coordinates at the last pose.
    pub fn coordinates(&self) -> &[f64] {
        &self.last
    }

    /// The joint, or the coordinate, with the largest residual at the last pose, and this residual in m or rad. It is
    /// above rounding only if the rig has a tolerance.
    pub fn largest_gap(&self) -> (&'r str, f64) {
        self.gap
    }

    /// The motion of all bodies for a state near the last one, or for any state that can be reached from there
    /// along a straight line in the coordinates.
    ///
    /// Fails if the joints cannot be closed there or do not determine the motion.
    pub fn follow(&mut self, state: &RigState) -> Result<RigMotion, RigPoseError> {
        let far = state
            .q
            .iter()
            .zip(&self.last)
            .enumerate()
            .map(|(k, (to, from))| self.rig.coordinates[k].measures.wrapped_difference(*to, *from))
            .fold(0.0, |most: f64, step| most.max(step.abs()));
        // Small steps stay in the assembly mode of the nominal configuration.
        let n_steps = (far / CONTINUATION_STEP).min(1e4).ceil();
        let from = self.last.clone();
        let mut step = 1.0;
        while step < n_steps {
            let q: Vec<f64> = from
                .iter()
                .zip(&state.q)
                .enumerate()
                .map(|(k, (from, to))| {
                    let whole = self.rig.coordinates[k].measures.wrapped_difference(*to, *from);
                    from + whole * step / n_steps
                })
                .collect();
            self.close_joints(&q)?;
            step += 1.0;
        }
        self.close_joints(&state.q)?;
        let motion = self.differentiate(state)?;
        self.slopes = Some(motion.rates_per_coordinate.clone());
        Ok(motion)
    }

    /// Gauss-Newton from the last poses to the poses with closed joints and coordinates `q`.
    ///
    /// One inverse of the gradient is used as long as steps shrink fast with it. Along a trajectory this saves
    /// nearly all decompositions. The residual, not the inverse, decides whether the pose is reached.
    fn close_joints(&mut self, q: &[f64]) -> Result<(), RigPoseError> {
        let n_joint = self.equations.len() - q.len();
        // The coordinates are the last equations.
        for (equation, value) in self.equations[n_joint..].iter_mut().zip(q) {
            equation.1 = *value;
        }
        let mut poses = self.predict_poses(q);
        let mut outcome = ("", f64::INFINITY);
        let mut last_length = f64::INFINITY;
        let mut is_fresh = false;
        for _ in 0..MOST_STEPS {
            let bodies: Vec<BodyMotion> = poses.iter().map(|p| BodyMotion::at_standstill(*p)).collect();
            let derived = self.derive(&bodies);
            let mut residual = DMatrix::zeros(self.equations.len(), 1);
            for (i, ((pair, target), derived)) in self.equations.iter().zip(&derived).enumerate() {
                residual[i] = pair.wrapped_difference(derived.value, *target);
            }
            let gap = residual.iamax_full().0;
            outcome = (self.names[gap], residual[gap].abs());
            let known = self.inverse.as_ref().map(|inverse| inverse.solve(&residual));
            let shrinks = |step: &DMatrix<f64>| step.amax() < SMALLEST_STEP.max(SLOWEST * last_length);
            let mut step = if let Some(step) = known.filter(shrinks) {
                step
            } else {
                let fresh = self.invert(&derived)?;
                let step = fresh.solve(&residual);
                self.inverse = Some(fresh);
                is_fresh = true;
                step
            };
            let length = step.amax();
            if !length.is_finite() {
                break;
            }
            if length < SMALLEST_STEP {
                if outcome.1 > LARGEST_GAP {
                    // An old inverse may not see this residual, and has another least-squares solution.
                    if !is_fresh {
                        self.inverse = None;
                        continue;
                    }
                    if outcome.1.is_nan() || outcome.1 > self.rig.gap_tolerance {
                        break;
                    }
                }
                displace(&mut poses, &step);
                self.poses = poses;
                self.gap = outcome;
                q.clone_into(&mut self.last);
                return Ok(());
            }
            // After a step of more than half a radian the gradient is no longer valid.
            if length > 0.5 {
                step *= 0.5 / length;
                last_length = f64::INFINITY;
            } else {
                last_length = length;
            }
            is_fresh = false;
            displace(&mut poses, &step);
        }
        // The next pose starts with a new inverse.
        self.inverse = None;
        Err(RigPoseError::OutOfReach {
            at: outcome.0.to_owned(),
            gap: outcome.1,
        })
    }

    /// Prediction of the poses at coordinates `q`, to first order.
    fn predict_poses(&self, q: &[f64]) -> Vec<BodyPose> {
        let mut poses = self.poses.clone();
        if let Some(slopes) = &self.slopes {
            let measures = self.rig.coordinates.iter().map(|c| &c.measures);
            let steps = measures.zip(q).zip(&self.last);
            // `displace` subtracts its step, so the sign is negative.
            let back = DMatrix::from_iterator(
                q.len(),
                1,
                steps.map(|((m, to), from)| -m.wrapped_difference(*to, *from)),
            );
            displace(&mut poses, &(slopes * back));
        }
        poses
    }

    /// Rates and accelerations of all bodies at the closed pose.
    fn differentiate(&mut self, state: &RigState) -> Result<RigMotion, RigPoseError> {
        let n_equations = self.equations.len();
        let n_dof = state.q.len();
        let n_joint = n_equations - n_dof;
        let mut bodies: Vec<BodyMotion> = self.poses.iter().map(|pose| BodyMotion::at_standstill(*pose)).collect();
        let derived = self.derive(&bodies);
        // Unit rate of each coordinate, with the joints' equations constant.
        let mut unit = DMatrix::zeros(n_equations, n_dof);
        for k in 0..n_dof {
            unit[(n_joint + k, k)] = 1.0;
        }
        let rates_per_coordinate = self.solve(&derived, &unit)?;
        let rates = &rates_per_coordinate * DVector::from_column_slice(&state.qd);
        let part = |of: &[f64], at: usize| Vector3::new(of[at], of[at + 1], of[at + 2]);
        for (b, body) in bodies.iter_mut().enumerate() {
            body.v_WB_W = part(rates.as_slice(), 6 * b);
            body.w_WB_W = part(rates.as_slice(), 6 * b + 3);
        }
        // Accelerations: the joints' second derivatives are zero, and the coordinates' ones are prescribed.
        let mut right = DMatrix::zeros(n_equations, 1);
        for (i, derived) in self.derive(&bodies).iter().enumerate() {
            let prescribed = if i < n_joint { 0.0 } else { state.qdd[i - n_joint] };
            right[i] = prescribed - derived.bias;
        }
        let accelerations = self.solve(&derived, &right)?;
        for (b, body) in bodies.iter_mut().enumerate() {
            body.a_WB_W = part(accelerations.as_slice(), 6 * b);
            body.alpha_WB_W = part(accelerations.as_slice(), 6 * b + 3);
        }
        Ok(RigMotion {
            bodies,
            rates_per_coordinate,
        })
    }

    /// Solves `gradient x = right` by iterative refinement with the present inverse; with a new one if that converges
    /// slowly.
    fn solve(&mut self, derived: &[PairDerivatives], right: &DMatrix<f64>) -> Result<DMatrix<f64>, RigPoseError> {
        let scale = right.amax().max(f64::MIN_POSITIVE);
        if let Some(inverse) = &self.inverse {
            let mut x = inverse.solve(right);
            let mut last_length = f64::INFINITY;
            loop {
                let step = inverse.solve(&(right - self.product(derived, &x)));
                let length = step.amax();
                if length <= REFINED * x.amax().max(scale) {
                    return Ok(x + step);
                }
                if length > SLOWEST * last_length || !length.is_finite() {
                    break;
                }
                x += step;
                last_length = length;
            }
        }
        let fresh = self.invert(derived)?;
        let mut x = fresh.solve(right);
        x += fresh.solve(&(right - self.product(derived, &x)));
        self.inverse = Some(fresh);
        Ok(x)
    }

    /// Gradient of all equations times columns of rates.
    fn product(&self, derived: &[PairDerivatives], x: &DMatrix<f64>) -> DMatrix<f64> {
        let mut product = DMatrix::zeros(self.equations.len(), x.ncols());
        for (i, ((pair, _), derived)) in self.equations.iter().zip(derived).enumerate() {
            for k in 0..x.ncols() {
                let mut sum = 0.0;
                derived.scatter(pair, |column, value| sum += value * x[(column, k)]);
                product[(i, k)] = sum;
            }
        }
        product
    }

    /// Values and derivatives of all equations.
    fn derive(&self, bodies: &[BodyMotion]) -> Vec<PairDerivatives> {
        self.equations
            .iter()
            .map(|(pair, _)| pair.derive(bodies, &self.base))
            .collect()
    }

    /// The inverse of the gradient; an error if the equations do not determine the motion of all bodies.
    fn invert(&self, derived: &[PairDerivatives]) -> Result<GradientInverse, RigPoseError> {
        let n = 6 * self.rig.bodies.len();
        // Rows of zeros complete a matrix with too few equations, so that its rank shows this.
        let mut jacobian: DMatrix<f64> = DMatrix::zeros(self.equations.len().max(n), n);
        for (i, ((pair, _), derived)) in self.equations.iter().zip(derived).enumerate() {
            derived.scatter(pair, |column, value| jacobian[(i, column)] += value);
        }
        if jacobian.iter().all(|x| x.is_finite()) {
            let qr: ColPivQR<f64, Dyn, Dyn> = ColPivQR::new(jacobian.clone());
            let r: DMatrix<f64> = qr.r();
            let largest = r[(0, 0)].abs();
            let smallest = (0..n).fold(f64::INFINITY, |least: f64, i| least.min(r[(i, i)].abs()));
            if smallest > RANK_TOLERANCE * largest {
                let q: DMatrix<f64> = qr.q();
                let mut inverse = q.rows(0, self.equations.len()).transpose();
                let solvable = r.solve_upper_triangular_mut(&mut inverse);
                debug_assert!(solvable, "the rank was checked");
                qr.p().inv_permute_rows(&mut inverse);
                return Ok(GradientInverse(inverse));
            }
        }
        Err(RigPoseError::Undetermined {
            body: self.rig.bodies[freest_body(jacobian)].name.clone(),
        })
    }
}

/// The body that moves most in the direction that violates the equations least.
fn freest_body(jacobian: DMatrix<f64>) -> usize {
    let n = jacobian.ncols();
    if jacobian.iter().any(|x| !x.is_finite()) {
        return 0;
    }
    let svd = jacobian.svd(false, true);
    svd.v_t.map_or(0, |v_t| {
        let least = svd.singular_values.imin();
        (0..n)
            .max_by(|i, j| v_t[(least, *i)].abs().total_cmp(&v_t[(least, *j)].abs()))
            .unwrap_or(0)
            / 6
    })
}

/// Moves all bodies by minus a step, six rows per body.
fn displace(poses: &mut [BodyPose], step: &DMatrix<f64>) {
    for (b, pose) in poses.iter_mut().enumerate() {
        let part = |at: usize| -Vector3::new(step[at], step[at + 1], step[at + 2]);
        *pose = pose.displaced_by(&part(6 * b), &part(6 * b + 3));
    }
}

/// The least-squares inverse of the gradient of all equations at one pose.
#[derive(Clone, Debug)]
struct GradientInverse(DMatrix<f64>);

impl GradientInverse {
    /// Least-squares solutions, one per column of the right-hand side.
    fn solve(&self, right: &DMatrix<f64>) -> DMatrix<f64> {
        &self.0 * right
    }
}
