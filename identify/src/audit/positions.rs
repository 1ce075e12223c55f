//! Faults of positions that smoothing cannot remove: wrong time stamps, and backlash between encoder and load. Input:
//! recorded positions; output: faults. Each sample is compared with the cubic through its neighbours.
//!
//! If time stamps are wrong, the position errors are the time error times the rate, with the same time error for all
//! coordinates. With backlash, the position jumps each time the load changes sides, by one length to and fro.

use std::ops::RangeInclusive;

use super::thresholds::{
    BACKLASH_ALIKE_OF_FIVE, BACKLASH_ALTERNATING_OF_FIVE, BACKLASH_ENCODER_STEPS, BACKLASH_FEWEST_JUMPS,
    BACKLASH_JUMP_SIGMAS, BACKLASH_SIZE_TOLERANCE, BACKLASH_TRAVEL_SHARE, FAST_RATE_SHARE, JITTER_FEWEST_SAMPLES,
    JITTER_MIN_AGREEMENT, JITTER_MIN_ERROR_GROWTH, NEIGHBOURHOOD_MOST_SPAN, POSITION_FAULT_NEIGHBOURHOODS,
    SLOW_RATE_SHARE,
};
use crate::recording::SignalRecording;
use crate::signal::median;

/// Number of neighbours on either side of a sample.
const SIDE: usize = 5;
/// Number of samples on either side of a jump that are used to estimate it.
const JUMP_NEIGHBOURS: usize = 10;
/// Samples on either side of a jump that the load may need to cross the play. They do not count for its width.
const CROSSING_SAMPLES: usize = 5;
/// Largest number of samples that are used, from the start.
const MAX_SAMPLES: usize = 20_000;

/// A fault of the positions of a recording.
#[derive(Clone, Debug, PartialEq)]
pub enum PositionFault {
    /// Samples were taken before or after their time stamps; rms value.
    Jitter {
        /// The rms time error, s.
        time: f64,
    },
    /// The position of a coordinate jumps to and fro.
    Backlash {
        /// Name of the coordinate.
        coordinate: String,
        /// The jump, rad or m.
        width: f64,
        /// Standard deviation of the width, rad or m.
        deviation: f64,
    },
}

impl SignalRecording {
    /// Faults of the positions; columns that cannot be used are skipped. Backlash is searched only if there is no
    /// jitter.
    pub fn position_faults(&self, coordinates: &[String]) -> Vec<PositionFault> {
        let Ok(time) = self.column("t") else {
            return Vec::new();
        };
        let n = time.len().min(MAX_SAMPLES);
        if n < POSITION_FAULT_NEIGHBOURHOODS * JUMP_NEIGHBOURS {
            return Vec::new();
        }
        let time = &time[..n];
        // Positions that move and are finite.
        let position = |name: &String| {
            let q = self.column(name).ok()?.get(..n)?;
            let moves = q.iter().any(|x| x.total_cmp(&q[0]).is_ne());
            (moves && q.iter().all(|x| x.is_finite())).then_some(q)
        };
        let beside: Vec<CubicResidual> = (coordinates.iter())
            .filter_map(|name| Some(CubicResidual::new(time, position(name)?)))
            .collect();
        let jitter = timing_jitter(&beside).map(|time| PositionFault::Jitter { time });
        let mut faults: Vec<PositionFault> = jitter.into_iter().collect();
        if faults.is_empty() {
            for name in coordinates {
                let width = position(name).and_then(|q| backlash_width(time, q));
                faults.extend(width.map(|[width, deviation]| PositionFault::Backlash {
                    coordinate: name.clone(),
                    width,
                    deviation,
                }));
            }
        }
        faults
    }
}

/// Differences between samples and the cubic through their neighbours.
struct CubicResidual {
    /// Sample minus cubic, rad or m.
    errors: Vec<f64>,
    /// Slope of the cubic at the sample, rad/s or m/s.
    rates: Vec<f64>,
}

