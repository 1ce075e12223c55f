//! The plan of a reduction: which bodies become one part, which become point masses, which parameters share a symbol.
//!
//! A TOML file goes in; its tables come out as types, with the position of each name in the file.

use std::collections::BTreeMap;
use std::path::Path;

use modelmill_boundary::files::{DiskFiles, FileSource};
use modelmill_rig::{LoadFailure, Rig, RigLog, parse, source_span};
use modelmill_spec::{SourceFile, SourceFiles, read_text};
use serde::Deserialize;
use toml::Spanned;

/// A name with its position in the file.
pub(crate) type PlanName = Spanned<String>;

/// A plan that was read.
#[derive(Clone, Debug)]
pub struct ReductionPlan {
    /// The tables of the file.
    pub(crate) entry: PlanEntry,
    /// The file from which it was read.
    pub sources: SourceFiles,
    /// A copy of the rig with additional points, if the plan was generated.
    pub(crate) rig: Option<Box<Rig>>,
}

impl ReductionPlan {
    /// The rig for this plan: the given one, or its copy with the points of a generated plan.
    pub fn rig<'a>(&'a self, rig: &'a Rig) -> &'a Rig {
        self.rig.as_deref().unwrap_or(rig)
    }
}

/// The tables of a plan.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlanEntry {
    /// Version of the format, 1.
    pub(crate) schema: Spanned<i64>,
    /// Name of the model.
    pub(crate) name: PlanName,
    /// Title of the model.
    pub(crate) title: Option<String>,
    /// The plane of motion.
    #[serde(default)]
    pub(crate) plane: PlaneEntry,
    /// The sampled poses.
    #[serde(default)]
    pub(crate) samples: SamplesEntry,
    /// Groups of bodies.
    #[serde(default)]
    pub(crate) group: Vec<GroupEntry>,
    /// Substitution parts; a carrier stands before what it carries.
    #[serde(default)]
    pub(crate) part: Vec<PlanPartEntry>,
    /// Groups that become point masses.
    #[serde(default)]
    pub(crate) lumped_mass: Vec<PlanLumpedMassEntry>,
    /// New names of rig points in the model: model's name = rig's name.
    #[serde(default)]
    pub(crate) points: BTreeMap<PlanName, PlanName>,
    /// Named constants of the model.
    #[serde(default)]
    pub(crate) constants: BTreeMap<PlanName, PlanConstantEntry>,
    /// Loop closures.
    #[serde(default, rename = "loop")]
    pub(crate) loops: Vec<PlanLoopEntry>,
    /// Options of drives.
    #[serde(default)]
    pub(crate) drive: Vec<PlanDriveEntry>,
    /// Groups that are left out of the model.
    #[serde(default)]
    pub(crate) leave_out: Vec<PlanName>,
}

/// The plane of motion, in the rig's base frame.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct PlaneEntry {
    /// The model's origin, m.
    pub(crate) at: [f64; 3],
    /// The normal, of any length.
    pub(crate) normal: [f64; 3],
    /// The model's x axis, of any length.
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

/// Poses at which assumptions are checked.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct SamplesEntry {
    /// Number of poses.
    pub(crate) number: usize,
    /// Largest distance of coordinates from their nominal values, rad or m.
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
    /// Name of the group.
    pub(crate) name: PlanName,
    /// Names of bodies of the rig.
    pub(crate) bodies: Vec<PlanName>,
}

/// A substitution part.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlanPartEntry {
    /// Name of the part and of its frame.
    pub(crate) name: PlanName,
    /// Groups that it combines; the first body of the first group is the leading one.
    pub(crate) groups: Spanned<Vec<PlanName>>,
    /// The part that carries it, or `base`.
    pub(crate) on: PlanName,
    /// Point of the carrier where its joint is.
    pub(crate) at: PlanName,
    /// The same point on its leading body: origin of its frame.
    pub(crate) from: PlanName,
    /// Point of its leading body on its longitudinal axis, which is x.
    pub(crate) to: PlanName,
    /// Name of its joint's coordinate; passive unless the rig has one of this name.
    pub(crate) coordinate: PlanName,
    /// Names of its parameters.
    #[serde(default)]
    pub(crate) symbols: SymbolsEntry,
    /// `keep` or `drop` the distance of the centre of mass from the longitudinal axis.
    pub(crate) off_axis: Option<Spanned<String>>,
    /// Note in the model file.
    pub(crate) note: Option<String>,
}

