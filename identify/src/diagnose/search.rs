//! Search for the smallest set of effects that explains what the model cannot: forward over sets, with every member
//! tried against every other candidate, then backward, with simpler effects preferred.

use std::collections::HashSet;

use super::bench::{EffectSelector, ProjectedGram, ScoredEffectSet, SelectedEffect};
use super::criterion::criterion;
use super::evidence::SelectionEvidence;
use super::pool::FitScope;
use super::problem::ColumnSource;
use super::rejection::RejectedCandidate;
use super::thresholds::{
    OTHER_KIND_SHARE, OTHER_SET_LEAST_ADVANTAGE, OTHER_SET_LEAST_GAIN, REFINEMENT_FEWEST_NUMBERS,
    REFINEMENT_LEAST_GAIN, RIVAL_FINER_GAIN_FACTOR, RIVAL_MOST_GRID_RATIO, RIVAL_MOST_RATIO, SIMPLER_KIND_SHARE,
    SIMPLER_SET_MOST_LOSS, STEP_MOST_RISE,
};

/// Sets that are followed at the same time (width of the beam).
const BEAM: usize = 6;
/// Sets of one size that are tested on validation data before the search stops.
const TESTED: usize = 10;
/// Members by which a set may exceed the accepted one to be improved by exchanges.
const MOST_EXCHANGED: usize = 3;
/// Largest number of effects in a set.
const MOST: usize = 40;

/// A step of the search: the set of effects after it, with the evidence for the change.
#[derive(Clone, Debug)]
pub(crate) struct EffectSetChange {
    /// The effects after the step.
    pub(crate) picks: Vec<SelectedEffect>,
    /// `None` for the step that reduces the last set: it is justified by the lack of evidence for what is removed.
    pub(crate) evidence: Option<SelectionEvidence>,
}

/// A set that is supported by evidence.
struct SupportedEffectSet {
    /// Indices of the candidates that were tried. The fitted set may have others after its columns are computed again.
    candidates: Vec<usize>,
    /// The set, fitted.
    trial: ScoredEffectSet,
    /// Evidence for it, compared with the accepted set.
    evidence: SelectionEvidence,
}

/// Result of the search.
pub(crate) struct EffectSearchResult {
    /// Sets in the order in which they were accepted; the last one is the result.
    pub(crate) steps: Vec<EffectSetChange>,
    /// The best candidates that were rejected in the last step.
    pub(crate) rejected: Vec<RejectedCandidate>,
}

