//! Excitation: a motion with which the base parameters are identified best. Input: limits. Output: a periodic
//! trajectory for each active coordinate, eq. (14), (15) and (17) of the paper.
//!
//! 1. `random` - random series within the limits; the search starts from the best of them.
//! 2. `search` - sequential quadratic programming from each start.
//! 3. `feasible` - shrinks the result until no limit is exceeded, between samples either.
//!
//! The objective is an [`ExcitationCriterion`]: the uncertainty of the base parameters, or, with [`separate`], the
//! similarity of two effects. It is minimised.
//!
//! The caller provides the mechanism as an [`ExcitationPlant`].

mod feasible;
mod fourier;
mod measure;
mod random;
mod search;
pub mod separate;
mod thresholds;

use std::fmt;

use modelmill_runtime::RandomBits;
use nalgebra::DMatrix;

pub use fourier::FourierSeries;
pub use measure::{condition_number, least_singular_value, scaled_condition_number};

/// Motion of all active coordinates, `[coordinate][sample]`.
#[derive(Clone, Debug, Default)]
pub struct ExcitationMotion {
    /// Positions, rad or m.
    pub q: Vec<Vec<f64>>,
    /// Rates, rad/s or m/s.
    pub qd: Vec<Vec<f64>>,
    /// Accelerations, rad/s^2 or m/s^2.
    pub qdd: Vec<Vec<f64>>,
}

impl ExcitationMotion {
    /// Samples series at equal steps over one period; the end, which equals the beginning, is left out.
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

/// What excitation needs of a mechanism.
pub trait ExcitationPlant {
    /// The regressor along a motion: rows of samples and drives, columns of base parameters; `None` if the mechanism
    /// cannot follow the motion.
    fn regressor(&self, motion: &ExcitationMotion) -> Option<DMatrix<f64>>;

    /// Names of limits in addition to those of the coordinates, in the order of [`ExcitationPlant::excess`].
    fn limits(&self) -> Vec<String>;

    /// Excess of each of [`ExcitationPlant::limits`], `[limit][sample]`, as a share of half its range: negative inside,
    /// -1 in the middle. `None` if the mechanism cannot follow the motion.
    fn excess(&self, motion: &ExcitationMotion) -> Option<Vec<Vec<f64>>>;

    /// For [`ExcitationCriterion::Separation`]: how well effects are distinguished along a motion, for example an rms
    /// force. `None` if the mechanism cannot follow the motion, and for plants without effects to distinguish.
    fn separation(&self, _motion: &ExcitationMotion) -> Option<f64> {
        None
    }
}

/// Limits of one active coordinate, `[low, high]`.
#[derive(Clone, Debug, PartialEq)]
pub struct ExcitationLimits {
    /// Name of the coordinate in messages.
    pub name: String,
    /// Limits of the position, rad or m.
    pub position: [f64; 2],
    /// Limits of the rate, rad/s or m/s, around 0; `None` without limits.
    pub rate: Option<[f64; 2]>,
    /// Limits of the acceleration, rad/s^2 or m/s^2, around 0; `None` without limits.
    pub acceleration: Option<[f64; 2]>,
}

/// What is minimised.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum ExcitationCriterion {
    /// Condition number of the stacked regressor in its units, eq. (13).
    #[default]
    Condition,
    /// `-log det(W'W / N)`, which does not depend on units.
    LogDet,
    /// Similarity of effects: minimises `-log` of [`ExcitationPlant::separation`].
    Separation,
}

/// Options of the search.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Number of harmonics of the series.
    pub harmonics: usize,
    /// Period, s; with [`Options::period_range`] the result has another one.
    pub period: f64,
    /// Bounds of the period, s, if it is a variable of the search, eq. (17); `None` to keep [`Options::period`].
    pub period_range: Option<[f64; 2]>,
    /// Criterion that is minimised.
    pub criterion: ExcitationCriterion,
    /// Number of random feasible trajectories that are tried first.
    pub random: usize,
    /// Number of them from which the search starts.
    pub starts: usize,
    /// Largest number of steps of the search from each start.
    pub steps: usize,
    /// Seed of the random numbers; the same seed gives the same trajectory.
    pub seed: u64,
}

impl Options {
    /// The period for a position between -1 and 1 in the range: the ratio of the ends is divided evenly. The fixed
    /// period if there is no range.
    pub(crate) fn period_at(&self, position: f64) -> f64 {
        self.period_range.map_or(self.period, |[low, high]| {
            (low.ln() + 0.5 * (position + 1.0) * (high / low).ln()).exp()
        })
    }

    /// The position of a period in the range, the inverse of [`Options::period_at`]; 0 if the range is one point.
    pub(crate) fn period_position(&self, period: f64) -> f64 {
        let [low, high] = self.period_range.unwrap_or([period; 2]);
        let width = (high / low).ln();
        if width > 0.0 {
            2.0 * (period / low).ln() / width - 1.0
        } else {
            0.0
        }
    }
}

