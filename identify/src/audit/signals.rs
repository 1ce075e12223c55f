//! What looks wrong with single signals of a recording: values that are held over several samples, forces that stay at
//! a limit, angles too large for rad.

use std::f64::consts::PI;

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, Remedy};

use crate::recording::{RecordingNote, SignalRecording, sample_place_word};
use crate::signal::white_noise;
use crate::words::{count_of, seven_digits, with_digits};

/// Angles beyond this many rad are likely in degrees: two turns to each side.
const LARGE_ANGLE: f64 = 4.0 * PI;
/// Samples at a limit before a force counts as saturated.
const FEWEST_AT_LIMIT: usize = 8;
/// And so many times as many as at the value next to it: the crest of a wave is at its last step 2.4 times as long as at the one
/// before.
const CROWDED: usize = 3;

/// Noise about a limit, in standard deviations of white noise.
const SPREAD: f64 = 5.0;
/// What slope times length of a plateau must be of its spread; 8 for the top of a parabola.
const STEEP: f64 = 30.0;

/// Spread of a limit, as a part of it, at most.
const SHARP: f64 = 0.01;

impl SignalRecording {
    /// Warnings about single signals. `coordinates` are `(name, whether it is an angle)`; columns that cannot be used
    /// are passed over.
    pub fn signal_notes(
        &self,
        coordinates: &[(String, bool)],
        drives: &[String],
    ) -> Vec<RecordingNote> {
        let positions: Vec<&[f64]> = coordinates
            .iter()
            .filter_map(|(name, _)| self.column(name).ok())
            .collect();
        let mut notes = Vec::new();
        for (name, is_angle) in coordinates {
            let Ok(q) = self.column(name) else { continue };
            notes.extend(self.slow_update_note(name, q));
            if *is_angle {
                notes.extend(self.large_angle_note(name, q));
            }
        }
        for drive in drives {
            let Ok(force) = self.column(drive) else {
                continue;
            };
            notes.extend(self.slow_update_note(drive, force));
            let saturated = self.saturation_note(drive, force, &positions);
            notes
                .extend(saturated.or_else(|| self.noisy_saturation_note(drive, force, &positions)));
        }
        notes
    }

    /// A signal that changes only every so many samples was recorded at a lower rate than it is written.
    fn slow_update_note(&self, name: &str, values: &[f64]) -> Option<RecordingNote> {
        let changes: Vec<usize> = (1..values.len())
            .filter(|i| values[*i].total_cmp(&values[i - 1]).is_ne())
            .collect();
        if changes.len() < 20 {
            return None;
        }
        let mut gaps: Vec<usize> = changes.windows(2).map(|w| w[1] - w[0]).collect();
        let n = gaps.len();
        gaps.sort_unstable();
        let usual = gaps[n / 2];
        let share = gaps.iter().filter(|gap| **gap == usual).count() as f64 / n as f64;
        (usual > 1 && share > 0.9).then(|| {
            RecordingNote::warning(message!(
                "`{name}` in {} changes only every {usual} samples: each value is repeated, so it was recorded at a lower \
                 rate than it is written. Rates from such steps are wrong: keep one sample of each, or a lower cut-off \
                 ({}).",
                self.file(),
                Remedy::option(OptionName::CutoffHz),
            ))
        })
    }

    fn large_angle_note(&self, name: &str, q: &[f64]) -> Option<RecordingNote> {
        let largest = q.iter().map(|v| v.abs()).fold(0.0, f64::max);
        let rounded = |value: f64| match value {
            value if value < 1e7 => format!("{value:.1}"),
            value => seven_digits(value),
        };
        (largest > LARGE_ANGLE).then(|| {
            RecordingNote::warning(message!(
                "`{name}` in {} reaches {}, which is {} turns if it is in rad, as it must be; if it is in \
                 degrees, say so: {}.",
                self.file(),
                rounded(largest),
                rounded(largest / (2.0 * PI)),
                Remedy::options(self.degree_conversion_options(name))
            ))
        })
    }

