//! Places at which effects of a kind may act, alone and alike at several.

use modelmill_spec::{ActsOn, Carries, DriveKind, Mechanism, Motion, Place};

/// A place with its name and what it carries.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Spot {
    pub(crate) name: String,
    pub(crate) carries: Carries,
    pub(crate) sort: ActsOn,
    pub(crate) place: Place,
}

/// All places of a mechanism.
pub(crate) fn spots(mechanism: &Mechanism) -> Vec<Spot> {
    let carries = |motion: Motion| match motion {
        Motion::Revolute => Carries::Torque,
        Motion::Prismatic => Carries::Force,
    };
    let mut spots = Vec::new();
    let mut driven = Vec::new();
    for (d, drive) in mechanism.drives.iter().enumerate() {
        let carries = match drive.kind {
            DriveKind::Joint(i) => {
                driven.push(i.0);
                carries(mechanism.coordinates[i.0].motion)
            }
            DriveKind::Linear { .. } => Carries::Force,
        };
        spots.push(Spot {
            name: drive.name.clone(),
            carries,
            sort: ActsOn::Drive,
            place: Place::Drive(modelmill_spec::DriveIdx(d)),
        });
    }
    // A joint with a drive of its own is the same place.
    for (i, coordinate) in mechanism.coordinates.iter().enumerate() {
        if !driven.contains(&i) {
            spots.push(Spot {
                name: coordinate.name.clone(),
                carries: carries(coordinate.motion),
                sort: ActsOn::Coordinate,
                place: Place::Coordinate(modelmill_spec::CoordinateIdx(i)),
            });
        }
    }
    // Of the points that a loop joins one is enough, and what is fixed to the base feels nothing.
    let twins: Vec<usize> = mechanism.loops.iter().map(|l| l.joins[1].0).collect();
    for (i, point) in mechanism.points.iter().enumerate() {
        if point.frame.0 != 0 && !twins.contains(&i) {
            spots.push(Spot {
                name: point.name.clone(),
                carries: Carries::Mass,
                sort: ActsOn::Point,
                place: Place::Point(modelmill_spec::PointIdx(i)),
            });
        }
    }
    spots
}

/// Sets of places at which a kind may act with shared parameters: each alone, and in machines with loops, whose sides are
/// often alike, all drives, all passive joints and all active ones.
pub(crate) fn sets<'a>(mechanism: &Mechanism, spots: &[&'a Spot]) -> Vec<Vec<&'a Spot>> {
    let mut sets: Vec<Vec<&Spot>> = spots.iter().map(|spot| vec![*spot]).collect();
    if mechanism.loops.is_empty() {
        return sets;
    }
    let is_passive = |spot: &Spot| match spot.place {
        Place::Coordinate(i) => mechanism.coordinates[i.0].passive,
        _ => false,
    };
    for sort in [ActsOn::Drive, ActsOn::Coordinate] {
        for passive in [false, true] {
            for carries in [Carries::Force, Carries::Torque] {
                let alike: Vec<&Spot> = spots
                    .iter()
                    .copied()
                    .filter(|s| s.sort == sort && s.carries == carries && is_passive(s) == passive)
                    .collect();
                if alike.len() > 1 {
                    sets.push(alike);
                }
            }
        }
    }
    sets
}
