//! An atlas of mechanisms: how many base parameters each has, what they are, and what its functions cost.
//!
//! Base parameters are counted for bodies alone, without what the file's effects add, so that they can be held against
//! published ones: with gravity and without, for constants in general and in numbers for the file's values.

use std::fmt::Write as _;

use modelmill_codegen::{OperationCount, ProgramStage, ReductionMethod};
use modelmill_spec::{CoordinateMotion, ExactExpression, LoadedModel, Mechanism};

use crate::error::Outcome;
use crate::model::Model;
use crate::text::table::{count, significant};

/// What the atlas says of a mechanism.
#[derive(Clone, Debug, PartialEq)]
pub struct AtlasEntry {
    /// The model's name; files of the atlas are called so.
    pub name: String,
    /// Its title.
    pub title: String,
    /// Joints that turn and joints that slide, those that loops settle among them.
    pub joints: [usize; 2],
    /// Bodies that hang on nothing.
    pub free: usize,
    /// Coordinates that loops settle.
    pub passive: usize,
    /// Loops.
    pub loops: usize,
    /// Drives.
    pub drives: usize,
    /// Base parameters of the bodies for constants in general: with gravity and without.
    pub base: [usize; 2],
    /// The rank in numbers, eq. (9), of the same at the file's values, with gravity.
    pub at_values: usize,
    /// Whether general constants were reduced exactly.
    pub is_exact: bool,
    /// Effects beside the bodies, and the base parameters with them.
    pub effects: [usize; 2],
    /// Operations of the regressor and of the inverse dynamics per state, effects included.
    pub operations: [OperationCount; 2],
    /// Seconds that it took to derive the model, if they were measured.
    pub seconds: Option<f64>,
    /// Whether the model was made of a robot description: it has a line and a picture, but no page of expressions.
    pub is_imported: bool,
}

impl Model {
    /// What the atlas says of this model; `seconds` is how long it took to derive, if that was measured.
    ///
    /// Fails where a variant of it (without gravity, without effects) cannot be derived.
    pub fn atlas(&self, seconds: Option<f64>) -> Outcome<AtlasEntry> {
        let derivation = &self.derivation;
        let mechanism = &derivation.mechanism;
        let mut bodies = mechanism.clone();
        bodies.effects.clear();
        bodies.retain.clear();
        let mut weightless = bodies.clone();
        weightless.gravity = std::array::from_fn(|_| ExactExpression::Sum(Vec::new()));
        let general = if mechanism.effects.is_empty() {
            self.clone()
        } else {
            self.derive_variant(bodies)?
        };
        let base = [&general, &self.derive_variant(weightless)?].map(|m| m.base.len());
        let at_values = general
            .check()?
            .rank
            .map_or(0, |rank| rank.numeric_rank.rank);
        let of = |motion: CoordinateMotion| {
            let coordinates = mechanism.coordinates.iter();
            coordinates.filter(|c| c.motion == motion).count()
        };
        let free = of(CoordinateMotion::QuaternionScalar);
        let programs = &derivation.programs;
        Ok(AtlasEntry {
            name: self.name.clone(),
            title: mechanism.title.clone().unwrap_or_default(),
            // The position of a free body is no joint.
            joints: [
                of(CoordinateMotion::Revolute),
                of(CoordinateMotion::Prismatic) - 3 * free,
            ],
            free,
            passive: mechanism.coordinates.iter().filter(|c| c.passive).count(),
            loops: mechanism.loops.len(),
            drives: mechanism.drives.iter().filter(|d| d.is_driven).count()
                + mechanism.shared_drives.len(),
            base,
            at_values,
            is_exact: matches!(derivation.reduction.method, ReductionMethod::Exact { .. }),
            effects: [mechanism.effects.len(), derivation.reduction.retained.len()],
            operations: [
                programs.regressor.count_operations(ProgramStage::State),
                programs
                    .inverse_dynamics
                    .count_operations(ProgramStage::State),
            ],
            seconds,
            is_imported: false,
        })
    }

