//! The time base of a run whose rates were recorded: positions change by the integral of the rates over the true time,
//! so that the time stamps are compared with both, without any model.
//!
//! ```text
//! q(t) = a + b t + s int(rate) + c rate + d rate'
//! ```
//!
//! Here `s` is 1 for a true clock. `b` is a constant error of the rates, and `c` and `d` are delay and low-pass of the
//! rates, which would otherwise change `s` with the frequency of the motion.
//!
//! Decision: only the ratio of two runs is used. A rate that is scaled wrongly in both runs is no change. A rate that was
//! computed from positions and time stamps agrees with any clock, so it is not used.

use nalgebra::{DMatrix, DVector};

use crate::model::Model;
use crate::recording::{DerivativeSource, PreparedRecording};
use crate::runs::changes::ChangeEstimate;
use crate::runs::columns::TimeScaling;
use crate::runs::thresholds::{TIME_BASE_FEWEST_SAMPLES, TIME_BASE_LEAST_ERROR, TIME_BASE_SIGMAS, TIME_BASE_WINDOWS};
use crate::segment::RecordingSegment;

/// A rate is a difference quotient if most of its samples differ from it by less than this share of the rms rate (1). By
/// judgement: rounding to six digits gives 1e-4, and noise and delay of measured rates more than 1e-3.
const QUOTIENT_TOLERANCE: f64 = 3e-4;

/// Rates below this share of the rms rate (1) are not compared with difference quotients: at standstill both are 0. By
/// judgement.
const QUOTIENT_LEAST_RATE: f64 = 0.1;

/// The slopes `s` of one run: for each coordinate those of all windows, with the weight of each.
#[derive(Clone, Debug, Default)]
pub(crate) struct TimeBase(Vec<Vec<WindowSlope>>);

/// The slope in one window of time.
#[derive(Clone, Copy, Debug)]
struct WindowSlope {
    /// Change of position over integral of the rate (1).
    slope: f64,
    /// The inverse of its variance if the residual is white.
    weight: f64,
}

/// How the clock of a recording scales the rates and accelerations of each active coordinate: what was recorded does not
/// depend on time stamps, and each derivative that is computed scales once.
pub(crate) fn time_scaling(model: &Model, recording: &PreparedRecording) -> Vec<TimeScaling> {
    let is_recorded = |name: &str, suffix: &str| {
        recording.derivative_source() == DerivativeSource::RecordedFirst
            && recording.raw_column(&format!("{name}{suffix}")).is_some()
    };
    let coordinate = |name: &String| {
        let [rate, acceleration] = ["_d", "_dd"].map(|suffix| is_recorded(name, suffix));
        let rates = i32::from(!rate);
        TimeScaling {
            rates,
            accelerations: if acceleration { 0 } else { rates + 1 },
        }
    };
    model.active_coordinates().iter().map(coordinate).collect()
}

impl TimeBase {
    /// The slopes of a recording; coordinates without a measured rate have none.
    pub(crate) fn of_recording(model: &Model, recording: &PreparedRecording) -> Self {
        let slopes = |name: &String| {
            let rate = recording.raw_column(&format!("{name}_d"));
            let columns = [recording.raw_column("t"), recording.raw_column(name), rate];
            let [Some(time), Some(position), Some(rate)] = columns else {
                return Vec::new();
            };
            slopes_of_measured_rate(time, position, rate)
        };
        Self(model.active_coordinates().iter().map(slopes).collect())
    }

    /// The ratio of the later run's true speed to that of its time stamps, relative to this run; `None` if the rates of
    /// one of the runs were not recorded, or do not determine it.
    fn ratio(&self, later: &Self) -> Option<ChangeEstimate> {
        let mut ratios: Vec<(f64, f64)> = Vec::new();
        for (first, later) in self.0.iter().zip(&later.0) {
            let (Some((a, da)), Some((b, db))) = (mean_slope(first), mean_slope(later)) else {
                continue;
            };
            let std = (a / b).abs() * (da / a).hypot(db / b);
            ratios.push((a / b, std.max(f64::EPSILON).powi(-2)));
        }
        let weight: f64 = ratios.iter().map(|(_, w)| w).sum();
        let value = ratios.iter().map(|(x, w)| x * w).sum::<f64>() / weight;
        // Coordinates that disagree make the ratio uncertain: a clock is the same for all.
        let scatter: f64 = ratios.iter().map(|(x, w)| w * (x - value).powi(2)).sum();
        let scatter = scatter / (ratios.len() as f64 - 1.0).max(1.0);
        let std = (scatter.max(1.0) / weight).sqrt();
        (value.is_finite() && std.is_finite()).then_some(ChangeEstimate { value, std })
    }

