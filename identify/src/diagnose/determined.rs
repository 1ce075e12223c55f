//! Whether the fitted recordings determine the effects of a set. An effect whose columns the other columns of the set
//! represent along all fitted recordings has no value there, whatever it explains in validation runs: the position of a
//! joint that stands in each run is such a case. Then the error of the validation runs belongs to the estimates of the
//! model, and not to an effect.

use super::bench::{EffectSelector, SelectedEffect};
use super::pool::{FitScope, solve_gram};
use super::thresholds::EFFECT_INDEPENDENCE_TOLERANCE;

impl EffectSelector<'_> {
    /// Whether the fitted recordings determine every member of a set. Without validation runs all recordings are fitted,
    /// and columns that depend on those of the model are excluded before. Parameters that each recording has for itself
    /// are not compared between recordings.
    pub(crate) fn are_members_determined(&self, picks: &[SelectedEffect]) -> bool {
        if !self.problem.layout.has_check() {
            return true;
        }
        let columns = self.columns(picks);
        let gram = self.pool.gram(&columns, &self.weights, FitScope::Fit);
        let mut start = self.base.len();
        picks.iter().all(|pick| {
            let own = start..start + pick.columns.len();
            start = own.end;
            let mut which: Vec<usize> = (0..columns.len()).filter(|k| !own.contains(k)).collect();
            self.candidate(pick).is_per_run
                || own.clone().any(|k| {
                    which.push(k);
                    let one = gram.select_rows(&which).select_columns(&which);
                    which.pop();
                    solve_gram(&one).1 > EFFECT_INDEPENDENCE_TOLERANCE * gram[(k, k)]
                })
        })
    }
}
