//! A fitted set of effects, and what further columns explain beside it: all from inner products, so that no sample is touched
//! again.

use nalgebra::{DMatrix, DVector};

use super::bench::{Bench, Pick};
use super::column::Column;
use super::factored::Factored;
use super::pool::{On, solve};

/// A column of which the others leave a smaller share of squares than this says nothing new.
const SAID: f64 = 1e-6;
/// Shares of a column's squares below this are rounding.
const ROUNDING: f64 = 1e-7;

/// A set that is fitted to all samples with the base parameters.
#[derive(Default)]
pub(crate) struct Beside {
    /// Its columns, those of the base first.
    which: Vec<usize>,
    factor: Factored,
    pub(crate) factors: DVector<f64>,
    squares: f64,
}

/// Weighted inner products of some columns.
struct Products {
    /// With each other.
    own: DMatrix<f64>,
    /// With those of the set, a column for each.
    with: DMatrix<f64>,
    /// With the measured forces.
    measured: DVector<f64>,
}

impl Bench<'_> {
    pub(crate) fn beside(&self, picks: &[Pick]) -> Beside {
        let mut all = self.columns(picks);
        all.push(self.measured);
        let gram = self.pool.gram(&all, &self.weights, On::All);
        let n = all.len() - 1;
        let (factors, squares) = solve(&gram);
        all.pop();
        Beside {
            which: all,
            factor: Factored::new(&gram.view((0, 0), (n, n)).into_owned()),
            factors,
            squares,
        }
    }

    /// By how much columns of the pool would lower the weighted sum of squares beside a set.
    pub(crate) fn explained(&self, columns: &[usize], beside: &Beside) -> f64 {
        beside.explained(&self.products_of(columns, beside))
    }

    /// The same of columns that are not in the pool.
    pub(crate) fn explained_by(&self, columns: &[Column], beside: &Beside) -> f64 {
        let product = |a: &Column, b: &Column| self.pool.product_of(a, b, &self.weights);
        let in_pool = |k: usize| self.pool.column(k);
        let (n, m) = (columns.len(), beside.which.len());
        beside.explained(&Products {
            own: DMatrix::from_fn(n, n, |i, j| product(&columns[i], &columns[j])),
            with: DMatrix::from_fn(m, n, |i, j| product(in_pool(beside.which[i]), &columns[j])),
            measured: DVector::from_fn(n, |i, _| product(in_pool(self.measured), &columns[i])),
        })
    }

    /// How many of some columns say something that a set does not say already.
    pub(crate) fn rank(&self, columns: &[usize], beside: &Beside) -> usize {
        let products = self.products_of(columns, beside);
        let mut left = beside.left(&products);
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
        values.iter().filter(|value| **value > SAID).count()
    }

    /// Whether some columns lie in the span of others and a set.
    pub(crate) fn lies_within(&self, some: &[usize], others: &[usize], beside: &Beside) -> bool {
        let all = [others, some].concat();
        let products = self.products_of(&all, beside);
        let left = beside.left(&products);
        (others.len()..all.len()).all(|k| {
            let mut which: Vec<usize> = (0..others.len()).collect();
            which.push(k);
            let gram = left.select_rows(&which).select_columns(&which);
            solve(&gram).1 <= SAID * products.own[(k, k)]
        })
    }

    fn products_of(&self, columns: &[usize], beside: &Beside) -> Products {
        let product = |a: usize, b: usize| self.pool.product(a, b, &self.weights);
        let (n, m) = (columns.len(), beside.which.len());
        Products {
            own: DMatrix::from_fn(n, n, |i, j| product(columns[i], columns[j])),
            with: DMatrix::from_fn(m, n, |i, j| product(beside.which[i], columns[j])),
            measured: DVector::from_fn(n, |i, _| product(self.measured, columns[i])),
        }
    }
}

impl Beside {
    /// What the set leaves of inner products; what is rounding beside a column's own is nothing.
    fn left(&self, products: &Products) -> DMatrix<f64> {
        let halves = self.factor.halves(&products.with);
        let mut left = &products.own - halves.transpose() * &halves;
        for i in 0..left.nrows() {
            if left[(i, i)] < ROUNDING * products.own[(i, i)] {
                left[(i, i)] = 0.0;
            }
        }
        left
    }

    fn explained(&self, products: &Products) -> f64 {
        let n = products.own.nrows();
        let right = &products.measured - products.with.transpose() * &self.factors;
        let mut gram = self.left(products).resize(n + 1, n + 1, 0.0);
        for i in 0..n {
            gram[(i, n)] = right[i];
            gram[(n, i)] = right[i];
        }
        gram[(n, n)] = self.squares;
        self.squares - solve(&gram).1
    }
}