    /// The base parameters as a page of the atlas: expressions, with the values of the file, beside the picture.
    pub fn atlas_page(&self, entry: &AtlasEntry) -> String {
        let mut text = format!(
            "# {}\n\n{}.\n\n![{}]({}.svg)\n\n{}.\n\n## Base parameters, eq. (16)\n\n| | expression | value | unit |\n|---|---|---:|---|\n",
            entry.name,
            entry.title,
            entry.name,
            entry.name,
            entry.summary_text(),
        );
        for (base, value) in self.base.iter().zip(&self.nominal) {
            let _ = writeln!(
                text,
                "| `{}` | `{}` | {} | {} |",
                base.name,
                base.expression.replace('|', "\\|"),
                significant(*value, 6),
                base.unit
            );
        }
        text.push_str("\n[All mechanisms](../atlas.md)\n");
        text
    }

    /// The same model of another mechanism.
    fn derive_variant(&self, mechanism: Mechanism) -> Outcome<Self> {
        let mut loaded = LoadedModel::clone(&self.loaded);
        loaded.mechanism = mechanism;
        self.host().derive(&self.path, loaded)
    }
}

impl AtlasEntry {
    pub(crate) fn summary_text(&self) -> String {
        let [turning, sliding] = self.joints;
        let mut parts = Vec::new();
        for (n, one, many) in [
            (self.free, "free body", "free bodies"),
            (turning, "joint that turns", "joints that turn"),
            (sliding, "joint that slides", "joints that slide"),
            (self.loops, "loop", "loops"),
            (self.drives, "drive", "drives"),
        ] {
            if n > 0 {
                parts.push(count(n, one, many));
            }
        }
        parts.join(", ")
    }

    pub(crate) fn joints_in_letters(&self) -> String {
        let [turning, sliding] = self.joints;
        let mut parts = Vec::new();
        for (n, letter) in [(self.free, "free"), (turning, "R"), (sliding, "P")] {
            if n > 0 {
                parts.push(format!("{n} {letter}"));
            }
        }
        parts.join(" + ")
    }

    /// The line of the table.
    fn row(&self) -> String {
        let [with, without] = self.base;
        let operations = |count: &OperationCount| format!("{} + {}", count.add, count.mul);
        let [regressor, dynamics] = &self.operations;
        let effects = match self.effects {
            [0, _] => "-".to_owned(),
            [n, base] => format!("{base} with {n}"),
        };
        let name = &self.name;
        let named = if self.is_imported {
            format!("`{name}` (imported)")
        } else {
            format!("[`{name}`]({name}.md)")
        };
        format!(
            "| ![]({name}.svg) | {named} | {} | {} | {} | {} | {with}{} | {without} | {} | {effects} | {} | {} | {} |",
            self.joints_in_letters(),
            self.passive,
            self.loops,
            self.drives,
            if self.is_exact { "" } else { " (numeric)" },
            self.at_values,
            operations(regressor),
            operations(dynamics),
            self.seconds
                .map_or_else(|| "-".to_owned(), |s| significant(s, 2)),
        )
        .replace("](", "](atlas/")
    }
}

/// What the atlas is, and what its columns are.
pub(crate) const ABOUT: [&str; 2] = [
    "How many parameters the inverse dynamics of a mechanism has, and what they are: the columns of `H` eliminated and \
     regrouped exactly, eqs. (6) to (16).",
    "Counts are of the bodies alone: *general* for constants in general with gravity, *weightless* without gravity, *at \
     values* the rank in numbers at the values of the model file, where lengths that are zero or equal let fewer remain. \
     *With effects* is the number with the effects of the file, such as friction. Operations are additions and \
     multiplications of one call at one state, effects included. Joints: R turns, P slides, free hangs on nothing; \
     *passive* are coordinates that loops settle. Seconds are those of one derivation on the machine that wrote this \
     page. What is *imported* was made of a robot description of other people, and has no page of expressions.",
];

/// The atlas as a page in Markdown; pictures and pages of the mechanisms stand in the folder `atlas` beside it.
pub fn page(entries: &[AtlasEntry]) -> String {
    let mut text = format!(
        "# Atlas of mechanisms\n\n{}\n\n\
        | | mechanism | joints | passive | loops | drives | general | weightless | at values | with effects | regressor | \
        inverse dynamics | s |\n|---|---|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|\n",
        ABOUT.join("\n\n")
    );
    for entry in entries {
        text.push_str(&entry.row());
        text.push('\n');
    }
    text
}
