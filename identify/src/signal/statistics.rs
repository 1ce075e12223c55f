//! Statistics of plain numbers.

/// Median of numbers, the upper one of two; zero for none.
pub fn median(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Standard deviation of the white noise in an otherwise smooth signal, from the median of its fourth differences.
/// Slow motion and a few jumps do not change it. If the noise was filtered the result is too low.
///
/// Source: the idea of J. von Neumann's mean square successive difference (Ann. Math. Stat. 12, 1941), with the
/// median absolute deviation to be robust against jumps.
pub fn white_noise(values: &[f64]) -> f64 {
    if values.len() < 10 {
        return 0.0;
    }
    let mut differences: Vec<f64> = values
        .windows(5)
        .map(|w| (w[0] - 4.0 * w[1] + 6.0 * w[2] - 4.0 * w[3] + w[4]).abs())
        .collect();
    differences.sort_by(f64::total_cmp);
    // The variance of such a difference is 70 times that of the noise. The median of its magnitude is 0.6745 of its
    // standard deviation.
    differences[differences.len() / 2] / (0.674_489_75 * 70.0_f64.sqrt())
}

/// A count that was computed as a float, rounded down; negative values give zero.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a float becomes the nearest count there is"
)]
pub fn float_to_count(value: f64) -> usize {
    value as usize
}
