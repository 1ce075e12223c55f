//! Indistinguishable alternatives. Input: the set of effects that was found. Output: for each of its effects the other
//! effects that, in its place, explain the recording equally well.

use super::bench::{EffectSelector, ScoredEffectSet, SelectedEffect, n_columns};
use super::conditional::ConditioningSet;
use super::problem::{CandidateEffect, ColumnSource, LocatedEffect, ReadingFaultKind, TIME_BASE};
use super::thresholds::{
    CLOCK_OR_LENGTH_MOST_RATIO, MIN_DISTINCTION, MIN_SUBSTITUTE_SHARE, NEGLIGIBLE_EFFECT_SHARE,
    SIGNAL_FAULT_LEAST_DIFFERENCE, SIGNAL_FAULT_MOST_PLACE, SUBSTITUTE_MOST_RATIO,
};

/// An effect that cannot be distinguished from one that was found.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct EffectAlias {
    /// Kind and place.
    pub(crate) effect: LocatedEffect,
    /// How much worse the criterion is with it, in the units of [`MIN_DISTINCTION`]; negative if better.
    pub(crate) criterion_loss: f64,
    /// Whether it is only another form of the same effect, and not another cause.
    pub(crate) is_equivalent_form: bool,
}

impl EffectSelector<'_> {
    /// The alternatives of each effect of a set, `[effect]`, best first; none if only effects are requested.
    pub(crate) fn find_aliases(&mut self, picks: &[SelectedEffect]) -> Vec<Vec<EffectAlias>> {
        if self.problem.effects_only {
            return vec![Vec::new(); picks.len()];
        }
        self.weigh_channels(picks);
        // Reference: the squared residual of the set.
        let (factors, squares) = self.fit(picks, super::pool::FitScope::All);
        let rest = self.residual(picks, &factors);
        let mut all = Vec::new();
        let known = self.pool.len();
        for i in 0..picks.len() {
            // Compare in the presence of the other effects. Columns of the previous round are released.
            let mut others = picks.to_vec();
            let pick = others.remove(i);
            self.current_choices.fill(None);
            self.drop_columns_since(known, []);
            self.update_choices(&others);
            let beside = self.conditioning_set(&others);
            let channels: Vec<usize> = (0..rest.len()).collect();
            let worth = self.effective_equations(&rest, &channels);
            let table = self.projected_gram(picks);
            // Loss of the criterion with another set; `None` if it is above a bound or the set does not explain what
            // the effect adds to `fewer`.
            let substitute = |bench: &Self, fewer: &[SelectedEffect], trial: &ScoredEffectSet, most_loss: f64| {
                // Squared residual without the effect, and without its partner if `fewer` lacks two.
                let left = bench.fit_from_gram(&table, fewer.to_vec()).squares;
                let worse = worth * (trial.squares / squares.max(f64::MIN_POSITIVE)).ln();
                // An effect that explains nothing cannot be replaced.
                let own = left - squares;
                let stands_in =
                    own > NEGLIGIBLE_EFFECT_SHARE * left && left - trial.squares > MIN_SUBSTITUTE_SHARE * own;
                (worse < most_loss && stands_in && trial.is_possible()).then_some(worse)
            };
            // The same with the bound from which on a set is distinguishable.
            let in_place = |bench: &Self, fewer: &[SelectedEffect], trial: &ScoredEffectSet| {
                substitute(bench, fewer, trial, MIN_DISTINCTION)
            };
            let mut found: Vec<EffectAlias> = Vec::new();
            // Stage 1: single candidates in place of the effect.
            for candidate in self.current_choices.clone().iter().flatten() {
                if picks.iter().any(|p| p.candidate == candidate.candidate) {
                    continue;
                }
                // The same kind at more or fewer places is another form of the set.
                // Kind and place of the effect and of the candidate.
                let (one, two) = (&self.candidate(&pick).effect, &self.candidate(candidate).effect);
                if one.kind == two.kind && one.at.iter().any(|place| two.at.contains(place)) {
                    continue;
                }
                // A candidate that contains the effect and more is not supported by the data.
                let more = self.is_in_conditional_span(&pick, candidate, &beside);
                if more && candidate.rank > pick.rank {
                    continue; // It holds the found one and more, so that nothing speaks for it.
                }
                // A curve with a searched constant approximates almost any curve without one.
                if self.candidate(candidate).searched_constants > self.candidate(&pick).searched_constants {
                    continue;
                }
                // Fit the candidate in place of the effect.
                let mut set = others.clone();
                set.push(candidate.clone());
                let tried = self.fit_from_gram(&table, set);
                let trial = self.refit_at_size(candidate, tried, squares);
                // Neither of two signal faults is shown if the forces lie between both, and neither a clock nor a length
                // if both fit.
                let are_alike = self.are_clock_and_length(&pick, candidate, trial.squares / squares)
                    || self.are_between(&pick, candidate, &rest, &trial);
                let most_loss = if are_alike { f64::INFINITY } else { MIN_DISTINCTION };
                if let Some(worse) = substitute(self, &others, &trial, most_loss) {
                    found.push(EffectAlias {
                        effect: self.candidate(candidate).effect.clone(),
                        // What lies between both counts for neither.
                        criterion_loss: if most_loss > MIN_DISTINCTION { 0.0 } else { worse },
                        // With an offset, friction that depends on the direction is the same as friction.
                        is_equivalent_form: more && self.is_refinement_of(candidate, &pick),
                    });
                }
            }
            // Stage 2: one effect in place of two, such as friction that depends on the direction for friction and an
            // offset.
            for j in 0..others.len() {
                let mut fewer = others.clone();
                let second = fewer.remove(j);
                for candidate in self.current_choices.iter().flatten() {
                    let is_new = picks.iter().all(|p| p.candidate != candidate.candidate);
                    // The candidate must not have more parameters than both effects together.
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
            // Stage 3: pairs of simpler effects that together are the effect.
            for (one, worse) in self.equivalent_pairs(&pick, picks, &others, in_place) {
                if found.iter().all(|alias| alias.effect != one) {
                    found.push(EffectAlias {
                        effect: one,
                        criterion_loss: worse,
                        is_equivalent_form: true,
                    });
                }
            }
            // The closest alternative comes first.
            found.sort_by(|a, b| a.criterion_loss.total_cmp(&b.criterion_loss));
            all.push(found);
        }
        all
    }

    /// Whether an effect and another one in its place are a delay and a low-pass of the same forces, and the forces
    /// lie between both or beyond either, or both fits hardly differ. Both shift a force by the same time and differ
    /// only in the curvature of the force. `rest` is the residual with the effect, `trial` the set with the other
    /// one.
    ///
    /// On the line through both fits, the fit with the effect is at 0 and the other one at 1. A true delay lies at 0, a
    /// true low-pass at 1. What lies elsewhere was bent by something else, such as the smoothing of positions, and the
    /// difference of the errors shows neither of them. A difference that is small relative to the residual may be bent
    /// from one end to the other.
    fn are_between(
        &self,
        pick: &SelectedEffect,
        candidate: &SelectedEffect,
        rest: &[Vec<f64>],
        trial: &ScoredEffectSet,
    ) -> bool {
        let [one, other] = [pick, candidate].map(|pick| match self.candidate(pick).source {
            ColumnSource::ReadingFault(fault) if fault.kind != ReadingFaultKind::Scaled => Some(fault),
            _ => None,
        });
        let (Some(one), Some(other)) = (one, other) else {
            return false;
        };
        if one.channel != other.channel || one.kind == other.kind {
            return false;
        }
        let (factors, _) = self.fit(&trial.picks, super::pool::FitScope::All);
        let rest_of_other = self.residual(&trial.picks, &factors);
        // Squares of the residual, of the difference of both fits, and the product of both.
        let (mut total, mut squares, mut product) = (0.0, 0.0, 0.0);
        for ((rest, other), weight) in rest.iter().zip(&rest_of_other).zip(&self.weights) {
            for (r, o) in rest.iter().zip(other) {
                total += weight * r * r;
                product += weight * r * (r - o);
                squares += weight * (r - o).powi(2);
            }
        }
        squares < SIGNAL_FAULT_LEAST_DIFFERENCE * total || product.abs() > SIGNAL_FAULT_MOST_PLACE * squares
    }

    /// Whether one of two candidates is a clock that runs fast or slow, the other a constant of the geometry, and the squared
    /// residual with the one is hardly larger than that with the other.
    fn are_clock_and_length(&self, one: &SelectedEffect, other: &SelectedEffect, residual_ratio: f64) -> bool {
        let is_clock = |pick: &SelectedEffect| self.candidate(pick).effect.kind == TIME_BASE;
        let is_constant = |pick: &SelectedEffect| matches!(self.candidate(pick).source, ColumnSource::Constant(_));
        let are_both = (is_clock(one) && is_constant(other)) || (is_constant(one) && is_clock(other));
        are_both && residual_ratio <= CLOCK_OR_LENGTH_MOST_RATIO
    }

    /// Whether one of two effects at the same places is the general form of the other.
    fn is_refinement_of(&self, one: &SelectedEffect, other: &SelectedEffect) -> bool {
        let [one, other] = [one, other].map(|pick| self.candidate(pick));
        let refines = |a: &CandidateEffect, b: &CandidateEffect| a.refines.as_ref() == Some(&b.effect.kind);
        one.effect.at == other.effect.at && (refines(one, other) || refines(other, one))
    }

    /// Pairs of simpler effects that together are equivalent to one effect of a set; each effect is returned with the
    /// loss of its pair.
    fn equivalent_pairs(
        &self,
        pick: &SelectedEffect,
        picks: &[SelectedEffect],
        others: &[SelectedEffect],
        in_place: impl Fn(&Self, &[SelectedEffect], &ScoredEffectSet) -> Option<f64>,
    ) -> Vec<(LocatedEffect, f64)> {
        // Simpler effects whose columns lie in the span of the effect.
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

    /// A set with a force signal fault or a body that is nearly as good, fitted again with columns at the estimated
    /// values.
    fn refit_at_size(&mut self, candidate: &SelectedEffect, tried: ScoredEffectSet, squares: f64) -> ScoredEffectSet {
        let source = &self.candidate(candidate).source;
        // Only these have columns that change with their estimates.
        let is_sized = matches!(source, ColumnSource::ReadingFault(_) | ColumnSource::Body(_));
        if !is_sized || tried.squares > SUBSTITUTE_MOST_RATIO * squares {
            return tried;
        }
        let refreshed = self.refresh_columns(tried.picks);
        self.fit_set(refreshed)
    }

    /// Whether all columns of one effect lie in the span of the base and of another effect; results are stored.
    pub(crate) fn is_in_span(&self, one: &SelectedEffect, other: &SelectedEffect) -> bool {
        // Span tests are repeated often, so their results are stored.
        let key = (one.columns.clone(), other.columns.clone());
        let known = self.span_cache.borrow().get(&key).copied();
        known.unwrap_or_else(|| {
            let found = self.is_in_conditional_span(one, other, &self.base_set);
            self.span_cache.borrow_mut().insert(key, found);
            found
        })
    }

    /// Whether all columns of one effect lie in the span of a set and of another effect.
    pub(crate) fn is_in_conditional_span(
        &self,
        one: &SelectedEffect,
        other: &SelectedEffect,
        beside: &ConditioningSet,
    ) -> bool {
        if one.columns == other.columns {
            return true;
        }
        // Forces of bodies on different channels may be equal after the base is projected out; friction forces are not.
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
