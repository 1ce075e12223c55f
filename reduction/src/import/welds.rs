//! Replaces rigid loop closures (welds) by simpler ones. A description with welds goes in; loops cut at undriven joints
//! come out.
//!
//! A weld has six conditions, and three coincident points express them in nine equations. If the loop has an undriven
//! ball joint or hinge, the loop can be cut there instead: the links between weld and joint are attached to the other
//! side, the weld becomes a fixed connection, and one point closes the loop, or two points on an axis. The angles of
//! that joint are then no coordinates.

use nalgebra::{Matrix3, Vector3};

use super::description::{
    ClosureConstraint, DescriptionClosure, DescriptionJoint, DescriptionJointKind, DescriptionLink, RobotDescription,
};
use super::placed::DescriptionPose;

/// Axes closer to each other than this intersect, m.
const MEETING_DISTANCE: f64 = 1e-9;
/// Three unit axes with a triple product below this are coplanar, so they are no ball joint.
const COPLANAR_VOLUME: f64 = 1e-6;

/// A joint at which a loop can be cut.
struct LoopCut {
    /// Links whose parent changes: from the welded link up to the child of the joint.
    inverted_links: Vec<usize>,
    /// Massless links between the hinges that form a ball joint.
    massless_links: Vec<usize>,
    /// Pose of the joint in its child link, with the axis along x.
    at: DescriptionPose,
    /// The closure that replaces the weld.
    constraint: ClosureConstraint,
}

impl LoopCut {
    /// Order of preference: one point before an axis, then few inverted links.
    fn rank(&self) -> (bool, usize) {
        (self.constraint != ClosureConstraint::Origins, self.inverted_links.len())
    }
}

/// Replaces each weld by a cut at a joint of its loop, if there is a suitable one.
pub(crate) fn cut_at_joints(description: &mut RobotDescription) {
    for k in 0..description.closures.len() {
        // Express the ends in links that move.
        let closure = &mut description.closures[k];
        for (link, placed) in &mut closure.ends {
            // A frame of a link that is fixed to its parent is a frame of the parent.
            while let Some(own) = *link
                && description.links[own].joints.is_empty()
            {
                *placed = description.links[own].at.compose(placed);
                *link = description.links[own].parent;
            }
        }
        if closure.constraint != ClosureConstraint::Frames {
            continue;
        }
        // The best cut on each side of the weld, then the better of both.
        let ends = closure.ends.map(|(link, _)| link);
        let cuts = [1, 0].map(|end| {
            let best = possible_cuts(description, ends[end], ends[1 - end])
                .into_iter()
                .min_by_key(LoopCut::rank);
            best.map(|cut| (end, cut))
        });
        if let Some((end, cut)) = cuts.into_iter().flatten().min_by_key(|(_, cut)| cut.rank()) {
            apply_cut(description, k, end, &cut);
        }
    }
    sort_links(description);
}

/// A link and its ancestors, from the link upwards.
fn ancestors(links: &[DescriptionLink], link: Option<usize>) -> Vec<usize> {
    std::iter::successors(link, |link| links[*link].parent).collect()
}

/// The joints between one end of a weld and the common ancestor at which the loop can be cut.
fn possible_cuts(description: &RobotDescription, end: Option<usize>, other: Option<usize>) -> Vec<LoopCut> {
    let links = &description.links;
    // Joints above the common ancestor are not in the loop.
    let shared = ancestors(links, other);
    let mut turned = Vec::new();
    let mut found = Vec::new();
    for link in ancestors(links, end) {
        if shared.contains(&link) {
            break;
        }
        // With a cut below this link, it and the links before it are attached to the other side.
        turned.push(link);
        found.extend(cut_below(description, &turned));
        // Only links with at most one axis can be inverted.
        let joints = &links[link].joints;
        if joints.len() > 1
            || joints
                .iter()
                .any(|j| matches!(j.kind, DescriptionJointKind::Ball | DescriptionJointKind::Free))
        {
            break;
        }
    }
    found
}

