//! Least squares, eq. (12) of the paper: `p_min = argmin |W p - y|`, from a stream of rows.
//!
//! Rows are added block by block and reduced at once by Householder reflections to the upper triangle `[R | Q'y]` with
//! the residual norm in its corner. So the memory does not depend on the number of samples, and the normal equations,
//! which would square the condition number, are never formed. Rows of one channel are reduced together: the force of a
//! joint does not depend on the links before it, and columns that are zero in a complete block cost nothing.
//! Sources: G. H. Golub, "Numerical methods for solving linear least squares problems", Numer. Math. 7 (1965); J.
//! Demmel et al., "Communication-optimal parallel and sequential QR and LU factorizations", SIAM J. Sci. Comput. 34
//! (2012) for the sequential tall-skinny form; A. van der Sluis (1969) for scaling columns to equal norm.

use nalgebra::DMatrix;

use crate::estimate::error::LeastSquaresError;
use crate::estimate::reflections::{HouseholderBlock, LANES, fold_into_factor};
use crate::estimate::rows::{all_finite, check_rows, is_uninformative};
use crate::estimate::solution::{RegressionSolution, RowCount, solve_r_factor};

/// Largest number of values that are reduced together, so that they fit into the fastest caches.
const BLOCK_NUMBERS: usize = 4096;

/// Number of rows that are reduced together for a number of columns.
fn block_rows(width: usize) -> usize {
    (BLOCK_NUMBERS / width).clamp(64, 512).next_multiple_of(LANES)
}

/// A regression that takes its rows block by block.
///
/// ```
/// use modelmill_identify::LeastSquares;
/// let mut regression = LeastSquares::new(2);
/// // Two columns, row by row: the constant and the time.
/// regression.add_rows(&[1.0, 0.0, 1.0, 1.0, 1.0, 2.0], &[1.0, 3.0, 5.0])?;
/// let solution = regression.solve()?;
/// assert!((solution.values[1] - 2.0).abs() < 1e-12);
/// # Ok::<(), modelmill_identify::LeastSquaresError>(())
/// ```
#[derive(Debug, Clone)]
pub struct LeastSquares {
    n_parameters: usize,
    rows: usize,
    /// Number of rows of zeros among them.
    zero_rows: usize,
    /// `(n + 1) x (n + 1)`, row-major upper triangle `[R, Q'y; 0, +-|residual|]`.
    augmented_factor: Vec<f64>,
    /// Rows per block.
    block_rows: usize,
    /// A block of pending rows for each channel.
    channels: Vec<PendingRows>,
}

/// Pending rows: `n + 1` columns of `block_rows` values, filled up to `rows`.
#[derive(Debug, Clone)]
struct PendingRows {
    block: Vec<f64>,
    rows: usize,
}

impl LeastSquares {
    /// A regression for `n_parameters` parameters, without rows yet.
    pub fn new(n_parameters: usize) -> Self {
        Self::with_channels(n_parameters, 1)
    }

    /// The same for rows that are interleaved by channel (`row = sample * channels + channel`). Those of one channel
    /// are reduced together, which saves work if a channel does not depend on all parameters. The result is the same.
    pub fn with_channels(n_parameters: usize, channels: usize) -> Self {
        let width = n_parameters + 1;
        let block_rows = block_rows(width);
        let pending = PendingRows {
            block: vec![0.0; width * block_rows],
            rows: 0,
        };
        Self {
            n_parameters,
            rows: 0,
            zero_rows: 0,
            augmented_factor: vec![0.0; width * width],
            block_rows,
            channels: vec![pending; channels.max(1)],
        }
    }

    /// Number of parameters.
    pub fn n_parameters(&self) -> usize {
        self.n_parameters
    }

    /// Number of rows so far.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of all rows, and of those that are not zero.
    pub(crate) fn row_count(&self) -> RowCount {
        RowCount {
            shown: self.rows,
            informative: self.rows - self.zero_rows,
        }
    }

    /// Adds rows: `regressor[row * n_parameters + column]` and `measured[row]`.
    /// To weight a row, scale it and its measured value.
    /// Fails if the lengths do not match or a number is not finite; then nothing is added.
    pub fn add_rows(&mut self, regressor: &[f64], measured: &[f64]) -> Result<(), LeastSquaresError> {
        let n = self.n_parameters;
        check_rows(regressor, measured, n, self.rows)?;
        let n_channels = self.channels.len();
        for (i, (row, y)) in regressor.chunks_exact(n).zip(measured).enumerate() {
            let channel = (self.rows + i) % n_channels;
            let (stride, pending) = (self.block_rows, &mut self.channels[channel]);
            for (column, value) in row.iter().enumerate() {
                pending.block[column * stride + pending.rows] = *value;
            }
            pending.block[n * stride + pending.rows] = *y;
            pending.rows += 1;
            self.zero_rows += usize::from(is_uninformative(row, *y));
            if pending.rows == stride {
                self.reduce_block(channel);
            }
        }
        self.rows += measured.len();
        Ok(())
    }

