//! Inner products of a few columns with a few others in one pass: each number is read once for several products. Input:
//! slices of equal length; output: their products.

use std::array;

use pulp::{Arch, Simd, WithSimd};

use crate::signal::{LANES, dot};

/// Columns on either side of a tile.
pub(crate) const SIDE: usize = 4;

/// Inner products `[row][column]` of columns of equal length. The sums are those of [`dot`], to the bit.
pub(crate) fn tile_products(rows: [&[f64]; SIDE], columns: [&[f64]; SIDE]) -> [[f64; SIDE]; SIDE] {
    // Vector instructions take complete groups of numbers; the remainder is added below.
    let whole = rows[0].len() / LANES * LANES;
    let sums = Arch::new().dispatch(ProductTile {
        rows: rows.map(|row| &row[..whole]),
        columns: columns.map(|column| &column[..whole]),
    });
    array::from_fn(|r| {
        array::from_fn(|c| {
            let lanes: f64 = sums[r][c].iter().sum();
            // The remainder is too short for partial sums.
            lanes + dot(&rows[r][whole..], &columns[c][whole..])
        })
    })
}

/// Partial sums of each row with each column, `[row][column][lane]`.
struct ProductTile<'a> {
    /// Values of the rows; the length is a multiple of [`LANES`].
    rows: [&'a [f64]; SIDE],
    /// Values of the columns, of the same length.
    columns: [&'a [f64]; SIDE],
}

impl WithSimd for ProductTile<'_> {
    type Output = [[[f64; LANES]; SIDE]; SIDE];

    #[allow(
        clippy::inline_always,
        reason = "inlined code uses the vector instructions of its caller"
    )]
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let [rows, columns] = [self.rows, self.columns].map(|all| all.map(|one| S::as_simd_f64s(one).0));
        // Equal lengths known to the compiler save bounds checks.
        let n = rows[0].len();
        let [rows, columns] = [rows, columns].map(|all| all.map(|one| &one[..n]));
        let mut found = [[[0.0; LANES]; SIDE]; SIDE];
        // As many sums at a time as there are registers: the lanes of one vector for each pair.
        let vectors = LANES / S::F64_LANES;
        for vector in 0..vectors {
            let mut sums = [[simd.splat_f64s(0.0); SIDE]; SIDE];
            let mut k = vector;
            while k < n {
                let x = [rows[0][k], rows[1][k], rows[2][k], rows[3][k]];
                let y = [columns[0][k], columns[1][k], columns[2][k], columns[3][k]];
                for r in 0..SIDE {
                    for c in 0..SIDE {
                        let product = simd.mul_f64s(x[r], y[c]);
                        sums[r][c] = simd.add_f64s(sums[r][c], product);
                    }
                }
                k += vectors;
            }
            for r in 0..SIDE {
                for c in 0..SIDE {
                    S::as_mut_simd_f64s(&mut found[r][c]).0[vector] = sums[r][c];
                }
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tile_has_the_bits_of_single_products() {
        for samples in [0, 1, 15, 16, 63, 64, 65, 1000, 1003] {
            let values = |k: usize| -> Vec<f64> { (0..samples).map(|i| ((i * (k + 3)) as f64 * 0.37).sin()).collect() };
            let all: Vec<Vec<f64>> = (0..2 * SIDE).map(values).collect();
            let rows: [&[f64]; SIDE] = array::from_fn(|r| all[r].as_slice());
            let columns: [&[f64]; SIDE] = array::from_fn(|c| all[SIDE + c].as_slice());
            let tile = tile_products(rows, columns);
            for r in 0..SIDE {
                for c in 0..SIDE {
                    let single = dot(rows[r], columns[c]);
                    assert_eq!(tile[r][c].to_bits(), single.to_bits(), "of {samples}");
                }
            }
        }
    }
}
