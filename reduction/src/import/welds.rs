//! Loops that hold all of two frames are cut where they are simplest.
//!
//! A weld says six things, and three points that coincide say them in nine equations. Where the loop has a ball joint or a
//! hinge that nothing drives, it can just as well be cut there: what lies between weld and joint hangs on the other side, the
//! weld is a fixed place, and what closes the loop is one point, or two on an axis. The angles of that joint are no
//! coordinates any more.

use nalgebra::{Matrix3, Vector3};

use super::description::{
    ClosureConstraint, DescriptionClosure, DescriptionJoint, DescriptionJointKind, DescriptionLink,
    RobotDescription,
};
use super::placed::DescriptionPose;

/// Axes meet where they come this near to each other, m.
const MEETING_DISTANCE: f64 = 1e-9;
/// Axes whose volume is below this do not turn about all directions.
const COPLANAR_VOLUME: f64 = 1e-6;

/// A joint at which a loop can be cut.
struct LoopCut {
    /// From the welded link upwards to the one that hangs on the joint.
    inverted_links: Vec<usize>,
    /// Links that weigh nothing between the parts of the joint.
    massless_links: Vec<usize>,
    /// The place of the joint in the link that hangs on it, its axis along x.
    at: DescriptionPose,
    constraint: ClosureConstraint,
}

impl LoopCut {
    /// Points before axes, and then as little as can be hung anew.
    fn rank(&self) -> (bool, usize) {
        (
            self.constraint != ClosureConstraint::Origins,
            self.inverted_links.len(),
        )
    }
}

