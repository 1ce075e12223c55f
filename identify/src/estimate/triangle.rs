//! Reduced rows as a value of their own: what a regression is, for all that is computed from it without the samples.

use nalgebra::{DMatrix, DVector};

use crate::estimate::error::LeastSquaresError;
use crate::estimate::least_squares::LeastSquares;
use crate::estimate::solution::{RowCount, Solution, solve_triangle};

/// The upper triangle `[R, Q'y; 0, +-|residual|]` of some rows: all that they say about the parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Triangle {
    n: usize,
    rows: RowCount,
    /// `(n + 1) x (n + 1)` by rows.
    entries: Vec<f64>,
}

impl Triangle {
    /// What a regression has reduced.
    pub fn new(regression: &LeastSquares) -> Self {
        Self {
            n: regression.n_parameters(),
            rows: regression.row_count(),
            entries: regression.reduced(),
        }
    }

    /// Number of parameters.
    pub fn n_parameters(&self) -> usize {
        self.n
    }

    /// Rows that were reduced, those of zeros left out.
    pub fn rows(&self) -> usize {
        self.rows.telling
    }

    /// Says from how many rows the reduced ones came.
    pub(crate) fn count_rows(&mut self, rows: RowCount) {
        self.rows = rows;
    }

    /// `R`, `n x n`.
    pub fn r(&self) -> DMatrix<f64> {
        DMatrix::from_fn(self.n, self.n, |i, j| self.entries[i * (self.n + 1) + j])
    }

    /// `Q'y`, `n` long.
    pub fn right(&self) -> DVector<f64> {
        DVector::from_fn(self.n, |i, _| self.entries[i * (self.n + 1) + self.n])
    }

    /// The norm of the residual that no parameters can explain.
    pub fn corner(&self) -> f64 {
        self.entries[self.entries.len() - 1].abs()
    }

    /// The solution; undetermined directions stay at `nominal`.
    pub fn solve_near(&self, nominal: &[f64]) -> Result<Solution, LeastSquaresError> {
        solve_triangle(&self.entries, self.rows, nominal)
    }

    /// The same rows for the differences of the parameters from some values.
    pub(crate) fn from(&self, values: &[f64]) -> Self {
        let mut shifted = self.clone();
        for row in shifted.entries.chunks_exact_mut(self.n + 1) {
            let explained: f64 = row.iter().zip(values).map(|(w, value)| w * value).sum();
            row[self.n] -= explained;
        }
        shifted
    }

    /// The regression of some of the columns alone; the parameters of the others are 0.
    /// Fails when a column is not there.
    pub fn only(&self, columns: &[usize]) -> Result<Self, LeastSquaresError> {
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

    /// The same with further rows, `n` numbers and a right-hand side each, which do not count as measured ones.
    /// Fails when the lengths do not fit.
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
