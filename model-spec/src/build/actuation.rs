//! Loops, drives and the columns of recordings.
//!
//! The tables `loop`, `drive` and `recording` of a file go in. Out come the loops, the rows of the equation of
//! motion,
//! and the names and factors of recorded columns.
//!
//! Decision: a degree of freedom without a drive becomes a row of the equation of motion with a drive that is not
//! driven. It is named after its coordinate, and its force is zero unless it was recorded. So there are as many
//! drives as degrees of freedom, the drives' Jacobian has a row of the unit matrix there, and no stage needs a second
//! kind of rows.

use std::collections::BTreeMap;

use crate::actuators::ModelActuator;
use crate::build::MechanismSpans;
use crate::build::bodies::check_unique;
use crate::build::frames::{FrameTree, PointTable, duplicate_name};
use crate::build::free;
use crate::build::symbols::SymbolTable;
use crate::build::welds::weld_loops;
use crate::column;
use crate::diagnostic::{Diagnostic, DiagnosticLog, SourceSpan};
use crate::exact::{CoordinateIdx, ExactExpression, ModelSymbol};
use crate::mechanism::{DriveKind, KinematicLoop, ModelDrive, PointIdx};
use crate::schema::ModelEntry;
use crate::scope::SymbolSort;
use crate::suggest;
use crate::values::SpannedName;

/// Most loops of a mechanism.
const MOST_LOOPS: usize = 60;

/// Reads the loops: pairs of points on different frames that coincide, and pairs of frames that are welded.
///
/// Points of welds are appended to `points`, and their places to `places.points`. The places of loops are appended to
/// `places.loops`. A faulty loop is reported and left out.
pub(super) fn loops(
    model: &ModelEntry,
    tree: &FrameTree,
    points: &mut PointTable,
    places: &mut MechanismSpans,
    log: &mut DiagnosticLog,
) -> Vec<KinematicLoop> {
    let entries = model.loops.as_ref().map_or(&[][..], |list| list.entries.as_slice());
    if let Some(entry) = entries.get(MOST_LOOPS) {
        log.push(Diagnostic::error(entry.span, "there are too many loops").label(format!("at most {MOST_LOOPS}")));
    }
    // Loops beyond the limit are not looked at.
    let mut loops: Vec<KinematicLoop> = Vec::new();
    // The place of each loop's name.
    let mut name_spans: Vec<SourceSpan> = Vec::new();
    for entry in entries.iter().take(MOST_LOOPS) {
        let joins = match (&entry.joins, &entry.welds) {
            (Some(joins), None) => joins,
            (None, Some(welds)) => {
                loops.extend(weld_loops(entry.name.as_ref(), welds, tree, points, places, log));
                name_spans.resize(loops.len(), entry.name.as_ref().map_or(welds.span, |name| name.span));
                continue;
            }
            _ if log.syntax_broken || entry.faulty => continue,
            _ => {
                log.push(
                    Diagnostic::error(entry.span, "this loop does not specify what it joins")
                        .label("expected either `joins` or `welds`")
                        .help("for example `joins = [\"A\", \"B\"]` for two points, or `welds = [\"f\", \"g\"]` for two frames"),
                );
                continue;
            }
        };
        let [first, second] = joins.entries.as_slice() else {
            log.push(
                Diagnostic::error(
                    joins.span,
                    format!("a loop joins two points, not {}", joins.entries.len()),
                )
                .label("expected the names of two points")
                .help("write one `[[loop]]` for each pair"),
            );
            continue;
        };
        // Both names are looked up, so that both are reported if both are unknown.
        let (Some(one), Some(other)) = (points.find(first, log), points.find(second, log)) else {
            continue;
        };
        // Two points on one frame can never move relative to each other.
        if points.points[one.0].frame == points.points[other.0].frame {
            log.push(
                Diagnostic::error(joins.span, "these two points are fixed to the same frame")
                    .label("a loop closes between two chains of frames"),
            );
            continue;
        }
        places.loops.push(joins.span);
        // Without a name a loop is called after its two points.
        loops.push(KinematicLoop {
            name: entry
                .name
                .as_ref()
                .map_or_else(|| format!("{}_{}", first.text, second.text), |name| name.text.clone()),
            joins: [one, other],
        });
        name_spans.push(entry.name.as_ref().map_or(joins.span, |name| name.span));
    }
    // Names must be unique, given or not; a weld has three loops.
    let names = loops.iter().zip(name_spans).map(|(closure, span)| SpannedName {
        text: closure.name.clone(),
        span,
    });
    check_unique("loop", names.collect::<Vec<_>>().iter(), log);
    loops
}

