//! modelmill as a library: from a declarative model file it derives base parameters, equations and fast code.
//! From recordings it identifies parameter values, detects the physical effects that a model lacks, and writes these
//! findings as one page.
//!
//! The library uses no terminal, no fixed path and no global state. A [`Host`] reads files, provides the libraries of
//! effects, and passes progress to the caller's listener.
//!
//! A physical effect, such as friction of a drive or inertia of a rod, adds forces to those of the bodies. A library of
//! effects defines kinds of effects; one is built in.
//!
//! Results are values; [`mod@print`] and [`report`] convert them to text, JSON and pages. Their recommendations, such
//! as adding an effect to the model file, are written in the syntax of the caller. A [`print::StepWording`] chooses
//! the syntax: commands of the program, Python calls, or words for callers of this Rust library
//! ([`print::RustWording`]).
//!
//! All quantities are in SI units (m, rad, kg, s, N, N m). A recording or a model file may declare other units for its
//! own values.
//!
//! Equation and table numbers, such as eq. (16) and Table 1, are those of the paper "Dynamic Modeling and
//! Identification of a Complex-structured Parallel Robot" about the robot SpiderMill. The page `docs/experiment.html`
//! of the repository reproduces its experiment.
//!
//! # A first model
//!
//! ```
//! use modelmill::Model;
//!
//! let model = Model::open("../model-spec/models/spidermill-paper.toml")?;
//! // Each regressor column belongs to one product of parameters. A largest set of linearly independent columns is
//! // kept; `retained` is the product of a kept column.
//! let first = &model.base[0];
//! assert_eq!((first.name.as_str(), first.retained.as_str()), ("p1_min", "m1*dc1"));
//! # Ok::<(), modelmill::Error>(())
//! ```
//!
//! A model can also be read from text ([`Model::from_text`]). Every error of a file is reported with its line and
//! column:
//!
//! ```
//! let Err(modelmill::Error::Model(faults)) = modelmill::Model::from_text("arm.toml", "schema = 1\nname = 3") else {
//!     panic!("a name is a text");
//! };
//! assert!(faults.render(false).contains("arm.toml:2"));
//! ```
//!
//! # Methods
//!
//! Methods of [`Model`] use the equations that were derived when the model was read. Methods of [`Host`] need no
//! model.
//!
//! | method | what it does |
//! |---|---|
//! | [`Model::check`] | summary of the model, and the numeric rank of its regressor (over random states) compared with the exact rank |
//! | [`model::ModelChanges::from_models`] | entries of the model file, base parameters and operation counts that differ between a model and its variant |
//! | [`variants::VariantComparison::along_recordings`] | forces, power, work, utilisation of limits, and errors of two variants |
//! | [`Host::kinds`] | the kinds of effects that a model may have |
//! | [`Model::with_added_effects`] | the model with effects added to its file |
//! | [`Model::picture`] | the mechanism at a pose, as SVG |
//! | [`Model::equations`] | parameter products p_g, linear dependencies of the regressor columns, base parameters p_min, and straight-line programs (the equations as a list of assignments without branches), as a page |
//! | [`Model::generate`] | source code of the model in a target language |
//! | [`Model::evaluate`] | forces along a recording |
//! | [`Model::functions`] | forces, regressor, mass matrix and other functions at given states |
//! | [`Model::identify`] | base parameters from recordings by least squares, eq. (12) |
//! | [`servo::ServoModel::identify`] | base parameters and gains from commands or currents, without forces |
//! | [`Model::add_actuator_forces`] | recordings with the forces of actuators, computed from their signals |
//! | [`Model::compare`] | error figures (such as the NRMS), and the ranges of coordinates, rates, loads and time in which errors are large |
//! | [`Model::simulate_motion`], [`Model::compare_forward`] | the motion under recorded forces, and its position errors in simulations of 0.1 s, 1 s and the whole run |
//! | [`Model::diagnose`] | the physical effects that are missing |
//! | [`Model::verify`] | a test of the model: checks of drives, parameters and effects, each with the result `pass`, `fail` or `not evaluated` |
//! | [`Model::runs`] | changes between recordings of one machine |
//! | [`report::page`] | a diagnosis as one page |
//! | [`Host::simulate`] | simulation of a rig (a numeric model of the complete machine, used in place of hardware) along a trajectory |
//! | [`Host::reduce`] | the reduction of a rig to a planar model |
//! | [`Host::propose_plan`] | a plan file for this reduction: the plane, and the bodies that are merged into one part |
//! | [`Host::check_rig`] | the contents of a rig, and whether its loops close |
//! | [`Host::import`] | a model file from a URDF, MJCF or SDF |
//! | [`export::description`], [`Model::export`] | a URDF or MJCF from a model file, or from a fit |
//! | [`Model::adopt`] | the model file with the values of a fit |
//! | [`Model::interpret`] | physical parameters from base parameters |
//! | [`Model::excite`] | the excitation trajectory that determines the base parameters best, or that best distinguishes an effect from its alternatives |
//!
//! ## Check, compare variants, write equations and code
//!
//! ```
//! use modelmill::generate::{CodeLanguage, CodeOptions};
//! use modelmill::model::{ModelChanges, PageFormat};
//! use modelmill::Model;
//!
//! let paper = Model::open("../model-spec/models/spidermill-paper.toml")?;
//! let consistent = Model::open("../model-spec/models/spidermill.toml")?;
//! let checked = paper.check()?;
//! assert_eq!((checked.summary.loops.len(), checked.rank.map(|rank| rank.numeric_rank.rank)), (1, Some(5)));
//!
//! let changes = ModelChanges::from_models(&paper, &consistent);
//! assert!(!changes.base.is_empty());
//!
//! assert!(paper.equations(PageFormat::Markdown)?.text.contains("p1_min"));
//! let module = &paper.generate(&CodeOptions { language: CodeLanguage::default(), ..CodeOptions::default() })?[0];
//! assert!(module.text.contains("pub struct InverseDynamics"));
//! # Ok::<(), modelmill::Error>(())
//! ```
//!
//! ## Compare a model with recordings
//!
//! ```
//! use modelmill::Model;
//! use modelmill::identify::EstimatorOptions;
//! use modelmill::recording::RecordingOptions;
//!
//! let model = Model::open("../model-spec/models/spidermill-paper.toml")?;
//! let reading = RecordingOptions::default();
//! let fit = model.recording("../recordings/spidermill-mbs/plain-fit.csv", &reading)?;
//! let check = model.recording("../recordings/spidermill-mbs/plain-check.csv", &reading)?;
//!
//! let compared = model.compare(&[&check], &model.values)?;
//! let identified = model.identify(&[&fit], &[&check], &EstimatorOptions::default())?;
//! let after = identified.fit.check.as_ref().and_then(|figures| figures.nrms);
//! assert!(after < compared.figures.nrms);
//!
//! let forces = model.evaluate("../recordings/spidermill-mbs/plain-check.csv", &reading, &identified.values())?;
//! assert_eq!(forces.columns[0].0, "spindle_left");
//!
//! // Table 1 of the paper: five physical parameters are solved for, the others are fixed at their nominal values.
//! let unknown = ["m2", "m4", "dc3", "Ic12", "Ic32"].map(str::to_owned);
//! let physical = model.interpret(&identified.fit, "the fit", &unknown)?;
//! assert!(!physical.solutions().is_empty());
//! # Ok::<(), modelmill::Error>(())
//! ```
//!
//! ## Find missing effects, and add them
//!
//! ```
//! use modelmill::diagnose::DiagnosisOptions;
//! use modelmill::print::RustWording;
//! use modelmill::recording::RecordingOptions;
//! use modelmill::{Model, report};
//!
//! let model = Model::open("../model-spec/models/spidermill.toml")?;
//! let reading = RecordingOptions::default();
//! let run = model.recording("../recordings/spidermill-mbs/with-rods-fit.csv", &reading)?;
//! let other = model.recording("../recordings/spidermill-mbs/with-rods-check.csv", &reading)?;
//! let findings = model.diagnose(&[&run], &[&other], &DiagnosisOptions::default())?;
//! assert_eq!(findings.missing[0].effect.kind, "rod_inertia");
//!
//! let better = model.with_added_effects(&findings.entries)?;
//! assert!(better.text().contains("rod_inertia"));
//! assert!(report::page(&findings, &RustWording)?.contains("<h1>"));
//! # Ok::<(), modelmill::Error>(())
//! ```
//!
//! ## Plan an excitation trajectory, reduce a rig
//!
//! ```
//! use std::path::Path;
//! use modelmill::{Host, Model};
//! use modelmill::excite::{ExcitationRequest, Options, TrajectoryLimit};
//!
//! let arm = Model::open("../model-spec/models/two_link.toml")?;
//! let limits = ["q1=-1:1", "q1_d=2", "q2=-1.5:1.5", "q2_d=3"];
//! let result = arm.excite(
//!     &ExcitationRequest {
//!         options: Options { harmonics: 3, period: 5.0, random: 20, starts: 1, ..Options::default() },
//!         limits: limits.iter().map(|text| TrajectoryLimit::parse(text).unwrap()).collect(),
//!         ..ExcitationRequest::default()
//!     },
//!     &[],
//! )?;
//! assert!(result.found.condition_number <= result.found.start_condition_number);
//!
//! let host = Host::new();
//! let rig = Path::new("../model-spec/rigs/spidermill-full.toml");
//! let plan = Path::new("../model-spec/rigs/spidermill-plan.toml");
//! let options = modelmill::reduce::RigReductionOptions { plan: Some(plan), ..Default::default() };
//! let reduced = host.reduce(rig, &options)?;
//! assert!(reduced.forces.iter().all(|force| force.nrms < 1e-6));
//! # Ok::<(), modelmill::Error>(())
//! ```
//!
//! # Progress, cancellation, notes
//!
//! A [`progress::ProgressListener`] of the host receives the name and the progress of each job, can stop it
//! ([`Error::Cancelled`]), and receives notes. A note ([`RecordingNote`]) states a choice that the library made, such
//! as a cut-off frequency, or warns of a condition that is likely to affect the result. Results contain the notes too.
//!
//! # Modules
//!
//! In the order of the data flow; each module uses only modules before it:
//!
//! [`files`], [`text`], [`error`], [`progress`], [`host`], [`model`], [`picture`], [`atlas`], [`segment`], [`along`], [`audit`],
//! [`faults`], [`recording`], [`compare`], [`evaluate`], [`states`], [`forward`], [`identify`], [`servo`], [`runs`], [`diagnose`],
//! [`verify`], [`add`], [`adopt`], [`interpret`], [`excite`], [`variants`], [`generate`], [`simulate`], [`rig_check`], [`reduce`], [`mod@import`], [`mod@export`],
//! [`options`], [`mod@print`], [`report`].

pub mod add;
pub mod adopt;
pub mod along;
mod answers;
pub mod atlas;
pub mod audit;
pub mod compare;
pub mod diagnose;
pub mod error;
pub mod evaluate;
pub mod excite;
#[cfg(feature = "import")]
pub mod export;
pub mod faults;
pub mod forward;
pub mod generate;
pub mod host;
pub mod identify;
#[cfg(feature = "import")]
pub mod import;
pub mod interpret;
pub mod model;
pub mod options;
pub mod picture;
pub mod print;
pub mod progress;
pub mod recording;
#[cfg(feature = "import")]
pub mod reduce;
mod regressors;
pub mod report;
#[cfg(feature = "rig")]
pub mod rig_check;
pub mod runs;
pub mod segment;
pub mod servo;
#[cfg(feature = "rig")]
pub mod simulate;
pub mod states;
pub mod text;
pub mod variants;
pub mod verify;

pub use modelmill_boundary::files;
pub use modelmill_identify::{FitFile, NoteSeverity, RecordingNote};
pub use modelmill_spec::{EffectKind, SCHEMA, edit};

pub use error::{Error, Outcome};
pub use host::Host;
pub use model::Model;
