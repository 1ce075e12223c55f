//! Why a candidate was rejected: one list, whose names are values of the JSON and whose sentences printers write.

use serde::{Serialize, Serializer};

use super::CandidateOutcome;
use super::bench::{ScoredEffectSet, SelectedEffect};
use super::evidence::SelectionEvidence;

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
    /// Its gain is not confirmed in all parts of the data, such as far from reversals or in each half.
    NotConfirmedEverywhere,
    /// It explains almost nothing of the residual.
    ExplainsNothing,
    /// The residual is only noise or rounding.
    OnlyNoiseRemains,
    /// The error does not fall on the validation run.
    NotConfirmedByValidation,
    /// The error does not fall in cross-validation.
    NotConfirmedByFolds,
    /// The gain is below the minimum gain.
    GainTooSmall,
    /// The gain is too small for the number of parameters (Bayesian information criterion, BIC).
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
            Self::NotConfirmedEverywhere => "not confirmed in all parts of the data",
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

#[cfg(feature = "schema")]
impl schemars::JsonSchema for RejectionReason {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "RejectionReason".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({
            "description": "The reason for which a candidate was rejected, as a phrase.",
            "type": "string"
        })
    }
}

impl Serialize for RejectionReason {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// A candidate that was tested and rejected, with what shows the reason.
#[derive(Clone, Debug)]
pub(crate) struct RejectedCandidate {
    /// The candidate with its columns.
    pub(crate) pick: SelectedEffect,
    /// Evidence for it.
    pub(crate) evidence: SelectionEvidence,
    /// A reason other than the evidence; `None` if the evidence is not sufficient.
    pub(crate) other_reason: Option<RejectionReason>,
}

impl RejectedCandidate {
    /// A candidate that was rejected with a fitted set, after a test of its evidence.
    pub(crate) fn new(pick: SelectedEffect, evidence: SelectionEvidence, trial: &ScoredEffectSet) -> Self {
        let other_reason = if !trial.wrong_sign.is_empty() {
            Some(RejectionReason::WrongSign)
        } else if !trial.cancelling.is_empty() {
            Some(RejectionReason::CancelsAnother)
        } else if !trial.implausible.is_empty() {
            Some(RejectionReason::ImplausibleValue)
        } else {
            // Sufficient evidence is rejected only where it is not confirmed.
            (evidence.is_sufficient()).then_some(RejectionReason::NotConfirmedEverywhere)
        };
        Self {
            pick,
            evidence,
            other_reason,
        }
    }

    /// The reason of the rejection; `has_check` states whether there is a validation run.
    pub(crate) fn reason(&self, has_check: bool) -> RejectionReason {
        let insufficient = || self.evidence.insufficiency_reason(has_check);
        (self.other_reason.or_else(insufficient)).unwrap_or(RejectionReason::ExplainedBetter)
    }
}

/// Where no other rejected candidate gains more, the reason of a rejection is not that another one explains more.
pub(crate) fn name_unconfirmed(outcomes: &mut [CandidateOutcome]) {
    let rejected = outcomes.iter().filter(|one| one.rejection_reason.is_some());
    let most = rejected.map(|one| one.gain).fold(f64::NEG_INFINITY, f64::max);
    for one in outcomes {
        if one.rejection_reason == Some(RejectionReason::ExplainedBetter) && one.gain >= most {
            one.rejection_reason = Some(RejectionReason::NotConfirmedEverywhere);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::LocatedEffect;

    /// "Another candidate explains more" needs another candidate.
    #[test]
    fn the_best_rejected_candidate_has_no_better_one() {
        let outcome = |gain: f64, rejection_reason: Option<RejectionReason>| CandidateOutcome {
            effect: LocatedEffect {
                kind: "time_delay".to_owned(),
                at: vec!["a".to_owned()],
            },
            explained: 0.2,
            gain,
            rejection_reason,
        };
        let better = Some(RejectionReason::ExplainedBetter);
        let mut outcomes = [
            outcome(0.9, None),
            outcome(0.3, better),
            outcome(0.2, better),
            outcome(0.1, Some(RejectionReason::WrongSign)),
        ];
        name_unconfirmed(&mut outcomes);
        let reasons = outcomes.map(|one| one.rejection_reason);
        let expected = [
            None,
            Some(RejectionReason::NotConfirmedEverywhere),
            better,
            Some(RejectionReason::WrongSign),
        ];
        assert_eq!(reasons, expected);
        // A better one that was rejected for another reason does explain more.
        let mut outcomes = [outcome(0.3, better), outcome(0.4, Some(RejectionReason::WrongSign))];
        name_unconfirmed(&mut outcomes);
        assert_eq!(outcomes[0].rejection_reason, better);
    }
}
