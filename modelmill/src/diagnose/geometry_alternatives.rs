//! Errors of the geometry that explain the recordings as well as the effects do that were found: constants, and zeros
//! that the model file writes as coordinates of points. The given model along the recordings goes in, sets of such
//! errors come out.
//!
//! All errors are compared in one fit (separable least squares, G. H. Golub and V. Pereyra, 1973): estimated base
//! parameters are projected out, and sets of one or two errors are tried.

use modelmill_codegen::ModelEvaluator;
use modelmill_identify::LeastSquares;
use modelmill_identify::diagnose::{ForceColumn, LocatedEffect};
use nalgebra::{DMatrix, DVector, DVectorView};

use crate::along::filter_and_decimate;
use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::regressors::regressor;
use crate::segment::RecordingSegment;

use super::constants::CONSTANT_ERROR;
use super::model_versions::{ForceComparison, ModelVersion};
use super::named_zeros::NamedZeros;
use super::payloads::reach;
use super::problem::FixedParameters;
use super::thresholds::{
    ALTERNATIVE_LEAST_GAIN, ALTERNATIVE_MOST_ERROR, ALTERNATIVE_MOST_RESIDUAL, ALTERNATIVE_ROUNDING, MOST_ALTERNATIVES,
};

/// Step of the differences, as a part of the machine's size or of a radian.
const STEP: f64 = 1e-3;
/// Rounds of Gauss-Newton; the slopes stay those at the model file's values, so each round gains some two digits.
const ROUNDS: usize = 5;
/// Sets are fitted if their residual would be below the limit by linear slopes, with this part of the given squared
/// residual as margin.
const LINEAR_MARGIN: f64 = 0.1;
/// Most sets of one size that are fitted.
const MOST_FITS: usize = 10;
/// A set of two errors ranks before one if it leaves less than this part of its squared residual.
const SECOND_ERROR_GAIN: f64 = 2.0;
/// Two columns count as parallel if the sine of the angle between them is below this.
const PARALLEL: f64 = 1e-3;

