//! Statistics of plain numbers.

/// Middle of some numbers; zero for none.
pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// A count that was computed as a float, rounded down; what is negative counts as none.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a float becomes the nearest count there is"
)]
pub(crate) fn count(value: f64) -> usize {
    value as usize
}