    /// A force that stays at a limit but for noise, although it comes to it and leaves it at a slope.
    fn noisy_saturation_note(
        &self,
        name: &str,
        force: &[f64],
        positions: &[&[f64]],
    ) -> Option<RecordingNote> {
        let n = force.len();
        if n < 20 * FEWEST_AT_LIMIT {
            return None;
        }
        let mut found: Vec<(f64, usize, usize)> = Vec::new();
        for is_high in [true, false] {
            let (level, spread) = crowded_level(force, is_high)?;
            // Friction holds a level too, but not as sharply.
            if spread > SHARP * level.abs() {
                continue;
            }
            // Nothing lies beyond a limit but noise.
            let sign = if is_high { 1.0 } else { -1.0 };
            let beyond = force.iter().filter(|f| sign * (*f - level) > spread);
            if beyond.count() > n / 1000 {
                continue;
            }
            let is_near = |i: usize| (force[i] - level).abs() <= spread;
            let (mut count, mut first) = (0, None);
            let mut i = 0;
            while i < n {
                let start = i;
                while i < n && is_near(i) {
                    i += 1;
                }
                let length = i - start;
                // Before the first sample of a plateau and behind its last one, over a few samples.
                let slope = |a: Option<usize>, b: usize| {
                    let (a, b) = (force.get(a?)?, force.get(b)?);
                    Some((a - b).abs() / 3.0)
                };
                let before = slope(start.checked_sub(4), start.saturating_sub(1));
                let behind = slope(Some(i + 3), i);
                let steepest = [before, behind].into_iter().flatten().fold(0.0, f64::max);
                // A parabola that leaves the band has 8 times its half width in slope times length.
                let moves = |q: &&[f64]| length > 0 && q[start].total_cmp(&q[i - 1]).is_ne();
                let is_moving = positions.iter().any(moves);
                if is_moving
                    && length >= FEWEST_AT_LIMIT
                    && steepest * length as f64 > STEEP * spread
                {
                    count += length;
                    first.get_or_insert(start);
                }
                i = i.max(start + 1);
            }
            if let Some(first) = first {
                found.push((level, count, first));
            }
        }
        let (level, count, first) = *found.first()?;
        let other = found.get(1).map(|(level, count, _)| {
            let samples = count_of(*count, "sample", "samples");
            format!(", and {samples} at {}", with_digits(*level, 5))
        });
        Some(RecordingNote::warning(message!(
            "The force of `{name}` in {} stays at {} but for noise for {}, first in {} {}{}: the drive or its measurement seems \
             to be saturated. The true force is not known there; use a gentler motion, or leave these times out ({}).",
            self.file(),
            with_digits(level, 5),
            count_of(count, "sample", "samples"),
            sample_place_word(self.file()),
            self.line(first).unwrap_or(0),
            other.unwrap_or_default(),
            Remedy::option(OptionName::Between),
        )))
    }

    /// A force that stays exactly at its largest or smallest value while something moves.
    fn saturation_note(
        &self,
        name: &str,
        force: &[f64],
        positions: &[&[f64]],
    ) -> Option<RecordingNote> {
        let low = force.iter().copied().fold(f64::INFINITY, f64::min);
        let high = force.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if low >= high {
            // Forces of 0 are said beside the drives' other ones, by `zero_force_notes`.
            return (force.len() > 1 && low != 0.0).then(|| {
                RecordingNote::warning(format!(
                    "The force of `{name}` in {} is {low} throughout: it is no measurement of a drive that works.",
                    self.file()
                ))
            });
        }
        // The highest value below the upper end, and the lowest above the lower one.
        let below = force.iter().copied().filter(|x| *x < high);
        let above = force.iter().copied().filter(|x| *x > low);
        let ends = [
            (high, below.fold(f64::NEG_INFINITY, f64::max)),
            (low, above.fold(f64::INFINITY, f64::min)),
        ];
        let mut found: Vec<(f64, usize, usize)> = Vec::new();
        for (limit, next) in ends {
            let (count, first) = count_at_value(force, limit, positions);
            // A force that is read in coarse steps stays at each of them.
            let (at_next, _) = count_at_value(force, next, positions);
            if let Some(first) = first
                && count >= FEWEST_AT_LIMIT
                && count > CROWDED * at_next
            {
                found.push((limit, count, first));
            }
        }
        let (limit, count, first) = *found.first()?;
        let other = found
            .get(1)
            .map(|(limit, count, _)| {
                let samples = count_of(*count, "sample", "samples");
                format!(", and {samples} at {}", format_recorded(*limit))
            })
            .unwrap_or_default();
        Some(RecordingNote::warning(message!(
            "The force of `{name}` in {} stays exactly at {} for {} while the mechanism moves, first in {} {}{other}: \
             the drive or its measurement seems to be saturated. The true force is not known there; use a gentler motion, \
             or leave these times out ({}).",
            self.file(),
            format_recorded(limit),
            count_of(count, "sample", "samples"),
            sample_place_word(self.file()),
            self.line(first).unwrap_or(0),
            Remedy::option(OptionName::Between),
        )))
    }
}

