//! Reads what URDF describes by extensions: closures of loops (`<constraint>`, Drake's `ball_constraint`) and rotors of
//! transmissions (Drake's `rotor_inertia` and `gear_ratio`).
//!
//! Sources: the proposal of closed loops for urdfdom (issue 264), and Drake's list of custom tags
//! (drake.mit.edu, "Custom Drake tags for parsing").

use nalgebra::Vector3;
use roxmltree::Node;

use super::description::{ClosureConstraint, DescriptionClosure, RobotDescription};
use super::placed::{DescriptionPose, rotation_between_axes};
use super::urdf::child_pose;
use super::xml::{
    child, children, exact_numbers, line, located_message, number_attribute, required_attribute, required_child,
    three_numbers, vector,
};

/// Reads the closures of loops. The links must be known.
pub(super) fn read_closures(out: &mut RobotDescription, robot: &Node) -> Result<(), String> {
    for node in children(robot, "constraint") {
        let closure = constraint(out, &node)?;
        out.closures.push(closure);
    }
    for node in children(robot, "ball_constraint") {
        let closure = ball_constraint(&node, |name| link_index(out, &node, name))?;
        out.closures.push(closure);
    }
    Ok(())
}

/// The index of a link by its name.
fn link_index(out: &RobotDescription, node: &Node, name: &str) -> Result<Option<usize>, String> {
    let index = out.links.iter().position(|link| link.name == name);
    index
        .map(Some)
        .ok_or_else(|| located_message(node, &format!("there is no link `{name}`")))
}

/// A `<constraint>`: a joint between two links that closes a loop, with its frame in both.
fn constraint(out: &RobotDescription, node: &Node) -> Result<DescriptionClosure, String> {
    let constraint = match required_attribute(node, "type")?.as_str() {
        "ball" | "spherical" => ClosureConstraint::Origins,
        "revolute" | "continuous" => ClosureConstraint::Axes,
        "fixed" => ClosureConstraint::Frames,
        other => {
            let fault = format!(
                "it closes a loop and is {other}; loops can be closed by ball, revolute and fixed constraints only"
            );
            return Err(located_message(node, &fault));
        }
    };
    let end = |side: &str| -> Result<(Option<usize>, DescriptionPose), String> {
        let name = required_attribute(&required_child(node, side)?, "link")?;
        let mut place = child_pose(node, &format!("{side}_origin"))?;
        // A hinge has its axis along x of the closure's frame; the default axis is x.
        if constraint == ClosureConstraint::Axes
            && let Some(axis) = child(node, &format!("{side}_axis"))
        {
            let direction = vector(three_numbers(&axis, "xyz")?);
            let turn = rotation_between_axes(&Vector3::x(), &direction)
                .ok_or_else(|| located_message(&axis, "the axis has no direction"))?;
            place.r *= turn;
        }
        Ok((link_index(out, node, &name)?, place))
    };
    let ends = [end("parent")?, end("child")?];
    Ok(DescriptionClosure {
        name: node.attribute("name").map_or_else(|| closure_name(node), str::to_owned),
        line: line(node),
        ends,
        constraint,
    })
}

/// The name of a closure that has none in the file.
fn closure_name(node: &Node) -> String {
    format!("closure_{}", line(node))
}

/// Drake's `ball_constraint`: a point of one link coincides with a point of another. `link` finds a link by its name.
pub(super) fn ball_constraint(
    node: &Node,
    link: impl Fn(&str) -> Result<Option<usize>, String>,
) -> Result<DescriptionClosure, String> {
    // URDF has the values in attributes, SDF as text.
    let value = |key: &str| -> Result<String, String> {
        let inner = required_child(node, &format!("ball_constraint_{key}"))?;
        let text = inner.attribute("name").or(inner.attribute("value")).or(inner.text());
        Ok(text.unwrap_or_default().trim().to_owned())
    };
    let end = |body: &str, point: &str| -> Result<(Option<usize>, DescriptionPose), String> {
        let mut place = DescriptionPose::identity();
        place.p = vector(exact_numbers(node, point, &value(point)?)?);
        Ok((link(&value(body)?)?, place))
    };
    Ok(DescriptionClosure {
        name: closure_name(node),
        line: line(node),
        ends: [end("body_A", "p_AP")?, end("body_B", "p_BQ")?],
        constraint: ClosureConstraint::Origins,
    })
}

/// Adds the rotors of transmissions to their joints: the inertia at the joint is that of the rotor times the square of
/// the gear ratio.
pub(super) fn read_rotors(out: &mut RobotDescription, robot: &Node) -> Result<(), String> {
    for node in children(robot, "transmission") {
        for actuator in children(&node, "actuator") {
            let Some(rotor) = child(&actuator, "rotor_inertia") else {
                continue;
            };
            let rotor_node = rotor;
            let rotor = number_attribute(&rotor_node, "value")?;
            if rotor < 0.0 {
                return Err(located_message(&rotor_node, "a rotor inertia cannot be negative"));
            }
            let gear = child(&actuator, "gear_ratio").map_or(Ok(1.0), |gear| number_attribute(&gear, "value"))?;
            let mut names = children(&node, "joint");
            let (Some(joint), None) = (names.next(), names.next()) else {
                return Err(located_message(
                    &node,
                    "a rotor inertia needs exactly one <joint> in the transmission",
                ));
            };
            let name = required_attribute(&joint, "name")?;
            let mut joints = out.links.iter_mut().flat_map(|link| &mut link.joints);
            let Some(joint) = joints.find(|joint| joint.name == name) else {
                let remark =
                    format!("its rotor inertia is left out, since the joint `{name}` is fixed or does not exist");
                out.remarks.push(located_message(&node, &remark));
                continue;
            };
            joint.armature += rotor * gear * gear;
        }
    }
    Ok(())
}
