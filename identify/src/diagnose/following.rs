//! Effects whose columns follow from the fit: a tilted base, late forces, a further body, a wrong number of the model, and
//! what depends on the load.
//!
//! Decision: the load of a drive comes from bodies and weight in the present fit, together with friction of every
//! drive, and is computed again as the fit changes. The measured force would not do: it holds the friction itself
//! and its noise, so that a column made of it would explain part of any error.

use std::collections::{HashMap, HashSet};

use nalgebra::DVector;

use super::bench::{Bench, Pick};
use super::column::Column;
use super::pool::{On, solve};
use super::problem::{Candidate, Carried, Source};

impl Bench<'_> {
    /// Candidates that depend on what the drives carry, with the columns that a fit gives them.
    pub(crate) fn carried(&mut self, picks: &[Pick]) -> HashMap<usize, Pick> {
        let is_carried = |c: &Candidate| matches!(c.source, Source::Carried);
        if !self.problem.candidates.iter().any(is_carried) {
            return HashMap::new();
        }
        let load = self.load(picks);
        self.rubbing_on(&load, Carried::All)
    }

    /// What the drives carry by a set's fit: masses and weight, and no friction.
    pub(crate) fn load(&self, picks: &[Pick]) -> Column {
        let mut which = self.columns(picks);
        let n = which.len();
        which.extend(&self.friction);
        which.push(self.measured);
        let (factors, _) = solve(&self.pool.gram(&which, &self.weights, On::All));
        let of_picks = picks.iter().flat_map(|pick| {
            let candidate = self.candidate(pick);
            pick.columns.iter().map(|_| candidate.is_part_of_load)
        });
        let is_part_of_load: Vec<bool> = (self.problem.base_is_part_of_load.iter().copied())
            .chain(of_picks)
            .collect();
        let parts = which[..n].iter().copied().zip(factors.iter().copied());
        let parts = parts.zip(is_part_of_load);
        self.sum(parts.filter_map(|(part, is_part_of_load)| is_part_of_load.then_some(part)))
    }

    /// The same where drives carry the other friction of the set too: which friction lies between load and drive no model says.
    fn load_with_friction(&self, picks: &[Pick]) -> Column {
        let (factors, _) = self.fit(picks, On::All);
        let is_own = picks.iter().flat_map(|pick| {
            let is_carried = matches!(self.candidate(pick).source, Source::Carried);
            pick.columns.iter().map(move |_| is_carried)
        });
        let is_own: Vec<bool> = (self.base.iter().map(|_| false)).chain(is_own).collect();
        let which = self.columns(picks);
        let parts = which.into_iter().zip(factors.iter().copied()).zip(is_own);
        self.sum(parts.filter_map(|(part, is_own)| (!is_own).then_some(part)))
    }

    /// The sum of some columns times factors and of what is held.
    fn sum(&self, parts: impl Iterator<Item = (usize, f64)>) -> Column {
        let mut sum = self.problem.held.clone().unwrap_or_default();
        sum.0.resize(self.weights.len(), None);
        for (k, factor) in parts {
            sum.add(factor, self.pool.column(k));
        }
        sum
    }

    /// Candidates that depend on what the drives carry.
    fn rubbing_on(&mut self, load: &Column, which: Carried) -> HashMap<usize, Pick> {
        let made = self.supply.carried(load, which);
        let picks = made.into_iter().map(|(candidate, choice)| {
            let pick = Pick {
                candidate,
                constants: choice.constants,
                rank: choice.columns.len(),
                columns: (choice.columns.into_iter())
                    .map(|c| self.pool.add(c))
                    .collect(),
            };
            (candidate, pick)
        });
        picks.collect()
    }

    /// Columns of a candidate that changes the model as fitted. What it was found to be so far, if it is among the picks,
    /// says where: the columns times the parameters are the change there.
    pub(crate) fn changed(
        &mut self,
        candidate: usize,
        picks: &[Pick],
        factors: &DVector<f64>,
    ) -> Pick {
        let mine = picks.iter().position(|pick| pick.candidate == candidate);
        let found = mine.map(|i| {
            let before: usize = picks[..i].iter().map(|p| p.columns.len()).sum();
            let start = self.base.len() + before;
            factors.as_slice()[start..start + picks[i].columns.len()].to_vec()
        });
        let columns: Vec<Column> = match &self.problem.candidates[candidate].source {
            Source::Tilt(tilt) => {
                let angles = found.unwrap_or_else(|| vec![0.0; tilt.axes.len()]);
                let along = tilt.components.each_ref().map(|component| {
                    let mut sum = component.held.clone();
                    sum.0.resize(self.weights.len(), None);
                    // Factors of the base come first, then those of effects, which do not tilt.
                    for (change, factor) in component.base.iter().zip(factors.iter()) {
                        sum.add(*factor, change);
                    }
                    sum
                });
                let directions = tilt.directions(&angles).into_iter();
                directions
                    .map(|direction| {
                        let mut sum = Column(vec![None; self.weights.len()]);
                        for (share, along) in direction.iter().zip(&along) {
                            sum.add(*share, along);
                        }
                        sum
                    })
                    .collect()
            }
            Source::Reading(reading) => {
                let mut force = self.problem.held.clone().unwrap_or_default();
                force.0.resize(self.weights.len(), None);
                let own = mine.map_or(&[][..], |i| &picks[i].columns);
                for (k, factor) in self.columns(picks).iter().zip(factors.iter()) {
                    if !own.contains(k) {
                        force.add(*factor, self.pool.column(*k));
                    }
                }
                vec![self.misread(*reading, &force, found.map_or(0.0, |value| value[0]))]
            }
            Source::Body(body) => {
                body.columns(found.map_or([0.0; 3], |values| body.centre(&values)))
            }
            Source::Constant(constant) => {
                let error = found.map_or(0.0, |values| values[0]);
                // Factors of the base come first.
                let base = &factors.as_slice()[..self.base.len()];
                vec![constant.column(error, base, self.weights.len())]
            }
            Source::Columns(_) | Source::Carried => unreachable!("they change no model"),
        };
        Pick {
            candidate,
            constants: Vec::new(),
            rank: columns.len(),
            columns: columns.into_iter().map(|c| self.pool.add(c)).collect(),
        }
    }

    /// A member that depends on what the drives carry, with or without friction as explains more; its constant stays.
    fn best_carried(&mut self, picks: &[Pick], member: usize) -> Option<Pick> {
        let candidate = picks[member].candidate;
        let value = picks[member].constants.first().map(|(_, value)| *value);
        let which = Carried::One(candidate, value);
        let loads = [self.load(picks), self.load_with_friction(picks)];
        let ways = loads.map(|load| self.rubbing_on(&load, which).remove(&candidate));
        let squares = |way: &Pick| {
            let mut set = picks.to_vec();
            set[member] = way.clone();
            self.fit(&set, On::All).1
        };
        let ways = ways.into_iter().flatten();
        ways.min_by(|a, b| squares(a).total_cmp(&squares(b)))
    }

    /// Makes the columns of effects that depend on the fit anew.
    pub(crate) fn refresh(&mut self, mut picks: Vec<Pick>) -> Vec<Pick> {
        let known = self.pool.len();
        for _ in 0..3 {
            for i in 0..picks.len() {
                let candidate = picks[i].candidate;
                if matches!(
                    self.problem.candidates[candidate].source,
                    Source::Columns(_)
                ) {
                    continue;
                }
                let (factors, _) = self.fit(&picks, On::All);
                let rank = picks[i].rank;
                let anew = match self.problem.candidates[candidate].source {
                    Source::Carried => self.best_carried(&picks, i),
                    _ => Some(self.changed(candidate, &picks.clone(), &factors)),
                };
                if let Some(anew) = anew {
                    picks[i] = Pick { rank, ..anew };
                }
            }
        }
        self.keep_only(known, &mut picks);
        picks
    }

    /// Forgets columns that were made since the pool had a length, but for those of a set.
    fn keep_only(&mut self, known: usize, picks: &mut [Pick]) {
        let added = self.pool.split_off(known);
        let is_known = |columns: &[usize]| columns.iter().all(|k| *k < known);
        (self.within.get_mut()).retain(|(one, other), _| is_known(one) && is_known(other));
        for k in picks.iter_mut().flat_map(|pick| &mut pick.columns) {
            if *k >= known {
                *k = self.pool.add(added[*k - known].clone());
            }
        }
    }

    /// Lets go of columns that were made since the pool had a length, but for those of some effects.
    pub(crate) fn forget_since<'p>(
        &mut self,
        known: usize,
        but: impl IntoIterator<Item = &'p Pick>,
    ) {
        let kept: HashSet<usize> = (but.into_iter())
            .flat_map(|pick| pick.columns.iter().copied())
            .collect();
        for k in (known..self.pool.len()).filter(|k| !kept.contains(k)) {
            self.pool.forget(k);
        }
    }
}
