//! The rank on the file's values, beside the exact one.

/// Rank of the regressor on the file's values, found numerically.
#[derive(Clone, Debug, PartialEq)]
pub struct NumericRank {
    /// The rank.
    pub rank: usize,
    /// At how many random states the regressor was stacked.
    pub samples: usize,
    /// Condition number of the columns that are retained, if known.
    pub condition: Option<f64>,
}
