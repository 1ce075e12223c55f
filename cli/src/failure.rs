//! What ends a command early, and the exit status that goes with it.

use std::fmt;

/// Why a command ended early.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The input is at fault: exit status 1, and one message that says where, what was expected
    /// and what to do.
    Input(String),
    /// As [`Failure::Input`], with a text that is rendered already.
    Rendered(String),
    /// The command line is at fault: exit status 2.
    Usage(String),
    /// The reader of standard output went away; nobody wants to hear more.
    BrokenPipe,
}

/// Result of a command.
pub(crate) type Outcome<T = ()> = Result<T, Failure>;

impl Failure {
    /// The exit status.
    pub(crate) fn status(&self) -> u8 {
        match self {
            Self::BrokenPipe => 0,
            Self::Input(_) | Self::Rendered(_) => 1,
            Self::Usage(_) => 2,
        }
    }

    /// A fault of the input, from anything that can say what it is.
    pub(crate) fn input(says: impl fmt::Display) -> Self {
        Self::Input(says.to_string())
    }
}

impl From<modelmill_identify::RecordingError> for Failure {
    fn from(error: modelmill_identify::RecordingError) -> Self {
        Self::input(error)
    }
}

impl From<modelmill_identify::LeastSquaresError> for Failure {
    fn from(error: modelmill_identify::LeastSquaresError) -> Self {
        Self::input(error)
    }
}

impl From<modelmill_identify::FiguresError> for Failure {
    fn from(error: modelmill_identify::FiguresError) -> Self {
        Self::input(error)
    }
}

impl From<modelmill_identify::FilterError> for Failure {
    fn from(error: modelmill_identify::FilterError) -> Self {
        Self::input(error)
    }
}
