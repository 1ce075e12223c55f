//! Reads URDF: links and joints with the defaults of the format, mimic joints, and loop closures of a `robot.yaml`.
//!
//! Source of names and defaults: the URDF specification of ROS (wiki.ros.org/urdf/XML).

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;
use roxmltree::{Document, Node};

use super::closures_file::{self, ClosureFile, JointReplacement};
use super::description::{
    ClosureConstraint, DescriptionClosure, DescriptionCoupling, DescriptionInertia, DescriptionJoint,
    DescriptionJointKind, DescriptionLink, RobotDescription,
};
use super::placed::{DescriptionPose, rotation_from_quaternion};
use super::urdf_extensions;
use super::xml::{
    child, children, exact_numbers, line, located_message, number_attribute, required_attribute, required_child,
    symmetric, three_numbers, vector,
};

/// A joint between two links, as the file describes it.
struct UrdfJoint {
    /// Name of the parent link.
    parent: String,
    /// Name of the child link.
    child: String,
    /// Pose of the joint, and of the child at zero, in the parent.
    origin: DescriptionPose,
    /// Joints in sequence; empty for a fixed joint.
    joints: Vec<DescriptionJoint>,
    /// Name of the joint.
    name: String,
    /// Line in the file.
    line: u32,
}

/// Reads a description; fails with one line that states the fault and its place. `closures` is the text of a
/// `robot.yaml`.
#[allow(clippy::too_many_lines, reason = "elements in their order")]
pub(crate) fn read(document: &Document, closures: Option<&str>, is_floating: bool) -> Result<RobotDescription, String> {
    let robot = document.root_element();
    let mut out = RobotDescription {
        name: robot.attribute("name").unwrap_or("robot").to_owned(),
        format: "URDF",
        ..RobotDescription::default()
    };
    // Read all elements first; the tree is built from their names.
    let links: Vec<Node> = children(&robot, "link").collect();
    let mut joints = Vec::new();
    for node in children(&robot, "joint") {
        joints.push(joint(&node, &mut out)?);
    }
    // A file of closures can change the kinds of joints.
    let closures = closures.map(closures_file::read).transpose()?;
    if let Some(file) = &closures {
        out.remarks.extend(file.remarks.iter().cloned());
        replace_joints(&mut joints, &file.joints, &mut out.remarks)?;
    }
    resolve_fixed_couplings(&mut out, &joints);
    // Transmissions have no effect on a model, but other tools scale forces by their reduction.
    for node in children(&robot, "transmission") {
        for reduction in node.descendants().filter(|node| {
            node.tag_name().name() == "mechanicalReduction"
                && node.text().is_some_and(|text| text.trim().parse() != Ok(1.0))
        }) {
            out.remarks.push(format!(
                "line {}: the reduction {} of the transmission `{}` is ignored; forces of the model are those at the joints",
                line(&reduction),
                reduction.text().unwrap_or_default().trim(),
                node.attribute("name").unwrap_or_default()
            ));
        }
    }
    if let Some(node) = robot.children().find(|node| node.tag_name().name() == "loop_joint") {
        return Err(located_message(
            &node,
            "<loop_joint> is not part of the URDF standard; write the closure into a robot.yaml next to the file",
        ));
    }
    // A tree needs unique names, one root, and one parent for each other link.
    let world = implied_world(&links, &joints);
    check_names(&links, &joints, world)?;
    let root = root_link(&links, &joints, world)?;
    // Names are looked up in tables, because a search per joint would take the square of their number.
    let by_name: BTreeMap<&str, Node> = links
        .iter()
        .filter_map(|node| Some((node.attribute("name")?, *node)))
        .collect();
    let mut below: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (j, joint) in joints.iter().enumerate() {
        below.entry(joint.parent.as_str()).or_default().push(j);
    }
    let mut places: BTreeMap<String, usize> = BTreeMap::new();
    let mut reached: BTreeSet<&str> = BTreeSet::from([root.as_str()]);
    // Breadth first from the root, so that parents stand before their children.
    let mut order = vec![(root.as_str(), None)];
    let mut k = 0;
    while k < order.len() {
        let (name, between): (&str, Option<usize>) = order[k];
        // The world may have no element.
        let node = by_name.get(name);
        let mut link = DescriptionLink {
            name: name.to_owned(),
            parent: None,
            at: DescriptionPose::identity(),
            joints: Vec::new(),
            inertial: (node.map(|node| inertial(node, &mut out.remarks)).transpose()?).unwrap_or_default(),
        };
        // A link gets pose and joints of the joint through which it is reached.
        if let Some(j) = between {
            let joint = &joints[j];
            link.parent = places.get(&joint.parent).copied();
            link.at = joint.origin;
            link.joints.clone_from(&joint.joints);
            if joint.joints.iter().any(|j| j.kind == DescriptionJointKind::Free) && joint.parent != root {
                return Err(format!(
                    "line {}: the joint `{}` is floating, but its parent link is not the root; only children of the root can be free bodies",
                    joint.line, joint.name
                ));
            }
        // The root of a floating robot gets a free joint.
        } else if is_floating {
            link.joints.push(DescriptionJoint::new(
                "root_joint".to_owned(),
                DescriptionJointKind::Free,
                line(node.unwrap_or(&robot)),
            ));
        }
        places.insert(name.to_owned(), out.links.len());
        out.links.push(link);
        // Children of this link follow in the order of their joints.
        for &j in below.get(name).into_iter().flatten() {
            let joint = &joints[j];
            if !reached.insert(&joint.child) {
                return Err(format!(
                    "line {}: the link `{}` is the child of two joints; URDF describes trees only",
                    joint.line, joint.child
                ));
            }
            order.push((&joint.child, Some(j)));
        }
        k += 1;
    }
    // Links that were not reached.
    if let Some(node) = links
        .iter()
        .find(|node| !node.attribute("name").is_some_and(|name| places.contains_key(name)))
    {
        return Err(located_message(
            node,
            "it is part of a loop of joints that is not connected to the root",
        ));
    }
    if let Some(file) = closures {
        add_closures(&mut out, &joints, file)?;
    }
    urdf_extensions::read_closures(&mut out, &robot)?;
    urdf_extensions::read_rotors(&mut out, &robot)?;
    Ok(out)
}

