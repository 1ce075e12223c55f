//! Interpolation between uneven and even times: times and values go in; values of the cubic spline through them come
//! out.
//!
//! A filter for even steps treats an error of a sample's time as motion. The spline through the samples at their true
//! times has an error of fourth order in the step, far below that of a filter. Source: C. de Boor, "A Practical Guide
//! to Splines" (1978), chapter IV, with second derivatives of zero at the ends.

use crate::motion::thresholds::{EVEN_TIMES_TOLERANCE, ROUNDED_MOST_DECIMALS, ROUNDED_TIMES_TOLERANCE};

/// How the times of samples are spaced.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum SampleSpacing {
    /// At even times.
    Even,
    /// At even times that were rounded to their number of decimals.
    Rounded,
    /// At uneven times.
    Uneven,
}

/// How the times of samples are spaced, as far as they show it.
pub(crate) fn sample_spacing(time: &[f64]) -> SampleSpacing {
    let n = time.len();
    if n < 3 {
        return SampleSpacing::Even;
    }
    let grid = even_times(time);
    let step = (grid[n - 1] - grid[0]) / (n - 1) as f64;
    // The largest difference from the even grid decides.
    let off = (time.iter().zip(&grid)).fold(0.0_f64, |most, (t, even)| most.max((t - even).abs()));
    if off <= EVEN_TIMES_TOLERANCE * step {
        SampleSpacing::Even
    } else if off <= timestamp_resolution(time) {
        SampleSpacing::Rounded
    } else {
        SampleSpacing::Uneven
    }
}

/// Whether the steps are even, except for rounding.
pub fn is_even(time: &[f64]) -> bool {
    sample_spacing(time) != SampleSpacing::Uneven
}

/// Half a unit of the last decimal of the times; 0 if they have more than [`ROUNDED_MOST_DECIMALS`].
fn timestamp_resolution(time: &[f64]) -> f64 {
    let has = |decimals: i32| {
        let scale = 10.0_f64.powi(decimals);
        let is_whole = |t: &f64| (t * scale - (t * scale).round()).abs() < 1e-9 * (t * scale).abs().max(1.0);
        time.iter().all(is_whole)
    };
    (0..=ROUNDED_MOST_DECIMALS)
        .find(|decimals| has(*decimals))
        // The line through rounded times has a small error itself.
        .map_or(0.0, |decimals| ROUNDED_TIMES_TOLERANCE * 10.0_f64.powi(-decimals))
}

/// As many even times as there are samples, on the least squares line through their times.
pub(crate) fn even_times(time: &[f64]) -> Vec<f64> {
    let n = time.len() as f64;
    let mean = time.iter().sum::<f64>() / n;
    let middle = (n - 1.0) / 2.0;
    let (mut slope, mut size) = (0.0, 0.0);
    for (k, t) in time.iter().enumerate() {
        let k = k as f64 - middle;
        slope += k * (t - mean);
        size += k * k;
    }
    let step = if size > 0.0 { slope / size } else { 0.0 };
    (0..time.len()).map(|k| mean + step * (k as f64 - middle)).collect()
}

/// As many even times as there are samples, from the first time to the last.
pub(crate) fn spread_times(time: &[f64]) -> Vec<f64> {
    let n = time.len();
    let step = (time[n - 1] - time[0]) / (n.max(2) - 1) as f64;
    (0..n).map(|k| time[0] + step * k as f64).collect()
}

/// The values of the spline at [`spread_times`].
pub(crate) fn resample_evenly(time: &[f64], values: &[f64]) -> Vec<f64> {
    CubicSpline::new(time, values).evaluate_at(&spread_times(time))
}

/// The cubic spline through samples.
pub(crate) struct CubicSpline<'a> {
    /// Times of the samples, s.
    time: &'a [f64],
    /// Values of the samples.
    values: &'a [f64],
    /// Second derivatives at the samples.
    second_derivatives: Vec<f64>,
}

impl<'a> CubicSpline<'a> {
    /// Computes the spline. Times must increase; panics unless there are as many values.
    pub(crate) fn new(time: &'a [f64], values: &'a [f64]) -> Self {
        assert_eq!(time.len(), values.len(), "one value per time");
        let n = time.len();
        let mut bends = vec![0.0; n];
        if n > 2 {
            // Thomas' algorithm for the second derivatives, which are 0 at both ends.
            let (mut upper, mut right) = (vec![0.0; n], vec![0.0; n]);
            for i in 1..n - 1 {
                let [before, after] = [time[i] - time[i - 1], time[i + 1] - time[i]];
                let slopes = (values[i + 1] - values[i]) / after - (values[i] - values[i - 1]) / before;
                let pivot = 2.0 * (before + after) - before * upper[i - 1];
                upper[i] = after / pivot;
                right[i] = (6.0 * slopes - before * right[i - 1]) / pivot;
            }
            for i in (1..n - 1).rev() {
                bends[i] = right[i] - upper[i] * bends[i + 1];
            }
        }
        Self {
            time,
            values,
            second_derivatives: bends,
        }
    }

    /// Values at times that must not decrease. Outside of the samples the first or last piece is continued.
    pub(crate) fn evaluate_at(&self, times: &[f64]) -> Vec<f64> {
        let n = self.time.len();
        if n < 2 {
            return vec![self.values.first().copied().unwrap_or(0.0); times.len()];
        }
        let mut i = 0;
        // Move to the piece that contains the time.
        let at = |t: &f64| {
            while i + 2 < n && self.time[i + 1] <= *t {
                i += 1;
            }
            let step = self.time[i + 1] - self.time[i];
            let [a, b] = [(self.time[i + 1] - t) / step, (t - self.time[i]) / step];
            let bend = (a.powi(3) - a) * self.second_derivatives[i] + (b.powi(3) - b) * self.second_derivatives[i + 1];
            a * self.values[i] + b * self.values[i + 1] + bend * step * step / 6.0
        };
        times.iter().map(at).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounded_stamps_are_even_and_jitter_is_not() {
        let stamps = |off: fn(u32) -> f64| -> Vec<f64> { (0..400).map(|k| f64::from(k) / 300.0 + off(k)).collect() };
        assert!(is_even(&stamps(|_| 0.0)));
        let rounded: Vec<f64> = stamps(|_| 0.0).into_iter().map(|t| (1e4 * t).round() / 1e4).collect();
        assert!(is_even(&rounded));
        assert!(!is_even(&stamps(|k| 2e-5 * f64::from(k * k % 7) / 7.0)));
        let mut lost = rounded;
        lost.remove(200);
        assert!(!is_even(&lost));
    }

    /// De Boor's error of the fourth order: half the step, a sixteenth of the error, away from the ends.
    #[test]
    fn the_error_is_of_the_fourth_order() {
        let error = |steps: u32| {
            let time: Vec<f64> = (0..=steps)
                .map(|k| f64::from(k) + 0.2 * f64::from(k % 3))
                .map(|k| 6.0 * k / f64::from(steps))
                .collect();
            let values: Vec<f64> = time.iter().map(|t| t.sin()).collect();
            let sample_times: Vec<f64> = (0..500).map(|k| 1.5 + 0.006 * f64::from(k)).collect();
            let found = CubicSpline::new(&time, &values).evaluate_at(&sample_times);
            let off = sample_times.iter().zip(found).map(|(t, v)| (v - t.sin()).abs());
            off.fold(0.0, f64::max)
        };
        let [coarse, fine] = [error(60), error(120)];
        println!("{coarse:e} {fine:e}");
        assert!((10.0..24.0).contains(&(coarse / fine)));
        assert!(fine < 1e-6);
    }
}
