//! Virtual chains: a platform whose position in the base serves as coordinates has joints in the model that no machine
//! has. They must not be drawn.

use modelmill_spec::{CoordinateIdx, DriveKind, Mechanism, MechanismPoses, PointIdx};

/// Marks the frames of virtual chains. Such a chain leads from the base to a body that loops or linear drives hold. All
/// its coordinates are independent and have no drive, at least one is a translation, and the bodies between carry
/// nothing. The frame of the body itself is marked as well.
///
/// Without the translation it could be the cardan joint of a tilting platform, which is a real joint.
pub(crate) fn mark_virtual_frames(mechanism: &Mechanism, poses: &MechanismPoses) -> Vec<bool> {
    let mut is_virtual = vec![false; mechanism.frames.len()];
    for frame in 1..mechanism.frames.len() {
        if poses.frames()[frame].joint_axes.is_empty() || !is_held(mechanism, poses, frame) {
            continue;
        }
        let mut chain = vec![frame];
        let mut next = mechanism.frames[frame].parent.0;
        while next != 0 && is_bare(mechanism, next) {
            chain.push(next);
            next = mechanism.frames[next].parent.0;
        }
        let moves: Vec<_> = chain.iter().flat_map(|f| &poses.frames()[*f].joint_axes).collect();
        let is_free = moves.iter().all(|moved| {
            let kind = DriveKind::Joint(CoordinateIdx(moved.coordinate));
            let is_driven = mechanism
                .drives
                .iter()
                .any(|drive| drive.is_driven && drive.kind == kind);
            !mechanism.coordinates[moved.coordinate].passive && !is_driven
        });
        if next == 0 && is_free && moves.len() > 1 && moves.iter().any(|moved| !moved.is_rotation) {
            for f in chain {
                is_virtual[f] = true;
            }
        }
    }
    is_virtual
}

/// Whether a frame carries nothing but one other frame.
fn is_bare(mechanism: &Mechanism, frame: usize) -> bool {
    let bodies = mechanism.effects.iter().map(|effect| &effect.bodies);
    let mut parts = mechanism.parts.iter().chain(bodies.clone().flat_map(|b| &b.parts));
    let mut lumps = (mechanism.lumped_masses.iter()).chain(bodies.flat_map(|b| &b.lumped_masses));
    let children = mechanism.frames.iter().skip(1).filter(|f| f.parent.0 == frame);
    !parts.any(|part| part.frame.0 == frame)
        && !lumps.any(|lump| lump.frame.0 == frame)
        && !mechanism.points.iter().any(|point| point.frame.0 == frame)
        && children.count() == 1
}

/// Whether a loop or a drive between points is connected to the body of a frame.
fn is_held(mechanism: &Mechanism, poses: &MechanismPoses, frame: usize) -> bool {
    let drives = mechanism.drives.iter().chain(&mechanism.shared_drives);
    let mut held: Vec<PointIdx> = drives.flat_map(|drive| drive_ends(drive.kind)).collect();
    held.extend(mechanism.loops.iter().flat_map(|closed| closed.joins));
    held.into_iter().any(|point| {
        // Frames without a joint of their own belong to the body of their parent.
        let mut at = mechanism.points[point.0].frame.0;
        while at != 0 && at != frame && poses.frames()[at].joint_axes.is_empty() {
            at = mechanism.frames[at].parent.0;
        }
        at == frame
    })
}

/// The points of a drive between points; empty for a drive on a joint.
pub(crate) fn drive_ends(kind: DriveKind) -> Vec<PointIdx> {
    match kind {
        DriveKind::Linear { from, to } => vec![from, to],
        DriveKind::Joint(_) => Vec::new(),
    }
}
