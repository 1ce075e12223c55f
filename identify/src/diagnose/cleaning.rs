//! Removes from the measured forces what least squares cannot tolerate: single outliers, and oscillations that are
//! periodic in time (`hum`). Both are reported by name.
//!
//! Both are searched in the residual of base parameters and friction. An outlier differs from the median of its
//! neighbours by many robust standard deviations, and is not next to a reversal of the drive.

use super::disturbance::{Disturbance, EstimatedQuantity};
use super::hum::{self, SlowSpectralLine};
use super::pool::{ColumnPool, FitScope, solve_gram};
use super::problem::DiagnosisProblem;
use super::thresholds::{
    FORCE_OUTLIER_DEVIATIONS, OUTLIER_LEAST_FORCE_SHARE, OUTLIER_LEAST_STEP, OUTLIERS_MOST_SHARE,
    QUANTISED_FEWEST_REPEATS, QUANTISED_FEWEST_VALUES, QUANTISED_LEAST_NOISE_PART, QUANTISED_MOST_OFF_STEP,
    REVERSAL_OUTLIER_SAMPLES, REVERSAL_UNDECIDED_SAMPLES, REVERSALS_MOST_SHARE, STANDSTILL_MOST_SHARE,
    STANDSTILL_SHORTEST_S,
};
use crate::signal::dot;
use crate::signal::median;

/// Number of samples around an outlier whose median it is compared with.
const NEIGHBOURS: usize = 9;

/// Removes outliers and spectral lines from the measured forces and reports them.
pub(crate) fn clean_forces(problem: &mut DiagnosisProblem) -> Vec<Disturbance> {
    count_removed_squares(problem, |problem| {
        let mut found = remove_outliers(problem);
        let left = base_residual(problem);
        found.extend(hum::remove_lines(problem, &left));
        found
    })
}

/// Removes slow spectral lines from forces that have not been cleaned, then cleans the rest, and reports all. In this
/// order, since the crests of an unknown line would be taken for outliers.
pub(crate) fn clean_with_slow_lines(problem: &mut DiagnosisProblem, slow: &[SlowSpectralLine]) -> Vec<Disturbance> {
    let mut found = count_removed_squares(problem, |problem| {
        let lines = slow.iter();
        lines.filter_map(|line| line.remove_from_force(problem)).collect()
    });
    found.extend(clean_forces(problem));
    found
}

/// Adds the mean square of what `clean` removes from each channel to the problem's `removed`.
fn count_removed_squares(
    problem: &mut DiagnosisProblem,
    clean: impl FnOnce(&mut DiagnosisProblem) -> Vec<Disturbance>,
) -> Vec<Disturbance> {
    // Compare the forces before and after cleaning.
    let before = problem.measured.clone();
    let found = clean(problem);
    let squares = |(old, new): (&Option<Vec<f64>>, &Option<Vec<f64>>)| {
        let pairs = old.iter().flatten().zip(new.iter().flatten());
        let sum: f64 = pairs.map(|(a, b)| (a - b).powi(2)).sum();
        sum / old.as_ref().map_or(1, Vec::len).max(1) as f64
    };
    let removed = before.0.iter().zip(&problem.measured.0).map(squares);
    for (all, more) in problem.removed.iter_mut().zip(removed) {
        *all += more;
    }
    found
}

/// Residual of base parameters and friction, `[channel][sample]`, with all channels weighted equally.
fn base_residual(problem: &DiagnosisProblem) -> Vec<Vec<f64>> {
    // Fit base and friction to all samples, except those that decide nothing.
    let mut pool = ColumnPool::new(&problem.layout).exclude_samples(&problem.undecided_samples());
    let columns = problem.base.iter().chain(&problem.friction);
    let mut which: Vec<usize> = columns.map(|c| pool.add(c)).collect();
    let measured = pool.add(&problem.measured);
    let size = |values: &Option<Vec<f64>>| values.as_ref().map_or(0.0, |v| dot(v, v) / v.len().max(1) as f64);
    // First weights from the size of the forces.
    let weight = |values: &Option<Vec<f64>>| 1.0 / size(values).max(f64::MIN_POSITIVE);
    let mut weights: Vec<f64> = problem.measured.0.iter().map(weight).collect();
    which.push(measured);
    let mut rest = Vec::new();
    // Two passes: the second uses weights from the residual of the first.
    for _ in 0..2 {
        let (factors, _) = solve_gram(&pool.gram(&which, &weights, FitScope::All));
        rest = pool.residual(measured, &which[..which.len() - 1], factors.as_slice());
        for (weight, rest) in weights.iter_mut().zip(&rest) {
            // The median of the squares is not affected by outliers.
            let middle = median(rest.iter().map(|r| r * r).collect());
            *weight = 1.0 / middle.max(f64::MIN_POSITIVE);
        }
    }
    rest
}

