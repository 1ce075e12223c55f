//! What supports each effect of the last set, and the probability that follows from it.
//!
//! Odds from the likelihood alone are extreme for the best of many candidates, whatever the data. So the probability
//! uses what separates true findings from false ones: the share of the error of its drives that an effect explains where
//! it was not fitted, how steadily over the blocks of time, the repeatable residual that stays on these drives, and the
//! alternatives. It is monotone in each of them; the constants are calibrated on benchmarks whose truth is known, see
//! [`super::thresholds`].

use nalgebra::DVector;
use serde::Serialize;

use super::SetResidual;
use super::aliases::EffectAlias;
use super::bench::{EffectSelector, SelectedEffect};
use super::evidence::SelectionEvidence;
use super::pool::FitScope;
use super::thresholds::{
    CANCELLING_MOST_SHARE, CLEAR_LEAST_DEVIATIONS, ODDS_AT_REFERENCE, ODDS_OF_ALTERNATIVE, ODDS_PER_GAIN, ODDS_PER_T,
    ODDS_PER_UNEXPLAINED, PROBABILITY_MOST, SUPPORT_GAIN_RANGE, SUPPORT_GAIN_REFERENCE, SUPPORT_T_RANGE,
    SUPPORT_T_REFERENCE, UNCLEAR_MOST_PROBABILITY,
};
use crate::signal::dot;

/// What supports an effect.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct EffectSupport {
    /// Relative decrease of the squared error of its drives on data that was not fitted.
    pub gain: f64,
    /// How steady the gain is over the blocks of time: its mean divided by its standard error.
    pub t: f64,
    /// Repeatable squared error that remains on its drives, divided by the squared error that it explains there.
    pub unexplained: f64,
    /// Whether the residual of its drives is white noise: then a small gain is as certain as a large one.
    pub white_residual: bool,
    /// Its share of the probability among its alternatives, 0 to 1; 1 if there are none.
    pub share: f64,
    /// Whether one of its parameters differs from zero by more than twice its standard deviation, or its terms at least do
    /// not cancel each other.
    pub has_clear_value: bool,
}

impl EffectSupport {
    /// Probability that the effect is present, 0 to 1: monotone in each quantity.
    pub fn probability(&self) -> f64 {
        (self.share * self.group_probability()).min(PROBABILITY_MOST)
    }

    /// Probability that the effect or one of its alternatives is present, 0 to 1.
    pub fn group_probability(&self) -> f64 {
        let [least_t, most_t] = SUPPORT_T_RANGE;
        let [least_gain, most_gain] = SUPPORT_GAIN_RANGE;
        // In white noise nothing else could explain the gain.
        let [least_t, least_gain] = if self.white_residual {
            [SUPPORT_T_REFERENCE, SUPPORT_GAIN_REFERENCE]
        } else {
            [least_t, least_gain]
        };
        let log_odds = ODDS_AT_REFERENCE
            + ODDS_PER_T * (self.t.clamp(least_t, most_t) / SUPPORT_T_REFERENCE).ln()
            + ODDS_PER_GAIN * (self.gain.clamp(least_gain, most_gain) / SUPPORT_GAIN_REFERENCE).ln()
            - ODDS_PER_UNEXPLAINED * self.unexplained.max(0.0).ln_1p();
        let most = if self.has_clear_value {
            PROBABILITY_MOST
        } else {
            UNCLEAR_MOST_PROBABILITY
        };
        (1.0 / (1.0 + (-log_odds).exp())).min(most)
    }
}

impl EffectSelector<'_> {
    /// Support of each member of a set, with its alternatives and the residual of the set.
    pub(crate) fn support_members(
        &self,
        picks: &[SelectedEffect],
        aliases: &[Vec<EffectAlias>],
        left: &SetResidual,
    ) -> Vec<EffectSupport> {
        let estimates = self.estimate_parameters(picks, FitScope::All);
        let members = aliases.iter().zip(&estimates).enumerate();
        members
            .map(|(i, (aliases, estimates))| {
                let mut without = picks.to_vec();
                let pick = without.remove(i);
                let mut channels = self.affected_channels(&[pick]);
                // An equation without a drive has no noise of its own: base parameters satisfy it at the cost of the
                // other channels, which then show what the effect explains.
                if channels.iter().any(|d| self.problem.is_idle(*d)) {
                    channels = (0..self.weights.len()).collect();
                }
                let evidence = self.evidence(&without, picks, &channels);
                EffectSupport {
                    gain: evidence.gain,
                    t: steadiness(&evidence),
                    unexplained: self.unexplained_ratio(&without, &channels, left),
                    white_residual: evidence.is_residual_white,
                    share: probability_share(aliases),
                    has_clear_value: has_clear_value(estimates) || !self.do_terms_cancel(&picks[i], estimates),
                }
            })
            .collect()
    }

    /// Whether the terms of an effect cancel each other: the square of their sum is clearly below the sum of their squares.
    fn do_terms_cancel(&self, pick: &SelectedEffect, estimates: &[(f64, Option<f64>)]) -> bool {
        let gram = self.pool.gram(&pick.columns, &self.weights, FitScope::All);
        let values = DVector::from_iterator(estimates.len(), estimates.iter().map(|(value, _)| *value));
        let squares_of_terms: f64 = (values.iter().enumerate())
            .map(|(k, value)| value * value * gram[(k, k)])
            .sum();
        (values.transpose() * &gram * &values)[0] < CANCELLING_MOST_SHARE * squares_of_terms
    }

    /// Repeatable squares that a set leaves unexplained on some channels, relative to those that come back without a
    /// member.
    fn unexplained_ratio(&self, without: &[SelectedEffect], channels: &[usize], left: &SetResidual) -> f64 {
        let (factors, _) = self.fit(without, FitScope::All);
        let rest = self.residual(without, &factors);
        let squares = |rest: &[Vec<f64>], d: usize| self.weights[d] * dot(&rest[d], &rest[d]);
        let explained: f64 = (channels.iter())
            .map(|d| squares(&rest, *d) - squares(&left.residual, *d))
            .sum();
        let unexplained = channels.iter().filter(|d| left.unexplained.contains(d));
        let stays: f64 = unexplained
            .map(|d| left.repeatable_share[*d] * squares(&left.residual, *d))
            .sum();
        if stays > 0.0 {
            stays / explained.max(f64::MIN_POSITIVE)
        } else {
            0.0
        }
    }
}

