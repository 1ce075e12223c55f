//! Reads the equalities of MJCF: `connect` and `weld` become loop closures; `joint`, and fixed tendons of constant
//! length, become couplings.

use nalgebra::{Matrix3, Vector3};
use roxmltree::Node;

use super::description::{ClosureConstraint, DescriptionClosure, DescriptionCoupling};
use super::mjcf::MjcfReader;
use super::placed::{DescriptionPose, rotation_from_quaternion};
use super::xml::{
    children, exact_numbers, line, located_message, number_attribute, numbers, required_attribute, vector,
};

/// Why a coupling is refused that is no constant ratio.
const POLYNOMIAL: &str = "a coupling by a polynomial of higher degree is not imported; delete it, import the rest, and write it in the model \
     file as the `follows` of the joint's coordinate";

impl<'a> MjcfReader<'a> {
    /// The index of a body by name; none is the world.
    fn link(&self, node: &Node, name: &str) -> Result<Option<usize>, String> {
        if name == "world" {
            return Ok(None);
        }
        let found = self.link_of_name.get(name).copied();
        found
            .map(Some)
            .ok_or_else(|| located_message(node, &format!("there is no body `{name}`")))
    }

    /// Link and pose of a site by name.
    pub(super) fn site(&self, node: &Node, name: &str) -> Result<(Option<usize>, DescriptionPose), String> {
        let found = self.sites.iter().find(|(site, _, _)| site == name);
        found
            .map(|(_, link, placed)| (*link, *placed))
            .ok_or_else(|| located_message(node, &format!("there is no site `{name}`")))
    }

    /// Reads one equality; inactive ones are left out with a remark.
    pub(super) fn read_equality(&mut self, node: &Node<'a, '_>) -> Result<(), String> {
        if self.text(node, None, "active")? == Some("false") {
            self.out
                .remarks
                .push(located_message(node, "this equality is not active and is left out"));
            return Ok(());
        }
        let tag = node.tag_name().name();
        // Equalities without a name are numbered.
        let name = node
            .attribute("name")
            .map_or_else(|| format!("{tag}_{}", self.out.closures.len() + 1), str::to_owned);
        match tag {
            "connect" | "weld" => {
                let holds = if tag == "connect" {
                    ClosureConstraint::Origins
                } else {
                    ClosureConstraint::Frames
                };
                // The ends are given by two sites, or by two bodies with an anchor.
                let ends = if node.attribute("site1").is_some() {
                    let [one, other] = [required_attribute(node, "site1")?, required_attribute(node, "site2")?];
                    [self.site(node, &one)?, self.site(node, &other)?]
                } else {
                    self.body_ends(node, tag)?
                };
                if let Some(moved) =
                    (ends.iter()).find_map(|(link, _)| link.filter(|one| self.mocap_links.contains(one)))
                {
                    // A program pulls the other end along; it closes no loop of the mechanism.
                    let says = format!(
                        "one end is the mocap body `{}`, which is moved from outside; this equality is left out",
                        self.out.links[moved].name
                    );
                    self.out.remarks.push(located_message(node, &says));
                    return Ok(());
                }
                self.out.closures.push(DescriptionClosure {
                    name,
                    line: line(node),
                    ends,
                    constraint: holds,
                });
            }
            "joint" => self.read_joint_equality(node)?,
            "tendon" => self.read_tendon_equality(node)?,
            other => {
                return Err(located_message(
                    node,
                    &format!("the equality `{other}` is not supported; supported are connect, weld, joint and tendon"),
                ));
            }
        }
        Ok(())
    }

    /// The two ends of a closure between bodies; the second end is determined by the pose of the file.
    fn body_ends(&self, node: &Node<'a, '_>, tag: &str) -> Result<[(Option<usize>, DescriptionPose); 2], String> {
        let one = self.link(node, &required_attribute(node, "body1")?)?;
        let other = self.link(node, node.attribute("body2").unwrap_or("world"))?;
        // Poses of both bodies, as the file gives them, determine the second end.
        let in_world = |link: Option<usize>| link.map_or(DescriptionPose::identity(), |link| self.world[link]);
        let anchor = match node.attribute("anchor") {
            Some(text) => vector(exact_numbers(node, "anchor", text)?),
            None if tag == "weld" => Vector3::zeros(),
            None => return Err(located_message(node, "it needs `anchor`")),
        };
        if tag == "weld" {
            // The anchor is a point of the second body, by default its origin.
            let pose: Option<[f64; 7]> = match node.attribute("relpose") {
                Some(text) => Some(exact_numbers(node, "relpose", text)?),
                None => None,
            };
            // The weld connects both bodies at the anchor.
            let shift = DescriptionPose {
                p: anchor,
                r: Matrix3::identity(),
            };
            // The position of `relpose` is that of the anchor in the first body. A zero quaternion means the relative pose
            // of the file.
            let first = match pose {
                Some([x, y, z, q @ ..]) if q.iter().any(|x| x.abs() > 0.0) => DescriptionPose {
                    p: Vector3::new(x, y, z),
                    r: rotation_from_quaternion(q)
                        .ok_or_else(|| located_message(node, "`relpose` has no direction"))?,
                },
                _ => in_world(one).inverse().compose(&in_world(other)).compose(&shift),
            };
            return Ok([(one, first), (other, shift)]);
        }
        // For `connect` the anchor is a point of the first body.
        let first = DescriptionPose {
            p: anchor,
            r: Matrix3::identity(),
        };
        let second = in_world(other).inverse().compose(&in_world(one)).compose(&first);
        Ok([(one, first), (other, second)])
    }

