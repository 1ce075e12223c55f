//! The largest force of an event: the peak of its residual. Noise raises the largest sample, and an average over the time
//! of a short hit lowers its peak, so that a parabola is fitted about each sample.

use modelmill_identify::float_to_count;

use super::levels::SearchedResidual;
use super::segments::DriveSegment;
use super::smoothing::range_median;

/// Half of the time over which a parabola is fitted, s.
const PARABOLA_HALF_S: f64 = 0.02;
/// Time before a push at standstill that is not used, s: its first step.
const STEP_RISE_S: f64 = 0.03;
/// Time before that over which the level of the force is taken, s.
const LEVEL_S: f64 = 0.1;

/// The largest force of a drive in a segment, N or N m. `step` is the time between samples, s.
pub(super) fn largest_force(rest: &SearchedResidual, segment: &DriveSegment, step: f64) -> f64 {
    let count = |seconds: f64, fewest: usize| float_to_count(seconds / step + 1e-6).max(fewest);
    let half = count(PARABOLA_HALF_S, 1);
    let sign = segment.force.signum();
    // At standstill dry friction gives the residual any level.
    let level = if segment.is_at_standstill {
        let signed = |at: usize| isize::try_from(at).unwrap_or(isize::MAX);
        let before = signed(segment.start) - signed(count(STEP_RISE_S, 1));
        range_median(&rest.values, before - signed(count(LEVEL_S, 2)), before).unwrap_or(0.0)
    } else {
        0.0
    };
    let shown = (segment.start..segment.end).filter(|i| segment.is_at_standstill || !rest.is_masked[*i]);
    let (mut fitted, mut measured) = (0.0_f64, 0.0_f64);
    for i in shown {
        fitted = fitted.max(sign * (parabola_at(&rest.values, i, half) - level));
        measured = measured.max(sign * (rest.values[i] - level));
    }
    // A parabola exceeds a force that begins at once.
    fitted.min(measured)
}

/// The value at a sample of the parabola that is fitted to it and `half` neighbours on either side (Savitzky and Golay,
/// 1964); the sample itself at the ends.
fn parabola_at(values: &[f64], at: usize, half: usize) -> f64 {
    if at < half || at + half >= values.len() {
        return values[at];
    }
    let m = half as f64;
    let scale = 3.0 / ((2.0 * m - 1.0) * (2.0 * m + 1.0) * (2.0 * m + 3.0));
    let terms = values[at - half..=at + half].iter().enumerate().map(|(k, value)| {
        let x = k as f64 - m;
        (3.0 * m * (m + 1.0) - 1.0 - 5.0 * x * x) * value
    });
    scale * terms.sum::<f64>()
}
