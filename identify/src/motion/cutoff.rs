//! The cut-off between motion and noise: signals that are differentiated go in; the cut-off of the low-pass with the
//! smallest expected error of the accelerations comes out.
//!
//! The trade-off is that of N. Wiener (lost signal against remaining noise, frequency by frequency), restricted to
//! Butterworth's filter run both ways and central differences. The definition of signal, the weights of coordinates
//! and the search are our own.

use std::f64::consts::{LN_10, PI, TAU};

use crate::motion::thresholds::{
    CUTOFF_ERROR_RATIO, CUTOFF_FEWEST_PERIODS, CUTOFF_FEWEST_SAMPLES, CUTOFF_HIGHEST_SHARE, CUTOFF_NEGLIGIBLE_SQUARE,
    MOTION_NOISE_RATIO, TRIM_ONE_IN, TRIMMED_PERIODS,
};
use crate::signal::{float_to_count, hann_power, median};

/// Relative width of a band.
const BAND: f64 = 0.15;
/// Number of cut-offs that are tried.
const STEPS: u32 = 128;

/// A signal that is differentiated to get accelerations.
#[derive(Debug, Clone, Copy)]
pub(crate) struct DifferentiatedSignal<'a> {
    /// Its samples, evenly spaced.
    pub(crate) values: &'a [f64],
    /// Number of differentiations: two for positions, one for rates.
    pub(crate) derivative_order: u8,
}

