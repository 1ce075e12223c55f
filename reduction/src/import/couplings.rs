//! Joints that follow others: each joint as `ratio*variable + offset`, where a variable becomes a coordinate of the model.
//!
//! A joint whose angle is a whole multiple of another's shares its coordinate; any other one has a coordinate that follows.

use super::description::{Description, Joint, Kind};
use crate::write::float;

/// Integer multiples of a coordinate beyond this make expressions that nobody wants.
const LARGEST_MULTIPLE: i64 = 60;
/// A ratio this near to a fraction is the fraction, printed with so many digits.
const SAME_RATIO: f64 = 1e-9;

/// What becomes a coordinate.
#[derive(Clone)]
pub(crate) struct Variable {
    /// The joint that it is.
    pub(crate) joint: String,
    pub(crate) is_driven: bool,
}

/// A joint as its variable moves it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Follows {
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
pub(crate) struct Couplings {
    pub(crate) variables: Vec<Variable>,
    pub(crate) follows: Vec<(String, Follows)>,
}

impl Couplings {
    pub(crate) fn of(&self, joint: &str) -> Option<Follows> {
        let found = self.follows.iter().find(|(name, _)| name == joint);
        found.map(|(_, follows)| *follows)
    }
}

/// `q = ratio*q[of] + offset`; none is held.
#[derive(Clone, Copy)]
struct Rule {
    of: Option<usize>,
    ratio: f64,
    offset: f64,
    line: u32,
}

/// Resolves all couplings of a description.
pub(crate) fn resolve(description: &mut Description) -> Result<Couplings, String> {
    let joints: Vec<Joint> = description
        .links
        .iter()
        .flat_map(|link| &link.joints)
        .filter(|joint| matches!(joint.kind, Kind::Turn | Kind::Slide))
        .cloned()
        .collect();
    let mut rules = rules(description, &joints)?;
    lead_by_driven(&joints, &mut rules);
    let mut variables = Vec::new();
    let mut variable_of: Vec<Option<usize>> = vec![None; joints.len()];
    for (leader, joint) in joints.iter().enumerate() {
        if rules[leader].is_some() {
            continue;
        }
        let mut followers = joints.iter().zip(&rules);
        let leads_driven = followers.any(|(other, rule)| {
            other.is_driven && rule.is_some_and(|rule| rule.of == Some(leader))
        });
        variable_of[leader] = Some(variables.len());
        variables.push(Variable {
            joint: joint.name.clone(),
            is_driven: joint.is_driven || leads_driven,
        });
    }
    let mut follows = Vec::new();
    for (k, joint) in joints.iter().enumerate() {
        let found = match rules[k] {
            None => Follows {
                variable: variable_of[k],
                ratio: 1.0,
                offset: 0.0,
                has_own: false,
                changes_kind: false,
            },
            Some(rule) => {
                let leader = rule.of.filter(|_| rule.ratio != 0.0);
                let ratio = fraction(rule.ratio).map_or(rule.ratio, |(p, q)| p as f64 / q as f64);
                if leader.is_some() && (ratio - rule.ratio).abs() > 1e-14 {
                    description.remarks.push(format!(
                        "line {}: the ratio {} is taken for {}",
                        rule.line,
                        rule.ratio,
                        shown(ratio)
                    ));
                }
                let shares = |of: usize| match (joint.kind, joints[of].kind) {
                    (Kind::Turn, Kind::Turn) => fraction(ratio).is_some_and(|(_, q)| q == 1),
                    (one, other) => one == other,
                };
                Follows {
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
    Ok(Couplings { variables, follows })
}

/// Every joint by the joint that leads in the end.
fn rules(description: &Description, joints: &[Joint]) -> Result<Vec<Option<Rule>>, String> {
    let index = |name: &str, line: u32| {
        joints
            .iter()
            .position(|joint| joint.name == name)
            .ok_or_else(|| {
                format!("line {line}: the coupling names `{name}`, which is no joint that turns or slides")
            })
    };
    let mut rules: Vec<Option<Rule>> = vec![None; joints.len()];
    for coupling in &description.couplings {
        let line = coupling.line;
        let one = index(&coupling.joint, line)?;
        let of = coupling
            .of
            .as_deref()
            .map(|of| index(of, line))
            .transpose()?;
        if of == Some(one) {
            return Err(format!("line {line}: `{}` follows itself", coupling.joint));
        }
        let rule = Rule {
            of,
            ratio: coupling.ratio,
            offset: coupling.offset,
            line,
        };
        if rules[one].is_none() {
            rules[one] = Some(rule);
        } else if let Some(other) = of.filter(|of| rules[*of].is_none() && rule.ratio != 0.0) {
            rules[other] = Some(Rule {
                of: Some(one),
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
            && let Some(of) = rule.of
            && let Some(next) = rules[of]
        {
            steps += 1;
            if steps > joints.len() {
                return Err(format!(
                    "line {}: `{}` follows itself by way of others",
                    rule.line, joints[k].name
                ));
            }
            rules[k] = Some(Rule {
                of: next.of,
                ratio: rule.ratio * next.ratio,
                offset: rule.ratio * next.offset + rule.offset,
                line: rule.line,
            });
        }
    }
    Ok(rules)
}

/// Lets a driven joint lead where the one that leads is not.
fn lead_by_driven(joints: &[Joint], rules: &mut [Option<Rule>]) {
    for old in 0..joints.len() {
        if rules[old].is_some() || joints[old].is_driven {
            continue;
        }
        let found = (0..joints.len()).find_map(|k| {
            let rule = rules[k].filter(|rule| rule.of == Some(old) && rule.ratio != 0.0)?;
            joints[k].is_driven.then_some((k, rule))
        });
        let Some((new, lead)) = found else { continue };
        for (k, slot) in rules.iter_mut().enumerate() {
            if let Some(rule) = slot
                .as_mut()
                .filter(|rule| rule.of == Some(old) && k != new)
            {
                rule.ratio /= lead.ratio;
                rule.offset -= rule.ratio * lead.offset;
                rule.of = Some(new);
            }
        }
        rules[old] = Some(Rule {
            of: Some(new),
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
pub(crate) fn shown(ratio: f64) -> String {
    match fraction(ratio) {
        Some((p, 1)) => p.to_string(),
        Some((p, q)) => format!("{p}/{q}"),
        None => float(ratio),
    }
}
