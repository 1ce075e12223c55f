//! Rank of eq. (9) on a sample, safe against columns that are nothing but rounding.

use modelmill_codegen::{ModelEvaluator, PoseFault};
use modelmill_identify::estimate::{RegressorRank, numeric_rank};
use nalgebra::DMatrix;

use crate::sample::Sample;

/// Columns smaller than this share of the largest one are rounding of intermediate results.
const ROUNDING: f64 = 1e-12;

/// The numeric rank of a regressor whose columns at the level of rounding count as zero.
///
/// Scaled to norm 1 they would count as columns of noise, and each would add one to the rank.
pub fn rank(mut w: DMatrix<f64>) -> RegressorRank {
    let largest = w.column_iter().map(|c| c.norm()).fold(0.0, f64::max);
    for mut column in w.column_iter_mut() {
        if column.norm() < ROUNDING * largest {
            column.fill(0.0);
        }
    }
    numeric_rank(&w).expect("finite numbers and at least one column")
}

/// The numeric rank of all products' columns at some states.
pub fn rank_of_products(evaluator: &ModelEvaluator<'_>, sample: &Sample) -> Result<RegressorRank, PoseFault> {
    evaluator.full_regressor(&sample.states()).map(rank)
}
