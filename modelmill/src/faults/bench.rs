//! Errors of the model under hypothetical corrections of a recording. A recording goes in; for each correction the
//! error of every drive comes out, once with all parameters fitted and once with the nominal values of the file.
//!
//! For each change of the motion the regressor is evaluated once, and its inner products with all measured forces are
//! kept. Every change of the forces (sign, unit, exchange) then costs a small system of equations only.

use modelmill_codegen::{ModelEvaluator, MotionStates};
use modelmill_identify::{ScaledNormalEquations, gram};
use nalgebra::{DMatrix, DVector};

use super::correction::{ForceChange, MotionChange};
use super::thresholds::{
    BENCH_FEWEST_SAMPLES, FIT_ERROR_FLOOR, LEAST_DISSIPATION, NOMINAL_ERROR_CAP, NOMINAL_ERROR_FLOOR,
};
use crate::model::Model;
use crate::segment::RecordingSegment;

/// Most rows over all drives, spread over the recording.
const ROWS: usize = 3600;
/// Most samples for each drive.
const SAMPLES: usize = 900;
/// Columns in addition to those of the model for each drive: rate, its sign, an offset, and acceleration, in this
/// order. A model that lacks friction would otherwise put it elsewhere.
const MORE: usize = 4;
/// Those of them that are fitted with nominal values: an inertia of the drive would take the place of that of bodies.
const MORE_WITH_NOMINAL: usize = 3;
/// Ridge on the diagonal of scaled normal equations.
pub(super) const RIDGE: f64 = 1e-10;
/// Number of times the weights of the drives are set to their errors.
const ROUNDS: usize = 4;

/// Positions, rates and accelerations, `[order][coordinate][sample]`, SI units.
pub(super) type MotionColumns = [Vec<Vec<f64>>; 3];

/// Samples of a recording at which hypotheses are compared.
pub(super) struct FaultBench<'a> {
    /// The model.
    pub(super) model: &'a Model,
    /// Motion at the samples.
    motion: MotionColumns,
    /// Measured forces, `[drive][sample]`.
    forces: Vec<Vec<f64>>,
    /// Nominal values of the base parameters; `None` if the file has too few.
    nominal: Option<Vec<f64>>,
}

/// Relative errors (1) of the drives under a hypothesis; drives without force are `None`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct HypothesisErrors {
    /// With all parameters fitted.
    pub(super) fit: Vec<Option<f64>>,
    /// With nominal values of the bodies, and friction and an offset of each drive fitted, relative to the error with
    /// friction and offset alone: below 1 if the nominal values explain something.
    pub(super) nominal: Option<Vec<Option<f64>>>,
    /// Power that the fitted friction of each drive dissipates, relative to the product of the rms values of its rate and
    /// its force (1): negative if friction drives the machine, which it cannot.
    pub(super) dissipation: Vec<Option<f64>>,
}

impl HypothesisErrors {
    /// Errors of a mechanism that cannot reach the poses: as large as the forces.
    pub(super) fn out_of_reach(bench: &FaultBench<'_>) -> Self {
        let all = |size: f64| vec![Some(size); bench.forces.len()];
        Self {
            fit: all(1.0),
            nominal: bench.nominal.as_ref().map(|_| all(NOMINAL_ERROR_CAP)),
            dissipation: vec![None; bench.forces.len()],
        }
    }

    /// Sum over the drives of the logarithms by which the fitted error is smaller than `before`.
    pub(super) fn fit_gain(&self, before: &Self) -> f64 {
        log_gain(&before.fit, &self.fit, |error| error.max(FIT_ERROR_FLOOR))
    }

    /// The same with nominal values; 0 if the file has too few.
    pub(super) fn nominal_gain(&self, before: &Self) -> f64 {
        let bounded = |error: f64| error.clamp(NOMINAL_ERROR_FLOOR, NOMINAL_ERROR_CAP);
        match (&before.nominal, &self.nominal) {
            (Some(before), Some(after)) => log_gain(before, after, bounded),
            _ => 0.0,
        }
    }

