//! What a recording cannot tell apart: effects that, put in place of a found one, explain it as well.

use super::bench::{EffectSelector, ScoredEffectSet, SelectedEffect, n_columns};
use super::beside::ConditioningSet;
use super::problem::{ColumnSource, LocatedEffect};

/// How much worse (twice the logarithm of the likelihood, with the samples that the residual is worth) a set may be and
/// still not be told from the best.
pub(crate) const MIN_DISTINCTION: f64 = 9.0;
/// What stands in for an effect must take off this share of the squared error that the effect takes off.
const MIN_SUBSTITUTE_SHARE: f64 = 0.8;
/// A wrong reading that leaves less than this factor is looked at with a column of its own size.
const CLOSE: f64 = 3.0;
/// What takes off less than this share of squares takes nothing off.
const NEGLIGIBLE_SHARE: f64 = 1e-6;

/// An effect that cannot be told from a found one.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct EffectAlias {
    pub(crate) effect: LocatedEffect,
    /// How much worse it is, in the units of [`MIN_DISTINCTION`]; negative if better.
    pub(crate) criterion_loss: f64,
    /// Whether it is part of another way to write the same down, and no other cause.
    pub(crate) is_equivalent_form: bool,
}

impl EffectSelector<'_> {
    /// For each effect of a set, what could stand in its place.
    pub(crate) fn find_aliases(&mut self, picks: &[SelectedEffect]) -> Vec<Vec<EffectAlias>> {
        if self.problem.effects_only {
            return vec![Vec::new(); picks.len()];
        }
        self.weigh_channels(picks);
        let (factors, squares) = self.fit(picks, super::pool::FitScope::All);
        let rest = self.residual(picks, &factors);
        let mut all = Vec::new();
        let known = self.pool.len();
        for i in 0..picks.len() {
            let mut others = picks.to_vec();
            let pick = others.remove(i);
            self.current_choices.fill(None);
            self.drop_columns_since(known, []);
            self.update_choices(&others);
            let beside = self.conditioning_set(&others);
            let channels: Vec<usize> = (0..rest.len()).collect();
            let worth = self.effective_equations(&rest, &channels);
            let table = self.projected_gram(picks);
            // How much worse a set is in place of the found one, if it may stand for what the found one adds to `fewer`.
            let in_place =
                |bench: &Self, fewer: &[SelectedEffect], trial: &ScoredEffectSet| -> Option<f64> {
                    let left = bench.fit_from_gram(&table, fewer.to_vec()).squares;
                    let worse = worth * (trial.squares / squares.max(f64::MIN_POSITIVE)).ln();
                    // What takes nothing off cannot be stood in for.
                    let own = left - squares;
                    let stands_in = own > NEGLIGIBLE_SHARE * left
                        && left - trial.squares > MIN_SUBSTITUTE_SHARE * own;
                    (worse < MIN_DISTINCTION && stands_in && trial.is_possible()).then_some(worse)
                };
            let mut found: Vec<EffectAlias> = Vec::new();
            for candidate in self.current_choices.clone().iter().flatten() {
                if picks.iter().any(|p| p.candidate == candidate.candidate) {
                    continue;
                }
                // The same kind at more or fewer places is another way to write the set down.
                let (one, two) = (
                    &self.candidate(&pick).effect,
                    &self.candidate(candidate).effect,
                );
                if one.kind == two.kind && one.at.iter().any(|place| two.at.contains(place)) {
                    continue;
                }
                let more = self.is_in_conditional_span(&pick, candidate, &beside);
                if more && candidate.rank > pick.rank {
                    continue; // It holds the found one and more, so that nothing speaks for it.
                }
                // A curve that is bent by a constant of its own comes near to any that is not.
                if self.candidate(candidate).searched_constants
                    > self.candidate(&pick).searched_constants
                {
                    continue;
                }
                let mut set = others.clone();
                set.push(candidate.clone());
                let tried = self.fit_from_gram(&table, set);
                let trial = self.refit_at_size(candidate, tried, squares);
                if let Some(worse) = in_place(self, &others, &trial) {
                    found.push(EffectAlias {
                        effect: self.candidate(candidate).effect.clone(),
                        criterion_loss: worse,
                        is_equivalent_form: false,
                    });
                }
            }
            // One effect may stand for two, as friction that differs by direction for friction and an offset.
            for j in 0..others.len() {
                let mut fewer = others.clone();
                let second = fewer.remove(j);
                for candidate in self.current_choices.iter().flatten() {
                    let is_new = picks.iter().all(|p| p.candidate != candidate.candidate);
                    let size = n_columns(&[pick.clone(), second.clone()]);
                    if !is_new || candidate.columns.len() > size {
                        continue;
                    }
                    let mut set = fewer.clone();
                    set.push(candidate.clone());
                    let trial = self.fit_from_gram(&table, set);
                    let effect = &self.candidate(candidate).effect;
                    if let Some(worse) = in_place(self, &fewer, &trial)
                        && found.iter().all(|alias| alias.effect != *effect)
                    {
                        found.push(EffectAlias {
                            effect: effect.clone(),
                            criterion_loss: worse,
                            is_equivalent_form: self.is_in_span(&pick, candidate)
                                && self.is_in_span(&second, candidate),
                        });
                    }
                }
            }
            for (one, worse) in self.equivalent_pairs(&pick, picks, &others, in_place) {
                if found.iter().all(|alias| alias.effect != one) {
                    found.push(EffectAlias {
                        effect: one,
                        criterion_loss: worse,
                        is_equivalent_form: true,
                    });
                }
            }
            found.sort_by(|a, b| a.criterion_loss.total_cmp(&b.criterion_loss));
            all.push(found);
        }
        all
    }

    /// Pairs of simpler effects that say together what one of a set says, each with how much worse the pair is.
    fn equivalent_pairs(
        &self,
        pick: &SelectedEffect,
        picks: &[SelectedEffect],
        others: &[SelectedEffect],
        in_place: impl Fn(&Self, &[SelectedEffect], &ScoredEffectSet) -> Option<f64>,
    ) -> Vec<(LocatedEffect, f64)> {
        let halves: Vec<&SelectedEffect> = (self.current_choices.iter().flatten())
            .filter(|one| one.rank < pick.rank && self.candidate(one).searched_constants == 0)
            .filter(|one| picks.iter().all(|p| p.candidate != one.candidate))
            .filter(|one| self.is_in_span(one, pick))
            .collect();
        let mut found = Vec::new();
        for (k, one) in halves.iter().enumerate() {
            for two in &halves[k + 1..] {
                let mut set = others.to_vec();
                set.extend([(*one).clone(), (*two).clone()]);
                if let Some(worse) = in_place(self, others, &self.fit_set(set)) {
                    let both = [one, two].map(|half| (self.candidate(half).effect.clone(), worse));
                    found.extend(both);
                }
            }
        }
        found
    }

    /// A set with a wrong reading or a further body that comes near to what is found, by columns of its own size.
    fn refit_at_size(
        &mut self,
        candidate: &SelectedEffect,
        tried: ScoredEffectSet,
        squares: f64,
    ) -> ScoredEffectSet {
        let source = &self.candidate(candidate).source;
        let is_sized = matches!(
            source,
            ColumnSource::ReadingFault(_) | ColumnSource::Body(_)
        );
        if !is_sized || tried.squares > CLOSE * squares {
            return tried;
        }
        let refreshed = self.refresh_columns(tried.picks);
        self.fit_set(refreshed)
    }

    /// Whether all columns of one effect lie in the span of the base and another one.
    pub(crate) fn is_in_span(&self, one: &SelectedEffect, other: &SelectedEffect) -> bool {
        let key = (one.columns.clone(), other.columns.clone());
        let known = self.span_cache.borrow().get(&key).copied();
        known.unwrap_or_else(|| {
            let found = self.is_in_conditional_span(one, other, &self.base_set);
            self.span_cache.borrow_mut().insert(key, found);
            found
        })
    }

    /// Whether all columns of one effect lie in the span of a set and another one.
    pub(crate) fn is_in_conditional_span(
        &self,
        one: &SelectedEffect,
        other: &SelectedEffect,
        beside: &ConditioningSet,
    ) -> bool {
        if one.columns == other.columns {
            return true;
        }
        // Bodies of other channels may be the same beside the base; friction is not.
        if !self.candidate(one).is_part_of_load {
            let reached = self.affected_channels(std::slice::from_ref(other));
            let acted = self.affected_channels(std::slice::from_ref(one));
            if acted.iter().any(|d| !reached.contains(d)) {
                return false;
            }
        }
        self.is_in_joint_span(&one.columns, &other.columns, beside)
    }
}
