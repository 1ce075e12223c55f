//! Faults of force signals: a delay, a low-pass, or a wrong scale. Their columns are computed from the fitted forces.

use super::bench::{EffectSelector, ScoredEffectSet, SelectedEffect};
use super::column::ForceColumn;
use super::pool::FitScope;
use super::problem::{
    CandidateEffect, CandidateNature, ColumnSource, DiagnosisProblem, EffectParameter, ForceReadingFault,
    LocatedEffect, ReadingFaultKind, SignConstraint,
};
use super::thresholds::MIN_DISTINCTION;
use crate::signal::float_to_count;

/// Below this delay, in samples, a derivative is accurate enough.
const SLIGHT: f64 = 0.1;
/// From this decimation on, the filter before it smooths the jumps of friction.
const ROUNDS_OFF: f64 = 1.5;

impl ReadingFaultKind {
    /// Kind of effect, symbol of its parameter, unit and sign of the parameter.
    fn effect_description(self) -> (&'static str, &'static str, &'static str, SignConstraint) {
        match self {
            // A force that leads the motion is a delay of the motion, which is another fault.
            Self::Delayed => ("time_delay", "T", "s", SignConstraint::Positive),
            Self::LowPassed => ("force_lag", "tau", "s", SignConstraint::Positive),
            Self::Scaled => ("drive_gain", "gain", "1", SignConstraint::Any),
        }
    }
}

/// Candidates for faults of force signals: each kind for every channel with a signal, and a low-pass of all. A delay of
/// all forces is an effect of the library, and a wrong scale of all is equivalent to other parameters.
pub fn reading_fault_candidates(problem: &DiagnosisProblem) -> Vec<CandidateEffect> {
    let layout = &problem.layout;
    // Only channels with a force signal can have a faulty one.
    let read: Vec<usize> = (0..layout.channels.len()).filter(|d| !problem.is_idle(*d)).collect();
    // With one channel, its fault is that of all channels.
    let has_others = read.len() > 1;
    // With several channels, each may have its own delay and low-pass; each may have its own scale in any case.
    let each = read.into_iter().flat_map(|d| {
        let late = has_others.then_some((ReadingFaultKind::Delayed, Some(d)));
        let lagging = has_others.then_some((ReadingFaultKind::LowPassed, Some(d)));
        [late, lagging, Some((ReadingFaultKind::Scaled, Some(d)))]
    });
    // A low-pass of all channels comes first.
    let all = [Some((ReadingFaultKind::LowPassed, None))];
    let readings = all.into_iter().chain(each).flatten();
    readings
        .map(|(fault, channel)| {
            let (kind, symbol, unit, sign) = fault.effect_description();
            // A fault of all channels has the place "force".
            let place = channel.map_or("force", |d: usize| layout.channels[d].as_str());
            CandidateEffect {
                effect: LocatedEffect {
                    kind: kind.to_owned(),
                    at: vec![place.to_owned()],
                },
                parameters: vec![EffectParameter {
                    symbol: symbol.to_owned(),
                    unit: unit.to_owned(),
                    sign,
                }],
                searched_constants: 0,
                is_part_of_load: false,
                refines: None,
                nature: CandidateNature::Effect,
                is_per_run: false,
                source: ColumnSource::ReadingFault(ForceReadingFault { kind: fault, channel }),
            }
        })
        .collect()
}

