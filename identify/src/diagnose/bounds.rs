//! Lower bounds of the residual of a set, without a fit: of a million sets only those are fitted that may be among the
//! best.

use nalgebra::DMatrix;

use super::bench::{EffectSelector, ProjectedGram, SelectedEffect};
use super::factored::GramFactor;
use super::problem::{ColumnSource, SignConstraint};

/// Largest number of added columns; with more the bound is zero.
const MOST: usize = 7;
/// An added column explains nothing if less than this share of its squares remains after the projection on the others.
/// The limit is lower than that of fits, so that the bound stays a lower bound.
const NEGLIGIBLE_SHARE: f64 = 1e-12;
/// Rounding error of squares, relative to those of the residual of the set.
const ROUNDING: f64 = 1e-9;

/// A fitted set, prepared for bounds on the residual with further effects.
pub(crate) struct ExtensionBound<'a> {
    /// Inner products of all columns, with the base projected out.
    table: &'a ProjectedGram,
    /// What the set explains: `L^-1 c` for the products `c` of each column of the table with the set, as columns.
    halves: DMatrix<f64>,
    /// Squared residual of the set.
    squares: f64,
    /// Least number of estimated values in the set.
    freedoms: usize,
}

impl EffectSelector<'_> {
    /// Prepares a set; the table must contain its columns and those that may be added.
    pub(crate) fn extension_bound<'a>(&self, table: &'a ProjectedGram, set: &[SelectedEffect]) -> ExtensionBound<'a> {
        let columns = set.iter().flat_map(|pick| &pick.columns);
        let places: Vec<usize> = columns.map(|k| table.row_of_column[*k]).collect();
        let n = places.len();
        let own = DMatrix::from_fn(n, n, |i, j| table.gram[(places[i], places[j])]);
        // Cholesky factor of the set's own products; it projects the set out of every other column.
        let factor = GramFactor::new(&own);
        let with = DMatrix::from_fn(n, table.gram.nrows(), |i, j| table.gram[(places[i], j)]);
        let halves = factor.forward_substitute(&with);
        let mut beyond = ExtensionBound {
            table,
            halves,
            squares: 0.0,
            freedoms: set.iter().map(|pick| self.fewest_freedoms(pick)).sum(),
        };
        let measured = beyond.measured_index();
        beyond.squares = beyond.product(measured, measured);
        beyond
    }

    /// Lower bound of the criterion of a set with further effects, with `worth` independent equations.
    pub(crate) fn least_criterion(&self, beyond: &ExtensionBound<'_>, further: &[&SelectedEffect], worth: f64) -> f64 {
        let squares = beyond.least_squares(further.iter().flat_map(|pick| &pick.columns));
        let more: usize = further.iter().map(|pick| self.fewest_freedoms(pick)).sum();
        let freedoms = (beyond.freedoms + more) as f64;
        worth * squares.max(f64::MIN_POSITIVE).ln() + freedoms * worth.ln().max(1.0)
    }

    /// Least number of estimated values in an effect: parameters with the wrong sign may be set to zero.
    fn fewest_freedoms(&self, pick: &SelectedEffect) -> usize {
        let candidate = self.candidate(pick);
        let has_sign = candidate.parameters.iter().any(|p| p.sign != SignConstraint::Any);
        let is_body = matches!(candidate.source, ColumnSource::Body(_));
        let may_lose = candidate.refines.is_none() && candidate.searched_constants == 0;
        // One estimated number is the least that remains.
        if may_lose && (has_sign || is_body) {
            pick.rank.min(1)
        } else {
            self.freedoms(pick)
        }
    }
}

impl ExtensionBound<'_> {
    /// Row of the measured forces in the table.
    fn measured_index(&self) -> usize {
        self.table.gram.nrows() - 1
    }

    /// Inner product of two columns of the table with the set projected out.
    fn product(&self, a: usize, b: usize) -> f64 {
        let n = self.halves.nrows();
        let [one, two] = [a, b].map(|k| &self.halves.as_slice()[k * n..(k + 1) * n]);
        let known: f64 = one.iter().zip(two).map(|(x, y)| x * y).sum();
        self.table.gram[(a, b)] - known
    }

    /// Lower bound of the squared residual of the set with further columns, which may take any sign.
    fn least_squares<'k>(&self, columns: impl Iterator<Item = &'k usize>) -> f64 {
        let mut places = [self.measured_index(); MOST + 1];
        let mut n = 0;
        for k in columns {
            // Too many columns: zero is a valid bound.
            if n == MOST {
                return 0.0;
            }
            places[n] = self.table.row_of_column[*k];
            n += 1;
        }
        places[n] = self.measured_index();
        // Products of the added columns and the measured forces, with the set projected out.
        let mut left = [[0.0; MOST + 1]; MOST + 1];
        for i in 0..=n {
            for j in 0..=i {
                left[i][j] = self.product(places[i], places[j]);
            }
        }
        // Gaussian elimination of the added columns; the last diagonal entry is the squared residual.
        for i in 0..n {
            let own = self.table.gram[(places[i], places[i])];
            // A dependent column explains nothing more.
            if left[i][i] <= NEGLIGIBLE_SHARE * own {
                continue;
            }
            for j in i + 1..=n {
                let share = left[j][i] / left[i][i];
                for k in i + 1..=j {
                    left[j][k] -= share * left[k][i];
                }
            }
        }
        left[n][n] - ROUNDING * self.squares
    }
}

