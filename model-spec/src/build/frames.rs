//! Frames, in any order in the file, as a tree in which parents come first; and the points on them.
//!
//! Each frame becomes a list of elementary rotations and translations from its parent. Denavit-Hartenberg rows are in
//! the
//! order of Khalil and Kleinfinger (modified) or in the standard order.

use std::collections::BTreeMap;

use crate::angle::{angle, length};
use crate::build::MechanismSpans;
use crate::build::joints;
use crate::build::symbols::{SymbolTable, vector};
use crate::diagnostic::{Diagnostic, DiagnosticLog, SourceSpan};
use crate::exact::{ExactAngle, ExactExpression, ExactLength};
use crate::formula::SourceFormula;
use crate::mechanism::{
    FrameAxis, FrameConvention, FrameIdx, FramePoint, FrameStep, ModelFrame, PointIdx, carrying_frame,
};
use crate::schema::{DhEntry, FrameEntry, ModelEntry, TransformEntry};
use crate::scope::{FormulaRequirement, FormulaScope, SymbolSort};
use crate::suggest;
use crate::unit::UnitDimension;
use crate::values::SpannedName;

/// The frames, and their indices by name.
pub(super) struct FrameTree {
    /// The base first, and each parent before its children.
    pub(super) frames: Vec<ModelFrame>,
    /// Index of each frame by its name.
    names: BTreeMap<String, FrameIdx>,
    /// True if two frames have the same name. An unknown name may then be meant for one of them and is not reported.
    any_twice: bool,
}

// Later stages look up parents and carriers of points by name.
impl FrameTree {
    /// The frame that carries a frame without a joint in between: the same one if it moves relative to its parent.
    pub(super) fn carrying_frame(&self, frame: FrameIdx) -> FrameIdx {
        carrying_frame(&self.frames, frame)
    }

    /// The frame of a name; an unknown name is reported.
    pub(super) fn find(&self, name: &SpannedName, log: &mut DiagnosticLog) -> Option<FrameIdx> {
        let found = self.names.get(&name.text).copied();
        // With duplicate names an unknown name may be a consequence.
        if found.is_none() && !self.any_twice && !log.is_full() {
            let removal = log.removal(&["frame"], &name.text);
            log.push(
                Diagnostic::error(name.span, format!("unknown frame `{}`", name.text))
                    .label("expected the name of a frame, or `base`")
                    .with_removal_or(removal, || {
                        suggest::advice(&name.text, "frames", self.names.keys().map(String::as_str))
                    }),
            );
        }
        found
    }
}

/// Reads the frames, sorts them so that parents come first, and appends their places to `places.frames`.
/// The base is always the frame with index 0.
pub(super) fn frames(
    model: &ModelEntry,
    symbols: &SymbolTable,
    places: &mut MechanismSpans,
    log: &mut DiagnosticLog,
) -> FrameTree {
    let entries: Vec<&FrameEntry> = model.frame.iter().flat_map(|list| &list.entries).collect();
    // The first frame with a name keeps it; a second one is reported and left out.
    let mut by_name: BTreeMap<&str, usize> = BTreeMap::new();
    let mut any_twice = false;
    for (i, entry) in entries.iter().enumerate() {
        // `base` is reserved; other names must be unique.
        let Some(name) = &entry.name else { continue };
        if name.text == "base" {
            log.push(Diagnostic::error(name.span, "the frame `base` exists already").label("expected another name"));
        } else if let Some(first) = by_name.get(name.text.as_str()) {
            let first_span = entries[*first].name.as_ref().map_or(name.span, |name| name.span);
            log.push(duplicate_name("frame", name, first_span));
            any_twice = true;
        } else {
            by_name.insert(&name.text, i);
        }
    }
    // The tree starts with the base.
    let mut tree = FrameTree {
        frames: vec![ModelFrame {
            name: "base".to_owned(),
            parent: FrameIdx(0),
            steps: Vec::new(),
            convention: FrameConvention::Base,
        }],
        names: BTreeMap::from([("base".to_owned(), FrameIdx(0))]),
        any_twice,
    };
    places.frames.push(None);
    // Parents are already in the tree here; an unknown parent was reported and is replaced by the base.
    let order = parents_first(&entries, &by_name, any_twice, log);
    for i in order {
        let entry = entries[i];
        let Some(name) = &entry.name else { continue };
        let parent = entry
            .on
            .as_ref()
            .and_then(|on| tree.names.get(&on.text).copied())
            .unwrap_or(FrameIdx(0));
        // Steps from the parent, as elementary rotations and translations.
        let (steps, convention) = placement(entry, symbols, log);
        tree.names.insert(name.text.clone(), FrameIdx(tree.frames.len()));
        tree.frames.push(ModelFrame {
            name: name.text.clone(),
            parent,
            steps,
            convention,
        });
        places.frames.push(Some(name.span));
    }
    tree
}

