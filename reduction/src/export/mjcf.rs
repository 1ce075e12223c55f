//! Writes MJCF: a tree of links with inertias and passive properties goes in; XML comes out, with loops as `connect`
//! and drives between two points as tendons.

use std::fmt::Write as _;

use modelmill_boundary::message;
use modelmill_boundary::text::Message;
use modelmill_spec::{
    ActuatorKind, ActuatorTerm, CoordinateIdx, DriveKind, Mechanism, ModelActuator, ModelDrive, PointIdx,
};
use nalgebra::UnitQuaternion;

use super::friction::{PassiveEffects, PassiveProperties};
use super::inertia::LinkInertia;
use super::tree::{ExportedJoint, LinkTree};
use super::urdf::{clean, orthonormal};
use super::{number_list, number_text};

/// Mass of a moving body that has none in the model, kg; MuJoCo requires one.
const NEGLIGIBLE_MASS: f64 = 1e-9;

/// The MJCF of a mechanism; `at` are the coordinates at which the bodies are drawn.
pub(super) fn write(
    mechanism: &Mechanism,
    tree: &LinkTree,
    bodies: &[LinkInertia],
    friction: &PassiveEffects,
    at: &[f64],
    remarks: &mut Vec<Message>,
) -> String {
    let mut writer = MjcfWriter {
        mechanism,
        tree,
        bodies,
        friction,
        at,
        remarks,
        text: String::new(),
        depth: 0,
    };
    writer.write_all();
    writer.text
}

/// The text as it is written, and its inputs.
struct MjcfWriter<'a> {
    /// The mechanism.
    mechanism: &'a Mechanism,
    /// Its links and joints.
    tree: &'a LinkTree,
    /// Inertia of each link.
    bodies: &'a [LinkInertia],
    /// Passive properties of joints, tendons and elements.
    friction: &'a PassiveEffects,
    /// Coordinates at which the bodies are drawn, rad or m.
    at: &'a [f64],
    /// Remarks on what MJCF states differently.
    remarks: &'a mut Vec<Message>,
    /// The XML so far.
    text: String,
    /// Depth of the present element, for its indentation.
    depth: usize,
}