/// A length or angle of the model file with its error.
#[derive(Clone, Debug, PartialEq)]
pub struct GeometryError {
    /// The constant; `None` for a coordinate of a point that the file sets to zero.
    pub constant: Option<String>,
    /// Point and axis of a coordinate that the file sets to zero; `None` for a constant.
    pub zero: Option<(String, &'static str)>,
    /// The error: what must be added to the value of the file.
    pub value: f64,
    /// Its unit.
    pub unit: String,
}

/// Errors of the geometry that explain the recordings as well as the effects that were found.
#[derive(Clone, Debug, PartialEq)]
pub struct GeometryAlternative {
    /// The errors, one or two.
    pub errors: Vec<GeometryError>,
    /// The squared residual that they explain, divided by that which the effects found explain.
    pub share: f64,
}

/// The alternatives to the effects that were found, the best first. `constants` are the names of all of them if they are
/// wrong constants, else empty, and `n_effects` is their number. `remaining` is the mean square residual with them,
/// relative to the forces. Empty if there are none, or if the model has no nominal values.
///
/// Fails only when the job is cancelled.
pub(super) fn geometry_alternatives(
    version: &ModelVersion,
    named: Option<&NamedZeros>,
    held: FixedParameters,
    constants: &[&str],
    n_effects: usize,
    remaining: f64,
) -> Outcome<Vec<GeometryAlternative>> {
    let job = (version.model.host()).run_job("comparing errors of the geometry", 0, |_| {
        let comparison = GeometryComparison::new(version, named, held)?;
        Some(comparison.alternatives(named, constants, n_effects, remaining))
    })?;
    Ok(job.unwrap_or_default())
}

/// One error of the geometry in the comparison.
struct ComparedError {
    /// Index of its constant in the model with named zeros.
    constant: usize,
    /// The size that its error may have, m or rad.
    size: f64,
    /// Its force per unit of the error, without the part that estimated base parameters explain.
    slope: DVector<f64>,
}

/// Some errors with their values.
struct ErrorFit {
    /// Their indices.
    set: Vec<usize>,
    /// Their values, m or rad.
    values: Vec<f64>,
    /// The squared residual that they leave.
    residual: f64,
}

/// All errors of the geometry along the recordings.
struct GeometryComparison<'a> {
    /// The model with named zeros.
    varied: &'a Model,
    /// Its base parameters that are estimated.
    estimated: Vec<usize>,
    /// The recordings.
    data: Vec<(&'a RecordingSegment, bool)>,
    /// Values of its constants.
    constants: Vec<f64>,
    /// Nominal values of the dynamic parameters.
    parameters: Vec<f64>,
    /// Reciprocals of the rms forces of the drives, 1/N or 1/(N m).
    weights: Vec<f64>,
    /// The forces that the model must explain, less those at the nominal constants where base parameters are fixed.
    target: DVector<f64>,
    /// The squared residual at the nominal constants.
    given: f64,
    /// The errors.
    errors: Vec<ComparedError>,
}

impl<'a> GeometryComparison<'a> {
    /// Evaluates each error by central differences; `None` where the forces cannot be compared.
    fn new(version: &'a ModelVersion, named: Option<&'a NamedZeros>, held: FixedParameters) -> Option<Self> {
        let model = &version.model;
        let varied = named.map_or(model, |named| &named.model);
        let n_drives = varied.row_names().len();
        // Forces drive by drive, all recordings one after the other.
        let stacked = |of: &dyn Fn(&ForceComparison, usize) -> Vec<f64>| -> Vec<Vec<f64>> {
            let column = |d| version.runs.iter().flat_map(|run| of(run, d)).collect();
            (0..n_drives).map(column).collect()
        };
        let measured = stacked(&|run, d| run.measured[d].clone());
        let rms = |column: &Vec<f64>| (column.iter().map(|x| x * x).sum::<f64>() / column.len().max(1) as f64).sqrt();
        let mechanism = &varied.derivation.mechanism;
        let is_estimated = |k: &usize| held == FixedParameters::Known && !model.is_known(*k);
        let position = |k: usize| named.map_or(k, |named| named.positions[k]);
        let mut comparison = Self {
            varied,
            estimated: (0..model.base.len()).filter(is_estimated).map(position).collect(),
            data: (version.data.iter().zip(&version.runs))
                .map(|(data, run)| (data, run.is_check))
                .collect(),
            constants: mechanism.constants.iter().map(|c| c.value).collect(),
            parameters: mechanism.parameters.iter().map(|p| p.nominal).collect(),
            weights: measured
                .iter()
                .map(|force| 1.0 / rms(force).max(f64::MIN_POSITIVE))
                .collect(),
            target: DVector::zeros(0),
            given: 0.0,
            errors: Vec::new(),
        };
        comparison.target = comparison.weighted(&measured);
        let nominal = comparison.forces_and_span(&[])?;
        // Fixed parameters may have other values than the nominal ones: only changes of the force count then.
        if comparison.estimated.is_empty() {
            let errors = stacked(&|run, d| run.error(d));
            comparison.target = comparison.weighted(&errors) + &nominal.0;
        }
        comparison.given = comparison.residual(&[])?.norm_squared();
        for (k, constant) in mechanism.constants.iter().enumerate() {
            let size = match constant.unit.as_str() {
                "m" => reach(mechanism),
                "rad" => 1.0,
                _ => continue,
            };
            let step = STEP * size;
            let sides = [-step, step].map(|step| comparison.forces(&[(k, step)]));
            let [Some(back), Some(ahead)] = sides else {
                continue;
            };
            let slope = nominal
                .1
                .project_out(&comparison.weights, (ahead - back) / (2.0 * step));
            if slope.iter().all(|x| x.is_finite()) && slope.norm() * size > 0.0 {
                comparison.errors.push(ComparedError {
                    constant: k,
                    size,
                    slope,
                });
            }
        }
        Some(comparison)
    }

    /// Columns by drive as one vector, each drive divided by its rms force.
    fn weighted(&self, columns: &[Vec<f64>]) -> DVector<f64> {
        let weighted = columns.iter().zip(&self.weights);
        DVector::from_vec(
            weighted
                .flat_map(|(column, w)| column.iter().map(move |x| w * x))
                .collect(),
        )
    }

    /// The model with some changed constants, and the base parameters of the nominal dynamic parameters.
    fn evaluator_at(&self, changes: &[(usize, f64)]) -> (ModelEvaluator<'a>, Vec<f64>) {
        let mut constants = self.constants.clone();
        for (k, change) in changes {
            constants[*k] += change;
        }
        let derivation = &self.varied.derivation;
        let base = derivation.base_values(&self.parameters, &constants);
        (ModelEvaluator::with_constants(derivation, constants), base)
    }

