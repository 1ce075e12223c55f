//! `diagnose`: which physical effect a model lacks. Input are a model and recordings, output are [`DiagnosisFindings`].
//! Candidates come from the effect library, their columns from the derivation of the model, and a search over
//! sets of them decides.
//!
//! `places` -> `candidates` (the effects that `add` could add) -> `columns` (their forces along the recordings)
//! -> `problem` (states and solves the search), with `long_recordings` (fewer samples of long recordings), `faults`
//! (faults of recordings, subtracted first), and candidates that a model file cannot contain: `encoders`,
//! `gears`, `memory`, `payloads`, `constants` -> `added_effects` (the model file with the effects found) -> `model_versions`
//! (both models, identified, along all recordings) -> `off_nominal` (base parameters that differ from the file)
//! -> `findings`. `requested_effects` does the same for effects that the user names, `words` writes sentences,
//! `thresholds` has the numbers that decide.

pub(crate) mod added_effects;
mod candidates;
mod columns;
mod constants;
mod encoders;
mod faults;
mod findings;
mod gears;
mod held_friction;
mod laws;
mod long_recordings;
mod memory;
mod model_versions;
pub(crate) mod numbers;
mod off_nominal;
mod payloads;
mod places;
mod problem;
mod requested_effects;
mod thresholds;
mod tilt;
pub mod words;

pub(crate) use candidates::sign;
pub use findings::{
    DiagnosisFindings, DiagnosisOptions, EffectEstimate, MissingEffect, NominalDiagnosis, SeparationProposal,
    UndecidedEffect,
};
pub use laws::{LawEntry, LawHypothesis, ProposedLaw};
pub use model_versions::{ForceComparison, ModelVersion};
pub use modelmill_identify::diagnose::{
    DiagnosisVerdict, Disturbance, EstimatedQuantity, LocatedEffect, ModelDiagnosis, ResidualBudget, SelectionStep,
};
pub use off_nominal::OffNominalParameter;
pub use problem::FixedParameters;
pub use requested_effects::NamedEffect;
pub(crate) use requested_effects::{ChosenEffect, ConstantPolicy, base_columns, derive_effect};
