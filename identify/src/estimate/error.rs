//! Errors of estimates, with remedies.

use std::fmt;

/// Why a regression cannot be set up or solved.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum LeastSquaresError {
    /// The regressor has no columns.
    NoParameters,
    /// Rows and measured values do not match.
    Shape {
        /// Number of values of the regressor.
        regressor: usize,
        /// Number of measured values.
        measured: usize,
        /// Number of columns of the regressor.
        columns: usize,
    },
    /// A block does not contain complete samples of all channels.
    Channels {
        /// Rows of the block.
        rows: usize,
        /// Rows per sample.
        channels: usize,
    },
    /// A number of the regressor or of the measured values is NaN or infinite.
    NotFinite {
        /// Index of the row among all rows.
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
    /// The instruments contain too little information about the regressor.
    WeakInstruments {
        /// The smallest canonical correlation between both.
        correlation: f64,
    },
    /// The second pass over the rows differs from the first.
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
            Self::Shape {
                regressor,
                measured,
                columns,
            } => write!(
                f,
                "the regressor has {regressor} numbers, but {measured} measured values need {measured} rows of {columns} columns"
            ),
            Self::Channels { rows, channels } => {
                write!(
                    f,
                    "{rows} rows are not complete samples of {channels} channels; pass complete samples in each block"
                )
            }
            Self::NotFinite {
                row,
                column: Some(column),
            } => write!(
                f,
                "column {column} of the regressor is not finite in row {row}; \
                 check whether the mechanism is out of reach or singular there"
            ),
            Self::NotFinite { row, column: None } => write!(f, "the measured value of row {row} is not finite"),
            Self::NoRows => f.write_str("there are no samples to identify from"),
            Self::NominalLength { have, expected } => {
                write!(f, "{have} nominal values were given for {expected} parameters")
            }
            Self::NoConvergence => {
                f.write_str("the singular values do not converge; the numbers of the regressor differ too much in size")
            }
            Self::WeakInstruments { correlation } => write!(
                f,
                "the instruments do not determine the parameters: the smallest canonical correlation between them and the \
                 regressor is {correlation:.1e}. Check that they belong to the same motion and are synchronous with the \
                 recording. Identify without instruments to see whether the recording itself determines all parameters"
            ),
            Self::PassesDiffer { first, this_pass: now } => write!(
                f,
                "the second pass had {now} rows, but the first had {first}; pass the same rows each time"
            ),
        }
    }
}

impl std::error::Error for LeastSquaresError {}

/// Why no physically possible parameters were found.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum PhysicalError {
    /// A body is impossible with its nominal values, which are the start of the search.
    NominalImpossible {
        /// The body.
        body: String,
        /// What is wrong with it.
        why: String,
    },
    /// The iteration did not converge; only extreme numbers can cause it.
    NoConvergence,
}

impl fmt::Display for PhysicalError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NominalImpossible { body, why } => write!(
                f,
                "the nominal values of {body} are physically impossible: {why}; give values that a body can have, for \
                 example from a CAD system"
            ),
            Self::NoConvergence => f.write_str(
                "the search for physical parameters did not converge; check the magnitudes of the nominal values",
            ),
        }
    }
}

impl std::error::Error for PhysicalError {}
