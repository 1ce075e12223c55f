//! Why a verb gives no answer.

use std::fmt;

use modelmill_boundary::message;
use modelmill_boundary::text::{LibrarySpelling, Message, RemedySpelling};
use modelmill_codegen::DeriveError;
use modelmill_identify::{
    FiguresError, FilterError, FitFileError, LeastSquaresError, RecordingError,
};

/// Result of a verb.
pub type Outcome<T = ()> = Result<T, Error>;

/// Why a verb gives no answer. All say in words where the fault is, what was expected, and what to do.
#[derive(Debug)]
#[non_exhaustive]
pub enum Error {
    /// A model, rig or plan file has no meaning; every finding has its place.
    Model(Box<modelmill_spec::LoadFailure>),
    /// The mechanism cannot be derived.
    Derivation {
        /// What messages call the model file.
        model: String,
        /// What is wrong.
        error: Box<DeriveError>,
    },
    /// A recording cannot be read or prepared.
    Recording(Box<RecordingError>),
    /// A fit cannot be read, or belongs to another model.
    Fit(Box<FitFileError>),
    /// Least squares have no answer.
    LeastSquares(LeastSquaresError),
    /// Measured forces and the model's do not go together.
    Figures(FiguresError),
    /// A filter does not suit the recording.
    Filter(FilterError),
    /// Another fault of what the verb was given.
    Input(Message),
    /// Options that contradict each other, or that the verb does not know.
    Options(Message),
    /// The caller asked the verb to stop.
    Cancelled,
}

impl Error {
    /// A fault of what the verb was given, from a text or a message that says what it is.
    pub fn input(says: impl Into<Message>) -> Self {
        Self::Input(says.into())
    }

    /// Options that make no sense together.
    pub(crate) fn options(says: impl Into<Message>) -> Self {
        Self::Options(says.into())
    }

    /// A mechanism that cannot be derived; `model` is what messages call its file.
    pub(crate) fn derivation(model: &str, error: DeriveError) -> Self {
        Self::Derivation {
            model: model.to_owned(),
            error: Box::new(error),
        }
    }

    /// What is wrong, in the words of whoever reads it.
    pub fn spell(&self, spelling: &dyn RemedySpelling) -> String {
        match self {
            Self::Model(failure) => failure.render_spelled(false, spelling),
            other => other.message().spell(spelling),
        }
    }

    /// What is wrong. That of a file without meaning is a text with snippets, in which [`Error::spell`] spells advice.
    pub fn message(&self) -> Message {
        match self {
            Self::Model(failure) => failure.render(false).into(),
            Self::Derivation { model, error } => message!("{model}: {error}"),
            Self::Recording(error) => error.message(),
            Self::Fit(error) => error.message(),
            Self::LeastSquares(error) => error.to_string().into(),
            Self::Figures(error) => error.to_string().into(),
            Self::Filter(error) => error.to_string().into(),
            Self::Input(says) | Self::Options(says) => says.clone(),
            Self::Cancelled => "stopped before there was an answer, as was asked for".into(),
        }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.spell(&LibrarySpelling))
    }
}

impl std::error::Error for Error {}

impl From<modelmill_spec::LoadFailure> for Error {
    fn from(failure: modelmill_spec::LoadFailure) -> Self {
        Self::Model(Box::new(failure))
    }
}

impl From<RecordingError> for Error {
    fn from(error: RecordingError) -> Self {
        Self::Recording(Box::new(error))
    }
}

impl From<FitFileError> for Error {
    fn from(error: FitFileError) -> Self {
        Self::Fit(Box::new(error))
    }
}

impl From<LeastSquaresError> for Error {
    fn from(error: LeastSquaresError) -> Self {
        Self::LeastSquares(error)
    }
}

impl From<FiguresError> for Error {
    fn from(error: FiguresError) -> Self {
        Self::Figures(error)
    }
}

impl From<FilterError> for Error {
    fn from(error: FilterError) -> Self {
        Self::Filter(error)
    }
}
