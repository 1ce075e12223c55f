//! Channels of which no force is read, since nothing drives there: their equation of motion holds with a force of zero. Nothing
//! can be wrong with a reading that there is not, and their noise is that of the states, which shows in what a fit leaves.

use super::bench::EffectSelector;
use super::noise::{ROUNDING, white_noise};
use super::pool::{FitScope, dot};
use super::problem::{DiagnosisProblem, NoColumnProvider};

impl DiagnosisProblem {
    /// Whether no force of a channel is read.
    pub(crate) fn is_idle(&self, channel: usize) -> bool {
        self.idle.get(channel).is_some_and(|idle| *idle)
    }

    /// Gives idle channels their noise.
    ///
    /// Of zeros alone everything follows if all parameters are zero. So the parameters are those of the channels that are
    /// read; by the size of what these say of an idle channel its rows are weighed in a second fit, which leaves its noise.
    pub(crate) fn estimate_idle_noise(&mut self) {
        if !self.idle.contains(&true) {
            return;
        }
        // Candidates take no part in it.
        let candidates = std::mem::take(&mut self.candidates);
        let found = EffectSelector::new(self, &NoColumnProvider).idle_channel_noise();
        self.candidates = candidates;
        for (channel, noise) in found {
            self.noise[channel] = noise;
        }
    }
}

impl EffectSelector<'_> {
    fn idle_channel_noise(&mut self) -> Vec<(usize, f64)> {
        let problem = self.problem;
        let channels = 0..problem.layout.channels.len();
        let mean = |values: &[f64]| dot(values, values) / values.len().max(1) as f64;
        let over = |squares: f64| if squares > 0.0 { 1.0 / squares } else { 1.0 };
        self.weights = (channels.clone())
            .map(|d| {
                if problem.is_idle(d) {
                    0.0
                } else {
                    over(mean(&problem.measured_force(d)))
                }
            })
            .collect();
        let (factors, _) = self.fit(&[], FitScope::All);
        let idle: Vec<usize> = channels.filter(|d| problem.is_idle(*d)).collect();
        let mut sizes = Vec::new();
        for d in &idle {
            let terms = self.base.iter().zip(factors.iter()).map(|(k, factor)| {
                let values = self.pool.column(*k).0[*d].as_deref();
                factor.powi(2) * values.map_or(0.0, mean)
            });
            sizes.push(terms.sum::<f64>());
        }
        for (d, size) in idle.iter().zip(&sizes) {
            self.weights[*d] = over(*size);
        }
        let (factors, _) = self.fit(&[], FitScope::All);
        let rest = self.residual(&[], &factors);
        let noise = |(d, size): (&usize, &f64)| {
            let rounding = ROUNDING * size.max(mean(&rest[*d])).sqrt();
            (*d, white_noise(&rest[*d]).max(rounding))
        };
        idle.iter().zip(&sizes).map(noise).collect()
    }
}
