//! Joins the segments of all drives to events. A push acts on several drives at once through the mechanism, so that
//! drives that agree in time support each other.

use super::ContactEvent;
use super::levels::SearchedResidual;
use super::peak::largest_force;
use super::segments::DriveSegment;
use super::trace::ResidualTrace;
use crate::audit::thresholds::{
    ALONE_LEAST_DEVIATIONS, ALONE_LEAST_FORCE_SHARE, ALONE_MOST_MASKED_SHARE, BRIEF_EVENT_S, BRIEF_LEAST_DEVIATIONS,
    BRIEF_LEAST_FORCE_SHARE, EVENT_GAP_S, EVENT_LEAST_POWER, FAINT_HIT_MOST_DEVIATIONS, FAINT_LEAST_CONTRAST,
    FAINT_MOST_DEVIATIONS, FAINT_SHORT_LEAST_DEVIATIONS, FAINT_SHORTEST_S, GROUP_CLEAR_DEVIATIONS,
    GROUP_LEAST_CONTRAST, GROUP_LEAST_DEVIATION_SHARE, GROUP_LEAST_OVERLAP, GROUP_TIME_SHARE, GROUP_TIME_TOLERANCE_S,
    HIDDEN_LEAST_DEVIATIONS, MOST_COUNTED_DEVIATIONS, SHARP_LEAST_DEVIATIONS, SHOWN_LEAST_DEVIATION_SHARE,
};

/// Events from the accepted segments, in the order of time.
pub(super) fn join_segments(
    trace: &ResidualTrace,
    rests: &[SearchedResidual],
    mut segments: Vec<DriveSegment>,
) -> Vec<ContactEvent> {
    segments.sort_by_key(|segment| (segment.start, segment.end));
    let time = |at: usize| trace.time[at.min(trace.samples() - 1)];
    // Segments that overlap belong together.
    let mut groups: Vec<Vec<DriveSegment>> = Vec::new();
    let mut latest = f64::NEG_INFINITY;
    for segment in segments {
        let (from, to) = (time(segment.start), time(segment.end));
        match groups.last_mut() {
            Some(group) if from < latest + EVENT_GAP_S => group.push(segment),
            _ => groups.push(vec![segment]),
        }
        latest = latest.max(to);
    }
    groups
        .into_iter()
        .flat_map(|group| group_events(rests, group, time))
        .collect()
}

/// The events of a group of segments that overlap: that of the strongest segment, then those of what is apart from it.
fn group_events(
    rests: &[SearchedResidual],
    mut group: Vec<DriveSegment>,
    time: impl Fn(usize) -> f64 + Copy,
) -> Vec<ContactEvent> {
    let mut events: Vec<ContactEvent> = Vec::new();
    let strongest_of = |group: &[DriveSegment]| {
        let all = group.iter().enumerate();
        let strongest = all.max_by(|(_, a), (_, b)| a.deviations.total_cmp(&b.deviations));
        strongest.map(|(at, _)| at)
    };
    while let Some(at) = strongest_of(&group) {
        let strongest = group.remove(at);
        let agrees = |one: &DriveSegment| is_same_event(&strongest, one, time);
        let (mut agreeing, others): (Vec<_>, Vec<_>) = group.into_iter().partition(agrees);
        agreeing.push(strongest.clone());
        group = others;
        if let Some(event) = joined_event(rests, &strongest, &agreeing, time) {
            let is_apart = |one: &DriveSegment| time(one.start) > event.to || time(one.end) < event.from;
            group.retain(is_apart);
            events.push(event);
        }
    }
    events.sort_by(|a, b| a.from.total_cmp(&b.from));
    events
}

/// Whether a segment belongs to the event of the strongest one: it has the same times, or is about as strong and they
/// overlap for most of the shorter one.
fn is_same_event(strongest: &DriveSegment, one: &DriveSegment, time: impl Fn(usize) -> f64) -> bool {
    let [a, b] = [time(one.start), time(one.end)];
    let [from, to] = [time(strongest.start), time(strongest.end)];
    let tolerance = GROUP_TIME_TOLERANCE_S + GROUP_TIME_SHARE * (to - from);
    let is_clear = one.deviations > GROUP_CLEAR_DEVIATIONS && one.edge_contrast > FAINT_LEAST_CONTRAST;
    let is_strong = is_clear || one.deviations > GROUP_LEAST_DEVIATION_SHARE * strongest.deviations;
    let has_same_times = (a - from).abs() < tolerance && (b - to).abs() < tolerance;
    let overlap = b.min(to) - a.max(from);
    let overlaps = one.deviations > GROUP_CLEAR_DEVIATIONS && overlap > GROUP_LEAST_OVERLAP * (b - a).min(to - from);
    is_strong && (has_same_times || overlaps && !one.needs_support)
}

