//! Reads the actuators of MJCF: drives of joints, of the joints of fixed tendons, and along straight spatial tendons.
//! Also reads the keyframe, as the pose from which loops are closed.

use nalgebra::Vector3;
use roxmltree::Node;

use super::description::{DescriptionJointKind, StraightDrive};
use super::mjcf::MjcfReader;
use super::xml::{children, located_message, numbers, required_attribute};

impl<'a> MjcfReader<'a> {
    /// Reads all actuators: marks driven joints, adds straight drives, and reports properties of tendons that are left
    /// out.
    pub(super) fn read_actuators(&mut self, root: &Node<'a, '_>) -> Result<(), String> {
        let mut n = 0;
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
                self.add_joint_drive(&node, name, gear)?;
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
                // A fixed tendon is a sum of joint positions; each joint gets a drive with its coefficient.
                for joint in children(&tendon, "joint") {
                    let gear = gear * super::xml::number_attribute(&joint, "coef")?;
                    let name = required_attribute(&joint, "joint")?;
                    self.add_joint_drive(&joint, &name, gear)?;
                }
            } else {
                self.out.remarks.push(located_message(
                    &node,
                    "it acts on neither a joint nor a tendon and is left out",
                ));
            }
        }
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
            // The limit of all actuators on a tendon is that of its drive.
            if !is_drive && self.limited_force(&tendon)?.is_some() {
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
        if self.out.straight_drives.iter().any(|known| known.tendon == line) {
            self.out.remarks.push(located_message(
                node,
                &format!("another actuator also acts on the tendon `{line}`; both are one drive in the model"),
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
            force: match self.limited_force(tendon)? {
                Some(range) => Some(range),
                None => self.force_range(node)?.map(|range| scale_range(range, gear)),
            },
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
    fn limited_force(&self, node: &Node<'a, '_>) -> Result<Option<[f64; 2]>, String> {
        let range = self.numbers(node, None, "actuatorfrcrange")?;
        let is_limited = self.text(node, None, "actuatorfrclimited")? != Some("false");
        Ok(range.filter(|[low, high]| is_limited && low < high))
    }

    /// The force limits of an actuator before its gear, N or N m; none if it has no limits.
    fn force_range(&self, node: &Node<'a, '_>) -> Result<Option<[f64; 2]>, String> {
        if let Some([low, high]) = self.numbers(node, None, "forcerange")?
            && low < high
            && self.text(node, None, "forcelimited")? != Some("false")
        {
            return Ok(Some([low, high]));
        }
        // The control of a motor is its force, so that the range of the control limits it.
        if node.tag_name().name() == "motor"
            && let Some([low, high]) = self.numbers(node, None, "ctrlrange")?
            && self.text(node, None, "ctrllimited")? != Some("false")
        {
            return Ok(Some([low, high]));
        }
        Ok(None)
    }

    /// Marks a joint as driven by an actuator `node`, with force limits and reflected rotor inertia.
    fn add_joint_drive(&mut self, node: &Node<'a, '_>, name: &str, gear: f64) -> Result<(), String> {
        let range = self.force_range(node)?;
        let armature = self.first(node, None, "armature")?;
        let damping = self.first(node, None, "damping")?;
        for (what, value) in [("armature", armature), ("damping", damping)] {
            if value < 0.0 {
                return Err(located_message(node, &format!("`{what}` cannot be negative")));
            }
        }
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
        joint.armature += armature * (gear * gear);
        joint.damping += damping * (gear * gear);
        // Limits at the joint itself have priority.
        if joint.force.is_none() {
            joint.force = range.map(|range| scale_range(range, gear));
        }
        if (gear - 1.0).abs() > 0.0 && node.tag_name().name() != "joint" {
            self.out.remarks.push(located_message(
                node,
                &format!("its gear is {gear}; the force of the drive in the model is the force at the joint `{name}`"),
            ));
        }
        Ok(())
    }

    /// Reads the first keyframe with positions, as the pose from which loops are closed.
    pub(super) fn read_keyframe(&mut self, root: &Node<'a, '_>) -> Result<(), String> {
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

/// A range multiplied by a factor of either sign, ordered again.
fn scale_range([low, high]: [f64; 2], factor: f64) -> [f64; 2] {
    let ends = [low * factor, high * factor];
    [ends[0].min(ends[1]), ends[0].max(ends[1])]
}
