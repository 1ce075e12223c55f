//! Locks joints at a value, so that they are no coordinates: those of the option `locked`, or all that `kept` does not
//! name. A description goes in; couplings that fix the joints come out.

use super::ImportError;
use super::description::{DescriptionCoupling, DescriptionJoint, DescriptionJointKind, RobotDescription};
use super::thresholds::COUPLED_VALUES;

/// Locks the joints of `locked` at their values, and, with `kept`, all joints that neither are listed there nor are
/// coupled with one that is listed. Those stay at the pose of the description. Joints that are coupled with a locked one
/// are locked with it, leaders as well as followers.
///
/// Fails for a joint that does not exist, is locked twice or against its coupling, or is neither revolute nor prismatic.
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
    let mut fixed = with_followers(description, values)?;
    if let Some(kept) = kept {
        for name in kept {
            find_joint(description, name)?;
            if fixed.iter().any(|(other, _)| other == name) {
                return Err(ImportError(format!(
                    "the joint `{name}` cannot move, because it is coupled with a locked one; leave out one of both"
                )));
            }
        }
        fix_others(description, kept, &mut fixed)?;
    }
    for (name, value) in fixed {
        let line = find_joint(description, &name)?.line;
        // Nothing else determines a locked joint. Those that are coupled with it have their values in the same list.
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

/// Adds all joints that neither are listed in `kept`, nor are coupled with one that is, to those that are fixed: at the
/// pose of the description. Remarks joints that have more than one value, because they stay as they are.
fn fix_others(
    description: &mut RobotDescription,
    kept: &[String],
    fixed: &mut Vec<(String, f64)>,
) -> Result<(), ImportError> {
    let moving = with_coupled(description, kept);
    let joints = || description.links.iter().flat_map(|link| &link.joints);
    let has_pose = |name: &str| description.pose.iter().any(|(known, _)| known == name);
    let follows = |name: &str| description.couplings.iter().any(|coupling| coupling.joint == name);
    let mut others: Vec<&DescriptionJoint> = joints()
        .filter(|joint| is_scalar(joint) && !moving.contains(&joint.name))
        .collect();
    // Of coupled joints one has the value of the pose: the one with a stated value, else the leader.
    others.sort_by_key(|joint| (!has_pose(&joint.name), follows(&joint.name)));
    for joint in others {
        let is_fixed = |coupling: &DescriptionCoupling| coupling.joint == joint.name && !is_edge(coupling);
        if fixed.iter().any(|(name, _)| *name == joint.name) || description.couplings.iter().any(is_fixed) {
            continue;
        }
        let pose = description.pose.iter().find(|(name, _)| *name == joint.name);
        let value = pose.map_or(joint.zero, |(_, value)| *value);
        fixed.extend(with_followers(description, vec![(joint.name.clone(), value)])?);
    }
    let remarks: Vec<String> = joints()
        .filter(|joint| !is_scalar(joint) && !moving.contains(&joint.name))
        .map(|joint| {
            let kind = match joint.kind {
                DescriptionJointKind::Free => "free joint",
                _ => "ball joint",
            };
            format!(
                "line {}: the {kind} `{}` moves too, because only revolute and prismatic joints can be fixed; remove it from \
                 the description if its link does not move",
                joint.line, joint.name
            )
        })
        .collect();
    description.remarks.extend(remarks);
    Ok(())
}

/// Whether a coupling relates two joints; without a leader or with a ratio of zero it fixes its joint.
fn is_edge(coupling: &DescriptionCoupling) -> bool {
    coupling.leader.is_some() && coupling.ratio != 0.0
}

/// Values of joints, with the values of all that are coupled with them: of followers, and of leaders by the inverse of
/// the coupling.
///
/// Fails if the values contradict a coupling.
fn with_followers(
    description: &RobotDescription,
    mut values: Vec<(String, f64)>,
) -> Result<Vec<(String, f64)>, ImportError> {
    let find =
        |values: &[(String, f64)], name: &str| values.iter().find(|(known, _)| known == name).map(|found| found.1);
    let edges: Vec<(&DescriptionCoupling, &String)> = description
        .couplings
        .iter()
        .filter(|coupling| is_edge(coupling))
        .filter_map(|coupling| Some((coupling, coupling.leader.as_ref()?)))
        .collect();
    loop {
        let n = values.len();
        for (coupling, leader) in &edges {
            match (find(&values, &coupling.joint), find(&values, leader)) {
                (None, Some(of)) => values.push((coupling.joint.clone(), coupling.ratio * of + coupling.offset)),
                (Some(own), None) => values.push(((*leader).clone(), (own - coupling.offset) / coupling.ratio)),
                _ => {}
            }
        }
        if values.len() == n {
            break;
        }
    }
    for (coupling, leader) in &edges {
        let (Some(own), Some(of)) = (find(&values, &coupling.joint), find(&values, leader)) else {
            continue;
        };
        let expected = coupling.ratio * of + coupling.offset;
        // Written so that values that are not finite are refused.
        let agrees = (own - expected).abs() <= COUPLED_VALUES * (1.0 + expected.abs());
        if !agrees {
            return Err(ImportError(format!(
                "line {}: `{}` follows `{leader}`; with `{leader}` at {of} it is at {expected} and not at {own}; lock one of \
                 them only",
                coupling.line, coupling.joint
            )));
        }
    }
    Ok(values)
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