/// Whether a segment of one drive is an event without the support of others. Where it is brief, hardly stands out, or is
/// hidden for a large part, errors of the model look alike.
fn is_clear_alone(rest: &SearchedResidual, segment: &DriveSegment, lasted: f64) -> bool {
    if segment.is_at_standstill {
        return true;
    }
    let is_large =
        segment.deviations > BRIEF_LEAST_DEVIATIONS && segment.force.abs() > BRIEF_LEAST_FORCE_SHARE * rest.force_rms;
    let is_large_enough = segment.force.abs() > ALONE_LEAST_FORCE_SHARE * rest.force_rms;
    let is_shown = segment.masked_share < ALONE_MOST_MASKED_SHARE || segment.deviations > HIDDEN_LEAST_DEVIATIONS;
    let is_short = lasted < FAINT_SHORTEST_S && segment.deviations < FAINT_SHORT_LEAST_DEVIATIONS;
    let is_sharp = segment.deviations > FAINT_MOST_DEVIATIONS || segment.edge_contrast > FAINT_LEAST_CONTRAST;
    let stands_out = segment.deviations > ALONE_LEAST_DEVIATIONS;
    is_large || (lasted >= BRIEF_EVENT_S && is_shown && is_sharp && is_large_enough && stands_out && !is_short)
}

/// The event of segments that agree; `None` if it does not stand out enough.
fn joined_event(
    rests: &[SearchedResidual],
    strongest: &DriveSegment,
    agreeing: &[DriveSegment],
    time: impl Fn(usize) -> f64,
) -> Option<ContactEvent> {
    // At least one drive must show the event itself; several that stand out clearly support each other.
    let clear = agreeing.iter().filter(|one| one.deviations > GROUP_CLEAR_DEVIATIONS);
    let (contrast, least) = if clear.clone().any(|one| one.drive != strongest.drive) {
        (GROUP_LEAST_CONTRAST, GROUP_CLEAR_DEVIATIONS)
    } else {
        (FAINT_LEAST_CONTRAST, SHARP_LEAST_DEVIATIONS)
    };
    let shows = |one: &DriveSegment| {
        let is_strong = one.deviations > least.min(SHOWN_LEAST_DEVIATION_SHARE * strongest.deviations);
        let is_sudden = one.edge_contrast > contrast || one.deviations > FAINT_MOST_DEVIATIONS;
        is_strong && is_sudden && !one.needs_support
    };
    if !agreeing.iter().any(shows) {
        return None;
    }
    let times = |one: &DriveSegment| [time(one.start), time(one.end)];
    let [from, to] = times(strongest);
    let is_single = agreeing.iter().all(|one| one.drive == strongest.drive);
    if is_single && !is_clear_alone(&rests[strongest.drive], strongest, to - from) {
        return None;
    }
    let is_faint_hit = to - from < BRIEF_EVENT_S && strongest.deviations < FAINT_HIT_MOST_DEVIATIONS;
    if is_faint_hit {
        return None;
    }
    let squares = agreeing
        .iter()
        .map(|one| one.deviations.min(MOST_COUNTED_DEVIATIONS).powi(2));
    if squares.sum::<f64>().sqrt() < EVENT_LEAST_POWER {
        return None;
    }
    let mut drives: Vec<(usize, f64, f64)> = Vec::new();
    let step = time(1) - time(0);
    for one in agreeing {
        let rest = &rests[one.drive];
        let largest = largest_force(rest, one, step);
        match drives.iter_mut().find(|(d, ..)| *d == one.drive) {
            Some((_, most, _)) => *most = most.max(largest),
            None => drives.push((one.drive, largest, one.force.abs() / one.deviations)),
        }
    }
    drives.sort_by_key(|(d, ..)| *d);
    Some(ContactEvent {
        is_confirmed: drives.len() > 1 || agreeing.iter().any(|one| one.is_confirmed),
        from: agreeing.iter().map(|one| times(one)[0]).fold(from, f64::min),
        to: agreeing.iter().map(|one| times(one)[1]).fold(to, f64::max),
        drives,
    })
}
