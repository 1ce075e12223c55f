//! Which effect is missing: columns of what a model could lack go in; the smallest set that explains what it cannot say
//! comes out, with what cannot be told apart, and an honest answer where nothing explains it.
//!
//! 1. [`DiagnosisProblem`] - measured forces, columns of the model, candidates with the constants that are searched for.
//! 2. `pool`, `factored`, `beside`, `bench` - inner products of all columns, so that a set of effects is fitted in microseconds;
//!    `tuning` finds constants, `following` makes columns that depend on the fit, `readings` those of forces that are read
//!    wrongly, `tilt` turns gravity, `body` places a further mass, `constant` moves a number of the model.
//! 3. `search` - forward over sets, with exchanges; `evidence` decides on time that was not fitted; `settle` makes the last
//!    set as small and simple as it can be.
//! 4. `aliases` - what this recording cannot tell apart; `reproducible` - what no candidate explains and no noise is.
//! 5. [`ModelDiagnosis`] - the answer.
//!
//! What recordings have and the model does not lack is told by name too: `cleaning` takes outliers and `hum` off beforehand,
//! `drifts` and `readings` are candidates among the others, and `disturbance` says what is left, and of which sort.
//!
//! Decision: disturbances of recordings compete with effects. An encoder error, a drift or a wrong scale resembles
//! some effect at any size, so they are candidates like all others, and only effects make the verdict. What least
//! squares cannot bear (outliers, hum) or what one recording alone has (a push, another day) is removed beforehand.
//!
//! Decision: samples at reversals decide nothing. Dry friction jumps there, and no derivative of positions shows on
//! which side of the jump a sample lies. They count in the figures.

mod aliases;
mod bench;
mod beside;
mod body;
mod bounds;
mod cleaning;
mod column;
mod constant;
mod disturbance;
mod drifts;
mod estimates;
mod evidence;
mod factored;
mod following;
mod hum;
mod idle;
mod laws;
mod noise;
mod numbered;
mod pool;
mod problem;
mod readings;
mod reproducible;
mod search;
mod settle;
mod tile;
mod tilt;
mod tuning;
mod untold;

use serde::Serialize;

pub use body::AttachedBody;
pub use cleaning::quantisation_step;
pub use column::ForceColumn;
pub use constant::ConstantCorrection;
pub use disturbance::{Disturbance, EstimatedQuantity, ResidualBudget};
pub use drifts::drift_candidates;
pub use evidence::SelectionEvidence;
pub use laws::{
    LawFactor, LawProduct, LawProposal, LawShape, LawSite, LawTerm, LawVariable, SiteLaw,
};
pub use noise::{ROUNDING, effective_samples, white_noise};
pub use problem::{
    CandidateEffect, CandidateNature, ColumnChoice, ColumnProvider, ColumnSource, DiagnosisProblem,
    EffectParameter, ForceReadingFault, LoadDependentQuery, LocatedEffect, NoColumnProvider,
    ReadingFaultKind, SampleLayout, SampleSegment, SignConstraint,
};
pub use readings::reading_fault_candidates;
pub use tilt::{ForceSensitivity, TiltCandidate};

use bench::{EffectSelector, SelectedEffect};
use evidence::LEAST_GAIN;
use pool::{FitScope, dot};
use reproducible::repeatable_shares;

/// Kinds of friction of which a drift is a change.
const FRICTION: [&str; 2] = ["viscous_friction", "coulomb_friction"];

/// A law for so much of what is left says what effects that it makes needless were part of.
const MIN_LAW_SHARE: f64 = 0.5;

/// Why an effect is refused that does nothing but take back another.
const CANCELS: &str = "it would only cancel another effect at its place";

/// The answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum DiagnosisVerdict {
    /// What the model leaves is noise as far as the recordings can tell.
    Adequate,
    /// Effects are missing, and with them the model is adequate.
    MissingEffect,
    /// What is left comes again, and no candidate explains it.
    Unexplained,
}

