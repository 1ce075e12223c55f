//! Motion that excites a mechanism so that its base parameters are found best: limits go in, a periodic trajectory for
//! each active coordinate comes out, eq. (14), (15) and (17) of the paper.
//!
//! 1. `random` - random series within the limits; the best of them are where the search starts.
//! 2. `search` - sequential quadratic programming from each start.
//! 3. `feasible` - what was found, shrunk until no limit is exceeded, between samples either.
//!
//! What is made small is a [`ExcitationCriterion`]: uncertainty of the base parameters, or, with [`separate`], what two effects have in
//! common.
//!
//! How a mechanism moves is the business of the caller, who gives a [`ExcitationPlant`].

mod feasible;
mod fourier;
mod measure;
mod random;
mod search;
pub mod separate;

use std::fmt;

use modelmill_runtime::RandomBits;
use nalgebra::DMatrix;

pub use fourier::FourierSeries;
pub use measure::{condition_number, least_singular_value, scaled_condition_number};

/// Motion of all active coordinates, `[coordinate][sample]`.
#[derive(Clone, Debug, Default)]
pub struct ExcitationMotion {
    /// rad or m
    pub q: Vec<Vec<f64>>,
    /// rad/s or m/s
    pub qd: Vec<Vec<f64>>,
    /// rad/s^2 or m/s^2
    pub qdd: Vec<Vec<f64>>,
}

impl ExcitationMotion {
    /// Series sampled at equal steps over one period, without its end, which is its beginning.
    pub fn sample(series: &[FourierSeries], samples: usize) -> Self {
        let mut motion = Self::default();
        for one in series {
            let step = one.period() / samples as f64;
            let mut columns = [0, 1, 2].map(|_| Vec::with_capacity(samples));
            for i in 0..samples {
                for (column, value) in columns.iter_mut().zip(one.at_time(i as f64 * step)) {
                    column.push(value);
                }
            }
            let [q, qd, qdd] = columns;
            motion.q.push(q);
            motion.qd.push(qd);
            motion.qdd.push(qdd);
        }
        motion
    }
}

/// The mechanism, as far as excitation must know it.
pub trait ExcitationPlant {
    /// The regressor along a motion: rows of samples and drives, columns of base parameters; `None` where the
    /// mechanism cannot follow.
    fn regressor(&self, motion: &ExcitationMotion) -> Option<DMatrix<f64>>;

    /// Names of limits beyond those of coordinates, in the order of [`ExcitationPlant::excess`].
    fn limits(&self) -> Vec<String>;

    /// For each of [`ExcitationPlant::limits`] and each sample, by how much it is exceeded, as a share of half its range:
    /// negative inside, -1 in the middle; `None` where the mechanism cannot follow.
    fn excess(&self, motion: &ExcitationMotion) -> Option<Vec<Vec<f64>>>;

    /// For [`ExcitationCriterion::Separation`], by how much effects can be told apart along a motion, such as a force in root mean
    /// squares; `None` where the mechanism cannot follow, and for plants that are not asked to tell any apart.
    fn separation(&self, _motion: &ExcitationMotion) -> Option<f64> {
        None
    }
}

/// Limits of one active coordinate, `[low, high]`.
#[derive(Clone, Debug, PartialEq)]
pub struct ExcitationLimits {
    /// What messages call it.
    pub name: String,
    /// rad or m
    pub position: [f64; 2],
    /// rad/s or m/s, around 0
    pub rate: Option<[f64; 2]>,
    /// rad/s^2 or m/s^2, around 0
    pub acceleration: Option<[f64; 2]>,
}

/// What is made small.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum ExcitationCriterion {
    /// The condition number of the stacked regressor in its units, eq. (13).
    #[default]
    Condition,
    /// `-log det(W'W / N)`, which does not depend on units.
    LogDet,
    /// What effects have in common: made small is `-log` of [`ExcitationPlant::apart`].
    Separation,
}

/// How to search.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Harmonics of the series.
    pub harmonics: usize,
    /// Period, s.
    pub period: f64,
    /// What is made small.
    pub criterion: ExcitationCriterion,
    /// Random feasible trajectories that are tried first.
    pub random: usize,
    /// How many of them the search starts from.
    pub starts: usize,
    /// Steps of the search from each start, at most.
    pub steps: usize,
    /// The same seed gives the same trajectory.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            harmonics: 7,
            period: 7.29,
            criterion: ExcitationCriterion::Condition,
            random: 1000,
            starts: 4,
            steps: 150,
            seed: 1,
        }
    }
}

/// A trajectory that was found.
#[derive(Clone, Debug, PartialEq)]
pub struct ExcitationTrajectory {
    /// One series for each active coordinate.
    pub series: Vec<FourierSeries>,
    /// Value of the criterion: the logarithm of the condition number, `-log det`, or `-log` of what is apart.
    pub value: f64,
    /// The same for the best of the random trajectories.
    pub start_value: f64,
    /// Condition number of the regressor, eq. (13), at [`samples`] steps over the period.
    pub condition_number: f64,
    /// The same for the best of the random trajectories.
    pub start_condition_number: f64,
    /// Random trajectories that kept the limits.
    pub feasible_starts: usize,
    /// Trajectories for which the regressor was evaluated.
    pub evaluations: usize,
    /// Value of the criterion where each search ended, the best first.
    pub end_values: Vec<f64>,
    /// How close the trajectory comes to each limit.
    pub margins: Vec<LimitMargin>,
}

