//! From the tables of a file to the mechanism that they describe.
//!
//! Every stage reports all faults that it finds and continues with the parts that have none. A name with a faulty
//! definition counts as known, so that one fault is reported once.

mod actuation;
mod actuators;
mod bodies;
mod couplings;
mod degrees;
pub(crate) mod effect_places;
mod effects;
mod folds;
mod frames;
mod free;
mod identified;
mod joints;
mod limits;
mod millimetres;
mod retain;
pub(crate) mod symbols;
mod tables;
mod thresholds;
mod welds;

use crate::build::effect_places::EffectTargets;
use crate::diagnostic::{DiagnosticLog, SourceSpan};
use crate::kinds::{EffectKind, describe, library_entries};
use crate::mechanics;
use crate::mechanism::{Mechanism, RecordingColumns};
use crate::pose;
use crate::schema::{EffectKindEntry, ModelEntry};

/// The places in the file of the parts of a mechanism, by index, for findings about its pose.
#[derive(Debug, Default)]
pub(crate) struct MechanismSpans {
    /// The complete file.
    pub(crate) whole: Option<SourceSpan>,
    /// Frames; `None` for the base.
    pub(crate) frames: Vec<Option<SourceSpan>>,
    /// Names of points.
    pub(crate) points: Vec<SourceSpan>,
    /// The pairs of points of loops.
    pub(crate) loops: Vec<SourceSpan>,
    /// Drives, or the coordinates of rows without a drive.
    pub(crate) drives: Vec<SourceSpan>,
    /// Names of coordinates.
    pub(crate) coordinates: Vec<SourceSpan>,
}

/// Builds the mechanism, if there are no errors, and the kinds of effects that its file may use.
///
/// `libraries` are kinds of effects from libraries of the user.
///
/// The mechanism is `None` after any error, each of which is in the log.
pub(crate) fn build(
    model: &ModelEntry,
    libraries: &[EffectKindEntry],
    log: &mut DiagnosticLog,
) -> (Option<Mechanism>, Vec<EffectKind>) {
    let mut places = MechanismSpans {
        whole: Some(model.span),
        ..MechanismSpans::default()
    };
    // Names first: all later stages resolve expressions with them.
    let mut symbols = symbols::declare(model, &mut places, log);
    let gravity = symbols::gravity(model, &symbols.scope, log);
    let n_errors = log.n_errors();
    let tree = frames::frames(model, &symbols, &mut places, log);
    // A faulty frame may be the one that would use a coordinate.
    if log.n_errors() == n_errors {
        symbols::check_coordinates_move(model, &symbols, &places, log);
    }
    let mut points = frames::points(model, &symbols.scope, &tree, &mut places, log);
    let parts = bodies::parts(model, &symbols, &tree, log);
    let lumped_masses = bodies::lumped_masses(model, &symbols, &tree, &points, log);
    let couplings = couplings::couplings(model, &mut symbols, &places, log);
    let loops = actuation::loops(model, &tree, &mut points, &mut places, log);
    free::check_loops(&tree, &loops, &points, &places, log);
    let drives = actuation::drives(model, &symbols, &tree, &points, &mut places, log);
    let actuators = actuators::actuators(model, &symbols, &drives, log);
    // Effects come after drives, points and parts, on which they act.
    let own_kinds = model.effect_kind.iter().flat_map(|list| &list.entries);
    let own_kinds: Vec<&EffectKindEntry> = libraries.iter().chain(own_kinds).collect();
    let scene = EffectTargets {
        drives: &drives.rows,
        points: &points,
        parts: &parts,
        lumped_masses: &lumped_masses,
    };
    let effects = effects::effects(model, &own_kinds, &mut symbols, &scene, log);
    // Effects may tilt gravity or delay the measured forces.
    let (gravity, force_delay) = mechanics::gravity_and_delay(&effects, gravity, &symbols.constants);
    let retain = retain::retain(model, &symbols, log);
    let limits = limits::limits(model, &symbols.coordinates, &drives.rows, &points.points, log);
    let identified_base = identified::read_identified(model, &mut symbols, log);
    let columns = actuation::recording(model, &symbols, &drives, &actuators, log);
    let torque = actuation::torque(model, &drives, log);
    actuation::check_place_names(model, log);
    // With errors, unused names are often a consequence.
    if log.n_errors() == 0 {
        symbols::warn_of_unused(&symbols, log);
    }
    let kinds = library_entries()
        .iter()
        .map(|entry| describe(entry, false))
        .chain(own_kinds.into_iter().map(|entry| describe(entry, true)))
        .collect();
    let Some(name) = model.name.as_ref().filter(|_| log.n_errors() == 0) else {
        return (None, kinds);
    };
    let mut mechanism = Mechanism {
        name: name.text.clone(),
        title: model.title.as_ref().map(|title| title.text.clone()),
        gravity,
        constants: symbols.constants,
        parameters: symbols.parameters,
        coordinates: symbols.coordinates,
        frames: tree.frames,
        points: points.points,
        parts,
        lumped_masses,
        loops,
        couplings,
        drives: drives.rows,
        shared_drives: drives.shared,
        actuators,
        servo_forces: Vec::new(),
        effects,
        force_delay,
        identified_base,
        retain,
        limits,
        recording: RecordingColumns { columns, torque },
        has_numeric_constants: false,
    };
    // These checks need the complete mechanism at its nominal values.
    bodies::warn_of_negative(model, &mechanism, log);
    degrees::warn_of_degrees(model, &mechanism, log);
    millimetres::warn_of_millimetres(model, log);
    pose::check_pose(&mut mechanism, &places, log);
    if log.n_errors() == 0 {
        folds::warn_of_folds(&mechanism, &places, log);
    }
    ((log.n_errors() == 0).then_some(mechanism), kinds)
}
