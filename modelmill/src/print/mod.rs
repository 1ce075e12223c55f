//! Printers of results: JSON objects for scripts, text for people. Each prints a value of the library; none looks anything up.

mod changes;
mod comparison;
mod contents;
pub mod edit;
pub mod effects;
mod estimation;
mod excitation;
mod findings;
mod identification;
mod interpretation;
pub(crate) mod laws;
mod next_step;
mod reduction;
mod runs;
mod spelling;
mod summary;
pub mod tables;
mod variants;

use modelmill_identify::RecordingNote;
use serde_json::Value;

pub use spelling::{
    CommandName, LibrarySpelling, Message, OptionName, OptionSetting, Remedy, RemedySpelling,
    StepSpelling,
};
pub use summary::{faults, refusal, warnings};

/// Remarks as JSON.
pub(crate) fn notes(notes: &[RecordingNote], spelling: &dyn RemedySpelling) -> Value {
    notes.iter().map(|note| note.json(spelling)).collect()
}
