//! What is reported of events: notes for the user, disturbances for the diagnosis, and excluded forces.

use std::ops::Range;

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, Remedy};
use modelmill_identify::RecordingNote;
use modelmill_identify::diagnose::{Disturbance, EstimatedQuantity};

use super::{ContactEvent, events};
use crate::audit::thresholds::{EVENT_LEAST_MARGIN_S, EVENT_MARGIN_SHARE};
use crate::model::Model;
use crate::segment::RecordingSegment;
use crate::text::table::significant;

/// Notes on the events of a segment. With `leave_out`, their forces are excluded.
pub(in crate::audit) fn event_notes(model: &Model, data: &mut RecordingSegment, leave_out: bool) -> Vec<RecordingNote> {
    let events = events(model, data);
    let notes = events
        .iter()
        .map(|event| event_note(model, &data.run.file, event, leave_out));
    let notes = notes.collect();
    // Possible contacts are no facts, so that a diagnosis decides for itself.
    let confirmed = events.iter().filter(|event| event.is_confirmed);
    let faults: Vec<Disturbance> = confirmed
        .map(|event| event_disturbance(model, &data.run.file, event))
        .collect();
    data.faults.extend(faults);
    if leave_out {
        leave_out_events(data, &events);
    }
    notes
}

/// The note on an event: a warning, or a hint if it is only possible.
fn event_note(model: &Model, file: &str, event: &ContactEvent, leave_out: bool) -> RecordingNote {
    let names = model.row_names();
    let drives: Vec<String> = event
        .drives
        .iter()
        .map(|(d, largest, usual)| {
            format!(
                "`{}` by up to {} {} where {} is usual",
                names[*d],
                significant(*largest, 3),
                model.force_unit(*d),
                significant(*usual, 2)
            )
        })
        .collect();
    let option = Remedy::option(OptionName::LeaveOutEvents);
    let [from, to] = [event.from, event.to].map(|time| significant(time, 5));
    let drives = drives.join(" and ");
    let todo = if leave_out {
        message!(". They are left out of fits and error figures ({}).", option)
    } else {
        message!("; {} leaves them out of fits and error figures.", option)
    };
    if event.is_confirmed {
        RecordingNote::warning(message!(
            "From {from} to {to} s of {file} there are forces that no parameters explain, {drives}, as in a contact or a push{}",
            todo
        ))
    } else {
        RecordingNote::info(message!(
            "A possible contact from {from} to {to} s of {file}: forces that no parameters explain begin and end suddenly, {drives}. \
             No other sample has a similar state, so that the model may be the cause as well{}",
            todo
        ))
    }
}

/// An event as a disturbance for the diagnosis.
pub(crate) fn event_disturbance(model: &Model, file: &str, event: &ContactEvent) -> Disturbance {
    let names = model.row_names();
    let drives = event.drives.iter();
    Disturbance {
        kind: "contact_event".to_owned(),
        at: drives.clone().map(|(d, _, _)| names[*d].clone()).collect(),
        estimates: drives
            .map(|(d, largest, _)| EstimatedQuantity::new("largest", *largest, model.force_unit(*d)))
            .collect(),
        recordings: vec![file.to_owned()],
        interval: Some([event.from, event.to]),
        description: None,
    }
}

/// The interval that is left out for an event that lasts between two times, s: with a margin, wherever events are left
/// out.
pub(crate) fn left_out_interval([from, to]: [f64; 2]) -> [f64; 2] {
    let margin = EVENT_LEAST_MARGIN_S.max(EVENT_MARGIN_SHARE * (to - from));
    [from - margin, to + margin]
}

/// Excludes the forces of all drives during events. Their values are replaced by a line between the samples around: they
/// count nowhere, but a filter of all forces would carry the real ones into the samples around.
pub(crate) fn leave_out_events(data: &mut RecordingSegment, events: &[ContactEvent]) {
    if events.is_empty() {
        return;
    }
    let run = &mut data.run;
    if run.left_out.is_empty() {
        let drives = run.force.as_ref().map_or(0, Vec::len);
        run.left_out = vec![vec![false; run.time.len()]; drives];
    }
    for event in events {
        let [from, to] = left_out_interval([event.from, event.to]);
        let start = run.time.partition_point(|time| *time < from);
        let end = run.time.partition_point(|time| *time <= to);
        for out in &mut run.left_out {
            out[start..end].fill(true);
        }
        for force in run.force.iter_mut().flatten() {
            bridge(force, start..end);
        }
    }
}

/// Replaces some values by a line between their neighbours; at an end by the only neighbour.
fn bridge(values: &mut [f64], gap: Range<usize>) {
    let before = gap.start.checked_sub(1).map(|i| values[i]);
    let after = values.get(gap.end).copied();
    let (Some(before), Some(after)) = (before.or(after), after.or(before)) else {
        return;
    };
    let steps = gap.len() as f64 + 1.0;
    for (k, value) in values[gap].iter_mut().enumerate() {
        *value = before + (k as f64 + 1.0) / steps * (after - before);
    }
}
