//! A run as additive statistics of its rows: normal equations that are summed over blocks and runs.
//!
//! Decision: fits of any columns, omitted blocks, single runs, all runs and segments all come from the same inner
//! products. A run of any length is a matrix of some 200 columns.

use nalgebra::{DMatrix, DVector};

use crate::changes::thresholds::{CHANGE_INDEPENDENCE_TOLERANCE, WEAK_DEPENDENCE};

/// Inner products of all columns of a least-squares problem among themselves and with the measured values.
#[derive(Clone, Debug, PartialEq)]
pub struct NormalEquations {
    /// `Z' Z`, symmetric.
    pub gram: DMatrix<f64>,
    /// `Z' y`.
    pub rhs: DVector<f64>,
    /// `y' y`.
    pub total: f64,
    /// Number of rows.
    pub rows: usize,
}

/// A least-squares solution for some of the columns.
#[derive(Clone, Debug, PartialEq)]
pub struct NormalSolution {
    /// One value per column; 0 for a column that is a combination of those before it.
    pub values: DVector<f64>,
    /// `(Z' Z)^-1`: the covariance of the values if rows have variance 1; 0 where a value is fixed at 0.
    pub covariance: DMatrix<f64>,
    /// Which values are determined individually, and not only in combination with others.
    pub determined: Vec<bool>,
    /// Squared residual `|y - Z x|^2`.
    pub residual_squares: f64,
    /// Number of independent columns.
    pub rank: usize,
    /// Which columns these are; of several dependent columns the first.
    pub independent: Vec<bool>,
}

impl NormalEquations {
    /// Normal equations without rows.
    pub fn new(columns: usize) -> Self {
        Self {
            gram: DMatrix::zeros(columns, columns),
            rhs: DVector::zeros(columns),
            total: 0.0,
            rows: 0,
        }
    }

    /// Adds rows given by columns, `z[column][row]` with `None` for a column of zeros, and the measured values.
    pub fn add_rows(&mut self, z: &[Option<&[f64]>], y: &[f64]) {
        // Columns of zeros add nothing, so only the others are multiplied.
        let moving: Vec<(usize, &[f64])> = (z.iter().enumerate())
            .filter_map(|(k, column)| Some((k, (*column)?)))
            .collect();
        let mut rows = DMatrix::zeros(y.len(), moving.len() + 1);
        for (j, (_, column)) in moving.iter().enumerate() {
            rows.column_mut(j).copy_from_slice(column);
        }
        rows.column_mut(moving.len()).copy_from_slice(y);
        let products = rows.transpose() * &rows;
        for (i, (a, _)) in moving.iter().enumerate() {
            for (j, (b, _)) in moving.iter().enumerate() {
                self.gram[(*a, *b)] += products[(i, j)];
            }
            self.rhs[*a] += products[(i, moving.len())];
        }
        self.total += products[(moving.len(), moving.len())];
        self.rows += y.len();
    }

    /// Adds the rows of other normal equations with the same columns.
    pub fn merge(&mut self, other: &Self) {
        self.gram += &other.gram;
        self.rhs += &other.rhs;
        self.total += other.total;
        self.rows += other.rows;
    }

    /// The same with all rows multiplied by the root of a weight.
    #[must_use]
    pub fn scale_weight(&self, weight: f64) -> Self {
        Self {
            gram: &self.gram * weight,
            rhs: &self.rhs * weight,
            total: self.total * weight,
            rows: self.rows,
        }
    }

    /// The same for some of the columns.
    #[must_use]
    pub fn select_columns(&self, columns: &[usize]) -> Self {
        Self {
            gram: DMatrix::from_fn(columns.len(), columns.len(), |i, j| self.gram[(columns[i], columns[j])]),
            rhs: DVector::from_fn(columns.len(), |i, _| self.rhs[columns[i]]),
            total: self.total,
            rows: self.rows,
        }
    }

    /// `|y - Z x|^2` for given values.
    pub fn residual_squares(&self, x: &DVector<f64>) -> f64 {
        (self.total - 2.0 * self.rhs.dot(x) + x.dot(&(&self.gram * x))).max(0.0)
    }

    /// The columns from `fitted` on, with those before them eliminated.
    pub(crate) fn schur_complement(&self, fitted: usize) -> SchurComplement {
        let (mut table, scale) = self.scaled_equations();
        for k in 0..fitted {
            sweep(&mut table, k);
        }
        let n = table.nrows() - fitted;
        SchurComplement {
            scale: scale.rows(fitted, n - 1).into_owned(),
            table: table.view((fitted, fitted), (n, n)).into_owned(),
        }
    }

