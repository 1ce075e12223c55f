//! Planted residuals: pushes on moving and standing drives are found with their times, and nothing else is.

use std::f64::consts::TAU;

use modelmill_runtime::RandomBits;

use super::doubts::may_be_time_error;
use super::segments::DriveSegment;
use super::trace::ResidualTrace;
use super::{ContactEvent, find_events};

/// Samples per second.
const RATE: f64 = 125.0;
/// Number of samples.
const SAMPLES: usize = 2500;
/// Number of drives.
const DRIVES: usize = 3;
/// Noise of the residual; the force of each drive has an amplitude of 1.
const NOISE: f64 = 0.015;

/// A residual without events: of drives that move along sums of sines, or from point to point.
fn calm_trace(seed: u64, from_point_to_point: bool) -> ResidualTrace {
    sampled_trace(seed, from_point_to_point, RATE)
}

/// As [`calm_trace`], with other samples per second.
fn sampled_trace(seed: u64, from_point_to_point: bool, rate: f64) -> ResidualTrace {
    let mut draws = RandomBits::new(seed);
    let time: Vec<f64> = (0..SAMPLES).map(|i| i as f64 / rate).collect();
    let (mut positions, mut rates, mut accelerations) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..DRIVES {
        let waves: Vec<[f64; 3]> = (1..4)
            .map(|k| {
                [
                    0.3 + draws.below_one(),
                    TAU * f64::from(k) / 10.0,
                    TAU * draws.below_one(),
                ]
            })
            .collect();
        // From point to point the same waves are played for half of every period of 5 s.
        let phase = |t: f64| {
            if from_point_to_point {
                let part = (t / 5.0).fract();
                let done = if part < 0.5 {
                    part - (2.0 * TAU * part).sin() / (2.0 * TAU)
                } else {
                    0.5
                };
                5.0 * ((t / 5.0).floor() * 0.5 + done)
            } else {
                t
            }
        };
        let at = |t: f64| waves.iter().map(|[a, w, p]| a * (w * phase(t) + p).sin()).sum::<f64>();
        let step = 1e-3;
        positions.push(time.iter().map(|t| at(*t)).collect());
        rates.push(
            time.iter()
                .map(|t| (at(t + step) - at(t - step)) / (2.0 * step))
                .collect(),
        );
        let second = |t: &f64| (at(t + step) - 2.0 * at(*t) + at(t - step)) / (step * step);
        accelerations.push(time.iter().map(second).collect());
    }
    let fitted: Vec<Vec<f64>> = positions
        .iter()
        .map(|position: &Vec<f64>| position.iter().map(|q| q.sin()).collect())
        .collect();
    let mut noise = || {
        (0..SAMPLES)
            .map(|_| NOISE * draws.nearly_normal())
            .collect::<Vec<f64>>()
    };
    let residual: Vec<Vec<f64>> = (0..DRIVES).map(|_| noise()).collect();
    let mut trace = ResidualTrace {
        time,
        motion: [positions, rates, accelerations],
        measured: fitted,
        residual: vec![vec![0.0; SAMPLES]; DRIVES],
        is_measured: vec![vec![true; SAMPLES]; DRIVES],
        slowest: vec![1e-3; DRIVES],
        smear: 0.1,
    };
    for (d, rest) in residual.iter().enumerate() {
        add_force(&mut trace, d, |i| rest[i]);
    }
    trace
}

/// Adds an unexplained force to a drive.
fn add_force(trace: &mut ResidualTrace, drive: usize, force: impl Fn(usize) -> f64) {
    for i in 0..SAMPLES {
        trace.measured[drive][i] += force(i);
        trace.residual[drive][i] += force(i);
    }
}

/// Adds pushes to some drives between two times.
fn push(trace: &mut ResidualTrace, forces: &[f64], from: f64, to: f64) {
    for (d, force) in forces.iter().enumerate() {
        let ramp = 0.04_f64;
        add_force(trace, d, |i| {
            let t = i as f64 / RATE;
            force * ((t - from) / ramp).clamp(0.0, 1.0) * ((to - t) / ramp).clamp(0.0, 1.0)
        });
    }
}

/// Whether one event has these times within 0.1 s.
fn has_event(events: &[ContactEvent], from: f64, to: f64) -> bool {
    let is_it = |event: &&ContactEvent| (event.from - from).abs() < 0.1 && (event.to - to).abs() < 0.1;
    events.iter().filter(is_it).count() == 1
}

/// A residual that a shift of the force by a fourth of a sample explains may be an error of the time stamps; three times
/// that cannot be.
#[test]
fn small_residuals_of_steep_forces_may_be_errors_of_time() {
    let trace = calm_trace(7, false);
    for start in (100..2000).step_by(50) {
        let fitted = trace.fitted_force(1);
        let steps = (start..start + 19).map(|i| (fitted[i + 1] - fitted[i]).abs());
        let step = steps.sum::<f64>() / 19.0;
        for (force, expected) in [(0.25 * step, true), (-0.25 * step, true), (0.75 * step, false)] {
            let segment = DriveSegment {
                drive: 1,
                start,
                end: start + 20,
                force,
                deviations: 10.0,
                masked_share: 0.0,
                edge_contrast: 1.0,
                is_confirmed: true,
                needs_support: false,
                is_at_standstill: false,
            };
            assert_eq!(
                may_be_time_error(&trace, &segment),
                expected,
                "{start}: {force} of {step}"
            );
        }
    }
}

