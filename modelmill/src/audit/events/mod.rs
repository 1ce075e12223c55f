//! Contacts and pushes: intervals of time in which forces act that no parameters explain. A segment of a recording
//! goes in, its events with times, drives and sizes come out.
//!
//! 1. `fit`: the residual of a robust fit with friction of every drive; a second look has the residual of a diagnosis.
//! 2. `regimes`: where a drive moves, where it stands, and where its residual shows no contact.
//! 3. `levels`: the residual of each drive in units of its own level, without what a delay explains.
//! 4. `segments`, `steps`: segments of one drive that stand out, in motion and at standstill.
//! 5. `doubts`, `similar_states`: drop noise that is large for a while, friction that switches, and what repeats at
//!    similar states, which is a law that the model lacks.
//! 6. `grouping`, `peak`: joins the drives, each with its largest force.
//!
//! Decision: an event has a start and an end within the run. What lasts until the end is a change of the machine, such
//! as a payload.

mod doubts;
mod fit;
mod grouping;
mod levels;
mod notes;
mod peak;
mod regimes;
mod rows;
mod search;
mod segments;
mod similar_states;
mod smoothing;
mod steps;
#[cfg(test)]
mod tests;
mod trace;

use crate::model::Model;
use crate::segment::RecordingSegment;

pub(super) use notes::event_notes;
pub(crate) use notes::{event_disturbance, leave_out_events, left_out_interval};
pub(crate) use rows::{motion_of_drives, slowest_rate, standing_states};
pub(crate) use search::find_events;
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
    rows::residual_trace(model, data).map_or_else(Vec::new, |trace| find_events(&trace))
}
