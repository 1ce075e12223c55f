//! A search for lengths and limits that would give the paper's Table 2. The paper prints neither; Table 1 gives the
//! masses. The consistent model with contact points beside the axes of the cranks is the robot; the paper's treatment is
//! the model. Lengths, pose, size and duration of both motions are varied.
//!
//! Decision: random trials within the bounds, then a (1+1) evolution strategy with the rule of a fifth (I. Rechenberg,
//! 1973) are enough: the function is cheap, has kinks where forces pass through zero, and any point with the paper's
//! figures answers the question.

use modelmill::{Host, Model, Outcome};
use modelmill_codegen::{ModelEvaluator, MotionStates};
use modelmill_identify::excite::{ExcitationMotion, FourierSeries};
use modelmill_runtime::RandomBits;
use nalgebra::{DMatrix, DVector};

use crate::runs::PeriodicTrajectory;
use crate::{bundled, printed};

/// Samples of each run in the search, and for the figures of its result.
const SAMPLES: [usize; 2] = [150, 1500];

/// Constants of the model files that are varied, with their bounds as multiples of the assumed values.
const LENGTHS: [(&str, [f64; 2]); 6] = [
    ("d1", [0.8, 1.3]),
    ("d3", [0.85, 1.3]),
    ("b", [0.1, 1.5]),
    ("dA", [0.5, 1.5]),
    ("Bx", [0.5, 1.5]),
    ("By", [-2.0, 4.0]),
];
/// Other variables: distance of the contact points (m), rotation of both cranks outwards (rad), and factors of size and
/// duration of the identification and of the test motion.
const OTHERS: [(&str, [f64; 2]); 6] = [
    ("eA", [0.0, 0.08]),
    ("outwards", [-0.5, 0.5]),
    ("size, identification", [0.2, 1.5]),
    ("size, verification", [0.2, 1.5]),
    ("duration, identification", [0.7, 3.0]),
    ("duration, verification", [0.7, 3.0]),
];
/// Where the search starts: the assumptions of this page, with contact points 20 mm beside the axes.
const START: [f64; 12] = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.02, 0.0, 1.0, 1.0, 1.0, 1.0];

/// First step near the best of the random trials, as a share of the bounds.
const FIRST_STEP: f64 = 0.1;

/// Mean relative errors, `[calculated, estimated][left, right][identification, verification]`.
pub(crate) type MeanErrors = [[[f64; 2]; 2]; 2];

/// Lengths and limits with which the errors come closest to the paper's.
pub(crate) struct LengthSearch {
    /// Number of evaluations.
    pub(crate) evaluations: usize,
    /// Names and values of the lengths, m, the last one the distance of the contact points.
    pub(crate) lengths: Vec<(&'static str, f64)>,
    /// The motions: identification, verification.
    pub(crate) motions: [Vec<FourierSeries>; 2],
    /// Mean relative errors at the start of the search and at its end.
    pub(crate) errors: [MeanErrors; 2],
}

/// Both models with a constant `eA` for the distance of the contact points, and both motions.
struct SearchProblem<'a> {
    /// The robot and the paper's treatment.
    models: [Model; 2],
    /// Motions on which the variables act.
    trajectories: &'a [PeriodicTrajectory; 2],
}

