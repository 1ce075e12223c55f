//! One drive's rows: averaged over a block of samples, and made white.
//!
//! A mean of rows times the parameters is the mean of the forces, whatever the rows are, so averaging is a low-pass that
//! keeps the equation. What is left of the noise between blocks is taken for an autoregression of first order: a block less
//! `colour` times the block before has residuals that do not depend on each other.

use crate::Real;

/// A row of the regressor with what was measured for it.
#[derive(Clone, Copy, Debug)]
pub(super) struct WatchRow<T, const NB: usize> {
    pub(super) row: [T; NB],
    pub(super) value: T,
}

impl<T: Real, const NB: usize> WatchRow<T, NB> {
    pub(super) fn zero() -> Self {
        Self {
            row: [T::from_f64(0.0); NB],
            value: T::from_f64(0.0),
        }
    }

    /// What parameters leave of the value.
    pub(super) fn residual(&self, parameters: &[T; NB]) -> T {
        let terms = self.row.iter().zip(parameters);
        terms.fold(self.value, |rest, (x, p)| rest - *x * *p)
    }

    fn linear_combination(&self, a: T, other: &Self, b: T) -> Self {
        let mut result = *self;
        for (x, y) in result.row.iter_mut().zip(&other.row) {
            *x = a * *x + b * *y;
        }
        result.value = a * self.value + b * other.value;
        result
    }
}

/// A drive's block in the making, and the noise of the drive.
#[derive(Clone, Copy, Debug)]
pub(super) struct DriveAverages<T, const NB: usize> {
    sum: WatchRow<T, NB>,
    /// Whether every sample of the block could be counted.
    is_complete: bool,
    before: Option<WatchRow<T, NB>>,
    /// What of a block's residual is that of the block before.
    colour: T,
    /// One over the deviation of the rest.
    weight: T,
    learned: ResidualMoments<T>,
}

/// Sums over residuals of blocks.
#[derive(Clone, Copy, Debug)]
struct ResidualMoments<T> {
    last: Option<T>,
    squares: T,
    products: T,
    n: T,
    n_products: T,
}

impl<T: Real, const NB: usize> DriveAverages<T, NB> {
    pub(super) fn new() -> Self {
        let zero = T::from_f64(0.0);
        Self {
            sum: WatchRow::zero(),
            is_complete: true,
            before: None,
            colour: zero,
            weight: T::from_f64(1.0),
            learned: ResidualMoments {
                last: None,
                squares: zero,
                products: zero,
                n: zero,
                n_products: zero,
            },
        }
    }

    /// Takes a sample; one with something that is no number spoils its block.
    pub(super) fn add_sample(&mut self, row: &[T; NB], force: T) {
        for (sum, x) in self.sum.row.iter_mut().zip(row) {
            *sum = *sum + *x;
        }
        self.sum.value = self.sum.value + force;
        self.is_complete &= force.abs() < T::largest();
    }

    /// The mean of the block that ends here, its value less what the parameters explain; none if it is spoilt.
    pub(super) fn end_block(&mut self, share: T, parameters: &[T; NB]) -> Option<WatchRow<T, NB>> {
        let sum = core::mem::replace(&mut self.sum, WatchRow::zero());
        let whole = core::mem::replace(&mut self.is_complete, true);
        let mut mean = sum.linear_combination(share, &sum, T::from_f64(0.0));
        mean.value = mean.residual(parameters);
        let fine = mean.value.is_finite() && mean.row.iter().all(|x| x.abs() < T::largest());
        if whole && fine {
            return Some(mean);
        }
        self.before = None;
        self.learned.last = None;
        None
    }

    /// A block with the noise made white and of deviation one; none behind a gap.
    pub(super) fn whiten(&mut self, mean: &WatchRow<T, NB>) -> Option<WatchRow<T, NB>> {
        let before = self.before.replace(*mean)?;
        Some(mean.linear_combination(self.weight, &before, -self.weight * self.colour))
    }

    /// Learns from the residual of a block.
    pub(super) fn add_residual(&mut self, residual: T) {
        let (m, one) = (&mut self.learned, T::from_f64(1.0));
        if let Some(last) = m.last.replace(residual) {
            m.products = m.products + last * residual;
            m.n_products = m.n_products + one;
        }
        m.squares = m.squares + residual * residual;
        m.n = m.n + one;
    }

    /// Takes what was learned for the drive's noise.
    pub(super) fn update_noise_model(&mut self) {
        let m = &self.learned;
        let (zero, one, most) = (T::from_f64(0.0), T::from_f64(1.0), T::from_f64(0.98));
        let variance = m.squares / m.n;
        let colour = m.products / m.n_products / variance;
        if colour.is_finite() {
            let colour = if colour > most { most } else { colour };
            self.colour = if colour < -most { -most } else { colour };
        }
        let deviation = (variance * (one - self.colour * self.colour)).sqrt();
        // Without any noise all drives count alike.
        if deviation > zero && (one / deviation).is_finite() {
            self.weight = one / deviation;
        }
    }
}
