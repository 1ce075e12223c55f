//! Statistics of plain numbers.

/// Middle of some numbers; zero for none.
pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// White noise of a signal that is smooth otherwise: the robust spread of its fourth differences, which neither slow motion
/// nor a few jumps change. An estimate from below where the noise was filtered.
///
/// Source: the idea of J. von Neumann's mean square successive difference (Ann. Math. Stat. 12, 1941), with the median
/// absolute deviation for jumps.
pub fn white_noise(values: &[f64]) -> f64 {
    if values.len() < 10 {
        return 0.0;
    }
    let mut differences: Vec<f64> = values
        .windows(5)
        .map(|w| (w[0] - 4.0 * w[1] + 6.0 * w[2] - 4.0 * w[3] + w[4]).abs())
        .collect();
    differences.sort_by(f64::total_cmp);
    // The variance of such a difference is 70 times that of the noise; the median of its magnitude 0.6745 of its spread.
    differences[differences.len() / 2] / (0.674_489_75 * 70.0_f64.sqrt())
}

/// A count that was computed as a float, rounded down; what is negative counts as none.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a float becomes the nearest count there is"
)]
pub(crate) fn float_to_count(value: f64) -> usize {
    value as usize
}
