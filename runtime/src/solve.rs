//! A small dense linear system, for Newton's steps on loops.

use crate::{PoseError, Real};

/// Solves `matrix * x = rhs` by Gaussian elimination with partial pivoting.
///
/// # Errors
/// [`PoseError::Singular`] if a pivot is zero or no number.
pub fn solve<T: Real, const N: usize>(
    mut matrix: [[T; N]; N],
    mut rhs: [T; N],
) -> Result<[T; N], PoseError> {
    let zero = T::from_f64(0.0);
    for column in 0..N {
        let mut pivot = column;
        for row in column + 1..N {
            if matrix[row][column].abs() > matrix[pivot][column].abs() {
                pivot = row;
            }
        }
        matrix.swap(column, pivot);
        rhs.swap(column, pivot);
        let lead = matrix[column][column];
        let regular = lead.abs() > zero;
        // A pivot that is no number fails this comparison too.
        if !regular {
            return Err(PoseError::Singular);
        }
        for row in column + 1..N {
            let factor = matrix[row][column] / lead;
            for k in column..N {
                matrix[row][k] = matrix[row][k] - factor * matrix[column][k];
            }
            rhs[row] = rhs[row] - factor * rhs[column];
        }
    }
    for row in (0..N).rev() {
        let mut value = rhs[row];
        for k in row + 1..N {
            value = value - matrix[row][k] * rhs[k];
        }
        rhs[row] = value / matrix[row][row];
    }
    Ok(rhs)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_system_that_needs_pivoting_is_solved() {
        let x = solve(
            [[0.0, 2.0, 1.0], [1.0, 1.0, 0.0], [3.0, 0.0, -1.0]],
            [7.0, 3.0, 0.0],
        )
        .unwrap();
        for (found, expected) in x.iter().zip([1.0, 2.0, 3.0]) {
            assert!((found - expected).abs() < 1e-12_f64);
        }
    }

    #[test]
    fn a_singular_system_is_an_error() {
        assert_eq!(
            solve([[1.0, 2.0], [2.0, 4.0]], [1.0, 1.0_f64]),
            Err(PoseError::Singular)
        );
        assert_eq!(solve([[f64::NAN]], [1.0]), Err(PoseError::Singular));
    }
}
