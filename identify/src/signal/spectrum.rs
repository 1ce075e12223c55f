//! Power spectrum of a signal, to separate motion from noise.
//!
//! Source: J. W. Cooley and J. W. Tukey (1965), radix 2, with zero padding; window by J. von Hann.

use std::f64::consts::PI;

/// Periodogram of the signal without its mean under a Hann window, at even frequencies from 0 to half of the sampling
/// rate. The unit is arbitrary but the same for all frequencies. Empty for fewer than 4 samples.
pub(crate) fn hann_power(signal: &[f64]) -> Vec<f64> {
    let n = signal.len();
    if n < 4 {
        return Vec::new();
    }
    let mean = signal.iter().sum::<f64>() / n as f64;
    // Zero padding to a power of two, for the fast transform.
    let padded = n.next_power_of_two();
    let mut re = vec![0.0; padded];
    let mut im = vec![0.0; padded];
    for (i, value) in signal.iter().enumerate() {
        re[i] = (value - mean) * (PI * (i as f64 + 0.5) / n as f64).sin().powi(2);
    }
    transform(&mut re, &mut im);
    (0..=padded / 2).map(|k| re[k] * re[k] + im[k] * im[k]).collect()
}

/// Discrete Fourier transform in place; the length must be a power of two.
fn transform(re: &mut [f64], im: &mut [f64]) {
    let n = re.len();
    let bits = n.trailing_zeros();
    // Sort the samples by the reversed bits of their indices.
    for i in 0..n {
        let j = if bits == 0 {
            0
        } else {
            i.reverse_bits() >> (usize::BITS - bits)
        };
        if j > i {
            re.swap(i, j);
            im.swap(i, j);
        }
    }
    // Combine transforms of half the length, until the complete length is reached.
    let mut half = 1;
    while half < n {
        let twiddles: Vec<(f64, f64)> = (0..half).map(|k| (-PI * k as f64 / half as f64).sin_cos()).collect();
        // Butterflies of each block.
        for start in (0..n).step_by(2 * half) {
            for (k, (sin, cos)) in twiddles.iter().enumerate() {
                let (a, b) = (start + k, start + k + half);
                let (x, y) = (re[b] * cos - im[b] * sin, re[b] * sin + im[b] * cos);
                (re[b], im[b]) = (re[a] - x, im[a] - y);
                re[a] += x;
                im[a] += y;
            }
        }
        half *= 2;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_transform_is_the_sum_that_defines_it() {
        let x: Vec<f64> = (0..16).map(|i| f64::from(i * i % 7) - 2.0).collect();
        let (mut re, mut im) = (x.clone(), vec![0.0; 16]);
        transform(&mut re, &mut im);
        for k in 0..16 {
            let angle = |i: usize| -2.0 * PI * (k * i) as f64 / 16.0;
            let r: f64 = x.iter().enumerate().map(|(i, v)| v * angle(i).cos()).sum();
            let m: f64 = x.iter().enumerate().map(|(i, v)| v * angle(i).sin()).sum();
            assert!((re[k] - r).abs() < 1e-12 && (im[k] - m).abs() < 1e-12);
        }
    }

    #[test]
    fn a_tone_peaks_at_its_frequency() {
        let tone: Vec<f64> = (0..1024)
            .map(|i| 3.0 + (2.0 * PI * 0.125 * f64::from(i)).sin())
            .collect();
        let power = hann_power(&tone);
        let peak = (0..power.len()).max_by(|a, b| power[*a].total_cmp(&power[*b])).unwrap();
        assert_eq!(peak, 128);
    }
}
