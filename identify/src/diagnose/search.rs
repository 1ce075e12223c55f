//! The search for the smallest set of effects that explains what the model cannot say: forward over sets, with every
//! member tried against every other candidate, back again, and simpler ones preferred.

use std::collections::HashSet;

use super::bench::{Bench, Pick, Table, Trial};
use super::evidence::Evidence;
use super::pool::On;
use super::problem::{Problem, Source};

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
const NEARLY_ALL_OF: f64 = 0.97;
/// Another simple kind that brings this share of what a refinement of a member brings comes first.
const MOST_OF: f64 = 0.7;
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
pub(crate) struct Step {
    pub(crate) picks: Vec<Pick>,
    /// `None` where the last set is made smaller, for which the lack of evidence speaks.
    pub(crate) evidence: Option<Evidence>,
}

/// A set that evidence speaks for.
struct Next {
    /// The candidates that were tried; once their columns are settled they may be others.
    tried: Vec<usize>,
    trial: Trial,
    evidence: Evidence,
}

/// Why the best candidates of a step were refused.
#[derive(Clone, Debug)]
pub(crate) struct Refused {
    pub(crate) pick: Pick,
    pub(crate) evidence: Evidence,
    pub(crate) wrong_sign: bool,
    pub(crate) cancels: bool,
}

/// What the search found.
pub(crate) struct Found {
    /// Sets, one change after the other; the last is the answer.
    pub(crate) steps: Vec<Step>,
    /// What was best of the rest, and why it was refused.
    pub(crate) refused: Vec<Refused>,
}

