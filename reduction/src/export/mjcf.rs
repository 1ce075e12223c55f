//! MJCF: bodies within bodies, loops as `connect`, drives between two points as tendons.

use std::fmt::Write as _;

use modelmill_boundary::message;
use modelmill_boundary::text::Message;
use modelmill_spec::{CoordinateIdx, Drive, DriveKind, Mechanism, PointIdx};
use nalgebra::UnitQuaternion;

use super::friction::{Friction, Passive};
use super::inertia::Body;
use super::tree::{Joint, Tree};
use super::urdf::{clean, orthonormal};
use super::{list, number};

/// MuJoCo moves no body without mass: what one gets that has none, kg.
const NEXT_TO_NOTHING: f64 = 1e-9;

pub(super) fn write(
    mechanism: &Mechanism,
    tree: &Tree,
    bodies: &[Body],
    friction: &Friction,
    at: &[f64],
    remarks: &mut Vec<Message>,
) -> String {
    let mut writer = Writer {
        mechanism,
        tree,
        bodies,
        friction,
        at,
        remarks,
        text: String::new(),
        depth: 0,
    };
    writer.all();
    writer.text
}

struct Writer<'a> {
    mechanism: &'a Mechanism,
    tree: &'a Tree,
    bodies: &'a [Body],
    friction: &'a Friction,
    /// Coordinates at which the bodies are drawn.
    at: &'a [f64],
    remarks: &'a mut Vec<Message>,
    text: String,
    depth: usize,
}

