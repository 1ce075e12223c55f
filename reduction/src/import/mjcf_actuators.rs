//! Reads the actuators of MJCF: drives of joints, of the joints of fixed tendons, and along straight spatial tendons.
//! Also reads the keyframe, as the pose from which loops are closed.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use roxmltree::Node;

use super::description::{DescriptionJointKind, JointServo, StraightDrive};
use super::mjcf::MjcfReader;
use super::mjcf_attach::ATTACHED;
use super::xml::{children, located_message, numbers, required_attribute};

/// Limits of the sum of all actuators at each joint, by its name, N or N m; none if one of them has no limits.
type ActuatorRanges = BTreeMap<String, Option<[f64; 2]>>;

impl<'a> MjcfReader<'a> {
    /// Reads all actuators: marks driven joints, adds straight drives, and reports properties of tendons that are left
    /// out.
    pub(super) fn read_actuators(&mut self, root: &Node<'a, '_>) -> Result<(), String> {
        let mut n = 0;
        let mut at_joints = ActuatorRanges::new();
        for node in children(root, "actuator")
            .flat_map(|section| section.children().filter(Node::is_element).collect::<Vec<_>>())
        {
            n += 1;
            // The first number of the gear is the ratio at a joint or tendon with one degree of freedom.
            let gear = match self.text(&node, None, "gear")? {
                Some(text) => numbers(&node, "gear", text)?.first().copied().unwrap_or(1.0),
                None => 1.0,
            };
            if let Some(name) = node.attribute("joint").or(node.attribute("jointinparent")) {
                self.add_joint_drive(&node, name, gear, &mut at_joints)?;
            } else if let Some(name) = node.attribute("tendon") {
                // The tendon by its name.
                let tendon = children(root, "tendon")
                    .flat_map(|section| section.children().collect::<Vec<_>>())
                    .find(|tendon| tendon.attribute("name") == Some(name))
                    .ok_or_else(|| located_message(&node, &format!("there is no tendon `{name}`")))?;
                if tendon.tag_name().name() != "fixed" {
                    self.add_tendon_drive(&node, &tendon, gear)?;
                    continue;
                }
                self.out.remarks.push(located_message(
                    &node,
                    &format!("it drives the joints of the tendon `{name}` together; in the model each joint has a separate drive"),
                ));
                // Inertia and damping of one rotor act on all joints of the tendon at once.
                for key in ["armature", "damping"] {
                    if self.first(&node, None, key)? != 0.0 {
                        let remark = format!("`{key}` of an actuator on a fixed tendon: left out");
                        self.out.remarks.push(located_message(&node, &remark));
                    }
                }
                if self.actuator_range(&node)?.is_some() {
                    let remark = "the force limits of an actuator on a fixed tendon: left out";
                    self.out.remarks.push(located_message(&node, remark));
                }
                // A fixed tendon is a sum of joint positions; each joint gets a drive with its coefficient.
                for joint in children(&tendon, "joint") {
                    let gear = gear * super::xml::number_attribute(&joint, "coef")?;
                    let name = required_attribute(&joint, "joint")?;
                    self.add_joint_drive(&joint, &name, gear, &mut at_joints)?;
                }
            } else {
                self.out.remarks.push(located_message(
                    &node,
                    "it acts on neither a joint nor a tendon and is left out",
                ));
            }
        }
        self.limit_joint_drives(&at_joints);
        for tendon in
            children(root, "tendon").flat_map(|section| section.children().filter(Node::is_element).collect::<Vec<_>>())
        {
            // Springs and losses of tendons are not part of the model, except those of straight drives.
            let mut bends = Vec::new();
            let is_drive =
                (self.out.straight_drives.iter()).any(|line| tendon.attribute("name") == Some(line.tendon.as_str()));
            // A straight drive has damping, friction and armature of its tendon, but not its spring.
            let kept = if is_drive { 1 } else { 4 };
            for key in ["stiffness", "damping", "frictionloss", "armature"]
                .into_iter()
                .take(kept)
            {
                // One tendon is one drive, even if several actuators act on it.
                if self.text(&tendon, None, key)?.is_some_and(|text| text.trim() != "0") {
                    bends.push(key);
                }
            }
            if !bends.is_empty() {
                self.out.remarks.push(located_message(
                    &tendon,
                    &format!("{} of this tendon: left out", bends.join(", ")),
                ));
            }
            if self.text(&tendon, None, "range")?.is_some() && self.text(&tendon, None, "limited")? != Some("false") {
                self.out
                    .remarks
                    .push(located_message(&tendon, "the range of this tendon is left out"));
            }
            // The limit of all actuators on a tendon is part of those of its drive.
            if !is_drive && self.total_force_range(&tendon, None)?.is_some() {
                self.out
                    .remarks
                    .push(located_message(&tendon, "the force limit of this tendon is left out"));
            }
        }
        // A file without actuators describes the mechanism only.
        if n == 0 {
            let joints = self.out.links.iter_mut().flat_map(|link| &mut link.joints);
            for joint in joints.filter(|joint| joint.kind != DescriptionJointKind::Free) {
                joint.is_driven = true;
            }
            self.out
                .remarks
                .push("the file has no actuators; in the model every joint has a drive".to_owned());
        }
        Ok(())
    }

