//! Reads SDF: links and joints with poses relative to each other become a tree of links with loop closures.
//!
//! Source of names, defaults and frames: the specification (sdformat.org/spec) and its tutorial "Pose Frame Semantics".

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};

use modelmill_boundary::nesting::NestingLevel;
use nalgebra::{Matrix3, Vector3};
use roxmltree::{Document, Node};

use super::description::{
    ClosureConstraint, DescriptionClosure, DescriptionCoupling, DescriptionInertia, DescriptionJoint,
    DescriptionJointKind, RobotDescription,
};
use super::placed::{DescriptionPose, rotation, rotation_from_quaternion};
use super::sdf_couplings::{gearbox_coupling, screw_coupling};
use super::sdf_tree::build_link_tree;
use super::urdf_extensions::ball_constraint;
use super::xml::{
    child, children, exact_numbers, line, located_message, required_attribute, required_child, symmetric, vector,
};

/// Values beyond this mean "no limit".
const NO_LIMIT: f64 = 1e15;
/// Largest number of poses that refer to each other in sequence; more is a cycle.
const LONGEST_CHAIN: usize = 1000;

/// A frame that poses may refer to.
struct SdfFrame<'a, 'i> {
    /// Its element.
    node: Node<'a, 'i>,
    /// Name of the frame to which the pose is relative by default.
    usually: String,
}

/// All frames of a model, in tables: a search per element would take the square of their number.
pub(super) struct SdfFrames<'a, 'i> {
    /// In the order of the file.
    frames: Vec<SdfFrame<'a, 'i>>,
    /// The first frame of each name.
    by_name: BTreeMap<String, usize>,
    /// Names of links and joints that occur a second time, with another kind of element.
    ambiguous: BTreeSet<String>,
    /// The links by their names.
    links: BTreeMap<String, usize>,
    /// Poses in the model that are known already, by index of the frame.
    poses: RefCell<Vec<Option<DescriptionPose>>>,
}

impl<'a, 'i> SdfFrames<'a, 'i> {
    /// The level of a pose to which no other one refers.
    pub(super) const TOP: NestingLevel = NestingLevel::top(LONGEST_CHAIN);

    /// The first frame of a name, with its index.
    fn find(&self, name: &str) -> Option<(usize, &SdfFrame<'a, 'i>)> {
        self.by_name.get(name).map(|k| (*k, &self.frames[*k]))
    }
}

/// A joint between two links.
pub(super) struct SdfJoint {
    /// Index of the parent link; none is the world.
    pub(super) parent: Option<usize>,
    /// Index of the child link; none is the world.
    pub(super) child: Option<usize>,
    /// Joints in sequence; empty for a fixed joint.
    pub(super) joints: Vec<DescriptionJoint>,
    /// Pose of the joint in the model.
    pub(super) place: DescriptionPose,
    /// Name of the joint.
    pub(super) name: String,
    /// Line in the file.
    pub(super) line: u32,
    /// Type in the file, such as `revolute`.
    pub(super) kind: String,
}

/// Major and minor number of the format: 1.12 is later than 1.9.
pub(super) type FormatVersion = (u32, u32);

/// The first version in which an axis is given in the axes of the joint.
const AXES_OF_THE_JOINT: FormatVersion = (1, 5);

/// The version of a file, which decides in which axes joint axes are given; without one the latest that is read.
fn format_version(root: &Node) -> FormatVersion {
    let text = root.attribute("version").unwrap_or_default();
    let mut numbers = text.trim().split('.').map(str::parse);
    match (numbers.next(), numbers.next()) {
        (Some(Ok(major)), Some(Ok(minor))) => (major, minor),
        _ => (1, 12),
    }
}

