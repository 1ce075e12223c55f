//! The answer of `diagnose`.

use indexmap::IndexMap;
use modelmill_identify::ErrorRegion;
use modelmill_identify::diagnose::{
    DiagnosisVerdict, EffectSupport, LocatedEffect, RejectionReason, ResidualCharacter, SelectionEvidence,
};
use serde::Serialize;

use super::{EstimateAnswer, NoteAnswer};

/// The findings of `modelmill diagnose`.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(any(test, feature = "schema"), derive(schemars::JsonSchema))]
pub(crate) struct DiagnosisAnswer {
    /// Name of the model.
    pub(crate) model: String,
    /// `adequate`, `missing_effect` or `unexplained`.
    pub(crate) verdict: DiagnosisVerdict,
    /// Noise of all drives, relative to the measured force.
    pub(crate) noise_floor: f64,
    /// Parts of the residual of each drive, by the names of the drives.
    pub(crate) budget: IndexMap<String, DriveBudgetAnswer>,
    /// Faults of the recordings that are no errors of the model.
    pub(crate) disturbances: Vec<DisturbanceAnswer>,
    /// Faults of the recordings for which a trial correction was made (in memory). All other findings hold for the
    /// corrected recordings.
    pub(crate) corrected: Vec<CorrectedFaultAnswer>,
    /// Faults of the recordings that could not be corrected; nothing else is stated then.
    pub(crate) unresolved: Vec<CorrectedFaultAnswer>,
    /// Errors after each step; the first step is the model as it is.
    pub(crate) steps: Vec<SelectionStepAnswer>,
    /// Missing effects.
    pub(crate) effects: Vec<MissingEffectAnswer>,
    /// Errors of the geometry that explain as much as the effects found.
    pub(crate) geometry_alternatives: Vec<GeometryAlternativeAnswer>,
    /// Effects with a probability below 0.5, which do not count as missing.
    pub(crate) possible: Vec<MissingEffectAnswer>,
    /// All effects that were tried.
    pub(crate) candidates: Vec<CandidateAnswer>,
    /// Effects that the recordings can neither show nor exclude.
    pub(crate) untold: Vec<UndecidedEffectAnswer>,
    /// Hypotheses for the residual, the best first.
    pub(crate) laws: Vec<LawHypothesisAnswer>,
    /// Base parameters that differ from their values in the file.
    pub(crate) parameters_off_nominal: Vec<OffNominalAnswer>,
    /// Drives with a repeatable residual that no effect explains.
    pub(crate) unexplained: Vec<DriveShareAnswer>,
    /// Residuals that follow the time and not the state, and are no noise.
    pub(crate) follows_time: Vec<TimeResidualAnswer>,
    /// Notes on the recordings and their preparation.
    pub(crate) data: Vec<NoteAnswer>,
    /// Ranges of a variable in which the error is largest.
    #[serde(rename = "where")]
    pub(crate) regions: Vec<ErrorRegion>,
    /// The diagnosis with all parameters fixed at the values of the file; `null` if it was not made.
    pub(crate) with_nominal_parameters: Option<NominalDiagnosisAnswer>,
}

/// Parts of the residual of a drive, each as an rms value relative to the rms force of the drive.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(any(test, feature = "schema"), derive(schemars::JsonSchema))]
pub(crate) struct DriveBudgetAnswer {
    /// Noise, white or coloured.
    pub(crate) noise: f64,
    /// `in_time` and `subtracted` together.
    pub(crate) not_repeating: f64,
    /// What follows the time and not the state, and is no noise.
    pub(crate) in_time: f64,
    /// Disturbances that were subtracted from the force before the fit.
    pub(crate) subtracted: f64,
    /// What is repeatable, and what a model could explain.
    pub(crate) model: f64,
    /// Unit of `rms`.
    pub(crate) unit: String,
    /// Force of the drive, rms.
    pub(crate) rms: f64,
}

/// A fault of recordings that is no error of the model.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(any(test, feature = "schema"), derive(schemars::JsonSchema))]
pub(crate) struct DisturbanceAnswer {
    /// Its kind, such as `contact_event`.
    pub(crate) kind: String,
    /// Drives, coordinates or columns that have it.
    pub(crate) at: Vec<String>,
    /// A clause that describes it, if the kind alone does not.
    pub(crate) says: Option<String>,
    /// Its quantities.
    pub(crate) estimates: Vec<EstimateAnswer>,
    /// Files of the recordings that have it; empty for all.
    pub(crate) recordings: Vec<String>,
    /// Its start and end, s; `null` if it has no time.
    pub(crate) interval: Option<[f64; 2]>,
    /// Whether the verdict names it.
    pub(crate) in_verdict: bool,
    /// What explains as much in its place: errors of the geometry, an elastic drive, a contact; empty if there is nothing.
    pub(crate) indistinguishable_from: Vec<LocatedEffect>,
}

