//! Recorded rates that lag the recorded positions, as a low-pass in a controller makes them. A recording goes in; the
//! delays of its rates come out, and such rates are set aside.
//!
//! The integral of a rate with the delay T is the position T earlier. So the difference of position and integral is T
//! times the rate. T is estimated by least squares, with a constant and a drift beside it, so that no position has to be
//! differentiated.

use super::thresholds::{
    LATE_RATE_EXPLAINED, LATE_RATE_FEWEST_SAMPLES, LATE_RATE_LEAST_CHANGE, LATE_RATE_LEAST_STEPS, LATE_RATE_LONGEST_S,
};
use crate::recording::{GAP_LEAST_STEPS, RecordingNote, SignalRecording};
use crate::signal::median;
use crate::words::{backquoted_list, with_digits};
use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, Remedy};

/// A rate that lags its position.
#[derive(Clone, Copy, Debug, PartialEq)]
struct LateRate {
    /// The delay, s.
    delay: f64,
    /// Change of the rate within the delay, relative to its size (rms).
    change: f64,
}

impl SignalRecording {
    /// Removes recorded rates that lag the positions, with the accelerations that follow from them, and adds a note.
    ///
    /// Positions then give the rates: a force at one time must be compared with the motion at the same time.
    pub fn set_late_rates_aside(&mut self, coordinates: &[String]) {
        let late = coordinates
            .iter()
            .filter_map(|name| Some((name, self.late_rate(name)?)));
        let late: Vec<(&String, LateRate)> = late.collect();
        // All rates come from one controller: if the delay matters for one of them, none is used.
        if !late.iter().any(|(_, rate)| rate.change > LATE_RATE_LEAST_CHANGE) {
            return;
        }
        let late: Vec<(String, f64)> = late
            .into_iter()
            .map(|(name, rate)| (name.clone(), rate.delay))
            .collect();
        for (name, _) in &late {
            for suffix in ["_d", "_dd"] {
                self.columns.shift_remove(&format!("{name}{suffix}"));
            }
        }
        let rates: Vec<String> = late.iter().map(|(name, _)| format!("{name}_d")).collect();
        let [least, most] = [f64::min, f64::max].map(|choose| {
            let delays = late.iter().map(|(_, delay)| 1e3 * delay);
            with_digits(delays.reduce(choose).unwrap_or(0.0), 2)
        });
        let delay = if least == most {
            most
        } else {
            format!("{least} to {most}")
        };
        self.notes.push(RecordingNote::warning(message!(
            "The recorded rates {} in {} lag the recorded positions by {delay} ms, as after a low-pass. They are not used: \
             rates and accelerations are computed from the positions. Record rates without a filter, or omit them ({}).",
            backquoted_list(&rates),
            self.file(),
            Remedy::option(OptionName::Source).with_value("positions"),
        )));
        self.late_rates = late;
    }

    /// Coordinates whose rates were set aside because they lag the positions, each with the delay, s.
    pub fn late_rates(&self) -> &[(String, f64)] {
        &self.late_rates
    }

    /// The delay of the rates of a coordinate; `None` if there are no rates or if no clear delay explains their
    /// difference from the positions.
    fn late_rate(&self, name: &str) -> Option<LateRate> {
        let time = self.column("t").ok()?;
        let position = self.column(name).ok()?;
        let rate = self.column(&format!("{name}_d")).ok()?;
        rate_delay(time, position, rate)
    }
}

