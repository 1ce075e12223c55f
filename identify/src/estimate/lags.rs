//! Autocovariances of series: sums of products over lags, Bartlett's weighted sum of them, and the automatic bandwidth
//! (Newey and West; the equations are in [`deviations`](super::deviations)).

use nalgebra::DMatrix;

use crate::signal::{dot, float_to_count};

/// Samples that are collected before their products are added: with the samples before them they stay in the first-level
/// cache.
const BLOCK: usize = 512;

/// Number of lags from which the bandwidth is estimated (Newey and West, for Bartlett's kernel).
pub(crate) fn lags_for_bandwidth(samples: usize) -> usize {
    float_to_count(4.0 * (samples as f64 / 100.0).powf(2.0 / 9.0)).clamp(1, samples.max(2) - 1)
}

/// Automatic bandwidth, samples, from the lag products of the influences; prewhitening with the coefficients
/// `whitening` is applied to the products.
pub(crate) fn bandwidth(memory: &AutocovarianceSums, whitening: &[f64], lags: usize, samples: usize) -> usize {
    let (mut curvature, mut power) = (0.0, 0.0);
    for (j, a) in whitening.iter().enumerate() {
        // Autocovariance of the prewhitened series.
        let gamma = |lag: usize| {
            let before = memory.product(lag.abs_diff(1), j);
            (1.0 + a * a) * memory.product(lag, j) - a * (before + memory.product(lag + 1, j))
        };
        let variance = gamma(0);
        if variance <= 0.0 {
            continue;
        }
        let s0 = 1.0 + 2.0 * (1..=lags).map(|lag| gamma(lag) / variance).sum::<f64>();
        let s1 = 2.0 * (1..=lags).map(|lag| lag as f64 * gamma(lag) / variance).sum::<f64>();
        curvature += s1 * s1;
        power += s0 * s0;
    }
    let alpha = if power > 0.0 { curvature / power } else { 0.0 };
    // Newey and West (1994), with limits from below and above.
    let automatic = float_to_count(1.1447 * (alpha * samples as f64).cbrt());
    automatic.max(lags + 1).min((samples / 10).max(1))
}

/// Accumulates products of several series with themselves some samples later.
pub(crate) struct LagProducts {
    /// Number of series.
    width: usize,
    /// Largest lag.
    lags: usize,
    /// Samples of each series, `[series][sample]`: first those before the block, as many as the largest lag, then the
    /// block. Before the first sample all are zero.
    recent: Vec<Vec<f64>>,
    /// Samples in the block.
    filled: usize,
    /// `products[lag * width + series]`.
    products: Vec<f64>,
}

impl LagProducts {
    /// Without samples.
    pub(crate) fn new(width: usize, lags: usize) -> Self {
        Self {
            width,
            lags,
            recent: vec![vec![0.0; lags + BLOCK]; width],
            filled: 0,
            products: vec![0.0; (lags + 1) * width],
        }
    }

    /// Adds one sample of all series.
    pub(crate) fn push(&mut self, values: &[f64]) {
        let at = self.lags + self.filled;
        for (series, value) in self.recent.iter_mut().zip(values) {
            series[at] = *value;
        }
        self.filled += 1;
        if self.filled == BLOCK {
            self.add_block();
        }
    }

    /// Adds the products of the block, and keeps its last samples for the next one.
    fn add_block(&mut self) {
        let (lags, filled) = (self.lags, self.filled);
        for (k, series) in self.recent.iter_mut().enumerate() {
            let block = &series[lags..lags + filled];
            for lag in 0..=lags {
                let earlier = &series[lags - lag..lags - lag + filled];
                self.products[lag * self.width + k] += dot(block, earlier);
            }
            series.copy_within(filled..filled + lags, 0);
        }
        self.filled = 0;
    }

    /// The sums over all samples.
    pub(crate) fn finish(mut self) -> AutocovarianceSums {
        self.add_block();
        AutocovarianceSums {
            width: self.width,
            products: self.products,
        }
    }
}

/// Sums of products of several series with themselves some samples later.
pub(crate) struct AutocovarianceSums {
    /// Number of series.
    width: usize,
    /// `products[lag * width + series]`.
    products: Vec<f64>,
}

impl AutocovarianceSums {
    /// Sum of products of a series at a lag.
    pub(crate) fn product(&self, lag: usize, series: usize) -> f64 {
        self.products[lag * self.width + series]
    }

    /// Autocorrelation at a lag; 0 for a series of zeros.
    pub(crate) fn correlation(&self, lag: usize, series: usize) -> f64 {
        let variance = self.product(0, series);
        if variance > 0.0 {
            self.product(lag, series) / variance
        } else {
            0.0
        }
    }
}