impl EffectSelector<'_> {
    /// Column of a force signal fault: the change of the signal per unit of the parameter, between no fault and the
    /// value of the parameter. `force` are the forces without the fault, N or N m.
    pub(crate) fn reading_fault_column(
        &self,
        reading: ForceReadingFault,
        force: &ForceColumn,
        value: f64,
    ) -> ForceColumn {
        // Each channel by itself; channels without the fault get no column.
        let channels = force.0.iter().enumerate();
        let of = |(d, values): (usize, &Option<Vec<f64>>)| {
            let values = values.as_ref()?;
            // Channels that the fault does not concern.
            if reading.channel.is_some_and(|channel| channel != d) {
                return None;
            }
            // A scale changes the signal in proportion to the force.
            if reading.kind == ReadingFaultKind::Scaled {
                return Some(values.clone());
            }
            // Segment by segment, since neither a delay nor a low-pass crosses a gap.
            let mut changes = Vec::with_capacity(values.len());
            let mut start = 0;
            for segment in &self.problem.layout.segments {
                let part = &values[start..start + segment.samples];
                // Delay or time constant in samples.
                let samples = value / segment.step;
                // For a small delay or time constant T both faults change the force by -T df/dt.
                if samples.abs() < SLIGHT {
                    changes.extend(central_differences(part).map(|slope| -slope / segment.step));
                } else if reading.kind == ReadingFaultKind::Delayed {
                    // Decimation with its filter smooths the jumps of dry friction, so that they need no special
                    // treatment.
                    let has_jumps = segment.step < ROUNDS_OFF * segment.recorded_step;
                    let rates = has_jumps.then(|| self.problem.friction.get(3 * d));
                    let rates = rates.flatten().and_then(|column| column.0[d].as_deref());
                    let rates = rates.map(|rates| &rates[start..start + segment.samples]);
                    let late = (0..part.len()).map(|i| interpolate_force(part, rates, i as f64 - samples));
                    changes.extend(late.zip(part).map(|(then, now)| (then - now) / value));
                } else {
                    // Difference of the filtered force and the force, per unit of the time constant.
                    let filtered = low_pass(part, samples.abs()).into_iter().zip(part);
                    changes.extend(filtered.map(|(late, now)| (late - now) / value.abs()));
                }
                start += segment.samples;
            }
            Some(changes)
        };
        ForceColumn(channels.map(of).collect())
    }

    /// Fits a set again with columns computed from its own fit. A delay and a low-pass are equivalent if both are
    /// small: the low-pass is chosen only if its residual is clearly smaller.
    pub(crate) fn refit_dependent_columns(&mut self, trial: &ScoredEffectSet) -> ScoredEffectSet {
        // Delays and low-passes change their columns with their value; a wrong scale does not.
        let curved = |bench: &Self, pick: &SelectedEffect| match bench.candidate(pick).source {
            ColumnSource::ReadingFault(reading) if reading.kind != ReadingFaultKind::Scaled => Some(reading),
            _ => None,
        };
        let is_curved = |(i, pick): (usize, &SelectedEffect)| Some((i, curved(self, pick)?));
        // Without a delay or low-pass only bodies need columns at their estimated values.
        let Some((at, reading)) = trial.picks.iter().enumerate().find_map(is_curved) else {
            let is_body = |pick: &SelectedEffect| matches!(self.candidate(pick).source, ColumnSource::Body(_));
            if trial.picks.iter().any(is_body) {
                let refreshed = self.refresh_columns(trial.picks.clone());
                return ScoredEffectSet {
                    score: trial.score,
                    ..self.fit_set(refreshed)
                };
            }
            return trial.clone();
        };
        // The other one of the two faults on the same channel.
        let is_other = |pick: &&SelectedEffect| {
            let other = curved(self, pick);
            other.is_some_and(|o| o.channel == reading.channel && o.kind != reading.kind)
                && trial.picks.iter().all(|p| p.candidate != pick.candidate)
        };
        // The set itself, and the same set with the other fault on this channel.
        let mut sets = vec![trial.picks.clone()];
        if let Some(other) = self.current_choices.iter().flatten().find(is_other) {
            let mut set = trial.picks.clone();
            set[at] = other.clone();
            sets.push(set);
        }
        // Fit each set with columns at its own estimates.
        let mut tried: Vec<ScoredEffectSet> = Vec::new();
        for set in sets {
            let refreshed = self.refresh_columns(set);
            tried.push(self.fit_set(refreshed));
        }
        // The set with the delay comes first.
        tried.sort_by_key(|trial| {
            let fault = trial.picks.get(at).and_then(|pick| curved(self, pick));
            fault.is_some_and(|reading| reading.kind == ReadingFaultKind::LowPassed)
        });
        let mut best = tried.remove(0);
        if let Some(other) = tried.pop() {
            let (factors, _) = self.fit(&other.picks, FitScope::All);
            let rest = self.residual(&other.picks, &factors);
            let channels: Vec<usize> = (0..rest.len()).collect();
            // Difference of the criterion: both sets have the same number of estimated values.
            let better = self.effective_equations(&rest, &channels) * (best.squares / other.squares).ln();
            let has_signs = other.is_possible();
            // A negative delay is impossible, so the low-pass is taken without a test then.
            if !best.is_possible() || has_signs && better > MIN_DISTINCTION {
                best = other;
            }
        }
        ScoredEffectSet {
            score: trial.score,
            ..best
        }
    }
}

