//! Which effect is missing. Input: measured forces, columns of the model and columns of candidates. Output: the
//! smallest set of effects that explains the residual, with indistinguishable alternatives, or the statement that no
//! candidate explains it.
//!
//! 1. [`DiagnosisProblem`] - measured forces, columns of the model, candidates with the constants that are searched
//!    for.
//! 2. `pool`, `factored`, `conditional`, `bench` - inner products of all columns, so that a set of effects is fitted in
//!    microseconds; `tuning` finds constants, `fit_dependent` computes columns that depend on the fit, `force_signals` those of
//!    faulty force signals, `tilt` rotates gravity, `body` places an additional mass, `constant` corrects a number of
//!    the model.
//! 3. `search` - forward search over sets, with exchanges; `combinations` tries pairs and the same kinds at all drives;
//!    `criterion` compares fitted sets; `evidence` decides on time that was not fitted; `simplification`
//!    makes the last set as small and simple as possible.
//! 4. `residuals` - what a set leaves; `aliases` - effects that this recording cannot distinguish; `reproducible` - the
//!    repeatable residual that no candidate explains.
//! 5. [`ModelDiagnosis`] - the answer.
//!
//! Disturbances of the recordings are reported by name too: `cleaning` removes outliers and `hum` beforehand, `drifts`
//! and `force_signals` are candidates among the others, and `disturbance` splits the residual by its origin.
//!
//! Decision: disturbances of recordings compete with effects. An encoder error, a drift or a wrong scale resembles some
//! effect at any size, so they are candidates like all others, and only effects decide the verdict. Disturbances that
//! least squares cannot tolerate (outliers, hum) or that only one recording has (a push, another day) are removed
//! beforehand.
//!
//! Decision: samples at reversals decide nothing. Dry friction jumps there, and no derivative of positions shows on
//! which side of the jump a sample lies. They count in the figures.

mod aliases;
mod below_unexplained;
mod bench;
mod body;
mod bounds;
mod cleaning;
mod column;
mod combinations;
mod conditional;
mod confirmed_readings;
mod constant;
mod criterion;
mod determined;
mod disturbance;
mod drifts;
mod estimates;
mod evidence;
mod factored;
mod fit_dependent;
mod force_signals;
mod hum;
mod in_time;
mod laws;
mod noise;
mod numbered;
mod plausible;
mod pool;
mod possible;
mod problem;
mod rejection;
mod reproducible;
mod residuals;
mod search;
mod simplification;
mod support;
mod thresholds;
mod tile;
mod tilt;
mod tuning;
mod undecided;
mod zero_columns;

use serde::Serialize;

pub use body::AttachedBody;
pub use cleaning::quantisation_step;
pub use column::ForceColumn;
pub use constant::ConstantCorrection;
pub use disturbance::{Disturbance, EstimatedQuantity, ResidualBudget};
pub use drifts::drift_candidates;
pub use evidence::SelectionEvidence;
pub use force_signals::reading_fault_candidates;
pub use in_time::{
    ChangeForce, ChangeInterval, ChangeShape, ResidualCharacter, TimeResidual, signal_changes, top_speed,
};
pub use laws::{LawFactor, LawProduct, LawProposal, LawShape, LawSite, LawTerm, LawVariable, SiteLaw};
pub use noise::{effective_samples, white_noise};
pub use problem::{
    CandidateEffect, CandidateNature, ColumnChoice, ColumnProvider, ColumnSource, DiagnosisProblem, EffectParameter,
    ForceReadingFault, LoadDependentQuery, LocatedEffect, NoColumnProvider, ReadingFaultKind, SampleLayout,
    SampleSegment, SignConstraint, TIME_BASE,
};
pub use rejection::RejectionReason;
pub use support::EffectSupport;
pub use thresholds::{FORCE_ROUNDING, LACKING_LEAST_PROBABILITY};
pub use tilt::{ForceSensitivity, TiltCandidate};

use crate::signal::dot;
use bench::{EffectSelector, SelectedEffect};
use in_time::FoundChange;
use pool::FitScope;
use reproducible::repeatable_shares;
use thresholds::{EXPLICABLE_LEAST_NOISE_RATIO, HIDING_NOISE_SHARE, LEAST_GAIN, REPLACING_LAW_LEAST_SHARE};

