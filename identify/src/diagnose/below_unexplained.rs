//! Drops effects that explain less than what stays unexplained on their channels.

use super::SetResidual;
use super::bench::{EffectSelector, SelectedEffect};
use super::in_time::squares_in_time;
use super::pool::FitScope;
use super::problem::CandidateNature;
use super::thresholds::{EFFECT_LEAST_UNEXPLAINED_RATIO, LARGE_RESIDUAL_SHARE, SPOILED_LEAST_RISE};
use crate::signal::dot;

impl EffectSelector<'_> {
    /// Drops members that explain less than what stays unexplained, the weakest first, and returns the set with its
    /// residual: there an unknown law is as likely as the effect. Three rules hold. The gains on all channels are compared with
    /// the repeatable squares. Where all residuals are large, one channel must gain more than the squares that stay there. The
    /// gain of a drift or of a change in time is compared with the squares that follow the time only, unless the evidence for
    /// other effects depends on it.
    pub(super) fn drop_below_unexplained(
        &mut self,
        mut picks: Vec<SelectedEffect>,
    ) -> (Vec<SelectedEffect>, SetResidual) {
        loop {
            let left = self.set_residual(&picks);
            let squares_in_time = self.squares_in_time(&picks, &left);
            // Find the member whose gain is smallest relative to the unexplained squares on its channels.
            let mut least: Option<(f64, Vec<SelectedEffect>)> = None;
            for i in 0..picks.len() {
                let channels = self.affected_channels(&picks[i..=i]);
                if channels.is_empty() {
                    continue;
                }
                let repeatable = |d: usize| {
                    if left.unexplained.contains(&d) {
                        left.repeatable_share[d] * dot(&left.residual[d], &left.residual[d])
                    } else {
                        0.0
                    }
                };
                let varies = self.varies_in_time(&picks[i]);
                let in_time = |d: usize| if varies { squares_in_time[d] } else { 0.0 };
                let is_in_time = channels.iter().any(|d| in_time(*d) > 0.0);
                let large: Option<Vec<f64>> = channels.iter().map(|d| self.large_squares(*d, &left)).collect();
                if !is_in_time && large.is_none() && channels.iter().all(|d| repeatable(*d) <= 0.0) {
                    continue;
                }
                // Gain of the member: squares that come back when the set is fitted without it.
                let mut fewer = picks.clone();
                fewer.remove(i);
                let fewer = self.refresh_columns(fewer);
                let (factors, _) = self.fit(&fewer, FitScope::All);
                let rest = self.residual(&fewer, &factors);
                let gain = |d: usize| dot(&rest[d], &rest[d]) - dot(&left.residual[d], &left.residual[d]);
                let weighted =
                    |of: &dyn Fn(usize) -> f64| channels.iter().map(|d| self.weights[*d] * of(*d)).sum::<f64>();
                let compared = |stays: f64| match stays {
                    stays if stays > 0.0 => weighted(&gain) / stays,
                    _ => f64::INFINITY,
                };
                let of_repeatable = compared(weighted(&repeatable));
                let of_time = match compared(weighted(&in_time)) {
                    share if share < EFFECT_LEAST_UNEXPLAINED_RATIO && self.spoils_others(&picks, &fewer) => {
                        f64::INFINITY
                    }
                    share => share,
                };
                // Where all residuals are large, one channel on which the member explains more is enough.
                let of_large = large.map_or(f64::INFINITY, |large| {
                    let shares = channels.iter().zip(&large).map(|(d, stays)| gain(*d) / stays);
                    shares.fold(0.0, f64::max)
                });
                let share = of_repeatable.min(of_large).min(of_time);
                if share < EFFECT_LEAST_UNEXPLAINED_RATIO && least.as_ref().is_none_or(|(other, _)| share < *other) {
                    least = Some((share, fewer));
                }
            }
            match least {
                Some((_, fewer)) => picks = fewer,
                None => return (picks, left),
            }
        }
    }

    /// Whether a member is a drift or a change in time, which each recording has for itself.
    fn varies_in_time(&self, pick: &SelectedEffect) -> bool {
        let candidate = self.candidate(pick);
        candidate.is_per_run && candidate.nature != CandidateNature::Effect
    }

    /// Whether the error on validation runs, by which the evidence for the other effects is judged, clearly rises without a
    /// member. False if there are no others.
    fn spoils_others(&self, picks: &[SelectedEffect], fewer: &[SelectedEffect]) -> bool {
        let error = |set: &[SelectedEffect]| self.relative_errors(set, self.has_run_parameters(set)).1;
        !fewer.is_empty() && error(fewer) > SPOILED_LEAST_RISE * error(picks)
    }

    /// The squares of each channel that follow the time only and cannot be noise, `[channel]`; zeros if no member is compared
    /// with them.
    fn squares_in_time(&self, picks: &[SelectedEffect], left: &SetResidual) -> Vec<f64> {
        if !picks.iter().any(|pick| self.varies_in_time(pick)) {
            return vec![0.0; left.residual.len()];
        }
        let residuals = left.residual.iter().zip(&left.repeatable_share).enumerate();
        residuals
            .map(|(d, (rest, again))| squares_in_time(self.problem, d, rest, *again))
            .collect()
    }

    /// The squares of a channel beyond its noise if they are a large part of those of the force; `None` otherwise.
    fn large_squares(&self, channel: usize, left: &SetResidual) -> Option<f64> {
        let rest = &left.residual[channel];
        let force = self.problem.measured_force(channel);
        let beyond_noise = dot(rest, rest) - self.problem.noise[channel].powi(2) * rest.len() as f64;
        let is_large = beyond_noise > LARGE_RESIDUAL_SHARE.powi(2) * dot(&force, &force);
        (is_large && !self.problem.is_idle(channel)).then_some(beyond_noise)
    }
}
