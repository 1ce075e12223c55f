//! Columns that look wrong. Input: a recording; output: warnings.
//!
//! Checks for wrapped angles, for rates that are not the derivatives of their positions (with the unit error that
//! explains it), and for times that are hardly in seconds.

use std::f64::consts::PI;

use modelmill_boundary::message;
use modelmill_boundary::text::{Message, OptionName, OptionSetting, Remedy};

use super::thresholds::{
    LONGEST_STEP_S, RATE_FEWEST_SAMPLES, RATE_MOST_MISFIT, RATE_MOST_NOISE, RATE_RATIO_TOLERANCE, SAME_RATIO_TOLERANCE,
    SHORTEST_STEP_S, WRAP_LEAST_STEPS, WRAP_TOLERANCE_DEG, WRAP_TOLERANCE_RAD,
};
use crate::motion::{DerivativeSource, PreparedRun};
use crate::recording::{GAP_LEAST_STEPS, RecordingNote, SignalRecording};
use crate::signal::median;
use crate::words::{backquoted_list, with_digits};

impl PreparedRun {
    /// Warnings about measured forces that are 0 in every sample; parameters of 0 would explain them exactly.
    /// `undriven` are drives whose force is known to be zero.
    pub fn zero_force_notes(&self, drives: &[String], undriven: &[String]) -> Vec<RecordingNote> {
        // Forces may be missing from the recording.
        let forces = self.force.iter().flatten();
        let idle: Vec<String> = drives
            .iter()
            .zip(forces)
            .filter(|(name, force)| !undriven.contains(name) && force.iter().all(|f| *f == 0.0))
            .map(|(name, _)| name.clone())
            .collect();
        if idle.is_empty() {
            return Vec::new();
        }
        vec![RecordingNote::warning(message!(
            "The measured force of {} in {} is 0 in every sample. Estimated parameters become too small, and errors \
             relative to it are undefined. Check which column is the force ({}).",
            backquoted_list(&idle),
            self.file,
            Remedy::option(OptionName::Columns),
        ))]
    }
}

impl SignalRecording {
    /// Warnings about columns that can be read but are probably wrong. `coordinates` are `(name, whether it is an
    /// angle)`; columns that cannot be used are skipped.
    pub fn suspicious_columns(&self, coordinates: &[(String, bool)], source: DerivativeSource) -> Vec<RecordingNote> {
        let Ok(time) = self.column("t") else {
            return Vec::new();
        };
        let mut notes: Vec<RecordingNote> = coordinates
            .iter()
            .filter(|(_, is_angle)| *is_angle)
            .filter_map(|(name, _)| self.wrapped_angle_note(name, time))
            .collect();
        // Recorded rates are compared only if they are used.
        let (rates, settled) = if source == DerivativeSource::Positions {
            (Vec::new(), false)
        } else {
            self.rate_mismatch_notes(coordinates, time)
        };
        // Unit of the time: unless the rates show that it is right.
        let step = median(time.windows(2).map(|w| w[1] - w[0]).collect());
        // One sample has no steps.
        if time.len() > 1 && step <= SHORTEST_STEP_S {
            notes.push(RecordingNote::warning(format!(
                "`t` in {} has steps of {} s, which is too short for a recording of forces. Check its unit: times must \
                 be in s.",
                self.file(),
                with_digits(step, 3)
            )));
        }
        if step >= LONGEST_STEP_S && rates.is_empty() && !settled {
            notes.push(RecordingNote::warning(message!(
                "`t` in {} has steps of {} s, which is too long for a recording of forces. Times must be in s; if they \
                 are in ms, convert them ({}).",
                self.file(),
                with_digits(step, 3),
                Remedy::option(OptionName::Columns).with_value("t=t [ms]"),
            )));
        }
        notes.extend(rates);
        // The clock is compared with the recorded rates.
        let names: Vec<&str> = coordinates.iter().map(|(name, _)| name.as_str()).collect();
        notes.extend(self.clock_notes(&names));
        notes
    }

