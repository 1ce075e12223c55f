//! The places of an effect: what their names refer to, and the load of each.
//!
//! Names go in; an [`EffectPlace`] each and the common [`PlaceLoad`] come out. Faults are reported.

use crate::build::frames::PointTable;
use crate::build::symbols::SymbolTable;
use crate::diagnostic::{Diagnostic, DiagnosticLog};
use crate::exact::CoordinateIdx;
use crate::kind_terms::symbols_without_unit;
use crate::kinds::{ActsOn, OtherMotion, PlaceLoad, n_places};
use crate::mechanism::{DriveIdx, DriveKind, EffectPlace, LumpedMass, ModelDrive, ModelPart, PartIdx};
use crate::record::OneOrMany;
use crate::schema::{EffectEntry, EffectKindEntry};
use crate::suggest;
use crate::values::SpannedName;

/// Everything that an effect may act on, in addition to the coordinates.
pub(crate) struct EffectTargets<'a> {
    /// Drives with rows of the equation of motion.
    pub(crate) drives: &'a [ModelDrive],
    /// Named points.
    pub(crate) points: &'a PointTable,
    /// Rigid bodies.
    pub(crate) parts: &'a [ModelPart],
    /// Lumped masses, without names that an effect could use.
    pub(crate) lumped_masses: &'a [LumpedMass],
}

/// The word for all drives in `at_each`.
pub(crate) const ALL_DRIVES: &str = "drives";

/// The effects that an entry stands for: one at each place of `at_each`, or the entry itself. Faults are reported.
pub(super) fn single_effects(
    entry: &EffectEntry,
    scene: &EffectTargets<'_>,
    log: &mut DiagnosticLog,
) -> Vec<EffectEntry> {
    let Some(each) = &entry.at_each else {
        if entry.at.is_none() && !entry.faulty {
            log.push(
                Diagnostic::error(entry.span, "this effect has no place")
                    .label("expected `at`, or `at_each` for parameters of its own at each place")
                    .help("for example `at = [\"motor\"]`, or `at_each = \"drives\"`"),
            );
        }
        return vec![entry.clone()];
    };
    if let Some(at) = &entry.at {
        log.push(
            Diagnostic::error(at.span, "an effect has both `at` and `at_each`")
                .label("expected one of them")
                .related(each.span, "the other one")
                .help("`at` shares the parameters among its places; `at_each` gives each place its own"),
        );
        return Vec::new();
    }
    // A common name would make the parameters one.
    let named = entry.parameters.iter().flat_map(|table| &table.entries);
    let mut names = named.filter_map(|(_, parameter)| parameter.name.as_ref());
    if let Some(name) = names.next() {
        log.push(
            Diagnostic::error(name.span, "a parameter at several places has one name")
                .label("expected no name with `at_each`")
                .help("delete the name, so that each place has its own parameter; or share one parameter with `at`"),
        );
        return Vec::new();
    }
    let is_all = !each.entries.is_empty()
        && each.entries.iter().all(|name| name.text == ALL_DRIVES)
        && scene.drives.iter().all(|drive| drive.name != ALL_DRIVES);
    let places: Vec<SpannedName> = if is_all {
        let driven = scene.drives.iter().filter(|drive| drive.is_driven);
        let named = |text: &String| SpannedName {
            text: text.clone(),
            span: each.span,
        };
        driven.map(|drive| named(&drive.name)).collect()
    } else {
        each.entries.clone()
    };
    if places.is_empty() {
        log.push(
            Diagnostic::error(each.span, "this effect acts nowhere")
                .label("expected the names of drives, coordinates or points"),
        );
    }
    let single = |place: SpannedName| EffectEntry {
        at: Some(OneOrMany {
            span: place.span,
            entries: vec![place],
        }),
        at_each: None,
        ..entry.clone()
    };
    places.into_iter().map(single).collect()
}

