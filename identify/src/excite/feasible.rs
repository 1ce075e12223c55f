//! Shrinks a trajectory until it is within its limits at all times. Input: a trajectory; output: the same trajectory,
//! as little smaller as possible, and its margins.
//!
//! Decision: angles, rates and accelerations are trigonometric polynomials. Their extremes are bounded by interval
//! halving with a bound of the second derivative, so that these limits are kept at all times. Forces, points and
//! singular values have no such bound; they are checked on a grid sixteen times finer than the search's, with a margin
//! from parabolas through neighbours added twice.

use super::measure::{TrajectoryEvaluator, excess};
use super::{ExcitationLimits, ExcitationMotion, FourierSeries, LimitMargin};

/// Number of samples at which limits of the plant are checked, per sample of the search.
const LIMIT_CHECK_REFINEMENT: usize = 16;
/// Distance from limits as a share of half the range, which is above all rounding.
const LIMIT_CLEARANCE: f64 = 1e-7;

/// Largest factor by which a series may grow around its mean before rate or acceleration reach their limits; infinite
/// without such limits.
pub(super) fn max_scale_factor(limits: &ExcitationLimits, series: &FourierSeries) -> f64 {
    let mut factor = f64::INFINITY;
    for (derivative, range) in [(1, limits.rate), (2, limits.acceleration)] {
        let Some(range) = range else { continue };
        let [least, greatest] = series.extremes(derivative);
        let space = 1.0 - LIMIT_CLEARANCE;
        if greatest > 0.0 {
            factor = factor.min(space * range[1] / greatest);
        }
        if least < 0.0 {
            factor = factor.min(space * range[0] / least);
        }
    }
    factor
}

/// Shrinks each series to the limits of its coordinate, and all together to those of the plant. Returns the value of
/// the criterion and the series; `None` if no useful trajectory remains.
pub(super) fn shrink_to_limits(
    measure: &TrajectoryEvaluator<'_>,
    series: &[FourierSeries],
) -> Option<(f64, Vec<FourierSeries>)> {
    let kept = shrink_to_coordinate_limits(measure, series, 1.0);
    // Filling the remaining distance to the limits usually improves the criterion.
    let filled = shrink_to_coordinate_limits(measure, series, f64::INFINITY);
    let all = [kept, filled].into_iter();
    let valued = all.filter_map(|one| shrink_to_plant_limits(measure, one));
    valued.min_by(|a, b| a.0.total_cmp(&b.0))
}

/// Shrinks or enlarges each series to the limits of its coordinate, by at most the factor `most`.
fn shrink_to_coordinate_limits(
    measure: &TrajectoryEvaluator<'_>,
    series: &[FourierSeries],
    most: f64,
) -> Vec<FourierSeries> {
    let pairs = series.iter().zip(measure.limits);
    pairs.map(|(one, limits)| fit_into_ranges(limits, one, most)).collect()
}

/// Shrinks all series by a common factor to the limits of the plant.
fn shrink_to_plant_limits(
    measure: &TrajectoryEvaluator<'_>,
    mut kept: Vec<FourierSeries>,
) -> Option<(f64, Vec<FourierSeries>)> {
    let fine = LIMIT_CHECK_REFINEMENT * super::samples_per_period(measure.options);
    let mut factor = 1.0_f64;
    for _ in 0..60 {
        let trial: Vec<FourierSeries> = kept.iter().map(|one| one.scale_amplitude(factor)).collect();
        match worst_plant_limit(measure, &trial, fine) {
            Some((_, excess)) if excess <= -LIMIT_CLEARANCE => {
                kept = trial;
                let value = measure.criterion_value(&measure.sample_motion(&kept));
                return value.is_finite().then_some((value, kept));
            }
            // The step depends on the excess, so that the motion is not reduced more than needed.
            Some((_, excess)) => {
                factor *= (1.0 - 0.5 * (excess + 2.0 * LIMIT_CLEARANCE)).clamp(0.8, 0.9999);
            }
            None => factor *= 0.9,
        }
    }
    None
}

/// A series shrunk and shifted into the limits of its coordinate, or enlarged to fill them, by at most the factor
/// `most`.
fn fit_into_ranges(limits: &ExcitationLimits, series: &FourierSeries, most: f64) -> FourierSeries {
    let [low, high] = limits.position;
    let space = LIMIT_CLEARANCE * (high - low);
    let (low, high) = (low + space, high - space);
    let [least, greatest] = series.extremes(0);
    let by_position = (high - low) / (greatest - least).max(f64::MIN_POSITIVE);
    let factor = max_scale_factor(limits, series).min(by_position).min(most);
    let mut kept = series.scale_amplitude(factor);
    let (below, above) = (factor * (series.offset - least), factor * (greatest - series.offset));
    // Shift the mean only as far as needed.
    kept.offset = series.offset.max(low + below).min(high - above);
    kept
}

/// Index and excess of the plant's limit that is exceeded most, between samples too. The index is `usize::MAX` and the
/// excess -1 if there are no limits; `None` if the mechanism cannot follow.
pub(super) fn worst_plant_limit(
    measure: &TrajectoryEvaluator<'_>,
    series: &[FourierSeries],
    samples: usize,
) -> Option<(usize, f64)> {
    let motion = ExcitationMotion::sample(series, samples);
    let all = measure.plant.excess(&motion)?;
    let peaks = all.iter().map(|values| largest_between_samples(values)).enumerate();
    Some(peaks.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((usize::MAX, -1.0)))
}

/// Upper estimate of a periodic function from its samples: the largest sample plus twice what a parabola through three
/// neighbours could add between them.
fn largest_between_samples(values: &[f64]) -> f64 {
    let n = values.len();
    let mut largest = f64::NEG_INFINITY;
    for i in 0..n {
        let (before, now, after) = (values[(i + n - 1) % n], values[i], values[(i + 1) % n]);
        // A parabola rises above its middle sample by at most an eighth of the second difference.
        let second = (before - 2.0 * now + after).abs();
        largest = largest.max(now + 0.25 * second);
    }
    largest
}

/// Margins of a trajectory to all of its limits.
pub(super) fn margins(measure: &TrajectoryEvaluator<'_>, series: &[FourierSeries]) -> Vec<LimitMargin> {
    let what = ["", "_d", "_dd"];
    let mut margins: Vec<LimitMargin> = measure
        .ranges()
        .into_iter()
        .map(|(i, derivative, range)| {
            let ends = series[i].extremes(derivative);
            LimitMargin {
                name: format!("{}{}", measure.limits[i].name, what[derivative]),
                excess: excess(ends[0], range).max(excess(ends[1], range)),
                proven: true,
            }
        })
        .collect();
    // Limits of the plant, on the fine grid.
    let fine = ExcitationMotion::sample(
        series,
        LIMIT_CHECK_REFINEMENT * super::samples_per_period(measure.options),
    );
    let all = measure.plant.excess(&fine);
    for (k, name) in measure.plant.limits().into_iter().enumerate() {
        margins.push(LimitMargin {
            name,
            excess: all
                .as_ref()
                .map_or(f64::INFINITY, |all| largest_between_samples(&all[k])),
            proven: false,
        });
    }
    margins
}
