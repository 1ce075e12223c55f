//! Writes a URDF that an MJCF attaches as MJCF: the text of the URDF goes in, that of an MJCF comes out.
//!
//! Source: what MuJoCo 4.0 makes of such files. Joints have no drives, a `<mimic>` becomes an equality, the effort is a limit
//! of the force at the joint, and the link `world` is the world. Limits of rates and closures are not read.

use std::fmt::Write as _;

use nalgebra::Matrix3;
use roxmltree::{Document, Node};

use super::counts;
use super::description::{
    DescriptionInertia, DescriptionJoint, DescriptionJointKind, DescriptionLink, RobotDescription,
};
use super::mjcf_attach::write_attribute;
use super::placed::DescriptionPose;
use super::thresholds::DEEPEST_ELEMENT;
use super::unread;
use super::urdf;
use super::xml::{LineTable, child, children, located_message};

/// Element at the top of an MJCF with a remark on an attached file in the attribute `text`.
pub(super) const ATTACHED_REMARK: &str = "modelmill-remark";

/// Settings of `<mujoco>` in a URDF that have no effect on a model.
const WITHOUT_EFFECT: [&str; 10] = [
    "angle",
    "assetdir",
    "convexhull",
    "coordinate",
    "discardvisual",
    "eulerseq",
    "fusestatic",
    "meshdir",
    "strippath",
    "texturedir",
];

/// The text of an MJCF with the links and joints of a URDF. `path` names the file in remarks.
///
/// Fails with one line that states the fault and its place in the URDF.
pub(super) fn mjcf_of_urdf(document: &Document, path: &str) -> Result<String, String> {
    let _lines = LineTable::install(document);
    counts::check_elements(document)?;
    let root = document.root_element();
    check_settings(&root)?;
    check_masses(&root)?;
    let mut description = urdf::read(document, None, false)?;
    description.remarks.extend(unread::unread_remarks(document));
    for closure in &description.closures {
        description.remarks.push(format!(
            "line {}: the closure `{}` is left out: MuJoCo reads none from a URDF",
            closure.line, closure.name
        ));
    }
    let joints = description.links.iter().flat_map(|link| &link.joints);
    for joint in joints.filter(|joint| joint.rate.is_some()) {
        description.remarks.push(format!(
            "line {}: the limit of the rate of `{}` is left out: MuJoCo reads none from a URDF",
            joint.line, joint.name
        ));
    }
    let mut out = String::from("<mujoco");
    write_attribute(&mut out, "model", &description.name);
    out.push_str("><compiler angle=\"radian\"/><worldbody>");
    write_bodies(&description, &mut out)?;
    out.push_str("</worldbody><equality>");
    for coupling in &description.couplings {
        out.push_str("<joint");
        write_attribute(&mut out, "joint1", &coupling.joint);
        if let Some(leader) = &coupling.leader {
            write_attribute(&mut out, "joint2", leader);
        }
        let _ = write!(out, " polycoef=\"{:?} {:?} 0 0 0\"/>", coupling.offset, coupling.ratio);
    }
    out.push_str("</equality>");
    for remark in &description.remarks {
        let _ = write!(out, "<{ATTACHED_REMARK}");
        write_attribute(&mut out, "text", &format!("in `{path}`: {remark}"));
        out.push_str("/>");
    }
    out.push_str("</mujoco>");
    Ok(out)
}

/// Refuses settings for MuJoCo that change masses.
fn check_settings(root: &Node) -> Result<(), String> {
    let compilers = children(root, "mujoco").flat_map(|node| children(&node, "compiler"));
    for node in compilers {
        let mut keys = node.attributes().map(|a| a.name());
        if let Some(key) = keys.find(|key| !WITHOUT_EFFECT.contains(key)) {
            let says =
                format!("`{key}` of an attached URDF is not read; remove it, or save the complete model with MuJoCo");
            return Err(located_message(&node, &says));
        }
    }
    Ok(())
}