    /// Weighted forces for nominal dynamic parameters and some changed constants; `None` if a pose has no solution.
    fn forces(&self, changes: &[(usize, f64)]) -> Option<DVector<f64>> {
        let (evaluator, base) = self.evaluator_at(changes);
        let mut forces: Vec<Vec<f64>> = vec![Vec::new(); self.weights.len()];
        for (one, _) in &self.data {
            let mut of_segment: Vec<Vec<f64>> = vec![Vec::new(); self.weights.len()];
            let evaluated = one.for_each_block(self.varied, |states| {
                Ok::<_, Error>(evaluator.inverse_dynamics(states, &base).map(|block| {
                    for (force, more) in of_segment.iter_mut().zip(block) {
                        force.extend(more);
                    }
                }))
            });
            evaluated.ok()?;
            for (force, more) in forces.iter_mut().zip(filter_and_decimate(of_segment, one).ok()?) {
                force.extend(more);
            }
        }
        let forces = self.weighted(&forces);
        (forces.len() == self.target.len() && forces.iter().all(|x| x.is_finite())).then_some(forces)
    }

    /// The same, and the span of the forces of estimated base parameters.
    fn forces_and_span(&self, changes: &[(usize, f64)]) -> Option<(DVector<f64>, ForceSpan)> {
        if self.target.is_empty() {
            return None;
        }
        let (evaluator, base) = self.evaluator_at(changes);
        let mut columns = regressor(&self.data, &evaluator, self.varied).ok()?;
        let mut sum = DVector::zeros(self.target.len());
        for (column, value) in columns.iter().zip(base) {
            add_weighted(&mut sum, value, column, &self.weights)?;
        }
        let estimated = self.estimated.iter().map(|k| std::mem::take(&mut columns[*k]));
        let span = ForceSpan::new(estimated.collect(), &self.weights, &self.target)?;
        sum.iter().all(|x| x.is_finite()).then_some((sum, span))
    }

    /// The residual with some changed constants and the best estimates of base parameters.
    fn residual(&self, changes: &[(usize, f64)]) -> Option<DVector<f64>> {
        let (forces, span) = self.forces_and_span(changes)?;
        let left = span.project_out(&self.weights, &self.target - forces);
        left.iter().all(|x| x.is_finite()).then_some(left)
    }

    /// The values of some errors by Gauss-Newton; `None` if their columns are parallel, or an error is too large to be
    /// one.
    fn fit(&self, set: &[usize]) -> Option<ErrorFit> {
        if set.is_empty() {
            return None;
        }
        let columns: Vec<DVector<f64>> = set.iter().map(|k| self.errors[*k].slope.normalize()).collect();
        let matrix = DMatrix::from_columns(&columns);
        let svd = matrix.svd(true, true);
        if svd.singular_values.min() < PARALLEL {
            return None;
        }
        let mut values = vec![0.0; set.len()];
        let mut left = self.residual(&[])?;
        for _ in 0..ROUNDS {
            let step = svd.solve(&left, 0.0).ok()?;
            for ((value, step), k) in values.iter_mut().zip(step.iter()).zip(set) {
                *value += step / self.errors[*k].slope.norm();
            }
            let mut pairs = set.iter().zip(&values);
            if pairs.any(|(k, x)| x.abs() > ALTERNATIVE_MOST_ERROR * self.errors[*k].size) {
                return None;
            }
            let constants = set.iter().map(|k| self.errors[*k].constant);
            let changes: Vec<(usize, f64)> = constants.zip(values.iter().copied()).collect();
            left = self.residual(&changes)?;
        }
        Some(ErrorFit {
            set: set.to_vec(),
            values,
            residual: left.norm_squared(),
        })
    }

    /// The squared residual that a set would leave if forces were linear in the errors; decides which sets are fitted.
    fn linear_residual(&self, set: &[usize], given: &DVector<f64>) -> f64 {
        let gram = DMatrix::from_fn(set.len(), set.len(), |i, j| {
            self.errors[set[i]].slope.dot(&self.errors[set[j]].slope)
        });
        let right = DVector::from_iterator(set.len(), set.iter().map(|k| self.errors[*k].slope.dot(given)));
        self.given - gram.lu().solve(&right).map_or(0.0, |values| values.dot(&right))
    }

