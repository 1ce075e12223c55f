//! Delays in a set: columns as late as the fit says, and none that is less than a sampler's own.

use super::bench::{Bench, Pick, Trial};
use super::pool::On;
use super::problem::Source;

impl Bench<'_> {
    /// Passes over a delay that would be less than half a sample beside a set.
    pub(crate) fn leave_out_slight_delays(&mut self, accepted: &[Pick]) {
        let all = self.present.iter().flatten();
        let delays: Vec<Pick> = all
            .filter(|p| matches!(self.candidate(p).source, Source::Delay))
            .cloned()
            .collect();
        for delay in delays {
            let candidate = delay.candidate;
            let mut set = accepted.to_vec();
            set.push(delay);
            let set = self.refresh(set);
            let trial = self.trial(set);
            if self.is_slight_delay(&trial) {
                self.present[candidate] = None;
            }
        }
    }

    /// A set whose effects that depend on the fit have been made anew by it.
    pub(crate) fn settled(&mut self, trial: &Trial) -> Trial {
        let fixed = |p: &Pick| matches!(self.candidate(p).source, Source::Columns(_));
        if trial.picks.iter().all(fixed) {
            return trial.clone();
        }
        let score = trial.score;
        let picks = self.refresh(trial.picks.clone());
        Trial {
            score,
            ..self.trial(picks)
        }
    }

    /// Whether a set holds a delay of less than half a sample, which is how samplers are, and no finding.
    pub(crate) fn is_slight_delay(&self, trial: &Trial) -> bool {
        let is_delay = |pick: &Pick| matches!(self.candidate(pick).source, Source::Delay);
        let Some(at) = trial.picks.iter().position(is_delay) else {
            return false;
        };
        let before: usize = trial.picks[..at].iter().map(|p| p.columns.len()).sum();
        // On the fit alone and on all: what differs between recordings is no delay.
        let delay = [On::Fit, On::All]
            .map(|on| self.fit(&trial.picks, on).0[self.base.len() + before].abs())
            .into_iter()
            .fold(f64::INFINITY, f64::min);
        let steps = self.problem.layout.stretches.iter().map(|s| s.sampled);
        delay < 0.5 * steps.fold(0.0, f64::max)
    }
}
