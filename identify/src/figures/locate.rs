//! Regions of large error. Input: errors of the channels and the variables they may depend on. Output: regions whose
//! share of the squared error is larger than their share of the samples.
//!
//! Each variable is divided into bins with equal numbers of samples. The contiguous interval with the largest excess
//! (share of the squared error minus share of the samples) is found exactly (Kadane's algorithm, J. Bentley, Comm. ACM
//! 27 (1984)). Intervals around zero are tried too, since drives reverse there. A region is reported only if its excess
//! and its density are large and it repeats over the parts of the recording.

use serde::{Deserialize, Serialize};

use super::thresholds::{
    BIN_FEWEST_SAMPLES, DENSE_PARTS_LEAST_SHARE, FEWEST_PARTS, MOST_REGIONS, PART_DENSITY_SHARE, PART_FEWEST_SAMPLES,
    RECURRENCE_PARTS, REGION_LEAST_DENSITY, REGION_LEAST_EXCESS, ZERO_REGION_LEAST_SHARE,
};
use crate::words::with_digits;

/// A region with a larger share of a channel's squared error than of the samples.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ErrorRegion {
    /// The channel whose error it is.
    pub channel: String,
    /// Name of the variable that bounds the region.
    #[serde(rename = "in")]
    pub variable: String,
    /// Lowest and highest value of the variable, in its unit.
    pub range: [f64; 2],
    /// Fraction of the channel's squared error that lies there.
    pub share: f64,
    /// Fraction of the samples that lie there.
    pub samples: f64,
    /// Description in one sentence.
    pub says: String,
}

/// Limits for the report of regions.
#[derive(Debug, Clone, PartialEq)]
pub struct LocateOptions {
    /// Number of bins of each variable; fewer if there are not 25 samples for each.
    pub bins: usize,
    /// Least excess of the share of the error over the share of the samples.
    pub excess: f64,
    /// Least ratio of the two shares.
    pub density: f64,
    /// Largest number of regions of a channel, largest excess first.
    pub most: usize,
}

impl Default for LocateOptions {
    fn default() -> Self {
        Self {
            bins: 40,
            excess: REGION_LEAST_EXCESS,
            density: REGION_LEAST_DENSITY,
            most: MOST_REGIONS,
        }
    }
}

/// Name of the time column, for which repetition is not required.
pub const TIME_COLUMN: &str = "t";

/// Finds regions of concentrated error. `errors` are `(channel, measured - model per sample)` in order of time,
/// `variables` are `(name, value per sample)`; time has the name [`TIME_COLUMN`].
/// Columns whose length differs from that of the channel are skipped, and so are samples that are not finite.
///
/// ```
/// use modelmill_identify::{locate_errors, LocateOptions};
/// let rate: Vec<f64> = (0..1000).map(|i| (f64::from(i) * 0.1).sin()).collect();
/// let error: Vec<f64> = rate.iter().map(|v| if *v > 0.9 { 1.0 } else { 0.1 }).collect();
/// let regions = locate_errors(&[("left", &error)], &[("left_d", &rate)], &LocateOptions::default());
/// assert_eq!(regions[0].variable, "left_d");
/// assert!(regions[0].range[0] > 0.85 && regions[0].share > 0.9);
/// ```
pub fn locate_errors(
    errors: &[(&str, &[f64])],
    variables: &[(&str, &[f64])],
    options: &LocateOptions,
) -> Vec<ErrorRegion> {
    let mut regions = Vec::new();
    for (channel, error) in errors {
        let squares: Vec<f64> = error.iter().map(|e| if e.is_finite() { e * e } else { 0.0 }).collect();
        let total: f64 = squares.iter().sum();
        if total <= 0.0 || !total.is_finite() {
            continue;
        }
        let mut found: Vec<ErrorRegion> = variables
            .iter()
            .filter(|(_, values)| values.len() == error.len())
            .filter_map(|(name, values)| densest_region(channel, &squares, total, name, values, options))
            .collect();
        found.sort_by(|a, b| (b.share - b.samples).total_cmp(&(a.share - a.samples)));
        found.truncate(options.most);
        regions.extend(found);
    }
    regions
}

