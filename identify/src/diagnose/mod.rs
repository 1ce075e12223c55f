//! Which effect is missing: columns of what a model could lack go in; the smallest set that explains what it cannot say
//! comes out, with what cannot be told apart, and an honest answer where nothing explains it.
//!
//! 1. [`Problem`] - measured forces, columns of the model, candidates with the constants that are searched for.
//! 2. `pool`, `factored`, `bench` - inner products of all columns, so that a set of effects is fitted in microseconds;
//!    `tuning` finds constants, `following` makes columns that depend on the fit, `delays` those of late forces, `tilt`
//!    turns gravity.
//! 3. `search` - forward over sets, with exchanges; `evidence` decides on time that was not fitted; `settle` makes the last
//!    set as small and simple as it can be.
//! 4. `aliases` - what this recording cannot tell apart; `reproducible` - what no candidate explains and no noise is.
//! 5. [`Diagnosis`] - the answer.

mod aliases;
mod bench;
mod column;
mod delays;
mod evidence;
mod factored;
mod following;
mod noise;
mod pool;
mod problem;
mod reproducible;
mod search;
mod settle;
mod tilt;
mod tuning;

use serde::Serialize;

pub use column::Column;
pub use evidence::Evidence;
pub use noise::{effective_samples, white_noise};
pub use problem::{
    Candidate, Choice, Effect, EffectParameter, Layout, NoSupply, Problem, Sign, Source, Stretch,
    Supply,
};
pub use tilt::{Sensitivity, Tilt};

use bench::{Bench, Pick};
use pool::{On, dot};
use reproducible::reproducible;

/// Share of a channel's squared residual that must come again to be called unexplained.
const UNEXPLAINED: f64 = 0.1;
/// The same, in squares of the channel's white noise.
const ABOVE_NOISE: f64 = 0.05;

/// How many times the squares of the white noise a rest must have that does not come again with the state.
const MUCH: f64 = 2.0;
/// How few independent samples it is worth then, relative to all.
const RESEMBLE: f64 = 0.3;

/// The answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// What the model leaves is noise as far as the recordings can tell.
    Adequate,
    /// Effects are missing, and with them the model is adequate.
    MissingEffect,
    /// What is left comes again, and no candidate explains it.
    Unexplained,
}

/// A step of the ladder.
#[derive(Clone, Debug)]
pub struct Rung {
    /// What was added; `None` for the model as it is.
    pub added: Vec<Effect>,
    /// What it replaced.
    pub dropped: Vec<Effect>,
    /// Relative error on the recordings of the fit.
    pub fit: f64,
    /// The same on those of the check, or of cross-validation if there are none.
    pub check: f64,
    /// What spoke for it.
    pub evidence: Option<Evidence>,
}

/// An effect that is missing.
#[derive(Clone, Debug)]
pub struct FoundEffect {
    /// What and where.
    pub effect: Effect,
    /// Position in [`Problem::candidates`].
    pub candidate: usize,
    /// Constants that were searched for.
    pub constants: Vec<(String, f64)>,
    /// Estimates of the parameters, from the recordings of the fit.
    pub estimates: Vec<f64>,
    /// What cannot be told from it.
    pub indistinguishable_from: Vec<Effect>,
}

/// What became of a candidate.
#[derive(Clone, Debug)]
pub struct Considered {
    /// What and where.
    pub effect: Effect,
    /// Share of the squared error of the model as it is that it explains alone.
    pub explained: f64,
    /// Held-out gain beside the effects that were found; for a found one, what is lost without it.
    pub gain: f64,
    /// Why it was refused; `None` if it was not.
    pub refused: Option<String>,
}

/// What a diagnosis says.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// The answer.
    pub verdict: Verdict,
    /// White noise of all channels relative to the measured forces.
    pub noise_floor: f64,
    /// The ladder, from the model as it is.
    pub ladder: Vec<Rung>,
    /// Effects that are missing.
    pub effects: Vec<FoundEffect>,
    /// All candidates, those that explain most first.
    pub candidates: Vec<Considered>,
    /// What is left in the end, `[channel][sample]`.
    pub rest: Vec<Vec<f64>>,
    /// Share of each channel's squared rest that comes again where it was not fitted.
    pub reproducible: Vec<f64>,
    /// Channels whose rest is unexplained.
    pub unexplained: Vec<usize>,
}

