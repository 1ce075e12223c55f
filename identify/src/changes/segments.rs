//! Change points: where a series of uncertain values changed and stayed changed. Input: values with standard
//! deviations; output: indices.

use crate::changes::thresholds::{LONE_VALUE_DEVIATIONS, SEGMENT_FEWEST_VALUES, SEGMENT_PRICE};
use crate::signal::median;

/// The median of the square of a number from the normal distribution.
const MEDIAN_OF_SQUARE: f64 = 0.4549;

/// A value with its standard deviation.
pub type UncertainValue = (f64, f64);

/// First index of each segment except the first, by optimal partitioning (Jackson et al., IEEE Signal Processing
/// Letters 12, 2005): the values of a segment have one mean, and each segment has a price. `among` is the number of
/// series that are tested together, which raises the price so that false changes stay rare. Unknown values are ignored.
/// If neighbours scatter more than their standard deviations, these are increased.
pub fn change_points(values: &[Option<UncertainValue>], among: usize) -> Vec<usize> {
    let known: Vec<(usize, UncertainValue)> = (values.iter().enumerate())
        .filter_map(|(at, one)| Some((at, (*one)?)))
        .filter(|(_, (x, deviation))| x.is_finite() && *deviation > 0.0)
        .collect();
    let n = known.len();
    if n < 2 * SEGMENT_FEWEST_VALUES {
        return Vec::new();
    }
    // Squared difference of neighbours, relative to its variance.
    let square = |pair: &[(usize, UncertainValue)]| {
        let [(_, (a, da)), (_, (b, db))] = [pair[0], pair[1]];
        (a - b).powi(2) / (da * da + db * db)
    };
    let scatter = median(known.windows(2).map(square).collect()) / MEDIAN_OF_SQUARE;
    let scatter = scatter.max(1.0);
    let known = drop_outliers(&known, LONE_VALUE_DEVIATIONS * scatter.sqrt());
    let n = known.len();
    if n < 2 * SEGMENT_FEWEST_VALUES {
        return Vec::new();
    }
    // Values minus the first one, so that sums keep their digits.
    let origin = known[0].1.0;
    let mut sums = vec![[0.0; 3]];
    for (k, (_, (x, deviation))) in known.iter().enumerate() {
        let (x, w) = (x - origin, deviation.powi(-2) / scatter);
        let [a, b, c] = sums[k];
        sums.push([a + w, b + w * x, c + w * x * x]);
    }
    // Squared residual of a segment around its mean, from cumulative sums.
    let left = |from: usize, to: usize| {
        let [w, wx, wxx] = std::array::from_fn(|i| sums[to][i] - sums[from][i]);
        (wxx - wx * wx / w).max(0.0)
    };
    let price = SEGMENT_PRICE * ((n * among.max(1)) as f64).ln();
    // Least cost of the values up to each one, and the start of the last segment.
    let mut best: Vec<(f64, usize)> = vec![(-price, 0)];
    for end in 1..=n {
        let starts = (0..end).filter(|start| end - start >= SEGMENT_FEWEST_VALUES && best[*start].0.is_finite());
        let cost = |start: usize| (best[start].0 + left(start, end) + price, start);
        let least = starts.map(cost).min_by(|a, b| a.0.total_cmp(&b.0));
        best.push(least.unwrap_or((f64::INFINITY, 0)));
    }
    let mut found = Vec::new();
    let mut end = n;
    // Trace the segments back from the end.
    while best[end].1 > 0 {
        end = best[end].1;
        found.push(known[end].0);
    }
    found.reverse();
    found
}

/// Values without those that differ by `apart` standard deviations from both neighbours.
fn drop_outliers(known: &[(usize, UncertainValue)], apart: f64) -> Vec<(usize, UncertainValue)> {
    let is_near = |a: usize, b: usize| {
        let ((_, (a, da)), (_, (b, db))) = (known[a], known[b]);
        (a - b).abs() < apart * da.hypot(db)
    };
    let last = known.len() - 1;
    (0..=last)
        .filter(|k| (*k > 0 && is_near(*k, k - 1)) || (*k < last && is_near(*k, k + 1)))
        .map(|k| known[k])
        .collect()
}

/// Mean of some values weighted by their variances, with its standard deviation; `None` if none is known.
pub fn weighted_mean(values: &[Option<UncertainValue>]) -> Option<UncertainValue> {
    let known = values.iter().flatten().filter(|(_, d)| *d > 0.0);
    let [w, wx] = known.fold([0.0; 2], |[w, wx], (x, d)| [w + d.powi(-2), wx + x * d.powi(-2)]);
    (w > 0.0).then(|| (wx / w, w.sqrt().recip()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_noise::TestNoise;

    fn series(seed: u64, steps: &[(usize, f64)], scatter: f64) -> Vec<Option<UncertainValue>> {
        let mut noise = TestNoise::new(seed);
        let value = |k: usize| {
            let level: f64 = steps.iter().filter(|s| k >= s.0).map(|s| s.1).sum();
            Some((1e6 + level + scatter * noise.normal(), 1.0))
        };
        (0..60).map(value).collect()
    }

    #[test]
    fn a_change_that_stays_is_found_where_it_is() {
        for seed in 0..50 {
            let mut values = series(seed, &[(20, 6.0), (41, -7.0)], 1.0);
            values[33] = None;
            let found = change_points(&values, 30);
            let is_near = |(a, b): (&usize, usize)| a.abs_diff(b) <= 1;
            assert!(
                found.len() == 2 && found.iter().zip([20, 41]).all(is_near),
                "{seed}: {found:?}"
            );
            let (before, deviation) = weighted_mean(&values[..20]).expect("a mean");
            assert!((before - 1e6).abs() < 5.0 * deviation && (deviation - 0.05_f64.sqrt()).abs() < 1e-12);
        }
    }

    /// Neither chance, nor standard deviations that are too small, nor a single value make a change.
    #[test]
    fn nothing_is_found_where_nothing_stays_changed() {
        let found = (0..200).filter(|seed| !change_points(&series(*seed, &[], 1.0), 30).is_empty());
        assert_eq!(found.count(), 0);
        let found = (0..200).filter(|seed| !change_points(&series(*seed, &[], 5.0), 30).is_empty());
        assert!(found.count() <= 4);
        assert!(change_points(&series(1, &[(20, 30.0), (21, -30.0)], 1.0), 30).is_empty());
        assert!(change_points(&[None, Some((1.0, 0.1))], 1).is_empty());
    }
}
