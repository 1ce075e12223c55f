//! How windows differ from the reference when nothing has changed, parameter by parameter.
//!
//! Squares of scores over information, summed over windows, are the factor by which windows scatter more than white noise
//! would have them: noise of other colours, faults of the model along the motion, and all else that is there every day.
//! A change is held against that. How many windows it was learned from says how far a window may be off by chance.

use super::comparison::ChangeScore;
use crate::Real;

/// The factor is never taken for less: what has no noise at all is a simulation.
const MINIMUM_DISPERSION: f64 = 1e-2;
/// A window that is off by more than this many times its scatter counts as if it were off by no more.
const WINSOR_LIMIT: f64 = 9.0;
/// So many windows before single ones are held against the rest.
const MINIMUM_WINDOWS: f64 = 5.0;

/// Sums over windows.
#[derive(Clone, Copy, Debug)]
pub(super) struct WindowScatter<T, const NB: usize> {
    squares: [T; NB],
    information: [T; NB],
    /// Comparisons that were taken.
    n: T,
    /// Windows that do not overlap, per comparison.
    per_comparison: T,
}

/// What a change of a parameter is held against.
#[derive(Clone, Copy, Debug)]
pub(super) struct ScatterEstimate<T> {
    /// Factor on the variance of white noise.
    pub(super) dispersion: T,
    /// Windows, of the present one's information, from which it was learned.
    windows: T,
}

impl<T: Real> ScatterEstimate<T> {
    /// The gain that chance does not reach, where `limit` is that of a dispersion that is known: Student's distribution by
    /// its likelihood ratio, `nu log(1 + F/nu)`.
    pub(super) fn threshold(&self, limit: T) -> T {
        let stretched = (limit / self.windows).exp() - T::from_f64(1.0);
        self.dispersion * self.windows * stretched
    }

    /// Whether a gain exceeds what chance reaches.
    pub(super) fn is_exceeded(&self, gain: T, limit: T) -> bool {
        // Without windows the threshold is no number.
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

    /// What parameter `k` is held against, with what a window knows of it.
    pub(super) fn estimate(&self, k: usize, information: T) -> ScatterEstimate<T> {
        let zero = T::from_f64(0.0);
        let entry = |array: &[T; NB]| array.get(k).copied().unwrap_or(zero);
        let (squares, known) = (entry(&self.squares), entry(&self.information));
        let (least, found) = (T::from_f64(MINIMUM_DISPERSION), squares / known);
        // Windows that knew much more do not count more than once.
        let n = known / information;
        let n = if n < self.n { n } else { self.n };
        ScatterEstimate {
            dispersion: if found > least { found } else { least },
            windows: n * self.per_comparison,
        }
    }

    /// Takes a window in which nothing has changed; those before count `share` as much.
    pub(super) fn add_window(&mut self, singles: &[ChangeScore<T>; NB], share: T) {
        let (few, furthest) = (T::from_f64(MINIMUM_WINDOWS), T::from_f64(WINSOR_LIMIT));
        self.n = self.n * share + T::from_f64(1.0);
        for (k, single) in singles.iter().enumerate() {
            let measure = self.estimate(k, single.information);
            let mut square = single.score * single.score;
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