    /// Options that convert an angle recorded in degrees, and those of its recorded derivatives that are in degrees
    /// too.
    pub fn degree_conversion_options(&self, name: &str) -> Vec<OptionSetting> {
        // An option that reads a column in another unit.
        let units = ["deg", "deg/s", "deg/s^2"];
        let columns = self.degree_columns(name).into_iter().zip(units);
        columns
            .map(|(column, unit)| OptionSetting::new(OptionName::Columns, format!("{column}={column} [{unit}]")))
            .collect()
    }

    /// The columns that are in degrees if an angle is: the angle and its recorded derivatives, except for those that
    /// are the derivatives in rad of the recorded signal before them.
    pub fn degree_columns(&self, name: &str) -> Vec<String> {
        let mut columns = vec![name.to_owned()];
        for (of, order) in [("", "_d"), ("_d", "_dd")] {
            let [of, rate] = [of, order].map(|suffix| format!("{name}{suffix}"));
            // Units are given in the order of the derivatives, so that none may be skipped.
            let Ok(values) = self.column(&rate) else {
                break;
            };
            // A derivative that is 180/pi times too small is in rad already; the next one is then relative to rad as
            // well.
            let beside = self.column("t").ok().zip(self.column(&of).ok());
            let compared = beside.and_then(|(time, of)| compare_rate(time, of, values));
            let is_rad = compared.is_some_and(|(ratio, misfit)| {
                misfit < RATE_MOST_MISFIT && (ratio * 180.0 / PI - 1.0).abs() < RATE_RATIO_TOLERANCE
            });
            if is_rad {
                break;
            }
            columns.push(rate);
        }
        columns
    }

    /// Warning about jumps by a full turn between neighbouring samples; `None` without any.
    fn wrapped_angle_note(&self, name: &str, time: &[f64]) -> Option<RecordingNote> {
        let q = self.column(name).ok()?;
        let steps: Vec<f64> = q.windows(2).map(|w| w[1] - w[0]).collect();
        // A jump is about a full turn and far larger than a usual step.
        let usual = median(steps.iter().map(|step| step.abs()).collect());
        for (turn, slack, name_of_turn, besides) in [
            (2.0 * PI, WRAP_TOLERANCE_RAD, "2 pi", ""),
            (360.0, WRAP_TOLERANCE_DEG, "360", " and in degrees"),
        ] {
            let jumps = |step: &f64| (step.abs() - turn).abs() < slack && step.abs() > WRAP_LEAST_STEPS * usual;
            let Some(first) = steps.iter().position(jumps) else {
                continue;
            };
            // The message gives the first jump and the number of all.
            let n = steps.iter().filter(|step| jumps(step)).count();
            let times = if n == 1 { "once" } else { "first" };
            let all = if n == 1 {
                String::new()
            } else {
                format!(", {n} times in all")
            };
            return Some(RecordingNote::warning(format!(
                "`{name}` in {} jumps by {name_of_turn}, {times} from {} to {} at t = {} s (line {}){all}: the angle \
                 seems to be wrapped{besides}. Derivatives and filters treat the jumps as motion. Record the angle \
                 without jumps, or add full turns.",
                self.file(),
                q[first],
                q[first + 1],
                time[first + 1],
                self.line(first + 1).unwrap_or(0),
            )));
        }
        None
    }

