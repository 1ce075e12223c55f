//! Rows times their weights, and the scales of residuals that weights are made from.
//!
//! Decision: weights are factors of rows. Variances, standstill, scales of channels and Huber's function multiply
//! rows of regressor and force alike. A force that was not measured makes its row zero before any filter, so
//! nothing has to be invented. Rows of zeros are no residuals, while error figures count every sample.

use crate::estimate::error::LeastSquaresError;
use crate::estimate::least_squares::LeastSquares;
use crate::estimate::magnitudes::Magnitudes;
use crate::estimate::rows::{Visit, is_left_out};
use crate::estimate::solution::Solution;

/// What each row was multiplied by in the end.
#[derive(Debug, Clone, PartialEq)]
pub struct Weighting {
    /// For each channel the scale of its residuals, in the units of the measured value (as shown).
    pub scales: Vec<f64>,
    /// Whether rows were divided by it.
    pub by_channel: bool,
    /// Huber's bound in scales.
    pub huber: Option<f64>,
    /// Share of the rows whose residual was beyond the bound.
    pub outliers: f64,
    /// Solutions that were made.
    pub iterations: usize,
    /// Whether the last two agreed.
    pub settled: bool,
}

/// Which rows a reweighting makes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum WeightedRows {
    /// Regressor and measured value times the root of the weight: their gradient is that of Huber's function.
    Weighted,
    /// WeightedRows within the bound only, with the residual that Huber's function sees: the second derivatives.
    Curvature,
}

/// The scale of each channel's residuals: standard deviation, or median magnitude for robust estimates.
pub(crate) fn scales<E: From<LeastSquaresError>>(
    solution: &Solution,
    weighting: &Weighting,
    show: &mut impl FnMut(&mut Visit<'_>) -> Result<(), E>,
) -> Result<Vec<f64>, E> {
    let channels = weighting.scales.len();
    let n = solution.values.len();
    let mut squares = vec![0.0; channels];
    let mut medians: Vec<Magnitudes> = match weighting.huber {
        Some(_) => vec![Magnitudes::new(); channels],
        None => Vec::new(),
    };
    let mut size = vec![0.0; channels];
    let mut counts = vec![0_usize; channels];
    let mut rows = 0_usize;
    show(&mut |regressor, measured| {
        for (row, y) in regressor.chunks_exact(n).zip(measured) {
            let channel = rows % channels;
            rows += 1;
            if is_left_out(row, *y) {
                continue;
            }
            counts[channel] += 1;
            let error = y - dot(row, &solution.values);
            squares[channel] += error * error;
            size[channel] += y * y;
            if let Some(median) = medians.get_mut(channel) {
                median.add(error.abs());
            }
        }
        Ok(())
    })?;
    Ok((0..channels)
        .map(|channel| {
            let samples = counts[channel].max(1) as f64;
            let freedom = (samples - solution.rank as f64 / channels as f64).max(1.0);
            let spread = (squares[channel] / freedom).sqrt();
            let scale = medians.get(channel).map_or(spread, |m| 1.4826 * m.median());
            // A channel without any residual must not get all the weight there is.
            let least = 1e-12 * (size[channel] / samples).sqrt();
            if scale > least {
                scale
            } else {
                spread.max(least).max(f64::MIN_POSITIVE.sqrt())
            }
        })
        .collect())
}

/// The regression of reweighted rows.
pub(crate) fn reweighted<E: From<LeastSquaresError>>(
    values: &[f64],
    channels: usize,
    weighting: &Weighting,
    rows: WeightedRows,
    show: &mut impl FnMut(&mut Visit<'_>) -> Result<(), E>,
) -> Result<LeastSquares, E> {
    let mut regression = LeastSquares::with_channels(values.len(), channels);
    show_weighted(values, channels, weighting, rows, show, &mut |w, y| {
        regression.add_rows(w, y)
    })?;
    Ok(regression)
}

/// The share of rows beyond Huber's bound.
pub(crate) fn outliers<E: From<LeastSquaresError>>(
    values: &[f64],
    channels: usize,
    weighting: &Weighting,
    show: &mut impl FnMut(&mut Visit<'_>) -> Result<(), E>,
) -> Result<f64, E> {
    let bound = weighting.huber.unwrap_or(f64::INFINITY);
    let (mut beyond, mut rows, mut counted) = (0_usize, 0_usize, 0_usize);
    show(&mut |w, y| {
        for (row, y) in w.chunks_exact(values.len()).zip(y) {
            let scale = weighting.scales[rows % channels];
            rows += 1;
            counted += usize::from(!is_left_out(row, *y));
            beyond += usize::from((y - dot(row, values)).abs() > bound * scale);
        }
        Ok(())
    })?;
    Ok(beyond as f64 / counted.max(1) as f64)
}

/// Shows weighted rows for residuals at `values`.
pub(crate) fn show_weighted<E: From<LeastSquaresError>>(
    values: &[f64],
    channels: usize,
    weighting: &Weighting,
    rows: WeightedRows,
    show: &mut impl FnMut(&mut Visit<'_>) -> Result<(), E>,
    visit: &mut Visit<'_>,
) -> Result<(), E> {
    if !weighting.by_channel && weighting.huber.is_none() {
        return show(visit);
    }
    let n = values.len();
    let (mut scaled, mut right) = (Vec::new(), Vec::new());
    let mut at = 0_usize;
    show(&mut |regressor, measured| {
        scaled.clear();
        right.clear();
        for (row, y) in regressor.chunks_exact(n).zip(measured) {
            let scale = weighting.scales[at % channels];
            at += 1;
            let error = y - dot(row, values);
            let inside = weighting
                .huber
                .is_none_or(|bound| error.abs() <= bound * scale);
            let root = match (weighting.huber, rows) {
                (Some(bound), WeightedRows::Weighted) if !inside => {
                    (bound * scale / error.abs()).sqrt()
                }
                (Some(_), WeightedRows::Curvature) if !inside => 0.0,
                _ => 1.0,
            };
            let factor = if weighting.by_channel {
                root / scale
            } else {
                root
            };
            scaled.extend(row.iter().map(|w| factor * w));
            right.push(match (weighting.huber, rows) {
                // What Huber's function sees of the residual keeps the variance of its gradient.
                (Some(bound), WeightedRows::Curvature) => {
                    let seen = error.clamp(-bound * scale, bound * scale);
                    let unit = if weighting.by_channel {
                        seen / scale
                    } else {
                        seen
                    };
                    factor * dot(row, values) + unit
                }
                _ => factor * y,
            });
        }
        visit(&scaled, &right)
    })
}

pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}
