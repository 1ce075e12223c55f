//! Disturbances of recordings, which are no part of the model, and the origin of the residual of each channel. A
//! channel is the force signal of one drive.

use super::bench::{EffectSelector, SelectedEffect};
use super::in_time::{ChangeInterval, TimeResidual, time_residual};
use super::noise::effective_samples;
use super::problem::{CandidateNature, DiagnosisProblem};
use super::thresholds::{
    COLOURED_LEAST_VARIANCE_RATIO, COLOURED_MOST_EFFECTIVE_SHARE, COLOURED_MOST_REPEATABLE_SHARE,
    SAME_CHANGE_TIME_SHARE,
};
use crate::signal::dot;

/// A named value of a disturbance or an effect.
#[derive(Clone, Debug, PartialEq)]
pub struct EstimatedQuantity {
    /// Name of the quantity.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Its standard deviation, where it is known.
    pub standard_deviation: Option<f64>,
    /// Unit of both; empty if it is that of the force.
    pub unit: String,
}

impl EstimatedQuantity {
    /// A value without a standard deviation.
    pub fn new(name: &str, value: f64, unit: &str) -> Self {
        Self {
            name: name.to_owned(),
            value,
            standard_deviation: None,
            unit: unit.to_owned(),
        }
    }
}

/// A disturbance that was found in a recording: an error of its signals, such as drift or outliers, or a change of the
/// machine, such as a contact or another payload. It is not a missing effect. Suspected mistakes of the recording, such
/// as exchanged columns, are listed as disturbances too.
#[derive(Clone, Debug, PartialEq)]
pub struct Disturbance {
    /// Name of the kind in JSON and in scripts.
    pub kind: String,
    /// Names of the drives or coordinates that have it.
    pub at: Vec<String>,
    /// How large it is.
    pub estimates: Vec<EstimatedQuantity>,
    /// Which recordings have it; empty for all.
    pub recordings: Vec<String>,
    /// When it acts, s; `None` for all of the time.
    pub interval: Option<[f64; 2]>,
    /// Description for people, if it was given one.
    pub description: Option<String>,
}

/// Residual of a force by its origin: rms values in the unit of the force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResidualBudget {
    /// Noise, white or coloured: it is not repeatable.
    pub noise: f64,
    /// Disturbances that were subtracted from the force, and are no part of the residual: drift, hum, outliers, differences
    /// between recordings.
    pub subtracted: f64,
    /// Residual that follows the time and not the state, and is no noise.
    pub in_time: f64,
    /// Repeatable residual, which the model does not explain.
    pub model: f64,
    /// The measured force itself.
    pub force: f64,
}

/// Whether a variance is not larger than that of the white noise of its channel.
pub(crate) fn is_white(problem: &DiagnosisProblem, channel: usize, variance: f64) -> bool {
    variance < COLOURED_LEAST_VARIANCE_RATIO * problem.noise[channel].powi(2)
}

impl ResidualBudget {
    /// Everything that is not repeatable and no noise: what was subtracted, and what follows the time.
    pub fn non_repeatable(&self) -> f64 {
        self.subtracted.hypot(self.in_time)
    }
}