/// Samples in which a force stays exactly at a value, three of them or more one after the other, while something moves; and the first.
fn count_at_value(force: &[f64], value: f64, positions: &[&[f64]]) -> (usize, Option<usize>) {
    let (mut count, mut first) = (0, None);
    let mut i = 0;
    while i < force.len() {
        let start = i;
        while i < force.len() && force[i].total_cmp(&value).is_eq() {
            i += 1;
        }
        let moves = |q: &&[f64]| i > start && q[start].total_cmp(&q[i - 1]).is_ne();
        if i - start >= 3 && positions.iter().any(moves) {
            count += i - start;
            first.get_or_insert(start);
        }
        i = i.max(start + 1);
    }
    (count, first)
}

/// A level near an end of the range of a force at which samples crowd: its value and how far they spread about it.
fn crowded_level(force: &[f64], is_high: bool) -> Option<(f64, f64)> {
    let mut sorted = force.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    if !is_high {
        sorted.reverse();
    }
    let n = sorted.len();
    let few = (n / 100).max(FEWEST_AT_LIMIT);
    let upper = &sorted[n - n / 3..];
    let crowd = (0..upper.len().checked_sub(few)?).min_by(|a, b| {
        let width = |i: usize| (upper[i + few] - upper[i]).abs();
        width(*a).total_cmp(&width(*b))
    })?;
    let width = (upper[crowd + few] - upper[crowd]).abs();
    let level = upper[crowd + few / 2];
    Some((level, (SPREAD * white_noise(force)).max(2.0 * width)))
}