/// Whether one of some estimates differs clearly from zero; false if no uncertainty is known.
fn has_clear_value(estimates: &[(f64, Option<f64>)]) -> bool {
    let mut known = estimates
        .iter()
        .filter_map(|(value, deviation)| Some((*value, (*deviation)?)));
    known.any(|(value, deviation)| value.abs() > CLEAR_LEAST_DEVIATIONS * deviation)
}

/// How steady a gain is: over the blocks, or relative to the error of each block, whichever is steadier. A gain that is
/// concentrated in few blocks has a small mean over its standard error although every block gains.
fn steadiness(evidence: &SelectionEvidence) -> f64 {
    evidence.blocks_t.max(evidence.shares_t)
}

/// Share of an effect among its alternatives. One that explains the data better was passed over for a simpler cause, so
/// that it counts like an equal one; another form of the same effect does not count.
fn probability_share(aliases: &[EffectAlias]) -> f64 {
    let rivals = aliases.iter().filter(|alias| !alias.is_equivalent_form);
    let others: f64 = rivals
        .map(|alias| ODDS_OF_ALTERNATIVE * (-0.5 * alias.criterion_loss.max(0.0)).exp())
        .sum();
    1.0 / (1.0 + others)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn alias(criterion_loss: f64, is_equivalent_form: bool) -> EffectAlias {
        EffectAlias {
            effect: super::super::problem::LocatedEffect {
                kind: "kind".into(),
                at: vec!["drive".into()],
            },
            criterion_loss,
            is_equivalent_form,
        }
    }

    /// More gain, a steadier gain, less that is unexplained and fewer alternatives never lower the probability.
    #[test]
    fn more_support_means_a_higher_probability() {
        let steps = [0.0, 0.01, 0.1, 0.3, 0.7, 1.0];
        for gain in steps {
            for t in steps.map(|x| 10.0 * x) {
                for unexplained in steps {
                    for share in steps {
                        let one = EffectSupport {
                            gain,
                            t,
                            unexplained,
                            white_residual: false,
                            share,
                            has_clear_value: false,
                        };
                        let p = one.probability();
                        assert!((0.0..=PROBABILITY_MOST).contains(&p), "{one:?}: {p}");
                        for more in [
                            EffectSupport {
                                gain: gain + 0.1,
                                ..one
                            },
                            EffectSupport { t: t + 1.0, ..one },
                            EffectSupport {
                                white_residual: true,
                                ..one
                            },
                            EffectSupport {
                                share: (share + 0.1).min(1.0),
                                ..one
                            },
                            EffectSupport {
                                has_clear_value: true,
                                ..one
                            },
                            EffectSupport {
                                unexplained: unexplained / 2.0,
                                ..one
                            },
                        ] {
                            assert!(more.probability() >= p, "{one:?} {more:?}");
                        }
                    }
                }
            }
        }
    }

    /// One clear parameter is enough; without a known uncertainty nothing is known.
    #[test]
    fn one_parameter_beyond_its_uncertainty_is_clear() {
        assert!(!has_clear_value(&[
            (-162.0, Some(235.0)),
            (921.0, Some(4020.0)),
            (0.0, None)
        ]));
        assert!(has_clear_value(&[(-162.0, Some(235.0)), (921.0, Some(40.0))]));
        assert!(!has_clear_value(&[(1.0, None)]));
    }

    /// An alternative takes at most as much as an equal one, however much better it fits, and another form of the same
    /// effect takes nothing.
    #[test]
    fn an_alternative_takes_at_most_an_equal_share() {
        assert!((probability_share(&[]) - 1.0).abs() < 1e-12);
        assert!((probability_share(&[alias(0.0, true)]) - 1.0).abs() < 1e-12);
        let equal = probability_share(&[alias(0.0, false)]);
        assert!((probability_share(&[alias(-40.0, false)]) - equal).abs() < 1e-12);
        assert!(probability_share(&[alias(6.0, false)]) > equal);
        assert!(equal > 0.5);
    }
}