/// Rows of the equation of motion, and the drives that share them where there are more drives than rows.
pub(super) struct DriveRows {
    /// One row per degree of freedom, with the drive that acts on it.
    pub(super) rows: Vec<ModelDrive>,
    /// Drives without rows of their own; empty unless there are more drives than degrees of freedom.
    pub(super) shared: Vec<ModelDrive>,
}

/// Reads the drives. There must be one per driven degree of freedom, or more than there are degrees of freedom.
///
/// Each degree of freedom without a drive has a row of its own, named after its coordinate. Rows of free bodies come
/// first,
/// those of undriven joints last.
pub(super) fn drives(
    model: &ModelEntry,
    symbols: &SymbolTable,
    tree: &FrameTree,
    points: &PointTable,
    places: &mut MechanismSpans,
    log: &mut DiagnosticLog,
) -> DriveRows {
    let entries = model.drive.as_ref().map_or(&[][..], |list| list.entries.as_slice());
    let before = log.n_errors();
    // Each entry is read with its kind; drives with faults keep their names.
    let mut drives: Vec<ModelDrive> = Vec::new();
    // Whether each drive acts where its entry states; faulty ones stay in the list only to keep their names known.
    let mut known = Vec::new();
    for entry in entries {
        // Exactly one of `joint` and `linear` states how a drive acts.
        let kind = match (&entry.joint, &entry.linear) {
            (Some(joint), None) => coordinate(joint, symbols, log).map(DriveKind::Joint),
            (None, Some(linear)) => {
                let from = linear.from.as_ref().and_then(|name| points.find(name, log));
                let to = linear.to.as_ref().and_then(|name| points.find(name, log));
                from.zip(to)
                    .filter(|(from, to)| acts_between_bodies([*from, *to], tree, points, linear.span, log))
                    .map(|(from, to)| DriveKind::Linear { from, to })
            }
            _ if log.syntax_broken || entry.faulty => None,
            _ => {
                log.push(
                    Diagnostic::error(entry.span, "this drive does not specify what it drives")
                        .label("expected either `joint` or `linear`")
                        .help("for example `joint = \"q1\"`, or `linear = { from = \"B\", to = \"A\" }`"),
                );
                None
            }
        };
        let Some(name) = &entry.name else { continue };
        if name.text == "t" {
            // Its force would be read from the column of the time.
            log.push(
                Diagnostic::error(name.span, "a drive cannot be called `t`")
                    .label("recordings have the time in the column `t`")
                    .help("choose another name, such as `motor`"),
            );
        }
        // A second drive with the same name is left out.
        if let Some(first) = drives.iter().position(|drive| drive.name == name.text) {
            log.push(duplicate_name("drive", name, places.drives[first]));
            continue;
        }
        // Two drives on one coordinate would have equal columns.
        if let Some(DriveKind::Joint(joint)) = kind
            && let Some(first) = drives
                .iter()
                .zip(&known)
                .position(|(drive, known)| *known && drive.kind == DriveKind::Joint(joint))
        {
            log.push(
                Diagnostic::error(
                    name.span,
                    format!("two drives act on `{}`", symbols.coordinates[joint.0].name),
                )
                .label("the second one")
                .related(places.drives[first], "the first one")
                .help("each coordinate has one drive: delete one of the two, or change the `joint` of one"),
            );
        }
        places.drives.push(name.span);
        known.push(kind.is_some());
        // The replaced kind of a faulty drive is never used, because the fault stops the build.
        drives.push(ModelDrive {
            name: name.text.clone(),
            kind: kind.unwrap_or(DriveKind::Joint(CoordinateIdx(0))),
            is_driven: true,
        });
    }
    // With more drives than degrees of freedom the drives share rows, which are added below.
    let shared = free::split_shared_drives(symbols, &mut drives);
    free::check_linear_drives(tree, &shared, points, &places.drives, log);
    // The places of drives now belong to the rows.
    if !shared.is_empty() {
        places.drives.clear();
    }
    let mut drives = DriveRows { rows: drives, shared };
    free::add_rows(model, symbols, tree, points, places, &mut drives, log);
    // Counts are compared only without earlier faults, which may be the reason for a difference.
    if log.n_errors() == before && !log.syntax_broken {
        free::check_linear_drives(tree, &drives.rows, points, &places.drives, log);
        check_drive_count(model, symbols, &drives.rows, places, log);
    }
    drives
}

