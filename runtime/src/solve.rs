//! A small dense linear system, for Newton's steps on loops.

use crate::{PoseError, Real};

/// Solves `matrix * x = rhs` by Gaussian elimination with partial pivoting; `rhs` becomes `x`, the matrix is used up.
///
/// # Errors
/// [`PoseError::Singular`] if a pivot is zero or no number.
pub fn solve<T: Real, Row: AsRef<[T]> + AsMut<[T]>>(
    matrix: &mut [Row],
    rhs: &mut [T],
) -> Result<(), PoseError> {
    let n = rhs.len();
    let zero = T::from_f64(0.0);
    for column in 0..n {
        let mut pivot = column;
        for row in column + 1..n {
            if matrix[row].as_ref()[column].abs() > matrix[pivot].as_ref()[column].abs() {
                pivot = row;
            }
        }
        matrix.swap(column, pivot);
        rhs.swap(column, pivot);
        let (above, below) = matrix.split_at_mut(column + 1);
        let lead_row = above[column].as_ref();
        let lead = lead_row[column];
        let regular = lead.abs() > zero;
        // A pivot that is no number fails this comparison too.
        if !regular {
            return Err(PoseError::Singular);
        }
        for (k, row) in below.iter_mut().enumerate() {
            let row = row.as_mut();
            let factor = row[column] / lead;
            for (x, above) in row.iter_mut().zip(lead_row).skip(column + 1) {
                *x = *x - factor * *above;
            }
            rhs[column + 1 + k] = rhs[column + 1 + k] - factor * rhs[column];
        }
    }
    for row in (0..n).rev() {
        let coefficients = matrix[row].as_ref();
        let mut value = rhs[row];
        for k in row + 1..n {
            value = value - coefficients[k] * rhs[k];
        }
        rhs[row] = value / coefficients[row];
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_system_that_needs_pivoting_is_solved() {
        let mut x = [7.0, 3.0, 0.0];
        solve(
            &mut [[0.0, 2.0, 1.0], [1.0, 1.0, 0.0], [3.0, 0.0, -1.0]],
            &mut x,
        )
        .unwrap();
        for (found, expected) in x.iter().zip([1.0, 2.0, 3.0]) {
            assert!((found - expected).abs() < 1e-12_f64);
        }
    }

    #[test]
    fn a_singular_system_is_an_error() {
        let dependent = solve(&mut [[1.0, 2.0], [2.0, 4.0]], &mut [1.0, 1.0_f64]);
        assert_eq!(dependent, Err(PoseError::Singular));
        assert_eq!(
            solve(&mut [[f64::NAN]], &mut [1.0]),
            Err(PoseError::Singular)
        );
    }
}