    /// Number of drives that friction brakes and that it would drive `before`; 0 if it drives others instead.
    pub(super) fn drives_braked_instead(&self, before: &Self) -> usize {
        let pairs = || before.dissipation.iter().zip(&self.dissipation);
        let is_turned = |before: f64, after: f64| before < -LEAST_DISSIPATION && after > LEAST_DISSIPATION;
        let is_as_good = |before: f64, after: f64| after > before.min(LEAST_DISSIPATION) - LEAST_DISSIPATION;
        let both = || pairs().filter_map(|(before, after)| Some(((*before)?, (*after)?)));
        if both().all(|(before, after)| is_turned(before, after) || is_as_good(before, after)) {
            both().filter(|(before, after)| is_turned(*before, *after)).count()
        } else {
            0
        }
    }

    /// Geometric mean of the fitted errors over the drives.
    pub(super) fn mean_fit(&self) -> f64 {
        geometric_mean(&self.fit)
    }

    /// Geometric mean of the errors with nominal values over the drives.
    pub(super) fn mean_nominal(&self) -> Option<f64> {
        self.nominal.as_deref().map(geometric_mean)
    }
}

/// Sum of the logarithms of `before / after` over the drives that have both.
fn log_gain(before: &[Option<f64>], after: &[Option<f64>], bounded: impl Fn(f64) -> f64) -> f64 {
    let pairs = before.iter().zip(after);
    pairs
        .filter_map(|(before, after)| Some((bounded((*before)?) / bounded((*after)?)).ln()))
        .sum()
}

/// Geometric mean of the errors that exist.
fn geometric_mean(errors: &[Option<f64>]) -> f64 {
    let logarithms: Vec<f64> = errors.iter().flatten().map(|e| e.max(f64::MIN_POSITIVE).ln()).collect();
    (logarithms.iter().sum::<f64>() / logarithms.len().max(1) as f64).exp()
}

impl<'a> FaultBench<'a> {
    /// The samples of all segments of a recording at which all forces were measured; `None` if there are too few.
    pub(super) fn new(model: &'a Model, segments: &[RecordingSegment]) -> Option<Self> {
        let drives = model.row_names().len();
        let total: usize = segments.iter().map(RecordingSegment::samples).sum();
        let wanted = (ROWS / drives.max(1)).clamp(BENCH_FEWEST_SAMPLES, SAMPLES);
        let every = (total / wanted).max(1);
        let n_coordinates = model.active_coordinates().len();
        let mut motion: MotionColumns = std::array::from_fn(|_| vec![Vec::new(); n_coordinates]);
        let mut forces = vec![Vec::new(); drives];
        for run in segments.iter().map(|one| &one.run) {
            let measured = run.force.as_deref()?;
            let samples = (0..run.samples()).step_by(every);
            for k in samples.filter(|k| (0..drives).all(|d| run.is_force_measured(d, *k))) {
                for (to, from) in motion.iter_mut().zip([&run.q, &run.qd, &run.qdd]) {
                    to.iter_mut().zip(from).for_each(|(to, from)| to.push(from[k]));
                }
                forces.iter_mut().zip(measured).for_each(|(to, from)| to.push(from[k]));
            }
        }
        let is_enough = forces.first().is_some_and(|force| force.len() >= BENCH_FEWEST_SAMPLES);
        is_enough.then(|| Self {
            model,
            motion,
            forces,
            nominal: nominal_values(model),
        })
    }

    /// Number of samples.
    pub(super) fn samples(&self) -> usize {
        self.forces.first().map_or(0, Vec::len)
    }

    /// Largest magnitude of a coordinate.
    pub(super) fn largest_position(&self, coordinate: usize) -> f64 {
        self.motion[0][coordinate].iter().fold(0.0, |most, q| most.max(q.abs()))
    }

    /// The measured forces, `[drive][sample]`.
    pub(super) fn forces(&self) -> &[Vec<f64>] {
        &self.forces
    }

    /// Nominal values of the base parameters; `None` if the file has too few.
    pub(super) fn nominal(&self) -> Option<&[f64]> {
        self.nominal.as_deref()
    }

