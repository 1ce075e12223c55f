//! Forward simulation: energy is kept, recorded forces return the recorded motion, and dry friction sticks as it does by hand.

use modelmill::Model;
use modelmill::recording::{PreparedRecording, RecordingOptions};
use modelmill::states::{ModelFunction, StateMatrix, StateSamples};

use crate::draws::Draws;
use crate::made::bundled;

/// Time between samples, s.
const STEP: f64 = 0.001;

/// Small motions of all coordinates about the nominal pose: positions, rates and accelerations, `[coordinate][sample]`.
fn motion(model: &Model, samples: usize, seed: u64) -> [Vec<Vec<f64>>; 3] {
    let mut draws = Draws::new(seed);
    let coordinates = model.derivation.mechanism.coordinates.iter();
    let mut all = [Vec::new(), Vec::new(), Vec::new()];
    for coordinate in coordinates.filter(|c| !c.passive) {
        let (size, w, phase) = (
            0.03 + 0.03 * draws.uniform(),
            8.0 + 6.0 * draws.uniform(),
            6.3 * draws.uniform(),
        );
        for (order, columns) in all.iter_mut().enumerate() {
            let turn = phase + 0.5 * std::f64::consts::PI * order as f64;
            let factor = size * w.powi(i32::try_from(order).expect("at most 2"));
            let start = if order == 0 { coordinate.nominal } else { 0.0 };
            let value = |i: usize| start + factor * (w * STEP * i as f64 + turn).sin();
            columns.push((0..samples).map(value).collect());
        }
    }
    all
}

/// A recording of a motion and forces, `[drive][sample]`.
fn recording(model: &Model, [q, qd, qdd]: &[Vec<Vec<f64>>; 3], forces: &[Vec<f64>]) -> PreparedRecording {
    let time = (0..q[0].len()).map(|i| STEP * i as f64).collect();
    let mut columns = vec![("t".to_owned(), time)];
    for (k, name) in model.active_coordinates().into_iter().enumerate() {
        columns.push((format!("{name}_d"), qd[k].clone()));
        columns.push((format!("{name}_dd"), qdd[k].clone()));
        columns.push((name, q[k].clone()));
    }
    columns.extend(model.row_names().into_iter().zip(forces.iter().cloned()));
    let prepared = model.recording_of_table("made", columns, &RecordingOptions::default());
    prepared.unwrap_or_else(|error| panic!("{}: {error}", model.name))
}

/// A function of the model along a motion, row by row.
fn along(model: &Model, function: ModelFunction, [q, qd, qdd]: [&[Vec<f64>]; 3]) -> Vec<f64> {
    let width = q.len();
    let flat = [q, qd, qdd].map(<[Vec<f64>]>::concat);
    let rows = |k: usize| StateMatrix {
        numbers: &flat[k],
        width,
        by_state: false,
    };
    let states = StateSamples {
        q: rows(0),
        qd: Some(rows(1)),
        qdd: Some(rows(2)),
        forces: None,
    };
    let found = model.functions().evaluate_at(function, &states, &model.values);
    found.unwrap_or_else(|error| panic!("{}: {error}", model.name))
}

/// Columns from values row by row.
fn columns(rows: &[f64], width: usize) -> Vec<Vec<f64>> {
    (0..width)
        .map(|k| rows.iter().skip(k).step_by(width).copied().collect())
        .collect()
}

#[test]
fn recorded_forces_return_the_recorded_motion() {
    for (name, seed) in [
        ("two_link", 1),
        ("scara", 2),
        ("five_bar", 3),
        ("spidermill", 4),
        ("four_bar", 5),
        ("emps", 6),
    ] {
        let model = Model::open(bundled(name)).expect("a model");
        let moved = motion(&model, 200, seed);
        let forces = along(
            &model,
            ModelFunction::InverseDynamics,
            [&moved[0], &moved[1], &moved[2]],
        );
        let run = recording(&model, &moved, &columns(&forces, model.row_names().len()));
        let made = model.simulate_motion(&run, &model.values).expect("a simulation");
        for (made, q) in made.q.iter().zip(&moved[0]) {
            for (a, b) in made.iter().zip(q) {
                // Forces between samples are interpolated linearly, which is the largest error.
                assert!((a - b).abs() < 2e-5, "{name}: {a} instead of {b}");
            }
        }
    }
}

