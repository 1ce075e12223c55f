//! modelmill as a library: from a declarative model file to base parameters, equations and fast code, and from recordings to
//! parameters, to the effect that a model lacks, and to a page that shows it.
//!
//! The library owns no terminal, no path and no global. Files, libraries of effects and progress come from a [`Host`]; results
//! are values; [`mod@print`] and [`report`] make text, JSON and pages of them. What a reader of a text is advised to do is spelled
//! by a [`print::StepSpelling`], since a command line, a notebook and a Rust program ask for it in different words.
//!
//! Units are SI throughout (m, rad, kg, s, N, N m); a recording or a model file may say otherwise of itself.
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
//! A model may come from text as well ([`Model::from_text`]). What is wrong with a file comes with its places:
//!
//! ```
//! let Err(modelmill::Error::Model(faults)) = modelmill::Model::from_text("arm.toml", "schema = 1\nname = 3") else {
//!     panic!("a name is a text");
//! };
//! assert!(faults.render(false).contains("arm.toml:2"));
//! ```
//!
//! # The verbs
//!
//! Each is a method: of [`Model`] where there is one, else of [`Host`].
//!
//! | verb | what it does |
//! |---|---|
//! | [`Model::check`] | what the model consists of, and its numeric rank beside the exact one |
//! | [`model::ModelChanges::between`] | what a variant changes |
//! | [`variants::VariantComparison::along`] | what it costs along recordings: forces, power, work, limits, error |
//! | [`Host::kinds`] | the kinds of effects that a model may have |
//! | [`Model::with_added_effects`] | the model with effects added to its file |
//! | [`Model::picture`] | the mechanism at a pose, as SVG |
//! | [`Model::equations`] | p_g, dependences, p_min and programs as a page |
//! | [`Model::generate`] | code |
//! | [`Model::evaluate`] | forces along a recording |
//! | [`Model::functions`] | forces, regressor, mass matrix and the like at given states |
//! | [`Model::identify`] | base parameters from recordings, eq. (12) |
//! | [`Model::compare`] | error figures, and where the error lives |
//! | [`Model::diagnose`] | which physical effect is missing |
//! | [`report::page`] | a diagnosis as one page |
//! | [`Host::simulate`] | a full-body rig along a trajectory |
//! | [`Host::reduce`] | a rig to a planar model |
//! | [`Host::import`] | a model file from a URDF, MJCF or SDF |
//! | [`export::description`], [`Model::export`] | a URDF or MJCF from a model file, or from a fit |
//! | [`Model::interpret`] | physical parameters from base parameters |
//! | [`Model::excite`] | the motion that tells base parameters, or effects, apart best |
//!
//! ## Check, compare variants, write equations and code
//!
//! ```
//! use modelmill::generate::{Code, Language};
//! use modelmill::model::{Changes, Format};
//! use modelmill::Model;
//!
//! let paper = Model::open("../model-spec/models/spidermill-paper.toml")?;
//! let consistent = Model::open("../model-spec/models/spidermill.toml")?;
//! let checked = paper.check()?;
//! assert_eq!((checked.summary.loops.len(), checked.rank.map(|rank| rank.shown.rank)), (1, Some(5)));
//!
//! let changes = Changes::between(&paper, &consistent);
//! assert!(!changes.base.is_empty());
//!
//! assert!(paper.equations(Format::Markdown)?.text.contains("p1_min"));
//! let module = &paper.generate(&Code { language: Language::default(), ..Code::default() })?[0];
//! assert!(module.text.contains("pub struct InverseDynamics"));
//! # Ok::<(), modelmill::Error>(())
//! ```
//!
//! ## Hold a model against recordings
//!
//! ```
//! use modelmill::Model;
//! use modelmill::identify::Estimation;
//! use modelmill::recording::Reading;
//!
//! let model = Model::open("../model-spec/models/spidermill-paper.toml")?;
//! let reading = Reading::default();
//! let fit = model.recording("../recordings/spidermill-mbs/plain-fit.csv", &reading)?;
//! let check = model.recording("../recordings/spidermill-mbs/plain-check.csv", &reading)?;
//!
//! let compared = model.compare(&[&check], &model.nominal)?;
//! let identified = model.identify(&[&fit], &[&check], &Estimation::default())?;
//! let after = identified.fit.check.as_ref().and_then(|figures| figures.nrms);
//! assert!(after < compared.figures.nrms);
//!
//! let forces = model.evaluate("../recordings/spidermill-mbs/plain-check.csv", &reading, &identified.values())?;
//! assert_eq!(forces.columns[0].0, "spindle_left");
//!
//! // Table 1 of the paper: physical parameters, the others held at their nominal values.
//! let unknown = ["m2", "m4", "dc3", "Ic12", "Ic32"].map(str::to_owned);
//! let physical = model.interpret(&identified.fit, "the fit", &unknown)?;
//! assert!(!physical.solutions().is_empty());
//! # Ok::<(), modelmill::Error>(())
//! ```
//!
//! ## Learn what is missing, and add it
//!
//! ```
//! use modelmill::diagnose::Question;
//! use modelmill::print::LibrarySpelling;
//! use modelmill::recording::Reading;
//! use modelmill::{Model, report};
//!
//! let model = Model::open("../model-spec/models/spidermill.toml")?;
//! let run = model.recording("../recordings/spidermill-mbs/with-rods-fit.csv", &Reading::default())?;
//! let other = model.recording("../recordings/spidermill-mbs/with-rods-check.csv", &Reading::default())?;
//! let findings = model.diagnose(&[&run], &[&other], &Question::default())?;
//! assert_eq!(findings.missing[0].effect.kind, "rod_inertia");
//!
//! let better = model.with(&findings.entries)?;
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
//! use modelmill::excite::{Limit, Options, Request};
//!
//! let arm = Model::open("../model-spec/models/two_link.toml")?;
//! let limits = ["q1=-1:1", "q1_d=2", "q2=-1.5:1.5", "q2_d=3"];
//! let found = arm.excite(
//!     &Request {
//!         options: Options { harmonics: 3, period: 5.0, random: 20, starts: 1, ..Options::default() },
//!         limits: limits.iter().map(|text| Limit::parse(text).unwrap()).collect(),
//!         ..Request::default()
//!     },
//!     &[],
//! )?;
//! assert!(found.found.condition_number <= found.found.start);
//!
//! let host = Host::new();
//! let rig = Path::new("../model-spec/rigs/spidermill-full.toml");
//! let plan = Path::new("../model-spec/rigs/spidermill-plan.toml");
//! let reduced = host.reduce(rig, Some(plan))?;
//! assert!(reduced.forces.iter().all(|force| force.nrms < 1e-6));
//! # Ok::<(), modelmill::Error>(())
//! ```
//!
//! # Progress, cancellation, remarks
//!
//! A [`progress::ProgressListener`] of the host hears which job goes on and how far it is, may stop it ([`Error::Cancelled`]), and hears
//! remarks as they come up. Results hold these remarks too, as [`RecordingNote`]s.
//!
//! # Layout
//!
//! In the order of the flow, each standing on those before it: [`text`], [`error`], [`progress`], [`host`], [`model`],
//! [`stretch`], [`along`], [`audit`], [`recording`], [`compare`], [`evaluate`], [`states`], [`identify`], [`diagnose`], [`add`], [`adopt`],
//! [`runs`], [`interpret`], [`excite`], [`variants`], [`generate`], [`simulate`], [`reduce`], [`mod@import`], [`mod@print`], [`report`].

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
#[cfg(feature = "rig")]
pub mod simulate;
pub mod states;
pub mod stretch;
pub mod text;
pub mod variants;

pub use modelmill_boundary::files;
pub use modelmill_identify::{FitFile, NoteSeverity, RecordingNote};
pub use modelmill_spec::{EffectKind, SCHEMA, bundled, edit};

pub use error::{Error, Outcome};
pub use host::Host;
pub use model::Model;
