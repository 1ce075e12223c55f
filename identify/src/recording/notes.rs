//! What a user should know about the data although it is no error: notes that go to the
//! terminal and into the JSON (`"data": [{"severity", "says"}]`).

use serde::{Deserialize, Serialize};

/// How much a [`Note`] matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum NoteSeverity {
    /// Said for the record: a choice that was made, a column that was prepared.
    Info,
    /// Likely to harm the result; worth a look before trusting it.
    Warning,
}

/// One remark about a recording or its preparation.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RecordingNote {
    /// How much it matters.
    pub severity: NoteSeverity,
    /// One or two full sentences.
    pub says: String,
}

impl RecordingNote {
    /// A remark for the record.
    pub fn info(says: impl Into<String>) -> Self {
        Self {
            severity: NoteSeverity::Info,
            says: says.into(),
        }
    }

    /// A remark that asks for attention.
    pub fn warning(says: impl Into<String>) -> Self {
        Self {
            severity: NoteSeverity::Warning,
            says: says.into(),
        }
    }
}
