//! The search for the smallest set of effects that explains what the model cannot say: forward over sets, with every
//! member tried against every other candidate, back again, and simpler ones preferred.

use std::collections::HashSet;

use super::bench::{EffectSelector, ProjectedGram, ScoredEffectSet, SelectedEffect};
use super::evidence::SelectionEvidence;
use super::pool::FitScope;
use super::problem::{ColumnSource, DiagnosisProblem};

/// Sets that are followed at once.
const BEAM: usize = 6;
/// Sets of a size that are put to the test before the search gives up.
const TESTED: usize = 10;
/// A rival whose squares are within this factor is tried with finer constants.
const CLOSE: f64 = 1.5;
/// The same for one whose constant has been looked for on a grid only.
const CLOSE_ON_A_GRID: f64 = 20.0;
/// A rival is tried with finer constants if so many times what it explains with those of a grid would be enough.
const FINER_EXPLAINS: f64 = 2.0;
/// A simpler kind that brings this share of what one that holds it brings comes first.
const SIMPLER_KIND_SHARE: f64 = 0.97;
/// Another simple kind that brings this share of what a refinement of a member brings comes first.
const OTHER_KIND_SHARE: f64 = 0.7;
/// By how much (in the logarithm of the likelihood, twice) another set must be better than one that only grows.
const MUCH_BETTER: f64 = 20.0;
/// Which share of the squared error on its channels it must take off beside that.
const LARGE_CHANGE: f64 = 0.1;
/// Candidates of which all pairs are tried whole, those that explain most beside one other.
const PAIRED: usize = 140;
/// Pairs that go on.
const BEST_PAIRS: usize = 12;
/// Most effects that are looked for.
const MOST: usize = 40;

/// A step of the ladder: the set of effects after it, with what spoke for the change.
#[derive(Clone, Debug)]
pub(crate) struct EffectSetChange {
    pub(crate) picks: Vec<SelectedEffect>,
    /// `None` where the last set is made smaller, for which the lack of evidence speaks.
    pub(crate) evidence: Option<SelectionEvidence>,
}

/// A set that evidence speaks for.
struct SupportedEffectSet {
    /// The candidates that were tried; once their columns are settled they may be others.
    candidates: Vec<usize>,
    trial: ScoredEffectSet,
    evidence: SelectionEvidence,
}

/// Why the best candidates of a step were refused.
#[derive(Clone, Debug)]
pub(crate) struct RejectedCandidate {
    pub(crate) pick: SelectedEffect,
    pub(crate) evidence: SelectionEvidence,
    pub(crate) wrong_sign: bool,
    pub(crate) cancels: bool,
}

/// What the search found.
pub(crate) struct EffectSearchResult {
    /// Sets, one change after the other; the last is the answer.
    pub(crate) steps: Vec<EffectSetChange>,
    /// What was best of the rest, and why it was refused.
    pub(crate) rejected: Vec<RejectedCandidate>,
}

