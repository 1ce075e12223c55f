//! Spectra of the residuals, by averaged windowed segments (P. Welch, IEEE Trans. Audio Electroacoustics 15 (1967)).

use std::f64::consts::TAU;
use std::fmt::Write as _;

use modelmill_identify::float_to_count;

use super::draw::{LEFT, PlotAxis, RIGHT, SvgPicture, WIDTH, range};
use super::units::force_unit;
use crate::diagnose::ModelVersion;
use crate::text::svg::escape;

/// Height of a picture.
const HEIGHT: f64 = 170.0;
/// Largest number of samples of a segment.
const SEGMENT: usize = 2048;
/// Number of frequencies, evenly spaced on a logarithmic axis.
const FREQUENCIES: usize = 140;

/// Power spectral density of a signal at some frequencies, one-sided: `(frequency in Hz, unit^2/Hz)`. `rate` is the
/// sampling rate, Hz. Empty for fewer than 32 samples.
pub(crate) fn density(signal: &[f64], rate: f64) -> Vec<(f64, f64)> {
    // Short signals are one segment, very short ones have no spectrum.
    let n = SEGMENT.min(signal.len());
    if n < 32 || !(rate > 0.0 && rate.is_finite()) {
        return Vec::new();
    }
    // The window of Hann, which keeps a strong line from hiding weak frequencies next to it.
    let window: Vec<f64> = (0..n)
        .map(|i| 0.5 - 0.5 * (TAU * (i as f64 + 0.5) / n as f64).cos())
        .collect();
    // The window removes power, for which the density is corrected.
    let power: f64 = window.iter().map(|w| w * w).sum();
    // Segments overlap by half, as Welch recommends for this window.
    let starts: Vec<usize> = (0..=signal.len() - n).step_by(n / 2).collect();
    let segments: Vec<Vec<f64>> = starts
        .iter()
        .map(|start| {
            let part = &signal[*start..start + n];
            // The mean would leak into low frequencies.
            let mean = part.iter().sum::<f64>() / n as f64;
            part.iter().zip(&window).map(|(x, w)| (x - mean) * w).collect()
        })
        .collect();
    // Frequencies are bins of the discrete Fourier transform; low ones may coincide.
    let mut bins: Vec<usize> = (0..FREQUENCIES)
        .map(|k| {
            let share = k as f64 / (FREQUENCIES - 1) as f64;
            let bin = float_to_count((n as f64 / 2.0).powf(share).round());
            bin.clamp(1, n / 2)
        })
        .collect();
    bins.dedup();
    bins.iter()
        .map(|bin| {
            let sum: f64 = segments.iter().map(|s| goertzel(s, *bin)).sum();
            // One-sided density: the factor 2 adds the negative frequencies.
            let density = 2.0 * sum / (segments.len() as f64 * power * rate);
            (*bin as f64 * rate / n as f64, density)
        })
        .collect()
}

/// Squared magnitude of one bin of the discrete Fourier transform (G. Goertzel, Amer. Math. Monthly 65 (1958)).
fn goertzel(values: &[f64], bin: usize) -> f64 {
    let factor = 2.0 * (TAU * bin as f64 / values.len() as f64).cos();
    let (mut one, mut two) = (0.0, 0.0);
    for x in values {
        (one, two) = (x + factor * one - two, one);
    }
    one * one + two * two - factor * one * two
}

/// A figure for each drive: density of the residual over frequency, before and after the effects.
pub(crate) fn figures(before: &ModelVersion, after: Option<&ModelVersion>) -> String {
    let mut html = String::new();
    for (d, drive) in before.model.row_names().iter().enumerate() {
        let of = |version: &ModelVersion| -> Vec<(f64, f64)> {
            // The longest run resolves the lowest frequencies.
            let judged = version.validation_runs();
            let longest = judged.iter().max_by_key(|k| version.runs[**k].time.len());
            let Some(run) = longest.map(|k| &version.runs[*k]) else {
                return Vec::new();
            };
            let n = run.time.len();
            if n < 2 {
                return Vec::new();
            }
            // The mean rate after decimation.
            let rate = (n - 1) as f64 / (run.time[n - 1] - run.time[0]);
            density(&run.error(d), rate)
        };
        let curves = [Some(("c-before", of(before))), after.map(|v| ("c-after", of(v)))];
        let curves: Vec<(&str, Vec<(f64, f64)>)> = curves.into_iter().flatten().collect();
        // The picture shows amplitude densities, whose unit is that of the force per root of Hz.
        let roots: Vec<f64> = curves
            .iter()
            .flat_map(|(_, c)| c.iter().map(|(_, v)| v.sqrt()))
            .filter(|v| *v > 0.0)
            .collect();
        let frequencies: Vec<f64> = curves.iter().flat_map(|(_, c)| c.iter().map(|(f, _)| *f)).collect();
        if roots.is_empty() {
            continue;
        }
        // Both axes are logarithmic, since densities cover decades.
        let x = PlotAxis::decades(range(&frequencies), [LEFT, WIDTH - RIGHT]);
        let [low, high] = range(&roots);
        let y = PlotAxis::decades(
            // At most eight decades are shown; what is below is rounding.
            [(low / 1.5).max(high * 1e-8), high * 1.5],
            [HEIGHT - 34.0, 8.0],
        );
        let mut picture = SvgPicture::new(WIDTH, HEIGHT);
        picture.frame(&x, &y, "frequency, Hz", [8, 4]);
        for (class, curve) in &curves {
            let mut path = String::new();
            for (k, (f, v)) in curve.iter().enumerate() {
                let pen = if k == 0 { 'M' } else { 'L' };
                let _ = write!(path, "{pen}{:.1} {:.1}", x.position(*f), y.position(v.sqrt()));
            }
            picture.path(&format!("curve {class}"), &path);
        }
        let unit = force_unit(&before.model, d);
        let _ = write!(
            html,
            "<figure class=\"still\"><figcaption><b>{}: amplitude spectral density of the error, {unit}/√Hz</b> {}</figcaption>\n{}</figure>\n",
            escape(drive),
            super::legend(after.is_some()),
            picture.finish(&format!("spectrum of the error of {drive}"))
        );
    }
    html
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn power_is_kept_and_lies_where_it_belongs() {
        // A sine of amplitude 3 at 20 Hz: its mean square is 4.5, all of it near 20 Hz.
        let rate = 500.0;
        let signal: Vec<f64> = (0..8192)
            .map(|i| 3.0 * (TAU * 20.0 * f64::from(i) / rate).sin())
            .collect();
        let found = density(&signal, rate);
        let peak = found.iter().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        assert!((peak.0 - 20.0).abs() < 1.0, "{peak:?}");
        // White noise of variance 1 has a density of 2 / rate.
        let mut state = 1_u64;
        let mut uniform = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let noise: Vec<f64> = (0..60_000).map(|_| (uniform() - 0.5) * 12_f64.sqrt()).collect();
        let found = density(&noise, rate);
        let mean = found.iter().map(|(_, v)| v).sum::<f64>() / found.len() as f64;
        assert!((mean * rate / 2.0 - 1.0).abs() < 0.1, "{mean}");
    }
}
