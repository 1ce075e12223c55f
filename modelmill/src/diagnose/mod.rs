//! `diagnose`: which physical effect a model lacks. Candidates come from the effect library, their columns from the model's
//! own derivation, and a search over sets of them decides.
//!
//! `places` -> `candidates` (what `add` would add) -> `columns` (numbers along the recordings) -> `problem` (posed and solved)
//! with `long` (recordings in fewer samples), `faults` (of recordings, taken off), and candidates that no entry of a model
//! file says: `encoders`, `gears`, `memory`, `payloads`, `constants`
//! -> `added` (the model file with what was found) -> `versions` (both models identified, along all recordings) -> `off_nominal`
//! (what base parameters say against the file) -> `findings`.
//! `chosen` does the same for effects that the user names; `words` puts verdicts into sentences.

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