    /// The same samples for another model of the machine.
    pub(super) fn with_model<'b>(&self, model: &'b Model) -> FaultBench<'b> {
        FaultBench {
            model,
            motion: self.motion.clone(),
            forces: self.forces.clone(),
            nominal: nominal_values(model),
        }
    }

    /// The motion after a change.
    fn changed_motion(&self, change: &MotionChange) -> MotionColumns {
        let mut motion = self.motion.clone();
        for (order, columns) in motion.iter_mut().enumerate() {
            change.apply(order, columns);
        }
        motion
    }

    /// Calls a function with the states after a change.
    pub(super) fn with_states<R>(&self, change: &MotionChange, evaluate: impl FnOnce(&MotionStates<'_>) -> R) -> R {
        let motion = self.changed_motion(change);
        evaluate(&MotionStates {
            q: slices(&motion[0]),
            qd: slices(&motion[1]),
            qdd: slices(&motion[2]),
            load: slices(&self.forces),
        })
    }

    /// The rows of the model after a change of the motion; `None` if a pose has no solution or a number is not finite.
    pub(super) fn rows(&self, change: &MotionChange) -> Option<HypothesisRows> {
        let n = self.forces.len();
        let (model_rows, drives) = self.with_states(change, |states| {
            let evaluator = ModelEvaluator::new(&self.model.derivation);
            let rows = evaluator.regressor(states).ok()?;
            let drives = evaluator.drive_motion(states).ok()?;
            Some((rows, drives))
        })?;
        let accelerations = drive_accelerations(&drives, n, &self.changed_motion(change)[2]);
        let samples = self.samples();
        let base = model_rows.ncols();
        let mut channels = Vec::with_capacity(n);
        for d in 0..n {
            let mut rows = DMatrix::zeros(samples, base + MORE);
            for i in 0..samples {
                for k in 0..base {
                    rows[(i, k)] = model_rows[(i * n + d, k)];
                }
                let rate = drives[n + d][i];
                let sign = if rate == 0.0 { 0.0 } else { rate.signum() };
                for (k, value) in [rate, sign, 1.0, accelerations[d][i]].into_iter().enumerate() {
                    rows[(i, base + k)] = value;
                }
            }
            if rows.iter().any(|x| !x.is_finite()) {
                return None;
            }
            channels.push(ChannelMoments::new(&rows, &self.forces, self.nominal())?);
        }
        Some(HypothesisRows { channels, base })
    }

    /// The errors with the forces after a change.
    pub(super) fn errors(&self, rows: &HypothesisRows, change: &ForceChange) -> HypothesisErrors {
        let (fit, dissipation) = rows.fit_errors(change);
        HypothesisErrors {
            fit,
            dissipation,
            nominal: self.nominal.as_ref().map(|values| rows.nominal_errors(change, values)),
        }
    }
}

/// Columns as slices.
fn slices(columns: &[Vec<f64>]) -> Vec<&[f64]> {
    columns.iter().map(Vec::as_slice).collect()
}

/// The nominal values of a model; `None` if bodies lack most of them.
fn nominal_values(model: &Model) -> Option<Vec<f64>> {
    let bodies: Vec<usize> = (0..model.base.len()).filter(|k| !model.is_effect(*k)).collect();
    let known = bodies
        .iter()
        .filter(|k| model.has_values(**k) || model.is_known(**k))
        .count();
    (!bodies.is_empty() && 2 * known > bodies.len()).then(|| model.values.clone())
}

/// Accelerations of the drives, without the part that comes from a changing Jacobian: `drive_motion` gives positions
/// and rates of the `n` drives, then their Jacobian row by row.
fn drive_accelerations(drives: &[Vec<f64>], n: usize, accelerations: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let columns = accelerations.len();
    let jacobian = &drives[2 * n..];
    let one = |d: usize| {
        let samples = drives.first().map_or(0, Vec::len);
        let at = |i: usize| {
            (0..columns)
                .map(|k| jacobian[d * columns + k][i] * accelerations[k][i])
                .sum()
        };
        (0..samples).map(at).collect()
    };
    (0..n).map(one).collect()
}

/// The rows of a model after a change of the motion, as inner products.
pub(super) struct HypothesisRows {
    /// By drive.
    channels: Vec<ChannelMoments>,
    /// Number of base parameters.
    base: usize,
}

/// Inner products of the columns of one drive.
struct ChannelMoments {
    /// Squares of the columns of the model.
    column_squares: DVector<f64>,
    /// The columns that are fitted with nominal values, among themselves.
    friction: DMatrix<f64>,
    /// All columns with the force of the nominal values; `None` without these.
    nominal: Option<DVector<f64>>,
    /// All columns with the force of each drive.
    right: Vec<DVector<f64>>,
    /// Sum of squares of each force.
    squares: Vec<f64>,
    /// The columns of this drive alone with all columns.
    own: DMatrix<f64>,
    /// The columns of the model without the part that those of this drive alone explain.
    reduced: ReducedMoments,
}

