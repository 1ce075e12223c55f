//! What recordings have that no part of the model is: faults of sensors, of the day, of the recording.

use super::bench::{EffectSelector, SelectedEffect};
use super::noise::effective_samples;
use super::pool::dot;
use super::problem::{CandidateNature, DiagnosisProblem};

/// A value of a disturbance or an effect.
#[derive(Clone, Debug, PartialEq)]
pub struct EstimatedQuantity {
    /// What it is.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Its standard deviation, where it is known.
    pub standard_deviation: Option<f64>,
    /// Unit of both.
    pub unit: String,
}

impl EstimatedQuantity {
    /// A value without a deviation.
    pub fn new(name: &str, value: f64, unit: &str) -> Self {
        Self {
            name: name.to_owned(),
            value,
            standard_deviation: None,
            unit: unit.to_owned(),
        }
    }
}

/// A fault of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Disturbance {
    /// What scripts call it.
    pub kind: String,
    /// Drives or coordinates that have it.
    pub at: Vec<String>,
    /// How large it is.
    pub estimates: Vec<EstimatedQuantity>,
    /// Which recordings have it; empty for all.
    pub recordings: Vec<String>,
    /// When it acts, s; `None` for all of the time.
    pub interval: Option<[f64; 2]>,
    /// What it is, in words, where whoever found it has some of its own.
    pub description: Option<String>,
}

/// What is left of a force, by where it comes from; effective values in its unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResidualBudget {
    /// Noise, white or coloured: it does not come again.
    pub noise: f64,
    /// What does not repeat with the state: drift, hum, outliers, events, another day.
    pub non_repeatable: f64,
    /// What comes again with the state, and the model does not say.
    pub model: f64,
    /// The measured force itself.
    pub force: f64,
}

/// Noise of a residual counts as coloured where it is worth fewer samples than this share of them.
const COLOURED: f64 = 0.5;
/// And where its variance is so many times that of the white noise.
const ABOVE_WHITE: f64 = 1.5;

/// Whether noise of a variance is no more than the white noise of its channel.
pub(crate) fn is_white(problem: &DiagnosisProblem, channel: usize, variance: f64) -> bool {
    variance < ABOVE_WHITE * problem.noise[channel].powi(2)
}

impl EffectSelector<'_> {
    /// Members of a set that are faults of the recordings, with what they are worth.
    pub(crate) fn disturbances(&self, picks: &[SelectedEffect]) -> Vec<Disturbance> {
        let fitted = self.estimate_parameters(picks, super::pool::FitScope::All);
        let mut found: Vec<Disturbance> = Vec::new();
        for (pick, values) in picks.iter().zip(fitted) {
            let candidate = self.candidate(pick);
            if candidate.nature == CandidateNature::Effect {
                continue;
            }
            let parameters = candidate.parameters.iter().zip(values);
            let estimates = parameters.map(|(p, (value, deviation))| EstimatedQuantity {
                name: p.symbol.clone(),
                value,
                standard_deviation: deviation,
                unit: p.unit.clone(),
            });
            let constants = pick.constants.iter();
            let constants = constants.map(|(name, value)| EstimatedQuantity::new(name, *value, ""));
            found.push(Disturbance {
                kind: candidate.effect.kind.clone(),
                at: candidate.effect.at.clone(),
                estimates: estimates.chain(constants).collect(),
                recordings: Vec::new(),
                interval: None,
                description: None,
            });
        }
        found
    }

    /// Where the noise of each channel comes from, and noise that has a memory by name.
    pub(crate) fn residual_budgets(
        &self,
        picks: &[SelectedEffect],
        rest: &[Vec<f64>],
        again: &[f64],
    ) -> (Vec<ResidualBudget>, Vec<Disturbance>) {
        let problem = self.problem;
        let (factors, _) = self.fit(picks, super::pool::FitScope::All);
        let size = |values: &[f64]| dot(values, values) / values.len().max(1) as f64;
        let mut budgets = Vec::new();
        let mut coloured = Vec::new();
        for (d, rest) in rest.iter().enumerate() {
            let mut disturbed = vec![0.0; rest.len()];
            let mut at = self.base.len();
            for pick in picks {
                for k in &pick.columns {
                    if self.candidate(pick).nature == CandidateNature::Disturbance
                        && let Some(values) = &self.pool.column(*k).0[d]
                    {
                        for (sum, x) in disturbed.iter_mut().zip(values) {
                            *sum += factors[at] * x;
                        }
                    }
                    at += 1;
                }
            }
            let left = size(rest);
            let model = left * again[d];
            let force = problem.measured_force(d);
            let removed = problem.removed.get(d).copied().unwrap_or(0.0);
            let budget = ResidualBudget {
                noise: (left - model).max(0.0).sqrt(),
                non_repeatable: (size(&disturbed) + removed).sqrt(),
                model: model.sqrt(),
                force: size(&force).sqrt(),
            };
            coloured.extend(self.coloured_noise(d, rest, again[d]));
            budgets.push(budget);
        }
        (budgets, coloured)
    }

    /// Noise of a channel whose samples resemble their neighbours, and what comes again with the state is not most of it.
    fn coloured_noise(&self, channel: usize, rest: &[f64], again: f64) -> Option<Disturbance> {
        let layout = &self.problem.layout;
        let variance = dot(rest, rest) / rest.len().max(1) as f64;
        if is_white(self.problem, channel, variance * (1.0 - again)) {
            return None;
        }
        let worth = effective_samples(rest) / rest.len().max(1) as f64;
        if worth > COLOURED {
            return None;
        }
        // Of a first-order process with that many samples to one that counts.
        let memory = worth.recip();
        let keeps = (memory - 1.0) / (memory + 1.0);
        let step = layout.segments.first().map_or(1.0, |s| s.step);
        let corner = -keeps.ln() / (std::f64::consts::TAU * step);
        Some(Disturbance {
            kind: "coloured_noise".to_owned(),
            at: vec![layout.channels[channel].clone()],
            estimates: vec![
                EstimatedQuantity::new("noise", (variance * (1.0 - again)).sqrt(), ""),
                EstimatedQuantity::new("corner", corner, "Hz"),
            ],
            recordings: Vec::new(),
            interval: None,
            description: None,
        })
    }
}

impl DiagnosisProblem {
    /// The measured force of a channel, with that of held parameters.
    pub(crate) fn measured_force(&self, channel: usize) -> Vec<f64> {
        let mut force = self.measured.0[channel]
            .clone()
            .unwrap_or_else(|| vec![0.0; self.layout.samples()]);
        let held = self
            .fixed_forces
            .as_ref()
            .and_then(|held| held.0[channel].as_ref());
        for (sum, x) in force.iter_mut().zip(held.into_iter().flatten()) {
            *sum += x;
        }
        force
    }
}
