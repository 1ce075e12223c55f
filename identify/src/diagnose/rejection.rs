//! Why a candidate was rejected: one list, whose names are values of the JSON and whose sentences printers write.

use serde::{Serialize, Serializer};

/// The reason for which a candidate was rejected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RejectionReason {
    /// A parameter would have a sign that is physically impossible.
    WrongSign,
    /// It would only cancel another effect at its place.
    CancelsAnother,
    /// A value is beyond what the machine's size and forces allow.
    ImplausibleValue,
    /// It is less likely than not, and reported as possible.
    LessLikelyThanNot,
    /// Another candidate explains more.
    ExplainedBetter,
    /// It explains almost nothing of the residual.
    ExplainsNothing,
    /// The residual is only noise or rounding.
    OnlyNoiseRemains,
    /// The error does not fall on the validation run.
    NotConfirmedByValidation,
    /// The error does not fall in cross-validation.
    NotConfirmedByFolds,
    /// The gain is below the least that counts.
    GainTooSmall,
    /// The gain does not pay for the number of parameters.
    TooManyParameters,
    /// Its columns depend linearly on those of the model.
    LinearlyDependent,
    /// Its formula has no finite value at some samples.
    NotFinite,
}

impl RejectionReason {
    /// The value of `refused` in the JSON of `diagnose`. These values are fixed, because programs of users compare
    /// them.
    pub fn name(self) -> &'static str {
        match self {
            Self::WrongSign => "sign",
            Self::CancelsAnother => "it would only cancel another effect at its place",
            Self::ImplausibleValue => "implausible value",
            Self::LessLikelyThanNot => "less likely than not",
            Self::ExplainedBetter => "another explains more",
            Self::ExplainsNothing => "explains nothing that is left",
            Self::OnlyNoiseRemains => "what is left is rounding",
            Self::NotConfirmedByValidation => "not supported by the check",
            Self::NotConfirmedByFolds => "not supported by cross-validation",
            Self::GainTooSmall => "too small to matter",
            Self::TooManyParameters => "not worth its parameters",
            Self::LinearlyDependent => "the model says it already",
            Self::NotFinite => "no finite value somewhere along the recordings",
        }
    }
}

impl Serialize for RejectionReason {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}