#[cfg(test)]
mod tests {
    use super::super::column::ForceColumn;
    use super::super::criterion::criterion;
    use super::super::problem::{
        CandidateEffect, CandidateNature, ColumnChoice, DiagnosisProblem, EffectParameter, LocatedEffect,
        NoColumnProvider, SampleLayout, SampleSegment,
    };
    use super::*;

    const SAMPLES: u32 = 200;

    /// Two columns for every third candidate, one for the others; some are nearly the same, and some have a sign.
    fn candidate(k: u32) -> CandidateEffect {
        let wave = |rate: f64, phase: f64| -> Option<Vec<f64>> {
            let at = |i: u32| (rate * f64::from(i) + phase).sin();
            Some((0..SAMPLES).map(at).collect())
        };
        let rate = 0.05 + 0.03 * f64::from(k / 2) + 1e-6 * f64::from(k);
        let mut columns = vec![ForceColumn(vec![wave(rate, 0.3)])];
        if k.is_multiple_of(3) {
            columns.push(ForceColumn(vec![wave(1.7 * rate, 1.1)]));
        }
        let sign = [SignConstraint::Any, SignConstraint::Positive][k as usize % 2];
        let parameter = |symbol: usize| EffectParameter {
            symbol: format!("p{symbol}"),
            unit: String::new(),
            sign,
        };
        CandidateEffect {
            effect: LocatedEffect {
                kind: format!("kind{k}"),
                at: vec!["drive".into()],
            },
            parameters: (0..columns.len()).map(parameter).collect(),
            searched_constants: 0,
            is_part_of_load: false,
            refines: None,
            nature: CandidateNature::Effect,
            is_per_run: false,
            source: ColumnSource::Columns(vec![ColumnChoice {
                constants: Vec::new(),
                columns,
            }]),
        }
    }

    /// What is passed over is worse than the bound that it is passed over for: the bound is never above the criterion,
    /// and near it where no sign matters.
    #[test]
    fn no_set_is_better_than_its_bound() {
        let value = |i: u32| (0.09 * f64::from(i)).sin() - 0.4 * (0.31 * f64::from(i)).cos();
        let measured = (0..SAMPLES).map(value).collect();
        let problem = DiagnosisProblem {
            layout: SampleLayout {
                channels: vec!["drive".into()],
                segments: vec![SampleSegment {
                    name: String::new(),
                    samples: SAMPLES as usize,
                    start: 0.0,
                    step: 0.1,
                    recorded_step: 0.1,
                    is_check: false,
                }],
                left_out: Vec::new(),
            },
            measured: ForceColumn(vec![Some(measured)]),
            noise: vec![1e-3],
            candidates: (0..12).map(candidate).collect(),
            ..DiagnosisProblem::default()
        };
        let mut bench = EffectSelector::new(&problem, &NoColumnProvider);
        bench.update_choices(&[]);
        let present: Vec<SelectedEffect> = bench.current_choices.iter().flatten().cloned().collect();
        let table = bench.projected_gram(&[]);
        let worth = 100.0;
        let mut near = 0;
        for n in 0..4 {
            let set = &present[..n];
            let beyond = bench.extension_bound(&table, set);
            for (i, one) in present.iter().enumerate().skip(n) {
                for two in &present[i + 1..] {
                    let least = bench.least_criterion(&beyond, &[one, two], worth);
                    let mut picks = set.to_vec();
                    picks.extend([one.clone(), two.clone()]);
                    let trial = bench.fit_from_gram(&table, picks);
                    let own = criterion(&problem, &trial, worth);
                    assert!(least <= own, "{n}, {i}: {least} above {own}");
                    near += usize::from(trial.is_possible() && own - least < 1.0);
                }
            }
        }
        assert!(near > 20, "{near} bounds are near");
    }
}
