//! Inner products of columns, by channel and separately for fit and validation, so that any set of columns is fitted in
//! microseconds.
//!
//! Decision: a search fits many thousands of sets, so samples are read once. Weights, which change with each
//! accepted step, multiply finished sums. Inner products square the condition number; scaled columns and lower
//! bounds for a new column guard the digits.

use std::array;
use std::borrow::Cow;
use std::cell::{OnceCell, RefCell};
use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::column::ForceColumn;
use super::numbered::ColumnMap;
use super::problem::SampleLayout;
use super::tile;
use crate::signal::{add_multiples, dot};

/// Inner products of a column with earlier ones, by part (0 is the fit, 1 the validation) and channel on which both
/// act, first all channels of one part. In the maps for folds they are ordered by fold and channel.
type PairProducts = ColumnMap<Box<[f64]>>;
/// Folds of the cross-validation where there is no check.
const FOLDS: usize = 10;
/// If fewer products of a tile are unknown, they are computed one by one.
const FEW: usize = 3;

/// Columns with their inner products, each of which is computed when it is first needed.
pub(crate) struct ColumnPool<'a> {
    /// The columns; callers refer to them by index.
    columns: Vec<Cow<'a, ForceColumn>>,
    /// Channels on which each column acts, one bit per channel.
    acts: Vec<Box<[u64]>>,
    /// Number of channels.
    channels: usize,
    /// Samples of the fit.
    fit: Range<usize>,
    /// Samples of the validation runs.
    check: Range<usize>,
    /// Known inner products of each column.
    products: RefCell<Vec<PairProducts>>,
    /// Known inner products of each column by fold.
    of_folds: RefCell<Vec<PairProducts>>,
    /// Folds of all samples.
    folds: Vec<Range<usize>>,
    /// Samples that were not measured, `[channel][sample]`: they never count.
    lost: Vec<Vec<bool>>,
    /// Indices of the samples that are excluded from every product, by channel and sorted; those that were not measured
    /// are among them.
    left_out: Vec<Vec<usize>>,
    /// Prior knowledge of the factors of the first columns, as further equations: the inverse of their covariance.
    pub(crate) prior_equations: Option<DMatrix<f64>>,
    /// Largest force of each channel, N or N m; infinite where there is none.
    pub(crate) force_scales: Vec<f64>,
    /// The range of each column relative to these forces, computed when it is first needed.
    relative_ranges: Vec<OnceCell<f64>>,
}

