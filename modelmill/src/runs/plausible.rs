//! Changes between runs that are not plausible: they explain less than what stays unexplained, or no machine has them.

use modelmill_identify::changes::{BlockFit, NormalEquations, SelectedChange, fit_blocks};

use super::changes::{self, ChangeKind};
use super::thresholds::{
    CHANGE_LEAST_FORCE_SHARE, LARGE_UNEXPLAINED_SHARE, NEGATIVE_FRICTION_SIGMAS, TURNED_SCALE_TOLERANCE,
};
use super::{RunAnalyser, RunStatistics};

impl RunAnalyser<'_> {
    /// Drops changes that explain less than what stays unexplained of every drive that they act on, where this is a large
    /// part of the force: an effect that the model lacks is as likely there. `runs` are both runs. Drives whose force is not `believed` do not count.
    pub(super) fn drop_below_unexplained(
        &self,
        found: &mut Vec<SelectedChange>,
        runs: [&RunStatistics; 2],
        believed: &[bool],
    ) {
        found.retain(|one| {
            let columns = &self.possible[one.candidate].candidate.columns;
            let fractions = runs[1].sizes.force_fractions(columns, &one.values);
            let mut drives = fractions.iter().enumerate().filter(|(d, _)| believed[*d]);
            drives.any(|(d, part)| {
                let rest = runs.map(|run| run.unexplained.0[d]).into_iter().fold(0.0, f64::max);
                *part > CHANGE_LEAST_FORCE_SHARE && (rest < LARGE_UNEXPLAINED_SHARE || *part > rest)
            })
        });
    }

    /// Whether a change is impossible: friction would drive the machine, or the scale of a force would be negative without a
    /// turned sign. Then the model lacks an effect, and all changes that were found with this one are dropped. Drives whose
    /// force is not `believed`, and friction that the first run does not determine, do not count.
    pub(super) fn is_implausible(&self, one: &SelectedChange, before: &RunStatistics, believed: &[bool]) -> bool {
        let change = one.values[0];
        let std = one.covariance[(0, 0)].max(0.0).sqrt();
        match self.possible[one.candidate].kind {
            ChangeKind::Friction(d) if believed[d] && one.determined[0] => {
                let Some(k) = changes::friction(self.model, d)[0] else {
                    return false;
                };
                let Some(std_before) = self.base_fit(before).std[k] else {
                    return false;
                };
                let least = before.values[k].min(before.values[k] + change);
                least < -NEGATIVE_FRICTION_SIGMAS * std.hypot(std_before)
            }
            // A turned sign has the factor -1.
            ChangeKind::Scale(d) if believed[d] => {
                let tolerance = TURNED_SCALE_TOLERANCE.max(NEGATIVE_FRICTION_SIGMAS * std);
                1.0 + change < 0.0 && (2.0 + change).abs() > tolerance
            }
            _ => false,
        }
    }

    /// The base parameters fitted to a run alone.
    pub(super) fn base_fit(&self, run: &RunStatistics) -> BlockFit {
        let base: Vec<usize> = (0..self.layout.base).collect();
        let blocks: Vec<NormalEquations> = run.white.blocks.iter().map(|one| one.select_columns(&base)).collect();
        fit_blocks(&blocks)
    }
}