/// Kinds of friction of which a drift is a change.
const FRICTION: [&str; 2] = ["viscous_friction", "coulomb_friction"];

/// Verdict of a diagnosis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum DiagnosisVerdict {
    /// The residual of the model is noise as far as the recordings can show.
    Adequate,
    /// Effects are missing, and with them the model is adequate.
    MissingEffect,
    /// A part of the residual remains that no candidate explains: it is repeatable, or it varies with time. The verdict is
    /// the same if the recordings agree with the model only after the correction of a mistake, or if noise of half the
    /// force or more hides what may be missing.
    Unexplained,
}

impl ModelDiagnosis {
    /// True if the noise is so large that a missing effect could stay undetected.
    pub fn is_hidden_by_noise(&self) -> bool {
        self.noise_floor >= HIDING_NOISE_SHARE
    }
}

/// A step of the search: the change of the set of effects and the error after it.
#[derive(Clone, Debug)]
pub struct SelectionStep {
    /// Effects that were added; empty for the first step, the model as it is.
    pub added: Vec<LocatedEffect>,
    /// Effects that were removed in exchange.
    pub dropped: Vec<LocatedEffect>,
    /// Error on the recordings of the fit, relative to the measured force (0.1 = 10 %).
    pub fit: f64,
    /// The same on the validation runs, or by cross-validation if there are none.
    pub check: f64,
    /// As `check`, for each channel relative to its own force, `[channel]`.
    pub check_by_channel: Vec<f64>,
    /// Evidence that supports the step; `None` where a smaller set replaces a larger one.
    pub evidence: Option<SelectionEvidence>,
}

/// An effect that is missing.
#[derive(Clone, Debug)]
pub struct IdentifiedEffect {
    /// Kind and place.
    pub effect: LocatedEffect,
    /// Index into [`DiagnosisProblem::candidates`].
    pub candidate: usize,
    /// Constants that were searched for, as (symbol, value).
    pub constants: Vec<(String, f64)>,
    /// Estimates of the parameters from the recordings of the fit, in the order and units of the candidate's
    /// parameters.
    pub estimates: Vec<f64>,
    /// Their standard deviations, in the same units; `None` where other columns explain the same.
    pub standard_deviations: Vec<Option<f64>>,
    /// Probability that the effect is present, 0 to 1.
    pub probability: f64,
    /// What supports the effect; the probability follows from it.
    pub support: EffectSupport,
    /// Effects that explain the data equally well.
    pub indistinguishable_from: Vec<LocatedEffect>,
    /// Other places that share one value with this place in the model file; the estimates are then differences from the
    /// shared value. Empty if the model has no such effect here. The caller, who knows the model, sets it.
    pub shared_with: Vec<String>,
    /// Whether it was measured in the positions instead of estimated from the forces; the errors of the steps are then
    /// those without it. The caller sets it.
    pub is_measured: bool,
}

/// A candidate with the result of the search.
#[derive(Clone, Debug)]
pub struct CandidateOutcome {
    /// Kind and place.
    pub effect: LocatedEffect,
    /// Share of the squared error of the unchanged model that it explains alone, 0 to 1.
    pub explained: f64,
    /// Relative decrease of the squared error if the candidate is added to the other effects found. It is computed on
    /// data that was not fitted if the effect was found or the search tested it, otherwise on the fitted data.
    pub gain: f64,
    /// Why it was rejected; `None` if it was found.
    pub rejection_reason: Option<RejectionReason>,
}