/// The cut-off, Hz, with nearly the smallest expected error of the accelerations of all signals, each relative to its
/// size. Signals have the same length and are sampled at `rate_hz`. `None` if none of them has motion above its
/// noise.
///
/// The spectrum of the differences is signal plus noise. White noise of the measured values has the known shape `(2
/// rate sin(pi f/rate))^(2 times)` there. Its level is the median of means over the upper quarter of the band, so
/// that quantisation counts as noise. Motion is what exceeds it on average over bands, because single lines at high
/// frequencies are seldom motion, but have a large share in the acceleration. The error of a cut-off has three parts:
/// lost signal, remaining noise, and transients at the ends of a short recording. The error of a coordinate is
/// limited by its size, so that a coordinate with little motion does not decide for the others.
///
/// A low cut-off loses more samples at the ends. Therefore the highest cut-off is returned whose expected error is
/// within a quarter of the smallest, or below 0.03 % of the acceleration. It is never above a fifth of the sampling
/// rate, where central differences attenuate more than the filter.
pub(crate) fn choose_cutoff(signals: &[DifferentiatedSignal<'_>], rate_hz: f64, order: usize) -> Option<f64> {
    let samples = signals.first()?.values.len();
    if samples < CUTOFF_FEWEST_SAMPLES || !(rate_hz > 0.0 && rate_hz.is_finite()) {
        return None;
    }
    let spectra: Vec<AccelerationSpectrum> = signals
        .iter()
        .filter_map(|signal| AccelerationSpectrum::new(*signal, rate_hz))
        .collect();
    let bins = spectra.first().map_or(0, |one| one.bins);
    let gains = FilterGains::new(bins, order);
    if spectra.is_empty() {
        return None;
    }
    // Cut-offs in geometric steps, each with the sum of the squared relative errors of all signals.
    let lowest = CUTOFF_FEWEST_PERIODS * rate_hz / samples as f64;
    let highest = CUTOFF_HIGHEST_SHARE * rate_hz;
    let costs: Vec<(f64, f64)> = (0..=STEPS)
        .map(|i| lowest * (highest / lowest).powf(f64::from(i) / f64::from(STEPS)))
        .map(|cutoff| {
            let transient = transient_error(cutoff / rate_hz, samples);
            let passed = gains.passed_power(cutoff, rate_hz);
            let noise = [1, 2].map(|times| gains.noise_power(&passed, times, rate_hz));
            let errors = spectra.iter().map(|spectrum| {
                let noise = noise[usize::from(spectrum.derivative_order == 2)];
                spectrum.relative_error(&passed, noise, &gains, transient)
            });
            (cutoff, errors.sum())
        })
        .collect();
    let smallest = costs.iter().map(|(_, cost)| *cost).fold(f64::INFINITY, f64::min);
    let bearable = (CUTOFF_ERROR_RATIO.powi(2) * smallest).max(CUTOFF_NEGLIGIBLE_SQUARE * spectra.len() as f64);
    costs
        .into_iter()
        .filter(|(_, cost)| *cost <= bearable)
        .map(|(cutoff, _)| cutoff)
        .reduce(f64::max)
}

/// Error of the transients at both ends in the samples that are kept, relative to the square of the acceleration. The
/// cut-off is given as a share of the sampling rate. Three periods of it are dropped, or fewer in a short recording,
/// and the transient falls tenfold in each period.
fn transient_error(cutoff: f64, samples: usize) -> f64 {
    let periods = cutoff * samples as f64;
    let dropped = (periods / TRIM_ONE_IN).min(TRIMMED_PERIODS);
    10.0_f64.powf(-2.0 * dropped) / (LN_10 * (periods - 2.0 * dropped))
}

/// Power of an acceleration over frequency, split into motion and noise.
struct AccelerationSpectrum {
    /// As in [`DifferentiatedSignal`].
    derivative_order: u8,
    /// Number of frequencies.
    bins: usize,
    /// Power of the true acceleration at the frequencies where it exceeds the noise.
    motion: Vec<(usize, f64)>,
    /// Power of the noise of the measured values, equal at all frequencies.
    noise: f64,
}

impl AccelerationSpectrum {
    /// Splits the spectrum of a signal; `None` if no motion exceeds the noise.
    fn new(signal: DifferentiatedSignal<'_>, rate_hz: f64) -> Option<Self> {
        // Differences of neighbouring samples, as a first estimate of the acceleration.
        let mut differences = signal.values.to_vec();
        for _ in 0..signal.derivative_order {
            differences = differences.windows(2).map(|w| (w[1] - w[0]) * rate_hz).collect();
        }
        let power = hann_power(&differences);
        let bins = power.len();
        let angle = |k: usize| PI * k as f64 / (bins - 1) as f64;
        let shape = |k: usize| (2.0 * rate_hz * (0.5 * angle(k)).sin()).powi(2 * i32::from(signal.derivative_order));
        // The level of the noise in the upper quarter of the band.
        let upper: Vec<f64> = (bins * 3 / 4..bins - 1).map(|k| power[k] / shape(k)).collect();
        // The median ignores lines. The means below it are needed if the noise itself consists of lines, as in a run
        // that was made of copies.
        let means = upper.chunks(upper.len().div_ceil(64).max(16));
        let noise = median(means.map(|c| c.iter().sum::<f64>() / c.len() as f64).collect());
        let mut motion = Vec::new();
        // The window and the padding spread one frequency over several bins, so bands have a least width.
        let narrowest = (8 * bins).div_ceil(differences.len());
        let mut start = 1;
        while start < bins {
            let width = float_to_count(BAND * start as f64).max(narrowest);
            let end = (start + width).min(bins);
            let band: f64 = (start..end).map(|k| power[k] / shape(k)).sum();
            if band > MOTION_NOISE_RATIO * noise * (end - start) as f64 {
                for k in start..end {
                    // The gain of differences of neighbours at this frequency.
                    let half = 0.5 * angle(k);
                    let taken = (half.sin() / half).powi(2 * i32::from(signal.derivative_order));
                    let above = power[k] - noise * shape(k);
                    if above > 0.0 {
                        motion.push((k, above / taken));
                    }
                }
            }
            start = end;
        }
        (!motion.is_empty()).then_some(Self {
            derivative_order: signal.derivative_order,
            bins,
            motion,
            noise,
        })
    }

    /// Expected squared error of the filtered acceleration, relative to the square of its size plus that error. The
    /// filter has the gain `passed` at each frequency, and noise of power 1 becomes noise of power `noise`.
    fn relative_error(&self, passed: &[f64], noise: f64, gains: &FilterGains, transient: f64) -> f64 {
        let times = i32::from(self.derivative_order);
        let mut error = self.noise * noise;
        let mut size = 0.0;
        for (k, motion) in &self.motion {
            // Central differences extend over two steps.
            let gain = passed[*k] * gains.difference[*k].powi(times);
            error += (1.0 - gain).powi(2) * motion;
            size += motion;
        }
        error += transient * size;
        error / (error + size)
    }
}

/// Gains of filter and differences at each frequency that do not depend on the cut-off; the same for all signals.
struct FilterGains {
    /// Exponent of the filter: twice its order.
    power: i32,
    /// The warped frequency of the bilinear transformation to that exponent.
    warped: Vec<f64>,
    /// Sine of the angle of a frequency in one step.
    sine: Vec<f64>,
    /// Ratio of that sine to the angle: the gain of central differences.
    difference: Vec<f64>,
}

impl FilterGains {
    /// Prepares the gains for spectra of `bins` frequencies.
    fn new(bins: usize, order: usize) -> Self {
        let power = 2 * i32::try_from(order).unwrap_or(i32::MAX / 2);
        let angles = (0..bins).map(|k| 0.5 * TAU * k as f64 / (bins - 1) as f64);
        Self {
            power,
            warped: angles.clone().map(|a| (0.5 * a).tan().powi(power)).collect(),
            sine: angles.clone().map(f64::sin).collect(),
            difference: angles.map(|a| a.sin() / a).collect(),
        }
    }

    /// Gain of the filter with this cut-off at each frequency, in both directions.
    fn passed_power(&self, cutoff_hz: f64, rate_hz: f64) -> Vec<f64> {
        let warped = (PI * cutoff_hz / rate_hz).tan().powi(self.power);
        let passed = |frequency: &f64| 1.0 / (1.0 + frequency / warped);
        self.warped.iter().map(passed).collect()
    }

    /// Power of the acceleration noise for measured noise of power 1, after `times` differentiations.
    fn noise_power(&self, passed: &[f64], times: i32, rate_hz: f64) -> f64 {
        let pairs = passed.iter().zip(&self.sine).skip(1);
        pairs
            .map(|(passed, sine)| {
                let slope = (sine * rate_hz).powi(times);
                (passed * slope).powi(2)
            })
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::derivatives::filter_and_differentiate;
    use crate::test_noise::TestNoise;

    fn twice(values: &[f64]) -> DifferentiatedSignal<'_> {
        DifferentiatedSignal {
            values,
            derivative_order: 2,
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
            let mut noise = TestNoise::new(5);
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
                let qdd = filter_and_differentiate(&time, &positions, cutoff, 4).unwrap().qdd;
                let inner = 400..3245;
                (inner.clone().map(|i| (qdd[i] - truth(time[i])).powi(2)).sum::<f64>() / inner.len() as f64).sqrt()
            };
            let size = (time.iter().map(|t| truth(*t).powi(2)).sum::<f64>() / time.len() as f64).sqrt();
            let chosen = choose_cutoff(&[twice(&positions)], rate, 4).unwrap();
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
        assert_eq!(choose_cutoff(&[twice(&[1.0; 500])], 250.0, 4), None);
        let mut noise = TestNoise::new(2);
        let still: Vec<f64> = (0..500).map(|_| 1.0 + 1e-6 * noise.normal()).collect();
        // Chance peaks may pass for motion; nothing below may panic on them.
        let _ = choose_cutoff(&[twice(&still)], 250.0, 4);
    }
}
