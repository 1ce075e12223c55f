//! Random trajectories within the limits, as large as the limits allow.

use std::f64::consts::PI;

use modelmill_runtime::RandomBits;

use super::feasible::{max_scale_factor, worst_plant_limit};
use super::measure::{TrajectoryEvaluator, half_width};
use super::{ExcitationCriterion, ExciteError, FourierSeries, SearchFlow};

/// Random trajectories within the limits.
pub(super) struct FeasibleStarts {
    /// The best of them with the values of the criterion, best first.
    pub(super) best: Vec<(f64, Vec<FourierSeries>)>,
    /// Number of trajectories that were within the limits.
    pub(super) feasible: usize,
}

/// Largest number of draws per requested trajectory.
const PATIENCE: usize = 20;
/// Number of times a trajectory is shrunk to the plant's limits before another one is drawn.
const SHRINKS: usize = 12;

/// Draws as many trajectories as the options request and keeps the best; an error if none is useful.
pub(super) fn draw_starts(
    measure: &TrajectoryEvaluator<'_>,
    progress: &dyn Fn(usize) -> SearchFlow,
) -> Result<FeasibleStarts, ExciteError> {
    let wanted = measure.options.random.max(1);
    let mut draws = RandomBits::new(measure.options.seed);
    let mut drawn: Vec<(f64, Vec<FourierSeries>)> = Vec::new();
    let mut feasible = 0;
    let mut stopped = false;
    draw_feasible(measure, &mut draws, wanted, |series| {
        feasible += 1;
        let flow = progress(1);
        let value = measure.criterion_value(&measure.sample_motion(&series));
        if value.is_finite() {
            drawn.push((value, series));
        }
        stopped = flow.is_break();
        flow
    })?;
    if drawn.is_empty() {
        return Err(no_start_error(measure));
    }
    drawn.sort_by(|a, b| a.0.total_cmp(&b.0));
    // The search starts from these, so they must be within the limits between samples too. If the user stops, one is
    // enough.
    drawn.truncate(if stopped { 1 } else { 4 * measure.options.starts.max(1) });
    let kept: Vec<(f64, Vec<FourierSeries>)> = drawn
        .into_iter()
        .filter_map(|(_, series)| super::feasible::shrink_to_limits(measure, &series))
        .collect();
    let mut best = kept;
    best.sort_by(|a, b| a.0.total_cmp(&b.0));
    if best.is_empty() {
        return Err(no_start_error(measure));
    }
    Ok(FeasibleStarts { best, feasible })
}

/// Error for the case that no trajectory has a finite criterion.
fn no_start_error(measure: &TrajectoryEvaluator<'_>) -> ExciteError {
    match measure.options.criterion {
        ExcitationCriterion::Separation => ExciteError::Inseparable,
        ExcitationCriterion::Condition | ExcitationCriterion::LogDet => ExciteError::Deficient,
    }
}

/// Draws trajectories until `wanted` of them are within the limits, the largest number of draws is reached, or `take`
/// stops. An error if none is within the limits.
pub(super) fn draw_feasible(
    measure: &TrajectoryEvaluator<'_>,
    draws: &mut RandomBits,
    wanted: usize,
    mut take: impl FnMut(Vec<FourierSeries>) -> SearchFlow,
) -> Result<(), ExciteError> {
    let names = measure.plant.limits();
    // Counts how often each limit was exceeded, for the error message.
    let mut blame = vec![0_usize; names.len()];
    let (mut tried, mut feasible) = (0, 0);
    let mut flow = SearchFlow::Continue(());
    while flow.is_continue() && feasible < wanted && tried < PATIENCE * wanted {
        tried += 1;
        // One period for all coordinates; without a range no number is drawn, so that fixed periods keep their seeds.
        let position = match measure.options.period_range {
            Some(_) => 2.0 * draws.below_one() - 1.0,
            None => 0.0,
        };
        let omega = 2.0 * PI / measure.options.period_at(position);
        let mut series: Vec<FourierSeries> = (0..measure.limits.len())
            .map(|i| draw_series(measure, i, omega, draws))
            .collect();
        for _ in 0..SHRINKS {
            match worst_plant_limit(measure, &series, super::samples_per_period(measure.options)) {
                Some((_, excess)) if excess <= 0.0 => {
                    feasible += 1;
                    flow = take(series);
                    break;
                }
                Some((k, _)) if k < blame.len() => blame[k] += 1,
                _ => {}
            }
            // Shrink the motion and check the limits again.
            series = series.iter().map(|s| s.scale_amplitude(0.8)).collect();
        }
    }
    if feasible > 0 {
        return Ok(());
    }
    let most = (0..names.len()).max_by_key(|k| blame[*k]);
    Err(ExciteError::NoStart {
        attempts: tried,
        most_exceeded: most.filter(|k| blame[*k] > 0).map(|k| names[k].clone()),
    })
}

/// A random series of one coordinate that reaches its tightest limit, around a random mean within the remaining range.
fn draw_series(measure: &TrajectoryEvaluator<'_>, i: usize, omega: f64, draws: &mut RandomBits) -> FourierSeries {
    let n = measure.options.harmonics;
    let [low, high] = measure.limits[i].position;
    let shape = FourierSeries {
        offset: 0.0,
        mu: (0..n).map(|_| draws.nearly_normal()).collect(),
        nu: (0..n).map(|_| draws.nearly_normal()).collect(),
        omega,
    };
    // Scale the random shape to the limits of position, rate and acceleration.
    let [least, greatest] = shape.extremes(0);
    let by_position = 2.0 * half_width([low, high]) / (greatest - least);
    let factor = max_scale_factor(&measure.limits[i], &shape).min(by_position);
    let mut series = shape.scale_amplitude(factor);
    // Remaining range for the mean value.
    let room = (2.0 * half_width([low, high]) - factor * (greatest - least)).max(0.0);
    series.offset = low - factor * least + room * draws.below_one();
    series
}
