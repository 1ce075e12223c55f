//! What became of the model with the effects that a diagnosis found.

use modelmill_boundary::text::Message;

use super::ModelVersion;
use crate::error::Outcome;

/// The model with the effects that a diagnosis found, or the reason why there is none.
#[expect(clippy::large_enum_variant, reason = "there is one for each diagnosis")]
pub enum ModelCompletion {
    /// No effect was found that a model file can contain, or a suspected mistake could not be corrected.
    NothingToAdd,
    /// The model with the effects, identified from the same recordings.
    Added(ModelVersion),
    /// The effects contradict the model file, or the model with them cannot be identified.
    Refused(Message),
}

impl ModelCompletion {
    /// The model with the effects, if there is one.
    pub fn version(&self) -> Option<&ModelVersion> {
        match self {
            Self::Added(version) => Some(version),
            Self::NothingToAdd | Self::Refused(_) => None,
        }
    }

    /// Why there is none although effects were found.
    pub fn refusal(&self) -> Option<&Message> {
        match self {
            Self::Refused(reason) => Some(reason),
            Self::NothingToAdd | Self::Added(_) => None,
        }
    }
}

impl From<Outcome<ModelVersion>> for ModelCompletion {
    fn from(outcome: Outcome<ModelVersion>) -> Self {
        match outcome {
            Ok(version) => Self::Added(version),
            Err(error) => Self::Refused(error.message()),
        }
    }
}