    /// Adds rows of one channel, column by column, which is the fastest way. All columns have the length of `measured`.
    /// Fails as [`LeastSquares::add_rows`] does; then nothing is added.
    ///
    /// ```
    /// use modelmill_identify::LeastSquares;
    /// let mut regression = LeastSquares::new(2);
    /// regression.add_columns(0, &[&[1.0, 1.0, 1.0], &[0.0, 1.0, 2.0]], &[1.0, 3.0, 5.0])?;
    /// assert!((regression.solve()?.values[1] - 2.0).abs() < 1e-12);
    /// # Ok::<(), modelmill_identify::LeastSquaresError>(())
    /// ```
    pub fn add_columns(
        &mut self,
        channel: usize,
        columns: &[&[f64]],
        measured: &[f64],
    ) -> Result<(), LeastSquaresError> {
        let n = self.n_parameters;
        if n == 0 {
            return Err(LeastSquaresError::NoParameters);
        }
        let rows = measured.len();
        if columns.len() != n || columns.iter().any(|column| column.len() != rows) {
            return Err(LeastSquaresError::Shape {
                regressor: columns.iter().map(|column| column.len()).sum(),
                measured: rows,
                columns: n,
            });
        }
        let all = columns.iter().map(|column| (*column, true)).chain([(measured, false)]);
        for (place, (column, is_regressor)) in all.enumerate() {
            if !all_finite(column)
                && let Some(i) = column.iter().position(|value| !value.is_finite())
            {
                return Err(LeastSquaresError::NotFinite {
                    row: self.rows + i,
                    column: is_regressor.then_some(place),
                });
            }
        }
        // Few measured values are zero, so this test costs little.
        let silent = measured.iter().enumerate().filter(|(_, y)| **y == 0.0);
        self.zero_rows += silent
            .filter(|(i, _)| columns.iter().all(|column| column[*i] == 0.0))
            .count();
        let channel = channel % self.channels.len();
        let stride = self.block_rows;
        let mut done = 0;
        while done < rows {
            let pending = &mut self.channels[channel];
            let (from, more) = (pending.rows, (stride - pending.rows).min(rows - done));
            let slots = pending.block.chunks_exact_mut(stride);
            for (slot, column) in slots.zip(columns.iter().chain([&measured])) {
                slot[from..from + more].copy_from_slice(&column[done..done + more]);
            }
            pending.rows += more;
            done += more;
            if pending.rows == stride {
                self.reduce_block(channel);
            }
        }
        self.rows += rows;
        Ok(())
    }

    /// Merges another regression for the same parameters, for example one that ran on another core. Fails if the
    /// numbers of parameters differ.
    pub fn merge(&mut self, mut other: Self) -> Result<(), LeastSquaresError> {
        let n = self.n_parameters;
        if other.n_parameters != n {
            return Err(LeastSquaresError::NominalLength {
                have: other.n_parameters,
                expected: n,
            });
        }
        other.reduce();
        let (rows, idle) = (self.rows + other.rows, self.zero_rows + other.zero_rows);
        for row in other.augmented_factor.chunks_exact(n + 1) {
            self.add_rows(&row[..n], &row[n..])?;
        }
        (self.rows, self.zero_rows) = (rows, idle);
        Ok(())
    }

    /// Reduces the pending rows of a channel into the R factor.
    fn reduce_block(&mut self, channel: usize) {
        let (stride, pending) = (self.block_rows, &mut self.channels[channel]);
        let rows = pending.rows.next_multiple_of(LANES);
        for column in pending.block.chunks_exact_mut(stride) {
            column[pending.rows..rows].fill(0.0);
        }
        let block = HouseholderBlock {
            columns: &mut pending.block,
            stride,
            rows,
        };
        fold_into_factor(&mut self.augmented_factor, block);
        pending.rows = 0;
    }

    /// Reduces all pending rows into the R factor.
    fn reduce(&mut self) {
        for channel in 0..self.channels.len() {
            self.reduce_block(channel);
        }
    }

    /// The complete factor `[R, Q'y; 0, +-|residual|]`, `(n + 1) x (n + 1)` by rows.
    pub(crate) fn augmented_factor(&self) -> Vec<f64> {
        let mut complete = self.clone();
        complete.reduce();
        complete.augmented_factor
    }

    /// The R factor of the regressor, `n x n`: it has the same singular values, column norms and dependencies as the
    /// stacked regressor.
    pub fn r_factor(&self) -> DMatrix<f64> {
        let (n, triangle) = (self.n_parameters, self.augmented_factor());
        DMatrix::from_fn(n, n, |i, j| triangle[i * (n + 1) + j])
    }

