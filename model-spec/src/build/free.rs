//! Free bodies and undriven joints: motion without a drive. They get their rows of the equation of motion here.
//! Configurations that need more than such rows are refused.

use std::collections::BTreeMap;

use crate::build::MechanismSpans;
use crate::build::actuation::DriveRows;
use crate::build::frames::{FrameTree, PointTable};
use crate::build::symbols::SymbolTable;
use crate::diagnostic::{Diagnostic, DiagnosticLog, SourceSpan};
use crate::exact::{CoordinateIdx, ModelSymbol};
use crate::mechanism::{DriveKind, FrameIdx, FrameStep, FreeBody, KinematicLoop, ModelDrive, PointIdx};
use crate::schema::ModelEntry;

/// The free bodies, each with the index of the frame that it moves.
fn free_bodies(tree: &FrameTree) -> impl Iterator<Item = (usize, &FreeBody)> {
    // Indices of frames are kept, because checks need the place of the frame in the file.
    let steps = tree.frames.iter().enumerate();
    steps.flat_map(|(i, frame)| {
        let of_frame = frame.steps.iter();
        of_frame.filter_map(move |step| match step {
            FrameStep::Free(body) => Some((i, body)),
            _ => None,
        })
    })
}

/// Removes the drives from a mechanism that has more of them than degrees of freedom. They are returned and share its
/// rows: their forces are not unique, only those on the independent coordinates are.
pub(super) fn split_shared_drives(symbols: &SymbolTable, drives: &mut Vec<ModelDrive>) -> Vec<ModelDrive> {
    // Degrees of freedom: active coordinates with a rate.
    let coordinates = symbols.coordinates.iter();
    let freedoms = coordinates.filter(|c| !c.passive && c.motion.has_rate()).count();
    // Without a degree of freedom there is no row to share.
    if drives.len() <= freedoms || freedoms == 0 {
        return Vec::new();
    }
    std::mem::take(drives)
}

/// Adds a row for every degree of freedom without a drive, or for all of them if drives share the rows.
///
/// Rows are inserted into the drives of `drives`, and their places into `places.drives`.
pub(super) fn add_rows(
    model: &ModelEntry,
    symbols: &SymbolTable,
    tree: &FrameTree,
    points: &PointTable,
    places: &mut MechanismSpans,
    drives: &mut DriveRows,
    log: &mut DiagnosticLog,
) {
    let DriveRows { rows: drives, shared } = drives;
    // Rows of a free body: its position, then the vector part of its quaternion as rates of rotation.
    let mut of_bodies = Vec::new();
    for (frame, body) in free_bodies(tree) {
        // A free body is checked before its rows are made.
        check_free_body(symbols, tree, frame, body, places, log);
        let [_, qx, qy, qz] = body.quaternion;
        of_bodies.extend(body.position);
        of_bodies.extend([qx, qy, qz]);
    }
    // Undriven joints, or all independent ones if drives share the rows.
    let mut undriven = undriven_coordinates(model, symbols, places, drives, log);
    // Shared drives act on all joints, so every independent coordinate gets a row without a drive.
    if !shared.is_empty() {
        let all = (0..symbols.coordinates.len()).map(CoordinateIdx);
        undriven = all
            .filter(|i| {
                let coordinate = &symbols.coordinates[i.0];
                !coordinate.passive && coordinate.motion.has_rate() && !of_bodies.contains(i)
            })
            .collect();
    }
    // A row is not needed where a drive acts directly on the coordinate.
    let driven: Vec<CoordinateIdx> = drives
        .iter()
        .filter_map(|drive| match drive.kind {
            DriveKind::Joint(i) => Some(i),
            DriveKind::Linear { .. } => None,
        })
        .collect();
    // The force of such a row is called `on_` and the coordinate.
    let row = |i: CoordinateIdx| ModelDrive {
        name: format!("on_{}", symbols.coordinates[i.0].name),
        kind: DriveKind::Joint(i),
        is_driven: false,
    };
    let span = |i: &CoordinateIdx| places.coordinates[i.0];
    of_bodies.retain(|i| !driven.contains(i));
    // The name of a row must not collide with any other column of recordings.
    for (i, row) in of_bodies.iter().chain(&undriven).map(|i| (i, row(*i))) {
        let is_taken = symbols.coordinates.iter().any(|c| c.name == row.name)
            || drives.iter().chain(&*shared).any(|drive| drive.name == row.name)
            || points.get(&row.name).is_some();
        if is_taken {
            log.push(
                Diagnostic::error(
                    span(i),
                    format!(
                        "nothing drives this coordinate, and `{}` is the name of its force",
                        row.name
                    ),
                )
                .label("something else has this name")
                .help("rename one of the two"),
            );
        }
    }
    // Rows of free bodies come first, those of undriven joints last.
    let spans: Vec<_> = of_bodies.iter().map(span).collect();
    let last: Vec<_> = undriven.iter().map(span).collect();
    drives.splice(0..0, of_bodies.into_iter().map(row));
    drives.extend(undriven.into_iter().map(row));
    places.drives.splice(0..0, spans);
    places.drives.extend(last);
}

