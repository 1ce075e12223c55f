//! From the set that the search ends with to the answer: members exchanged, taken out, made simpler, joined.
//!
//! Decision: one cause is preferred to two, a simple one to a general one. A kind that `refines` another waits for
//! it; an effect that is a special case of an accepted one takes its place; among sets that the blocks cannot
//! separate, the one with the fewest parameters is taken.

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
            let mut tests = Vec::new();
            let mut fewer = Vec::new();
            for i in 0..picks.len() {
                fewer.push(self.settled_without(&picks, i));
                let rest = &fewer[i];
                let channels = self.acted_on(std::slice::from_ref(&picks[i]));
                tests.push((i, self.evidence(rest, &picks, &channels)));
            }
            let mut unsupported: Vec<(usize, f64)> = tests
                .into_iter()
                .filter(|(_, evidence)| !evidence.holds())
                .map(|(i, evidence)| (i, evidence.gain))
                .collect();
            unsupported.sort_by(|a, b| a.1.total_cmp(&b.1));
            let fewer = unsupported.into_iter().find_map(|(i, _)| {
                // Members that do little one by one may do much together.
                (!self.is_worse(&fewer[i], &whole)).then(|| fewer[i].clone())
            });
            match fewer {
                Some(fewer) => picks = self.simplify(fewer),
                None => break,
            }
        }
        self.join(picks)
    }

    /// A set without a member: what follows from the fit follows without it too, and what was bent by a constant beside it at its
    /// place may be bent otherwise.
    fn settled_without(&mut self, picks: &[Pick], member: usize) -> Vec<Pick> {
        let place = &self.candidate(&picks[member]).effect.at;
        let rest = without(picks, &[member]);
        let is_bent_there = |pick: &Pick| {
            let candidate = self.candidate(pick);
            let is_bent = candidate.searched > 0 && candidate.parameters.len() > 1;
            is_bent && candidate.effect.at == *place
        };
        let bent: Vec<usize> = (0..rest.len())
            .filter(|k| is_bent_there(&rest[*k]))
            .collect();
        let rest = self.refine_some(rest, bent);
        self.refresh(rest)
    }

    /// Takes one effect for two that it is the same as, such as dry friction that differs by direction for dry friction and
    /// an offset: one cause is likelier than two. So does one that holds either of them and says all that both say as far as
    /// the recordings tell, as a cable that is bent for a spring and a wave at its place.
    fn join(&mut self, mut picks: Vec<Pick>) -> Vec<Pick> {
        for i in 0..picks.len() {
            for j in i + 1..picks.len() {
                let known = self.pool.len();
                let joined = self
                    .same_as_both(&picks, i, j)
                    .or_else(|| self.as_good_as_both(&picks, i, j));
                if let Some(joined) = joined {
                    picks = joined;
                    return self.join(picks);
                }
                self.forget_since(known, []);
            }
        }
        picks
    }

    /// A set with one effect for two of its members that together are the same.
    fn same_as_both(&mut self, picks: &[Pick], i: usize, j: usize) -> Option<Vec<Pick>> {
        let pair = [picks[i].clone(), picks[j].clone()];
        let others = without(picks, &[i, j]);
        let wide = self.as_wide_as(&pair);
        let seen = self.looked_at(&others, &|k| wide.contains(&k));
        let same = seen.into_iter().flatten().find(|one| {
            let is_new = picks.iter().all(|p| p.candidate != one.candidate);
            is_new && one.rank == n_columns(&pair) && pair.iter().all(|p| self.is_within(p, one))
        })?;
        let mut set = others;
        set.insert(i, same);
        let trial = self.trial(set);
        trial.is_possible().then_some(trial.picks)
    }

    /// A set with one effect for two members at a place, of which it holds one, or is one with other constants, if the evidence
    /// that speaks for it does not speak for the pair beside it.
    fn as_good_as_both(&mut self, picks: &[Pick], i: usize, j: usize) -> Option<Vec<Pick>> {
        let pair = [picks[i].clone(), picks[j].clone()];
        let [one, two] = pair.each_ref().map(|p| &self.candidate(p).effect);
        if one.at != two.at {
            return None;
        }
        let problem = self.problem;
        let place = &one.at;
        let others = without(picks, &[i, j]);
        let is_curve = |k: usize| {
            let candidate = &problem.candidates[k];
            matches!(candidate.source, Source::Columns(_))
                && candidate.effect.at == *place
                && (candidate.searched > 0 || pair.iter().all(|p| p.candidate != k))
                && others.iter().all(|p| p.candidate != k)
        };
        let seen = self.looked_at(&others, &is_curve);
        let channels = self.acted_on(&pair);
        for one in seen.into_iter().flatten() {
            let is_held = |p: &Pick| p.candidate == one.candidate || self.is_within(p, &one);
            if !pair.iter().any(is_held) {
                continue;
            }
            let mut set = others.clone();
            set.insert(i, one);
            let set = self.refine_around(set, i);
            let trial = self.trial(set);
            let for_both = self.evidence(&trial.picks, picks, &channels);
            if trial.is_possible()
                && !for_both.holds()
                && for_both.bic < AS_GOOD
                && self.evidence(&others, &trial.picks, &channels).holds()
                && !self.is_worse(&trial.picks, picks)
            {
                return Some(trial.picks);
            }
        }
        None
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

/// A set without some of its members.
fn without(picks: &[Pick], members: &[usize]) -> Vec<Pick> {
    let kept = picks.iter().enumerate();
    let kept = kept.filter(|(k, _)| !members.contains(k));
    kept.map(|(_, pick)| pick.clone()).collect()
}
