//! Undetermined directions. Input: a null space; output: sparse, readable directions.

use nalgebra::DMatrix;

use crate::estimate::thresholds::PARTICIPATION_TOLERANCE;
use crate::words::with_digits;

/// A change of the parameters that changes no row of the regressor.
#[derive(Debug, Clone, PartialEq)]
pub struct NullDirection {
    /// `(parameter, change)`; the first has change 1, the others are ordered by parameter.
    pub changes: Vec<(usize, f64)>,
}

impl NullDirection {
    /// One sentence with the parameters' names; a parameter without a name is called `#index`.
    pub fn describe(&self, names: &[String]) -> String {
        let name = |i: usize| names.get(i).cloned().unwrap_or_else(|| format!("#{i}"));
        let list: Vec<String> = self.changes.iter().map(|(i, _)| name(*i)).collect();
        match list.as_slice() {
            [] => String::new(),
            [alone] => format!("{alone} has no effect on these samples"),
            [others @ .., last] => {
                let changes: Vec<String> = self
                    .changes
                    .iter()
                    .map(|(i, change)| {
                        let sign = if *change < 0.0 { '-' } else { '+' };
                        format!("{} {sign} {}", name(*i), with_digits(change.abs(), 4))
                    })
                    .collect();
                format!(
                    "only a combination of {} and {last} is determined: {} changes nothing",
                    others.join(", "),
                    changes.join(" with ")
                )
            }
        }
    }
}

/// Whether each parameter is outside of all null vectors, and a sparse basis of the null space.
///
/// `null_space` has one unit vector per row, in columns scaled by `norms`. Elimination with complete pivoting makes
/// each direction start with a parameter that no other direction contains.
pub(crate) fn null_directions(null_space: &DMatrix<f64>, norms: &[f64]) -> (Vec<bool>, Vec<NullDirection>) {
    let n = norms.len();
    let determined = (0..n)
        .map(|j| null_space.column(j).norm() <= PARTICIPATION_TOLERANCE)
        .collect();
    let mut basis = null_space.clone();
    let mut pivots: Vec<usize> = Vec::new();
    for step in 0..basis.nrows() {
        let mut best = (0.0, step, 0);
        for i in step..basis.nrows() {
            for j in 0..n {
                // Of entries that are equal up to rounding, the first is the pivot.
                if basis[(i, j)].abs() > best.0 * (1.0 + 1e-9) {
                    best = (basis[(i, j)].abs(), i, j);
                }
            }
        }
        let (size, row, column) = best;
        if size <= PARTICIPATION_TOLERANCE {
            break;
        }
        // Scale the pivot row and remove its parameter from all other rows.
        basis.swap_rows(step, row);
        let pivot = basis[(step, column)];
        basis.row_mut(step).unscale_mut(pivot);
        for i in (0..basis.nrows()).filter(|i| *i != step) {
            let factor = basis[(i, column)];
            for j in 0..n {
                basis[(i, j)] -= factor * basis[(step, j)];
            }
        }
        pivots.push(column);
    }
    // Undo the scaling of the columns.
    let directions = pivots
        .iter()
        .enumerate()
        .map(|(i, &pivot)| {
            let others = (0..n)
                .filter(|&j| j != pivot && basis[(i, j)].abs() > PARTICIPATION_TOLERANCE)
                .map(|j| (j, basis[(i, j)] * norms[pivot] / norms[j]));
            NullDirection {
                changes: std::iter::once((pivot, 1.0)).chain(others).collect(),
            }
        })
        .collect();
    (determined, directions)
}
