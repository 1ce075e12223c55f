//! Single signals that look wrong: values that are repeated over several samples, forces that stay at a limit, angles
//! too large for rad. Input: a recording; output: warnings.

use std::f64::consts::PI;

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, Remedy};

use super::thresholds::{
    BEYOND_LIMIT_ONE_IN, EXACT_LIMIT_SHORTEST_RUN, FEWEST_AT_LIMIT, LARGE_ANGLE_RAD, LIMIT_BAND_MOST_SHARE,
    LIMIT_BAND_SIGMAS, LIMIT_BAND_WIDTHS, LIMIT_CROWDING, MOVING_LEAST_SPEED_SHARE, NOISY_LIMIT_FEWEST_SAMPLES,
    NOISY_LIMIT_ONE_IN, PLATEAU_STEEPNESS, SLOW_UPDATE_FEWEST_CHANGES, SLOW_UPDATE_SHARE, TOP_SPEED_WINDOWS,
};
use crate::recording::{RecordingNote, SignalRecording, sample_place_word};
use crate::signal::white_noise;
use crate::words::{count_of, seven_digits, with_digits};

impl SignalRecording {
    /// Warnings about single signals. `coordinates` are `(name, whether it is an angle)`; columns that cannot be used
    /// are skipped.
    pub fn signal_notes(&self, coordinates: &[(String, bool)], drives: &[String]) -> Vec<RecordingNote> {
        // Positions show whether the mechanism moves.
        let positions: Vec<PositionSignal<'_>> = coordinates
            .iter()
            .filter_map(|(name, _)| self.column(name).ok())
            .map(PositionSignal::new)
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
            // An exact limit is searched first; only without one a noisy limit.
            let saturated = self.saturation_note(drive, force, &positions);
            notes.extend(saturated.or_else(|| self.noisy_saturation_note(drive, force, &positions)));
        }
        notes
    }

    /// Warning about a signal that changes only every n samples: it was recorded at a lower rate than the file. `None`
    /// otherwise.
    fn slow_update_note(&self, name: &str, values: &[f64]) -> Option<RecordingNote> {
        let changes: Vec<usize> = (1..values.len())
            .filter(|i| values[*i].total_cmp(&values[i - 1]).is_ne())
            .collect();
        if changes.len() < SLOW_UPDATE_FEWEST_CHANGES {
            return None;
        }
        // Distances between changes: at least nine of ten must be equal and above one sample.
        let mut gaps: Vec<usize> = changes.windows(2).map(|w| w[1] - w[0]).collect();
        let n = gaps.len();
        gaps.sort_unstable();
        let usual = gaps[n / 2];
        // Most distances are equal if the signal is updated at a fixed rate.
        let share = gaps.iter().filter(|gap| **gap == usual).count() as f64 / n as f64;
        (usual > 1 && share > SLOW_UPDATE_SHARE).then(|| {
            RecordingNote::warning(message!(
                "`{name}` in {} changes only every {usual} samples: each value is repeated, so the signal was recorded at \
                 a lower rate than the file. Rates computed from such steps are wrong. Keep one sample of each value, or \
                 use a lower cut-off ({}).",
                self.file(),
                Remedy::option(OptionName::CutoffHz),
            ))
        })
    }

    /// Warning about an angle that is too large for rad; `None` otherwise.
    fn large_angle_note(&self, name: &str, q: &[f64]) -> Option<RecordingNote> {
        let largest = q.iter().map(|v| v.abs()).fold(0.0, f64::max);
        // One decimal, or seven digits for very large values.
        let rounded = |value: f64| match value {
            value if value < 1e7 => format!("{value:.1}"),
            value => seven_digits(value),
        };
        (largest > LARGE_ANGLE_RAD).then(|| {
            RecordingNote::warning(message!(
                "`{name}` in {} reaches {}, which is {} turns in rad. Angles must be in rad; if it is in degrees, \
                 use {}.",
                self.file(),
                rounded(largest),
                rounded(largest / (2.0 * PI)),
                Remedy::options(self.degree_conversion_options(name))
            ))
        })
    }

    /// Warning about a force that stays at a limit except for noise, although it reaches and leaves the limit with a
    /// slope.
    fn noisy_saturation_note(
        &self,
        name: &str,
        force: &[f64],
        positions: &[PositionSignal<'_>],
    ) -> Option<RecordingNote> {
        let n = force.len();
        if n < NOISY_LIMIT_FEWEST_SAMPLES {
            return None;
        }
        let mut found: Vec<(f64, usize, usize)> = Vec::new();
        // Search an upper and a lower limit: level, number of samples, first sample.
        for is_high in [true, false] {
            let (level, spread) = crowded_level(force, is_high)?;
            // Friction causes plateaus too, but they are less sharp.
            if spread > LIMIT_BAND_MOST_SHARE * level.abs() {
                continue;
            }
            // Only noise lies beyond a limit.
            let sign = if is_high { 1.0 } else { -1.0 };
            let beyond = force.iter().filter(|f| sign * (*f - level) > spread);
            if beyond.count() > n / BEYOND_LIMIT_ONE_IN {
                continue;
            }
            // Whether a sample lies within the band around the level.
            let is_near = |i: usize| (force[i] - level).abs() <= spread;
            let (mut count, mut first) = (0, None);
            let mut i = 0;
            // Find all runs of samples within the band.
            while i < n {
                let start = i;
                while i < n && is_near(i) {
                    i += 1;
                }
                // A plateau from `start` to `i`.
                let length = i - start;
                // Slopes just before and just after the plateau, over three steps.
                // Change per sample over three samples; `None` at the ends of the recording.
                let slope = |a: Option<usize>, b: usize| {
                    let (a, b) = (force.get(a?)?, force.get(b)?);
                    Some((a - b).abs() / 3.0)
                };
                let before = slope(start.checked_sub(4), start.saturating_sub(1));
                let behind = slope(Some(i + 3), i);
                let steepest = [before, behind].into_iter().flatten().fold(0.0, f64::max);
                // At the top of a parabola, slope times length is 8 times the half width of the band; a plateau has
                // more.
                let is_moving = positions.iter().any(|q| length > 0 && q.moves_between(start, i - 1));
                if is_moving && length >= FEWEST_AT_LIMIT && steepest * length as f64 > PLATEAU_STEEPNESS * spread {
                    count += length;
                    first.get_or_insert(start);
                }
                i = i.max(start + 1);
            }
            if let Some(first) = first {
                found.push((level, count, first));
            }
        }
        // The upper limit is named first; the lower one is added if both were found.
        let (level, count, first) = *found.first()?;
        let other = found.get(1).map(|(level, count, _)| {
            let samples = count_of(*count, "sample", "samples");
            format!(", and {samples} at {}", with_digits(*level, 5))
        });
        Some(RecordingNote::warning(message!(
            "The force of `{name}` in {} stays at {} except for noise for {}, first in {} {}{}: the drive or its \
             measurement seems to be saturated. The true force is unknown there. Record a motion with smaller \
             forces, or leave these times out ({}).",
            self.file(),
            with_digits(level, 5),
            count_of(count, "sample", "samples"),
            sample_place_word(self.file()),
            self.line(first).unwrap_or(0),
            other.unwrap_or_default(),
            Remedy::option(OptionName::Between),
        )))
    }

    /// Warning about a force that stays exactly at its largest or smallest value while the mechanism moves, or is
    /// constant.
    fn saturation_note(&self, name: &str, force: &[f64], positions: &[PositionSignal<'_>]) -> Option<RecordingNote> {
        let low = force.iter().copied().fold(f64::INFINITY, f64::min);
        let high = force.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if low >= high {
            // Forces of 0 are reported for all drives together, by `zero_force_notes`.
            return (force.len() > 1 && low != 0.0).then(|| {
                RecordingNote::warning(message!(
                    "The force of `{name}` in {} is {low} in every sample. The force of a working drive is never constant. \
                     Check which column is the force ({}).",
                    self.file(),
                    Remedy::option(OptionName::Columns),
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
        // Compare the limit with the next value inside.
        for (limit, next) in ends {
            let (count, first) = count_at_value(force, limit, positions);
            // A quantised force stays at each of its steps.
            let (at_next, _) = count_at_value(force, next, positions);
            if let Some(first) = first
                && count >= FEWEST_AT_LIMIT
                && count > LIMIT_CROWDING * at_next
            {
                found.push((limit, count, first));
            }
        }
        // Both limits are in one message.
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
             the drive or its measurement seems to be saturated. The true force is unknown there. Record a motion with smaller \
             forces, or leave these times out ({}).",
            self.file(),
            format_recorded(limit),
            count_of(count, "sample", "samples"),
            sample_place_word(self.file()),
            self.line(first).unwrap_or(0),
            Remedy::option(OptionName::Between),
        )))
    }
}

/// The recorded positions of a coordinate, with its top speed.
struct PositionSignal<'a> {
    values: &'a [f64],
    /// The largest mean speed over a window of the recording, per sample.
    top_speed: f64,
}

impl<'a> PositionSignal<'a> {
    fn new(values: &'a [f64]) -> Self {
        let window = (values.len() / TOP_SPEED_WINDOWS).max(1);
        let speeds = (window..values.len()).map(|i| (values[i] - values[i - window]).abs() / window as f64);
        Self {
            values,
            top_speed: speeds.fold(0.0, f64::max),
        }
    }

    /// Whether the coordinate moves noticeably within some samples: a force that is constant while all stand still is no
    /// limit of the drive.
    fn moves_between(&self, first: usize, last: usize) -> bool {
        let within = &self.values[first..=last];
        let low = within.iter().copied().fold(f64::INFINITY, f64::min);
        let high = within.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        high - low > MOVING_LEAST_SPEED_SHARE * self.top_speed * (last - first) as f64
    }
}

/// Number of samples in which a force is exactly equal to a value, in runs of three or more while a position changes;
/// and the first of them.
fn count_at_value(force: &[f64], value: f64, positions: &[PositionSignal<'_>]) -> (usize, Option<usize>) {
    let (mut count, mut first) = (0, None);
    let mut i = 0;
    while i < force.len() {
        let start = i;
        while i < force.len() && force[i].total_cmp(&value).is_eq() {
            i += 1;
        }
        // Something must move during the run of equal values.
        let moves = |q: &PositionSignal<'_>| i > start && q.moves_between(start, i - 1);
        if i - start >= EXACT_LIMIT_SHORTEST_RUN && positions.iter().any(moves) {
            count += i - start;
            first.get_or_insert(start);
        }
        i = i.max(start + 1);
    }
    (count, first)
}

/// A level near an end of the range of a force around which many samples lie: its value, and the half width of the band
/// around it.
fn crowded_level(force: &[f64], is_high: bool) -> Option<(f64, f64)> {
    let mut sorted = force.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    // In reversed order the end of interest is always the last part.
    if !is_high {
        sorted.reverse();
    }
    let n = sorted.len();
    // The narrowest interval with this many samples, within the outer third of the values.
    let few = (n / NOISY_LIMIT_ONE_IN).max(FEWEST_AT_LIMIT);
    // Only the outer third of the values can be at a limit.
    let upper = &sorted[n - n / 3..];
    let crowd = (0..upper.len().checked_sub(few)?).min_by(|a, b| {
        let width = |i: usize| (upper[i + few] - upper[i]).abs();
        width(*a).total_cmp(&width(*b))
    })?;
    let width = (upper[crowd + few] - upper[crowd]).abs();
    let level = upper[crowd + few / 2];
    let spread = (LIMIT_BAND_SIGMAS * white_noise(force)).max(LIMIT_BAND_WIDTHS * width);
    Some((level, spread))
}

/// A recorded number as it is in the file; with seven digits if it is very large.
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
    use modelmill_boundary::text::RustWording;

    fn says(q: impl Fn(f64) -> f64, force: impl Fn(f64) -> f64) -> Vec<String> {
        let mut text = "t,q,motor\n".to_owned();
        for i in 0..1000 {
            let t = f64::from(i) * 0.002;
            let _ = writeln!(text, "{t},{},{}", q(t), force(t));
        }
        let recording = SignalRecording::from_reader(text.as_bytes(), "run.csv", &ReadOptions::default()).unwrap();
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
        // At standstill a force may be constant.
        assert_eq!(
            says(
                |t| if t < 1.0 { 0.3 } else { t },
                |t| if t < 1.0 { 9.0 } else { 8.0 - t }
            ),
            none
        );
        // So it may be if the encoder has noise: a hand moves a pendulum, and holds it.
        assert_eq!(
            says(
                |t| (3.0 * t).min(2.4) + 1e-4 * (9e4 * t).sin(),
                |t| 9.0 * (3.0 * t).min(2.4).sin() * 0.5 + (3.0 * t).min(2.4) + 1e-3 * (7e4 * t).sin()
            ),
            none
        );
    }

    #[test]
    fn a_clipped_force_is_named_with_its_limit_and_line() {
        let found = says(|t| (3.0 * t).sin(), |t| (20.0 * (7.0 * t).sin()).clamp(-15.0, 15.0));
        assert_eq!(found.len(), 1);
        assert!(
            found[0].contains("stays exactly at 15") && found[0].contains("at -15"),
            "{found:?}"
        );
        let found = says(
            |t| (3.0 * t).sin(),
            |t| (20.0 * (7.0 * t).sin()).clamp(-15.0, 15.0) + 1e-3 * (9e4 * t).sin(),
        );
        assert!(found.len() == 1 && found[0].contains("except for noise"), "{found:?}");
        let found = says(|t| (3.0 * t).sin(), |t| (20.0 * (7.0 * t).sin()).clamp(-15.0, 15.0));
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
            let recording = SignalRecording::from_bytes(text.as_bytes(), "run.csv", &ReadOptions::default());
            Remedy::options(recording.unwrap().degree_conversion_options("q")).format_for(&RustWording)
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
        assert!(held.len() == 1 && held[0].contains("every 4 samples"), "{held:?}");
        let degrees = says(|t| 90.0 * (3.0 * t).sin(), |t| (5.0 * t).sin());
        assert!(
            degrees.len() == 1 && degrees[0].ends_with("if it is in degrees, use option `columns` = `q=q [deg]`."),
            "{degrees:?}"
        );
        let dead = says(|t| (3.0 * t).sin(), |_| 4.0);
        assert!(dead.len() == 1 && dead[0].contains("is 4 in every sample"), "{dead:?}");
    }
}
