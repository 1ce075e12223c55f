//! Doubts about a segment of one drive: a noise that is large there, a switch of friction at its start or end, and a
//! force so steep that an error of the time stamps explains it.

use super::levels::SearchedResidual;
use super::segments::DriveSegment;
use super::smoothing::{range_median, sample_quantile};
use super::trace::ResidualTrace;
use crate::audit::thresholds::{
    LOCAL_NOISE_LEAST_DEVIATIONS, STICK_LONGEST_S, STICK_MOST_FRICTIONS, SWITCH_FRICTION_SHARE, SWITCH_NEAR_S,
    TIME_ERROR_MOST_S,
};

/// Half of the time that an edge may take, s.
pub(super) const EDGE_RISE_S: f64 = 0.04;
/// Time over which the level at either side of an edge is taken, s.
pub(super) const EDGE_LEVEL_S: f64 = 0.08;

/// Whether the mean of the residual in a segment hardly exceeds what noise of its size there would give. The noise is
/// that between neighbouring samples, half of which are taken to be independent.
pub(super) fn is_local_noise(rest: &SearchedResidual, segment: &DriveSegment) -> bool {
    let values = &rest.values[segment.start..segment.end];
    if values.len() < 4 {
        return true;
    }
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares = values.windows(2).map(|pair| (pair[1] - pair[0]).powi(2));
    let variance = 0.5 * squares.sum::<f64>() / (n - 1.0);
    let deviation = (2.0 * variance / n).sqrt();
    mean * segment.force.signum() < LOCAL_NOISE_LEAST_DEVIATIONS * deviation
}

/// Whether dry friction may be the cause of a segment: it begins, ends or lies at a switch of friction, and is smaller
/// than the friction of its drive, or it is short and lies about a reversal. Then another drive must confirm it.
pub(super) fn may_be_friction(trace: &ResidualTrace, rest: &SearchedResidual, segment: &DriveSegment) -> bool {
    let near = trace.sample_count(SWITCH_NEAR_S, 1);
    let about = segment.start.saturating_sub(near)..(segment.end + near).min(trace.samples());
    // About a reversal a drive may stick.
    let rate = &trace.motion[1][rest.drive];
    let last = segment.end.min(trace.samples()) - 1;
    let lasted = trace.time[last] - trace.time[segment.start];
    let friction = dry_friction(trace, rest);
    let is_about_reversal = rate[segment.start] * rate[last] < 0.0 && lasted < STICK_LONGEST_S;
    if is_about_reversal && segment.force.abs() < STICK_MOST_FRICTIONS * friction {
        return true;
    }
    let has_switch = |at: usize| {
        let about = at.saturating_sub(near)..(at + near).min(trace.samples());
        rest.is_masked[about].contains(&true)
    };
    let is_between_switches = has_switch(segment.start) || has_switch(segment.end);
    let is_short = lasted < STICK_LONGEST_S && rest.is_masked[about].contains(&true);
    (is_between_switches || is_short) && segment.force.abs() < SWITCH_FRICTION_SHARE * friction
}

/// Whether an error of the time stamps explains a segment: the force changes so fast there that a shift by half a sample
/// gives an error of this size. Then another drive must confirm it.
pub(super) fn may_be_time_error(trace: &ResidualTrace, segment: &DriveSegment) -> bool {
    let fitted = trace.fitted_force(segment.drive);
    let last = segment.end.min(trace.samples()) - 1;
    let steps = (segment.start..last).map(|i| (fitted[i + 1] - fitted[i]).abs());
    let rate = trace.sample_rate();
    let slope = rate * steps.sum::<f64>() / (last - segment.start).max(1) as f64;
    segment.force.abs() < slope * (0.5 / rate).min(TIME_ERROR_MOST_S)
}

/// How much the residual changes at the start and at the end of a segment, in units of its force (1): 1 for a push that
/// begins and ends at once, less for an error that comes and goes with the motion. The smaller one of both.
pub(super) fn edge_contrast(trace: &ResidualTrace, rest: &SearchedResidual, segment: &DriveSegment) -> f64 {
    let signed = |at: usize| isize::try_from(at).unwrap_or(isize::MAX);
    let rise = signed(trace.sample_count(EDGE_RISE_S, 1));
    let window = signed(trace.sample_count(EDGE_LEVEL_S, 2));
    let (start, end) = (signed(segment.start), signed(segment.end));
    let sign = segment.force.signum();
    // Brief segments have no room for both windows.
    let (inner_rise, inner) = (rise.min((end - start) / 4), window.min((end - start) / 2).max(1));
    let level = |from: isize, to: isize| sign * range_median(&rest.smooth, from, to).unwrap_or(0.0);
    let first = level(start + inner_rise, start + inner_rise + inner) - level(start - rise - window, start - rise);
    let last = level(end - inner_rise - inner, end - inner_rise) - level(end + rise, end + rise + window);
    let within = rest.smooth[segment.start..segment.end].iter().map(|x| sign * x);
    first.min(last) / sample_quantile(within.collect(), 0.8).max(segment.force.abs())
}

/// The dry friction of a drive: half of the median jump of its fitted force where the rate changes its sign between two
/// samples, N or N m; 0 without reversals.
fn dry_friction(trace: &ResidualTrace, rest: &SearchedResidual) -> f64 {
    let (fitted, rate) = (trace.fitted_force(rest.drive), &trace.motion[1][rest.drive]);
    let reversals = (1..rate.len()).filter(|i| rate[i - 1] * rate[*i] < 0.0);
    let jumps = reversals.map(|i| 0.5 * (fitted[i] - fitted[i - 1]).abs());
    sample_quantile(jumps.collect(), 0.5)
}