/// Replaces joints by the kinds that the file of closures gives for them. Damping and friction of the URDF stay; its
/// limits are those of another motion.
fn replace_joints(
    joints: &mut [UrdfJoint],
    by: &[(String, JointReplacement)],
    remarks: &mut Vec<String>,
) -> Result<(), String> {
    for (name, becomes) in by {
        let found = joints.iter_mut().find(|joint| &joint.name == name);
        let Some(UrdfJoint { joints, line, .. }) = found else {
            return Err(format!(
                "the file of closures gives a type for the joint `{name}`, which does not exist"
            ));
        };
        // The new joints keep the losses of the old one.
        let old = std::mem::take(joints);
        if old.iter().any(DescriptionJoint::has_limits) && *becomes != JointReplacement::Fixed {
            remarks.push(format!(
                "line {line}: the limits of `{name}` are left out: the file of closures gives it another motion"
            ));
        }
        let new = |name: String, kind: DescriptionJointKind| {
            let mut joint = DescriptionJoint::new(name, kind, *line);
            (joint.damping, joint.friction) = old.first().map_or((0.0, 0.0), |old| (old.damping, old.friction));
            joint
        };
        match becomes {
            JointReplacement::Fixed => {}
            JointReplacement::Ball => joints.push(new(name.clone(), DescriptionJointKind::Ball)),
            JointReplacement::Cross(axes) => {
                // A universal joint is a sequence of hinges about the axes of the frame.
                for letter in axes {
                    let own = format!("{name}_{}", letter.to_ascii_uppercase());
                    let mut joint = new(own, DescriptionJointKind::Revolute);
                    joint.axis = Vector3::zeros();
                    joint.axis[usize::from(*letter as u8 - b'x')] = 1.0;
                    joints.push(joint);
                }
            }
        }
    }
    Ok(())
}

/// Removes couplings of fixed joints, and fixes joints that follow a fixed one.
fn resolve_fixed_couplings(out: &mut RobotDescription, joints: &[UrdfJoint]) {
    let is_fixed = |name: &str| {
        let mut joints = joints.iter();
        joints.any(|joint| joint.name == name && joint.joints.is_empty())
    };
    let remarks = &mut out.remarks;
    out.couplings.retain_mut(|coupling| {
        // The leader does not move, so the follower does not move either.
        if let Some(of) = coupling.leader.take_if(|of| is_fixed(of)) {
            remarks.push(format!(
                "line {}: `{}` follows `{of}`, which is fixed; it is fixed at {}",
                coupling.line, coupling.joint, coupling.offset
            ));
        }
        // A fixed joint needs no coupling.
        let moves = !is_fixed(&coupling.joint);
        if !moves {
            remarks.push(format!(
                "line {}: `{}` is fixed; its <mimic> is left out",
                coupling.line, coupling.joint
            ));
        }
        moves
    });
}

/// The name of the ground for readers that know it without an element, such as Drake and `MuJoCo`.
const WORLD: &str = "world";