/// Finds what is missing. `supply` makes columns that are not known from the start.
pub fn diagnose(problem: &Problem, supply: &dyn Supply) -> Diagnosis {
    let mut bench = Bench::new(problem, supply);
    bench.look(&[]);
    let alone = bench.explained_alone();
    let found = bench.search();
    let picks = found.steps.last().map_or(Vec::new(), |s| s.picks.clone());
    let mut ladder = vec![bench.rung(&[], &[], None)];
    let mut before: Vec<Pick> = Vec::new();
    for step in &found.steps {
        ladder.push(bench.rung(&before, &step.picks, step.evidence));
        before.clone_from(&step.picks);
    }
    let aliases = bench.aliases(&picks);
    bench.weigh(&picks);
    let (factors, _) = bench.fit(&picks, On::All);
    let rest = bench.rest(&picks, &factors);
    let again = reproducible(&problem.layout, &problem.variables, &rest);
    let unexplained: Vec<usize> = (0..rest.len())
        .filter(|d| bench.is_unexplained(*d, &rest[*d], again[*d]))
        .collect();
    let verdict = match (unexplained.is_empty(), picks.is_empty()) {
        (false, _) => Verdict::Unexplained,
        (true, true) => Verdict::Adequate,
        (true, false) => Verdict::MissingEffect,
    };
    let (on_fit, _) = bench.fit(&picks, On::Fit);
    let mut at = problem.base.len();
    let mut effects = Vec::new();
    for (pick, aliases) in picks.iter().zip(aliases) {
        effects.push(FoundEffect {
            effect: bench.candidate(pick).effect.clone(),
            candidate: pick.candidate,
            constants: pick.constants.clone(),
            estimates: on_fit.as_slice()[at..at + pick.columns.len()].to_vec(),
            indistinguishable_from: aliases.into_iter().map(|alias| alias.effect).collect(),
        });
        at += pick.columns.len();
    }
    let candidates = bench.considered(&picks, &found, &alone);
    Diagnosis {
        verdict,
        noise_floor: noise_floor(problem),
        ladder,
        effects,
        candidates,
        rest,
        reproducible: again,
        unexplained,
    }
}

/// White noise of all channels relative to the measured forces.
fn noise_floor(problem: &Problem) -> f64 {
    let samples = problem.layout.samples() as f64;
    let noise: f64 = problem.noise.iter().map(|n| n * n * samples).sum();
    let size = total_force(problem);
    if size > 0.0 {
        (noise / size).sqrt()
    } else {
        0.0
    }
}

/// Squares of the measured forces, those of held parameters included.
fn total_force(problem: &Problem) -> f64 {
    let mut force = problem.measured.clone();
    if let Some(held) = &problem.held {
        force.add(1.0, held);
    }
    force.0.iter().flatten().map(|v| dot(v, v)).sum()
}

