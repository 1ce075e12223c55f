//! `diagnose`: which physical effect a model lacks. Input are a model and recordings, output are [`Findings`]. Candidates come from
//! the effect library, their columns from the derivation of the model, and a search over sets of them decides.
//!
//! `places` -> `candidates` (the effects that `add` could add) -> `columns` (their forces along the recordings) -> `problem`
//! (states and solves the search), with `long` (fewer samples of long recordings), `faults` (faults of recordings, subtracted
//! first), and candidates that a model file cannot contain: `encoders`, `gears`, `memory`, `payloads`, `constants`
//! -> `added` (the model file with the effects found) -> `versions` (both models, identified, along all recordings)
//! -> `off_nominal` (base parameters that differ from the file) -> `findings`.
//! `chosen` does the same for effects that the user names, `words` writes sentences, `thresholds` has the numbers that decide.

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
pub use chosen::Named;
pub(crate) use chosen::{Chosen, Constants, base, choose};
pub use findings::{Estimate, Findings, Missing, Question, Separation, Untold, WithNominal};
pub use laws::{Hypothesis, Law, LawEntry};
pub use modelmill_identify::diagnose::{
    Budget, Diagnosis, Disturbance, Effect, Quantity, Rung, Verdict,
};
pub use off_nominal::OffNominal;
pub use problem::Held;
pub use versions::{Along, Version};