/// Result of the search inside a diagnosis. Drives are indices here: a channel is the force signal of one drive. The
/// library `modelmill` returns it in its `DiagnosisFindings`, which adds the names of the drives, the models without
/// and with the effects, and the edited model file.
#[derive(Clone, Debug)]
pub struct ModelDiagnosis {
    /// The verdict.
    pub verdict: DiagnosisVerdict,
    /// Noise of the forces of all drives together, white or coloured, relative to the measured forces (0.01 = 1 %).
    pub noise_floor: f64,
    /// Residual of each channel, split by its origin.
    pub budgets: Vec<ResidualBudget>,
    /// Disturbances of the recordings, which are not model errors.
    pub disturbances: Vec<Disturbance>,
    /// Steps of the search; the first is the model as it is.
    pub steps: Vec<SelectionStep>,
    /// Effects that are missing.
    pub effects: Vec<IdentifiedEffect>,
    /// Effects that are less likely than not: with a probability below 0.5. They do not count as missing. The last set of
    /// effects does not contain them, so the errors of the last step are those without them. Their estimates are those of
    /// an earlier set that contained them.
    pub possible_effects: Vec<IdentifiedEffect>,
    /// All candidates: first those that were found, then by the share that they explain alone.
    pub candidates: Vec<CandidateOutcome>,
    /// Effects that the recordings can neither show nor exclude. Even if such an effect had a force as large as that of
    /// the drive, the part of it that the other columns cannot reproduce would be too small to detect.
    pub undecided_effects: Vec<LocatedEffect>,
    /// Residual after the last step, `[channel][sample]`, N or N m; 0 at excluded samples.
    pub residual: Vec<Vec<f64>>,
    /// As `residual`, but with the real residual also at the excluded samples, which are not fitted; 0 where no force
    /// was measured.
    pub complete_residual: Vec<Vec<f64>>,
    /// Share of each channel's squared residual that is repeatable on data that was not fitted, 0 to 1.
    pub repeatable_share: Vec<f64>,
    /// Indices of the channels whose residual is unexplained.
    pub unexplained: Vec<usize>,
    /// Residuals that vary with time, are not a function of the state, and cannot be noise.
    pub time_residuals: Vec<TimeResidual>,
    /// Places on which proposed laws may act; empty unless something is unexplained.
    pub sites: Vec<LawSite>,
    /// Proposed laws that are in no library and would explain the unexplained residual.
    pub laws: Vec<LawProposal>,
}

/// Finds the missing effects. `supply` computes columns that are not known from the start. Outliers and hum are
/// subtracted from the measured forces of the problem, and samples to be left out become zero.
pub fn diagnose(problem: &mut DiagnosisProblem, supply: &dyn ColumnProvider) -> ModelDiagnosis {
    problem.removed.resize(problem.layout.channels.len(), 0.0);
    problem.leave_out_standstill();
    problem.find_reversal_samples();
    problem.estimate_idle_noise();
    // The uncleaned forces are kept for a second cleaning, if slow hum shows in the residual of the first diagnosis.
    let known = problem.disturbances.clone();
    let raw = (problem.measured.clone(), problem.removed.clone());
    let with = |found: Vec<Disturbance>| known.iter().cloned().chain(found).collect();
    let cleaned = cleaning::clean_forces(problem);
    let found = in_time::find_changes(problem, &problem.base.iter().collect::<Vec<_>>());
    problem.add_changes(found);
    let (mut diagnosis, later) = diagnose_cleaned(problem, supply, with(cleaned.clone()));
    if supply.is_cancelled() {
        return diagnosis;
    }
    // A change that is hidden by a large missing effect is visible only in the residual of the effects found.
    if problem.add_changes(later) {
        (diagnosis, _) = diagnose_cleaned(problem, supply, with(cleaned));
    }
    let ModelDiagnosis {
        residual: rest,
        repeatable_share: again,
        unexplained,
        ..
    } = &diagnosis;
    // A hum among the frequencies of the motion is visible only after the model has been fitted.
    let slow = hum::slow_lines(problem, rest, again, unexplained);
    if slow.is_empty() || supply.is_cancelled() {
        return diagnosis;
    }
    // Start again from the original forces without that hum.
    (problem.measured, problem.removed) = raw;
    let cleaned = cleaning::clean_with_slow_lines(problem, &slow);
    diagnose_cleaned(problem, supply, with(cleaned)).0
}

