//! Errors of the library's methods: each states the place of the fault, what was expected and what to do.

use std::fmt;

use modelmill_boundary::message;
use modelmill_boundary::text::{Message, RemedyWording, RustWording};
use modelmill_codegen::DeriveError;
use modelmill_identify::{FiguresError, FilterError, FitFileError, LeastSquaresError, RecordingError};

/// Result of a method of the library.
pub type Outcome<T = ()> = Result<T, Error>;

/// The reason why a method returned no result. The message of each variant states where the fault is, what was
/// expected, and what to do.
#[derive(Debug)]
#[non_exhaustive]
pub enum Error {
    /// A model, rig or plan file is invalid. The value contains all errors and warnings of the file, each with its line
    /// and column.
    Model(Box<modelmill_spec::LoadFailure>),
    /// The equations of the mechanism cannot be derived.
    Derivation {
        /// Name of the model file in messages.
        model: String,
        /// The fault of the mechanism.
        error: Box<DeriveError>,
    },
    /// A recording cannot be read or prepared.
    Recording(Box<RecordingError>),
    /// A fit cannot be read, or belongs to another model.
    Fit(Box<FitFileError>),
    /// Least squares has no solution.
    LeastSquares(LeastSquaresError),
    /// Error metrics cannot be computed: measured and model forces have different lengths, are not finite, or there are
    /// no samples.
    Figures(FiguresError),
    /// A filter is not applicable to the recording, such as a cut-off above half the sampling rate.
    Filter(FilterError),
    /// Another fault of an input.
    Input(Message),
    /// Options contradict each other, or the method does not support them.
    Options(Message),
    /// The caller stopped the job, or the time limit of its host is over.
    Cancelled,
}

impl Error {
    /// An error of an input.
    pub fn input(message: impl Into<Message>) -> Self {
        Self::Input(message.into())
    }

    /// Options that contradict each other.
    pub(crate) fn options(message: impl Into<Message>) -> Self {
        Self::Options(message.into())
    }

    /// A mechanism that cannot be derived; `model` is the name of its file in messages.
    pub(crate) fn derivation(model: &str, error: DeriveError) -> Self {
        Self::Derivation {
            model: model.to_owned(),
            error: Box::new(error),
        }
    }

    /// The error text, with remedies written for the reader: as command-line options, in Python or in Rust.
    pub fn format_for(&self, wording: &dyn RemedyWording) -> String {
        match self {
            Self::Model(failure) => failure.render_for(false, wording),
            other => other.message().format_for(wording),
        }
    }

    /// The error as a message whose remedies can be written for any reader. For an invalid model file they are already
    /// written for callers of the Rust library; [`Error::format_for`] writes them for any reader.
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
            Self::Cancelled => "stopped on request, or by a time limit, before there was a result".into(),
        }
    }
}

impl fmt::Display for Error {
    // Without a known reader the remedies are written as fields of the library's options.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.format_for(&RustWording))
    }
}

impl std::error::Error for Error {}

// Large payloads are boxed, so that `Result` stays small.
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