/// Replaces outliers by the median of their neighbours and reports their share and rms size per channel.
fn remove_outliers(problem: &mut DiagnosisProblem) -> Vec<Disturbance> {
    let mut flagged: Vec<Vec<bool>> = vec![vec![false; problem.layout.samples()]; problem.layout.channels.len()];
    // Distances of the outliers of each channel, for the report.
    let mut sizes: Vec<Vec<f64>> = vec![Vec::new(); flagged.len()];
    // Large outliers hide smaller ones, so the search is repeated.
    for _ in 0..3 {
        let rest = base_residual(problem);
        let mut more = false;
        for (d, rest) in rest.iter().enumerate() {
            let reverses = reversal_samples(problem, d, REVERSAL_OUTLIER_SAMPLES);
            // Distance from the local median, compared with the noise of the channel.
            let apart = deviation_from_neighbours(problem, rest);
            // 1.4826 times the median of absolute values is the standard deviation of normal noise.
            let spread = 1.4826 * median(apart.iter().map(|x| x.abs()).collect());
            let force = problem.measured_force(d);
            let size = (dot(&force, &force) / force.len().max(1) as f64).sqrt();
            let bound = (FORCE_OUTLIER_DEVIATIONS * spread.max(problem.noise[d])).max(OUTLIER_LEAST_FORCE_SHARE * size);
            let mut candidates: Vec<bool> = (0..rest.len())
                .map(|i| apart[i].abs() > bound && !reverses[i])
                .collect();
            // Frequent large distances belong to the force, for example stick-slip or a ripple.
            let count = candidates.iter().filter(|is_far| **is_far).count();
            let is_rare = (count as f64) < OUTLIERS_MOST_SHARE * rest.len() as f64;
            leave_out_smooth_peaks(problem, rest, &apart, &mut candidates);
            let new: Vec<usize> = (0..rest.len()).filter(|i| candidates[*i]).collect();
            let Some(values) = problem.measured.0[d].as_mut().filter(|_| is_rare) else {
                continue;
            };
            for i in new {
                // Move the sample to the median of its neighbours.
                values[i] -= apart[i];
                sizes[d].push(apart[i]);
                flagged[d][i] = true;
                more = true;
            }
        }
        if !more {
            break;
        }
    }
    let channels = flagged.iter().zip(&sizes).enumerate();
    // Report channels with outliers.
    let outlying = channels.filter(|(_, (_, sizes))| !sizes.is_empty());
    outlying
        .map(|(d, (flagged, sizes))| {
            let count = flagged.iter().filter(|f| **f).count() as f64;
            let size = (sizes.iter().map(|x| x * x).sum::<f64>() / sizes.len() as f64).sqrt();
            Disturbance {
                kind: "outliers".to_owned(),
                at: vec![problem.layout.channels[d].clone()],
                estimates: vec![
                    EstimatedQuantity::new("share", count / flagged.len().max(1) as f64, "1"),
                    EstimatedQuantity::new("size", size, ""),
                ],
                recordings: Vec::new(),
                interval: None,
                description: None,
            }
        })
        .collect()
}

/// Whether each sample is within some samples of a reversal of the channel's drive, where friction jumps.
fn reversal_samples(problem: &DiagnosisProblem, channel: usize, samples: usize) -> Vec<bool> {
    let n = problem.layout.samples();
    let mut about = vec![false; n];
    // The second friction column of a drive is the sign of its rate.
    let sign = problem.friction.get(3 * channel + 1);
    let Some(sign) = sign.and_then(|column| column.0[channel].as_ref()) else {
        return about;
    };
    // The sign of the rate changes or is zero between two samples.
    for i in 1..n {
        if sign[i] * sign[i - 1] <= 0.0 {
            let end = (i + samples).min(n);
            about[i.saturating_sub(samples)..end].fill(true);
        }
    }
    about
}