/// The cut between the last link of `turned` and its parent, if its joints are undriven, uncoupled and without losses.
fn cut_below(description: &RobotDescription, turned: &[usize]) -> Option<LoopCut> {
    let links = &description.links;
    let may_go = |joint: &DescriptionJoint| {
        let mut couplings = description.couplings.iter();
        // The joint loses its coordinate, so that nothing may refer to it or act on it.
        let is_coupled = couplings.any(|c| c.joint == joint.name || c.leader.as_ref() == Some(&joint.name));
        let acts = [joint.damping, joint.friction, joint.armature, joint.stiffness];
        !joint.is_driven && !is_coupled && acts.iter().all(|x| x.abs() <= 0.0)
    };
    // Joints upwards, each with its pose in the last link of `turned` while all joints are at zero.
    let mut found: Vec<(DescriptionJointKind, DescriptionPose)> = Vec::new();
    let mut within = Vec::new();
    let mut seen = DescriptionPose::identity();
    let own = *turned.last()?;
    let mut here = own;
    loop {
        let link = &links[here];
        if link.joints.is_empty() || !link.joints.iter().all(may_go) {
            break;
        }
        // The last joint of a link is nearest to it.
        for joint in link.joints.iter().rev() {
            let at = DescriptionPose {
                p: joint.anchor,
                r: axes_along(&joint.axis)?,
            };
            found.push((joint.kind, seen.compose(&at)));
        }
        // A ball joint: one point closes the loop.
        if is_ball(&found) {
            return Some(LoopCut {
                inverted_links: turned.to_vec(),
                massless_links: within,
                at: found[0].1,
                constraint: ClosureConstraint::Origins,
            });
        }
        let parent = link.parent?;
        // Otherwise go on through a link without mass.
        let inertial = &links[parent].inertial;
        // Hinges of one ball joint are separated by links without mass, other children and closures.
        let is_bare = inertial.mass == 0.0
            && inertial.inertia.amax() == 0.0
            && links.iter().filter(|l| l.parent == Some(parent)).count() == 1
            && description
                .closures
                .iter()
                .all(|c| c.ends.iter().all(|(end, _)| *end != Some(parent)));
        if !is_bare || found.len() >= 3 {
            break;
        }
        // The pose of the parent in the last link of `turned`.
        seen = seen.compose(&link.at.inverse());
        here = parent;
        within.push(here);
    }
    // If there is no ball joint, a single hinge.
    let (kind, at) = found.first()?;
    (*kind == DescriptionJointKind::Revolute && links[own].joints.len() == 1).then(|| LoopCut {
        inverted_links: turned.to_vec(),
        massless_links: Vec::new(),
        at: *at,
        constraint: ClosureConstraint::Axes,
    })
}

/// Whether joints form a ball joint: one ball, or three hinges with intersecting axes that are not coplanar.
fn is_ball(found: &[(DescriptionJointKind, DescriptionPose)]) -> bool {
    match found {
        [(DescriptionJointKind::Ball, _)] => true,
        [
            (DescriptionJointKind::Revolute, a),
            (DescriptionJointKind::Revolute, b),
            (DescriptionJointKind::Revolute, c),
        ] => {
            // All axes pass through one point and span space.
            let meet = |x: &DescriptionPose| (x.p - a.p).amax() < MEETING_DISTANCE;
            let axes = Matrix3::from_columns(&[a.r.column(0), b.r.column(0), c.r.column(0)]);
            meet(b) && meet(c) && axes.determinant().abs() > COPLANAR_VOLUME
        }
        _ => false,
    }
}

