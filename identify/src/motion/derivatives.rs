//! Rates and accelerations from recorded positions: a zero-phase low-pass, then central differences at the recorded
//! times. Positions go in; filtered positions and both derivatives come out.
//!
//! Source: the standard procedure, for example M. Gautier, "Numerical calculation of the base inertial parameters of
//! robots", and A. Janot, M. Gautier and M. Brunot, "Data set and reference models of EMPS" (2019), whose settings
//! are [`crate::StatePreparation::emps`]. The cut-off is chosen by [`crate::motion::cutoff`]. Periodic motions are
//! better treated by [`crate::motion::series`].

use crate::motion::even::is_even;
use crate::signal::{FilterError, LowPass};

/// The derivative of `values` at each time, from the parabola through three neighbours. This is the central
/// difference for even steps, and of second order for uneven ones. At both ends the parabola of the first or last
/// three samples is used. Panics unless `values` is as long as `time`. Two samples have the slope of their line, a
/// single one has zero.
pub fn differentiate(time: &[f64], values: &[f64]) -> Vec<f64> {
    assert_eq!(time.len(), values.len(), "one value per time");
    let n = values.len();
    match n {
        0 | 1 => return vec![0.0; n],
        2 => return vec![(values[1] - values[0]) / (time[1] - time[0]); 2],
        _ => {}
    }
    // Slope at the sample `at` of the parabola through the samples around `i`.
    let slope = |i: usize, at: usize| {
        let before = time[i] - time[i - 1];
        let after = time[i + 1] - time[i];
        let left = (values[i] - values[i - 1]) / before;
        let right = (values[i + 1] - values[i]) / after;
        let curvature = (right - left) / (before + after);
        left + curvature * (before + 2.0 * (time[at] - time[i]))
    };
    let mut derivative = Vec::with_capacity(n);
    derivative.push(slope(1, 0));
    derivative.extend((1..n - 1).map(|i| slope(i, i)));
    derivative.push(slope(n - 2, n - 1));
    derivative
}

/// Rates and accelerations of one coordinate, whose positions are smooth and at even times: derivatives of polynomials of
/// degree six through seven neighbours, of order `h^6` in the step `h`; `None` for uneven times or fewer than seven samples. Three samples at both ends have central
/// differences or one-sided ones, see [`differentiate`].
///
/// Central differences make rates too small by `(w h)^2/6` at an angular frequency `w`. Where terms nearly cancel, as in
/// the equations of a servo that follows its command, this is no small error. Panics unless `positions` is as long as `time`.
/// Source: B. Fornberg, "Generation of finite difference formulas on arbitrarily spaced grids", Math. Comp. 51 (1988).
pub fn differentiate_by_seven_points(time: &[f64], positions: &[f64]) -> Option<[Vec<f64>; 2]> {
    let n = time.len();
    if n < 7 || !is_even(time) {
        return None;
    }
    let mut rates = differentiate(time, positions);
    let mut accelerations = differentiate(time, &rates);
    let step = (time[n - 1] - time[0]) / (n - 1) as f64;
    for i in 3..n - 3 {
        let [before, after] = [-1, 1].map(|sign| [1, 2, 3].map(|k| positions[i.wrapping_add_signed(sign * k)]));
        let difference = |k: usize| after[k] - before[k];
        let sum = |k: usize| after[k] + before[k];
        rates[i] = (45.0 * difference(0) - 9.0 * difference(1) + difference(2)) / (60.0 * step);
        let curvature = 270.0 * sum(0) - 27.0 * sum(1) + 2.0 * sum(2) - 490.0 * positions[i];
        accelerations[i] = curvature / (180.0 * step * step);
    }
    Some([rates, accelerations])
}

/// One coordinate with its derivatives; all columns have the same length.
#[derive(Debug, Clone, PartialEq)]
pub struct SmoothedCoordinate {
    /// Filtered positions.
    pub q: Vec<f64>,
    /// Rates, central differences of `q`.
    pub qd: Vec<f64>,
    /// Accelerations, central differences of `qd`.
    pub qdd: Vec<f64>,
}

/// Filters positions at `cutoff_hz` (Butterworth of `order`, zero phase) and takes central differences twice at the
/// recorded times `time`, s. Fails when the cut-off does not fit the sampling rate, or when there are too few
/// samples.
pub fn filter_and_differentiate(
    time: &[f64],
    positions: &[f64],
    cutoff_hz: f64,
    order: usize,
) -> Result<SmoothedCoordinate, FilterError> {
    let q = LowPass::butterworth(order, cutoff_hz, mean_rate(time))?.zero_phase(positions)?;
    let qd = differentiate(time, &q);
    let qdd = differentiate(time, &qd);
    Ok(SmoothedCoordinate { q, qd, qdd })
}

/// Mean number of samples per second; 0 for fewer than two samples.
pub(crate) fn mean_rate(time: &[f64]) -> f64 {
    match time {
        [first, .., last] => (time.len() - 1) as f64 / (last - first),
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_of_a_sine_are_accurate_to_the_sixth_power_of_the_step() {
        let time: Vec<f64> = (0..200).map(|k| f64::from(k) * 0.005).collect();
        let (w, phase) = (13.0, 0.3);
        let positions: Vec<f64> = time.iter().map(|t| (w * t + phase).sin()).collect();
        let [rates, accelerations] = differentiate_by_seven_points(&time, &positions).unwrap();
        let central = differentiate(&time, &positions);
        for i in 3..time.len() - 3 {
            let (sine, cosine) = (w * time[i] + phase).sin_cos();
            assert!((rates[i] - w * cosine).abs() < 1e-8 * w);
            assert!((accelerations[i] + w * w * sine).abs() < 1e-8 * w * w);
            let share = (central[i] - w * cosine).abs() / (w * cosine).abs();
            assert!((share / ((w * 0.005_f64).powi(2) / 6.0) - 1.0).abs() < 0.01);
        }
        assert!(differentiate_by_seven_points(&[0.0, 0.1, 0.35, 0.4, 0.7, 1.3, 1.4], &positions[..7]).is_none());
    }

    #[test]
    fn parabolas_are_differentiated_exactly_on_uneven_times() {
        let time = [0.0, 0.1, 0.35, 0.4, 0.7, 1.3];
        let values: Vec<f64> = time.iter().map(|t| 1.0 - 3.0 * t + 2.5 * t * t).collect();
        for (t, d) in time.iter().zip(differentiate(&time, &values)) {
            assert!((d - (5.0 * t - 3.0)).abs() < 1e-12);
        }
    }
}
