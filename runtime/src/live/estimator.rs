//! Recursive least squares with forgetting, in the form of the R factor of a QR factorisation.
//!
//! Rotations eliminate each new row against the R factor (W. Givens 1958; G. Golub, C. Van Loan, Matrix Computations,
//! 6.5). The R factor is a square root of the information matrix, so it needs half the digits. Forgetting cannot make
//! it grow where nothing moves: the information of a direction that is not excited fades to zero, and a prior takes its
//! place.

use crate::Real;

/// Entries smaller than this become zero, so that no step is slowed down by subnormal numbers.
const FADED: f64 = 1e-30;

/// Recursive estimator of `NB` parameters with forgetting.
///
/// ```
/// use modelmill_runtime::live::{EstimatorPrior, RecursiveEstimator};
///
/// let mut estimator = RecursiveEstimator::<f64, 2>::new();
/// for (row, value) in [([1.0, 0.0], 3.0), ([1.0, 1.0], 5.0), ([1.0, 2.0], 7.0)] {
///     estimator.forget(0.9);
///     assert!(estimator.add(row, value));
/// }
/// let values = estimator.solve(&EstimatorPrior::uninformative());
/// assert!((values[0] - 3.0).abs() < 1e-12 && (values[1] - 2.0).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct RecursiveEstimator<T, const NB: usize> {
    /// The R factor, upper triangular; entries below its diagonal are zero.
    pub(super) rows: [[T; NB]; NB],
    /// The right-hand side of each of its rows.
    pub(super) values: [T; NB],
    /// Sum of squared residuals, faded as the rows are.
    squares: T,
}

/// Prior knowledge of the parameters: expected values with standard deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EstimatorPrior<T, const NB: usize> {
    /// Expected values.
    pub values: [T; NB],
    /// One over the standard deviation of each, relative to the standard deviation of a row; 0 where nothing is known.
    pub weights: [T; NB],
}

impl<T: Real, const NB: usize> EstimatorPrior<T, NB> {
    /// A prior without any information.
    #[must_use]
    pub fn uninformative() -> Self {
        let zeros = [T::from_f64(0.0); NB];
        Self {
            values: zeros,
            weights: zeros,
        }
    }
}

impl<T: Real, const NB: usize> Default for RecursiveEstimator<T, NB> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Real, const NB: usize> RecursiveEstimator<T, NB> {
    /// An estimator without any information.
    #[must_use]
    pub fn new() -> Self {
        let zero = T::from_f64(0.0);
        Self {
            rows: [[zero; NB]; NB],
            values: [zero; NB],
            squares: zero,
        }
    }

    /// Multiplies all information by this share, between 0 and 1: `exp(-dt/tau)` for a memory of `tau` seconds.
    pub fn forget(&mut self, share: T) {
        self.scale_information(share.sqrt());
    }

    /// [`Self::forget`] with the root of the share, which multiplies the rows.
    pub(super) fn scale_information(&mut self, root: T) {
        let faded = T::from_f64(FADED);
        let fade = |x: &mut T| {
            let y = *x * root;
            *x = if y.abs() < faded { T::from_f64(0.0) } else { y };
        };
        for (k, row) in self.rows.iter_mut().enumerate() {
            row.iter_mut().skip(k).for_each(fade);
        }
        self.values.iter_mut().for_each(fade);
        self.squares = self.squares * root * root;
    }

    /// Adds a row of the regressor and the value measured for it, both divided by the standard deviation of the
    /// measurement.
    ///
    /// Returns `false`, and adds nothing, if one of the numbers is not finite.
    #[must_use = "a row that was not taken is missing"]
    pub fn add(&mut self, mut row: [T; NB], mut value: T) -> bool {
        if !(value.is_finite() && row.iter().all(|x| x.is_finite())) {
            return false;
        }
        let triangle = self.rows.iter_mut().zip(&mut self.values);
        for (k, (own, own_value)) in triangle.enumerate() {
            let Some((c, s)) = givens_rotation(own, &row, k) else {
                continue;
            };
            rotate_rows(c, s, own, &mut row, k);
            (*own_value, value) = (c * *own_value + s * value, c * value - s * *own_value);
        }
        self.squares = self.squares + value * value;
        true
    }

