//! Columns of a recording as signals: their numbers, which of them is the time, and which one is the rate of another.

use modelmill_identify::float_to_count;

use super::thresholds::{LONGEST_LIKELY_STEP, RATE_LEAST_CORRELATION, STENCIL_SPAN, TIME_LEAST_SHARE};
use super::words::{NameParts, SignalRole};

/// A column of a recording.
pub(super) struct FileSignal {
    /// Its name in the file.
    pub(super) name: String,
    /// Its name taken apart.
    pub(super) parts: NameParts,
    /// Its numbers; empty if they could not be read.
    pub(super) values: Vec<f64>,
}

/// That a signal is the rate of another one.
#[derive(Clone, Copy, Debug)]
pub(super) struct RateLink {
    /// Correlation with the differences of the other signal.
    pub(super) correlation: f64,
    /// The signal over the differences, a factor between their units.
    pub(super) ratio: f64,
}

impl FileSignal {
    /// A column by its name and its numbers.
    pub(super) fn new(name: String, values: Vec<f64>) -> Self {
        Self {
            parts: NameParts::new(&name),
            name,
            values,
        }
    }

    /// Whether all numbers are equal, so that nothing can be known from them.
    pub(super) fn is_constant(&self) -> bool {
        self.values.windows(2).all(|pair| pair[0].total_cmp(&pair[1]).is_eq())
    }

    /// Whether it measures something of this role, by its name.
    pub(super) fn has_role(&self, role: SignalRole) -> bool {
        self.parts.role == Some(role)
    }

    /// Whether its numbers increase from sample to sample.
    fn increases(&self) -> bool {
        self.values.len() > 2 && self.values.windows(2).all(|pair| pair[1] > pair[0])
    }
}

/// The signal that is the time: one that increases, with a name of the time if there is any.
pub(super) fn find_time(signals: &[FileSignal]) -> Option<usize> {
    let named = signals.iter().position(|one| {
        // Two equal stamps do not make a column another one.
        let increasing = one.values.windows(2).filter(|pair| pair[1] > pair[0]).count();
        let is_time = increasing as f64 >= TIME_LEAST_SHARE * (one.values.len().saturating_sub(1)) as f64;
        one.has_role(SignalRole::Time) && (one.values.is_empty() || is_time)
    });
    named.or_else(|| {
        signals
            .iter()
            .position(|one| one.parts.role.is_none() && one.increases())
    })
}

/// The unit that the steps of a time suggest; `None` for seconds.
pub(super) fn suggest_time_unit(time: &[f64]) -> Option<&'static str> {
    let mut steps: Vec<f64> = time.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    // Limits lie between usual steps: a step of 1 ms is the most frequent one, so 1, 1000 and 1e6 would be undecided.
    match *steps.get(steps.len() / 2)? {
        step if step < LONGEST_LIKELY_STEP => None,
        step if step < 1e3 * LONGEST_LIKELY_STEP => Some("ms"),
        step if step < 1e6 * LONGEST_LIKELY_STEP => Some("us"),
        _ => Some("ns"),
    }
}

/// Whether `rate` is the derivative of `signal` but for a factor; `time` may be the number of the sample.
pub(super) fn find_rate_link(time: &[f64], signal: &[f64], rate: &[f64]) -> Option<RateLink> {
    let n = time.len();
    if n < 8 || signal.len() != n || rate.len() != n {
        return None;
    }
    // Differences over several samples suppress the steps of an encoder.
    let step = (time[n - 1] - time[0]) / (n - 1) as f64;
    let reach = float_to_count(STENCIL_SPAN / step).clamp(1, n / 4);
    let mut sums = [0.0; 5];
    let mut count = 0.0;
    for k in reach..n - reach {
        let span = time[k + reach] - time[k - reach];
        let slope = (signal[k + reach] - signal[k - reach]) / span;
        let here = rate[k - reach..=k + reach].iter().sum::<f64>() / (2 * reach + 1) as f64;
        if !slope.is_finite() || !here.is_finite() {
            continue;
        }
        let terms = [slope, here, slope * slope, here * here, slope * here];
        sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
        count += 1.0;
    }
    let [a, b, aa, bb, ab] = sums.map(|sum| sum / count);
    let (var_a, var_b, cov) = (aa - a * a, bb - b * b, ab - a * b);
    let correlation = cov / (var_a * var_b).sqrt();
    (correlation.abs() >= RATE_LEAST_CORRELATION).then_some(RateLink {
        correlation,
        ratio: cov / var_a,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Stamps with jitter, in each unit and at usual sampling rates.
    #[test]
    fn units_of_time_are_decided_far_from_usual_steps() {
        for rate in [10.0, 50.0, 125.0, 500.0, 1000.0, 2000.0, 5000.0] {
            for (unit, per_second) in [(None, 1.0), (Some("ms"), 1e3), (Some("us"), 1e6), (Some("ns"), 1e9)] {
                for jitter in [-0.1, 0.1] {
                    let step = per_second / rate * (1.0 + jitter);
                    let time: Vec<f64> = (0..100).map(|k| step * f64::from(k)).collect();
                    assert_eq!(suggest_time_unit(&time), unit, "{rate} Hz");
                }
            }
        }
    }

    #[test]
    fn rates_are_recognised_with_their_unit() {
        let time: Vec<f64> = (0..500).map(|k| 0.004 * f64::from(k)).collect();
        let of = |f: &dyn Fn(f64) -> f64| -> Vec<f64> { time.iter().map(|t| f(*t)).collect() };
        let position = of(&|t| (3.0 * t).sin());
        let rate = of(&|t| -171.887 * (3.0 * t).cos() + (500.0 * t).sin());
        let link = find_rate_link(&time, &position, &rate).unwrap();
        assert!(link.correlation < -0.99 && (link.ratio + 57.3).abs() < 0.5, "{link:?}");
        assert!(find_rate_link(&time, &position, &of(&|t| (3.0 * t).sin())).is_none());
        assert!(find_rate_link(&time, &position, &vec![1.0; 500]).is_none());
    }
}
