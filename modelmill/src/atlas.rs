//! An atlas of mechanisms: how many base parameters each has, what they are, and how many operations its functions
//! need.
//!
//! Base parameters are counted twice, with gravity and without it. They are counted for the bodies alone, without the
//! effects of the file, so that the numbers can be compared with published ones. They are counted symbolically, for
//! arbitrary values of the constants, and numerically, for the file's values.

use modelmill_boundary::text::MarkdownText;
use modelmill_codegen::{OperationCount, ProgramStage, ReductionMethod};
use modelmill_spec::{CoordinateMotion, ExactExpression, LoadedModel, Mechanism};

use crate::error::Outcome;
use crate::model::Model;
use crate::text::table::{count, significant};

/// The figures of one mechanism in the atlas.
#[derive(Clone, Debug, PartialEq)]
pub struct AtlasEntry {
    /// The model's name; also the stem of its files in the atlas.
    pub name: String,
    /// Its title.
    pub title: String,
    /// Numbers of revolute and of prismatic joints, including passive ones (determined by loop closure).
    pub joints: [usize; 2],
    /// Number of free bodies (with six degrees of freedom) whose orientation is a quaternion. The coordinates of a free
    /// body with three angles are counted in `joints`.
    pub free: usize,
    /// Number of passive coordinates (determined by loop closure).
    pub passive: usize,
    /// Number of loops.
    pub loops: usize,
    /// Number of drives.
    pub drives: usize,
    /// Numbers of base parameters of the bodies for arbitrary values of the constants: with gravity and without.
    pub base: [usize; 2],
    /// The numeric rank, eq. (9), of the bodies' regressor at the file's values, with gravity.
    pub at_values: usize,
    /// Whether the reduction is exact for arbitrary values of the constants; otherwise it is numeric.
    pub is_exact: bool,
    /// Number of effects in the file, and number of base parameters of the model with these effects.
    pub effects: [usize; 2],
    /// Numbers of operations of the regressor and of the inverse dynamics per state, effects included.
    pub operations: [OperationCount; 2],
    /// Time of the derivation, s, if it was measured.
    pub seconds: Option<f64>,
    /// Whether the model was imported from a robot description. Then it has a row in the table and a picture, but no
    /// page of expressions.
    pub is_imported: bool,
}

impl Model {
    /// The atlas entry of this model; `seconds` is the time of its derivation, if that was measured.
    ///
    /// Fails where a variant of it (without gravity, without effects) cannot be derived.
    pub fn atlas(&self, seconds: Option<f64>) -> Outcome<AtlasEntry> {
        let derivation = &self.derivation;
        let mechanism = &derivation.mechanism;
        // Three variants are counted: bodies alone, bodies without gravity, and the model with its effects.
        let mut bodies = mechanism.clone();
        bodies.effects.clear();
        bodies.retain.clear();
        let mut weightless = bodies.clone();
        weightless.gravity = std::array::from_fn(|_| ExactExpression::Sum(Vec::new()));
        // A model without effects is its own variant, so that one derivation is saved.
        let general = if mechanism.effects.is_empty() {
            self.clone()
        } else {
            self.derive_variant(bodies)?
        };
        let base = [&general, &self.derive_variant(weightless)?].map(|m| m.base.len());
        let at_values = general.check()?.rank.map_or(0, |rank| rank.numeric_rank.rank);
        let of = |motion: CoordinateMotion| {
            let coordinates = mechanism.coordinates.iter();
            coordinates.filter(|c| c.motion == motion).count()
        };
        let free = of(CoordinateMotion::QuaternionScalar);
        let programs = &derivation.programs;
        Ok(AtlasEntry {
            name: self.name.clone(),
            title: mechanism.title.clone().unwrap_or_default(),
            // The three position coordinates of a free body are prismatic, but are no joints.
            joints: [
                of(CoordinateMotion::Revolute),
                of(CoordinateMotion::Prismatic) - 3 * free,
            ],
            free,
            passive: mechanism.coordinates.iter().filter(|c| c.passive).count(),
            loops: mechanism.loops.len(),
            drives: mechanism.drives.iter().filter(|d| d.is_driven).count() + mechanism.shared_drives.len(),
            base,
            at_values,
            is_exact: matches!(derivation.reduction.method, ReductionMethod::Exact { .. }),
            effects: [mechanism.effects.len(), derivation.reduction.retained.len()],
            operations: [
                programs.regressor.count_operations(ProgramStage::State),
                programs.inverse_dynamics.count_operations(ProgramStage::State),
            ],
            seconds,
            is_imported: false,
        })
    }