/// Distance of each sample from the median of its neighbours within the segment.
fn deviation_from_neighbours(problem: &DiagnosisProblem, rest: &[f64]) -> Vec<f64> {
    let mut apart = Vec::with_capacity(rest.len());
    let mut start = 0;
    for segment in &problem.layout.segments {
        let part = &rest[start..start + segment.samples];
        apart.extend((0..part.len()).map(|i| deviation_in_window(part, i)));
        start += segment.samples;
    }
    apart
}

/// Leaves out candidates for outliers that are peaks of a smooth residual: where there is no noise, these are far from
/// the median of their neighbours, but close to the cubic polynomial through two samples before and two after them.
///
/// `apart` holds the distances from the median. Candidates without such samples stay.
fn leave_out_smooth_peaks(problem: &DiagnosisProblem, rest: &[f64], apart: &[f64], candidates: &mut [bool]) {
    let mut start = 0;
    for segment in &problem.layout.segments {
        let end = start + segment.samples;
        let mut first = start;
        while first < end {
            // The samples from `first` up to `last` are candidates; `last` is none.
            let last = (first..end).find(|i| !candidates[*i]).unwrap_or(end);
            let peak = first..last;
            let is_inside = first >= start + 2 && last + 1 < end && !candidates[last + 1];
            if !peak.is_empty() && is_inside {
                let support = [first - 2, first - 1, last, last + 1];
                let largest =
                    |distance: &dyn Fn(usize) -> f64| peak.clone().map(|i| distance(i).abs()).fold(0.0, f64::max);
                let from_median = largest(&|i| apart[i]);
                let from_polynomial = largest(&|i| rest[i] - interpolate(&support, rest, i));
                if from_polynomial < OUTLIER_LEAST_STEP * from_median {
                    candidates[peak].fill(false);
                }
            }
            first = last + 1;
        }
        start = end;
    }
}

/// Value at sample `i` of the polynomial through the samples `support` of `values`, by Lagrange's formula.
fn interpolate(support: &[usize], values: &[f64], i: usize) -> f64 {
    let weight = |j: usize| {
        let others = support.iter().filter(|k| **k != j);
        others
            .map(|k| (i as f64 - *k as f64) / (j as f64 - *k as f64))
            .product::<f64>()
    };
    support.iter().map(|j| values[*j] * weight(*j)).sum()
}

/// Distance of a sample from the median of its neighbours.
///
/// At the ends of a segment the neighbours lie on one side, and the slope of a smooth residual would be taken for an
/// outlier where there is no noise. There the sample is compared with the line of the median slope as well, and the
/// smaller distance counts.
fn deviation_in_window(part: &[f64], i: usize) -> f64 {
    let low = i.saturating_sub(NEIGHBOURS / 2);
    let high = (low + NEIGHBOURS).min(part.len());
    let window = &part[low..high];
    let from_median = part[i] - median(window.to_vec());
    if 2 * i + 1 == low + high || window.len() < 3 {
        return from_median;
    }
    let slope = median(window.windows(2).map(|pair| pair[1] - pair[0]).collect());
    // The neighbours moved along the slope to this sample.
    let moved = (low..high).zip(window).map(|(j, x)| x - slope * (j as f64 - i as f64));
    let from_line = part[i] - median(moved.collect());
    if from_median * from_line <= 0.0 {
        0.0
    } else if from_line.abs() < from_median.abs() {
        from_line
    } else {
        from_median
    }
}

/// Step of a quantised force signal, in its unit: the common divisor of its values, if it is coarser than the noise.
/// `None` otherwise.
pub fn quantisation_step(values: &[f64], noise: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    // Values that differ by rounding only are equal.
    let largest = sorted.first()?.abs().max(sorted.last()?.abs());
    sorted.dedup_by(|a, b| (*a - *b).abs() <= 1e-9 * largest);
    // Quantised values repeat; many different values mean a fine resolution.
    if sorted.len() < QUANTISED_FEWEST_VALUES || QUANTISED_FEWEST_REPEATS * sorted.len() > values.len() {
        return None;
    }
    let gaps = sorted.windows(2).map(|pair| pair[1] - pair[0]);
    // The smallest difference is the step, if all others are multiples of it.
    let step = gaps.fold(f64::INFINITY, f64::min);
    let is_multiple = |gap: f64| (gap / step - (gap / step).round()).abs() < QUANTISED_MOST_OFF_STEP;
    let all = sorted.windows(2).all(|pair| is_multiple(pair[1] - pair[0]));
    // A quantisation step q adds an error of standard deviation q / sqrt(12).
    (all && step / 12.0_f64.sqrt() > QUANTISED_LEAST_NOISE_PART * noise).then_some(step)
}