    /// The least squares solution. If the rows do not determine all parameters, the undetermined directions keep the
    /// value 0 (in columns of equal norm: the shortest solution), and [`RegressionSolution::undetermined`] lists them.
    /// Fails if there are no rows or no parameters.
    pub fn solve(&self) -> Result<RegressionSolution, LeastSquaresError> {
        self.solve_near(&vec![0.0; self.n_parameters])
    }

    /// As [`LeastSquares::solve`], but undetermined directions stay at `nominal`. Determined parameters do not depend
    /// on `nominal`.
    pub fn solve_near(&self, nominal: &[f64]) -> Result<RegressionSolution, LeastSquaresError> {
        let n = self.n_parameters;
        if n == 0 {
            return Err(LeastSquaresError::NoParameters);
        }
        if nominal.len() != n {
            return Err(LeastSquaresError::NominalLength {
                have: nominal.len(),
                expected: n,
            });
        }
        if self.rows == 0 {
            return Err(LeastSquaresError::NoRows);
        }
        solve_r_factor(&self.augmented_factor(), self.row_count(), nominal)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DVector;

    use super::*;
    use crate::test_noise::TestNoise;

    #[track_caller]
    fn near(actual: f64, expected: f64, relative: f64) {
        assert!(
            (actual - expected).abs() <= relative * expected.abs().max(1e-300),
            "{actual} instead of {expected}"
        );
    }

    /// 1 to degree 6 in 1000 points, in one go and in odd pieces, against nalgebra's own QR.
    #[test]
    fn streaming_equals_a_dense_solution() {
        let mut noise = TestNoise::new(1);
        let (n, rows) = (7, 1003);
        let w = DMatrix::from_fn(rows, n, |i, j| (i as f64 / 500.0 - 1.0).powi(i32::try_from(j).unwrap()));
        let y = DVector::from_fn(rows, |i, _| (i as f64 / 100.0).sin() + 0.1 * noise.normal());
        let flat: Vec<f64> = w.transpose().iter().copied().collect();
        let mut pieces = LeastSquares::new(n);
        let mut done = 0;
        for size in [1, 2, 300, 5, 255, 256, 184] {
            pieces
                .add_rows(&flat[done * n..(done + size) * n], &y.as_slice()[done..done + size])
                .unwrap();
            done += size;
        }
        assert_eq!(done, rows);
        let dense = w.clone().svd(true, true).solve(&y, 0.0).unwrap();
        let solution = pieces.solve().unwrap();
        for j in 0..n {
            near(solution.values[j], dense[j], 1e-11);
        }
        near(solution.residual_norm, (&w * &dense - &y).norm(), 1e-12);
        near(solution.measured_norm, y.norm(), 1e-12);
        let s = w.clone().svd(false, false).singular_values;
        near(solution.condition_number, s.max() / s.min(), 1e-10);
        let covariance = (w.transpose() * &w).try_inverse().unwrap();
        let variance = (&w * &dense - &y).norm_squared() / (rows - n) as f64;
        for j in 0..n {
            near(solution.classical_std[j], (variance * covariance[(j, j)]).sqrt(), 1e-9);
        }
        let mut halves = LeastSquares::new(n);
        let mut second = LeastSquares::new(n);
        halves.add_rows(&flat[..401 * n], &y.as_slice()[..401]).unwrap();
        second.add_rows(&flat[401 * n..], &y.as_slice()[401..]).unwrap();
        halves.merge(second).unwrap();
        assert_eq!(halves.rows(), rows);
        near(halves.solve().unwrap().values[3], dense[3], 1e-11);
    }

    /// Rows of three channels, of which the later ones do not see the first columns: by rows, by channels and by
    /// columns.
    #[test]
    fn channels_and_columns_reduce_to_the_same_triangle() {
        let mut noise = TestNoise::new(6);
        let (n, samples) = (11, 777);
        let sees = |channel: usize, j: usize| j >= 4 * channel;
        let w: Vec<f64> = (0..3 * samples * n)
            .map(|i| if sees(i / n % 3, i % n) { noise.normal() } else { 0.0 })
            .collect();
        let y: Vec<f64> = (0..3 * samples).map(|_| noise.normal()).collect();
        let mut by_rows = LeastSquares::new(n);
        by_rows.add_rows(&w, &y).unwrap();
        let mut by_channels = LeastSquares::with_channels(n, 3);
        for (w, y) in w.chunks(3 * n * 50).zip(y.chunks(3 * 50)) {
            by_channels.add_rows(w, y).unwrap();
        }
        let mut by_columns = LeastSquares::with_channels(n, 3);
        for start in (0..samples).step_by(64) {
            let end = (start + 64).min(samples);
            for channel in 0..3 {
                let rows = (start..end).map(|sample| 3 * sample + channel);
                let columns: Vec<Vec<f64>> = (0..n)
                    .map(|j| rows.clone().map(|row| w[row * n + j]).collect())
                    .collect();
                let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
                let right: Vec<f64> = rows.map(|row| y[row]).collect();
                by_columns.add_columns(channel, &columns, &right).unwrap();
            }
        }
        let dense = DMatrix::from_row_slice(3 * samples, n, &w);
        let expected = dense
            .svd(true, true)
            .solve(&DVector::from_column_slice(&y), 0.0)
            .unwrap();
        for regression in [&by_rows, &by_channels, &by_columns] {
            assert_eq!(regression.rows(), 3 * samples);
            let solution = regression.solve().unwrap();
            for j in 0..n {
                near(solution.values[j], expected[j], 1e-10);
            }
        }
        let bad = [1.0, f64::NAN, 1.0];
        let columns = vec![&bad[..]; n];
        let error = by_columns.add_columns(0, &columns, &[1.0; 3]).unwrap_err();
        assert_eq!(
            error,
            LeastSquaresError::NotFinite {
                row: 3 * samples + 1,
                column: Some(0)
            }
        );
        assert!(by_columns.add_columns(0, &columns[1..], &[1.0; 3]).is_err());
        assert_eq!(by_columns.rows(), 3 * samples);
    }

    /// The normal equations lose everything at a condition number of 1e8; the QR must not.
    #[test]
    fn an_ill_conditioned_problem_keeps_its_digits() {
        let mut regression = LeastSquares::new(2);
        for i in 0..1000 {
            let t = f64::from(i) / 1000.0;
            let row = [1.0, 1.0 + 1e-8 * t];
            regression.add_rows(&row, &[3.0 * row[0] - 2.0 * row[1]]).unwrap();
        }
        let solution = regression.solve().unwrap();
        near(solution.values[0], 3.0, 1e-6);
        near(solution.values[1], -2.0, 1e-6);
        assert_eq!(solution.rank, 2);
    }

    #[test]
    fn what_is_not_determined_is_named_and_stays_nominal() {
        let mut regression = LeastSquares::new(4);
        for i in 0..200 {
            let t = f64::from(i);
            let (a, b) = ((0.1 * t).sin(), (0.23 * t).cos());
            // Columns: a, b, 2 a, and zeros.
            regression
                .add_rows(&[a, b, 2.0 * a, 0.0], &[7.0 * a + 5.0 * b])
                .unwrap();
        }
        let nominal = [1.0, 1.0, 1.0, 1.0];
        let solution = regression.solve_near(&nominal).unwrap();
        assert_eq!(solution.rank, 2);
        assert_eq!(solution.determined, [false, true, false, false]);
        near(solution.values[1], 5.0, 1e-12);
        near(solution.values[0] + 2.0 * solution.values[2], 7.0, 1e-12);
        near(solution.values[3], 1.0, 1e-12);
        assert!(solution.classical_std[0].is_infinite() && solution.classical_std[1].is_finite());
        assert!(solution.condition_number.is_infinite());
        let names: Vec<String> = ["p1", "p2", "p3", "p4"].map(str::to_owned).into();
        let mut says = solution.describe_undetermined(&names);
        says.sort();
        assert_eq!(
            says,
            [
                "only a combination of p1 and p3 is determined: p1 + 1 with p3 - 0.5 changes nothing",
                "p4 has no effect on these samples"
            ]
        );
    }

    #[test]
    fn faulty_input_is_an_error_and_takes_nothing() {
        let mut regression = LeastSquares::new(2);
        assert_eq!(regression.solve().unwrap_err(), LeastSquaresError::NoRows);
        assert!(regression.add_rows(&[1.0, 2.0, 3.0], &[1.0]).is_err());
        let error = regression
            .add_rows(&[1.0, 2.0, 3.0, f64::NAN], &[1.0, 2.0])
            .unwrap_err();
        assert_eq!(
            error,
            LeastSquaresError::NotFinite {
                row: 1,
                column: Some(1)
            }
        );
        let error = regression.add_rows(&[1.0, 2.0], &[f64::INFINITY]).unwrap_err();
        assert_eq!(error, LeastSquaresError::NotFinite { row: 0, column: None });
        assert_eq!(regression.rows(), 0);
        assert_eq!(
            LeastSquares::new(0).solve().unwrap_err(),
            LeastSquaresError::NoParameters
        );
        regression.add_rows(&[1.0, 2.0], &[1.0]).unwrap();
        let single = regression.solve().unwrap();
        assert_eq!(single.rank, 1);
        assert!(single.residual_variance().is_nan() || single.residual_norm < 1e-12);
    }
}
