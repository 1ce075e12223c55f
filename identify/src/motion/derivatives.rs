//! Rates and accelerations from recorded positions: zero-phase low-pass, then central
//! differences on the true time base. Positions go in; filtered positions and both derivatives
//! come out, with the cut-off that was used.
//!
//! Source: the field's standard procedure, e.g. M. Gautier, "Numerical calculation of the base
//! inertial parameters of robots", and A. Janot, M. Gautier and M. Brunot, "Data set and
//! reference models of EMPS" (2019), whose recipe is [`StatePreparation::emps`].
//! Which cut-off: [`crate::motion::cutoff`]. Periodic motions have a better way: [`crate::motion::series`].

use crate::signal::{FilterError, LowPass};

/// The derivative of `values` at each of the times: that of the parabola through three
/// neighbours, which is the central difference where steps are even, and second-order exact
/// where they are not. At both ends the parabola of the first or last three is used.
/// `values` must be as long as `time` (asserted); fewer than three samples have the slope of
/// their line, or zero.
pub fn differentiate(time: &[f64], values: &[f64]) -> Vec<f64> {
    assert_eq!(time.len(), values.len(), "one value per time");
    let n = values.len();
    match n {
        0 | 1 => return vec![0.0; n],
        2 => return vec![(values[1] - values[0]) / (time[1] - time[0]); 2],
        _ => {}
    }
    // Slope at the place `at` of the parabola through the samples around `i`.
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

/// One coordinate with its derivatives, as [`filter_and_differentiate`] returns it; all of the same length.
#[derive(Debug, Clone, PartialEq)]
pub struct SmoothedCoordinate {
    /// Filtered positions.
    pub q: Vec<f64>,
    /// Rates, central differences of `q`.
    pub qd: Vec<f64>,
    /// Accelerations, central differences of `qd`.
    pub qdd: Vec<f64>,
}

/// Filters positions at `cutoff_hz` (Butterworth of `order`, zero phase) and takes central
/// differences twice on the true `time`, s.
/// Fails when the cut-off does not suit the sampling rate or there are too few samples.
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

/// Samples per second on average; 0 for fewer than two samples.
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
    fn parabolas_are_differentiated_exactly_on_uneven_times() {
        let time = [0.0, 0.1, 0.35, 0.4, 0.7, 1.3];
        let values: Vec<f64> = time.iter().map(|t| 1.0 - 3.0 * t + 2.5 * t * t).collect();
        for (t, d) in time.iter().zip(differentiate(&time, &values)) {
            assert!((d - (5.0 * t - 3.0)).abs() < 1e-12);
        }
    }
}
