//! Normal equations whose columns differ in unit: the diagonal is scaled to 1 before they are factored, so that rounding
//! is relative to each column.
//!
//! A small ridge keeps dependent columns solvable; without one they are refused.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Normal equations `N x = b` that are scaled and factored, `S N S + ridge I = L L'`.
#[derive(Debug, Clone)]
pub struct ScaledNormalEquations {
    /// The factor.
    factor: Cholesky<f64, Dyn>,
    /// The diagonal of `S`: the inverse norm of each column; 0 for a column of zeros.
    scale: DVector<f64>,
}

impl ScaledNormalEquations {
    /// Factors normal equations, of which only the lower triangle is read. The ridge is relative to the diagonal.
    /// `None` if they are not positive definite, or an entry is not finite.
    pub fn new(normal: DMatrix<f64>, ridge: f64) -> Option<Self> {
        let squares = normal.diagonal();
        Self::after_elimination(normal, &squares, ridge)
    }

    /// The same for normal equations from which other columns were eliminated. `squares` is their diagonal before that,
    /// and sets the scale: of a column that the eliminated ones explain, only rounding remains.
    pub fn after_elimination(mut normal: DMatrix<f64>, squares: &DVector<f64>, ridge: f64) -> Option<Self> {
        let scale = squares.map(|square| if square > 0.0 { square.sqrt().recip() } else { 0.0 });
        for j in 0..scale.len() {
            for i in j..scale.len() {
                normal[(i, j)] *= scale[i] * scale[j];
            }
            normal[(j, j)] += ridge;
        }
        let factor = normal.cholesky()?;
        Some(Self { factor, scale })
    }

    /// The solution for a right side.
    pub fn solve(&self, right: &DVector<f64>) -> DVector<f64> {
        let solved = self.factor.solve(&right.component_mul(&self.scale));
        solved.component_mul(&self.scale)
    }

    /// `L^-1 S` times some columns: the products of two results are `A' N^-1 B`.
    pub fn half_solve(&self, mut columns: DMatrix<f64>) -> DMatrix<f64> {
        for mut column in columns.column_iter_mut() {
            column.component_mul_assign(&self.scale);
        }
        self.factor.l_dirty().solve_lower_triangular_mut(&mut columns);
        columns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_of_any_unit_are_solved_and_dependent_ones_need_a_ridge() {
        let columns = [1e-6, 1.0, 1e7];
        let rows = DMatrix::from_fn(9, 3, |i, k| columns[k] * (1.0 + i as f64 * (k as f64 + 0.3)).sin());
        let normal = rows.transpose() * &rows;
        let right = DVector::from_vec(vec![2e-6, -1.0, 3e7]);
        let factor = ScaledNormalEquations::new(normal.clone(), 0.0).expect("independent columns");
        let found = factor.solve(&right);
        let back = &normal * &found - &right;
        assert!(back.component_div(&right).amax() < 1e-9, "{back}");
        let half = factor.half_solve(DMatrix::from_columns(std::slice::from_ref(&right)));
        assert!((half.norm_squared() - right.dot(&found)).abs() < 1e-9 * half.norm_squared());

        let twice = DMatrix::from_fn(9, 3, |i, k| if k == 1 { rows[(i, 0)] } else { 0.5 * rows[(i, k)] });
        let normal = twice.transpose() * &twice;
        assert!(ScaledNormalEquations::new(normal.clone(), 1e-10).is_some());
        let empty = DMatrix::zeros(2, 2);
        assert!(ScaledNormalEquations::new(empty.clone(), 0.0).is_none());
        let solved = ScaledNormalEquations::new(empty, 1e-10)
            .expect("a ridge")
            .solve(&DVector::zeros(2));
        assert_eq!(solved, DVector::zeros(2));
        assert!(ScaledNormalEquations::new(normal * f64::NAN, 1e-10).is_none());
    }
}
