//! What ends a command early, and the exit status that goes with it.

/// Why a command ended early.
#[derive(Debug)]
pub(crate) enum CommandFailure {
    /// The library has no answer: exit status 2 where options contradict each other, else 1.
    Library(modelmill::Error),
    /// The input is at fault: exit status 1, and one message that says where, what was expected
    /// and what to do.
    Input(String),
    /// The command line is at fault: exit status 2.
    Usage(String),
    /// The reader of standard output went away; nobody wants to hear more.
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
            Self::Input(_) | Self::Library(_) => 1,
        }
    }
}

impl From<modelmill::Error> for CommandFailure {
    fn from(error: modelmill::Error) -> Self {
        Self::Library(error)
    }
}
