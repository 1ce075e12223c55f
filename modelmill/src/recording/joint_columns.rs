//! Columns that name joints, such as `joint_states.position.elbow`, `elbow.effort` or `q_elbow`: the names of a file go
//! in, and for a name of the model the column that certainly measures it comes out.
//!
//! Decision: only names are compared, and all words must agree. What is likely but not certain is left to the proposal
//! of columns, because a wrong column without a message is worse than a missing one.

use modelmill_spec::{ColumnQuantity, DriveKind, Mechanism, split_header_unit, unit_factor};

use super::proposal::words::{COMMAND_WORDS, SignalRole, UNIT_ENDINGS, split_words};

/// Words for what a column measures. Currents are not among them, because they are no forces of the joint.
const ROLE_WORDS: &[(SignalRole, &[&str])] = &[
    (SignalRole::Position, &["position", "positions", "pos", "q", "angle"]),
    (
        SignalRole::Rate,
        &["velocity", "velocities", "vel", "qd", "dq", "qdot", "speed"],
    ),
    (
        SignalRole::Acceleration,
        &["acceleration", "accelerations", "acc", "qdd", "ddq", "qddot"],
    ),
    (
        SignalRole::Force,
        &["effort", "efforts", "torque", "torques", "tau", "force", "forces"],
    ),
    (SignalRole::Time, &["time"]),
];

/// Words that do not identify a joint.
const IDLE_WORDS: [&str; 6] = ["joint", "joints", "measured", "meas", "actual", "act"];

/// Words that state a measurement.
const MEASURED_WORDS: [&str; 4] = ["measured", "meas", "actual", "act"];

/// Words of signals that are no measurements at the joint, in addition to those of commands.
const FOREIGN_WORDS: [&str; 18] = [
    "trajectory",
    "points",
    "path",
    "plan",
    "planned",
    "waypoints",
    "error",
    "err",
    "output",
    "motor",
    "raw",
    "offset",
    "limit",
    "max",
    "min",
    "external",
    "ext",
    "estimated",
];

/// What the name of a column states.
#[derive(Clone, Debug, PartialEq)]
struct StatedSignal {
    /// What the column measures.
    role: SignalRole,
    /// Words of its joint, in lower case; empty for the time.
    joint: Vec<String>,
    /// The unit behind the last `_`.
    unit: Option<&'static str>,
    /// Whether it belongs to a topic of the states of joints.
    is_joint_state: bool,
}

/// Columns of a recording that name joints.
pub(super) struct JointColumns<'a> {
    /// Name and content of each column that states both what it measures and of which joint.
    columns: Vec<(&'a str, StatedSignal)>,
    /// Names of the model, with what each stands for.
    ours: Vec<(String, SignalRole, Vec<Vec<String>>)>,
}

/// The column for a name of the model.
pub(super) enum JointColumn {
    /// The column, with a unit in brackets if it is not part of its name.
    Unique(String),
    /// Several columns, of which none is certain.
    Ambiguous(Vec<String>),
}

impl<'a> JointColumns<'a> {
    /// Reads the names of all columns and those of the model.
    pub(super) fn new(mechanism: &Mechanism, known: &[(String, ColumnQuantity)], header: &'a [String]) -> Self {
        let stated = |name: &'a String| Some((name.as_str(), stated_signal(name)?));
        Self {
            columns: header.iter().filter_map(stated).collect(),
            ours: (known.iter())
                .filter_map(|(name, quantity)| model_signal(mechanism, name, *quantity))
                .collect(),
        }
    }

