//! A run as sums over its rows, which add from block to block and from run to run.

use nalgebra::{DMatrix, DVector};

/// A column whose rest beside the others is below this part of it says nothing of its own.
const TELLING: f64 = 1e-7;

/// Inner products of all columns of a least-squares problem among themselves and with the measured values.
#[derive(Clone, Debug, PartialEq)]
pub struct Moments {
    /// `Z' Z`.
    pub gram: DMatrix<f64>,
    /// `Z' y`.
    pub rhs: DVector<f64>,
    /// `y' y`.
    pub total: f64,
    /// How many rows there are.
    pub rows: usize,
}

/// A least-squares solution for some of the columns.
#[derive(Clone, Debug, PartialEq)]
pub struct Solved {
    /// One value for each column that was asked for; 0 for one that is a combination of those before it.
    pub values: DVector<f64>,
    /// `(Z' Z)^-1`: the covariance of the values if rows are of variance 1; 0 where a value is held at 0.
    pub covariance: DMatrix<f64>,
    /// Which values are their own, and no combination of the others.
    pub determined: Vec<bool>,
    /// What is left: `|y - Z x|^2`.
    pub rest: f64,
    /// How many columns say something of their own.
    pub rank: usize,
    /// Which columns these are: of columns that say the same the first.
    pub kept: Vec<bool>,
}

impl Moments {
    /// Of no rows.
    pub fn new(columns: usize) -> Self {
        Self {
            gram: DMatrix::zeros(columns, columns),
            rhs: DVector::zeros(columns),
            total: 0.0,
            rows: 0,
        }
    }

    /// Adds rows by their columns, `z[column][row]` with `None` for a column of zeros, and the measured values.
    pub fn add_rows(&mut self, z: &[Option<&[f64]>], y: &[f64]) {
        let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        for (i, a) in z.iter().enumerate() {
            let Some(a) = a else { continue };
            self.rhs[i] += product(a, y);
            for (j, b) in z.iter().enumerate().take(i + 1) {
                let Some(b) = b else { continue };
                let sum = product(a, b);
                self.gram[(i, j)] += sum;
                if i != j {
                    self.gram[(j, i)] += sum;
                }
            }
        }
        self.total += product(y, y);
        self.rows += y.len();
    }

    /// Adds the rows of another one with the same columns.
    pub fn merge(&mut self, other: &Self) {
        self.gram += &other.gram;
        self.rhs += &other.rhs;
        self.total += other.total;
        self.rows += other.rows;
    }

    /// The same for some of the columns.
    #[must_use]
    pub fn of(&self, columns: &[usize]) -> Self {
        Self {
            gram: DMatrix::from_fn(columns.len(), columns.len(), |i, j| {
                self.gram[(columns[i], columns[j])]
            }),
            rhs: DVector::from_fn(columns.len(), |i, _| self.rhs[columns[i]]),
            total: self.total,
            rows: self.rows,
        }
    }

    /// `|y - Z x|^2` for given values.
    pub fn rest(&self, x: &DVector<f64>) -> f64 {
        (self.total - 2.0 * self.rhs.dot(x) + x.dot(&(&self.gram * x))).max(0.0)
    }

    /// Least squares for all columns, by sweeps of the scaled normal equations; columns that say nothing of their own are held
    /// at 0.
    pub fn solve(&self) -> Solved {
        let n = self.rhs.len();
        let scale = DVector::from_fn(n, |i, _| self.gram[(i, i)].sqrt());
        let by = |x: f64, s: f64| if s > 0.0 { x / s } else { 0.0 };
        // The last row and column are those of the measured values.
        let mut table = DMatrix::from_fn(n + 1, n + 1, |i, j| match (i < n, j < n) {
            (true, true) => by(by(self.gram[(i, j)], scale[i]), scale[j]),
            (true, false) => by(self.rhs[i], scale[i]),
            (false, true) => by(self.rhs[j], scale[j]),
            (false, false) => self.total,
        });
        let kept: Vec<bool> = (0..n).map(|k| sweep(&mut table, k)).collect();
        let value = |x: f64, i: usize| if kept[i] { by(x, scale[i]) } else { 0.0 };
        // A column that was held is a combination of kept ones, which therefore are not determined.
        let determined = |i: usize| {
            kept[i] && (0..n).all(|k| kept[k] || scale[k] == 0.0 || table[(k, i)].abs() < 1e-3)
        };
        Solved {
            values: DVector::from_fn(n, |i, _| value(table[(i, n)], i)),
            covariance: DMatrix::from_fn(n, n, |i, j| {
                if kept[j] {
                    by(value(table[(i, j)], i), scale[j])
                } else {
                    0.0
                }
            }),
            determined: (0..n).map(determined).collect(),
            rest: table[(n, n)].max(0.0),
            rank: kept.iter().filter(|kept| **kept).count(),
            kept,
        }
    }
}

/// Sweeps a symmetric table on one of its columns, if that says something of its own: it then holds minus the regression of
/// all others upon it (Goodnight, The American Statistician 33, 1979).
fn sweep(table: &mut DMatrix<f64>, k: usize) -> bool {
    let pivot = table[(k, k)];
    if pivot < TELLING {
        return false;
    }
    let n = table.nrows();
    let row: Vec<f64> = (0..n).map(|j| table[(k, j)] / pivot).collect();
    let column: Vec<f64> = (0..n).map(|i| table[(i, k)]).collect();
    for i in (0..n).filter(|i| *i != k) {
        for j in (0..n).filter(|j| *j != k) {
            table[(i, j)] -= column[i] * row[j];
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
    use crate::test_noise::Noise;

    #[test]
    fn sums_of_blocks_give_the_least_squares_of_all_rows() {
        let mut noise = Noise::new(3);
        let rows = 200;
        let column =
            |noise: &mut Noise| -> Vec<f64> { (0..rows).map(|_| noise.normal()).collect() };
        let (a, b) = (column(&mut noise), column(&mut noise));
        let twin: Vec<f64> = a.iter().map(|x| -2.0 * x).collect();
        let y: Vec<f64> = (0..rows)
            .map(|i| 3.0 * a[i] - 0.5 * b[i] + 0.01 * noise.normal())
            .collect();
        let mut all = Moments::new(4);
        for part in [0..70, 70..rows] {
            let mut one = Moments::new(4);
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
        assert!(
            (solved.values[0] - expected[0]).abs() < 1e-12
                && (solved.values[2] - expected[1]).abs() < 1e-12
        );
        assert_eq!(
            (solved.values[1], solved.values[3], solved.rank),
            (0.0, 0.0, 2)
        );
        let inverse = (matrix.transpose() * &matrix).try_inverse().unwrap();
        assert!((solved.covariance[(0, 2)] - inverse[(0, 1)]).abs() < 1e-14);
        assert!((all.rest(&solved.values) - solved.rest).abs() < 1e-9);
        // The first column and its twin share their value; the other is its own.
        assert_eq!(solved.determined, [false, false, true, false]);
        assert_eq!(all.of(&[2]).solve().determined, [true]);
    }
}