    /// Sets of one error, or of two, that leave no more than the effects found. Wrong constants are compared by the same
    /// fit; for other effects, `remaining` is the mean square residual relative to the forces.
    fn alternatives(
        &self,
        named: Option<&NamedZeros>,
        constants: &[&str],
        n_effects: usize,
        remaining: f64,
    ) -> Vec<GeometryAlternative> {
        let name = |k: usize| {
            self.varied.derivation.mechanism.constants[self.errors[k].constant]
                .name
                .as_str()
        };
        let all = 0..self.errors.len();
        let (known, others): (Vec<usize>, Vec<usize>) = all.partition(|k| constants.contains(&name(*k)));
        let by_constants = self.fit(&known).filter(|_| known.len() == constants.len());
        let n_samples = self.target.len() as f64 / self.weights.len().max(1) as f64;
        let found = by_constants.map_or(n_samples * remaining, |fit| fit.residual);
        let explained = self.given - found;
        if explained < ALTERNATIVE_LEAST_GAIN * self.given {
            return Vec::new();
        }
        let most = ALTERNATIVE_MOST_RESIDUAL * found + ALTERNATIVE_ROUNDING * self.given;
        let mut fits = self.sufficient_fits(&others, most);
        // What was found is no alternative, but a part of it is one.
        let parts = self.sufficient_fits(&known, most);
        fits.extend(parts.into_iter().filter(|fit| fit.set.len() < known.len()));
        // More errors than effects found must explain much more.
        fits.retain(|fit| fit.set.len() <= n_effects || SECOND_ERROR_GAIN * fit.residual < found);
        // A second error must reduce the residual much to be worth it.
        let rank = |fit: &ErrorFit| fit.residual * SECOND_ERROR_GAIN.powi(i32::from(fit.set.len() > 1));
        fits.sort_by(|a, b| rank(a).total_cmp(&rank(b)));
        fits.truncate(MOST_ALTERNATIVES);
        let described = fits.into_iter().map(|fit| GeometryAlternative {
            errors: (fit.set.iter().zip(&fit.values))
                .map(|(k, value)| self.describe_error(named, *k, *value))
                .collect(),
            share: (self.given - fit.residual) / explained,
        });
        described.collect()
    }

    /// The sets of one or two errors that leave at most a given squared residual. Pairs with an error that is sufficient
    /// alone are left out.
    fn sufficient_fits(&self, errors: &[usize], most: f64) -> Vec<ErrorFit> {
        let Some(given) = self.residual(&[]) else {
            return Vec::new();
        };
        let fitted = |sets: Vec<Vec<usize>>| -> Vec<ErrorFit> {
            let mut promising: Vec<(f64, Vec<usize>)> = (sets.into_iter())
                .map(|set| (self.linear_residual(&set, &given), set))
                .filter(|(left, _)| *left <= most + LINEAR_MARGIN * self.given)
                .collect();
            promising.sort_by(|a, b| a.0.total_cmp(&b.0));
            promising.truncate(MOST_FITS);
            let fits = promising.iter().filter_map(|(_, set)| self.fit(set));
            fits.filter(|fit| fit.residual <= most).collect()
        };
        let mut fits = fitted(errors.iter().map(|k| vec![*k]).collect());
        let is_sufficient = |k: usize| fits.iter().any(|fit| fit.set == [k]);
        let rest: Vec<usize> = errors.iter().copied().filter(|k| !is_sufficient(*k)).collect();
        let pairs = rest.iter().enumerate();
        let pairs = pairs.flat_map(|(i, a)| rest[i + 1..].iter().map(move |b| vec![*a, *b]));
        fits.extend(fitted(pairs.collect()));
        fits
    }

