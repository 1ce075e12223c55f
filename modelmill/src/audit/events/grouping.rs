//! Joins the segments of all drives to events. A push acts on several drives at once through the mechanism, so that
//! drives that agree in time support each other.

use super::ContactEvent;
use super::levels::DriveResidual;
use super::segments::DriveSegment;
use super::trace::ResidualTrace;
use crate::audit::thresholds::{
    BRIEF_EVENT_S, BRIEF_LEAST_DEVIATIONS, BRIEF_LEAST_FORCE_SHARE, EVENT_GAP_S, EVENT_LEAST_POWER,
    GROUP_LEAST_DEVIATION_SHARE, GROUP_TIME_SHARE, GROUP_TIME_TOLERANCE_S, MOST_COUNTED_DEVIATIONS,
};

/// Events from the accepted segments, in the order of time.
pub(super) fn join_segments(
    trace: &ResidualTrace,
    rests: &[DriveResidual],
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
        .iter()
        .filter_map(|group| group_event(rests, group, time))
        .collect()
}

/// The event of a group; `None` if it does not stand out enough. The drives that agree in time with the strongest one
/// decide.
fn group_event(rests: &[DriveResidual], group: &[DriveSegment], time: impl Fn(usize) -> f64) -> Option<ContactEvent> {
    let strongest = group.iter().max_by(|a, b| a.deviations.total_cmp(&b.deviations))?;
    let times = |one: &DriveSegment| [time(one.start), time(one.end)];
    let [from, to] = times(strongest);
    let tolerance = GROUP_TIME_TOLERANCE_S + GROUP_TIME_SHARE * (to - from);
    let agreeing: Vec<&DriveSegment> = group
        .iter()
        .filter(|one| {
            let [a, b] = times(one);
            let is_strong = one.deviations > GROUP_LEAST_DEVIATION_SHARE * strongest.deviations;
            is_strong && (a - from).abs() < tolerance && (b - to).abs() < tolerance
        })
        .collect();
    if agreeing.iter().all(|one| one.needs_support) {
        return None;
    }
    let is_single = agreeing.iter().all(|one| one.drive == strongest.drive);
    let is_clear = (strongest.is_at_standstill || strongest.deviations > BRIEF_LEAST_DEVIATIONS)
        && strongest.force.abs() > BRIEF_LEAST_FORCE_SHARE * rests[strongest.drive].force_rms;
    let is_brief = to - from < BRIEF_EVENT_S;
    if is_single && is_brief && !is_clear {
        return None;
    }
    let squares = agreeing
        .iter()
        .map(|one| one.deviations.min(MOST_COUNTED_DEVIATIONS).powi(2));
    if squares.sum::<f64>().sqrt() < EVENT_LEAST_POWER {
        return None;
    }
    let mut drives: Vec<(usize, f64, f64)> = Vec::new();
    for one in &agreeing {
        let rest = &rests[one.drive];
        let largest = if one.is_at_standstill {
            one.force.abs()
        } else {
            let values = rest.short.values[one.start..one.end].iter();
            values.fold(0.0, |most: f64, x| most.max(x.abs()))
        };
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
