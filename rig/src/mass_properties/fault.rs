//! A body of a file with its place, and a fault of a file with its place and a remedy.

use std::ops::Range;

use super::tensor::PrintedBody;

/// A body of a table or report.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct CadRow {
    /// Name as the file has it; may be empty.
    pub(super) name: String,
    /// Bytes of the row, or of the report.
    pub(super) span: Range<usize>,
    /// Volume, m^3, if it is stated.
    pub(super) volume: Option<f64>,
    /// Whether all three products of inertia are stated.
    pub(super) has_products: bool,
    /// The smallest last place of its moments and products of inertia, kg m^2; none without moments.
    pub(super) place: Option<f64>,
    /// Its values.
    pub(super) body: PrintedBody,
}

/// A fault of a file of mass properties.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct CadFault {
    /// Bytes of the file.
    pub(super) span: Range<usize>,
    /// What was found.
    pub(super) message: String,
    /// What is expected, or what to do.
    pub(super) expected: String,
}

impl CadFault {
    /// A fault at a place.
    pub(super) fn new(span: Range<usize>, message: impl Into<String>, expected: impl Into<String>) -> Self {
        Self {
            span,
            message: message.into(),
            expected: expected.into(),
        }
    }
}