/// A right-handed rotation matrix with x along a direction; none for a zero vector.
fn axes_along(direction: &Vector3<f64>) -> Option<Matrix3<f64>> {
    let x = direction.try_normalize(0.0)?;
    // The coordinate axis farthest from x, made perpendicular to it.
    let mut away = Vector3::zeros();
    away[x.iamin()] = 1.0;
    let y = (away - x * x.dot(&away)).normalize();
    Some(Matrix3::from_columns(&[x, y, x.cross(&y)]))
}

/// Attaches the links between weld and joint to the other end of the weld, and makes the joint the closure.
fn apply_cut(description: &mut RobotDescription, closure: usize, end: usize, cut: &LoopCut) {
    // The two frames that the weld connects.
    let (other, there) = description.closures[closure].ends[1 - end];
    let (_, here) = description.closures[closure].ends[end];
    let own = cut.inverted_links[cut.inverted_links.len() - 1];
    // Pose of the joint in its parent, past the massless links; all its joints are removed.
    let parts: Vec<usize> = [own].into_iter().chain(cut.massless_links.iter().copied()).collect();
    let mut carrier = None;
    let mut in_carrier = cut.at;
    let mut names = Vec::new();
    for part in parts {
        let link = &mut description.links[part];
        in_carrier = link.at.compose(&in_carrier);
        carrier = link.parent;
        let joints = std::mem::take(&mut link.joints);
        names.extend(joints.into_iter().rev().map(|joint| format!("`{}`", joint.name)));
    }
    names.reverse();
    // Invert the chain: each link gets the inverse pose, and the joint of the link above it with the opposite axis.
    let (mut parent, mut at, mut joints) = (other, there.compose(&here.inverse()), Vec::new());
    for link in &cut.inverted_links {
        let now = &mut description.links[*link];
        // What the link had before belongs to the next link in the inverted chain.
        let before = std::mem::replace(&mut now.at, at);
        let reversed = std::mem::replace(&mut now.joints, joints);
        now.parent = parent;
        // The joint in the axes of the link that was its parent.
        joints = reversed
            .into_iter()
            .map(|joint| DescriptionJoint {
                anchor: before.p + before.r * joint.anchor,
                axis: -(before.r * joint.axis),
                ..joint
            })
            .collect();
        parent = Some(*link);
        at = before.inverse();
    }
    // The closure is now at the joint.
    let DescriptionClosure {
        line,
        ends,
        constraint: holds,
        ..
    } = &mut description.closures[closure];
    *holds = cut.constraint;
    *ends = [(carrier, in_carrier), (Some(own), cut.at)];
    let says = format!(
        "line {line}: the loop is cut at {}, which {} no {} in the model",
        names.join(", "),
        if names.len() == 1 { "has" } else { "have" },
        if names.len() == 1 { "coordinate" } else { "coordinates" },
    );
    description.remarks.push(says);
}

/// Sorts links so that parents stand before their children, with as few changes of the order as possible.
fn sort_links(description: &mut RobotDescription) {
    let n = description.links.len();
    let mut order: Vec<usize> = Vec::new();
    let mut places: Vec<Option<usize>> = vec![None; n];
    // One pass is enough unless welds were cut; each cut may need another one.
    while order.len() < n {
        for (k, link) in description.links.iter().enumerate() {
            if places[k].is_none() && link.parent.is_none_or(|parent| places[parent].is_some()) {
                places[k] = Some(order.len());
                order.push(k);
            }
        }
    }
    // Replace all indices of links by the new ones.
    let place = |link: usize| places[link].unwrap_or(link);
    for closure in &mut description.closures {
        for (link, _) in &mut closure.ends {
            *link = link.map(place);
        }
    }
    for line in &mut description.straight_drives {
        for (link, _) in &mut line.ends {
            *link = link.map(place);
        }
    }
    let mut links: Vec<(usize, DescriptionLink)> = description.links.drain(..).enumerate().collect();
    for (_, link) in &mut links {
        link.parent = link.parent.map(place);
    }
    links.sort_by_key(|(k, _)| place(*k));
    description.links = links.into_iter().map(|(_, link)| link).collect();
}