/// A fault of recordings with what to do about it.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(any(test, feature = "schema"), derive(schemars::JsonSchema))]
pub(crate) struct CorrectedFaultAnswer {
    /// Its kind, such as `wrong_sign`.
    pub(crate) kind: String,
    /// Coordinates, drives or columns that have it.
    pub(crate) at: Vec<String>,
    /// Files of the recordings that have it.
    pub(crate) recordings: Vec<String>,
    /// What was found, as a clause.
    pub(crate) says: String,
    /// What to do, as a sentence.
    pub(crate) todo: String,
    /// When to do it.
    pub(crate) heading: String,
}

/// A step of the search.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(any(test, feature = "schema"), derive(schemars::JsonSchema))]
pub(crate) struct SelectionStepAnswer {
    /// The effect that the step added; `null` for the model as it is.
    pub(crate) added: Option<LocatedEffect>,
    /// Further effects that the same step added.
    pub(crate) also_added: Vec<LocatedEffect>,
    /// Effects that were removed in exchange.
    pub(crate) dropped: Vec<LocatedEffect>,
    /// Error on the fitted recordings.
    pub(crate) fit: f64,
    /// Error on the validation runs, or by cross-validation if there are none.
    pub(crate) check: f64,
    /// Relative decrease of the squared error on data that was not fitted.
    pub(crate) gain: Option<f64>,
    /// What supports the step.
    pub(crate) evidence: Option<SelectionEvidence>,
}

/// An effect that the model lacks, or may lack.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(any(test, feature = "schema"), derive(schemars::JsonSchema))]
pub(crate) struct MissingEffectAnswer {
    /// Its kind, such as `coulomb_friction`.
    pub(crate) kind: String,
    /// The places that share its parameters.
    pub(crate) at: Vec<String>,
    /// Its parameters.
    pub(crate) estimates: Vec<EstimateAnswer>,
    /// Probability that it is present, 0 to 1.
    pub(crate) probability: f64,
    /// What supports it.
    pub(crate) support: EffectSupport,
    /// Effects that explain the recordings equally well.
    pub(crate) indistinguishable_from: Vec<LocatedEffect>,
    /// Other places that share one value with this place; the estimates are then differences from this value.
    pub(crate) shared_with: Vec<String>,
    /// An experiment that would separate it from its alternatives, as a sentence.
    pub(crate) separate_by: Option<String>,
    /// The command that plans a motion for this experiment.
    pub(crate) separate_command: Option<String>,
}

/// Errors of the geometry that together explain as much as effects.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(any(test, feature = "schema"), derive(schemars::JsonSchema))]
pub(crate) struct GeometryAlternativeAnswer {
    /// The errors.
    pub(crate) errors: Vec<GeometryErrorAnswer>,
    /// Share of what the effects explain; 1 for as much.
    pub(crate) share: f64,
}

/// An error of a constant, or of a coordinate that the file writes as zero.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(any(test, feature = "schema"), derive(schemars::JsonSchema))]
pub(crate) struct GeometryErrorAnswer {
    /// The constant; `null` for a coordinate of a point.
    pub(crate) constant: Option<String>,
    /// The point of the coordinate; `null` for a constant.
    pub(crate) point: Option<String>,
    /// The axis of the coordinate; `null` for a constant.
    pub(crate) axis: Option<String>,
    /// The error, in `unit`.
    pub(crate) value: f64,
    /// The unit.
    pub(crate) unit: String,
}

/// An effect that was tried.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(any(test, feature = "schema"), derive(schemars::JsonSchema))]
pub(crate) struct CandidateAnswer {
    /// Its kind.
    pub(crate) kind: String,
    /// Its places.
    pub(crate) at: Vec<String>,
    /// Share of the squared error of the unchanged model that it explains alone, 0 to 1.
    pub(crate) explained: f64,
    /// Relative decrease of the squared error in addition to the effects found.
    pub(crate) gain: f64,
    /// Why it was rejected; `null` if it was found.
    pub(crate) refused: Option<RejectionReason>,
}

/// An effect that the recordings can neither show nor exclude.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(any(test, feature = "schema"), derive(schemars::JsonSchema))]
pub(crate) struct UndecidedEffectAnswer {
    /// Its kind.
    pub(crate) kind: String,
    /// Its places.
    pub(crate) at: Vec<String>,
    /// Why, as a sentence.
    pub(crate) says: String,
    /// A motion that would decide it, as a sentence.
    pub(crate) separate_by: String,
}