impl LengthSearch {
    /// Searches with the given number of evaluations; the same seed gives the same result.
    ///
    /// Fails only if the user cancels it.
    pub(crate) fn new(
        host: &Host,
        trajectories: &[PeriodicTrajectory; 2],
        evaluations: usize,
        seed: u64,
    ) -> Outcome<Self> {
        let problem = SearchProblem {
            models: [
                contact_model(host, "spidermill.toml")?,
                contact_model(host, "spidermill-paper.toml")?,
            ],
            trajectories,
        };
        let mut draws = RandomBits::new(seed);
        let best = host.run_job("searching for lengths", evaluations, |job| {
            let mut best = (problem.distance(&START), START);
            let mut step = FIRST_STEP;
            for k in 0..evaluations {
                if job.flow(1).is_break() {
                    break;
                }
                // The first trials are anywhere, the others near the best one.
                let is_anywhere = 2 * k < evaluations;
                let trial = if is_anywhere {
                    draw(&mut draws)
                } else {
                    mutate(&best.1, step, &mut draws)
                };
                let value = problem.distance(&trial);
                let is_better = value < best.0;
                if is_better {
                    best = (value, trial);
                }
                // A fifth of the trials near the best should succeed.
                if !is_anywhere {
                    let factor: f64 = if is_better { 1.5 } else { 0.904 };
                    step = (step * factor).clamp(1e-3, 0.5);
                }
            }
            best.1
        })?;
        let found = constants(&problem.models[0], &best);
        let names = &problem.models[0].derivation.mechanism.constants;
        let lengths = LENGTHS.iter().map(|(name, _)| *name).chain(["eA"]);
        let errors = [START, best].map(|x| problem.errors(&x, SAMPLES[1]).unwrap_or([[[f64::NAN; 2]; 2]; 2]));
        Ok(Self {
            evaluations,
            lengths: lengths
                .filter_map(|name| {
                    let k = names.iter().position(|c| c.name == name)?;
                    Some((name, found[k]))
                })
                .collect(),
            motions: [0, 1].map(|run| problem.series(&best, run)),
            errors,
        })
    }

    /// The largest factor between an error and the paper's, above 1.
    pub(crate) fn largest_factor(&self) -> f64 {
        logarithms(&self.errors[1]).map(f64::abs).fold(0.0, f64::max).exp()
    }
}

/// Bounds of the variables.
fn bounds() -> impl Iterator<Item = [f64; 2]> {
    LENGTHS.iter().map(|(_, b)| *b).chain(OTHERS.iter().map(|(_, b)| *b))
}

/// A random point within the bounds.
fn draw(draws: &mut RandomBits) -> [f64; 12] {
    let mut x = START;
    for (x, [low, high]) in x.iter_mut().zip(bounds()) {
        *x = low + (high - low) * draws.below_one();
    }
    x
}

/// A random neighbour within the bounds; the step is a share of their distance.
fn mutate(x: &[f64; 12], step: f64, draws: &mut RandomBits) -> [f64; 12] {
    let mut trial = *x;
    for (x, [low, high]) in trial.iter_mut().zip(bounds()) {
        *x = (*x + step * (high - low) * draws.nearly_normal()).clamp(low, high);
    }
    trial
}

/// Logarithms of the ratios of errors to the paper's.
fn logarithms(errors: &MeanErrors) -> impl Iterator<Item = f64> + '_ {
    let paper = printed::TABLE_2.iter().flatten().flatten();
    errors
        .iter()
        .flatten()
        .flatten()
        .zip(paper)
        .map(|(ours, paper)| (100.0 * ours / paper).ln())
}