    /// Reads an equality of two joints, or of one joint that is fixed. `polycoef` refers to deviations from the pose of
    /// the file.
    fn read_joint_equality(&mut self, node: &Node<'a, '_>) -> Result<(), String> {
        let joint = required_attribute(node, "joint1")?;
        let of = node.attribute("joint2").map(str::to_owned);
        let given = match self.text(node, None, "polycoef")? {
            Some(text) => numbers(node, "polycoef", text)?,
            None => vec![0.0, 1.0],
        };
        // Missing coefficients are zero.
        let coefficient = |k: usize| given.get(k).copied().unwrap_or(0.0);
        let zero = |name: &str| self.joint_zero(node, name);
        if of.is_some() && (2..5).any(|k| coefficient(k) != 0.0) {
            return Err(located_message(node, POLYNOMIAL));
        }
        // q1 - zero1 = c0 + c1*(q2 - zero2), solved for q1.
        let ratio = if of.is_some() { coefficient(1) } else { 0.0 };
        let reference = of.as_deref().map_or(Ok(0.0), zero)?;
        let offset = zero(&joint)? + coefficient(0) - ratio * reference;
        self.out.couplings.push(DescriptionCoupling {
            line: line(node),
            joint,
            leader: of,
            ratio,
            offset,
        });
        Ok(())
    }

    /// The value of a joint at the pose of the file, rad or m.
    fn joint_zero(&self, node: &Node, name: &str) -> Result<f64, String> {
        let mut joints = self.out.links.iter().flat_map(|link| &link.joints);
        joints
            .find(|joint| joint.name == name)
            .map(|joint| joint.zero)
            .ok_or_else(|| located_message(node, &format!("there is no joint `{name}`")))
    }

    /// Reads a fixed tendon of constant length, or two tendons that follow each other, as a coupling. At most two
    /// joints may be involved.
    fn read_tendon_equality(&mut self, node: &Node<'a, '_>) -> Result<(), String> {
        let given = match self.text(node, None, "polycoef")? {
            Some(text) => numbers(node, "polycoef", text)?,
            None => vec![0.0, 1.0],
        };
        let coefficient = |k: usize| given.get(k).copied().unwrap_or(0.0);
        // The condition as a sum over joints: length of the first tendon minus a multiple of the second one's.
        let mut terms = tendon_joints(node, &required_attribute(node, "tendon1")?)?;
        if let Some(other) = node.attribute("tendon2") {
            if (2..5).any(|k| coefficient(k) != 0.0) {
                return Err(located_message(node, POLYNOMIAL));
            }
            for (joint, length) in tendon_joints(node, other)? {
                terms.push((joint, -coefficient(1) * length));
            }
        }
        // Add up the lengths per joint; both tendons may contain the same joint.
        let mut sums: Vec<(String, f64)> = Vec::new();
        for (joint, length) in terms {
            match sums.iter_mut().find(|(known, _)| *known == joint) {
                Some((_, sum)) => *sum += length,
                None => sums.push((joint, length)),
            }
        }
        // A joint that cancels out is not coupled.
        sums.retain(|(_, length)| *length != 0.0);
        // One joint is fixed; of two joints the second follows the first.
        let (one, of) = match sums.as_slice() {
            [one] => (one, None),
            [of, one] => (one, Some(of)),
            _ => {
                return Err(located_message(
                    node,
                    &format!(
                        "it couples {} joints; models have couplings of two joints only",
                        sums.len()
                    ),
                ));
            }
        };
        // Solve the condition for the follower.
        let ratio = of.map_or(0.0, |(_, length)| -length / one.1);
        let reference = of.map_or(Ok(0.0), |(of, _)| self.joint_zero(node, of))?;
        let offset = self.joint_zero(node, &one.0)? + coefficient(0) / one.1 - ratio * reference;
        self.out.couplings.push(DescriptionCoupling {
            line: line(node),
            joint: one.0.clone(),
            leader: of.map(|(of, _)| of.clone()),
            ratio,
            offset,
        });
        Ok(())
    }
}

/// Joints of a fixed tendon with their coefficients: change of length per rad or per m.
fn tendon_joints(node: &Node<'_, '_>, name: &str) -> Result<Vec<(String, f64)>, String> {
    // The tendon by its name.
    let root = node.document().root_element();
    let tendon = children(&root, "tendon")
        .flat_map(|section| section.children().collect::<Vec<_>>())
        .find(|tendon| tendon.attribute("name") == Some(name))
        .ok_or_else(|| located_message(node, &format!("there is no tendon `{name}`")))?;
    if tendon.tag_name().name() != "fixed" {
        return Err(located_message(
            node,
            &format!("`{name}` is a spatial tendon; a constant length is supported for fixed tendons only"),
        ));
    }
    let joints = children(&tendon, "joint");
    joints
        .map(|joint| Ok((required_attribute(&joint, "joint")?, number_attribute(&joint, "coef")?)))
        .collect()
}