/// Slopes per sample by central differences; one-sided at the ends.
fn central_differences(values: &[f64]) -> impl Iterator<Item = f64> {
    let last = values.len() - 1;
    (0..values.len()).map(move |i| {
        let (before, after) = (i.saturating_sub(1), (i + 1).min(last));
        (values[after] - values[before]) / (after - before).max(1) as f64
    })
}

/// Output of a first-order low-pass with a time constant in samples, exact for an input that is linear between its
/// samples. It starts in equilibrium.
fn low_pass(values: &[f64], constant: f64) -> Vec<f64> {
    // Share of a difference that remains after one sample.
    let keeps = (-constant.recip()).exp();
    let mut state = values[0];
    let mut before = values[0];
    let follow = |now: &f64| {
        let slope = now - before;
        // In steady state the output lags a ramp by the time constant.
        state = now - slope * constant + (state - before + slope * constant) * keeps;
        before = *now;
        state
    };
    values.iter().map(follow).collect()
}

/// Cubic interpolation between the second and the third of four samples; `share` runs from 0 to 1 (J. L. Lagrange).
fn interpolate_cubic(values: &[f64], share: f64) -> f64 {
    // Lagrange's formula, arranged around the two inner samples.
    let [before, first, second, behind] = [values[0], values[1], values[2], values[3]];
    let (x, y) = (share, 1.0 - share);
    let inner = y * first + x * second;
    let outer = (1.0 + y) * before + (1.0 + x) * behind;
    (1.0 + x) * (1.0 + y) * inner / 2.0 - x * y * outer / 6.0
}

