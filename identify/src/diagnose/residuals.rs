//! Residuals of a set of effects at all samples.
//!
//! The effects of a search go in. Out come the residuals of each channel, also next to reversals, and whether a change of
//! the set makes them larger.

use super::bench::{EffectSelector, SelectedEffect};
use super::pool::FitScope;
use crate::signal::dot;

impl EffectSelector<'_> {
    /// Residual of a set that is fitted to all samples but those left out, `[channel][sample]`, at all samples.
    pub(super) fn complete_residual(&self, picks: &[SelectedEffect]) -> Vec<Vec<f64>> {
        let (factors, _) = self.fit(picks, FitScope::All);
        (self.pool).full_residual(self.measured, &self.columns(picks), factors.as_slice())
    }

    /// Residual of a set that is fitted to the recordings of the fit, `[channel][sample]`. Samples at reversals count
    /// here; samples that are left out of the diagnosis are zero.
    pub(super) fn full_residual(&self, picks: &[SelectedEffect]) -> Vec<Vec<f64>> {
        let (factors, _) = self.fit(picks, FitScope::Fit);
        let columns = self.columns(picks);
        let mut rest = (self.pool).full_residual(self.measured, &columns, factors.as_slice());
        self.zero_left_out(&mut rest);
        rest
    }

    /// Sets the samples that are left out of the diagnosis to zero, `[channel][sample]`.
    pub(super) fn zero_left_out(&self, values: &mut [Vec<f64>]) {
        for (values, out) in values.iter_mut().zip(&self.problem.left_out) {
            for (value, _) in values.iter_mut().zip(out).filter(|(_, out)| **out) {
                *value = 0.0;
            }
        }
    }

    /// Whether a change raises the squared residual over all samples, reversals included, in the fit and in the
    /// validation runs. Then it explains the samples that decide at the cost of those next to reversals, where an
    /// effect would act too.
    pub(super) fn is_worse_overall(
        &self,
        before: &[SelectedEffect],
        after: &[SelectedEffect],
        channels: &[usize],
    ) -> bool {
        if self.problem.jumps.is_empty() {
            return false;
        }
        let layout = &self.problem.layout;
        let split = layout.fit_samples();
        let [old, new] = [before, after].map(|picks| self.full_residual(picks));
        let rises = |range: std::ops::Range<usize>| {
            let of = |rest: &[Vec<f64>], d: usize| {
                let part = &rest[d][range.clone()];
                self.weights[d] * dot(part, part)
            };
            let more = channels.iter().map(|d| of(&new, *d) - of(&old, *d));
            more.sum::<f64>() > 0.0
        };
        rises(0..split) && (!layout.has_check() || rises(split..layout.samples()))
    }
}
