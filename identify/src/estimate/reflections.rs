//! Householder reflections of a block of rows into an R factor, with the widest vector instructions of the processor:
//! the inner loop of [`LeastSquares`](crate::LeastSquares).
//!
//! Decision: `pulp` compiles this loop for several instruction sets from safe code. Sums in wider vectors round
//! differently, so identified values agree between machines to rounding only.

use pulp::{Arch, Simd, WithSimd};

/// Numbers of a block are padded with zero rows to a multiple of this, which no vector exceeds.
pub(crate) const LANES: usize = 8;

/// Columns of a block of rows; `stride` numbers per column, a multiple of [`LANES`].
pub(crate) struct HouseholderBlock<'a> {
    /// Column after column.
    pub(crate) columns: &'a mut [f64],
    /// Numbers per column.
    pub(crate) stride: usize,
    /// Rows in use, a multiple of [`LANES`].
    pub(crate) rows: usize,
}

/// Reduces a block into the row-major R factor with the same number of columns; the block is overwritten.
pub(crate) fn fold_into_factor(triangle: &mut [f64], block: HouseholderBlock<'_>) {
    Arch::new().dispatch(HouseholderFold {
        factor: triangle,
        block,
    });
}

/// Arguments of the reduction, as `pulp` needs them in one value.
struct HouseholderFold<'a> {
    factor: &'a mut [f64],
    block: HouseholderBlock<'a>,
}

impl WithSimd for HouseholderFold<'_> {
    type Output = ();

    #[allow(clippy::inline_always, reason = "the trait's manual requires it")]
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let HouseholderBlock { columns, stride, rows } = self.block;
        let triangle = self.factor;
        let width = columns.len() / stride;
        for k in 0..width {
            let (head, tail) = columns.split_at_mut((k + 1) * stride);
            let pivot = &head[k * stride..k * stride + rows];
            let [below] = dots(simd, pivot, [pivot]);
            // Columns that are zero in all these rows, such as those of links before a joint, cost nothing.
            if below == 0.0 {
                continue;
            }
            let row = &mut triangle[k * width..(k + 1) * width];
            let alpha = row[k];
            let beta = -(alpha * alpha + below).sqrt().copysign(alpha);
            // The reflection is 1 - tau v v' with v = (1, pivot / v0).
            let v0 = alpha - beta;
            let (tau, inverse) = (-v0 / beta, v0.recip());
            row[k] = beta;
            // Apply the reflection to the columns behind, four at a time.
            let mut entries = row[k + 1..].chunks_exact_mut(4);
            let mut fours = tail.chunks_exact_mut(4 * stride);
            for (entries, four) in (&mut entries).zip(&mut fours) {
                let (a, rest) = four.split_at_mut(stride);
                let (b, rest) = rest.split_at_mut(stride);
                let (c, d) = rest.split_at_mut(stride);
                let [a, b, c, d] = [a, b, c, d].map(|column| &mut column[..rows]);
                let sums = dots(simd, pivot, [a, b, c, d]);
                let mut factors = [0.0; 4];
                for j in 0..4 {
                    let sum = tau * (entries[j] + sums[j] * inverse);
                    entries[j] -= sum;
                    factors[j] = -sum * inverse;
                }
                add_scaled(simd, factors, pivot, [a, b, c, d]);
            }
            // The remaining one to three columns.
            let entries = entries.into_remainder().iter_mut();
            let ones = fours.into_remainder().chunks_exact_mut(stride);
            for (entry, column) in entries.zip(ones) {
                let column = &mut column[..rows];
                let [sum] = dots(simd, pivot, [column]);
                let sum = tau * (*entry + sum * inverse);
                *entry -= sum;
                add_scaled(simd, [-sum * inverse], pivot, [column]);
            }
        }
    }
}

/// Dot products of one column with `N` others, all with complete vectors.
#[allow(clippy::inline_always, reason = "part of the loop above")]
#[inline(always)]
fn dots<S: Simd, const N: usize>(simd: S, pivot: &[f64], columns: [&[f64]; N]) -> [f64; N] {
    let (pivot, _) = S::as_simd_f64s(pivot);
    let columns = columns.map(|column| &S::as_simd_f64s(column).0[..pivot.len()]);
    // Two sums per product hide the latency of the additions.
    let mut even = [simd.splat_f64s(0.0); N];
    let mut odd = even;
    let pairs = pivot.len() / 2;
    for i in 0..pairs {
        for j in 0..N {
            even[j] = simd.mul_add_e_f64s(pivot[2 * i], columns[j][2 * i], even[j]);
            odd[j] = simd.mul_add_e_f64s(pivot[2 * i + 1], columns[j][2 * i + 1], odd[j]);
        }
    }
    if pivot.len() % 2 == 1 {
        let i = pivot.len() - 1;
        for j in 0..N {
            even[j] = simd.mul_add_e_f64s(pivot[i], columns[j][i], even[j]);
        }
    }
    std::array::from_fn(|j| simd.reduce_sum_f64s(simd.add_f64s(even[j], odd[j])))
}

/// `column += factor * pivot` for `N` columns.
#[allow(clippy::inline_always, reason = "part of the loop above")]
#[inline(always)]
fn add_scaled<S: Simd, const N: usize>(simd: S, factors: [f64; N], pivot: &[f64], columns: [&mut [f64]; N]) {
    let (pivot, _) = S::as_simd_f64s(pivot);
    let factors = factors.map(|factor| simd.splat_f64s(factor));
    let columns = columns.map(|column| &mut S::as_mut_simd_f64s(column).0[..pivot.len()]);
    for i in 0..pivot.len() {
        for j in 0..N {
            columns[j][i] = simd.mul_add_e_f64s(factors[j], pivot[i], columns[j][i]);
        }
    }
}
