//! Refinement: estimates only those parameters that the recordings support.

use modelmill_identify::estimate::{EssentialOptions, WeightedEstimate, select_essential};

use super::RefinementResult;
use crate::error::Outcome;

/// Removes parameters one by one while the residual does not rise significantly; they keep their nominal values.
/// Values, standard deviations and condition numbers in `found` are replaced.
pub(super) fn refine(found: &mut WeightedEstimate, nominal: &[f64]) -> Outcome<RefinementResult> {
    let WeightedEstimate {
        solution,
        uncertainty,
        r_factor,
        ..
    } = found;
    let kept = select_essential(r_factor, solution, uncertainty, nominal, &EssentialOptions::default())?;
    solution.values = kept.values;
    solution.classical_std = kept.classical_std;
    solution.condition_number = kept.condition_number;
    solution.scaled_condition_number = kept.scaled_condition_number;
    // Removed parameters are listed in the result, so that no direction is undetermined.
    solution.undetermined.clear();
    solution.determined = uncertainty.std.iter().map(|_| true).collect();
    // Effective samples follow from the ratio of the two standard deviations.
    uncertainty.effective_samples = (kept.std.iter().zip(&solution.classical_std))
        .map(|(std, classical)| uncertainty.samples as f64 * (classical / std).powi(2))
        .collect();
    uncertainty.std = kept.std;
    Ok(RefinementResult::Essential(kept.dropped, kept.residual_rise))
}