/// Whether the two points of a drive are on bodies that can move relative to each other; reports it otherwise.
fn acts_between_bodies(
    ends: [PointIdx; 2],
    tree: &FrameTree,
    points: &PointTable,
    span: SourceSpan,
    log: &mut DiagnosticLog,
) -> bool {
    let bodies = ends.map(|point| tree.carrying_frame(points.points[point.0].frame));
    // A frame with a fault may have lost its joint.
    if bodies[0] != bodies[1] || log.n_errors() > 0 {
        return true;
    }
    let [from, to] = ends.map(|point| &points.points[point.0].name);
    log.push(
        Diagnostic::error(span, format!("the points `{from}` and `{to}` are on the same body"))
            .label(format!("both move with `{}`", tree.frames[bodies[0].0].name))
            .help("a linear drive pushes two bodies apart: name points on frames with a joint between them"),
    );
    false
}

/// Reports a number of drives that differs from the number of degrees of freedom, with advice for each case.
fn check_drive_count(
    model: &ModelEntry,
    symbols: &SymbolTable,
    drives: &[ModelDrive],
    places: &MechanismSpans,
    log: &mut DiagnosticLog,
) {
    // Active coordinates with a rate are the degrees of freedom.
    let n_active = symbols
        .coordinates
        .iter()
        .filter(|coordinate| !coordinate.passive && coordinate.motion.has_rate())
        .count();
    // Coordinates that could not be declared would make the count wrong.
    let n_declared = model
        .coordinates
        .as_ref()
        .map_or(0, |table| table.entries.len() + table.faulty.len());
    let faulty = model.drive.as_ref().is_some_and(|list| list.faulty);
    if drives.len() == n_active || faulty || n_declared != symbols.coordinates.len() {
        return;
    }
    // The mark is on the first drive that is too many, or on a coordinate without a drive.
    let span = if drives.len() > n_active {
        places.drives.get(n_active).copied()
    } else {
        // Linear drives belong to no coordinate, so any coordinate without a drive of its own is a good mark.
        symbols
            .coordinates
            .iter()
            .enumerate()
            .find(|(i, coordinate)| {
                !coordinate.passive
                    && coordinate.motion.has_rate()
                    && !drives
                        .iter()
                        .any(|drive| drive.kind == DriveKind::Joint(CoordinateIdx(*i)))
            })
            .and_then(|(i, _)| places.coordinates.get(i).copied())
    };
    // The counts in the message, with the right plural.
    let degrees = |n: usize| format!("{n} degree{} of freedom", if n == 1 { "" } else { "s" });
    let count = |n: usize| format!("{n} drive{}", if n == 1 { "" } else { "s" });
    log.push(
        Diagnostic::error(
            span.unwrap_or(model.span),
            format!("{} for {}", count(drives.len()), degrees(n_active)),
        )
        .label(if drives.len() > n_active {
            "nothing is independent that this drive could move"
        } else {
            "there is no drive for this coordinate"
        })
        .help("each coordinate that is not `passive` is a degree of freedom and needs one drive, or `driven = false`")
        .help(if n_active == 0 {
            "every coordinate is `passive`, so that nothing is driven: remove `passive = true` from the one that the drive moves; if \
             the loops then constrain too many coordinates, a joint is missing or there is a loop too many"
        } else {
            "add a `[[drive]]`; if the loops determine this coordinate, mark it `passive = true`, and if it moves freely, `driven = false`"
        }),
    );
}

