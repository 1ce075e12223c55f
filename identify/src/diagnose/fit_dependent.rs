//! Effects whose columns depend on the fit: a tilted base, faulty force signals, an additional body, a wrong constant
//! of the model, and load-dependent effects.
//!
//! Decision: the load of a drive is computed from bodies and weight in the present fit, which also contains friction of
//! every drive, and is computed again as the fit changes. The measured force would not do: it contains the friction
//! itself and its noise, so that a column computed from it would explain part of any error.

use std::collections::{HashMap, HashSet};

use nalgebra::DVector;

use super::bench::{EffectSelector, SelectedEffect};
use super::column::ForceColumn;
use super::pool::{FitScope, solve_gram};
use super::problem::{CandidateEffect, ColumnSource, LoadDependentQuery};

impl EffectSelector<'_> {
    /// Load-dependent candidates by index, with the columns for the load of a set's fit.
    pub(crate) fn load_dependent_effects(&mut self, picks: &[SelectedEffect]) -> HashMap<usize, SelectedEffect> {
        // Without load-dependent candidates the load is not needed.
        let is_carried = |c: &CandidateEffect| matches!(c.source, ColumnSource::LoadDependent);
        if !self.problem.candidates.iter().any(is_carried) {
            return HashMap::new();
        }
        let load = self.load(picks);
        self.load_friction_effects(&load, LoadDependentQuery::All)
    }

    /// Load of each drive from the fit of a set: forces of masses and weight, without friction.
    pub(crate) fn load(&self, picks: &[SelectedEffect]) -> ForceColumn {
        let mut which = self.columns(picks);
        let n = which.len();
        which.extend(&self.friction);
        which.push(self.measured);
        // Friction of every drive takes part in the fit, so that it does not appear as load.
        let (factors, _) = solve_gram(&self.pool.gram(&which, &self.weights, FitScope::All));
        // Whether each column of the set belongs to the load.
        let of_picks = picks.iter().flat_map(|pick| {
            let candidate = self.candidate(pick);
            pick.columns.iter().map(|_| candidate.is_part_of_load)
        });
        // Masses and weight count, of the model as well as of the set.
        let is_part_of_load: Vec<bool> = (self.problem.base_is_part_of_load.iter().copied())
            .chain(of_picks)
            .collect();
        // Columns with their factors; friction of the drives behind them is dropped.
        let parts = which[..n].iter().copied().zip(factors.iter().copied());
        let parts = parts.zip(is_part_of_load);
        self.sum_columns(parts.filter_map(|(part, is_part_of_load)| is_part_of_load.then_some(part)))
    }

    /// The same with the other friction of the set included: no model states which friction lies between load and
    /// drive.
    fn load_with_friction(&self, picks: &[SelectedEffect]) -> ForceColumn {
        let (factors, _) = self.fit(picks, FitScope::All);
        // The load-dependent effects themselves are not part of their own load.
        let is_own = picks.iter().flat_map(|pick| {
            let is_carried = matches!(self.candidate(pick).source, ColumnSource::LoadDependent);
            pick.columns.iter().map(move |_| is_carried)
        });
        let is_own: Vec<bool> = (self.base.iter().map(|_| false)).chain(is_own).collect();
        let which = self.columns(picks);
        let parts = which.into_iter().zip(factors.iter().copied()).zip(is_own);
        self.sum_columns(parts.filter_map(|(part, is_own)| (!is_own).then_some(part)))
    }

    /// Sum of some columns times factors and of the forces of fixed parameters.
    fn sum_columns(&self, parts: impl Iterator<Item = (usize, f64)>) -> ForceColumn {
        // Forces of fixed parameters are part of every load.
        let mut sum = self.problem.fixed_forces.clone().unwrap_or_default();
        sum.0.resize(self.weights.len(), None);
        let parts: Vec<(f64, &ForceColumn)> = parts.map(|(k, factor)| (factor, self.pool.column(k))).collect();
        sum.add_all(&parts);
        sum
    }

    /// The force that acts in the fit of a set, without some of its columns. `factors` belong to base and picks.
    pub(crate) fn fitted_force(
        &self,
        picks: &[SelectedEffect],
        factors: &DVector<f64>,
        without: &[usize],
    ) -> ForceColumn {
        let parts = self.columns(picks).into_iter().zip(factors.iter().copied());
        self.sum_columns(parts.filter(|(k, _)| !without.contains(k)))
    }

    /// Load-dependent candidates by index, with columns for a load, added to the pool.
    fn load_friction_effects(
        &mut self,
        load: &ForceColumn,
        which: LoadDependentQuery,
    ) -> HashMap<usize, SelectedEffect> {
        // New columns enter the pool and stay there until they are released.
        let made = self.provider.load_dependent_columns(load, which);
        let picks = made.into_iter().map(|(candidate, choice)| {
            let pick = SelectedEffect {
                candidate,
                constants: choice.constants,
                rank: choice.columns.len(),
                columns: (choice.columns.into_iter()).map(|c| self.pool.add(c)).collect(),
            };
            (candidate, pick)
        });
        picks.collect()
    }

    /// Columns of a candidate that changes the fitted model. If it is among the picks, they are linearised at its
    /// present estimates: columns times parameters are the change there. `factors` belong to base and picks; `fitted` is
    /// their force, if it is known.
    pub(crate) fn linearise_model_change(
        &mut self,
        candidate: usize,
        picks: &[SelectedEffect],
        factors: &DVector<f64>,
        fitted: Option<&ForceColumn>,
    ) -> SelectedEffect {
        // Present estimates of the candidate.
        let mine = picks.iter().position(|pick| pick.candidate == candidate);
        let found = mine.map(|i| {
            // Position of the candidate's factors behind those of the base and earlier picks.
            let before: usize = picks[..i].iter().map(|p| p.columns.len()).sum();
            let start = self.base.len() + before;
            factors.as_slice()[start..start + picks[i].columns.len()].to_vec()
        });
        let columns: Vec<ForceColumn> = match &self.problem.candidates[candidate].source {
            // Tilt: derivatives with respect to gravity, combined along the directions in which it rotates.
            ColumnSource::Tilt(tilt) => {
                // Forces per component of gravity, then along the directions in which gravity rotates.
                let angles = found.unwrap_or_else(|| vec![0.0; tilt.axes.len()]);
                // Change of the forces with each component of gravity.
                let along = tilt.components.each_ref().map(|component| {
                    let mut sum = component.fixed.clone();
                    sum.0.resize(self.weights.len(), None);
                    // Factors of the base come first, then those of effects, which do not depend on the tilt.
                    let parts = factors.iter().copied().zip(&component.base);
                    sum.add_all(&parts.collect::<Vec<_>>());
                    sum
                });
                let directions = tilt.directions(&angles).into_iter();
                directions
                    .map(|direction| {
                        let mut sum = ForceColumn(vec![None; self.weights.len()]);
                        for (share, along) in direction.iter().zip(&along) {
                            sum.add(*share, along);
                        }
                        sum
                    })
                    .collect()
            }
            // Sensor fault: computed from the fitted force without the column of the fault itself.
            ColumnSource::ReadingFault(reading) => {
                // The force that acts: the fitted force without the part that the fault itself explains.
                let own = mine.map_or(&[][..], |i| &picks[i].columns);
                let anew;
                let force = match fitted.filter(|_| own.is_empty()) {
                    Some(fitted) => fitted,
                    None => {
                        anew = self.fitted_force(picks, factors, own);
                        &anew
                    }
                };
                vec![self.reading_fault_column(*reading, force, found.map_or(0.0, |value| value[0]))]
            }
            // Body: derivatives at the estimated centre.
            ColumnSource::Body(body) => body.columns(found.map_or([0.0; 3], |values| body.centre(&values))),
            // Constant: secant between no error and the estimated error.
            ColumnSource::Constant(constant) => {
                // Without an estimate yet, the derivative is used.
                let error = found.map_or(0.0, |values| values[0]);
                // The derivatives are those of the base columns, whose factors come first.
                let base = &factors.as_slice()[..self.base.len()];
                vec![constant.secant_column(error, base, self.weights.len())]
            }
            ColumnSource::Columns(_) | ColumnSource::LoadDependent => {
                unreachable!("they change no model")
            }
        };
        SelectedEffect {
            candidate,
            constants: Vec::new(),
            rank: columns.len(),
            columns: columns.into_iter().map(|c| self.pool.add(c)).collect(),
        }
    }

    /// A load-dependent member, with or without friction in the load, whichever explains more; its constant stays.
    fn best_load_dependent(&mut self, picks: &[SelectedEffect], member: usize) -> Option<SelectedEffect> {
        let candidate = picks[member].candidate;
        let value = picks[member].constants.first().map(|(_, value)| *value);
        let which = LoadDependentQuery::One(candidate, value);
        // Columns for both definitions of the load; the better one is kept.
        let loads = [self.load(picks), self.load_with_friction(picks)];
        // Columns for each definition of the load.
        let ways = loads.map(|load| self.load_friction_effects(&load, which).remove(&candidate));
        // Squared residual of the set with these columns.
        let squares = |way: &SelectedEffect| {
            let mut set = picks.to_vec();
            set[member] = way.clone();
            self.fit(&set, FitScope::All).1
        };
        let ways = ways.into_iter().flatten();
        ways.min_by(|a, b| squares(a).total_cmp(&squares(b)))
    }

    /// Computes the columns that depend on the fit again; three rounds, since each fit changes them a little.
    pub(crate) fn refresh_columns(&mut self, mut picks: Vec<SelectedEffect>) -> Vec<SelectedEffect> {
        let known = self.pool.len();
        for _ in 0..3 {
            for i in 0..picks.len() {
                let candidate = picks[i].candidate;
                if matches!(self.problem.candidates[candidate].source, ColumnSource::Columns(_)) {
                    continue;
                }
                // Later members use the new columns of earlier ones.
                let (factors, _) = self.fit(&picks, FitScope::All);
                let rank = picks[i].rank;
                // The rank stays, since the columns change only slightly.
                let anew = match self.problem.candidates[candidate].source {
                    ColumnSource::LoadDependent => self.best_load_dependent(&picks, i),
                    _ => Some(self.linearise_model_change(candidate, &picks.clone(), &factors, None)),
                };
                if let Some(anew) = anew {
                    picks[i] = SelectedEffect { rank, ..anew };
                }
            }
        }
        self.drop_other_columns(known, &mut picks);
        picks
    }

    /// Removes the columns that were added from an index on, except those of a set, which get new indices.
    fn drop_other_columns(&mut self, known: usize, picks: &mut [SelectedEffect]) {
        // Span tests with removed columns are no longer valid.
        let added = self.pool.split_off(known);
        let is_known = |columns: &[usize]| columns.iter().all(|k| *k < known);
        (self.span_cache.get_mut()).retain(|(one, other), _| is_known(one) && is_known(other));
        // Columns of the set are added again behind the known ones.
        for k in picks.iter_mut().flat_map(|pick| &mut pick.columns) {
            if *k >= known {
                *k = self.pool.add(added[*k - known].clone());
            }
        }
    }

    /// Releases the columns that were added from an index on, except those of some effects; indices do not change.
    pub(crate) fn drop_columns_since<'p>(&mut self, known: usize, but: impl IntoIterator<Item = &'p SelectedEffect>) {
        // Indices that must stay valid.
        let kept: HashSet<usize> = (but.into_iter())
            .flat_map(|pick| pick.columns.iter().copied())
            .collect();
        for k in (known..self.pool.len()).filter(|k| !kept.contains(k)) {
            self.pool.release_column(k);
        }
    }
}
