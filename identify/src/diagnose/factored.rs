//! Inner products of columns, decomposed, so that what they explain of others is quickly said.

use nalgebra::{DMatrix, DVector};

use super::pool::DEPENDENT;

/// A decomposed matrix of inner products; columns that depend on earlier ones are passed over.
pub(crate) struct Factored {
    lower: DMatrix<f64>,
    scale: Vec<f64>,
    kept: Vec<bool>,
}

impl Factored {
    pub(crate) fn new(gram: &DMatrix<f64>) -> Self {
        let n = gram.nrows();
        let scale: Vec<f64> = (0..n)
            .map(|i| {
                let root = gram[(i, i)].sqrt();
                if root > 0.0 { root } else { 1.0 }
            })
            .collect();
        let mut lower = DMatrix::zeros(n, n);
        let mut kept = vec![false; n];
        for i in 0..n {
            for j in 0..=i {
                if j < i && !kept[j] {
                    continue;
                }
                let mut sum = gram[(i, j)] / (scale[i] * scale[j]);
                for k in 0..j {
                    sum -= lower[(i, k)] * lower[(j, k)];
                }
                if j < i {
                    lower[(i, j)] = sum / lower[(j, j)];
                } else if sum > DEPENDENT {
                    kept[i] = true;
                    lower[(i, i)] = sum.sqrt();
                }
            }
        }
        Self { lower, scale, kept }
    }

    /// `L^-1 x`: its square is what the columns explain.
    pub(crate) fn half(&self, products: &DVector<f64>) -> DVector<f64> {
        let n = products.len();
        let mut half = DVector::zeros(n);
        for i in 0..n {
            if !self.kept[i] {
                continue;
            }
            let mut sum = products[i] / self.scale[i];
            for k in 0..i {
                sum -= self.lower[(i, k)] * half[k];
            }
            half[i] = sum / self.lower[(i, i)];
        }
        half
    }

    pub(crate) fn halves(&self, products: &DMatrix<f64>) -> DMatrix<f64> {
        let columns: Vec<DVector<f64>> = products
            .column_iter()
            .map(|column| self.half(&column.into_owned()))
            .collect();
        DMatrix::from_columns(&columns)
    }
}