/// The coordinate of a name; other sorts of names are reported.
fn coordinate(name: &SpannedName, symbols: &SymbolTable, log: &mut DiagnosticLog) -> Option<CoordinateIdx> {
    // The scope reports unknown names and marks the coordinate as used.
    let meaning = symbols
        .scope
        .look_up(&name.text, name.span, &[SymbolSort::Coordinate], log)?;
    match meaning.exact {
        ExactExpression::Symbol(ModelSymbol::Coordinate(idx)) => Some(idx),
        _ => None,
    }
}

/// Reports equal names of drives, coordinates and points, which are places of effects and columns of recordings.
///
/// Names that end like a derivative of a coordinate (`_d`, `_dd`) are reported as well.
pub(super) fn check_place_names(model: &ModelEntry, log: &mut DiagnosticLog) {
    // The first use of each name, with the sort of thing and its place.
    let mut seen: BTreeMap<&str, (&str, SourceSpan)> = BTreeMap::new();
    let coordinates = model
        .coordinates
        .iter()
        .flat_map(|table| &table.entries)
        .map(|(key, _)| ("coordinate", key.name.as_str(), key.span));
    let drives = model
        .drive
        .iter()
        .flat_map(|list| &list.entries)
        .filter_map(|entry| entry.name.as_ref())
        .map(|name| ("drive", name.text.as_str(), name.span));
    let points = model
        .point
        .iter()
        .flat_map(|list| &list.entries)
        .filter_map(|entry| entry.name.as_ref())
        .map(|name| ("point", name.text.as_str(), name.span));
    let all: Vec<(&str, &str, SourceSpan)> = coordinates.chain(drives).chain(points).collect();
    // Equal names of one kind are reported where that kind is read.
    for &(what, name, span) in &all {
        match seen.get(name) {
            Some(&(first, first_span)) if first != what => log.push(
                Diagnostic::error(span, format!("`{name}` names a {first} and a {what}"))
                    .label(format!("the {what}"))
                    .related(first_span, format!("the {first}"))
                    .help("effects and recordings distinguish them by name; rename one of the two"),
            ),
            Some(_) => {}
            None => {
                seen.insert(name, (what, span));
            }
        }
    }
    // The column `q_d` would be read as the rate of `q`.
    for &(what, name, span) in all.iter().filter(|(what, ..)| *what != "point") {
        let stem = name.strip_suffix("_dd").or_else(|| name.strip_suffix("_d"));
        if let Some(stem) = stem
            && let Some((first, first_span)) = seen.get(stem)
            && *first == "coordinate"
        {
            log.push(
                Diagnostic::error(span, format!("the {what} `{name}` reads like a derivative of `{stem}`"))
                    .label("recordings name derivatives with `_d` and `_dd`")
                    .related(*first_span, "this coordinate")
                    .help("choose another name"),
            );
        }
    }
}