/// Cuts welds at joints, where there are such.
pub(crate) fn cut_at_joints(description: &mut RobotDescription) {
    for k in 0..description.closures.len() {
        let closure = &mut description.closures[k];
        for (link, placed) in &mut closure.ends {
            // A link that is fixed to its parent is a place in it.
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

/// A link and those that carry it.
fn ancestors(links: &[DescriptionLink], link: Option<usize>) -> Vec<usize> {
    std::iter::successors(link, |link| links[*link].parent).collect()
}

/// The joints at which what hangs between them and one end of a weld can go to the other end.
fn possible_cuts(
    description: &RobotDescription,
    end: Option<usize>,
    other: Option<usize>,
) -> Vec<LoopCut> {
    let links = &description.links;
    let shared = ancestors(links, other);
    let mut turned = Vec::new();
    let mut found = Vec::new();
    for link in ancestors(links, end) {
        if shared.contains(&link) {
            break;
        }
        turned.push(link);
        found.extend(cut_below(description, &turned));
        // Only what has one axis can be hung the other way round.
        let joints = &links[link].joints;
        if joints.len() > 1
            || joints.iter().any(|j| {
                matches!(
                    j.kind,
                    DescriptionJointKind::Ball | DescriptionJointKind::Free
                )
            })
        {
            break;
        }
    }
    found
}

/// The cut between the last of some links and what carries it.
fn cut_below(description: &RobotDescription, turned: &[usize]) -> Option<LoopCut> {
    let links = &description.links;
    let may_go = |joint: &DescriptionJoint| {
        let mut couplings = description.couplings.iter();
        let is_coupled =
            couplings.any(|c| c.joint == joint.name || c.leader.as_ref() == Some(&joint.name));
        let acts = [
            joint.damping,
            joint.friction,
            joint.armature,
            joint.stiffness,
        ];
        !joint.is_driven && !is_coupled && acts.iter().all(|x| x.abs() <= 0.0)
    };
    // Joints upwards, each with its place in the link that hangs on them while all stand at their zero.
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
        for joint in link.joints.iter().rev() {
            let at = DescriptionPose {
                p: joint.anchor,
                r: axes_along(&joint.axis)?,
            };
            found.push((joint.kind, seen.compose(&at)));
        }
        if is_ball(&found) {
            return Some(LoopCut {
                inverted_links: turned.to_vec(),
                massless_links: within,
                at: found[0].1,
                constraint: ClosureConstraint::Origins,
            });
        }
        let parent = link.parent?;
        let inertial = &links[parent].inertial;
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
        seen = seen.compose(&link.at.inverse());
        here = parent;
        within.push(here);
    }
    // One hinge by itself, if no ball joint is there.
    let (kind, at) = found.first()?;
    (*kind == DescriptionJointKind::Revolute && links[own].joints.len() == 1).then(|| LoopCut {
        inverted_links: turned.to_vec(),
        massless_links: Vec::new(),
        at: *at,
        constraint: ClosureConstraint::Axes,
    })
}

/// Whether joints are one ball joint together.
fn is_ball(found: &[(DescriptionJointKind, DescriptionPose)]) -> bool {
    match found {
        [(DescriptionJointKind::Ball, _)] => true,
        [
            (DescriptionJointKind::Revolute, a),
            (DescriptionJointKind::Revolute, b),
            (DescriptionJointKind::Revolute, c),
        ] => {
            let meet = |x: &DescriptionPose| (x.p - a.p).amax() < MEETING_DISTANCE;
            let axes = Matrix3::from_columns(&[a.r.column(0), b.r.column(0), c.r.column(0)]);
            meet(b) && meet(c) && axes.determinant().abs() > COPLANAR_VOLUME
        }
        _ => false,
    }
}

/// Axes of which x points along a direction.
fn axes_along(direction: &Vector3<f64>) -> Option<Matrix3<f64>> {
    let x = direction.try_normalize(0.0)?;
    let mut away = Vector3::zeros();
    away[x.iamin()] = 1.0;
    let y = (away - x * x.dot(&away)).normalize();
    Some(Matrix3::from_columns(&[x, y, x.cross(&y)]))
}

/// Hangs what lies between weld and joint on the other end of the weld, and makes the joint the closure.
fn apply_cut(description: &mut RobotDescription, closure: usize, end: usize, cut: &LoopCut) {
    let (other, there) = description.closures[closure].ends[1 - end];
    let (_, here) = description.closures[closure].ends[end];
    let own = cut.inverted_links[cut.inverted_links.len() - 1];
    // Where the joint is in what carries it.
    let parts: Vec<usize> = [own]
        .into_iter()
        .chain(cut.massless_links.iter().copied())
        .collect();
    let mut carrier = None;
    let mut in_carrier = cut.at;
    let mut names = Vec::new();
    for part in parts {
        let link = &mut description.links[part];
        in_carrier = link.at.compose(&in_carrier);
        carrier = link.parent;
        let joints = std::mem::take(&mut link.joints);
        names.extend(
            joints
                .into_iter()
                .rev()
                .map(|joint| format!("`{}`", joint.name)),
        );
    }
    names.reverse();
    let (mut parent, mut at, mut joints) = (other, there.compose(&here.inverse()), Vec::new());
    for link in &cut.inverted_links {
        let now = &mut description.links[*link];
        let before = std::mem::replace(&mut now.at, at);
        let reversed = std::mem::replace(&mut now.joints, joints);
        now.parent = parent;
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
    let DescriptionClosure {
        line,
        ends,
        constraint: holds,
        ..
    } = &mut description.closures[closure];
    *holds = cut.constraint;
    *ends = [(carrier, in_carrier), (Some(own), cut.at)];
    let says = format!(
        "line {line}: the loop is cut at {}, which {} no coordinate of {} own here",
        names.join(", "),
        if names.len() == 1 { "has" } else { "have" },
        if names.len() == 1 { "its" } else { "their" },
    );
    description.remarks.push(says);
}

/// Puts parents before their children again, in the order in which they stood otherwise.
fn sort_links(description: &mut RobotDescription) {
    let mut order: Vec<usize> = Vec::new();
    while order.len() < description.links.len() {
        for (k, link) in description.links.iter().enumerate() {
            if !order.contains(&k) && link.parent.is_none_or(|parent| order.contains(&parent)) {
                order.push(k);
            }
        }
    }
    let place = |link: usize| order.iter().position(|k| *k == link).unwrap_or(link);
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
    let mut links: Vec<(usize, DescriptionLink)> =
        description.links.drain(..).enumerate().collect();
    for (_, link) in &mut links {
        link.parent = link.parent.map(place);
    }
    links.sort_by_key(|(k, _)| place(*k));
    description.links = links.into_iter().map(|(_, link)| link).collect();
}
