//! Tests with exactly known parameters: forces are `H_min p_min` of the emitted model, plus noise.

use std::f64::consts::TAU;

use modelmill_runtime::Random;
use modelmill_runtime::live::{Options, ParameterWatch, WatchVerdict};

use crate::machine::{CYCLE, parameters_in_use, times};
use crate::motion::motion;
use crate::spidermill_worn as model;

/// Number of base parameters.
const NB: usize = model::N_BASE;
/// Regressor rows of both drives at one time.
type SampleRows = [[f64; NB]; 2];

/// Rows of the regressor over a period; the right crank may be at standstill.
fn rows(right_rests: bool) -> Vec<SampleRows> {
    let emitted = model::Model::<f64>::default();
    let states = times().map(|t| {
        let [mut q, mut qd, mut qdd] = motion(t);
        if right_rests {
            (q[1], qd[1], qdd[1]) = (motion(0.0)[0][1], 0.0, 0.0);
        }
        model::State { q, qd, qdd }
    });
    states.map(|state| emitted.regressor(&state).unwrap()).collect()
}

/// A watch of simulated forces with noise of 8 N: white, below 1 Hz, or a mixture.
#[derive(Clone)]
struct WatchBench {
    /// The watch under test.
    watch: ParameterWatch<f64, NB, 2>,
    /// True base parameters.
    parameters: [f64; NB],
    /// Source of the noise.
    random: Random,
    /// Share of the noise that is coloured.
    colour: f64,
    /// Present value of the coloured noise of each drive.
    wandering: [f64; 2],
    /// Drives whose forces are not measured.
    silent: [bool; 2],
    /// Number of samples so far.
    n: usize,
}

impl WatchBench {
    /// True parameters are 10 % larger than those of the controller.
    fn new(colour: f64, seed: u64) -> Self {
        let in_use = parameters_in_use().unwrap();
        Self {
            watch: ParameterWatch::new(&in_use, &Options::at_rate(1.0 / CYCLE)),
            parameters: in_use.map(|p| 1.1 * p),
            random: Random::new(seed),
            colour,
            wandering: [0.0; 2],
            silent: [false; 2],
            n: 0,
        }
    }

    /// A random number with mean zero and standard deviation one.
    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * self.random.uniform(f64::MIN_POSITIVE, 1.0).ln()).sqrt();
        radius * (TAU * self.random.uniform(0.0, 1.0)).cos()
    }

    /// Continues for some seconds. Returns one entry per sample with a change: the parameter, if it is identified.
    fn run_seconds(&mut self, rows: &[SampleRows], seconds: u32) -> Vec<Option<usize>> {
        // Correlation of coloured noise from sample to sample, for 1 Hz.
        let stays = f64::exp(-TAU * 1.0 * CYCLE);
        let mut changes = Vec::new();
        for _ in 0..1000 * seconds {
            let sample = &rows[self.n % rows.len()];
            let mut forces = [0.0; 2];
            for d in 0..2 {
                let fresh = self.normal();
                self.wandering[d] = stays * self.wandering[d] + (1.0 - stays * stays).sqrt() * self.normal();
                let noise = (1.0 - self.colour) * fresh + self.colour * self.wandering[d];
                let terms = sample[d].iter().zip(&self.parameters);
                forces[d] = terms.map(|(h, p)| h * p).sum::<f64>() + 8.0 * noise;
                if self.silent[d] {
                    forces[d] = f64::NAN;
                }
            }
            if let WatchVerdict::Changed(change) = self.watch.step(sample, &forces) {
                changes.push(change.is_identified().then_some(change.parameter));
            }
            self.n += 1;
        }
        changes
    }

    /// Changes a parameter so that the force of one drive changes by `size` N, root mean square.
    fn change(&mut self, parameter: usize, size: f64, rows: &[SampleRows]) {
        let rms = |d: usize| {
            let squares: f64 = rows.iter().map(|r| r[d][parameter].powi(2)).sum();
            (squares / rows.len() as f64).sqrt()
        };
        self.parameters[parameter] += size / rms(0).max(rms(1));
    }
}

/// Ten base parameters of bodies, rods and friction, with white and with coloured noise.
#[test]
fn each_parameter_is_named_within_ten_seconds_and_no_other() {
    let rows = rows(false);
    for (colour, size) in [(0.0, 5.0), (0.5, 15.0)] {
        let mut bench = WatchBench::new(colour, 1);
        assert!(bench.run_seconds(&rows, 120).is_empty());
        for parameter in 0..NB {
            let mut changed = bench.clone();
            changed.change(parameter, size, &rows);
            let found = changed.run_seconds(&rows, 10);
            let last = found.last().copied().flatten();
            assert_eq!(last, Some(parameter), "of colour {colour}");
            let told = found.iter().flatten();
            assert!(told.into_iter().all(|p| *p == parameter));
            // The window already has the new value.
            let estimate = changed.watch.estimate()[parameter];
            let step = changed.parameters[parameter] - bench.parameters[parameter];
            let missing = (estimate - changed.parameters[parameter]) / step;
            assert!(missing.abs() < 0.7, "{parameter}: {missing}");
        }
    }
}