#[test]
fn nothing_is_found_without_events() {
    let events = (0..40).map(|seed| find_events(&calm_trace(seed, seed % 2 == 0)).len());
    assert_eq!(events.sum::<usize>(), 0);
}

#[test]
fn pushes_are_found_with_their_times() {
    let (mut found, mut planted, mut wrong) = (0, 0, 0);
    for seed in 0..40_u64 {
        let stands = seed % 2 == 0;
        let mut trace = calm_trace(100 + seed, stands);
        let mut draws = RandomBits::new(900 + seed);
        let mut pushes = Vec::new();
        for period in 0..3 {
            // The standstill is the second half of a period of 5 s.
            let length = 0.12 + 1.2 * draws.below_one() * draws.below_one();
            let from = 5.0 * f64::from(period) + 2.9 + 0.4 * draws.below_one();
            let size = 0.06 + 0.6 * draws.below_one().powi(2);
            let shares = [1.0, 2.0 * draws.below_one() - 1.0, 0.5 * draws.below_one()];
            push(&mut trace, &shares.map(|share| share * size), from, from + length);
            pushes.push((from, from + length));
        }
        let events = find_events(&trace);
        let hit = |(from, to): &&(f64, f64)| has_event(&events, *from, *to);
        found += pushes.iter().filter(hit).count();
        planted += pushes.len();
        let is_one = |event: &ContactEvent| pushes.iter().any(|(from, to)| event.from < *to && event.to > *from);
        wrong += events.iter().filter(|event| !is_one(event)).count();
    }
    assert!(
        10 * found >= 9 * planted && wrong == 0,
        "{found} of {planted}, {wrong} wrong"
    );
}

/// Hits of half a sine of 60 ms at 250 Hz are found with their times and their true peaks. A drive that reverses at the
/// time of a hit may not show it.
#[test]
fn short_hits_are_found_with_their_peaks() {
    let (rate, peaks) = (250.0, [1.5, 0.9]);
    let mut errors = Vec::new();
    for seed in 0..20_u64 {
        let mut trace = sampled_trace(700 + seed, false, rate);
        let (from, length) = (4.0 + 0.1013 * seed as f64, 0.06);
        for (d, peak) in peaks.into_iter().enumerate() {
            add_force(&mut trace, d, |i| {
                let part = (i as f64 / rate - from) / length;
                if (0.0..1.0).contains(&part) {
                    peak * (0.5 * TAU * part).sin()
                } else {
                    0.0
                }
            });
        }
        let events = find_events(&trace);
        assert!(
            events.len() == 1 && has_event(&events, from, from + length),
            "{seed}: {events:?}"
        );
        let of_drives = events[0].drives.iter();
        errors.extend(of_drives.map(|(d, largest, _)| largest / peaks[*d] - 1.0));
    }
    // A reversal during the hit hides the peak of a few drives.
    let near = errors.iter().filter(|error| error.abs() < 0.06).count();
    let mean = errors.iter().filter(|error| error.abs() < 0.06).sum::<f64>() / near as f64;
    assert!(
        errors.len() > 30 && 10 * near > 9 * errors.len() && mean.abs() < 0.02,
        "{mean}: {errors:?}"
    );
}

/// The size of long pushes is not that of the largest noise.
#[test]
fn long_pushes_have_their_size() {
    for seed in 0..10_u64 {
        let mut trace = calm_trace(800 + seed, seed % 2 == 0);
        push(&mut trace, &[0.4, 0.3, 0.0], 7.9, 8.8);
        let events = find_events(&trace);
        assert!(has_event(&events, 7.9, 8.8), "{seed}: {events:?}");
        let largest = events[0]
            .drives
            .iter()
            .find(|(d, ..)| *d == 0)
            .expect("the first drive")
            .1;
        assert!((0.39..0.4 + 4.0 * NOISE).contains(&largest), "{seed}: {largest}");
    }
}

/// A force that is a function of the state is no contact, nor is one that lasts until the end.
#[test]
fn laws_and_lasting_changes_are_no_contacts() {
    for seed in 0..10 {
        let mut trace = calm_trace(200 + seed, false);
        let position = trace.motion[0][0].clone();
        let highest = position.iter().fold(0.0_f64, |most, q| most.max(*q));
        add_force(&mut trace, 0, |i| if position[i] > 0.7 * highest { 0.3 } else { 0.0 });
        let mut payload = calm_trace(300 + seed, false);
        push(&mut payload, &[0.2, 0.1, 0.05], 10.0, 1e3);
        for trace in [trace, payload] {
            let events = find_events(&trace);
            assert!(events.is_empty(), "{seed}: {events:?}");
        }
    }
}

/// Readings with a dead band or a frozen value show no contact.
#[test]
fn faulty_readings_are_no_contacts() {
    for seed in 0..10 {
        let mut dead = calm_trace(400 + seed, false);
        for i in 0..SAMPLES {
            let fitted = dead.measured[0][i] - dead.residual[0][i];
            let reading = if dead.measured[0][i].abs() < 0.6 {
                0.0
            } else {
                dead.measured[0][i]
            };
            dead.measured[0][i] = reading;
            dead.residual[0][i] = reading - 0.3 * fitted;
        }
        let mut frozen = calm_trace(500 + seed, false);
        for i in 1000..1250 {
            let fitted = frozen.measured[1][i] - frozen.residual[1][i];
            frozen.measured[1][i] = frozen.measured[1][999];
            frozen.residual[1][i] = frozen.measured[1][999] - fitted;
        }
        for trace in [dead, frozen] {
            let events = find_events(&trace);
            assert!(events.is_empty(), "{seed}: {events:?}");
        }
    }
}
