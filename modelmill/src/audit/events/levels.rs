//! The residual of a drive in units of its own level: freed from what a delay or a compliance explains, smoothed over a
//! short and a long time, and set to zero where it shows no contact.

use super::regimes::DriveRegimes;
use super::smoothing::{
    differences_per_sample, median_deviation, running_mean, running_median, sample_quantile, shown_median,
};
use super::trace::ResidualTrace;
use crate::audit::thresholds::{
    LEVEL_FEWEST_S, LEVEL_LEAST_FORCE_SHARE, LEVEL_MOST_RATIO, LONG_MEAN_S, SHORT_MEAN_S, SLOW_MEAN_S,
};

/// Fewest samples with which the share of a delay or a compliance is fitted.
const FEWEST_FITTED: usize = 50;
/// Rounds of the robust fit of one column.
const ROUNDS: usize = 5;
/// Residuals beyond this many deviations have less weight in it.
const HUBER_DEVIATIONS: f64 = 2.0;

/// The residual of a drive, smoothed over some time.
pub(super) struct SmoothedResidual {
    /// Values, N or N m; zero where the residual shows no contact.
    pub(super) values: Vec<f64>,
    /// Its usual level, as a standard deviation, N or N m.
    pub(super) level: f64,
}

/// The residual of a drive along a run, in the forms in which events are searched.
pub(super) struct SearchedResidual {
    /// Index of the drive.
    pub(super) drive: usize,
    /// Root mean square of the measured force, N or N m.
    pub(super) force_rms: f64,
    /// The residual without what a delay or a compliance explains, N or N m.
    pub(super) values: Vec<f64>,
    /// The same, smoothed over the short time, also where it shows no contact.
    pub(super) smooth: Vec<f64>,
    /// Smoothed over times from short to long: the shortest keeps the times of an event, in the longest ones small
    /// forces stand out.
    pub(super) forms: [SmoothedResidual; 3],
    /// Whether a sample in motion shows no contact, or the drive stands.
    pub(super) is_masked: Vec<bool>,
    /// Regimes of the drive.
    pub(super) regimes: DriveRegimes,
}

impl SearchedResidual {
    /// The residual of one drive of a trace.
    pub(super) fn new(trace: &ResidualTrace, drive: usize, regimes: DriveRegimes) -> Self {
        let is_masked: Vec<bool> = (regimes.is_unknown.iter().zip(&regimes.is_standing))
            .map(|(unknown, stands)| *unknown || *stands || regimes.has_dead_band)
            .collect();
        let force_rms = trace.force_rms(drive);
        let values = without_delay(trace, drive, &is_masked);
        // Odd widths are symmetric.
        let width = |time: f64| trace.sample_count(time, 3) | 1;
        let smooth = running_median(&values, width(SHORT_MEAN_S));
        let long = running_median(&values, width(LONG_MEAN_S));
        // Over a long time a switch of friction within it would count as well.
        let slow = shown_median(&values, &is_masked, width(SLOW_MEAN_S));
        let fewest = trace.sample_count(LEVEL_FEWEST_S, FEWEST_FITTED / 2);
        let with_level = |smooth: &[f64]| SmoothedResidual::new(smooth, &is_masked, force_rms, fewest);
        Self {
            drive,
            force_rms,
            forms: [with_level(&smooth), with_level(&long), with_level(&slow)],
            smooth,
            values,
            is_masked,
            regimes,
        }
    }
}

impl SmoothedResidual {
    /// The values with their level; all are zero if fewer than `fewest` samples show anything.
    fn new(smooth: &[f64], is_masked: &[bool], force_rms: f64, fewest: usize) -> Self {
        let shown: Vec<f64> = (smooth.iter().zip(is_masked))
            .filter(|(_, masked)| !**masked)
            .map(|(value, _)| *value)
            .collect();
        if shown.len() < fewest {
            return Self {
                values: vec![0.0; smooth.len()],
                level: LEVEL_LEAST_FORCE_SHARE * force_rms,
            };
        }
        // Long pushes raise the upper quantile, and a residual with long tails lowers the median.
        let median = median_deviation(shown.iter().copied());
        let upper = sample_quantile(shown.iter().map(|x| x.abs()).collect(), 0.8) / 1.2816;
        let level = upper.min(LEVEL_MOST_RATIO * median).max(median);
        Self {
            values: (smooth.iter().zip(is_masked))
                .map(|(value, masked)| if *masked { 0.0 } else { *value })
                .collect(),
            level: level.max(LEVEL_LEAST_FORCE_SHARE * force_rms),
        }
    }
}

/// The residual of a drive without what a delay of its force or a compliance explains: shares of the derivative of the
/// fitted force and of the jerk.
fn without_delay(trace: &ResidualTrace, drive: usize, is_masked: &[bool]) -> Vec<f64> {
    let width = trace.sample_count(SHORT_MEAN_S, 3) | 1;
    let mut rest = trace.residual[drive].clone();
    for signal in [&trace.fitted_force(drive), &trace.motion[2][drive]] {
        let column = running_mean(&differences_per_sample(signal), width);
        let share = robust_share(&rest, &column, is_masked);
        for (rest, column) in rest.iter_mut().zip(&column) {
            *rest -= share * column;
        }
    }
    rest
}

/// The robust least-squares factor of a column in a residual, from the samples that show something.
fn robust_share(rest: &[f64], column: &[f64], is_masked: &[bool]) -> f64 {
    let shown: Vec<(f64, f64)> = (rest.iter().zip(column).zip(is_masked))
        .filter(|(_, masked)| !**masked)
        .map(|((rest, column), _)| (*rest, *column))
        .collect();
    if shown.len() < FEWEST_FITTED {
        return 0.0;
    }
    let mut share = 0.0;
    for _ in 0..ROUNDS {
        let scale = median_deviation(shown.iter().map(|(rest, column)| rest - share * column));
        let (mut product, mut square) = (0.0, 0.0);
        for (rest, column) in &shown {
            let error = (rest - share * column).abs();
            let weight = if error > HUBER_DEVIATIONS * scale {
                HUBER_DEVIATIONS * scale / error
            } else {
                1.0
            };
            product += weight * rest * column;
            square += weight * column * column;
        }
        if square > 0.0 {
            share = product / square;
        }
    }
    share
}
