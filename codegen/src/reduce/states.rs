//! States of a mechanism at the model file's values, with many digits: poses of a walk are closed to all digits, and
//! the rows of the regressor are evaluated there.

use modelmill_algebra::digits::BigFloat;
use modelmill_algebra::field::RandomStream;
use modelmill_spec::{Mechanism, ModelConstant};
use nalgebra::{DMatrix, DVector};

use super::closing_constants::{
    CLOSED_TO_ALL_DIGITS, ConstantSensitivity, NO_CONTRADICTION, PoseContradiction, SINGULAR, changed_value,
    least_change, project_residuals,
};
use crate::DeriveError;
use crate::expr::independent::SEED;
use crate::expr::{Atom, BigFloatPoint, EvaluationTape, ExprId, Graph};
use crate::loops::numeric_poses::{NumericLoops, uniform_symmetric};
use crate::loops::walk::{NEARLY_CLOSED, PoseWalk, all_residuals};
use crate::regressor::projection::LoopProjection;
use crate::stop::StopRequest;

/// Evaluates rows of the regressor at successive states of one walk.
pub(super) struct WalkSampler<'a> {
    /// Kinds of coordinates and values of the file.
    mechanism: &'a Mechanism,
    /// The walk, in double precision.
    walk: PoseWalk<'a>,
    /// The selected equations with their derivatives by the passive coordinates.
    kept: NumericLoops<'a>,
    /// Indices of the active coordinates.
    active: Vec<usize>,
    /// Indices of the passive coordinates.
    passive: Vec<usize>,
    /// Number of columns of the regressor.
    n_columns: usize,
    /// Number of drives, which is the number of rows per state.
    n_drives: usize,
    /// The selected residuals, then all residuals.
    residual: EvaluationTape,
    /// Rates of the passive coordinates.
    rates: EvaluationTape,
    /// Accelerations of the passive coordinates.
    accelerations: EvaluationTape,
    /// The regressor, drive by drive.
    outputs: EvaluationTape,
    /// Values of pi, constants and parameters.
    constants: BigFloatPoint,
    /// Random numbers for rates, accelerations and loads.
    stream: RandomStream,
    /// Largest residual so far of equations that are not selected, relative to the size of the loops.
    off: f64,
    /// Derivatives of all equations by the constants in them.
    sensitivity: ConstantSensitivity,
    /// Poses so far at which rows were evaluated.
    poses: Vec<Vec<f64>>,
    /// Largest change of a constant, in rad or relative to its size, with which all equations hold; `None` without one.
    change: Option<f64>,
}

impl<'a> WalkSampler<'a> {
    /// Prepares the columns `columns[k][d]` (product by drive).
    ///
    /// # Errors
    /// [`DeriveError::NoPointFound`] if the nominal pose cannot be closed or a value of the file is not finite.
    pub(super) fn new(
        graph: &mut Graph,
        mechanism: &'a Mechanism,
        projection: &LoopProjection,
        columns: &[Vec<ExprId>],
    ) -> Result<Self, DeriveError> {
        let none = DeriveError::NoPointFound { draws: 1 };
        let loops = &projection.loops;
        let walk = PoseWalk::new(graph, mechanism, loops).ok_or(none.clone())?;
        let n_drives = projection.drives.len();
        let outputs: Vec<ExprId> = (0..n_drives).flat_map(|d| columns.iter().map(move |c| c[d])).collect();
        // Values of the file as the decimals that were written, not as binary numbers.
        let mut constants = BigFloatPoint::default();
        let mut set =
            |atom, value: Option<BigFloat>, is_angle| value.and_then(|value| constants.set(atom, value, is_angle));
        set(Atom::Pi, Some(BigFloat::pi()), false).ok_or(none.clone())?;
        for (i, constant) in mechanism.constants.iter().enumerate() {
            set(Atom::Constant(i), stated_value(constant), constant.is_angle).ok_or(none.clone())?;
        }
        for (i, parameter) in mechanism.parameters.iter().enumerate() {
            let value = BigFloat::from_shortest_decimal(parameter.nominal);
            set(Atom::Parameter(i), value, false).ok_or(none.clone())?;
        }
        let equations = all_residuals(loops);
        // As many equations as unknowns agree with any constants.
        let redundant = if equations.len() > loops.passive.len() {
            &equations[..]
        } else {
            &[]
        };
        Ok(Self {
            sensitivity: ConstantSensitivity::new(graph, mechanism, redundant, &loops.passive),
            poses: Vec::new(),
            change: None,
            kept: NumericLoops::new(graph, mechanism, &loops.residual),
            active: loops.active.clone(),
            passive: loops.passive.clone(),
            n_columns: columns.len(),
            n_drives,
            residual: EvaluationTape::new(graph, &[loops.residual.clone(), equations].concat()),
            rates: EvaluationTape::new(graph, &projection.passive_rates),
            accelerations: EvaluationTape::new(graph, &projection.passive_accelerations),
            outputs: EvaluationTape::new(graph, &outputs),
            constants,
            stream: RandomStream::new(SEED),
            off: 0.0,
            mechanism,
            walk,
        })
    }

