//! Reads MJCF, the format of MuJoCo: bodies with joints, default classes, equalities, actuators, and forces at joints.
//!
//! Source of names and defaults: MuJoCo's XML reference (mujoco.readthedocs.io/en/stable/XMLreference.html).

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};
use roxmltree::{Document, Node};

use super::description::{
    DescriptionInertia, DescriptionJoint, DescriptionJointKind, DescriptionLink, RobotDescription,
};
use super::geoms::{self, GIVE_INERTIAL};
use super::mjcf_compiler::{CompilerSettings, MjcfCompiler};
use super::mjcf_defaults::MjcfDefaults;
use super::mjcf_meshes::{LoadedMeshes, MeshEntries, MeshFiles, mesh_entries};
use super::mjcf_names::GivenNames;
use super::mjcf_of_urdf::ATTACHED_REMARK;
use super::placed::{DescriptionPose, rotation_about, rotation_from_quaternion};
use super::xml::{children, exact_numbers, line, located_message, numbers, required_attribute, symmetric, vector};

/// The state of the reader: settings, defaults, and the description so far.
pub(super) struct MjcfReader<'a> {
    /// Settings of the file and of attached models.
    pub(super) settings: CompilerSettings<'a>,
    /// Default classes.
    defaults: MjcfDefaults<'a>,
    /// The description.
    pub(super) out: RobotDescription,
    /// Poses of the bodies in the world, at the pose of the file.
    pub(super) world: Vec<DescriptionPose>,
    /// The bodies by their names, for elements that refer to them.
    pub(super) link_of_name: BTreeMap<String, usize>,
    /// Names of the file, and of elements that it does not name.
    names: GivenNames,
    /// Bodies that are moved from outside.
    pub(super) mocap_links: Vec<usize>,
    /// Sites: name, link (none is the world) and pose in it.
    pub(super) sites: Vec<(String, Option<usize>, DescriptionPose)>,
    /// Reads files of meshes; `None` if the description is not a file.
    pub(super) mesh_files: Option<MeshFiles<'a>>,
    /// The entries of meshes by their names.
    pub(super) mesh_entries: MeshEntries<'a>,
    /// Meshes that were read.
    pub(super) loaded_meshes: LoadedMeshes,
}

/// The surroundings of an element.
#[derive(Clone, Copy)]
struct MjcfContext<'a> {
    /// Index of the body; none is the world.
    link: Option<usize>,
    /// Default class (`childclass`) of the elements inside.
    class: Option<&'a str>,
}

/// Reads a description; fails with one line that states the fault and its place.
pub(crate) fn read<'a>(document: &'a Document, mesh_files: Option<MeshFiles<'a>>) -> Result<RobotDescription, String> {
    let root = document.root_element();
    let mut reader = MjcfReader {
        settings: CompilerSettings::read(&root)?,
        defaults: MjcfDefaults::read(&root)?,
        out: RobotDescription {
            name: root.attribute("model").unwrap_or("robot").to_owned(),
            format: "MJCF",
            gravity: Some(Vector3::new(0.0, 0.0, -9.81)),
            ..RobotDescription::default()
        },
        world: Vec::new(),
        link_of_name: BTreeMap::new(),
        names: GivenNames::read(&root)?,
        mocap_links: Vec::new(),
        sites: Vec::new(),
        mesh_files,
        mesh_entries: mesh_entries(&root),
        loaded_meshes: LoadedMeshes::new(),
    };
    // Options: gravity, and forces that the model does not have.
    for option in children(&root, "option") {
        if let Some(text) = option.attribute("gravity") {
            reader.out.gravity = Some(vector(exact_numbers(&option, "gravity", text)?));
        }
        // A flag of the file can disable gravity without a change of the vector.
        let is_off = |flag: Node| flag.attribute("gravity") == Some("disable");
        if children(&option, "flag").any(is_off) {
            let says = "its flag disables gravity; the model has gravity";
            reader.out.remarks.push(located_message(&option, says));
        }
        // Forces of the surrounding fluid are not part of a model.
        for key in ["density", "viscosity"] {
            let text = option.attribute(key);
            if text.is_some_and(|text| text.trim().parse() != Ok(0.0)) {
                let says = format!("`{key}`: fluid forces are left out");
                reader.out.remarks.push(located_message(&option, &says));
            }
        }
    }
    // Elements that MuJoCo expands when it reads the file; only their result could be imported.
    for node in root.descendants() {
        let tag = node.tag_name().name();
        if ["include", "attach"].contains(&tag) {
            return Err(located_message(
                &node,
                "other files can only be read if the description is given as a file",
            ));
        }
        if ["composite", "flexcomp"].contains(&tag) {
            return Err(located_message(
                &node,
                "this element is not expanded here; save the complete model with MuJoCo (mj_saveLastXML) and import that file",
            ));
        }
    }
    // Remarks on attached files of another format.
    let remarks = children(&root, ATTACHED_REMARK).filter_map(|node| node.attribute("text"));
    reader.out.remarks.extend(remarks.map(str::to_owned));
    // The tree of bodies with their joints and inertias.
    for body in children(&root, "worldbody") {
        let inside = MjcfContext {
            link: None,
            class: None,
        };
        reader.read_children(&body, inside, DescriptionPose::identity())?;
    }
    // Then everything that refers to bodies and joints by name.
    reader.scale_to_total();
    for equalities in children(&root, "equality") {
        for node in equalities.children().filter(Node::is_element) {
            reader.read_equality(&node)?;
        }
    }
    reader.read_actuators(&root)?;
    reader.read_keyframe(&root)?;
    Ok(reader.out)
}