/// Without forces and friction, kinetic energy plus the work against gravity stays constant.
#[test]
fn energy_is_kept() {
    for (name, seed) in [
        ("two_link", 1),
        ("five_bar", 2),
        ("spidermill", 3),
        ("arm_parallelogram", 4),
        ("slider_crank", 5),
    ] {
        let model = Model::open(bundled(name)).expect("a model");
        let (n, samples) = (model.active_coordinates().len(), 150);
        let run = recording(
            &model,
            &motion(&model, samples, seed),
            &vec![vec![0.0; samples]; model.row_names().len()],
        );
        let made = model.simulate_motion(&run, &model.values).expect("a simulation");
        let zeros = vec![vec![0.0; samples]; n];
        let mass = along(&model, ModelFunction::MassMatrix, [&made.q, &zeros, &zeros]);
        let gravity = along(&model, ModelFunction::Bias, [&made.q, &zeros, &zeros]);
        let kinetic = |i: usize| -> f64 {
            let rate = |k: usize| made.qd[k][i];
            let entries = (0..n).flat_map(|a| (0..n).map(move |b| (a, b)));
            0.5 * entries
                .map(|(a, b)| rate(a) * mass[(i * n + a) * n + b] * rate(b))
                .sum::<f64>()
        };
        let power = |i: usize| -> f64 { (0..n).map(|k| gravity[i * n + k] * made.qd[k][i]).sum() };
        let mut work = 0.0;
        let (mut largest, mut scale) = (0.0_f64, kinetic(0));
        for i in 1..samples {
            work += 0.5 * STEP * (power(i - 1) + power(i));
            scale = scale.max(kinetic(i));
            largest = largest.max((kinetic(i) + work - kinetic(0)).abs());
        }
        // The work is a sum of trapezoids, whose error is of the order of the squared step.
        assert!(largest < 1e-4 * scale, "{name}: {largest} of {scale} J");
    }
}

/// A mass of which friction and force are known: it slides, stops, sticks, and breaks away.
#[test]
fn a_mass_stops_and_breaks_away_as_by_hand() {
    let text = std::fs::read_to_string("../model-spec/models/emps.toml").expect("a model");
    let text = text
        .replace("nominal = 203.5034", "nominal = 0")
        .replace("nominal = -3.1648", "nominal = 0");
    let text = text
        .replace("t = \"t_s\"", "")
        .replace("x = \"q_meas_m\"", "")
        .replace("motor = \"force_N\"", "");
    let model = Model::from_text("axis.toml", &text).expect("a model");
    let (mass, dry, push, pull) = (95.1089, 20.3935, 10.0, 40.0);
    let (v0, samples) = (0.05, 1500);
    let (braking, driving) = ((dry - push) / mass, (pull - dry) / mass);
    let stop = v0 / braking;
    let mut moved = [vec![Vec::new()], vec![Vec::new()], vec![Vec::new()]];
    let mut force = Vec::new();
    for i in 0..samples {
        let t = STEP * f64::from(i);
        // The force rises within one step, and exceeds the friction at about 0.35 of it.
        let start = 1.0 + 0.35 * STEP;
        let values = if t < stop {
            [v0 * t - 0.5 * braking * t * t, v0 - braking * t, -braking]
        } else if t < start {
            [0.5 * v0 * stop, 0.0, 0.0]
        } else {
            let after = t - start;
            [
                0.5 * v0 * stop + 0.5 * driving * after * after,
                driving * after,
                driving,
            ]
        };
        for (columns, value) in moved.iter_mut().zip(values) {
            columns[0].push(value);
        }
        force.push(if i <= 1000 { push } else { pull });
    }
    let run = recording(&model, &moved, &[force]);
    let made = model.simulate_motion(&run, &model.values).expect("a simulation");
    for i in 0..samples {
        let i = usize::try_from(i).expect("a count");
        let (a, b) = (made.q[0][i], moved[0][0][i]);
        // A place breaks away at the start of a step, up to 1 ms late.
        let most = if i <= 1000 { 2e-5 } else { 1e-4 };
        assert!((a - b).abs() < most, "sample {i}: {a} instead of {b}");
        // Stuck means at standstill, without creeping.
        if (470..1000).contains(&i) {
            assert!(made.qd[0][i].abs() < 1e-12, "sample {i}: {}", made.qd[0][i]);
        }
    }
}

