//! Changes in time: something that begins at a time of a recording and lasts to its end or for an interval, such as a
//! grasped payload, another scale of a force signal, or a jump of its zero. Input: the problem, the columns of a set of
//! effects and the shapes of possible changes. Output: candidates with the times at which they fit best.
//!
//! A residual that follows the time and not the state is no noise, whatever its size. So such changes compete with
//! effects in the search. A model that is valid for a part of a recording only is not adequate for all of it.
//!
//! 1. `products` - inner products of all columns, block by block, so that any time profile is fitted without reading
//!    samples again.
//! 2. `profile` - time profiles: a step, an interval, and slow changes that a step must exceed.
//! 3. `residual` - what remains after the search and follows the time.

mod products;
mod profile;
mod residual;

use std::ops::Range;

use super::column::ForceColumn;
use super::problem::{
    CandidateEffect, CandidateNature, ColumnChoice, ColumnSource, DiagnosisProblem, EffectParameter, LocatedEffect,
    SignConstraint,
};
use super::thresholds::{
    CHANGE_LEAST_ADVANTAGE, CHANGE_LEAST_SHARE, GENERAL_CHANGE_REST, INTERVAL_LEAST_ADVANTAGE, MOVING_LEAST_SHARE,
    SIMPLER_CHANGE_SHARE, SLOW_RATE_SHARE,
};
use products::BlockProducts;
use profile::{TimeProfile, slow_profiles};
pub use residual::{ResidualCharacter, TimeResidual, top_speed};
pub(crate) use residual::{squares_in_time, standstill_samples, time_residual};

/// The force of a possible change, from the time on at which it begins.
#[derive(Clone, Debug, PartialEq)]
pub enum ChangeForce {
    /// Known columns, one for each parameter.
    Columns(Vec<ForceColumn>),
    /// The fitted force of a channel, by its index: the scale of its signal changes.
    FittedForce(usize),
}

/// A change that may begin at any time of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct ChangeShape {
    /// Kind and place.
    pub effect: LocatedEffect,
    /// Its parameters, one per column.
    pub parameters: Vec<EffectParameter>,
    /// Its force per unit of the parameters.
    pub force: ChangeForce,
}

/// When a change acts in a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct ChangeInterval {
    /// The recording.
    pub recording: String,
    /// Begin and end, s; a change that lasts ends with the recording.
    pub interval: [f64; 2],
    /// Whether it lasts to the end of the recording.
    pub lasts: bool,
}

/// A change that was found, as a candidate of the search.
#[derive(Clone, Debug)]
pub(crate) struct FoundChange {
    /// The candidate.
    pub(crate) candidate: CandidateEffect,
    /// When it acts.
    pub(crate) intervals: Vec<ChangeInterval>,
    /// Weighted squares that it explains in all recordings.
    explained: f64,
    /// Weighted squares that remain in all recordings.
    remaining: f64,
}

impl FoundChange {
    /// Whether a more general change of the same kind and place explains clearly more, or leaves clearly less: after a heavy
    /// load the simpler change explains nearly all, and what it leaves is still far above the noise.
    fn is_too_simple(&self, general: &Self) -> bool {
        self.explained < SIMPLER_CHANGE_SHARE * general.explained
            || general.remaining < GENERAL_CHANGE_REST * self.remaining
    }
}

/// Changes that explain more of the residual of a set than slow changes of the same shape do. `set` are the columns of
/// the base and of the effects of the set.
pub(crate) fn find_changes(problem: &DiagnosisProblem, set: &[&ForceColumn]) -> Vec<FoundChange> {
    if problem.change_shapes.is_empty() {
        return Vec::new();
    }
    let Some(products) = BlockProducts::new(problem, set) else {
        return Vec::new();
    };
    let mut found: Vec<FoundChange> = Vec::new();
    for (k, shape) in problem.change_shapes.iter().enumerate() {
        let Some(change) = find_change(problem, &products, k, shape) else {
            continue;
        };
        // Of two shapes with the same kind and place the one with fewer columns comes first.
        let same = found
            .iter_mut()
            .find(|other| other.candidate.effect == change.candidate.effect);
        match same {
            Some(other) if other.is_too_simple(&change) => *other = change,
            Some(_) => {}
            None => found.push(change),
        }
    }
    found
}

/// Possible changes of each force signal: a jump of its zero and another scale. `units` are those of the forces,
/// `[channel]`.
pub fn signal_changes(problem: &DiagnosisProblem, units: &[String]) -> Vec<ChangeShape> {
    let channels = problem.layout.channels.iter().enumerate();
    // Without a signal there is nothing to change.
    let with_signal = channels.filter(|(d, _)| !problem.is_idle(*d));
    let shape = |kind: &str, at: &String, symbol: &str, unit: &str, force: ChangeForce| ChangeShape {
        effect: LocatedEffect {
            kind: kind.to_owned(),
            at: vec![at.clone()],
        },
        parameters: vec![EffectParameter {
            symbol: symbol.to_owned(),
            unit: unit.to_owned(),
            sign: SignConstraint::Any,
        }],
        force,
    };
    let shapes = with_signal.flat_map(|(d, name)| {
        let mut constant = ForceColumn(vec![None; problem.layout.channels.len()]);
        constant.0[d] = Some(vec![1.0; problem.layout.samples()]);
        [
            shape(
                "offset_step",
                name,
                "F0",
                &units[d],
                ChangeForce::Columns(vec![constant]),
            ),
            shape("gain_change", name, "gain", "1", ChangeForce::FittedForce(d)),
        ]
    });
    shapes.collect()
}