    /// At least `wanted` rows at new states. Each state's rows are scaled so that their largest number is about 1.
    ///
    /// # Errors
    /// [`DeriveError::NoPointFound`] if the walk makes no progress or the rows have no values.
    pub(super) fn next_rows(
        &mut self,
        wanted: usize,
        stop: StopRequest<'_>,
    ) -> Result<Vec<Vec<BigFloat>>, DeriveError> {
        // Draws per state.
        const TRIES: usize = 10;
        /// Number of consecutive failures after which the walk is given up.
        const STUCK: usize = 3;
        let n_states = wanted.div_ceil(self.n_drives.max(1)).max(1);
        let mut rows = Vec::new();
        let (mut n_found, mut tries, mut stuck) = (0, 0, 0);
        while n_found < n_states {
            stop.check()?;
            tries += 1;
            if tries > TRIES * n_states || stuck == STUCK {
                return Err(DeriveError::NoPointFound { draws: tries });
            }
            let Some(pose) = self.walk.next_pose(&mut self.stream) else {
                stuck += 1;
                continue;
            };
            stuck = 0;
            let Some(values) = self.evaluate_at(&pose) else {
                continue;
            };
            let largest = values.iter().map(|x| x.to_f64().abs()).fold(0.0, f64::max);
            if !largest.is_normal() {
                continue;
            }
            n_found += 1;
            self.poses.push(pose);
            #[expect(clippy::cast_possible_truncation, reason = "the exponent of a machine number")]
            // Scaling by a power of two is exact.
            let scale = -(largest.log2() as i64);
            let scaled: Vec<BigFloat> = values.iter().map(|x| x.scale_by_power_of_two(scale)).collect();
            rows.extend(scaled.chunks(self.n_columns.max(1)).map(<[BigFloat]>::to_vec));
        }
        Ok(rows)
    }

    /// The size of the largest loop, m.
    pub(super) fn loop_size(&self) -> f64 {
        self.walk.loop_size()
    }

    /// The largest residual, over all states so far, of loops with more equations than needed, relative to their size.
    /// It is caused by rounded constants in the file.
    pub(super) fn closure_error(&self) -> f64 {
        self.off
    }

    /// The value of a constant, as stated in the file or as changed by [`Self::close_by_constants`].
    pub(super) fn constant_value(&self, constant: usize) -> Option<&BigFloat> {
        self.constants.value(Atom::Constant(constant))
    }

    /// The largest change of a constant, in rad or relative to its size, if constants were changed.
    pub(super) fn constant_change(&self) -> Option<f64> {
        self.change
    }

    /// Changes constants so that all equations hold to all digits, and starts the record of closure errors again.
    /// False, without a change, if all equations hold already or no small change achieves this.
    pub(super) fn close_by_constants(&mut self) -> bool {
        if self.off <= NO_CONTRADICTION {
            return false;
        }
        let stated = self.constants.clone();
        for selection in self.sensitivity.selections(self.mechanism, &is_part_of_turn) {
            for singular in SINGULAR {
                if let Some(change) = self.change_constants(&selection, singular) {
                    (self.change, self.off) = (Some(change), 0.0);
                    return true;
                }
                self.constants = stated.clone();
            }
        }
        false
    }