impl<'a> MjcfReader<'a> {
    /// The settings of the file to which an element belongs.
    pub(super) fn settings_of(&self, node: &Node) -> &MjcfCompiler {
        self.settings.find_settings(node)
    }

    /// An attribute of an element, its own or that of its default class.
    pub(super) fn text(&self, node: &Node<'a, '_>, class: Option<&str>, key: &str) -> Result<Option<&'a str>, String> {
        self.defaults.attribute(node, class, key)
    }

    /// An attribute of exactly `N` numbers, its own or that of its default class.
    pub(super) fn numbers<const N: usize>(
        &self,
        node: &Node<'a, '_>,
        class: Option<&str>,
        key: &str,
    ) -> Result<Option<[f64; N]>, String> {
        let text = self.text(node, class, key)?;
        text.map(|text| exact_numbers(node, key, text)).transpose()
    }

    /// The first number of an attribute, zero without it. Nonzero further ones are reported.
    pub(super) fn first(&mut self, node: &Node<'a, '_>, class: Option<&str>, key: &str) -> Result<f64, String> {
        let Some(text) = self.text(node, class, key)? else {
            return Ok(0.0);
        };
        let all = numbers(node, key, text)?;
        if all.iter().skip(1).any(|x| *x != 0.0) {
            self.out.remarks.push(located_message(
                node,
                &format!("only the first number of `{key}` is read"),
            ));
        }
        Ok(all.first().copied().unwrap_or(0.0))
    }

    /// Position and orientation of an element, from any of the ways in which MJCF specifies an orientation.
    fn read_placement(&self, node: &Node<'a, '_>, class: Option<&str>) -> Result<DescriptionPose, String> {
        // The position; then whichever orientation is given.
        let settings = self.settings_of(node);
        let mut out = DescriptionPose::identity();
        if let Some(pos) = self.numbers(node, class, "pos")? {
            out.p = vector(pos);
        }
        let fault = |key: &str| located_message(node, &format!("`{key}` has no direction"));
        if let Some(quat) = self.numbers(node, class, "quat")? {
            out.r = rotation_from_quaternion(quat).ok_or_else(|| fault("quat"))?;
        }
        if let Some([x, y, z, angle]) = self.numbers(node, class, "axisangle")? {
            let axis = Vector3::new(x, y, z)
                .try_normalize(1e-12)
                .ok_or_else(|| fault("axisangle"))?;
            out.r = rotation_about(&axis, settings.angle(angle));
        }
        // The x axis is kept; the y axis is made perpendicular to it.
        if let Some([a, b, c, d, e, f]) = self.numbers(node, class, "xyaxes")? {
            let x = Vector3::new(a, b, c)
                .try_normalize(1e-12)
                .ok_or_else(|| fault("xyaxes"))?;
            let y = Vector3::new(d, e, f);
            let y = (y - x * x.dot(&y))
                .try_normalize(1e-12)
                .ok_or_else(|| fault("xyaxes"))?;
            out.r = Matrix3::from_columns(&[x, y, x.cross(&y)]);
        }
        // The smallest rotation that turns the z axis into the given direction; half a turn about x for the opposite
        // one.
        if let Some(z) = self.numbers(node, class, "zaxis")? {
            let z = vector(z).try_normalize(1e-12).ok_or_else(|| fault("zaxis"))?;
            let axis = Vector3::z().cross(&z);
            let angle = axis.norm().atan2(z.z);
            let axis = axis.try_normalize(1e-12).unwrap_or_else(Vector3::x);
            out.r = rotation_about(&axis, angle);
        }
        if let Some(angles) = self.numbers::<3>(node, class, "euler")? {
            out.r = settings.euler_rotation(angles);
        }
        Ok(out)
    }

    /// Reads the elements inside a body, which are given in a frame at `place` in the body.
    fn read_children(
        &mut self,
        node: &Node<'a, '_>,
        inside: MjcfContext<'a>,
        place: DescriptionPose,
    ) -> Result<(), String> {
        for child in node.children().filter(Node::is_element) {
            // A default class is valid for all elements inside.
            let class = child.attribute("childclass").or(inside.class);
            match child.tag_name().name() {
                "body" => self.read_body(&child, MjcfContext { class, ..inside }, place)?,
                // A frame has no body; its pose is applied to the elements inside.
                "frame" => {
                    let place = place.compose(&self.read_placement(&child, class)?);
                    self.read_children(&child, MjcfContext { class, ..inside }, place)?;
                }
                "site" => {
                    if let Some(name) = child.attribute("name") {
                        let at = place.compose(&self.read_placement(&child, class)?);
                        self.sites.push((name.to_owned(), inside.link, at));
                    }
                }
                "joint" | "freejoint" if inside.link.is_none() => {
                    return Err(located_message(&child, "the world cannot have a joint"));
                }
                "joint" => self.read_joint(&child, inside, place)?,
                // The defaults of joints do not count for this element.
                "freejoint" => {
                    if let Some(link) = inside.link {
                        let free = self.free_joint(&child, link)?;
                        self.out.links[link].joints.push(free);
                    }
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Reads a body with its joints, its inertia and its child bodies.
    fn read_body(
        &mut self,
        node: &Node<'a, '_>,
        around: MjcfContext<'a>,
        place: DescriptionPose,
    ) -> Result<(), String> {
        // Bodies have no default class of their own, so the pose is that of the element.
        let placed = place.compose(&self.read_placement(node, None)?);
        let own = self.out.links.len();
        // Bodies without a name are numbered.
        let name = self.names.name_of(node, "body", &format!("body{}", own + 1));
        self.link_of_name.insert(name.clone(), own);
        let parent = around.link.map_or(DescriptionPose::identity(), |link| self.world[link]);
        // Equalities between bodies need the poses in the world.
        self.world.push(parent.compose(&placed));
        let inertial = match self.inertial(node, around.class) {
            // A body that is fixed to the world needs no mass, if the total is not scaled.
            Err(_) if self.is_fixed(node, around.link) && self.settings.main_settings().total_mass.is_none() => {
                DescriptionInertia::default()
            }
            inertial => inertial?,
        };
        // Properties of simulation and control are reported, since the model lacks them.
        if node.attribute("mocap") == Some("true") {
            self.mocap_links.push(own);
            self.out.remarks.push(located_message(
                node,
                "this mocap body is moved from outside; it is fixed in the model",
            ));
        }
        if node.attribute("gravcomp").is_some_and(|text| text.trim() != "0") {
            self.out.remarks.push(located_message(
                node,
                "`gravcomp` is left out: it is a controller and not a property of the body, so the model has the full weight",
            ));
        }
        self.out.links.push(DescriptionLink {
            name,
            parent: around.link,
            at: placed,
            joints: Vec::new(),
            inertial,
        });
        // Child bodies follow the body in the list, so that parents stand before children.
        let inside = MjcfContext {
            link: Some(own),
            class: around.class,
        };
        self.read_children(node, inside, DescriptionPose::identity())
    }

    /// Whether a body cannot move: neither it nor a body that carries it has a joint.
    fn is_fixed(&self, node: &Node<'a, '_>, parent: Option<usize>) -> bool {
        let mut waiting = vec![*node];
        while let Some(node) = waiting.pop() {
            for child in node.children().filter(Node::is_element) {
                match child.tag_name().name() {
                    "joint" | "freejoint" => return false,
                    "frame" => waiting.push(child),
                    _ => {}
                }
            }
        }
        let mut carrier = parent;
        while let Some(link) = carrier.map(|link| &self.out.links[link]) {
            if !link.joints.is_empty() {
                return false;
            }
            carrier = link.parent;
        }
        true
    }

    /// Mass and inertia of a body: its `<inertial>`, or its shapes, with the bounds of the file.
    fn inertial(&mut self, node: &Node<'a, '_>, class: Option<&'a str>) -> Result<DescriptionInertia, String> {
        let given = self.find_inertial(node)?;
        // The given inertia counts, unless the file demands that of the shapes.
        let mut found = match (given, self.settings_of(node).from_geoms) {
            (Some((given, place)), None | Some(false)) => {
                let mut placed = self.read_placement(&given, None)?;
                let [mass] = exact_numbers(&given, "mass", &required_attribute(&given, "mass")?)?;
                // A full matrix is given in the axes of the body, a diagonal one in those of the element.
                let inertia = if let Some(full) = given.attribute("fullinertia") {
                    if given.attribute("diaginertia").is_some() {
                        return Err(located_message(
                            &given,
                            "expected `fullinertia` or `diaginertia`, not both",
                        ));
                    }
                    placed.r = Matrix3::identity();
                    symmetric(exact_numbers(&given, "fullinertia", full)?)
                } else if let Some(text) = given.attribute("diaginertia") {
                    Matrix3::from_diagonal(&vector(exact_numbers(&given, "diaginertia", text)?))
                } else {
                    return Err(located_message(&given, "it needs `diaginertia` or `fullinertia`"));
                };
                DescriptionInertia {
                    mass,
                    at: place.compose(&placed),
                    inertia,
                }
            }
            (_, Some(false)) => DescriptionInertia::default(),
            // No `<inertial>`, or `inertiafromgeom` is true.
            _ => self.inertia_from_geoms(node, class)?,
        };
        // Lower bounds of the compiler settings.
        let settings = self.settings_of(node);
        found.mass = found.mass.max(settings.least_mass);
        found.inertia = settings.bounded_inertia(found.inertia);
        Ok(found)
    }

    /// The `<inertial>` of a body and the pose of the frame in which it stands.
    fn find_inertial<'n>(&self, body: &Node<'a, 'n>) -> Result<Option<(Node<'a, 'n>, DescriptionPose)>, String> {
        let mut waiting = vec![(*body, DescriptionPose::identity())];
        while let Some((node, place)) = waiting.pop() {
            for child in node.children().filter(Node::is_element) {
                match child.tag_name().name() {
                    "inertial" => return Ok(Some((child, place))),
                    "frame" => waiting.push((child, place.compose(&self.read_placement(&child, None)?))),
                    _ => {}
                }
            }
        }
        Ok(None)
    }

    /// Scales all masses and inertias by one factor, if the file specifies the total mass.
    fn scale_to_total(&mut self) {
        let masses = self.out.links.iter().map(|link| link.inertial.mass);
        let (sum, Some(total)) = (masses.sum::<f64>(), self.settings.main_settings().total_mass) else {
            return;
        };
        if sum <= 0.0 {
            return;
        }
        for link in &mut self.out.links {
            link.inertial.mass *= total / sum;
            link.inertial.inertia *= total / sum;
        }
    }

    /// Mass and inertia of the shapes of a body, including those in its `<frame>` elements.
    fn inertia_from_geoms(
        &mut self,
        node: &Node<'a, '_>,
        class: Option<&'a str>,
    ) -> Result<DescriptionInertia, String> {
        // All shapes of the body itself, but not those of its child bodies.
        let mut shapes = Vec::new();
        // In MuJoCo the settings of the body decide which groups have mass, also for shapes of attached models.
        let groups = self.settings_of(node).groups;
        let mut waiting = vec![(*node, class, DescriptionPose::identity())];
        while let Some((node, class, place)) = waiting.pop() {
            for child in node.children().filter(Node::is_element) {
                let class = child.attribute("childclass").or(class);
                match child.tag_name().name() {
                    "frame" => {
                        waiting.push((child, class, place.compose(&self.read_placement(&child, class)?)));
                    }
                    "geom" => shapes.extend(self.geom_inertia(&child, class, place, groups)?),
                    _ => {}
                }
            }
        }
        Ok(geoms::combined_inertia(&shapes))
    }

    /// Mass and inertia of one shape; none if it has no mass or is outside of `groups`, the first and the last.
    fn geom_inertia(
        &mut self,
        node: &Node<'a, '_>,
        class: Option<&'a str>,
        place: DescriptionPose,
        [first, last]: [f64; 2],
    ) -> Result<Option<DescriptionInertia>, String> {
        let mass = self.numbers::<1>(node, class, "mass")?.map(|[mass]| mass);
        // Without a mass MuJoCo computes it from the density, by default that of water.
        let [density] = self.numbers(node, class, "density")?.unwrap_or([1000.0]);
        if mass == Some(0.0) || (mass.is_none() && density == 0.0) {
            return Ok(None);
        }
        // Often shapes for the picture only are in another group and have no mass.
        let [group] = self.numbers(node, class, "group")?.unwrap_or([0.0]);
        if !(first..=last).contains(&group) {
            return Ok(None);
        }
        if self.text(node, class, "shellinertia")? == Some("true") {
            let says = format!("mass and inertia of a hollow shape are not computed here; {GIVE_INERTIAL}");
            return Err(located_message(node, &says));
        }
        // A shape with a mesh has the type of a mesh, if no other is given.
        let usual = match self.text(node, class, "mesh")? {
            Some(_) => "mesh",
            None => "sphere",
        };
        let kind = self.text(node, class, "type")?.unwrap_or(usual);
        let mut placed = self.read_placement(node, class)?;
        if let Some(mesh) = self.text(node, class, "mesh")? {
            if kind != "mesh" {
                let says = format!(
                    "mass and inertia of a {kind} that is fitted to a mesh are not computed here; {GIVE_INERTIAL}"
                );
                return Err(located_message(node, &says));
            }
            let own = self.mesh_inertia(node, mesh, mass, density)?;
            let at = place.compose(&placed).compose(&own.at);
            return Ok(Some(DescriptionInertia { at, ..own }));
        }
        let size = match self.text(node, class, "size")? {
            Some(text) => numbers(node, "size", text)?,
            None => Vec::new(),
        };
        // `fromto` gives both ends of the axis of a shape; its z axis points along it.
        let mut half = None;
        if let Some([a, b, c, d, e, f]) = self.numbers(node, class, "fromto")? {
            let (from, to) = (Vector3::new(a, b, c), Vector3::new(d, e, f));
            placed.p = 0.5 * (from + to);
            let z = (to - from)
                .try_normalize(1e-12)
                .ok_or_else(|| located_message(node, "`fromto` has no length"))?;
            half = Some(0.5 * (to - from).norm());
            let axis = Vector3::z().cross(&z);
            let angle = axis.norm().atan2(z.z);
            placed.r = rotation_about(&axis.try_normalize(1e-12).unwrap_or_else(Vector3::x), angle);
        }
        let shape = geoms::GeomShape::new(kind, &size, half).map_err(|fault| located_message(node, &fault))?;
        Ok(shape.map(|shape| shape.inertial(mass, density, place.compose(&placed))))
    }

    /// A free joint, which only a body of the world may have.
    fn free_joint(&mut self, node: &Node, link: usize) -> Result<DescriptionJoint, String> {
        if self.out.links[link].parent.is_some() {
            return Err(located_message(
                node,
                "a free joint is possible for a child of the world only",
            ));
        }
        let name = self.names.name_of(node, "joint", "root");
        Ok(DescriptionJoint::new(name, DescriptionJointKind::Free, line(node)))
    }

    /// Reads a joint with its zero, limits and losses. It gets a drive only from an actuator.
    fn read_joint(
        &mut self,
        node: &Node<'a, '_>,
        inside: MjcfContext<'a>,
        place: DescriptionPose,
    ) -> Result<(), String> {
        let (Some(link), class) = (inside.link, inside.class) else {
            return Ok(());
        };
        let kind = match self.text(node, class, "type")?.unwrap_or("hinge") {
            "hinge" => DescriptionJointKind::Revolute,
            "slide" => DescriptionJointKind::Prismatic,
            "ball" => DescriptionJointKind::Ball,
            // Losses of a free joint are named as left out.
            "free" => {
                let mut free = self.free_joint(node, link)?;
                free.damping = self.first(node, class, "damping")?;
                free.friction = self.first(node, class, "frictionloss")?;
                free.armature = self.first(node, class, "armature")?;
                free.stiffness = self.first(node, class, "stiffness")?;
                self.out.links[link].joints.push(free);
                return Ok(());
            }
            other => {
                return Err(located_message(
                    node,
                    &format!("there is no joint type `{other}`; expected hinge, slide, ball or free"),
                ));
            }
        };
        let n = self.out.links[link].joints.len();
        // Joints without a name are named after their body, with a number from the second on.
        let suffix = if n == 0 { String::new() } else { format!("{}", n + 1) };
        let wanted = format!("{}_joint{suffix}", self.out.links[link].name);
        let name = self.names.name_of(node, "joint", &wanted);
        let mut joint = DescriptionJoint::new(name, kind, line(node));
        joint.is_driven = false;
        if let Some(pos) = self.numbers(node, class, "pos")? {
            joint.anchor = vector(pos);
        }
        // Anchor and axis are given in the axes of the enclosing frame.
        joint.anchor = place.p + place.r * joint.anchor;
        if let Some(axis) = self.numbers(node, class, "axis")? {
            joint.axis = vector(axis);
        }
        joint.axis = place.r * joint.axis;
        if joint.axis.norm() == 0.0 {
            return Err(located_message(node, "the axis has no direction"));
        }
        // Angles have the unit of the file, lengths are in m.
        let in_unit = |reader: &Self, value: f64| {
            if kind == DescriptionJointKind::Prismatic {
                value
            } else {
                reader.settings_of(node).angle(value)
            }
        };
        if matches!(kind, DescriptionJointKind::Revolute | DescriptionJointKind::Prismatic) {
            let zero = self.first(node, class, "ref")?;
            joint.zero = in_unit(self, zero);
        }
        // A range counts if `limited` is true, or if it is not specified and `autolimits` is true.
        let limited = self.text(node, class, "limited")?.unwrap_or("auto");
        if let Some(range) = self.numbers::<2>(node, class, "range")? {
            let counts = limited == "true" || (limited == "auto" && self.settings_of(node).has_auto_limits);
            if counts && kind == DescriptionJointKind::Ball {
                self.out.remarks.push(located_message(
                    node,
                    "the range of a ball joint is left out: models have no limits of this kind",
                ));
            } else if counts {
                // As in MuJoCo, limits that are not in ascending order are none.
                joint.range = Some(range.map(|x| in_unit(self, x))).filter(|[low, high]| low < high);
            }
        }
        // Limits of the sum of all actuators at the joint.
        joint.force = self.total_force_range(node, class)?;
        // Passive forces at the joint.
        joint.damping = self.first(node, class, "damping")?;
        joint.friction = self.first(node, class, "frictionloss")?;
        joint.armature = self.first(node, class, "armature")?;
        joint.stiffness = self.first(node, class, "stiffness")?;
        let rest = self.first(node, class, "springref")?;
        joint.rest = in_unit(self, rest);
        self.out.links[link].joints.push(joint);
        Ok(())
    }
}
