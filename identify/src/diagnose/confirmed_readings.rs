//! Whether faults of force signals are confirmed.
//!
//! Decision: a scale is the bin into which any error in proportion to the force falls, so it must have the same value in
//! each half of the data and explain most of the error of its drive. A delay or a low-pass explains what smoothing of the
//! positions does to dry friction at reversals, so it must lower the error far from reversals too. The same holds for
//! friction that builds up after reversals.

use super::bench::{EffectSelector, SelectedEffect};
use super::pool::solve_gram;
use super::problem::{ColumnSource, ReadingFaultKind};
use super::thresholds::{
    DELAY_LEAST_SHARE_FAR, FAR_LEAST_SHARE, FAR_REVERSAL_SAMPLES, SCALE_MOST_DIFFERENCE, SCALE_MOST_REMAINING_SHARE,
};

impl EffectSelector<'_> {
    /// Whether every fault of a force signal in a set is confirmed, and every form of friction that resembles one.
    pub(crate) fn are_readings_confirmed(&self, picks: &[SelectedEffect]) -> bool {
        (0..picks.len()).all(|i| match self.candidate(&picks[i]).source {
            ColumnSource::ReadingFault(fault) if fault.kind == ReadingFaultKind::Scaled => {
                self.is_scale_confirmed(picks, i)
            }
            ColumnSource::ReadingFault(_) => self.is_confirmed_far_from_reversals(picks, i),
            _ if self.acts_after_reversals(&picks[i]) => self.is_confirmed_far_from_reversals(picks, i),
            _ => true,
        })
    }

    /// Whether an effect is a form of friction that builds up over a searched distance after reversals, such as Dahl
    /// friction.
    fn acts_after_reversals(&self, pick: &SelectedEffect) -> bool {
        let candidate = self.candidate(pick);
        candidate.refines.is_some() && candidate.searched_constants > 0 && candidate.parameters.len() == 1
    }

    /// Whether the member at a position of a set lowers the squared error far from reversals about as it does
    /// everywhere. It is confirmed if few samples are far from reversals, since nothing can be known then.
    fn is_confirmed_far_from_reversals(&self, picks: &[SelectedEffect], member: usize) -> bool {
        let channels = self.affected_channels(&picks[member..=member]);
        let mut without = picks.to_vec();
        without.remove(member);
        let [old, new] = [without.as_slice(), picks].map(|set| self.full_residual(set));
        let far = self.samples_far_from_reversals();
        let is_known = |d: &&usize| {
            let count = far[**d].iter().filter(|is_far| **is_far).count();
            count as f64 > FAR_LEAST_SHARE * far[**d].len() as f64
        };
        let known: Vec<usize> = channels.iter().filter(is_known).copied().collect();
        let gain = |is_counted: &dyn Fn(usize, usize) -> bool| -> f64 {
            let squares = |rest: &[Vec<f64>]| -> f64 {
                let of = |d: &usize| {
                    let counted = rest[*d].iter().enumerate().filter(|(i, _)| is_counted(*d, *i));
                    self.weights[*d] * counted.map(|(_, r)| r * r).sum::<f64>()
                };
                known.iter().map(of).sum()
            };
            1.0 - squares(&new) / squares(&old).max(f64::MIN_POSITIVE)
        };
        known.is_empty() || gain(&|d, i| far[d][i]) >= DELAY_LEAST_SHARE_FAR * gain(&|_, _| true)
    }

    /// Samples at which no drive is near a reversal of its own, `[channel][sample]`; all where rates are unknown.
    fn samples_far_from_reversals(&self) -> Vec<Vec<bool>> {
        let samples = self.problem.layout.samples();
        let channels = 0..self.problem.layout.channels.len();
        channels
            .map(|d| {
                let mut far = vec![true; samples];
                let column = self.problem.friction.get(3 * d);
                let Some(rate) = column.and_then(|column| column.0[d].as_ref()) else {
                    return far;
                };
                for i in 1..samples {
                    if rate[i - 1] * rate[i] <= 0.0 {
                        let from = i.saturating_sub(FAR_REVERSAL_SAMPLES);
                        far[from..(i + FAR_REVERSAL_SAMPLES).min(samples)].fill(false);
                    }
                }
                far
            })
            .collect()
    }

    /// Whether the scale at a position of a set has the same value in both halves of the data, and explains most of the
    /// squared error of its drive where it was not fitted.
    fn is_scale_confirmed(&self, picks: &[SelectedEffect], member: usize) -> bool {
        let channels = self.affected_channels(&picks[member..=member]);
        let mut without = picks.to_vec();
        without.remove(member);
        let error = |set: &[SelectedEffect]| self.validation_errors(set, &channels, false).iter().sum::<f64>();
        if error(picks) > SCALE_MOST_REMAINING_SHARE * error(&without) {
            return false;
        }
        let [first, second] = self.values_by_half(picks, member);
        (first - second).abs() <= SCALE_MOST_DIFFERENCE * first.abs().max(second.abs())
    }

    /// Estimates of the first parameter of a member from each half of the blocks of time.
    fn values_by_half(&self, picks: &[SelectedEffect], member: usize) -> [f64; 2] {
        let mut which = self.columns(picks);
        let before: usize = picks[..member].iter().map(|pick| pick.columns.len()).sum();
        let at = self.base.len() + before;
        which.push(self.measured);
        let folds = self.pool.fold_grams(&which, &self.weights);
        let (first, second) = folds.split_at(folds.len() / 2);
        [first, second].map(|half| {
            let mut parts = half.iter().map(|(_, gram)| gram);
            let Some(mut sum) = parts.next().cloned() else {
                return 0.0;
            };
            for part in parts {
                sum += part;
            }
            solve_gram(&sum).0[at]
        })
    }
}
