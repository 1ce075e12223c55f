//! Detects the onset of a change: a series of daily values goes in, its most significant step or ramp comes out. A ramp
//! is needed for wear: it grows every day, so a search for constant levels would see only single deviating days.

use modelmill_identify::changes::UncertainValue;

/// The onset of a step or a ramp in a series.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ChangeOnset {
    /// Index of the first day that differs.
    pub(crate) day: usize,
    /// Growth per day of a ramp; `None` for a step.
    pub(crate) per_day: Option<f64>,
    /// Reduction of the weighted sum of squares, in units of the variance between days.
    pub(crate) gain: f64,
}

/// Smallest number of days before a change and since.
pub(crate) const MINIMUM_DAYS: usize = 2;
/// Additional gain that a ramp needs to be preferred to a step.
const RAMP_PREFERENCE: f64 = 9.0;
/// Smallest gain of a change: the square of six standard deviations.
const MINIMUM_GAIN: f64 = 36.0;
/// The median of the square of a standard normal variable.
const MEDIAN_OF_SQUARE: f64 = 0.4549;

/// The most significant onset of a series, if there is one. Standard deviations are enlarged if the days scatter more
/// than these. The scatter is estimated from second differences, on which a step or a ramp has an effect on two days at
/// most.
pub(crate) fn clearest_onset(values: &[Option<UncertainValue>]) -> Option<ChangeOnset> {
    let known: Vec<(usize, UncertainValue)> = (values.iter().enumerate())
        .filter_map(|(k, one)| Some((k, (*one)?)))
        .filter(|(_, (x, d))| x.is_finite() && *d > 0.0)
        .collect();
    if known.len() < 2 * MINIMUM_DAYS {
        return None;
    }
    let second = |three: &[(usize, UncertainValue)]| {
        let [(a, (x, dx)), (b, (y, dy)), (c, (z, dz))] = [three[0], three[1], three[2]];
        // The middle of three days is compared with the line through the others; days may be missing in between.
        let part = (b - a) as f64 / (c - a) as f64;
        let off = y - x - part * (z - x);
        off * off / (dy * dy + ((1.0 - part) * dx).powi(2) + (part * dz).powi(2))
    };
    let mut squares: Vec<f64> = known.windows(3).map(second).collect();
    squares.sort_by(f64::total_cmp);
    let scatter = (squares[squares.len() / 2] / MEDIAN_OF_SQUARE).max(1.0);
    // Reference: a constant level over all days.
    let (flat, _) = fit(&known, |_| 0.0)?;
    let mut best: Option<(f64, ChangeOnset)> = None;
    // Try a step and a ramp from every day on.
    for at in MINIMUM_DAYS..=known.len() - MINIMUM_DAYS {
        let day = known[at].0;
        let step = fit(&known, |k| f64::from(u8::from(k >= day)));
        let ramp = fit(&known, |k| if k >= day { (k - day + 1) as f64 } else { 0.0 });
        let tried = [(step, false, 0.0), (ramp, true, RAMP_PREFERENCE)];
        for (found, is_ramp, price) in tried {
            let Some((left, slope)) = found else { continue };
            let gain = (flat - left) / scatter - price;
            if best.is_none_or(|(most, _)| gain > most) {
                let per_day = is_ramp.then_some(slope);
                best = Some((gain, ChangeOnset { day, per_day, gain }));
            }
        }
    }
    best.map(|(_, onset)| onset).filter(|onset| onset.gain > MINIMUM_GAIN)
}

/// Weighted least squares fit of a level and a multiple of `shape`. Returns the weighted sum of squared residuals, and
/// the multiple.
fn fit(known: &[(usize, UncertainValue)], shape: impl Fn(usize) -> f64) -> Option<(f64, f64)> {
    let origin = known.first()?.1.0;
    let [mut w, mut s, mut ss, mut x, mut sx] = [0.0; 5];
    for (k, (value, deviation)) in known {
        let (weight, z, value) = (deviation.powi(-2), shape(*k), value - origin);
        w += weight;
        s += weight * z;
        ss += weight * z * z;
        x += weight * value;
        sx += weight * z * value;
    }
    let determinant = w * ss - s * s;
    let slope = if determinant > 1e-12 * w * ss {
        (w * sx - s * x) / determinant
    } else {
        0.0
    };
    let level = (x - slope * s) / w;
    let left = known
        .iter()
        .map(|(k, (value, deviation))| ((value - origin - level - slope * shape(*k)) / deviation).powi(2));
    Some((left.sum(), slope))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(shape: &dyn Fn(usize) -> f64) -> Vec<Option<UncertainValue>> {
        let noise = [0.3, -0.5, 0.1, 0.6, -0.2, -0.4, 0.5, 0.0, -0.3, 0.2];
        (0..10)
            .map(|k| (k != 2).then(|| (100.0 + shape(k) + noise[k], 1.0)))
            .collect()
    }

    #[test]
    fn steps_and_ramps_are_told_apart_with_their_day() {
        // So steep that no two days are alike.
        for slope in [8.0, 300.0] {
            let found = clearest_onset(&series(&|k| slope * (k as f64 - 3.0).max(0.0))).expect("an onset");
            assert_eq!(found.day, 4);
            assert!((found.per_day.expect("a ramp") - slope).abs() < 0.3, "{found:?}");
        }
        let found = clearest_onset(&series(&|k| if k >= 6 { 12.0 } else { 0.0 })).expect("an onset");
        assert_eq!((found.day, found.per_day), (6, None));
    }

    /// Neither noise, nor scatter beyond the deviations, nor a single day is an onset.
    #[test]
    fn nothing_is_found_where_nothing_stays() {
        assert_eq!(clearest_onset(&series(&|_| 0.0)), None);
        let mut scattered = series(&|k| [9.0, -7.0, 3.0, 8.0, -9.0, 4.0, -6.0, 7.0, -3.0, 5.0][k]);
        assert_eq!(clearest_onset(&scattered), None);
        scattered.truncate(3);
        assert_eq!(clearest_onset(&scattered), None);
        assert_eq!(clearest_onset(&[]), None);
    }
}