impl MjcfWriter<'_> {
    /// A line with the present indentation.
    fn line(&mut self, text: &str) {
        self.text += &"  ".repeat(self.depth);
        self.text += text;
        self.text += "\n";
    }

    /// An element with contents.
    fn write_element(&mut self, tag: &str, attributes: &str, inside: impl FnOnce(&mut Self)) {
        self.line(&format!("<{tag}{attributes}>"));
        self.depth += 1;
        inside(self);
        self.depth -= 1;
        self.line(&format!("</{tag}>"));
    }

    /// The complete file.
    fn write_all(&mut self) {
        // Bodies first; the sections after them refer to bodies, joints and sites by name.
        let name = format!(" model=\"{}\"", self.mechanism.name);
        self.write_element("mujoco", &name, |w| {
            w.line("<compiler angle=\"radian\" autolimits=\"true\"/>");
            // Gravity is an expression in constants of the model.
            let gravity: Vec<f64> = (w.mechanism.gravity.iter())
                .map(|g| g.evaluate(&|s| w.mechanism.symbol_nominal(s)))
                .collect();
            w.line(&format!("<option gravity=\"{}\"/>", number_list(&gravity)));
            w.write_element("worldbody", "", |w| w.write_link(0));
            w.equalities();
            w.tendons();
            w.actuators();
        });
    }

    /// The contents of a link: its sites and its child bodies.
    fn write_link(&mut self, link: usize) {
        // Sites for the points of this link that loops, drives or elements need.
        for p in 0..self.mechanism.points.len() {
            let (on, at) = self.tree.point(self.mechanism, PointIdx(p));
            if on == link && self.is_used(PointIdx(p)) {
                let name = &self.mechanism.points[p].name;
                self.line(&format!(
                    "<site name=\"{name}\" pos=\"{}\"/>",
                    number_list(clean(at).as_slice())
                ));
            }
        }
        // Bodies are nested: each child stands inside of its parent.
        for child in 1..self.tree.links.len() {
            if self.tree.links[child].parent == link {
                self.body(child);
            }
        }
    }

    /// Whether a loop, a drive or an element uses a point, so that it needs a site.
    fn is_used(&self, point: PointIdx) -> bool {
        let m = self.mechanism;
        // Drives between two points; drives of joints have no points.
        let is_end = |drive: &ModelDrive| match drive.kind {
            DriveKind::Linear { from, to } => from == point || to == point,
            DriveKind::Joint(_) => false,
        };
        m.loops.iter().any(|one| one.joins.contains(&point))
            || m.drives.iter().chain(&m.shared_drives).any(is_end)
            || (self.friction.elements.iter()).any(|(ends, _)| ends.contains(&point))
    }

    /// A body with its joints, its inertia and its contents.
    fn body(&mut self, at: usize) {
        let link = &self.tree.links[at];
        // Pose relative to the parent, as position and quaternion.
        let placed = self.tree.links[link.parent].placed.relative_placement(&link.placed);
        let turn = UnitQuaternion::from_rotation_matrix(&orthonormal(&placed.rotation));
        let head = format!(
            " name=\"{}\" pos=\"{}\" quat=\"{}\"",
            link.name,
            number_list(clean(placed.origin).as_slice()),
            number_list(&[turn.w, turn.i, turn.j, turn.k])
        );
        self.write_element("body", &head, |w| {
            let link = &w.tree.links[at];
            // Links without joints are free bodies.
            if link.joints.is_empty() {
                w.line(&format!("<freejoint name=\"{}_free\"/>", link.name));
            }
            for joint in &link.joints {
                let text = w.joint(joint, at);
                w.line(&text);
            }
            let inertial = w.inertial(at);
            w.line(&inertial);
            w.write_link(at);
        });
    }

    /// A joint. Limits and passive properties belong to the joint that has the name of its coordinate.
    fn joint(&self, joint: &ExportedJoint, link: usize) -> String {
        // Anchor and axis in the axes of the body.
        let placed = &self.tree.links[link].placed;
        let coordinate = &self.mechanism.coordinates[joint.coordinate];
        let mut text = format!(
            "<joint name=\"{}\" type=\"{}\" pos=\"{}\" axis=\"{}\"",
            joint.name,
            if joint.is_rotation { "hinge" } else { "slide" },
            number_list(clean(placed.relative_point(&joint.origin)).as_slice()),
            number_list(clean(placed.rotation.transpose() * joint.axis).as_slice()),
        );
        // The value of the joint at the pose in which the bodies are drawn.
        let reference = joint.ratio * self.at[joint.coordinate];
        if reference != 0.0 {
            let _ = write!(text, " ref=\"{}\"", number_text(reference));
        }
        // Limits and losses are written once, at the joint with the name of the coordinate.
        if joint.name == coordinate.name {
            let limits = self.mechanism.limits.coordinates.iter();
            let of = limits.clone().find(|(i, _)| i.0 == joint.coordinate);
            if let Some([low, high]) = of.and_then(|(_, one)| one.position) {
                let _ = write!(text, " range=\"{} {}\"", number_text(low), number_text(high));
            }
            text += &passive_attributes(&self.friction.joints[joint.coordinate], "springref");
        }
        text + "/>"
    }

    /// The inertia of a body; a negligible one if it has no mass.
    fn inertial(&mut self, at: usize) -> String {
        let body = &self.bodies[at];
        if body.mass == 0.0 {
            self.remarks.push(message!(
                "`{}` has no mass, but MuJoCo requires one for a moving body; it gets {NEGLIGIBLE_MASS:e} kg",
                self.tree.links[at].name
            ));
            let inertia = number_text(1e-3 * NEGLIGIBLE_MASS);
            return format!(
                "<inertial pos=\"0 0 0\" mass=\"{NEGLIGIBLE_MASS:e}\" diaginertia=\"{inertia} {inertia} {inertia}\"/>"
            );
        }
        // MuJoCo's sequence of the six entries: the diagonal, then xy, xz, yz.
        let i = body.central_inertia();
        let six = [i[(0, 0)], i[(1, 1)], i[(2, 2)], i[(0, 1)], i[(0, 2)], i[(1, 2)]];
        format!(
            "<inertial pos=\"{}\" mass=\"{}\" fullinertia=\"{}\"/>",
            number_list(body.centre_of_mass().as_slice()),
            number_text(body.mass),
            number_list(&six)
        )
    }

    /// Equalities: loops, and joints that follow others.
    fn equalities(&mut self) {
        let m = self.mechanism;
        let mut lines = Vec::new();
        // A loop: two sites coincide.
        for one in &m.loops {
            let [a, b] = one.joins.map(|point| &m.points[point.0].name);
            // Names of loops may have other characters than letters and digits.
            let name = one.name.replace(|c: char| !c.is_alphanumeric(), "_");
            lines.push(format!("<connect name=\"{name}\" site1=\"{a}\" site2=\"{b}\"/>"));
        }
        // Joints of a coordinate that moves several joints follow the one with its name.
        for joint in self.tree.links.iter().flat_map(|link| &link.joints) {
            let owner = &m.coordinates[joint.coordinate].name;
            if joint.name != *owner {
                // MuJoCo's polynomial relates deviations from the drawn pose, where both joints have their references.
                lines.push(format!(
                    "<joint joint1=\"{}\" joint2=\"{owner}\" polycoef=\"0 {} 0 0 0\"/>",
                    joint.name,
                    number_text(joint.ratio)
                ));
            }
        }
        for one in &self.tree.followed {
            // The same for coordinates with `follows`: the constant term is the difference at the drawn pose.
            let [own, other] = [one.coordinate, one.leader].map(|i| self.at[i]);
            lines.push(format!(
                "<joint joint1=\"{}\" joint2=\"{}\" polycoef=\"{} {} 0 0 0\"/>",
                m.coordinates[one.coordinate].name,
                m.coordinates[one.leader].name,
                number_text(one.offset + one.factor * other - own),
                number_text(one.factor)
            ));
        }
        if lines.is_empty() {
            return;
        }
        self.remarks.push(
            "MuJoCo closes loops and couples joints by soft constraints: forces of its inverse dynamics agree only as well as \
             these are satisfied (`solref`, `solimp`)"
                .into(),
        );
        self.write_element("equality", "", |w| {
            for line in lines {
                w.line(&line);
            }
        });
    }

    /// Tendons: drives and passive elements between two points.
    fn tendons(&mut self) {
        let m = self.mechanism;
        let mut lines: Vec<(String, [PointIdx; 2])> = Vec::new();
        let drives = m.drives.iter().enumerate().map(|(d, one)| (Some(d), one));
        for (d, drive) in drives.chain(m.shared_drives.iter().map(|one| (None, one))) {
            if let DriveKind::Linear { from, to } = drive.kind {
                // Shared drives have no passive properties.
                let own = d.map_or(PassiveProperties::default(), |d| self.friction.drives[d]);
                let rest = passive_attributes(&own, "springlength");
                lines.push((format!("name=\"{}_line\"{rest}", drive.name), [from, to]));
            }
        }
        // Springs and dampers between two points, without a drive.
        for (k, (ends, own)) in self.friction.elements.iter().enumerate() {
            let rest = passive_attributes(own, "springlength");
            lines.push((format!("name=\"element_{}\"{rest}", k + 1), *ends));
        }
        if lines.is_empty() {
            return;
        }
        self.write_element("tendon", "", |w| {
            for (head, ends) in lines {
                w.write_element("spatial", &format!(" {head}"), |w| {
                    for point in ends {
                        let name = &w.mechanism.points[point.0].name;
                        w.line(&format!("<site site=\"{name}\"/>"));
                    }
                });
            }
        });
    }

    /// Actuators: for each drive that has a joint or a tendon a position or velocity controller with the gains of the
    /// model, or a motor. Both have the force limits of the drive.
    fn actuators(&mut self) {
        let m = self.mechanism;
        let drives = m.drives.iter().enumerate().map(|(d, one)| (Some(d), one));
        let all = drives.chain(m.shared_drives.iter().map(|one| (None, one)));
        let mut lines = Vec::new();
        for (d, drive) in all.filter(|(_, drive)| drive.is_driven) {
            // What the motor acts on; coordinates of quaternions have no joint of their own.
            let on = match drive.kind {
                DriveKind::Joint(CoordinateIdx(i)) => {
                    if m.coordinates[i].motion.is_quaternion() || !self.has_joint(i) {
                        continue;
                    }
                    format!("joint=\"{}\"", m.coordinates[i].name)
                }
                DriveKind::Linear { .. } => format!("tendon=\"{}_line\"", drive.name),
            };
            let mut limits = m.limits.forces.iter();
            let range = limits.find(|(i, _)| Some(i.0) == d).map(|(_, range)| *range);
            if let Some(servo) = d.and_then(|d| self.servo_attributes(d, range)) {
                let (element, name, attributes) = servo;
                lines.push(format!("<{element} name=\"{name}\" {on}{attributes}/>"));
                continue;
            }
            // The control of a motor is its force, so that limits of the force are its range.
            let range = range.map_or(String::new(), |[low, high]| {
                format!(" ctrlrange=\"{} {}\"", number_text(low), number_text(high))
            });
            lines.push(format!("<motor name=\"{}\" {on}{range}/>", drive.name));
        }
        if lines.is_empty() {
            return;
        }
        self.write_element("actuator", "", |w| {
            for line in lines {
                w.line(&line);
            }
        });
    }

    /// Element, name and attributes of the controller of a drive; `None` for a motor. Its name is that of its command if the
    /// model gives one. What MJCF cannot express is reported.
    fn servo_attributes(&mut self, drive: usize, range: Option<[f64; 2]>) -> Option<(&'static str, String, String)> {
        let m = self.mechanism;
        let name = &m.drives[drive].name;
        let own: Vec<&ModelActuator> = m.actuators.iter().filter(|one| one.drive.0 == drive).collect();
        let element = match own.as_slice() {
            [] => return None,
            [one] if one.kind == ActuatorKind::PositionServo => "position",
            [one] if one.kind == ActuatorKind::VelocityServo => "velocity",
            _ => {
                self.remarks.push(message!(
                    "the actuators of `{name}` are no single position or velocity servo: they become a motor whose control is the force"
                ));
                return None;
            }
        };
        let actuator = own[0];
        let gain = |term: &ActuatorTerm| m.nominal_product(term.parameters.iter().map(|(p, power)| (p.0, *power)));
        if actuator.terms.iter().any(|term| gain(term).is_none()) {
            self.remarks.push(message!(
                "a gain of `{name}` has no nominal value: its servo becomes a motor whose control is the force"
            ));
            return None;
        }
        let gain = |term: &ActuatorTerm| gain(term).unwrap_or(0.0);
        let [stiffness, command_rate, _, rate] = actuator.slopes(&|c| m.constants[c].value, &gain);
        let mut text = String::new();
        if element == "position" {
            let _ = write!(text, " kp=\"{}\" kv=\"{}\"", number_text(stiffness), number_text(-rate));
            if command_rate != 0.0 {
                self.remarks.push(message!(
                    "`kv` of the servo of `{name}` acts on the rate of its command too, which MJCF cannot express: left out"
                ));
            }
        } else {
            let _ = write!(text, " kv=\"{}\"", number_text(-rate));
        }
        let limit = actuator.saturation.map(|limit| [-limit.abs(), limit.abs()]);
        let limit = match (limit, range) {
            (Some([a, b]), Some([c, d])) => Some([a.max(c), b.min(d)]),
            (one, other) => one.or(other),
        };
        if let Some([low, high]) = limit.filter(|[low, high]| low < high) {
            let _ = write!(text, " forcerange=\"{} {}\"", number_text(low), number_text(high));
        }
        if let Some(delay) = actuator.delay.filter(|delay| *delay > 0.0) {
            // The buffer holds the delay for steps down to 0.1 ms, and the delay is no multiple of the step.
            let samples = (delay / 1e-4).ceil() + 1.0;
            let _ = write!(
                text,
                " delay=\"{}\" nsample=\"{samples}\" interp=\"linear\"",
                number_text(delay)
            );
            let needs = "a delay of a servo needs MuJoCo 4 and a time step of at least 0.1 ms".into();
            if !self.remarks.contains(&needs) {
                self.remarks.push(needs);
            }
        }
        for (what, is_there) in [
            ("dead band", actuator.dead_band.is_some()),
            ("rate limit", actuator.rate_limit.is_some()),
        ] {
            if is_there {
                self.remarks
                    .push(message!("the {what} of the servo of `{name}` is left out"));
            }
        }
        let has_usual_name = actuator.signal == format!("{name}_command");
        let name = if has_usual_name { name } else { &actuator.signal };
        Some((element, name.clone(), text))
    }

    /// Whether a joint moves with a coordinate.
    fn has_joint(&self, coordinate: usize) -> bool {
        let mut joints = self.tree.links.iter().flat_map(|link| &link.joints);
        joints.any(|joint| joint.coordinate == coordinate)
    }
}

/// Attributes of the passive properties of a joint or tendon; `rest` is the name of the attribute for the relaxed
/// position.
fn passive_attributes(one: &PassiveProperties, rest: &str) -> String {
    let mut text = String::new();
    for (name, value) in [
        ("damping", one.damping),
        ("frictionloss", one.friction),
        ("armature", one.armature),
        ("stiffness", one.stiffness),
    ] {
        if value != 0.0 {
            let _ = write!(text, " {name}=\"{}\"", number_text(value));
        }
    }
    // A spring needs its relaxed position.
    if one.stiffness != 0.0 {
        let _ = write!(text, " {rest}=\"{}\"", number_text(one.rest));
    }
    text
}
