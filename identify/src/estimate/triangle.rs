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

    /// The triangle of `n` parameters whose entries, from [`Triangle::entries`], were kept elsewhere, and from how many rows they
    /// came, those of zeros left out.
    /// Fails when there are not `(n + 1)(n + 2) / 2` entries or one is not finite.
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
            return Err(LeastSquaresError::NotFinite {
                row: at,
                column: None,
            });
        }
        let mut whole = vec![0.0; width * width];
        let mut next = entries.iter();
        for i in 0..width {
            for (x, entry) in whole[i * width + i..(i + 1) * width]
                .iter_mut()
                .zip(next.by_ref())
            {
                *x = *entry;
            }
        }
        Ok(Self {
            n,
            rows: RowCount {
                shown: rows,
                telling: rows,
            },
            entries: whole,
        })
    }

    /// The entries of the triangle `[R, Q'y; 0, +-|residual|]` by rows, without the zeros below its diagonal.
    pub fn entries(&self) -> Vec<f64> {
        let width = self.n + 1;
        (0..width)
            .flat_map(|i| &self.entries[i * width + i..(i + 1) * width])
            .copied()
            .collect()
    }

    /// The triangle of the rows of both. Fails when the numbers of parameters differ.
    pub fn merged(&self, other: &Self) -> Result<Self, LeastSquaresError> {
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
                telling: self.rows.telling + other.rows.telling,
            },
            ..Self::new(&regression)
        })
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_noise::Noise;

    #[test]
    fn triangles_that_were_kept_add_to_that_of_all_rows() {
        let mut noise = Noise::new(8);
        let (n, rows) = (4, 90);
        let w: Vec<f64> = (0..n * rows).map(|_| noise.normal()).collect();
        let y: Vec<f64> = (0..rows).map(|_| noise.normal()).collect();
        let of = |from: usize, to: usize| {
            let mut regression = LeastSquares::new(n);
            regression
                .add_rows(&w[from * n..to * n], &y[from..to])
                .unwrap();
            let triangle = Triangle::new(&regression);
            Triangle::from_entries(n, triangle.rows(), &triangle.entries()).unwrap()
        };
        let [a, b, c] = [of(0, 20), of(20, 50), of(50, rows)];
        let all = of(0, rows).solve_near(&[0.0; 4]).unwrap();
        for merged in [
            a.merged(&b).unwrap().merged(&c).unwrap(),
            c.merged(&a).unwrap().merged(&b).unwrap(),
        ] {
            assert_eq!(merged.rows(), rows);
            let solved = merged.solve_near(&[0.0; 4]).unwrap();
            for k in 0..n {
                assert!((solved.values[k] - all.values[k]).abs() < 1e-12);
                assert!((solved.classical_std[k] - all.classical_std[k]).abs() < 1e-12);
            }
        }
        assert!(Triangle::from_entries(3, rows, &a.entries()).is_err());
        assert!(a.merged(&Triangle::new(&LeastSquares::new(3))).is_err());
    }
}