impl Bench<'_> {
    /// Searches forward until nothing more is supported.
    pub(crate) fn search(&mut self) -> Found {
        let mut accepted: Vec<Pick> = Vec::new();
        let mut steps = Vec::new();
        let mut beam: Vec<Vec<Pick>> = vec![Vec::new()];
        let mut refused;
        loop {
            let of_steps = steps.iter().flat_map(|step: &Step| &step.picks);
            let kept = of_steps.chain(beam.iter().flatten());
            self.present.fill(None);
            self.forget_since(self.known, kept);
            self.weigh(&accepted);
            self.look(&accepted);
            let mut trials = self.grow(&accepted, &beam);
            refused = Vec::new();
            let Some(step) = self.step(&accepted, &mut trials, &mut refused) else {
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
        let pruned = self.trial(pruned).picks;
        if pruned != accepted {
            steps.push(Step {
                picks: pruned,
                evidence: None,
            });
        }
        Found { steps, refused }
    }

    /// The next step from what is accepted, with all constants and columns that depend on the fit made anew. What does not keep
    /// then what it promised leaves the trials.
    fn step(
        &mut self,
        accepted: &[Pick],
        trials: &mut Vec<Trial>,
        refused: &mut Vec<Refused>,
    ) -> Option<Step> {
        loop {
            let next = self.next(accepted, trials, refused)?;
            let (trial, evidence) = self
                .simple_first(accepted, &next.trial)
                .unwrap_or((next.trial, next.evidence));
            let (picks, _) = self.simplest(accepted, trial, evidence, trials);
            let refined = self.refine(picks);
            let polished = self.polish(refined);
            let refreshed = self.refresh(polished);
            let settled = self.trial(refreshed);
            let evidence = self.between(accepted, &settled.picks);
            let channels = self.changed_on(accepted, &settled.picks);
            if settled.is_possible()
                && evidence.holds()
                && !self.costs_more(accepted, &settled.picks, &channels)
            {
                return Some(Step {
                    picks: settled.picks,
                    evidence: Some(evidence),
                });
            }
            trials.retain(|trial| members(&trial.picks) != next.tried);
        }
    }

    /// The first of the trials that evidence speaks for.
    fn next(
        &mut self,
        accepted: &[Pick],
        trials: &[Trial],
        refused: &mut Vec<Refused>,
    ) -> Option<Next> {
        let (grown, exchanged): (Vec<&Trial>, Vec<&Trial>) =
            trials.iter().partition(|t| self.is_addition(accepted, t));
        let mut additions = grown.into_iter();
        refused.clear();
        let chosen = self.first_that_holds(accepted, &mut additions, refused);
        // Another set altogether must be much better than one that only grows.
        let bound = chosen
            .as_ref()
            .map_or(f64::INFINITY, |next| next.trial.score - MUCH_BETTER);
        let mut others = exchanged.into_iter().filter(|t| t.score < bound);
        let other = self.first_that_holds(accepted, &mut others, &mut Vec::new());
        let other = other.filter(|other| {
            chosen.as_ref().is_none_or(|grown| {
                let evidence = self.between(&grown.trial.picks, &other.trial.picks);
                evidence.holds() && evidence.gain > LARGE_CHANGE
            })
        });
        other.or(chosen)
    }

    /// Evidence for one set beside another, on the channels on which they differ.
    fn between(&self, before: &[Pick], after: &[Pick]) -> Evidence {
        self.evidence(before, after, &self.changed_on(before, after))
    }

    /// Channels on which two sets differ.
    fn changed_on(&self, before: &[Pick], after: &[Pick]) -> Vec<usize> {
        let mut differ = difference(after, before);
        differ.extend(difference(before, after));
        self.acted_on(&differ)
    }

    /// Whether evidence speaks for one set beside another that is to take its place. What was found step by step need not prove
    /// itself again as a whole: a large loss that its parameters are worth is enough.
    pub(crate) fn is_worse(&mut self, settled: &[Pick], before: &[Pick]) -> bool {
        self.weigh(before);
        let channels: Vec<usize> = (0..self.weights.len()).collect();
        self.evidence(settled, before, &channels).would_be_missed()
    }

    /// Whether a set is another one and a further effect, which may take the place of what it holds.
    fn is_addition(&self, accepted: &[Pick], trial: &Trial) -> bool {
        let is_new = |pick: &&Pick| accepted.iter().all(|p| p.candidate != pick.candidate);
        let mut news = trial.picks.iter().filter(is_new);
        let (Some(new), None) = (news.next(), news.next()) else {
            return false;
        };
        let replaced = Self::replaced(accepted, &trial.picks);
        replaced.iter().all(|p| self.is_within(p, new))
    }

    /// The first of some sets that evidence speaks for; why single effects were refused goes into a list.
    fn first_that_holds(
        &mut self,
        accepted: &[Pick],
        trials: &mut dyn Iterator<Item = &Trial>,
        refused: &mut Vec<Refused>,
    ) -> Option<Next> {
        let mut tested = 0;
        for trial in trials {
            if tested == TESTED {
                break;
            }
            let tried = members(&trial.picks);
            let trial = self.settled(trial);
            // What turns out impossible once its columns have its own size was no test.
            tested += usize::from(trial.is_possible());
            let news: Vec<Pick> = difference(&trial.picks, accepted);
            let evidence = self.evidence(accepted, &trial.picks, &self.acted_on(&news));
            if evidence.holds() && trial.is_possible() {
                return Some(Next {
                    tried,
                    trial,
                    evidence,
                });
            }
            if let [pick] = news.as_slice() {
                refused.push(Refused {
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
    fn grow(&mut self, accepted: &[Pick], beam: &[Vec<Pick>]) -> Vec<Trial> {
        let all: Vec<Pick> = beam.iter().flatten().cloned().collect();
        let table = self.table(&all);
        let (factors, _) = self.fit(accepted, On::All);
        let rest = self.rest(accepted, &factors);
        let channels: Vec<usize> = (0..rest.len()).collect();
        let worth = self.worth(&rest, &channels);
        let mut trials: Vec<Trial> = Vec::new();
        let mut known: HashSet<Vec<usize>> = HashSet::new();
        for set in beam {
            for pick in self.present.iter().flatten() {
                if set.iter().any(|p| p.candidate == pick.candidate) {
                    continue;
                }
                let mut picks = set.clone();
                // What holds more than a member takes its place.
                let mut pick = pick.clone();
                if pick.columns.len() > 1 {
                    let (within, rest): (Vec<Pick>, Vec<Pick>) =
                        picks.into_iter().partition(|p| self.is_within(p, &pick));
                    // Its rank beside the accepted set does not count what it replaces.
                    let more: usize = within.iter().map(|p| p.rank).sum();
                    pick.rank = (pick.rank + more).min(pick.columns.len());
                    picks = rest;
                }
                picks.push(pick);
                if known.insert(members(&picks)) {
                    trials.push(self.try_in(&table, picks));
                }
            }
        }
        let pairs = self.pairs(accepted, &table, worth);
        trials.extend(
            (pairs.into_iter())
                .filter(|pair| beam.iter().all(|set| !same(set, &pair.picks)))
                .collect::<Vec<Trial>>(),
        );
        // The best set says what is noise: beside what it explains, neighbours resemble each other less.
        let best = trials.iter().filter(|trial| trial.is_possible());
        let worth = best
            .min_by(|a, b| a.squares.total_cmp(&b.squares))
            .map_or(worth, |best| {
                let (factors, _) = self.fit(&best.picks, On::All);
                worth.max(self.worth(&self.rest(&best.picks, &factors), &channels))
            });
        let problem = self.problem;
        let score = |trial: &Trial| criterion(problem, trial, worth);
        trials.sort_by(|a, b| score(a).total_cmp(&score(b)));
        trials.dedup_by(|a, b| same(&a.picks, &b.picks));
        trials.truncate(40);
        // Constants that suited other sets may suit these less.
        for k in 0..trials.len().min(BEAM) {
            let tuned = self.retune(trials[k].picks.clone());
            if tuned != trials[k].picks {
                trials[k] = self.trial(tuned);
            }
        }
        trials.sort_by(|a, b| score(a).total_cmp(&score(b)));
        let all: Vec<Pick> = trials.iter().flat_map(|t| t.picks.clone()).collect();
        let table = self.table(&all);
        // Every member of the best sets against every other candidate.
        for k in 0..trials.len().min(BEAM) {
            let mut best = trials[k].clone();
            loop {
                let mut better: Option<Trial> = None;
                let mut bound = score(&best) - 1e-9;
                for i in 0..best.picks.len() {
                    let mut others = best.picks.clone();
                    others.remove(i);
                    let beyond = self.beyond(&table, &others);
                    for pick in self.present.iter().flatten() {
                        if best.picks.iter().any(|p| p.candidate == pick.candidate)
                            || self.least_criterion(&beyond, &[pick], worth) > bound
                        {
                            continue;
                        }
                        let mut picks = best.picks.clone();
                        let mut pick = pick.clone();
                        if pick.columns.len() > 1 && self.is_within(&picks[i], &pick) {
                            pick.rank = (pick.rank + picks[i].rank).min(pick.columns.len());
                        }
                        picks[i] = pick;
                        let trial = self.try_in(&table, picks);
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
            if trials.iter().all(|known| !same(&known.picks, &best.picks)) {
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
    fn pairs(&self, accepted: &[Pick], table: &Table, worth: f64) -> Vec<Trial> {
        let is_new = |pick: &&Pick| accepted.iter().all(|p| p.candidate != pick.candidate);
        let alone = |pick: &Pick| {
            let mut set = accepted.to_vec();
            set.push(pick.clone());
            self.try_in(table, set).squares
        };
        let simple = self.present.iter().flatten().filter(is_new);
        let simple = simple.filter(|pick| self.freedoms(pick) <= 2);
        let mut further: Vec<(f64, &Pick)> = simple.map(|pick| (alone(pick), pick)).collect();
        further.sort_by(|a, b| a.0.total_cmp(&b.0));
        further.truncate(PAIRED);
        let mut kept: Vec<Vec<Pick>> = vec![accepted.to_vec()];
        kept.extend((0..accepted.len()).map(|i| {
            let mut fewer = accepted.to_vec();
            fewer.remove(i);
            fewer
        }));
        let mut best: Vec<(f64, Trial)> = Vec::new();
        for set in kept {
            let beyond = self.beyond(table, &set);
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
                    let trial = self.try_in(table, picks);
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
    fn polish(&mut self, mut picks: Vec<Pick>) -> Vec<Pick> {
        let is_searched = |bench: &Self, pick: &Pick| bench.candidate(pick).searched > 0;
        let mut table = self.table(&picks);
        for i in 0..picks.len() {
            let mut others = picks.clone();
            let own = others.remove(i);
            let now = self.try_in(&table, picks.clone());
            // The constants of others may suit this member and no kin of it.
            let others_are_searched = others.iter().any(|other| is_searched(self, other));
            let is_kin = |bench: &Self, rival: &Pick| {
                let [one, two] = [rival, &own].map(|pick| &bench.candidate(pick).effect);
                others_are_searched
                    && (one.kind == two.kind || one.at.iter().any(|place| two.at.contains(place)))
            };
            let rivals: Vec<Pick> = self
                .present
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
            let without = self.trial(others.clone()).squares;
            let mut best = now;
            for rival in rivals {
                let mut set = others.clone();
                set.insert(i, rival);
                // On another set's constants a rival is judged by its own.
                let tuned = if is_searched(self, &set[i]) || is_kin(self, &set[i]) {
                    self.retune(set)
                } else if self.try_in(&table, set.clone()).squares > CLOSE * best.squares {
                    continue;
                } else {
                    set
                };
                let kind = |pick: &Pick| self.candidate(pick).effect.kind.clone();
                let squares = self.trial(tuned.clone()).squares;
                let is_close = if kind(&tuned[i]) == kind(&own) {
                    squares <= CLOSE_ON_A_GRID * best.squares
                } else {
                    squares <= CLOSE * best.squares
                        && FINER_EXPLAINS * (without - squares) >= without - best.squares
                };
                if !is_close {
                    continue;
                }
                let tuned = self.refine_around(tuned, i);
                let trial = self.trial(tuned);
                if trial.is_possible() && trial.squares < best.squares {
                    best = trial;
                }
            }
            if best.picks != picks {
                picks = best.picks;
                table = self.table(&picks);
            }
        }
        picks
    }

    /// Where several simple effects with no more freedoms than a large one explain more, the first of them.
    fn simple_first(&self, accepted: &[Pick], best: &Trial) -> Option<(Trial, Evidence)> {
        let before: usize = accepted.iter().map(|p| self.freedoms(p)).sum();
        let budget = best.freedoms.checked_sub(before)?;
        if budget < 2 {
            return None;
        }
        let mut all = accepted.to_vec();
        all.extend(best.picks.iter().cloned());
        let table = self.table(&all);
        let simple: Vec<&Pick> = self
            .present
            .iter()
            .flatten()
            .filter(|p| {
                self.freedoms(p) == 1
                    && !matches!(
                        self.candidate(p).source,
                        Source::Reading(_) | Source::Constant(_)
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
                    self.try_in(&table, picks)
                })
                .filter(Trial::is_possible);
            let next = trials.min_by(|a, b| a.squares.total_cmp(&b.squares))?;
            set.clone_from(&next.picks);
            first.get_or_insert_with(|| next.clone());
            if next.squares < best.squares {
                let first = first?;
                let news = difference(&first.picks, accepted);
                let evidence = self.evidence(accepted, &first.picks, &self.acted_on(&news));
                return evidence.holds().then_some((first, evidence));
            }
        }
        None
    }

    /// Of the sets that are as good as the best as far as the blocks can tell, the one with the fewest freedoms; of several
    /// the first, for kinds come in the order of the library.
    fn simplest(
        &self,
        accepted: &[Pick],
        best: Trial,
        evidence: Evidence,
        trials: &[Trial],
    ) -> (Vec<Pick>, Evidence) {
        let mut chosen = (best, evidence);
        // A kind that holds a simpler one, such as friction that differs by direction, comes after it.
        // So does what refines a member, after other simple kinds.
        let refines = !Self::replaced(accepted, &chosen.0.picks).is_empty();
        let beside = self.beside(accepted);
        let nested = trials.iter().filter(|trial| {
            let news = difference(&trial.picks, accepted);
            let bests = difference(&chosen.0.picks, accepted);
            let [simple] = news.as_slice() else {
                return false;
            };
            let [own] = bests.as_slice() else {
                return false;
            };
            trial.is_possible()
                && Self::replaced(accepted, &trial.picks).is_empty()
                && simple.rank < own.rank
                && self.candidate(simple).searched <= self.candidate(own).searched
                && (refines || self.is_within_beside(simple, own, &beside))
        });
        let mut simpler: Vec<(Trial, Evidence)> = Vec::new();
        for trial in nested {
            let news = difference(&trial.picks, accepted);
            let own = self.evidence(accepted, &trial.picks, &self.acted_on(&news));
            let kind = &self.candidate(&news[0]).effect.kind;
            let is_refined = difference(&chosen.0.picks, accepted)
                .iter()
                .any(|best| self.candidate(best).refines.as_ref() == Some(kind));
            let most_of = if refines || is_refined {
                MOST_OF
            } else {
                NEARLY_ALL_OF
            };
            if own.holds() && own.gain > most_of * chosen.1.gain {
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
            let news = difference(&trial.picks, accepted);
            let channels = self.acted_on(&news);
            let ratio = trial.squares / chosen.0.squares.max(f64::MIN_POSITIVE);
            if chosen.1.effective_samples * ratio.ln() > 2.0 {
                continue;
            }
            let own = self.evidence(accepted, &trial.picks, &channels);
            if own.holds() {
                chosen = (trial.clone(), own);
            }
        }
        (chosen.0.picks, chosen.1)
    }

    /// Members of a set that are no longer in another.
    fn replaced(accepted: &[Pick], picks: &[Pick]) -> Vec<Pick> {
        let gone = |pick: &&Pick| picks.iter().all(|p| p.candidate != pick.candidate);
        accepted.iter().filter(gone).cloned().collect()
    }
}

/// The information criterion of a set, with as many samples as the residual is worth; sets with impossible signs come last.
pub(crate) fn criterion(problem: &Problem, trial: &Trial, worth: f64) -> f64 {
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
fn overlap(problem: &Problem, picks: &[Pick]) -> f64 {
    let effect = |pick: &Pick| &problem.candidates[pick.candidate].effect;
    let twice = |(i, one): (usize, &Pick)| {
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
pub(crate) fn difference(set: &[Pick], other: &[Pick]) -> Vec<Pick> {
    let is_new = |pick: &&Pick| other.iter().all(|p| p.candidate != pick.candidate);
    let new: Vec<Pick> = set.iter().filter(is_new).cloned().collect();
    if new.is_empty() { set.to_vec() } else { new }
}

/// The candidates of a set, in order.
fn members(picks: &[Pick]) -> Vec<usize> {
    let mut members: Vec<usize> = picks.iter().map(|pick| pick.candidate).collect();
    members.sort_unstable();
    members
}

/// Whether two sets hold the same candidates.
fn same(a: &[Pick], b: &[Pick]) -> bool {
    a.len() == b.len() && (a.iter()).all(|p| b.iter().any(|q| q.candidate == p.candidate))
}
