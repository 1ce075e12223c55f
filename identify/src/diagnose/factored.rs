//! Cholesky factor of inner products of columns, which gives quickly what they explain of other columns.

use nalgebra::DMatrix;

use super::pool::DEPENDENT;
use crate::signal::dot;

/// Factor of a matrix of inner products; columns that depend on earlier ones are skipped.
#[derive(Default)]
pub(crate) struct GramFactor {
    /// Lower Cholesky factor of the independent columns, each scaled to unit length.
    lower: DMatrix<f64>,
    /// Indices of these columns with their lengths.
    independent_columns: Vec<(usize, f64)>,
}

impl GramFactor {
    /// Factors a symmetric matrix of inner products.
    pub(crate) fn new(gram: &DMatrix<f64>) -> Self {
        let n = gram.nrows();
        // The factor is stored transposed, so that each of its rows is contiguous.
        let mut upper = DMatrix::<f64>::zeros(n, n);
        let mut kept: Vec<(usize, f64)> = Vec::with_capacity(n);
        for i in 0..n {
            let scale = gram[(i, i)].sqrt();
            if scale <= 0.0 {
                continue;
            }
            let m = kept.len();
            // Row of the factor for this column: its products with the independent ones before it.
            let mut own = vec![0.0; m];
            for (j, (column, other)) in kept.iter().enumerate() {
                let known = dot(&upper.column(j).as_slice()[..j], &own[..j]);
                own[j] = (gram[(*column, i)] / (other * scale) - known) / upper[(j, j)];
            }
            // Share of the column's squares that the earlier ones do not explain.
            let left = 1.0 - dot(&own, &own);
            if left > DEPENDENT {
                upper.column_mut(m).as_mut_slice()[..m].copy_from_slice(&own);
                upper[(m, m)] = left.sqrt();
                kept.push((i, scale));
            }
        }
        let m = kept.len();
        let lower = upper.view((0, 0), (m, m)).transpose();
        Self {
            lower,
            independent_columns: kept,
        }
    }

    /// `L^-1 x` for each column `x` of `products` (rows: factored columns). Its squared norm is what the factored
    /// columns explain.
    pub(crate) fn forward_substitute(&self, products: &DMatrix<f64>) -> DMatrix<f64> {
        let scaled = |i: usize, j: usize| {
            let (k, scale) = self.independent_columns[i];
            products[(k, j)] / scale
        };
        let mut halves = DMatrix::from_fn(self.independent_columns.len(), products.ncols(), scaled);
        self.lower.solve_lower_triangular_unchecked_mut(&mut halves);
        halves
    }
}
