//! Rates and accelerations from recorded positions: zero-phase low-pass, then central
//! differences on the true time base. Positions go in; filtered positions and both derivatives
//! come out, with the cut-off that was used.
//!
//! Source: the field's standard procedure, e.g. M. Gautier, "Numerical calculation of the base
//! inertial parameters of robots", and A. Janot, M. Gautier and M. Brunot, "Data set and
//! reference models of EMPS" (2019), whose recipe is [`Preparation::emps`].
//! The choice of the cut-off is our own: see [`choose_cutoff`].

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};

use crate::filters::{FilterError, LowPass};
use crate::spectrum::hann_power;

/// Where derivatives come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Source {
    /// Recorded derivative columns are taken as they are; only missing ones are prepared.
    #[default]
    RecordedFirst,
    /// Every derivative is prepared from the positions, whatever the file holds.
    Positions,
}

/// How positions become smooth positions, rates and accelerations.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Smoothing {
    /// Butterworth's low-pass run both ways, then central differences: the field's standard.
    #[default]
    Butterworth,
    /// Local polynomials (Savitzky-Golay) of the width that suits the cut-off.
    SavitzkyGolay,
    /// A Fourier series up to the cut-off; the period, s, is found from the positions when absent.
    Fourier {
        /// The period, s.
        period: Option<f64>,
    },
}

/// How states are prepared from a recording. [`Preparation::default`] suits a file of positions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Preparation {
    /// Cut-off of the low-pass on the positions, Hz; chosen from the signal when absent.
    pub cutoff_hz: Option<f64>,
    /// Order of the Butterworth filter in one direction.
    pub order: usize,
    /// Samples dropped at the start and at the end; when absent, three periods of the
    /// cut-off at both ends if anything was filtered (the transient falls tenfold in each, and
    /// reaches 0.1 % of the acceleration), at most a sixth of the recording; none otherwise.
    pub trim: Option<(usize, usize)>,
    /// Every how many samples one is kept, after the parallel filter on all columns of the
    /// regressor and on the force; 1 keeps all.
    pub decimate: usize,
    /// Which derivatives are prepared.
    pub source: Source,
    /// How they are prepared.
    pub smoothing: Smoothing,
}

impl Default for Preparation {
    fn default() -> Self {
        Self {
            cutoff_hz: None,
            order: 4,
            trim: None,
            decimate: 1,
            source: Source::RecordedFirst,
            smoothing: Smoothing::Butterworth,
        }
    }
}

impl Preparation {
    /// The recipe of the EMPS reference: order 4 at 100 Hz, the first 49 samples dropped,
    /// decimation by 10. As many are dropped at the end, where differences are one-sided: with
    /// one or two bad accelerations left there the error rises from 4.04 to 4.3 %, while any
    /// number from 5 on gives the same.
    pub fn emps() -> Self {
        Self {
            cutoff_hz: Some(100.0),
            trim: Some((49, 49)),
            decimate: 10,
            source: Source::Positions,
            ..Self::default()
        }
    }
}

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

