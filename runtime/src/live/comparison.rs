//! What a window says of a change of the parameters against a reference, a row at a time.
//!
//! Rows of the reference know the parameters p, those of the window p + d. Turning the rows of the window into the triangle
//! of both takes p out of them; what is left of them speaks of the change d alone, with what either side does not know
//! of p allowed for. A change of parameter j alone then explains `(m_j' z)^2 / m_j' m_j` of the squares, with the columns
//! m of what is left and its values z.

use super::estimator::{RecursiveEstimator, givens_rotation, rotate_rows};
use crate::Real;

/// The elimination in the making; each call of [`Self::advance`] does one row of `NB`.
#[derive(Clone, Copy, Debug)]
pub(super) struct WindowComparison<T, const NB: usize> {
    /// The triangle of both in p, its part in d, and its values.
    both: [[T; NB]; NB],
    change: [[T; NB]; NB],
    values: [T; NB],
    /// Rows of the window; those before `next` are what is left of them.
    window: [[T; NB]; NB],
    window_values: [T; NB],
    next: usize,
}

/// A change of one parameter alone, in units of whitened rows.
#[derive(Clone, Copy, Debug)]
pub(super) struct ChangeScore<T> {
    /// Information of the window on the change.
    pub(super) information: T,
    /// The change times that.
    pub(super) score: T,
}

impl<T: Real> ChangeScore<T> {
    /// Squares that the change explains; 0 where nothing is known of it.
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
    /// There is nothing to compare.
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

    /// Begins with a window and a reference as they are now.
    pub(super) fn start(
        &mut self,
        reference: &RecursiveEstimator<T, NB>,
        window: &RecursiveEstimator<T, NB>,
    ) {
        self.both = reference.rows;
        self.values = reference.values;
        self.change = [[T::from_f64(0.0); NB]; NB];
        self.window = window.rows;
        self.window_values = window.values;
        self.next = 0;
    }

    /// Does one row; true where it was the last.
    pub(super) fn advance(&mut self) -> bool {
        let place = self.next;
        let rows = self.window.get_mut(place);
        let Some((row, value)) = rows.zip(self.window_values.get_mut(place)) else {
            return false;
        };
        let (mut common, mut own) = (*row, *row);
        let triangle = self.both.iter_mut().zip(&mut self.change);
        let triangle = triangle.zip(&mut self.values).enumerate();
        // Above the row's place the window has zeros.
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

    /// Whether a comparison is in the making.
    pub(super) fn is_busy(&self) -> bool {
        self.next < NB
    }

    /// What is left of the window: a change of each parameter alone.
    ///
    /// `alone` is the information of the window: what is no more than rounding beside it is none.
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
            // What is no number is not more either.
            let is_known = single.information > rounding * *alone;
            if !is_known {
                (single.information, single.score) = (zero, zero);
            }
        }
        singles
    }

    /// The same for a further change besides that of parameter `first`.
    pub(super) fn second_changes(
        &self,
        first: usize,
        singles: &[ChangeScore<T>; NB],
    ) -> [ChangeScore<T>; NB] {
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
            // Of what all but coincides with the first nothing can be said.
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
