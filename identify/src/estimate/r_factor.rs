//! The R factor as a value of its own: the input of all computations that do not need the samples.

use nalgebra::{DMatrix, DVector};

use crate::estimate::error::LeastSquaresError;
use crate::estimate::least_squares::LeastSquares;
use crate::estimate::solution::{RegressionSolution, RowCount, solve_r_factor};

/// The factor `[R, Q'y; 0, +-|residual|]` of some rows: all their information on the parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct RFactor {
    /// Number of parameters.
    n: usize,
    /// Number of rows that were reduced.
    rows: RowCount,
    /// `(n + 1) x (n + 1)` by rows.
    entries: Vec<f64>,
}

impl RFactor {
    /// The factor of a regression.
    pub fn new(regression: &LeastSquares) -> Self {
        Self {
            n: regression.n_parameters(),
            rows: regression.row_count(),
            entries: regression.augmented_factor(),
        }
    }

    /// Restores the factor of `n` parameters from stored [`RFactor::entries`] and the number of its rows, those of
    /// zeros excluded.
    /// Fails if there are not `(n + 1)(n + 2) / 2` entries or one is not finite.
    pub fn from_entries(n: usize, rows: usize, entries: &[f64]) -> Result<Self, LeastSquaresError> {
        let width = n + 1;
        if entries.len() != width * (width + 1) / 2 {
            return Err(LeastSquaresError::Shape {
                regressor: entries.len(),
                measured: width,
                columns: n,
            });
        }
        if let Some(at) = entries.iter().position(|x| !x.is_finite()) {
            return Err(LeastSquaresError::NotFinite { row: at, column: None });
        }
        let mut whole = vec![0.0; width * width];
        let mut next = entries.iter();
        for i in 0..width {
            for (x, entry) in whole[i * width + i..(i + 1) * width].iter_mut().zip(next.by_ref()) {
                *x = *entry;
            }
        }
        Ok(Self {
            n,
            rows: RowCount {
                shown: rows,
                informative: rows,
            },
            entries: whole,
        })
    }

    /// The entries of the factor `[R, Q'y; 0, +-|residual|]` by rows, without the zeros below its diagonal.
    pub fn entries(&self) -> Vec<f64> {
        let width = self.n + 1;
        (0..width)
            .flat_map(|i| &self.entries[i * width + i..(i + 1) * width])
            .copied()
            .collect()
    }

    /// The factor of the rows of both. Fails if the numbers of parameters differ.
    pub fn merge_with(&self, other: &Self) -> Result<Self, LeastSquaresError> {
        if self.n != other.n {
            return Err(LeastSquaresError::NominalLength {
                have: other.n,
                expected: self.n,
            });
        }
        let mut regression = LeastSquares::new(self.n);
        for row in [self, other]
            .iter()
            .flat_map(|one| one.entries.chunks_exact(self.n + 1))
        {
            regression.add_rows(&row[..self.n], &row[self.n..])?;
        }
        Ok(Self {
            rows: RowCount {
                shown: self.rows.shown + other.rows.shown,
                informative: self.rows.informative + other.rows.informative,
            },
            ..Self::new(&regression)
        })
    }

    /// Number of parameters.
    pub fn n_parameters(&self) -> usize {
        self.n
    }

    /// Number of rows that were reduced, those of zeros excluded.
    pub fn rows(&self) -> usize {
        self.rows.informative
    }

    /// Sets the number of rows from which the factor came.
    pub(crate) fn set_row_count(&mut self, rows: RowCount) {
        self.rows = rows;
    }

    /// `R`, `n x n`.
    pub fn r(&self) -> DMatrix<f64> {
        DMatrix::from_fn(self.n, self.n, |i, j| self.entries[i * (self.n + 1) + j])
    }

    /// `Q'y`, `n` long.
    pub fn right_side(&self) -> DVector<f64> {
        DVector::from_fn(self.n, |i, _| self.entries[i * (self.n + 1) + self.n])
    }

    /// Norm of the residual that no parameters can explain.
    pub fn residual_norm(&self) -> f64 {
        self.entries[self.entries.len() - 1].abs()
    }

    /// The solution; undetermined directions stay at `nominal`.
    pub fn solve_near(&self, nominal: &[f64]) -> Result<RegressionSolution, LeastSquaresError> {
        solve_r_factor(&self.entries, self.rows, nominal)
    }

    /// The same rows for parameters relative to some values.
    pub(crate) fn relative_to(&self, values: &[f64]) -> Self {
        let mut shifted = self.clone();
        for row in shifted.entries.chunks_exact_mut(self.n + 1) {
            let explained: f64 = row.iter().zip(values).map(|(w, value)| w * value).sum();
            row[self.n] -= explained;
        }
        shifted
    }

    /// The factor of some of the columns alone; the parameters of the others are 0. Fails if a column does not exist.
    pub fn select_columns(&self, columns: &[usize]) -> Result<Self, LeastSquaresError> {
        let width = self.n + 1;
        let mut regression = LeastSquares::new(columns.len());
        for row in self.entries.chunks_exact(width) {
            let kept: Vec<f64> = columns.iter().map(|j| row[*j]).collect();
            regression.add_rows(&kept, &row[self.n..])?;
        }
        Ok(Self {
            rows: self.rows,
            ..Self::new(&regression)
        })
    }

    /// The same with additional rows, `n` numbers and a right side each, which do not count as measured ones. Fails if
    /// the lengths do not match.
    pub fn with_rows(&self, regressor: &[f64], right: &[f64]) -> Result<Self, LeastSquaresError> {
        let width = self.n + 1;
        let mut regression = LeastSquares::new(self.n);
        for row in self.entries.chunks_exact(width) {
            regression.add_rows(&row[..self.n], &row[self.n..])?;
        }
        regression.add_rows(regressor, right)?;
        Ok(Self {
            rows: self.rows,
            ..Self::new(&regression)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_noise::TestNoise;

    #[test]
    fn triangles_that_were_kept_add_to_that_of_all_rows() {
        let mut noise = TestNoise::new(8);
        let (n, rows) = (4, 90);
        let w: Vec<f64> = (0..n * rows).map(|_| noise.normal()).collect();
        let y: Vec<f64> = (0..rows).map(|_| noise.normal()).collect();
        let of = |from: usize, to: usize| {
            let mut regression = LeastSquares::new(n);
            regression.add_rows(&w[from * n..to * n], &y[from..to]).unwrap();
            let r_factor = RFactor::new(&regression);
            RFactor::from_entries(n, r_factor.rows(), &r_factor.entries()).unwrap()
        };
        let [a, b, c] = [of(0, 20), of(20, 50), of(50, rows)];
        let all = of(0, rows).solve_near(&[0.0; 4]).unwrap();
        for merged in [
            a.merge_with(&b).unwrap().merge_with(&c).unwrap(),
            c.merge_with(&a).unwrap().merge_with(&b).unwrap(),
        ] {
            assert_eq!(merged.rows(), rows);
            let solved = merged.solve_near(&[0.0; 4]).unwrap();
            for k in 0..n {
                assert!((solved.values[k] - all.values[k]).abs() < 1e-12);
                assert!((solved.classical_std[k] - all.classical_std[k]).abs() < 1e-12);
            }
        }
        assert!(RFactor::from_entries(3, rows, &a.entries()).is_err());
        assert!(a.merge_with(&RFactor::new(&LeastSquares::new(3))).is_err());
    }
}
