//! The search in a residual: segments of each drive, doubts about them, and events of all drives.

use super::levels::SearchedResidual;
use super::segments::DriveSegment;
use super::similar_states::{ScaledStates, StateComparison};
use super::smoothing::true_share;
use super::trace::ResidualTrace;
use super::{ContactEvent, doubts, grouping, regimes, segments, similar_states, steps};
use crate::audit::thresholds::{
    EVENT_LONGEST_MASKED_SHARE, EVENTS_MOST_DURATION_SHARE, SHORTEST_EVENT_S, SUDDEN_LEAST_DEVIATIONS,
};

/// The events in a residual, in the order of time; none if they are so long that they are no exception.
pub(crate) fn find_events(trace: &ResidualTrace) -> Vec<ContactEvent> {
    let regimes = regimes::drive_regimes(trace).into_iter().enumerate();
    let rests: Vec<SearchedResidual> = regimes
        .map(|(d, regimes)| SearchedResidual::new(trace, d, regimes))
        .collect();
    let mut accepted = Vec::new();
    for rest in &rests {
        let states = ScaledStates::new(trace, rest.drive);
        let moving = segments::segments_in_motion(trace, rest).into_iter();
        accepted.extend(moving.filter_map(|segment| accept_segment(trace, rest, &states, segment)));
        accepted.extend(steps::pushes_at_standstill(trace, rest));
    }
    let events = grouping::join_segments(trace, &rests, accepted);
    let lasted: f64 = events.iter().map(|event| event.to - event.from).sum();
    let duration = trace.time[trace.samples() - 1] - trace.time[0];
    if lasted < EVENTS_MOST_DURATION_SHARE * duration {
        events
    } else {
        Vec::new()
    }
}

/// The segment, if it may be a contact; it then knows whether similar states confirm it.
fn accept_segment(
    trace: &ResidualTrace,
    rest: &SearchedResidual,
    states: &ScaledStates,
    mut segment: DriveSegment,
) -> Option<DriveSegment> {
    let is_strong = segment.deviations > SUDDEN_LEAST_DEVIATIONS;
    let masked = &rest.is_masked[segment.start..segment.end];
    let shown = masked.iter().filter(|masked| !**masked).count();
    // An event has a start and an end, and enough samples that show it. Samples are counted: a duration computed from
    // their number may fall short of the limit by rounding.
    let shortest = trace.sample_count(SHORTEST_EVENT_S, 1);
    let lasts = masked.len() >= shortest && (is_strong || shown >= shortest);
    let is_within = segment.start > 2 && segment.end + 2 < trace.samples();
    if !lasts || !is_within || true_share(masked) > EVENT_LONGEST_MASKED_SHARE[usize::from(is_strong)] {
        return None;
    }
    if doubts::is_local_noise(rest, &segment) {
        return None;
    }
    segment.masked_share = true_share(masked);
    segment.edge_contrast = doubts::edge_contrast(trace, rest, &segment);
    let may_be_friction = doubts::may_be_friction(trace, rest, &segment) && !segment.is_sharp();
    segment.needs_support = may_be_friction || doubts::may_be_time_error(trace, &segment);
    let comparison = similar_states::compare_with_similar_states(trace, rest, states, &segment);
    segment.is_confirmed = comparison == StateComparison::Alone;
    match comparison {
        StateComparison::Alone => Some(segment),
        StateComparison::Sudden if is_strong => Some(segment),
        StateComparison::Sudden | StateComparison::Incomparable | StateComparison::Repeats => None,
    }
}
