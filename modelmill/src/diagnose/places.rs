//! Places at which effects of a kind may act, alone, in pairs, and alike at several.

use modelmill_identify::diagnose::LocatedEffect;
use modelmill_spec::{
    ActsOn, DriveIdx, DriveKind, EffectKind, EffectPlace, Mechanics, Mechanism, PartIdx, PlaceLoad, PointIdx,
};

use crate::recording::free::free_bodies;

use super::thresholds::WAVE_SHORTEST_TRAVEL;

/// A place of the mechanism at which an effect may act.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct CandidatePlace {
    /// Its name in the model file.
    pub name: String,
    /// Whether it transmits a force or a torque, which decides about units.
    pub carries: PlaceLoad,
    /// Drive, coordinate, point, body, base or force.
    pub sort: ActsOn,
    /// Its index in the mechanism.
    pub place: EffectPlace,
}

/// All places of a mechanism.
pub(crate) fn candidate_places(mechanism: &Mechanism) -> Vec<CandidatePlace> {
    let spot = |name: &str, carries: PlaceLoad, sort: ActsOn, place: EffectPlace| CandidatePlace {
        name: name.to_owned(),
        carries,
        sort,
        place,
    };
    let mut spots = Vec::new();
    let mut driven = Vec::new();
    // Drives come first, since most effects act on them.
    for (d, drive) in mechanism.drives.iter().enumerate().filter(|(_, drive)| drive.is_driven) {
        if let DriveKind::Joint(i) = drive.kind {
            driven.push(i.0);
        }
        let carries = drive.kind.place_load(&mechanism.coordinates);
        let place = EffectPlace::Drive(DriveIdx(d));
        spots.push(spot(&drive.name, carries, ActsOn::Drive, place));
    }
    // A joint with a drive of its own is the same place.
    for (i, coordinate) in mechanism.coordinates.iter().enumerate() {
        if !driven.contains(&i) && !is_free(mechanism, i) {
            let place = EffectPlace::Coordinate(modelmill_spec::CoordinateIdx(i));
            let carries = coordinate.motion.place_load();
            spots.push(spot(&coordinate.name, carries, ActsOn::Coordinate, place));
        }
    }
    // Points, bodies, base and force signals follow.
    for (i, point) in mechanism.points.iter().enumerate() {
        let place = EffectPlace::Point(PointIdx(i));
        spots.push(spot(&point.name, PlaceLoad::Mass, ActsOn::Point, place));
    }
    for (i, part) in mechanism.parts.iter().enumerate() {
        let place = EffectPlace::Part(PartIdx(i));
        spots.push(spot(&part.name, PlaceLoad::Elsewhere, ActsOn::Part, place));
    }
    spots.push(spot("base", PlaceLoad::Elsewhere, ActsOn::Base, EffectPlace::Base));
    spots.push(spot("force", PlaceLoad::Elsewhere, ActsOn::Force, EffectPlace::Force));
    spots
}

/// Names of the other places whose parameters the model uses for an effect at its places too; empty if it has none
/// there.
pub(crate) fn sharing_places(mechanism: &Mechanism, effect: &LocatedEffect) -> Vec<String> {
    let spots = candidate_places(mechanism);
    let its = spots.iter().filter(|spot| effect.at.contains(&spot.name));
    let its: Vec<EffectPlace> = its.map(|spot| spot.place).collect();
    let sharing = mechanism.sharing_places(&effect.kind, &its).unwrap_or_default();
    sharing
        .into_iter()
        .map(|place| mechanism.place_name(place).to_owned())
        .collect()
}

/// Whether a coordinate belongs to a free body, which has no joint that could rub.
pub(crate) fn is_free(mechanism: &Mechanism, coordinate: usize) -> bool {
    let mut bodies = free_bodies(mechanism);
    bodies.any(|body| {
        let mut all = body.position.iter().chain(&body.quaternion);
        all.any(|i| i.0 == coordinate)
    })
}

/// Whether a kind may act at a place and can have an effect there.
pub(crate) fn is_applicable(mechanism: &Mechanism, kind: &EffectKind, spot: &CandidatePlace) -> bool {
    let has_unit = |units: &[(PlaceLoad, String)]| units.iter().any(|(c, _)| *c == spot.carries);
    let has_units = kind.parameters.iter().all(|p| has_unit(&p.units));
    if !kind.on.contains(&spot.sort) {
        return false;
    }
    let joins_points = |mechanics: Mechanics| mechanics.pairs(mechanism).is_some();
    if let EffectPlace::Point(point) = spot.place
        && mechanism.points[point.0].frame.0 == 0
        && !kind.mechanics.is_some_and(joins_points)
    {
        // A point that is fixed to the base does not move, so no effect acts there.
        return false;
    }
    if let Some(mechanics) = kind.mechanics {
        return mechanics.has_effect_at(mechanism, spot.place);
    }
    match spot.place {
        // A loop joins two points to one place; the first of them is enough.
        EffectPlace::Point(p) => {
            let mut loops = mechanism.loops.iter();
            has_units && loops.all(|l| l.joins[1] != p)
        }
        // Waves along the travel, such as cogging, come from drives.
        EffectPlace::Coordinate(_) => has_units && !is_wave(kind),
        _ => has_units,
    }
}

