//! The plan of a reduction: which bodies become one part, which become point masses, what shares a symbol.
//!
//! A TOML file goes in; its tables as types come out, with the places of all names.

use std::collections::BTreeMap;
use std::path::Path;

use modelmill_boundary::files::{DiskFiles, FileSource};
use modelmill_rig::{LoadFailure, Rig, RigLog, parse, source_span};
use modelmill_spec::{SourceFile, SourceFiles, read_text};
use serde::Deserialize;
use toml::Spanned;

/// A name, with its place.
pub(crate) type PlanName = Spanned<String>;

/// A plan that was read.
#[derive(Clone, Debug)]
pub struct ReductionPlan {
    pub(crate) entry: PlanEntry,
    /// The file that it was read from.
    pub sources: SourceFiles,
    /// The rig with points of the plan's own, where it has some.
    pub(crate) rig: Option<Box<Rig>>,
}

impl ReductionPlan {
    /// The rig that the plan is for: the one given, with the points that a made plan refers to.
    pub fn rig<'a>(&'a self, rig: &'a Rig) -> &'a Rig {
        self.rig.as_deref().unwrap_or(rig)
    }
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlanEntry {
    pub(crate) schema: Spanned<i64>,
    /// Name of the model.
    pub(crate) name: PlanName,
    pub(crate) title: Option<String>,
    #[serde(default)]
    pub(crate) plane: PlaneEntry,
    #[serde(default)]
    pub(crate) samples: SamplesEntry,
    #[serde(default)]
    pub(crate) group: Vec<GroupEntry>,
    #[serde(default)]
    pub(crate) part: Vec<PlanPartEntry>,
    #[serde(default)]
    pub(crate) lumped_mass: Vec<PlanLumpedMassEntry>,
    /// Names of rig points in the model, where they are to differ: model's name = rig's name.
    #[serde(default)]
    pub(crate) points: BTreeMap<PlanName, PlanName>,
    #[serde(default)]
    pub(crate) constants: BTreeMap<PlanName, PlanConstantEntry>,
    #[serde(default, rename = "loop")]
    pub(crate) loops: Vec<PlanLoopEntry>,
    #[serde(default)]
    pub(crate) drive: Vec<PlanDriveEntry>,
    /// Groups that the model shall not know.
    #[serde(default)]
    pub(crate) leave_out: Vec<PlanName>,
}

/// The plane of motion, in the rig's base frame.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct PlaneEntry {
    pub(crate) at: [f64; 3],
    pub(crate) normal: [f64; 3],
    /// The model's x axis.
    pub(crate) x: [f64; 3],
}

impl Default for PlaneEntry {
    fn default() -> Self {
        Self {
            at: [0.0; 3],
            normal: [0.0, 0.0, 1.0],
            x: [1.0, 0.0, 0.0],
        }
    }
}

/// Poses at which claims are checked.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct SamplesEntry {
    pub(crate) number: usize,
    /// How far coordinates go to either side of their nominal values, rad or m.
    pub(crate) range: f64,
}

impl Default for SamplesEntry {
    fn default() -> Self {
        Self {
            number: 200,
            range: 0.25,
        }
    }
}

/// Bodies that move as one in the plane, such as a front and a back loop.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct GroupEntry {
    pub(crate) name: PlanName,
    pub(crate) bodies: Vec<PlanName>,
}

/// A substitution part.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlanPartEntry {
    /// Name of the part and of its frame.
    pub(crate) name: PlanName,
    /// What it stands for; the first body of the first group leads.
    pub(crate) groups: Spanned<Vec<PlanName>>,
    /// The part that carries it, or `base`.
    pub(crate) on: PlanName,
    /// Point of the carrier where its joint is.
    pub(crate) at: PlanName,
    /// The same place on its leading body: origin of its frame.
    pub(crate) from: PlanName,
    /// Point of its leading body on its longitudinal axis, which is x.
    pub(crate) to: PlanName,
    /// Name of its joint's coordinate; passive unless the rig has one of this name.
    pub(crate) coordinate: PlanName,
    #[serde(default)]
    pub(crate) symbols: SymbolsEntry,
    /// `keep` or `drop`: what becomes of the centre's distance from the longitudinal axis.
    pub(crate) off_axis: Option<Spanned<String>>,
    pub(crate) note: Option<String>,
}

