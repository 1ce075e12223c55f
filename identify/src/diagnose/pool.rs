//! Inner products of columns, channel by channel and apart for fit and check, so that any set of columns is fitted in
//! microseconds.
//!
//! Decision: a search fits many thousands of sets, so samples are read once. Weights, which change with each
//! accepted step, multiply finished sums. Inner products square the condition number; scaled columns and lower
//! bounds for a new column guard the digits.

use std::array;
use std::borrow::Cow;
use std::cell::RefCell;
use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use pulp::Arch;

use super::column::ForceColumn;
use super::numbered::ColumnMap;
use super::problem::SampleLayout;
use super::tile;

/// Inner products of a column with earlier ones by part (0 is the fit, 1 the check) and channel on which both act, the parts one
/// after the other; or by fold and channel.
type PairProducts = ColumnMap<Box<[f64]>>;
/// Inner products of fewer numbers are made as they stand.
const SHORT: usize = 64;
/// Sums that an inner product has at once.
pub(crate) const LANES: usize = 16;
/// Folds of the cross-validation where there is no check.
const FOLDS: usize = 10;
/// Fewer inner products of a tile are made one by one.
const FEW: usize = 3;

/// Columns with their inner products, each of which is computed when it is asked for first.
pub(crate) struct ColumnPool<'a> {
    columns: Vec<Cow<'a, ForceColumn>>,
    /// Channels on which each column acts, a bit for each.
    acts: Vec<Box<[u64]>>,
    /// How many there are.
    channels: usize,
    fit: Range<usize>,
    check: Range<usize>,
    products: RefCell<Vec<PairProducts>>,
    of_folds: RefCell<Vec<PairProducts>>,
    /// Folds of all samples.
    folds: Vec<Range<usize>>,
    /// Samples that were not measured, by channel: nothing counts them.
    lost: Vec<Vec<bool>>,
    /// Samples that are left out of every product, by channel and in order; the lost ones are among them.
    left_out: Vec<Vec<usize>>,
    /// What is known of the factors of the first columns beforehand, as further equations: the inverse of their covariance.
    pub(crate) prior_equations: Option<DMatrix<f64>>,
}

impl<'a> ColumnPool<'a> {
    pub(crate) fn new(layout: &SampleLayout) -> Self {
        let fit = layout.fit_samples();
        Self {
            columns: Vec::new(),
            acts: Vec::new(),
            channels: layout.channels.len(),
            fit: 0..fit,
            check: fit..layout.samples(),
            products: RefCell::default(),
            of_folds: RefCell::default(),
            folds: layout.blocks(FOLDS),
            lost: layout.left_out.clone(),
            left_out: layout
                .left_out
                .iter()
                .map(|out| true_indices(out))
                .collect(),
            prior_equations: None,
        }
    }

    /// Leaves further samples out of all products and of what is left.
    pub(crate) fn exclude_samples(mut self, left_out: &[Vec<bool>]) -> Self {
        let all = left_out.iter().enumerate().map(|(d, out)| {
            let lost = self.lost.get(d);
            let either = out.iter().enumerate().map(|(i, out)| {
                *out || lost.is_some_and(|lost| lost.get(i).copied().unwrap_or(false))
            });
            true_indices(&either.collect::<Vec<bool>>())
        });
        if !left_out.is_empty() {
            self.left_out = all.collect();
        }
        self
    }

    /// Inner product of two columns' values on a channel over some samples, without those that are left out.
    pub(crate) fn inner_product(
        &self,
        channel: usize,
        a: &[f64],
        b: &[f64],
        range: Range<usize>,
    ) -> f64 {
        let less = self.excluded_product(channel, a, b, &range);
        dot(&a[range.clone()], &b[range]) - less
    }

    /// What samples that are left out would add to an inner product.
    fn excluded_product(&self, channel: usize, a: &[f64], b: &[f64], range: &Range<usize>) -> f64 {
        let out = self.left_out.get(channel).map_or(&[][..], Vec::as_slice);
        let from = out.partition_point(|i| *i < range.start);
        let to = out.partition_point(|i| *i < range.end);
        out[from..to].iter().map(|i| a[*i] * b[*i]).sum()
    }

    /// All samples.
    pub(crate) fn all_samples(&self) -> Range<usize> {
        0..self.check.end
    }

    /// Makes a series that begins at a sample zero where samples are left out.
    pub(crate) fn zero_excluded(&self, channel: usize, start: usize, values: &mut [f64]) {
        let out = self.left_out.get(channel).map_or(&[][..], Vec::as_slice);
        let from = out.partition_point(|i| *i < start);
        let to = out.partition_point(|i| *i < start + values.len());
        for i in &out[from..to] {
            values[i - start] = 0.0;
        }
    }

