//! What a user should know about the data although it is no error: notes that go to the
//! terminal and into the JSON (`"data": [{"severity", "says"}]`).

use modelmill_boundary::text::{Message, RemedySpelling};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// How much a [`RecordingNote`] matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum NoteSeverity {
    /// Said for the record: a choice that was made, a column that was prepared.
    Info,
    /// Likely to harm the result; worth a look before trusting it.
    Warning,
}

/// One remark about a recording or its preparation.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordingNote {
    /// How much it matters.
    pub severity: NoteSeverity,
    /// One or two full sentences.
    pub says: Message,
}

/// A remark as it stands in JSON, in the words of whoever reads it.
#[derive(Serialize, Deserialize)]
struct SpelledNote {
    severity: NoteSeverity,
    says: String,
}

impl RecordingNote {
    /// A remark for the record.
    pub fn info(says: impl Into<Message>) -> Self {
        Self {
            severity: NoteSeverity::Info,
            says: says.into(),
        }
    }

    /// A remark that asks for attention.
    pub fn warning(says: impl Into<Message>) -> Self {
        Self {
            severity: NoteSeverity::Warning,
            says: says.into(),
        }
    }

    /// The remark as JSON, in the words of whoever reads it.
    pub fn json(&self, spelling: &dyn RemedySpelling) -> serde_json::Value {
        serde_json::json!({ "severity": self.severity, "says": self.says.spell(spelling) })
    }
}

/// Writes remarks in the words of the library, which is how a fit keeps them that no front end has printed.
pub(crate) fn serialize<S: Serializer>(
    notes: &[RecordingNote],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(notes.iter().map(|note| SpelledNote {
        severity: note.severity,
        says: note.says.in_library_words(),
    }))
}

/// Reads remarks, whose words are plain text then.
pub(crate) fn deserialize<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Vec<RecordingNote>, D::Error> {
    let notes = Vec::<SpelledNote>::deserialize(deserializer)?.into_iter();
    let note = |one: SpelledNote| RecordingNote {
        severity: one.severity,
        says: one.says.into(),
    };
    Ok(notes.map(note).collect())
}