/// One coordinate with its derivatives, as [`prepare`] returns it; all of the same length.
#[derive(Debug, Clone, PartialEq)]
pub struct Prepared {
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
pub fn prepare(
    time: &[f64],
    positions: &[f64],
    cutoff_hz: f64,
    order: usize,
) -> Result<Prepared, FilterError> {
    let q = LowPass::butterworth(order, cutoff_hz, mean_rate(time))?.zero_phase(positions)?;
    let qd = differentiate(time, &q);
    let qdd = differentiate(time, &qd);
    Ok(Prepared { q, qd, qdd })
}

/// Samples per second on average; 0 for fewer than two samples.
pub fn mean_rate(time: &[f64]) -> f64 {
    match time {
        [first, .., last] => (time.len() - 1) as f64 / (last - first),
        _ => 0.0,
    }
}

/// The cut-off, Hz, that promises nearly the smallest mean square error of the acceleration, for
/// positions sampled at `rate_hz`; `None` when the positions hold no motion above their noise.
///
/// The spectrum of the raw second differences is signal plus noise. White noise of the position
/// has the known shape `(2 sin(pi f/rate) rate)^4` there; its level is the median over the upper
/// quarter of the band. A cut-off then costs the signal it takes, `(1 - H)^2 (P - N)`, and the
/// noise it leaves, `H^2 N`, where `H` is the gain of the filter run both ways (the trade-off of a
/// Wiener filter, restricted to Butterworth's shape). A low cut-off loses more samples at the
/// ends, so the highest one is returned whose expected error is within a quarter of the smallest,
/// or below 0.1 % of the acceleration; never above a fifth of the sampling rate.
pub fn choose_cutoff(positions: &[f64], rate_hz: f64, order: usize) -> Option<f64> {
    if positions.len() < 32 {
        return None;
    }
    let difference: Vec<f64> = positions
        .windows(3)
        .map(|w| (w[2] - 2.0 * w[1] + w[0]) * rate_hz * rate_hz)
        .collect();
    let power = hann_power(&difference);
    let n = power.len();
    let frequency = |k: usize| 0.5 * rate_hz * k as f64 / (n - 1) as f64;
    let shape = |k: usize| (2.0 * (PI * frequency(k) / rate_hz).sin()).powi(4);
    let mut upper: Vec<f64> = (n * 3 / 4..n - 1).map(|k| power[k] / shape(k)).collect();
    if upper.is_empty() {
        return None;
    }
    upper.sort_by(f64::total_cmp);
    // The median of an exponentially distributed periodogram is ln 2 of its mean.
    let level = upper[upper.len() / 2] / std::f64::consts::LN_2;
    // Chance lifts one bin in three million above fifteen times the noise. A lower bar would let
    // bins of noise through, whose share in the acceleration is huge at high frequencies.
    let signal: Vec<f64> = (0..n)
        .map(|k| {
            let noise = level * shape(k);
            if power[k] > 15.0 * noise {
                power[k] - noise
            } else {
                0.0
            }
        })
        .collect();
    if signal.iter().all(|s| *s == 0.0) {
        return None;
    }
    let lowest = 4.0 * rate_hz / positions.len() as f64;
    // Beyond a fifth of the rate, central differences take more than the filter leaves.
    let highest = 0.2 * rate_hz;
    let steps = 96;
    let costs: Vec<(f64, f64)> = (0..=steps)
        .map(|i| lowest * (highest / lowest).powf(f64::from(i) / f64::from(steps)))
        .filter_map(|cutoff| {
            let filter = LowPass::butterworth(order, cutoff, rate_hz).ok()?;
            let cost: f64 = (1..n)
                .map(|k| {
                    let gain = filter.gain(frequency(k), rate_hz).powi(2);
                    (1.0 - gain).powi(2) * signal[k] + gain * gain * level * shape(k)
                })
                .sum();
            Some((cutoff, cost))
        })
        .collect();
    let smallest = costs
        .iter()
        .map(|(_, cost)| *cost)
        .fold(f64::INFINITY, f64::min);
    let bearable = (1.25_f64.powi(2) * smallest).max(1e-6 * signal.iter().sum::<f64>());
    costs
        .into_iter()
        .filter(|(_, cost)| *cost <= bearable)
        .map(|(cutoff, _)| cutoff)
        .reduce(f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_noise::Noise;

    #[test]
    fn parabolas_are_differentiated_exactly_on_uneven_times() {
        let time = [0.0, 0.1, 0.35, 0.4, 0.7, 1.3];
        let values: Vec<f64> = time.iter().map(|t| 1.0 - 3.0 * t + 2.5 * t * t).collect();
        for (t, d) in time.iter().zip(differentiate(&time, &values)) {
            assert!((d - (5.0 * t - 3.0)).abs() < 1e-12);
        }
    }

    /// The chosen cut-off gives nearly the smallest error that any cut-off could give.
    #[test]
    fn the_chosen_cutoff_is_nearly_the_best_there_is() {
        let rate = 250.0;
        let time: Vec<f64> = (0..3645).map(|k| f64::from(k) / rate).collect();
        let harmonics: Vec<(f64, f64, f64)> = (1..=7)
            .map(|h| {
                (
                    f64::from(h) * 2.0 * PI / 7.29,
                    0.2 / f64::from(h),
                    0.7 * f64::from(h * h),
                )
            })
            .collect();
        for sigma in [1e-3, 4e-6, 1e-8] {
            let mut noise = Noise::new(5);
            let truth = |t: f64| -> f64 {
                harmonics
                    .iter()
                    .map(|(w, a, phase)| -a * w * w * (w * t + phase).sin())
                    .sum()
            };
            let positions: Vec<f64> = time
                .iter()
                .map(|t| {
                    harmonics
                        .iter()
                        .map(|(w, a, phase)| a * (w * t + phase).sin())
                        .sum::<f64>()
                        + sigma * noise.normal()
                })
                .collect();
            let error = |cutoff: f64| {
                let qdd = prepare(&time, &positions, cutoff, 4).unwrap().qdd;
                let inner = 400..3245;
                (inner
                    .clone()
                    .map(|i| (qdd[i] - truth(time[i])).powi(2))
                    .sum::<f64>()
                    / inner.len() as f64)
                    .sqrt()
            };
            let size =
                (time.iter().map(|t| truth(*t).powi(2)).sum::<f64>() / time.len() as f64).sqrt();
            let chosen = choose_cutoff(&positions, rate, 4).unwrap();
            let best = (0..60)
                .map(|i| error(0.6 * 1.09_f64.powi(i)))
                .fold(f64::INFINITY, f64::min);
            assert!(
                error(chosen) < (1.6 * best).max(1.5e-3 * size),
                "sigma {sigma}: {chosen} Hz gives {} not {best}",
                error(chosen)
            );
        }
    }

    #[test]
    fn a_coordinate_at_rest_has_no_cutoff() {
        assert_eq!(choose_cutoff(&[1.0; 500], 250.0, 4), None);
        let mut noise = Noise::new(2);
        let still: Vec<f64> = (0..500).map(|_| 1.0 + 1e-6 * noise.normal()).collect();
        // Chance peaks may pass for motion; nothing below may panic on them.
        let _ = choose_cutoff(&still, 250.0, 4);
    }
}
