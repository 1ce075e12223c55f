//! Whether a set of effects is better than another: by what they leave where they were not fitted.
//!
//! Residuals of mechanisms resemble their neighbours, so that tests that count samples find effects everywhere. Blocks of
//! time that follow each other are compared instead: on the recordings of the check if there are any, else each fold of the
//! fit with factors from the others; where nothing but white noise is left and the check agrees, folds of both. The
//! information criterion counts as many samples as the residual is worth, and asks more of the best of many candidates than
//! of the only one.
//! Sources: J. Racine, "Consistent cross-validatory model-selection for dependent data: hv-block cross-validation",
//! J. Econometrics 99 (2000); G. Schwarz, Annals of Statistics 6 (1978); J. Chen and Z. Chen, "Extended Bayesian
//! information criteria for model selection with large model spaces", Biometrika 95 (2008).
//!
//! Decision: blocks decide and not samples. On EMPS 2480 samples are worth 83, and an F-test that counts samples
//! finds a spring that does not exist. An effect must lower the squared error in contiguous blocks that were not
//! fitted, steadily over the blocks and by a least share. This needs no law of the noise.
//!
//! Decision: where a set leaves white noise of the size of the differences of neighbouring samples, there is no
//! error of the model left. Then the gain on data that was not fitted must be eight variances. Gains below a
//! hundredth of the effects already selected may come from their uncertainty and do not get this threshold.

use nalgebra::DMatrix;
use serde::Serialize;

use super::bench::{Bench, Pick};
use super::pool::{On, dot, solve};

/// Blocks that the error of a stretch is cut into.
const BLOCKS: usize = 12;
/// A change must lower the squared error on its channels by this share where it was not fitted.
pub(crate) const LEAST_GAIN: f64 = 0.02;
/// Where all that is left is white noise the least gain follows from it: so many times its variance less on what was not
/// fitted. Blocks then need less of their own: nothing but noise makes them differ.
const LEAST_OF_NOISE: f64 = 8.0;
const LEAST_T_OF_NOISE: f64 = 1.0;
/// What is left is white noise if it is worth this share of its samples, and no larger than so many times the noise of
/// neighbours.
const WHITE: f64 = 0.5;
const LIKE_NOISE: f64 = 1.5;
/// What adds less than this part of the squares that other effects explain may be how well these are known.
const BESIDE_OTHERS: f64 = 1e-4;
/// What adds less than this part of a force's squares may be what smoothing made of the positions.
const OF_FORCE: f64 = 1e-5;
/// Squared errors below this, in units of what counts as noise, are nobody's.
const BELOW_NOISE: f64 = 0.8;
/// How many of its own deviations over the blocks the gain must be above zero.
const LEAST_T: f64 = 2.5;
/// A gain from which on it is enough that blocks gain by shares of their own, and how sure that must be.
const LARGE_GAIN: f64 = 0.15;
const LEAST_SHARES_T: f64 = 4.0;

/// What speaks for one set of effects beside another.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Evidence {
    /// Share of the squared error that leaves, on the channels where the change acts, where the sets were not fitted.
    pub gain: f64,
    /// The gain in units of its standard deviation over contiguous blocks.
    pub blocks_t: f64,
    /// The same for the gain of each block relative to itself.
    pub shares_t: f64,
    /// By how much the extended information criterion falls, with the effective number of samples and the number of
    /// candidates that there were to choose from.
    pub bic: f64,
    /// How many independent equations the residual after is worth.
    pub effective_samples: f64,
    /// The squared error before, relative to the white noise of the channels: less than 1 only where there is nothing but rounding.
    pub above_noise: f64,
    /// What the gain must reach: a share that matters, or less where all that is left is white noise.
    pub least_gain: f64,
}

impl Evidence {
    /// Whether it is enough to believe in a change.
    pub fn holds(&self) -> bool {
        self.gain >= self.least_gain
            && self.is_steady()
            && self.bic > 0.0
            && self.above_noise > BELOW_NOISE
    }

