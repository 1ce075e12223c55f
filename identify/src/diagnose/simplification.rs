//! From the last set of the search to the result: members are exchanged, removed, simplified and joined.
//!
//! Decision: one cause is preferred to two, a simple one to a general one. A kind that `refines` another comes after
//! it; an effect that is a special case of an accepted one takes its place; among sets that the blocks cannot separate,
//! the one with the fewest parameters is taken.

use super::bench::{EffectSelector, SelectedEffect, n_columns};
use super::criterion::criterion;
use super::pool::FitScope;
use super::problem::{ColumnSource, ForceReadingFault, ReadingFaultKind};
use super::thresholds::{EQUALLY_GOOD_DIFFERENCE, EXCHANGE_LEAST_DECREASE};

impl EffectSelector<'_> {
    /// Replaces members by simpler kinds if no evidence supports the general one.
    fn simplify(&mut self, mut picks: Vec<SelectedEffect>) -> Vec<SelectedEffect> {
        for i in 0..picks.len() {
            // An effect with one parameter cannot be simplified.
            if picks[i].columns.len() < 2 {
                continue;
            }
            let mut others = picks.clone();
            let own = others.remove(i);
            self.update_choices(&others);
            // Only kinds with fewer independent columns whose columns lie in the span of the member are simpler.
            let rank = self.current_choices[own.candidate].as_ref().map_or(0, |p| p.rank);
            let beside = self.conditioning_set(&others);
            let nested: Vec<SelectedEffect> = (self.current_choices.iter().flatten())
                .filter(|one| one.rank < rank)
                .filter(|one| self.candidate(one).searched_constants <= self.candidate(&own).searched_constants)
                .filter(|one| self.is_in_conditional_span(one, &own, &beside))
                .cloned()
                .collect();
            // Evidence is computed on the channels of the member only.
            let channels = self.affected_channels(std::slice::from_ref(&own));
            for simple in nested {
                let mut set = picks.clone();
                set[i] = simple;
                let trial = self.fit_set(set);
                // The simpler effect must be supported by evidence of its own.
                if trial.is_possible()
                    && !self.evidence(&trial.picks, &picks, &channels).is_sufficient()
                    && self.evidence(&others, &trial.picks, &channels).is_sufficient()
                {
                    picks = trial.picks;
                    break;
                }
            }
        }
        picks
    }

    /// Whether a wrong scale of the force signal is preferred to load-dependent friction at the same drive. If a drive
    /// carries little but friction, both give the same curve.
    fn is_preferred_reading(&self, rival: &SelectedEffect, member: &SelectedEffect) -> bool {
        let is_scale = |reading: &ForceReadingFault| reading.kind == ReadingFaultKind::Scaled;
        matches!(&self.candidate(rival).source, ColumnSource::ReadingFault(one) if is_scale(one))
            && self.candidate(member).source == ColumnSource::LoadDependent
            && self.candidate(rival).effect.at == self.candidate(member).effect.at
    }

    /// Removes members one by one that are no longer supported, then joins pairs. The result is not significantly worse
    /// than the set at the start.
    pub(crate) fn prune(&mut self, picks: Vec<SelectedEffect>) -> Vec<SelectedEffect> {
        self.weigh_channels(&picks);
        // The set before any removal is the reference for all removals.
        let whole = picks.clone();
        let mut picks = self.simplify(picks);
        loop {
            // Evidence for each member: the set without it, fitted again, compared with the set.
            let mut tests = Vec::new();
            let mut fewer = Vec::new();
            for i in 0..picks.len() {
                fewer.push(self.refit_without(&picks, i));
                let rest = &fewer[i];
                let channels = self.affected_channels(std::slice::from_ref(&picks[i]));
                tests.push((i, self.evidence(rest, &picks, &channels)));
            }
            let mut unsupported: Vec<(usize, f64)> = tests
                .into_iter()
                .filter(|(_, evidence)| !evidence.is_sufficient())
                .map(|(i, evidence)| (i, evidence.gain))
                .collect();
            // Try the removals in order of their gain, the smallest first.
            unsupported.sort_by(|a, b| a.1.total_cmp(&b.1));
            // Remove the first member without which the set is not worse than the reference.
            let fewer = unsupported.into_iter().find_map(|(i, _)| {
                // Members that explain little one by one may explain much together.
                (!self.is_worse(&fewer[i], &whole)).then(|| fewer[i].clone())
            });
            match fewer {
                Some(fewer) => picks = self.simplify(fewer),
                None => break,
            }
        }
        self.join_equivalent(picks)
    }

    /// A set without a member. Columns that depend on the fit are computed again, and so are constants of other effects
    /// at the same place, since the member may have influenced them.
    fn refit_without(&mut self, picks: &[SelectedEffect], member: usize) -> Vec<SelectedEffect> {
        // Effects at the place of the removed member are the ones that depend on it most.
        let place = &self.candidate(&picks[member]).effect.at;
        let rest = without_members(picks, &[member]);
        // Whether an effect is a curve with searched constants at the place of the member.
        let is_bent_there = |pick: &SelectedEffect| {
            let candidate = self.candidate(pick);
            let is_bent = candidate.searched_constants > 0 && candidate.parameters.len() > 1;
            is_bent && candidate.effect.at == *place
        };
        let bent: Vec<usize> = (0..rest.len()).filter(|k| is_bent_there(&rest[*k])).collect();
        let rest = self.refine_members(rest, bent);
        self.refresh_columns(rest)
    }

    /// Joins two effects into one that is equivalent, such as dry friction that depends on the direction for dry
    /// friction and an offset: one cause is more likely than two. It also joins two effects into one that contains one
    /// of them and explains as much as both, such as a bent cable for a spring and a wave at its place.
    fn join_equivalent(&mut self, mut picks: Vec<SelectedEffect>) -> Vec<SelectedEffect> {
        for i in 0..picks.len() {
            for j in i + 1..picks.len() {
                // Columns that were computed for a pair that is not joined are released again.
                let known = self.pool.len();
                let joined = self
                    .merge_identical_pair(&picks, i, j)
                    .or_else(|| self.merge_similar_pair(&picks, i, j));
                if let Some(joined) = joined {
                    picks = joined;
                    // Positions have changed, so start again.
                    return self.join_equivalent(picks);
                }
                self.drop_columns_since(known, []);
            }
        }
        picks
    }

    /// A set with one effect in place of two members with the same span; `None` if there is no such candidate or the
    /// fit is physically impossible.
    fn merge_identical_pair(&mut self, picks: &[SelectedEffect], i: usize, j: usize) -> Option<Vec<SelectedEffect>> {
        let pair = [picks[i].clone(), picks[j].clone()];
        let others = without_members(picks, &[i, j]);
        // Candidates that have enough columns for both.
        let wide = self.wider_candidates(&pair);
        let seen = self.choose_candidates(&others, &|k| wide.contains(&k));
        // The same number of independent columns, and both members in its span: the spans are equal.
        let same = seen.into_iter().flatten().find(|one| {
            let is_new = picks.iter().all(|p| p.candidate != one.candidate);
            is_new && one.rank == n_columns(&pair) && pair.iter().all(|p| self.is_in_span(p, one))
        })?;
        // The joined effect takes the position of the first member.
        let mut set = others;
        set.insert(i, same);
        let trial = self.fit_set(set);
        trial.is_possible().then_some(trial.picks)
    }

    /// A set with one effect in place of two members at the same place. The effect contains one of them, or is the same
    /// kind with other constants. It is accepted if it is supported by evidence and the pair is not clearly better.
    fn merge_similar_pair(&mut self, picks: &[SelectedEffect], i: usize, j: usize) -> Option<Vec<SelectedEffect>> {
        let pair = [picks[i].clone(), picks[j].clone()];
        let [one, two] = pair.each_ref().map(|p| &self.candidate(p).effect);
        // Only effects at the same place are joined here.
        if one.at != two.at {
            return None;
        }
        let problem = self.problem;
        let place = &one.at;
        let others = without_members(picks, &[i, j]);
        // Candidates with known columns at the place of the pair that are not in the set yet.
        let is_curve = |k: usize| {
            let candidate = &problem.candidates[k];
            matches!(candidate.source, ColumnSource::Columns(_))
                && candidate.effect.at == *place
                && (candidate.searched_constants > 0 || pair.iter().all(|p| p.candidate != k))
                && others.iter().all(|p| p.candidate != k)
        };
        let seen = self.choose_candidates(&others, &is_curve);
        let channels = self.affected_channels(&pair);
        for one in seen.into_iter().flatten() {
            // The candidate is one of the pair with other constants, or contains one of the pair.
            let is_held = |p: &SelectedEffect| p.candidate == one.candidate || self.is_in_span(p, &one);
            if !pair.iter().any(is_held) {
                continue;
            }
            let mut set = others.clone();
            set.insert(i, one);
            // Refine its constant before the comparison.
            let set = self.refine_around_member(set, i);
            let trial = self.fit_set(set);
            // Evidence for the pair compared with the single effect.
            let for_both = self.evidence(&trial.picks, picks, &channels);
            if trial.is_possible()
                && !for_both.is_sufficient()
                && for_both.bic < EQUALLY_GOOD_DIFFERENCE
                && self.evidence(&others, &trial.picks, &channels).is_sufficient()
                && !self.is_worse(&trial.picks, picks)
            {
                return Some(trial.picks);
            }
        }
        None
    }

    /// Indices of candidates without searched constants that may contain two effects; only these are evaluated.
    fn wider_candidates(&self, pair: &[SelectedEffect]) -> Vec<usize> {
        let candidates = self.problem.candidates.iter().enumerate();
        let may_hold = candidates.filter(|(k, candidate)| {
            // A candidate that contains both needs at least as many parameters.
            let has_room = candidate.searched_constants == 0 && candidate.parameters.len() >= n_columns(pair);
            // Columns that do not depend on the fit can be tested at once.
            has_room
                && match &candidate.source {
                    ColumnSource::Columns(choices) if choices.len() == 1 => {
                        let one = self.select_choice(*k, 0);
                        pair.iter().all(|p| self.is_in_span(p, &one))
                    }
                    _ => true,
                }
        });
        may_hold.map(|(k, _)| k).collect()
    }

    /// Exchanges members for others that make the set better or simpler. A preferred cause may be slightly worse.
    pub(crate) fn exchange(&mut self, mut picks: Vec<SelectedEffect>) -> Vec<SelectedEffect> {
        self.weigh_channels(&picks);
        let (factors, _) = self.fit(&picks, FitScope::All);
        let rest = self.residual(&picks, &factors);
        let channels: Vec<usize> = (0..rest.len()).collect();
        // The criterion uses the residual of the complete set.
        let worth = self.effective_equations(&rest, &channels);
        for i in 0..picks.len() {
            let mut others = picks.clone();
            others.remove(i);
            self.update_choices(&others);
            let table = self.projected_gram(&picks);
            let now = self.fit_set(picks.clone());
            let bound = criterion(self.problem, &now, worth) - EXCHANGE_LEAST_DECREASE;
            // Best rival so far: its criterion less the preference, the preference, and the fitted set.
            let mut best = (bound, 0.0, None);
            for rival in self.current_choices.iter().flatten() {
                if picks.iter().any(|p| p.candidate == rival.candidate) {
                    continue;
                }
                let mut set = picks.clone();
                set[i] = rival.clone();
                let trial = self.fit_from_gram(&table, set);
                let score = criterion(self.problem, &trial, worth);
                // A preferred cause gets an advantage.
                let ahead = if self.is_preferred_reading(rival, &picks[i]) {
                    EQUALLY_GOOD_DIFFERENCE
                } else {
                    0.0
                };
                let score = score - ahead;
                let is_confirmed =
                    || self.are_members_determined(&trial.picks) && self.are_readings_confirmed(&trial.picks);
                if trial.freedoms <= now.freedoms && score < best.0 && is_confirmed() {
                    best = (score, ahead, Some(trial));
                }
            }
            // Fit the best rival again with its own columns before it is accepted.
            if let (score, ahead, Some(trial)) = best {
                let settled = self.refit_dependent_columns(&trial);
                let changes = settled.picks != trial.picks;
                // A column that is computed again may explain less than it promised.
                let kept = criterion(self.problem, &settled, worth) - ahead;
                if !changes || kept < score.max(bound) {
                    let refined = self.refine_constants(settled.picks);
                    picks = self.refresh_columns(refined);
                }
            }
        }
        picks
    }
}

/// A set without the members at some positions.
fn without_members(picks: &[SelectedEffect], members: &[usize]) -> Vec<SelectedEffect> {
    let kept = picks.iter().enumerate();
    let kept = kept.filter(|(k, _)| !members.contains(k));
    kept.map(|(_, pick)| pick.clone()).collect()
}
