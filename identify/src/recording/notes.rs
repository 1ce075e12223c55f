//! Notes: facts about the data that a user should know although they are not errors. They go to the terminal and into
//! the JSON (`"data": [{"severity", "says"}]`).

use modelmill_boundary::text::{Message, RemedyWording};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// How much a [`RecordingNote`] matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum NoteSeverity {
    /// For information: a choice that was made, a column that was prepared.
    Info,
    /// Likely to affect the result; check it before using the result.
    Warning,
}

/// One note about a model file, a recording or its preparation.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordingNote {
    /// How much it matters.
    pub severity: NoteSeverity,
    /// One or two complete sentences.
    pub says: Message,
}

/// A note in JSON, with remedies already written out.
#[derive(Serialize, Deserialize)]
struct FormattedNote {
    /// As in [`RecordingNote`].
    severity: NoteSeverity,
    /// The text.
    says: String,
}

impl RecordingNote {
    /// A note for information.
    pub fn info(says: impl Into<Message>) -> Self {
        Self {
            severity: NoteSeverity::Info,
            says: says.into(),
        }
    }

    /// A note that the user should check.
    pub fn warning(says: impl Into<Message>) -> Self {
        Self {
            severity: NoteSeverity::Warning,
            says: says.into(),
        }
    }

    /// The note as JSON, with remedies written for the reader's front end.
    pub fn json(&self, wording: &dyn RemedyWording) -> serde_json::Value {
        serde_json::json!({ "severity": self.severity, "says": self.says.format_for(wording) })
    }
}

/// Writes notes with remedies written for the library. A fit that no front end has printed keeps them in this form.
pub(crate) fn serialize<S: Serializer>(notes: &[RecordingNote], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(notes.iter().map(|note| FormattedNote {
        severity: note.severity,
        says: note.says.in_library_words(),
    }))
}

/// Reads notes, whose texts are plain then.
pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<RecordingNote>, D::Error> {
    let notes = Vec::<FormattedNote>::deserialize(deserializer)?.into_iter();
    let note = |one: FormattedNote| RecordingNote {
        severity: one.severity,
        says: one.says.into(),
    };
    Ok(notes.map(note).collect())
}