/// Inner products of the columns of the model in the rows of one drive, after least squares on the columns that only
/// this drive has. These are fitted by each drive alone, whatever its weight, so that they need to be eliminated once.
struct ReducedMoments {
    /// The columns among themselves.
    normal: DMatrix<f64>,
    /// The columns with the force of each drive.
    right: Vec<DVector<f64>>,
    /// Sum of squares of the residual of each force. The ridge raises a relative error by at most its own square root,
    /// which is far below [`FIT_ERROR_FLOOR`].
    squares: Vec<f64>,
}

impl ChannelMoments {
    /// The inner products of the rows of a drive with the forces of all drives and with that of nominal values. The last
    /// [`MORE`] columns are those of this drive alone. `None` if a number is not finite.
    fn new(rows: &DMatrix<f64>, forces: &[Vec<f64>], nominal: Option<&[f64]>) -> Option<Self> {
        let vector = |force: &Vec<f64>| DVector::from_column_slice(force);
        let base = rows.ncols() - MORE;
        let normal = gram(rows);
        let right: Vec<DVector<f64>> = forces.iter().map(|force| rows.tr_mul(&vector(force))).collect();
        let squares: Vec<f64> = forces.iter().map(|force| vector(force).norm_squared()).collect();
        let many = MORE_WITH_NOMINAL;
        Some(Self {
            column_squares: normal.diagonal().rows(0, base).into_owned(),
            friction: normal.view((base, base), (many, many)).into_owned(),
            nominal: nominal.map(|values| normal.columns(0, base) * DVector::from_column_slice(values)),
            own: normal.rows(base, MORE).into_owned(),
            reduced: ReducedMoments::new(&normal, &right, &squares)?,
            right,
            squares,
        })
    }
}

impl ChannelMoments {
    /// Power of the friction of this drive, which is fitted to `factor` times a force beside the `values` of the model;
    /// relative to the rms values of rate and force.
    fn dissipation(&self, values: &DVector<f64>, source: usize, factor: f64, squares: f64) -> Option<f64> {
        let base = values.len();
        let normal = self.own.columns(base, MORE).into_owned();
        let right = self.right[source].rows(base, MORE) * factor - self.own.columns(0, base) * values;
        let own = ScaledNormalEquations::new(normal, RIDGE)?.solve(&right);
        // Products of the rate with itself and with its sign.
        let power = own[0] * self.own[(0, base)] + own[1] * self.own[(0, base + 1)];
        let size = (self.own[(0, base)] * squares).sqrt();
        (size > 0.0).then(|| power / size)
    }
}

impl ReducedMoments {
    /// Eliminates the last [`MORE`] columns: the Schur complement of their normal equations. `None` if a number is not
    /// finite.
    fn new(normal: &DMatrix<f64>, right: &[DVector<f64>], squares: &[f64]) -> Option<Self> {
        let base = normal.ncols() - MORE;
        let solver = ScaledNormalEquations::new(normal.view((base, base), (MORE, MORE)).into_owned(), RIDGE)?;
        let of_model = solver.half_solve(normal.view((base, 0), (MORE, base)).into_owned());
        let forces = right.iter().map(|right| right.rows(base, MORE).into_owned());
        let of_forces = solver.half_solve(DMatrix::from_columns(&forces.collect::<Vec<_>>()));
        let mut reduced = Self {
            normal: normal.view((0, 0), (base, base)) - of_model.transpose() * &of_model,
            right: Vec::with_capacity(right.len()),
            squares: Vec::with_capacity(right.len()),
        };
        for ((right, square), of_force) in right.iter().zip(squares).zip(of_forces.column_iter()) {
            reduced.right.push(right.rows(0, base) - of_model.tr_mul(&of_force));
            reduced.squares.push(square - of_force.norm_squared());
        }
        Some(reduced)
    }
}

