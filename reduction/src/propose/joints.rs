//! The joints of the reduced mechanism. Places of revolute joints that move alike go in; parts with their carriers, loops
//! and the points of lumped masses come out.
//!
//! Two places whose displacements are equal are one joint of the model: a body that only translates between them changes
//! no force by its size. So a joint of the model is a set of places, and connects all parts that have a place in it.

use modelmill_rig::{BodyAnchor, Rig};
use nalgebra::Vector2;

use super::motion::{BodyMotionKind, ClassifiedMotion};
use crate::tolerance::distance_tolerance;

/// A place of a revolute joint on one of its bodies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct HingePlace {
    /// Index of the joint.
    pub(super) joint: usize,
    /// The place.
    pub(super) anchor: BodyAnchor,
}

/// Places of joints with equal displacements.
struct MovingJoint {
    path: Vec<Vector2<f64>>,
    places: Vec<HingePlace>,
}

/// A part of the proposed plan.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ProposedPart {
    /// Index of the family of bodies.
    pub(super) family: usize,
    /// Its leading body.
    pub(super) lead: usize,
    /// Index of the part that carries it; none is the base.
    pub(super) carrier: Option<usize>,
    /// Its joint on the carrier and on the leading body.
    pub(super) joint: [HingePlace; 2],
    /// The coordinate of the rig that is its angle.
    pub(super) coordinate: Option<usize>,
}

/// Bodies that become a point mass.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ProposedLumpedMass {
    /// The bodies.
    pub(super) bodies: Vec<usize>,
    /// Places on leading bodies, in equal shares.
    pub(super) at: Vec<HingePlace>,
}

/// The mechanism of the proposed plan.
#[derive(Debug, Default)]
pub(super) struct ProposedMechanism {
    /// Parts; carriers stand before what they carry.
    pub(super) parts: Vec<ProposedPart>,
    /// Pairs of places that coincide.
    pub(super) loops: Vec<[HingePlace; 2]>,
    /// Point masses.
    pub(super) lumped_masses: Vec<ProposedLumpedMass>,
    /// Bodies without a place in the model.
    pub(super) left_out: Vec<usize>,
}

/// Determines parts, loops and point masses. Fails with a reason.
pub(super) fn propose_mechanism(rig: &Rig, motion: &ClassifiedMotion) -> Result<ProposedMechanism, String> {
    let joints = moving_joints(rig, motion);
    let mut mechanism = ProposedMechanism::default();
    while let Some(part) = next_part(rig, motion, &joints, &mechanism.parts)? {
        mechanism.parts.push(part);
    }
    while let Some(k) = undetermined_part(&joints, &mechanism.parts) {
        mechanism.parts.remove(k);
        for part in &mut mechanism.parts {
            part.carrier = part
                .carrier
                .map(|carrier| if carrier > k { carrier - 1 } else { carrier });
        }
    }
    for joint in &joints {
        let ends = separate_ends(joint, motion, &mechanism.parts);
        for pair in ends.windows(2) {
            mechanism.loops.push([pair[0], pair[1]]);
        }
        // All bodies that translate with this joint.
        let mut bodies: Vec<usize> = joint.places.iter().filter_map(|place| place.anchor.body).collect();
        bodies.retain(|body| motion.kinds[*body] == BodyMotionKind::Translating);
        bodies.sort_unstable();
        bodies.dedup();
        if !bodies.is_empty() && !ends.is_empty() {
            mechanism.lumped_masses.push(ProposedLumpedMass { bodies, at: ends });
        }
    }
    for (body, kind) in motion.kinds.iter().enumerate() {
        let has_place = match kind {
            BodyMotionKind::Fixed => false,
            BodyMotionKind::Translating => mechanism.lumped_masses.iter().any(|mass| mass.bodies.contains(&body)),
            BodyMotionKind::Rotating(family) => mechanism.parts.iter().any(|part| part.family == *family),
        };
        if !has_place {
            mechanism.left_out.push(body);
        }
    }
    Ok(mechanism)
}

/// All places of revolute joints, those with equal displacements together.
fn moving_joints(rig: &Rig, motion: &ClassifiedMotion) -> Vec<MovingJoint> {
    let mut joints: Vec<MovingJoint> = Vec::new();
    for joint in 0..rig.joints.len() {
        for anchor in rig.hinge(joint).into_iter().flatten() {
            let path = motion.path(&anchor);
            let is_same = |other: &MovingJoint| {
                let pairs = other.path.iter().zip(&path);
                pairs.map(|(a, b)| (a - b).norm()).fold(0.0, f64::max) <= distance_tolerance(rig)
            };
            let place = HingePlace { joint, anchor };
            match joints.iter_mut().find(|other| is_same(other)) {
                Some(other) => other.places.push(place),
                None => joints.push(MovingJoint {
                    path,
                    places: vec![place],
                }),
            }
        }
    }
    joints
}