impl EffectSelector<'_> {
    /// Searches forward until nothing more is supported.
    pub(crate) fn search_sets(&mut self) -> EffectSearchResult {
        let mut accepted: Vec<SelectedEffect> = Vec::new();
        let mut steps = Vec::new();
        let mut beam: Vec<Vec<SelectedEffect>> = vec![Vec::new()];
        let mut refused;
        loop {
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
            beam = trials
                .iter()
                .filter(|other| other.is_possible())
                .take(BEAM)
                .map(|other| other.picks.clone())
                .collect();
            accepted.clone_from(&step.picks);
            if !beam.contains(&accepted) {
                beam.insert(0, accepted.clone());
            }
            steps.push(step);
            if accepted.len() >= MOST {
                break;
            }
        }
        let exchanged = self.exchange(accepted.clone());
        let pruned = self.prune(exchanged);
        // Smaller and simpler, but not worse: else nothing is exchanged.
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

    /// The next step from what is accepted, with all constants and columns that depend on the fit made anew. What does not keep
    /// then what it promised leaves the trials.
    fn next_step(
        &mut self,
        accepted: &[SelectedEffect],
        trials: &mut Vec<ScoredEffectSet>,
        refused: &mut Vec<RejectedCandidate>,
    ) -> Option<EffectSetChange> {
        loop {
            let next = self.next_supported_set(accepted, trials, refused)?;
            let (trial, evidence) = self
                .simplest_single_effect(accepted, &next.trial)
                .unwrap_or((next.trial, next.evidence));
            let (picks, _) = self.simplest_set(accepted, trial, evidence, trials);
            let refined = self.refine_constants(picks);
            let polished = self.exchange_finely(refined);
            let refreshed = self.refresh_columns(polished);
            let settled = self.fit_set(refreshed);
            let evidence = self.evidence_between(accepted, &settled.picks);
            let channels = self.differing_channels(accepted, &settled.picks);
            if settled.is_possible()
                && evidence.is_sufficient()
                && !self.is_worse_overall(accepted, &settled.picks, &channels)
            {
                return Some(EffectSetChange {
                    picks: settled.picks,
                    evidence: Some(evidence),
                });
            }
            trials.retain(|trial| candidate_indices(&trial.picks) != next.candidates);
        }
    }

    /// The first of the trials that evidence speaks for.
    fn next_supported_set(
        &mut self,
        accepted: &[SelectedEffect],
        trials: &[ScoredEffectSet],
        refused: &mut Vec<RejectedCandidate>,
    ) -> Option<SupportedEffectSet> {
        let (grown, exchanged): (Vec<&ScoredEffectSet>, Vec<&ScoredEffectSet>) =
            trials.iter().partition(|t| self.is_addition(accepted, t));
        let mut additions = grown.into_iter();
        refused.clear();
        let chosen = self.first_supported_set(accepted, &mut additions, refused);
        // Another set altogether must be much better than one that only grows.
        let bound = chosen
            .as_ref()
            .map_or(f64::INFINITY, |next| next.trial.score - MUCH_BETTER);
        let mut others = exchanged.into_iter().filter(|t| t.score < bound);
        let other = self.first_supported_set(accepted, &mut others, &mut Vec::new());
        let other = other.filter(|other| {
            chosen.as_ref().is_none_or(|grown| {
                let evidence = self.evidence_between(&grown.trial.picks, &other.trial.picks);
                evidence.is_sufficient() && evidence.gain > LARGE_CHANGE
            })
        });
        other.or(chosen)
    }

    /// Evidence for one set beside another, on the channels on which they differ.
    fn evidence_between(
        &self,
        before: &[SelectedEffect],
        after: &[SelectedEffect],
    ) -> SelectionEvidence {
        self.evidence(before, after, &self.differing_channels(before, after))
    }

    /// Channels on which two sets differ.
    fn differing_channels(
        &self,
        before: &[SelectedEffect],
        after: &[SelectedEffect],
    ) -> Vec<usize> {
        let mut differ = set_difference(after, before);
        differ.extend(set_difference(before, after));
        self.affected_channels(&differ)
    }

    /// Whether evidence speaks for one set beside another that is to take its place. What was found step by step need not prove
    /// itself again as a whole: a large loss that its parameters are worth is enough.
    pub(crate) fn is_worse(
        &mut self,
        settled: &[SelectedEffect],
        before: &[SelectedEffect],
    ) -> bool {
        self.weigh_channels(before);
        let channels: Vec<usize> = (0..self.weights.len()).collect();
        self.evidence(settled, before, &channels).is_worth_keeping()
    }

    /// Whether a set is another one and a further effect, which may take the place of what it holds.
    fn is_addition(&self, accepted: &[SelectedEffect], trial: &ScoredEffectSet) -> bool {
        let is_new =
            |pick: &&SelectedEffect| accepted.iter().all(|p| p.candidate != pick.candidate);
        let mut news = trial.picks.iter().filter(is_new);
        let (Some(new), None) = (news.next(), news.next()) else {
            return false;
        };
        let replaced = Self::replaced_effects(accepted, &trial.picks);
        replaced.iter().all(|p| self.is_in_span(p, new))
    }

    /// The first of some sets that evidence speaks for; why single effects were refused goes into a list.
    fn first_supported_set(
        &mut self,
        accepted: &[SelectedEffect],
        trials: &mut dyn Iterator<Item = &ScoredEffectSet>,
        refused: &mut Vec<RejectedCandidate>,
    ) -> Option<SupportedEffectSet> {
        let mut tested = 0;
        for trial in trials {
            if tested == TESTED {
                break;
            }
            let tried = candidate_indices(&trial.picks);
            let trial = self.refit_dependent_columns(trial);
            // What turns out impossible once its columns have its own size was no test.
            tested += usize::from(trial.is_possible());
            let news: Vec<SelectedEffect> = set_difference(&trial.picks, accepted);
            let evidence = self.evidence(accepted, &trial.picks, &self.affected_channels(&news));
            if evidence.is_sufficient() && trial.is_possible() {
                return Some(SupportedEffectSet {
                    candidates: tried,
                    trial,
                    evidence,
                });
            }
            if let [pick] = news.as_slice() {
                refused.push(RejectedCandidate {
                    pick: pick.clone(),
                    evidence,
                    wrong_sign: !trial.wrong_sign.is_empty(),
                    cancels: !trial.cancelling.is_empty(),
                });
            }
        }
        None
    }

    /// All sets that one more effect makes of those in the beam, the best of them improved by exchanges; best first.
    fn grow_sets(
        &mut self,
        accepted: &[SelectedEffect],
        beam: &[Vec<SelectedEffect>],
    ) -> Vec<ScoredEffectSet> {
        let all: Vec<SelectedEffect> = beam.iter().flatten().cloned().collect();
        let table = self.projected_gram(&all);
        let (factors, _) = self.fit(accepted, FitScope::All);
        let rest = self.residual(accepted, &factors);
        let channels: Vec<usize> = (0..rest.len()).collect();
        let worth = self.effective_equations(&rest, &channels);
        let mut trials: Vec<ScoredEffectSet> = Vec::new();
        let mut known: HashSet<Vec<usize>> = HashSet::new();
        for set in beam {
            for pick in self.current_choices.iter().flatten() {
                if set.iter().any(|p| p.candidate == pick.candidate) {
                    continue;
                }
                let mut picks = set.clone();
                // What holds more than a member takes its place.
                let mut pick = pick.clone();
                if pick.columns.len() > 1 {
                    let (within, rest): (Vec<SelectedEffect>, Vec<SelectedEffect>) =
                        picks.into_iter().partition(|p| self.is_in_span(p, &pick));
                    // Its rank beside the accepted set does not count what it replaces.
                    let more: usize = within.iter().map(|p| p.rank).sum();
                    pick.rank = (pick.rank + more).min(pick.columns.len());
                    picks = rest;
                }
                picks.push(pick);
                if known.insert(candidate_indices(&picks)) {
                    trials.push(self.fit_from_gram(&table, picks));
                }
            }
        }
        let pairs = self.best_pairs(accepted, &table, worth);
        trials.extend(
            (pairs.into_iter())
                .filter(|pair| beam.iter().all(|set| !is_same_set(set, &pair.picks)))
                .collect::<Vec<ScoredEffectSet>>(),
        );
        // The best set says what is noise: beside what it explains, neighbours resemble each other less.
        let best = trials.iter().filter(|trial| trial.is_possible());
        let worth = best
            .min_by(|a, b| a.squares.total_cmp(&b.squares))
            .map_or(worth, |best| {
                let (factors, _) = self.fit(&best.picks, FitScope::All);
                worth
                    .max(self.effective_equations(&self.residual(&best.picks, &factors), &channels))
            });
        let problem = self.problem;
        let score = |trial: &ScoredEffectSet| criterion(problem, trial, worth);
        trials.sort_by(|a, b| score(a).total_cmp(&score(b)));
        trials.dedup_by(|a, b| is_same_set(&a.picks, &b.picks));
        trials.truncate(40);
        // Constants that suited other sets may suit these less.
        for k in 0..trials.len().min(BEAM) {
            let tuned = self.choose_constants(trials[k].picks.clone());
            if tuned != trials[k].picks {
                trials[k] = self.fit_set(tuned);
            }
        }
        trials.sort_by(|a, b| score(a).total_cmp(&score(b)));
        let all: Vec<SelectedEffect> = trials.iter().flat_map(|t| t.picks.clone()).collect();
        let table = self.projected_gram(&all);
        // Every member of the best sets against every other candidate.
        for k in 0..trials.len().min(BEAM) {
            let mut best = trials[k].clone();
            loop {
                let mut better: Option<ScoredEffectSet> = None;
                let mut bound = score(&best) - 1e-9;
                for i in 0..best.picks.len() {
                    let mut others = best.picks.clone();
                    others.remove(i);
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
            if trials
                .iter()
                .all(|known| !is_same_set(&known.picks, &best.picks))
            {
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

    /// The best of all pairs of further effects beside the accepted ones, and in place of any of these: a pair may explain all
    /// where neither does much alone, and where what is shared by two places comes first.
    fn best_pairs(
        &self,
        accepted: &[SelectedEffect],
        table: &ProjectedGram,
        worth: f64,
    ) -> Vec<ScoredEffectSet> {
        let is_new =
            |pick: &&SelectedEffect| accepted.iter().all(|p| p.candidate != pick.candidate);
        let alone = |pick: &SelectedEffect| {
            let mut set = accepted.to_vec();
            set.push(pick.clone());
            self.fit_from_gram(table, set).squares
        };
        let simple = self.current_choices.iter().flatten().filter(is_new);
        let simple = simple.filter(|pick| self.freedoms(pick) <= 2);
        let mut further: Vec<(f64, &SelectedEffect)> =
            simple.map(|pick| (alone(pick), pick)).collect();
        further.sort_by(|a, b| a.0.total_cmp(&b.0));
        further.truncate(PAIRED);
        let mut kept: Vec<Vec<SelectedEffect>> = vec![accepted.to_vec()];
        kept.extend((0..accepted.len()).map(|i| {
            let mut fewer = accepted.to_vec();
            fewer.remove(i);
            fewer
        }));
        let mut best: Vec<(f64, ScoredEffectSet)> = Vec::new();
        for set in kept {
            let beyond = self.extension_bound(table, &set);
            for (i, (_, one)) in further.iter().enumerate() {
                for (_, two) in &further[i + 1..] {
                    if best.len() == BEST_PAIRS {
                        let least = self.least_criterion(&beyond, &[one, two], worth);
                        if best.last().is_some_and(|(last, _)| least > *last) {
                            continue;
                        }
                    }
                    let mut picks = set.clone();
                    picks.extend([(*one).clone(), (*two).clone()]);
                    let trial = self.fit_from_gram(table, picks);
                    let own = criterion(self.problem, &trial, worth);
                    if best.len() < BEST_PAIRS || best.last().is_some_and(|(last, _)| own < *last) {
                        let at = best.partition_point(|(other, _)| *other < own);
                        best.insert(at, (own, trial));
                        best.truncate(BEST_PAIRS);
                    }
                }
            }
        }
        best.into_iter().map(|(_, trial)| trial).collect()
    }

    /// Tries members of a set against candidates that come close, each with constants that are searched finely: on their
    /// grids the wrong one may have been nearer to its best value.
    fn exchange_finely(&mut self, mut picks: Vec<SelectedEffect>) -> Vec<SelectedEffect> {
        let is_searched =
            |bench: &Self, pick: &SelectedEffect| bench.candidate(pick).searched_constants > 0;
        let mut table = self.projected_gram(&picks);
        for i in 0..picks.len() {
            let mut others = picks.clone();
            let own = others.remove(i);
            let now = self.fit_from_gram(&table, picks.clone());
            // The constants of others may suit this member and no kin of it.
            let others_are_searched = others.iter().any(|other| is_searched(self, other));
            let is_kin = |bench: &Self, rival: &SelectedEffect| {
                let [one, two] = [rival, &own].map(|pick| &bench.candidate(pick).effect);
                others_are_searched
                    && (one.kind == two.kind || one.at.iter().any(|place| two.at.contains(place)))
            };
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
            let without = self.fit_set(others.clone()).squares;
            let mut best = now;
            for rival in rivals {
                let mut set = others.clone();
                set.insert(i, rival);
                // On another set's constants a rival is judged by its own.
                let tuned = if is_searched(self, &set[i]) || is_kin(self, &set[i]) {
                    self.choose_constants(set)
                } else if self.fit_from_gram(&table, set.clone()).squares > CLOSE * best.squares {
                    continue;
                } else {
                    set
                };
                let kind = |pick: &SelectedEffect| self.candidate(pick).effect.kind.clone();
                let squares = self.fit_set(tuned.clone()).squares;
                let is_close = if kind(&tuned[i]) == kind(&own) {
                    squares <= CLOSE_ON_A_GRID * best.squares
                } else {
                    squares <= CLOSE * best.squares
                        && FINER_EXPLAINS * (without - squares) >= without - best.squares
                };
                if !is_close {
                    continue;
                }
                let tuned = self.refine_around_member(tuned, i);
                let trial = self.fit_set(tuned);
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

    /// Where several simple effects with no more freedoms than a large one explain more, the first of them.
    fn simplest_single_effect(
        &self,
        accepted: &[SelectedEffect],
        best: &ScoredEffectSet,
    ) -> Option<(ScoredEffectSet, SelectionEvidence)> {
        let before: usize = accepted.iter().map(|p| self.freedoms(p)).sum();
        let budget = best.freedoms.checked_sub(before)?;
        if budget < 2 {
            return None;
        }
        let mut all = accepted.to_vec();
        all.extend(best.picks.iter().cloned());
        let table = self.projected_gram(&all);
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
            if next.squares < best.squares {
                let first = first?;
                let news = set_difference(&first.picks, accepted);
                let evidence =
                    self.evidence(accepted, &first.picks, &self.affected_channels(&news));
                return evidence.is_sufficient().then_some((first, evidence));
            }
        }
        None
    }

    /// Of the sets that are as good as the best as far as the blocks can tell, the one with the fewest freedoms; of several
    /// the first, for kinds come in the order of the library.
    fn simplest_set(
        &self,
        accepted: &[SelectedEffect],
        best: ScoredEffectSet,
        evidence: SelectionEvidence,
        trials: &[ScoredEffectSet],
    ) -> (Vec<SelectedEffect>, SelectionEvidence) {
        let mut chosen = (best, evidence);
        // A kind that holds a simpler one, such as friction that differs by direction, comes after it.
        // So does what refines a member, after other simple kinds.
        let refines = !Self::replaced_effects(accepted, &chosen.0.picks).is_empty();
        let beside = self.conditioning_set(accepted);
        let nested = trials.iter().filter(|trial| {
            let news = set_difference(&trial.picks, accepted);
            let bests = set_difference(&chosen.0.picks, accepted);
            let [simple] = news.as_slice() else {
                return false;
            };
            let [own] = bests.as_slice() else {
                return false;
            };
            trial.is_possible()
                && Self::replaced_effects(accepted, &trial.picks).is_empty()
                && simple.rank < own.rank
                && self.candidate(simple).searched_constants
                    <= self.candidate(own).searched_constants
                && (refines || self.is_in_conditional_span(simple, own, &beside))
        });
        let mut simpler: Vec<(ScoredEffectSet, SelectionEvidence)> = Vec::new();
        for trial in nested {
            let news = set_difference(&trial.picks, accepted);
            let own = self.evidence(accepted, &trial.picks, &self.affected_channels(&news));
            let kind = &self.candidate(&news[0]).effect.kind;
            let is_refined = set_difference(&chosen.0.picks, accepted)
                .iter()
                .any(|best| self.candidate(best).refines.as_ref() == Some(kind));
            let most_of = if refines || is_refined {
                OTHER_KIND_SHARE
            } else {
                SIMPLER_KIND_SHARE
            };
            if own.is_sufficient() && own.gain > most_of * chosen.1.gain {
                simpler.push((trial.clone(), own));
            }
        }
        simpler.sort_by(|a, b| b.1.gain.total_cmp(&a.1.gain));
        if let Some(simple) = simpler.into_iter().next() {
            chosen = simple;
        }
        for trial in trials.iter().take(40) {
            if trial.freedoms >= chosen.0.freedoms || !trial.is_possible() {
                continue;
            }
            let news = set_difference(&trial.picks, accepted);
            let channels = self.affected_channels(&news);
            let ratio = trial.squares / chosen.0.squares.max(f64::MIN_POSITIVE);
            if chosen.1.effective_samples * ratio.ln() > 2.0 {
                continue;
            }
            let own = self.evidence(accepted, &trial.picks, &channels);
            if own.is_sufficient() {
                chosen = (trial.clone(), own);
            }
        }
        (chosen.0.picks, chosen.1)
    }

    /// Members of a set that are no longer in another.
    fn replaced_effects(
        accepted: &[SelectedEffect],
        picks: &[SelectedEffect],
    ) -> Vec<SelectedEffect> {
        let gone = |pick: &&SelectedEffect| picks.iter().all(|p| p.candidate != pick.candidate);
        accepted.iter().filter(gone).cloned().collect()
    }
}

/// The information criterion of a set, with as many samples as the residual is worth; sets with impossible signs come last.
pub(crate) fn criterion(problem: &DiagnosisProblem, trial: &ScoredEffectSet, worth: f64) -> f64 {
    let wrong = if trial.is_possible() { 0.0 } else { 1e12 };
    worth * trial.squares.max(f64::MIN_POSITIVE).ln()
        + trial.freedoms as f64 * worth.ln().max(1.0)
        + overlap(problem, &trial.picks)
        + wrong
}

/// What another place costs, where nothing else decides between sets that say the same.
const PLACE: f64 = 0.01;

/// A little against sets in which one kind acts twice at a place, which say what others say more plainly; and against many
/// places.
fn overlap(problem: &DiagnosisProblem, picks: &[SelectedEffect]) -> f64 {
    let effect = |pick: &SelectedEffect| &problem.candidates[pick.candidate].effect;
    let twice = |(i, one): (usize, &SelectedEffect)| {
        let others = picks[i + 1..].iter().filter(|other| {
            effect(one).kind == effect(other).kind
                && effect(one)
                    .at
                    .iter()
                    .any(|place| effect(other).at.contains(place))
        });
        others.count() as f64
    };
    let places: usize = picks.iter().map(|pick| effect(pick).at.len()).sum();
    picks.iter().enumerate().map(twice).sum::<f64>() + PLACE * places as f64
}

/// Picks of a set whose candidate is not in another.
pub(crate) fn set_difference(
    set: &[SelectedEffect],
    other: &[SelectedEffect],
) -> Vec<SelectedEffect> {
    let is_new = |pick: &&SelectedEffect| other.iter().all(|p| p.candidate != pick.candidate);
    let new: Vec<SelectedEffect> = set.iter().filter(is_new).cloned().collect();
    if new.is_empty() { set.to_vec() } else { new }
}

/// The candidates of a set, in order.
fn candidate_indices(picks: &[SelectedEffect]) -> Vec<usize> {
    let mut members: Vec<usize> = picks.iter().map(|pick| pick.candidate).collect();
    members.sort_unstable();
    members
}

/// Whether two sets hold the same candidates.
fn is_same_set(a: &[SelectedEffect], b: &[SelectedEffect]) -> bool {
    a.len() == b.len() && (a.iter()).all(|p| b.iter().any(|q| q.candidate == p.candidate))
}
