//! Names of columns as words: what a column measures, of which joint, and in which unit.

use modelmill_spec::split_header_unit;

/// What a column of a recording measures, by its name or by its numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(in crate::recording) enum SignalRole {
    Time,
    Position,
    Rate,
    Acceleration,
    Force,
    /// Anything that a model does not read, such as a temperature.
    Other,
}

/// Words for a role that have no other meaning in names of columns.
const STRONG_WORDS: &[(SignalRole, &[&str])] = &[
    (
        SignalRole::Other,
        &[
            "temp",
            "temperature",
            "voltage",
            "error",
            "err",
            "status",
            "mode",
            "covariance",
            "frame",
            "episode",
            "seq",
            "task",
        ],
    ),
    (
        SignalRole::Acceleration,
        &[
            "qdd",
            "ddq",
            "dd",
            "ddot",
            "acc",
            "accel",
            "acceleration",
            "accelerations",
        ],
    ),
    (
        SignalRole::Rate,
        &[
            "qd",
            "dq",
            "qdot",
            "vel",
            "velocity",
            "velocities",
            "speed",
            "speeds",
            "rate",
            "omega",
        ],
    ),
    (
        SignalRole::Force,
        &[
            "tau", "torque", "torques", "trq", "effort", "efforts", "force", "forces", "current", "currents", "moment",
        ],
    ),
    (
        SignalRole::Position,
        &[
            "pos",
            "position",
            "positions",
            "angle",
            "angles",
            "theta",
            "phi",
            "encoder",
        ],
    ),
    (SignalRole::Time, &["time", "timestamp", "seconds", "sec"]),
];

/// Words that have a meaning only if no other word has one.
const WEAK_WORDS: &[(SignalRole, &[&str])] = &[
    (SignalRole::Time, &["t", "stamp"]),
    (SignalRole::Rate, &["v", "w", "dot", "d"]),
    (SignalRole::Force, &["e", "f", "i", "u", "m", "motor", "drive"]),
    (SignalRole::Position, &["q", "p", "x", "state"]),
];

/// Words of signals that a controller requests and a sensor does not measure.
pub(in crate::recording) const COMMAND_WORDS: [&str; 14] = [
    "des",
    "desired",
    "ref",
    "reference",
    "target",
    "cmd",
    "command",
    "commanded",
    "set",
    "setpoint",
    "goal",
    "action",
    "con",
    "control",
];

/// Words that say nothing about the joint.
const IDLE_WORDS: [&str; 14] = [
    "joint",
    "joints",
    "states",
    "state",
    "meas",
    "measured",
    "act",
    "actual",
    "data",
    "value",
    "observation",
    "raw",
    "filt",
    "filtered",
];

/// Units at the end of a name behind `_`, with the spelling of the tables of units. Those of one letter are units of
/// forces.
pub(in crate::recording) const UNIT_ENDINGS: [(&str, &str); 13] = [
    ("deg", "deg"),
    ("degree", "deg"),
    ("degrees", "deg"),
    ("rad", "rad"),
    ("rads", "rad/s"),
    ("rpm", "rpm"),
    ("nm", "N m"),
    ("n", "N"),
    ("ms", "ms"),
    ("us", "us"),
    ("ns", "ns"),
    ("mm", "mm"),
    ("a", "A"),
];

/// A name taken apart.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct NameParts {
    /// What it measures, as far as words or the unit show it.
    pub(super) role: Option<SignalRole>,
    /// Whether it is a request and no measurement.
    pub(super) is_command: bool,
    /// Words that identify the joint, in lower case.
    pub(super) words: Vec<String>,
    /// Numbers that identify the joint.
    pub(super) numbers: Vec<u64>,
    /// The unit, if the name has one.
    pub(super) unit: Option<String>,
    /// Whether the unit is part of the name with brackets, so that it is applied anyway.
    pub(super) has_header_unit: bool,
}

impl NameParts {
    /// Takes a name apart.
    pub(super) fn new(name: &str) -> Self {
        let header = split_header_unit(name);
        let mut words = split_words(header.map_or(name, |(base, _)| base));
        let mut unit = header.map(|(_, unit)| unit.to_owned());
        // A unit behind `_`, unless it is the complete name.
        if unit.is_none() && words.len() > 1 {
            let last = words.last().cloned().unwrap_or_default();
            let others = role_words(&words[..words.len() - 1]).map(|(role, _)| *role);
            // A letter may also identify the joint: `q_a` is a position.
            let is_possible = last.len() > 1 || matches!(others, None | Some(SignalRole::Force));
            let found = UNIT_ENDINGS.iter().find(|(ending, _)| *ending == last);
            if let Some((_, known)) = found.filter(|_| is_possible) {
                unit = Some((*known).to_owned());
                words.pop();
            }
        }
        let is_any = |all: &[&str], word: &String| all.contains(&word.as_str());
        let by_word = role_words(&words);
        let role = match (by_word.map(|(role, _)| *role), unit.as_deref().and_then(role_of_unit)) {
            // A unit is more precise than a word, except for what no model reads.
            (Some(SignalRole::Other), _) => Some(SignalRole::Other),
            (_, Some(by_unit)) => Some(by_unit),
            (by_word, None) => by_word,
        };
        let is_command = words.iter().any(|word| is_any(&COMMAND_WORDS, word));
        let used = |word: &String| {
            let is_role = by_word.is_some_and(|(_, all)| is_any(all, word));
            is_role || is_any(&COMMAND_WORDS, word) || is_any(&IDLE_WORDS, word)
        };
        let (numbers, words): (Vec<String>, Vec<String>) = (words.into_iter().filter(|word| !used(word)))
            .partition(|word| word.bytes().all(|byte| byte.is_ascii_digit()));
        // Numbers of columns without names are no numbers of joints.
        let is_nameless = words == ["column"];
        let numbers = numbers.iter().filter(|_| !is_nameless);
        Self {
            role,
            is_command,
            numbers: numbers.filter_map(|number| number.parse().ok()).collect(),
            words,
            has_header_unit: header.is_some(),
            unit,
        }
    }
}

