//! What a recording cannot tell apart: effects that, put in place of a found one, explain it as well.

use super::bench::{Bench, Pick, Trial, n_columns};
use super::beside::Beside;
use super::problem::{Effect, Source};

/// How much worse (twice the logarithm of the likelihood, with the samples that the residual is worth) a set may be and
/// still not be told from the best.
pub(crate) const APART: f64 = 9.0;
/// What stands in for an effect must take off this share of the squared error that the effect takes off.
const STANDS_IN: f64 = 0.8;
/// A wrong reading that leaves less than this factor is looked at with a column of its own size.
const CLOSE: f64 = 3.0;
/// What takes off less than this share of squares takes nothing off.
const NOTHING: f64 = 1e-6;

/// An effect that cannot be told from a found one.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Alias {
    pub(crate) effect: Effect,
    /// How much worse it is, in the units of [`APART`]; negative if better.
    pub(crate) worse: f64,
    /// Whether it is part of another way to write the same down, and no other cause.
    pub(crate) is_rewriting: bool,
}

impl Bench<'_> {
    /// For each effect of a set, what could stand in its place.
    pub(crate) fn aliases(&mut self, picks: &[Pick]) -> Vec<Vec<Alias>> {
        if self.problem.effects_only {
            return vec![Vec::new(); picks.len()];
        }
        self.weigh(picks);
        let (factors, squares) = self.fit(picks, super::pool::On::All);
        let rest = self.rest(picks, &factors);
        let mut all = Vec::new();
        let known = self.pool.len();
        for i in 0..picks.len() {
            let mut others = picks.to_vec();
            let pick = others.remove(i);
            self.present.fill(None);
            self.forget_since(known, []);
            self.look(&others);
            let beside = self.beside(&others);
            let channels: Vec<usize> = (0..rest.len()).collect();
            let worth = self.worth(&rest, &channels);
            let table = self.table(picks);
            // How much worse a set is in place of the found one, if it may stand for what the found one adds to `fewer`.
            let in_place = |bench: &Self, fewer: &[Pick], trial: &Trial| -> Option<f64> {
                let left = bench.try_in(&table, fewer.to_vec()).squares;
                let worse = worth * (trial.squares / squares.max(f64::MIN_POSITIVE)).ln();
                // What takes nothing off cannot be stood in for.
                let own = left - squares;
                let stands_in = own > NOTHING * left && left - trial.squares > STANDS_IN * own;
                (worse < APART && stands_in && trial.is_possible()).then_some(worse)
            };
            let mut found: Vec<Alias> = Vec::new();
            for candidate in self.present.clone().iter().flatten() {
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
                let more = self.is_within_beside(&pick, candidate, &beside);
                if more && candidate.rank > pick.rank {
                    continue; // It holds the found one and more, so that nothing speaks for it.
                }
                // A curve that is bent by a constant of its own comes near to any that is not.
                if self.candidate(candidate).searched > self.candidate(&pick).searched {
                    continue;
                }
                let mut set = others.clone();
                set.push(candidate.clone());
                let tried = self.try_in(&table, set);
                let trial = self.of_its_size(candidate, tried, squares);
                if let Some(worse) = in_place(self, &others, &trial) {
                    found.push(Alias {
                        effect: self.candidate(candidate).effect.clone(),
                        worse,
                        is_rewriting: false,
                    });
                }
            }
            // One effect may stand for two, as friction that differs by direction for friction and an offset.
            for j in 0..others.len() {
                let mut fewer = others.clone();
                let second = fewer.remove(j);
                for candidate in self.present.iter().flatten() {
                    let is_new = picks.iter().all(|p| p.candidate != candidate.candidate);
                    let size = n_columns(&[pick.clone(), second.clone()]);
                    if !is_new || candidate.columns.len() > size {
                        continue;
                    }
                    let mut set = fewer.clone();
                    set.push(candidate.clone());
                    let trial = self.try_in(&table, set);
                    let effect = &self.candidate(candidate).effect;
                    if let Some(worse) = in_place(self, &fewer, &trial)
                        && found.iter().all(|alias| alias.effect != *effect)
                    {
                        found.push(Alias {
                            effect: effect.clone(),
                            worse,
                            is_rewriting: self.is_within(&pick, candidate)
                                && self.is_within(&second, candidate),
                        });
                    }
                }
            }
            for (one, worse) in self.halves(&pick, picks, &others, in_place) {
                if found.iter().all(|alias| alias.effect != one) {
                    found.push(Alias {
                        effect: one,
                        worse,
                        is_rewriting: true,
                    });
                }
            }
            found.sort_by(|a, b| a.worse.total_cmp(&b.worse));
            all.push(found);
        }
        all
    }

    /// Pairs of simpler effects that say together what one of a set says, each with how much worse the pair is.
    fn halves(
        &self,
        pick: &Pick,
        picks: &[Pick],
        others: &[Pick],
        in_place: impl Fn(&Self, &[Pick], &Trial) -> Option<f64>,
    ) -> Vec<(Effect, f64)> {
        let halves: Vec<&Pick> = (self.present.iter().flatten())
            .filter(|one| one.rank < pick.rank && self.candidate(one).searched == 0)
            .filter(|one| picks.iter().all(|p| p.candidate != one.candidate))
            .filter(|one| self.is_within(one, pick))
            .collect();
        let mut found = Vec::new();
        for (k, one) in halves.iter().enumerate() {
            for two in &halves[k + 1..] {
                let mut set = others.to_vec();
                set.extend([(*one).clone(), (*two).clone()]);
                if let Some(worse) = in_place(self, others, &self.trial(set)) {
                    let both = [one, two].map(|half| (self.candidate(half).effect.clone(), worse));
                    found.extend(both);
                }
            }
        }
        found
    }

    /// A set with a wrong reading or a further body that comes near to what is found, by columns of its own size.
    fn of_its_size(&mut self, candidate: &Pick, tried: Trial, squares: f64) -> Trial {
        let source = &self.candidate(candidate).source;
        let is_sized = matches!(source, Source::Reading(_) | Source::Body(_));
        if !is_sized || tried.squares > CLOSE * squares {
            return tried;
        }
        let refreshed = self.refresh(tried.picks);
        self.trial(refreshed)
    }

    /// Whether all columns of one effect lie in the span of the base and another one.
    pub(crate) fn is_within(&self, one: &Pick, other: &Pick) -> bool {
        let key = (one.columns.clone(), other.columns.clone());
        let known = self.within.borrow().get(&key).copied();
        known.unwrap_or_else(|| {
            let found = self.is_within_beside(one, other, &self.alone);
            self.within.borrow_mut().insert(key, found);
            found
        })
    }

    /// Whether all columns of one effect lie in the span of a set and another one.
    pub(crate) fn is_within_beside(&self, one: &Pick, other: &Pick, beside: &Beside) -> bool {
        if one.columns == other.columns {
            return true;
        }
        // Bodies of other channels may be the same beside the base; friction is not.
        if !self.candidate(one).is_part_of_load {
            let reached = self.acted_on(std::slice::from_ref(other));
            let acted = self.acted_on(std::slice::from_ref(one));
            if acted.iter().any(|d| !reached.contains(d)) {
                return false;
            }
        }
        self.lies_within(&one.columns, &other.columns, beside)
    }
}
