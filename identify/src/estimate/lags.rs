//! Autocovariances of series: sums of products over lags, Bartlett's weighted sum of them, and the automatic bandwidth
//! (Newey and West; the equations are in [`deviations`](super::deviations)).

use std::collections::VecDeque;

use nalgebra::{DMatrix, DVector};

use crate::signal::float_to_count;

/// Number of lags from which the bandwidth is estimated (Newey and West, for Bartlett's kernel).
pub(crate) fn lags_for_bandwidth(samples: usize) -> usize {
    float_to_count(4.0 * (samples as f64 / 100.0).powf(2.0 / 9.0)).clamp(1, samples.max(2) - 1)
}

/// Automatic bandwidth, samples, from the lag products of the influences; prewhitening with the coefficients
/// `whitening` is applied to the products.
pub(crate) fn bandwidth(memory: &LagProducts, whitening: &[f64], lags: usize, samples: usize) -> usize {
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
    /// The last samples, newest first.
    recent: VecDeque<Vec<f64>>,
    /// `products[lag * width + series]`.
    products: Vec<f64>,
}

impl LagProducts {
    /// Without samples.
    pub(crate) fn new(width: usize, lags: usize) -> Self {
        Self {
            width,
            lags,
            // The samples of the present window, oldest first.
            recent: VecDeque::with_capacity(lags + 1),
            products: vec![0.0; (lags + 1) * width],
        }
    }

    /// Adds one sample of all series.
    pub(crate) fn push(&mut self, values: &[f64]) {
        let mut slot = if self.recent.len() > self.lags {
            self.recent.pop_back()
        } else {
            None
        }
        .unwrap_or_default();
        slot.clear();
        slot.extend_from_slice(values);
        self.recent.push_front(slot);
        for (earlier, products) in self.recent.iter().zip(self.products.chunks_exact_mut(self.width)) {
            for ((product, now), before) in products.iter_mut().zip(values).zip(earlier) {
                *product += now * before;
            }
        }
    }

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
    /// Length of a window, samples.
    length: usize,
    recent: VecDeque<Vec<f64>>,
    /// Sum over the window.
    sum: DVector<f64>,
    /// Sum of the outer products of all windows; only the lower triangle.
    outer: DMatrix<f64>,
}

impl BartlettWindows {
    pub(crate) fn new(width: usize, length: usize) -> Self {
        Self {
            length,
            recent: VecDeque::with_capacity(length),
            sum: DVector::zeros(width),
            outer: DMatrix::zeros(width, width),
        }
    }

    /// Adds one sample of all series.
    pub(crate) fn push(&mut self, values: &[f64]) {
        let mut slot = if self.recent.len() == self.length {
            self.drop_oldest()
        } else {
            Vec::new()
        };
        for (sum, value) in self.sum.iter_mut().zip(values) {
            *sum += value;
        }
        slot.clear();
        slot.extend_from_slice(values);
        self.recent.push_back(slot);
        self.add_outer();
    }

    /// Removes the oldest sample from the window and returns its memory.
    fn drop_oldest(&mut self) -> Vec<f64> {
        let oldest = self.recent.pop_front().unwrap_or_default();
        for (sum, value) in self.sum.iter_mut().zip(&oldest) {
            *sum -= value;
        }
        oldest
    }

    /// Adds the outer product of the present window.
    fn add_outer(&mut self) {
        self.outer.syger(1.0 / self.length as f64, &self.sum, &self.sum, 1.0);
    }

    /// The weighted sum; windows that extend beyond the last sample are included.
    pub(crate) fn finish(mut self) -> DMatrix<f64> {
        while self.recent.len() > 1 {
            self.drop_oldest();
            self.add_outer();
        }
        self.outer.fill_upper_triangle_with_lower_triangle();
        self.outer
    }
}