/// Finds a place by its name. If several things have that name, the kind of effect decides which one is used.
/// `allowed` are the sorts of places of the kind; `scene` has the parts of the mechanism. An unknown name is
/// reported.
pub(super) fn find_place(
    name: &SpannedName,
    allowed: &[ActsOn],
    symbols: &SymbolTable,
    scene: &EffectTargets<'_>,
    log: &mut DiagnosticLog,
) -> Option<EffectPlace> {
    // Parts are looked up lazily, because most effects act on drives.
    let part = || {
        let at = scene.parts.iter().position(|part| part.name == name.text)?;
        Some(EffectPlace::Part(PartIdx(at)))
    };
    // The reserved names for the complete base and for the measured forces.
    let whole = match name.text.as_str() {
        "base" => Some((ActsOn::Base, EffectPlace::Base)),
        "force" => Some((ActsOn::Force, EffectPlace::Force)),
        _ => None,
    };
    // Parts, the base and the forces have names of their own, which a drive or a point may have as well.
    if let Some((_, place)) = whole.filter(|(sort, _)| allowed.contains(sort)) {
        return Some(place);
    }
    if allowed.contains(&ActsOn::Part)
        && let Some(place) = part()
    {
        return Some(place);
    }
    // Names of drives, coordinates and points differ from each other, so their order does not matter.
    if let Some(idx) = scene.drives.iter().position(|drive| drive.name == name.text) {
        return Some(EffectPlace::Drive(DriveIdx(idx)));
    }
    // Next come coordinates, then points, and at the end parts for kinds that do not act on them.
    let coordinate = symbols
        .coordinates
        .iter()
        .position(|coordinate| coordinate.name == name.text);
    if let Some(idx) = coordinate {
        return Some(EffectPlace::Coordinate(CoordinateIdx(idx)));
    }
    if let Some(idx) = scene.points.get(&name.text) {
        return Some(EffectPlace::Point(idx));
    }
    // A place of the wrong sort is returned, too: `common_load` reports it with a better message.
    if let Some(place) = part().or(whole.map(|(_, place)| place)) {
        return Some(place);
    }
    // Unknown: the advice lists only names on which this kind may act.
    let mut known: Vec<&str> = Vec::new();
    let expected = match allowed {
        [ActsOn::Part] => {
            known.extend(scene.parts.iter().map(|part| part.name.as_str()));
            "the name of a part"
        }
        [ActsOn::Base] => {
            known.push("base");
            "`base`"
        }
        [ActsOn::Force] => {
            known.push("force");
            "`force`"
        }
        _ => {
            known.extend(scene.drives.iter().map(|drive| drive.name.as_str()));
            known.extend(symbols.coordinates.iter().map(|one| one.name.as_str()));
            known.extend(scene.points.names());
            "the name of a drive, a coordinate or a point"
        }
    };
    // A place that a variant removes is reported with the place of the removal.
    if !log.is_full() {
        let removal = log.removal(&["drive", "coordinates", "point", "part"], &name.text);
        log.push(
            Diagnostic::error(name.span, format!("unknown place `{}`", name.text))
                .label(format!("expected {expected}"))
                .with_removal_or(removal, || suggest::advice(&name.text, "places", known.iter().copied())),
        );
    }
    None
}