/// The role that words show, with all words that show it.
fn role_words(words: &[String]) -> Option<&'static (SignalRole, &'static [&'static str])> {
    let find = |table: &'static [(SignalRole, &'static [&'static str])]| {
        let mut entries = table.iter();
        entries.find(|(_, all)| words.iter().any(|word| all.contains(&word.as_str())))
    };
    find(STRONG_WORDS).or_else(|| find(WEAK_WORDS))
}

/// The words of a name in lower case: parts between other characters, at capitals, and at numbers.
pub(in crate::recording) fn split_words(name: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    let mut before = ' ';
    for c in name.chars() {
        let is_kept = c.is_alphanumeric();
        let is_new = !before.is_alphanumeric()
            || before.is_ascii_digit() != c.is_ascii_digit()
            || (before.is_lowercase() && c.is_uppercase());
        if is_kept {
            match words.last_mut() {
                Some(word) if !is_new => word.extend(c.to_lowercase()),
                _ => words.push(c.to_lowercase().collect()),
            }
        }
        before = c;
    }
    words
}

/// What a column with a unit measures.
fn role_of_unit(unit: &str) -> Option<SignalRole> {
    let unit = unit.replace(['°'], "deg").replace('²', "^2");
    let role = match unit.as_str() {
        "s" | "ms" | "us" | "ns" | "min" | "sec" => SignalRole::Time,
        "rad" | "deg" | "mrad" | "rev" | "m" | "mm" | "cm" => SignalRole::Position,
        "rpm" | "rad/s" | "deg/s" | "rev/s" | "m/s" | "mm/s" | "cm/s" | "1/min" => SignalRole::Rate,
        "rad/s^2" | "deg/s^2" | "m/s^2" | "mm/s^2" | "rad/s2" | "deg/s2" | "m/s2" => SignalRole::Acceleration,
        "N" | "kN" | "mN" | "N m" | "Nm" | "N*m" | "N·m" | "Nmm" | "mNm" | "kNm" | "Ncm" | "A" | "mA" => {
            SignalRole::Force
        }
        "V" | "mV" | "W" | "C" | "K" | "%" => SignalRole::Other,
        _ => return None,
    };
    Some(role)
}

/// How well two names mean the same joint, from 0 to 1. `shift` is added to the numbers of `ours`.
pub(super) fn joint_similarity(ours: &NameParts, theirs: &NameParts, shift: i64) -> f64 {
    // Numbers must agree: joint 1 is never joint 2.
    if let (Some(a), Some(b)) = (ours.numbers.last(), theirs.numbers.last())
        && a.checked_add_signed(shift) != Some(*b)
    {
        return 0.0;
    }
    let common = ours.words.iter().filter(|word| theirs.words.contains(word)).count();
    let numbers = usize::from(!ours.numbers.is_empty() && !theirs.numbers.is_empty());
    let sizes = |parts: &NameParts| parts.words.len() + usize::from(!parts.numbers.is_empty());
    match sizes(ours) + sizes(theirs) {
        0 => 1.0,
        all => 2.0 * (common + numbers) as f64 / all as f64,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_show_what_is_measured() {
        for (name, role, is_command, unit) in [
            ("joint_states.position.elbow_joint", SignalRole::Position, false, None),
            ("joint_states.effort.elbow_joint", SignalRole::Force, false, None),
            ("tau_meas2", SignalRole::Force, false, None),
            ("pos_des1 [deg]", SignalRole::Position, true, Some("deg")),
            ("v_arm1", SignalRole::Rate, false, None),
            ("e_torso", SignalRole::Force, false, None),
            ("JointVelocity3", SignalRole::Rate, false, None),
            ("torque (Nm)", SignalRole::Force, false, Some("Nm")),
            ("time_ms", SignalRole::Time, false, Some("ms")),
            ("q3_deg", SignalRole::Position, false, Some("deg")),
            ("motor_temperature1", SignalRole::Other, false, None),
            ("tau2_n", SignalRole::Force, false, Some("N")),
            ("current2_a", SignalRole::Force, false, Some("A")),
            // Joints called a and n.
            ("q_a", SignalRole::Position, false, None),
            ("pos_n", SignalRole::Position, false, None),
            ("vel_a", SignalRole::Rate, false, None),
        ] {
            let parts = NameParts::new(name);
            assert_eq!(
                (parts.role, parts.is_command, parts.unit.as_deref()),
                (Some(role), is_command, unit),
                "{name}"
            );
        }
        assert_eq!(NameParts::new("arm1").role, None);
        assert_eq!(NameParts::new("q_a").words, ["a"]);
    }

    #[test]
    fn names_of_one_joint_are_similar() {
        let similarity = |a: &str, b: &str| joint_similarity(&NameParts::new(a), &NameParts::new(b), 0);
        assert!(similarity("arm_1_joint", "e_arm1") > 0.99);
        assert!(similarity("torso_lift_joint", "e_torso") > similarity("torso_lift_joint", "e_arm1"));
        assert!(similarity("q1", "pos_meas1") > 0.99);
        assert!(similarity("q1", "pos_meas2") < 0.01);
        assert!(
            similarity("shoulder_pan_joint", "effort.shoulder_pan_joint")
                > similarity("shoulder_pan_joint", "effort.shoulder_lift_joint")
        );
        assert!(similarity("q", "position") > 0.99);
    }
}
