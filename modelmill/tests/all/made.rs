//! Recordings of bundled models along motions of their own, with noise that has a memory, and with something done to them.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::ops::Range;
use std::panic::Location;
use std::path::{Path, PathBuf};

use modelmill::Model;
use modelmill_codegen::{Derivation, ModelEvaluator, MotionStates};
use modelmill_spec::JointCoordinate;

use crate::draws::Draws;

pub(crate) const SAMPLES: usize = 2000;
/// Time between two samples, s.
pub(crate) const STEP: f64 = 0.01;
/// Noise of each force beside its effective value, and how much of it a sample keeps of the one before.
const NOISE: f64 = 0.01;
const KEPT: f64 = 0.6;

/// What is done to a run.
#[derive(Clone, Copy)]
pub(crate) enum Made<'a> {
    Nothing,
    /// A further part, as its entry in the model file.
    Body(&'a str),
    /// Dry and viscous friction on a drive.
    Friction(usize, f64, f64),
    Scale(usize, f64),
    Offset(usize, f64),
    /// The clock counts so many seconds in one.
    Clock(f64),
    /// Between two samples a force pushes some drives, by so many times their effective force.
    Bump(&'a [usize], usize, usize, f64),
    /// Friction of a drive comes on top of a further part, as for [`Made::Body`].
    BodyAndFriction(&'a str, usize, f64, f64),
    /// Measured forces of all drives are scaled, and there may be a further part.
    BodyAndScales(&'a str, &'a [f64]),
    /// So many times what a model weighs more, between two samples: a push.
    Push(&'a Model, f64, usize, usize),
    /// The encoder of a joint sits before a gear that yields by so much for each unit of what its drive carries.
    Yields(usize, f64),
    /// The encoder of a joint reads so much too much.
    Zero(usize, f64),
    /// A hose pulls a joint back by at most so much, beyond so much of its way from the middle hardly more.
    Hose(usize, f64, f64),
    /// The force of a drive lacks between two samples.
    Lost(usize, usize, usize),
}

/// A recording of a bundled model's positions and forces, along a motion of its own.
#[track_caller]
pub(crate) fn run(name: &str, seed: u64, made: Made) -> PathBuf {
    let model = match made {
        Made::Body(part) | Made::BodyAndFriction(part, ..) | Made::BodyAndScales(part, _) => with_part(name, part),
        _ => Model::open(bundled(name)).expect("the model"),
    };
    run_of(&model, name, seed, made)
}

/// A bundled model with a further part, given as its entry in the model file.
pub(crate) fn with_part(name: &str, part: &str) -> Model {
    let text = std::fs::read_to_string(bundled(name)).expect("a model");
    Model::from_text(name, &format!("{text}{part}")).expect("the model")
}

/// How far a coordinate goes, rad or m; loops leave less room.
fn reach(derivation: &Derivation, coordinate: &JointCoordinate) -> f64 {
    let wide = if derivation.mechanism.loops.is_empty() {
        1.0
    } else {
        0.3
    };
    wide * if coordinate.motion.is_angle() { 0.35 } else { 0.1 }
}

/// Adds so many times what a model weighs more than another.
fn push(forces: &mut [Vec<f64>], with: &[Vec<f64>], without: &[Vec<f64>], times: f64, when: Range<usize>) {
    for (d, force) in forces.iter_mut().enumerate() {
        for k in when.clone() {
            force[k] += times * (with[d][k] - without[d][k]);
        }
    }
}

/// Adds half a wave.
fn bump(force: &mut [f64], height: f64) {
    let n = force.len() as f64;
    for (k, f) in force.iter_mut().enumerate() {
        *f += height * (0.5 * TAU * k as f64 / n).sin();
    }
}

/// Adds a pull that gives way on both sides of the middle.
fn hose(force: &mut [f64], positions: &[f64], most: f64, way: f64) {
    let middle = positions.iter().sum::<f64>() / SAMPLES as f64;
    for (f, position) in force.iter_mut().zip(positions) {
        *f += most * ((position - middle) / way).tanh();
    }
}

/// What an encoder reads beside where its joint is.
fn read_more(made: Made, joint: usize, carried: &[Vec<f64>], sample: usize) -> f64 {
    match made {
        Made::Yields(drive, by) if drive == joint => by * carried[drive][sample],
        Made::Zero(other, by) if other == joint => by,
        _ => 0.0,
    }
}

/// A recording of a model that is derived already.
#[track_caller]
pub(crate) fn run_of(model: &Model, name: &str, seed: u64, made: Made) -> PathBuf {
    let mut draws = Draws::new(seed);
    let active = model.active_coordinates();
    let mut columns = [(); 3].map(|()| vec![vec![0.0; SAMPLES]; active.len()]);
    let coordinates = &model.derivation.mechanism.coordinates;
    for (i, coordinate) in coordinates.iter().filter(|c| !c.passive).enumerate() {
        columns[0][i].fill(coordinate.nominal);
        let reach = reach(&model.derivation, coordinate);
        for _ in 0..4 {
            let rate = TAU * (0.1 + 0.9 * draws.uniform());
            let phase = TAU * draws.uniform();
            let amplitude = reach * (0.3 + draws.uniform()) / 2.0;
            for k in 0..SAMPLES {
                let (sin, cos) = (rate * STEP * k as f64 + phase).sin_cos();
                columns[0][i][k] += amplitude * sin;
                columns[1][i][k] += amplitude * rate * cos;
                columns[2][i][k] -= amplitude * rate * rate * sin;
            }
        }
    }
    let [q, qd, qdd]: [Vec<&[f64]>; 3] = columns.each_ref().map(|all| all.iter().map(Vec::as_slice).collect());
    let at_rest = MotionStates {
        q: q.clone(),
        qd: vec![&[0.0; SAMPLES]; active.len()],
        qdd: vec![&[0.0; SAMPLES]; active.len()],
        load: Vec::new(),
    };
    let states = MotionStates {
        q,
        qd,
        qdd,
        load: Vec::new(),
    };
    let evaluator = ModelEvaluator::new(&model.derivation);
    let mut forces = evaluator.inverse_dynamics(&states, &model.values).expect("forces");
    if let Made::Push(pushed, times, from, to) = made {
        let [with, without] = [pushed, model].map(|model| {
            let evaluator = ModelEvaluator::new(&model.derivation);
            let forces = evaluator.inverse_dynamics(&at_rest, &model.values);
            forces.expect("forces")
        });
        push(&mut forces, &with, &without, times, from..to);
    }
    if let Made::Hose(joint, most, way) = made {
        hose(&mut forces[joint], &columns[0][joint], most, way);
    }
    let carried = forces.clone();
    let motion = evaluator.drive_motion(&states).expect("drives");
    let drives = model.row_names();
    let mut clock = 1.0;
    for (d, force) in forces.iter_mut().enumerate() {
        let rate = &motion[drives.len() + d];
        for (f, rate) in force.iter_mut().zip(rate) {
            match made {
                Made::Friction(drive, dry, viscous) | Made::BodyAndFriction(_, drive, dry, viscous) if drive == d => {
                    *f += dry * rate.signum() + viscous * rate;
                }
                Made::Scale(drive, factor) if drive == d => *f *= factor,
                Made::BodyAndScales(_, factors) => *f *= factors[d],
                Made::Offset(drive, offset) if drive == d => *f += offset,
                Made::Clock(factor) => clock = factor,
                _ => {}
            }
        }
        let size = (force.iter().map(|f| f * f).sum::<f64>() / SAMPLES as f64).sqrt();
        if let Made::Bump(drives, from, to, by) = made
            && drives.contains(&d)
        {
            bump(&mut force[from..to], by * size);
        }
        let mut noise = 0.0;
        for f in force {
            noise = KEPT * noise + (1.0 - KEPT * KEPT).sqrt() * draws.normal();
            *f += NOISE * size * noise;
        }
    }
    let mut text = format!("t,{},{}", active.join(","), drives.join(","));
    for k in 0..SAMPLES {
        let _ = write!(text, "\n{}", clock * STEP * k as f64);
        for (i, column) in columns[0].iter().enumerate() {
            let _ = write!(text, ",{}", column[k] + read_more(made, i, &carried, k));
        }
        for (d, force) in forces.iter().enumerate() {
            let is_lost = matches!(made, Made::Lost(drive, from, to) if drive == d && (from..to).contains(&k));
            let _ = write!(text, ",{}", if is_lost { f64::NAN } else { force[k] });
        }
    }
    // Modules use the same seeds, and their tests run at the same time.
    let module = Path::new(Location::caller().file()).file_stem();
    let module = module.expect("a file").to_string_lossy();
    let file = format!("{module}-{name}-{seed}.csv");
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join(file);
    std::fs::write(&file, text + "\n").expect("a recording");
    file
}

pub(crate) fn bundled(name: &str) -> PathBuf {
    let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("../model-spec/models");
    models.join(format!("{name}.toml"))
}