    /// Eliminates the first columns. Returns the normal equations of the others, and the first values as functions of
    /// the others.
    pub(crate) fn eliminate(&self, first: usize) -> (Self, EliminatedValues) {
        let (mut table, scale) = self.scaled_equations();
        let n = self.rhs.len();
        let kept: Vec<bool> = (0..first).map(|k| sweep(&mut table, k)).collect();
        let others = n - first;
        let left = Self {
            gram: DMatrix::from_fn(others, others, |i, j| {
                let (i, j) = (first + i, first + j);
                table[(i, j)] * scale[i] * scale[j]
            }),
            rhs: DVector::from_fn(others, |i, _| table[(first + i, n)] * scale[first + i]),
            total: table[(n, n)].max(0.0),
            rows: self.rows,
        };
        // Undo the scaling; dependent columns have the value 0.
        let of = |i: usize, x: f64| {
            if kept[i] { divide_by_scale(x, scale[i]) } else { 0.0 }
        };
        let eliminated = EliminatedValues {
            offset: DVector::from_fn(first, |i, _| of(i, table[(i, n)])),
            coefficients: DMatrix::from_fn(first, others, |i, j| of(i, table[(i, first + j)]) * scale[first + j]),
            covariance: DMatrix::from_fn(first, first, |i, j| {
                if kept[j] {
                    divide_by_scale(of(i, table[(i, j)]), scale[j])
                } else {
                    0.0
                }
            }),
            determined: (0..first)
                .map(|i| {
                    // A fixed column that depends on this one makes it undetermined.
                    let is_free = |k: usize| kept[k] || scale[k] == 0.0 || table[(k, i)].abs() < WEAK_DEPENDENCE;
                    kept[i] && (0..first).all(is_free)
                })
                .collect(),
            depends_on: (0..first)
                .map(|i| (first..n).map(|j| table[(i, j)].abs() > WEAK_DEPENDENCE).collect())
                .collect(),
            rank: kept.iter().filter(|kept| **kept).count(),
        };
        (left, eliminated)
    }

    /// The normal equations with columns scaled to norm 1, and these norms. The last row and column belong to the
    /// measured values.
    fn scaled_equations(&self) -> (DMatrix<f64>, DVector<f64>) {
        let n = self.rhs.len();
        let scale = DVector::from_fn(n, |i, _| self.gram[(i, i)].sqrt());
        let table = DMatrix::from_fn(n + 1, n + 1, |i, j| match (i < n, j < n) {
            (true, true) => divide_by_scale(divide_by_scale(self.gram[(i, j)], scale[i]), scale[j]),
            (true, false) => divide_by_scale(self.rhs[i], scale[i]),
            (false, true) => divide_by_scale(self.rhs[j], scale[j]),
            (false, false) => self.total,
        });
        (table, scale)
    }

    /// Least squares solution for all columns, by sweeps of the scaled normal equations; dependent columns are fixed at
    /// 0.
    pub fn solve(&self) -> NormalSolution {
        let n = self.rhs.len();
        let (mut table, scale) = self.scaled_equations();
        let kept: Vec<bool> = (0..n).map(|k| sweep(&mut table, k)).collect();
        let value = |x: f64, i: usize| {
            if kept[i] { divide_by_scale(x, scale[i]) } else { 0.0 }
        };
        // A column that was fixed is a combination of kept ones, which therefore are not determined.
        let determined =
            |i: usize| kept[i] && (0..n).all(|k| kept[k] || scale[k] == 0.0 || table[(k, i)].abs() < WEAK_DEPENDENCE);
        NormalSolution {
            values: DVector::from_fn(n, |i, _| value(table[(i, n)], i)),
            covariance: DMatrix::from_fn(n, n, |i, j| {
                if kept[j] {
                    divide_by_scale(value(table[(i, j)], i), scale[j])
                } else {
                    0.0
                }
            }),
            determined: (0..n).map(determined).collect(),
            residual_squares: table[(n, n)].max(0.0),
            rank: kept.iter().filter(|kept| **kept).count(),
            independent: kept,
        }
    }
}

/// Values as functions of others: `o = a - B x`.
#[derive(Clone, Debug)]
pub(crate) struct EliminatedValues {
    /// The vector `a`.
    offset: DVector<f64>,
    /// The matrix `B`.
    coefficients: DMatrix<f64>,
    /// Their covariance if the others are known exactly.
    covariance: DMatrix<f64>,
    /// Which of them are determined if the others are known.
    determined: Vec<bool>,
    /// Which others each of them depends on.
    depends_on: Vec<Vec<bool>>,
    /// Number of independent columns among them.
    rank: usize,
}

impl EliminatedValues {
    /// The values for given others.
    pub(crate) fn values(&self, others: &DVector<f64>) -> DVector<f64> {
        &self.offset - &self.coefficients * others
    }

    /// Their covariance for that of the others.
    pub(crate) fn covariance(&self, others: &DMatrix<f64>) -> DMatrix<f64> {
        &self.covariance + &self.coefficients * others * self.coefficients.transpose()
    }

