//! From the set that the search ends with to the answer: members exchanged, taken out, made simpler, joined.

use super::bench::{Bench, Pick, n_columns};
use super::pool::On;
use super::problem::{Fault, Reading, Source};
use super::search::criterion;

/// By how much the criterion must fall for an exchange of members.
const EXCHANGED: f64 = 1.0;
/// Within so much of the criterion two members are equally good.
const AS_GOOD: f64 = 5.0;

impl Bench<'_> {
    /// Takes simpler kinds where nothing speaks for what they lack.
    fn simplify(&mut self, mut picks: Vec<Pick>) -> Vec<Pick> {
        for i in 0..picks.len() {
            if picks[i].columns.len() < 2 {
                continue;
            }
            let mut others = picks.clone();
            let own = others.remove(i);
            self.look(&others);
            let rank = self.present[own.candidate].as_ref().map_or(0, |p| p.rank);
            let beside = self.beside(&others);
            let nested: Vec<Pick> = (self.present.iter().flatten())
                .filter(|one| one.rank < rank)
                .filter(|one| self.candidate(one).searched <= self.candidate(&own).searched)
                .filter(|one| self.is_within_beside(one, &own, &beside))
                .cloned()
                .collect();
            let channels = self.acted_on(std::slice::from_ref(&own));
            for simple in nested {
                let mut set = picks.clone();
                set[i] = simple;
                let trial = self.trial(set);
                // What takes the place of a wider effect must be worth something by itself.
                if trial.is_possible()
                    && !self.evidence(&trial.picks, &picks, &channels).holds()
                    && self.evidence(&others, &trial.picks, &channels).holds()
                {
                    picks = trial.picks;
                    break;
                }
            }
        }
        picks
    }

    /// Whether a reading that is too large comes before friction by the load which is the same: where a drive carries little
    /// but friction, friction of friction and a wrong scale are one curve.
    fn leads(&self, rival: &Pick, member: &Pick) -> bool {
        let is_scale = |reading: &Reading| reading.fault == Fault::Scaled;
        matches!(&self.candidate(rival).source, Source::Reading(one) if is_scale(one))
            && self.candidate(member).source == Source::Carried
            && self.candidate(rival).effect.at == self.candidate(member).effect.at
    }

    /// Takes out, one by one, what is no longer needed.
    pub(crate) fn prune(&mut self, picks: Vec<Pick>) -> Vec<Pick> {
        self.weigh(&picks);
        let whole = picks.clone();
        let mut picks = self.simplify(picks);
        loop {
            let without = |i: usize| {
                let mut rest = picks.clone();
                rest.remove(i);
                rest
            };
            let mut tests = Vec::new();
            for i in 0..picks.len() {
                // What follows from the fit follows without the member too.
                let rest = self.refresh(without(i));
                let channels = self.acted_on(std::slice::from_ref(&picks[i]));
                tests.push((i, self.evidence(&rest, &picks, &channels)));
            }
            let mut unsupported: Vec<(usize, f64)> = tests
                .into_iter()
                .filter(|(_, evidence)| !evidence.holds())
                .map(|(i, evidence)| (i, evidence.gain))
                .collect();
            unsupported.sort_by(|a, b| a.1.total_cmp(&b.1));
            let fewer = unsupported.into_iter().find_map(|(i, _)| {
                let fewer = self.refresh(without(i));
                // Members that do little one by one may do much together.
                (!self.is_worse(&fewer, &whole)).then_some(fewer)
            });
            match fewer {
                Some(fewer) => picks = self.simplify(fewer),
                None => break,
            }
        }
        self.join(picks)
    }

    /// Takes one effect for two that it is the same as, such as dry friction that differs by direction for dry friction and
    /// an offset: one cause is likelier than two.
    fn join(&mut self, mut picks: Vec<Pick>) -> Vec<Pick> {
        for i in 0..picks.len() {
            for j in i + 1..picks.len() {
                let pair = [picks[i].clone(), picks[j].clone()];
                let mut others = picks.clone();
                others.remove(j);
                others.remove(i);
                let wide = self.as_wide_as(&pair);
                let seen = self.looked_at(&others, &|k| wide.contains(&k));
                let same = seen.into_iter().flatten().find(|one| {
                    let is_new = picks.iter().all(|p| p.candidate != one.candidate);
                    is_new
                        && one.rank == n_columns(&pair)
                        && pair.iter().all(|p| self.is_within(p, one))
                });
                let Some(same) = same else { continue };
                let mut set = others.clone();
                set.insert(i, same);
                let trial = self.trial(set);
                if trial.is_possible() {
                    picks = trial.picks;
                    return self.join(picks);
                }
            }
        }
        picks
    }

    /// Candidates without constants of their own that may hold two effects: only these are worth a look.
    fn as_wide_as(&self, pair: &[Pick]) -> Vec<usize> {
        let candidates = self.problem.candidates.iter().enumerate();
        let may_hold = candidates.filter(|(k, candidate)| {
            let has_room = candidate.searched == 0 && candidate.parameters.len() >= n_columns(pair);
            // What does not depend on the fit is known already.
            has_room
                && match &candidate.source {
                    Source::Columns(choices) if choices.len() == 1 => {
                        let one = self.pick(*k, 0);
                        pair.iter().all(|p| self.is_within(p, &one))
                    }
                    _ => true,
                }
        });
        may_hold.map(|(k, _)| k).collect()
    }

    /// Exchanges members for others by which the whole set gets better or simpler.
    pub(crate) fn exchange(&mut self, mut picks: Vec<Pick>) -> Vec<Pick> {
        self.weigh(&picks);
        let (factors, _) = self.fit(&picks, On::All);
        let rest = self.rest(&picks, &factors);
        let channels: Vec<usize> = (0..rest.len()).collect();
        let worth = self.worth(&rest, &channels);
        for i in 0..picks.len() {
            let mut others = picks.clone();
            others.remove(i);
            self.look(&others);
            let table = self.table(&picks);
            let now = self.trial(picks.clone());
            let bound = criterion(self.problem, &now, worth) - EXCHANGED;
            let mut best = (bound, 0.0, None);
            for rival in self.present.iter().flatten() {
                if picks.iter().any(|p| p.candidate == rival.candidate) {
                    continue;
                }
                let mut set = picks.clone();
                set[i] = rival.clone();
                let trial = self.try_in(&table, set);
                let score = criterion(self.problem, &trial, worth);
                let ahead = if self.leads(rival, &picks[i]) {
                    AS_GOOD
                } else {
                    0.0
                };
                let score = score - ahead;
                if trial.freedoms <= now.freedoms && score < best.0 {
                    best = (score, ahead, Some(trial));
                }
            }
            if let (score, ahead, Some(trial)) = best {
                let settled = self.settled(&trial);
                let changes = settled.picks != trial.picks;
                // A column that is made anew may no longer say what it promised.
                let kept = criterion(self.problem, &settled, worth) - ahead;
                if !changes || kept < score.max(bound) {
                    let refined = self.refine(settled.picks);
                    picks = self.refresh(refined);
                }
            }
        }
        picks
    }
}