    /// Adds a straight drive for an actuator on a spatial tendon, if the tendon is a straight line between two sites.
    fn add_tendon_drive(&mut self, node: &Node<'a, '_>, tendon: &Node<'a, '_>, gear: f64) -> Result<(), String> {
        let parts: Vec<Node> = tendon.children().filter(Node::is_element).collect();
        // Pulleys and wrapped tendons have more elements, and their direction is not that of a line.
        let (&[one, other], true) = (
            parts.as_slice(),
            parts.iter().all(|part| part.tag_name().name() == "site"),
        ) else {
            self.out.remarks.push(located_message(
                node,
                "it acts on a tendon that is not a straight line between two sites and is left out; add drives to the joints that \
                 it moves by hand",
            ));
            return Ok(());
        };
        // The sites at both ends.
        let mut ends = [(None, Vector3::zeros()); 2];
        for (end, part) in ends.iter_mut().zip([one, other]) {
            let (link, place) = self.site(&part, &required_attribute(&part, "site")?)?;
            *end = (link, place.p);
        }
        let line = tendon.attribute("name").unwrap_or_default().to_owned();
        if let Some(known) = (self.out.straight_drives.iter_mut()).find(|known| known.tendon == line) {
            // Limits of the sum depend on the gears of both.
            let limits = if known.force.take().is_some() {
                ", without force limits"
            } else {
                ""
            };
            self.out.remarks.push(located_message(
                node,
                &format!("another actuator also acts on the tendon `{line}`; both are one drive in the model{limits}"),
            ));
            return Ok(());
        }
        // Losses of the tendon, and the rotor inertia of the actuator by the square of its gear.
        let own = |key: &str| Ok::<f64, String>(self.numbers::<1>(tendon, None, key)?.map_or(0.0, |[x]| x));
        let (damping, friction) = (own("damping")?, own("frictionloss")?);
        let on_tendon = own("armature")?;
        let [armature, drag] = [self.first(node, None, "armature")?, self.first(node, None, "damping")?];
        self.out.straight_drives.push(StraightDrive {
            name: node.attribute("name").unwrap_or(&line).to_owned(),
            line: super::xml::line(node),
            ends,
            // MuJoCo limits the sum of all actuators of a tendon before their gears.
            force: clamp_range(self.actuator_range(node)?, self.total_force_range(tendon, None)?)
                .map(|range| scale_range(range, gear)),
            damping: damping + drag * gear * gear,
            friction,
            armature: on_tendon + armature * gear * gear,
            tendon: line,
        });
        // The gear scales the force of the actuator; the model has the force along the tendon.
        if (gear - 1.0).abs() > 0.0 {
            self.out.remarks.push(located_message(
                node,
                &format!("its gear is {gear}; the force of the drive in the model is the force along the tendon"),
            ));
        }
        Ok(())
    }

