//! Joints that follow others: each joint as `ratio*variable + offset`, where a variable becomes a coordinate of the model.
//!
//! A joint whose angle is a whole multiple of another's shares its coordinate; any other one has a coordinate that follows.

use super::description::{DescriptionJoint, DescriptionJointKind, RobotDescription};
use crate::write::toml_float;

/// Integer multiples of a coordinate beyond this make expressions that nobody wants.
const LARGEST_MULTIPLE: i64 = 60;
/// A ratio this near to a fraction is the fraction, printed with so many digits.
const SAME_RATIO: f64 = 1e-9;

/// What becomes a coordinate.
#[derive(Clone)]
pub(crate) struct JointVariable {
    /// The joint that it is.
    pub(crate) joint: String,
    pub(crate) is_driven: bool,
}

/// A joint as its variable moves it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct JointFollower {
    /// None where it is held.
    pub(crate) variable: Option<usize>,
    pub(crate) ratio: f64,
    pub(crate) offset: f64,
    /// Whether it has a coordinate of its own, which follows that of the variable.
    pub(crate) has_own: bool,
    /// Whether one of both turns and the other slides.
    pub(crate) changes_kind: bool,
}

/// Joints that turn or slide, and what they follow, in the order of the description.
pub(crate) struct ImportCouplings {
    pub(crate) variables: Vec<JointVariable>,
    pub(crate) follows: Vec<(String, JointFollower)>,
}

impl ImportCouplings {
    pub(crate) fn find_follower(&self, joint: &str) -> Option<JointFollower> {
        let found = self.follows.iter().find(|(name, _)| name == joint);
        found.map(|(_, follows)| *follows)
    }
}

/// `q = ratio*q[of] + offset`; none is held.
#[derive(Clone, Copy)]
struct CouplingRule {
    leader: Option<usize>,
    ratio: f64,
    offset: f64,
    line: u32,
}

/// Resolves all couplings of a description.
pub(crate) fn resolve(description: &mut RobotDescription) -> Result<ImportCouplings, String> {
    let joints: Vec<DescriptionJoint> = description
        .links
        .iter()
        .flat_map(|link| &link.joints)
        .filter(|joint| {
            matches!(
                joint.kind,
                DescriptionJointKind::Revolute | DescriptionJointKind::Prismatic
            )
        })
        .cloned()
        .collect();
    let mut rules = coupling_rules(description, &joints)?;
    prefer_driven_leaders(&joints, &mut rules);
    let mut variables = Vec::new();
    let mut variable_of: Vec<Option<usize>> = vec![None; joints.len()];
    for (leader, joint) in joints.iter().enumerate() {
        if rules[leader].is_some() {
            continue;
        }
        let mut followers = joints.iter().zip(&rules);
        let leads_driven = followers.any(|(other, rule)| {
            other.is_driven && rule.is_some_and(|rule| rule.leader == Some(leader))
        });
        variable_of[leader] = Some(variables.len());
        variables.push(JointVariable {
            joint: joint.name.clone(),
            is_driven: joint.is_driven || leads_driven,
        });
    }
    let mut follows = Vec::new();
    for (k, joint) in joints.iter().enumerate() {
        let found = match rules[k] {
            None => JointFollower {
                variable: variable_of[k],
                ratio: 1.0,
                offset: 0.0,
                has_own: false,
                changes_kind: false,
            },
            Some(rule) => {
                let leader = rule.leader.filter(|_| rule.ratio != 0.0);
                let ratio = fraction(rule.ratio).map_or(rule.ratio, |(p, q)| p as f64 / q as f64);
                if leader.is_some() && (ratio - rule.ratio).abs() > 1e-14 {
                    description.remarks.push(format!(
                        "line {}: the ratio {} is taken for {}",
                        rule.line,
                        rule.ratio,
                        ratio_text(ratio)
                    ));
                }
                let shares = |of: usize| match (joint.kind, joints[of].kind) {
                    (DescriptionJointKind::Revolute, DescriptionJointKind::Revolute) => {
                        fraction(ratio).is_some_and(|(_, q)| q == 1)
                    }
                    (one, other) => one == other,
                };
                JointFollower {
                    variable: leader.and_then(|of| variable_of[of]),
                    ratio: leader.map_or(0.0, |_| ratio),
                    offset: rule.offset,
                    has_own: leader.is_some_and(|of| !shares(of)),
                    changes_kind: leader.is_some_and(|of| joint.kind != joints[of].kind),
                }
            }
        };
        follows.push((joint.name.clone(), found));
    }
    Ok(ImportCouplings { variables, follows })
}