/// Coordinates of joints with `driven = false`; contradictions to `passive` and to drives are reported.
///
/// Components of quaternions are skipped, because their joint states how the body moves.
fn undriven_coordinates(
    model: &ModelEntry,
    symbols: &SymbolTable,
    places: &MechanismSpans,
    drives: &[ModelDrive],
    log: &mut DiagnosticLog,
) -> Vec<CoordinateIdx> {
    let mut found = Vec::new();
    // Only coordinates with `driven = false` count.
    for (key, entry) in model.coordinates.iter().flat_map(|table| &table.entries) {
        if entry.driven.is_none_or(|flag| flag.0) {
            continue;
        }
        let Some(i) = symbols.coordinates.iter().position(|c| c.name == key.name) else {
            continue;
        };
        let coordinate = &symbols.coordinates[i];
        if coordinate.motion.is_quaternion() {
            continue; // The joint decides for all coordinates of the body.
        }
        // Passive coordinates have no row of their own.
        if coordinate.passive {
            log.push(
                Diagnostic::error(
                    key.span,
                    format!("`{}` is `passive`, so that no drive could act on it", key.name),
                )
                .label("delete `driven = false`: the loops determine this coordinate"),
            );
            continue;
        }
        // A drive on the coordinate contradicts the entry.
        let kind = DriveKind::Joint(CoordinateIdx(i));
        if let Some(at) = drives.iter().position(|drive| drive.kind == kind) {
            log.push(
                Diagnostic::error(key.span, format!("`{}` has `driven = false` and a drive", key.name))
                    .label("`driven = false` here")
                    .related(places.drives[at], "this drive acts on it")
                    .help("delete one of the two"),
            );
            continue;
        }
        found.push(CoordinateIdx(i));
    }
    found
}

/// Reports a free body that is not on the base, has passive coordinates, or shares its coordinates.
///
/// `frame` is the frame that the body moves.
fn check_free_body(
    symbols: &SymbolTable,
    tree: &FrameTree,
    frame: usize,
    body: &FreeBody,
    places: &MechanismSpans,
    log: &mut DiagnosticLog,
) {
    let here = &tree.frames[frame];
    let Some(span) = places.frames.get(frame).copied().flatten() else {
        return;
    };
    // The coordinates are the pose in the base frame, so no other step may come before or after.
    if here.parent != FrameIdx(0) || here.steps.len() != 1 {
        log.push(
            Diagnostic::error(
                span,
                "a free body with a quaternion must be on `base` without a transform",
            )
            .label("its coordinates are its pose in the base frame")
            .help("write `on = \"base\"` and omit `transform`; a frame on the body may have one"),
        );
    }
    // None of the seven coordinates may be passive.
    let all = body.position.iter().chain(&body.quaternion);
    for i in all.clone() {
        if symbols.coordinates[i.0].passive {
            log.push(
                Diagnostic::error(
                    places.coordinates[i.0],
                    "a coordinate of a free body with a quaternion cannot be `passive`",
                )
                .label("no loop determines it")
                .help("a platform whose pose the loops determine has `free` with six coordinates"),
            );
        }
    }
    // A zero quaternion cannot be normalised to an orientation.
    let size: f64 = body
        .quaternion
        .iter()
        .map(|i| symbols.coordinates[i.0].nominal.powi(2))
        .sum();
    if size.is_nan() || size <= 1e-12 {
        log.push(
            Diagnostic::error(
                places.coordinates[body.quaternion[0].0],
                "the nominal quaternion is zero",
            )
            .label("it is not an orientation")
            .help("omit its values, or give it a length of one"),
        );
    }
    // A coordinate of a free body must move that body only.
    for i in all {
        let uses = tree
            .frames
            .iter()
            .flat_map(|frame| &frame.steps)
            .filter(|step| is_moved_by(step, *i));
        if uses.count() > 1 {
            log.push(
                Diagnostic::error(
                    places.coordinates[i.0],
                    "a coordinate of a free body moves something else as well",
                )
                .label("its rate is that of the body alone")
                .help("declare a coordinate for each joint"),
            );
        }
    }
}