/// Refuses links whose mass MuJoCo computes from their shapes.
fn check_masses(root: &Node) -> Result<(), String> {
    for link in children(root, "link") {
        if child(&link, "inertial").is_none() && child(&link, "collision").is_some() {
            let says = "MuJoCo computes the mass of this attached link from its collision shapes, which is not done here; \
                        give it an <inertial>";
            return Err(located_message(&link, says));
        }
    }
    Ok(())
}

/// Writes the links as bodies, each inside its parent.
fn write_bodies(description: &RobotDescription, out: &mut String) -> Result<(), String> {
    let links = &description.links;
    let mut inside = vec![Vec::new(); links.len()];
    let mut depth = vec![0; links.len()];
    for (k, link) in links.iter().enumerate() {
        if let Some(parent) = link.parent {
            inside[parent].push(k);
            depth[k] = depth[parent] + 1;
        }
        if depth[k] > DEEPEST_ELEMENT {
            return Err(format!(
                "the link `{}` is more than {DEEPEST_ELEMENT} joints away from the root",
                link.name
            ));
        }
    }
    for k in (0..links.len()).filter(|k| links[*k].parent.is_none()) {
        if links[k].name == "world" {
            for inner in &inside[k] {
                write_body(links, &inside, *inner, out);
            }
        } else {
            write_body(links, &inside, k, out);
        }
    }
    Ok(())
}

/// Writes a link with those below it.
fn write_body(links: &[DescriptionLink], inside: &[Vec<usize>], index: usize, out: &mut String) {
    let link = &links[index];
    out.push_str("<body");
    write_attribute(out, "name", &link.name);
    write_pose(out, &link.at);
    out.push('>');
    let DescriptionInertia { mass, at, inertia } = &link.inertial;
    // A full matrix is given in the axes around it.
    if *mass != 0.0 || *inertia != Matrix3::zeros() {
        out.push_str("<frame");
        write_pose(out, at);
        let _ = write!(out, "><inertial pos=\"0 0 0\" mass=\"{mass:?}\" fullinertia=\"");
        for (k, (row, column)) in [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)].into_iter().enumerate() {
            let blank = if k == 0 { "" } else { " " };
            let _ = write!(out, "{blank}{:?}", inertia[(row, column)]);
        }
        out.push_str("\"/></frame>");
    }
    for joint in &link.joints {
        write_joint(joint, out);
    }
    for inner in &inside[index] {
        write_body(links, inside, *inner, out);
    }
    out.push_str("</body>");
}

/// Writes a joint with its limits and losses.
fn write_joint(joint: &DescriptionJoint, out: &mut String) {
    let kind = match joint.kind {
        DescriptionJointKind::Revolute => "hinge",
        DescriptionJointKind::Prismatic => "slide",
        DescriptionJointKind::Ball => "ball",
        DescriptionJointKind::Free => "free",
    };
    out.push_str("<joint");
    write_attribute(out, "name", &joint.name);
    write_attribute(out, "type", kind);
    let [x, y, z] = joint.axis.into();
    let _ = write!(out, " axis=\"{x:?} {y:?} {z:?}\"");
    for (key, range) in [("range", joint.range), ("actuatorfrcrange", joint.force)] {
        if let Some([low, high]) = range {
            let _ = write!(out, " {key}=\"{low:?} {high:?}\"");
        }
    }
    for (key, value) in [
        ("damping", joint.damping),
        ("frictionloss", joint.friction),
        ("armature", joint.armature),
    ] {
        if value != 0.0 {
            let _ = write!(out, " {key}=\"{value:?}\"");
        }
    }
    out.push_str("/>");
}

/// Writes position and orientation.
fn write_pose(out: &mut String, pose: &DescriptionPose) {
    let [px, py, pz] = pose.p.into();
    let _ = write!(out, " pos=\"{px:?} {py:?} {pz:?}\"");
    if pose.r != Matrix3::identity() {
        let entries: Vec<String> = [(0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (2, 1)]
            .into_iter()
            .map(|(row, column)| format!("{:?}", pose.r[(row, column)]))
            .collect();
        let _ = write!(out, " xyaxes=\"{}\"", entries.join(" "));
    }
}