#[test]
fn a_drive_that_is_never_measured_keeps_no_other_waiting() {
    let rows = rows(false);
    let mut bench = WatchBench::new(0.3, 3);
    bench.silent[1] = true;
    assert!(bench.run_seconds(&rows, 120).is_empty());
    assert_eq!(*bench.watch.verdict(), WatchVerdict::Quiet);
    assert_eq!(bench.watch.watched_drives(), [true, false]);
    // Friction of the drive that is measured.
    bench.parameters[6] += 20.0;
    let found = bench.run_seconds(&rows, 10);
    assert_eq!(found.last(), Some(&Some(6)));
}

#[test]
fn what_rests_is_not_named_and_raises_nothing_as_it_begins_to_move() {
    let (resting, moving) = (rows(true), rows(false));
    let of_right = |p: usize| model::BASE_PARAMETERS[p].expression.ends_with("_spindle_right");
    let mut bench = WatchBench::new(0.3, 2);
    assert!(bench.run_seconds(&resting, 120).is_empty());
    // Friction of the spindle at standstill has no effect.
    let mut unfelt = bench.clone();
    for p in (0..NB).filter(|p| of_right(*p) && *p > 5) {
        unfelt.parameters[p] *= 3.0;
    }
    assert!(unfelt.run_seconds(&resting, 30).is_empty());
    // Friction of the other spindle.
    let mut changed = bench.clone();
    changed.parameters[6] += 20.0;
    let found = changed.run_seconds(&resting, 10);
    assert_eq!(found.last(), Some(&Some(6)));
    // Only the motion has changed.
    assert!(bench.run_seconds(&moving, 120).is_empty());
}

#[test]
fn what_is_accepted_is_the_reference_from_then_on() {
    let rows = rows(false);
    let mut bench = WatchBench::new(0.0, 3);
    assert!(bench.run_seconds(&rows, 90).is_empty());
    bench.change(7, 10.0, &rows);
    assert!(!bench.run_seconds(&rows, 10).is_empty());
    bench.watch.accept();
    assert_eq!(*bench.watch.verdict(), WatchVerdict::Learning);
    assert!(bench.run_seconds(&rows, 120).is_empty());
    assert_eq!(*bench.watch.verdict(), WatchVerdict::Quiet);
    bench.change(7, -10.0, &rows);
    assert_eq!(bench.run_seconds(&rows, 10).last(), Some(&Some(7)));
}

#[test]
fn what_is_no_number_is_left_out_and_counted() {
    let mut bench = WatchBench::new(0.0, 4);
    let rows = rows(false);
    bench.run_seconds(&rows, 65);
    let mut spoilt = rows[0];
    spoilt[0][3] = f64::INFINITY;
    bench.watch.step(&spoilt, &[1.0, f64::NAN]);
    bench.run_seconds(&rows, 65);
    assert_eq!(bench.watch.n_skipped_blocks(), 2);
    assert_eq!(*bench.watch.verdict(), WatchVerdict::Quiet);
    assert!(bench.watch.estimate().iter().all(|p| p.is_finite()));
    // No force is measured, for longer than the memory of the watch.
    for _ in 0..2_000_000 {
        bench.watch.step(&rows[0], &[f64::NAN; 2]);
    }
    assert!(bench.run_seconds(&rows, 30).is_empty());
}

#[test]
fn options_that_make_no_sense_do_no_harm() {
    let rows = rows(false);
    for x in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-300] {
        let options = Options {
            rate: x,
            block: x,
            window: x,
            memory: x,
            learning: x,
            false_alarm_interval: x,
        };
        let mut watch = ParameterWatch::<f64, NB, 2>::new(&parameters_in_use().unwrap(), &options);
        for row in rows.iter().take(500) {
            watch.step(row, &[1.0, 2.0]);
        }
    }
}

/// Some minutes with optimisation: `cargo test --release -p modelmill-example-live -- --ignored`.
#[test]
#[ignore = "ten hours take a minute"]
fn there_is_less_than_one_false_alarm_in_ten_hours_of_noise() {
    let rows = rows(false);
    for colour in [0.0, 0.5, 0.9] {
        let mut bench = WatchBench::new(colour, 5);
        for hour in 0..10 {
            let found = bench.run_seconds(&rows, 3600);
            assert!(found.is_empty(), "colour {colour}, hour {hour}");
        }
    }
}