    /// Warnings about rates and accelerations that are not the derivatives of the recorded signal before them, one for
    /// each explanation; and whether any rates are.
    fn rate_mismatch_notes(&self, coordinates: &[(String, bool)], time: &[f64]) -> (Vec<RecordingNote>, bool) {
        let mut found: Vec<(Message, Vec<String>, Vec<String>, f64)> = Vec::new();
        let mut settled = false;
        for (name, is_angle) in coordinates {
            // Rates are compared with positions, accelerations with rates.
            for (of, rate) in [("", "_d"), ("_d", "_dd")] {
                let [of, rate] = [of, rate].map(|suffix| format!("{name}{suffix}"));
                let (Ok(q), Ok(qd)) = (self.column(&of), self.column(&rate)) else {
                    continue;
                };
                let Some((ratio, misfit)) = compare_rate(time, q, qd) else {
                    continue;
                };
                // The column is the derivative.
                if misfit < RATE_MOST_MISFIT && (ratio - 1.0).abs() < RATE_RATIO_TOLERANCE {
                    settled = true;
                    continue;
                }
                // A ratio has an explanation only if the rate is a multiple of the derivative.
                let why = if misfit < RATE_MOST_MISFIT {
                    explain_ratio(ratio, *is_angle)
                } else {
                    Message::new()
                };
                // Columns with the same explanation and ratio share one warning.
                match found.iter_mut().find(|(other, .., r)| {
                    *other == why && (why.is_empty() || (r / ratio - 1.0).abs() < SAME_RATIO_TOLERANCE)
                }) {
                    Some((_, ofs, rates, _)) => {
                        ofs.push(of);
                        rates.push(rate);
                    }
                    None => found.push((why, vec![of], vec![rate], ratio)),
                }
            }
        }
        // One sentence for all columns with the same explanation.
        let notes = found.into_iter().map(|(why, ofs, rates, ratio)| {
            let (is, derivative) = if rates.len() == 1 {
                ("is", "the derivative")
            } else {
                ("are", "the derivatives")
            };
            // Without an explanation the columns may be mixed up.
            let how = if why.is_empty() {
                message!(
                    "nor a multiple of it: check which column is which ({})",
                    Remedy::option(OptionName::Columns)
                )
            } else {
                message!("but about {} times as large: {}", with_digits(ratio, 3), why)
            };
            RecordingNote::warning(message!(
                "{} in {} {is} not {derivative} of {} with respect to `t`, {}. Correct the columns, or compute \
                 derivatives from the positions ({}).",
                backquoted_list(&rates),
                self.file(),
                backquoted_list(&ofs),
                how,
                Remedy::option(OptionName::Source).with_value("positions"),
            ))
        });
        (notes.collect(), settled)
    }
}

/// Ratio of a rate to the derivative of a position, and the share of the rate's integral that the position does not
/// explain; `None` if the position hardly moves or is mostly noise.
///
/// The integral of the rate is compared with the position, since differences of the position would amplify its noise.
/// Each segment between gaps is compared relative to its own mean.
fn compare_rate(time: &[f64], position: &[f64], rate: &[f64]) -> Option<(f64, f64)> {
    let usual = median(time.windows(2).map(|w| w[1] - w[0]).collect());
    let (mut qq, mut qi, mut ii, mut steps) = (0.0, 0.0, 0.0, 0.0);
    let largest = position.iter().fold(0.0_f64, |most, q| most.max(q.abs()));
    let mut start = 0;
    for end in 1..=time.len() {
        // Continue up to a gap or the end.
        if end < time.len() && time[end] - time[end - 1] <= GAP_LEAST_STEPS * usual {
            continue;
        }
        // Trapezoidal rule.
        let mut integral = vec![0.0];
        for i in start + 1..end {
            let sum = integral[i - start - 1];
            integral.push(sum + 0.5 * (rate[i] + rate[i - 1]) * (time[i] - time[i - 1]));
            steps += (position[i] - position[i - 1]).powi(2);
        }
        // Sums of squares and products of the deviations from the means.
        let n = (end - start) as f64;
        let mean_q = position[start..end].iter().sum::<f64>() / n;
        let mean_i = integral.iter().sum::<f64>() / n;
        for (q, sum) in position[start..end].iter().zip(&integral) {
            let (q, sum) = (q - mean_q, sum - mean_i);
            qq += q * q;
            qi += q * sum;
            ii += sum * sum;
        }
        start = end;
    }
    // A coordinate at standstill away from zero differs from its mean by rounding, which is no motion.
    let rounding = (1e-12 * largest).powi(2) * time.len() as f64;
    // A signal that changes as much between samples as in total is noise, or sampled too coarsely.
    if time.len() < RATE_FEWEST_SAMPLES || qq <= rounding || steps > RATE_MOST_NOISE * qq {
        return None;
    }
    // The rate is zero, although the position moves.
    if ii <= 0.0 {
        return Some((0.0, 1.0));
    }
    // Least squares ratio, and the share that a linear relation does not explain.
    let ratio = qi / qq;
    Some((ratio, (1.0 - qi * qi / (qq * ii)).max(0.0).sqrt()))
}