/// A step of the ladder.
#[derive(Clone, Debug)]
pub struct SelectionStep {
    /// What was added; `None` for the model as it is.
    pub added: Vec<LocatedEffect>,
    /// What it replaced.
    pub dropped: Vec<LocatedEffect>,
    /// Relative error on the recordings of the fit.
    pub fit: f64,
    /// The same on those of the check, or of cross-validation if there are none.
    pub check: f64,
    /// As `check`, of each channel beside its own force.
    pub check_by_channel: Vec<f64>,
    /// What spoke for it.
    pub evidence: Option<SelectionEvidence>,
}

/// An effect that is missing.
#[derive(Clone, Debug)]
pub struct IdentifiedEffect {
    /// What and where.
    pub effect: LocatedEffect,
    /// Position in [`DiagnosisProblem::candidates`].
    pub candidate: usize,
    /// Constants that were searched for.
    pub constants: Vec<(String, f64)>,
    /// Estimates of the parameters, from the recordings of the fit.
    pub estimates: Vec<f64>,
    /// Their standard deviations, where they are known.
    pub standard_deviations: Vec<Option<f64>>,
    /// How likely it is that it is there.
    pub probability: f64,
    /// What cannot be told from it.
    pub indistinguishable_from: Vec<LocatedEffect>,
}

/// What became of a candidate.
#[derive(Clone, Debug)]
pub struct CandidateOutcome {
    /// What and where.
    pub effect: LocatedEffect,
    /// Share of the squared error of the model as it is that it explains alone.
    pub explained: f64,
    /// Held-out gain beside the effects that were found; for a found one, what is lost without it.
    pub gain: f64,
    /// Why it was refused; `None` if it was not.
    pub rejection_reason: Option<String>,
}

/// What a diagnosis says.
#[derive(Clone, Debug)]
pub struct ModelDiagnosis {
    /// The answer.
    pub verdict: DiagnosisVerdict,
    /// Noise of all channels relative to the measured forces, white or coloured.
    pub noise_floor: f64,
    /// What is left of each channel, by where it comes from.
    pub budgets: Vec<ResidualBudget>,
    /// What the recordings have and the model does not lack.
    pub disturbances: Vec<Disturbance>,
    /// The ladder, from the model as it is.
    pub steps: Vec<SelectionStep>,
    /// Effects that are missing.
    pub effects: Vec<IdentifiedEffect>,
    /// All candidates, those that explain most first.
    pub candidates: Vec<CandidateOutcome>,
    /// What the recordings leave open: effects as large as a drive's force would hide in what the model has.
    pub undetermined_effects: Vec<LocatedEffect>,
    /// What is left in the end, `[channel][sample]`.
    pub residual: Vec<Vec<f64>>,
    /// Share of each channel's squared rest that comes again where it was not fitted.
    pub repeatable_share: Vec<f64>,
    /// Channels whose rest is unexplained.
    pub unexplained: Vec<usize>,
    /// Places on which laws may act, where something is unexplained.
    pub sites: Vec<LawSite>,
    /// Laws that no library holds and that would explain it.
    pub laws: Vec<LawProposal>,
}

/// Finds what is missing. `supply` makes columns that are not known from the start. Outliers and hum are taken off the measured
/// forces of the problem, and what is to be left out becomes zero.
pub fn diagnose(problem: &mut DiagnosisProblem, supply: &dyn ColumnProvider) -> ModelDiagnosis {
    problem.removed.resize(problem.layout.channels.len(), 0.0);
    problem.find_reversal_samples();
    problem.estimate_idle_noise();
    let known = problem.disturbances.clone();
    let raw = (problem.measured.clone(), problem.removed.clone());
    let with = |found: Vec<Disturbance>| known.iter().cloned().chain(found).collect();
    let cleaned = cleaning::clean_forces(problem);
    let diagnosis = diagnose_cleaned(problem, supply, with(cleaned));
    let ModelDiagnosis {
        residual: rest,
        repeatable_share: again,
        unexplained,
        ..
    } = &diagnosis;
    let slow = hum::slow_lines(problem, rest, again, unexplained);
    if slow.is_empty() {
        return diagnosis;
    }
    (problem.measured, problem.removed) = raw;
    let cleaned = cleaning::clean_with_slow_lines(problem, &slow);
    diagnose_cleaned(problem, supply, with(cleaned))
}

