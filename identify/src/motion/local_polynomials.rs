//! Savitzky-Golay filter: the polynomial that fits best around each sample gives its smoothed position, rate and
//! acceleration.
//!
//! The fit uses the recorded times, so that uneven steps are allowed. At the ends the window stays inside of the
//! recording. Sources: A. Savitzky, M. J. E. Golay, Analytical Chemistry 36 (1964); R. W. Schafer, "What is a
//! Savitzky-Golay filter?", IEEE Signal Processing Magazine 28 (2011), for the cut-off.

use nalgebra::{SMatrix, SVector};

use crate::motion::derivatives::SmoothedCoordinate;
use crate::signal::float_to_count;

/// Degree of the polynomials: the lowest with a second derivative that is smooth to second order.
pub(crate) const DEGREE: usize = 4;
/// Number of coefficients of a polynomial.
const TERMS: usize = DEGREE + 1;

/// Samples on each side of the window whose cut-off is `cutoff_hz`, at `rate_hz` samples per second. This is
/// Schafer's eq. (12), but never less than a fit needs.
pub(crate) fn half_width(cutoff_hz: f64, rate_hz: f64) -> usize {
    let width = (TERMS as f64 * 0.5 * rate_hz / cutoff_hz + 4.6) / 3.2;
    float_to_count(width.round()).max(DEGREE)
}

/// Smoothed positions with both derivatives from windows of `2 half_width + 1` samples; `None` if there are fewer
/// samples.
pub(crate) fn smooth_by_polynomials(time: &[f64], positions: &[f64], half_width: usize) -> Option<SmoothedCoordinate> {
    let n = time.len();
    let width = 2 * half_width + 1;
    if n < width || width <= TERMS {
        return None;
    }
    let mut prepared = SmoothedCoordinate {
        q: Vec::with_capacity(n),
        qd: Vec::with_capacity(n),
        qdd: Vec::with_capacity(n),
    };
    for i in 0..n {
        let start = i.saturating_sub(half_width).min(n - width);
        // Times in units of the window keep the normal equations well conditioned.
        let scale = 0.5 * (time[start + width - 1] - time[start]);
        let mut normal = SMatrix::<f64, TERMS, TERMS>::zeros();
        let mut right = SVector::<f64, TERMS>::zeros();
        // Normal equations of the polynomial around sample i.
        for k in start..start + width {
            let x = (time[k] - time[i]) / scale;
            let mut row = SVector::<f64, TERMS>::repeat(1.0);
            for j in 1..TERMS {
                row[j] = row[j - 1] * x;
            }
            normal += row * row.transpose();
            right += row * (positions[k] - positions[i]);
        }
        let polynomial = normal.cholesky()?.solve(&right);
        // Coefficients of degree 0, 1 and 2 give position, rate and half the acceleration.
        prepared.q.push(positions[i] + polynomial[0]);
        prepared.qd.push(polynomial[1] / scale);
        prepared.qdd.push(2.0 * polynomial[2] / (scale * scale));
    }
    Some(prepared)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_noise::TestNoise;

    #[test]
    fn polynomials_are_exact_on_uneven_times() {
        let time: Vec<f64> = (0..60)
            .map(|i| 0.01 * f64::from(i) + 0.002 * (f64::from(i)).sin())
            .collect();
        let q: Vec<f64> = time
            .iter()
            .map(|t| 1.0 - t + 3.0 * t.powi(2) - 2.0 * t.powi(4))
            .collect();
        let found = smooth_by_polynomials(&time, &q, 7).unwrap();
        for (i, t) in time.iter().enumerate() {
            assert!((found.q[i] - q[i]).abs() < 1e-10);
            assert!((found.qd[i] - (-1.0 + 6.0 * t - 8.0 * t.powi(3))).abs() < 1e-8);
            assert!((found.qdd[i] - (6.0 - 24.0 * t.powi(2))).abs() < 1e-5);
        }
        assert_eq!(smooth_by_polynomials(&time[..10], &q[..10], 7), None);
    }

    /// A tone well below the cut-off passes, noise is much reduced.
    #[test]
    fn the_width_suits_the_cutoff() {
        let rate = 500.0;
        let time: Vec<f64> = (0..4000).map(|i| f64::from(i) / rate).collect();
        let mut noise = TestNoise::new(3);
        let w = std::f64::consts::TAU * 1.5;
        let q: Vec<f64> = time.iter().map(|t| (w * t).sin() + 1e-5 * noise.normal()).collect();
        let found = smooth_by_polynomials(&time, &q, half_width(15.0, rate)).unwrap();
        let error: f64 = (100..3900)
            .map(|i| (found.qdd[i] + w * w * (w * time[i]).sin()).powi(2))
            .sum::<f64>()
            / 3800.0;
        assert!(error.sqrt() < 0.01 * w * w, "{}", error.sqrt());
    }
}