/// Reads a description; fails with one line that states the fault and its place.
pub(crate) fn read(document: &Document) -> Result<RobotDescription, String> {
    let root = document.root_element();
    let version = format_version(&root);
    // The model is in the file directly, or in a world.
    let world = child(&root, "world");
    let mut models = children(&root, "model").chain(world.iter().flat_map(|world| children(world, "model")));
    let model = models
        .next()
        .ok_or_else(|| located_message(&root, "it needs a <model>"))?;
    if let Some(other) = models.next() {
        return Err(located_message(
            &other,
            "the file has a second model; keep only the one to import",
        ));
    }
    let mut out = RobotDescription {
        name: model.attribute("name").unwrap_or("robot").to_owned(),
        format: "SDF",
        ..RobotDescription::default()
    };
    // Only a world specifies gravity.
    if let Some(node) = world.and_then(|world| child(&world, "gravity")) {
        out.gravity = Some(vector(exact_numbers(&node, "gravity", node.text().unwrap_or(""))?));
    }
    // Models inside a model would need names with their scope.
    if let Some(inner) = model
        .children()
        .find(|node| ["model", "include"].contains(&node.tag_name().name()))
    {
        return Err(located_message(
            &inner,
            "nested models are not expanded here; `gz sdf -p` prints one flat model",
        ));
    }
    if text_of(&model, "static").is_some_and(|text| ["true", "1"].contains(&text)) {
        return Err(located_message(&model, "the model is static, so nothing moves"));
    }
    // Poses of all links in the model, through the frames to which they refer.
    let frames = model_frames(&model)?;
    let links: Vec<Node> = children(&model, "link").collect();
    let mut places = Vec::new();
    for node in &links {
        places.push(pose_in_model(
            &frames,
            &required_attribute(node, "name")?,
            node,
            SdfFrames::TOP,
        )?);
    }
    let mut joints = Vec::new();
    // Gearboxes couple other joints, which are read first.
    let (gearboxes, moving): (Vec<Node>, Vec<Node>) =
        children(&model, "joint").partition(|node| node.attribute("type") == Some("gearbox"));
    for node in moving {
        joints.push(joint(&node, &frames, version, &mut out)?);
    }
    for node in gearboxes {
        out.couplings.push(gearbox_coupling(&node, &frames, version, &joints)?);
    }
    // Pose of the model in the world.
    let own = match child(&model, "pose") {
        Some(pose) => pose_of(&pose)?,
        None => DescriptionPose::identity(),
    };
    let base = model
        .attribute("canonical_link")
        .and_then(|name| links.iter().position(|node| node.attribute("name") == Some(name)))
        .unwrap_or(0);
    build_link_tree(&mut out, &links, &places, &joints, &own, base)?;
    read_constraints(&mut out, &model, &links, &frames)?;
    Ok(out)
}

/// Reads Drake's closures of loops: `ball_constraint` and `weld_constraint`. The links must be known.
fn read_constraints(
    out: &mut RobotDescription,
    model: &Node,
    links: &[Node],
    frames: &SdfFrames,
) -> Result<(), String> {
    let known: Vec<String> = out.links.iter().map(|link| link.name.clone()).collect();
    let known: BTreeMap<&str, usize> = known.iter().enumerate().map(|(k, name)| (name.as_str(), k)).collect();
    let index = |name: &str| known.get(name).copied();
    for node in children(model, "ball_constraint") {
        out.closures.push(ball_constraint(&node, |name| match index(name) {
            None if name == "world" => Ok(None),
            None => Err(located_message(&node, &format!("there is no link `{name}`"))),
            found => Ok(found),
        })?);
    }
    for node in children(model, "weld_constraint") {
        // A frame stands for its pose in the link to which it is attached.
        let end = |tag: &str| -> Result<(Option<usize>, DescriptionPose), String> {
            let inner = required_child(&node, tag)?;
            let name = inner.text().unwrap_or("").trim();
            let place = pose_in_model(frames, name, &inner, SdfFrames::TOP)?;
            let Some(link) = attached_link(name, &inner, frames)? else {
                return Ok((None, place));
            };
            let link = required_attribute(&links[link], "name")?;
            let in_link = pose_in_model(frames, &link, &inner, SdfFrames::TOP)?
                .inverse()
                .compose(&place);
            Ok((index(&link), in_link))
        };
        out.closures.push(DescriptionClosure {
            name: format!("closure_{}", line(&node)),
            line: line(&node),
            ends: [end("parent")?, end("child")?],
            constraint: ClosureConstraint::Frames,
        });
    }
    Ok(())
}