/// The change of one shape with its times in all recordings; `None` if no recording shows it.
fn find_change(
    problem: &DiagnosisProblem,
    products: &BlockProducts<'_>,
    k: usize,
    shape: &ChangeShape,
) -> Option<FoundChange> {
    let mut parameters = Vec::new();
    let mut columns = Vec::new();
    let mut intervals = Vec::new();
    let mut explained = 0.0;
    let mut searched_constants = 0;
    // The set is fitted again to all recordings, so that a change in one lowers the squares of the others too.
    let all = 0..products.recordings.len();
    let mut remaining: f64 = all.map(|r| products.residual_squares(k, r)).sum();
    let times = problem.layout.times();
    let bests = products.recordings.iter().enumerate().map(|(r, recording)| {
        let best = best_profile(products, k, r)?;
        let samples = products.refine_times(k, r, &best.profile);
        let stands = is_signal_at_standstill(problem, shape, &recording.samples, &samples);
        (!stands).then_some((best, samples))
    });
    let mut bests: Vec<Option<(BestProfile, Range<usize>)>> = bests.collect();
    remove_needless_profiles(products, k, &mut bests);
    for (recording, best) in products.recordings.iter().zip(bests) {
        let Some((best, samples)) = best else { continue };
        explained += best.gain;
        searched_constants += best.profile.searched_constants();
        remaining -= best.gain + best.of_level;
        let last = recording.samples.end - 1;
        intervals.push(ChangeInterval {
            recording: recording.name.clone(),
            interval: [times[samples.start], times[(samples.end).min(last)]],
            lasts: samples.end > last,
        });
        // Each recording has its own parameters, since the change begins anew there.
        for (parameter, column) in shape.parameters.iter().zip(products.shape_columns(k)) {
            parameters.push(EffectParameter {
                symbol: format!("change of {} in {}", parameter.symbol, recording.name),
                ..parameter.clone()
            });
            columns.push(within(column, &samples));
        }
    }
    (!columns.is_empty()).then(|| FoundChange {
        candidate: CandidateEffect {
            effect: shape.effect.clone(),
            searched_constants,
            parameters,
            is_part_of_load: false,
            refines: None,
            nature: CandidateNature::ChangeInTime,
            is_per_run: true,
            source: ColumnSource::Columns(vec![ColumnChoice {
                constants: Vec::new(),
                columns,
            }]),
        },
        intervals,
        explained,
        remaining: remaining.max(0.0),
    })
}

/// Whether the drive of a changed signal hardly moves during the time with the change, or during the time without it:
/// friction takes any value at standstill, which looks like another zero. `recording` and `changed` are samples.
fn is_signal_at_standstill(
    problem: &DiagnosisProblem,
    shape: &ChangeShape,
    recording: &Range<usize>,
    changed: &Range<usize>,
) -> bool {
    let place = |name: &String| problem.layout.channels.iter().position(|channel| channel == name);
    let is_signal = ["offset_step", "gain_change"].contains(&shape.effect.kind.as_str());
    let channel = shape.effect.at.first().and_then(place).filter(|_| is_signal);
    let rate = channel.and_then(|d| problem.friction.get(3 * d)?.0[d].as_ref());
    let Some(rate) = rate else { return false };
    let slowest = SLOW_RATE_SHARE * top_speed(rate);
    let moves_within = |samples: &mut dyn Iterator<Item = usize>| {
        let (mut all, mut moving) = (0_usize, 0_usize);
        for i in samples {
            all += 1;
            moving += usize::from(rate[i].abs() > slowest);
        }
        all == 0 || moving as f64 > MOVING_LEAST_SHARE * all as f64
    };
    let is_changed = |i: &usize| changed.contains(i);
    !moves_within(&mut recording.clone().filter(is_changed))
        || !moves_within(&mut recording.clone().filter(|i| !is_changed(i)))
}

