//! Resolves couplings between joints. Couplings of the description go in; each joint comes out as `ratio*variable +
//! offset`, and each variable becomes a coordinate of the model.
//!
//! A joint whose angle is an integer multiple of another's shares its coordinate. Any other follower gets a coordinate
//! with `follows`.

use super::description::{DescriptionJoint, DescriptionJointKind, RobotDescription};
use crate::write::toml_float;

/// Largest numerator and denominator of a ratio that is written as a fraction.
const LARGEST_MULTIPLE: i64 = 60;
/// A ratio this close to a fraction is the fraction, printed with a limited number of digits.
const SAME_RATIO: f64 = 1e-9;

/// A variable: it becomes a coordinate of the model.
#[derive(Clone)]
pub(crate) struct JointVariable {
    /// Name of the joint whose value it is.
    pub(crate) joint: String,
    /// Whether a drive acts on this joint or on one that follows it.
    pub(crate) is_driven: bool,
}

/// The value of a joint as a function of a variable: `ratio*variable + offset`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct JointFollower {
    /// Index of the variable; none if the joint is fixed at `offset`.
    pub(crate) variable: Option<usize>,
    /// Factor of the variable.
    pub(crate) ratio: f64,
    /// Constant part, rad or m.
    pub(crate) offset: f64,
    /// Whether it has a separate coordinate, which follows that of the variable.
    pub(crate) has_own: bool,
    /// Whether one joint is revolute and the other prismatic.
    pub(crate) changes_kind: bool,
}

/// All revolute and prismatic joints with their variables, in the order of the description.
pub(crate) struct ImportCouplings {
    /// The variables.
    pub(crate) variables: Vec<JointVariable>,
    /// Name of each joint, and how it follows its variable.
    pub(crate) follows: Vec<(String, JointFollower)>,
}

impl ImportCouplings {
    /// How a joint follows its variable; none if there is no such joint.
    pub(crate) fn find_follower(&self, joint: &str) -> Option<JointFollower> {
        let found = self.follows.iter().find(|(name, _)| name == joint);
        found.map(|(_, follows)| *follows)
    }
}

/// A rule `q = ratio*q[leader] + offset`.
#[derive(Clone, Copy)]
struct CouplingRule {
    /// Index of the joint that is followed; none fixes the joint at `offset`.
    leader: Option<usize>,
    /// Factor of the leader's value.
    ratio: f64,
    /// Constant part, rad or m.
    offset: f64,
    /// Line of the coupling in the description.
    line: u32,
}