/// The link to which a frame is attached, directly or through other frames; none is the world.
fn attached_link(name: &str, from: &Node, frames: &SdfFrames) -> Result<Option<usize>, String> {
    let mut name = name.to_owned();
    for _ in 0..LONGEST_CHAIN {
        if name == "world" {
            return Ok(None);
        }
        if let Some(k) = frames.links.get(&name) {
            return Ok(Some(*k));
        }
        let (_, frame) = frames
            .find(&name)
            .ok_or_else(|| located_message(from, &format!("there is no link `{name}`")))?;
        if frame.usually == "__model__" {
            return Ok((!frames.links.is_empty()).then_some(0));
        }
        name.clone_from(&frame.usually);
    }
    Err(located_message(
        from,
        "its frame is attached to itself through other frames",
    ))
}

/// The trimmed text of a child element.
fn text_of<'a>(node: &Node<'a, '_>, tag: &str) -> Option<&'a str> {
    child(node, tag).and_then(|node| node.text()).map(str::trim)
}

/// The number in a child element; none without that element.
pub(super) fn number_of(node: &Node, tag: &str) -> Result<Option<f64>, String> {
    let Some(inner) = child(node, tag) else {
        return Ok(None);
    };
    exact_numbers(&inner, tag, inner.text().unwrap_or("")).map(|[x]| Some(x))
}

/// All frames of a model: links, joints and explicit frames.
fn model_frames<'a, 'i>(model: &Node<'a, 'i>) -> Result<SdfFrames<'a, 'i>, String> {
    let mut out = SdfFrames {
        frames: Vec::new(),
        by_name: BTreeMap::new(),
        ambiguous: BTreeSet::new(),
        links: BTreeMap::new(),
        poses: RefCell::default(),
    };
    let mut known: BTreeSet<(String, &str)> = BTreeSet::new();
    for node in model.children().filter(Node::is_element) {
        // Frame for poses without `relative_to`: the child link for joints, else the model or the attached frame.
        let usually = match node.tag_name().name() {
            "link" => "__model__".to_owned(),
            "joint" => text_of(&node, "child").unwrap_or("__model__").to_owned(),
            "frame" => node.attribute("attached_to").unwrap_or("__model__").to_owned(),
            _ => continue,
        };
        let name = required_attribute(&node, "name")?;
        // Old files use the same name for a link and a joint, so only elements of the same kind are compared.
        let tag = node.tag_name().name();
        if !known.insert((name.clone(), tag)) {
            return Err(located_message(&node, "this name occurs twice; rename one"));
        }
        if tag == "link" {
            out.links.insert(name.clone(), out.links.len());
        }
        if out.by_name.contains_key(&name) {
            out.ambiguous.insert(name);
        } else {
            out.by_name.insert(name, out.frames.len());
        }
        out.frames.push(SdfFrame { node, usually });
    }
    out.poses = RefCell::new(vec![None; out.frames.len()]);
    Ok(out)
}

/// The pose of a frame in the model, through all frames to which it is relative. `from` is the element for messages.
pub(super) fn pose_in_model(
    frames: &SdfFrames,
    name: &str,
    from: &Node,
    level: NestingLevel,
) -> Result<DescriptionPose, String> {
    // The recursion ends at the frame of the model.
    if name == "__model__" || name.is_empty() || name == "world" {
        return Ok(DescriptionPose::identity());
    }
    let inner = level
        .enter()
        .map_err(|_| located_message(from, "its pose is relative to itself through other frames"))?;
    let (k, frame) = frames
        .find(name)
        .ok_or_else(|| located_message(from, &format!("there is no frame `{name}`")))?;
    if let Some(known) = frames.poses.borrow()[k] {
        return Ok(known);
    }
    // `frame` is the older name of the attribute `relative_to`.
    let pose = child(&frame.node, "pose");
    let relative = pose
        .and_then(|pose| pose.attribute("relative_to").or(pose.attribute("frame")))
        .filter(|name| !name.is_empty())
        .unwrap_or(&frame.usually);
    let placed = pose.map_or(Ok(DescriptionPose::identity()), |pose| pose_of(&pose))?;
    let pose = pose_in_model(frames, relative, &frame.node, inner)?.compose(&placed);
    frames.poses.borrow_mut()[k] = Some(pose);
    Ok(pose)
}

