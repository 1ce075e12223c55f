//! The tree of an SDF: links and joints between them go in, links in the order of a spanning tree and closures of loops
//! come out.

use nalgebra::{Matrix3, Vector3};
use roxmltree::Node;

use super::counts::too_many_joints;
use super::description::{
    ClosureConstraint, DescriptionClosure, DescriptionJoint, DescriptionJointKind, DescriptionLink, RobotDescription,
};
use super::placed::{DescriptionPose, rotation_between_axes};
use super::sdf::{SdfJoint, inertial};
use super::thresholds::MOST_MOVING_JOINTS;
use super::xml::{line, located_message, required_attribute};

/// The part that stands for the group of a part. Parts on the way are made to lead there at once.
fn last_of_group(leads: &mut [usize], part: usize) -> usize {
    let mut last = part;
    while leads[last] != last {
        last = leads[last];
    }
    let mut here = part;
    while leads[here] != last {
        here = std::mem::replace(&mut leads[here], last);
    }
    last
}

/// Builds a tree from links and joints. Joints that close a loop become closures, preferably ball joints.
#[allow(
    clippy::too_many_lines,
    reason = "tree first, then what closes rings, on the same tables"
)]
pub(super) fn build_link_tree(
    out: &mut RobotDescription,
    nodes: &[Node],
    places: &[DescriptionPose],
    joints: &[SdfJoint],
    own: &DescriptionPose,
    base: usize,
) -> Result<(), String> {
    // Spanning tree by merging groups of connected links; the world is the last entry. Ball joints come last, so that
    // they are cut.
    let n = nodes.len();
    let part = |link: Option<usize>| link.unwrap_or(n);
    let mut order: Vec<usize> = (0..joints.len()).collect();
    order.sort_by_key(|k| joints[*k].kind == "ball");
    // Each part leads to another one of its group; the last one stands for the group.
    let mut leads: Vec<usize> = (0..=n).collect();
    let mut in_tree = vec![false; joints.len()];
    for k in order {
        let [one, other] = [part(joints[k].parent), part(joints[k].child)].map(|p| last_of_group(&mut leads, p));
        // A joint between two groups connects them; a joint inside of a group would close a loop.
        if one != other {
            in_tree[k] = true;
            leads[other] = one;
        }
    }
    // The joints of the tree at each part, in the order of the file.
    let mut at: Vec<Vec<usize>> = vec![Vec::new(); n + 1];
    for k in (0..joints.len()).filter(|k| in_tree[*k]) {
        at[part(joints[k].parent)].push(k);
        at[part(joints[k].child)].push(k);
    }
    // Links in the order in which they are reached: from the world, then from the base link, then from the remaining
    // links. The last two get a free joint.
    let mut index: Vec<Option<usize>> = vec![None; n];
    let mut n_free = 0;
    let starts = [None, Some(base)].into_iter().chain((0..n).map(Some));
    for start in starts {
        if let Some(link) = start {
            if index[link].is_some() {
                continue;
            }
            let suffix = if link == base {
                String::new()
            } else {
                format!("_{}", nodes[link].attribute("name").unwrap_or_default())
            };
            // A link that no joint connects to the world is a free body.
            n_free += 1;
            if n_free > MOST_MOVING_JOINTS {
                return Err(located_message(&nodes[link], &too_many_joints()));
            }
            index[link] = Some(out.links.len());
            out.links.push(DescriptionLink {
                name: required_attribute(&nodes[link], "name")?,
                parent: None,
                at: own.compose(&places[link]),
                joints: vec![DescriptionJoint::new(
                    format!("base{suffix}"),
                    DescriptionJointKind::Free,
                    line(&nodes[link]),
                )],
                inertial: inertial(&nodes[link])?,
            });
        }
        // Follow the joints of the tree from this link.
        let mut waiting = vec![start];
        while let Some(here) = waiting.pop() {
            for between in at[part(here)].iter().map(|k| &joints[*k]) {
                // The tree can pass a joint in either direction.
                let is_forward = between.parent == here;
                let there = if is_forward { between.child } else { between.parent };
                let Some(link) = there.filter(|link| index[*link].is_none()) else {
                    continue;
                };
                // A joint that is passed from child to parent has the opposite axis, and its parts in reverse order.
                let carrier = here.map_or_else(|| own.inverse(), |link| places[link]);
                let to_link = places[link].inverse();
                let mut moving = between.joints.clone();
                for joint in &mut moving {
                    // The anchor and the axis in the axes of the link that the joint moves.
                    joint.anchor = to_link.compose(&between.place).p;
                    joint.axis = to_link.r * joint.axis;
                    if !is_forward {
                        joint.axis = -joint.axis;
                    }
                }
                if !is_forward {
                    if moving.iter().any(|joint| joint.kind == DescriptionJointKind::Ball) {
                        out.remarks.push(format!(
                            "line {}: the tree passes the ball joint `{}` from child to parent; its angles are those of the parent relative to \
                             the child",
                            between.line, between.name
                        ));
                    }
                    moving.reverse();
                }
                index[link] = Some(out.links.len());
                out.links.push(DescriptionLink {
                    name: required_attribute(&nodes[link], "name")?,
                    parent: here.and_then(|link| index[link]),
                    at: carrier.inverse().compose(&places[link]),
                    joints: moving,
                    inertial: inertial(&nodes[link])?,
                });
                waiting.push(Some(link));
            }
        }
    }
    // Joints outside of the tree close loops.
    for between in joints.iter().zip(&in_tree).filter(|(_, is)| !**is).map(|(b, _)| b) {
        // The conditions of the closure.
        let constraint = match between.kind.as_str() {
            "ball" => ClosureConstraint::Origins,
            "revolute" | "continuous" => ClosureConstraint::Axes,
            "fixed" => ClosureConstraint::Frames,
            other => {
                return Err(format!(
                    "line {}: the joint `{}` closes a loop and is {other}; loops can be closed by ball, revolute and fixed joints only",
                    between.line, between.name
                ));
            }
        };
        // A hinge has its axis along x of the closure's frame.
        let mut place = between.place;
        if let (ClosureConstraint::Axes, Some(joint)) = (constraint, between.joints.first()) {
            place.r = rotation_between_axes(&Vector3::x(), &joint.axis).unwrap_or_else(Matrix3::identity);
        }
        // The same pose as seen from the links at both ends.
        let end = |link: Option<usize>| match link {
            Some(link) => (index[link], places[link].inverse().compose(&place)),
            None => (None, own.compose(&place)),
        };
        // A cut joint has no coordinate, so nothing can act on it.
        for joint in &between.joints {
            let acting = [joint.damping, joint.friction, joint.stiffness, joint.armature];
            if joint.has_limits() || acting.iter().any(|value| *value != 0.0) {
                out.remarks.push(format!(
                    "line {}: damping, friction, spring, rotor and limits of `{}`, which closes a loop, are left out",
                    between.line, between.name
                ));
            }
        }
        out.closures.push(DescriptionClosure {
            name: between.name.clone(),
            line: between.line,
            ends: [end(between.parent), end(between.child)],
            constraint,
        });
    }
    Ok(())
}
