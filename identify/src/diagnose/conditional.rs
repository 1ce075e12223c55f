//! A fitted set of effects, and what further columns explain in addition. Everything is computed from inner products,
//! so that samples are not read again.

use nalgebra::{DMatrix, DVector};

use super::bench::{EffectSelector, SelectedEffect};
use super::column::ForceColumn;
use super::factored::GramFactor;
use super::pool::{FitScope, solve_gram};
use super::thresholds::EFFECT_INDEPENDENCE_TOLERANCE;

/// A smaller share of a column's squares than this is rounding.
const ROUNDING: f64 = 1e-7;

/// A set of effects that is fitted to all samples together with the base parameters.
#[derive(Default)]
pub(crate) struct ConditioningSet {
    /// Indices of its columns in the pool, base first.
    columns: Vec<usize>,
    /// Factor of their weighted inner products.
    factor: GramFactor,
    /// Estimated factor of each column, in the same order.
    pub(crate) factors: DVector<f64>,
    /// Weighted sum of squares of the residual.
    squares: f64,
}

/// Weighted inner products of some further columns.
struct InnerProductBlocks {
    /// With each other; symmetric.
    own: DMatrix<f64>,
    /// With the columns of the set: a row for each column of the set, a column for each further one.
    with_set: DMatrix<f64>,
    /// With the measured forces.
    measured: DVector<f64>,
}

impl EffectSelector<'_> {
    /// Fits a set of effects to all samples and keeps what is needed to evaluate further columns.
    pub(crate) fn conditioning_set(&self, picks: &[SelectedEffect]) -> ConditioningSet {
        let mut all = self.columns(picks);
        all.push(self.measured);
        let gram = self.pool.gram(&all, &self.weights, FitScope::All);
        let n = all.len() - 1;
        let (factors, squares) = solve_gram(&gram);
        all.pop();
        ConditioningSet {
            columns: all,
            factor: GramFactor::new(&gram.view((0, 0), (n, n)).into_owned()),
            factors,
            squares,
        }
    }

    /// Decrease of the weighted sum of squares when columns of the pool are added to a set.
    pub(crate) fn explained_squares(&self, columns: &[usize], beside: &ConditioningSet) -> f64 {
        beside.explained_squares(&self.products_of(columns, beside))
    }

    /// The same for columns that are not in the pool.
    pub(crate) fn explained_by_columns(&self, columns: &[ForceColumn], beside: &ConditioningSet) -> f64 {
        let product = |a: &ForceColumn, b: &ForceColumn| self.pool.weighted_product_of(a, b, &self.weights);
        let in_pool = |k: usize| self.pool.column(k);
        let (n, m) = (columns.len(), beside.columns.len());
        beside.explained_squares(&InnerProductBlocks {
            own: DMatrix::from_fn(n, n, |i, j| product(&columns[i], &columns[j])),
            with_set: DMatrix::from_fn(m, n, |i, j| product(in_pool(beside.columns[i]), &columns[j])),
            measured: DVector::from_fn(n, |i, _| product(in_pool(self.measured), &columns[i])),
        })
    }

    /// Number of columns that are linearly independent of a set and of each other.
    pub(crate) fn conditional_rank(&self, columns: &[usize], beside: &ConditioningSet) -> usize {
        let products = self.products_of(columns, beside);
        let mut left = beside.project_out_set(&products);
        // Scale columns to unit length, so that the tolerance is relative.
        let scale = products
            .own
            .diagonal()
            .map(|own| if own > 0.0 { own.sqrt().recip() } else { 0.0 });
        for i in 0..columns.len() {
            for j in 0..columns.len() {
                left[(i, j)] *= scale[i] * scale[j];
            }
        }
        let values = left.symmetric_eigenvalues();
        values
            .iter()
            .filter(|value| **value > EFFECT_INDEPENDENCE_TOLERANCE)
            .count()
    }

    /// Whether all columns of `some` lie in the span of `others` and a set.
    pub(crate) fn is_in_joint_span(&self, some: &[usize], others: &[usize], beside: &ConditioningSet) -> bool {
        let all = [others, some].concat();
        let products = self.products_of(&all, beside);
        let left = beside.project_out_set(&products);
        // Squares of each column that remain after a fit of the others.
        (others.len()..all.len()).all(|k| {
            let mut which: Vec<usize> = (0..others.len()).collect();
            which.push(k);
            let gram = left.select_rows(&which).select_columns(&which);
            solve_gram(&gram).1 <= EFFECT_INDEPENDENCE_TOLERANCE * products.own[(k, k)]
        })
    }

    /// Computes the inner products of columns of the pool with a set and the measured forces, several at a time.
    pub(crate) fn compute_products_with(&self, columns: &[usize], beside: &ConditioningSet) {
        let mut others = beside.columns.clone();
        others.push(self.measured);
        self.pool.compute_cross_products(columns, &others);
    }

    /// Weighted inner products of columns of the pool.
    fn products_of(&self, columns: &[usize], beside: &ConditioningSet) -> InnerProductBlocks {
        let product = |a: usize, b: usize| self.pool.weighted_product(a, b, &self.weights);
        let (n, m) = (columns.len(), beside.columns.len());
        InnerProductBlocks {
            own: DMatrix::from_fn(n, n, |i, j| product(columns[i], columns[j])),
            with_set: DMatrix::from_fn(m, n, |i, j| product(beside.columns[i], columns[j])),
            measured: DVector::from_fn(n, |i, _| product(self.measured, columns[i])),
        }
    }
}

impl ConditioningSet {
    /// Inner products with the set projected out: `G - H' H` with `H = L^-1 C` (Schur complement). A diagonal entry at
    /// the level of rounding becomes zero.
    fn project_out_set(&self, products: &InnerProductBlocks) -> DMatrix<f64> {
        let halves = self.factor.forward_substitute(&products.with_set);
        let mut left = &products.own - halves.transpose() * &halves;
        for i in 0..left.nrows() {
            if left[(i, i)] < ROUNDING * products.own[(i, i)] {
                left[(i, i)] = 0.0;
            }
        }
        left
    }

    /// Decrease of the weighted sum of squares for columns with given inner products.
    fn explained_squares(&self, products: &InnerProductBlocks) -> f64 {
        let n = products.own.nrows();
        // Products of the columns with the residual of the set.
        let right = &products.measured - products.with_set.transpose() * &self.factors;
        let mut gram = self.project_out_set(products).resize(n + 1, n + 1, 0.0);
        for i in 0..n {
            gram[(i, n)] = right[i];
            gram[(n, i)] = right[i];
        }
        gram[(n, n)] = self.squares;
        self.squares - solve_gram(&gram).1
    }
}
