//! States of a mechanism at the model file's values, with many digits: poses of a walk are closed to all digits, and
//! the rows of the regressor are evaluated there.

use modelmill_algebra::digits::BigFloat;
use modelmill_algebra::field::RandomStream;
use modelmill_spec::Mechanism;
use nalgebra::{DMatrix, DVector};

use crate::DeriveError;
use crate::expr::independent::SEED;
use crate::expr::{Atom, BigFloatPoint, EvaluationTape, ExprId, Graph};
use crate::loops::numeric_poses::{NumericLoops, uniform_symmetric};
use crate::loops::walk::{NEARLY_CLOSED, PoseWalk, all_residuals};
use crate::regressor::projection::LoopProjection;

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
            let value = if constant.is_angle {
                declared_angle(constant.value)
            } else {
                BigFloat::from_shortest_decimal(constant.value)
            };
            set(Atom::Constant(i), value, constant.is_angle).ok_or(none.clone())?;
        }
        for (i, parameter) in mechanism.parameters.iter().enumerate() {
            let value = BigFloat::from_shortest_decimal(parameter.nominal);
            set(Atom::Parameter(i), value, false).ok_or(none.clone())?;
        }
        Ok(Self {
            kept: NumericLoops::new(graph, mechanism, &loops.residual),
            active: loops.active.clone(),
            passive: loops.passive.clone(),
            n_columns: columns.len(),
            n_drives,
            residual: EvaluationTape::new(graph, &[loops.residual.clone(), all_residuals(loops)].concat()),
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
    pub(super) fn next_rows(&mut self, wanted: usize) -> Result<Vec<Vec<BigFloat>>, DeriveError> {
        // Draws per state.
        const TRIES: usize = 10;
        /// Number of consecutive failures after which the walk is given up.
        const STUCK: usize = 3;
        let n_states = wanted.div_ceil(self.n_drives.max(1)).max(1);
        let mut rows = Vec::new();
        let (mut n_found, mut tries, mut stuck) = (0, 0, 0);
        while n_found < n_states {
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

    /// Values of the outputs at a pose, with random rates, accelerations and loads; `None` where they do not exist.
    fn evaluate_at(&mut self, q: &[f64]) -> Option<Vec<BigFloat>> {
        let (mut point, off) = self.close_loops(q)?;
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

    /// A pose with its passive coordinates to all digits, and the largest residual of equations that are not selected,
    /// relative to the size of the loops. `None` if the loops do not close.
    fn close_loops(&self, q: &[f64]) -> Option<(BigFloatPoint, f64)> {
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
            return Some((point, 0.0));
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
                let relative = relative.map(|(x, size)| x.to_f64().abs() / size);
                let off = relative.fold(0.0, f64::max);
                return (off <= NEARLY_CLOSED).then_some((point, off));
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

/// A constant angle with all digits: a multiple of a quarter of a degree if the value equals one up to rounding, else
/// the decimal that was written.
fn declared_angle(value: f64) -> Option<BigFloat> {
    // Quarters of a degree in half a revolution.
    const PER_HALF_TURN: f64 = 720.0;
    let n = (value / std::f64::consts::PI * PER_HALF_TURN).round();
    let is_near = (n * std::f64::consts::PI / PER_HALF_TURN - value).abs() <= 4.0 * f64::EPSILON * value.abs();
    if is_near && n != 0.0 {
        let part = &BigFloat::from_f64(n)? * &BigFloat::pi();
        return Some(part / BigFloat::from_f64(PER_HALF_TURN)?);
    }
    BigFloat::from_shortest_decimal(value)
}