    /// The page of one mechanism: picture, summary, and base parameters with the values of the file.
    pub fn atlas_page(&self, entry: &AtlasEntry) -> String {
        let mut page = MarkdownText::default();
        page.marks("# ").text(&entry.name).marks("\n\n").text(&entry.title);
        page.marks(".\n\n").picture(&entry.name, &format!("{}.svg", entry.name));
        page.marks("\n\n").text(&entry.summary_text());
        page.marks(".\n\n## Base parameters\n\n| | expression | value | unit |\n|---|---|---:|---|\n");
        for (base, value) in self.base.iter().zip(&self.values) {
            page.marks("| ").code(&base.name).marks(" | ").code(&base.expression);
            page.marks(" | ").text(&significant(*value, 6)).marks(" | ");
            page.text(&base.unit).marks(" |\n");
        }
        page.marks("\n[All mechanisms](../atlas.md)\n");
        page.into_string()
    }

    /// The model with another mechanism in place of its own, derived anew.
    ///
    /// Fails when the derivation fails or is cancelled.
    fn derive_variant(&self, mechanism: Mechanism) -> Outcome<Self> {
        let mut loaded = LoadedModel::clone(&self.loaded);
        loaded.mechanism = mechanism;
        self.host().derive(&self.path, loaded)
    }
}

impl AtlasEntry {
    /// Numbers of free bodies, joints, loops and drives as one phrase; zero counts are omitted.
    pub(crate) fn summary_text(&self) -> String {
        let [turning, sliding] = self.joints;
        let mut parts = Vec::new();
        for (n, one, many) in [
            (self.free, "free body", "free bodies"),
            (turning, "revolute joint", "revolute joints"),
            (sliding, "prismatic joint", "prismatic joints"),
            (self.loops, "loop", "loops"),
            (self.drives, "drive", "drives"),
        ] {
            if n > 0 {
                parts.push(count(n, one, many));
            }
        }
        parts.join(", ")
    }

    /// Joints by letters, such as `1 free + 3 R + 2 P`.
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

    /// Adds the table line of the mechanism.
    fn write_row(&self, page: &mut MarkdownText) {
        let [with, without] = self.base;
        let operations = |count: &OperationCount| format!("{} + {}", count.add, count.mul);
        let [regressor, dynamics] = &self.operations;
        let effects = match self.effects {
            [0, _] => "-".to_owned(),
            [n, base] => format!("{base} with {n}"),
        };
        // Pictures and pages are in a folder next to the table.
        let file = |ending: &str| format!("atlas/{}.{ending}", self.name);
        page.marks("| ").picture("", &file("svg")).marks(" | ");
        if self.is_imported {
            page.code(&self.name).marks(" (imported)");
        } else {
            page.code_link(&self.name, &file("md"));
        }
        let base = format!("{with}{}", if self.is_exact { "" } else { " (numeric)" });
        let cells = [
            self.joints_in_letters(),
            self.passive.to_string(),
            self.loops.to_string(),
            self.drives.to_string(),
            base,
            without.to_string(),
            self.at_values.to_string(),
            effects,
            operations(regressor),
            operations(dynamics),
            self.seconds.map_or_else(|| "-".to_owned(), |s| significant(s, 2)),
        ];
        for cell in cells {
            page.marks(" | ").text(&cell);
        }
        page.marks(" |\n");
    }
}

/// Two paragraphs: what the atlas shows, and what its columns mean.
pub(crate) const ABOUT: [&str; 2] = [
    "How many parameters the inverse dynamics of a mechanism has, and what they are: the columns of `H` eliminated and \
     regrouped exactly, eqs. (6) to (16).",
    "Counts are of the bodies alone: *general* for constants in general with gravity, *weightless* without gravity, *at \
     values* the rank in numbers at the values of the model file, where zero or equal lengths leave fewer. \
     *With effects* is the number with the effects of the file, such as friction. Operations are additions and \
     multiplications of one call at one state, effects included. Joints: R revolute, P prismatic, free for a free body; \
     *passive* coordinates are determined by loop closure. Seconds are those of one derivation on the machine that wrote this \
     page. *Imported* mechanisms come from published robot descriptions and have no page of expressions.",
];

/// The atlas as a page in Markdown; pictures and pages of the mechanisms are in the folder `atlas` next to it.
pub fn page(entries: &[AtlasEntry]) -> String {
    let mut page = MarkdownText::default();
    page.marks("# Atlas of mechanisms\n\n")
        .marks(ABOUT[0])
        .marks("\n\n")
        .marks(ABOUT[1]);
    page.marks(
        "\n\n| | mechanism | joints | passive | loops | drives | general | weightless | at values | with effects | regressor | \
         inverse dynamics | s |\n|---|---|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|\n",
    );
    for entry in entries {
        entry.write_row(&mut page);
    }
    page.into_string()
}