/// Force at a fractional sample index, clamped to the series. If the drive reverses between two samples, friction jumps
/// there: the force is extrapolated from before up to the reversal, and from after beyond it.
fn interpolate_force(values: &[f64], rates: Option<&[f64]>, at: f64) -> f64 {
    let last = values.len() - 1;
    let at = at.clamp(0.0, last as f64);
    let k = float_to_count(at.floor());
    let share = at - at.floor();
    // The rate changes its sign between two samples.
    let turns_within = |rates: &[f64], i: usize| rates[i] * rates[i + 1] < 0.0;
    // Three intervals around the place must be free of reversals for the cubic.
    let is_smooth = rates.is_none_or(|rates| {
        let near = k.saturating_sub(1)..(k + 2).min(last);
        near.into_iter().all(|i| !turns_within(rates, i))
    });
    // No reversal nearby: four samples give a smooth curve.
    if is_smooth && k > 0 && k + 2 <= last {
        return interpolate_cubic(&values[k - 1..k + 3], share);
    }
    let turns = rates.filter(|rates| k < last && turns_within(rates, k));
    // Instant of the reversal, from the linear course of the rate between the samples.
    match turns.map(|rates| rates[k] / (rates[k] - rates[k + 1])) {
        Some(turn) if share < turn => values[k] + share * (values[k] - values[k.saturating_sub(1)]),
        Some(_) => values[k + 1] - (1.0 - share) * (values[(k + 2).min(last)] - values[k + 1]),
        None => values[k] + share * (values[(k + 1).min(last)] - values[k]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::problem::{NoColumnProvider, SampleLayout, SampleSegment};

    /// With every ninth sample kept, friction jumps are smoothed, so a force is smooth where its drive reverses too.
    #[test]
    fn a_late_force_of_few_samples_is_smooth_where_the_drive_turns_round() {
        let (step, delay) = (0.036, 0.0041);
        let force = |t: f64| 300.0 * (6.0 * t + 0.4).sin();
        let times: Vec<f64> = (0..300).map(|i| step * f64::from(i)).collect();
        let forces = ForceColumn(vec![Some(times.iter().map(|t| force(*t)).collect())]);
        let rates = ForceColumn(vec![Some(times.iter().map(|t| (5.0 * t).sin()).collect())]);
        let problem = DiagnosisProblem {
            layout: SampleLayout {
                channels: vec!["a".into()],
                segments: vec![SampleSegment {
                    name: "run".into(),
                    samples: times.len(),
                    start: 0.0,
                    step,
                    recorded_step: 0.004,
                    is_check: false,
                }],
                left_out: Vec::new(),
            },
            measured: forces.clone(),
            friction: vec![rates.clone(), rates.clone(), rates],
            noise: vec![1.0],
            removed: vec![0.0],
            ..DiagnosisProblem::default()
        };
        let bench = EffectSelector::new(&problem, &NoColumnProvider);
        let late = ForceReadingFault {
            kind: ReadingFaultKind::Delayed,
            channel: None,
        };
        let changes = bench.reading_fault_column(late, &forces, delay);
        let changes = changes.0[0].as_ref().unwrap();
        for (i, t) in times.iter().enumerate().skip(2).take(times.len() - 4) {
            let expected = (force(t - delay) - force(*t)) / delay;
            assert!((changes[i] - expected).abs() < 5.0, "{t}: {} {expected}", changes[i]);
        }
    }

    /// Between samples a force is linear, except for a jump at the instant of the reversal.
    #[test]
    fn a_late_force_jumps_where_the_drive_turns_round() {
        let rate = |t: f64| t - 20.3;
        let force = |t: f64| 3.0 * t + 50.0 * rate(t).signum();
        let [rates, values]: [Vec<f64>; 2] =
            [&rate as &dyn Fn(f64) -> f64, &force].map(|of| (0..40).map(|i| of(f64::from(i))).collect());
        for i in 1..390 {
            let t = 0.1 * f64::from(i) + 0.05;
            let interpolated = interpolate_force(&values, Some(&rates), t);
            assert!((interpolated - force(t)).abs() < 1e-9, "{t}: {interpolated}");
        }
    }

    /// Six samples per wave are enough to interpolate it.
    #[test]
    fn a_smooth_force_is_followed_between_its_samples() {
        let values: Vec<f64> = (0..40).map(|i| f64::from(i).sin()).collect();
        for i in 10..380 {
            let t = 0.1 * f64::from(i);
            let interpolated = interpolate_force(&values, None, t);
            assert!((interpolated - t.sin()).abs() < 0.025, "{t}: {interpolated}");
        }
    }

    /// A low-pass of first order answers a step by an exponential and follows a ramp at the distance of its time
    /// constant.
    #[test]
    fn a_low_pass_answers_ramps_and_steps_as_its_equation_says() {
        let constant = 2.5;
        let ramp: Vec<f64> = (0..60).map(f64::from).collect();
        let late = low_pass(&ramp, constant);
        for (i, x) in late.iter().enumerate() {
            let t = i as f64;
            let expected = t - constant + constant * (-t / constant).exp();
            assert!((x - expected).abs() < 1e-12, "{i}: {x} {expected}");
        }
    }
}
