//! A fitted set of effects, and what further columns explain beside it: all from inner products, so that no sample is touched
//! again.

use nalgebra::{DMatrix, DVector};

use super::bench::{EffectSelector, SelectedEffect};
use super::column::ForceColumn;
use super::factored::GramFactor;
use super::pool::{FitScope, solve_gram};

/// A column of which the others leave a smaller share of squares than this says nothing new.
const INDEPENDENCE_TOLERANCE: f64 = 1e-6;
/// Shares of a column's squares below this are rounding.
const ROUNDING: f64 = 1e-7;

/// A set that is fitted to all samples with the base parameters.
#[derive(Default)]
pub(crate) struct ConditioningSet {
    /// Its columns, those of the base first.
    columns: Vec<usize>,
    factor: GramFactor,
    pub(crate) factors: DVector<f64>,
    squares: f64,
}

/// Weighted inner products of some columns.
struct InnerProductBlocks {
    /// With each other.
    own: DMatrix<f64>,
    /// With those of the set, a column for each.
    with_set: DMatrix<f64>,
    /// With the measured forces.
    measured: DVector<f64>,
}

impl EffectSelector<'_> {
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

    /// By how much columns of the pool would lower the weighted sum of squares beside a set.
    pub(crate) fn explained_squares(&self, columns: &[usize], beside: &ConditioningSet) -> f64 {
        beside.explained_squares(&self.products_of(columns, beside))
    }

    /// The same of columns that are not in the pool.
    pub(crate) fn explained_by_columns(
        &self,
        columns: &[ForceColumn],
        beside: &ConditioningSet,
    ) -> f64 {
        let product =
            |a: &ForceColumn, b: &ForceColumn| self.pool.weighted_product_of(a, b, &self.weights);
        let in_pool = |k: usize| self.pool.column(k);
        let (n, m) = (columns.len(), beside.columns.len());
        beside.explained_squares(&InnerProductBlocks {
            own: DMatrix::from_fn(n, n, |i, j| product(&columns[i], &columns[j])),
            with_set: DMatrix::from_fn(m, n, |i, j| {
                product(in_pool(beside.columns[i]), &columns[j])
            }),
            measured: DVector::from_fn(n, |i, _| product(in_pool(self.measured), &columns[i])),
        })
    }

    /// How many of some columns say something that a set does not say already.
    pub(crate) fn conditional_rank(&self, columns: &[usize], beside: &ConditioningSet) -> usize {
        let products = self.products_of(columns, beside);
        let mut left = beside.project_out_set(&products);
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
            .filter(|value| **value > INDEPENDENCE_TOLERANCE)
            .count()
    }

    /// Whether some columns lie in the span of others and a set.
    pub(crate) fn is_in_joint_span(
        &self,
        some: &[usize],
        others: &[usize],
        beside: &ConditioningSet,
    ) -> bool {
        let all = [others, some].concat();
        let products = self.products_of(&all, beside);
        let left = beside.project_out_set(&products);
        (others.len()..all.len()).all(|k| {
            let mut which: Vec<usize> = (0..others.len()).collect();
            which.push(k);
            let gram = left.select_rows(&which).select_columns(&which);
            solve_gram(&gram).1 <= INDEPENDENCE_TOLERANCE * products.own[(k, k)]
        })
    }

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
    /// What the set leaves of inner products; what is rounding beside a column's own is nothing.
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

    fn explained_squares(&self, products: &InnerProductBlocks) -> f64 {
        let n = products.own.nrows();
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
