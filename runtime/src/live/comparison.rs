//! Test of a window for a change of the parameters against a reference, one row per step.
//!
//! Rows of the reference have the parameters p, those of the window p + d. Rotating the rows of the window into the
//! common R factor eliminates p from them. The remaining rows depend on the change d alone and account for the
//! uncertainty of p on both sides. A change of parameter j alone then explains `(m_j' z)^2 / m_j' m_j` of their
//! squares, with the columns m of the remaining rows and their values z.

use super::estimator::{RecursiveEstimator, givens_rotation, rotate_rows};
use crate::Real;

/// State of the elimination; each call of [`Self::advance`] processes one row of `NB`.
#[derive(Clone, Copy, Debug)]
pub(super) struct WindowComparison<T, const NB: usize> {
    /// The common R factor in p, its columns in d, and its right-hand side.
    both: [[T; NB]; NB],
    change: [[T; NB]; NB],
    values: [T; NB],
    /// Rows of the window; rows before `next` are those that remain after the elimination of p.
    window: [[T; NB]; NB],
    window_values: [T; NB],
    /// First row that is not processed yet; `NB` if there is none.
    next: usize,
}

/// Score of a change of one parameter alone, in units of whitened rows.
#[derive(Clone, Copy, Debug)]
pub(super) struct ChangeScore<T> {
    /// Information of the window on the change: one over its variance.
    pub(super) information: T,
    /// Estimated change times its information.
    pub(super) score: T,
}

impl<T: Real> ChangeScore<T> {
    /// Squares that the change explains; 0 without information.
    pub(super) fn gain(&self) -> T {
        let zero = T::from_f64(0.0);
        if self.information > zero {
            self.score * self.score / self.information
        } else {
            zero
        }
    }
}

impl<T: Real, const NB: usize> WindowComparison<T, NB> {
    /// A comparison with nothing to do.
    pub(super) fn new_idle() -> Self {
        let zero = T::from_f64(0.0);
        let zeros = [[zero; NB]; NB];
        Self {
            both: zeros,
            change: zeros,
            values: [zero; NB],
            window: zeros,
            window_values: [zero; NB],
            next: NB,
        }
    }

    /// Starts with copies of a window and a reference.
    pub(super) fn start(&mut self, reference: &RecursiveEstimator<T, NB>, window: &RecursiveEstimator<T, NB>) {
        self.both = reference.rows;
        self.values = reference.values;
        self.change = [[T::from_f64(0.0); NB]; NB];
        self.window = window.rows;
        self.window_values = window.values;
        self.next = 0;
    }

    /// Processes one row; true if it was the last.
    pub(super) fn advance(&mut self) -> bool {
        let place = self.next;
        let rows = self.window.get_mut(place);
        let Some((row, value)) = rows.zip(self.window_values.get_mut(place)) else {
            return false;
        };
        let (mut common, mut own) = (*row, *row);
        let triangle = self.both.iter_mut().zip(&mut self.change);
        let triangle = triangle.zip(&mut self.values).enumerate();
        // Entries of the window before the diagonal are zero.
        for (k, ((both, change), both_value)) in triangle.skip(place) {
            let Some((c, s)) = givens_rotation(both, &common, k) else {
                continue;
            };
            rotate_rows(c, s, both, &mut common, k);
            rotate_rows(c, s, change, &mut own, 0);
            (*both_value, *value) = (c * *both_value + s * *value, c * *value - s * *both_value);
        }
        *row = own;
        self.next = place + 1;
        self.next == NB
    }

    /// Whether rows are still to be processed.
    pub(super) fn is_busy(&self) -> bool {
        self.next < NB
    }

    /// Score of a change of each parameter alone, from the remaining rows of the window.
    ///
    /// `alone` is the information of the window; a share of it within rounding counts as none.
    pub(super) fn single_changes(&self, alone: &[T; NB]) -> [ChangeScore<T>; NB] {
        let zero = T::from_f64(0.0);
        let mut singles = [ChangeScore {
            information: zero,
            score: zero,
        }; NB];
        for (row, value) in self.window.iter().zip(&self.window_values) {
            for (single, x) in singles.iter_mut().zip(row) {
                single.information = single.information + *x * *x;
                single.score = single.score + *x * *value;
            }
        }
        let rounding = T::epsilon().sqrt();
        for (single, alone) in singles.iter_mut().zip(alone) {
            // Written so that NaN counts as unknown.
            let is_known = single.information > rounding * *alone;
            if !is_known {
                (single.information, single.score) = (zero, zero);
            }
        }
        singles
    }

    /// The same for a second change in addition to that of parameter `first`.
    pub(super) fn second_changes(&self, first: usize, singles: &[ChangeScore<T>; NB]) -> [ChangeScore<T>; NB] {
        let zero = T::from_f64(0.0);
        let mut common = [zero; NB];
        for row in &self.window {
            let own = row.get(first).copied().unwrap_or(zero);
            for (sum, x) in common.iter_mut().zip(row) {
                *sum = *sum + own * *x;
            }
        }
        let mut rest = *singles;
        let Some(known) = singles.get(first).filter(|s| s.information > zero) else {
            return rest;
        };
        for ((single, shared), k) in rest.iter_mut().zip(&common).zip(0..) {
            let share = *shared / known.information;
            let information = single.information - share * *shared;
            // A change that nearly coincides with the first cannot be distinguished from it.
            let is_apart = k != first && information > T::from_f64(1e-3) * single.information;
            if is_apart {
                single.score = single.score - share * known.score;
                single.information = information;
            } else {
                (single.information, single.score) = (zero, zero);
            }
        }
        rest
    }

    /// Squares that changes of all parameters together explain.
    pub(super) fn total_gain(&self) -> T {
        let squares = self.window_values.iter();
        squares.fold(T::from_f64(0.0), |sum, z| sum + *z * *z)
    }
}