    /// Takes back the changes of [`Self::close_by_constants`].
    pub(super) fn restore_constants(&mut self) -> Option<()> {
        for (i, constant) in self.mechanism.constants.iter().enumerate() {
            let value = stated_value(constant)?;
            self.constants.set(Atom::Constant(i), value, constant.is_angle)?;
        }
        self.change = None;
        Some(())
    }

    /// Gauss-Newton steps on some constants until all loops close at many poses; returns the largest change. `None` if a
    /// contradiction remains. Singular values below the share `singular` of the largest count as zero.
    fn change_constants(&mut self, selection: &[usize], singular: f64) -> Option<f64> {
        /// Number of poses at which all equations must hold. Each has at least one contradiction for the constants.
        const POSES: usize = 24;
        /// Largest number of steps. Each adds as many digits as derivatives in double precision have.
        const ROUNDS: usize = 40;
        /// Residuals must fall at least by this factor per step.
        const FALL: f64 = 0.3;
        let every = self.poses.len().div_ceil(POSES).max(1);
        let poses: Vec<Vec<f64>> = self.poses.iter().step_by(every).cloned().collect();
        let units: Vec<f64> = (self.passive.iter()).map(|p| self.walk.coordinate_unit(*p)).collect();
        let sizes = self.walk.residual_sizes();
        let at = |q: &Vec<f64>| {
            let sensitivity = &self.sensitivity;
            sensitivity.contradiction(self.mechanism, q, sizes, &units, selection)
        };
        let contradictions: Vec<PoseContradiction> = poses.iter().map(at).collect::<Option<_>>()?;
        let inverse = least_change(&contradictions, singular)?;
        let mut last = f64::INFINITY;
        for _ in 0..ROUNDS {
            let closed = poses.iter().map(|q| Some(self.close_loops(q)?.1));
            let residuals: Vec<Vec<f64>> = closed.collect::<Option<_>>()?;
            let most = residuals.iter().flatten().fold(0.0, |most: f64, x| most.max(x.abs()));
            if most <= CLOSED_TO_ALL_DIGITS || most > FALL * last {
                return (most <= NO_CONTRADICTION).then(|| self.largest_change(selection))?;
            }
            last = most;
            let step = &inverse * project_residuals(&contradictions, &residuals);
            for (at, step) in selection.iter().zip(step.iter()) {
                let (i, one) = self.sensitivity.constant(*at);
                let constant = &self.mechanism.constants[i];
                let value = changed_value(self.constant_value(i)?, constant.value, one, *step)?;
                self.constants.set(Atom::Constant(i), value, constant.is_angle)?;
            }
        }
        None
    }

    /// The largest change of selected constants from their stated values, in rad or relative to their size.
    fn largest_change(&self, selection: &[usize]) -> Option<f64> {
        let mut changes = selection.iter().map(|at| {
            let (i, one) = self.sensitivity.constant(*at);
            let change = self.constant_value(i)? - &stated_value(&self.mechanism.constants[i])?;
            Some(change.to_f64().abs() / one)
        });
        changes.try_fold(0.0, |most: f64, change| Some(most.max(change?)))
    }

    /// Values of the outputs at a pose, with random rates, accelerations and loads; `None` where they do not exist.
    fn evaluate_at(&mut self, q: &[f64]) -> Option<Vec<BigFloat>> {
        let (mut point, residuals) = self.close_loops(q)?;
        let off = residuals.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        for i in self.active.clone() {
            let unit = self.walk.coordinate_unit(i);
            let mut random = |most: f64| BigFloat::from_f64(most * unit * uniform_symmetric(&mut self.stream));
            point.set(Atom::Rate(i), random(2.0)?, false)?;
            point.set(Atom::Acceleration(i), random(5.0)?, false)?;
        }
        // Loads of the size of forces in N.
        for d in 0..self.n_drives {
            let load = BigFloat::from_f64(100.0 * uniform_symmetric(&mut self.stream))?;
            point.set(Atom::Load(d), load, false)?;
        }
        // Passive rates come before the accelerations, which depend on them.
        for (p, value) in self.passive.iter().zip(self.rates.evaluate(&point)?) {
            point.set(Atom::Rate(*p), value, false)?;
        }
        for (p, value) in self.passive.iter().zip(self.accelerations.evaluate(&point)?) {
            point.set(Atom::Acceleration(*p), value, false)?;
        }
        let values = self.outputs.evaluate(&point)?;
        self.off = self.off.max(off);
        Some(values)
    }