impl HypothesisRows {
    /// Relative error of each drive with all parameters fitted. Drives are weighted by their errors, so that a small
    /// drive counts as much as a large one. Also returns the dissipation of each drive.
    fn fit_errors(&self, change: &ForceChange) -> (Vec<Option<f64>>, Vec<Option<f64>>) {
        let n = self.channels.len();
        let base = self.base;
        let squares: Vec<f64> = (0..n).map(|d| change.squares(d, &self.channels[d].squares)).collect();
        let mut errors: Vec<Option<f64>> = squares.iter().map(|s| (*s > 0.0).then_some(1.0)).collect();
        let mut dissipation = vec![None; n];
        for _ in 0..ROUNDS {
            let mut normal = DMatrix::zeros(base, base);
            let mut column_squares = DVector::zeros(base);
            let mut right = DVector::zeros(base);
            for (d, channel) in self.channels.iter().enumerate() {
                let Some(error) = errors[d] else { continue };
                let weight = 1.0 / (squares[d] * error.max(FIT_ERROR_FLOOR).powi(2));
                let (source, factor) = change.source(d);
                right.axpy(weight * factor, &channel.reduced.right[source], 1.0);
                column_squares.axpy(weight, &channel.column_squares, 1.0);
                for j in 0..base {
                    // Only the lower triangle is read.
                    let from = channel.reduced.normal.view((j, j), (base - j, 1));
                    normal
                        .view_mut((j, j), (base - j, 1))
                        .zip_apply(&from, |sum, x| *sum += weight * x);
                }
            }
            let Some(solver) = ScaledNormalEquations::after_elimination(normal, &column_squares, RIDGE) else {
                return (errors, dissipation);
            };
            let values = solver.solve(&right);
            for (d, channel) in self.channels.iter().enumerate() {
                let (source, factor) = change.source(d);
                let reduced = &channel.reduced;
                let unexplained = factor * factor * reduced.squares[source];
                let left = unexplained - 2.0 * factor * values.dot(&reduced.right[source])
                    + values.dot(&(&reduced.normal * &values));
                if let Some(error) = &mut errors[d] {
                    *error = (left.max(0.0) / squares[d]).sqrt();
                    dissipation[d] = channel.dissipation(&values, source, factor, squares[d]);
                }
            }
        }
        (errors, dissipation)
    }

