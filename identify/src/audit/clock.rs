//! Checks the times of a recording against recorded rates: a position changes by the integral of its rate, whatever the
//! joint does, so that all coordinates show the same clock error. Samples that were written twice are visible where all
//! positions stay equal while the rates continue. Input: a recording; output: warnings.

use std::collections::BTreeMap;

use crate::motion::mean_rate;
use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, Remedy};

use super::thresholds::{
    CLOCK_AGREEING_OF_THREE, CLOCK_AGREEMENT_SHARE, CLOCK_RATIOS, CLOCK_SQUARED_CORRELATION, MIN_CLOCK_ERROR,
    REPEATED_CHANCE_FACTOR, REPEATED_FEWEST_POSITIONS, REPEATED_FEWEST_SAMPLES, REPEATED_LEAST_SHARE,
};
use crate::recording::{RecordingNote, SignalRecording};
use crate::signal::median;
use crate::words::{backquoted_list, with_digits};

/// Largest number of pieces of the recording over which rates are integrated.
const PIECES: usize = 400;
/// Least number of samples of a piece.
const SHORTEST: usize = 8;

impl SignalRecording {
    /// Warnings about the times of samples. `coordinates` are the names of the positions; rates have the suffix `_d`.
    pub(crate) fn clock_notes(&self, coordinates: &[&str]) -> Vec<RecordingNote> {
        let Ok(time) = self.column("t") else {
            return Vec::new();
        };
        let mut notes: Vec<RecordingNote> = self.clock_error_note(time, coordinates).into_iter().collect();
        notes.extend(self.repeated_samples_note(time, coordinates));
        notes
    }

    /// Warning about a clock that runs too fast or too slowly; `None` if it agrees with the rates.
    fn clock_error_note(&self, time: &[f64], coordinates: &[&str]) -> Option<RecordingNote> {
        // One ratio for each coordinate with a recorded rate.
        let mut ratios: BTreeMap<String, f64> = BTreeMap::new();
        for name in coordinates {
            let rate = format!("{name}_d");
            let (Ok(q), true) = (self.column(name), self.has_column(&rate)) else {
                continue;
            };
            if let Ok(qd) = self.column(&rate)
                && let Some(ratio) = change_by_integral(time, q, qd)
            {
                ratios.insert(rate, ratio);
            }
        }
        // The median over the coordinates is not affected by a single wrong sensor.
        let middle = median(ratios.values().copied().collect());
        let off = middle - 1.0;
        if ratios.is_empty() || !CLOCK_RATIOS.contains(&middle) || off.abs() < MIN_CLOCK_ERROR {
            return None;
        }
        // Coordinates that show a clock error of the same sign and of similar size.
        let agree = ratios
            .values()
            .filter(|ratio| (*ratio - 1.0) * off.signum() > CLOCK_AGREEMENT_SHARE * off.abs());
        if 3 * agree.count() < CLOCK_AGREEING_OF_THREE * ratios.len() {
            return None;
        }
        let names: Vec<String> = ratios.keys().cloned().collect();
        let (runs, should) = if off > 0.0 {
            ("too slowly", "longer")
        } else {
            ("too fast", "shorter")
        };
        // The true duration is the recorded one times the ratio.
        let duration = time[time.len() - 1] - time[0];
        Some(RecordingNote::warning(format!(
            "`t` in {} runs {runs}: positions change by {} times the integral of the recorded {}. So the run takes {} s \
             and not {} s, {should} by {} %. Rates from positions have the same relative error, accelerations twice that. \
             Provide the true times as `t`; the steps of {} s may come from a sample counter.",
            self.file(),
            with_digits(middle, 4),
            backquoted_list(&names),
            with_digits(duration * middle, 5),
            with_digits(duration, 5),
            with_digits(100.0 * off.abs(), 2),
            with_digits(mean_rate(time).recip(), 4),
        )))
    }