impl CubicResidual {
    /// Fits a cubic around every sample that has enough neighbours without a gap between them; `time` in s.
    fn new(time: &[f64], q: &[f64]) -> Self {
        let (mut errors, mut rates) = (Vec::new(), Vec::new());
        let step = median_step(time);
        for i in (SIDE..q.len() - SIDE).filter(|i| !has_gap(time, i - SIDE..=i + SIDE, step)) {
            let about = (i - SIDE..=i + SIDE).filter(|k| *k != i);
            // Relative to the sample, so that the value at zero is the error.
            let points = about.map(|k| (time[k] - time[i], q[k] - q[i]));
            let [value, rate] = fit_cubic(points, 0.0);
            errors.push(-value);
            rates.push(rate);
        }
        Self { errors, rates }
    }
}

/// The median time between samples, s.
fn median_step(time: &[f64]) -> f64 {
    median(time.windows(2).map(|pair| pair[1] - pair[0]).collect())
}

/// Whether some samples take much longer than usual, because samples between them are lost.
fn has_gap(time: &[f64], samples: RangeInclusive<usize>, step: f64) -> bool {
    let usual = (samples.end() - samples.start()) as f64 * step;
    time[*samples.end()] - time[*samples.start()] > NEIGHBOURHOOD_MOST_SPAN * usual
}

/// Least squares fit of a cubic to points (time, value): value and slope at zero. If `step` is not zero, a jump of that
/// size times an estimated factor at zero is fitted too, and the factor is returned instead of the value. Zeros if the
/// fit fails.
fn fit_cubic(points: impl Iterator<Item = (f64, f64)>, step: f64) -> [f64; 2] {
    let points: Vec<(f64, f64)> = points.collect();
    // Scale the times to -1..1.
    let scale = points.iter().fold(f64::MIN_POSITIVE, |m, (t, _)| m.max(t.abs()));
    let n = if step == 0.0 { 4 } else { 5 };
    let mut gram = nalgebra::DMatrix::<f64>::zeros(n, n);
    let mut right = nalgebra::DVector::<f64>::zeros(n);
    for (t, x) in points {
        let s = t / scale;
        let row = [1.0, s, s * s, s * s * s, step * s.signum()];
        for i in 0..n {
            for j in 0..n {
                gram[(i, j)] += row[i] * row[j];
            }
            right[i] += row[i] * x;
        }
    }
    let Some(factor) = gram.cholesky() else {
        return [0.0; 2];
    };
    let found = factor.solve(&right);
    [if step == 0.0 { found[0] } else { found[4] }, found[1] / scale]
}

/// The rms time error of the stamps, s, if the errors of all coordinates grow with the rate and agree on the time
/// error; else `None`.
fn timing_jitter(all: &[CubicResidual]) -> Option<f64> {
    if all.len() < 2 {
        return None;
    }
    let mut readings: Vec<Vec<Option<f64>>> = Vec::new();
    for one in all {
        // Compare errors at slow and fast motion.
        let fastest = one.rates.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        let pairs = one.errors.iter().zip(&one.rates);
        // Median error at samples whose relative rate is wanted.
        let size = |wanted: &dyn Fn(f64) -> bool| {
            let sizes = pairs.clone().filter(|(_, v)| wanted(v.abs() / fastest));
            median(sizes.map(|(e, _)| e.abs()).collect())
        };
        let [slow, fast] = [size(&|v| v < SLOW_RATE_SHARE), size(&|v| v > FAST_RATE_SHARE)];
        if fastest <= 0.0 || fast <= JITTER_MIN_ERROR_GROWTH * slow {
            return None;
        }
        // Time error at each fast sample: position error over rate.
        readings.push(
            pairs
                .map(|(e, v)| (v.abs() > FAST_RATE_SHARE * fastest).then(|| e / v))
                .collect(),
        );
    }
    let mut times = Vec::new();
    for (k, one) in readings.iter().enumerate() {
        for other in &readings[k + 1..] {
            let both: Vec<(f64, f64)> = one
                .iter()
                .zip(other)
                .filter_map(|(a, b)| Some(((*a)?, (*b)?)))
                .collect();
            let sum = |of: &dyn Fn(&(f64, f64)) -> f64| both.iter().map(of).sum::<f64>();
            // Correlation of the time errors at samples where both coordinates are fast.
            let alike = sum(&|(a, b)| a * b) / (sum(&|(a, _)| a * a) * sum(&|(_, b)| b * b)).sqrt();
            if both.len() < JITTER_FEWEST_SAMPLES || alike.is_nan() || alike < JITTER_MIN_AGREEMENT {
                return None;
            }
            times.extend(both.iter().map(|(a, _)| a * a));
        }
    }
    let mean = times.iter().sum::<f64>() / times.len().max(1) as f64;
    (mean > 0.0).then(|| mean.sqrt())
}

