//! Pushes at standstill: two opposite steps of the force, after which it returns to its level before.
//!
//! At standstill dry friction takes any value up to its limit, so that the level of the force says nothing. Friction
//! that relaxes under a controller changes slowly; a push begins and ends at once and leaves nothing behind.

use super::levels::SearchedResidual;
use super::segments::DriveSegment;
use super::smoothing::{dilate_mask, median_deviation, range_median, running_median, sample_quantile, true_ranges};
use super::trace::ResidualTrace;
use crate::audit::thresholds::{
    STANDSTILL_END_MARGIN_S, STANDSTILL_FEWEST_S, STEP_LEAST_DEVIATIONS, STEP_LEAST_FORCE_SHARE, STEP_LEAST_RETURN,
    STEP_MOST_RATIO, STEP_WINDOWS_S,
};

/// Time on either side of a step that is not used, s: the step itself.
const STEP_RISE_S: f64 = 0.03;
/// Levels of the steps below this share of the rms force are rounding.
const ROUNDING: f64 = 1e-9;

/// A step of the force.
#[derive(Clone, Copy)]
struct ForceStep {
    /// Its sample.
    at: usize,
    /// Force after it minus force before it, N or N m.
    height: f64,
}

/// The pushes of one drive at standstill of all drives: short ones first, then long ones, which noise hides less.
pub(super) fn pushes_at_standstill(trace: &ResidualTrace, rest: &SearchedResidual) -> Vec<DriveSegment> {
    if rest.regimes.has_dead_band {
        return Vec::new();
    }
    let moves: Vec<bool> = rest.regimes.all_stand.iter().map(|stands| !stands).collect();
    let margin = trace.sample_count(STANDSTILL_END_MARGIN_S, 1);
    let usable: Vec<bool> = dilate_mask(&moves, margin).iter().map(|near| !near).collect();
    let mut pushes: Vec<DriveSegment> = Vec::new();
    for seconds in STEP_WINDOWS_S {
        for push in pushes_of_window(trace, rest, &true_ranges(&usable), seconds) {
            if pushes
                .iter()
                .all(|known| push.start > known.end || push.end < known.start)
            {
                pushes.push(push);
            }
        }
    }
    pushes
}

/// The pushes whose steps are differences of medians over a window.
fn pushes_of_window(
    trace: &ResidualTrace,
    rest: &SearchedResidual,
    standing: &[std::ops::Range<usize>],
    seconds: f64,
) -> Vec<DriveSegment> {
    let (window, rise) = (trace.sample_count(seconds, 2), trace.sample_count(STEP_RISE_S, 1));
    let standing: Vec<_> = standing
        .iter()
        .filter(|range| range.len() > 2 * (window + rise))
        .cloned()
        .collect();
    let differences = step_differences(&trace.residual[rest.drive], &standing, window, rise);
    // At the ends of a standstill there is no difference.
    let apart = rise + window / 2;
    let inner = |range: &std::ops::Range<usize>| range.start + apart..range.end - apart;
    let of_standing: Vec<f64> = standing
        .iter()
        .flat_map(|range| differences[inner(range)].to_vec())
        .collect();
    if of_standing.len() < trace.sample_count(STANDSTILL_FEWEST_S, 1) {
        return Vec::new();
    }
    let middle = sample_quantile(of_standing.clone(), 0.5);
    let deviation = median_deviation(of_standing.iter().map(|x| x - middle)).max(ROUNDING * rest.force_rms);
    let bound = (STEP_LEAST_DEVIATIONS * deviation).max(STEP_LEAST_FORCE_SHARE * rest.force_rms);
    let mut pushes = Vec::new();
    for range in standing {
        let steps = largest_steps(&differences, &range, bound);
        let pairs = opposite_pairs(&steps, |first, last| {
            returns_to_level(&trace.residual[rest.drive], &range, first, last, window, rise)
        });
        pushes.extend(pairs.into_iter().map(|(first, last)| DriveSegment {
            drive: rest.drive,
            start: first.at,
            end: last.at,
            force: first.height.signum() * first.height.abs().min(last.height.abs()),
            deviations: first.height.abs().min(last.height.abs()) / deviation,
            masked_share: 0.0,
            edge_contrast: 1.0,
            is_confirmed: true,
            needs_support: false,
            is_at_standstill: true,
        }));
    }
    pushes
}