/// Every joint by the joint that leads in the end.
fn coupling_rules(
    description: &RobotDescription,
    joints: &[DescriptionJoint],
) -> Result<Vec<Option<CouplingRule>>, String> {
    let index = |name: &str, line: u32| {
        joints
            .iter()
            .position(|joint| joint.name == name)
            .ok_or_else(|| {
                format!("line {line}: the coupling names `{name}`, which is no joint that turns or slides")
            })
    };
    let mut rules: Vec<Option<CouplingRule>> = vec![None; joints.len()];
    for coupling in &description.couplings {
        let line = coupling.line;
        let one = index(&coupling.joint, line)?;
        let of = coupling
            .leader
            .as_deref()
            .map(|of| index(of, line))
            .transpose()?;
        if of == Some(one) {
            return Err(format!("line {line}: `{}` follows itself", coupling.joint));
        }
        let rule = CouplingRule {
            leader: of,
            ratio: coupling.ratio,
            offset: coupling.offset,
            line,
        };
        if rules[one].is_none() {
            rules[one] = Some(rule);
        } else if let Some(other) = of.filter(|of| rules[*of].is_none() && rule.ratio != 0.0) {
            rules[other] = Some(CouplingRule {
                leader: Some(one),
                ratio: 1.0 / rule.ratio,
                offset: -rule.offset / rule.ratio,
                line,
            });
        } else {
            return Err(format!(
                "line {line}: `{}` follows two joints",
                coupling.joint
            ));
        }
    }
    for k in 0..joints.len() {
        let mut steps = 0;
        while let Some(rule) = rules[k]
            && let Some(of) = rule.leader
            && let Some(next) = rules[of]
        {
            steps += 1;
            if steps > joints.len() {
                return Err(format!(
                    "line {}: `{}` follows itself by way of others",
                    rule.line, joints[k].name
                ));
            }
            rules[k] = Some(CouplingRule {
                leader: next.leader,
                ratio: rule.ratio * next.ratio,
                offset: rule.ratio * next.offset + rule.offset,
                line: rule.line,
            });
        }
    }
    Ok(rules)
}

/// Lets a driven joint lead where the one that leads is not.
fn prefer_driven_leaders(joints: &[DescriptionJoint], rules: &mut [Option<CouplingRule>]) {
    for old in 0..joints.len() {
        if rules[old].is_some() || joints[old].is_driven {
            continue;
        }
        let found = (0..joints.len()).find_map(|k| {
            let rule = rules[k].filter(|rule| rule.leader == Some(old) && rule.ratio != 0.0)?;
            joints[k].is_driven.then_some((k, rule))
        });
        let Some((new, lead)) = found else { continue };
        for (k, slot) in rules.iter_mut().enumerate() {
            if let Some(rule) = slot
                .as_mut()
                .filter(|rule| rule.leader == Some(old) && k != new)
            {
                rule.ratio /= lead.ratio;
                rule.offset -= rule.ratio * lead.offset;
                rule.leader = Some(new);
            }
        }
        rules[old] = Some(CouplingRule {
            leader: Some(new),
            ratio: 1.0 / lead.ratio,
            offset: -lead.offset / lead.ratio,
            line: lead.line,
        });
        rules[new] = None;
    }
}

/// Numerator and denominator of a ratio of small whole numbers.
fn fraction(ratio: f64) -> Option<(i64, i64)> {
    (1..=LARGEST_MULTIPLE).find_map(|q| {
        let p = (ratio * q as f64).round();
        let is_same = (ratio - p / q as f64).abs() < SAME_RATIO;
        #[allow(clippy::cast_possible_truncation, reason = "small")]
        (is_same && p.abs() <= LARGEST_MULTIPLE as f64).then_some((p as i64, q))
    })
}

/// A ratio as a model file has it.
pub(crate) fn ratio_text(ratio: f64) -> String {
    match fraction(ratio) {
        Some((p, 1)) => p.to_string(),
        Some((p, q)) => format!("{p}/{q}"),
        None => toml_float(ratio),
    }
}