impl SearchProblem<'_> {
    /// Sum of the squared logarithms of the ratios to the paper's errors; infinite if a loop does not close.
    fn distance(&self, x: &[f64; 12]) -> f64 {
        let errors = self.errors(x, SAMPLES[0]);
        let sum = errors.map(|errors| logarithms(&errors).map(|ratio| ratio * ratio).sum::<f64>());
        sum.filter(|sum| sum.is_finite()).unwrap_or(f64::INFINITY)
    }

    /// One of the motions: rotated outwards, smaller or larger, faster or slower.
    fn series(&self, x: &[f64; 12], run: usize) -> Vec<FourierSeries> {
        let [outwards, size, duration] = [x[7], x[8 + run], x[10 + run]];
        let series = self.trajectories[run].series.iter().zip([1.0, -1.0]);
        series
            .map(|(one, side)| {
                // The same positions in a longer time have smaller rates, which are the coefficients.
                let mut moved = one.scale_amplitude(size / duration);
                moved.omega /= duration;
                moved.offset += side * outwards;
                moved
            })
            .collect()
    }

    /// Mean relative errors before and after an identification along the first motion; `None` if a loop does not close.
    fn errors(&self, x: &[f64; 12], samples: usize) -> Option<MeanErrors> {
        let [robot, paper] = &self.models;
        let evaluators = self
            .models
            .each_ref()
            .map(|model| ModelEvaluator::with_constants(&model.derivation, constants(model, x)));
        // The paper's model does not know the distance of the contact points.
        let known: [f64; 12] = std::array::from_fn(|k| if k == LENGTHS.len() { 0.0 } else { x[k] });
        let unaware = constants(paper, &known);
        let model = ModelEvaluator::with_constants(&paper.derivation, unaware.clone());
        let [calculated, truth] = [base_values(paper, &unaware), base_values(robot, &constants(robot, x))];
        let mut estimated = None;
        let mut errors = [[[0.0; 2]; 2]; 2];
        for run in 0..2 {
            let motion = ExcitationMotion::sample(&self.series(x, run), samples);
            let states = MotionStates {
                q: slices(&motion.q),
                qd: slices(&motion.qd),
                qdd: slices(&motion.qdd),
                load: Vec::new(),
            };
            let measured = evaluators[0].inverse_dynamics(&states, &truth).ok()?;
            let columns = unit_columns(&model, &states, calculated.len())?;
            // The first motion is the identification.
            if estimated.is_none() {
                let w = DMatrix::from_columns(&columns);
                let y = DVector::from_vec(measured.concat());
                estimated = Some(w.svd(true, true).solve(&y, 1e-12).ok()?);
            }
            let all = [DVector::from_vec(calculated.clone()), estimated.clone()?];
            for (stage, values) in all.iter().enumerate() {
                let forces: DVector<f64> = DMatrix::from_columns(&columns) * values;
                for (drive, measured) in measured.iter().enumerate().take(2) {
                    let forces = forces.iter().skip(drive * samples);
                    errors[stage][drive][run] = mean_relative(measured, forces);
                }
            }
        }
        Some(errors)
    }
}

/// Columns as slices.
fn slices(columns: &[Vec<f64>]) -> Vec<&[f64]> {
    columns.iter().map(Vec::as_slice).collect()
}

/// The constants of a model for some variables.
fn constants(model: &Model, x: &[f64; 12]) -> Vec<f64> {
    let constants = &model.derivation.mechanism.constants;
    let value = |name: &str, value: f64| match LENGTHS.iter().position(|(length, _)| *length == name) {
        Some(k) => value * x[k],
        None if name == OTHERS[0].0 => x[LENGTHS.len()],
        None => value,
    };
    constants.iter().map(|c| value(&c.name, c.value)).collect()
}

/// The columns of the regressor, drives one after the other.
fn unit_columns(model: &ModelEvaluator<'_>, states: &MotionStates<'_>, n: usize) -> Option<Vec<DVector<f64>>> {
    (0..n)
        .map(|k| {
            let mut unit = vec![0.0; n];
            unit[k] = 1.0;
            Some(DVector::from_vec(model.inverse_dynamics(states, &unit).ok()?.concat()))
        })
        .collect()
}

/// Mean of |error| / |force|, the paper's measure. Samples with a force of zero have no relative error.
fn mean_relative<'a>(measured: &[f64], modelled: impl Iterator<Item = &'a f64>) -> f64 {
    let pairs = measured.iter().zip(modelled).filter(|(y, _)| **y != 0.0);
    let (sum, n) = pairs.fold((0.0, 0), |(sum, n), (y, m)| (sum + ((y - m) / y).abs(), n + 1));
    sum / f64::from(n.max(1))
}

/// The base parameters with the masses of the model file.
fn base_values(model: &Model, constants: &[f64]) -> Vec<f64> {
    let parameters: Vec<f64> = model
        .derivation
        .mechanism
        .parameters
        .iter()
        .map(|p| p.nominal)
        .collect();
    model.derivation.base_values(&parameters, constants)
}

/// A bundled model with a constant `eA` for the distance of the contact points from the axes of the cranks.
fn contact_model(host: &Host, of: &str) -> Outcome<Model> {
    let text = format!(
        "schema = 1\nname = \"contact\"\nextends = \"{of}\"\n\
         [constants]\neA = {{ value = 0.0, unit = \"m\" }}\n\
         [[point]]\nname = \"A_left\"\nat = [\"dA\", \"eA\"]\n\
         [[point]]\nname = \"A_right\"\nat = [\"dA\", \"-eA\"]\n"
    );
    bundled::variant(host, of, "contact.toml", &text)
}