impl Default for Options {
    fn default() -> Self {
        Self {
            harmonics: 7,
            period: 7.29,
            period_range: None,
            criterion: ExcitationCriterion::Condition,
            random: 1000,
            starts: 4,
            steps: 150,
            seed: 1,
        }
    }
}

/// Result of the search.
#[derive(Clone, Debug, PartialEq)]
pub struct ExcitationTrajectory {
    /// One series for each active coordinate.
    pub series: Vec<FourierSeries>,
    /// Value of the criterion: the logarithm of the condition number, `-log det`, or `-log` of the separation.
    pub value: f64,
    /// The same for the best random trajectory.
    pub start_value: f64,
    /// Condition number of the regressor, eq. (13), at [`samples_per_period`] steps over the period.
    pub condition_number: f64,
    /// The same for the best random trajectory.
    pub start_condition_number: f64,
    /// Number of random trajectories within the limits.
    pub feasible_starts: usize,
    /// Number of evaluations of the criterion.
    pub evaluations: usize,
    /// Value of the criterion at the end of each search, best first.
    pub end_values: Vec<f64>,
    /// Margin to each limit.
    pub margins: Vec<LimitMargin>,
}

/// Margin of a trajectory to one limit.
#[derive(Clone, Debug, PartialEq)]
pub struct LimitMargin {
    /// Name of the limit; `_d` and `_dd` mark rates and accelerations.
    pub name: String,
    /// Largest excess over a period, as a share of half the range: not above 0 if the limit is kept.
    pub excess: f64,
    /// Whether the excess is a proven bound for all times, or comes from fine sampling and differences.
    pub proven: bool,
}

/// Why there is no excitation.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum ExciteError {
    /// No random trajectory was within the limits.
    NoStart {
        /// Number of trajectories that were tried.
        attempts: usize,
        /// The limit that was exceeded most often; `None` if the mechanism could not follow the motions.
        most_exceeded: Option<String>,
    },
    /// There are no base parameters or no coordinates.
    NothingToExcite,
    /// The regressor has dependent columns along every trajectory that was tried.
    Deficient,
    /// The effects are indistinguishable along every trajectory that was tried.
    Inseparable,
}

impl fmt::Display for ExciteError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoStart { attempts: tried, most_exceeded: most } => {
                write!(f, "none of {tried} random trajectories is within the limits: ")?;
                match most {
                    Some(name) => write!(f, "`{name}` was exceeded most often; widen this limit"),
                    None => f.write_str(
                        "the mechanism cannot reach the positions; narrow their limits so that the loops close everywhere within them",
                    ),
                }
            }
            Self::NothingToExcite => f.write_str(
                "there is nothing to excite: the model has no base parameter that a force depends on",
            ),
            Self::Deficient => f.write_str(
                "no trajectory within the limits distinguishes all base parameters; widen the limits or use more harmonics",
            ),
            Self::Inseparable => {
                f.write_str("no trajectory within the limits distinguishes the effects")
            }
        }
    }
}

impl std::error::Error for ExciteError {}

/// Number of samples over a period from which criteria and limits of the plant are computed in the search: 16 for the
/// shortest wave, but at least 128.
pub fn samples_per_period(options: &Options) -> usize {
    (16 * options.harmonics).max(128)
}

/// Whether a search continues.
pub type SearchFlow = std::ops::ControlFlow<()>;

/// Finds a trajectory. `progress` is called with the number of new steps, out of [`max_progress_steps`], and returns
/// whether to continue. A search that is stopped ends soon, with its result so far or an error.
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
    // Stage 1: random starts; stage 2: a search from each of the best, shrunk to the limits.
    let drawn = random::draw_starts(&measure, progress)?;
    let mut found: Vec<(f64, Vec<FourierSeries>)> = Vec::new();
    for start in drawn.best.iter().take(options.starts) {
        let end = search::improve(&measure, &start.1, progress);
        found.extend(feasible::shrink_to_limits(&measure, &end));
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found.truncate(options.starts);
    // Stage 3: the best ends are refined with sharper constraints.
    let polished = found.len().min(POLISHED_ENDS);
    for k in 0..polished {
        let end = search::polish(&measure, &found[k].1, progress);
        found.extend(feasible::shrink_to_limits(&measure, &end));
    }
    // The best start is the result if no search improves it.
    let first = drawn.best[0].clone();
    found.push(first.clone());
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let ends = found.iter().map(|(value, _)| *value).collect();
    let (value, series) = found.swap_remove(0);
    let condition = |series: &[FourierSeries]| {
        let motion = ExcitationMotion::sample(series, samples_per_period(options));
        plant.regressor(&motion).map_or(f64::INFINITY, |w| condition_number(&w))
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

/// Random motions within the limits, like those from which a search starts.
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

/// Number of search results that are refined.
const POLISHED_ENDS: usize = 2;

/// Largest number of steps that `progress` of [`excite`] counts.
pub fn max_progress_steps(options: &Options) -> usize {
    let rounds = options.starts + POLISHED_ENDS * search::POLISHES;
    options.random + rounds * options.steps
}
