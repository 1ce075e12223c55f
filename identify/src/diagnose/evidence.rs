//! Decides whether a set of effects is better than another, by their residuals on data to which they were not fitted.
//!
//! Residuals of mechanisms are correlated in time, so that tests that count samples find effects everywhere. Contiguous
//! blocks of time are compared instead: on the validation runs if there are any, else each fold of the fit with factors
//! from the other folds. If the residual is white noise and the validation runs agree, folds of both are used. The
//! information criterion counts the effective number of samples, and requires more of the best of many candidates than
//! of a single one.
//! Sources: J. Racine, "Consistent cross-validatory model-selection for dependent data: hv-block cross-validation", J.
//! Econometrics 99 (2000); G. Schwarz, Annals of Statistics 6 (1978); J. Chen and Z. Chen, "Extended Bayesian
//! information criteria for model selection with large model spaces", Biometrika 95 (2008).
//!
//! Decision: blocks decide and not samples. On EMPS 2480 samples are worth 83, and an F-test that counts samples finds
//! a spring that does not exist. An effect must lower the squared error in contiguous blocks that were not fitted,
//! steadily over the blocks and by a least share. This needs no model of the noise.
//!
//! Decision: if the residual of a set is white noise of the size of the differences of neighbouring samples, no model
//! error is left. Then the gain on data that was not fitted must be eight variances. Gains below a hundredth of the
//! effects already selected may come from their uncertainty and do not get this threshold.

use nalgebra::DMatrix;
use serde::Serialize;

use super::bench::{EffectSelector, SelectedEffect};
use super::pool::{FitScope, solve_gram};
use super::rejection::RejectionReason;
use super::thresholds::{
    BLOCKS_LEAST_T, EXPLICABLE_LEAST_NOISE_RATIO, GIVEN_BACK_LEAST_T, GIVEN_BACK_MOST_SHARE, LARGE_GAIN, LEAST_GAIN,
    LEAST_SHARES_T, MATERIAL_LEAST_GAIN, MIN_SHARE_OF_FORCE, MIN_SHARE_OF_OTHERS, MIN_SHARE_OF_REMOVED,
    NOISE_LEAST_GAIN_VARIANCES, NOISE_LEAST_T, WHITE_LEAST_EFFECTIVE_SHARE, WHITE_MOST_NOISE_RATIO,
};
use crate::signal::dot;

/// Number of blocks into which the error of a segment is divided.
const BLOCKS: usize = 12;

/// Evidence for one set of effects compared with another.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct SelectionEvidence {
    /// Relative decrease of the squared error on data that was not fitted, on the channels where the change acts.
    pub gain: f64,
    /// Mean gain of the blocks, divided by its standard error (t value).
    pub blocks_t: f64,
    /// The same for the gain of each block relative to the error of that block.
    pub shares_t: f64,
    /// Decrease of the extended information criterion, with the effective number of samples and the number of
    /// candidates.
    pub bic: f64,
    /// Effective number of samples of the residual after the change.
    pub effective_samples: f64,
    /// The squared error before the change, relative to the white noise of the channels; below 1 only if nothing but
    /// rounding is left.
    pub above_noise: f64,
    /// Least gain that is accepted: a fixed share, or less if the residual is white noise.
    pub least_gain: f64,
    /// Whether the residual after the change is white noise, so that nothing else is left.
    pub is_residual_white: bool,
}

impl SelectionEvidence {
    /// Whether the evidence is enough to accept a change.
    pub fn is_sufficient(&self) -> bool {
        self.gain >= self.least_gain
            && self.is_steady()
            && self.bic > 0.0
            && self.above_noise > EXPLICABLE_LEAST_NOISE_RATIO
    }

    /// Whether a change that was accepted before is worth keeping.
    pub(crate) fn is_worth_keeping(&self) -> bool {
        let is_large = self.gain >= LARGE_GAIN && self.bic > 0.0 && self.above_noise > EXPLICABLE_LEAST_NOISE_RATIO;
        self.is_sufficient() || is_large
    }

    /// Whether a change that would be undone here has lowered the error by more than noise.
    pub(crate) fn gives_back(&self) -> bool {
        self.gain > GIVEN_BACK_MOST_SHARE && self.blocks_t > GIVEN_BACK_LEAST_T
    }

    /// Whether the gain is consistent over time: in the mean over the blocks, or, if it is large, relative to each
    /// block.
    fn is_steady(&self) -> bool {
        let least_t = if self.least_gain < LEAST_GAIN {
            NOISE_LEAST_T
        } else {
            BLOCKS_LEAST_T
        };
        self.blocks_t >= least_t || self.gain >= LARGE_GAIN && self.shares_t >= LEAST_SHARES_T
    }