/// Whether a step of a frame depends on a coordinate.
/// A rotation depends on it by a term, a translation by a factor, a free body by its coordinates.
fn is_moved_by(step: &FrameStep, coordinate: CoordinateIdx) -> bool {
    match step {
        FrameStep::Rotate(_, angle) => angle
            .terms
            .iter()
            .any(|(s, _)| *s == ModelSymbol::Coordinate(coordinate)),
        FrameStep::Translate(_, length) => length.coordinates.iter().any(|(i, _)| *i == coordinate),
        FrameStep::Free(body) => body.position.iter().chain(&body.quaternion).any(|i| *i == coordinate),
    }
}

/// Reports linear drives between two free bodies, or between a free body and the base.
///
/// `spans` are the places of the drives, in their order.
pub(super) fn check_linear_drives(
    tree: &FrameTree,
    drives: &[ModelDrive],
    points: &PointTable,
    spans: &[SourceSpan],
    log: &mut DiagnosticLog,
) {
    // Both ends must move with the same free body, or with none.
    let root = free_body_finder(tree);
    for (drive, span) in drives.iter().zip(spans) {
        if let DriveKind::Linear { from, to } = drive.kind
            && root(points, from) != root(points, to)
        {
            log.push(free_body_crossing(*span, "a drive"));
        }
    }
}

/// Reports loops between two free bodies, or between a free body and the base.
pub(super) fn check_loops(
    tree: &FrameTree,
    loops: &[KinematicLoop],
    points: &PointTable,
    places: &MechanismSpans,
    log: &mut DiagnosticLog,
) {
    let root = free_body_finder(tree);
    for (closed, span) in loops.iter().zip(&places.loops) {
        let [one, other] = closed.joins;
        if root(points, one) != root(points, other) {
            log.push(free_body_crossing(*span, "a loop"));
        }
    }
}

/// The diagnostic of a drive or loop with ends on different sides of a free body.
///
/// `what` is the sort of thing, with its article.
fn free_body_crossing(span: SourceSpan, what: &str) -> Diagnostic {
    Diagnostic::error(
        span,
        format!("{what} cannot reach across a free body with a quaternion"),
    )
    .label("one end moves with the body and the other does not")
    .help("give that body `free` with six coordinates, its position and three angles")
}

/// Returns a function that gives the frame of the free body on which a point moves, if any.
fn free_body_finder(tree: &FrameTree) -> impl Fn(&PointTable, PointIdx) -> Option<usize> {
    // Parents come before their children, so one pass is enough.
    let mut of_frame: BTreeMap<usize, usize> = BTreeMap::new();
    for (i, frame) in tree.frames.iter().enumerate() {
        // A frame belongs to the free body of its parent, unless it is one itself.
        let is_free = frame.steps.iter().any(|step| matches!(step, FrameStep::Free(_)));
        let root = if is_free {
            Some(i)
        } else {
            of_frame.get(&frame.parent.0).copied()
        };
        of_frame.extend(root.map(|root| (i, root)));
    }
    move |points, point| of_frame.get(&points.points[point.0].frame.0).copied()
}
