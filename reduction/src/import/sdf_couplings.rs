//! Couplings of SDF: gearboxes, which couple the angles of two other joints and have no motion of their own, and screws.
//!
//! For a gearbox, let theta_1 be the angle from the reference body to the parent about `<axis>`, and theta_2 that from the
//! reference body to the child about `<axis2>`. Then theta_2 = -ratio theta_1 (sdformat.org/spec, `gearbox_reference_body`).

use roxmltree::Node;

use super::description::{DescriptionCoupling, DescriptionJoint, DescriptionJointKind};
use super::sdf::{FormatVersion, SdfFrames, SdfJoint, axis_in_model, joint_end, number_of, pose_in_model};
use super::xml::{child, line, located_message, required_attribute, required_child};

/// Largest sine of the angle between an axis of a gearbox and that of the joint that it couples (1). Directions with five
/// digits are that close.
const PARALLEL: f64 = 1e-4;

/// The coupling of a gearbox between two of the joints; fails with one line if the reference body has no joint with the
/// parent or the child, or about another axis.
pub(super) fn gearbox_coupling(
    node: &Node,
    frames: &SdfFrames,
    version: FormatVersion,
    joints: &[SdfJoint],
) -> Result<DescriptionCoupling, String> {
    let name = required_attribute(node, "name")?;
    let ratio =
        number_of(node, "gearbox_ratio")?.ok_or_else(|| located_message(node, "a gearbox needs <gearbox_ratio>"))?;
    let place = pose_in_model(frames, &name, node, SdfFrames::TOP)?;
    let reference = joint_end(node, "gearbox_reference_body", frames)?;
    let mut turned = Vec::new();
    for (tag, axis) in [("parent", "axis"), ("child", "axis2")] {
        let link = joint_end(node, tag, frames)?;
        let axis = required_child(node, axis)?;
        let direction = axis_in_model(&axis, frames, version, &place)?;
        let between = joints.iter().find_map(|one| hinge_between(one, [reference, link]));
        let (joint, is_forward) = between.ok_or_else(|| {
            located_message(
                node,
                &format!(
                    "the <{tag}> of the gearbox `{name}` has no revolute joint with its <gearbox_reference_body>; name a body \
                     to which both have one"
                ),
            )
        })?;
        let (one, other) = (direction.normalize(), joint.axis.normalize());
        if one.cross(&other).norm() > PARALLEL {
            return Err(located_message(
                node,
                &format!(
                    "an axis of the gearbox `{name}` is not that of the joint `{}`",
                    joint.name
                ),
            ));
        }
        // The angle of the gearbox in terms of that of the joint.
        let sign = if is_forward { 1.0 } else { -1.0 } * one.dot(&other).signum();
        turned.push((joint.name.clone(), sign));
    }
    if child(node, "sensor").is_some() {
        return Err(located_message(
            node,
            "a gearbox with a sensor is not read; delete the sensor",
        ));
    }
    let [(leader, first), (follower, second)] = [&turned[0], &turned[1]];
    Ok(DescriptionCoupling {
        line: line(node),
        joint: follower.clone(),
        leader: Some(leader.clone()),
        ratio: -ratio * first * second,
        offset: 0.0,
    })
}

/// The hinge between a body and a link, and whether the body is its parent; none for other joints.
fn hinge_between(joint: &SdfJoint, [body, link]: [Option<usize>; 2]) -> Option<(&DescriptionJoint, bool)> {
    let [hinge] = joint.joints.as_slice() else { return None };
    if hinge.kind != DescriptionJointKind::Revolute {
        return None;
    }
    let ends = [joint.parent, joint.child];
    let is_forward = ends == [body, link];
    (is_forward || ends == [link, body]).then_some((hinge, is_forward))
}

/// The coupling of a screw: the translation follows the rotation, which keeps the limits and losses.
pub(super) fn screw_coupling(
    node: &Node,
    turn: &DescriptionJoint,
    slide: &mut DescriptionJoint,
) -> Result<DescriptionCoupling, String> {
    let pitch = number_of(node, "screw_thread_pitch")?.ok_or_else(|| {
        located_message(
            node,
            "it needs <screw_thread_pitch>, in metres per revolution; the older <thread_pitch> is ambiguous",
        )
    })?;
    // The translation keeps only axis and anchor; limits and losses are not counted twice.
    let mut bare = DescriptionJoint::new(slide.name.clone(), DescriptionJointKind::Prismatic, slide.line);
    (bare.axis, bare.anchor) = (slide.axis, slide.anchor);
    bare.is_driven = false;
    *slide = bare;
    Ok(DescriptionCoupling {
        line: line(node),
        joint: slide.name.clone(),
        leader: Some(turn.name.clone()),
        ratio: pitch / std::f64::consts::TAU,
        offset: 0.0,
    })
}
