//! Parts of columns that other columns do not explain: projections onto the complement of a space.
//!
//! Columns go in, an orthonormal basis of their span comes out. Source: modified Gram-Schmidt with a second pass, which
//! keeps the basis orthogonal to rounding (L. Giraud et al., "Rounding error analysis of the classical Gram-Schmidt
//! orthogonalization process", Numer. Math. 101 (2005)).

use super::thresholds::DEPENDENT_SHARE;

/// An orthonormal basis of the span of columns.
#[derive(Clone, Default)]
pub(super) struct OrthonormalSpan {
    /// Its columns.
    basis: Vec<Vec<f64>>,
}

impl OrthonormalSpan {
    /// The span of some columns of equal length.
    pub(super) fn new(columns: impl IntoIterator<Item = Vec<f64>>) -> Self {
        let mut all = Self::default();
        for column in columns {
            all.add(&column);
        }
        all
    }

    /// Adds a column, unless it depends on the others.
    pub(super) fn add(&mut self, column: &[f64]) {
        let before = norm(column);
        let mut rest = self.residual(column);
        let after = norm(&rest);
        if after > DEPENDENT_SHARE * before {
            for x in &mut rest {
                *x /= after;
            }
            self.basis.push(rest);
        }
    }

    /// Number of independent columns.
    pub(super) fn rank(&self) -> usize {
        self.basis.len()
    }

    /// The part of a column that is orthogonal to the span.
    pub(super) fn residual(&self, column: &[f64]) -> Vec<f64> {
        let mut rest = column.to_vec();
        for _ in 0..2 {
            for one in &self.basis {
                let share = dot(one, &rest);
                rest.iter_mut().zip(one).for_each(|(x, q)| *x -= share * q);
            }
        }
        rest
    }
}

/// The scalar product of two columns.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// The norm of a column.
fn norm(column: &[f64]) -> f64 {
    dot(column, column).sqrt()
}

#[cfg(test)]
mod tests {
    use super::{OrthonormalSpan, dot};

    #[test]
    fn residuals_are_orthogonal_to_all_columns() {
        let columns = [
            vec![1.0, 1.0, 1.0, 1.0],
            vec![1.0, 2.0, 3.0, 4.0],
            vec![3.0, 4.0, 5.0, 6.0],
        ];
        let span = OrthonormalSpan::new(columns.clone());
        // The third column is the second one and twice the first one.
        assert_eq!(span.rank(), 2);
        let rest = span.residual(&[0.5, -1.0, 2.0, 7.0]);
        for column in &columns {
            assert!(dot(&rest, column).abs() < 1e-12);
        }
        assert!(dot(&rest, &rest) > 1.0);
    }
}