/// The load of the places of an effect. All places must have the same load, and the kind must be allowed there.
///
/// `None` after any fault, each of which is reported.
/// `places` belong to the names `at`, in the same order.
pub(super) fn common_load(
    kind: &EffectKindEntry,
    at: &OneOrMany<SpannedName>,
    places: &[EffectPlace],
    symbols: &SymbolTable,
    drives: &[ModelDrive],
    log: &mut DiagnosticLog,
) -> Option<PlaceLoad> {
    let carried = |kind: DriveKind| kind.place_load(&symbols.coordinates);
    let names = &at.entries;
    let kind_name = kind.name.as_ref().map_or("", |name| name.text.as_str());
    // The load of the first place, which all others must share.
    let mut common: Option<PlaceLoad> = None;
    let mut fine = true;
    // A kind with `other` acts at its first place only; the second one gives its motion.
    let n_acting = if kind.other.is_some() { 1 } else { names.len() };
    if let (Some(motion), [first, other, ..], Some(place)) = (kind.other, &names[..], places.get(1)) {
        // The second place gives its motion only, so it is checked for its motion and for being another place.
        fine = has_motion(motion, other, *place, &carried, drives, log);
        if first.text == other.text {
            log.push(
                Diagnostic::error(other.span, format!("`{}` is listed twice", other.text))
                    .label("expected another place than that on which it acts"),
            );
            fine = false;
        }
    }
    // Each place on which the kind acts: its sort, its units, duplicates, and equal loads.
    for (i, (name, place)) in names.iter().zip(places).enumerate().take(n_acting) {
        let (sort, carries) = match place {
            EffectPlace::Drive(idx) => (ActsOn::Drive, carried(drives[idx.0].kind)),
            EffectPlace::Coordinate(idx) => (ActsOn::Coordinate, carried(DriveKind::Joint(*idx))),
            EffectPlace::Point(_) => (ActsOn::Point, PlaceLoad::Mass),
            EffectPlace::Part(_) => (ActsOn::Part, PlaceLoad::Elsewhere),
            EffectPlace::Base => (ActsOn::Base, PlaceLoad::Elsewhere),
            EffectPlace::Force => (ActsOn::Force, PlaceLoad::Elsewhere),
        };
        let allowed: Vec<ActsOn> = kind.on.iter().flat_map(|on| on.entries.clone()).collect();
        if !allowed.contains(&sort) {
            let list: Vec<&str> = allowed.iter().map(|sort| sort.description()).collect();
            log.push(
                Diagnostic::error(name.span, format!("`{kind_name}` cannot act here"))
                    .label(format!("this is {}", sort.description()))
                    .help(format!("`{kind_name}` acts on {}", list.join(" or "))),
            );
            fine = false;
            continue;
        }
        // Places of mechanics are checked with the mechanics.
        // The kind must have units for the load of this place.
        if kind.mechanics.is_none() && !symbols_without_unit(kind, carries).is_empty() {
            log.push(
                Diagnostic::error(name.span, format!("`{kind_name}` cannot act here"))
                    .label(match carries {
                        PlaceLoad::Force => "this place carries a force, for which the kind has no units",
                        PlaceLoad::Torque => "this place carries a torque, for which the kind has no units",
                        PlaceLoad::Mass | PlaceLoad::Elsewhere => "the kind has no units for this place",
                    })
                    .help("give the kind's parameters and constants units for both, `{ force = ..., torque = ... }`"),
            );
            fine = false;
            continue;
        }
        // The same place twice would double the effect.
        if names[..i].iter().any(|other| other.text == name.text) {
            log.push(Diagnostic::error(name.span, format!("`{}` is listed twice", name.text)).label("each place once"));
            fine = false;
        }
        // One parameter cannot be both a force and a torque.
        match common {
            Some(first) if first != carries => {
                log.push(
                    Diagnostic::error(
                        name.span,
                        "places that carry forces and torques cannot share a parameter",
                    )
                    .label("differs from the first place")
                    .help("write an `[[effect]]` for each"),
                );
                fine = false;
            }
            _ => common = Some(carries),
        }
    }
    // Kinds that couple two places, and some mechanics, need an exact number of them.
    if let Some(n) = n_places(kind).filter(|n| *n != names.len()) {
        // The reason in the advice depends on how the kind uses its places.
        let (word, why) = match n {
            1 => ("one place", "it acts on one place at a time"),
            _ if kind.mechanics.is_some() => ("two places", "it acts along the line between two points"),
            _ if kind.other.is_some() => ("two places", "it acts on the first with the motion of the second"),
            _ => (
                "two places",
                "at each of two places it acts with the motion of the other",
            ),
        };
        log.push(
            Diagnostic::error(at.span, format!("`{kind_name}` takes {word}"))
                .label(format!("expected {n}, found {}", names.len()))
                .help(why),
        );
        fine = false;
    }
    common.filter(|_| fine)
}

/// Whether the second place of an effect moves as its kind requires; reports it otherwise.
/// `carried` gives the load of a drive: a torque for revolute motion, a force for prismatic motion.
fn has_motion(
    motion: OtherMotion,
    name: &SpannedName,
    place: EffectPlace,
    carried: &dyn Fn(DriveKind) -> PlaceLoad,
    drives: &[ModelDrive],
    log: &mut DiagnosticLog,
) -> bool {
    // Only drives and coordinates move.
    let carries = match place {
        EffectPlace::Drive(idx) => Some(carried(drives[idx.0].kind)),
        EffectPlace::Coordinate(idx) => Some(carried(DriveKind::Joint(idx))),
        EffectPlace::Point(_) | EffectPlace::Part(_) | EffectPlace::Base | EffectPlace::Force => None,
    };
    if carries == Some(motion.place_load()) {
        return true;
    }
    let expected = format!("expected a drive or coordinate that {}", motion.description());
    log.push(
        Diagnostic::error(
            name.span,
            format!("`{}` does not move as this kind requires", name.text),
        )
        .label(expected)
        .help("the kind states in `other` whether its other place is an `angle` or a `length`"),
    );
    false
}