impl EffectSelector<'_> {
    /// Searches forward until no further set is supported, then exchanges and removes members.
    pub(crate) fn search_sets(&mut self) -> EffectSearchResult {
        // The accepted set grows from step to step; the beam contains other good sets that are extended as well.
        let mut accepted: Vec<SelectedEffect> = Vec::new();
        let mut steps = Vec::new();
        let mut beam: Vec<Vec<SelectedEffect>> = vec![Vec::new()];
        let mut refused;
        loop {
            // Columns of accepted and followed sets stay in the pool; all others are released and computed again for
            // this step.
            let of_steps = steps.iter().flat_map(|step: &EffectSetChange| &step.picks);
            let kept = of_steps.chain(beam.iter().flatten());
            self.current_choices.fill(None);
            self.drop_columns_since(self.permanent_columns, kept);
            self.weigh_channels(&accepted);
            self.update_choices(&accepted);
            let mut trials = self.grow_sets(&accepted, &beam);
            refused = Vec::new();
            let Some(step) = self.next_step(&accepted, &mut trials, &mut refused) else {
                break;
            };
            // The best possible sets of this step are extended in the next one, and so is the accepted set.
            beam = trials
                .iter()
                .filter(|other| other.is_possible())
                .take(BEAM)
                .map(|other| other.picks.clone())
                .collect();
            accepted.clone_from(&step.picks);
            // The accepted set is always extended, even if other sets have better scores.
            if !beam.contains(&accepted) {
                beam.insert(0, accepted.clone());
            }
            steps.push(step);
            // A limit for recordings that no set explains.
            if accepted.len() >= MOST {
                break;
            }
        }
        if self.provider.is_cancelled() {
            return EffectSearchResult {
                steps,
                rejected: refused,
            };
        }
        // Backward: exchange members for better or simpler ones, then remove those that are not needed.
        let exchanged = self.exchange(accepted.clone());
        let pruned = self.prune(exchanged);
        // The result must not be worse than the accepted set; otherwise keep its members, and at last the set itself.
        let pruned = if self.is_worse(&pruned, &accepted) {
            self.prune(accepted.clone())
        } else {
            pruned
        };
        let pruned = if self.is_worse(&pruned, &accepted) {
            accepted.clone()
        } else {
            pruned
        };
        // Parameters with random signs are set to zero in the result as well.
        let pruned = self.fit_set(pruned).picks;
        if pruned != accepted {
            steps.push(EffectSetChange {
                picks: pruned,
                evidence: None,
            });
        }
        EffectSearchResult {
            steps,
            rejected: refused,
        }
    }

    /// The next step from the accepted set. Constants and columns that depend on the fit are computed again; a set that
    /// does not keep its gain then is removed from the trials. `None` if no trial is supported.
    fn next_step(
        &mut self,
        accepted: &[SelectedEffect],
        trials: &mut Vec<ScoredEffectSet>,
        refused: &mut Vec<RejectedCandidate>,
    ) -> Option<EffectSetChange> {
        loop {
            // The first set that is supported by evidence.
            let next = self.next_supported_set(accepted, trials, refused)?;
            // Prefer simple effects, then refine constants and compare with close rivals.
            let (trial, evidence) = self
                .simplest_single_effect(accepted, &next.trial)
                .unwrap_or((next.trial, next.evidence));
            let (picks, _) = self.simplest_set(accepted, trial, evidence, trials);
            let picks = self.drop_unsupported_members(accepted, picks);
            let refined = self.refine_constants(picks);
            let polished = self.exchange_finely(refined);
            let refreshed = self.refresh_columns(polished);
            // The set has changed since it was tested, so the evidence is computed again.
            let settled = self.fit_set(refreshed);
            let evidence = self.evidence_between(accepted, &settled.picks);
            let channels = self.differing_channels(accepted, &settled.picks);
            if settled.is_possible()
                && evidence.is_sufficient()
                && !self.is_worse_overall(accepted, &settled.picks, &channels)
                && self.is_next_step(accepted, &settled, evidence.gain)
            {
                return Some(EffectSetChange {
                    picks: settled.picks,
                    evidence: Some(evidence),
                });
            }
            // The set has lost its support; try the next one without it.
            trials.retain(|trial| candidate_indices(&trial.picks) != next.candidates);
        }
    }

    /// Whether a set may follow the accepted one: the error of all drives together does not rise, a general kind that
    /// replaces simpler ones is much better, and faults of force signals are confirmed.
    fn is_next_step(&self, accepted: &[SelectedEffect], next: &ScoredEffectSet, gain: f64) -> bool {
        let before: usize = accepted.iter().map(|pick| self.freedoms(pick)).sum();
        let is_refinement = next.freedoms >= before + REFINEMENT_FEWEST_NUMBERS
            && next.picks.len() <= accepted.len()
            && !Self::replaced_effects(accepted, &next.picks).is_empty();
        // Both sets are judged by the same data.
        let by_folds = self.has_run_parameters(accepted) || self.has_run_parameters(&next.picks);
        let error = |picks: &[SelectedEffect]| self.relative_errors(picks, by_folds).1;
        (!is_refinement || gain >= REFINEMENT_LEAST_GAIN)
            && self.are_members_determined(&next.picks)
            && self.are_readings_confirmed(&next.picks)
            && error(&next.picks) <= (1.0 + STEP_MOST_RISE) * error(accepted)
    }

    /// The first trial that is supported by evidence. Sets that add one effect come first; `refused` receives the
    /// single effects that were rejected.
    fn next_supported_set(
        &mut self,
        accepted: &[SelectedEffect],
        trials: &[ScoredEffectSet],
        refused: &mut Vec<RejectedCandidate>,
    ) -> Option<SupportedEffectSet> {
        // Sets that only add an effect, and all others.
        let (grown, exchanged): (Vec<&ScoredEffectSet>, Vec<&ScoredEffectSet>) =
            trials.iter().partition(|t| self.is_addition(accepted, t));
        let mut additions = grown.into_iter();
        refused.clear();
        let chosen = self.first_supported_set(accepted, &mut additions, refused);
        // A set with other members must be much better than one that only grows.
        // Sets with other members are tested only if their criterion is far below.
        let bound = chosen
            .as_ref()
            .map_or(f64::INFINITY, |next| next.trial.score - OTHER_SET_LEAST_ADVANTAGE);
        let mut others = exchanged.into_iter().filter(|t| t.score < bound);
        let other = self.first_supported_set(accepted, &mut others, &mut Vec::new());
        // Compare the other set directly with the grown one.
        let other = other.filter(|other| {
            chosen.as_ref().is_none_or(|grown| {
                let evidence = self.evidence_between(&grown.trial.picks, &other.trial.picks);
                evidence.is_sufficient() && evidence.gain > OTHER_SET_LEAST_GAIN
            })
        });
        other.or(chosen)
    }

    /// Evidence for the set `after` compared with `before`, on the channels on which they differ.
    fn evidence_between(&self, before: &[SelectedEffect], after: &[SelectedEffect]) -> SelectionEvidence {
        self.evidence(before, after, &self.differing_channels(before, after))
    }

    /// Channels on which effects act that only one of two sets has.
    fn differing_channels(&self, before: &[SelectedEffect], after: &[SelectedEffect]) -> Vec<usize> {
        let mut differ = set_difference(after, before);
        differ.extend(set_difference(before, after));
        self.affected_channels(&differ)
    }

    /// Whether the set `before` is clearly better than `settled`, which is to replace it. What was accepted step by
    /// step need not be significant again in total: a large gain that justifies its parameters is enough.
    pub(crate) fn is_worse(&mut self, settled: &[SelectedEffect], before: &[SelectedEffect]) -> bool {
        self.weigh_channels(before);
        let channels: Vec<usize> = (0..self.weights.len()).collect();
        let evidence = self.evidence(settled, before, &channels);
        evidence.is_worth_keeping() || evidence.gives_back()
    }

    /// Whether a trial adds exactly one effect to the accepted set; the new effect may replace members that it
    /// contains.
    fn is_addition(&self, accepted: &[SelectedEffect], trial: &ScoredEffectSet) -> bool {
        let is_new = |pick: &&SelectedEffect| accepted.iter().all(|p| p.candidate != pick.candidate);
        let mut news = trial.picks.iter().filter(is_new);
        let (Some(new), None) = (news.next(), news.next()) else {
            return false;
        };
        let replaced = Self::replaced_effects(accepted, &trial.picks);
        replaced.iter().all(|p| self.is_in_span(p, new))
    }

    /// The first of some sets that is supported by evidence; rejected single effects are added to `refused`.
    fn first_supported_set(
        &mut self,
        accepted: &[SelectedEffect],
        trials: &mut dyn Iterator<Item = &ScoredEffectSet>,
        refused: &mut Vec<RejectedCandidate>,
    ) -> Option<SupportedEffectSet> {
        // Stop after a number of tests, since each needs fits on blocks.
        let mut tested = 0;
        for trial in trials {
            if tested == TESTED || self.provider.is_cancelled() {
                break;
            }
            // Columns that depend on the fit are computed for this set before it is tested.
            let tried = candidate_indices(&trial.picks);
            let trial = self.refit_dependent_columns(trial);
            // A set that is impossible once its columns have the right size does not count as a test.
            tested += usize::from(trial.is_possible());
            let news: Vec<SelectedEffect> = set_difference(&trial.picks, accepted);
            let evidence = self.evidence(accepted, &trial.picks, &self.affected_channels(&news));
            let is_confirmed =
                || self.are_members_determined(&trial.picks) && self.are_readings_confirmed(&trial.picks);
            if evidence.is_sufficient() && trial.is_possible() && is_confirmed() {
                return Some(SupportedEffectSet {
                    candidates: tried,
                    trial,
                    evidence,
                });
            }
            // Only single effects are reported as rejected; a pair has no reason of its own.
            if let [pick] = news.as_slice() {
                refused.push(RejectedCandidate::new(pick.clone(), evidence, &trial));
            }
        }
        None
    }

    /// Every set of the beam with every candidate; an effect that contains a member replaces it. `known` receives the
    /// candidates of each set.
    fn extend_beam(
        &self,
        beam: &[Vec<SelectedEffect>],
        table: &ProjectedGram,
        known: &mut HashSet<Vec<usize>>,
    ) -> Vec<ScoredEffectSet> {
        let mut trials = Vec::new();
        for set in beam {
            for pick in self.current_choices.iter().flatten() {
                if set.iter().any(|p| p.candidate == pick.candidate) {
                    continue;
                }
                let mut picks = set.clone();
                // An effect that contains a member replaces it.
                let mut pick = pick.clone();
                if pick.columns.len() > 1 {
                    let (within, rest): (Vec<SelectedEffect>, Vec<SelectedEffect>) =
                        picks.into_iter().partition(|p| self.is_in_span(p, &pick));
                    // Its rank relative to the accepted set does not count the members that it replaces.
                    let more: usize = within.iter().map(|p| p.rank).sum();
                    pick.rank = (pick.rank + more).min(pick.columns.len());
                    picks = rest;
                }
                picks.push(pick);
                // The same set may be reached from several sets of the beam.
                if known.insert(candidate_indices(&picks)) {
                    trials.push(self.fit_from_gram(table, picks));
                }
            }
        }
        trials
    }

    /// All sets with one more effect than those in the beam, and the best pairs. The best of them are improved by
    /// exchanges. Returns at most 40, best first.
    fn grow_sets(&mut self, accepted: &[SelectedEffect], beam: &[Vec<SelectedEffect>]) -> Vec<ScoredEffectSet> {
        // One table of inner products serves all trials; the number of independent equations comes from the accepted
        // set.
        let all: Vec<SelectedEffect> = beam.iter().flatten().cloned().collect();
        let table = self.projected_gram(&all);
        let (factors, _) = self.fit(accepted, FitScope::All);
        let rest = self.residual(accepted, &factors);
        let channels: Vec<usize> = (0..rest.len()).collect();
        // Number of independent equations for the information criterion.
        let worth = self.effective_equations(&rest, &channels);
        let mut known: HashSet<Vec<usize>> = HashSet::new();
        // Stage 1: every set of the beam with every candidate.
        let mut trials = self.extend_beam(beam, &table, &mut known);
        // Stage 2: pairs of candidates.
        let pairs = self.best_pairs(accepted, &table, worth);
        trials.extend(
            (pairs.into_iter())
                .filter(|pair| beam.iter().all(|set| !is_same_set(set, &pair.picks)))
                .collect::<Vec<ScoredEffectSet>>(),
        );
        // Stage 3: the same kinds at all drives, and pairs of kinds at one drive.
        for trial in self.alike_sets(accepted, &table, worth) {
            if known.insert(candidate_indices(&trial.picks)) {
                trials.push(trial);
            }
        }
        // The best set gives the best estimate of the noise: with its residual, samples are less correlated and worth
        // more.
        let best = trials.iter().filter(|trial| trial.is_possible());
        let worth = best
            .min_by(|a, b| a.squares.total_cmp(&b.squares))
            .map_or(worth, |best| {
                let (factors, _) = self.fit(&best.picks, FitScope::All);
                worth.max(self.effective_equations(&self.residual(&best.picks, &factors), &channels))
            });
        let problem = self.problem;
        // Sort by the criterion and keep the best sets.
        let score = |trial: &ScoredEffectSet| criterion(problem, trial, worth);
        trials.sort_by(|a, b| score(a).total_cmp(&score(b)));
        trials.dedup_by(|a, b| is_same_set(&a.picks, &b.picks));
        trials.truncate(40);
        // Constants chosen for other sets may be wrong for these.
        for k in 0..trials.len().min(BEAM) {
            let tuned = self.choose_constants(trials[k].picks.clone());
            if tuned != trials[k].picks {
                trials[k] = self.fit_set(tuned);
            }
        }
        trials.sort_by(|a, b| score(a).total_cmp(&score(b)));
        let all: Vec<SelectedEffect> = trials.iter().flat_map(|t| t.picks.clone()).collect();
        let table = self.projected_gram(&all);
        // Stage 4: exchange every member of the best sets for every other candidate, as long as a set gets better.
        for k in 0..trials.len().min(BEAM) {
            // The members of a large set are exchanged once it is accepted, and only for similar ones.
            if trials[k].picks.len() > accepted.len() + MOST_EXCHANGED {
                continue;
            }
            // Repeat as long as any exchange improves the set.
            let mut best = trials[k].clone();
            loop {
                let mut better: Option<ScoredEffectSet> = None;
                let mut bound = score(&best) - 1e-9;
                for i in 0..best.picks.len() {
                    let mut others = best.picks.clone();
                    others.remove(i);
                    // A lower bound of the criterion excludes most exchanges without a fit.
                    let beyond = self.extension_bound(&table, &others);
                    for pick in self.current_choices.iter().flatten() {
                        if best.picks.iter().any(|p| p.candidate == pick.candidate)
                            || self.least_criterion(&beyond, &[pick], worth) > bound
                        {
                            continue;
                        }
                        let mut picks = best.picks.clone();
                        let mut pick = pick.clone();
                        if pick.columns.len() > 1 && self.is_in_span(&picks[i], &pick) {
                            pick.rank = (pick.rank + picks[i].rank).min(pick.columns.len());
                        }
                        picks[i] = pick;
                        let trial = self.fit_from_gram(&table, picks);
                        let own = score(&trial);
                        // The best exchange of this round.
                        if own < bound {
                            bound = own;
                            better = Some(trial);
                        }
                    }
                }
                match better {
                    Some(trial) => best = trial,
                    None => break,
                }
            }
            if trials.iter().all(|known| !is_same_set(&known.picks, &best.picks)) {
                trials.push(best);
            }
        }
        for trial in &mut trials {
            trial.score = score(trial);
        }
        trials.sort_by(|a, b| a.score.total_cmp(&b.score));
        trials.truncate(40);
        trials
    }

    /// Exchanges members of a set for candidates that are nearly as good, each with finely searched constants: on the
    /// grids, the wrong candidate may have been nearer to its best value.
    fn exchange_finely(&mut self, mut picks: Vec<SelectedEffect>) -> Vec<SelectedEffect> {
        // Whether a candidate has constants that are searched.
        let is_searched = |bench: &Self, pick: &SelectedEffect| bench.candidate(pick).searched_constants > 0;
        let mut table = self.projected_gram(&picks);
        for i in 0..picks.len() {
            let mut others = picks.clone();
            // Compare rivals in the presence of all other members.
            let own = others.remove(i);
            let now = self.fit_from_gram(&table, picks.clone());
            // The constants of the other members were chosen with this member, which may put similar effects at a
            // disadvantage.
            let others_are_searched = others.iter().any(|other| is_searched(self, other));
            let is_kin = |bench: &Self, rival: &SelectedEffect| {
                let [one, two] = [rival, &own].map(|pick| &bench.candidate(pick).effect);
                others_are_searched && (one.kind == two.kind || one.at.iter().any(|place| two.at.contains(place)))
            };
            // Rivals with no more estimated numbers, if one of both has searched constants or if they are similar
            // effects.
            let rivals: Vec<SelectedEffect> = self
                .current_choices
                .iter()
                .flatten()
                .filter(|rival| {
                    let is_new = picks.iter().all(|p| p.candidate != rival.candidate);
                    let is_tuned = [*rival, &own].iter().any(|pick| is_searched(self, pick));
                    is_new && (is_tuned || is_kin(self, rival))
                })
                .filter(|rival| self.freedoms(rival) <= self.freedoms(&own))
                .cloned()
                .collect();
            // Squared residual without the member: the reference for what a rival explains.
            let without = self.fit_set(others.clone()).squares;
            let mut best = now;
            for rival in rivals {
                let mut set = others.clone();
                set.insert(i, rival);
                // A rival with a searched constant is compared at its own best constant.
                let tuned = if is_searched(self, &set[i]) || is_kin(self, &set[i]) {
                    self.choose_constants(set)
                } else if self.fit_from_gram(&table, set.clone()).squares > RIVAL_MOST_RATIO * best.squares {
                    continue;
                } else {
                    set
                };
                // Another kind must be closer on the grid than another place of the same kind.
                let kind = |pick: &SelectedEffect| self.candidate(pick).effect.kind.clone();
                let squares = self.fit_set(tuned.clone()).squares;
                // Only rivals that are close on the grid are worth a fine search.
                let is_close = if kind(&tuned[i]) == kind(&own) {
                    squares <= RIVAL_MOST_GRID_RATIO * best.squares
                } else {
                    squares <= RIVAL_MOST_RATIO * best.squares
                        && RIVAL_FINER_GAIN_FACTOR * (without - squares) >= without - best.squares
                };
                if !is_close {
                    continue;
                }
                let tuned = self.refine_around_member(tuned, i);
                let trial = self.fit_set(tuned);
                // Compare the squared residuals with finely searched constants.
                if trial.is_possible() && trial.squares < best.squares {
                    best = trial;
                }
            }
            if best.picks != picks {
                picks = best.picks;
                table = self.projected_gram(&picks);
            }
        }
        picks
    }

    /// If several simple effects with no more estimated numbers than one large effect explain more, returns the set
    /// with the first of them and its evidence.
    fn simplest_single_effect(
        &self,
        accepted: &[SelectedEffect],
        best: &ScoredEffectSet,
    ) -> Option<(ScoredEffectSet, SelectionEvidence)> {
        // Estimated numbers that the large effect adds: the budget for simple ones.
        let before: usize = accepted.iter().map(|p| self.freedoms(p)).sum();
        let budget = best.freedoms.checked_sub(before)?;
        // Kinds at all drives are simple effects already.
        let news = best.picks.len().saturating_sub(accepted.len());
        if budget < 2 || news > 2 {
            return None;
        }
        let mut all = accepted.to_vec();
        all.extend(best.picks.iter().cloned());
        let table = self.projected_gram(&all);
        // Simple effects have one estimated number and are no sensor faults or wrong constants.
        let simple: Vec<&SelectedEffect> = self
            .current_choices
            .iter()
            .flatten()
            .filter(|p| {
                self.freedoms(p) == 1
                    && !matches!(
                        self.candidate(p).source,
                        ColumnSource::ReadingFault(_) | ColumnSource::Constant(_)
                    )
            })
            .collect();
        // Add the best simple effect, one by one, as long as the set has no more estimated numbers than the large one.
        let mut set = accepted.to_vec();
        let mut first = None;
        for _ in 0..budget {
            let trials = simple
                .iter()
                .filter(|pick| set.iter().all(|p| p.candidate != pick.candidate))
                .map(|pick| {
                    let mut picks = set.clone();
                    picks.push((*pick).clone());
                    self.fit_from_gram(&table, picks)
                })
                .filter(ScoredEffectSet::is_possible);
            let next = trials.min_by(|a, b| a.squares.total_cmp(&b.squares))?;
            set.clone_from(&next.picks);
            first.get_or_insert_with(|| next.clone());
            // The simple effects together explain more; accept the first one, if it is supported.
            if next.squares < best.squares {
                let first = first?;
                let news = set_difference(&first.picks, accepted);
                let evidence = self.evidence(accepted, &first.picks, &self.affected_channels(&news));
                return evidence.is_sufficient().then_some((first, evidence));
            }
        }
        None
    }

    /// Of the sets that the blocks cannot distinguish from the best one, the set with the fewest estimated numbers; of
    /// several the first, since kinds come in the order of the library.
    fn simplest_set(
        &self,
        accepted: &[SelectedEffect],
        best: ScoredEffectSet,
        evidence: SelectionEvidence,
        trials: &[ScoredEffectSet],
    ) -> (Vec<SelectedEffect>, SelectionEvidence) {
        let mut chosen = (best, evidence);
        // A kind that contains a simpler one, such as friction that depends on the direction, comes after it. A
        // refinement of a member comes after other simple kinds.
        // Whether the best set replaces a member by a more general effect.
        let refines = !Self::replaced_effects(accepted, &chosen.0.picks).is_empty();
        let beside = self.conditioning_set(accepted);
        let nested = trials.iter().filter(|trial| {
            let news = set_difference(&trial.picks, accepted);
            let bests = set_difference(&chosen.0.picks, accepted);
            // Both sets must differ from the accepted one by exactly one effect.
            let [simple] = news.as_slice() else {
                return false;
            };
            let [own] = bests.as_slice() else {
                return false;
            };
            trial.is_possible()
                && Self::replaced_effects(accepted, &trial.picks).is_empty()
                && simple.rank < own.rank
                && self.candidate(simple).searched_constants <= self.candidate(own).searched_constants
                && (refines || self.is_in_conditional_span(simple, own, &beside))
        });
        // Simpler kinds that reach most of the gain of the best one.
        let mut simpler: Vec<(ScoredEffectSet, SelectionEvidence)> = Vec::new();
        for trial in nested {
            let news = set_difference(&trial.picks, accepted);
            let own = self.evidence(accepted, &trial.picks, &self.affected_channels(&news));
            let kind = &self.candidate(&news[0]).effect.kind;
            let is_refined = set_difference(&chosen.0.picks, accepted)
                .iter()
                .any(|best| self.candidate(best).refines.as_ref() == Some(kind));
            // Share of the gain that the simpler kind must reach.
            let most_of = if refines || is_refined {
                OTHER_KIND_SHARE
            } else {
                SIMPLER_KIND_SHARE
            };
            // The simpler kind must be supported and reach most of the gain.
            if own.is_sufficient() && own.gain > most_of * chosen.1.gain {
                simpler.push((trial.clone(), own));
            }
        }
        simpler.sort_by(|a, b| b.1.gain.total_cmp(&a.1.gain));
        if let Some(simple) = simpler.into_iter().next() {
            chosen = simple;
        }
        // Other sets with fewer estimated numbers whose squared error is not significantly larger.
        for trial in trials.iter().take(40) {
            if trial.freedoms >= chosen.0.freedoms || !trial.is_possible() {
                continue;
            }
            let news = set_difference(&trial.picks, accepted);
            let channels = self.affected_channels(&news);
            // Twice the logarithm of the likelihood ratio must be small, for the sum of all squares and for the variances
            // of the channels: an effect at one drive does not replace an effect at another.
            let ratio = trial.squares / chosen.0.squares.max(f64::MIN_POSITIVE);
            if chosen.1.effective_samples * ratio.ln() > SIMPLER_SET_MOST_LOSS
                || self.likelihood_loss(&chosen.0.picks, &trial.picks) > SIMPLER_SET_MOST_LOSS
            {
                continue;
            }
            let own = self.evidence(accepted, &trial.picks, &channels);
            if own.is_sufficient() {
                chosen = (trial.clone(), own);
            }
        }
        (chosen.0.picks, chosen.1)
    }

    /// Twice the logarithm of the likelihood ratio of two sets, each channel with the variance that the set leaves there;
    /// positive if `better` is more likely than `other`.
    fn likelihood_loss(&self, better: &[SelectedEffect], other: &[SelectedEffect]) -> f64 {
        let [better, other] = [better, other].map(|picks| {
            let (factors, _) = self.fit(picks, FitScope::All);
            self.residual(picks, &factors)
        });
        let variance = |rest: &[Vec<f64>], d: usize| {
            let noise = self.problem.noise[d].powi(2).max(f64::MIN_POSITIVE);
            self.pool.mean_square(d, &rest[d]).max(noise)
        };
        let losses = (0..better.len()).map(|d| {
            let ratio = variance(&other, d) / variance(&better, d);
            self.effective_equations(&better, &[d]) * ratio.ln()
        });
        losses.sum()
    }

    /// Members of the accepted set that are not in `picks`.
    fn replaced_effects(accepted: &[SelectedEffect], picks: &[SelectedEffect]) -> Vec<SelectedEffect> {
        let gone = |pick: &&SelectedEffect| picks.iter().all(|p| p.candidate != pick.candidate);
        accepted.iter().filter(gone).cloned().collect()
    }
}

/// Members of a set whose candidate is not in another; the complete set if there are none.
pub(crate) fn set_difference(set: &[SelectedEffect], other: &[SelectedEffect]) -> Vec<SelectedEffect> {
    let is_new = |pick: &&SelectedEffect| other.iter().all(|p| p.candidate != pick.candidate);
    let new: Vec<SelectedEffect> = set.iter().filter(is_new).cloned().collect();
    if new.is_empty() { set.to_vec() } else { new }
}

/// Indices of the candidates of a set, sorted.
fn candidate_indices(picks: &[SelectedEffect]) -> Vec<usize> {
    let mut members: Vec<usize> = picks.iter().map(|pick| pick.candidate).collect();
    members.sort_unstable();
    members
}

/// Whether two sets have the same candidates.
fn is_same_set(a: &[SelectedEffect], b: &[SelectedEffect]) -> bool {
    a.len() == b.len() && (a.iter()).all(|p| b.iter().any(|q| q.candidate == p.candidate))
}