/// Reads what the columns of drives measure: for each drive, the factor that converts its column to the load at the
/// joint.
///
/// The factor is the product of the ratio and the torque constant.
pub(super) fn torque(model: &ModelEntry, drives: &DriveRows, log: &mut DiagnosticLog) -> Vec<(String, f64)> {
    // Drives that share rows have columns as well.
    let drives: Vec<&ModelDrive> = drives.rows.iter().chain(&drives.shared).collect();
    let recording = model.recording.as_ref();
    let torque = recording.and_then(|entry| entry.torque.as_ref());
    let mut factors = Vec::new();
    for (key, entry) in torque.iter().flat_map(|table| &table.entries) {
        if !drives.iter().any(|drive| drive.name == key.name) {
            let known = drives.iter().map(|drive| drive.name.as_str());
            log.push(
                Diagnostic::error(key.span, format!("unknown drive `{}`", key.name))
                    .label("expected a drive, whose column is not what acts at the joint")
                    .help(suggest::advice(&key.name, "drives", known)),
            );
            continue;
        }
        // An entry without any factor has no effect.
        let given = [&entry.ratio, &entry.constant];
        if given.iter().all(|number| number.is_none()) && !entry.faulty {
            log.push(
                Diagnostic::error(key.span, format!("this entry of `{}` is empty", key.name))
                    .label("expected `ratio`, `constant` (N m/A), or both"),
            );
        }
        // The factor is the product of the given numbers.
        let mut factor = 1.0;
        for number in given.into_iter().flatten() {
            if number.value == 0.0 {
                log.push(Diagnostic::error(number.span, "this is zero").label("expected a factor other than zero"));
            }
            factor *= number.value;
        }
        factors.push((key.name.clone(), factor));
    }
    factors
}

/// Reads how recordings name the columns of this model: pairs of the model's name and a description of the column.
pub(super) fn recording(
    model: &ModelEntry,
    symbols: &SymbolTable,
    drives: &DriveRows,
    actuators: &[ModelActuator],
    log: &mut DiagnosticLog,
) -> Vec<(String, String)> {
    let Some(columns) = model.recording.as_ref().and_then(|entry| entry.columns.as_ref()) else {
        return Vec::new();
    };
    // All names that the model has for columns; quaternions have no derivatives.
    let mut known = vec!["t".to_owned()];
    for coordinate in &symbols.coordinates {
        let name = &coordinate.name;
        if !coordinate.motion.has_rate() {
            known.push(name.clone());
            continue;
        }
        known.extend([name.clone(), format!("{name}_d"), format!("{name}_dd")]);
    }
    // Drives have a column for the force and one for its variance.
    for drive in drives.rows.iter().chain(&drives.shared) {
        known.extend([drive.name.clone(), format!("{}_var", drive.name)]);
    }
    // Signals of actuators have columns, which may have derivatives too.
    for actuator in actuators {
        let name = &actuator.signal;
        known.extend([name.clone(), format!("{name}_d"), format!("{name}_dd")]);
    }
    let mut pairs: Vec<(String, String)> = Vec::new();
    // Unknown names of the model are left out, so that nothing is mapped to them.
    for (key, theirs) in &columns.entries {
        if !known.contains(&key.name) {
            if !log.is_full() {
                log.push(
                    Diagnostic::error(key.span, format!("unknown column `{}`", key.name))
                        .label("expected `t`, a coordinate, with `_d` or `_dd` for its derivatives, or a drive, with `_var` for the variance of its force")
                        .help(suggest::advice(
                            &key.name,
                            "columns",
                            known.iter().map(String::as_str),
                        )),
                );
            }
            continue;
        }
        if theirs.text.trim().is_empty() {
            log.push(
                Diagnostic::error(theirs.span, "this column name is empty")
                    .label("expected the column's name in the recordings"),
            );
        }
        // Faults that no recording could resolve are reported here, not when the first recording is read.
        if let Some(says) = column::fault_without_recording(&theirs.text) {
            log.push(
                Diagnostic::error(theirs.span, format!("this describes no column: {says}"))
                    .label("expected a column's name, or a sum of columns such as `(pos6 - pos5)/32 - pi/2 [deg]`"),
            );
        }
        pairs.push((key.name.clone(), theirs.text.clone()));
    }
    pairs
}