/// The unit error that explains a ratio of a rate to the derivative of its position, as a clause of a sentence.
/// Empty if the ratio is 1; a negative ratio adds that the signs differ.
fn explain_ratio(ratio: f64, is_angle: bool) -> Message {
    let degree = 180.0 / PI;
    // Whether the ratio is near a value, with either sign.
    let is = |value: f64| (ratio.abs() / value - 1.0).abs() < RATE_RATIO_TOLERANCE;
    let why = if is(1.0) {
        Message::new()
    } else if is(degree) && is_angle {
        "it seems to be in degrees, and the signal that it is the derivative of in rad".into()
    } else if is(1.0 / degree) && is_angle {
        "the signal that it is the derivative of seems to be in degrees".into()
    } else if is(1e3) && is_angle {
        "time seems to be in ms, and must be in s".into()
    } else if is(1e3) {
        "time seems to be in ms, or one of both lengths is in mm and the other in m".into()
    } else if is(1e3 * degree) && is_angle {
        "time seems to be in ms and the rate in degrees".into()
    } else if is(1e3 / degree) && is_angle {
        "time seems to be in ms and the angle in degrees".into()
    } else if is(1e6) {
        "time seems to be in microseconds, and must be in s".into()
    } else if is(1e-3) && !is_angle {
        "lengths seem to be in mm, and must be in m".into()
    } else if is(30.0 / PI) && is_angle {
        "it seems to be in revolutions per minute, and must be in rad/s".into()
    } else if is(0.5 / PI) && is_angle {
        "it seems to be in revolutions per second, and must be in rad/s".into()
    } else {
        message!(
            "check the units (rad, m, s) and which column is which ({})",
            Remedy::option(OptionName::Columns)
        )
    };
    if ratio < 0.0 {
        // The sign is reported in addition to the unit.
        let and = if why.is_empty() { "" } else { ", and " };
        return message!("the signs differ{and}{}", why);
    }
    why
}

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;

    use super::*;
    use crate::test_noise::TestNoise;
    use crate::{ReadOptions, StatePreparation};

    /// A recording of one angle with its rate, each number by its own function of the time.
    fn recording(
        samples: u32,
        time: impl Fn(f64) -> f64,
        q: impl Fn(f64) -> f64,
        qd: impl Fn(f64) -> f64,
    ) -> SignalRecording {
        let mut text = "t,q,q_d,motor\n".to_owned();
        for i in 0..samples {
            let t = f64::from(i) * 0.004;
            let _ = writeln!(text, "{},{},{},{}", time(t), q(t), qd(t), t.sin());
        }
        SignalRecording::from_reader(text.as_bytes(), "run.csv", &ReadOptions::default()).unwrap()
    }

    fn says(recording: &SignalRecording) -> String {
        recording
            .suspicious_columns(&[("q".to_owned(), true)], DerivativeSource::RecordedFirst)
            .iter()
            .map(|note| note.says.in_library_words())
            .collect::<Vec<_>>()
            .join("\n")
    }

    #[track_caller]
    fn check(recording: &SignalRecording, expected: &str) {
        let says = says(recording);
        if expected.is_empty() {
            assert_eq!(says, "");
        } else {
            assert!(says.contains(expected), "{says}");
            assert_eq!(says.lines().count(), 1, "{says}");
        }
    }

    const A: f64 = 1.7;
    fn q(t: f64) -> f64 {
        (A * t).sin() + 0.3 * (3.1 * t).cos()
    }
    fn qd(t: f64) -> f64 {
        A * (A * t).cos() - 0.93 * (3.1 * t).sin()
    }

    #[test]
    fn slips_of_units_are_named() {
        let n = 2000;
        check(&recording(n, |t| t, q, qd), "");
        check(&recording(n, |t| t, q, |t| qd(t).to_degrees()), "about 57.3 times");
        check(&recording(n, |t| t, q, |t| qd(t).to_degrees()), "degrees");
        check(&recording(n, |t| 1e3 * t, q, qd), "time seems to be in ms");
        check(&recording(n, |t| t, q, |t| -qd(t)), "the signs differ");
        check(&recording(n, |t| t, q, |t| 2.0 * qd(t)), "check the units");
        check(&recording(n, |t| t, q, |t| (7.0 * t).sin()), "which column is which");
    }

    #[test]
    fn noise_bias_and_coarse_steps_are_no_suspicion() {
        let noise = std::cell::RefCell::new(TestNoise::new(3));
        let draw = |size: f64| size * noise.borrow_mut().normal();
        // A quantised and noisy position, a rate with noise and some offset.
        let rough = recording(
            5000,
            |t| t,
            |t| (q(t) * 2000.0).round() / 2000.0 + draw(1e-3),
            |t| qd(t) + 0.01 + draw(0.3),
        );
        check(&rough, "");
        let coarse = recording(300, |t| t, |t| q(40.0 * t), |t| 40.0 * qd(40.0 * t));
        check(&coarse, "");
        for rest in [0.0, 1.0, 0.3, -0.7] {
            check(&recording(500, |t| t, |_| rest, |_| 0.0), "");
        }
    }

    #[test]
    fn time_in_milliseconds_is_seen_without_rates() {
        let slow = recording(500, |t| 1e3 * t, q, qd);
        let notes = slow.suspicious_columns(&[("q".to_owned(), true)], DerivativeSource::Positions);
        assert!(
            notes.len() == 1
                && notes[0]
                    .says
                    .in_library_words()
                    .contains("if they are in ms, convert them"),
            "{notes:?}"
        );
    }

    #[test]
    fn a_wrapped_angle_is_named_with_its_line() {
        let wrap = |t: f64| (0.8 * t + PI).rem_euclid(2.0 * PI) - PI;
        let wrapped = recording(4000, |t| t, wrap, |_| 0.8);
        let notes = wrapped.suspicious_columns(&[("q".to_owned(), true)], DerivativeSource::Positions);
        assert!(
            notes.len() == 1
                && notes[0].says.in_library_words().contains("jumps by 2 pi")
                && notes[0].says.in_library_words().contains("2 times in all")
                && notes[0].says.in_library_words().contains("(line 984)"),
            "{notes:?}"
        );
        // A length may jump as it likes.
        assert_eq!(
            wrapped.suspicious_columns(&[("q".to_owned(), false)], DerivativeSource::Positions),
            []
        );
    }

    /// Two segments with a second between them: each is prepared on its own, so no rate shows the jump.
    #[test]
    fn nothing_is_filtered_across_a_gap() {
        let broken = recording(
            3000,
            |t| if t < 5.0 { t } else { t + 1.0 },
            |t| if t < 5.0 { q(t) } else { q(t) + 2.0 },
            qd,
        );
        let names = ["q".to_owned()];
        let drives = ["motor".to_owned()];
        let positions = StatePreparation {
            source: DerivativeSource::Positions,
            ..StatePreparation::default()
        };
        let runs = broken.runs_with(&names, &drives, &positions).unwrap();
        assert_eq!(runs.len(), 2);
        assert!(
            runs[0].notes[0].says.in_library_words().contains("1 gap")
                && runs[0].notes[0].says.in_library_words().contains("after line 1251"),
            "{:?}",
            runs[0].notes
        );
        for (run, shift) in runs.iter().zip([0.0, 1.0]) {
            for (t, v) in run.time.iter().zip(&run.qd[0]) {
                assert!((v - qd(t - shift)).abs() < 0.02, "{v} at {t}");
            }
        }
        assert_eq!(runs[0].prepared.cutoff_hz, runs[1].prepared.cutoff_hz);
        assert_eq!(runs[1].lines.len(), runs[1].samples());
        // Recorded rates need no filter, hence no cut.
        let recorded = recording(100, |t| if t < 0.2 { t } else { t + 1.0 }, q, qd);
        assert_eq!(recorded.split_at_gaps(0.0).len(), 2);
    }
}