impl DiagnosisProblem {
    /// Adds changes in time to the candidates. Earlier ones of the same kind and place stay: they were found in more
    /// recordings, since no effect explained a part of them yet. Returns whether there are new ones.
    fn add_changes(&mut self, found: Vec<FoundChange>) -> bool {
        let known = self.candidates.len();
        for FoundChange {
            candidate, intervals, ..
        } in found
        {
            if self
                .change_intervals
                .iter()
                .any(|(effect, _)| *effect == candidate.effect)
            {
                continue;
            }
            self.change_intervals.push((candidate.effect.clone(), intervals));
            self.candidates.push(candidate);
        }
        self.candidates.len() > known
    }
}

/// The diagnosis of a problem whose forces were cleaned from `disturbances`, and changes in time that show in its
/// residual but are not among its effects.
fn diagnose_cleaned(
    problem: &DiagnosisProblem,
    supply: &dyn ColumnProvider,
    mut disturbances: Vec<Disturbance>,
) -> (ModelDiagnosis, Vec<FoundChange>) {
    let mut bench = EffectSelector::new(problem, supply);
    bench.update_choices(&[]);
    // Stage 1: forward search over sets of effects.
    let alone = bench.explained_by_each();
    let found = bench.search_sets();
    let picks = found.steps.last().map_or(Vec::new(), |s| s.picks.clone());
    // Report the steps with their errors; the first entry is the model without any effect.
    let mut steps = vec![bench.selection_step(&[], &[], None)];
    let mut before: Vec<SelectedEffect> = Vec::new();
    for step in &found.steps {
        steps.push(bench.selection_step(&before, &step.picks, step.evidence));
        before.clone_from(&step.picks);
    }
    // Stage 2: drop effects that explain less than what stays unexplained on their channels.
    let (mut picks, mut left) = bench.drop_below_unexplained(picks);
    if picks.len() < before.len() {
        steps.push(bench.selection_step(&before, &picks, None));
    }
    // Stage 3: propose laws for the unexplained residual. Effects that such a law contains are dropped, if the law
    // still explains as much without them.
    let (mut sites, mut laws) = bench.find_laws(&picks, &left);
    let needed = bench.effects_outside_laws(&picks, &laws);
    if needed.len() < picks.len() {
        let left_then = bench.set_residual(&needed);
        let (sites_then, laws_then) = bench.find_laws(&needed, &left_then);
        let stands = |law: &LawProposal| {
            let is_its =
                |then: &LawProposal| then.channels == law.channels && then.law.gain >= REPLACING_LAW_LEAST_SHARE;
            law.law.gain < REPLACING_LAW_LEAST_SHARE || laws_then.iter().any(is_its)
        };
        if laws.iter().all(stands) {
            steps.push(bench.selection_step(&picks, &needed, None));
            (picks, left, sites, laws) = (needed, left_then, sites_then, laws_then);
        }
    }
    // Stage 4: indistinguishable alternatives and probabilities. Effects that are less likely than not are set aside.
    let mut assessed = bench.assess_effects(&picks, &left);
    let possible = assessed.set_aside_unlikely(&bench);
    if !possible.is_empty() {
        steps.push(bench.selection_step(&picks, &assessed.picks, None));
        picks.clone_from(&assessed.picks);
        left = bench.set_residual(&picks);
    }
    let SetResidual {
        residual: rest,
        repeatable_share: mut again,
        mut unexplained,
    } = left;
    // The part of the residual that a law predicts is repeatable.
    for proposal in &laws {
        for d in &proposal.channels {
            again[*d] = again[*d].max(proposal.law.gain);
            if !unexplained.contains(d) && bench.is_unexplained(*d, &rest, again[*d]) {
                unexplained.push(*d);
            }
        }
    }
    unexplained.sort_unstable();
    // Stage 5: the origin of the residual, disturbances and estimates.
    bench.weigh_channels(&picks);
    let (budgets, coloured, time_residuals) = bench.residual_budgets(&picks, &rest, &again);
    disturbances.extend(bench.disturbances(&picks));
    disturbances.extend(coloured);
    let mut effects = assessed.identified_effects(&bench);
    merge_drifting_friction(&mut effects, &mut disturbances);
    // Unexplained residual decides before effects that were found.
    let changes_in_time = (picks.iter()).any(|pick| bench.candidate(pick).nature == CandidateNature::ChangeInTime);
    let noise_floor = noise_floor(&budgets);
    let is_explained = unexplained.is_empty()
        && !changes_in_time
        && time_residuals.is_empty()
        && (noise_floor < HIDING_NOISE_SHARE || !effects.is_empty());
    let verdict = match (is_explained, effects.is_empty()) {
        (false, _) => DiagnosisVerdict::Unexplained,
        (true, true) => DiagnosisVerdict::Adequate,
        (true, false) => DiagnosisVerdict::MissingEffect,
    };
    let mut candidates = bench.candidate_outcomes(&picks, &found, &alone);
    for candidate in &mut candidates {
        if possible.iter().any(|found| found.effect == candidate.effect) {
            candidate.rejection_reason = Some(RejectionReason::LessLikelyThanNot);
        }
    }
    let undecided = bench.find_undecided(&picks, &rest);
    let later = bench.changes_in_residual(&picks);
    let complete_residual = bench.complete_residual(&picks);
    let diagnosis = ModelDiagnosis {
        verdict,
        noise_floor,
        budgets,
        disturbances,
        steps,
        effects,
        possible_effects: possible,
        candidates,
        undecided_effects: undecided,
        residual: rest,
        complete_residual,
        repeatable_share: again,
        unexplained,
        time_residuals,
        sites,
        laws,
    };
    (diagnosis, later)
}