/// The diagnostic of a name that is defined twice.
/// `what` is the sort of thing, and `first` the place of the first definition.
pub(super) fn duplicate_name(what: &str, name: &SpannedName, first: SourceSpan) -> Diagnostic {
    Diagnostic::error(name.span, format!("the {what} `{}` is defined twice", name.text))
        .label("defined again here")
        .related(first, "first defined here")
        .help("rename one of the two, or delete it")
}

/// Indices of the entries, parents first; unknown parents and cycles are reported, and such frames are fixed to the
/// base.
///
/// Depth-first search from each frame towards the base.
fn parents_first(
    entries: &[&FrameEntry],
    by_name: &BTreeMap<&str, usize>,
    any_twice: bool,
    log: &mut DiagnosticLog,
) -> Vec<usize> {
    /// The state of a frame during the search.
    #[derive(Clone, Copy, PartialEq)]
    enum FrameMark {
        /// Not visited yet.
        New,
        /// On the path that is followed now.
        OnPath,
        /// In the order already.
        Done,
    }
    let mut marks = vec![FrameMark::New; entries.len()];
    let mut order = Vec::new();
    // Walk from each frame to its parent until the base, a finished frame, or a fault ends the path.
    for start in by_name_order(entries, by_name) {
        let mut path = Vec::new();
        let mut at = start;
        loop {
            if marks[at] == FrameMark::Done {
                break;
            }
            // The path has reached one of its own frames.
            if marks[at] == FrameMark::OnPath {
                report_cycle(entries, &path, at, log);
                break;
            }
            marks[at] = FrameMark::OnPath;
            path.push(at);
            let Some(on) = &entries[at].on else { break };
            if on.text == "base" {
                break;
            }
            // An unknown parent is reported here only, where the names of all frames are known.
            let Some(&parent) = by_name.get(on.text.as_str()) else {
                if !any_twice && !log.is_full() {
                    let known = by_name.keys().copied().chain(["base"]);
                    let removal = log.removal(&["frame"], &on.text);
                    log.push(
                        Diagnostic::error(on.span, format!("unknown frame `{}`", on.text))
                            .label("expected the name of a frame, or `base`")
                            .with_removal_or(removal, || suggest::advice(&on.text, "frames", known)),
                    );
                }
                break;
            };
            at = parent;
        }
        // The path leads from a frame to its ancestors, so its reverse has parents first.
        for done in path.into_iter().rev() {
            marks[done] = FrameMark::Done;
            order.push(done);
        }
    }
    order
}

/// Indices of the entries that keep their names, in the order of the file.
fn by_name_order(entries: &[&FrameEntry], by_name: &BTreeMap<&str, usize>) -> Vec<usize> {
    (0..entries.len())
        .filter(|i| {
            entries[*i]
                .name
                .as_ref()
                .is_some_and(|name| by_name.get(name.text.as_str()) == Some(i))
        })
        .collect()
}

