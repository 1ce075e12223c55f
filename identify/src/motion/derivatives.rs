//! Rates and accelerations from recorded positions: a zero-phase low-pass, then central differences at the recorded
//! times. Positions go in; filtered positions and both derivatives come out.
//!
//! Source: the standard procedure, for example M. Gautier, "Numerical calculation of the base inertial parameters of
//! robots", and A. Janot, M. Gautier and M. Brunot, "Data set and reference models of EMPS" (2019), whose settings
//! are [`crate::StatePreparation::emps`]. The cut-off is chosen by [`crate::motion::cutoff`]. Periodic motions are
//! better treated by [`crate::motion::series`].

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
    fn parabolas_are_differentiated_exactly_on_uneven_times() {
        let time = [0.0, 0.1, 0.35, 0.4, 0.7, 1.3];
        let values: Vec<f64> = time.iter().map(|t| 1.0 - 3.0 * t + 2.5 * t * t).collect();
        for (t, d) in time.iter().zip(differentiate(&time, &values)) {
            assert!((d - (5.0 * t - 3.0)).abs() < 1e-12);
        }
    }
}