/// The ground as the parent of a joint, if it has no `<link>`.
fn implied_world(links: &[Node], joints: &[UrdfJoint]) -> Option<&'static str> {
    let is_declared = links.iter().any(|node| node.attribute("name") == Some(WORLD));
    let is_parent = joints.iter().any(|joint| joint.parent == WORLD);
    (is_parent && !is_declared).then_some(WORLD)
}

/// Checks that names of links and joints are unique, and that joints connect links that exist.
fn check_names(links: &[Node], joints: &[UrdfJoint], world: Option<&str>) -> Result<(), String> {
    let mut names: BTreeSet<String> = world.into_iter().map(str::to_owned).collect();
    for node in links {
        let name = required_attribute(node, "name")?;
        if !names.insert(name.clone()) {
            return Err(located_message(
                node,
                &format!("two links have the name `{name}`; rename one"),
            ));
        }
    }
    let mut joint_names = BTreeSet::new();
    for joint in joints {
        if !joint_names.insert(joint.name.as_str()) {
            return Err(format!(
                "line {}: two joints have the name `{}`; rename one",
                joint.line, joint.name
            ));
        }
        for end in [&joint.parent, &joint.child] {
            if !names.contains(end) {
                return Err(format!(
                    "line {}: the joint `{}` names the link `{end}`, which does not exist",
                    joint.line, joint.name
                ));
            }
        }
    }
    Ok(())
}

/// The name of the link that is no joint's child. Fails if there is none or more than one.
fn root_link(links: &[Node], joints: &[UrdfJoint], world: Option<&str>) -> Result<String, String> {
    // A link is a child if a joint names it as such.
    let children: BTreeSet<&str> = joints.iter().map(|joint| joint.child.as_str()).collect();
    let is_child = |name: &str| children.contains(name);
    let named = links
        .iter()
        .map(|node| (node.attribute("name").unwrap_or_default(), Some(node)));
    let all = world.into_iter().map(|name| (name, None)).chain(named);
    let mut roots = all.filter(|(name, _)| !is_child(name));
    match (roots.next(), roots.next()) {
        (Some((root, _)), None) => Ok(root.to_owned()),
        (Some((one, _)), Some((_, Some(two)))) => Err(located_message(
            two,
            &format!("this link and `{one}` are both without a parent; connect them to one robot"),
        )),
        _ => Err("there is no root link: every link is the child of a joint".to_owned()),
    }
}

/// The `<inertial>` of a link; zero mass without one.
fn inertial(node: &Node, remarks: &mut Vec<String>) -> Result<DescriptionInertia, String> {
    let Some(inertial) = child(node, "inertial") else {
        return Ok(DescriptionInertia::default());
    };
    let mass = number_attribute(&required_child(&inertial, "mass")?, "value")?;
    // The six independent entries of the symmetric matrix.
    let mut entries = [0.0; 6];
    if let Some(inertia) = child(&inertial, "inertia") {
        for (entry, key) in entries.iter_mut().zip(["ixx", "iyy", "izz", "ixy", "ixz", "iyz"]) {
            *entry = number_attribute(&inertia, key)?;
        }
    } else {
        // The format requires it, but other readers accept files without.
        let says = "there is no <inertia>; the mass is a point mass in the model";
        remarks.push(located_message(&inertial, says));
    }
    Ok(DescriptionInertia {
        mass,
        at: origin(&inertial)?,
        inertia: symmetric(entries),
    })
}