/// Length of the backlash with its standard deviation, rad or m, if the jumps have one size and alternate; else `None`.
fn backlash_width(time: &[f64], q: &[f64]) -> Option<[f64; 2]> {
    // The factor of the step is half of the jump, since the step goes from -1 to 1.
    let step = median_step(time);
    let jump = |i: usize| {
        // A cubic does not follow the motion across a gap.
        if has_gap(time, i - JUMP_NEIGHBOURS..=i + JUMP_NEIGHBOURS, step) {
            return 0.0;
        }
        let about = (i - JUMP_NEIGHBOURS..=i + JUMP_NEIGHBOURS).filter(|k| *k != i);
        2.0 * fit_cubic(about.map(|k| (time[k] - time[i], q[k] - q[i])), 1.0)[0]
    };
    let jumps: Vec<f64> = (JUMP_NEIGHBOURS..q.len() - JUMP_NEIGHBOURS).map(jump).collect();
    // Robust standard deviation of the jump estimates.
    let noise = 1.4826 * median(jumps.iter().map(|x| x.abs()).collect());
    let mut found: Vec<f64> = Vec::new();
    let mut places: Vec<usize> = Vec::new();
    for (i, own) in jumps.iter().enumerate() {
        let near = i.saturating_sub(JUMP_NEIGHBOURS)..(i + JUMP_NEIGHBOURS + 1).min(jumps.len());
        // Only the largest jump of a neighbourhood counts.
        let is_largest = jumps[near].iter().all(|x| x.abs() <= own.abs());
        if is_largest && own.abs() > BACKLASH_JUMP_SIGMAS * noise {
            found.push(*own);
            places.push(i + JUMP_NEIGHBOURS);
        }
    }
    // Size of a typical jump, compared with encoder steps and travel.
    let middle = median(found.iter().map(|x| x.abs()).collect());
    let low = q.iter().copied().fold(f64::INFINITY, f64::min);
    let travel = q.iter().copied().fold(f64::NEG_INFINITY, f64::max) - low;
    if middle < BACKLASH_ENCODER_STEPS * encoder_resolution(q) || middle < BACKLASH_TRAVEL_SHARE * travel {
        return None;
    }
    let is_alike = |x: &&f64| (x.abs() - middle).abs() < BACKLASH_SIZE_TOLERANCE * middle;
    // Neighbouring jumps in opposite directions.
    let alternate = found.windows(2).filter(|pair| pair[0] * pair[1] < 0.0).count();
    // Four of five jumps must have the same size, and four of five must change the sign.
    let is_play = found.len() >= BACKLASH_FEWEST_JUMPS
        && 5 * found.iter().filter(is_alike).count() >= BACKLASH_ALIKE_OF_FIVE * found.len()
        && 5 * alternate >= BACKLASH_ALTERNATING_OF_FIVE * (found.len() - 1);
    // The width of each jump without the samples at which the load crosses the play.
    let across = |i: usize| {
        let reach = CROSSING_SAMPLES + JUMP_NEIGHBOURS;
        let about = i.saturating_sub(reach)..=(i + reach).min(q.len() - 1);
        if has_gap(time, about.clone(), step) {
            return None;
        }
        let beyond = about.filter(|k| k.abs_diff(i) > CROSSING_SAMPLES);
        Some(2.0 * fit_cubic(beyond.map(|k| (time[k] - time[i], q[k] - q[i])), 1.0)[0].abs())
    };
    let widths: Vec<f64> = places.into_iter().filter_map(across).collect();
    if widths.is_empty() {
        return None;
    }
    let width = median(widths.clone());
    // Robust standard deviation of a median.
    let spread = 1.4826 * median(widths.iter().map(|one| (one - width).abs()).collect());
    let deviation = 1.25 * spread / (widths.len() as f64).sqrt();
    is_play.then_some([width, deviation])
}

