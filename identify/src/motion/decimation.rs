//! Decimation: the parallel filter of identification, which is applied equally to regressor and forces.
//!
//! Columns of samples go in, shorter columns of the same motion come out.

use crate::signal::{FilterError, LowPass};

/// Columns that are filtered at the same time, so that the recursion of the filter uses vector registers.
const LANES: usize = 16;
/// The same for a group of few columns.
const FEW: usize = 4;

/// The parallel filter passes frequencies up to this share of the new sampling rate.
pub const DECIMATION_PASSBAND: f64 = 0.4;

/// The low-pass that [`decimate`] uses: Chebyshev 1, order 8, 0.05 dB, up to 0.8 of the new
/// half rate.
fn anti_alias(factor: usize) -> Result<LowPass, FilterError> {
    LowPass::chebyshev1(8, 0.05, DECIMATION_PASSBAND / factor as f64, 1.0)
}

/// Every `factor`-th sample, starting with the first, of the zero-phase low-passed signal
/// (Chebyshev 1, order 8, 0.05 dB of ripple): MATLAB's and scipy's `decimate`.
/// A factor of 1 returns the signal as it is.
/// Fails when the factor is 0 or the signal has 27 samples or fewer.
///
/// ```
/// let ramp: Vec<f64> = (0..200).map(f64::from).collect();
/// let short = modelmill_identify::decimate(&ramp, 10)?;
/// assert_eq!(short.len(), 20);
/// # Ok::<(), modelmill_identify::FilterError>(())
/// ```
pub fn decimate(signal: &[f64], factor: usize) -> Result<Vec<f64>, FilterError> {
    match factor {
        0 => Err(FilterError::FactorOutOfRange { factor }),
        1 => Ok(signal.to_vec()),
        _ if factor >= signal.len() => Err(FilterError::FactorOutOfRange { factor }),
        _ => Ok(anti_alias(factor)?
            .zero_phase(signal)?
            .into_iter()
            .step_by(factor)
            .collect()),
    }
}

/// Every `factor`-th time stamp, those that [`decimate`] keeps; times are picked, not filtered.
pub fn decimate_time(time: &[f64], factor: usize) -> Vec<f64> {
    time.iter().copied().step_by(factor.max(1)).collect()
}

/// [`decimate`] on several columns of equal length, some of them at the same time.
/// Fails as [`decimate`] does.
pub fn decimate_columns(columns: &[&[f64]], factor: usize) -> Result<Vec<Vec<f64>>, FilterError> {
    if factor < 2 {
        return columns.iter().map(|column| decimate(column, factor)).collect();
    }
    let mut short = Vec::with_capacity(columns.len());
    // Groups of columns are filtered together; a small group uses fewer lanes.
    for group in columns.chunks(LANES) {
        short.extend(if group.len() <= FEW {
            decimate_group::<FEW>(group, factor)?
        } else {
            decimate_group::<LANES>(group, factor)?
        });
    }
    Ok(short)
}

/// [`decimate_columns`] of at most `N` columns.
fn decimate_group<const N: usize>(group: &[&[f64]], factor: usize) -> Result<Vec<Vec<f64>>, FilterError> {
    let samples = group.iter().map(|column| column.len()).min().unwrap_or(0);
    // Interleave the columns, one lane per column.
    let mut lanes = vec![[0.0; N]; samples];
    for (k, column) in group.iter().enumerate() {
        for (lane, value) in lanes.iter_mut().zip(*column) {
            lane[k] = *value;
        }
    }
    let kept = decimate_lanes(&lanes, factor)?;
    let column = |k: usize| kept.iter().map(|lane| lane[k]).collect();
    Ok((0..group.len()).map(column).collect())
}

/// Every `factor`-th sample of interleaved columns.
fn decimate_lanes<const N: usize>(lanes: &[[f64; N]], factor: usize) -> Result<Vec<[f64; N]>, FilterError> {
    if factor >= lanes.len() {
        return Err(FilterError::FactorOutOfRange { factor });
    }
    let filtered = anti_alias(factor)?.zero_phase_lanes(lanes)?;
    Ok(filtered.into_iter().step_by(factor).collect())
}

/// [`decimate`] on each of `width` interleaved columns: `table[sample * width + column]` in, the
/// same layout out. With `width = n_channels * n_columns` this is the parallel filter on a
/// regressor whose rows are interleaved per sample; with `width = n_channels` on the forces.
/// Fails as [`decimate`] does, and when the length is no multiple of `width`.
pub fn decimate_table(table: &[f64], width: usize, factor: usize) -> Result<Vec<f64>, FilterError> {
    if width == 0 || !table.len().is_multiple_of(width) {
        return Err(FilterError::Shape {
            have: table.len(),
            per_sample: width,
        });
    }
    match factor {
        0 => return Err(FilterError::FactorOutOfRange { factor }),
        1 => return Ok(table.to_vec()),
        _ => {}
    }
    let samples = table.len() / width;
    let mut short = vec![0.0; samples.div_ceil(factor) * width];
    // Columns of bodies that a drive does not move are zero, and stay zero.
    let mut is_zero = vec![true; width];
    for row in table.chunks_exact(width) {
        for (is_zero, value) in is_zero.iter_mut().zip(row) {
            *is_zero &= *value == 0.0;
        }
    }
    let mut columns: Vec<usize> = (0..width).filter(|column| !is_zero[*column]).collect();
    if columns.is_empty() {
        // Without other columns one of zeros is filtered, so that the length is checked.
        columns.push(0);
    }
    // Few columns at a time keep the memory small.
    for group in columns.chunks(LANES) {
        let lanes: Vec<[f64; LANES]> = (table.chunks_exact(width))
            .map(|row| {
                let mut lane = [0.0; LANES];
                for (value, column) in lane.iter_mut().zip(group) {
                    *value = row[*column];
                }
                lane
            })
            .collect();
        let kept = decimate_lanes(&lanes, factor)?;
        for (row, lane) in short.chunks_exact_mut(width).zip(&kept) {
            for (column, value) in group.iter().zip(lane) {
                row[*column] = *value;
            }
        }
    }
    Ok(short)
}