/// Reports frames whose parents form a cycle; `path` ends before the frame `at` is reached again.
fn report_cycle(entries: &[&FrameEntry], path: &[usize], at: usize, log: &mut DiagnosticLog) {
    let from = path.iter().position(|&one| one == at).unwrap_or(0);
    // The cycle starts at the first occurrence of the frame on the path.
    let names: Vec<&str> = path[from..]
        .iter()
        .chain([&at])
        .filter_map(|&one| entries[one].name.as_ref())
        .map(|name| name.text.as_str())
        .collect();
    let span = entries[at].on.as_ref().map_or(entries[at].span, |on| on.span);
    log.push(
        // Long cycles are described by their number of frames.
        Diagnostic::error(span, "these frames hang on one another in a circle")
            .label(if names.len() > 12 {
                format!("a circle of {} frames", names.len() - 1)
            } else {
                names.join(" on ")
            })
            .help("every chain of frames must end on `base`; close kinematic loops by `[[loop]]` instead"),
    );
}

/// The steps of a frame from its parent, and how the file describes them.
/// Exactly one of the three descriptions must be given; a joint without a transform is allowed.
fn placement(entry: &FrameEntry, symbols: &SymbolTable, log: &mut DiagnosticLog) -> (Vec<FrameStep>, FrameConvention) {
    let name_span = entry.name.as_ref().map_or(entry.span, |name| name.span);
    // Count the descriptions; `transform` and `joint` belong together.
    let n_ways = usize::from(entry.modified_dh.is_some())
        + usize::from(entry.standard_dh.is_some())
        + usize::from(entry.transform.is_some() || entry.joint.is_some());
    if n_ways != 1 && !log.syntax_broken && !(n_ways == 0 && entry.faulty) {
        log.push(
            Diagnostic::error(
                name_span,
                if n_ways == 0 {
                    "this frame is placed nowhere"
                } else {
                    "this frame is placed in more than one way"
                },
            )
            .label("expected one of `modified_dh`, `standard_dh`, `transform` (with or without `joint`)")
            .help("for example `modified_dh = { a = \"d1\", theta = \"theta1\" }`"),
        );
    }
    // Khalil and Kleinfinger: alpha and a belong to the parent's x axis.
    if let Some(dh) = &entry.modified_dh {
        let row = dh_row(dh, symbols, log);
        let steps = vec![
            FrameStep::Rotate(FrameAxis::X, row.alpha),
            FrameStep::Translate(FrameAxis::X, row.a),
            FrameStep::Rotate(FrameAxis::Z, row.theta),
            FrameStep::Translate(FrameAxis::Z, row.d),
        ];
        (without_zeros(steps), FrameConvention::ModifiedDh(row.texts))
    } else if let Some(dh) = &entry.standard_dh {
        // Denavit and Hartenberg: theta and d belong to the parent's z axis.
        let row = dh_row(dh, symbols, log);
        let steps = vec![
            FrameStep::Rotate(FrameAxis::Z, row.theta),
            FrameStep::Translate(FrameAxis::Z, row.d),
            FrameStep::Translate(FrameAxis::X, row.a),
            FrameStep::Rotate(FrameAxis::X, row.alpha),
        ];
        (without_zeros(steps), FrameConvention::StandardDh(row.texts))
    } else {
        let mut steps = Vec::new();
        let mut text = Vec::new();
        // A transform comes before its joint.
        if let Some(transform) = &entry.transform {
            transform_steps(transform, symbols, &mut steps, &mut text, log);
        }
        if let Some(joint) = &entry.joint {
            joints::steps(joint, symbols, &mut steps, &mut text, log);
        }
        (without_zeros(steps), FrameConvention::Transform(text.join(" ")))
    }
}

/// A Denavit-Hartenberg row.
struct DhRow {
    /// Length along x, m.
    a: ExactLength,
    /// Angle about x, rad.
    alpha: ExactAngle,
    /// Length along z, m.
    d: ExactLength,
    /// Angle about z, rad.
    theta: ExactAngle,
    /// The texts of `a`, `alpha`, `d` and `theta`, for print.
    texts: [String; 4],
}

