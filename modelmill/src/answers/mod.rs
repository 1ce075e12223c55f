//! Answers of the operations as types. The JSON of a command is one of these types as serde writes it, and its JSON Schema in
//! `modelmill/schema` is generated from the same type, so that a field is described once.
//!
//! Numbers are in SI units unless a field `unit` states another one; errors are relative to the measured force (0.1 = 10 %).

mod diagnosis;
mod runs;
#[cfg(test)]
mod schema_tests;

use modelmill_identify::NoteSeverity;
use serde::Serialize;
use serde_json::Value;

pub(crate) use diagnosis::{
    CandidateAnswer, CorrectedFaultAnswer, DiagnosisAnswer, DisturbanceAnswer, DriveBudgetAnswer, DriveShareAnswer,
    GeometryAlternativeAnswer, GeometryErrorAnswer, LawAnswer, LawHypothesisAnswer, MissingEffectAnswer,
    NominalDiagnosisAnswer, NominalEffectAnswer, OffNominalAnswer, RecordedIntervalAnswer, SelectionStepAnswer,
    TimeResidualAnswer, UndecidedEffectAnswer,
};
pub(crate) use runs::{
    ChangePointAnswer, DriveGainAnswer, MeanStepAnswer, MovedParameterAnswer, ParameterAnswer, RunAnswer,
    RunChangeAnswer, RunValueAnswer, RunValuesAnswer, RunsAnswer, SharedFitAnswer, UndecidedDriveAnswer,
    UnreadRunAnswer,
};

/// An estimated quantity.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(any(test, feature = "schema"), derive(schemars::JsonSchema))]
pub(crate) struct EstimateAnswer {
    /// Symbol of the parameter, or name of the quantity.
    pub(crate) name: String,
    /// The estimate, in `unit`.
    pub(crate) value: f64,
    /// Its standard deviation, in `unit`; `null` where it is not known.
    pub(crate) std: Option<f64>,
    /// The unit; empty for a number without unit.
    pub(crate) unit: String,
}

/// A note on recordings or on their preparation.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(any(test, feature = "schema"), derive(schemars::JsonSchema))]
pub(crate) struct NoteAnswer {
    /// `info`, or `warning` for what should be checked.
    pub(crate) severity: NoteSeverity,
    /// The note as sentences.
    pub(crate) says: String,
}

/// An answer as a JSON value.
pub(crate) fn to_json(answer: &impl Serialize) -> Value {
    // The answers have string keys only, and their serializers return no errors of their own.
    serde_json::to_value(answer).unwrap_or(Value::Null)
}