/// The diagnosis of a problem whose forces were cleaned from `disturbances`.
fn diagnose_cleaned(
    problem: &DiagnosisProblem,
    supply: &dyn ColumnProvider,
    mut disturbances: Vec<Disturbance>,
) -> ModelDiagnosis {
    let mut bench = EffectSelector::new(problem, supply);
    bench.update_choices(&[]);
    let alone = bench.explained_by_each();
    let found = bench.search_sets();
    let picks = found.steps.last().map_or(Vec::new(), |s| s.picks.clone());
    let mut ladder = vec![bench.selection_step(&[], &[], None)];
    let mut before: Vec<SelectedEffect> = Vec::new();
    for step in &found.steps {
        ladder.push(bench.selection_step(&before, &step.picks, step.evidence));
        before.clone_from(&step.picks);
    }
    let (mut picks, mut left) = bench.drop_below_unexplained(picks);
    if picks.len() < before.len() {
        ladder.push(bench.selection_step(&before, &picks, None));
    }
    let (mut sites, mut laws) = bench.find_laws(&picks, &left);
    let needed = bench.effects_outside_laws(&picks, &laws);
    if needed.len() < picks.len() {
        let left_then = bench.set_residual(&needed);
        let (sites_then, laws_then) = bench.find_laws(&needed, &left_then);
        let stands = |law: &LawProposal| {
            let is_its = |then: &LawProposal| {
                then.channels == law.channels && then.law.gain >= MIN_LAW_SHARE
            };
            law.law.gain < MIN_LAW_SHARE || laws_then.iter().any(is_its)
        };
        if laws.iter().all(stands) {
            ladder.push(bench.selection_step(&picks, &needed, None));
            (picks, left, sites, laws) = (needed, left_then, sites_then, laws_then);
        }
    }
    let SetResidual {
        residual: rest,
        repeatable_share: mut again,
        mut unexplained,
    } = left;
    // What a law foretells comes again.
    for proposal in &laws {
        for d in &proposal.channels {
            again[*d] = again[*d].max(proposal.law.gain);
            if !unexplained.contains(d) && bench.is_unexplained(*d, &rest[*d], again[*d]) {
                unexplained.push(*d);
            }
        }
    }
    unexplained.sort_unstable();
    let aliases = bench.find_aliases(&picks);
    bench.weigh_channels(&picks);
    let (budgets, coloured) = bench.residual_budgets(&picks, &rest, &again);
    disturbances.extend(bench.disturbances(&picks));
    disturbances.extend(coloured);
    let estimates = bench.estimate_parameters(&picks, FitScope::Fit);
    let mut effects = Vec::new();
    for (i, (pick, aliases)) in picks.iter().zip(aliases).enumerate() {
        let candidate = bench.candidate(pick);
        if candidate.nature == CandidateNature::Disturbance {
            continue;
        }
        let rivals = aliases.iter().filter(|alias| !alias.is_equivalent_form);
        let rivals: Vec<f64> = rivals.map(|alias| alias.criterion_loss).collect();
        let (values, deviations) = estimates[i].iter().copied().unzip();
        effects.push(IdentifiedEffect {
            effect: candidate.effect.clone(),
            candidate: pick.candidate,
            constants: pick.constants.clone(),
            estimates: values,
            standard_deviations: deviations,
            probability: bench.probability(&picks, i, &rivals, &unexplained),
            indistinguishable_from: aliases.into_iter().map(|alias| alias.effect).collect(),
        });
    }
    merge_drifting_friction(&mut effects, &mut disturbances);
    let verdict = match (unexplained.is_empty(), effects.is_empty()) {
        (false, _) => DiagnosisVerdict::Unexplained,
        (true, true) => DiagnosisVerdict::Adequate,
        (true, false) => DiagnosisVerdict::MissingEffect,
    };
    let candidates = bench.candidate_outcomes(&picks, &found, &alone);
    let untold = bench.find_undetermined(&picks, &rest);
    ModelDiagnosis {
        verdict,
        noise_floor: noise_floor(&budgets),
        budgets,
        disturbances,
        steps: ladder,
        effects,
        candidates,
        undetermined_effects: untold,
        residual: rest,
        repeatable_share: again,
        unexplained,
        sites,
        laws,
    }
}