/// Names of a part's parameters; two parts with the same name share the parameter.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct SymbolsEntry {
    /// Symbol of the mass.
    pub(crate) mass: Option<String>,
    /// Symbol of the centre of mass along the longitudinal axis.
    pub(crate) centre: Option<String>,
    /// Symbol of the centre of mass across the longitudinal axis.
    pub(crate) off_axis: Option<String>,
    /// Symbol of the inertia about the centre of mass.
    pub(crate) inertia: Option<String>,
}

/// Groups whose mass is concentrated at points.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlanLumpedMassEntry {
    /// Name of the point mass.
    pub(crate) name: PlanName,
    /// Groups that it combines.
    pub(crate) groups: Spanned<Vec<PlanName>>,
    /// Points of the model, in equal shares.
    pub(crate) at: Spanned<Vec<PlanName>>,
    /// Symbol of the mass.
    pub(crate) symbol: Option<String>,
    /// Note in the model file.
    pub(crate) note: Option<String>,
}

/// A known quantity of the model.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlanConstantEntry {
    /// The components that it represents, such as `R2m.x` for a point of the model in the frame of its part.
    pub(crate) is: Vec<PlanName>,
    /// Note in the model file.
    pub(crate) note: Option<String>,
}

/// A loop closure.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlanLoopEntry {
    /// Name of the loop.
    pub(crate) name: PlanName,
    /// The two points of the model that coincide.
    pub(crate) joins: [PlanName; 2],
}

/// How a drive of the rig is modelled.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlanDriveEntry {
    /// Name of the drive.
    pub(crate) name: PlanName,
    /// Whether to move the contact points onto the longitudinal axes of their parts, at the same distance from the
    /// joint.
    #[serde(default)]
    pub(crate) contact_on_axis: bool,
}

/// Reads a plan from its text; `path` is its name in messages.
///
/// Fails with all faults and their positions.
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
    // Faults of the syntax end the reading; those of the values are collected.
    let entry: PlanEntry = parse(text, 0).map_err(|found| fail(vec![*found]))?;
    let mut log = RigLog::default();
    let one = |log: &mut RigLog, is_bad: bool, range: std::ops::Range<usize>, says: &str, label: &str| {
        if is_bad {
            log.error(source_span(0, &range), says.to_owned(), label, "");
        }
    };
    one(
        &mut log,
        *entry.schema.get_ref() != 1,
        entry.schema.span(),
        "this version of plans is unknown",
        "expected 1",
    );
    let name = entry.name.get_ref();
    let is_word = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') && !name.is_empty();
    one(
        &mut log,
        !is_word,
        entry.name.span(),
        "this is not a valid name of a model",
        "expected letters, digits and `_`",
    );
    // Normal and x must not be parallel.
    let directions = [entry.plane.normal, entry.plane.x].map(nalgebra::Vector3::from);
    let across = directions[0].cross(&directions[1]).norm();
    let samples = &entry.samples;
    let top = 0..0;
    one(
        &mut log,
        !(across > 0.0 && across.is_finite()),
        top.clone(),
        "normal and x of the plane do not define a frame",
        "expected two directions in `[plane]` that are not parallel",
    );
    // Limits of the number of samples and of their range.
    let is_sound = (4..=100_000).contains(&samples.number) && samples.range > 0.0 && samples.range <= 10.0;
    one(
        &mut log,
        !is_sound,
        top,
        "number or range of the samples is not possible",
        "expected 4 to 100000 samples, in a range above 0 and up to 10",
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
