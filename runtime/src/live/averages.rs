//! The rows of one drive: averaged over a block of samples, and whitened.
//!
//! The mean of the rows times the parameters is the mean of the forces, so averaging is a low-pass filter that keeps
//! the equation valid. The noise that remains between blocks is modelled as a first-order autoregression: a block minus
//! `colour` times the previous block has uncorrelated residuals.

use crate::Real;

/// A row of the regressor with the value measured for it.
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

    /// Residual of the row: its value minus the row times the parameters.
    pub(super) fn residual(&self, parameters: &[T; NB]) -> T {
        let terms = self.row.iter().zip(parameters);
        terms.fold(self.value, |rest, (x, p)| rest - *x * *p)
    }

    /// `a` times this row plus `b` times the other, for row and value alike.
    fn linear_combination(&self, a: T, other: &Self, b: T) -> Self {
        let mut result = *self;
        for (x, y) in result.row.iter_mut().zip(&other.row) {
            *x = a * *x + b * *y;
        }
        result.value = a * self.value + b * other.value;
        result
    }
}

/// The current block of a drive, and the noise model of the drive.
#[derive(Clone, Copy, Debug)]
pub(super) struct DriveAverages<T, const NB: usize> {
    /// Sum of the samples so far.
    sum: WatchRow<T, NB>,
    /// Whether every force of the block was a usable number.
    is_complete: bool,
    /// The previous block, if there was no gap in between.
    before: Option<WatchRow<T, NB>>,
    /// Coefficient of the autoregression: share of the previous block's residual in that of this one, -0.98 to 0.98.
    colour: T,
    /// One over the standard deviation of the whitened residual.
    weight: T,
    /// Residuals from which the noise model is learned.
    learned: ResidualMoments<T>,
}

/// Sums over the residuals of blocks, for variance and autocorrelation.
#[derive(Clone, Copy, Debug)]
struct ResidualMoments<T> {
    /// Residual of the previous block, if there was no gap.
    last: Option<T>,
    /// Sum of squared residuals.
    squares: T,
    /// Sum of products of successive residuals.
    products: T,
    /// Number of squared residuals.
    n: T,
    /// Number of products.
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

    /// Adds a sample to the block; a force that is NaN or too large invalidates the block.
    pub(super) fn add_sample(&mut self, row: &[T; NB], force: T) {
        for (sum, x) in self.sum.row.iter_mut().zip(row) {
            *sum = *sum + *x;
        }
        self.sum.value = self.sum.value + force;
        self.is_complete &= force.abs() < T::largest();
    }

    /// The mean of the block that ends here, with its value reduced by what the parameters explain; `None` for an
    /// invalid block. `share` is one over the number of samples.
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

    /// Whitens a block to residuals of standard deviation one; `None` after a gap.
    pub(super) fn whiten(&mut self, mean: &WatchRow<T, NB>) -> Option<WatchRow<T, NB>> {
        let before = self.before.replace(*mean)?;
        Some(mean.linear_combination(self.weight, &before, -self.weight * self.colour))
    }

    /// Adds the residual of a block to the sums of the noise model.
    pub(super) fn add_residual(&mut self, residual: T) {
        let (m, one) = (&mut self.learned, T::from_f64(1.0));
        if let Some(last) = m.last.replace(residual) {
            m.products = m.products + last * residual;
            m.n_products = m.n_products + one;
        }
        m.squares = m.squares + residual * residual;
        m.n = m.n + one;
    }

    /// Computes the noise model of the drive from the sums.
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
        // Without any noise all drives have the same weight.
        if deviation > zero && (one / deviation).is_finite() {
            self.weight = one / deviation;
        }
    }
}