    /// Warning about samples that were written twice; `None` if there are few.
    fn repeated_samples_note(&self, time: &[f64], coordinates: &[&str]) -> Option<RecordingNote> {
        let positions: Vec<&[f64]> = coordinates
            .iter()
            .filter_map(|name| self.column(name).ok())
            .filter(|q| q.iter().any(|v| v.total_cmp(&q[0]).is_ne()))
            .collect();
        let n = time.len();
        // A single position may repeat by chance, and so may few samples.
        if positions.len() < REPEATED_FEWEST_POSITIONS || n < REPEATED_FEWEST_SAMPLES {
            return None;
        }
        // Bitwise equality: any noise of a new measurement would change the value.
        let same = |q: &[f64], i: usize| q[i].total_cmp(&q[i - 1]).is_eq();
        let all = (1..n)
            .filter(|i| positions.iter().all(|q| same(q, *i)))
            // At standstill all positions stay equal, so a neighbouring step must show motion.
            .filter(|i| {
                let around = [i.saturating_sub(2), (*i + 1).min(n - 1)];
                positions
                    .iter()
                    .filter(|q| around.iter().all(|k| *k == 0 || *k == *i || !same(q, *k)))
                    .count()
                    > 0
            })
            .count();
        // Quantised positions repeat by chance, independently of each other.
        let by_chance: f64 = positions
            .iter()
            .map(|q| (1..n).filter(|i| same(q, *i)).count() as f64 / n as f64)
            .product();
        // Report only if repetitions are clearly more frequent than by chance.
        let part = all as f64 / n as f64;
        (part > REPEATED_LEAST_SHARE + REPEATED_CHANCE_FACTOR * by_chance).then(|| {
            RecordingNote::warning(message!(
                "In {all} of {n} samples of {} all positions are equal to those of the sample before, while the mechanism \
                 moves. Samples were written twice, or read later than their times state. This disturbs derivatives of \
                 positions: use recorded rates, or a lower cut-off ({}).",
                self.file(),
                Remedy::option(OptionName::CutoffHz),
            ))
        })
    }
}

/// Ratio of the change of a position to the integral of its rate, over pieces of the recording; `None` if it hardly
/// moves or the rate does not explain it.
fn change_by_integral(time: &[f64], q: &[f64], qd: &[f64]) -> Option<f64> {
    let n = time.len();
    let piece = (n / PIECES).next_multiple_of(2).max(SHORTEST);
    // Change of the position and integral of the rate, piece by piece.
    let pairs: Vec<(f64, f64)> = (0..n.saturating_sub(piece))
        .step_by(piece)
        .map(|start| {
            let by = |step: usize| -> f64 {
                (start..start + piece)
                    .step_by(step)
                    .map(|i| 0.5 * (qd[i] + qd[i + step]) * (time[i + step] - time[i]))
                    .sum()
            };
            // Richardson extrapolation: the trapezoidal rule with single and double steps cancels the error of second
            // order.
            let integral = (4.0 * by(1) - by(2)) / 3.0;
            (q[start + piece] - q[start], integral)
        })
        .collect();
    // A rate may have an offset, so means are subtracted.
    let mean = |of: fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / pairs.len() as f64;
    let (change, integral) = (mean(|pair| pair.0), mean(|pair| pair.1));
    // Sums of products of both, around their means.
    let (mut qi, mut ii, mut qq) = (0.0, 0.0, 0.0);
    for (q, i) in &pairs {
        let (q, i) = (q - change, i - integral);
        qi += q * i;
        ii += i * i;
        qq += q * q;
    }
    // If the rate does not explain the position, the clock is not the reason.
    let is_explained = qi * qi > CLOCK_SQUARED_CORRELATION * qq * ii;
    if ii <= 0.0 || !is_explained {
        return None;
    }
    // Noise of the rate makes one ratio too small, noise of the position the other too large: the true value lies
    // between them.
    let (low, high) = (qi / ii, qq / qi);
    Some(1.0_f64.clamp(low.min(high), low.max(high)))
}

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;

    use super::*;
    use crate::ReadOptions;

    fn recording(stamp: impl Fn(u32) -> f64, repeated: bool) -> Vec<RecordingNote> {
        let mut text = "t,a,a_d,b,b_d\n".to_owned();
        for i in 0..4000 {
            let k = if repeated && i % 40 == 7 { i - 1 } else { i };
            // True steps of 1.02 ms.
            let t = 1.02e-3 * f64::from(k);
            let (a, b) = ((2.0 * t).sin(), (3.0 * t).cos());
            let (a_d, b_d) = (2.0 * (2.0 * t).cos(), -3.0 * (3.0 * t).sin());
            writeln!(text, "{},{a},{a_d},{b},{b_d}", stamp(i)).unwrap();
        }
        let read = SignalRecording::from_bytes(text.as_bytes(), "run.csv", &ReadOptions::default());
        read.unwrap().clock_notes(&["a", "b"])
    }

    #[test]
    fn counted_samples_and_repeated_ones_are_told() {
        assert_eq!(recording(|i| 1.02e-3 * f64::from(i), false), []);
        let counted = recording(|i| 1e-3 * f64::from(i), false);
        assert_eq!(counted.len(), 1);
        let says = counted[0].says.in_library_words();
        assert!(says.contains("too slowly") && says.contains("1.02 times"), "{says}");
        let repeated = recording(|i| 1.02e-3 * f64::from(i), true);
        assert!(
            repeated.len() == 1 && repeated[0].says.in_library_words().contains("In 100 of 4000"),
            "{repeated:?}"
        );
    }
}
