//! Linear algebra for the checks of a pose: rank and least squares of small dense matrices.

/// A dense matrix by rows.
pub(crate) type DenseRows = Vec<Vec<f64>>;

/// The numeric rank: number of pivots above `tolerance` times the largest entry, by elimination with full pivoting.
///
/// A matrix with entries that are not finite has rank zero.
pub(crate) fn rank(rows: &DenseRows, tolerance: f64) -> usize {
    let mut rows = rows.clone();
    let n_columns = rows.first().map_or(0, Vec::len);
    // The tolerance is relative to the largest entry.
    let largest = rows.iter().flatten().fold(0.0_f64, |most, entry| most.max(entry.abs()));
    if largest == 0.0 || !largest.is_finite() {
        return 0;
    }
    // Columns that have had a pivot.
    let mut used = vec![false; n_columns];
    let mut rank = 0;
    while rank < rows.len() {
        // The largest entry of the remaining rows and columns becomes the pivot.
        let mut pivot = (rank, 0, 0.0);
        for (i, row) in rows.iter().enumerate().skip(rank) {
            for (j, entry) in row.iter().enumerate() {
                if !used[j] && entry.abs() > pivot.2 {
                    pivot = (i, j, entry.abs());
                }
            }
        }
        let (i, j, size) = pivot;
        // All remaining entries are rounding, so the rank is reached.
        if size <= tolerance * largest {
            break;
        }
        rows.swap(rank, i);
        used[j] = true;
        let (done, rest) = rows.split_at_mut(rank + 1);
        let pivot_row = &done[rank];
        // Subtract multiples of the pivot row, so that its column becomes zero below.
        for row in rest {
            let factor = row[j] / pivot_row[j];
            if factor != 0.0 {
                for (entry, above) in row.iter_mut().zip(pivot_row) {
                    *entry -= factor * above;
                }
                row[j] = 0.0;
            }
        }
        rank += 1;
    }
    rank
}

/// Solves the normal equations `(J'J + damping I) x = J' r` by elimination; `None` if they are singular.
pub(crate) fn least_squares(jacobian: &DenseRows, residual: &[f64], damping: f64) -> Option<Vec<f64>> {
    let n = jacobian.first()?.len();
    // The matrix J'J with J'r as its last column.
    let mut matrix = vec![vec![0.0; n + 1]; n];
    for (row, r) in jacobian.iter().zip(residual) {
        for i in 0..n {
            if row[i] == 0.0 {
                continue;
            }
            for j in 0..n {
                matrix[i][j] += row[i] * row[j];
            }
            matrix[i][n] += row[i] * r;
        }
    }
    // Damping on the diagonal makes singular equations solvable.
    for (i, row) in matrix.iter_mut().enumerate() {
        row[i] += damping;
    }
    // Gaussian elimination with partial pivoting.
    for k in 0..n {
        // The largest entry of the column becomes the pivot.
        let best = (k..n).max_by(|&i, &j| matrix[i][k].abs().total_cmp(&matrix[j][k].abs()))?;
        if matrix[best][k] == 0.0 || !matrix[best][k].is_finite() {
            return None;
        }
        matrix.swap(k, best);
        let (done, rest) = matrix.split_at_mut(k + 1);
        for row in rest {
            let factor = row[k] / done[k][k];
            for (entry, above) in row.iter_mut().zip(&done[k]).skip(k) {
                *entry -= factor * above;
            }
        }
    }
    // Back substitution.
    let mut x = vec![0.0; n];
    for k in (0..n).rev() {
        let known: f64 = (k + 1..n).map(|j| matrix[k][j] * x[j]).sum();
        x[k] = (matrix[k][n] - known) / matrix[k][k];
    }
    // Overflow in the solution counts as singular.
    x.iter().all(|entry| entry.is_finite()).then_some(x)
}
