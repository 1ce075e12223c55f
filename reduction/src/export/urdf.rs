//! Writes URDF: a tree of links with inertias and friction goes in, XML comes out. A coordinate that moves several
//! joints moves one of them, and the others mimic it.

use std::fmt::Write as _;

use modelmill_boundary::message;
use modelmill_boundary::text::Message;
use modelmill_spec::{DriveKind, Mechanism};
use nalgebra::{Matrix3, Rotation3, Vector3};

use super::friction::{PassiveEffects, PassiveProperties};
use super::inertia::LinkInertia;
use super::tree::{ExportedJoint, ExportedLink, LinkPlacement, LinkTree};
use super::{FollowedCoordinate, number_list, number_text};

/// Limit that is written for a joint without limits, in SI units; the format requires a number.
const UNLIMITED_RANGE: f64 = 1000.0;

/// The URDF of a mechanism.
pub(super) fn write(
    mechanism: &Mechanism,
    tree: &LinkTree,
    bodies: &[LinkInertia],
    friction: &PassiveEffects,
    remarks: &mut Vec<Message>,
) -> String {
    report_unsupported(mechanism, remarks);
    // The base link, then each link with the joints from its parent.
    let mut text = format!("<?xml version=\"1.0\"?>\n<robot name=\"{}\">\n", mechanism.name);
    text += &link_element(&tree.links[0].name, None);
    for (one, body) in tree.links.iter().zip(bodies).skip(1) {
        text += &link_with_joints(mechanism, tree, one, body, friction);
    }
    text += "</robot>\n";
    text
}

/// Adds remarks on parts of the model that URDF cannot express: loops, drives between two points, gravity.
fn report_unsupported(mechanism: &Mechanism, remarks: &mut Vec<Message>) {
    // Loops stay open.
    if !mechanism.loops.is_empty() {
        let names: Vec<&str> = mechanism.loops.iter().map(|one| one.name.as_str()).collect();
        remarks.push(message!(
            "URDF has no loops: {} left open, and passive joints are independent; use MJCF for loops",
            names.join(", ")
        ));
    }
    // Drives between two points are left out.
    let is_line = |kind: &DriveKind| matches!(kind, DriveKind::Linear { .. });
    let drives = mechanism.drives.iter().chain(&mechanism.shared_drives);
    let lines: Vec<&str> = drives
        .filter(|drive| is_line(&drive.kind))
        .map(|drive| drive.name.as_str())
        .collect();
    if !lines.is_empty() {
        remarks.push(message!(
            "URDF has no drives between two points: {} left out; use MJCF, which has tendons",
            lines.join(", ")
        ));
    }
    // Simulators have gravity in their own settings.
    let gravity: [f64; 3] = std::array::from_fn(|k| mechanism.gravity[k].evaluate(&|s| mechanism.symbol_nominal(s)));
    remarks.push(message!(
        "URDF does not specify gravity; set it in the simulator: {} m/s^2 along x, y and z of `{}`",
        number_list(&gravity),
        mechanism.frames[0].name
    ));
}

/// A link with the joints from its parent. Between several joints there are links without mass.
fn link_with_joints(
    mechanism: &Mechanism,
    tree: &LinkTree,
    one: &ExportedLink,
    body: &LinkInertia,
    friction: &PassiveEffects,
) -> String {
    let mut text = String::new();
    // Name and pose of the link before the next joint.
    let mut parent = (tree.links[one.parent].name.clone(), tree.links[one.parent].placed);
    // Links without joints are free bodies.
    if one.joints.is_empty() {
        let origin = origin_element(&parent.1.relative_placement(&one.placed));
        let _ = writeln!(
            text,
            "  <joint name=\"{0}_floating\" type=\"floating\">\n    {origin}\n    <parent link=\"{1}\"/>\n    <child link=\"{0}\"/>\n  \
             </joint>",
            one.name, parent.0
        );
    }
    for (k, moving) in one.joints.iter().enumerate() {
        // The last joint leads to the link itself, the ones before to links without mass at their origins.
        let is_last = k + 1 == one.joints.len();
        let (name, placed) = if is_last {
            (one.name.clone(), one.placed)
        } else {
            let placed = LinkPlacement {
                rotation: one.placed.rotation,
                origin: moving.origin,
            };
            let name = format!("{}_{}", one.name, k + 1);
            text += &link_element(&name, None);
            (name, placed)
        };
        text += &joint_element(
            mechanism,
            moving,
            &parent,
            &(name.clone(), placed),
            (friction, &tree.followed),
        );
        parent = (name, placed);
    }
    text + &link_element(&one.name, Some(body))
}