    /// Why the evidence is not sufficient; `None` if it is. `has_check` selects the name of the validation
    /// method.
    pub fn insufficiency_reason(&self, has_check: bool) -> Option<RejectionReason> {
        if self.above_noise <= EXPLICABLE_LEAST_NOISE_RATIO {
            Some(RejectionReason::OnlyNoiseRemains)
        } else if self.gain <= 0.0 || !self.is_steady() {
            Some(if has_check {
                RejectionReason::NotConfirmedByValidation
            } else {
                RejectionReason::NotConfirmedByFolds
            })
        } else if self.gain < self.least_gain {
            Some(RejectionReason::GainTooSmall)
        } else if self.bic <= 0.0 {
            Some(RejectionReason::TooManyParameters)
        } else {
            None
        }
    }
}

impl EffectSelector<'_> {
    /// Evidence for the set `after` compared with `before`; `channels` are those on which they differ.
    pub(crate) fn evidence(
        &self,
        before: &[SelectedEffect],
        after: &[SelectedEffect],
        channels: &[usize],
    ) -> SelectionEvidence {
        let [old_rest, new_rest] = [before, after].map(|picks| {
            let (factors, _) = self.fit(picks, FitScope::All);
            self.residual(picks, &factors)
        });
        let squares = |rest: &[Vec<f64>]| -> f64 {
            let of = |d: &usize| self.weights[*d] * dot(&rest[*d], &rest[*d]);
            channels.iter().map(of).sum()
        };
        let [old_squares, new_squares] = [squares(&old_rest), squares(&new_rest)];
        let is_noise_known =
            self.is_white(&new_rest, channels) && self.is_above_fit_error(before, old_squares - new_squares, channels);
        let held_out = |by_folds: bool| [before, after].map(|picks| self.validation_errors(picks, channels, by_folds));
        let is_per_run = |pick: &SelectedEffect| self.candidate(pick).is_per_run;
        let mut compared = held_out(before.iter().chain(after).any(is_per_run));
        // If the residual is white noise and the validation runs support the change, they join the fit: both together
        // show effects that neither shows alone.
        if is_noise_known && sum_errors(&compared[0]) > sum_errors(&compared[1]) {
            compared = held_out(true);
        }
        let [old, new] = compared;
        let n = old.len() as f64;
        let differences: Vec<f64> = old.iter().zip(&new).map(|(a, b)| a - b).collect();
        let mean = differences.iter().sum::<f64>() / n;
        let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>();
        let error = (variance / (n * (n - 1.0).max(1.0))).sqrt();
        let t = if error > 0.0 { mean / error } else { 0.0 };
        // If the error is concentrated in few blocks, the t value of their mean is too low. Relative gains do not have
        // this problem.
        let shares: Vec<f64> = (old.iter().zip(&new))
            .map(|(a, b)| if a + b > 0.0 { (a - b) / (a + b) } else { 0.0 })
            .collect();
        let mean_share = shares.iter().sum::<f64>() / n;
        let spread = shares.iter().map(|s| (s - mean_share).powi(2)).sum::<f64>();
        let error_share = (spread / (n * (n - 1.0).max(1.0))).sqrt().max(1e-3);
        let shares_t = mean_share / error_share;
        let total = sum_errors(&old);
        let count = |picks: &[SelectedEffect]| -> f64 {
            let freedoms = picks.iter().map(|p| self.freedoms(p));
            freedoms.sum::<usize>() as f64
        };
        let worth = self.effective_equations(&new_rest, channels);
        // The best of many candidates fits the noise better than a single one, so the price grows with their number.
        let choices = (self.problem.candidates.len().max(1) as f64).ln();
        let price = |picks: &[SelectedEffect]| count(picks) * worth.ln() + 2.0 * picks.len() as f64 * choices;
        SelectionEvidence {
            gain: if total > 0.0 { n * mean / total } else { 0.0 },
            blocks_t: t,
            shares_t,
            bic: worth * (old_squares / new_squares.max(f64::MIN_POSITIVE)).ln() - (price(after) - price(before)),
            effective_samples: worth,
            above_noise: self.squares_over_noise(&old_rest, channels),
            is_residual_white: is_noise_known,
            least_gain: {
                // Weights are one over the variance of the residual, which is the noise where it is known.
                let of_noise = NOISE_LEAST_GAIN_VARIANCES / total.max(f64::MIN_POSITIVE);
                let less = old_squares - new_squares;
                if !self.is_above_smoothing_error(less, channels) || !self.is_above_removed_error(less, channels) {
                    f64::INFINITY
                } else if is_noise_known {
                    of_noise.clamp(MATERIAL_LEAST_GAIN, LEAST_GAIN)
                } else {
                    LEAST_GAIN
                }
            },
        }
    }

    /// Whether a residual is white noise on some channels, and not larger than the noise between neighbouring samples.
    fn is_white(&self, rest: &[Vec<f64>], channels: &[usize]) -> bool {
        channels.iter().all(|d| {
            let counted = rest[*d].iter().filter(|r| **r != 0.0).count() as f64;
            self.effective_equations(rest, &[*d]) > WHITE_LEAST_EFFECTIVE_SHARE * counted
                && self.squares_over_noise(rest, &[*d]) < WHITE_MOST_NOISE_RATIO
        })
    }

    /// Whether a decrease of the squares is larger than the uncertainty of the effects that are already in the set.
    fn is_above_fit_error(&self, before: &[SelectedEffect], less: f64, channels: &[usize]) -> bool {
        let explained = |picks: &[SelectedEffect]| {
            let (factors, _) = self.fit(picks, FitScope::All);
            let rest = self.residual(picks, &factors);
            let of = |d: &usize| self.weights[*d] * dot(&rest[*d], &rest[*d]);
            channels.iter().map(of).sum::<f64>()
        };
        before.is_empty() || less > MIN_SHARE_OF_OTHERS * (explained(&[]) - explained(before))
    }

    /// Whether a decrease of the squares is larger than the error that smoothing the positions may cause. This matters
    /// only if parameters are fixed: estimated ones absorb that error.
    fn is_above_smoothing_error(&self, less: f64, channels: &[usize]) -> bool {
        let squares = |d: &usize| {
            let force = self.problem.measured_force(*d);
            self.weights[*d] * dot(&force, &force)
        };
        let is_exact = self.problem.fixed_forces.is_some() && self.problem.prior.is_none();
        !is_exact || less > MIN_SHARE_OF_FORCE * channels.iter().map(squares).sum::<f64>()
    }

    /// Whether a decrease of the squares is larger than the error that subtracting differences between recordings may leave.
    fn is_above_removed_error(&self, less: f64, channels: &[usize]) -> bool {
        let removed = |d: &usize| {
            let samples = self.problem.measured_force(*d).len() as f64;
            self.weights[*d] * samples * self.problem.removed_differences.get(*d).copied().unwrap_or(0.0)
        };
        less > MIN_SHARE_OF_REMOVED * channels.iter().map(removed).sum::<f64>()
    }

    /// Squares of a residual relative to the white noise, mean over some channels.
    pub(super) fn squares_over_noise(&self, rest: &[Vec<f64>], channels: &[usize]) -> f64 {
        let of = |d: &usize| {
            let noise = self.problem.noise[*d].powi(2).max(f64::MIN_POSITIVE);
            self.pool.mean_square(*d, &rest[*d]) / noise
        };
        channels.iter().map(of).sum::<f64>() / channels.len().max(1) as f64
    }

    /// Weighted squared errors of some channels in blocks to which the set was not fitted, one per block: the blocks of
    /// the validation runs, or each fold of all recordings if there are none or if recordings have parameters of their
    /// own.
    pub(crate) fn validation_errors(&self, picks: &[SelectedEffect], channels: &[usize], by_folds: bool) -> Vec<f64> {
        let layout = &self.problem.layout;
        let square = |rest: &[Vec<f64>], range: &std::ops::Range<usize>| -> f64 {
            let of = |d: &usize| {
                let part = &rest[*d][range.clone()];
                self.weights[*d] * dot(part, part)
            };
            channels.iter().map(of).sum()
        };
        let blocks = layout.blocks(BLOCKS);
        if layout.has_check() && !by_folds {
            let (factors, _) = self.fit(picks, FitScope::Fit);
            let rest = self.residual(picks, &factors);
            let fit = layout.fit_samples();
            let checked = blocks.iter().filter(|block| block.start >= fit);
            return checked.map(|block| square(&rest, block)).collect();
        }
        let mut which = self.columns(picks);
        which.push(self.measured);
        let folds = self.pool.fold_grams(&which, &self.weights);
        let n = which.len();
        // The fit without a fold follows from the sum of all inner products minus those of the fold.
        let whole = (folds.iter()).fold(DMatrix::zeros(n, n), |sum, (_, part)| sum + part);
        let fold_errors = folds.iter().map(|(fold, own)| {
            let part = &whole - own;
            let (factors, _) = solve_gram(&part);
            // The residual is needed on the fold only.
            let mut error = 0.0;
            for d in channels {
                let mut rest: Vec<f64> = self.pool.column(self.measured).0[*d]
                    .as_ref()
                    .map_or_else(|| vec![0.0; fold.len()], |y| y[fold.clone()].to_vec());
                for (k, factor) in which.iter().zip(factors.iter()) {
                    if let Some(values) = &self.pool.column(*k).0[*d] {
                        for (r, x) in rest.iter_mut().zip(&values[fold.clone()]) {
                            *r -= factor * x;
                        }
                    }
                }
                self.pool.zero_excluded(*d, fold.start, &mut rest);
                error += self.weights[*d] * dot(&rest, &rest);
            }
            error
        });
        fold_errors.collect()
    }

    /// Channels on which at least one of some effects acts, sorted.
    pub(crate) fn affected_channels(&self, picks: &[SelectedEffect]) -> Vec<usize> {
        let mut channels: Vec<usize> = picks
            .iter()
            .flat_map(|pick| &pick.columns)
            .flat_map(|k| self.pool.column(*k).channels())
            .collect();
        channels.sort_unstable();
        channels.dedup();
        channels
    }
}

/// Sum of squared errors over blocks.
fn sum_errors(errors: &[f64]) -> f64 {
    errors.iter().sum()
}