    /// Adds a column; its place.
    pub(crate) fn add(&mut self, column: impl Into<Cow<'a, ForceColumn>>) -> usize {
        let column = column.into();
        let mut acts = vec![0; column.0.len().div_ceil(64)];
        for d in column.channels() {
            acts[d / 64] |= 1 << (d % 64);
        }
        self.acts.push(acts.into());
        self.columns.push(column);
        self.products.get_mut().push(PairProducts::default());
        self.of_folds.get_mut().push(PairProducts::default());
        self.columns.len() - 1
    }

    pub(crate) fn len(&self) -> usize {
        self.columns.len()
    }

    /// Takes the columns from a place on out again, with all their products.
    pub(crate) fn split_off(&mut self, known: usize) -> Vec<Cow<'a, ForceColumn>> {
        self.acts.truncate(known);
        self.products.get_mut().truncate(known);
        self.of_folds.get_mut().truncate(known);
        self.columns.split_off(known)
    }

    /// Lets go of what a column holds; its place is not given to another.
    pub(crate) fn release_column(&mut self, k: usize) {
        self.acts[k].fill(0);
        self.columns[k] = Cow::Owned(ForceColumn::default());
        self.products.get_mut()[k] = PairProducts::default();
        self.of_folds.get_mut()[k] = PairProducts::default();
    }

    pub(crate) fn column(&self, k: usize) -> &ForceColumn {
        &self.columns[k]
    }

    /// The values of a column on a channel; `None` where they are zero throughout.
    fn values(&self, k: usize, channel: usize) -> Option<&[f64]> {
        self.columns[k].0.get(channel)?.as_deref()
    }

    fn acts_on(&self, k: usize, channel: usize) -> bool {
        let word = self.acts[k].get(channel / 64);
        word.is_some_and(|word| word >> (channel % 64) & 1 == 1)
    }

    /// Whether two columns act on a channel both.
    fn has_common_channel(&self, a: usize, b: usize) -> bool {
        let mut words = self.acts[a].iter().zip(&*self.acts[b]);
        words.any(|(a, b)| a & b != 0)
    }

    /// Inner products of two columns by part and common channel.
    fn products_of(&self, a: usize, b: usize) -> Box<[f64]> {
        let [a, b] = [a, b].map(|k| &self.columns[k]);
        let parts = [&self.fit, &self.check].into_iter();
        let of_part = |range: &Range<usize>| {
            let range = range.clone();
            let common = a.common_channels(b);
            common.map(move |(d, a, b)| self.inner_product(d, a, b, range.clone()))
        };
        parts.flat_map(of_part).collect()
    }

    /// Computes the inner products of some columns that are not known yet, those of neighbours together.
    pub(crate) fn compute_products(&self, which: &[usize]) {
        let mut which = which.to_vec();
        // Neighbours act on the same channels.
        which.sort_unstable_by_key(|k| (&self.acts[*k], *k));
        which.dedup();
        let mut products = self.products.borrow_mut();
        let groups: Vec<&[usize]> = which.chunks(tile::SIDE).collect();
        for (i, rows) in groups.iter().enumerate() {
            for columns in &groups[..=i] {
                let mut unknown = Vec::with_capacity(tile::SIDE * tile::SIDE);
                for (r, a) in rows.iter().enumerate() {
                    for (c, b) in columns.iter().enumerate() {
                        let is_twice = rows == columns && c > r;
                        let (later, earlier) = (*a.max(b), a.min(b));
                        if !is_twice
                            && self.has_common_channel(*a, *b)
                            && !products[later].contains_key(earlier)
                        {
                            unknown.push((r, c));
                        }
                    }
                }
                if unknown.len() < FEW {
                    continue; // Single products cost less.
                }
                let made = self.compute_tile(rows, columns, &unknown);
                for ((r, c), found) in unknown.into_iter().zip(made) {
                    let (a, b) = (rows[r], columns[c]);
                    products[a.max(b)].insert(a.min(b), found);
                }
            }
        }
    }

    /// The same as [`ColumnPool::products_of`] of some pairs of a tile, in their order.
    fn compute_tile(
        &self,
        rows: &[usize],
        columns: &[usize],
        pairs: &[(usize, usize)],
    ) -> Vec<Box<[f64]>> {
        let mut found: Vec<Vec<f64>> = vec![Vec::new(); pairs.len()];
        for part in [&self.fit, &self.check] {
            for d in 0..self.channels {
                let r: [_; tile::SIDE] = array::from_fn(|k| self.values(*rows.get(k)?, d));
                let c: [_; tile::SIDE] = array::from_fn(|k| self.values(*columns.get(k)?, d));
                let Some(any) = r.iter().flatten().next() else {
                    continue;
                };
                if !pairs
                    .iter()
                    .any(|(i, j)| r[*i].is_some() && c[*j].is_some())
                {
                    continue;
                }
                // Those that do not act here stand in for nothing.
                let rows = r.map(|one| &one.unwrap_or(any)[part.clone()]);
                let columns = c.map(|one| &one.unwrap_or(any)[part.clone()]);
                let sums = tile::tile_products(rows, columns);
                for (found, (i, j)) in found.iter_mut().zip(pairs) {
                    if let (Some(a), Some(b)) = (r[*i], c[*j]) {
                        found.push(sums[*i][*j] - self.excluded_product(d, a, b, part));
                    }
                }
            }
        }
        found.into_iter().map(Vec::into_boxed_slice).collect()
    }

    /// Weighted inner product of two columns on all samples.
    pub(crate) fn weighted_product(&self, a: usize, b: usize, weights: &[f64]) -> f64 {
        self.scoped_product(a, b, weights, FitScope::All)
    }

    /// The same of columns that need not be in the pool, computed anew.
    pub(crate) fn weighted_product_of(
        &self,
        a: &ForceColumn,
        b: &ForceColumn,
        weights: &[f64],
    ) -> f64 {
        let on = |(d, a, b)| weights[d] * self.inner_product(d, a, b, self.all_samples());
        a.common_channels(b).map(on).sum()
    }

    fn scoped_product(&self, a: usize, b: usize, weights: &[f64], on: FitScope) -> f64 {
        if !self.has_common_channel(a, b) {
            return 0.0;
        }
        let (a, b) = (a.max(b), a.min(b));
        let mut products = self.products.borrow_mut();
        let known = products[a]
            .entry(b)
            .or_insert_with(|| self.products_of(a, b));
        let (fit, check) = known.split_at(known.len() / 2);
        // Which channels these are is told without a look at the columns.
        let common = (0..self.channels).filter(|d| self.acts_on(a, *d) && self.acts_on(b, *d));
        let sums = common.zip(fit.iter().zip(check)).map(|(d, (fit, check))| {
            weights[d]
                * if on == FitScope::All {
                    fit + check
                } else {
                    *fit
                }
        });
        sums.sum()
    }

    /// Weighted inner products of some columns on fit, check or both.
    pub(crate) fn gram(&self, which: &[usize], weights: &[f64], on: FitScope) -> DMatrix<f64> {
        let n = which.len();
        let mut gram = DMatrix::zeros(n, n);
        for i in 0..n {
            for j in 0..=i {
                let sum = self.scoped_product(which[i], which[j], weights, on)
                    + self.prior_term(which[i], which[j]);
                gram[(i, j)] = sum;
                gram[(j, i)] = sum;
            }
        }
        gram
    }

    /// What is known of two factors before any sample, as part of their inner product.
    fn prior_term(&self, a: usize, b: usize) -> f64 {
        let entry = self
            .prior_equations
            .as_ref()
            .and_then(|prior| prior.get((a, b)));
        entry.copied().unwrap_or(0.0)
    }

    /// Weighted inner products of some columns on each fold.
    pub(crate) fn fold_grams(
        &self,
        which: &[usize],
        weights: &[f64],
    ) -> Vec<(Range<usize>, DMatrix<f64>)> {
        let n = which.len();
        let mut grams = vec![DMatrix::zeros(n, n); self.folds.len()];
        let mut products = self.of_folds.borrow_mut();
        let mut common: Vec<f64> = Vec::new();
        for i in 0..n {
            for j in 0..=i {
                let (a, b) = (which[i].max(which[j]), which[i].min(which[j]));
                // Each fold has its share of it.
                let before = self.prior_term(a, b) / self.folds.len() as f64;
                for gram in &mut grams {
                    gram[(i, j)] = before;
                    gram[(j, i)] = before;
                }
                if !self.has_common_channel(a, b) {
                    continue;
                }
                let both = || self.columns[a].common_channels(&self.columns[b]);
                common.clear();
                common.extend(both().map(|(d, ..)| weights[d]));
                let known = products[a].entry(b).or_insert_with(|| {
                    let of_fold = |fold: &Range<usize>| {
                        let fold = fold.clone();
                        both().map(move |(d, a, b)| self.inner_product(d, a, b, fold.clone()))
                    };
                    self.folds.iter().flat_map(of_fold).collect()
                });
                for (gram, part) in grams.iter_mut().zip(known.chunks(common.len())) {
                    let sum: f64 = part.iter().zip(&common).map(|(p, w)| p * w).sum();
                    gram[(i, j)] = sum + before;
                    gram[(j, i)] = sum + before;
                }
            }
        }
        self.folds.iter().cloned().zip(grams).collect()
    }

    /// What is left of the column `of` when others are taken off with some factors; zero where samples are left out.
    pub(crate) fn residual(&self, of: usize, others: &[usize], factors: &[f64]) -> Vec<Vec<f64>> {
        let mut rest = self.full_residual(of, others, factors);
        for (d, rest) in rest.iter_mut().enumerate() {
            self.zero_excluded(d, 0, rest);
        }
        rest
    }

    /// The same of all samples but those that were not measured.
    pub(crate) fn full_residual(
        &self,
        of: usize,
        others: &[usize],
        factors: &[f64],
    ) -> Vec<Vec<f64>> {
        let samples = self.check.end;
        let mut rest: Vec<Vec<f64>> = (self.columns[of].0.iter())
            .map(|values| values.clone().unwrap_or_else(|| vec![0.0; samples]))
            .collect();
        for (k, factor) in others.iter().zip(factors) {
            for (rest, values) in rest.iter_mut().zip(&self.columns[*k].0) {
                if let Some(values) = values {
                    for (r, x) in rest.iter_mut().zip(values) {
                        *r -= factor * x;
                    }
                }
            }
        }
        for (rest, out) in rest.iter_mut().zip(&self.lost) {
            zero_where(rest, out);
        }
        rest
    }
}

