//! Joints that follow others: each joint as `ratio*variable + offset`, where a variable becomes a coordinate of the model.
//!
//! Angles of a model are integer multiples of coordinates. A ratio such as 6/7 is therefore exact with a coordinate that is
//! a seventh of the leading joint.

use super::description::{Description, Joint, Kind};

/// Integer multiples of a coordinate beyond this make expressions that nobody wants.
const LARGEST_MULTIPLE: i64 = 60;
/// A ratio this near to a fraction is the fraction, printed with so many digits.
const SAME_RATIO: f64 = 1e-9;

/// What becomes a coordinate.
#[derive(Clone)]
pub(crate) struct Variable {
    /// The joint that it is, or a whole part of.
    pub(crate) joint: String,
    /// The joint is this many times the variable.
    pub(crate) parts: i64,
    pub(crate) is_driven: bool,
}

/// A joint as its variable moves it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Follows {
    /// None where it is held.
    pub(crate) variable: Option<usize>,
    pub(crate) ratio: f64,
    pub(crate) offset: f64,
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
#[allow(
    clippy::too_many_lines,
    reason = "one pass over leaders, one over followers"
)]
pub(crate) fn resolve(description: &mut Description) -> Result<Couplings, String> {
    let joints: Vec<Joint> = description
        .links
        .iter()
        .flat_map(|link| &link.joints)
        .filter(|joint| matches!(joint.kind, Kind::Turn | Kind::Slide))
        .cloned()
        .collect();
    let n = joints.len();
    let mut rules = rules(description, &joints)?;
    lead_by_driven(&joints, &mut rules);
    let mut out = Couplings {
        variables: Vec::new(),
        follows: Vec::new(),
    };
    let mut variable_of: Vec<Option<usize>> = vec![None; n];
    for leader in 0..n {
        if rules[leader].is_some() {
            continue;
        }
        let members: Vec<(usize, Rule)> = (0..n)
            .filter_map(|k| {
                rules[k]
                    .filter(|rule| rule.of == Some(leader))
                    .map(|rule| (k, rule))
            })
            .collect();
        let mut parts = 1;
        for (k, rule) in &members {
            if rule.ratio == 0.0 {
                continue;
            }
            let (one, other) = (&joints[*k], &joints[leader]);
            if one.kind != other.kind {
                return Err(format!(
                    "line {}: `{}` follows `{}`, one turns and one slides; models have no screws yet: leave the coupling \
                     away and give both a drive",
                    rule.line, one.name, other.name
                ));
            }
            if one.kind == Kind::Turn {
                let (_, denominator) =
                    fraction(rule.ratio).ok_or_else(|| no_fraction(*rule, one))?;
                parts = least_common(parts, denominator);
            }
        }
        variable_of[leader] = Some(out.variables.len());
        out.variables.push(Variable {
            joint: joints[leader].name.clone(),
            parts,
            is_driven: joints[leader].is_driven
                || members.iter().any(|(k, _)| joints[*k].is_driven),
        });
        for (k, rule) in members {
            let joint = &joints[k];
            if parts > 1 || joint.kind == Kind::Turn {
                let exact = fraction(rule.ratio).map(|(p, q)| p * (parts / q));
                let exact = exact.filter(|n| n.abs() <= LARGEST_MULTIPLE);
                let multiple = exact.ok_or_else(|| no_fraction(rule, joint))?;
                #[allow(clippy::cast_precision_loss, reason = "at most 60")]
                let ratio = multiple as f64 / parts as f64;
                if (ratio - rule.ratio).abs() > 1e-14 {
                    description.remarks.push(format!(
                        "line {}: the ratio {} is taken for {}; angles of models have rational ratios",
                        rule.line,
                        rule.ratio,
                        shown(rule.ratio)
                    ));
                }
                if let Some(Some(rule)) = rules.get_mut(k) {
                    rule.ratio = ratio;
                }
            }
        }
    }
    for (k, joint) in joints.iter().enumerate() {
        let follows = match rules[k] {
            None => Follows {
                variable: variable_of[k],
                ratio: variable_of[k].map_or(1.0, |v| parts_of(&out, v)),
                offset: 0.0,
            },
            Some(rule) => {
                let variable = rule
                    .of
                    .and_then(|of| variable_of[of])
                    .filter(|_| rule.ratio != 0.0);
                Follows {
                    variable,
                    // Whole numbers again, free of the rounding of the quotient.
                    ratio: variable.map_or(0.0, |v| {
                        let ratio = rule.ratio * parts_of(&out, v);
                        if joint.kind == Kind::Turn {
                            ratio.round()
                        } else {
                            ratio
                        }
                    }),
                    offset: rule.offset,
                }
            }
        };
        out.follows.push((joint.name.clone(), follows));
    }
    Ok(out)
}

fn parts_of(couplings: &Couplings, variable: usize) -> f64 {
    couplings.variables[variable].parts as f64
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

fn no_fraction(rule: Rule, joint: &Joint) -> String {
    format!(
        "line {}: the ratio {} of `{}` is no fraction of small whole numbers; angles of models are whole multiples of \
         coordinates: leave the coupling away and give both joints a drive",
        rule.line, rule.ratio, joint.name
    )
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

fn shown(ratio: f64) -> String {
    match fraction(ratio) {
        Some((p, 1)) => p.to_string(),
        Some((p, q)) => format!("{p}/{q}"),
        None => ratio.to_string(),
    }
}

fn least_common(a: i64, b: i64) -> i64 {
    let (mut x, mut y) = (a, b);
    while y != 0 {
        (x, y) = (y, x % y);
    }
    a / x * b
}
