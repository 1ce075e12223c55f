//! Limits of the numbers of elements in a description, where a stage takes more time than in proportion to them, and
//! closures that close no loop.
//!
//! Links that are fixed to each other have no limit, because all stages take time in proportion to their number.

use std::collections::BTreeMap;

use roxmltree::{Document, Node};

use super::description::RobotDescription;
use super::thresholds::{MOST_CLOSURES, MOST_MOVING_JOINTS, MOST_NAMED_ELEMENTS};
use super::xml::located_message;

/// Elements that are counted by their tag wherever they stand.
const COUNTED: [&str; 7] = [
    "ball_constraint",
    "constraint",
    "default",
    "frame",
    "mimic",
    "site",
    "weld_constraint",
];
/// Elements in which all elements are counted together.
const COUNTED_INSIDE: [&str; 3] = ["actuator", "equality", "tendon"];

/// Elements in which a joint moves a link; elsewhere, `<joint>` refers to one.
const WITH_JOINTS: [&str; 4] = ["body", "frame", "model", "robot"];

/// Checks the number of joints that move, and of elements whose names are searched for each other. Fails with the first one beyond the limit.
pub(super) fn check_elements(document: &Document) -> Result<(), String> {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    let mut n_joints = 0;
    for node in document.descendants().filter(Node::is_element) {
        let tag = node.tag_name().name();
        let around = node.parent().map_or("", |parent| parent.tag_name().name());
        let is_joint = ["joint", "freejoint"].contains(&tag) && WITH_JOINTS.contains(&around);
        n_joints += usize::from(is_joint && node.attribute("type") != Some("fixed"));
        if n_joints > MOST_MOVING_JOINTS {
            return Err(located_message(&node, &too_many_joints()));
        }
        let kind = match (COUNTED.contains(&tag), COUNTED_INSIDE.contains(&around)) {
            (true, _) => tag,
            (_, true) => around,
            _ => continue,
        };
        let count = counts.entry(kind).or_default();
        *count += 1;
        if *count > MOST_NAMED_ELEMENTS {
            let what = if kind == tag {
                "elements of this kind"
            } else {
                "elements in"
            };
            let place = if kind == tag {
                String::new()
            } else {
                format!(" <{kind}>")
            };
            return Err(located_message(
                &node,
                &format!("the description has more than {MOST_NAMED_ELEMENTS} {what}{place}; remove those without use"),
            ));
        }
    }
    Ok(())
}

/// Checks the numbers of joints that move, which a description may have without an element, and of loop closures. Fails with
/// the first one beyond the limit, and with a closure that closes no loop.
pub(super) fn check_description(description: &RobotDescription) -> Result<(), String> {
    let mut joints = description.links.iter().flat_map(|link| &link.joints);
    if let Some(joint) = joints.nth(MOST_MOVING_JOINTS) {
        return Err(format!("line {}, `{}`: {}", joint.line, joint.name, too_many_joints()));
    }
    if let Some(closure) = (description.closures.iter()).find(|closure| closure.ends[0].0 == closure.ends[1].0) {
        return Err(format!(
            "line {}: the closure `{}` connects a link with itself; correct one of its ends, or remove it",
            closure.line, closure.name
        ));
    }
    if let Some(closure) = description.closures.get(MOST_CLOSURES) {
        return Err(format!(
            "line {}: the description has more than {MOST_CLOSURES} loop closures; the closure `{}` is one too many; remove \
             those that do not matter",
            closure.line, closure.name
        ));
    }
    Ok(())
}

/// The fault of too many joints that move.
pub(super) fn too_many_joints() -> String {
    format!(
        "the description has more than {MOST_MOVING_JOINTS} joints that move; make joints that do not matter fixed, or \
         remove them"
    )
}