    /// The column for a name of the model with a quantity; `None` if no column states to be that.
    pub(super) fn find(&self, ours: &str, quantity: ColumnQuantity) -> Option<JointColumn> {
        let (_, role, joints) = self.ours.iter().find(|(name, ..)| name == ours)?;
        let is_of = |signal: &StatedSignal, role: SignalRole, joints: &[Vec<String>]| {
            signal.role == role && joints.contains(&signal.joint)
        };
        let mut fitting: Vec<&(&str, StatedSignal)> = (self.columns.iter())
            .filter(|(_, signal)| is_of(signal, *role, joints))
            .filter(|(_, signal)| signal.unit.is_none_or(|unit| unit_factor(unit, quantity).is_some()))
            .collect();
        // The states of the joints come before what controllers publish in addition.
        let is_state = |one: &&&(&str, StatedSignal)| one.1.is_joint_state;
        if fitting.iter().filter(is_state).count() == 1 {
            fitting.retain(|one| is_state(&one));
        }
        let names = || fitting.iter().map(|(name, _)| (*name).to_owned()).collect();
        let [(name, signal)] = fitting.as_slice() else {
            return (!fitting.is_empty()).then(|| JointColumn::Ambiguous(names()));
        };
        // A column that two names of the model could be is neither.
        let others = self
            .ours
            .iter()
            .filter(|(_, role, joints)| is_of(signal, *role, joints));
        if others.count() > 1 {
            return None;
        }
        Some(JointColumn::Unique(match signal.unit {
            Some(unit) => format!("{name} [{unit}]"),
            None => (*name).to_owned(),
        }))
    }
}

/// What a name of the model stands for: its role, and the words of its joint, for a drive also those of its coordinate.
/// `None` for variances, which files name in no usual way, and for coordinates of free bodies.
fn model_signal(
    mechanism: &Mechanism,
    name: &str,
    quantity: ColumnQuantity,
) -> Option<(String, SignalRole, Vec<Vec<String>>)> {
    let role = match quantity {
        ColumnQuantity::Time => return Some((name.to_owned(), SignalRole::Time, vec![Vec::new()])),
        ColumnQuantity::Angle(0) | ColumnQuantity::Length(0) => SignalRole::Position,
        ColumnQuantity::Angle(1) | ColumnQuantity::Length(1) => SignalRole::Rate,
        ColumnQuantity::Angle(_) | ColumnQuantity::Length(_) => SignalRole::Acceleration,
        ColumnQuantity::Force | ColumnQuantity::Torque => SignalRole::Force,
        ColumnQuantity::ForceVariance
        | ColumnQuantity::TorqueVariance
        | ColumnQuantity::Number
        | ColumnQuantity::Current
        | ColumnQuantity::Voltage
        | ColumnQuantity::Pressure => return None,
    };
    let of_coordinate = match role {
        SignalRole::Rate => name.strip_suffix("_d"),
        SignalRole::Acceleration => name.strip_suffix("_dd"),
        _ => None,
    };
    let mut names = vec![of_coordinate.unwrap_or(name)];
    let drives = || mechanism.drives.iter().chain(&mechanism.shared_drives);
    if role == SignalRole::Force
        && let Some(drive) = drives().find(|drive| drive.name == name)
        && let DriveKind::Joint(coordinate) = drive.kind
        // Two drives of one joint have forces of their own.
        && drives().filter(|one| one.kind == drive.kind).count() == 1
    {
        names.push(&mechanism.coordinates[coordinate.0].name);
    }
    let joints: Vec<Vec<String>> = names.iter().filter_map(|name| joint_words(split_words(name))).collect();
    (!joints.is_empty()).then(|| (name.to_owned(), role, joints))
}

/// The words that identify a joint; `None` if there are only numbers, which count joints in many ways.
fn joint_words(words: Vec<String>) -> Option<Vec<String>> {
    let is_number = |word: &String| word.bytes().all(|byte| byte.is_ascii_digit());
    if words.iter().all(is_number) {
        return None;
    }
    let named: Vec<String> = (words.iter())
        .filter(|word| !IDLE_WORDS.contains(&word.as_str()))
        .cloned()
        .collect();
    // `joint_1` is a name, from which nothing is left out.
    Some(if named.iter().all(is_number) { words } else { named })
}

