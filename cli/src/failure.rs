//! Reasons why a command ends early, with the exit status of each.

/// Why a command ended early.
#[derive(Debug)]
pub(crate) enum CommandFailure {
    /// The library failed: exit status 2 if options contradict each other, else 1.
    Library(modelmill::Error),
    /// The input is at fault: exit status 1. The message has the place, what was expected, and a remedy.
    Input(String),
    /// The command line is at fault: exit status 2.
    Usage(String),
    /// The model fails a verification, or could not be verified: exit status 1. The output states why.
    NotVerified,
    /// The model file has values that no machine can have: exit status 1. The output states them.
    ImpossibleValues,
    /// An essential part of the program does not work: exit status 1. The output states which.
    Unusable,
    /// The reader of standard output closed it: exit status 0 and no message.
    BrokenPipe,
}

/// Result of a command.
pub(crate) type CommandOutcome<T = ()> = Result<T, CommandFailure>;

impl CommandFailure {
    /// The exit status.
    pub(crate) fn status(&self) -> u8 {
        match self {
            Self::BrokenPipe => 0,
            Self::Usage(_) | Self::Library(modelmill::Error::Options(_)) => 2,
            Self::NotVerified | Self::ImpossibleValues | Self::Unusable | Self::Input(_) | Self::Library(_) => 1,
        }
    }
}

impl From<modelmill::Error> for CommandFailure {
    fn from(error: modelmill::Error) -> Self {
        Self::Library(error)
    }
}