/// The pose in a `<pose>` element, with roll, pitch and yaw or a quaternion.
fn pose_of(node: &Node) -> Result<DescriptionPose, String> {
    let text = node.text().unwrap_or("").trim();
    if text.is_empty() {
        return Ok(DescriptionPose::identity());
    }
    if node.attribute("rotation_format") == Some("quat_xyzw") {
        let [px, py, pz, x, y, z, w] = exact_numbers(node, "pose", text)?;
        return Ok(DescriptionPose {
            p: Vector3::new(px, py, pz),
            r: rotation_from_quaternion([w, x, y, z]).ok_or_else(|| located_message(node, "the quaternion is zero"))?,
        });
    }
    // Otherwise roll, pitch and yaw, in rad unless stated.
    let [px, py, pz, angles @ ..] = exact_numbers::<6>(node, "pose", text)?;
    let is_degree = node.attribute("degrees") == Some("true");
    Ok(DescriptionPose {
        p: Vector3::new(px, py, pz),
        r: rotation(angles.map(|angle: f64| if is_degree { angle.to_radians() } else { angle })),
    })
}

/// Mass and inertia of a link; 1 kg and 1 kg m^2 without `<inertial>`, as in the format.
pub(super) fn inertial(node: &Node) -> Result<DescriptionInertia, String> {
    let given = child(node, "inertial");
    let mut out = DescriptionInertia {
        mass: 1.0,
        at: DescriptionPose::identity(),
        inertia: Matrix3::identity(),
    };
    let Some(given) = given else {
        return Ok(out);
    };
    if let Some(auto) = given.attribute("auto")
        && auto == "true"
    {
        return Err(located_message(
            &given,
            "mass and inertia from shapes are not computed here; write them into the file",
        ));
    }
    // Missing entries keep the defaults of the format.
    out.mass = number_of(&given, "mass")?.unwrap_or(1.0);
    if let Some(pose) = child(&given, "pose") {
        if pose.attribute("relative_to").is_some_and(|name| !name.is_empty()) {
            return Err(located_message(
                &pose,
                "the pose of an <inertial> is always relative to its link; delete `relative_to`",
            ));
        }
        out.at = pose_of(&pose)?;
    }
    if let Some(inertia) = child(&given, "inertia") {
        let mut entries = [1.0, 1.0, 1.0, 0.0, 0.0, 0.0];
        for (entry, key) in entries.iter_mut().zip(["ixx", "iyy", "izz", "ixy", "ixz", "iyz"]) {
            *entry = number_of(&inertia, key)?.unwrap_or(*entry);
        }
        out.inertia = symmetric(entries);
    }
    Ok(out)
}

