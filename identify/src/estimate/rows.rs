//! Blocks of rows of a regression, and the checks that all estimators apply to them.

use crate::estimate::error::LeastSquaresError;

/// Receives a block of complete samples: regressor and measured values, as in
/// [`LeastSquares::add_rows`](crate::LeastSquares::add_rows), rows interleaved per sample (`row = sample * channels +
/// channel`).
pub type RowVisitor<'a> = dyn FnMut(&[f64], &[f64]) -> Result<(), LeastSquaresError> + 'a;

/// Checks the lengths of a block of rows and that all numbers are finite; `before` is the number of earlier rows.
pub(crate) fn check_rows(
    regressor: &[f64],
    measured: &[f64],
    columns: usize,
    before: usize,
) -> Result<(), LeastSquaresError> {
    if columns == 0 {
        return Err(LeastSquaresError::NoParameters);
    }
    if regressor.len() != measured.len() * columns {
        return Err(LeastSquaresError::Shape {
            regressor: regressor.len(),
            measured: measured.len(),
            columns,
        });
    }
    if !all_finite(regressor)
        && let Some(i) = regressor.iter().position(|value| !value.is_finite())
    {
        return Err(LeastSquaresError::NotFinite {
            row: before + i / columns,
            column: Some(i % columns),
        });
    }
    if !all_finite(measured)
        && let Some(i) = measured.iter().position(|value| !value.is_finite())
    {
        return Err(LeastSquaresError::NotFinite {
            row: before + i,
            column: None,
        });
    }
    Ok(())
}

/// Whether a row contains no information, for example with weight 0: its residual is no sample of the noise.
pub(crate) fn is_uninformative(row: &[f64], measured: f64) -> bool {
    measured == 0.0 && row.iter().all(|w| *w == 0.0)
}

/// Whether all numbers are finite. A sum is not finite if one of its terms is not; independent sums reach the speed of
/// memory.
pub(crate) fn all_finite(values: &[f64]) -> bool {
    let mut sums = [0.0; 8];
    let eights = values.chunks_exact(8);
    let rest: f64 = eights.remainder().iter().sum();
    for eight in eights {
        for lane in 0..8 {
            // Zero times infinity or NaN is NaN; zero times a finite number cannot overflow.
            sums[lane] += 0.0 * eight[lane];
        }
    }
    (sums.iter().sum::<f64>() + 0.0 * rest).is_finite()
}