    /// The changed clock of a later run; `None` if the clock is unknown or did not change. The first result states
    /// whether it is known.
    pub(crate) fn changed_clock(&self, later: &Self) -> (bool, Option<ChangeEstimate>) {
        let ratio = self.ratio(later);
        let is_changed = |one: &ChangeEstimate| {
            let error = (one.value - 1.0).abs();
            error > TIME_BASE_LEAST_ERROR && error > TIME_BASE_SIGMAS * one.std
        };
        let is_known = |one: &ChangeEstimate| TIME_BASE_SIGMAS * one.std < TIME_BASE_LEAST_ERROR;
        (
            ratio.as_ref().is_some_and(|one| is_known(one) || is_changed(one)),
            ratio.filter(is_changed),
        )
    }
}

/// Multiplies derivatives that were computed with a wrong clock, by the factor of the true speed.
pub(crate) fn correct_clock(segments: &mut [RecordingSegment], scaling: &[TimeScaling], factor: f64) {
    for segment in segments {
        for (coordinate, scaling) in scaling.iter().enumerate() {
            scaling.scale_coordinate(&mut segment.run, coordinate, factor);
        }
    }
}

/// The slopes of a run; none if the rate was computed from the positions.
fn slopes_of_measured_rate(time: &[f64], position: &[f64], rate: &[f64]) -> Vec<WindowSlope> {
    if is_difference_quotient(time, position, rate) {
        Vec::new()
    } else {
        window_slopes(time, position, rate)
    }
}

/// Whether a rate is a difference quotient of the positions over the time stamps, in one of the usual forms.
fn is_difference_quotient(time: &[f64], position: &[f64], rate: &[f64]) -> bool {
    let n = time.len().min(position.len()).min(rate.len());
    let rms = (rate.iter().map(|v| v * v).sum::<f64>() / n.max(1) as f64).sqrt();
    let moving: Vec<usize> = (1..n.saturating_sub(1))
        .filter(|i| rate[*i].abs() > QUOTIENT_LEAST_RATE * rms)
        .collect();
    let quotient = |from: usize, to: usize| (position[to] - position[from]) / (time[to] - time[from]);
    let forms: [&dyn Fn(usize) -> f64; 4] = [
        &|i| quotient(i - 1, i),
        &|i| quotient(i, i + 1),
        &|i| quotient(i - 1, i + 1),
        // The slope of a parabola through three samples.
        &|i| {
            let share = (time[i] - time[i - 1]) / (time[i + 1] - time[i - 1]);
            share * quotient(i, i + 1) + (1.0 - share) * quotient(i - 1, i)
        },
    ];
    forms.iter().any(|form| {
        let is_equal = |i: &&usize| (rate[**i] - form(**i)).abs() < QUOTIENT_TOLERANCE * rms;
        let equal = moving.iter().filter(is_equal).count();
        !moving.is_empty() && 2 * equal > moving.len()
    })
}

/// The slopes in equal windows of a run.
fn window_slopes(time: &[f64], position: &[f64], rate: &[f64]) -> Vec<WindowSlope> {
    let n = time.len().min(position.len()).min(rate.len());
    let windows = (n / TIME_BASE_FEWEST_SAMPLES).min(TIME_BASE_WINDOWS);
    (0..windows)
        .filter_map(|k| {
            let some = k * n / windows..(k + 1) * n / windows;
            window_slope(&time[some.clone()], &position[some.clone()], &rate[some])
        })
        .collect()
}

/// The slope in one window by least squares; `None` if the motion does not determine it.
fn window_slope(time: &[f64], position: &[f64], rate: &[f64]) -> Option<WindowSlope> {
    let n = time.len();
    let mut integral = vec![0.0; n];
    for i in 1..n {
        integral[i] = integral[i - 1] + 0.5 * (rate[i] + rate[i - 1]) * (time[i] - time[i - 1]);
    }
    // The derivative of the rate is a difference over several samples, which has less noise.
    let half = (n / 60).max(1);
    let slope = |i: usize| {
        let (from, to) = (i.saturating_sub(half), (i + half).min(n - 1));
        (rate[to] - rate[from]) / (time[to] - time[from]).max(f64::MIN_POSITIVE)
    };
    let origin = time[0];
    let columns: [Vec<f64>; 5] = [
        integral,
        vec![1.0; n],
        time.iter().map(|t| t - origin).collect(),
        rate.to_vec(),
        (0..n).map(slope).collect(),
    ];
    let norms: Vec<f64> = (columns.iter())
        .map(|column| column.iter().map(|x| x * x).sum::<f64>().sqrt().max(f64::MIN_POSITIVE))
        .collect();
    let table = DMatrix::from_fn(n, columns.len(), |i, k| columns[k][i] / norms[k]);
    let measured = DVector::from_fn(n, |i, _| position[i] - position[0]);
    let inverse = (table.transpose() * &table).try_inverse()?;
    let values = &inverse * (table.transpose() * &measured);
    let residual = (&measured - &table * &values).norm_squared() / (n as f64 - 5.0).max(1.0);
    // An encoder at standstill has no residual, but no slope either.
    let floor = 1e-24 * measured.norm_squared() / n as f64;
    let variance = inverse[(0, 0)] * residual.max(floor) / (norms[0] * norms[0]);
    let slope = values[0] / norms[0];
    let is_good = slope.is_finite() && variance.is_finite() && variance > 0.0 && slope.abs() > 0.0;
    is_good.then(|| WindowSlope {
        slope,
        weight: variance.recip(),
    })
}

