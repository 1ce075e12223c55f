//! Coloured noise: white noise through a low-pass, as current loops and filters of amplifiers cause it.

use std::f64::consts::PI;

use crate::random::CaseRandom;

/// Order of the low-pass, which gives the slope of the spectrum above the corner frequency.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpectrumFall {
    /// First order.
    Gentle,
    /// Butterworth, second order.
    Steep,
}

/// Noise with a given standard deviation, one value per sample.
///
/// `rate` is the sampling frequency, Hz. `corner` is the corner frequency of the low-pass, Hz, with its order; `None`
/// means white noise.
pub fn noise(
    random: &mut CaseRandom,
    samples: usize,
    rate: f64,
    deviation: f64,
    corner: Option<(f64, SpectrumFall)>,
) -> Vec<f64> {
    let Some((corner, fall)) = corner else {
        return (0..samples).map(|_| deviation * random.normal()).collect();
    };
    // Bilinear transform: coefficients of numerator and denominator, undelayed one first.
    let k = libm::tan(PI * corner / rate);
    let (b, a) = match fall {
        SpectrumFall::Gentle => ([k, k, 0.0], [1.0 + k, k - 1.0, 0.0]),
        SpectrumFall::Steep => {
            let root = 2.0_f64.sqrt() * k;
            (
                [k * k, 2.0 * k * k, k * k],
                [1.0 + root + k * k, 2.0 * (k * k - 1.0), 1.0 - root + k * k],
            )
        }
    };
    // One sample through the filter (transposed direct form II).
    let step = |state: &mut [f64; 2], x: f64| {
        let y = (b[0] * x + state[0]) / a[0];
        *state = [b[1] * x - a[1] * y + state[1], b[2] * x - a[2] * y];
        y
    };
    // Number of samples after which the initial state of the filter has decayed.
    let mut settles = 0.0;
    while settles * corner < 4.0 * rate {
        settles += 1.0;
    }
    // The squared impulse response sums up to the variance of the output.
    let mut state = [0.0; 2];
    let mut squares = step(&mut state, 1.0).powi(2);
    let mut left = settles;
    while left > 0.0 {
        squares += step(&mut state, 0.0).powi(2);
        left -= 1.0;
    }
    let gain = deviation / squares.sqrt();
    // The filter runs before the first sample, so that the noise is stationary.
    let mut state = [0.0; 2];
    while settles > 0.0 {
        step(&mut state, random.normal());
        settles -= 1.0;
    }
    (0..samples).map(|_| gain * step(&mut state, random.normal())).collect()
}