    /// The limits of the sum of all actuators at a joint or tendon, N or N m; none if it has no limits.
    pub(super) fn total_force_range(
        &self,
        node: &Node<'a, '_>,
        class: Option<&'a str>,
    ) -> Result<Option<[f64; 2]>, String> {
        self.limits(node, class, ["actuatorfrcrange", "actuatorfrclimited"])
    }

    /// The force limits of an actuator before its gear, N or N m; none if it has no limits.
    fn actuator_range(&self, node: &Node<'a, '_>) -> Result<Option<[f64; 2]>, String> {
        let force = self.limits(node, None, ["forcerange", "forcelimited"])?;
        let Some(gain) = self.constant_gain(node)? else {
            return Ok(force);
        };
        // The force is a multiple of the control, so that the range of the control limits it too.
        let control = self.limits(node, None, ["ctrlrange", "ctrllimited"])?;
        Ok(clamp_range(control.map(|range| scale_range(range, gain)), force))
    }

    /// The factor from the control of an actuator to its force, if the force is a multiple of the control; filters of the
    /// control do not exceed its range.
    fn constant_gain(&self, node: &Node<'a, '_>) -> Result<Option<f64>, String> {
        match node.tag_name().name() {
            "motor" => return Ok(Some(1.0)),
            "general" => {}
            _ => return Ok(None),
        }
        let is_one_of = |key: &str, usual: &str, known: &[&str]| {
            Ok::<bool, String>(known.contains(&self.text(node, None, key)?.unwrap_or(usual)))
        };
        let is_multiple = is_one_of("gaintype", "fixed", &["fixed"])?
            && is_one_of("biastype", "none", &["none"])?
            && is_one_of("dyntype", "none", &["none", "filter", "filterexact"])?;
        if !is_multiple {
            return Ok(None);
        }
        let Some(text) = self.text(node, None, "gainprm")? else {
            return Ok(Some(1.0));
        };
        Ok(numbers(node, "gainprm", text)?.first().copied())
    }

    /// The limits in an attribute; none if another attribute disables them or they are not in ascending order.
    fn limits(
        &self,
        node: &Node<'a, '_>,
        class: Option<&'a str>,
        [range, limited]: [&str; 2],
    ) -> Result<Option<[f64; 2]>, String> {
        let is_limited = self.text(node, class, limited)? != Some("false");
        let range = self.numbers(node, class, range)?;
        Ok(range.filter(|[low, high]| is_limited && low < high))
    }

    /// Marks a joint as driven by an actuator `node`, with reflected rotor inertia, and adds its force limits to those of
    /// other actuators `at_joints`.
    fn add_joint_drive(
        &mut self,
        node: &Node<'a, '_>,
        name: &str,
        gear: f64,
        at_joints: &mut ActuatorRanges,
    ) -> Result<(), String> {
        let range = self.actuator_range(node)?.map(|range| scale_range(range, gear));
        let armature = self.first(node, None, "armature")?;
        let damping = self.first(node, None, "damping")?;
        for (what, value) in [("armature", armature), ("damping", damping)] {
            if value < 0.0 {
                return Err(located_message(node, &format!("`{what}` cannot be negative")));
            }
        }
        let is_second = at_joints.contains_key(name);
        let servo = self.joint_servo(node, gear, is_second)?;
        at_joints
            .entry(name.to_owned())
            .and_modify(|sum| *sum = sum.zip(range).map(|([a, b], [c, d])| [a + c, b + d]))
            .or_insert(range);
        // The joint by its name.
        let joint = self
            .out
            .links
            .iter_mut()
            .flat_map(|link| &mut link.joints)
            .find(|joint| joint.name == name)
            .ok_or_else(|| located_message(node, &format!("there is no joint `{name}`")))?;
        // A free body cannot have a drive.
        joint.is_driven = joint.kind != DescriptionJointKind::Free;
        if is_second && joint.servo.is_some() {
            let remark = "it acts on the same joint as a servo, whose controller is left out; in the model the drive has a force";
            self.out.remarks.push(located_message(node, remark));
        }
        joint.servo =
            servo.filter(|_| [DescriptionJointKind::Revolute, DescriptionJointKind::Prismatic].contains(&joint.kind));
        joint.armature += armature * (gear * gear);
        joint.damping += damping * (gear * gear);
        if (gear - 1.0).abs() > 0.0 && node.tag_name().name() != "joint" {
            self.out.remarks.push(located_message(
                node,
                &format!("its gear is {gear}; the force of the drive in the model is the force at the joint `{name}`"),
            ));
        }
        Ok(())
    }

