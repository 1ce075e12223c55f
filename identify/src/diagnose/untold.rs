//! What recordings leave open: effects whose columns are all but combinations of those that the model and the found set have, so
//! that a force as large as the drive's own may be theirs or not. Neither a claim nor a denial is due to them; another motion
//! tells. What is such a combination along any motion is none of them, since the model says it already.

use nalgebra::{DMatrix, DVector};

use super::bench::{EffectSelector, SelectedEffect};
use super::pool::dot;
use super::problem::{CandidateNature, ColumnSource, LocatedEffect};

/// Samples that are looked at, at most.
const MOST: usize = 2000;
/// Shares of squares below this are rounding: the column is a combination of others along any motion.
const ROUNDING: f64 = 1e-18;

impl EffectSelector<'_> {
    /// Effects that may hide beside a set, which leaves `rest`.
    pub(crate) fn find_undetermined(
        &self,
        picks: &[SelectedEffect],
        rest: &[Vec<f64>],
    ) -> Vec<LocatedEffect> {
        let every = self.pool.all_samples().len().div_ceil(MOST).max(1);
        let mut basis: Vec<DVector<f64>> = Vec::new();
        for k in self.columns(picks) {
            let column = self.stacked_column(k, every);
            let left = project_out(&basis, &column);
            let size = left.norm();
            if size * size > ROUNDING * column.norm_squared() {
                basis.push(left / size);
            }
        }
        let mut untold = Vec::new();
        for (k, candidate) in self.problem.candidates.iter().enumerate() {
            let ColumnSource::Columns(choices) = &candidate.source else {
                continue;
            };
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
            let columns: Vec<DVector<f64>> = pick
                .columns
                .iter()
                .map(|k| self.stacked_column(*k, every))
                .collect();
            let Some(share) = least_share(&basis, &columns) else {
                continue;
            };
            let channels = self.affected_channels(&[pick]);
            let force: f64 = channels
                .iter()
                .map(|d| {
                    let force = self.problem.measured_force(*d);
                    self.weights[*d] * dot(&force, &force) / force.len().max(1) as f64
                })
                .sum();
            // The deviation of its own force, in units of what is left, against the force of the drives.
            if share > ROUNDING && self.effective_equations(rest, &channels) * share * force < 1.0 {
                untold.push(candidate.effect.clone());
            }
        }
        untold
    }

    /// A column of the pool along some samples, channels one after the other, each in units of what is left of it.
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

/// What orthonormal directions leave of a column; twice, so that rounding of the first time goes too.
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

/// The least share of squares that directions leave of any combination of some columns but for those that they say along any
/// motion; `None` where they say all.
fn least_share(basis: &[DVector<f64>], columns: &[DVector<f64>]) -> Option<f64> {
    let scaled: Vec<DVector<f64>> = (columns.iter())
        .filter(|column| column.norm() > 0.0)
        .map(|column| column / column.norm())
        .collect();
    if scaled.is_empty() {
        return None;
    }
    let own = DMatrix::from_columns(&scaled);
    let svd = own.svd(true, false);
    let u = svd.u?;
    let largest = svd.singular_values.max();
    let kept = (0..u.ncols()).filter(|k| svd.singular_values[*k] > 1e-6 * largest);
    let left: Vec<DVector<f64>> = kept
        .map(|k| project_out(basis, &u.column(k).into_owned()))
        .collect();
    let left = DMatrix::from_columns(&left);
    let shares = left.singular_values();
    let squares = shares
        .iter()
        .map(|s| s * s)
        .filter(|share| *share > ROUNDING);
    squares.min_by(f64::total_cmp)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Beside sine and cosine a sum of both says nothing, the same with a little of another wave says that little, and another
    /// wave says all.
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