/// Where something is said, in order.
fn true_indices(said: &[bool]) -> Vec<usize> {
    let samples = said.iter().enumerate();
    samples.filter_map(|(i, said)| said.then_some(i)).collect()
}

fn zero_where(values: &mut [f64], out: &[bool]) {
    for (value, _) in values.iter_mut().zip(out).filter(|(_, out)| **out) {
        *value = 0.0;
    }
}

/// Samples that count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FitScope {
    /// Those of the fit.
    Fit,
    /// All.
    All,
}

/// Inner product; several sums at once, which is faster and rounds less. The sums are the same in vectors of any width, so that
/// a diagnosis decides alike on every machine.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    // Of a few numbers the choice would cost more than the sum.
    if a.len() < SHORT {
        return sum_products(a, b);
    }
    Arch::new().dispatch(|| sum_products(a, b))
}

#[allow(
    clippy::inline_always,
    reason = "what is inlined has the vectors of its caller"
)]
#[inline(always)]
fn sum_products(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; LANES];
    let (chunks_a, chunks_b) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let tail: f64 = chunks_a
        .remainder()
        .iter()
        .zip(chunks_b.remainder())
        .map(|(x, y)| x * y)
        .sum();
    for (x, y) in chunks_a.zip(chunks_b) {
        for (sum, (x, y)) in sums.iter_mut().zip(x.iter().zip(y)) {
            *sum += x * y;
        }
    }
    sums.iter().sum::<f64>() + tail
}