/// Removes the profiles, `[recording]`, that explain no more than noise in addition to the others: a large change in one
/// recording biases the fit of all, so that each of them seems to have one. The one that explains least goes first.
fn remove_needless_profiles(
    products: &BlockProducts<'_>,
    shape: usize,
    bests: &mut [Option<(BestProfile, Range<usize>)>],
) {
    let all = 0..bests.len();
    let mut kept: Vec<usize> = all.clone().filter(|r| bests[*r].is_some()).collect();
    if kept.len() < 2 {
        return;
    }
    let reduced = products.reduce_blocks(shape, all.clone());
    let counts: Vec<usize> = products.recordings.iter().map(|cut| cut.blocks.len()).collect();
    // Values of one recording with zeros for all others.
    let spread = |r: usize, values: Vec<f64>| {
        let [before, after] = [&counts[..r], &counts[r + 1..]].map(|counts| vec![0.0; counts.iter().sum()]);
        [before, values, after].concat()
    };
    let profile = |r: usize| bests[r].as_ref().map(|(best, _)| best.profile);
    let changes: Vec<Vec<f64>> = (all.clone())
        .map(|r| {
            spread(
                r,
                profile(r).map_or_else(|| vec![0.0; counts[r]], |one| one.values(counts[r])),
            )
        })
        .collect();
    let levels: Vec<Vec<f64>> = all.clone().map(|r| spread(r, vec![1.0; counts[r]])).collect();
    let total: f64 = all.map(|r| products.residual_squares(shape, r)).sum();
    let parameters = products.shape_columns(shape).len();
    let found: Vec<Vec<f64>> = kept.iter().map(|r| changes[*r].clone()).collect();
    let effective_samples = products.effective_samples(shape, &reduced, &found);
    while kept.len() > 1 {
        // Twice the decrease of the logarithm of the likelihood, less the price of its parameters and times.
        let worth = |r: usize| {
            let others = kept.iter().filter(|other| **other != r).map(|other| &changes[*other]);
            let others: Vec<&[f64]> = others.chain([&levels[r]]).map(Vec::as_slice).collect();
            let with = [others.as_slice(), &[changes[r].as_slice()]].concat();
            let [before, after] =
                [others, with].map(|profiles| (total - reduced.explained_squares(&profiles)).max(f64::MIN_POSITIVE));
            let constants = profile(r).map_or(0, TimeProfile::searched_constants);
            effective_samples * (before / after).ln() - (parameters + constants) as f64 * effective_samples.ln()
        };
        let least = kept.iter().map(|r| (*r, worth(*r))).min_by(|a, b| a.1.total_cmp(&b.1));
        let Some((needless, _)) = least.filter(|(_, worth)| *worth <= 0.0) else {
            break;
        };
        kept.retain(|r| *r != needless);
    }
    for (r, best) in bests.iter_mut().enumerate() {
        if !kept.contains(&r) {
            *best = None;
        }
    }
}

/// The step or interval of a shape that explains most in a recording.
struct BestProfile {
    /// Weighted squares that it explains in addition to a constant level of the recording.
    gain: f64,
    /// Weighted squares that the level explains.
    of_level: f64,
    /// When it acts.
    profile: TimeProfile,
}

/// The step or interval of a shape that explains most in a recording; `None` if it explains too little, or hardly more than a
/// slow change.
fn best_profile(products: &BlockProducts<'_>, shape: usize, recording: usize) -> Option<BestProfile> {
    let blocks = products.recordings[recording].blocks.len();
    // The level of the recording is free, since the other recordings may have changes too.
    let level = vec![1.0; blocks];
    let reduced = products.reduce_blocks(shape, recording..recording + 1);
    let of_level = reduced.explained_squares(&[&level]);
    let explained = |values: &[f64]| reduced.explained_squares(&[&level, values]) - of_level;
    let best = |profiles: &mut dyn Iterator<Item = TimeProfile>| {
        let scored = profiles.map(|profile| (explained(&profile.values(blocks)), profile));
        scored.max_by(|a, b| a.0.total_cmp(&b.0))
    };
    let (gain, step) = best(&mut TimeProfile::steps(blocks))?;
    let total = products.residual_squares(shape, recording);
    let slow = slow_profiles(blocks).map(|values| explained(&values));
    let slow = slow.into_iter().fold(0.0, f64::max);
    let is_enough = |gain: f64| gain > CHANGE_LEAST_SHARE * total && gain > CHANGE_LEAST_ADVANTAGE * slow;
    // An interval has a second time, so that it must explain clearly more than a step.
    let interval = best(&mut TimeProfile::intervals(blocks));
    let (gain, profile) = match interval {
        Some((of_interval, interval)) if of_interval > INTERVAL_LEAST_ADVANTAGE * gain && is_enough(of_interval) => {
            (of_interval, interval)
        }
        _ => (gain, step),
    };
    is_enough(gain).then_some(BestProfile {
        gain,
        of_level,
        profile,
    })
}

/// A column within some samples, zero elsewhere.
fn within(column: &ForceColumn, samples: &std::ops::Range<usize>) -> ForceColumn {
    let cut = |values: &Vec<f64>| -> Vec<f64> {
        let values = values.iter().enumerate();
        values
            .map(|(i, x)| if samples.contains(&i) { *x } else { 0.0 })
            .collect()
    };
    ForceColumn(column.0.iter().map(|values| values.as_ref().map(cut)).collect())
}

#[cfg(test)]
mod tests;
