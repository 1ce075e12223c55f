//! What columns cannot say: an orthonormal basis of columns goes in, the rest of another column comes out.

/// A column that loses all but this share of itself is said by the others.
const NOTHING: f64 = 1e-9;

/// The span of columns, as an orthonormal basis (Gram and Schmidt, each column twice).
#[derive(Clone, Default)]
pub struct ColumnSpan {
    basis: Vec<Vec<f64>>,
}

impl ColumnSpan {
    /// The span of some columns.
    pub fn from_columns(columns: impl IntoIterator<Item = Vec<f64>>) -> Self {
        let mut span = Self::default();
        span.extend(columns);
        span
    }

    /// Takes more columns in; those that say nothing new are passed over.
    pub fn extend(&mut self, columns: impl IntoIterator<Item = Vec<f64>>) {
        for column in columns {
            let before = norm(&column);
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

    /// What is left of a column.
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

/// The 2-norm.
pub fn norm(column: &[f64]) -> f64 {
    column.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Root of the mean square.
pub fn rms(column: &[f64]) -> f64 {
    norm(column) / (column.len().max(1) as f64).sqrt()
}