/// A least squares fit from inner products: factors of the first columns, by which the last is explained best, and the
/// sum of squares that is left. Columns that depend on those before them get the factor zero.
pub(crate) fn solve_gram(gram: &DMatrix<f64>) -> (DVector<f64>, f64) {
    let n = gram.nrows() - 1;
    // Cholesky's decomposition with columns scaled to 1; rows of the factor are columns here, which lie in one piece.
    let scale: Vec<f64> = (0..=n).map(|i| gram[(i, i)].sqrt()).collect();
    let mut upper = DMatrix::<f64>::zeros(n + 1, n + 1);
    let mut kept = vec![false; n];
    for i in 0..=n {
        if scale[i] == 0.0 {
            continue;
        }
        for j in 0..=i {
            if j < i && !kept[j] {
                continue;
            }
            let known = dot(
                &upper.column(i).as_slice()[..j],
                &upper.column(j).as_slice()[..j],
            );
            let sum = gram[(j, i)] / (scale[i] * scale[j]) - known;
            if j < i {
                upper[(j, i)] = sum / upper[(j, j)];
            } else if i == n {
                upper[(n, n)] = sum.max(0.0);
            } else if sum > DEPENDENT {
                kept[i] = true;
                upper[(i, i)] = sum.sqrt();
            } else {
                upper.column_mut(i).fill(0.0);
            }
        }
    }
    let mut factors = DVector::zeros(n);
    for i in (0..n).rev() {
        if !kept[i] {
            continue;
        }
        let mut sum = upper[(i, n)];
        for k in i + 1..n {
            if kept[k] {
                sum -= upper[(i, k)] * factors[k];
            }
        }
        factors[i] = sum / upper[(i, i)];
    }
    for i in 0..n {
        if kept[i] {
            factors[i] *= scale[n] / scale[i];
        }
    }
    (factors, upper[(n, n)] * scale[n] * scale[n])
}