impl DiagnosisProblem {
    /// Finds the samples next to a reversal of their drive, unless these are many: friction jumps there, and no
    /// derivative of positions shows on which side of the jump a sample lies.
    pub(crate) fn find_reversal_samples(&mut self) {
        let of = |d: usize| {
            let jumps = reversal_samples(self, d, REVERSAL_UNDECIDED_SAMPLES);
            // Leave out reversals only if few samples are lost.
            let count = jumps.iter().filter(|jumps| **jumps).count() as f64;
            if count < REVERSALS_MOST_SHARE * jumps.len() as f64 {
                jumps
            } else {
                Vec::new()
            }
        };
        self.jumps = (0..self.layout.channels.len()).map(of).collect();
    }

    /// Leaves out the samples at which a drive stands still for some time: dry friction takes any value there, so that the
    /// force is unknown up to twice the friction. A channel that mostly stands keeps all of its samples.
    pub(crate) fn leave_out_standstill(&mut self) {
        let channels = self.layout.channels.len();
        let samples = self.layout.samples();
        for d in 0..channels {
            let stands = super::in_time::standstill_samples(self, d);
            if stands.len() < samples {
                continue;
            }
            let mut long = vec![false; samples];
            let mut start = 0;
            for segment in &self.layout.segments {
                let end = start + segment.samples;
                let mut first = start;
                for i in start..=end {
                    if i < end && stands[i] {
                        continue;
                    }
                    // The samples from `first` on stand still up to here.
                    if (i - first) as f64 * segment.step > STANDSTILL_SHORTEST_S {
                        long[first..i].fill(true);
                    }
                    first = i + 1;
                }
                start = end;
            }
            let count = long.iter().filter(|long| **long).count();
            if count == 0 || count as f64 > STANDSTILL_MOST_SHARE * samples as f64 {
                continue;
            }
            self.left_out.resize(channels, vec![false; samples]);
            for (out, long) in self.left_out[d].iter_mut().zip(&long) {
                *out |= *long;
            }
        }
    }