    /// Error of each drive with nominal values of the base parameters, and friction and an offset fitted, relative to
    /// the error with friction and offset alone.
    fn nominal_errors(&self, change: &ForceChange, nominal: &[f64]) -> Vec<Option<f64>> {
        let values = DVector::from_column_slice(nominal);
        let one = |(d, channel): (usize, &ChannelMoments)| {
            let (source, factor) = change.source(d);
            let squares = change.squares(d, &channel.squares);
            let forces = &channel.right[source] * factor;
            // Inner products of the residual of the nominal values.
            let products = channel.nominal.as_ref()?;
            let on_model = |products: &DVector<f64>| values.dot(&products.rows(0, self.base));
            let left = squares - 2.0 * on_model(&forces) + on_model(products);
            let unexplained = |left: f64, right: &DVector<f64>| {
                let right = right.rows(self.base, MORE_WITH_NOMINAL).into_owned();
                let solver = ScaledNormalEquations::new(channel.friction.clone(), RIDGE);
                let explained = solver.map_or(0.0, |solver| solver.solve(&right).dot(&right));
                (left - explained).max(0.0)
            };
            let alone = unexplained(squares, &forces);
            let floor = FIT_ERROR_FLOOR * FIT_ERROR_FLOOR * squares;
            let rest = &forces - products;
            (squares > 0.0).then(|| (unexplained(left, &rest) / alone.max(floor)).sqrt())
        };
        self.channels.iter().enumerate().map(one).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers that look random, `[row, column]`.
    fn numbers(rows: usize, columns: usize, salt: f64) -> DMatrix<f64> {
        DMatrix::from_fn(rows, columns, |i, k| {
            (salt + 12.9898 * i as f64 + 78.233 * k as f64).sin() * 43.7 % 1.0
        })
    }

    /// Fitted errors by least squares on the rows of all drives, with all columns.
    fn errors_of_rows(rows: &[DMatrix<f64>], forces: &[Vec<f64>], change: &ForceChange) -> Vec<f64> {
        let (n, samples) = (rows.len(), forces[0].len());
        let base = rows[0].ncols() - MORE;
        let force = |d: usize, i: usize| {
            let (source, factor) = change.source(d);
            factor * forces[source][i]
        };
        let size = |d: usize| (0..samples).map(|i| force(d, i).powi(2)).sum::<f64>().sqrt();
        let mut errors = vec![1.0_f64; n];
        for _ in 0..ROUNDS {
            let weight = |d: usize| 1.0 / (size(d) * errors[d].max(FIT_ERROR_FLOOR));
            let stacked = DMatrix::from_fn(n * samples, base + MORE * n, |row, k| {
                let (d, i) = (row / samples, row % samples);
                let own = (base + MORE * d..base + MORE * (d + 1)).contains(&k);
                match (k < base, own) {
                    (true, _) => weight(d) * rows[d][(i, k)],
                    (_, true) => weight(d) * rows[d][(i, k - MORE * d)],
                    _ => 0.0,
                }
            });
            let measured = DVector::from_fn(n * samples, |row, _| {
                weight(row / samples) * force(row / samples, row % samples)
            });
            let svd = stacked.clone().svd(true, true);
            let values = svd
                .solve(&measured, 1e-9 * svd.singular_values.max())
                .expect("vectors are there");
            let residual = measured - stacked * values;
            errors = (0..n)
                .map(|d| residual.rows(d * samples, samples).norm() / (size(d) * weight(d)))
                .collect();
        }
        errors
    }

    #[test]
    fn fitted_errors_are_those_of_all_columns_together() {
        let (samples, base) = (60, 5);
        for dependent in [false, true] {
            let rows: Vec<DMatrix<f64>> = (0..3)
                .map(|d| {
                    let mut rows = numbers(samples, base + MORE, 0.3 + f64::from(d));
                    // A base parameter that the columns of a drive explain, and one that does not act on it.
                    if dependent && d == 1 {
                        let own = 2.0 * rows.column(base + MORE - 1);
                        rows.set_column(0, &own);
                        rows.column_mut(1).fill(0.0);
                    }
                    // A drive that stands still has neither rate nor acceleration; one with a constant rate has an offset
                    // twice.
                    if dependent && d == 0 {
                        for k in [0, 1, 3] {
                            rows.column_mut(base + k).fill(0.0);
                        }
                    }
                    if dependent && d == 2 {
                        rows.column_mut(base).fill(0.4);
                        rows.column_mut(base + 2).fill(1.0);
                    }
                    rows
                })
                .collect();
            let forces: Vec<Vec<f64>> = (rows.iter().enumerate())
                .map(|(d, rows)| {
                    let exact = rows.column_sum();
                    let noise = numbers(samples, 1, 9.7 + d as f64);
                    (0..samples).map(|i| exact[i] + 0.3 * noise[i]).collect()
                })
                .collect();
            let moments = rows.iter().map(|rows| ChannelMoments::new(rows, &forces, None));
            let channels = moments.collect::<Option<_>>().expect("numbers are finite");
            let moments = HypothesisRows { channels, base };
            let without = ForceChange(vec![(1, 1, 0.0)]);
            assert_eq!(
                moments.fit_errors(&without).0[1],
                None,
                "a force of zero has no relative error"
            );
            for change in [vec![], vec![(1, 1, -1.0)], vec![(0, 2, 1.0), (2, 0, 1.0)]] {
                let change = ForceChange(change);
                let expected = errors_of_rows(&rows, &forces, &change);
                let found = moments.fit_errors(&change).0;
                for (found, expected) in found.iter().zip(&expected) {
                    let found = found.expect("all drives have forces");
                    assert!((found - expected).abs() < 1e-6 * expected, "{found} and {expected}");
                }
            }
        }
    }

    /// Friction of 3 per unit of the rate, and a force of the model that has nothing to do with it; turned, the same
    /// friction drives.
    #[test]
    fn friction_dissipates_unless_the_force_is_turned() {
        let samples = 200;
        let rows = numbers(samples, 1 + MORE, 4.2);
        let force: Vec<f64> = (0..samples).map(|i| 5.0 * rows[(i, 0)] + 3.0 * rows[(i, 1)]).collect();
        let rate = rows.column(1).norm();
        let expected = 3.0 * rate * rate / (rate * DVector::from_vec(force.clone()).norm());
        let channel = ChannelMoments::new(&rows, &[force], None).expect("numbers are finite");
        let moments = HypothesisRows {
            channels: vec![channel],
            base: 1,
        };
        let of = |factor: f64| moments.fit_errors(&ForceChange(vec![(0, 0, factor)])).1[0].expect("a force");
        assert!((of(1.0) - expected).abs() < 1e-4, "{} and {expected}", of(1.0));
        assert!((of(-1.0) + expected).abs() < 1e-4, "{}", of(-1.0));
    }
}
