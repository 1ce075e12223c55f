//! Whether the residual of a segment repeats at similar states of its drive. If it does, it is a law that the model
//! lacks and no contact.

use super::doubts::{EDGE_LEVEL_S, EDGE_RISE_S};
use super::levels::SearchedResidual;
use super::segments::DriveSegment;
use super::smoothing::{differences_per_sample, range_median, running_mean, sample_quantile};
use super::trace::ResidualTrace;
use crate::audit::thresholds::{
    ALONE_LEAST_SHARE, EDGE_LEAST_SHARE, EDGE_MOST_DISTANCE_SIGMAS, JERK_WEIGHT, NEIGHBOUR_MOST_DISTANCE_SIGMAS,
    REPEATED_LEAST_MEAN_SHARE, REPEATED_LEAST_RMS_SHARE, VISIT_MOST_DISTANCE_RATIO, VISIT_NEAR_SIGMAS,
};

/// Number of samples of a segment that are compared with the rest of the run.
const COMPARED: usize = 40;
/// Number of nearest samples of the rest for each of them.
const NEIGHBOURS: usize = 5;
/// Time before and after a segment whose samples are no neighbours, s.
const AROUND_S: f64 = 0.1;
/// Time over which the jerk is averaged, s.
const JERK_MEAN_S: f64 = 0.05;

/// What other samples with similar states show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum StateComparison {
    /// The residual is not there at similar states.
    Alone,
    /// There are no similar states, but the residual begins and ends while the state hardly changes.
    Sudden,
    /// There are no similar states.
    Incomparable,
    /// The residual is there at similar states too.
    Repeats,
}

/// States of one drive, each scaled by its standard deviation.
pub(super) struct ScaledStates([Vec<f64>; 5]);

impl ScaledStates {
    /// Position, rate, acceleration, fitted force and jerk of a drive; the jerk counts less.
    pub(super) fn new(trace: &ResidualTrace, drive: usize) -> Self {
        let [positions, rates, accelerations] = &trace.motion;
        let jerk = differences_per_sample(&accelerations[drive]);
        let width = trace.sample_count(JERK_MEAN_S, 1);
        let states = [
            positions[drive].clone(),
            rates[drive].clone(),
            accelerations[drive].clone(),
            trace.fitted_force(drive),
            running_mean(&jerk, width),
        ];
        let mut scaled = states.map(|values| {
            let n = values.len() as f64;
            let mean = values.iter().sum::<f64>() / n;
            let sum: f64 = values.iter().map(|x| (x - mean).powi(2)).sum();
            let scale = (n / sum.max(f64::MIN_POSITIVE)).sqrt();
            values.iter().map(|x| scale * (x - mean)).collect::<Vec<f64>>()
        });
        scaled[4].iter_mut().for_each(|jerk| *jerk *= JERK_WEIGHT);
        Self(scaled)
    }

    /// Squared distance of two samples.
    fn squared_distance(&self, i: usize, k: usize) -> f64 {
        self.0.iter().map(|x| (x[i] - x[k]).powi(2)).sum()
    }
}

/// Compares the residual of a segment with that of the rest of the run.
pub(super) fn compare_with_similar_states(
    trace: &ResidualTrace,
    rest: &SearchedResidual,
    states: &ScaledStates,
    segment: &DriveSegment,
) -> StateComparison {
    let around = trace.sample_count(AROUND_S, 1);
    let near = segment.start.saturating_sub(around)..segment.end + around;
    let others: Vec<usize> = (0..trace.samples())
        .filter(|i| !near.contains(i) && !rest.is_masked[*i])
        .collect();
    let within: Vec<usize> = (segment.start..segment.end).filter(|i| !rest.is_masked[*i]).collect();
    let (mut known, mut alone) = (0_usize, 0_usize);
    let compared = within.iter().step_by(within.len().div_ceil(COMPARED).max(1));
    let mut n_compared = 0;
    for i in compared {
        n_compared += 1;
        let neighbours = nearest_visits(states, *i, &others, around);
        if neighbours.is_empty() {
            continue;
        }
        known += 1;
        let own = rest.smooth[*i];
        let theirs: Vec<f64> = neighbours.iter().map(|k| rest.smooth[*k] / own).collect();
        let mean = sample_quantile(theirs.clone(), 0.5);
        // Large residuals of both signs are noise that is large there.
        let size = sample_quantile(theirs.iter().map(|x| x.abs()).collect(), 0.5);
        let is_large = |sign: f64| theirs.iter().any(|x| sign * x > REPEATED_LEAST_RMS_SHARE);
        let size = if is_large(1.0) && is_large(-1.0) { size } else { 0.0 };
        alone += usize::from(mean < REPEATED_LEAST_MEAN_SHARE && size < REPEATED_LEAST_RMS_SHARE);
    }
    if 2 * known < n_compared || known == 0 {
        let is_sudden = [segment.start, segment.end]
            .into_iter()
            .all(|edge| is_sudden_edge(trace, rest, states, segment, edge));
        return if is_sudden {
            StateComparison::Sudden
        } else {
            StateComparison::Incomparable
        };
    }
    if alone as f64 >= ALONE_LEAST_SHARE * known as f64 {
        StateComparison::Alone
    } else {
        StateComparison::Repeats
    }
}

/// The nearest samples of a sample, one for each visit of similar states; none if none is near.
fn nearest_visits(states: &ScaledStates, sample: usize, others: &[usize], around: usize) -> Vec<usize> {
    let most = NEIGHBOUR_MOST_DISTANCE_SIGMAS * NEIGHBOUR_MOST_DISTANCE_SIGMAS;
    let mut near: Vec<(f64, usize)> = others
        .iter()
        .map(|k| (states.squared_distance(sample, *k), *k))
        .filter(|(distance, _)| *distance < most)
        .collect();
    near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    // A narrow law acts at the nearest visits only.
    let nearest = near.first().map_or(0.0, |(distance, _)| distance.sqrt());
    let bound = (VISIT_MOST_DISTANCE_RATIO * nearest).max(VISIT_NEAR_SIGMAS).powi(2);
    let mut visits: Vec<usize> = Vec::new();
    for (_, k) in near.into_iter().take_while(|(distance, _)| *distance < bound) {
        if visits.iter().all(|visit| visit.abs_diff(k) > 2 * around) {
            visits.push(k);
        }
        if visits.len() == NEIGHBOURS {
            break;
        }
    }
    visits
}

/// Whether the residual changes at an edge of a segment by a large part of its size, while the state hardly changes.
fn is_sudden_edge(
    trace: &ResidualTrace,
    rest: &SearchedResidual,
    states: &ScaledStates,
    segment: &DriveSegment,
    edge: usize,
) -> bool {
    let signed = |at: usize| isize::try_from(at).unwrap_or(isize::MAX);
    let level = signed(trace.sample_count(EDGE_LEVEL_S, 2));
    let rise = trace.sample_count(EDGE_RISE_S, 1);
    let last = trace.samples() - 1;
    let distance = states.squared_distance(edge.saturating_sub(rise), (edge + rise).min(last));
    let (at, rise) = (signed(edge), signed(rise));
    let before = range_median(&rest.values, at - rise - level, at - rise);
    let after = range_median(&rest.values, at + rise, at + rise + level);
    let (Some(before), Some(after)) = (before, after) else {
        return false;
    };
    let change = if edge == segment.start {
        after - before
    } else {
        before - after
    };
    change * segment.force.signum() > EDGE_LEAST_SHARE * segment.force.abs()
        && distance < EDGE_MOST_DISTANCE_SIGMAS * EDGE_MOST_DISTANCE_SIGMAS
}
