//! When something began: a step or a ramp, on which day.

/// What the values of a series do from a day on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Onset {
    /// The first day on which something is different.
    pub(crate) day: usize,
    /// By how much the value grows each day; `None` for a step.
    pub(crate) per_day: Option<f64>,
}

/// A ramp must leave so much less than a step, in deviations squared, to be preferred.
const CLEARER: f64 = 9.0;

/// The onset near a day at which a change was found: of steps and ramps that begin at most `near` days away the one that leaves
/// the least. `values` are those from the change before until the next, or for a ramp the end; each with its deviation.
pub(crate) fn onset(values: &[Option<(f64, f64)>], found: usize, near: usize) -> Onset {
    let from = found.saturating_sub(near).max(1);
    let to = (found + near).min(values.len().saturating_sub(1));
    let mut best: Option<(f64, Onset)> = None;
    for day in from..=to {
        let step = fit(values, |k| f64::from(u8::from(k >= day)));
        let ramp = fit(values, |k| if k >= day { (k - day + 1) as f64 } else { 0.0 });
        let step = step.map(|(left, _)| (left, Onset { day, per_day: None }));
        let ramp = ramp.map(|(left, slope)| (left + CLEARER, Onset { day, per_day: Some(slope) }));
        for (left, onset) in step.into_iter().chain(ramp) {
            if best.is_none_or(|(least, _)| left < least) {
                best = Some((left, onset));
            }
        }
    }
    best.map_or(Onset { day: found, per_day: None }, |(_, onset)| onset)
}

/// What a level and a multiple of a shape leave of values, in deviations squared, and that multiple.
fn fit(values: &[Option<(f64, f64)>], shape: impl Fn(usize) -> f64) -> Option<(f64, f64)> {
    let origin = values.iter().flatten().next()?.0;
    let known = || {
        let known = values.iter().enumerate();
        known.filter_map(|(k, one)| Some((k, (*one)?))).filter(|(_, (_, d))| *d > 0.0)
    };
    let [mut w, mut s, mut ss, mut x, mut sx] = [0.0; 5];
    for (k, (value, deviation)) in known() {
        let (weight, z, value) = (deviation.powi(-2), shape(k), value - origin);
        w += weight;
        s += weight * z;
        ss += weight * z * z;
        x += weight * value;
        sx += weight * z * value;
    }
    let determinant = w * ss - s * s;
    if determinant <= 1e-12 * w * ss {
        return None;
    }
    let slope = (w * sx - s * x) / determinant;
    let level = (x - slope * s) / w;
    let left = known().map(|(k, (value, deviation))| {
        ((value - origin - level - slope * shape(k)) / deviation).powi(2)
    });
    Some((left.sum(), slope))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_and_ramps_are_told_apart_with_their_day() {
        let noise = [0.3, -0.5, 0.1, 0.6, -0.2, -0.4, 0.5, 0.0, -0.3, 0.2];
        let series = |shape: &dyn Fn(usize) -> f64| -> Vec<Option<(f64, f64)>> {
            (0..10).map(|k| (k != 2).then(|| (100.0 + shape(k) + noise[k], 1.0))).collect()
        };
        let ramp = series(&|k| 5.0 * (k as f64 - 3.0).max(0.0));
        for found in [4, 5] {
            let onset = onset(&ramp, found, 2);
            assert_eq!(onset.day, 4);
            assert!((onset.per_day.expect("a ramp") - 5.0).abs() < 0.3, "{onset:?}");
        }
        let step = series(&|k| if k >= 6 { 12.0 } else { 0.0 });
        assert_eq!(onset(&step, 5, 2), Onset { day: 6, per_day: None });
        assert_eq!(onset(&[None, None], 1, 2).day, 1);
    }
}
