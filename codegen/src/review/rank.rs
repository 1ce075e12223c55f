//! The numeric rank of the regressor on the file's values, which the page compares with the exact one.

/// Rank of the regressors stacked over random states, eq. (9), on the file's values.
#[derive(Clone, Debug, PartialEq)]
pub struct NumericRank {
    /// Number of linearly independent columns.
    pub rank: usize,
    /// Number of random states.
    pub samples: usize,
    /// Condition number of the retained columns, if known.
    pub condition: Option<f64>,
}