/// The region of one variable with the largest excess, if it exceeds the limits.
fn densest_region(
    channel: &str,
    squares: &[f64],
    total: f64,
    name: &str,
    values: &[f64],
    options: &LocateOptions,
) -> Option<ErrorRegion> {
    let mut order: Vec<usize> = (0..values.len()).filter(|&i| values[i].is_finite()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let n = order.len();
    let bins = options.bins.min(n / BIN_FEWEST_SAMPLES);
    if bins < 2 {
        return None;
    }
    let edges = bin_edges(&order, values, bins);
    let excess_of = |range: [f64; 2]| {
        let inside = |value: f64| value >= range[0] && value <= range[1];
        let (mut share, mut count) = (0.0, 0_usize);
        for (value, square) in values.iter().zip(squares) {
            if inside(*value) {
                share += square / total;
                count += 1;
            }
        }
        (share, count as f64 / n as f64)
    };
    let interval = best_interval(&order, squares, total, &edges);
    let mut range = [values[order[interval.0]], values[order[interval.1 - 1]]];
    let (mut share, mut samples) = excess_of(range);
    // A symmetric interval around zero is preferred to another one that is slightly better.
    if range[0] < 0.0 && range[1] > 0.0 || values[order[0]] < 0.0 && values[order[n - 1]] > 0.0 {
        let mut sizes: Vec<f64> = order.iter().map(|&i| values[i].abs()).collect();
        sizes.sort_by(f64::total_cmp);
        for fraction in [40, 20, 10, 5] {
            let bound = sizes[n / fraction];
            let (zero_share, zero_samples) = excess_of([-bound, bound]);
            if zero_share - zero_samples > ZERO_REGION_LEAST_SHARE * (share - samples) {
                (range, share, samples) = ([-bound, bound], zero_share, zero_samples);
            }
        }
    }
    let counts = share - samples >= options.excess && share >= options.density * samples;
    if !counts || (name != TIME_COLUMN && !is_recurrent(squares, values, range, options.density)) {
        return None;
    }
    let around = if range[0] < 0.0 && range[0].to_bits() == (-range[1]).to_bits() {
        ", around zero"
    } else {
        ""
    };
    let says = format!(
        "{:.0} % of the squared error of {channel} is in the samples with {name} between {} and {}{around} \
         ({:.0} % of all samples)",
        100.0 * share,
        with_digits(range[0], 3),
        with_digits(range[1], 3),
        100.0 * samples,
    );
    Some(ErrorRegion {
        channel: channel.to_owned(),
        variable: name.to_owned(),
        range,
        share,
        samples,
        says,
    })
}

/// First sorted sample of each bin, and the end of the last one; equal values stay in one bin.
fn bin_edges(order: &[usize], values: &[f64], bins: usize) -> Vec<usize> {
    let n = order.len();
    let mut edges = vec![0];
    for bin in 1..bins {
        let mut edge = bin * n / bins;
        while edge < n && values[order[edge]] <= values[order[edge - 1]] {
            edge += 1;
        }
        if edge < n && edges.last().is_some_and(|last| edge > *last) {
            edges.push(edge);
        }
    }
    edges.push(n);
    edges
}

/// Interval with the largest excess by Kadane's algorithm over the bins: first sorted sample, and the one after the
/// last.
fn best_interval(order: &[usize], squares: &[f64], total: f64, edges: &[usize]) -> (usize, usize) {
    let n = order.len() as f64;
    let mut best = (f64::NEG_INFINITY, 0, order.len());
    let (mut sum, mut start) = (0.0, 0);
    for bin in edges.windows(2) {
        let share: f64 = order[bin[0]..bin[1]].iter().map(|&i| squares[i]).sum::<f64>() / total;
        if sum <= 0.0 {
            (sum, start) = (0.0, bin[0]);
        }
        sum += share - (bin[1] - bin[0]) as f64 / n;
        if sum > best.0 {
            best = (sum, start, bin[1]);
        }
    }
    (best.1, best.2)
}

/// Whether the region is denser than the rest in most parts of the recording that have samples in it, at least two.
fn is_recurrent(squares: &[f64], values: &[f64], range: [f64; 2], density: f64) -> bool {
    let length = squares.len().div_ceil(RECURRENCE_PARTS).max(1);
    let (mut visited, mut dense) = (0_usize, 0_usize);
    for (squares, values) in squares.chunks(length).zip(values.chunks(length)) {
        let inside: Vec<f64> = values
            .iter()
            .zip(squares)
            .filter(|(value, _)| **value >= range[0] && **value <= range[1])
            .map(|(_, square)| *square)
            .collect();
        let total: f64 = squares.iter().sum();
        if inside.len() < PART_FEWEST_SAMPLES || total <= 0.0 {
            continue;
        }
        visited += 1;
        let share = inside.iter().sum::<f64>() / total;
        // In a single part of the recording, less than the required density is enough.
        let enough = 1.0 + PART_DENSITY_SHARE * (density - 1.0);
        dense += usize::from(share >= (enough * inside.len() as f64 / squares.len() as f64).min(1.0));
    }
    visited >= FEWEST_PARTS && dense as f64 >= DENSE_PARTS_LEAST_SHARE * visited as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_noise::TestNoise;

    fn motion(samples: u32) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
        let time: Vec<f64> = (0..samples).map(|i| 0.004 * f64::from(i)).collect();
        let angle = time.iter().map(|t| (1.3 * t).sin() + 0.4 * (3.1 * t).cos()).collect();
        let rate = time
            .iter()
            .map(|t| 1.3 * (1.3 * t).cos() - 1.24 * (3.1 * t).sin())
            .collect();
        (time, angle, rate)
    }

    #[test]
    fn an_error_at_reversal_is_found_around_zero_rate() {
        let (time, angle, rate) = motion(4000);
        let mut noise = TestNoise::new(9);
        let error: Vec<f64> = rate
            .iter()
            .map(|v| noise.normal() + if v.abs() < 0.1 { 12.0 * v.signum() } else { 0.0 })
            .collect();
        let regions = locate_errors(
            &[("left", &error)],
            &[(TIME_COLUMN, &time), ("q", &angle), ("q_d", &rate)],
            &LocateOptions::default(),
        );
        let first = &regions[0];
        assert_eq!((first.channel.as_str(), first.variable.as_str()), ("left", "q_d"));
        assert!(
            first.range[0] < 0.0 && first.range[1] < 0.25 && first.share > 0.6,
            "{first:?}"
        );
        assert!(first.says.contains("around zero"), "{}", first.says);
        assert_eq!(serde_json::to_value(first).unwrap()["in"], "q_d");
    }

    #[test]
    fn a_single_burst_is_found_in_time_only() {
        let (time, angle, rate) = motion(4000);
        let mut noise = TestNoise::new(4);
        let error: Vec<f64> = time
            .iter()
            .map(|t| noise.normal() * if (5.0..5.6).contains(t) { 10.0 } else { 1.0 })
            .collect();
        let regions = locate_errors(
            &[("left", &error)],
            &[(TIME_COLUMN, &time), ("q", &angle), ("q_d", &rate)],
            &LocateOptions::default(),
        );
        assert_eq!(regions.len(), 1, "{regions:?}");
        assert_eq!(regions[0].variable, TIME_COLUMN);
        assert!(regions[0].range[0] > 4.7 && regions[0].range[1] < 5.9);
    }

    #[test]
    fn white_noise_has_no_region_and_odd_input_no_panic() {
        let (time, angle, rate) = motion(4000);
        for seed in 0..20 {
            let mut noise = TestNoise::new(seed);
            let error: Vec<f64> = time.iter().map(|_| noise.normal()).collect();
            let regions = locate_errors(
                &[("left", &error)],
                &[(TIME_COLUMN, &time), ("q", &angle), ("q_d", &rate)],
                &LocateOptions::default(),
            );
            assert!(regions.is_empty(), "{regions:?}");
        }
        let options = LocateOptions::default();
        assert!(locate_errors(&[("a", &[])], &[("q", &[])], &options).is_empty());
        assert!(locate_errors(&[("a", &[0.0; 100])], &[("q", &[1.0; 100])], &options).is_empty());
        assert!(locate_errors(&[("a", &[1.0; 100])], &[("q", &[1.0; 100])], &options).is_empty());
        assert!(locate_errors(&[("a", &[f64::NAN; 100])], &[("q", &[f64::NAN; 100])], &options).is_empty());
        assert!(locate_errors(&[("a", &[1.0; 100])], &[("q", &[1.0; 99])], &options).is_empty());
    }
}
