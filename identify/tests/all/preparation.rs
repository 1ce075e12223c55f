//! Rates and accelerations from positions alone, as encoders give them, beside the truth.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use modelmill_identify::{PreparedRun, ReadOptions, SignalRecording, SmoothingMethod, StatePreparation};
use modelmill_runtime::RandomBits;

const RATE: f64 = 250.0;
const PERIOD: f64 = 7.29;

/// Position, rate and acceleration of a motion of seven harmonics that the seed chooses.
fn motion(seed: u64, t: f64) -> [f64; 3] {
    let mut random = RandomBits::new(seed);
    let mut sum = [1.7, 0.0, 0.0];
    for k in 1..=7 {
        let w = TAU * f64::from(k) / PERIOD;
        let (a, phase) = (0.12 * random.below_one(), TAU * random.below_one());
        let (sin, cos) = (w * t + phase).sin_cos();
        sum[0] += a * sin;
        sum[1] += a * w * cos;
        sum[2] -= a * w * w * sin;
    }
    sum
}

/// What an encoder of 20 bits with noise reads, prepared.
fn prepared(seed: u64, samples: u32, smoothing: SmoothingMethod) -> PreparedRun {
    let mut random = RandomBits::new(seed.wrapping_mul(77));
    let step = TAU / f64::from(1 << 20);
    let mut text = "t,q\n".to_owned();
    for i in 0..samples {
        let t = f64::from(i) / RATE;
        let noise = 4e-6 * random.nearly_normal();
        let read = ((motion(seed, t)[0] + noise) / step).round() * step;
        writeln!(text, "{t},{read:.9}").unwrap();
    }
    let recording = SignalRecording::from_reader(text.as_bytes(), "run.csv", &ReadOptions::default()).unwrap();
    let preparation = StatePreparation {
        smoothing,
        ..StatePreparation::default()
    };
    recording.states_with(&["q".to_owned()], &[], &preparation).unwrap()
}

/// RMS error of the acceleration.
fn acceleration_error(seed: u64, run: &PreparedRun) -> f64 {
    let pairs = run.time.iter().zip(&run.qdd[0]);
    let sum: f64 = pairs.map(|(t, a)| (a - motion(seed, *t)[2]).powi(2)).sum();
    (sum / run.samples() as f64).sqrt()
}

/// The signs of friction come from the rates: they must be right but for the sample beside a reversal.
fn check_signs(seed: u64, run: &PreparedRun) {
    for (t, rate) in run.time.iter().zip(&run.qd[0]) {
        let around = [-1.0, 0.0, 1.0].map(|i| motion(seed, t + i / RATE)[1]);
        let reverses = around.iter().any(|r| r.signum() != around[1].signum());
        assert!(
            reverses || rate.signum() == around[1].signum(),
            "seed {seed}, t = {t}: {rate} for {}",
            around[1]
        );
    }
}

#[test]
fn two_periods_or_one_are_projected_on_their_series() {
    for seed in 1..=8 {
        for samples in [3645, 1823] {
            let run = prepared(seed, samples, SmoothingMethod::default());
            let note = run.notes[0].says.in_library_words();
            assert!(
                note.contains("with 7 harmonics, because its residual is white noise"),
                "seed {seed}, {samples} samples: {note}"
            );
            assert_eq!(run.samples(), samples as usize);
            // A millionth of the acceleration's 2 rad/s^2, which noise of 4.4e-6 rad would bury in differences.
            let error = acceleration_error(seed, &run);
            assert!(error < 6e-5, "seed {seed}, {samples} samples: {error}");
            check_signs(seed, &run);
        }
    }
}

#[test]
fn part_of_a_period_is_filtered_where_motion_ends() {
    for seed in 1..=8 {
        for samples in [1325, 1000, 2200] {
            let run = prepared(seed, samples, SmoothingMethod::default());
            let cutoff = run.prepared.cutoff_hz.unwrap();
            assert!(
                (3.0..15.0).contains(&cutoff),
                "seed {seed}, {samples} samples: {cutoff} Hz"
            );
            let error = acceleration_error(seed, &run);
            assert!(error < 4e-3, "seed {seed}, {samples} samples: {error}");
            check_signs(seed, &run);
        }
    }
}

#[test]
fn a_series_beats_the_low_pass_by_far() {
    let series = acceleration_error(3, &prepared(3, 3645, SmoothingMethod::Automatic));
    let filtered = acceleration_error(3, &prepared(3, 3645, SmoothingMethod::Butterworth));
    println!("error of the acceleration: {series:.2e} by the series, {filtered:.2e} by the filter");
    assert!(series < 0.1 * filtered);
}