    /// The parameters that explain all rows best, with a prior that does not fade.
    ///
    /// A parameter without any information is 0. Works on a copy of the R factor and adds `NB` rows to it.
    #[must_use]
    pub fn solve(&self, prior: &EstimatorPrior<T, NB>) -> [T; NB] {
        let zero = T::from_f64(0.0);
        let mut all = *self;
        for (k, (value, weight)) in prior.values.iter().zip(&prior.weights).enumerate() {
            if *weight == zero {
                continue;
            }
            let mut row = [zero; NB];
            if let Some(entry) = row.get_mut(k) {
                *entry = *weight;
            }
            // A prior that is not finite is ignored.
            _ = all.add(row, *weight * *value);
        }
        let mut solution = [zero; NB];
        for (k, (row, value)) in all.rows.iter().zip(&all.values).enumerate().rev() {
            let known = row.iter().zip(&solution).skip(k + 1);
            let rest = known.fold(*value, |rest, (x, y)| rest - *x * *y);
            let pivot = row.get(k).copied().unwrap_or(zero);
            if let Some(slot) = solution.get_mut(k) {
                *slot = if pivot == zero { zero } else { rest / pivot };
            }
        }
        solution
    }

    /// Sum of squared residuals of the rows, faded as they are.
    #[must_use]
    pub fn sum_of_squares(&self) -> T {
        self.squares
    }

    /// The diagonal of the information matrix: information on each parameter, all others given.
    #[must_use]
    pub fn information(&self) -> [T; NB] {
        let mut sums = [T::from_f64(0.0); NB];
        for row in &self.rows {
            for (sum, x) in sums.iter_mut().zip(row) {
                *sum = *sum + *x * *x;
            }
        }
        sums
    }
}

/// Cosine and sine of the rotation that eliminates entry `k` of a row with that of the R factor; `None` if it is zero.
pub(super) fn givens_rotation<T: Real, const N: usize>(own: &[T; N], row: &[T; N], k: usize) -> Option<(T, T)> {
    let (a, b) = (*own.get(k)?, *row.get(k)?);
    let length = (a * a + b * b).sqrt();
    // The squares of very small numbers underflow to zero.
    (b != T::from_f64(0.0) && length > T::from_f64(0.0)).then(|| (a / length, b / length))
}

