//! modelmill as a library: from a declarative model file to base parameters, equations and fast code.
//! From recordings it identifies parameter values, detects the effects that a model lacks, and writes a page about
//! them.
//!
//! The library uses no terminal, no fixed path and no global state. Files, libraries of effects and progress come from
//! a [`Host`]. Results are values; [`mod@print`] and [`report`] convert them to text, JSON and pages. Advice in a text
//! is spelled by a [`print::StepSpelling`], since the command line, Python and Rust write the same request differently.
//!
//! All quantities are in SI units (m, rad, kg, s, N, N m). A recording or a model file may declare other units for its
//! own values.
//!
//! # A first model
//!
//! ```
//! use modelmill::Model;
//!
//! let model = Model::open("../model-spec/models/spidermill-paper.toml")?;
//! let first = &model.base[0];
//! assert_eq!((first.name.as_str(), first.retained.as_str()), ("p1_min", "m1*dc1"));
//! # Ok::<(), modelmill::Error>(())
//! ```
//!
//! A model can also be read from text ([`Model::from_text`]). Every fault of a file is reported with its place:
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
//! Methods of [`Model`] need a derived model; methods of [`Host`] need none.
//!
//! | method | what it does |
//! |---|---|
//! | [`Model::check`] | summary of the model, and its numeric rank compared with the exact one |
//! | [`model::ModelChanges::from_models`] | what a variant changes in entries, base parameters and operation counts |
//! | [`variants::VariantComparison::along_recordings`] | forces, power, work, limits and errors of two variants |
//! | [`Host::kinds`] | the kinds of effects that a model may have |
//! | [`Model::with_added_effects`] | the model with effects added to its file |
//! | [`Model::picture`] | the mechanism at a pose, as SVG |
//! | [`Model::equations`] | p_g, dependencies, p_min and programs as a page |
//! | [`Model::generate`] | source code |
//! | [`Model::evaluate`] | forces along a recording |
//! | [`Model::functions`] | forces, regressor, mass matrix and other functions at given states |
//! | [`Model::identify`] | base parameters from recordings, eq. (12) |
//! | [`Model::compare`] | error figures, and the regions in which errors occur |
//! | [`Model::diagnose`] | the physical effects that are missing |
//! | [`Model::runs`] | what changed between recordings of one machine |
//! | [`report::page`] | a diagnosis as one page |
//! | [`Host::simulate`] | the simulation of a full-body rig along a trajectory |
//! | [`Host::reduce`] | the reduction of a rig to a planar model |
//! | [`Host::import`] | a model file from a URDF, MJCF or SDF |
//! | [`export::description`], [`Model::export`] | a URDF or MJCF from a model file, or from a fit |
//! | [`Model::adopt`] | the model file with the values of a fit |
//! | [`Model::interpret`] | physical parameters from base parameters |
//! | [`Model::excite`] | the motion that determines base parameters, or separates effects, best |
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
//! let compared = model.compare(&[&check], &model.nominal)?;
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
//! ## Find what is missing, and add it
//!
//! ```
//! use modelmill::diagnose::DiagnosisOptions;
//! use modelmill::print::LibrarySpelling;
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
//! assert!(report::page(&findings, &LibrarySpelling)?.contains("<h1>"));
//! # Ok::<(), modelmill::Error>(())
//! ```
//!
//! ## Motions and rigs
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
//! let reduced = host.reduce(rig, Some(plan))?;
//! assert!(reduced.forces.iter().all(|force| force.nrms < 1e-6));
//! # Ok::<(), modelmill::Error>(())
//! ```
//!
//! # Progress, cancellation, notes
//!
//! A [`progress::ProgressListener`] of the host receives the name and the progress of each job, can stop it
//! ([`Error::Cancelled`]), and receives notes when they occur. Results contain the same notes as [`RecordingNote`]s.
//!
//! # Modules
//!
//! In the order of the data flow, each based on those before it: [`text`], [`error`], [`progress`], [`host`],
//! [`model`], [`segment`], [`along`], [`audit`], [`recording`], [`compare`], [`evaluate`], [`states`], [`identify`],
//! [`diagnose`], [`add`], [`adopt`], [`runs`], [`interpret`], [`excite`], [`variants`], [`generate`], [`simulate`],
//! [`reduce`], [`mod@import`], [`mod@export`], [`picture`], [`atlas`], [`mod@print`], [`report`].

pub mod add;
pub mod adopt;
pub mod along;
pub mod atlas;
pub mod audit;
pub mod compare;
pub mod diagnose;
pub mod error;
pub mod evaluate;
pub mod excite;
#[cfg(feature = "import")]
pub mod export;
pub mod generate;
pub mod host;
pub mod identify;
#[cfg(feature = "import")]
pub mod import;
pub mod interpret;
pub mod model;
pub mod picture;
pub mod print;
pub mod progress;
pub mod recording;
#[cfg(feature = "import")]
pub mod reduce;
mod regressors;
pub mod report;
pub mod runs;
pub mod segment;
#[cfg(feature = "rig")]
pub mod simulate;
pub mod states;
pub mod text;
pub mod variants;

pub use modelmill_boundary::files;
pub use modelmill_identify::{FitFile, NoteSeverity, RecordingNote};
pub use modelmill_spec::{EffectKind, SCHEMA, bundled, edit};

pub use error::{Error, Outcome};
pub use host::Host;
pub use model::Model;