/// Friction that the model lacks and that drifts besides is one effect: friction that changes with time.
fn merge_drifting_friction(
    effects: &mut Vec<IdentifiedEffect>,
    disturbances: &mut Vec<Disturbance>,
) {
    disturbances.retain(|drift| {
        let is_its = |found: &IdentifiedEffect| {
            found.effect.at == drift.at && FRICTION.contains(&found.effect.kind.as_str())
        };
        let Some(at) = effects.iter().position(is_its) else {
            return true;
        };
        if drift.kind != "friction_drift" {
            return true;
        }
        let mut merged = effects[at].clone();
        effects.retain(|found| !is_its(found));
        drift.kind.clone_into(&mut merged.effect.kind);
        effects.insert(at.min(effects.len()), merged);
        // What it changes by is told besides.
        true
    });
}

/// Noise of all channels relative to the measured forces.
fn noise_floor(budgets: &[ResidualBudget]) -> f64 {
    let sum =
        |of: &dyn Fn(&ResidualBudget) -> f64| budgets.iter().map(|b| of(b).powi(2)).sum::<f64>();
    let force = sum(&|budget| budget.force);
    if force > 0.0 {
        (sum(&|budget| budget.noise) / force).sqrt()
    } else {
        0.0
    }
}

/// What a set leaves.
struct SetResidual {
    /// `[channel][sample]`
    residual: Vec<Vec<f64>>,
    /// Share of each channel's squares that comes again.
    repeatable_share: Vec<f64>,
    /// Channels of which that is more than noise.
    unexplained: Vec<usize>,
}

