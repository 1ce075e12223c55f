//! Zero-phase filters: a low-pass design goes in, and a signal comes out smoothed without delay.
//!
//! Designs are kept as second-order sections, which stay accurate at low cut-offs where a
//! transfer function of order 8 loses all digits.
//! Sources: analogue prototypes and bilinear transform as in A. V. Oppenheim and R. W. Schafer,
//! "Discrete-Time Signal Processing", ch. 7; forward-backward filtering with odd padding and
//! steady initial states as F. Gustafsson, "Determining the initial states in forward-backward
//! filtering", IEEE Trans. Signal Processing 44 (1996), in the form that MATLAB's and scipy's
//! `filtfilt` share.

use std::array;
use std::f64::consts::PI;
use std::fmt;

use pulp::{Arch, Simd, WithSimd};

/// Why a filter could not be designed or applied.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum FilterError {
    /// The cut-off is not between zero and half the sampling rate.
    CutoffOutOfRange {
        /// The requested cut-off, Hz.
        cutoff_hz: f64,
        /// The sampling rate, Hz.
        rate_hz: f64,
    },
    /// The order is zero or too large for any recording.
    OrderOutOfRange {
        /// The requested order.
        order: usize,
    },
    /// The decimation factor is zero or beyond the length of the signal.
    FactorOutOfRange {
        /// The requested factor.
        factor: usize,
    },
    /// The signal is too short for the padding at its ends.
    TooShort {
        /// Number of samples.
        have: usize,
        /// Least number of samples.
        need: usize,
    },
    /// The length of a table is not a multiple of its width.
    Shape {
        /// Number of values.
        have: usize,
        /// Values per sample.
        per_sample: usize,
    },
}

impl fmt::Display for FilterError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::CutoffOutOfRange { cutoff_hz, rate_hz } => write!(
                f,
                "a cut-off of {cutoff_hz} Hz was requested, but the recording has {rate_hz:.6} samples per second; \
                 choose a cut-off above 0 and below {:.6} Hz",
                rate_hz / 2.0
            ),
            Self::OrderOutOfRange { order } => {
                write!(
                    f,
                    "a filter of order {order} was requested; choose an order from 1 to {MAX_FILTER_ORDER} (4 is usual)"
                )
            }
            Self::FactorOutOfRange { factor } => write!(
                f,
                "decimation by {factor} was requested; choose 1 (none) or a factor well below the number of samples"
            ),
            Self::TooShort { have, need } => write!(
                f,
                "{} too few to be filtered, at least {need} are needed; \
                 use a longer recording or a lower filter order",
                match have {
                    1 => "1 sample is".to_owned(),
                    n => format!("{n} samples are"),
                }
            ),
            Self::Shape { have, per_sample } => {
                write!(
                    f,
                    "a table of {have} numbers does not divide into samples of {per_sample} numbers each"
                )
            }
        }
    }
}

impl std::error::Error for FilterError {}

/// Largest order. Filters of a higher order have transients that are longer than any recording.
pub const MAX_FILTER_ORDER: usize = 20;

/// A low-pass filter in second-order sections `(b0 + b1/z + b2/z^2) / (1 + a1/z + a2/z^2)`.
#[derive(Debug, Clone, PartialEq)]
pub struct LowPass {
    /// The sections in the order in which a signal passes them.
    sections: Vec<SecondOrderSection>,
    /// Order of the filter, which decides the padding.
    order: usize,
}

/// A section `(b0 + b1/z + b2/z^2) / (1 + a1/z + a2/z^2)`.
#[derive(Debug, Clone, Copy, PartialEq)]
struct SecondOrderSection {
    /// b0, b1, b2.
    b: [f64; 3],
    /// a1, a2.
    a: [f64; 2],
}

impl SecondOrderSection {
    /// Gain at frequency zero.
    fn dc_gain(&self) -> f64 {
        (self.b[0] + self.b[1] + self.b[2]) / (1.0 + self.a[0] + self.a[1])
    }

    /// States of the transposed direct form II for a constant input of one.
    fn steady_state(&self) -> [f64; 2] {
        let y = self.dc_gain();
        let second = self.b[2] - self.a[1] * y;
        [self.b[1] - self.a[0] * y + second, second]
    }
}

impl LowPass {
    /// Butterworth's filter: gain `1/sqrt(2)` at `cutoff_hz` in one direction, so `1/2` when it
    /// is run both ways by [`LowPass::zero_phase`].
    /// Fails when the cut-off is not inside `(0, rate_hz / 2)` or the order is not in `1..=20`.
    pub fn butterworth(order: usize, cutoff_hz: f64, rate_hz: f64) -> Result<Self, FilterError> {
        check_order(order)?;
        // Poles lie on a circle; only the upper half is computed.
        let warped = warp(cutoff_hz, rate_hz)?;
        let poles = (0..order.div_ceil(2)).map(|k| {
            let angle = PI * (2 * k + 1) as f64 / (2 * order) as f64;
            (-angle.sin() * warped, angle.cos() * warped)
        });
        Ok(Self::from_upper_poles(order, poles, 1.0))
    }