    /// The controller of a position or velocity actuator, or of a general one with the same force; `None` for actuators whose
    /// control is a force. Controllers that the model cannot express are reported and left out, and so are all at a joint
    /// with several actuators.
    fn joint_servo(&mut self, node: &Node<'a, '_>, gear: f64, is_second: bool) -> Result<Option<JointServo>, String> {
        let gains = match node.tag_name().name() {
            "position" => {
                let kp = self.text(node, None, "kp")?.is_some();
                let kp = if kp { self.first(node, None, "kp")? } else { 1.0 };
                Some([Some(kp), Some(self.first(node, None, "kv")?)])
            }
            "velocity" => {
                let kv = self.text(node, None, "kv")?.is_some();
                Some([None, Some(if kv { self.first(node, None, "kv")? } else { 1.0 })])
            }
            "general" => self.general_gains(node)?,
            _ => None,
        };
        let Some([kp, Some(kd)]) = gains else {
            if self.has_other_controller(node)? {
                let remark = "its controller is left out; in the model the drive has a force";
                self.out.remarks.push(located_message(node, remark));
            }
            return Ok(None);
        };
        let mut reasons = Vec::new();
        if is_second {
            reasons.push("another actuator acts on the same joint");
        }
        if (gear - 1.0).abs() > 0.0 {
            reasons.push("its gear is not 1, so that its command is no position of the joint");
        }
        if self.first(node, None, "timeconst")? != 0.0 {
            reasons.push("its command passes a filter (`timeconst`)");
        }
        if self.first(node, None, "dampratio")? != 0.0 {
            reasons.push("its damping is given as `dampratio`");
        }
        if kp.unwrap_or(0.0) < 0.0 || kd < 0.0 {
            reasons.push("a gain is negative");
        }
        if !reasons.is_empty() {
            let remark = format!(
                "its controller is left out, since {}; in the model the drive has a force",
                reasons.join(" and ")
            );
            self.out.remarks.push(located_message(node, &remark));
            return Ok(None);
        }
        // Unequal limits are those of the drive alone.
        let range = self.limits(node, None, ["forcerange", "forcelimited"])?;
        Ok(Some(JointServo {
            name: node.attribute("name").unwrap_or_default().to_owned(),
            kp,
            kd,
            delay: self.first(node, None, "delay")?,
            saturation: range
                .filter(|[low, high]| is_opposite(*low, *high))
                .map(|[_, high]| high),
        }))
    }

    /// Whether the force of an actuator depends on the state of its joint in a way that no actuator of a model has.
    fn has_other_controller(&self, node: &Node<'a, '_>) -> Result<bool, String> {
        Ok(match node.tag_name().name() {
            "intvelocity" | "pid" | "orientation" | "damper" | "dcmotor" => true,
            "general" => self.text(node, None, "biastype")?.is_some_and(|bias| bias == "affine"),
            _ => false,
        })
    }