/// Reads a `<joint>`: its links, its pose in the model, and its one or two axes. Screws become a rotation and a coupled
/// translation.
fn joint(
    node: &Node,
    frames: &SdfFrames,
    version: FormatVersion,
    out: &mut RobotDescription,
) -> Result<SdfJoint, String> {
    let name = required_attribute(node, "name")?;
    // Each degree of freedom becomes a joint, with the element that describes its axis.
    let kind = required_attribute(node, "type")?;
    let wanted: &[(&str, DescriptionJointKind)] = match kind.as_str() {
        "fixed" => &[],
        "revolute" | "continuous" => &[("axis", DescriptionJointKind::Revolute)],
        "prismatic" => &[("axis", DescriptionJointKind::Prismatic)],
        "ball" => &[("axis", DescriptionJointKind::Ball)],
        "universal" | "revolute2" => &[
            ("axis", DescriptionJointKind::Revolute),
            ("axis2", DescriptionJointKind::Revolute),
        ],
        "screw" => &[
            ("axis", DescriptionJointKind::Revolute),
            ("axis", DescriptionJointKind::Prismatic),
        ],
        other => {
            return Err(located_message(
                node,
                &format!(
                    "the joint type {other} is not supported; write it as several joints of the types revolute, prismatic, screw, ball, \
                     gearbox or fixed"
                ),
            ));
        }
    };
    // Pose of the joint at zero, and the links at both ends.
    if frames.ambiguous.contains(&name) {
        return Err(located_message(
            node,
            "a joint and a link or frame have the same name, so poses that refer to it are ambiguous; rename one",
        ));
    }
    let place = pose_in_model(frames, &name, node, SdfFrames::TOP)?;
    let (parent, child_link) = (joint_end(node, "parent", frames)?, joint_end(node, "child", frames)?);
    if parent == child_link {
        return Err(located_message(
            node,
            "its parent and its child are the same link; correct one of them",
        ));
    }
    let mut joints = Vec::new();
    for (k, (tag, kind)) in wanted.iter().enumerate() {
        // The second joint of a pair needs another name.
        let suffix = if k == 0 { "" } else { "_2" };
        let mut joint = DescriptionJoint::new(format!("{name}{suffix}"), *kind, line(node));
        match child(node, tag) {
            Some(axis) if *kind == DescriptionJointKind::Ball => read_ball_axis(&mut joint, &axis, out)?,
            Some(axis) => read_axis(&mut joint, &axis, frames, version, &place, out)?,
            None if *kind == DescriptionJointKind::Ball => {}
            None => return Err(located_message(node, &format!("it needs <{tag}>"))),
        }
        // Drake's extension: rotor inertia and gear ratio are children of the joint, not of the axis.
        if let Some(rotor) = number_of(node, "rotor_inertia")? {
            let gear = number_of(node, "gear_ratio")?.unwrap_or(1.0);
            joint.armature = rotor * gear * gear;
        }
        joints.push(joint);
    }
    // A screw has one degree of freedom: both joints are coupled.
    if let [turn, slide] = joints.as_mut_slice()
        && kind == "screw"
    {
        out.couplings.push(screw_coupling(node, turn, slide)?);
    }
    // Sensors and settings of the solver have no effect on the model.
    if let Some(physics) = child(node, "sensor").or(child(node, "physics")) {
        out.remarks.push(located_message(&physics, "this element is not read"));
    }
    Ok(SdfJoint {
        parent,
        child: child_link,
        joints,
        place,
        name,
        line: line(node),
        kind,
    })
}

/// The link that a child element of a joint names; none is the world. A frame means the link to which it is attached.
pub(super) fn joint_end(node: &Node, tag: &str, frames: &SdfFrames) -> Result<Option<usize>, String> {
    let inner = required_child(node, tag)?;
    attached_link(inner.text().unwrap_or("").trim(), &inner, frames)
}

/// The direction of an `<axis>` of a joint at `place`, in the axes of the model.
pub(super) fn axis_in_model(
    node: &Node,
    frames: &SdfFrames,
    version: FormatVersion,
    place: &DescriptionPose,
) -> Result<Vector3<f64>, String> {
    let (xyz, turned) = match child(node, "xyz") {
        Some(xyz) => {
            // The axis is given in the axes of the joint, or of a named frame.
            let given = xyz.attribute("expressed_in").filter(|name| !name.is_empty());
            let turned = match given {
                Some(name) => pose_in_model(frames, name, node, SdfFrames::TOP)?.r,
                None => place.r,
            };
            (vector(exact_numbers(&xyz, "xyz", xyz.text().unwrap_or(""))?), turned)
        }
        None => (Vector3::z(), place.r),
    };
    // Old versions give axes in the frame of the model.
    let in_model_frame = match text_of(node, "use_parent_model_frame") {
        Some(text) => ["1", "true"].contains(&text),
        None => version < AXES_OF_THE_JOINT,
    };
    let axis = if in_model_frame { xyz } else { turned * xyz };
    if axis.norm() == 0.0 {
        return Err(located_message(node, "the axis has no direction"));
    }
    Ok(axis)
}