/// Difference of the medians after and before each sample; zero where one of them is not within a standstill.
fn step_differences(rest: &[f64], standing: &[std::ops::Range<usize>], window: usize, rise: usize) -> Vec<f64> {
    let mut differences = vec![0.0; rest.len()];
    let apart = rise + window / 2;
    for range in standing {
        let smooth = running_median(&rest[range.clone()], window);
        for i in apart..smooth.len().saturating_sub(apart) {
            differences[range.start + i] = smooth[i + apart] - smooth[i - apart];
        }
    }
    differences
}

/// The steps above a bound within a range, in order: of neighbours with the same sign the middle of the largest part.
fn largest_steps(differences: &[f64], range: &std::ops::Range<usize>, bound: f64) -> Vec<ForceStep> {
    let mut steps = Vec::new();
    for sign in [1.0, -1.0] {
        let above: Vec<bool> = differences[range.clone()].iter().map(|x| sign * x > bound).collect();
        for part in true_ranges(&above) {
            let part = range.start + part.start..range.start + part.end;
            let height = part.clone().fold(0.0_f64, |most, i| most.max(sign * differences[i]));
            // Medians make a plateau about the step.
            let top: Vec<usize> = part.filter(|i| sign * differences[*i] > 0.7 * height).collect();
            steps.push(ForceStep {
                at: top.iter().sum::<usize>() / top.len(),
                height: sign * height,
            });
        }
    }
    steps.sort_by_key(|step| step.at);
    steps
}

/// Each step with the first later one of opposite sign and similar height, if the force returns to its level.
fn opposite_pairs(steps: &[ForceStep], returns: impl Fn(ForceStep, ForceStep) -> bool) -> Vec<(ForceStep, ForceStep)> {
    let mut pairs = Vec::new();
    let mut used = vec![false; steps.len()];
    for i in 0..steps.len() {
        if used[i] {
            continue;
        }
        let is_opposite = |k: &usize| {
            let ratio = -steps[*k].height / steps[i].height;
            !used[*k] && ratio < STEP_MOST_RATIO && ratio * STEP_MOST_RATIO > 1.0
        };
        let next = (i + 1..steps.len()).find(is_opposite);
        if let Some(k) = next.filter(|k| returns(steps[i], steps[*k])) {
            used[i] = true;
            used[k] = true;
            pairs.push((steps[i], steps[k]));
        }
    }
    pairs
}

/// Whether the levels before and after a push agree and the level during the push differs from both.
fn returns_to_level(
    rest: &[f64],
    range: &std::ops::Range<usize>,
    first: ForceStep,
    last: ForceStep,
    window: usize,
    rise: usize,
) -> bool {
    let signed = |at: usize| isize::try_from(at).unwrap_or(isize::MAX);
    let (window, rise) = (signed(window), signed(rise));
    let (start, end) = (signed(range.start), signed(range.end));
    let (a, b) = (signed(first.at), signed(last.at));
    let before = range_median(rest, (a - rise - window).max(start), a - rise);
    let after = range_median(rest, b + rise, (b + rise + window).min(end));
    let during = range_median(rest, a + rise, (b - rise).max(a + rise + 1));
    let (Some(before), Some(after), Some(during)) = (before, after, during) else {
        return false;
    };
    let height = first.height.abs().min(last.height.abs());
    let outside = 0.5 * (before + after);
    (before - after).abs() < (1.0 - STEP_LEAST_RETURN) * height && (during - outside).abs() > STEP_LEAST_RETURN * height
}
