//! `diagnose`: which physical effect a model lacks. Input are a model and recordings, output are [`DiagnosisFindings`].
//! Candidates come from the effect library, their columns from the derivation of the model, and a search over
//! sets of them decides.
//!
//! `places` -> `candidates` (the effects that `add` could add) -> `columns` (their forces along the recordings)
//! -> `problem` (states and solves the search), with `long` (fewer samples of long recordings), `faults`
//! (faults of recordings, subtracted first), and candidates that a model file cannot contain: `encoders`,
//! `gears`, `memory`, `payloads`, `constants` -> `added` (the model file with the effects found) -> `versions`
//! (both models, identified, along all recordings) -> `off_nominal` (base parameters that differ from the file)
//! -> `findings`. `chosen` does the same for effects that the user names, `words` writes sentences,
//! `thresholds` has the numbers that decide.

pub(crate) mod added;
mod candidates;
mod chosen;
mod columns;
mod constants;
mod encoders;
mod faults;
mod findings;
mod gears;
mod held_friction;
mod laws;
mod long;
mod memory;
pub(crate) mod numbers;
mod off_nominal;
mod payloads;
mod places;
mod problem;
mod thresholds;
mod tilt;
mod versions;
pub mod words;

pub(crate) use candidates::sign;
pub use chosen::NamedEffect;
pub(crate) use chosen::{ChosenEffect, ConstantPolicy, base_columns, derive_effect};
pub use findings::{
    DiagnosisFindings, DiagnosisOptions, EffectEstimate, MissingEffect, NominalDiagnosis,
    SeparationProposal, UndecidedEffect,
};
pub use laws::{LawEntry, LawHypothesis, ProposedLaw};
pub use modelmill_identify::diagnose::{
    DiagnosisVerdict, Disturbance, EstimatedQuantity, LocatedEffect, ModelDiagnosis,
    ResidualBudget, SelectionStep,
};
pub use off_nominal::OffNominalParameter;
pub use problem::FixedParameters;
pub use versions::{ForceComparison, ModelVersion};