/// Reads the axis (in the axes of the model), limits, losses and `<mimic>` of one degree of freedom.
fn read_axis(
    joint: &mut DescriptionJoint,
    node: &Node,
    frames: &SdfFrames,
    version: FormatVersion,
    place: &DescriptionPose,
    out: &mut RobotDescription,
) -> Result<(), String> {
    joint.axis = axis_in_model(node, frames, version, place)?;
    read_limits_and_losses(joint, node, out)?;
    if let Some(mimic) = child(node, "mimic") {
        // A coupling to another joint; the joint of a second axis has the suffix `_2`.
        let mut of = required_attribute(&mimic, "joint")?;
        if mimic.attribute("axis") == Some("axis2") {
            of.push_str("_2");
        }
        let ratio = number_of(&mimic, "multiplier")?.unwrap_or(1.0);
        let reference = number_of(&mimic, "reference")?.unwrap_or(0.0);
        out.couplings.push(DescriptionCoupling {
            line: line(&mimic),
            joint: joint.name.clone(),
            leader: Some(of),
            ratio,
            offset: number_of(&mimic, "offset")?.unwrap_or(0.0) - ratio * reference,
        });
    }
    Ok(())
}

/// Reads the `<axis>` of a ball joint, which has no direction: limits and losses, which are reported as left out.
fn read_ball_axis(joint: &mut DescriptionJoint, node: &Node, out: &mut RobotDescription) -> Result<(), String> {
    read_limits_and_losses(joint, node, out)?;
    let name = &joint.name;
    if !joint.is_driven {
        joint.is_driven = true;
        out.remarks.push(located_message(
            node,
            &format!("the effort of 0 of the ball joint `{name}` is left out"),
        ));
    }
    if let Some(mimic) = child(node, "mimic") {
        out.remarks.push(located_message(
            &mimic,
            &format!(
                "the coupling of the ball joint `{name}` is left out: only joints with one coordinate can be coupled"
            ),
        ));
    }
    Ok(())
}

/// Reads limits, losses and springs in an `<axis>`.
fn read_limits_and_losses(joint: &mut DescriptionJoint, node: &Node, out: &mut RobotDescription) -> Result<(), String> {
    if let Some(limit) = child(node, "limit") {
        // Limits; very large numbers mean that there is none.
        let low = number_of(&limit, "lower")?.filter(|x| *x > -NO_LIMIT);
        let high = number_of(&limit, "upper")?.filter(|x| *x < NO_LIMIT);
        match (low, high) {
            (Some(low), Some(high)) => joint.range = Some([low, high]),
            (None, None) => {}
            _ => out.remarks.push(located_message(
                &limit,
                "it bounds the position on one side only and is left out: ranges of models have both ends",
            )),
        }
        joint.rate = number_of(&limit, "velocity")?.filter(|x| *x > 0.0 && *x < NO_LIMIT);
        // An effort of zero marks a joint without a drive.
        let force = number_of(&limit, "effort")?.filter(|x| *x >= 0.0 && *x < NO_LIMIT);
        joint.is_driven = force != Some(0.0);
        joint.force = force.filter(|x| *x > 0.0).map(|x| [-x, x]);
    }
    // Losses and springs.
    if let Some(dynamics) = child(node, "dynamics") {
        joint.damping = number_of(&dynamics, "damping")?.unwrap_or(0.0);
        joint.friction = number_of(&dynamics, "friction")?.unwrap_or(0.0);
        joint.stiffness = number_of(&dynamics, "spring_stiffness")?.unwrap_or(0.0);
        joint.rest = number_of(&dynamics, "spring_reference")?.unwrap_or(0.0);
    }
    Ok(())
}
