//! Inner products of series, with partial sums that do not depend on the width of a machine's vectors.
//!
//! Decision: products are added without fused operations, in an order that no machine changes, so that a diagnosis
//! decides equally everywhere.

use nalgebra::DMatrix;
use pulp::{Arch, Simd, WithSimd};

/// Number of partial sums of an inner product.
pub(crate) const LANES: usize = 16;
/// Inner products of fewer numbers are computed without dispatch to vector instructions.
const SHORT: usize = 64;

/// Inner product of two series of equal length. Several partial sums are faster and round less.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    debug_assert_eq!(a.len(), b.len());
    let whole = a.len().min(b.len()) / LANES * LANES;
    let sums = if whole < SHORT {
        // For a few numbers the dispatch would cost more than the sum.
        let mut sums = [0.0; LANES];
        for (x, y) in a.chunks_exact(LANES).zip(b.chunks_exact(LANES)) {
            for (sum, (x, y)) in sums.iter_mut().zip(x.iter().zip(y)) {
                *sum += x * y;
            }
        }
        sums
    } else {
        Arch::new().dispatch(SeriesProduct {
            a: &a[..whole],
            b: &b[..whole],
        })
    };
    let tail: f64 = a[whole..].iter().zip(&b[whole..]).map(|(x, y)| x * y).sum();
    sums.iter().sum::<f64>() + tail
}

/// Partial sums of one inner product; the lengths are equal and a multiple of [`LANES`].
struct SeriesProduct<'a> {
    a: &'a [f64],
    b: &'a [f64],
}

impl WithSimd for SeriesProduct<'_> {
    type Output = [f64; LANES];

    #[allow(
        clippy::inline_always,
        reason = "inlined code uses the vector instructions of its caller"
    )]
    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> Self::Output {
        let mut sums = [0.0; LANES];
        let (a, b) = (self.a.as_chunks::<LANES>().0, self.b.as_chunks::<LANES>().0);
        // Plain loops, because a closure would be compiled without the vector instructions.
        for (x, y) in a.iter().zip(b) {
            for lane in 0..LANES {
                sums[lane] += x[lane] * y[lane];
            }
        }
        sums
    }
}

/// Inner products of all columns of a matrix with each other.
pub fn gram(columns: &DMatrix<f64>) -> DMatrix<f64> {
    let (rows, n) = columns.shape();
    let column = |k: usize| &columns.as_slice()[k * rows..(k + 1) * rows];
    let mut products = DMatrix::zeros(n, n);
    for j in 0..n {
        for i in 0..=j {
            let product = dot(column(i), column(j));
            products[(i, j)] = product;
            products[(j, i)] = product;
        }
    }
    products
}

/// Adds multiples of series to a sum of the same length: `sum += factor * values` for each term, in their order.
pub(crate) fn add_multiples(sum: &mut [f64], terms: &[(f64, &[f64])]) {
    debug_assert!(terms.iter().all(|(_, values)| values.len() == sum.len()));
    Arch::new().dispatch(SeriesSum { sum, terms });
}

/// Arguments of [`add_multiples`], as `pulp` needs them in one value.
struct SeriesSum<'a> {
    sum: &'a mut [f64],
    terms: &'a [(f64, &'a [f64])],
}

impl WithSimd for SeriesSum<'_> {
    type Output = ();

    #[allow(
        clippy::inline_always,
        reason = "inlined code uses the vector instructions of its caller"
    )]
    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        /// Numbers of the sum that stay in the first-level cache while all terms are added.
        const CHUNK: usize = 1024;
        let mut start = 0;
        while start < self.sum.len() {
            let end = (start + CHUNK).min(self.sum.len());
            let sum = &mut self.sum[start..end];
            let (fours, rest) = self.terms.as_chunks::<4>();
            for [(a, x), (b, y), (c, z), (d, w)] in fours {
                let n = sum.len();
                let (x, y, z, w) = (
                    &x[start..end][..n],
                    &y[start..end][..n],
                    &z[start..end][..n],
                    &w[start..end][..n],
                );
                for i in 0..n {
                    sum[i] = (((sum[i] + a * x[i]) + b * y[i]) + c * z[i]) + d * w[i];
                }
            }
            for (factor, values) in rest {
                let n = sum.len();
                let values = &values[start..end][..n];
                for i in 0..n {
                    sum[i] += factor * values[i];
                }
            }
            start = end;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sum in the documented order, number by number.
    fn textbook(a: &[f64], b: &[f64]) -> f64 {
        let whole = a.len() / LANES * LANES;
        let lane = |lane: usize| {
            let picked = (lane..whole).step_by(LANES);
            picked.fold(0.0, |sum, i| sum + a[i] * b[i])
        };
        let tail: f64 = (whole..a.len()).map(|i| a[i] * b[i]).sum();
        (0..LANES).map(lane).sum::<f64>() + tail
    }

    #[test]
    fn an_inner_product_has_the_same_bits_at_every_width() {
        for n in [0, 1, 15, 16, 63, 64, 65, 80, 1003] {
            let series = |k: f64| -> Vec<f64> { (0..n).map(|i| (f64::from(i) * k).sin()).collect() };
            let (a, b) = (series(0.37), series(1.13));
            assert_eq!(dot(&a, &b).to_bits(), textbook(&a, &b).to_bits(), "{n} numbers");
        }
    }
    #[test]
    fn products_of_columns_are_those_of_the_transposed_matrix() {
        for (rows, n) in [(0, 3), (7, 0), (5, 4), (130, 9)] {
            let columns = DMatrix::from_fn(rows, n, |i, k| (0.3 + i as f64 * (1.0 + k as f64)).sin());
            assert!((gram(&columns) - columns.tr_mul(&columns)).abs().sum() < 1e-11);
        }
    }

    #[test]
    fn multiples_are_added_in_their_order() {
        for (n, count) in [(0, 3), (5, 0), (1025, 1), (2500, 4), (3000, 7)] {
            let series: Vec<Vec<f64>> = (0..count)
                .map(|k| (0..n).map(|i| (f64::from(i) * (0.3 + f64::from(k))).sin()).collect())
                .collect();
            let terms: Vec<(f64, &[f64])> = series.iter().map(|x| (x.len() as f64 / 7.0, x.as_slice())).collect();
            let mut expected = vec![0.5; usize::try_from(n).unwrap()];
            let mut sum = expected.clone();
            for (factor, values) in &terms {
                for (e, x) in expected.iter_mut().zip(*values) {
                    *e += factor * x;
                }
            }
            add_multiples(&mut sum, &terms);
            assert_eq!(sum, expected);
        }
    }
}