/// How close a trajectory comes to a limit.
#[derive(Clone, Debug, PartialEq)]
pub struct LimitMargin {
    /// Which limit.
    pub name: String,
    /// The largest excess over a period, as a share of half the range: not above 0 where the limit is kept.
    pub excess: f64,
    /// Whether the excess is a proven bound for all times, or one from fine sampling and differences.
    pub proven: bool,
}

/// Why there is no excitation.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum ExciteError {
    /// No random trajectory kept the limits.
    NoStart {
        /// How many were tried.
        attempts: usize,
        /// The limit that was exceeded most often, if it is not that the mechanism could not follow.
        most_exceeded: Option<String>,
    },
    /// There are no base parameters or no coordinates.
    NothingToExcite,
    /// The regressor has dependent columns along every trajectory that was tried.
    Deficient,
    /// The effects are the same along every trajectory that was tried.
    Inseparable,
}

impl fmt::Display for ExciteError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoStart { attempts: tried, most_exceeded: most } => {
                write!(f, "none of {tried} random trajectories kept the limits: ")?;
                match most {
                    Some(name) => write!(f, "`{name}` was exceeded most often; widen it"),
                    None => f.write_str(
                        "the mechanism could not follow; narrow the positions so that the loops close within them",
                    ),
                }
            }
            Self::NothingToExcite => f.write_str(
                "there is nothing to excite: the model has no base parameter that a force depends on",
            ),
            Self::Deficient => f.write_str(
                "no trajectory within the limits tells all base parameters apart; widen the limits or use more harmonics",
            ),
            Self::Inseparable => {
                f.write_str("no trajectory within the limits tells the effects apart")
            }
        }
    }
}

impl std::error::Error for ExciteError {}

/// Samples over a period from which criteria and limits of the plant are computed in the search: 16 for the shortest
/// wave, but no fewer than 128.
pub fn samples_per_period(options: &Options) -> usize {
    (16 * options.harmonics).max(128)
}

/// Whether a search goes on.
pub type SearchFlow = std::ops::ControlFlow<()>;

/// Finds a trajectory; `progress` is told of each step out of [`steps`] and says whether to go on. A search that is stopped ends
/// soon, with what it has or an error.
pub fn excite(
    plant: &dyn ExcitationPlant,
    limits: &[ExcitationLimits],
    options: &Options,
    progress: &dyn Fn(usize) -> SearchFlow,
) -> Result<ExcitationTrajectory, ExciteError> {
    if limits.is_empty() {
        return Err(ExciteError::NothingToExcite);
    }
    let measure = measure::TrajectoryEvaluator::new(plant, limits, options);
    let drawn = random::draw_starts(&measure, progress)?;
    let mut found: Vec<(f64, Vec<FourierSeries>)> = Vec::new();
    for start in drawn.best.iter().take(options.starts) {
        let end = search::improve(&measure, &start.1, progress);
        found.extend(feasible::shrink_to_limits(&measure, &end));
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found.truncate(options.starts);
    let polished = found.len().min(POLISHED_ENDS);
    for k in 0..polished {
        let end = search::polish(&measure, &found[k].1, progress);
        found.extend(feasible::shrink_to_limits(&measure, &end));
    }
    // The start itself is an answer, should no search do better.
    let first = drawn.best[0].clone();
    found.push(first.clone());
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let ends = found.iter().map(|(value, _)| *value).collect();
    let (value, series) = found.swap_remove(0);
    let condition = |series: &[FourierSeries]| {
        let motion = ExcitationMotion::sample(series, samples_per_period(options));
        plant
            .regressor(&motion)
            .map_or(f64::INFINITY, |w| condition_number(&w))
    };
    Ok(ExcitationTrajectory {
        condition_number: condition(&series),
        start_condition_number: condition(&first.1),
        value,
        start_value: first.0,
        feasible_starts: drawn.feasible,
        evaluations: measure.evaluations(),
        end_values: ends,
        margins: feasible::margins(&measure, &series),
        series,
    })
}

/// Random motions within the limits, as a search would start from.
pub fn random_motions(
    plant: &dyn ExcitationPlant,
    limits: &[ExcitationLimits],
    options: &Options,
    wanted: usize,
) -> Result<Vec<ExcitationMotion>, ExciteError> {
    if limits.is_empty() {
        return Err(ExciteError::NothingToExcite);
    }
    let measure = measure::TrajectoryEvaluator::new(plant, limits, options);
    let mut motions = Vec::new();
    let mut draws = RandomBits::new(options.seed);
    random::draw_feasible(&measure, &mut draws, wanted, |series| {
        motions.push(measure.sample_motion(&series));
        SearchFlow::Continue(())
    })?;
    Ok(motions)
}

/// Ends of searches that are polished.
const POLISHED_ENDS: usize = 2;

/// Steps that `progress` of [`excite`] is told of, at most.
pub fn max_progress_steps(options: &Options) -> usize {
    let rounds = options.starts + POLISHED_ENDS * search::POLISHES;
    options.random + rounds * options.steps
}