/// What the name of a column states; `None` unless it clearly states a measured signal and its joint, or the time.
fn stated_signal(name: &str) -> Option<StatedSignal> {
    let base = split_header_unit(name).map_or(name, |(base, _)| base);
    let all = split_words(base);
    let is_foreign = |word: &String| COMMAND_WORDS.contains(&word.as_str()) || FOREIGN_WORDS.contains(&word.as_str());
    if all.iter().any(is_foreign) {
        return None;
    }
    // The parts of a column of a log are topic, field and joint; the topic identifies no joint.
    let parts: Vec<&str> = base.split('.').collect();
    let split = |text: &str| {
        let mut words = split_words(text);
        words.retain(|word| !MEASURED_WORDS.contains(&word.as_str()));
        words
    };
    let role_of_part = |part: &str| role_of(&split(part));
    let field = parts.iter().rposition(|part| role_of_part(part).is_some());
    let (topic, own) = match field {
        // `topic.position.elbow`, or `elbow.position` without anything behind it.
        Some(k) if k + 1 < parts.len() => (parts[..k].join("."), parts[k..].join(".")),
        Some(k) if k >= 1 => (parts[..k - 1].join("."), parts[k - 1..].join(".")),
        _ => (String::new(), base.to_owned()),
    };
    let topic = split_words(&topic);
    let mut words = split(&own);
    // A unit behind `_`.
    let unit = UNIT_ENDINGS
        .iter()
        .find(|(ending, _)| words.len() > 1 && ending.len() > 1 && words.last().is_some_and(|word| word == ending))
        .map(|(_, unit)| *unit);
    if unit.is_some() {
        words.pop();
    }
    // The word for the role stands at the start or at the end, and `q` only at the start: joints have such names too.
    let (first, last) = (words.first()?, words.last()?);
    let at_start = role_of(std::slice::from_ref(first));
    let at_end = role_of(std::slice::from_ref(last)).filter(|_| last.len() > 1);
    let role = match (at_start, at_end) {
        (Some(role), None) | (None, Some(role)) => role,
        (Some(role), Some(_)) if words.len() == 1 => role,
        _ => return None,
    };
    if at_start.is_some() {
        words.remove(0);
    } else {
        words.pop();
    }
    let joint = if role == SignalRole::Time {
        if !words.is_empty() {
            return None;
        }
        words
    } else {
        joint_words(words)?
    };
    let has = |word: &str| topic.iter().any(|one| one == word);
    Some(StatedSignal {
        role,
        joint,
        unit,
        is_joint_state: has("joint") && (has("states") || has("state")),
    })
}

/// The role that a single word states.
fn role_of(words: &[String]) -> Option<SignalRole> {
    let [word] = words else { return None };
    let mut table = ROLE_WORDS.iter();
    table
        .find(|(_, all)| all.contains(&word.as_str()))
        .map(|(role, _)| *role)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_state_role_and_joint() {
        for (name, role, joint) in [
            (
                "joint_states.position.shoulder_pan_joint",
                SignalRole::Position,
                "shoulder pan",
            ),
            ("/left/joint_states.effort.elbow", SignalRole::Force, "elbow"),
            ("shoulder_pan_joint.position", SignalRole::Position, "shoulder pan"),
            ("joint_states.elbow.velocity", SignalRole::Rate, "elbow"),
            ("position.shoulder_pan_joint", SignalRole::Position, "shoulder pan"),
            ("q_shoulder_pan_joint", SignalRole::Position, "shoulder pan"),
            ("qd_shoulder_pan_joint", SignalRole::Rate, "shoulder pan"),
            ("tau_elbow [N m]", SignalRole::Force, "elbow"),
            ("elbow_torque_Nm", SignalRole::Force, "elbow"),
            ("arm_1_joint_position", SignalRole::Position, "arm 1"),
            ("measured_position.elbow", SignalRole::Position, "elbow"),
            ("joint_states.position.joint_1", SignalRole::Position, "joint 1"),
            ("joint2_torque", SignalRole::Force, "joint 2"),
            ("time", SignalRole::Time, ""),
            ("__time", SignalRole::Time, ""),
            ("time_ms", SignalRole::Time, ""),
        ] {
            let found = stated_signal(name);
            let found = found.map(|one| (one.role, one.joint.join(" ")));
            assert_eq!(found, Some((role, joint.to_owned())), "{name}");
        }
    }

    #[test]
    fn other_signals_state_nothing() {
        for name in [
            "state.desired.position.elbow",
            "joint_trajectory.points_1.positions.elbow",
            "elbow_position_error",
            "motor_position.elbow",
            "elbow_current",
            "pos1",
            "q_1",
            "position_1",
            "elbow",
            "elbow_temperature",
            "cycle_time",
            "position",
            "q_elbow_torque",
        ] {
            assert_eq!(stated_signal(name), None, "{name}");
        }
    }
}