/// Joins friction that is missing and also drifts into one effect: friction that changes with time.
fn merge_drifting_friction(effects: &mut Vec<IdentifiedEffect>, disturbances: &mut Vec<Disturbance>) {
    disturbances.retain(|drift| {
        let is_its =
            |found: &IdentifiedEffect| found.effect.at == drift.at && FRICTION.contains(&found.effect.kind.as_str());
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
        // The drift stays in the list of disturbances, which reports by how much the friction changes.
        true
    });
}

/// Root of the summed squares of the channels' noise, relative to that of their forces; 0 without force.
fn noise_floor(budgets: &[ResidualBudget]) -> f64 {
    let sum = |of: &dyn Fn(&ResidualBudget) -> f64| budgets.iter().map(|b| of(b).powi(2)).sum::<f64>();
    let force = sum(&|budget| budget.force);
    if force > 0.0 {
        (sum(&|budget| budget.noise) / force).sqrt()
    } else {
        0.0
    }
}

/// Residual of a set of effects.
struct SetResidual {
    /// `[channel][sample]`, N or N m.
    residual: Vec<Vec<f64>>,
    /// Repeatable share of each channel's squares, 0 to 1.
    repeatable_share: Vec<f64>,
    /// Indices of the channels whose repeatable residual is more than noise.
    unexplained: Vec<usize>,
}

