//! Locks joints at a value, so that they are no coordinates: those of the option `locked`, or all that `kept` does not
//! name. A description goes in; couplings that fix the joints come out.

use super::ImportError;
use super::description::{DescriptionCoupling, DescriptionJoint, DescriptionJointKind, RobotDescription};

/// Locks the joints of `locked` at their values, and, with `kept`, all joints that neither are listed there nor are
/// coupled with one that is listed. Those stay at the pose of the description.
///
/// Fails for a joint that does not exist, is locked twice, or is neither revolute nor prismatic.
pub(crate) fn lock_joints(
    description: &mut RobotDescription,
    locked: &[(String, f64)],
    kept: Option<&[String]>,
) -> Result<(), ImportError> {
    let mut values: Vec<(String, f64)> = Vec::new();
    for (name, value) in locked {
        let joint = find_joint(description, name)?;
        if !is_scalar(joint) {
            return Err(ImportError(format!(
                "`{name}` cannot be locked: only revolute and prismatic joints have one value"
            )));
        }
        if values.iter().any(|(other, _)| other == name) || kept.is_some_and(|kept| kept.contains(name)) {
            return Err(ImportError(format!("the joint `{name}` is named twice")));
        }
        values.push((name.clone(), *value));
    }
    if let Some(kept) = kept {
        for name in kept {
            find_joint(description, name)?;
        }
        let moving = with_coupled(description, kept);
        let joints = description.links.iter().flat_map(|link| &link.joints);
        for joint in joints.filter(|joint| is_scalar(joint) && !moving.contains(&joint.name)) {
            if values.iter().all(|(name, _)| *name != joint.name) {
                let pose = description.pose.iter().find(|(name, _)| *name == joint.name);
                values.push((joint.name.clone(), pose.map_or(joint.zero, |(_, value)| *value)));
            }
        }
    }
    for (name, value) in values {
        let line = find_joint(description, &name)?.line;
        // Nothing else determines a locked joint. Joints that follow it are fixed with it.
        description.couplings.retain(|coupling| coupling.joint != name);
        description.pose.retain(|(other, _)| *other != name);
        description.couplings.push(DescriptionCoupling {
            line,
            joint: name,
            leader: None,
            ratio: 0.0,
            offset: value,
        });
    }
    Ok(())
}

/// The joint of a name.
fn find_joint<'a>(description: &'a RobotDescription, name: &str) -> Result<&'a DescriptionJoint, ImportError> {
    let joints = || description.links.iter().flat_map(|link| &link.joints);
    joints().find(|joint| joint.name == name).ok_or_else(|| {
        let known: Vec<&str> = joints().map(|joint| joint.name.as_str()).collect();
        ImportError(format!(
            "there is no joint `{name}` that moves; the description has {}",
            known.join(", ")
        ))
    })
}

/// Whether a joint has one value.
fn is_scalar(joint: &DescriptionJoint) -> bool {
    matches!(
        joint.kind,
        DescriptionJointKind::Revolute | DescriptionJointKind::Prismatic
    )
}

/// These joints and all that couplings connect with them.
fn with_coupled(description: &RobotDescription, kept: &[String]) -> Vec<String> {
    let mut moving = kept.to_vec();
    loop {
        let n = moving.len();
        for coupling in &description.couplings {
            let Some(leader) = &coupling.leader else { continue };
            let ends = [&coupling.joint, leader];
            if ends.iter().any(|end| moving.contains(end)) {
                let new = ends.into_iter().filter(|end| !moving.contains(end)).cloned();
                let new: Vec<String> = new.collect();
                moving.extend(new);
            }
        }
        if moving.len() == n {
            return moving;
        }
    }
}