/// The next part: a family that is not in the model yet, at a joint that it shares with the base or a part. Joints of
/// coordinates come first, then small shifts.
fn next_part(
    rig: &Rig,
    motion: &ClassifiedMotion,
    joints: &[MovingJoint],
    parts: &[ProposedPart],
) -> Result<Option<ProposedPart>, String> {
    let mut best: Option<((bool, usize, f64), ProposedPart)> = None;
    for (family, members) in motion.families.iter().enumerate() {
        if parts.iter().any(|part| part.family == family) {
            continue;
        }
        let leads = possible_leads(rig, members)?;
        for joint in joints {
            for from in joint
                .places
                .iter()
                .filter(|p| p.anchor.body.is_some_and(|b| leads.contains(&b)))
            {
                for at in &joint.places {
                    let carrier = match at.anchor.body {
                        None => None,
                        Some(body) => match parts.iter().position(|part| part.lead == body) {
                            Some(carrier) => Some(carrier),
                            None => continue,
                        },
                    };
                    let Some(lead) = from.anchor.body else { continue };
                    let coordinate = (at.joint == from.joint)
                        .then(|| rig.coordinate_of_joint(at.joint))
                        .flatten();
                    let gap = (motion.place(&at.anchor) - motion.place(&from.anchor)).norm();
                    // Gaps are compared by their digits, so that rounding does not decide.
                    let rank = (coordinate.is_none(), carrier.map_or(0, |c| c + 1), (gap * 1e9).round());
                    let is_better = best.as_ref().is_none_or(|(known, _)| {
                        let order = rank
                            .0
                            .cmp(&known.0)
                            .then(rank.2.total_cmp(&known.2))
                            .then(rank.1.cmp(&known.1));
                        order.is_lt()
                    });
                    if is_better {
                        let part = ProposedPart {
                            family,
                            lead,
                            carrier,
                            joint: [*at, *from],
                            coordinate,
                        };
                        best = Some((rank, part));
                    }
                }
            }
        }
    }
    Ok(best.map(|(_, part)| part))
}

/// The bodies of a family that can lead its part: the one at which drives act, else that of a coordinate, else all.
fn possible_leads(rig: &Rig, members: &[usize]) -> Result<Vec<usize>, String> {
    let mut driven: Vec<usize> = (0..rig.drives.len())
        .filter_map(|drive| rig.ends_of_drive(drive))
        .flatten()
        .filter_map(|end| end.body)
        .filter(|body| members.contains(body))
        .collect();
    driven.sort_unstable();
    driven.dedup();
    if let [one, two, ..] = driven[..] {
        return Err(format!(
            "drives act on `{}` and `{}`, which move alike, and a part has contact points on its leading body only",
            rig.bodies[one].name, rig.bodies[two].name
        ));
    }
    if !driven.is_empty() {
        return Ok(driven);
    }
    let measured: Vec<usize> = (0..rig.joints.len())
        .filter(|joint| rig.coordinate_of_joint(*joint).is_some())
        .filter_map(|joint| rig.hinge(joint))
        .flatten()
        .filter_map(|anchor| anchor.body)
        .filter(|body| members.contains(body))
        .collect();
    Ok(if measured.is_empty() {
        members.to_vec()
    } else {
        measured
    })
}

/// A part without a coordinate that meets no other part, and not the base, at a second joint: no loop determines its
/// rotation, as for a rod with a sliding joint at its other end. It carries no other part.
fn undetermined_part(joints: &[MovingJoint], parts: &[ProposedPart]) -> Option<usize> {
    let is_known = |body: Option<usize>| body.is_none_or(|body| parts.iter().any(|part| part.lead == body));
    parts.iter().position(|part| {
        let meets = joints.iter().filter(|joint| {
            let bodies = || joint.places.iter().map(|place| place.anchor.body);
            bodies().any(|body| body == Some(part.lead))
                && bodies().any(|body| body != Some(part.lead) && is_known(body))
        });
        part.coordinate.is_none() && meets.count() < 2
    })
}

/// One place for each set of parts at a joint that the tree of parts does not connect there; the base has one of its own.
fn separate_ends(joint: &MovingJoint, motion: &ClassifiedMotion, parts: &[ProposedPart]) -> Vec<HingePlace> {
    // The places that the model can name: of the base and of leading bodies.
    let owner = |place: &HingePlace| -> Option<Option<usize>> {
        match place.anchor.body {
            None => Some(None),
            Some(body) => parts.iter().position(|part| part.lead == body).map(Some),
        }
    };
    let mut owners: Vec<Option<usize>> = joint.places.iter().filter_map(owner).collect();
    owners.sort_unstable();
    owners.dedup();
    // A part whose own joint this is adds no end: it is at a place of its carrier.
    owners.retain(|owner| match owner {
        None => true,
        Some(k) => {
            let own = &parts[*k].joint[1];
            !joint.places.iter().any(|place| place == own)
        }
    });
    let mut ends: Vec<HingePlace> = Vec::new();
    for wanted in owners {
        let places = joint.places.iter().filter(|place| owner(place) == Some(wanted));
        // The place nearest to the end before it.
        let distance = |place: &&HingePlace| {
            ends.first().map_or(0.0, |first| {
                (motion.place(&place.anchor) - motion.place(&first.anchor)).norm()
            })
        };
        let nearest = places.min_by(|a, b| distance(a).total_cmp(&distance(b)));
        ends.extend(nearest);
    }
    ends
}