impl Bench<'_> {
    /// Whether what is left of a channel is more than noise: it comes again with the state, or it is well above the white
    /// noise and its neighbours resemble each other.
    fn is_unexplained(&self, channel: usize, rest: &[f64], again: f64) -> bool {
        let squares = dot(rest, rest) / rest.len().max(1) as f64;
        let noise = self.problem.noise[channel].powi(2);
        if squares <= noise {
            return false;
        }
        let worth = effective_samples(rest) / rest.len().max(1) as f64;
        let comes_again = again > UNEXPLAINED && again * squares > ABOVE_NOISE * noise;
        comes_again || squares > MUCH * noise && worth < RESEMBLE
    }

    /// Share of the squared error of the model as it is that each candidate explains alone.
    fn explained_alone(&self) -> Vec<f64> {
        let table = self.table(&[]);
        let total = self.try_in(&table, Vec::new()).squares;
        let share = |pick: &Option<Pick>| match pick {
            Some(pick) if total > 0.0 => {
                1.0 - self.try_in(&table, vec![pick.clone()]).squares / total
            }
            _ => 0.0,
        };
        self.present.iter().map(share).collect()
    }

    fn rung(&self, before: &[Pick], after: &[Pick], evidence: Option<Evidence>) -> Rung {
        let effects = |set: &[Pick], other: &[Pick]| -> Vec<Effect> {
            let is_new = |pick: &&Pick| other.iter().all(|p| p.candidate != pick.candidate);
            let new = set.iter().filter(is_new);
            new.map(|pick| self.candidate(pick).effect.clone())
                .collect()
        };
        let [fit, check] = self.errors(after);
        Rung {
            added: effects(after, before),
            dropped: effects(before, after),
            fit,
            check,
            evidence,
        }
    }

    /// Relative errors on fit and check, fitted to the fit; without a check by cross-validation.
    fn errors(&self, picks: &[Pick]) -> [f64; 2] {
        let layout = &self.problem.layout;
        let split = layout.fit_samples();
        let (factors, _) = self.fit(picks, On::Fit);
        let rest = self.rest(picks, &factors);
        let mut force = self.problem.measured.clone();
        if let Some(held) = &self.problem.held {
            force.add(1.0, held);
        }
        let norm = |part: &[f64]| dot(part, part);
        let size = |range: std::ops::Range<usize>| -> f64 {
            let channels = force.0.iter().flatten();
            channels.map(|values| norm(&values[range.clone()])).sum()
        };
        let fit: f64 = rest.iter().map(|r| norm(&r[..split])).sum();
        let fit = (fit / size(0..split).max(f64::MIN_POSITIVE)).sqrt();
        let check = if layout.has_check() {
            let error: f64 = rest.iter().map(|r| norm(&r[split..])).sum();
            error / size(split..layout.samples()).max(f64::MIN_POSITIVE)
        } else {
            let all = 0..rest.len();
            // Weights differ by channel, figures do not.
            let error: f64 = all
                .map(|d| self.held_out(picks, &[d]).iter().sum::<f64>() / self.weights[d])
                .sum();
            error / size(0..split).max(f64::MIN_POSITIVE)
        };
        [fit, check.sqrt()]
    }

    /// What became of every candidate.
    fn considered(
        &mut self,
        picks: &[Pick],
        found: &search::Found,
        alone: &[f64],
    ) -> Vec<Considered> {
        self.look(picks);
        let has_check = self.problem.layout.has_check();
        let table = self.table(picks);
        let now = self.try_in(&table, picks.to_vec()).squares;
        let mut considered: Vec<Considered> = Vec::new();
        for (k, candidate) in self.problem.candidates.iter().enumerate() {
            let picked = picks.iter().position(|p| p.candidate == k);
            let (gain, refused) = if let Some(i) = picked {
                let mut without = picks.to_vec();
                let pick = without.remove(i);
                let channels = self.acted_on(&[pick]);
                (self.evidence(&without, picks, &channels).gain, None)
            } else if let Some(refused) = found.refused.iter().find(|r| r.pick.candidate == k) {
                let why = if refused.wrong_sign {
                    "sign"
                } else {
                    refused
                        .evidence
                        .lacks(has_check)
                        .unwrap_or("another explains more")
                };
                (refused.evidence.gain, Some(why.to_owned()))
            } else if let Some(pick) = &self.present[k] {
                let mut with = picks.to_vec();
                with.push(pick.clone());
                let trial = self.try_in(&table, with);
                let gain = if now > 0.0 {
                    1.0 - trial.squares / now
                } else {
                    0.0
                };
                let why = if trial.wrong_sign.contains(&picks.len()) {
                    "sign"
                } else if gain < evidence::LEAST_GAIN {
                    "explains nothing that is left"
                } else {
                    "another explains more"
                };
                (gain, Some(why.to_owned()))
            } else {
                (0.0, Some("the model says it already".to_owned()))
            };
            considered.push(Considered {
                effect: candidate.effect.clone(),
                explained: alone[k],
                gain,
                refused,
            });
        }
        considered.sort_by(|a, b| {
            (b.refused.is_none().cmp(&a.refused.is_none()))
                .then(b.explained.total_cmp(&a.explained))
        });
        considered
    }
}
