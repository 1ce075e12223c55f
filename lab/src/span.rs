//! Projection on columns: columns go in as an orthonormal basis, the residual of another column comes out.

/// A column whose residual is below this share of its norm depends linearly on the others.
const NOTHING: f64 = 1e-9;

/// The span of columns, as an orthonormal basis (Gram-Schmidt, each column orthogonalised twice).
#[derive(Clone, Default)]
pub struct ColumnSpan {
    /// Orthonormal columns, in the order in which they were added.
    basis: Vec<Vec<f64>>,
}

impl ColumnSpan {
    /// The span of some columns.
    pub fn from_columns(columns: impl IntoIterator<Item = Vec<f64>>) -> Self {
        let mut span = Self::default();
        span.extend(columns);
        span
    }

    /// Adds columns to the span; linearly dependent ones are skipped.
    pub fn extend(&mut self, columns: impl IntoIterator<Item = Vec<f64>>) {
        for column in columns {
            let before = norm(&column);
            // The second pass removes the rounding of the first.
            let mut rest = self.rest(&self.rest(&column));
            let after = norm(&rest);
            if after > NOTHING * before {
                for x in &mut rest {
                    *x /= after;
                }
                self.basis.push(rest);
            }
        }
    }

    /// The residual of a column: its part orthogonal to the span.
    pub fn rest(&self, column: &[f64]) -> Vec<f64> {
        let mut rest = column.to_vec();
        for direction in &self.basis {
            let share: f64 = direction.iter().zip(&rest).map(|(a, b)| a * b).sum();
            for (x, d) in rest.iter_mut().zip(direction) {
                *x -= share * d;
            }
        }
        rest
    }
}

/// The 2-norm of a column.
pub fn norm(column: &[f64]) -> f64 {
    column.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Root mean square of a column; zero if it is empty.
pub fn rms(column: &[f64]) -> f64 {
    norm(column) / (column.len().max(1) as f64).sqrt()
}