impl EffectSelector<'_> {
    /// Changes in time that the residual of a set shows and that are not members of the set.
    fn changes_in_residual(&self, picks: &[SelectedEffect]) -> Vec<FoundChange> {
        let columns: Vec<&ForceColumn> = self.columns(picks).iter().map(|k| self.pool.column(*k)).collect();
        let mut found = in_time::find_changes(self.problem, &columns);
        let is_member = |effect: &LocatedEffect| picks.iter().any(|pick| self.candidate(pick).effect == *effect);
        found.retain(|change| !is_member(&change.candidate.effect));
        found
    }

    /// Residual of a set that is fitted to all samples, with its repeatable share; sets the weights of the channels
    /// from it.
    fn set_residual(&mut self, picks: &[SelectedEffect]) -> SetResidual {
        self.weigh_channels(picks);
        let (factors, _) = self.fit(picks, FitScope::All);
        let rest = self.residual(picks, &factors);
        let problem = self.problem;
        let again = repeatable_shares(&problem.layout, &problem.variables, &rest);
        let unexplained = (0..rest.len())
            .filter(|d| self.is_unexplained(*d, &rest, again[*d]))
            .collect();
        SetResidual {
            residual: rest,
            repeatable_share: again,
            unexplained,
        }
    }

    /// Proposes laws for the residual of a set, with the places where they may act; empty if only effects are
    /// requested.
    fn find_laws(&self, picks: &[SelectedEffect], left: &SetResidual) -> (Vec<LawSite>, Vec<LawProposal>) {
        if self.problem.effects_only || self.provider.is_cancelled() {
            return (Vec::new(), Vec::new());
        }
        let left = laws::ResidualView {
            residual: &left.residual,
            repeatable_share: &left.repeatable_share,
            unexplained: &left.unexplained,
        };
        laws::propose_laws(self, picks, &left, self.provider)
    }

    /// Members of a set that proposed laws do not make unnecessary. An effect that a law replaces is part of it, if the
    /// law explains most of the residual and acts on all channels of the effect.
    fn effects_outside_laws(&self, picks: &[SelectedEffect], laws: &[LawProposal]) -> Vec<SelectedEffect> {
        let is_part = |pick: &SelectedEffect, proposal: &LawProposal| {
            let channels = self.affected_channels(std::slice::from_ref(pick));
            let effect = &self.candidate(pick).effect;
            proposal.law.gain >= REPLACING_LAW_LEAST_SHARE
                && proposal.law.replaced_effects.contains(effect)
                && channels.iter().all(|d| proposal.channels.contains(d))
        };
        let is_needed = |pick: &&SelectedEffect| !laws.iter().any(|proposal| is_part(pick, proposal));
        picks.iter().filter(is_needed).cloned().collect()
    }

    /// Whether the residual of a channel is more than noise: a part of it is repeatable, and that share would be enough
    /// to add an effect. `rest` is the residual of all channels, `again` the repeatable share of this one.
    fn is_unexplained(&self, channel: usize, rest: &[Vec<f64>], again: f64) -> bool {
        let noise = self.problem.noise[channel]
            .powi(2)
            .max(self.idle_variance(channel, rest));
        self.pool.mean_square(channel, &rest[channel]) > noise && again > LEAST_GAIN
    }

    /// Share of the squared error of the unchanged model that each candidate explains alone, `[candidate]`, 0 to 1.
    fn explained_by_each(&self) -> Vec<f64> {
        let table = self.projected_gram(&[]);
        let total = self.fit_from_gram(&table, Vec::new()).squares;
        let share = |pick: &Option<SelectedEffect>| match pick {
            Some(pick) if total > 0.0 => 1.0 - self.fit_from_gram(&table, vec![pick.clone()]).squares / total,
            _ => 0.0,
        };
        self.current_choices.iter().map(share).collect()
    }

    /// A step from one set to another, with the errors of the later one.
    fn selection_step(
        &self,
        before: &[SelectedEffect],
        after: &[SelectedEffect],
        evidence: Option<SelectionEvidence>,
    ) -> SelectionStep {
        let effects = |set: &[SelectedEffect], other: &[SelectedEffect]| -> Vec<LocatedEffect> {
            let is_new = |pick: &&SelectedEffect| other.iter().all(|p| p.candidate != pick.candidate);
            let new = set.iter().filter(is_new);
            new.map(|pick| self.candidate(pick).effect.clone()).collect()
        };
        let (fit, check, check_by_channel) = self.relative_errors(after, self.has_run_parameters(after));
        SelectionStep {
            added: effects(after, before),
            dropped: effects(before, after),
            fit,
            check,
            check_by_channel,
            evidence,
        }
    }

    /// Whether a set has parameters that belong to one recording: those of a validation run are unknown to a fit of the
    /// other recordings.
    pub(crate) fn has_run_parameters(&self, picks: &[SelectedEffect]) -> bool {
        picks.iter().any(|pick| self.candidate(pick).is_per_run)
    }

    /// Relative errors of a set that is fitted to the recordings of the fit: on these, on the validation runs, and per
    /// channel on the validation runs. `by_folds` requests cross-validation over all recordings for the last two; it is
    /// used in any case if there is no validation run.
    fn relative_errors(&self, picks: &[SelectedEffect], by_folds: bool) -> (f64, f64, Vec<f64>) {
        let layout = &self.problem.layout;
        let split = layout.fit_samples();
        let rest = self.full_residual(picks);
        let channels = 0..rest.len();
        let mut forces: Vec<Vec<f64>> = channels.clone().map(|d| self.problem.measured_force(d)).collect();
        self.zero_left_out(&mut forces);
        let norm = |part: &[f64]| dot(part, part);
        let squares = |of: &[Vec<f64>], range: std::ops::Range<usize>| -> Vec<f64> {
            of.iter().map(|all| norm(&all[range.clone()])).collect()
        };
        let relative = |error: f64, force: f64| (error / force.max(f64::MIN_POSITIVE)).sqrt();
        let whole = |errors: &[f64], forces: &[f64]| relative(errors.iter().sum(), forces.iter().sum());
        let fit = whole(&squares(&rest, 0..split), &squares(&forces, 0..split));
        let by_folds = by_folds || !layout.has_check();
        let judged = if by_folds {
            0..layout.samples()
        } else {
            split..layout.samples()
        };
        let errors = if by_folds {
            // Validation errors are weighted by channel; reported errors are not.
            let held_out = |d: usize| self.validation_errors(picks, &[d], true).iter().sum::<f64>() / self.weights[d];
            channels.map(held_out).collect()
        } else {
            squares(&rest, judged.clone())
        };
        let forces = squares(&forces, judged);
        let pairs = errors.iter().zip(&forces);
        let by_channel = pairs.map(|(error, force)| relative(*error, *force));
        (fit, whole(&errors, &forces), by_channel.collect())
    }

    /// Result for every candidate: found, or rejected with the reason.
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
        // A candidate may fit noise too: where nothing else is left, that is the reason.
        let (factors, _) = self.fit(picks, FitScope::All);
        let rest = self.residual(picks, &factors);
        let is_only_noise = |pick: &SelectedEffect| {
            let channels = self.affected_channels(std::slice::from_ref(pick));
            self.squares_over_noise(&rest, &channels) <= EXPLICABLE_LEAST_NOISE_RATIO
        };
        let mut considered: Vec<CandidateOutcome> = Vec::new();
        for (k, candidate) in self.problem.candidates.iter().enumerate() {
            let picked = picks.iter().position(|p| p.candidate == k);
            // Three cases: part of the final set, tested and rejected by the search, or never among the best.
            let (gain, refused) = if let Some(i) = picked {
                let mut without = picks.to_vec();
                let pick = without.remove(i);
                let channels = self.affected_channels(&[pick]);
                (self.evidence(&without, picks, &channels).gain, None)
            } else if let Some(refused) = found.rejected.iter().find(|r| r.pick.candidate == k) {
                (refused.evidence.gain, Some(refused.reason(has_check)))
            } else if let Some(pick) = &self.current_choices[k] {
                let mut with = picks.to_vec();
                with.push(pick.clone());
                let trial = self.fit_from_gram(&table, with);
                let gain = if now > 0.0 { 1.0 - trial.squares / now } else { 0.0 };
                let why = if trial.wrong_sign.contains(&picks.len()) {
                    RejectionReason::WrongSign
                } else if trial.cancelling.contains(&picks.len()) {
                    RejectionReason::CancelsAnother
                } else if trial.implausible.contains(&picks.len()) {
                    RejectionReason::ImplausibleValue
                } else if gain < LEAST_GAIN {
                    RejectionReason::ExplainsNothing
                } else if is_only_noise(pick) {
                    RejectionReason::OnlyNoiseRemains
                } else {
                    RejectionReason::ExplainedBetter
                };
                (gain, Some(why))
            } else {
                (0.0, Some(RejectionReason::LinearlyDependent))
            };
            considered.push(CandidateOutcome {
                effect: candidate.effect.clone(),
                explained: alone[k],
                gain,
                rejection_reason: refused,
            });
        }
        rejection::name_unconfirmed(&mut considered);
        // Found effects first, then by the share that each explains alone.
        considered.sort_by(|a, b| {
            (b.rejection_reason.is_none().cmp(&a.rejection_reason.is_none())).then(b.explained.total_cmp(&a.explained))
        });
        considered
    }
}
