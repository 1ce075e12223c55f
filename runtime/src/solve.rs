//! A small dense linear system, for Newton's steps on loops.

use crate::{PoseError, Real};

/// Solves `matrix * x = rhs` by Gaussian elimination with partial pivoting; `rhs` becomes `x`, the matrix is
/// overwritten.
///
/// # Errors
/// [`PoseError::Singular`] if a pivot is zero or NaN.
pub fn solve<T: Real, Row: AsRef<[T]> + AsMut<[T]>>(matrix: &mut [Row], rhs: &mut [T]) -> Result<(), PoseError> {
    // Nothing is indexed, so that nothing can panic: a missing entry is read as zero, and a pivot of zero is an error.
    let zero = T::from_f64(0.0);
    let entry = |row: &Row, column: usize| row.as_ref().get(column).copied().unwrap_or(zero);
    let n = rhs.len();
    for column in 0..n {
        let mut pivot = (column, zero);
        for (row, values) in matrix.iter().enumerate().take(n).skip(column) {
            let size = entry(values, column).abs();
            // NaN fails this comparison.
            if size > pivot.1 {
                pivot = (row, size);
            }
        }
        if pivot.0 != column {
            exchange(matrix, column, pivot.0);
            exchange(rhs, column, pivot.0);
        }
        let (Some((above, below)), Some((rhs_above, rhs_below))) = (
            matrix.split_at_mut_checked(column + 1),
            rhs.split_at_mut_checked(column + 1),
        ) else {
            return Err(PoseError::Singular);
        };
        let (Some(lead_row), Some(lead_rhs)) = (above.last(), rhs_above.last()) else {
            return Err(PoseError::Singular);
        };
        let lead = entry(lead_row, column);
        let regular = lead.abs() > zero;
        if !regular {
            return Err(PoseError::Singular);
        }
        for (row, value) in below.iter_mut().zip(rhs_below) {
            let factor = entry(row, column) / lead;
            let rest = row.as_mut().iter_mut().zip(lead_row.as_ref());
            for (x, above) in rest.skip(column + 1) {
                *x = *x - factor * *above;
            }
            *value = *value - factor * *lead_rhs;
        }
    }
    for row in (0..n).rev() {
        let Some((rest, known)) = rhs.split_at_mut_checked(row + 1) else {
            return Err(PoseError::Singular);
        };
        let (Some(value), Some(coefficients)) = (rest.last_mut(), matrix.get(row)) else {
            return Err(PoseError::Singular);
        };
        let coefficients = coefficients.as_ref().iter().skip(row);
        let mut sum = *value;
        for (coefficient, known) in coefficients.clone().skip(1).zip(known) {
            sum = sum - *coefficient * *known;
        }
        *value = coefficients.copied().next().map_or(zero, |c| sum / c);
    }
    Ok(())
}

/// `swap` without an index that could be out of range.
fn exchange<X>(values: &mut [X], low: usize, high: usize) {
    if let Some((front, back)) = values.split_at_mut_checked(high)
        && let (Some(a), Some(b)) = (front.get_mut(low), back.first_mut())
    {
        core::mem::swap(a, b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_system_that_needs_pivoting_is_solved() {
        let mut x = [7.0, 3.0, 0.0];
        solve(&mut [[0.0, 2.0, 1.0], [1.0, 1.0, 0.0], [3.0, 0.0, -1.0]], &mut x).unwrap();
        for (found, expected) in x.iter().zip([1.0, 2.0, 3.0]) {
            assert!((found - expected).abs() < 1e-12_f64);
        }
    }

    #[test]
    fn a_singular_system_is_an_error() {
        let dependent = solve(&mut [[1.0, 2.0], [2.0, 4.0]], &mut [1.0, 1.0_f64]);
        assert_eq!(dependent, Err(PoseError::Singular));
        assert_eq!(solve(&mut [[f64::NAN]], &mut [1.0]), Err(PoseError::Singular));
    }
}