/// Bartlett's weighted sum of autocovariances, from sums over sliding windows.
pub(crate) struct BartlettWindows {
    /// Number of series.
    width: usize,
    /// Length of a window, samples.
    length: usize,
    /// The samples of the present window in a ring, `[sample * width + series]`; places without a sample are zero.
    recent: Vec<f64>,
    /// Place of the oldest sample in the ring, which the next sample replaces.
    oldest: usize,
    /// Sum over the window, `[series]`.
    sum: Vec<f64>,
    /// Sums over windows whose products are not added yet, `[series][window]`.
    pending: Vec<Vec<f64>>,
    /// Sum of the outer products of all windows; only the lower triangle.
    outer: DMatrix<f64>,
}

impl BartlettWindows {
    pub(crate) fn new(width: usize, length: usize) -> Self {
        Self {
            width,
            length,
            recent: vec![0.0; width * length],
            oldest: 0,
            sum: vec![0.0; width],
            pending: vec![Vec::with_capacity(BLOCK); width],
            outer: DMatrix::zeros(width, width),
        }
    }

    /// Adds one sample of all series.
    pub(crate) fn push(&mut self, values: &[f64]) {
        self.shift_window(|k| values[k]);
    }

    /// Moves the window by one sample, whose value of each series is given, and collects its sum.
    fn shift_window(&mut self, value: impl Fn(usize) -> f64) {
        let start = self.oldest * self.width;
        for k in 0..self.width {
            let value = value(k);
            // The oldest sample leaves the window before the next one enters.
            let sum = self.sum[k] - self.recent[start + k];
            self.sum[k] = sum + value;
            self.recent[start + k] = value;
            self.pending[k].push(self.sum[k]);
        }
        self.oldest = (self.oldest + 1) % self.length;
        if self.pending.first().is_some_and(|windows| windows.len() == BLOCK) {
            self.add_outer();
        }
    }

    /// Adds the outer products of the collected windows.
    fn add_outer(&mut self) {
        for i in 0..self.width {
            for j in 0..=i {
                self.outer[(i, j)] += dot(&self.pending[i], &self.pending[j]) / self.length as f64;
            }
        }
        for windows in &mut self.pending {
            windows.clear();
        }
    }

    /// The weighted sum; windows that extend beyond the last sample are included.
    pub(crate) fn finish(mut self) -> DMatrix<f64> {
        // Until the last sample leaves the window.
        for _ in 1..self.length {
            self.shift_window(|_| 0.0);
        }
        self.add_outer();
        self.outer.fill_upper_triangle_with_lower_triangle();
        self.outer
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_noise::TestNoise;

    /// Sums by their definition, over more samples than a block has and over fewer than the largest lag.
    #[test]
    fn lag_products_are_sums_over_pairs_of_samples() {
        for (samples, lags) in [(3, 5), (BLOCK, 1), (2 * BLOCK + 77, 40), (700, 600)] {
            let mut noise = TestNoise::new(12);
            let series: Vec<[f64; 2]> = (0..samples).map(|_| [noise.normal(), noise.normal()]).collect();
            let mut products = LagProducts::new(2, lags);
            for values in &series {
                products.push(values);
            }
            let sums = products.finish();
            for lag in 0..=lags {
                for k in 0..2 {
                    let pairs = series.iter().skip(lag).zip(&series);
                    let expected: f64 = pairs.map(|(now, before)| now[k] * before[k]).sum();
                    assert!(
                        (sums.product(lag, k) - expected).abs() < 1e-9,
                        "{samples} samples, lag {lag}"
                    );
                }
            }
        }
    }

    /// Bartlett's sum from lag products, with more windows than a block and with a window longer than the series.
    #[test]
    fn windows_agree_with_lag_products() {
        for (samples, length) in [(1500, 600), (1500, 7), (20, 33)] {
            let mut noise = TestNoise::new(4);
            let (mut products, mut windows) = (LagProducts::new(1, length), BartlettWindows::new(1, length));
            for _ in 0..samples {
                let value = noise.normal();
                products.push(&[value]);
                windows.push(&[value]);
            }
            let sums = products.finish();
            let weighted = |lag: usize| (1.0 - lag as f64 / length as f64) * sums.product(lag, 0);
            let expected = weighted(0) + 2.0 * (1..length).map(weighted).sum::<f64>();
            let found = windows.finish()[(0, 0)];
            assert!(
                (found - expected).abs() < 1e-9 * sums.product(0, 0),
                "{samples} samples, window {length}"
            );
        }
    }
}