    /// A pose with its passive coordinates to all digits, and the residuals of all equations, relative to the size of the
    /// loops. `None` if the loops do not close.
    fn close_loops(&self, q: &[f64]) -> Option<(BigFloatPoint, Vec<f64>)> {
        /// Largest number of Newton steps. Each adds as many correct digits as the inverse has in double precision.
        const ROUNDS: usize = 40;
        let mut point = self.constants.clone();
        let place = |point: &mut BigFloatPoint, i: usize, value: BigFloat| {
            let is_angle = self.mechanism.coordinates[i].motion.is_angle();
            point.set(Atom::Coordinate(i), value, is_angle)
        };
        for (i, value) in q.iter().enumerate() {
            place(&mut point, i, BigFloat::from_f64(*value)?)?;
        }
        if self.passive.is_empty() {
            return Some((point, Vec::new()));
        }
        let (_, mut jacobian) = self.kept.linearise(q)?;
        for (mut column, p) in jacobian.column_iter_mut().zip(&self.passive) {
            column *= self.walk.coordinate_unit(*p);
        }
        // The derivatives stay those of the first pose: its inverse is accurate enough for linear convergence.
        let inverse: DMatrix<f64> = jacobian.try_inverse()?;
        for _ in 0..ROUNDS {
            let values = self.residual.evaluate(&point)?;
            let (kept, all) = values.split_at(self.passive.len());
            let gaps = DVector::from_iterator(kept.len(), kept.iter().map(BigFloat::to_f64));
            let step = &inverse * gaps;
            // Converged: the other equations must be satisfied as well.
            if step.amax() < BigFloat::ROUNDING {
                let relative = all.iter().zip(self.walk.residual_sizes());
                let relative: Vec<f64> = relative.map(|(x, size)| x.to_f64() / size).collect();
                let is_closed = relative.iter().all(|x| x.abs() <= NEARLY_CLOSED);
                return is_closed.then_some((point, relative));
            }
            for (p, dx) in self.passive.iter().zip(step.iter()) {
                let change = BigFloat::from_f64(dx * self.walk.coordinate_unit(*p))?;
                let value = point.value(Atom::Coordinate(*p))? - &change;
                place(&mut point, *p, value)?;
            }
        }
        None
    }
}

/// A constant with all digits: the decimal that was written, or for an angle near a part of a turn that part.
fn stated_value(constant: &ModelConstant) -> Option<BigFloat> {
    let value = constant.value;
    if constant.is_angle && is_part_of_turn(value) {
        let part = &BigFloat::from_f64(quarter_degrees(value))? * &BigFloat::pi();
        return Some(part / BigFloat::from_f64(PER_HALF_TURN)?);
    }
    BigFloat::from_shortest_decimal(value)
}

/// Quarters of a degree in half a revolution.
const PER_HALF_TURN: f64 = 720.0;

/// An angle in quarters of a degree, rounded.
fn quarter_degrees(angle: f64) -> f64 {
    (angle / std::f64::consts::PI * PER_HALF_TURN).round()
}

/// Whether an angle other than 0 is a multiple of a quarter of a degree up to rounding.
fn is_part_of_turn(angle: f64) -> bool {
    let n = quarter_degrees(angle);
    let off = (n * std::f64::consts::PI / PER_HALF_TURN - angle).abs();
    n != 0.0 && off <= 4.0 * f64::EPSILON * angle.abs()
}
