//! Combinations that are tried at once: pairs of effects, and the same kinds at all drives.
//!
//! Decision: friction sits in every joint of an arm, and each joint has Coulomb and viscous friction. One effect alone
//! explains a sixth of the error there, and leaves a smooth residual that is worth few independent equations. So the
//! same kinds at all drives are one trial, and so is each pair of kinds at one drive. Members that are not supported
//! are removed at once.

use std::collections::BTreeMap;

use super::bench::{EffectSelector, ProjectedGram, ScoredEffectSet, SelectedEffect};
use super::criterion::criterion;
use super::problem::CandidateNature;

/// Number of candidates whose pairs are all tried: those that explain most in addition to the accepted set.
const PAIRED: usize = 140;
/// Number of pairs that join the other trial sets.
const BEST_PAIRS: usize = 12;

impl EffectSelector<'_> {
    /// The best pairs of further effects, added to the accepted set or to this set without one member. A pair may
    /// explain everything where neither effect explains much alone, and where an effect that two places share was
    /// accepted first.
    pub(crate) fn best_pairs(
        &self,
        accepted: &[SelectedEffect],
        table: &ProjectedGram,
        worth: f64,
    ) -> Vec<ScoredEffectSet> {
        let is_new = |pick: &&SelectedEffect| accepted.iter().all(|p| p.candidate != pick.candidate);
        // Weighted squared residual of the accepted set with one more effect.
        let alone = |pick: &SelectedEffect| {
            let mut set = accepted.to_vec();
            set.push(pick.clone());
            self.fit_from_gram(table, set).squares
        };
        // Only effects with at most two estimated numbers take part in pairs.
        let simple = self.current_choices.iter().flatten().filter(is_new);
        let simple = simple.filter(|pick| self.freedoms(pick) <= 2);
        let mut further: Vec<(f64, &SelectedEffect)> = simple.map(|pick| (alone(pick), pick)).collect();
        further.sort_by(|a, b| a.0.total_cmp(&b.0));
        further.truncate(PAIRED);
        // The accepted set and every subset with one member less.
        let mut kept: Vec<Vec<SelectedEffect>> = vec![accepted.to_vec()];
        kept.extend((0..accepted.len()).map(|i| {
            let mut fewer = accepted.to_vec();
            fewer.remove(i);
            fewer
        }));
        // Sorted list of the best pairs with their criterion.
        let mut best: Vec<(f64, ScoredEffectSet)> = Vec::new();
        for set in kept {
            let beyond = self.extension_bound(table, &set);
            for (i, (_, one)) in further.iter().enumerate() {
                for (_, two) in &further[i + 1..] {
                    // Once the list is full, skip pairs whose lower bound is above its last entry.
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
                        // Insert in order, so that the last entry is the worst of the list.
                        let at = best.partition_point(|(other, _)| *other < own);
                        best.insert(at, (own, trial));
                        best.truncate(BEST_PAIRS);
                    }
                }
            }
        }
        best.into_iter().map(|(_, trial)| trial).collect()
    }

    /// Sets with the same kinds at all drives: the accepted set with one kind, or with two kinds, at every drive that
    /// does not have it yet; and the accepted set with two kinds at one drive, the best two for each drive.
    /// Members that do not lower the criterion are left out.
    pub(crate) fn alike_sets(
        &self,
        accepted: &[SelectedEffect],
        table: &ProjectedGram,
        worth: f64,
    ) -> Vec<ScoredEffectSet> {
        let kinds: Vec<Vec<&SelectedEffect>> = self.simple_kinds_at_drives(accepted).into_values().collect();
        let mut sets = Vec::new();
        let mut best_at_drive: BTreeMap<&str, ScoredEffectSet> = BTreeMap::new();
        let with = |further: &[&SelectedEffect]| {
            let mut picks = accepted.to_vec();
            picks.extend(further.iter().map(|pick| (*pick).clone()));
            picks
        };
        for (i, one) in kinds.iter().enumerate() {
            if one.len() > 1 {
                sets.extend(self.fit_possible_members(table, accepted.len(), with(one)));
            }
            for two in &kinds[i + 1..] {
                if one.len() + two.len() > 2 {
                    let both = [one.as_slice(), two.as_slice()].concat();
                    sets.extend(self.fit_possible_members(table, accepted.len(), with(&both)));
                }
                for pick in one {
                    let place = &self.candidate(pick).effect.at;
                    let Some(other) = two.iter().find(|other| self.candidate(other).effect.at == *place) else {
                        continue;
                    };
                    let trial = self.fit_from_gram(table, with(&[pick, other]));
                    let best = best_at_drive.get(place[0].as_str());
                    if trial.is_possible() && best.is_none_or(|best| trial.squares < best.squares) {
                        best_at_drive.insert(place[0].as_str(), trial);
                    }
                }
            }
        }
        let few = sets
            .into_iter()
            .filter_map(|set| self.drop_weak_members(table, accepted.len(), set, worth));
        few.chain(best_at_drive.into_values()).collect()
    }

    /// A set without those members from `first` on that do not lower the criterion. `None` if fewer than two of them
    /// remain.
    fn drop_weak_members(
        &self,
        table: &ProjectedGram,
        first: usize,
        mut set: ScoredEffectSet,
        worth: f64,
    ) -> Option<ScoredEffectSet> {
        loop {
            let own = criterion(self.problem, &set, worth);
            let weak = self.weakest_by_place(&set.picks, first, |without, _| {
                let less = criterion(self.problem, &self.fit_from_gram(table, without.to_vec()), worth);
                (less <= own).then_some(-less)
            });
            if weak.is_empty() {
                return Some(set);
            }
            let kept = without_members(&set.picks, &weak);
            if kept.len() < first + 2 {
                return None;
            }
            set = self.fit_from_gram(table, kept);
        }
    }

    /// The weakest of the dispensable members of each place, by index, weakest first. `strength` gets the set without a
    /// member and the member; it returns a strength, smaller for weaker members, or `None` for a member that is needed.
    /// Members of one place may replace each other, so that only one of them is removed at a time.
    fn weakest_by_place(
        &self,
        picks: &[SelectedEffect],
        first: usize,
        strength: impl Fn(&[SelectedEffect], SelectedEffect) -> Option<f64>,
    ) -> Vec<usize> {
        let mut weakest: BTreeMap<&[String], (f64, usize)> = BTreeMap::new();
        for i in first..picks.len() {
            let mut without = picks.to_vec();
            let pick = without.remove(i);
            let Some(strength) = strength(&without, pick) else {
                continue;
            };
            let of_place = weakest
                .entry(&self.candidate(&picks[i]).effect.at)
                .or_insert((strength, i));
            if strength < of_place.0 {
                *of_place = (strength, i);
            }
        }
        let mut weakest: Vec<(f64, usize)> = weakest.into_values().collect();
        weakest.sort_by(|a, b| a.0.total_cmp(&b.0));
        weakest.into_iter().map(|(_, i)| i).collect()
    }

    /// Effects at single drives that the accepted set does not have, by kind: those with one estimated number and
    /// without a searched constant.
    fn simple_kinds_at_drives(&self, accepted: &[SelectedEffect]) -> BTreeMap<&str, Vec<&SelectedEffect>> {
        let channels = &self.problem.layout.channels;
        let mut kinds: BTreeMap<&str, Vec<&SelectedEffect>> = BTreeMap::new();
        for pick in self.current_choices.iter().flatten() {
            let candidate = self.candidate(pick);
            let is_new = accepted.iter().all(|member| member.candidate != pick.candidate);
            let is_at_drive = candidate.effect.at.len() == 1 && channels.contains(&candidate.effect.at[0]);
            let is_simple = self.freedoms(pick) == 1 && candidate.searched_constants == 0;
            if is_new && is_at_drive && is_simple && candidate.nature == CandidateNature::Effect {
                kinds.entry(candidate.effect.kind.as_str()).or_default().push(pick);
            }
        }
        kinds
    }

    /// Fits a set whose members from `first` on may be left out: those with an impossible estimate are. `None` if the
    /// others are impossible too, or if fewer than two of the further members remain.
    fn fit_possible_members(
        &self,
        table: &ProjectedGram,
        first: usize,
        picks: Vec<SelectedEffect>,
    ) -> Option<ScoredEffectSet> {
        let mut trial = self.fit_from_gram(table, picks);
        // Each round removes at least one member.
        while !trial.is_possible() {
            let wrong = [&trial.wrong_sign[..], &trial.cancelling, &trial.implausible].concat();
            let wrong: Vec<usize> = wrong.into_iter().filter(|i| *i >= first).collect();
            if wrong.is_empty() {
                return None;
            }
            let kept = without_members(&trial.picks, &wrong);
            if kept.len() < first + 2 {
                return None;
            }
            trial = self.fit_from_gram(table, kept);
        }
        Some(trial)
    }

    /// A set without those members that the accepted set does not have and that are not supported by evidence, the
    /// weakest of each place first; at least one further member stays.
    pub(crate) fn drop_unsupported_members(
        &self,
        accepted: &[SelectedEffect],
        picks: Vec<SelectedEffect>,
    ) -> Vec<SelectedEffect> {
        // Members of the accepted set come first.
        let is_further = |pick: &SelectedEffect| accepted.iter().all(|p| p.candidate != pick.candidate);
        let (further, mut picks): (Vec<SelectedEffect>, Vec<SelectedEffect>) = picks.into_iter().partition(is_further);
        let first = picks.len();
        picks.extend(further);
        while picks.len() > first + 1 {
            let mut weak = self.weakest_by_place(&picks, first, |without, pick| {
                let evidence = self.evidence(without, &picks, &self.affected_channels(&[pick]));
                (!evidence.is_sufficient()).then_some(evidence.gain)
            });
            if weak.is_empty() {
                break;
            }
            weak.truncate(picks.len() - first - 1);
            picks = without_members(&picks, &weak);
        }
        picks
    }
}

/// A set without some members.
fn without_members(picks: &[SelectedEffect], members: &[usize]) -> Vec<SelectedEffect> {
    let picks = picks.iter().enumerate();
    let kept = picks.filter(|(i, _)| !members.contains(i));
    kept.map(|(_, pick)| pick.clone()).collect()
}
