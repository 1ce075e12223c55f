//! Why parameters cannot be estimated, with what to do.

use std::fmt;

/// Why a regression cannot be set up or solved.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum LeastSquaresError {
    /// The regressor has no columns.
    NoParameters,
    /// Rows and measured values do not fit together.
    Shape {
        /// Numbers of the regressor given.
        regressor: usize,
        /// Measured values given.
        measured: usize,
        /// Columns of the regressor.
        columns: usize,
    },
    /// A block does not hold whole samples of all channels.
    Channels {
        /// Rows of the block.
        rows: usize,
        /// Rows per sample.
        channels: usize,
    },
    /// A number of the regressor or of the measured values is NaN or infinite.
    NotFinite {
        /// Row among all that were given, from 0.
        row: usize,
        /// Column of the regressor; `None` for the measured value.
        column: Option<usize>,
    },
    /// No rows were given.
    NoRows,
    /// The list of nominal values has another length than the parameters.
    NominalLength {
        /// Values given.
        have: usize,
        /// Parameters.
        expected: usize,
    },
    /// The singular value iteration did not converge; only extreme numbers can cause it.
    NoConvergence,
    /// The instruments say too little about the regressor.
    WeakInstruments {
        /// The smallest canonical correlation between both.
        correlation: f64,
    },
    /// The second pass over the rows did not show the rows of the first.
    PassesDiffer {
        /// Rows of the first pass.
        first: usize,
        /// Rows of this pass.
        this_pass: usize,
    },
}

impl fmt::Display for LeastSquaresError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoParameters => f.write_str("there is no parameter to identify; the regressor has no columns"),
            Self::Shape { regressor, measured, columns } => write!(
                f,
                "{regressor} numbers of the regressor do not make {measured} rows of {columns} columns"
            ),
            Self::Channels { rows, channels } => {
                write!(f, "{rows} rows are not whole samples of {channels} channels; give whole samples in each block")
            }
            Self::NotFinite { row, column: Some(column) } => write!(
                f,
                "column {column} of the regressor is not finite in row {row}; \
                 is the mechanism out of reach or singular there?"
            ),
            Self::NotFinite { row, column: None } => write!(f, "the measured value of row {row} is not finite"),
            Self::NoRows => f.write_str("there are no samples to identify from"),
            Self::NominalLength { have, expected } => {
                write!(f, "{have} nominal values were given for {expected} parameters")
            }
            Self::NoConvergence => f.write_str(
                "the singular values do not converge; the numbers of the regressor differ too much in size",
            ),
            Self::WeakInstruments { correlation } => write!(
                f,
                "the instruments do not determine the parameters: the smallest canonical correlation between them and the \
                 regressor is {correlation:.1e}; are they of the same motion, and in step with the recording? Does the \
                 recording itself determine all parameters? Identify without instruments to see"
            ),
            Self::PassesDiffer { first, this_pass: now } => write!(
                f,
                "the second pass showed {now} rows where the first showed {first}; show the same rows in all passes"
            ),
        }
    }
}

impl std::error::Error for LeastSquaresError {}

/// Why no possible parameters were found.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum PhysicalError {
    /// A body is not possible with its nominal values, so that nothing can be near to them.
    NominalImpossible {
        /// The body.
        body: String,
        /// What is wrong with it.
        why: String,
    },
    /// The iteration did not settle; only extreme numbers can cause it.
    NoConvergence,
}

impl fmt::Display for PhysicalError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NominalImpossible { body, why } => write!(
                f,
                "the nominal values of {body} are those of no body: {why}; give nominal values that a body can have, as a \
                 CAD system prints them"
            ),
            Self::NoConvergence => {
                f.write_str("the search for physical parameters did not settle; are the nominal values of the right size?")
            }
        }
    }
}

impl std::error::Error for PhysicalError {}