/// Share of a column's squares below which what others leave of it is rounding.
pub(crate) const DEPENDENT: f64 = 1e-9;

#[cfg(test)]
mod tests {
    use super::super::problem::SampleSegment;
    use super::*;

    #[test]
    fn sets_of_columns_are_fitted_as_by_svd() {
        let layout = SampleLayout {
            channels: vec!["a".into(), "b".into()],
            segments: vec![SampleSegment {
                name: String::new(),
                samples: 50,
                step: 0.1,
                recorded_step: 0.1,
                is_check: false,
            }],
            left_out: Vec::new(),
        };
        let wave = |k: f64| -> Vec<f64> { (0..50).map(|i| (k * f64::from(i)).sin()).collect() };
        let mut pool = ColumnPool::new(&layout);
        let one = pool.add(ForceColumn(vec![Some(wave(0.1)), None]));
        let two = pool.add(ForceColumn(vec![Some(wave(0.3)), Some(wave(0.5))]));
        let copy = pool.add(ForceColumn(vec![Some(wave(0.1)), None]));
        let mut measured = ForceColumn(vec![Some(wave(1.3)), Some(wave(0.9))]);
        measured.add(2.0, pool.column(one));
        measured.add(-3.0, pool.column(two));
        let y = pool.add(measured.clone());
        let weights = [1.0, 4.0];
        let (factors, squares) =
            solve_gram(&pool.gram(&[one, two, copy, y], &weights, FitScope::All));
        let column = |k: usize| -> Vec<f64> {
            let part = |d: usize| pool.column(k).0[d].clone().unwrap_or_else(|| vec![0.0; 50]);
            let weighed = part(1).into_iter().map(|x| 2.0 * x);
            part(0).into_iter().chain(weighed).collect()
        };
        let matrix = DMatrix::from_columns(&[column(one).into(), column(two).into()]);
        let right = DVector::from(column(y));
        let expected = matrix.clone().svd(true, true).solve(&right, 0.0).unwrap();
        assert!(
            (factors[0] - expected[0]).abs() < 1e-10 && (factors[1] - expected[1]).abs() < 1e-10
        );
        assert!(factors[2].abs() < f64::MIN_POSITIVE);
        let rest = (matrix * expected - right).norm_squared();
        assert!((squares - rest).abs() < 1e-9 * rest);
        let residual = pool.residual(y, &[one, two], &[factors[0], factors[1]]);
        let weighed = dot(&residual[0], &residual[0]) + 4.0 * dot(&residual[1], &residual[1]);
        assert!((weighed - rest).abs() < 1e-9 * rest);
    }
    /// What stands in the place of a force that was not measured moves nothing.
    #[test]
    fn forces_that_lack_have_no_say() {
        let wave = |k: f64| -> Vec<f64> { (0..50).map(|i| (k * f64::from(i)).sin()).collect() };
        let mut layout = SampleLayout {
            channels: vec!["a".into()],
            segments: vec![SampleSegment {
                name: String::new(),
                samples: 50,
                step: 0.1,
                recorded_step: 0.1,
                is_check: false,
            }],
            left_out: Vec::new(),
        };
        let found = |layout: &SampleLayout| {
            let mut pool = ColumnPool::new(layout);
            let one = pool.add(ForceColumn(vec![Some(wave(0.3))]));
            let mut forces: Vec<f64> = wave(0.3).iter().map(|x| 2.0 * x).collect();
            forces[17] = 100.0;
            let y = pool.add(ForceColumn(vec![Some(forces)]));
            let (factors, squares) = solve_gram(&pool.gram(&[one, y], &[1.0], FitScope::All));
            let rest = pool.residual(y, &[one], &[factors[0]]);
            (factors[0], squares, rest[0][17])
        };
        assert!((found(&layout).0 - 2.0).abs() > 0.1);
        layout.left_out = vec![(0..50).map(|i| i == 17).collect()];
        let (factor, squares, rest) = found(&layout);
        assert!((factor - 2.0).abs() < 1e-12 && squares < 1e-12 && rest.abs() < 1e-12);
    }
}