/// Two spindles of a closed loop carry the machine by friction: it stays where it is, although the forces do not balance
/// gravity. With forces beyond the friction it moves.
#[test]
fn friction_of_linear_drives_holds_a_closed_loop() {
    let model = Model::open("../recordings/spidermill-days/spidermill-friction.toml").expect("a model");
    // The file gives no friction.
    let mut values = model.values.clone();
    for (value, base) in values.iter_mut().zip(&model.base) {
        match base.expression.as_str() {
            "Fc_spindle_left" => *value = 20.0,
            "Fc_spindle_right" => *value = 32.0,
            _ => {}
        }
    }
    let samples = 120;
    let moved = motion(&model, samples, 1);
    let still = |order: usize| -> Vec<Vec<f64>> {
        let start = |column: &Vec<f64>| if order == 0 { column[0] } else { 0.0 };
        moved[order].iter().map(|column| vec![start(column); samples]).collect()
    };
    let rest = [still(0), still(1), still(2)];
    let held = along(&model, ModelFunction::InverseDynamics, [&rest[0], &rest[1], &rest[2]]);
    for (offset, is_held) in [(10.0, true), (60.0, false)] {
        // The recorded motion gives the first state only, with a rate that friction stops at once.
        let mut slow = moved.clone();
        for order in 1..3 {
            for column in &mut slow[order] {
                column[0] = 1e-5;
            }
        }
        let forces = columns(&held, 2).into_iter();
        let forces: Vec<Vec<f64>> = forces.map(|force| force.iter().map(|f| f + offset).collect()).collect();
        let run = recording(&model, &slow, &forces);
        let made = model.simulate_motion(&run, &values).expect("a simulation");
        let moved_by = (0..2)
            .map(|k| (made.q[k][samples - 1] - made.q[k][0]).abs())
            .fold(0.0, f64::max);
        assert_eq!(moved_by < 1e-6, is_held, "offset {offset} N: moved by {moved_by} rad");
        if is_held {
            assert!(made.qd.iter().all(|qd| qd[samples - 1].abs() < 1e-12));
        }
    }
}

/// A model with the wrong mass has larger errors over every horizon, and unstable motion is not judged over long ones.
#[test]
fn horizons_show_a_wrong_mass() {
    let model = Model::open(bundled("spidermill")).expect("a model");
    let reading = RecordingOptions::default();
    let run = model
        .recording("../recordings/spidermill-mbs/plain-check.csv", &reading)
        .expect("a recording");
    let right = model.compare_forward(&[&run], &model.values).expect("a comparison");
    let mut wrong = model.values.clone();
    wrong[0] *= 1.05;
    let other = model.compare_forward(&[&run], &wrong).expect("a comparison");
    let rms = |one: &modelmill::forward::ForwardComparison| one.horizons[0].rms.as_ref().expect("judged")[0];
    assert!(rms(&right) < 1e-6, "{}", rms(&right));
    assert!(rms(&other) > 100.0 * rms(&right), "{} and {}", rms(&other), rms(&right));
    let whole = right.horizons.last().expect("a whole run");
    assert!(whole.is_whole_run && !whole.is_judged && whole.rms.is_none());
    assert!(
        right
            .longest_horizon
            .is_some_and(|seconds| (0.5..7.0).contains(&seconds))
    );
}