/// The weighted mean of some slopes with its standard deviation from their scatter.
fn mean_slope(slopes: &[WindowSlope]) -> Option<(f64, f64)> {
    let n = slopes.len() as f64;
    if n < 4.0 {
        return None;
    }
    let weight: f64 = slopes.iter().map(|one| one.weight).sum();
    let mean = slopes.iter().map(|one| one.weight * one.slope).sum::<f64>() / weight;
    let squares = slopes.iter().map(|one| one.weight.powi(2) * (one.slope - mean).powi(2));
    let std = (n / (n - 1.0) * squares.sum::<f64>()).sqrt() / weight;
    // Windows cannot agree better than their own noise allows.
    let std = std.max(weight.sqrt().recip());
    (mean.is_finite() && std.is_finite() && mean.abs() > 0.0).then_some((mean, std))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A motion of several frequencies with its rate, which is delayed and coarse.
    fn signals(speed: f64, frequency: f64) -> TimeBase {
        let position = |t: f64| (frequency * t).sin() + 0.4 * (2.3 * frequency * t).sin();
        let rate = |t: f64| frequency * ((frequency * t).cos() + 0.92 * (2.3 * frequency * t).cos());
        let n = 4000;
        let time: Vec<f64> = (0..n).map(|k| 0.005 * f64::from(k)).collect();
        let coarse = |x: f64, step: f64| (x / step).round() * step;
        let q: Vec<f64> = time.iter().map(|t| coarse(position(t / speed), 1e-4)).collect();
        let qd: Vec<f64> = time.iter().map(|t| coarse(rate(t / speed - 0.01), 1e-3)).collect();
        TimeBase(vec![slopes_of_measured_rate(&time, &q, &qd)])
    }

    #[test]
    fn a_clock_is_found_from_recorded_rates_whatever_the_motion() {
        for (k, speed) in [1.02, 0.995, 1.1].into_iter().enumerate() {
            let later = signals(speed, 2.0 + k as f64);
            let (is_known, found) = signals(1.0, 3.0).changed_clock(&later);
            let found = found.expect("a change");
            let off = (found.value - speed).abs();
            assert!(is_known && off < 5e-4 && off < 5.0 * found.std, "{speed}: {found:?}");
        }
        assert_eq!(signals(1.0, 3.0).changed_clock(&signals(1.0, 5.0)), (true, None));
        assert_eq!(signals(1.0, 3.0).changed_clock(&TimeBase::default()), (false, None));
    }

    /// Rates that a logger or a script computed from the time stamps follow any clock.
    #[test]
    fn rates_from_time_stamps_are_no_evidence_for_the_clock() {
        let n = 4000;
        let rounded = |x: f64| (x * 1e6).round() / 1e6;
        // `gradient` as numpy computes it, and backward differences, over stamps with jitter.
        let run = |speed: f64, is_central: bool, frequency: f64| {
            let time: Vec<f64> = (0..n)
                .map(|k| speed * 0.005 * (f64::from(k) + 0.1 * f64::from(k * 7 % 5)))
                .collect();
            let motion = |t: f64| (frequency * t).sin() + 0.4 * (2.3 * frequency * t).sin();
            let q: Vec<f64> = time.iter().map(|t| rounded(motion(t / speed))).collect();
            let last = q.len() - 1;
            let slope = |i: usize, k: usize| (q[k] - q[i]) / (time[k] - time[i]);
            let rate = |i: usize| {
                if i == 0 || i == last || !is_central {
                    let from = i.saturating_sub(1);
                    return rounded(slope(from, from + 1));
                }
                let share = (time[i] - time[i - 1]) / (time[i + 1] - time[i - 1]);
                rounded(share * slope(i, i + 1) + (1.0 - share) * slope(i - 1, i))
            };
            let qd: Vec<f64> = (0..=last).map(rate).collect();
            TimeBase(vec![slopes_of_measured_rate(&time, &q, &qd)])
        };
        for is_central in [false, true] {
            let [first, later] = [(1.0, 3.0), (1.02, 4.0)].map(|(speed, f)| run(speed, is_central, f));
            assert_eq!(first.changed_clock(&later), (false, None), "{is_central}");
        }
    }
}