/// Names of a part's parameters; a name that two parts use ties them.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct SymbolsEntry {
    pub(crate) mass: Option<String>,
    pub(crate) centre: Option<String>,
    pub(crate) off_axis: Option<String>,
    pub(crate) inertia: Option<String>,
}

/// Groups whose mass is concentrated at points.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlanLumpedMassEntry {
    pub(crate) name: PlanName,
    pub(crate) groups: Spanned<Vec<PlanName>>,
    /// Points of the model, in equal shares.
    pub(crate) at: Spanned<Vec<PlanName>>,
    pub(crate) symbol: Option<String>,
    pub(crate) note: Option<String>,
}

/// A known quantity of the model and what it stands for.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlanConstantEntry {
    /// Such as `R2m.x`: a component of a model's point in the frame of its part.
    pub(crate) is: Vec<PlanName>,
    pub(crate) note: Option<String>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlanLoopEntry {
    pub(crate) name: PlanName,
    /// Points of the model.
    pub(crate) joins: [PlanName; 2],
}

/// How a drive of the rig is modelled.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlanDriveEntry {
    pub(crate) name: PlanName,
    /// Moves the contact points onto the longitudinal axes of their parts, at the same distance from the joint.
    #[serde(default)]
    pub(crate) contact_on_axis: bool,
}

/// Reads a plan from its text; `path` is what messages call it.
///
/// Fails with the place of what is wrong.
pub fn plan(path: &str, text: &str) -> Result<ReductionPlan, LoadFailure> {
    let sources = SourceFiles {
        files: vec![SourceFile {
            path: path.into(),
            text: text.to_owned(),
        }],
    };
    let fail = |diagnostics| LoadFailure {
        diagnostics,
        sources: sources.clone(),
    };
    let entry: PlanEntry = parse(text, 0).map_err(|found| fail(vec![*found]))?;
    let mut log = RigLog::default();
    let one =
        |log: &mut RigLog, is_bad: bool, range: std::ops::Range<usize>, says: &str, label: &str| {
            if is_bad {
                log.error(source_span(0, &range), says.to_owned(), label, "");
            }
        };
    one(
        &mut log,
        *entry.schema.get_ref() != 1,
        entry.schema.span(),
        "this schema of plans is not known",
        "expected 1",
    );
    let name = entry.name.get_ref();
    let is_word = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') && !name.is_empty();
    one(
        &mut log,
        !is_word,
        entry.name.span(),
        "this cannot be a model's name",
        "expected letters, digits and `_`",
    );
    let directions = [entry.plane.normal, entry.plane.x].map(nalgebra::Vector3::from);
    let across = directions[0].cross(&directions[1]).norm();
    let samples = &entry.samples;
    let top = 0..0;
    one(
        &mut log,
        !(across > 0.0 && across.is_finite()),
        top.clone(),
        "normal and x of the plane do not span a frame",
        "expected two directions in `[plane]`",
    );
    let is_sound =
        (4..=100_000).contains(&samples.number) && samples.range > 0.0 && samples.range <= 10.0;
    one(
        &mut log,
        !is_sound,
        top,
        "these samples check nothing",
        "expected 4 to 100000 in a range above zero and up to 10",
    );
    if log.0.is_empty() {
        Ok(ReductionPlan {
            entry,
            sources,
            rig: None,
        })
    } else {
        Err(fail(log.0))
    }
}

/// Reads a plan from disk.
pub fn plan_file(path: &Path) -> Result<ReductionPlan, LoadFailure> {
    plan_file_with(path, &DiskFiles::default())
}

/// Reads a plan from `files`.
pub fn plan_file_with(path: &Path, files: &dyn FileSource) -> Result<ReductionPlan, LoadFailure> {
    let advice = "give the path of a plan, such as `model-spec/rigs/spidermill-plan.toml`";
    let text = read_text(files, path, advice)?;
    plan(&path.to_string_lossy(), &text)
}