/// Resolves a Denavit-Hartenberg row; omitted entries are zero.
fn dh_row(dh: &DhEntry, symbols: &SymbolTable, log: &mut DiagnosticLog) -> DhRow {
    // Omitted entries are printed as zero.
    let text = |formula: &Option<SourceFormula>| {
        formula
            .as_ref()
            .map_or_else(|| "0".to_owned(), |formula| formula.text.clone())
    };
    DhRow {
        a: length_or_zero(dh.a.as_ref(), symbols, "`a` of a frame", log),
        alpha: angle_or_zero(dh.alpha.as_ref(), symbols, log),
        d: length_or_zero(dh.d.as_ref(), symbols, "`d` of a frame", log),
        theta: angle_or_zero(dh.theta.as_ref(), symbols, log),
        texts: [text(&dh.a), text(&dh.alpha), text(&dh.d), text(&dh.theta)],
    }
}

/// A length with its coordinates; zero if absent or faulty. `what` names it in messages.
pub(super) fn length_or_zero(
    formula: Option<&SourceFormula>,
    symbols: &SymbolTable,
    what: &str,
    log: &mut DiagnosticLog,
) -> ExactLength {
    formula
        .and_then(|formula| length(formula, &symbols.scope, what, log))
        .unwrap_or_else(|| ExactLength {
            offset: ExactExpression::zero(),
            coordinates: Vec::new(),
        })
}

/// An angle with its coordinates; zero if absent or faulty.
pub(super) fn angle_or_zero(
    formula: Option<&SourceFormula>,
    symbols: &SymbolTable,
    log: &mut DiagnosticLog,
) -> ExactAngle {
    formula
        .and_then(|formula| angle(formula, &symbols.scope, log))
        .unwrap_or_else(ExactAngle::zero)
}

/// Appends the steps of a fixed transform: translations, then rotations about z, y and x.
/// `text` gets its description. Coordinates in a transform are reported, because it is fixed.
fn transform_steps(
    transform: &TransformEntry,
    symbols: &SymbolTable,
    steps: &mut Vec<FrameStep>,
    text: &mut Vec<String>,
    log: &mut DiagnosticLog,
) {
    // An entry of a vector, if the vector has it.
    let entry = |vector: &Option<crate::values::FormulaVector>, i: usize| {
        vector.as_ref().and_then(|vector| vector.entries.get(i)?.clone())
    };
    // Vectors are printed with three entries.
    let shown = |vector: &Option<crate::values::FormulaVector>| {
        (0..3)
            .map(|i| entry(vector, i).map_or_else(|| "0".to_owned(), |formula| formula.text))
            .collect::<Vec<_>>()
            .join(", ")
    };
    if transform.xyz.is_some() {
        text.push(format!("xyz({})", shown(&transform.xyz)));
    }
    if transform.rpy.is_some() {
        text.push(format!("rpy({})", shown(&transform.rpy)));
    }
    // A coordinate here would make a joint, which belongs into `joint`.
    for (i, axis) in [FrameAxis::X, FrameAxis::Y, FrameAxis::Z].into_iter().enumerate() {
        let along = entry(&transform.xyz, i);
        let along = length_or_zero(along.as_ref(), symbols, "the position of a frame", log);
        if let Some(formula) = entry(&transform.xyz, i).filter(|_| !along.coordinates.is_empty()) {
            log.push(moving_transform_error(&formula, "prismatic"));
        }
        steps.push(FrameStep::Translate(axis, along));
    }
    // Rz(yaw) Ry(pitch) Rx(roll): the fixed-axis angles in reverse order.
    for (i, axis) in [(2, FrameAxis::Z), (1, FrameAxis::Y), (0, FrameAxis::X)] {
        let about = entry(&transform.rpy, i);
        let about = angle_or_zero(about.as_ref(), symbols, log);
        let moves = about
            .terms
            .iter()
            .any(|(symbol, _)| matches!(symbol, crate::ModelSymbol::Coordinate(_)));
        if let Some(formula) = entry(&transform.rpy, i).filter(|_| moves) {
            log.push(moving_transform_error(&formula, "revolute"));
        }
        steps.push(FrameStep::Rotate(axis, about));
    }
}

