//! The part of a residual that follows the time and not the state. Input: the residual of a channel. Output: what it is
//! like, if it cannot be noise: it stands out in some intervals, it is an oscillation of one frequency that comes and
//! goes, or it is too large.
//!
//! Stationary noise, white or coloured, has the same power at all times and a broad spectrum. What has not is no noise,
//! however small the part that repeats with the state.

use std::ops::Range;

use serde::Serialize;

use super::super::noise::effective_samples;
use super::super::problem::DiagnosisProblem;
use super::super::thresholds::{
    LARGE_RESIDUAL_LEAST_NOISE_RATIO, LARGE_RESIDUAL_LEAST_SHARE, LOUD_LEAST_RATIO, LOUD_LEAST_SHARE,
    LOUD_MOST_DURATION, RESONANCE_HALF_WIDTH, RESONANCE_LEAST_SHARE, RESONANCE_LOWEST_HZ, RESONANCE_MOST_LOW_SHARE,
    STANDSTILL_RATE_SHARE, TIME_RESIDUAL_LEAST_NOISE_RATIO, TOP_SPEED_QUANTILE, WINDOW_FEWEST_SAMPLES,
};
use super::ChangeInterval;
use crate::signal::dot;
use crate::signal::{float_to_count, hann_power, median};

/// Independent samples of a window.
const INDEPENDENT: f64 = 8.0;
/// Fewest windows of all recordings together.
const FEWEST_WINDOWS: usize = 12;

/// What a residual that follows the time is like.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum ResidualCharacter {
    /// It stands out in some intervals.
    Intervals,
    /// It is an oscillation about one frequency.
    Resonance,
    /// It is larger than noise can be, and nothing more is known of it.
    Large,
}

/// The residual of a channel that follows the time and not the state.
#[derive(Clone, Debug, PartialEq)]
pub struct TimeResidual {
    /// Index of the channel.
    pub channel: usize,
    /// What it is like.
    pub character: ResidualCharacter,
    /// Its rms value, N or N m; in the intervals if there are any.
    pub rms: f64,
    /// Standard deviation of the white noise of the channel, N or N m.
    pub noise: f64,
    /// Where it stands out.
    pub intervals: Vec<ChangeInterval>,
    /// Frequency of an oscillation, Hz.
    pub frequency: Option<f64>,
}

/// Tests the residual of a channel, of which the share `again` repeats with the state. `None` if it can be noise.
pub(crate) fn time_residual(
    problem: &DiagnosisProblem,
    channel: usize,
    rest: &[f64],
    again: f64,
) -> Option<TimeResidual> {
    // Near standstill dry friction takes any value, which is neither noise nor a function of the time.
    let moving = without_standstill(problem, channel, rest);
    let rest = moving.as_slice();
    let counted = rest.iter().filter(|r| **r != 0.0).count().max(1) as f64;
    let variance = dot(rest, rest) / counted * (1.0 - again);
    let noise = problem.noise[channel];
    let force = problem.measured_force(channel);
    let size = dot(&force, &force) / force.len().max(1) as f64;
    if variance < TIME_RESIDUAL_LEAST_NOISE_RATIO * noise * noise || size <= 0.0 {
        return None;
    }
    let one = |character, rms: f64| TimeResidual {
        channel,
        character,
        rms,
        noise,
        intervals: Vec::new(),
        frequency: None,
    };
    if let Some((intervals, rms)) = loud_intervals(problem, rest) {
        return Some(TimeResidual {
            intervals,
            ..one(ResidualCharacter::Intervals, rms)
        });
    }
    if let Some(frequency) = resonance(problem, rest, noise) {
        return Some(TimeResidual {
            frequency: Some(frequency),
            ..one(ResidualCharacter::Resonance, variance.sqrt())
        });
    }
    let is_large =
        variance > LARGE_RESIDUAL_LEAST_SHARE * size && variance > LARGE_RESIDUAL_LEAST_NOISE_RATIO * noise * noise;
    is_large.then(|| one(ResidualCharacter::Large, variance.sqrt()))
}

/// The squares of the residual of a channel that follow the time only, beyond the noise; 0 if it can be noise. `again` is the
/// share that repeats with the state.
pub(crate) fn squares_in_time(problem: &DiagnosisProblem, channel: usize, rest: &[f64], again: f64) -> f64 {
    let Some(found) = time_residual(problem, channel, rest, again) else {
        return 0.0;
    };
    let moving = without_standstill(problem, channel, rest);
    let counted = moving.iter().filter(|r| **r != 0.0).count() as f64;
    ((1.0 - again) * dot(&moving, &moving) - found.noise.powi(2) * counted).max(0.0)
}

/// Whether the drive of a channel stands still or nearly so, `[sample]`; empty if its rate is unknown.
pub(crate) fn standstill_samples(problem: &DiagnosisProblem, channel: usize) -> Vec<bool> {
    let rates = problem.friction.get(3 * channel);
    let Some(rates) = rates.and_then(|column| column.0[channel].as_ref()) else {
        return Vec::new();
    };
    let bound = STANDSTILL_RATE_SHARE * top_speed(rates);
    rates.iter().map(|v| v.abs() < bound).collect()
}

/// The magnitude of a rate that a drive exceeds in few samples only; 0 without samples. A single spike of a rate would
/// make slow motion a standstill.
pub fn top_speed<'a>(rates: impl IntoIterator<Item = &'a f64>) -> f64 {
    let mut speeds: Vec<f64> = rates.into_iter().map(|v| v.abs()).collect();
    if speeds.is_empty() {
        return 0.0;
    }
    let at = float_to_count(TOP_SPEED_QUANTILE * (speeds.len() - 1) as f64);
    *speeds.select_nth_unstable_by(at, f64::total_cmp).1
}