/// Resolves all couplings of a description. Adds a remark for each ratio that is rounded to a fraction.
pub(crate) fn resolve(description: &mut RobotDescription) -> Result<ImportCouplings, String> {
    // Joints with one coordinate; ball joints and free joints cannot be coupled.
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
    // Rules with leaders that are independent, and driven if possible.
    let mut rules = coupling_rules(description, &joints)?;
    prefer_driven_leaders(&joints, &mut rules);
    // Each joint without a rule is a variable.
    let mut variables = Vec::new();
    let mut variable_of: Vec<Option<usize>> = vec![None; joints.len()];
    for (leader, joint) in joints.iter().enumerate() {
        if rules[leader].is_some() {
            continue;
        }
        let mut followers = joints.iter().zip(&rules);
        // A drive at a follower moves the variable too.
        let leads_driven =
            followers.any(|(other, rule)| other.is_driven && rule.is_some_and(|rule| rule.leader == Some(leader)));
        variable_of[leader] = Some(variables.len());
        variables.push(JointVariable {
            joint: joint.name.clone(),
            is_driven: joint.is_driven || leads_driven,
        });
    }
    // How each joint follows its variable.
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
                // With a ratio of zero the joint is fixed.
                let leader = rule.leader.filter(|_| rule.ratio != 0.0);
                let ratio = fraction(rule.ratio).map_or(rule.ratio, |(p, q)| p as f64 / q as f64);
                if leader.is_some() && (ratio - rule.ratio).abs() > 1e-14 {
                    description.remarks.push(format!(
                        "line {}: the ratio {} is rounded to {}",
                        rule.line,
                        rule.ratio,
                        ratio_text(ratio)
                    ));
                }
                // Only an integer multiple of an angle keeps sines and cosines polynomial in those of the leader.
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

/// The rule of each joint, by the last leader of its chain of couplings; none for joints that follow no other.
///
/// Fails if a joint follows itself or two joints.
fn coupling_rules(
    description: &RobotDescription,
    joints: &[DescriptionJoint],
) -> Result<Vec<Option<CouplingRule>>, String> {
    // Index of a joint by its name.
    let index = |name: &str, line: u32| {
        joints.iter().position(|joint| joint.name == name).ok_or_else(|| {
            let mut all = description.links.iter().flat_map(|link| &link.joints);
            let what = if all.any(|joint| joint.name == name) {
                "which is not a revolute or prismatic joint"
            } else {
                "but there is no joint of this name"
            };
            format!("line {line}: the coupling names `{name}`, {what}")
        })
    };
    let mut rules: Vec<Option<CouplingRule>> = vec![None; joints.len()];
    for coupling in &description.couplings {
        let line = coupling.line;
        // The joint and the one that it follows.
        let one = index(&coupling.joint, line)?;
        let of = coupling.leader.as_deref().map(|of| index(of, line)).transpose()?;
        if of == Some(one) {
            return Err(format!("line {line}: `{}` follows itself", coupling.joint));
        }
        let rule = CouplingRule {
            leader: of,
            ratio: coupling.ratio,
            offset: coupling.offset,
            line,
        };
        // A second coupling of a joint is inverted, if the other joint is still free to follow.
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
            return Err(format!("line {line}: `{}` follows two joints", coupling.joint));
        }
    }
    // Replace leaders that are followers themselves, until the leader is independent.
    for k in 0..joints.len() {
        let mut steps = 0;
        while let Some(rule) = rules[k]
            && let Some(of) = rule.leader
            && let Some(next) = rules[of]
        {
            // A chain longer than the number of joints is a cycle.
            steps += 1;
            if steps > joints.len() {
                return Err(format!(
                    "line {}: `{}` follows itself through other joints",
                    rule.line, joints[k].name
                ));
            }
            // Insert the rule of the leader into that of the follower.
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

/// Makes a driven follower the leader if the present leader is not driven, and rewrites the rules of the other
/// followers.
fn prefer_driven_leaders(joints: &[DescriptionJoint], rules: &mut [Option<CouplingRule>]) {
    for old in 0..joints.len() {
        if rules[old].is_some() || joints[old].is_driven {
            continue;
        }
        // The first driven follower of this leader.
        let found = (0..joints.len()).find_map(|k| {
            let rule = rules[k].filter(|rule| rule.leader == Some(old) && rule.ratio != 0.0)?;
            joints[k].is_driven.then_some((k, rule))
        });
        let Some((new, lead)) = found else { continue };
        for (k, slot) in rules.iter_mut().enumerate() {
            if let Some(rule) = slot.as_mut().filter(|rule| rule.leader == Some(old) && k != new) {
                // The old leader as a function of the new one, inserted into the rule.
                rule.ratio /= lead.ratio;
                rule.offset -= rule.ratio * lead.offset;
                rule.leader = Some(new);
            }
        }
        // The inverse of the rule of the new leader.
        rules[old] = Some(CouplingRule {
            leader: Some(new),
            ratio: 1.0 / lead.ratio,
            offset: -lead.offset / lead.ratio,
            line: lead.line,
        });
        rules[new] = None;
    }
}

/// Numerator and denominator if a ratio is a fraction of small integers.
fn fraction(ratio: f64) -> Option<(i64, i64)> {
    (1..=LARGEST_MULTIPLE).find_map(|q| {
        // The nearest numerator for each denominator, the smallest denominator first.
        let p = (ratio * q as f64).round();
        let is_same = (ratio - p / q as f64).abs() < SAME_RATIO;
        #[allow(clippy::cast_possible_truncation, reason = "small")]
        (is_same && p.abs() <= LARGEST_MULTIPLE as f64).then_some((p as i64, q))
    })
}

/// A ratio in the notation of a model file: integer, fraction or decimal.
pub(crate) fn ratio_text(ratio: f64) -> String {
    match fraction(ratio) {
        Some((p, 1)) => p.to_string(),
        Some((p, q)) => format!("{p}/{q}"),
        None => toml_float(ratio),
    }
}