/// The diagnostic of a coordinate in a fixed transform; `motion` is the kind of joint to use instead.
fn moving_transform_error(formula: &SourceFormula, motion: &str) -> Diagnostic {
    Diagnostic::error(formula.ast.span, "a transform is fixed, this one would move")
        .label("expected an expression without coordinates")
        .help(format!("put the coordinate into `joint = {{ {motion} = \"...\" }}`"))
}

/// The steps without rotations and translations by zero.
fn without_zeros(steps: Vec<FrameStep>) -> Vec<FrameStep> {
    // Steps by zero would only lengthen all derived expressions.
    steps
        .into_iter()
        .filter(|step| match step {
            FrameStep::Rotate(_, angle) => !angle.is_zero(),
            FrameStep::Translate(_, length) => !length.is_zero(),
            FrameStep::Free(_) => true,
        })
        .collect()
}

/// The points, and their indices by name.
pub(crate) struct PointTable {
    /// The points in the order of the file.
    pub(crate) points: Vec<FramePoint>,
    /// Index of each point by its name.
    names: BTreeMap<String, PointIdx>,
}

impl PointTable {
    /// The point of a name; an unknown name is reported.
    pub(super) fn find(&self, name: &SpannedName, log: &mut DiagnosticLog) -> Option<PointIdx> {
        let found = self.get(&name.text);
        if found.is_none() && !log.is_full() {
            let removal = log.removal(&["point"], &name.text);
            log.push(
                Diagnostic::error(name.span, format!("unknown point `{}`", name.text))
                    .label("expected the name of a point")
                    .with_removal_or(removal, || suggest::advice(&name.text, "points", self.names())),
            );
        }
        found
    }

    /// The point of a name, if there is one.
    pub(super) fn get(&self, name: &str) -> Option<PointIdx> {
        self.names.get(name).copied()
    }

    /// The names of all points, in alphabetical order.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> + Clone {
        self.names.keys().map(String::as_str)
    }
}

/// Reads the points and appends their places to `places.points`.
pub(super) fn points(
    model: &ModelEntry,
    scope: &FormulaScope,
    tree: &FrameTree,
    places: &mut MechanismSpans,
    log: &mut DiagnosticLog,
) -> PointTable {
    let mut points = PointTable {
        points: Vec::new(),
        names: BTreeMap::new(),
    };
    // A point with an unknown frame is kept on the base, so that its name stays known.
    for entry in model.point.iter().flat_map(|list| &list.entries) {
        let frame = entry.on.as_ref().and_then(|on| tree.find(on, log));
        let at = entry.at.as_ref().map_or_else(
            || std::array::from_fn(|_| ExactExpression::zero()),
            |at| {
                let wanted = FormulaRequirement {
                    sorts: &[SymbolSort::Constant],
                    dimension: UnitDimension::LENGTH,
                    what: "the position of a point",
                };
                vector(at, scope, wanted, log)
            },
        );
        let Some(name) = &entry.name else { continue };
        // Points with the same name are reported; the first one stays.
        if let Some(first) = points.names.get(&name.text) {
            log.push(duplicate_name("point", name, places.points[first.0]));
            continue;
        }
        points.names.insert(name.text.clone(), PointIdx(points.points.len()));
        places.points.push(name.span);
        points.points.push(FramePoint {
            name: name.text.clone(),
            frame: frame.unwrap_or(FrameIdx(0)),
            at,
        });
    }
    points
}
