//! Idle channels, which have no force signal since nothing drives there: their equation of motion has the force zero.
//! They have no sensor faults, and their noise is that of the states, which appears in the residual of a fit. Input:
//! the problem; output: the noise of its idle channels, and the size of their terms.
//!
//! Decision: the equations of an idle channel are not believed more than those of the driven ones, relative to the size of
//! their terms. Its residual is smallest where all terms are small, so that a weight from its own residual would force
//! wrong parameters as long as an effect is missing at a drive.

use super::bench::EffectSelector;
use super::noise::white_noise;
use super::pool::FitScope;
use super::problem::{DiagnosisProblem, NoColumnProvider};
use super::thresholds::FORCE_ROUNDING;
use crate::signal::dot;

impl DiagnosisProblem {
    /// Whether a channel has no force signal.
    pub(crate) fn is_idle(&self, channel: usize) -> bool {
        self.idle.get(channel).is_some_and(|idle| *idle)
    }

    /// Estimates the noise of idle channels.
    ///
    /// With zero forces alone, zero parameters would fit. So the parameters are first estimated from the channels with
    /// a signal. They give the size of the forces of an idle channel, by which its rows are weighted in a second fit;
    /// the residual of that fit is the noise.
    pub(crate) fn estimate_idle_noise(&mut self) {
        if !self.idle.contains(&true) {
            return;
        }
        // The model is fitted without candidates.
        let candidates = std::mem::take(&mut self.candidates);
        let found = EffectSelector::new(self, &NoColumnProvider).idle_channel_noise();
        self.candidates = candidates;
        self.idle_squares = vec![0.0; self.layout.channels.len()];
        for (channel, noise, squares) in found {
            self.noise[channel] = noise;
            self.idle_squares[channel] = squares;
        }
    }
}

impl EffectSelector<'_> {
    /// Standard deviation of the noise of each idle channel, and mean square of its terms, as (channel, noise in N or
    /// N m, square of that unit).
    fn idle_channel_noise(&mut self) -> Vec<(usize, f64, f64)> {
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
        // First fit: only channels with a force signal have weight.
        let (factors, _) = self.fit(&[], FitScope::All);
        let idle: Vec<usize> = channels.filter(|d| problem.is_idle(*d)).collect();
        // Size of the terms that cancel in an idle channel: mean squares of the columns times their factors.
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
        // Second fit: all channels, idle ones weighted by that size.
        let (factors, _) = self.fit(&[], FitScope::All);
        let rest = self.residual(&[], &factors);
        // The noise is not below rounding.
        let noise = |(d, size): (&usize, &f64)| {
            let rounding = FORCE_ROUNDING * size.max(mean(&rest[*d])).sqrt();
            (*d, white_noise(&rest[*d]).max(rounding), *size)
        };
        idle.iter().zip(&sizes).map(noise).collect()
    }
}
