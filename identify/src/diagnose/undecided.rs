//! Effects that the recordings cannot decide: their columns are nearly combinations of those of the model and of the
//! effects found, so that a force as large as the drive's own may or may not belong to them. They are neither claimed
//! nor denied; another motion decides. Effects whose columns are such combinations along any motion are not listed,
//! since the model already contains them.

use nalgebra::{DMatrix, DVector};

use super::bench::{EffectSelector, SelectedEffect};
use super::problem::{CandidateNature, ColumnSource, LocatedEffect};
use super::thresholds::{UNDECIDED_LEAST_SHARE, UNDECIDED_MOST_VARIANCES};
use crate::signal::dot;

/// Largest number of samples that are used.
const MOST: usize = 2000;

impl EffectSelector<'_> {
    /// Effects that a set with the residual `rest` cannot decide. Only effects with one choice of columns at one place
    /// are considered.
    pub(crate) fn find_undecided(&self, picks: &[SelectedEffect], rest: &[Vec<f64>]) -> Vec<LocatedEffect> {
        // Use every n-th sample if there are many.
        let every = self.pool.all_samples().len().div_ceil(MOST).max(1);
        // Orthonormal basis of the columns of model and set (Gram-Schmidt); dependent columns are skipped.
        let mut basis: Vec<DVector<f64>> = Vec::new();
        for k in self.columns(picks) {
            let column = self.stacked_column(k, every);
            let left = project_out(&basis, &column);
            let size = left.norm();
            if size * size > UNDECIDED_LEAST_SHARE * column.norm_squared() {
                basis.push(left / size);
            }
        }
        let mut undecided = Vec::new();
        for (k, candidate) in self.problem.candidates.iter().enumerate() {
            let ColumnSource::Columns(choices) = &candidate.source else {
                continue;
            };
            // The same kind at the same place counts as found.
            let is_found = picks.iter().any(|pick| {
                let effect = &self.candidate(pick).effect;
                pick.candidate == k
                    || effect.at.iter().any(|at| candidate.effect.at.contains(at))
                        && effect.kind == candidate.effect.kind
            });
            let is_single = choices.len() == 1 && candidate.effect.at.len() == 1;
            if is_found || !is_single || candidate.nature != CandidateNature::Effect {
                continue;
            }
            let pick = self.select_choice(k, 0);
            let columns: Vec<DVector<f64>> = pick.columns.iter().map(|k| self.stacked_column(*k, every)).collect();
            // Share of the effect that the model and the set do not contain.
            let Some(share) = least_share(&basis, &columns) else {
                continue;
            };
            let channels = self.affected_channels(&[pick]);
            // Mean square of the drives' forces relative to the residual.
            let force: f64 = channels
                .iter()
                .map(|d| {
                    let force = self.problem.measured_force(*d);
                    self.weights[*d] * dot(&force, &force) / force.len().max(1) as f64
                })
                .sum();
            // Undecidable if the uncertainty of its force exceeds the force of the drives. The weights make both
            // relative to the residual.
            if share > UNDECIDED_LEAST_SHARE
                && self.effective_equations(rest, &channels) * share * force < UNDECIDED_MOST_VARIANCES
            {
                undecided.push(candidate.effect.clone());
            }
        }
        undecided
    }

    /// Every `every`-th sample of a column, channels one after the other, each divided by the standard deviation of its
    /// residual.
    fn stacked_column(&self, column: usize, every: usize) -> DVector<f64> {
        let n = self.pool.all_samples().len();
        let channels = self.pool.column(column).0.iter().zip(&self.weights);
        let values = channels.flat_map(|(values, weight)| {
            let at = move |i: usize| values.as_ref().map_or(0.0, |x| weight.sqrt() * x[i]);
            (0..n).step_by(every).map(at).collect::<Vec<f64>>()
        });
        DVector::from_vec(values.collect())
    }
}

/// Projects orthonormal directions out of a column; twice, to remove rounding errors of the first pass.
fn project_out(basis: &[DVector<f64>], column: &DVector<f64>) -> DVector<f64> {
    let mut left = column.clone();
    for _ in 0..2 {
        for direction in basis {
            let share = direction.dot(&left);
            left.axpy(-share, direction, 1.0);
        }
    }
    left
}

/// Least share of squares that remains after the projection, over all combinations of some columns. Combinations that
/// are determined along any motion are skipped; `None` if all are.
fn least_share(basis: &[DVector<f64>], columns: &[DVector<f64>]) -> Option<f64> {
    // Scale the columns, so that units do not matter.
    let scaled: Vec<DVector<f64>> = (columns.iter())
        .filter(|column| column.norm() > 0.0)
        .map(|column| column / column.norm())
        .collect();
    if scaled.is_empty() {
        return None;
    }
    // An orthonormal basis of the columns themselves.
    let own = DMatrix::from_columns(&scaled);
    let svd = own.svd(true, false);
    let u = svd.u?;
    let largest = svd.singular_values.max();
    // Independent directions of the columns.
    let kept = (0..u.ncols()).filter(|k| svd.singular_values[*k] > 1e-6 * largest);
    let left: Vec<DVector<f64>> = kept.map(|k| project_out(basis, &u.column(k).into_owned())).collect();
    let left = DMatrix::from_columns(&left);
    let shares = left.singular_values();
    let squares = shares
        .iter()
        .map(|s| s * s)
        .filter(|share| *share > UNDECIDED_LEAST_SHARE);
    squares.min_by(f64::total_cmp)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In addition to sine and cosine, a sum of both contains nothing new; with a small part of another wave it
    /// contains that part; another wave is new completely.
    #[test]
    fn what_is_left_of_columns_is_their_own() {
        let wave = |k: f64, phase: f64| {
            let n = 400;
            DVector::from_fn(n, |i, _| {
                (std::f64::consts::TAU * k * i as f64 / n as f64 + phase).sin()
            })
        };
        let base = [wave(1.0, 0.0), wave(1.0, 1.5)];
        let mut basis = Vec::new();
        for column in &base {
            let left = project_out(&basis, column);
            basis.push(&left / left.norm());
        }
        assert_eq!(least_share(&basis, &[wave(1.0, 0.7)]), None);
        let nearly = wave(1.0, 0.7) + 1e-4 * wave(3.0, 0.0);
        let share = least_share(&basis, &[nearly]).unwrap();
        assert!((share / 1e-8 - 1.0).abs() < 1e-3, "{share}");
        let share = least_share(&basis, &[wave(2.0, 0.3)]).unwrap();
        assert!((share - 1.0).abs() < 1e-9, "{share}");
    }
}
