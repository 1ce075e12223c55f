//! `diagnose`: which physical effects a model lacks. Inputs are a model and recordings; the output is
//! [`DiagnosisFindings`].
//!
//! Candidate effects come from the effect library; their regressor columns come from the derivation of the model. A
//! search over sets of candidates selects those that are missing.
//!
//! The modules, in the order of the data flow:
//!
//! 1. `long_recordings`: decimates long recordings.
//! 2. `places`: lists the places of the mechanism on which effects may act.
//! 3. `candidates`: derives the effects that `add` could add to the model file.
//! 4. `columns`, `numbers`: evaluate the forces of these effects along the recordings.
//! 5. `faults`, `contacts`: find disturbances before the search (contacts, coarse quantisation, differences between
//!    recordings), and subtract their forces or exclude their samples. After the search, contacts are searched once
//!    more, in its residual.
//! 6. Candidates that a model file cannot contain are added: `encoders` (wrong zeros, eccentricity), `gears` (elastic
//!    gears, backlash), `friction_memory` (Dahl friction, which depends on the earlier motion), `payloads` (additional
//!    bodies), `constants` (wrong lengths and angles), `tilt` (rotation of the base, through the change of the forces
//!    with gravity), `held_friction` (change of friction that is fixed at the values of an earlier day),
//!    `signal_delays` (delays of force signals).
//! 7. `problem`: formulates the search with all of these, and solves it.
//!    `zero_or_tilt` adds wrong zeros of encoders as alternatives of a tilt.
//! 8. `estimates`, `added_effects`: give each effect found one value per parameter, and add the effects to the model file, in
//!    memory.
//! 9. `model_versions`: identifies the models without and with the effects, and evaluates them along all recordings.
//! 10. `off_nominal`: lists base parameters whose estimates differ from the nominal values.
//! 11. `laws`: lists force laws that are in no library and would explain the residual.
//! 12. `geometry_alternatives`: lists errors of the geometry that explain as much as the effects found; for this,
//!     `named_zeros` replaces coordinates of points that the file writes as 0 by named constants (in memory).
//!     `elastic_drives` lists drives whose deflection looks like an eccentric encoder.
//! 13. `findings`: collects the results; `completed` gives the completed model file.
//!
//! In addition, `requested_effects` derives and evaluates effects that the user names, `words` writes sentences, and
//! `thresholds` contains the decision thresholds.

pub(crate) mod added_effects;
mod alternative_words;
mod candidates;
mod clock;
mod columns;
mod completed;
mod completion;
mod constants;
mod contacts;
mod corrected;
mod disturbance_words;
mod effect_search;
mod elastic_drives;
mod encoders;
mod estimates;
mod faults;
mod findings;
mod friction_memory;
mod gears;
mod geometry_alternatives;
mod held_friction;
mod laws;
mod long_recordings;
mod measured_play;
mod model_versions;
mod named_zeros;
pub(crate) mod numbers;
mod off_nominal;
mod payloads;
mod places;
mod problem;
mod requested_effects;
mod signal_delays;
mod standing_drives;
mod thresholds;
mod tilt;
pub mod words;
mod zero_or_tilt;

pub(crate) use candidates::sign;
pub use completion::ModelCompletion;
pub use elastic_drives::ElasticAlternative;
pub use estimates::EffectEstimate;
pub(crate) use findings::is_common_clock;
pub use findings::{
    DiagnosisFindings, DiagnosisOptions, MissingEffect, NominalDiagnosis, SeparationProposal, UndecidedEffect,
};
pub use geometry_alternatives::{GeometryAlternative, GeometryError};
pub use laws::{LawEntry, NamedLaw, NamedLawProposal};
pub use model_versions::{ForceComparison, ModelVersion};
pub use modelmill_identify::diagnose::{
    DiagnosisVerdict, Disturbance, EstimatedQuantity, LocatedEffect, ModelDiagnosis, RejectionReason, ResidualBudget,
    SelectionStep,
};
pub use off_nominal::OffNominalParameter;
pub use problem::FixedParameters;
pub use requested_effects::NamedEffect;
pub(crate) use requested_effects::{ChosenEffect, ConstantPolicy, base_columns, derive_effect};
