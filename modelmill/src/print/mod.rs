//! Output of results. Each module takes one value of the library and returns JSON for scripts and text for
//! people; none reads files or computes.

mod changes;
mod comparison;
mod contents;
pub mod edit;
pub mod effects;
mod estimation;
mod excitation;
mod findings;
mod forward;
mod geometry_alternatives;
mod identification;
mod interpretation;
pub(crate) mod laws;
mod next_step;
mod proposal;
#[cfg(feature = "import")]
mod reduction;
#[cfg(feature = "rig")]
mod rig_contents;
pub(crate) mod runs;
mod servo;
mod spelling;
mod summary;
pub mod tables;
mod variants;
mod verification;

use modelmill_identify::RecordingNote;
use serde_json::Value;

use crate::answers::NoteAnswer;

pub(crate) use findings::values_text;
pub use spelling::{
    CommandName, LibrarySpelling, Message, OptionName, OptionSetting, Remedy, RemedySpelling, StepSpelling,
};
pub use summary::{faults, refusal, warnings};
pub use verification::{VERIFICATION_SCHEMA, VerificationContext};

/// Notes of an answer.
pub(crate) fn note_answers(notes: &[RecordingNote], spelling: &dyn RemedySpelling) -> Vec<NoteAnswer> {
    let answer = |note: &RecordingNote| NoteAnswer {
        severity: note.severity,
        says: note.says.spell(spelling),
    };
    notes.iter().map(answer).collect()
}

/// Notes as JSON.
pub(crate) fn notes(notes: &[RecordingNote], spelling: &dyn RemedySpelling) -> Value {
    notes.iter().map(|note| note.json(spelling)).collect()
}