impl EffectSelector<'_> {
    /// Members of a set that are disturbances, with their estimates.
    pub(crate) fn disturbances(&self, picks: &[SelectedEffect]) -> Vec<Disturbance> {
        let problem = self.problem;
        let fitted = self.estimate_parameters(picks, super::pool::FitScope::All);
        let mut found: Vec<Disturbance> = Vec::new();
        // Channels and times of the changes in time so far.
        let mut changes: Vec<(Vec<usize>, &[ChangeInterval])> = Vec::new();
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
            // A change in time has an interval in each of its recordings.
            let times = problem
                .change_intervals
                .iter()
                .find(|(effect, _)| *effect == candidate.effect);
            let intervals = times.map_or(&[][..], |(_, intervals)| intervals);
            // What a change leaves at its own time belongs to it: no column has its force exactly.
            if candidate.nature == CandidateNature::ChangeInTime {
                let channels = self.affected_channels(std::slice::from_ref(pick));
                let is_same = |(others, known): &(Vec<usize>, &[ChangeInterval])| {
                    channels.iter().any(|d| others.contains(d)) && begin_together(intervals, known)
                };
                let is_known = changes.iter().any(is_same);
                changes.push((channels, intervals));
                if is_known {
                    continue;
                }
            }
            let constants = pick.constants.iter();
            let constants = constants.map(|(name, value)| EstimatedQuantity::new(name, *value, ""));
            let of = |estimates: Vec<EstimatedQuantity>, interval: Option<&ChangeInterval>| Disturbance {
                kind: candidate.effect.kind.clone(),
                at: candidate.effect.at.clone(),
                estimates,
                recordings: interval.map(|one| one.recording.clone()).into_iter().collect(),
                interval: interval.map(|one| one.interval),
                description: None,
            };
            if intervals.is_empty() {
                found.push(of(estimates.chain(constants).collect(), None));
                continue;
            }
            // Each recording has its own time, and parameters of its own that follow each other.
            let estimates: Vec<EstimatedQuantity> = estimates.collect();
            let parameters = estimates.len() / intervals.len();
            let own = estimates.chunks(parameters.max(1)).zip(intervals);
            found.extend(own.map(|(own, interval)| {
                let mut own = own.to_vec();
                // The recording is stated beside them.
                let suffix = format!(" in {}", interval.recording);
                for one in &mut own {
                    one.name = one.name.strip_suffix(&suffix).unwrap_or(&one.name).to_owned();
                }
                of(own, Some(interval))
            }));
        }
        found
    }

    /// Splits the residual of each channel by its origin, and reports coloured noise and residuals that follow the time.
    /// `rest` is `[channel][sample]`, `again` the repeatable share of its squares.
    pub(crate) fn residual_budgets(
        &self,
        picks: &[SelectedEffect],
        rest: &[Vec<f64>],
        again: &[f64],
    ) -> (Vec<ResidualBudget>, Vec<Disturbance>, Vec<TimeResidual>) {
        let problem = self.problem;
        let (factors, _) = self.fit(picks, super::pool::FitScope::All);
        let size = |values: &[f64]| dot(values, values) / values.len().max(1) as f64;
        let mut budgets = Vec::new();
        let mut coloured = Vec::new();
        let mut in_time = Vec::new();
        let all = rest;
        for (d, rest) in all.iter().enumerate() {
            // Force of all members of the set that are disturbances.
            let mut disturbed = vec![0.0; rest.len()];
            // Factors of the effects follow those of the base.
            let mut at = self.base.len();
            for pick in picks {
                for k in &pick.columns {
                    if self.candidate(pick).nature.is_disturbance()
                        && let Some(values) = &self.pool.column(*k).0[d]
                    {
                        for (sum, x) in disturbed.iter_mut().zip(values) {
                            *sum += factors[at] * x;
                        }
                    }
                    at += 1;
                }
            }
            // Split the mean square of the residual into the repeatable part and noise.
            let left = self.pool.mean_square(d, rest);
            let model = left * again[d];
            let force = problem.measured_force(d);
            let removed = problem.removed.get(d).copied().unwrap_or(0.0);
            // What follows the time without being stationary is no noise.
            let found = time_residual(problem, d, rest, again[d]);
            let noise = found.as_ref().map_or(left - model, |found| found.noise.powi(2));
            let in_time_power = (left - model - noise).max(0.0);
            let budget = ResidualBudget {
                noise: noise.max(0.0).sqrt(),
                subtracted: (size(&disturbed) + removed).sqrt(),
                in_time: in_time_power.sqrt(),
                model: model.sqrt(),
                force: size(&force).sqrt(),
            };
            match found {
                Some(found) => in_time.push(found),
                // An idle channel has no noise of its own.
                None if left <= self.idle_variance(d, all) => {}
                None => coloured.extend(self.coloured_noise(d, rest, again[d])),
            }
            budgets.push(budget);
        }
        (budgets, coloured, in_time)
    }

    /// Coloured noise of a channel: its samples are correlated, and most of it is not repeatable. `None` if the noise
    /// is white, or if most of the residual is repeatable: the estimate of the repeatable part is then not exact enough for a
    /// statement about the rest.
    fn coloured_noise(&self, channel: usize, rest: &[f64], again: f64) -> Option<Disturbance> {
        if again > COLOURED_MOST_REPEATABLE_SHARE {
            return None;
        }
        let layout = &self.problem.layout;
        let variance = self.pool.mean_square(channel, rest);
        if is_white(self.problem, channel, variance * (1.0 - again)) {
            return None;
        }
        // Share of samples that are independent.
        let worth = effective_samples(rest) / rest.len().max(1) as f64;
        if worth > COLOURED_MOST_EFFECTIVE_SHARE {
            return None;
        }
        // Coefficient a of a first-order process with (1 + a) / (1 - a) samples per independent one; it gives the
        // corner frequency.
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

/// Whether all of some changes begin in the same recordings and at nearly the same times as others.
fn begin_together(some: &[ChangeInterval], others: &[ChangeInterval]) -> bool {
    some.iter().all(|one| {
        others.iter().any(|other| {
            let [length, other_length] = [one, other].map(|change| change.interval[1] - change.interval[0]);
            let apart = (one.interval[0] - other.interval[0]).abs();
            one.recording == other.recording && apart < SAME_CHANGE_TIME_SHARE * length.max(other_length)
        })
    })
}

impl DiagnosisProblem {
    /// Measured force of a channel with the forces of fixed parameters added, N or N m.
    pub(crate) fn measured_force(&self, channel: usize) -> Vec<f64> {
        let mut force = self.measured.0[channel]
            .clone()
            .unwrap_or_else(|| vec![0.0; self.layout.samples()]);
        let held = self.fixed_forces.as_ref().and_then(|held| held.0[channel].as_ref());
        for (sum, x) in force.iter_mut().zip(held.into_iter().flatten()) {
            *sum += x;
        }
        force
    }
}