    /// Chebyshev's filter of the first kind: `ripple_db` of ripple up to `cutoff_hz`, and steeper
    /// beyond it than Butterworth's.
    /// Fails as [`LowPass::butterworth`] does; `ripple_db` must be positive.
    pub fn chebyshev1(order: usize, ripple_db: f64, cutoff_hz: f64, rate_hz: f64) -> Result<Self, FilterError> {
        check_order(order)?;
        let warped = warp(cutoff_hz, rate_hz)?;
        let epsilon = (10.0_f64.powf(ripple_db / 10.0) - 1.0).sqrt();
        let mu = (1.0 / epsilon).asinh() / order as f64;
        // Poles lie on an ellipse.
        let poles = (0..order.div_ceil(2)).map(|k| {
            let angle = PI * (2 * k + 1) as f64 / (2 * order) as f64;
            (-mu.sinh() * angle.sin() * warped, mu.cosh() * angle.cos() * warped)
        });
        // At frequency zero an even order has the lowest gain of the ripple.
        let dc = if order.is_multiple_of(2) {
            1.0 / epsilon.hypot(1.0)
        } else {
            1.0
        };
        Ok(Self::from_upper_poles(order, poles, dc))
    }

    /// Sections from the analogue poles `(re, im >= 0)`, one of each conjugate pair, by the
    /// bilinear transform `s = (z - 1)/(z + 1)`; all zeros lie at `z = -1`.
    fn from_upper_poles(order: usize, poles: impl Iterator<Item = (f64, f64)>, dc_gain: f64) -> Self {
        let mut sections: Vec<SecondOrderSection> = poles
            .enumerate()
            .map(|(k, (re, im))| {
                let is_real = order % 2 == 1 && k == order / 2;
                // The real pole of an odd order gives a section of first order.
                if is_real {
                    let pole = (1.0 + re) / (1.0 - re);
                    let gain = (1.0 - pole) / 2.0;
                    SecondOrderSection {
                        b: [gain, gain, 0.0],
                        a: [-pole, 0.0],
                    }
                } else {
                    let denominator = (1.0 - re).powi(2) + im * im;
                    let a1 = -2.0 * (1.0 - re * re - im * im) / denominator;
                    let a2 = ((1.0 + re).powi(2) + im * im) / denominator;
                    // Equals 1 + a1 + a2, but without cancellation at low cut-offs.
                    let gain = (re * re + im * im) / denominator;
                    SecondOrderSection {
                        b: [gain, 2.0 * gain, gain],
                        a: [a1, a2],
                    }
                }
            })
            .collect();
        // The gain at zero is applied once, in one of the sections.
        for b in &mut sections[0].b {
            *b *= dc_gain;
        }
        // The sharpest resonance is last, so that nothing is amplified in between.
        sections.reverse();
        Self { sections, order }
    }

    /// Length of the odd padding at both ends, samples; a signal must be longer.
    pub fn padding(&self) -> usize {
        3 * (self.order + 1)
    }

    /// Gain at `frequency_hz` in one direction.
    pub fn gain(&self, frequency_hz: f64, rate_hz: f64) -> f64 {
        let (sin1, cos1) = (2.0 * PI * frequency_hz / rate_hz).sin_cos();
        let (sin2, cos2) = (4.0 * PI * frequency_hz / rate_hz).sin_cos();
        let magnitude = |c0: f64, c1: f64, c2: f64| (c0 + c1 * cos1 + c2 * cos2).hypot(c1 * sin1 + c2 * sin2);
        self.sections
            .iter()
            .map(|s| magnitude(s.b[0], s.b[1], s.b[2]) / magnitude(1.0, s.a[0], s.a[1]))
            .product()
    }

    /// The signal filtered forwards and then backwards: no delay, the squared gain.
    /// Both ends are continued by point reflection, and the filter starts in the steady state of
    /// the first sample, as MATLAB's and scipy's `filtfilt` do.
    /// Fails when the signal is not longer than [`LowPass::padding`].
    pub fn zero_phase(&self, signal: &[f64]) -> Result<Vec<f64>, FilterError> {
        let lanes: Vec<[f64; 1]> = signal.iter().map(|x| [*x]).collect();
        Ok(self.zero_phase_lanes(&lanes)?.into_flattened())
    }

