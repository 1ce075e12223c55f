//! Contacts and pushes: intervals of time in which forces act that no parameters explain. A segment of a recording
//! goes in, its events with times, drives and sizes come out.
//!
//! 1. `fit`: the residual of a robust fit with friction of every drive; a second look has the residual of a diagnosis.
//! 2. `regimes`: where a drive moves, where it stands, and where its residual shows no contact.
//! 3. `levels`: the residual of each drive in units of its own level, without what a delay explains.
//! 4. `segments`, `steps`: segments of one drive that stand out, in motion and at standstill.
//! 5. `doubts`, `similar_states`: drop noise that is large for a while, friction that switches, and what repeats at
//!    similar states, which is a law that the model lacks.
//! 6. `grouping`: joins the drives.
//!
//! Decision: an event has a start and an end within the run. What lasts until the end is a change of the machine, such
//! as a payload.

mod doubts;
mod fit;
mod grouping;
mod levels;
mod notes;
mod regimes;
mod segments;
mod similar_states;
mod smoothing;
mod steps;
#[cfg(test)]
mod tests;
mod trace;

use super::thresholds::{
    EVENT_LONGEST_MASKED_SHARE, EVENTS_MOST_DURATION_SHARE, SHORTEST_EVENT_S, SUDDEN_LEAST_DEVIATIONS,
};
use crate::model::Model;
use crate::segment::RecordingSegment;
use levels::DriveResidual;
use segments::DriveSegment;
use similar_states::{ScaledStates, StateComparison};
use smoothing::true_share;

pub(crate) use fit::slowest_rate;
pub(super) use notes::event_notes;
pub(crate) use notes::{event_disturbance, leave_out_events};
pub(crate) use trace::ResidualTrace;

/// An interval of time in which forces act that no parameters explain.
#[derive(Clone, Debug)]
pub(crate) struct ContactEvent {
    /// Start of the interval, s.
    pub(crate) from: f64,
    /// End of the interval, s.
    pub(crate) to: f64,
    /// The drives on which it acts, each with the largest unexplained force and the usual one, N or N m.
    pub(crate) drives: Vec<(usize, f64, f64)>,
    /// Whether similar states without the force, or other drives, confirm it. If not, it is a possible contact.
    pub(crate) is_confirmed: bool,
}

/// The events of a segment, in the order of time; none if there are too few samples or no fit.
pub(crate) fn events(model: &Model, data: &RecordingSegment) -> Vec<ContactEvent> {
    fit::residual_trace(model, data).map_or_else(Vec::new, |trace| find_events(&trace))
}

/// The events in a residual, in the order of time; none if they are so long that they are no exception.
pub(crate) fn find_events(trace: &ResidualTrace) -> Vec<ContactEvent> {
    let regimes = regimes::drive_regimes(trace).into_iter().enumerate();
    let rests: Vec<DriveResidual> = regimes
        .map(|(d, regimes)| DriveResidual::new(trace, d, regimes))
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
    rest: &DriveResidual,
    states: &ScaledStates,
    mut segment: DriveSegment,
) -> Option<DriveSegment> {
    let is_strong = segment.deviations > SUDDEN_LEAST_DEVIATIONS;
    let masked = &rest.is_masked[segment.start..segment.end];
    let time = |samples: usize| samples as f64 / trace.sample_rate();
    let shown = masked.iter().filter(|masked| !**masked).count();
    // An event has a start and an end, and enough samples that show it.
    let lasts = time(masked.len()) >= SHORTEST_EVENT_S && (is_strong || time(shown) >= SHORTEST_EVENT_S);
    let is_within = segment.start > 2 && segment.end + 2 < trace.samples();
    if !lasts || !is_within || true_share(masked) > EVENT_LONGEST_MASKED_SHARE[usize::from(is_strong)] {
        return None;
    }
    if doubts::is_local_noise(rest, &segment) {
        return None;
    }
    segment.needs_support = doubts::may_be_friction(trace, rest, &segment);
    let comparison = similar_states::compare_with_similar_states(trace, rest, states, &segment);
    segment.is_confirmed = comparison == StateComparison::Alone;
    match comparison {
        StateComparison::Alone => Some(segment),
        StateComparison::Sudden if is_strong => Some(segment),
        StateComparison::Sudden | StateComparison::Incomparable | StateComparison::Repeats => None,
    }
}