    /// Which of them are determined, given which of the others are.
    pub(crate) fn determined_flags(&self, others: &[bool]) -> Vec<bool> {
        let is_told = |(alone, hangs): (&bool, &Vec<bool>)| {
            *alone && hangs.iter().zip(others).all(|(hangs, is_known)| *is_known || !hangs)
        };
        self.determined.iter().zip(&self.depends_on).map(is_told).collect()
    }

    /// Number of independent columns among the eliminated ones.
    pub(crate) fn rank(&self) -> usize {
        self.rank
    }
}

/// `x / scale`, or 0 for a column of zeros.
fn divide_by_scale(x: f64, scale: f64) -> f64 {
    if scale > 0.0 { x / scale } else { 0.0 }
}

/// Columns after the elimination of others that are always fitted.
#[derive(Clone, Debug)]
pub(crate) struct SchurComplement {
    /// Their scaled normal equations with the others eliminated; the last row and column belong to the measured values.
    table: DMatrix<f64>,
    /// The norm of each column before the elimination.
    scale: DVector<f64>,
}

impl SchurComplement {
    /// Sum of squares of a column after the elimination; 0 if the eliminated columns contain it.
    pub(crate) fn squares(&self, column: usize) -> f64 {
        let own = self.table[(column, column)];
        if own < CHANGE_INDEPENDENCE_TOLERANCE {
            return 0.0;
        }
        own * self.scale[column].powi(2)
    }

    /// Squared residual after a fit of some of the columns, and which of these are independent.
    pub(crate) fn residual_squares(&self, columns: &[usize]) -> (f64, Vec<bool>) {
        let last = self.table.nrows() - 1;
        let all: Vec<usize> = columns.iter().copied().chain([last]).collect();
        let mut table = self.table.select_rows(&all).select_columns(&all);
        let kept = (0..columns.len()).map(|k| sweep(&mut table, k)).collect();
        (table[(columns.len(), columns.len())].max(0.0), kept)
    }
}

/// Sweeps a symmetric table on one of its columns, if that is independent: the table then contains the regression of
/// all others on it (Goodnight, The American Statistician 33, 1979). Returns whether it did.
fn sweep(table: &mut DMatrix<f64>, k: usize) -> bool {
    let pivot = table[(k, k)];
    if pivot < CHANGE_INDEPENDENCE_TOLERANCE {
        return false;
    }
    let n = table.nrows();
    let row: Vec<f64> = (0..n).map(|j| table[(k, j)] / pivot).collect();
    let mut column: Vec<f64> = table.column(k).iter().copied().collect();
    column[k] = 0.0;
    for (j, factor) in row.iter().enumerate().filter(|(j, x)| *j != k && **x != 0.0) {
        for (x, c) in table.column_mut(j).iter_mut().zip(&column) {
            *x -= factor * c;
        }
    }
    for j in 0..n {
        table[(k, j)] = row[j];
        table[(j, k)] = -column[j] / pivot;
    }
    table[(k, k)] = pivot.recip();
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_noise::TestNoise;

    #[test]
    fn sums_of_blocks_give_the_least_squares_of_all_rows() {
        let mut noise = TestNoise::new(3);
        let rows = 200;
        let column = |noise: &mut TestNoise| -> Vec<f64> { (0..rows).map(|_| noise.normal()).collect() };
        let (a, b) = (column(&mut noise), column(&mut noise));
        let twin: Vec<f64> = a.iter().map(|x| -2.0 * x).collect();
        let y: Vec<f64> = (0..rows)
            .map(|i| 3.0 * a[i] - 0.5 * b[i] + 0.01 * noise.normal())
            .collect();
        let mut all = NormalEquations::new(4);
        for part in [0..70, 70..rows] {
            let mut one = NormalEquations::new(4);
            let z = [
                Some(&a[part.clone()]),
                None,
                Some(&b[part.clone()]),
                Some(&twin[part.clone()]),
            ];
            one.add_rows(&z, &y[part]);
            all.merge(&one);
        }
        let solved = all.solve();
        let matrix = DMatrix::from_fn(rows, 2, |i, j| [&a, &b][j][i]);
        let expected = matrix
            .clone()
            .svd(true, true)
            .solve(&DVector::from_column_slice(&y), 1e-12)
            .unwrap();
        assert!((solved.values[0] - expected[0]).abs() < 1e-12 && (solved.values[2] - expected[1]).abs() < 1e-12);
        assert_eq!((solved.values[1], solved.values[3], solved.rank), (0.0, 0.0, 2));
        let inverse = (matrix.transpose() * &matrix).try_inverse().unwrap();
        assert!((solved.covariance[(0, 2)] - inverse[(0, 1)]).abs() < 1e-14);
        assert!((all.residual_squares(&solved.values) - solved.residual_squares).abs() < 1e-9);
        // The first column and its twin share their value; the other is its own.
        assert_eq!(solved.determined, [false, false, true, false]);
        assert_eq!(all.select_columns(&[2]).solve().determined, [true]);
    }
}