/// A recorded number as it stands in the file, unless it is very long.
fn format_recorded(value: f64) -> String {
    if value.abs() < 1e12 {
        value.to_string()
    } else {
        seven_digits(value)
    }
}

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;

    use super::*;
    use crate::ReadOptions;
    use modelmill_boundary::text::LibrarySpelling;

    fn says(q: impl Fn(f64) -> f64, force: impl Fn(f64) -> f64) -> Vec<String> {
        let mut text = "t,q,motor\n".to_owned();
        for i in 0..1000 {
            let t = f64::from(i) * 0.002;
            let _ = writeln!(text, "{t},{},{}", q(t), force(t));
        }
        let recording =
            SignalRecording::from_reader(text.as_bytes(), "run.csv", &ReadOptions::default())
                .unwrap();
        let notes = recording.signal_notes(&[("q".to_owned(), true)], &["motor".to_owned()]);
        let says = notes.iter().map(|note| note.says.in_library_words());
        says.collect()
    }

    #[test]
    fn sound_signals_raise_no_suspicion() {
        let none: Vec<String> = Vec::new();
        assert_eq!(says(|t| (3.0 * t).sin(), |t| 20.0 * (7.0 * t).cos()), none);
        // A coarse encoder repeats values too, but as the speed has it.
        assert_eq!(
            says(
                |t| ((3.0 * t).sin() * 100.0).round() / 100.0,
                |t| 20.0 * (7.0 * t).cos()
            ),
            none
        );
        // A force in coarse steps stays at each of them.
        for step in [1.5, 3.0, 6.0] {
            let force = |t: f64| (20.0 * (7.0 * t).cos() / step).round() * step;
            assert_eq!(says(|t| (3.0 * t).sin(), force), none, "{step}");
        }
        // At rest a force may stay where it is.
        assert_eq!(
            says(
                |t| if t < 1.0 { 0.3 } else { t },
                |t| if t < 1.0 { 9.0 } else { 8.0 - t }
            ),
            none
        );
    }

    #[test]
    fn a_clipped_force_is_named_with_its_limit_and_line() {
        let found = says(
            |t| (3.0 * t).sin(),
            |t| (20.0 * (7.0 * t).sin()).clamp(-15.0, 15.0),
        );
        assert_eq!(found.len(), 1);
        assert!(
            found[0].contains("stays exactly at 15") && found[0].contains("at -15"),
            "{found:?}"
        );
        let found = says(
            |t| (3.0 * t).sin(),
            |t| (20.0 * (7.0 * t).sin()).clamp(-15.0, 15.0) + 1e-3 * (9e4 * t).sin(),
        );
        assert!(
            found.len() == 1 && found[0].contains("but for noise"),
            "{found:?}"
        );
        let found = says(
            |t| (3.0 * t).sin(),
            |t| (20.0 * (7.0 * t).sin()).clamp(-15.0, 15.0),
        );
        let coarse = |t: f64| ((20.0 * (7.0 * t).sin()).clamp(-15.0, 15.0) / 1.5).round() * 1.5;
        let of_steps = says(|t| (3.0 * t).sin(), coarse);
        assert!(of_steps[0].contains("stays exactly at 15"), "{of_steps:?}");
        // sin(7 t) passes 3/4 at t = 0.1212 s, in the 61st sample, on line 63.
        assert!(found[0].contains("first in line 63"), "{found:?}");
    }

    /// Recorded rates go along, unless they are in rad already.
    #[test]
    fn rates_in_degrees_are_named_with_their_angles() {
        let of = |scale: f64| {
            let mut text = "t,q,q_d,q_dd\n".to_owned();
            for k in 0..400 {
                let t = 0.01 * f64::from(k);
                let (sin, cos) = (3.0 * t).sin_cos();
                let (q, rate, acceleration) = (900.0 * sin, 2700.0 * cos, -8100.0 * sin);
                writeln!(text, "{t},{q},{},{}", scale * rate, scale * acceleration).unwrap();
            }
            let recording =
                SignalRecording::from_bytes(text.as_bytes(), "run.csv", &ReadOptions::default());
            Remedy::options(recording.unwrap().degree_conversion_options("q"))
                .spell(&LibrarySpelling)
        };
        assert_eq!(
            of(1.0),
            "option `columns` = `q=q [deg]` option `columns` = `q_d=q_d [deg/s]` option `columns` = `q_dd=q_dd [deg/s^2]`"
        );
        assert_eq!(of(PI / 180.0), "option `columns` = `q=q [deg]`");
    }

    #[test]
    fn held_values_degrees_and_dead_forces_are_named() {
        let held = says(
            |t| (3.0 * (t / 0.008 + 1e-9).floor() * 0.008).sin(),
            |t| (5.0 * t).sin(),
        );
        assert!(
            held.len() == 1 && held[0].contains("every 4 samples"),
            "{held:?}"
        );
        let degrees = says(|t| 90.0 * (3.0 * t).sin(), |t| (5.0 * t).sin());
        assert!(
            degrees.len() == 1 && degrees[0].ends_with("say so: option `columns` = `q=q [deg]`."),
            "{degrees:?}"
        );
        let dead = says(|t| (3.0 * t).sin(), |_| 4.0);
        assert!(
            dead.len() == 1 && dead[0].contains("is 4 throughout"),
            "{dead:?}"
        );
    }
}