    /// The same for several signals at a time. A recursion waits for its last result, and the other signals use that
    /// time. Every lane gives the same bits as it would alone.
    pub(crate) fn zero_phase_lanes<const N: usize>(&self, signal: &[[f64; N]]) -> Result<Vec<[f64; N]>, FilterError> {
        let pad = self.padding();
        let n = signal.len();
        if n <= pad {
            return Err(FilterError::TooShort { have: n, need: pad + 1 });
        }
        // Both ends are continued by point reflection at the first and last sample.
        let mirrored = |about: usize, i: usize| array::from_fn(|k| 2.0 * signal[about][k] - signal[i][k]);
        let mut extended: Vec<[f64; N]> = Vec::with_capacity(n + 2 * pad);
        extended.extend((1..=pad).rev().map(|i| mirrored(0, i)));
        extended.extend_from_slice(signal);
        extended.extend((1..=pad).map(|i| mirrored(n - 1, n - 1 - i)));
        let arch = Arch::new();
        // Forwards, then backwards over the same memory.
        for is_backward in [false, true] {
            arch.dispatch(SteadyStateFilter {
                sections: &self.sections,
                signal: &mut extended,
                is_backward,
            });
        }
        extended.truncate(pad + n);
        extended.drain(..pad);
        Ok(extended)
    }
}

/// A pass of all sections over a signal, forwards from the steady state of the first sample or backwards from that of
/// the last one.
struct SteadyStateFilter<'a, const N: usize> {
    /// The sections of the filter.
    sections: &'a [SecondOrderSection],
    /// The samples, which are replaced by the filtered ones.
    signal: &'a mut [[f64; N]],
    /// Whether the pass goes from the last sample to the first.
    is_backward: bool,
}

impl<const N: usize> WithSimd for SteadyStateFilter<'_, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        /// Samples that stay in the first-level cache while all sections pass over them.
        const CHUNK: usize = 64;
        let first = if self.is_backward {
            self.signal.last()
        } else {
            self.signal.first()
        };
        let Some(mut level) = first.copied() else {
            return;
        };
        // Each section starts in the steady state for the output of the sections before it.
        let mut states: Vec<[[f64; N]; 2]> = Vec::with_capacity(self.sections.len());
        for section in self.sections {
            states.push(section.steady_state().map(|state| level.map(|level| state * level)));
            level = level.map(|level| level * section.dc_gain());
        }
        // Loops and not closures, because a closure would be compiled without the vector instructions.
        let chunks = self.signal.len().div_ceil(CHUNK);
        for k in 0..chunks {
            // Chunks of a backward pass are counted from the end of the signal.
            let (start, end) = if self.is_backward {
                let end = self.signal.len() - k * CHUNK;
                (end.saturating_sub(CHUNK), end)
            } else {
                (k * CHUNK, (k * CHUNK + CHUNK).min(self.signal.len()))
            };
            let chunk = &mut self.signal[start..end];
            // Two sections at a time share a pass over the samples.
            for (sections, states) in self.sections.chunks(2).zip(states.chunks_mut(2)) {
                match (sections, states) {
                    ([a, b], [of_a, of_b]) => {
                        run_sections([a, b], [of_a, of_b], chunk, self.is_backward);
                    }
                    ([one], [state]) => run_sections([one], [state], chunk, self.is_backward),
                    _ => {}
                }
            }
        }
    }
}

/// Filters samples with some sections. While one section waits for its last result, another works on the sample
/// before.
#[allow(
    clippy::inline_always,
    reason = "a function of its own would be compiled for the narrowest vectors"
)]
#[inline(always)]
fn run_sections<const M: usize, const N: usize>(
    sections: [&SecondOrderSection; M],
    states: [&mut [[f64; N]; 2]; M],
    samples: &mut [[f64; N]],
    is_backward: bool,
) {
    // The states are copied, so that they can be kept in registers.
    let mut z = states.each_ref().map(|state| **state);
    let n = samples.len();
    for i in 0..n {
        let x = &mut samples[if is_backward { n - 1 - i } else { i }];
        for (section, [z1, z2]) in sections.iter().zip(&mut z) {
            let ([b0, b1, b2], [a1, a2]) = (section.b, section.a);
            for k in 0..N {
                let y = b0 * x[k] + z1[k];
                z1[k] = b1 * x[k] - a1 * y + z2[k];
                z2[k] = b2 * x[k] - a2 * y;
                x[k] = y;
            }
        }
    }
    for (state, z) in states.into_iter().zip(z) {
        *state = z;
    }
}

/// Fails unless the order is between 1 and [`MAX_FILTER_ORDER`].
fn check_order(order: usize) -> Result<(), FilterError> {
    if (1..=MAX_FILTER_ORDER).contains(&order) {
        Ok(())
    } else {
        Err(FilterError::OrderOutOfRange { order })
    }
}

/// The analogue frequency that the bilinear transform maps to the cut-off; fails unless it is below half of the
/// sampling rate.
fn warp(cutoff_hz: f64, rate_hz: f64) -> Result<f64, FilterError> {
    let inside = rate_hz.is_finite() && cutoff_hz > 0.0 && cutoff_hz < rate_hz / 2.0;
    if inside {
        Ok((PI * cutoff_hz / rate_hz).tan())
    } else {
        Err(FilterError::CutoffOutOfRange { cutoff_hz, rate_hz })
    }
}