    /// Stiffness and damping of a general actuator whose force is that of a position or velocity controller.
    fn general_gains(&self, node: &Node<'a, '_>) -> Result<Option<[Option<f64>; 2]>, String> {
        let is_one_of = |key: &str, usual: &str, known: &str| {
            Ok::<bool, String>(self.text(node, None, key)?.unwrap_or(usual) == known)
        };
        let is_affine = is_one_of("gaintype", "fixed", "fixed")?
            && is_one_of("biastype", "none", "affine")?
            && is_one_of("dyntype", "none", "none")?;
        if !is_affine {
            return Ok(None);
        }
        let all = |key: &str| {
            let text = self.text(node, None, key)?;
            text.map_or_else(|| Ok(Vec::new()), |text| numbers(node, key, text))
        };
        let (gain, bias) = (all("gainprm")?, all("biasprm")?);
        let at = |all: &[f64], k: usize| all.get(k).copied().unwrap_or(0.0);
        let gain = gain.first().copied().unwrap_or(1.0);
        let [constant, stiffness, damping] = [0, 1, 2].map(|k| at(&bias, k));
        Ok(if constant != 0.0 {
            None
        } else if is_opposite(gain, stiffness) {
            Some([Some(gain), Some(-damping)])
        } else if stiffness == 0.0 && is_opposite(gain, damping) {
            Some([None, Some(gain)])
        } else {
            None
        })
    }

    /// Limits the forces of driven joints: first by the actuators of each, then by its own limits, as in `MuJoCo`.
    fn limit_joint_drives(&mut self, at_joints: &ActuatorRanges) {
        for joint in self.out.links.iter_mut().flat_map(|link| &mut link.joints) {
            let range = at_joints.get(&joint.name).copied().flatten();
            joint.force = clamp_range(range, joint.force);
            if let Some([low, _]) = joint.force.take_if(|[low, high]| low >= high) {
                self.out.remarks.push(format!(
                    "line {}: the limits of `{}` and of its actuators leave only the force {low}; they are left out",
                    joint.line, joint.name
                ));
            }
        }
    }

    /// Reads the first keyframe with positions, as the pose from which loops are closed.
    pub(super) fn read_keyframe(&mut self, root: &Node<'a, '_>) -> Result<(), String> {
        if let Some(section) = children(root, "keyframe").find(|section| section.has_attribute(ATTACHED)) {
            let says = "the keyframes of attached models are left out; joints start at the pose of the description";
            self.out.remarks.push(located_message(&section, says));
        }
        let mut keys = children(root, "keyframe").flat_map(|section| section.children().collect::<Vec<_>>());
        let Some((key, text)) = keys.find_map(|key| key.attribute("qpos").map(|text| (key, text))) else {
            return Ok(());
        };
        // Positions stand in the order of the joints; a ball joint has four, a free joint seven.
        let mut values = numbers(&key, "qpos", text)?.into_iter();
        for joint in self.out.links.iter().flat_map(|link| &link.joints) {
            let n = match joint.kind {
                DescriptionJointKind::Revolute | DescriptionJointKind::Prismatic => 1,
                DescriptionJointKind::Ball => 4,
                DescriptionJointKind::Free => 7,
            };
            let own: Vec<f64> = values.by_ref().take(n).collect();
            // Only joints with one coordinate have a starting value.
            if let [value] = own[..] {
                self.out.pose.push((joint.name.clone(), value));
            }
        }
        Ok(())
    }
}

/// The limits of a force that is clamped to one range and then to another; none means no limits.
fn clamp_range(first: Option<[f64; 2]>, then: Option<[f64; 2]>) -> Option<[f64; 2]> {
    match (first, then) {
        (Some(range), Some([low, high])) => Some(range.map(|end| end.clamp(low, high))),
        (range, other) => range.or(other),
    }
}

/// A range multiplied by a factor of either sign, ordered again.
fn scale_range([low, high]: [f64; 2], factor: f64) -> [f64; 2] {
    let ends = [low * factor, high * factor];
    [ends[0].min(ends[1]), ends[0].max(ends[1])]
}

/// Whether two numbers of a file have the same size and opposite signs.
fn is_opposite(one: f64, other: f64) -> bool {
    (one + other).abs() <= 1e-12 * one.abs()
}
