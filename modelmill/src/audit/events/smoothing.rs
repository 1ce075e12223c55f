//! Smoothing and masks of sampled signals, as the search for events needs them.

use modelmill_identify::float_to_count;

use std::ops::Range;

/// The ranges in which a mask is true, in order.
pub(super) fn true_ranges(mask: &[bool]) -> Vec<Range<usize>> {
    let mut ranges: Vec<Range<usize>> = Vec::new();
    for (i, _) in mask.iter().enumerate().filter(|(_, is_true)| **is_true) {
        match ranges.last_mut() {
            Some(last) if last.end == i => last.end = i + 1,
            _ => ranges.push(Range { start: i, end: i + 1 }),
        }
    }
    ranges
}

/// The mask, widened by `reach` samples to either side.
pub(super) fn dilate_mask(mask: &[bool], reach: usize) -> Vec<bool> {
    let mut wide = vec![false; mask.len()];
    for range in true_ranges(mask) {
        let end = (range.end + reach).min(mask.len());
        wide[range.start.saturating_sub(reach)..end].fill(true);
    }
    wide
}

/// The share of a mask that is true; 0 for an empty mask.
pub(super) fn true_share(mask: &[bool]) -> f64 {
    mask.iter().filter(|is_true| **is_true).count() as f64 / mask.len().max(1) as f64
}

/// The median over `width` neighbouring samples; fewer at the ends.
pub(super) fn running_median(values: &[f64], width: usize) -> Vec<f64> {
    let half = width / 2;
    let window = |i: usize| i.saturating_sub(half)..(i + half + 1).min(values.len());
    (0..values.len())
        .map(|i| sample_quantile(values[window(i)].to_vec(), 0.5))
        .collect()
}

/// The median over those of `width` neighbouring samples that are not masked; zero if most of them are. It is computed
/// at some samples only, since it changes slowly.
pub(super) fn shown_median(values: &[f64], is_masked: &[bool], width: usize) -> Vec<f64> {
    let (half, stride) = (width / 2, (width / 12).max(1));
    let at = |i: usize| {
        let window = i.saturating_sub(half)..(i + half + 1).min(values.len());
        let shown: Vec<f64> = window.filter(|k| !is_masked[*k]).map(|k| values[k]).collect();
        if 2 * shown.len() > half {
            sample_quantile(shown, 0.5)
        } else {
            0.0
        }
    };
    let coarse: Vec<f64> = (0..values.len()).step_by(stride).map(at).collect();
    (0..values.len())
        .map(|i| coarse[((i + stride / 2) / stride).min(coarse.len() - 1)])
        .collect()
}

/// The mean over `width` neighbouring samples; fewer at the ends.
pub(super) fn running_mean(values: &[f64], width: usize) -> Vec<f64> {
    let half = width / 2;
    let mut sums = vec![0.0];
    sums.extend(values.iter().scan(0.0, |sum, value| {
        *sum += value;
        Some(*sum)
    }));
    let mean = |i: usize| {
        let (start, end) = (i.saturating_sub(half), (i + half + 1).min(values.len()));
        (sums[end] - sums[start]) / (end - start) as f64
    };
    (0..values.len()).map(mean).collect()
}

/// Central differences per sample; zero at the ends.
pub(super) fn differences_per_sample(values: &[f64]) -> Vec<f64> {
    let n = values.len();
    let difference = |i: usize| {
        if i == 0 || i + 1 == n {
            0.0
        } else {
            0.5 * (values[i + 1] - values[i - 1])
        }
    };
    (0..n).map(difference).collect()
}

/// The quantile of some values; 0 without values.
pub(super) fn sample_quantile(mut values: Vec<f64>, part: f64) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let at = float_to_count(part * (values.len() - 1) as f64);
    *values.select_nth_unstable_by(at, f64::total_cmp).1
}

/// The median of a range of a signal, which may reach beyond its ends; `None` if nothing of it is within.
pub(super) fn range_median(values: &[f64], from: isize, to: isize) -> Option<f64> {
    let clamp = |at: isize| usize::try_from(at).unwrap_or(0).min(values.len());
    let (from, to) = (clamp(from), clamp(to));
    (from < to).then(|| sample_quantile(values[from..to].to_vec(), 0.5))
}

/// Standard deviation of a normal distribution with the median magnitude of some values.
pub(super) fn median_deviation(values: impl Iterator<Item = f64>) -> f64 {
    1.4826 * sample_quantile(values.map(f64::abs).collect(), 0.5)
}
