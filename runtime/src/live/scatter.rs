//! Differences between windows and the reference while nothing has changed, for each parameter.
//!
//! Squares of scores over information, summed over windows, give the factor by which windows scatter more than under
//! white noise. Causes are coloured noise, model errors along the motion, and other usual disturbances. A change is
//! compared with this scatter. The number of windows from which it was learned determines its own uncertainty.

use super::comparison::ChangeScore;
use crate::Real;

/// Lower limit of the factor, for simulations without any noise.
const MINIMUM_DISPERSION: f64 = 1e-2;
/// A square larger than this many times its scatter is reduced to that limit.
const WINSOR_LIMIT: f64 = 9.0;
/// Number of windows after which single windows are limited by [`WINSOR_LIMIT`].
const MINIMUM_WINDOWS: f64 = 5.0;

/// Sums over windows, one per parameter.
#[derive(Clone, Copy, Debug)]
pub(super) struct WindowScatter<T, const NB: usize> {
    /// Sum of squared scores.
    squares: [T; NB],
    /// Sum of the information.
    information: [T; NB],
    /// Number of comparisons, faded as the sums are.
    n: T,
    /// Non-overlapping windows per comparison.
    per_comparison: T,
}

/// Scatter with which a change of a parameter is compared.
#[derive(Clone, Copy, Debug)]
pub(super) struct ScatterEstimate<T> {
    /// Factor on the variance of white noise.
    pub(super) dispersion: T,
    /// Number of windows, with the information of the present one, from which it was learned.
    windows: T,
}

impl<T: Real> ScatterEstimate<T> {
    /// Gain that chance alone does not reach. `limit` is its value if the dispersion is known; the uncertainty of the
    /// dispersion is included by the likelihood ratio of Student's distribution, `nu log(1 + F/nu)`.
    pub(super) fn threshold(&self, limit: T) -> T {
        let stretched = (limit / self.windows).exp() - T::from_f64(1.0);
        self.dispersion * self.windows * stretched
    }

    /// Whether a gain exceeds the threshold.
    pub(super) fn is_exceeded(&self, gain: T, limit: T) -> bool {
        // Without windows the threshold is NaN, and the comparison is false.
        gain > self.threshold(limit)
    }
}

impl<T: Real, const NB: usize> WindowScatter<T, NB> {
    pub(super) fn new(per_comparison: T) -> Self {
        let zero = T::from_f64(0.0);
        Self {
            squares: [zero; NB],
            information: [zero; NB],
            n: zero,
            per_comparison,
        }
    }

    /// Scatter of parameter `k`, for a window with the given information on it.
    pub(super) fn estimate(&self, k: usize, information: T) -> ScatterEstimate<T> {
        let zero = T::from_f64(0.0);
        let entry = |array: &[T; NB]| array.get(k).copied().unwrap_or(zero);
        let (squares, known) = (entry(&self.squares), entry(&self.information));
        let (least, found) = (T::from_f64(MINIMUM_DISPERSION), squares / known);
        // A window with much more information than the present one counts once.
        let n = known / information;
        let n = if n < self.n { n } else { self.n };
        ScatterEstimate {
            dispersion: if found > least { found } else { least },
            windows: n * self.per_comparison,
        }
    }

    /// Adds a window in which nothing has changed; the sums before are multiplied by `share`.
    pub(super) fn add_window(&mut self, singles: &[ChangeScore<T>; NB], share: T) {
        let (few, furthest) = (T::from_f64(MINIMUM_WINDOWS), T::from_f64(WINSOR_LIMIT));
        self.n = self.n * share + T::from_f64(1.0);
        for (k, single) in singles.iter().enumerate() {
            let measure = self.estimate(k, single.information);
            let mut square = single.score * single.score;
            // Outliers are limited, so that a single window cannot raise the scatter much.
            let most = furthest * measure.dispersion * single.information;
            if measure.windows > few && square > most {
                square = most;
            }
            let sums = self.squares.get_mut(k).zip(self.information.get_mut(k));
            if let Some((squares, information)) = sums {
                *squares = *squares * share + square;
                *information = *information * share + single.information;
            }
        }
    }
}
