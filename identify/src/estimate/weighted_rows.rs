//! Weighted rows, and the scales of residuals from which weights are computed.
//!
//! Decision: weights are factors of rows. Variances, standstill, scales of channels and Huber's function multiply rows
//! of regressor and force equally. A force that was not measured makes its row zero before any filter, so no value has
//! to be invented. Rows of zeros are no residuals, while error figures count every sample.

use crate::estimate::error::LeastSquaresError;
use crate::estimate::least_squares::LeastSquares;
use crate::estimate::magnitudes::MagnitudeHistogram;
use crate::estimate::rows::{RowVisitor, is_uninformative};
use crate::estimate::solution::RegressionSolution;
use crate::signal::dot;

/// Final weights of the rows.
#[derive(Debug, Clone, PartialEq)]
pub struct RowWeighting {
    /// Scale of the residuals of each channel, in the unit of the measured value.
    pub scales: Vec<f64>,
    /// Whether rows were divided by this scale.
    pub by_channel: bool,
    /// Huber's bound in multiples of the scale; `None` for ordinary least squares.
    pub huber: Option<f64>,
    /// Share of the rows whose residual exceeded the bound, 0 to 1.
    pub outliers: f64,
    /// Number of solutions.
    pub iterations: usize,
    /// Whether the last two solutions agreed.
    pub converged: bool,
}

/// Kind of rows that a reweighting computes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum WeightedRows {
    /// Regressor and measured value times the root of the weight: their gradient is that of Huber's function.
    Weighted,
    /// Rows within the bound only, with the clipped residual of Huber's function: the second derivatives.
    Curvature,
}

/// Scale of each channel's residuals: the standard deviation, or 1.4826 times the median magnitude for robust
/// estimates.
pub(crate) fn residual_scales<E: From<LeastSquaresError>>(
    solution: &RegressionSolution,
    weighting: &RowWeighting,
    show: &mut impl FnMut(&mut RowVisitor<'_>) -> Result<(), E>,
) -> Result<Vec<f64>, E> {
    let channels = weighting.scales.len();
    let n = solution.values.len();
    let mut squares = vec![0.0; channels];
    let mut medians: Vec<MagnitudeHistogram> = match weighting.huber {
        Some(_) => vec![MagnitudeHistogram::new(); channels],
        None => Vec::new(),
    };
    let mut size = vec![0.0; channels];
    let mut counts = vec![0_usize; channels];
    let mut rows = 0_usize;
    show(&mut |regressor, measured| {
        for (row, y) in regressor.chunks_exact(n).zip(measured) {
            let channel = rows % channels;
            rows += 1;
            if is_uninformative(row, *y) {
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
    let mut scales: Vec<f64> = (0..channels)
        .map(|channel| {
            let samples = counts[channel].max(1) as f64;
            let freedom = (samples - solution.rank as f64 / channels as f64).max(1.0);
            let spread = (squares[channel] / freedom).sqrt();
            let scale = medians.get(channel).map_or(spread, |m| 1.4826 * m.median());
            // A channel without residual must not get infinite weight.
            let least = 1e-12 * (size[channel] / samples).sqrt();
            if scale > least {
                scale
            } else {
                spread.max(least).max(f64::MIN_POSITIVE.sqrt())
            }
        })
        .collect();
    limit_idle_scales(&mut scales, &size);
    Ok(scales)
}

/// Raises the scales of channels whose measured values are all zero, as those of undriven joints, to the least scale of
/// the others; `size` is the sum of squared measured values of each channel.
///
/// The equations of such a channel are homogeneous: parameters near zero make their residual as small as one likes, so
/// a weight from their own residual grows without bound and takes the parameters along.
fn limit_idle_scales(scales: &mut [f64], size: &[f64]) {
    let pairs = || scales.iter().zip(size);
    let Some(least) = pairs()
        .filter(|(_, size)| **size > 0.0)
        .map(|(scale, _)| *scale)
        .reduce(f64::min)
    else {
        return;
    };
    for (scale, _) in scales.iter_mut().zip(size).filter(|(_, size)| **size == 0.0) {
        *scale = scale.max(least);
    }
}

/// Regression of the reweighted rows.
pub(crate) fn reweight_rows<E: From<LeastSquaresError>>(
    values: &[f64],
    channels: usize,
    weighting: &RowWeighting,
    rows: WeightedRows,
    show: &mut impl FnMut(&mut RowVisitor<'_>) -> Result<(), E>,
) -> Result<LeastSquares, E> {
    let mut regression = LeastSquares::with_channels(values.len(), channels);
    show_weighted(values, channels, weighting, rows, show, &mut |w, y| {
        regression.add_rows(w, y)
    })?;
    Ok(regression)
}

/// Share of the rows whose residual exceeds Huber's bound.
pub(crate) fn outlier_share<E: From<LeastSquaresError>>(
    values: &[f64],
    channels: usize,
    weighting: &RowWeighting,
    show: &mut impl FnMut(&mut RowVisitor<'_>) -> Result<(), E>,
) -> Result<f64, E> {
    let bound = weighting.huber.unwrap_or(f64::INFINITY);
    let (mut beyond, mut rows, mut counted) = (0_usize, 0_usize, 0_usize);
    show(&mut |w, y| {
        for (row, y) in w.chunks_exact(values.len()).zip(y) {
            let scale = weighting.scales[rows % channels];
            rows += 1;
            counted += usize::from(!is_uninformative(row, *y));
            beyond += usize::from((y - dot(row, values)).abs() > bound * scale);
        }
        Ok(())
    })?;
    Ok(beyond as f64 / counted.max(1) as f64)
}

/// Passes weighted rows to `visit`, with weights from the residuals at `values`.
pub(crate) fn show_weighted<E: From<LeastSquaresError>>(
    values: &[f64],
    channels: usize,
    weighting: &RowWeighting,
    rows: WeightedRows,
    show: &mut impl FnMut(&mut RowVisitor<'_>) -> Result<(), E>,
    visit: &mut RowVisitor<'_>,
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
            let inside = weighting.huber.is_none_or(|bound| error.abs() <= bound * scale);
            // Weight min(1, bound / |residual|) beyond the bound; its root multiplies the row.
            let root = match (weighting.huber, rows) {
                (Some(bound), WeightedRows::Weighted) if !inside => (bound * scale / error.abs()).sqrt(),
                (Some(_), WeightedRows::Curvature) if !inside => 0.0,
                _ => 1.0,
            };
            let factor = if weighting.by_channel { root / scale } else { root };
            scaled.extend(row.iter().map(|w| factor * w));
            right.push(match (weighting.huber, rows) {
                // The clipped residual keeps the variance of the gradient.
                (Some(bound), WeightedRows::Curvature) => {
                    let seen = error.clamp(-bound * scale, bound * scale);
                    let unit = if weighting.by_channel { seen / scale } else { seen };
                    factor * dot(row, values) + unit
                }
                _ => factor * y,
            });
        }
        visit(&scaled, &right)
    })
}