    /// Samples that decide nothing, `[channel][sample]`: those left out and those next to reversals.
    pub(crate) fn undecided_samples(&self) -> Vec<Vec<bool>> {
        let of = |d: usize| {
            let out = |all: &[Vec<bool>], i: usize| all.get(d).and_then(|out| out.get(i)).copied().unwrap_or(false);
            let samples = 0..self.layout.samples();
            samples.map(|i| out(&self.left_out, i) || out(&self.jumps, i)).collect()
        };
        (0..self.layout.channels.len()).map(of).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::diagnose::column::ForceColumn;
    use crate::diagnose::problem::{SampleLayout, SampleSegment};
    use crate::test_noise::TestNoise;

    fn problem(seed: u64, more: impl Fn(usize, &mut TestNoise) -> f64) -> DiagnosisProblem {
        let mut noise = TestNoise::new(seed);
        let n = 2000;
        let base: Vec<f64> = (0..n).map(|i| (0.02 * f64::from(i)).sin()).collect();
        let measured: Vec<f64> = base
            .iter()
            .enumerate()
            .map(|(i, b)| 50.0 * b + noise.normal() + more(i, &mut noise))
            .collect();
        DiagnosisProblem {
            layout: SampleLayout {
                channels: vec!["a".into()],
                segments: vec![SampleSegment {
                    name: "run".into(),
                    samples: base.len(),
                    start: 0.0,
                    step: 0.004,
                    recorded_step: 0.004,
                    is_check: false,
                }],
                left_out: Vec::new(),
            },
            measured: ForceColumn(vec![Some(measured)]),
            base: vec![ForceColumn(vec![Some(base)])],
            noise: vec![1.0],
            removed: vec![0.0],
            ..DiagnosisProblem::default()
        }
    }

    #[test]
    fn noise_has_neither_outliers_nor_lines() {
        for seed in 0..40 {
            assert_eq!(clean_forces(&mut problem(seed, |_, _| 0.0)), [], "seed {seed}");
        }
    }

    /// A model error without noise has a slope at the ends of the recording, which is no outlier; a peak there is one.
    #[test]
    fn slopes_at_the_ends_are_no_outliers() {
        for peak in [0.0, 90.0] {
            for phase in 0..12 {
                let mut problem = problem(1, |_, _| 0.0);
                let smooth = |i: usize| 40.0 * (0.004 * i as f64 + 0.5 * f64::from(phase)).sin();
                let with_peak = |i: usize| smooth(i) + if i == 1 { peak } else { 0.0 };
                let n = problem.layout.samples();
                problem.measured = ForceColumn(vec![Some((0..n).map(with_peak).collect())]);
                problem.noise = vec![0.0];
                let found = clean_forces(&mut problem);
                let outliers: Vec<&Disturbance> = found.iter().filter(|one| one.kind == "outliers").collect();
                let expected = usize::from(peak > 0.0);
                assert_eq!(outliers.len(), expected, "phase {phase}: {outliers:?}");
                if let Some(found) = outliers.first() {
                    let count = found.estimates[0].value * n as f64;
                    // Neighbours of a peak may count, since there is no noise to compare them with.
                    assert!((0.5..3.5).contains(&count), "phase {phase}: {count}");
                }
            }
        }
    }

    /// A model error without noise has sharp peaks, which are no outliers. One to three samples that jump are outliers.
    #[test]
    fn smooth_peaks_are_no_outliers() {
        for width in [10.0, 15.0, 30.0] {
            for wild in 0..4 {
                let mut problem = problem(1, |_, _| 0.0);
                let smooth = |i: usize| {
                    let from_peak = (i % 160) as f64 - 80.0;
                    40.0 * (-(from_peak / width).powi(2)).exp() + 4.0 * (0.004 * i as f64).sin()
                };
                let n = problem.layout.samples();
                let measured = |i: usize| smooth(i) + if (n / 2..n / 2 + wild).contains(&i) { 30.0 } else { 0.0 };
                problem.measured = ForceColumn(vec![Some((0..n).map(measured).collect())]);
                problem.noise = vec![0.0];
                let found = clean_forces(&mut problem);
                let outliers: Vec<&Disturbance> = found.iter().filter(|one| one.kind == "outliers").collect();
                assert_eq!(
                    outliers.len(),
                    usize::from(wild > 0),
                    "width {width}, {wild} outliers: {outliers:?}"
                );
                // The outliers are removed.
                let cleaned = problem.measured_force(0);
                for i in n / 2..n / 2 + wild {
                    let left = cleaned[i] - smooth(i);
                    assert!(left.abs() < 3.0, "width {width}, {wild} outliers: {left}");
                }
            }
        }
    }

    #[test]
    fn outliers_and_hum_are_taken_off() {
        for seed in 0..10 {
            let hum = |i: usize| 3.0 * (TAU * 50.02 * 0.004 * i as f64 + 0.4).sin();
            let wild = |i: usize| if i % 211 == 17 { 90.0 } else { 0.0 };
            let mut problem = problem(seed, |i, _| hum(i) + wild(i));
            let found = clean_forces(&mut problem);
            let kinds: Vec<&str> = found.iter().map(|one| one.kind.as_str()).collect();
            assert_eq!(kinds, ["outliers", "periodic_in_time"], "seed {seed}");
            let values = &found[1].estimates;
            assert!((values[0].value - 3.0).abs() < 0.2, "{values:?}");
            assert!((values[1].value - 50.02).abs() < 0.02, "{values:?}");
            let rest = base_residual(&problem);
            let left = dot(&rest[0], &rest[0]) / rest[0].len() as f64;
            assert!((0.85..1.15).contains(&left), "{left}");
        }
    }

    #[test]
    fn steps_of_a_reading_are_seen() {
        let mut noise = TestNoise::new(5);
        let force: Vec<f64> = (0..3000)
            .map(|i| 300.0 * (0.01 * f64::from(i)).sin() + noise.normal())
            .collect();
        let coarse: Vec<f64> = force.iter().map(|f| 20.0 * (f / 20.0).round()).collect();
        assert_eq!(quantisation_step(&coarse, 1.0), Some(20.0));
        assert_eq!(quantisation_step(&force, 1.0), None);
        let fine: Vec<f64> = force.iter().map(|f| 0.1 * (f / 0.1).round()).collect();
        assert_eq!(quantisation_step(&fine, 1.0), None);
    }
}
