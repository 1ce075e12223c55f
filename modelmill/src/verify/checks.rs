//! Checks of a model: what was checked, its state, value and limit.

use modelmill_boundary::text::Message;

/// The result of a check, and of a verification as a whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CheckState {
    /// The value is within its limits.
    Pass,
    /// The value is outside its limits.
    Fail,
    /// The recordings do not allow a decision.
    NotEvaluated,
}

impl CheckState {
    /// Its name in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::Fail => "fail",
            Self::NotEvaluated => "not_evaluated",
        }
    }

    /// Its name in text.
    pub fn word(self) -> &'static str {
        match self {
            Self::NotEvaluated => "not evaluated",
            other => other.name(),
        }
    }
}

/// What a check is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CheckScope {
    /// A recording: does it have faults that make its numbers meaningless?
    Recording,
    /// A drive along one recording: is the error of the model small enough?
    Drive,
    /// A position of the model simulated from recorded states: is its error small enough?
    Position,
    /// A base parameter: does its estimate agree with the model or with an interval?
    Parameter,
    /// The model: does it lack an effect?
    Effect,
}

impl CheckScope {
    /// All scopes, in the order of the output.
    pub const ALL: [Self; 5] = [
        Self::Recording,
        Self::Drive,
        Self::Position,
        Self::Parameter,
        Self::Effect,
    ];

    /// Its name in JSON and JUnit files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Recording => "recording",
            Self::Drive => "drive",
            Self::Position => "position",
            Self::Parameter => "parameter",
            Self::Effect => "effect",
        }
    }
}

/// One check.
#[derive(Clone, Debug, PartialEq)]
pub struct VerificationCheck {
    /// What it is about.
    pub scope: CheckScope,
    /// The recording; `None` if the check is about all recordings together.
    pub recording: Option<String>,
    /// The drive, the coordinate, the base parameter, the effect with its places, or the recording.
    pub at: String,
    /// The quantity that is checked: `error_percent`, `error`, `position_error`, `value`, `probability` or
    /// `fault`.
    pub quantity: &'static str,
    /// The result.
    pub state: CheckState,
    /// The value of the quantity; `None` if it could not be computed.
    pub value: Option<f64>,
    /// Standard deviation of the value, if it is an estimate.
    pub std: Option<f64>,
    /// Lower and upper limit; `None` for a side without limit.
    pub limit: [Option<f64>; 2],
    /// Unit of value and limit; empty if they have none.
    pub unit: String,
    /// Whether the limit is a default and not one of the user.
    pub is_default: bool,
    /// What was found, as a sentence without full stop.
    pub says: String,
    /// The cause of a failure according to the diagnosis; `None` for other states.
    pub cause: Option<Message>,
}