/// A residual with zeros where the drive of its channel stands still or nearly so.
fn without_standstill(problem: &DiagnosisProblem, channel: usize, rest: &[f64]) -> Vec<f64> {
    let mut moving = rest.to_vec();
    for (r, stands) in moving.iter_mut().zip(standstill_samples(problem, channel)) {
        if stands {
            *r = 0.0;
        }
    }
    moving
}

/// Intervals that have most of the squares of a residual and are far louder than the rest of the time, with the rms
/// value within them; `None` if the power of the residual is about the same at all times.
fn loud_intervals(problem: &DiagnosisProblem, rest: &[f64]) -> Option<(Vec<ChangeInterval>, f64)> {
    let layout = &problem.layout;
    let worth: f64 = segment_values(problem, rest)
        .map(|(_, part)| effective_samples(part))
        .sum();
    // A window has several independent samples, so that its power varies little in stationary noise.
    let wanted = (INDEPENDENT * rest.len() as f64 / worth.max(1.0)).max(WINDOW_FEWEST_SAMPLES);
    let windows = segment_values(problem, rest).flat_map(|(start, part)| {
        let count = (part.len() as f64 / wanted).floor().max(1.0);
        let count = float_to_count(count);
        let place = move |k: usize| start + k * part.len() / count;
        (0..count).map(move |k| place(k)..place(k + 1))
    });
    // Windows in which the drive hardly moves tell nothing.
    let counted = |range: &Range<usize>| rest[range.clone()].iter().filter(|r| **r != 0.0).count();
    let windows: Vec<Range<usize>> = windows
        .filter(|window| counted(window) as f64 >= 0.5 * WINDOW_FEWEST_SAMPLES)
        .collect();
    if windows.len() < FEWEST_WINDOWS {
        return None;
    }
    let squares: Vec<f64> = windows
        .iter()
        .map(|w| dot(&rest[w.clone()], &rest[w.clone()]))
        .collect();
    // The median of the squares, so that single outliers make no window loud.
    let power = |window: &Range<usize>| {
        let counted = rest[window.clone()].iter().filter(|r| **r != 0.0);
        median(counted.map(|r| r * r).collect())
    };
    let powers: Vec<f64> = windows.iter().map(power).collect();
    let usual = median(powers.clone());
    let loud: Vec<usize> = (0..windows.len())
        .filter(|k| powers[*k] > LOUD_LEAST_RATIO * usual)
        .collect();
    let of_loud: f64 = loud.iter().map(|k| squares[*k]).sum();
    let samples: usize = loud.iter().map(|k| counted(&windows[*k])).sum();
    let is_loud = of_loud > LOUD_LEAST_SHARE * squares.iter().sum::<f64>()
        && (samples as f64) < LOUD_MOST_DURATION * counted(&(0..rest.len())) as f64;
    if !is_loud {
        return None;
    }
    let times = layout.times();
    let names = layout
        .segments
        .iter()
        .flat_map(|s| std::iter::repeat_n(&s.name, s.samples));
    let names: Vec<&String> = names.collect();
    let mut intervals: Vec<ChangeInterval> = Vec::new();
    let mut end = None;
    for k in loud {
        let [from, to] = [windows[k].start, windows[k].end - 1].map(|i| times[i]);
        // Neighbouring windows of one recording are one interval.
        match intervals.last_mut() {
            Some(last) if end == Some(windows[k].start) && last.recording == *names[windows[k].start] => {
                last.interval[1] = to;
            }
            _ => intervals.push(ChangeInterval {
                recording: names[windows[k].start].clone(),
                interval: [from, to],
                lasts: false,
            }),
        }
        end = Some(windows[k].end);
    }
    Some((intervals, (of_loud / samples.max(1) as f64).sqrt()))
}

/// Frequency about which most of the power of a residual lies, above its white noise, Hz. `None` if it is spread or
/// low, as that of coloured noise and drift.
fn resonance(problem: &DiagnosisProblem, rest: &[f64], noise: f64) -> Option<f64> {
    // Power by frequency, summed over the segments on a common axis.
    let mut bins: Vec<(f64, f64)> = Vec::new();
    for (segment, (_, part)) in problem.layout.segments.iter().zip(segment_values(problem, rest)) {
        let power = hann_power(part);
        if power.len() < 2 {
            continue;
        }
        // White noise has the same power at all frequencies.
        let white = noise * noise * 3.0 / 8.0 * part.len() as f64;
        let nyquist = 0.5 / segment.step;
        let width = nyquist / (power.len() - 1) as f64;
        bins.extend(
            power
                .iter()
                .enumerate()
                .map(|(k, p)| (k as f64 * width, (p - white).max(0.0))),
        );
    }
    let total: f64 = bins.iter().map(|(_, power)| power).sum();
    let share = |from: f64, to: f64| {
        let within = bins.iter().filter(|(f, _)| (from..to).contains(f));
        within.map(|(_, power)| power).sum::<f64>() / total
    };
    if total <= 0.0 {
        return None;
    }
    let (peak, _) = *bins.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let about = share((1.0 - RESONANCE_HALF_WIDTH) * peak, (1.0 + RESONANCE_HALF_WIDTH) * peak);
    let low = share(0.0, 0.5 * peak);
    (peak > RESONANCE_LOWEST_HZ && about > RESONANCE_LEAST_SHARE && low < RESONANCE_MOST_LOW_SHARE).then_some(peak)
}

/// The values of each segment, with the index of its first sample.
fn segment_values<'a>(problem: &'a DiagnosisProblem, rest: &'a [f64]) -> impl Iterator<Item = (usize, &'a [f64])> {
    let mut start = 0;
    problem.layout.segments.iter().map(move |segment| {
        let first = start;
        start += segment.samples;
        (first, &rest[first..start])
    })
}