    /// Whether a change that was found before is worth keeping.
    pub(crate) fn would_be_missed(&self) -> bool {
        let is_large = self.gain >= LARGE_GAIN && self.bic > 0.0 && self.above_noise > BELOW_NOISE;
        self.holds() || is_large
    }

    /// Whether the gain is the same all along: in the mean over the blocks, or, if it is large, block by block.
    fn is_steady(&self) -> bool {
        let least_t = if self.least_gain < LEAST_GAIN {
            LEAST_T_OF_NOISE
        } else {
            LEAST_T
        };
        self.blocks_t >= least_t || self.gain >= LARGE_GAIN && self.shares_t >= LEAST_SHARES_T
    }

    /// What is lacking, in words.
    pub fn lacks(&self, has_check: bool) -> Option<&'static str> {
        if self.above_noise <= BELOW_NOISE {
            Some("what is left is rounding")
        } else if self.gain <= 0.0 || !self.is_steady() {
            Some(if has_check {
                "not supported by the check"
            } else {
                "not supported by cross-validation"
            })
        } else if self.gain < self.least_gain {
            Some("too small to matter")
        } else if self.bic <= 0.0 {
            Some("not worth its parameters")
        } else {
            None
        }
    }
}

impl Bench<'_> {
    /// Evidence for the set `after` beside `before`; `channels` are those on which they differ.
    pub(crate) fn evidence(&self, before: &[Pick], after: &[Pick], channels: &[usize]) -> Evidence {
        let [old_rest, new_rest] = [before, after].map(|picks| {
            let (factors, _) = self.fit(picks, On::All);
            self.rest(picks, &factors)
        });
        let squares = |rest: &[Vec<f64>]| -> f64 {
            let of = |d: &usize| self.weights[*d] * dot(&rest[*d], &rest[*d]);
            channels.iter().map(of).sum()
        };
        let [old_squares, new_squares] = [squares(&old_rest), squares(&new_rest)];
        let is_noise_known = self.is_white(&new_rest, channels)
            && self.is_no_remainder(before, old_squares - new_squares, channels);
        let held_out =
            |by_folds: bool| [before, after].map(|picks| self.held_out(picks, channels, by_folds));
        let is_per_run = |pick: &Pick| self.candidate(pick).is_per_run;
        let mut compared = held_out(before.iter().chain(after).any(is_per_run));
        // A check that speaks for a change, however softly, joins the fit where all that is left is white noise: both together
        // show effects that neither shows alone.
        if is_noise_known && sum(&compared[0]) > sum(&compared[1]) {
            compared = held_out(true);
        }
        let [old, new] = compared;
        let n = old.len() as f64;
        let differences: Vec<f64> = old.iter().zip(&new).map(|(a, b)| a - b).collect();
        let mean = differences.iter().sum::<f64>() / n;
        let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>();
        let error = (variance / (n * (n - 1.0).max(1.0))).sqrt();
        let t = if error > 0.0 { mean / error } else { 0.0 };
        // Where the error sits in few blocks their sizes differ more than a mean can bear: shares do not.
        let shares: Vec<f64> = (old.iter().zip(&new))
            .map(|(a, b)| if a + b > 0.0 { (a - b) / (a + b) } else { 0.0 })
            .collect();
        let mean_share = shares.iter().sum::<f64>() / n;
        let spread = shares.iter().map(|s| (s - mean_share).powi(2)).sum::<f64>();
        let error_share = (spread / (n * (n - 1.0).max(1.0))).sqrt().max(1e-3);
        let shares_t = mean_share / error_share;
        let total = sum(&old);
        let count = |picks: &[Pick]| -> f64 {
            let freedoms = picks.iter().map(|p| self.freedoms(p));
            freedoms.sum::<usize>() as f64
        };
        let worth = self.worth(&new_rest, channels);
        // The best of so many fits chance better than any one of them.
        let choices = (self.problem.candidates.len().max(1) as f64).ln();
        let price = |picks: &[Pick]| count(picks) * worth.ln() + 2.0 * picks.len() as f64 * choices;
        Evidence {
            gain: if total > 0.0 { n * mean / total } else { 0.0 },
            blocks_t: t,
            shares_t,
            bic: worth * (old_squares / new_squares.max(f64::MIN_POSITIVE)).ln()
                - (price(after) - price(before)),
            effective_samples: worth,
            above_noise: self.above_noise(&old_rest, channels),
            least_gain: {
                // Weights are one over the variance of what is left, which is the noise where it is known.
                let of_noise = LEAST_OF_NOISE / total.max(f64::MIN_POSITIVE);
                if !self.is_beyond_smoothing(old_squares - new_squares, channels) {
                    f64::INFINITY
                } else if is_noise_known {
                    of_noise.min(LEAST_GAIN)
                } else {
                    LEAST_GAIN
                }
            },
        }
    }

    /// Whether a residual is white noise on some channels, no larger than neighbours differ by.
    fn is_white(&self, rest: &[Vec<f64>], channels: &[usize]) -> bool {
        channels.iter().all(|d| {
            let counted = rest[*d].iter().filter(|r| **r != 0.0).count() as f64;
            self.worth(rest, &[*d]) > WHITE * counted && self.above_noise(rest, &[*d]) < LIKE_NOISE
        })
    }

    /// Whether squares that a change takes off are more than what may be wrong with the effects beside it.
    fn is_no_remainder(&self, before: &[Pick], less: f64, channels: &[usize]) -> bool {
        let explained = |picks: &[Pick]| {
            let (factors, _) = self.fit(picks, On::All);
            let rest = self.rest(picks, &factors);
            let of = |d: &usize| self.weights[*d] * dot(&rest[*d], &rest[*d]);
            channels.iter().map(of).sum::<f64>()
        };
        before.is_empty() || less > BESIDE_OTHERS * (explained(&[]) - explained(before))
    }

    /// Whether squares that a change takes off are more than what smoothing the positions may have made, where parameters are
    /// held and cannot take that up; those of a fit have taken it up.
    fn is_beyond_smoothing(&self, less: f64, channels: &[usize]) -> bool {
        let squares = |d: &usize| {
            let force = self.problem.force(*d);
            self.weights[*d] * dot(&force, &force)
        };
        let is_exact = self.problem.held.is_some() && self.problem.prior.is_none();
        !is_exact || less > OF_FORCE * channels.iter().map(squares).sum::<f64>()
    }

    /// Squares of a residual relative to those of the white noise, over some channels.
    fn above_noise(&self, rest: &[Vec<f64>], channels: &[usize]) -> f64 {
        let of = |d: &usize| {
            let noise = self.problem.noise[*d].powi(2).max(f64::MIN_POSITIVE);
            dot(&rest[*d], &rest[*d]) / rest[*d].len().max(1) as f64 / noise
        };
        channels.iter().map(of).sum::<f64>() / channels.len().max(1) as f64
    }

    /// Weighted squared errors of some channels in blocks of time to which the set was not fitted: those of the check, or
    /// each fold of all recordings where there is none or where they have parameters of their own.
    pub(crate) fn held_out(&self, picks: &[Pick], channels: &[usize], by_folds: bool) -> Vec<f64> {
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
            let (factors, _) = self.fit(picks, On::Fit);
            let rest = self.rest(picks, &factors);
            let fit = layout.fit_samples();
            let checked = blocks.iter().filter(|block| block.start >= fit);
            return checked.map(|block| square(&rest, block)).collect();
        }
        let mut which = self.columns(picks);
        which.push(self.measured);
        let folds = self.pool.fold_grams(&which, &self.weights);
        let n = which.len();
        let whole = (folds.iter()).fold(DMatrix::zeros(n, n), |sum, (_, part)| sum + part);
        let fold_errors = folds.iter().map(|(fold, own)| {
            let part = &whole - own;
            let (factors, _) = solve(&part);
            // Only the fold itself is of interest.
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
                self.pool.silence(*d, fold.start, &mut rest);
                error += self.weights[*d] * dot(&rest, &rest);
            }
            error
        });
        fold_errors.collect()
    }

    /// Channels on which some effects act.
    pub(crate) fn acted_on(&self, picks: &[Pick]) -> Vec<usize> {
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

fn sum(errors: &[f64]) -> f64 {
    errors.iter().sum()
}
