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
mod summary;
pub mod tables;
mod variants;
mod verification;
mod wording;

use modelmill_identify::RecordingNote;
use serde_json::Value;

use crate::answers::NoteAnswer;

pub(crate) use findings::values_text;
pub use summary::{faults, refusal, warnings};
pub use verification::{VERIFICATION_SCHEMA, VerificationContext};
pub use wording::{CommandName, Message, OptionName, OptionSetting, Remedy, RemedyWording, RustWording, StepWording};

/// Notes of an answer.
pub(crate) fn note_answers(notes: &[RecordingNote], wording: &dyn RemedyWording) -> Vec<NoteAnswer> {
    let answer = |note: &RecordingNote| NoteAnswer {
        severity: note.severity,
        says: note.says.format_for(wording),
    };
    notes.iter().map(answer).collect()
}

/// Notes as JSON.
pub(crate) fn notes(notes: &[RecordingNote], wording: &dyn RemedyWording) -> Value {
    notes.iter().map(|note| note.json(wording)).collect()
}