impl EffectSelector<'_> {
    fn set_residual(&mut self, picks: &[SelectedEffect]) -> SetResidual {
        self.weigh_channels(picks);
        let (factors, _) = self.fit(picks, FitScope::All);
        let rest = self.residual(picks, &factors);
        let problem = self.problem;
        let again = repeatable_shares(&problem.layout, &problem.variables, &rest);
        let unexplained = (0..rest.len())
            .filter(|d| self.is_unexplained(*d, &rest[*d], again[*d]))
            .collect();
        SetResidual {
            residual: rest,
            repeatable_share: again,
            unexplained,
        }
    }

    /// Laws for what a set leaves, and where they may act.
    fn find_laws(
        &self,
        picks: &[SelectedEffect],
        left: &SetResidual,
    ) -> (Vec<LawSite>, Vec<LawProposal>) {
        if self.problem.effects_only {
            return (Vec::new(), Vec::new());
        }
        let left = laws::ResidualView {
            residual: &left.residual,
            repeatable_share: &left.repeatable_share,
            unexplained: &left.unexplained,
        };
        laws::propose_laws(self, picks, &left, self.provider)
    }

    /// The members of a set that laws do not make needless: an effect that goes where a law for most of the rest comes is part of
    /// that law, if it acts on drives that feel the law.
    fn effects_outside_laws(
        &self,
        picks: &[SelectedEffect],
        laws: &[LawProposal],
    ) -> Vec<SelectedEffect> {
        let is_part = |pick: &SelectedEffect, proposal: &LawProposal| {
            let channels = self.affected_channels(std::slice::from_ref(pick));
            let effect = &self.candidate(pick).effect;
            proposal.law.gain >= MIN_LAW_SHARE
                && proposal.law.replaced_effects.contains(effect)
                && channels.iter().all(|d| proposal.channels.contains(d))
        };
        let is_needed =
            |pick: &&SelectedEffect| !laws.iter().any(|proposal| is_part(pick, proposal));
        picks.iter().filter(is_needed).cloned().collect()
    }

    /// A set without members that explain less than what stays unexplained where they act, and what it leaves: part of a law that
    /// nobody knows is as likely there as the effect.
    fn drop_below_unexplained(
        &mut self,
        mut picks: Vec<SelectedEffect>,
    ) -> (Vec<SelectedEffect>, SetResidual) {
        loop {
            let left = self.set_residual(&picks);
            let mut least: Option<(f64, Vec<SelectedEffect>)> = None;
            for i in 0..picks.len() {
                let channels = self.affected_channels(&picks[i..=i]);
                let squares =
                    |rest: &[Vec<f64>], d: usize| self.weights[d] * dot(&rest[d], &rest[d]);
                let unexplained = channels.iter().filter(|d| left.unexplained.contains(d));
                let stays: f64 = unexplained
                    .map(|d| left.repeatable_share[*d] * squares(&left.residual, *d))
                    .sum();
                if stays <= 0.0 {
                    continue;
                }
                let mut fewer = picks.clone();
                fewer.remove(i);
                let fewer = self.refresh_columns(fewer);
                let (factors, _) = self.fit(&fewer, FitScope::All);
                let rest = self.residual(&fewer, &factors);
                let squares =
                    |rest: &[Vec<f64>], d: usize| self.weights[d] * dot(&rest[d], &rest[d]);
                let gains = channels
                    .iter()
                    .map(|d| squares(&rest, *d) - squares(&left.residual, *d));
                let share = gains.sum::<f64>() / stays;
                if share < 1.0 && least.as_ref().is_none_or(|(other, _)| share < *other) {
                    least = Some((share, fewer));
                }
            }
            match least {
                Some((_, fewer)) => picks = fewer,
                None => return (picks, left),
            }
        }
    }

    /// Whether what is left of a channel is more than noise: it comes again with the state, by a share that an effect would be
    /// added for.
    fn is_unexplained(&self, channel: usize, rest: &[f64], again: f64) -> bool {
        let squares = dot(rest, rest) / rest.len().max(1) as f64;
        let noise = self.problem.noise[channel].powi(2);
        squares > noise && again > LEAST_GAIN
    }

    /// Share of the squared error of the model as it is that each candidate explains alone.
    fn explained_by_each(&self) -> Vec<f64> {
        let table = self.projected_gram(&[]);
        let total = self.fit_from_gram(&table, Vec::new()).squares;
        let share = |pick: &Option<SelectedEffect>| match pick {
            Some(pick) if total > 0.0 => {
                1.0 - self.fit_from_gram(&table, vec![pick.clone()]).squares / total
            }
            _ => 0.0,
        };
        self.current_choices.iter().map(share).collect()
    }

    fn selection_step(
        &self,
        before: &[SelectedEffect],
        after: &[SelectedEffect],
        evidence: Option<SelectionEvidence>,
    ) -> SelectionStep {
        let effects = |set: &[SelectedEffect], other: &[SelectedEffect]| -> Vec<LocatedEffect> {
            let is_new =
                |pick: &&SelectedEffect| other.iter().all(|p| p.candidate != pick.candidate);
            let new = set.iter().filter(is_new);
            new.map(|pick| self.candidate(pick).effect.clone())
                .collect()
        };
        let (fit, check, check_by_channel) = self.relative_errors(after);
        SelectionStep {
            added: effects(after, before),
            dropped: effects(before, after),
            fit,
            check,
            check_by_channel,
            evidence,
        }
    }

    /// Relative errors on fit and check, and of each channel on the check, fitted to the fit; without a check by cross-validation.
    fn relative_errors(&self, picks: &[SelectedEffect]) -> (f64, f64, Vec<f64>) {
        let layout = &self.problem.layout;
        let split = layout.fit_samples();
        let rest = self.full_residual(picks);
        let channels = 0..rest.len();
        let forces: Vec<Vec<f64>> = channels
            .clone()
            .map(|d| self.problem.measured_force(d))
            .collect();
        let norm = |part: &[f64]| dot(part, part);
        let squares = |of: &[Vec<f64>], range: std::ops::Range<usize>| -> Vec<f64> {
            of.iter().map(|all| norm(&all[range.clone()])).collect()
        };
        let relative = |error: f64, force: f64| (error / force.max(f64::MIN_POSITIVE)).sqrt();
        let whole =
            |errors: &[f64], forces: &[f64]| relative(errors.iter().sum(), forces.iter().sum());
        let fit = whole(&squares(&rest, 0..split), &squares(&forces, 0..split));
        let judged = if layout.has_check() {
            split..layout.samples()
        } else {
            0..split
        };
        let errors = if layout.has_check() {
            squares(&rest, judged.clone())
        } else {
            // Weights differ by channel, figures do not.
            let held_out = |d: usize| {
                self.validation_errors(picks, &[d], true)
                    .iter()
                    .sum::<f64>()
                    / self.weights[d]
            };
            channels.map(held_out).collect()
        };
        let forces = squares(&forces, judged);
        let pairs = errors.iter().zip(&forces);
        let by_channel = pairs.map(|(error, force)| relative(*error, *force));
        (fit, whole(&errors, &forces), by_channel.collect())
    }

    /// What a set leaves where it is fitted to the fit. What decides nothing counts, but for what is left out altogether.
    fn full_residual(&self, picks: &[SelectedEffect]) -> Vec<Vec<f64>> {
        let (factors, _) = self.fit(picks, FitScope::Fit);
        let columns = self.columns(picks);
        let mut rest = (self.pool).full_residual(self.measured, &columns, factors.as_slice());
        for (rest, out) in rest.iter_mut().zip(&self.problem.left_out) {
            for (r, _) in rest.iter_mut().zip(out).filter(|(_, out)| **out) {
                *r = 0.0;
            }
        }
        rest
    }

    /// Whether a change makes what is left larger where everything counts, in the fit and in the check: then it explains what
    /// decides at the cost of what lies next to reversals, where an effect would be seen, too.
    fn is_worse_overall(
        &self,
        before: &[SelectedEffect],
        after: &[SelectedEffect],
        channels: &[usize],
    ) -> bool {
        if self.problem.jumps.is_empty() {
            return false;
        }
        let layout = &self.problem.layout;
        let split = layout.fit_samples();
        let [old, new] = [before, after].map(|picks| self.full_residual(picks));
        let rises = |range: std::ops::Range<usize>| {
            let of = |rest: &[Vec<f64>], d: usize| {
                let part = &rest[d][range.clone()];
                self.weights[d] * dot(part, part)
            };
            let more = channels.iter().map(|d| of(&new, *d) - of(&old, *d));
            more.sum::<f64>() > 0.0
        };
        rises(0..split) && (!layout.has_check() || rises(split..layout.samples()))
    }

    /// What became of every candidate.
    fn candidate_outcomes(
        &mut self,
        picks: &[SelectedEffect],
        found: &search::EffectSearchResult,
        alone: &[f64],
    ) -> Vec<CandidateOutcome> {
        if self.problem.effects_only {
            return Vec::new();
        }
        self.update_choices(picks);
        let has_check = self.problem.layout.has_check();
        let table = self.projected_gram(picks);
        let now = self.fit_from_gram(&table, picks.to_vec()).squares;
        let mut considered: Vec<CandidateOutcome> = Vec::new();
        for (k, candidate) in self.problem.candidates.iter().enumerate() {
            let picked = picks.iter().position(|p| p.candidate == k);
            let (gain, refused) = if let Some(i) = picked {
                let mut without = picks.to_vec();
                let pick = without.remove(i);
                let channels = self.affected_channels(&[pick]);
                (self.evidence(&without, picks, &channels).gain, None)
            } else if let Some(refused) = found.rejected.iter().find(|r| r.pick.candidate == k) {
                let why = if refused.wrong_sign {
                    "sign"
                } else if refused.cancels {
                    CANCELS
                } else {
                    refused
                        .evidence
                        .insufficiency_reason(has_check)
                        .unwrap_or("another explains more")
                };
                (refused.evidence.gain, Some(why.to_owned()))
            } else if let Some(pick) = &self.current_choices[k] {
                let mut with = picks.to_vec();
                with.push(pick.clone());
                let trial = self.fit_from_gram(&table, with);
                let gain = if now > 0.0 {
                    1.0 - trial.squares / now
                } else {
                    0.0
                };
                let why = if trial.wrong_sign.contains(&picks.len()) {
                    "sign"
                } else if trial.cancelling.contains(&picks.len()) {
                    CANCELS
                } else if gain < LEAST_GAIN {
                    "explains nothing that is left"
                } else {
                    "another explains more"
                };
                (gain, Some(why.to_owned()))
            } else {
                (0.0, Some("the model says it already".to_owned()))
            };
            considered.push(CandidateOutcome {
                effect: candidate.effect.clone(),
                explained: alone[k],
                gain,
                rejection_reason: refused,
            });
        }
        considered.sort_by(|a, b| {
            (b.rejection_reason
                .is_none()
                .cmp(&a.rejection_reason.is_none()))
            .then(b.explained.total_cmp(&a.explained))
        });
        considered
    }
}