/// The delay of a rate relative to its position; `None` without a clear one.
fn rate_delay(time: &[f64], position: &[f64], rate: &[f64]) -> Option<LateRate> {
    let n = time.len();
    if n < LATE_RATE_FEWEST_SAMPLES {
        return None;
    }
    let usual = median(time.windows(2).map(|w| w[1] - w[0]).collect());
    // The integral would drift across a gap.
    if usual <= 0.0 || time.windows(2).any(|w| w[1] - w[0] > GAP_LEAST_STEPS * usual) {
        return None;
    }
    // Trapezoidal rule; its result belongs to the times of the samples.
    let mut integral = vec![0.0];
    for i in 1..n {
        integral.push(integral[i - 1] + 0.5 * (rate[i] + rate[i - 1]) * (time[i] - time[i - 1]));
    }
    // Position = scale * integral + delay * rate + constant + drift * t.
    let middle = 0.5 * (time[0] + time[n - 1]);
    let rows = |i: usize, with_rate: bool| {
        let t = (time[i] - middle) / (time[n - 1] - time[0]);
        [integral[i], 1.0, t, if with_rate { rate[i] } else { 0.0 }]
    };
    let [without, with] = [false, true].map(|with_rate| fit_four(n, position, |i| rows(i, with_rate)));
    let ((_, before), (values, after)) = (without?, with?);
    // The rate in other units, or of another coordinate, is reported elsewhere.
    let scale = values[0];
    let delay = values[3] / scale;
    let is_derivative = (0.9..1.1).contains(&scale);
    let is_long = delay > LATE_RATE_LEAST_STEPS * usual && delay < LATE_RATE_LONGEST_S;
    if !is_derivative || !is_long || after > (1.0 - LATE_RATE_EXPLAINED) * before {
        return None;
    }
    let steps = steps_of(delay, usual);
    let pairs = || (0..n - steps).map(|i| (rate[i], rate[i + steps]));
    let change: f64 = pairs().map(|(a, b)| (a - b).powi(2)).sum();
    let size: f64 = pairs().map(|(a, _)| a * a).sum();
    Some(LateRate {
        delay,
        change: (change / size).sqrt(),
    })
}

/// Number of samples of a delay, at least one.
fn steps_of(delay: f64, step: f64) -> usize {
    crate::signal::float_to_count((delay / step).round()).max(1)
}

/// Least squares for four unknowns: their values and the sum of squared residuals; columns of zeros get the value 0.
fn fit_four(n: usize, right: &[f64], row: impl Fn(usize) -> [f64; 4]) -> Option<([f64; 4], f64)> {
    let mut gram = nalgebra::Matrix4::<f64>::zeros();
    let mut products = nalgebra::Vector4::<f64>::zeros();
    for (i, value) in right.iter().enumerate().take(n) {
        let entries = nalgebra::Vector4::from(row(i));
        gram += entries * entries.transpose();
        products += entries * *value;
    }
    // A tiny part of the diagonal keeps an empty column solvable.
    let size = gram.trace();
    for k in 0..4 {
        if gram[(k, k)] <= 1e-14 * size * f64::EPSILON {
            gram[(k, k)] = 1.0;
        }
    }
    let values = gram.cholesky()?.solve(&products);
    let residual = (0..n).map(|i| right[i] - nalgebra::Vector4::from(row(i)).dot(&values));
    let squares = residual.map(|r| r * r).sum();
    Some((values.into(), squares))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::test_noise::TestNoise;

    /// A motion of three harmonics, and the rate after a first-order low-pass with this time constant.
    fn motion(lag: f64, seed: u64) -> [Vec<f64>; 3] {
        let step = 0.002;
        let mut noise = TestNoise::new(seed);
        let phase = 6.3 * noise.uniform();
        let (mut time, mut q, mut rate) = (Vec::new(), Vec::new(), Vec::new());
        for i in 0..5000 {
            let t = step * f64::from(i);
            let (mut position, mut filtered) = (0.0, 0.0);
            for (k, a) in [(1.0, 0.6), (3.0, 0.2), (5.0, 0.1)] {
                let w = TAU * 0.2 * k;
                position += a * (w * t + phase).sin();
                // The response to a cosine is attenuated and late.
                let gain = (1.0 + (w * lag).powi(2)).sqrt().recip();
                filtered += a * w * gain * (w * t + phase - (w * lag).atan()).cos();
            }
            time.push(t);
            q.push(position + 2e-5 * noise.normal());
            rate.push(filtered + 2e-3 * noise.normal());
        }
        [time, q, rate]
    }

    #[test]
    fn rates_behind_a_low_pass_are_found_and_others_are_not() {
        for seed in 0..6 {
            for lag in [0.01, 0.027] {
                let [time, q, rate] = motion(lag, seed);
                let found = rate_delay(&time, &q, &rate).expect("a delay").delay;
                assert!((found / lag - 1.0).abs() < 0.1, "{found} for {lag}");
            }
            for lag in [0.0, 0.001] {
                let [time, q, rate] = motion(lag, seed);
                assert_eq!(rate_delay(&time, &q, &rate), None, "{lag}");
            }
        }
    }
}