impl Writer<'_> {
    fn line(&mut self, text: &str) {
        self.text += &"  ".repeat(self.depth);
        self.text += text;
        self.text += "\n";
    }

    /// An element with others in it.
    fn within(&mut self, tag: &str, attributes: &str, inside: impl FnOnce(&mut Self)) {
        self.line(&format!("<{tag}{attributes}>"));
        self.depth += 1;
        inside(self);
        self.depth -= 1;
        self.line(&format!("</{tag}>"));
    }

    fn all(&mut self) {
        let name = format!(" model=\"{}\"", self.mechanism.name);
        self.within("mujoco", &name, |w| {
            w.line("<compiler angle=\"radian\" autolimits=\"true\"/>");
            let gravity: Vec<f64> = (w.mechanism.gravity.iter())
                .map(|g| g.evaluate(&|s| w.mechanism.symbol_nominal(s)))
                .collect();
            w.line(&format!("<option gravity=\"{}\"/>", list(&gravity)));
            w.within("worldbody", "", |w| w.inside(0));
            w.equalities();
            w.tendons();
            w.actuators();
        });
    }

    /// What is on a link, and the links behind it.
    fn inside(&mut self, link: usize) {
        for p in 0..self.mechanism.points.len() {
            let (on, at) = self.tree.point(self.mechanism, PointIdx(p));
            if on == link && self.is_used(PointIdx(p)) {
                let name = &self.mechanism.points[p].name;
                self.line(&format!(
                    "<site name=\"{name}\" pos=\"{}\"/>",
                    list(clean(at).as_slice())
                ));
            }
        }
        for child in 1..self.tree.links.len() {
            if self.tree.links[child].parent == link {
                self.body(child);
            }
        }
    }

    fn is_used(&self, point: PointIdx) -> bool {
        let m = self.mechanism;
        let is_end = |drive: &Drive| match drive.kind {
            DriveKind::Linear { from, to } => from == point || to == point,
            DriveKind::Joint(_) => false,
        };
        m.loops.iter().any(|one| one.joins.contains(&point))
            || m.drives.iter().chain(&m.shared_drives).any(is_end)
            || (self.friction.elements.iter()).any(|(ends, _)| ends.contains(&point))
    }

    fn body(&mut self, at: usize) {
        let link = &self.tree.links[at];
        let placed = self.tree.links[link.parent].placed.sees(&link.placed);
        let turn = UnitQuaternion::from_rotation_matrix(&orthonormal(&placed.rotation));
        let head = format!(
            " name=\"{}\" pos=\"{}\" quat=\"{}\"",
            link.name,
            list(clean(placed.origin).as_slice()),
            list(&[turn.w, turn.i, turn.j, turn.k])
        );
        self.within("body", &head, |w| {
            let link = &w.tree.links[at];
            if link.joints.is_empty() {
                w.line(&format!("<freejoint name=\"{}_free\"/>", link.name));
            }
            for joint in &link.joints {
                let text = w.joint(joint, at);
                w.line(&text);
            }
            let inertial = w.inertial(at);
            w.line(&inertial);
            w.inside(at);
        });
    }

    fn joint(&self, joint: &Joint, link: usize) -> String {
        let placed = &self.tree.links[link].placed;
        let coordinate = &self.mechanism.coordinates[joint.coordinate];
        let mut text = format!(
            "<joint name=\"{}\" type=\"{}\" pos=\"{}\" axis=\"{}\"",
            joint.name,
            if joint.is_rotation { "hinge" } else { "slide" },
            list(clean(placed.sees_point(&joint.origin)).as_slice()),
            list(clean(placed.rotation.transpose() * joint.axis).as_slice()),
        );
        let reference = joint.ratio * self.at[joint.coordinate];
        if reference != 0.0 {
            let _ = write!(text, " ref=\"{}\"", number(reference));
        }
        if joint.name == coordinate.name {
            let limits = self.mechanism.limits.coordinates.iter();
            let of = limits.clone().find(|(i, _)| i.0 == joint.coordinate);
            if let Some([low, high]) = of.and_then(|(_, one)| one.position) {
                let _ = write!(text, " range=\"{} {}\"", number(low), number(high));
            }
            text += &passive(&self.friction.joints[joint.coordinate], "springref");
        }
        text + "/>"
    }

    fn inertial(&mut self, at: usize) -> String {
        let body = &self.bodies[at];
        if body.mass == 0.0 {
            self.remarks.push(message!(
                "`{}` has no mass, and MuJoCo moves no body without: it gets {NEXT_TO_NOTHING:e} kg",
                self.tree.links[at].name
            ));
            let inertia = number(1e-3 * NEXT_TO_NOTHING);
            return format!(
                "<inertial pos=\"0 0 0\" mass=\"{NEXT_TO_NOTHING:e}\" diaginertia=\"{inertia} {inertia} {inertia}\"/>"
            );
        }
        let i = body.central();
        let six = [
            i[(0, 0)],
            i[(1, 1)],
            i[(2, 2)],
            i[(0, 1)],
            i[(0, 2)],
            i[(1, 2)],
        ];
        format!(
            "<inertial pos=\"{}\" mass=\"{}\" fullinertia=\"{}\"/>",
            list(body.centre().as_slice()),
            number(body.mass),
            list(&six)
        )
    }

    /// Loops, and joints that move with others.
    fn equalities(&mut self) {
        let m = self.mechanism;
        let mut lines = Vec::new();
        for one in &m.loops {
            let [a, b] = one.joins.map(|point| &m.points[point.0].name);
            let name = one.name.replace(|c: char| !c.is_alphanumeric(), "_");
            lines.push(format!(
                "<connect name=\"{name}\" site1=\"{a}\" site2=\"{b}\"/>"
            ));
        }
        for joint in self.tree.links.iter().flat_map(|link| &link.joints) {
            let owner = &m.coordinates[joint.coordinate].name;
            if joint.name != *owner {
                // Both are seen from where the bodies are drawn.
                lines.push(format!(
                    "<joint joint1=\"{}\" joint2=\"{owner}\" polycoef=\"0 {} 0 0 0\"/>",
                    joint.name,
                    number(joint.ratio)
                ));
            }
        }
        for one in &self.tree.followed {
            // Seen from where the bodies are drawn.
            let [own, other] = [one.coordinate, one.of].map(|i| self.at[i]);
            lines.push(format!(
                "<joint joint1=\"{}\" joint2=\"{}\" polycoef=\"{} {} 0 0 0\"/>",
                m.coordinates[one.coordinate].name,
                m.coordinates[one.of].name,
                number(one.offset + one.factor * other - own),
                number(one.factor)
            ));
        }
        if lines.is_empty() {
            return;
        }
        self.remarks.push(
            "MuJoCo holds loops and coupled joints by soft constraints: forces of its inverse dynamics agree as far as these \
             are held (`solref`, `solimp`)"
                .into(),
        );
        self.within("equality", "", |w| {
            for line in lines {
                w.line(&line);
            }
        });
    }

    /// Drives and passive elements between two points.
    fn tendons(&mut self) {
        let m = self.mechanism;
        let mut lines: Vec<(String, [PointIdx; 2])> = Vec::new();
        let drives = m.drives.iter().enumerate().map(|(d, one)| (Some(d), one));
        for (d, drive) in drives.chain(m.shared_drives.iter().map(|one| (None, one))) {
            if let DriveKind::Linear { from, to } = drive.kind {
                let own = d.map_or(Passive::default(), |d| self.friction.drives[d]);
                let rest = passive(&own, "springlength");
                lines.push((format!("name=\"{}_line\"{rest}", drive.name), [from, to]));
            }
        }
        for (k, (ends, own)) in self.friction.elements.iter().enumerate() {
            let rest = passive(own, "springlength");
            lines.push((format!("name=\"element_{}\"{rest}", k + 1), *ends));
        }
        if lines.is_empty() {
            return;
        }
        self.within("tendon", "", |w| {
            for (head, ends) in lines {
                w.within("spatial", &format!(" {head}"), |w| {
                    for point in ends {
                        let name = &w.mechanism.points[point.0].name;
                        w.line(&format!("<site site=\"{name}\"/>"));
                    }
                });
            }
        });
    }

    fn actuators(&mut self) {
        let m = self.mechanism;
        let drives = m.drives.iter().enumerate().map(|(d, one)| (Some(d), one));
        let all = drives.chain(m.shared_drives.iter().map(|one| (None, one)));
        let mut lines = Vec::new();
        for (d, drive) in all.filter(|(_, drive)| drive.is_driven) {
            let on = match drive.kind {
                DriveKind::Joint(CoordinateIdx(i)) => {
                    if m.coordinates[i].motion.is_quaternion() || !self.has_joint(i) {
                        continue;
                    }
                    format!("joint=\"{}\"", m.coordinates[i].name)
                }
                DriveKind::Linear { .. } => format!("tendon=\"{}_line\"", drive.name),
            };
            let limits = m.limits.forces.iter();
            let range = limits.clone().find(|(i, _)| Some(i.0) == d);
            let range = range.map_or(String::new(), |(_, [low, high])| {
                format!(" ctrlrange=\"{} {}\"", number(*low), number(*high))
            });
            lines.push(format!("<motor name=\"{}\" {on}{range}/>", drive.name));
        }
        if lines.is_empty() {
            return;
        }
        self.within("actuator", "", |w| {
            for line in lines {
                w.line(&line);
            }
        });
    }

    fn has_joint(&self, coordinate: usize) -> bool {
        let mut joints = self.tree.links.iter().flat_map(|link| &link.joints);
        joints.any(|joint| joint.coordinate == coordinate)
    }
}

/// Attributes of what a joint or tendon has by itself.
fn passive(one: &Passive, rest: &str) -> String {
    let mut text = String::new();
    for (name, value) in [
        ("damping", one.damping),
        ("frictionloss", one.friction),
        ("armature", one.armature),
        ("stiffness", one.stiffness),
    ] {
        if value != 0.0 {
            let _ = write!(text, " {name}=\"{}\"", number(value));
        }
    }
    if one.stiffness != 0.0 {
        let _ = write!(text, " {rest}=\"{}\"", number(one.rest));
    }
    text
}