/// Reads a `<joint>` with its limits, losses and `<mimic>`, which goes into the couplings of `out`.
fn joint(node: &Node, out: &mut RobotDescription) -> Result<UrdfJoint, String> {
    let name = required_attribute(node, "name")?;
    let kind = match required_attribute(node, "type")?.as_str() {
        "fixed" => None,
        "revolute" | "continuous" => Some(DescriptionJointKind::Revolute),
        "prismatic" => Some(DescriptionJointKind::Prismatic),
        "floating" => Some(DescriptionJointKind::Free),
        "spherical" | "ball" => Some(DescriptionJointKind::Ball),
        other => {
            return Err(located_message(
                node,
                &format!(
                    "the joint type {other} is not supported; write it as several joints of the types revolute, continuous, \
                     prismatic, floating or fixed"
                ),
            ));
        }
    };
    // Missing elements and attributes are not faults; the format gives defaults.
    let (limit, dynamics) = (child(node, "limit"), child(node, "dynamics"));
    let given = |of: Option<Node>, key: &str| match of {
        Some(node) if node.has_attribute(key) => number_attribute(&node, key).map(Some),
        _ => Ok(None),
    };
    let mut moving = None;
    if let Some(kind) = kind {
        let mut joint = DescriptionJoint::new(name.clone(), kind, line(node));
        // The default axis is x.
        joint.axis = match child(node, "axis") {
            Some(axis) => vector(three_numbers(&axis, "xyz")?),
            None => vector([1.0, 0.0, 0.0]),
        };
        if joint.axis.norm() == 0.0 && matches!(kind, DescriptionJointKind::Revolute | DescriptionJointKind::Prismatic)
        {
            return Err(located_message(node, "the axis has no direction"));
        }
        let (lower, upper) = (given(limit, "lower")?, given(limit, "upper")?);
        if required_attribute(node, "type")? != "continuous" && (lower.is_some() || upper.is_some()) {
            // The format defines zero as the default of each bound.
            joint.range = Some([lower.unwrap_or(0.0), upper.unwrap_or(0.0)]);
        }
        // Zero counts as "no limit".
        joint.rate = given(limit, "velocity")?.filter(|rate| *rate > 0.0);
        joint.force = given(limit, "effort")?
            .filter(|force| *force > 0.0)
            .map(|force| [-force, force]);
        joint.damping = given(dynamics, "damping")?.unwrap_or(0.0);
        joint.friction = given(dynamics, "friction")?.unwrap_or(0.0);
        moving = Some(joint);
    }
    // The joint follows another one.
    if let Some(mimic) = child(node, "mimic") {
        out.couplings.push(DescriptionCoupling {
            line: line(&mimic),
            joint: name.clone(),
            leader: Some(required_attribute(&mimic, "joint")?),
            ratio: given(Some(mimic), "multiplier")?.unwrap_or(1.0),
            offset: given(Some(mimic), "offset")?.unwrap_or(0.0),
        });
    }
    Ok(UrdfJoint {
        parent: required_attribute(&required_child(node, "parent")?, "link")?,
        child: required_attribute(&required_child(node, "child")?, "link")?,
        origin: origin(node)?,
        joints: moving.into_iter().collect(),
        name,
        line: line(node),
    })
}

/// The pose `<origin>` of an element; the identity without one.
fn origin(of: &Node) -> Result<DescriptionPose, String> {
    child_pose(of, "origin")
}

/// The pose in a child element; the identity without one.
pub(super) fn child_pose(of: &Node, tag: &str) -> Result<DescriptionPose, String> {
    let Some(node) = child(of, tag) else {
        return Ok(DescriptionPose::identity());
    };
    // All attributes are optional; URDF 1.2 has quaternions.
    let or_zeros = |key: &str| {
        if node.has_attribute(key) {
            three_numbers(&node, key)
        } else {
            Ok([0.0; 3])
        }
    };
    let mut pose = DescriptionPose::from_xyz_rpy(or_zeros("xyz")?, or_zeros("rpy")?);
    if let Some(text) = node.attribute("quat_xyzw") {
        if node.has_attribute("rpy") {
            return Err(located_message(
                &node,
                "`rpy` and `quat_xyzw` exclude each other; give one of them",
            ));
        }
        let [x, y, z, w] = exact_numbers(&node, "quat_xyzw", text)?;
        pose.r = rotation_from_quaternion([w, x, y, z])
            .ok_or_else(|| located_message(&node, "the quaternion in `quat_xyzw` is zero"))?;
    }
    Ok(pose)
}

/// Adds the contents of a file of closures: frames that coincide and joints that are driven.
fn add_closures(out: &mut RobotDescription, joints: &[UrdfJoint], file: ClosureFile) -> Result<(), String> {
    // The file names links, or joints in the place of their child links.
    let place = |name: &str| -> Result<Option<usize>, String> {
        let joint = joints.iter().find(|joint| joint.name == name);
        let link = joint.map_or(name, |joint| joint.child.as_str());
        let index = out.links.iter().position(|link_| link_.name == link);
        index
            .map(Some)
            .ok_or_else(|| format!("the file of closures names `{name}`, which is neither a link nor a joint"))
    };
    for closure in file.pairs {
        // The frames of both links coincide, or their origins only.
        let [one, other] = &closure.ends;
        let ends = [place(one)?, place(other)?].map(|link| (link, DescriptionPose::identity()));
        out.closures.push(DescriptionClosure {
            name: format!("{one}_{other}"),
            line: closure.line,
            ends,
            constraint: if closure.is_full {
                ClosureConstraint::Frames
            } else {
                ClosureConstraint::Origins
            },
        });
    }
    // Drives must be joints that move.
    for name in &file.drives {
        if joints
            .iter()
            .all(|joint| &joint.name != name || joint.joints.is_empty())
        {
            return Err(format!(
                "the file of closures lists the drive `{name}`, which is not a movable joint"
            ));
        }
    }
    // A list of drives is complete: other joints are passive.
    if !file.drives.is_empty() {
        for joint in out.links.iter_mut().flat_map(|link| &mut link.joints) {
            joint.is_driven &= file.drives.contains(&joint.name);
        }
    }
    Ok(())
}