/// A law that would explain the residual, with others that explain it equally well.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(any(test, feature = "schema"), derive(schemars::JsonSchema))]
pub(crate) struct LawHypothesisAnswer {
    /// The law.
    #[serde(flatten)]
    pub(crate) law: LawAnswer,
    /// Labels of the laws that explain the residual equally well.
    pub(crate) near_ties: Vec<String>,
    /// These laws in full.
    pub(crate) ties: Vec<LawAnswer>,
    /// The caution that goes with every law.
    pub(crate) says: String,
}

/// A law for the residual.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(any(test, feature = "schema"), derive(schemars::JsonSchema))]
pub(crate) struct LawAnswer {
    /// The force as an expression.
    pub(crate) expression: String,
    /// The drive.
    pub(crate) at: [String; 1],
    /// Share of the squared residual that it explains on data that was not fitted, 0 to 1.
    pub(crate) gain: f64,
    /// Its parameters.
    pub(crate) parameters: Vec<EstimateAnswer>,
    /// Effects that it makes unnecessary.
    pub(crate) instead_of: Vec<LocatedEffect>,
    /// Effects that were estimated together with it.
    pub(crate) in_addition_to: Vec<LocatedEffect>,
    /// Its entry for a library of effects; `null` for a law with memory, which no entry can express.
    pub(crate) entry: Option<String>,
    /// Name of its kind in that entry.
    pub(crate) kind: Option<String>,
    /// Places of the effect.
    pub(crate) places: Option<Vec<String>>,
    /// The command that adds it to the model file.
    pub(crate) command: Option<String>,
}

/// A base parameter that differs from its value in the file.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(any(test, feature = "schema"), derive(schemars::JsonSchema))]
pub(crate) struct OffNominalAnswer {
    /// Its name.
    pub(crate) name: String,
    /// Its expression.
    pub(crate) expression: String,
    /// The value of the file, in `unit`.
    pub(crate) nominal: f64,
    /// The identified value, in `unit`.
    pub(crate) value: f64,
    /// The difference in standard deviations.
    pub(crate) sigmas: f64,
    /// The unit.
    pub(crate) unit: String,
}

/// A drive with a repeatable residual.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(any(test, feature = "schema"), derive(schemars::JsonSchema))]
pub(crate) struct DriveShareAnswer {
    /// The drive.
    pub(crate) channel: String,
    /// Repeatable share of the squared residual, 0 to 1.
    pub(crate) reproducible: f64,
}

/// A residual that follows the time and not the state.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(any(test, feature = "schema"), derive(schemars::JsonSchema))]
pub(crate) struct TimeResidualAnswer {
    /// The drive.
    pub(crate) channel: String,
    /// What it is like.
    pub(crate) character: ResidualCharacter,
    /// Its rms value, in `unit`; in the intervals if there are any.
    pub(crate) rms: f64,
    /// Standard deviation of the white noise, in `unit`.
    pub(crate) noise: f64,
    /// The unit.
    pub(crate) unit: String,
    /// Frequency of an oscillation, Hz.
    pub(crate) frequency: Option<f64>,
    /// Where it stands out.
    pub(crate) intervals: Vec<RecordedIntervalAnswer>,
    /// The same as a sentence.
    pub(crate) says: String,
}

/// An interval of a recording.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(any(test, feature = "schema"), derive(schemars::JsonSchema))]
pub(crate) struct RecordedIntervalAnswer {
    /// File of the recording.
    pub(crate) recording: String,
    /// Start and end, s.
    pub(crate) interval: [f64; 2],
}

/// The diagnosis with all parameters fixed.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(any(test, feature = "schema"), derive(schemars::JsonSchema))]
pub(crate) struct NominalDiagnosisAnswer {
    /// Its verdict.
    pub(crate) verdict: DiagnosisVerdict,
    /// Its steps.
    pub(crate) steps: Vec<SelectionStepAnswer>,
    /// Its effects.
    pub(crate) effects: Vec<NominalEffectAnswer>,
}

/// A missing effect of the diagnosis with all parameters fixed.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(any(test, feature = "schema"), derive(schemars::JsonSchema))]
pub(crate) struct NominalEffectAnswer {
    /// Its kind.
    pub(crate) kind: String,
    /// Its places.
    pub(crate) at: Vec<String>,
    /// Its parameters.
    pub(crate) estimates: Vec<EstimateAnswer>,
}