/// A joint with its pose, axis, limits, mimic and friction. Limits are scaled by the ratio of the joint.
fn joint_element(
    mechanism: &Mechanism,
    moving: &ExportedJoint,
    (parent, from): &(String, LinkPlacement),
    (child, to): &(String, LinkPlacement),
    (friction, followed): (&PassiveEffects, &[FollowedCoordinate]),
) -> String {
    // Limits of the coordinate, and the force limit of a drive that acts on it.
    let coordinate = &mechanism.coordinates[moving.coordinate].name;
    let limits = mechanism.limits.coordinates.iter();
    let limits = limits.clone().find(|(i, _)| i.0 == moving.coordinate);
    let range = limits.and_then(|(_, one)| one.position);
    let rate = limits.and_then(|(_, one)| one.rate);
    let effort = mechanism.limits.forces.iter().find_map(|(d, range)| {
        let drives_it = matches!(mechanism.drives[d.0].kind, DriveKind::Joint(i) if i.0 == moving.coordinate);
        drives_it.then(|| range[0].abs().max(range[1].abs()))
    });
    // A rotation without a range has its own type.
    let kind = match (moving.is_rotation, range) {
        (true, None) => "continuous",
        (true, Some(_)) => "revolute",
        (false, _) => "prismatic",
    };
    // The axis in the axes of the child.
    let axis = to.rotation.transpose() * moving.axis;
    let mut text = format!(
        "  <joint name=\"{}\" type=\"{kind}\">\n    {}\n    <parent link=\"{parent}\"/>\n    <child link=\"{child}\"/>\n    <axis \
         xyz=\"{}\"/>\n",
        moving.name,
        origin_element(&from.relative_placement(to)),
        number_list(clean(axis).as_slice()),
    );
    // Limits of the joint; a negative ratio exchanges both ends.
    let scaled = |range: [f64; 2]| {
        let [a, b] = range.map(|x| x * moving.ratio);
        [a.min(b), a.max(b)]
    };
    if kind != "continuous" || rate.is_some() || effort.is_some() {
        let [low, high] = scaled(range.unwrap_or([-UNLIMITED_RANGE, UNLIMITED_RANGE]));
        // The format requires effort and velocity in each `<limit>`, but no bounds of a continuous joint.
        let bounds = if kind == "continuous" {
            String::new()
        } else {
            format!("lower=\"{}\" upper=\"{}\" ", number_text(low), number_text(high))
        };
        let most = |range: Option<[f64; 2]>| range.map_or(UNLIMITED_RANGE, |r| r[0].abs().max(r[1].abs()));
        let _ = writeln!(
            text,
            "    <limit {bounds}effort=\"{}\" velocity=\"{}\"/>",
            number_text(effort.unwrap_or(UNLIMITED_RANGE)),
            number_text(most(rate.map(scaled)))
        );
    }
    // The joint of the coordinate itself may follow another coordinate; the other joints follow it.
    let own = friction.joints[moving.coordinate];
    if moving.name != *coordinate {
        let _ = writeln!(
            text,
            "    <mimic joint=\"{coordinate}\" multiplier=\"{}\" offset=\"0\"/>",
            number_text(moving.ratio)
        );
    } else if let Some(one) = followed.iter().find(|f| f.coordinate == moving.coordinate) {
        let _ = writeln!(
            text,
            "    <mimic joint=\"{}\" multiplier=\"{}\" offset=\"{}\"/>",
            mechanism.coordinates[one.leader].name,
            number_text(one.factor),
            number_text(one.offset)
        );
    }
    // Losses belong to the joint with the name of the coordinate.
    if moving.name == *coordinate && own != PassiveProperties::default() {
        let _ = writeln!(
            text,
            "    <dynamics damping=\"{}\" friction=\"{}\"/>",
            number_text(own.damping),
            number_text(own.friction)
        );
    }
    text + "  </joint>\n"
}

/// A link with its inertia; without one if it has no mass.
fn link_element(name: &str, body: Option<&LinkInertia>) -> String {
    let Some(body) = body.filter(|body| !body.is_zero()) else {
        return format!("  <link name=\"{name}\"/>\n");
    };
    // Inertia about the centre of mass, in the axes of the link.
    let i = body.central_inertia();
    format!(
        "  <link name=\"{name}\">\n    <inertial>\n      <origin xyz=\"{}\" rpy=\"0 0 0\"/>\n      <mass value=\"{}\"/>\n      \
         <inertia ixx=\"{}\" ixy=\"{}\" ixz=\"{}\" iyy=\"{}\" iyz=\"{}\" izz=\"{}\"/>\n    </inertial>\n  </link>\n",
        number_list(body.centre_of_mass().as_slice()),
        number_text(body.mass),
        number_text(i[(0, 0)]),
        number_text(i[(0, 1)]),
        number_text(i[(0, 2)]),
        number_text(i[(1, 1)]),
        number_text(i[(1, 2)]),
        number_text(i[(2, 2)]),
    )
}

/// The `<origin>` of a pose: position, and roll, pitch and yaw about fixed axes.
fn origin_element(placed: &LinkPlacement) -> String {
    // The angles of nalgebra have the same sequence as those of URDF.
    let (roll, pitch, yaw) = Rotation3::from_matrix_unchecked(placed.rotation).euler_angles();
    format!(
        "<origin xyz=\"{}\" rpy=\"{}\"/>",
        number_list(clean(placed.origin).as_slice()),
        number_list(&[roll, pitch, yaw])
    )
}

/// A vector with zeros for components that are rounding relative to its norm.
pub(super) fn clean(v: Vector3<f64>) -> Vector3<f64> {
    let size = v.norm();
    v.map(|x| if x.abs() < 1e-14 * size { 0.0 } else { x })
}

/// The nearest rotation to a rotation matrix with rounding errors.
pub(super) fn orthonormal(rotation: &Matrix3<f64>) -> Rotation3<f64> {
    Rotation3::from_matrix_eps(rotation, 1e-15, 20, Rotation3::from_matrix_unchecked(*rotation))
}