/// The smallest change of a position between samples, which is the step of an encoder; 0 if it does not move.
fn encoder_resolution(q: &[f64]) -> f64 {
    let changes = q.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    let largest = changes.clone().fold(0.0, f64::max);
    let least = changes
        .filter(|change| *change > 1e-9 * largest)
        .fold(f64::INFINITY, f64::min);
    if least.is_finite() { least } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_noise::TestNoise;

    const N: usize = 1800;

    fn time() -> Vec<f64> {
        (0..N).map(|i| 0.004 * i as f64).collect()
    }

    fn motion(t: f64, k: usize) -> f64 {
        let k = k as f64;
        0.4 * ((1.0 + 0.3 * k) * t).sin() + 0.2 * ((2.3 + 0.2 * k) * t + k).cos()
    }

    #[test]
    fn a_sound_recording_has_no_fault() {
        for seed in 0..20 {
            let mut noise = TestNoise::new(seed);
            let read = |noise: &mut TestNoise, k| -> Vec<f64> {
                let all = time().into_iter();
                all.map(|t| motion(t, k) + 5e-6 * noise.normal()).collect()
            };
            let both = [0, 1].map(|k| CubicResidual::new(&time(), &read(&mut noise, k)));
            assert_eq!(timing_jitter(&both), None);
            assert_eq!(backlash_width(&time(), &read(&mut noise, 0)), None);
        }
    }

    /// Lost samples are no play: without them the motion seems to jump where it is fast.
    #[test]
    fn gaps_are_no_faults_of_positions() {
        for seed in 0..20 {
            let mut noise = TestNoise::new(seed);
            // Three gaps of 0.3 s at places that are drawn, about which the motion goes either way.
            let starts: Vec<f64> = (0..3)
                .map(|k| 0.5 + 2.2 * f64::from(k) + 0.6 * noise.uniform())
                .collect();
            let is_kept = |t: &f64| !starts.iter().any(|start| (*start..start + 0.3).contains(t));
            let kept: Vec<f64> = time().into_iter().filter(is_kept).collect();
            let read = |noise: &mut TestNoise, k| -> Vec<f64> {
                kept.iter().map(|t| motion(*t, k) + 5e-6 * noise.normal()).collect()
            };
            let both = [0, 1].map(|k| CubicResidual::new(&kept, &read(&mut noise, k)));
            assert_eq!(timing_jitter(&both), None);
            for k in 0..2 {
                assert_eq!(backlash_width(&kept, &read(&mut noise, k)), None, "{seed}");
            }
        }
    }

    #[test]
    fn wrong_stamps_are_told_by_all_coordinates() {
        let mut noise = TestNoise::new(3);
        let late: Vec<f64> = time().iter().map(|t| t + 1e-4 * noise.normal()).collect();
        let both = [0, 1].map(|k| {
            let read: Vec<f64> = (late.iter()).map(|t| motion(*t, k) + 5e-6 * noise.normal()).collect();
            CubicResidual::new(&time(), &read)
        });
        let found = timing_jitter(&both).unwrap();
        assert!((0.7e-4..1.4e-4).contains(&found), "{found}");
    }

    #[test]
    fn play_is_seen_by_jumps_to_and_fro() {
        let mut noise = TestNoise::new(8);
        let read: Vec<f64> = (time().iter())
            .map(|t| motion(*t, 0) + 2e-4 * (1.9 * t + 0.3).sin().signum() + 5e-6 * noise.normal())
            .collect();
        let [found, _] = backlash_width(&time(), &read).unwrap();
        assert!((3.8e-4..4.2e-4).contains(&found), "{found}");
    }

    /// The load needs some samples to cross the play; its width is that before and after them.
    #[test]
    fn the_width_of_play_does_not_depend_on_the_time_to_cross_it() {
        for crossing in [1e-3, 5e-3, 10e-3] {
            let mut noise = TestNoise::new(5);
            let read: Vec<f64> = (time().iter())
                .map(|t| {
                    let side = ((1.9 * t + 0.3).sin() / (1.9 * crossing)).clamp(-1.0, 1.0);
                    motion(*t, 0) + 1e-3 * side + 5e-6 * noise.normal()
                })
                .collect();
            let [found, deviation] = backlash_width(&time(), &read).unwrap();
            assert!((found - 2e-3).abs() < 1e-4, "{crossing} s: {found}");
            assert!(deviation < 1e-4, "{deviation}");
        }
    }
}