impl<'a> ColumnPool<'a> {
    /// An empty pool for a layout of samples.
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
            left_out: layout.left_out.iter().map(|out| true_indices(out)).collect(),
            prior_equations: None,
            force_scales: Vec::new(),
            relative_ranges: Vec::new(),
        }
    }

    /// Excludes further samples, `[channel][sample]`, from all products and residuals.
    pub(crate) fn exclude_samples(mut self, left_out: &[Vec<bool>]) -> Self {
        // Unite the new exclusions with the samples that were not measured.
        let all = left_out.iter().enumerate().map(|(d, out)| {
            let lost = self.lost.get(d);
            let either = out
                .iter()
                .enumerate()
                .map(|(i, out)| *out || lost.is_some_and(|lost| lost.get(i).copied().unwrap_or(false)));
            true_indices(&either.collect::<Vec<bool>>())
        });
        if !left_out.is_empty() {
            self.left_out = all.collect();
        }
        self
    }

    /// Inner product of two columns' values on a channel over a range of samples, without excluded ones.
    pub(crate) fn inner_product(&self, channel: usize, a: &[f64], b: &[f64], range: Range<usize>) -> f64 {
        let less = self.excluded_product(channel, a, b, &range);
        dot(&a[range.clone()], &b[range]) - less
    }

    /// Contribution of the excluded samples to an inner product.
    fn excluded_product(&self, channel: usize, a: &[f64], b: &[f64], range: &Range<usize>) -> f64 {
        let out = self.left_out.get(channel).map_or(&[][..], Vec::as_slice);
        let from = out.partition_point(|i| *i < range.start);
        let to = out.partition_point(|i| *i < range.end);
        out[from..to].iter().map(|i| a[*i] * b[*i]).sum()
    }

    /// Number of samples of a channel in a range that are not excluded.
    pub(crate) fn counted_samples(&self, channel: usize, range: &Range<usize>) -> usize {
        let out = self.left_out.get(channel).map_or(&[][..], Vec::as_slice);
        let from = out.partition_point(|i| *i < range.start);
        let to = out.partition_point(|i| *i < range.end);
        range.len() - (to - from)
    }

    /// Mean square of a series over all samples of a channel that are not excluded; excluded ones must be zero.
    pub(crate) fn mean_square(&self, channel: usize, values: &[f64]) -> f64 {
        dot(values, values) / self.counted_samples(channel, &(0..values.len())).max(1) as f64
    }

    /// The values of a range that are not excluded.
    pub(crate) fn counted_values(&self, channel: usize, values: &[f64], range: Range<usize>) -> Vec<f64> {
        let out = self.left_out.get(channel).map_or(&[][..], Vec::as_slice);
        let from = out.partition_point(|i| *i < range.start);
        let mut out = out[from..].iter().peekable();
        let is_counted = |i: &usize| out.next_if(|excluded| *excluded == i).is_none();
        range.filter(is_counted).map(|i| values[i]).collect()
    }

    /// Range of all samples.
    pub(crate) fn all_samples(&self) -> Range<usize> {
        0..self.check.end
    }

    /// Sets the excluded samples of a series to zero; the series begins at the sample `start`.
    pub(crate) fn zero_excluded(&self, channel: usize, start: usize, values: &mut [f64]) {
        let out = self.left_out.get(channel).map_or(&[][..], Vec::as_slice);
        let from = out.partition_point(|i| *i < start);
        let to = out.partition_point(|i| *i < start + values.len());
        for i in &out[from..to] {
            values[i - start] = 0.0;
        }
    }

    /// Adds a column and returns its index.
    pub(crate) fn add(&mut self, column: impl Into<Cow<'a, ForceColumn>>) -> usize {
        let column = column.into();
        // Store the channels as bits, so that common channels are found without reading values.
        let mut acts = vec![0; column.0.len().div_ceil(64)];
        for d in column.channels() {
            acts[d / 64] |= 1 << (d % 64);
        }
        self.acts.push(acts.into());
        self.columns.push(column);
        self.products.get_mut().push(PairProducts::default());
        self.of_folds.get_mut().push(PairProducts::default());
        self.relative_ranges.push(OnceCell::new());
        self.columns.len() - 1
    }

    /// Number of columns, released ones included.
    pub(crate) fn len(&self) -> usize {
        self.columns.len()
    }

    /// Removes all columns from an index on, with their products, and returns them.
    pub(crate) fn split_off(&mut self, known: usize) -> Vec<Cow<'a, ForceColumn>> {
        self.acts.truncate(known);
        self.relative_ranges.truncate(known);
        self.products.get_mut().truncate(known);
        self.of_folds.get_mut().truncate(known);
        self.columns.split_off(known)
    }

    /// Releases the memory of a column; its index is not used again.
    pub(crate) fn release_column(&mut self, k: usize) {
        self.acts[k].fill(0);
        self.columns[k] = Cow::Owned(ForceColumn::default());
        self.relative_ranges[k] = OnceCell::new();
        self.products.get_mut()[k] = PairProducts::default();
        self.of_folds.get_mut()[k] = PairProducts::default();
    }

    /// The column with an index.
    pub(crate) fn column(&self, k: usize) -> &ForceColumn {
        &self.columns[k]
    }

    /// Half of the range of a column's values, relative to the largest force of the channel; of several channels the
    /// largest. A constant column has no range: its force may balance an origin of a coordinate.
    pub(crate) fn relative_range(&self, k: usize) -> f64 {
        *self.relative_ranges[k].get_or_init(|| {
            let channels = self.columns[k].0.iter().zip(&self.force_scales);
            let ranges = channels.filter_map(|(values, scale)| {
                let values = values.as_ref()?;
                let (low, high) = values
                    .iter()
                    .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
                        (low.min(*x), high.max(*x))
                    });
                Some(0.5 * (high - low) / scale)
            });
            ranges.filter(|range| range.is_finite()).fold(0.0, f64::max)
        })
    }

    /// Values of a column on a channel; `None` where they are all zero.
    fn values(&self, k: usize, channel: usize) -> Option<&[f64]> {
        self.columns[k].0.get(channel)?.as_deref()
    }

    /// Whether a column acts on a channel.
    fn acts_on(&self, k: usize, channel: usize) -> bool {
        // One bit per channel, 64 in a word.
        let word = self.acts[k].get(channel / 64);
        word.is_some_and(|word| word >> (channel % 64) & 1 == 1)
    }

    /// Whether there is a channel on which both columns act.
    fn has_common_channel(&self, a: usize, b: usize) -> bool {
        let mut words = self.acts[a].iter().zip(&*self.acts[b]);
        words.any(|(a, b)| a & b != 0)
    }

    /// Computes the inner products of two columns by part and common channel.
    fn products_of(&self, a: usize, b: usize) -> Box<[f64]> {
        let [a, b] = [a, b].map(|k| &self.columns[k]);
        // Fit and validation separately, each over the common channels.
        let parts = [&self.fit, &self.check].into_iter();
        let of_part = |range: &Range<usize>| {
            let range = range.clone();
            let common = a.common_channels(b);
            common.map(move |(d, a, b)| self.inner_product(d, a, b, range.clone()))
        };
        parts.flat_map(of_part).collect()
    }

    /// Computes the unknown inner products of some columns, in tiles of neighbouring columns.
    pub(crate) fn compute_products(&self, which: &[usize]) {
        let mut which = which.to_vec();
        // Sorted by channels, the columns of a tile mostly act on the same ones.
        which.sort_unstable_by_key(|k| (&self.acts[*k], *k));
        which.dedup();
        // Every pair of groups is a tile of at most SIDE x SIDE products.
        let groups: Vec<&[usize]> = which.chunks(tile::SIDE).collect();
        for (i, rows) in groups.iter().enumerate() {
            for columns in &groups[..=i] {
                self.compute_unknown_of_tile(rows, columns);
            }
        }
    }

    /// Computes the unknown inner products of some columns with some others, in tiles.
    pub(crate) fn compute_cross_products(&self, some: &[usize], others: &[usize]) {
        let [some, others] = [some, others].map(|which| {
            let mut which = which.to_vec();
            which.sort_unstable_by_key(|k| (&self.acts[*k], *k));
            which.dedup();
            which
        });
        for rows in some.chunks(tile::SIDE) {
            for columns in others.chunks(tile::SIDE) {
                self.compute_unknown_of_tile(rows, columns);
            }
        }
    }

    /// Computes the unknown inner products of a tile.
    fn compute_unknown_of_tile(&self, rows: &[usize], columns: &[usize]) {
        let mut products = self.products.borrow_mut();
        let mut unknown = Vec::with_capacity(tile::SIDE * tile::SIDE);
        for (r, a) in rows.iter().enumerate() {
            for (c, b) in columns.iter().enumerate() {
                // A tile on the diagonal has each pair twice.
                let is_twice = rows == columns && c > r;
                // A product is stored with the column of the larger index.
                let (later, earlier) = (a.max(b), a.min(b));
                if !is_twice && self.has_common_channel(*a, *b) && !products[*later].contains_key(earlier) {
                    unknown.push((r, c));
                }
            }
        }
        if unknown.len() < FEW {
            return; // Single products cost less.
        }
        // One pass over the samples gives all unknown products of the tile.
        let made = self.compute_tile(rows, columns, &unknown);
        for ((r, c), found) in unknown.into_iter().zip(made) {
            let (a, b) = (rows[r], columns[c]);
            products[a.max(b)].insert(a.min(b), found);
        }
    }

    /// The same as [`Self::products_of`] for some pairs of a tile, in their order; a pair is (row, column) within the
    /// tile.
    fn compute_tile(&self, rows: &[usize], columns: &[usize], pairs: &[(usize, usize)]) -> Vec<Box<[f64]>> {
        let mut found: Vec<Vec<f64>> = vec![Vec::new(); pairs.len()];
        for part in [&self.fit, &self.check] {
            for d in 0..self.channels {
                let r: [_; tile::SIDE] = array::from_fn(|k| self.values(*rows.get(k)?, d));
                let c: [_; tile::SIDE] = array::from_fn(|k| self.values(*columns.get(k)?, d));
                // No row of the tile acts on this channel.
                let Some(any) = r.iter().flatten().next() else {
                    continue;
                };
                if !pairs.iter().any(|(i, j)| r[*i].is_some() && c[*j].is_some()) {
                    continue;
                }
                // Columns that do not act on this channel are replaced by any other one; their products are not used.
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

    /// Inner product of two columns on all samples, weighted by channel.
    pub(crate) fn weighted_product(&self, a: usize, b: usize, weights: &[f64]) -> f64 {
        self.scoped_product(a, b, weights, FitScope::All)
    }

    /// The same for columns that are not in the pool; nothing is stored.
    pub(crate) fn weighted_product_of(&self, a: &ForceColumn, b: &ForceColumn, weights: &[f64]) -> f64 {
        let on = |(d, a, b)| weights[d] * self.inner_product(d, a, b, self.all_samples());
        a.common_channels(b).map(on).sum()
    }

    /// Inner product of two columns on fit or all samples, weighted by channel; computed at the first call.
    fn scoped_product(&self, a: usize, b: usize, weights: &[f64], on: FitScope) -> f64 {
        if !self.has_common_channel(a, b) {
            return 0.0;
        }
        // Products are stored with the column of the larger index.
        let (a, b) = (a.max(b), a.min(b));
        let mut products = self.products.borrow_mut();
        let known = products[a].entry(b).or_insert_with(|| self.products_of(a, b));
        // First half: products on the fit; second half: on the validation runs.
        let (fit, check) = known.split_at(known.len() / 2);
        // The bits give the common channels without reading the columns.
        let common = (0..self.channels).filter(|d| self.acts_on(a, *d) && self.acts_on(b, *d));
        let sums = common
            .zip(fit.iter().zip(check))
            .map(|(d, (fit, check))| weights[d] * if on == FitScope::All { fit + check } else { *fit });
        sums.sum()
    }

    /// Matrix of weighted inner products of some columns on fit or all samples, with the prior equations added.
    pub(crate) fn gram(&self, which: &[usize], weights: &[f64], on: FitScope) -> DMatrix<f64> {
        let n = which.len();
        let mut gram = DMatrix::zeros(n, n);
        for i in 0..n {
            for j in 0..=i {
                // The matrix is symmetric, so one half is computed.
                let sum = self.scoped_product(which[i], which[j], weights, on) + self.prior_term(which[i], which[j]);
                gram[(i, j)] = sum;
                gram[(j, i)] = sum;
            }
        }
        gram
    }

    /// Entry of the prior equations for two factors; zero without prior.
    fn prior_term(&self, a: usize, b: usize) -> f64 {
        let entry = self.prior_equations.as_ref().and_then(|prior| prior.get((a, b)));
        entry.copied().unwrap_or(0.0)
    }

    /// Matrices of weighted inner products of some columns, one for each fold with its range of samples.
    pub(crate) fn fold_grams(&self, which: &[usize], weights: &[f64]) -> Vec<(Range<usize>, DMatrix<f64>)> {
        let n = which.len();
        let mut grams = vec![DMatrix::zeros(n, n); self.folds.len()];
        let mut products = self.of_folds.borrow_mut();
        // Weights of the common channels of a pair.
        let mut common: Vec<f64> = Vec::new();
        for i in 0..n {
            for j in 0..=i {
                let (a, b) = (which[i].max(which[j]), which[i].min(which[j]));
                // The prior is divided equally between the folds.
                let before = self.prior_term(a, b) / self.folds.len() as f64;
                for gram in &mut grams {
                    gram[(i, j)] = before;
                    gram[(j, i)] = before;
                }
                if !self.has_common_channel(a, b) {
                    continue;
                }
                // Common channels of both columns, with their values.
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
                // Weighted sum over the channels of each fold.
                for (gram, part) in grams.iter_mut().zip(known.chunks(common.len())) {
                    let sum: f64 = part.iter().zip(&common).map(|(p, w)| p * w).sum();
                    gram[(i, j)] = sum + before;
                    gram[(j, i)] = sum + before;
                }
            }
        }
        self.folds.iter().cloned().zip(grams).collect()
    }

    /// Column `of` minus the other columns times their factors, `[channel][sample]`; zero at excluded samples.
    pub(crate) fn residual(&self, of: usize, others: &[usize], factors: &[f64]) -> Vec<Vec<f64>> {
        let mut rest = self.full_residual(of, others, factors);
        for (d, rest) in rest.iter_mut().enumerate() {
            self.zero_excluded(d, 0, rest);
        }
        rest
    }

    /// The same with excluded samples kept; only those that were not measured are zero.
    pub(crate) fn full_residual(&self, of: usize, others: &[usize], factors: &[f64]) -> Vec<Vec<f64>> {
        // Start with the column and subtract the others one after the other.
        let samples = self.check.end;
        let mut rest: Vec<Vec<f64>> = (self.columns[of].0.iter())
            .map(|values| values.clone().unwrap_or_else(|| vec![0.0; samples]))
            .collect();
        for (d, rest) in rest.iter_mut().enumerate() {
            // Channels on which a column is zero are skipped.
            let terms = others.iter().zip(factors);
            let terms: Vec<(f64, &[f64])> = terms
                .filter_map(|(k, factor)| Some((-factor, self.values(*k, d)?)))
                .collect();
            add_multiples(rest, &terms);
        }
        for (rest, out) in rest.iter_mut().zip(&self.lost) {
            zero_where(rest, out);
        }
        rest
    }
}

/// Indices of the true entries, ascending.
fn true_indices(mask: &[bool]) -> Vec<usize> {
    let samples = mask.iter().enumerate();
    samples.filter_map(|(i, mask)| mask.then_some(i)).collect()
}

/// Sets values to zero where `out` is true.
fn zero_where(values: &mut [f64], out: &[bool]) {
    for (value, _) in values.iter_mut().zip(out).filter(|(_, out)| **out) {
        *value = 0.0;
    }
}

/// Samples to which a set is fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FitScope {
    /// Those of the fit.
    Fit,
    /// All.
    All,
}

/// Least squares fit from inner products: factors of the first columns that explain the last column best, and the sum
/// of squares of the residual. Columns that depend on earlier ones get the factor zero.
pub(crate) fn solve_gram(gram: &DMatrix<f64>) -> (DVector<f64>, f64) {
    let n = gram.nrows() - 1;
    // Cholesky decomposition with columns scaled to 1. It is stored transposed, so that each row of the factor is
    // contiguous.
    let scale: Vec<f64> = (0..=n).map(|i| gram[(i, i)].sqrt()).collect();
    let mut upper = DMatrix::<f64>::zeros(n + 1, n + 1);
    let mut kept = vec![false; n];
    for i in 0..=n {
        // A column of zeros stays without a factor.
        if scale[i] == 0.0 {
            continue;
        }
        for j in 0..=i {
            if j < i && !kept[j] {
                continue;
            }
            // The part that earlier columns of the factor explain.
            let known = dot(&upper.column(i).as_slice()[..j], &upper.column(j).as_slice()[..j]);
            let sum = gram[(j, i)] / (scale[i] * scale[j]) - known;
            // Off-diagonal entry, squared residual of the last column, or a new diagonal entry; dependent columns are
            // cleared.
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
    // Back substitution for the independent columns; then undo the scaling.
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

/// A column is dependent if less than this share of its squares remains after the projection on the others.
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
                start: 0.0,
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
        let (factors, squares) = solve_gram(&pool.gram(&[one, two, copy, y], &weights, FitScope::All));
        let column = |k: usize| -> Vec<f64> {
            let part = |d: usize| pool.column(k).0[d].clone().unwrap_or_else(|| vec![0.0; 50]);
            let weighed = part(1).into_iter().map(|x| 2.0 * x);
            part(0).into_iter().chain(weighed).collect()
        };
        let matrix = DMatrix::from_columns(&[column(one).into(), column(two).into()]);
        let right = DVector::from(column(y));
        let expected = matrix.clone().svd(true, true).solve(&right, 0.0).unwrap();
        assert!((factors[0] - expected[0]).abs() < 1e-10 && (factors[1] - expected[1]).abs() < 1e-10);
        assert!(factors[2].abs() < f64::MIN_POSITIVE);
        let rest = (matrix * expected - right).norm_squared();
        assert!((squares - rest).abs() < 1e-9 * rest);
        let residual = pool.residual(y, &[one, two], &[factors[0], factors[1]]);
        let weighed = dot(&residual[0], &residual[0]) + 4.0 * dot(&residual[1], &residual[1]);
        assert!((weighed - rest).abs() < 1e-9 * rest);
    }
    /// Values in place of a force that was not measured have no influence.
    #[test]
    fn forces_that_lack_have_no_say() {
        let wave = |k: f64| -> Vec<f64> { (0..50).map(|i| (k * f64::from(i)).sin()).collect() };
        let mut layout = SampleLayout {
            channels: vec!["a".into()],
            segments: vec![SampleSegment {
                name: String::new(),
                samples: 50,
                start: 0.0,
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
