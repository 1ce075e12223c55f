//! Why a verb gives no answer.

use std::fmt;

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
    Input(String),
    /// Options that contradict each other, or that the verb does not know.
    Options(String),
    /// The caller asked the verb to stop.
    Cancelled,
}

impl Error {
    /// A fault of what the verb was given, from anything that can say what it is.
    pub fn input(says: impl fmt::Display) -> Self {
        Self::Input(says.to_string())
    }

    /// Options that make no sense together.
    pub(crate) fn options(says: impl fmt::Display) -> Self {
        Self::Options(says.to_string())
    }

    /// A mechanism that cannot be derived; `model` is what messages call its file.
    pub(crate) fn derivation(model: &str, error: DeriveError) -> Self {
        Self::Derivation {
            model: model.to_owned(),
            error: Box::new(error),
        }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Model(failure) => failure.fmt(f),
            Self::Derivation { model, error } => write!(f, "{model}: {error}"),
            Self::Recording(error) => error.fmt(f),
            Self::Fit(error) => error.fmt(f),
            Self::LeastSquares(error) => error.fmt(f),
            Self::Figures(error) => error.fmt(f),
            Self::Filter(error) => error.fmt(f),
            Self::Input(says) | Self::Options(says) => f.write_str(says),
            Self::Cancelled => f.write_str("stopped before there was an answer, as was asked for"),
        }
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
