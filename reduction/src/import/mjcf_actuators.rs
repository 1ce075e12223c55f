//! What acts on the joints of MJCF: actuators, fixed tendons that they pull, and the pose that its author kept.

use roxmltree::Node;

use super::description::Kind;
use super::mjcf::Reader;
use super::xml::{at, children, numbers, word};

impl<'a, 'i> Reader<'a, 'i> {
    /// Which joints are driven, and by how much.
    pub(super) fn actuators(&mut self, root: &Node<'a, 'i>) -> Result<(), String> {
        let mut n = 0;
        for node in children(root, "actuator").flat_map(|section| {
            section
                .children()
                .filter(Node::is_element)
                .collect::<Vec<_>>()
        }) {
            n += 1;
            let gear = match self.text(&node, None, "gear")? {
                Some(text) => numbers(&node, "gear", text)?
                    .first()
                    .copied()
                    .unwrap_or(1.0),
                None => 1.0,
            };
            if let Some(name) = node.attribute("joint").or(node.attribute("jointinparent")) {
                self.drive(&node, name, gear)?;
            } else if let Some(name) = node.attribute("tendon") {
                let tendon = children(root, "tendon")
                    .flat_map(|section| section.children().collect::<Vec<_>>())
                    .find(|tendon| tendon.attribute("name") == Some(name))
                    .ok_or_else(|| at(&node, &format!("no tendon is called `{name}`")))?;
                if tendon.tag_name().name() != "fixed" {
                    self.out.remarks.push(at(
                        &node,
                        "it pulls a spatial tendon, which models do not have: joints that it moves need drives by hand",
                    ));
                    continue;
                }
                self.out.remarks.push(at(
                    &node,
                    &format!("it drives the joints of the tendon `{name}` together; here each has a force of its own"),
                ));
                for joint in children(&tendon, "joint") {
                    let gear = gear * super::xml::number(&joint, "coef")?;
                    let name = word(&joint, "joint")?;
                    self.drive(&joint, &name, gear)?;
                }
            } else {
                self.out.remarks.push(at(
                    &node,
                    "it acts on no joint and no fixed tendon and is left out",
                ));
            }
        }
        for tendon in children(root, "tendon").flat_map(|section| {
            section
                .children()
                .filter(Node::is_element)
                .collect::<Vec<_>>()
        }) {
            let mut bends = Vec::new();
            for key in ["stiffness", "damping", "frictionloss", "armature"] {
                if self
                    .text(&tendon, None, key)?
                    .is_some_and(|text| text.trim() != "0")
                {
                    bends.push(key);
                }
            }
            if !bends.is_empty() {
                self.out.remarks.push(at(
                    &tendon,
                    &format!("{} of this tendon: left out", bends.join(", ")),
                ));
            }
            if tendon.attribute("range").is_some() {
                self.out.remarks.push(at(
                    &tendon,
                    "a range of a tendon is no equality and is left out",
                ));
            }
        }
        if n == 0 {
            let joints = self.out.links.iter_mut().flat_map(|link| &mut link.joints);
            for joint in joints.filter(|joint| joint.kind != Kind::Free) {
                joint.is_driven = true;
            }
            self.out
                .remarks
                .push("the file has no actuators; every joint has a drive here".to_owned());
        }
        Ok(())
    }

    /// Gives a joint its drive.
    fn drive(&mut self, node: &Node<'a, 'i>, name: &str, gear: f64) -> Result<(), String> {
        let mut range = None;
        if let Some([low, high]) = self.numbers(node, None, "forcerange")?
            && low < high
            && self.text(node, None, "forcelimited")? != Some("false")
        {
            range = Some([low, high]);
        } else if node.tag_name().name() == "motor"
            && let Some([low, high]) = self.numbers(node, None, "ctrlrange")?
            && self.text(node, None, "ctrllimited")? != Some("false")
        {
            range = Some([low, high]);
        }
        let armature = self
            .numbers::<1>(node, None, "armature")?
            .map_or(0.0, |[x]| x);
        let joint = self
            .out
            .links
            .iter_mut()
            .flat_map(|link| &mut link.joints)
            .find(|joint| joint.name == name)
            .ok_or_else(|| at(node, &format!("no joint is called `{name}`")))?;
        joint.is_driven = joint.kind != Kind::Free;
        joint.armature += armature * gear * gear;
        if joint.force.is_none() {
            joint.force = range.map(|[low, high]| {
                let ends = [low * gear, high * gear];
                [ends[0].min(ends[1]), ends[0].max(ends[1])]
            });
        }
        if (gear - 1.0).abs() > 0.0 && node.tag_name().name() != "joint" {
            self.out.remarks.push(at(
                node,
                &format!(
                    "its gear is {gear}: the force of the drive here is that at the joint `{name}`"
                ),
            ));
        }
        Ok(())
    }

    /// The first pose of the file that its author kept, to close loops from.
    pub(super) fn keyframe(&mut self, root: &Node<'a, 'i>) -> Result<(), String> {
        let mut keys =
            children(root, "keyframe").flat_map(|section| section.children().collect::<Vec<_>>());
        let Some((key, text)) = keys.find_map(|key| key.attribute("qpos").map(|text| (key, text)))
        else {
            return Ok(());
        };
        let mut values = numbers(&key, "qpos", text)?.into_iter();
        for joint in self.out.links.iter().flat_map(|link| &link.joints) {
            let n = match joint.kind {
                Kind::Turn | Kind::Slide => 1,
                Kind::Ball => 4,
                Kind::Free => 7,
            };
            let own: Vec<f64> = values.by_ref().take(n).collect();
            if let [value] = own[..] {
                self.out.pose.push((joint.name.clone(), value));
            }
        }
        Ok(())
    }
}