    /// An error with its name in the model file.
    fn describe_error(&self, named: Option<&NamedZeros>, k: usize, value: f64) -> GeometryError {
        let constant = self.errors[k].constant;
        let own = &self.varied.derivation.mechanism.constants[constant];
        let zero = named.and_then(|named| named.zero_of_constant(constant));
        GeometryError {
            constant: zero.is_none().then(|| own.name.clone()),
            zero: zero.map(|zero| (zero.point.clone(), zero.axis)),
            value,
            unit: own.unit.clone(),
        }
    }
}

/// The forces of some base parameters along the recordings, and what they explain of other forces.
struct ForceSpan {
    /// Their forces per unit, not weighted.
    columns: Vec<ForceColumn>,
    /// Pseudo-inverse of the inner products of the weighted columns.
    inverse: DMatrix<f64>,
}

impl ForceSpan {
    /// From columns, and the weighted forces that are to be explained; all drives one after the other. `None` if a
    /// number is not finite.
    fn new(columns: Vec<ForceColumn>, weights: &[f64], target: &DVector<f64>) -> Option<Self> {
        let n = columns.len();
        if n == 0 {
            let inverse = DMatrix::zeros(0, 0);
            return Some(Self { columns, inverse });
        }
        let mut regression = LeastSquares::with_channels(n, weights.len());
        let samples = target.len() / weights.len();
        for (d, weight) in weights.iter().enumerate() {
            let weigh = |column: &ForceColumn| match column.0.get(d) {
                Some(Some(values)) => values.iter().map(|x| weight * x).collect(),
                _ => vec![0.0; samples],
            };
            let weighted: Vec<Vec<f64>> = columns.iter().map(weigh).collect();
            let weighted: Vec<&[f64]> = weighted.iter().map(Vec::as_slice).collect();
            let measured = &target.as_slice()[d * samples..(d + 1) * samples];
            regression.add_columns(d, &weighted, measured).ok()?;
        }
        let inverse = regression.solve().ok()?.unit_covariance();
        Some(Self { columns, inverse })
    }

    /// The part of weighted forces that the columns do not explain.
    fn project_out(&self, weights: &[f64], mut forces: DVector<f64>) -> DVector<f64> {
        if self.columns.is_empty() {
            return forces;
        }
        // Seminormal equations. The second step corrects the rounding of the first one (A. Bjorck, "Stability analysis
        // of the method of seminormal equations", Linear Algebra Appl. 88/89, 1987).
        for _ in 0..2 {
            let samples = forces.len() / weights.len().max(1);
            let product = |column: &ForceColumn| -> f64 {
                let channels = column
                    .0
                    .iter()
                    .zip(weights)
                    .zip(forces.as_slice().chunks_exact(samples));
                let products = channels.filter_map(|((values, weight), forces)| {
                    let values = DVectorView::from_slice(values.as_ref()?, samples);
                    Some(weight * values.dot(&DVectorView::from_slice(forces, samples)))
                });
                products.sum()
            };
            let gradient = DVector::from_iterator(self.columns.len(), self.columns.iter().map(product));
            let factors = &self.inverse * gradient;
            for (column, factor) in self.columns.iter().zip(factors.iter()) {
                if add_weighted(&mut forces, -factor, column, weights).is_none() {
                    forces.fill(f64::NAN);
                }
            }
        }
        forces
    }
}

/// Adds a multiple of a column to forces of all drives, one after the other; each drive has a weight. `None` if the
/// numbers of samples differ.
fn add_weighted(forces: &mut DVector<f64>, factor: f64, column: &ForceColumn, weights: &[f64]) -> Option<()> {
    let samples = forces.len() / weights.len().max(1);
    for ((values, weight), forces) in
        (column.0.iter().zip(weights)).zip(forces.as_mut_slice().chunks_exact_mut(samples))
    {
        let Some(values) = values else { continue };
        if values.len() != samples {
            return None;
        }
        let factor = factor * weight;
        for (force, value) in forces.iter_mut().zip(values) {
            *force += factor * value;
        }
    }
    Some(())
}

impl GeometryError {
    /// Its name: that of the constant, or point and axis.
    pub fn name(&self) -> String {
        match (&self.constant, &self.zero) {
            (Some(constant), _) => constant.clone(),
            (None, Some((point, axis))) => format!("{axis} of {point}"),
            (None, None) => String::new(),
        }
    }

    /// The same as an effect, for lists of explanations that the recordings do not distinguish.
    pub(crate) fn as_effect(&self) -> LocatedEffect {
        LocatedEffect {
            kind: CONSTANT_ERROR.to_owned(),
            at: vec![self.name()],
        }
    }
}