/// Rotates two rows in their plane, from entry `from` on.
#[inline]
pub(super) fn rotate_rows<T: Real, const N: usize>(c: T, s: T, own: &mut [T; N], row: &mut [T; N], from: usize) {
    let (Some(own), Some(row)) = (own.get_mut(from..), row.get_mut(from..)) else {
        return;
    };
    for (x, y) in own.iter_mut().zip(row) {
        (*x, *y) = (c * *x + s * *y, c * *y - s * *x);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Random;

    const N: usize = 4;

    /// Rows and values from a seed.
    fn sample(random: &mut Random) -> ([f64; N], f64) {
        let row = core::array::from_fn(|_| random.uniform(-1.0, 1.0));
        let noise = random.uniform(-0.3, 0.3);
        (row, row[0] - 2.0 * row[1] + 0.5 * row[2] + 3.0 * row[3] + noise)
    }

    /// The normal equations of weighted rows and a prior, by the elimination of the runtime.
    fn batch(rows: &[([f64; N], f64)], weight: impl Fn(usize) -> f64, prior: &EstimatorPrior<f64, N>) -> [f64; N] {
        let (mut matrix, mut right) = ([[0.0; N]; N], [0.0; N]);
        for (age, (row, value)) in rows.iter().rev().enumerate() {
            for i in 0..N {
                right[i] += weight(age) * row[i] * value;
                for j in 0..N {
                    matrix[i][j] += weight(age) * row[i] * row[j];
                }
            }
        }
        for i in 0..N {
            matrix[i][i] += prior.weights[i].powi(2);
            right[i] += prior.weights[i].powi(2) * prior.values[i];
        }
        crate::solve(&mut matrix, &mut right).unwrap();
        right
    }

    fn check(share: f64, prior: &EstimatorPrior<f64, N>) {
        extern crate std;
        let mut random = Random::new(3);
        let mut rows = std::vec::Vec::new();
        let mut estimator = RecursiveEstimator::<f64, N>::new();
        for _ in 0..400 {
            let (row, value) = sample(&mut random);
            rows.push((row, value));
            estimator.forget(share);
            assert!(estimator.add(row, value));
        }
        let age = |age: usize| share.powi(i32::try_from(age).unwrap());
        let expected = batch(&rows, age, prior);
        let found = estimator.solve(prior);
        for (a, b) in found.iter().zip(&expected) {
            assert!((a - b).abs() < 1e-9, "{found:?} {expected:?}");
        }
        let solution = estimator.solve(&EstimatorPrior::uninformative());
        let left: f64 = rows.iter().rev().enumerate().fold(0.0, |sum, (i, (h, y))| {
            let e = y - h.iter().zip(&solution).map(|(a, b)| a * b).sum::<f64>();
            sum + age(i) * e * e
        });
        assert!((estimator.sum_of_squares() - left).abs() < 1e-9 * left);
    }

    #[test]
    fn without_forgetting_it_is_least_squares_of_all_rows() {
        check(1.0, &EstimatorPrior::uninformative());
    }

    #[test]
    fn with_forgetting_it_is_least_squares_of_rows_that_fade() {
        check(0.97, &EstimatorPrior::uninformative());
    }

    #[test]
    fn a_prior_does_not_fade() {
        check(
            0.9,
            &EstimatorPrior {
                values: [1.0, 2.0, 3.0, 4.0],
                weights: [0.0, 2.0, 0.1, 5.0],
            },
        );
    }

    #[test]
    fn a_direction_that_rests_keeps_its_value_and_nothing_winds_up() {
        let mut random = Random::new(5);
        let mut estimator = RecursiveEstimator::<f32, N>::new();
        for step in 0..2_000_000 {
            let (mut row, mut value) = sample(&mut random);
            if step >= 1000 {
                value -= 3.0 * row[3];
                row[3] = 0.0;
            }
            estimator.forget(0.99);
            #[allow(clippy::cast_possible_truncation)]
            let taken = estimator.add(row.map(|x| x as f32), value as f32);
            assert!(taken);
            if step == 3000 {
                assert!((estimator.solve(&EstimatorPrior::uninformative())[3] - 3.0).abs() < 0.3);
            }
        }
        // At last it has faded altogether, and what is expected takes its place.
        let prior = EstimatorPrior {
            values: [0.0, 0.0, 0.0, 7.0],
            weights: [0.0, 0.0, 0.0, 1e-3],
        };
        let found = estimator.solve(&prior);
        assert!((found[3] - 7.0).abs() < 1e-3, "{found:?}");
        assert!((found[0] - 1.0).abs() < 0.2, "{found:?}");
    }

    #[test]
    fn what_is_no_number_is_not_taken() {
        let mut estimator = RecursiveEstimator::<f64, 2>::new();
        assert!(!estimator.add([1.0, f64::NAN], 1.0));
        assert!(!estimator.add([1.0, 1.0], f64::INFINITY));
        let nothing = estimator.solve(&EstimatorPrior::uninformative()).map(f64::to_bits);
        assert_eq!(nothing, [0.0_f64.to_bits(); 2]);
    }
}