/// Whether a kind repeats along the travel of its place, at least twice at its shortest wavelength.
pub(crate) fn is_wave(kind: &EffectKind) -> bool {
    use modelmill_spec::{ConstantSearch, Scale};
    kind.constants.iter().any(|c| match c.search {
        Some(ConstantSearch::Range { from, of, .. }) => of == Scale::Travel && from < WAVE_SHORTEST_TRAVEL,
        _ => false,
    })
}

/// Sets of places at which a kind may act with shared parameters, and how each is to be written: one effect at
/// all of them, or the sum of effects at each.
///
/// Each place alone; pairs for kinds that need two; and in machines with loops, whose sides are often alike,
/// all drives, all passive joints and all active ones.
pub(crate) fn place_sets<'a>(
    mechanism: &Mechanism,
    kind: &EffectKind,
    spots: &[&'a CandidatePlace],
    all: &'a [CandidatePlace],
) -> (Vec<Vec<&'a CandidatePlace>>, Vec<Vec<usize>>) {
    // A kind with a second place: each place with each other one of the right motion.
    if let Some(motion) = kind.other {
        let moves = |spot: &&&CandidatePlace| {
            matches!(spot.sort, ActsOn::Drive | ActsOn::Coordinate) && spot.carries == motion.place_load()
        };
        let others: Vec<&CandidatePlace> = all.iter().filter(|spot| moves(&spot)).collect();
        let with_others = |one: &&'a CandidatePlace| {
            let one = *one;
            let apart = others.iter().filter(move |other| other.place != one.place);
            apart.map(|other| vec![one, *other]).collect::<Vec<_>>()
        };
        let pairs: Vec<Vec<&CandidatePlace>> = spots.iter().flat_map(with_others).collect();
        let sets = (0..pairs.len()).map(|k| vec![k]).collect();
        return (pairs, sets);
    }
    // Mechanics between two points, such as springs.
    if let Some(joined) = kind.mechanics.and_then(|one| one.pairs(mechanism)) {
        let at = |point: PointIdx| spots.iter().find(|spot| spot.place == EffectPlace::Point(point));
        let pair = |[one, other]: [PointIdx; 2]| Some(vec![*at(one)?, *at(other)?]);
        let pairs: Vec<Vec<&CandidatePlace>> = joined.into_iter().filter_map(pair).collect();
        let sets = (0..pairs.len()).map(|k| vec![k]).collect();
        return (pairs, sets);
    }
    // Kinds for two drives of equal unit.
    if kind.places == Some(2) {
        let mut pairs = Vec::new();
        for (i, one) in spots.iter().enumerate() {
            for other in &spots[i + 1..] {
                let are_drives = one.sort == ActsOn::Drive && other.sort == ActsOn::Drive;
                if are_drives && one.carries == other.carries {
                    pairs.push(vec![*one, *other]);
                }
            }
        }
        let sets = (0..pairs.len()).map(|k| vec![k]).collect();
        return (pairs, sets);
    }
    // Mechanics that join places, such as rods at both sides of a loop.
    let places: Vec<EffectPlace> = spots.iter().map(|spot| spot.place).collect();
    if let Some(groups) = (kind.mechanics).and_then(|one| one.groups(mechanism, &places)) {
        let sets = (0..groups.len()).map(|k| vec![k]).collect();
        let of_group = |group: Vec<usize>| group.into_iter().map(|i| spots[i]).collect();
        return (groups.into_iter().map(of_group).collect(), sets);
    }
    // All other kinds: each place alone, and groups of places that are built alike.
    let singles: Vec<Vec<&CandidatePlace>> = spots.iter().map(|spot| vec![*spot]).collect();
    let mut sets: Vec<Vec<usize>> = (0..singles.len()).map(|k| vec![k]).collect();
    // Waves along the travel differ in their phase, even at places that are alike otherwise.
    if mechanism.loops.is_empty() || is_wave(kind) {
        return (singles, sets);
    }
    let is_passive = |spot: &CandidatePlace| match spot.place {
        EffectPlace::Coordinate(i) => mechanism.coordinates[i.0].passive,
        _ => false,
    };
    // In mechanisms with loops, limbs are often built alike: their places may share parameters.
    for sort in [ActsOn::Drive, ActsOn::Coordinate] {
        for passive in [false, true] {
            for carries in [PlaceLoad::Force, PlaceLoad::Torque] {
                let alike: Vec<usize> = (0..spots.len())
                    .filter(|k| {
                        let s = spots[*k];
                        s.sort == sort && s.carries == carries && is_passive(s) == passive
                    })
                    .collect();
                if alike.len() > 1 {
                    sets.push(alike);
                }
            }
        }
    }
    (singles, sets)
}
