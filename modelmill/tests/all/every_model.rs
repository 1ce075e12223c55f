//! Every bundled model on its own forces with noise: `compare`, `identify` and `diagnose` go through, and say what is
//! true of such a recording. Only the noise is missing from the model, so that nothing else may be found.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use modelmill::Model;
use modelmill::diagnose::{DiagnosisOptions, DiagnosisVerdict};
use modelmill::identify::EstimatorOptions;
use modelmill::recording::RecordingOptions;
use modelmill_codegen::{Derivation, ModelEvaluator, MotionStates};
use modelmill_identify::ErrorFigures;
use modelmill_spec::Mechanism;

use crate::draws::Draws;

/// Noise of each force beside its root mean square.
const NOISE: f64 = 0.01;
/// Samples of a recording, and the time between two, s.
const MOST_SAMPLES: usize = 600;
const STEP: f64 = 0.02;
/// Waves of each coordinate.
const WAVES: usize = 4;
/// Most equations of a recording: a machine with many drives needs fewer samples.
const MOST_EQUATIONS: usize = 9600;

/// Number of samples of a recording.
fn samples_of(mechanism: &Mechanism) -> usize {
    MOST_SAMPLES.min(MOST_EQUATIONS / mechanism.drives.len())
}

/// Positions, rates and accelerations of the active coordinates, `[order][coordinate][sample]`.
type Moving = [Vec<Vec<f64>>; 3];

/// Sums of waves around the nominal pose.
fn motion(mechanism: &Mechanism, reach: f64) -> Moving {
    let mut draws = Draws::new(7);
    let samples = samples_of(mechanism);
    let mut moving: Moving = Default::default();
    for coordinate in mechanism.coordinates.iter().filter(|c| !c.passive) {
        let size = if coordinate.motion.is_angle() {
            reach
        } else {
            0.3 * reach
        };
        let mut columns = [(); 3].map(|()| vec![0.0; samples]);
        columns[0].fill(coordinate.nominal);
        for _ in 0..WAVES {
            let rate = TAU * (0.15 + 0.6 * draws.uniform());
            let phase = TAU * draws.uniform();
            let amplitude = size * (0.2 + draws.uniform()) / WAVES as f64;
            for k in 0..samples {
                let (sin, cos) = (rate * STEP * k as f64 + phase).sin_cos();
                columns[0][k] += amplitude * sin;
                columns[1][k] += amplitude * rate * cos;
                columns[2][k] -= amplitude * rate * rate * sin;
            }
        }
        for (all, column) in moving.iter_mut().zip(columns) {
            all.push(column);
        }
    }
    // Quaternions have a length of one, and their scalar parts no rates.
    let active = || mechanism.coordinates.iter().filter(|c| !c.passive).enumerate();
    let quaternion: Vec<usize> = active()
        .filter(|(_, c)| c.motion.is_quaternion())
        .map(|(i, _)| i)
        .collect();
    for k in 0..samples {
        let square: f64 = quaternion.iter().map(|i| moving[0][*i][k].powi(2)).sum();
        for i in &quaternion {
            moving[0][*i][k] /= square.sqrt();
        }
    }
    for (i, _) in active().filter(|(_, c)| !c.motion.has_rate()) {
        moving[1][i].fill(0.0);
        moving[2][i].fill(0.0);
    }
    moving
}

/// A value for every parameter: those of the file, and others where it gives none.
fn with_values(mut mechanism: Mechanism) -> Mechanism {
    let mut draws = Draws::new(3);
    for parameter in &mut mechanism.parameters {
        if parameter.nominal == 0.0 {
            parameter.nominal = 0.5 + draws.uniform();
        }
    }
    mechanism
}

/// Forces along the widest of some motions that the mechanism can follow.
fn forces(derivation: &Derivation) -> (Moving, Vec<Vec<f64>>) {
    let evaluator = ModelEvaluator::new(derivation);
    let base = derivation.nominal_base_values();
    let samples = samples_of(&derivation.mechanism);
    let mut reach = 1.0;
    loop {
        let moving = motion(&derivation.mechanism, reach);
        let [q, qd, qdd] = &moving;
        let still = vec![vec![0.0; samples]; derivation.mechanism.drives.len()];
        let states = MotionStates {
            q: q.iter().map(Vec::as_slice).collect(),
            qd: qd.iter().map(Vec::as_slice).collect(),
            qdd: qdd.iter().map(Vec::as_slice).collect(),
            load: still.iter().map(Vec::as_slice).collect(),
        };
        let found = evaluator.inverse_dynamics(&states, &base);
        match found {
            Ok(forces) => return (moving, forces),
            Err(_) if reach > 0.01 => reach *= 0.7,
            Err(fault) => panic!("no motion was found: {fault}"),
        }
    }
}

/// A recording of a model's own forces with noise, as a file.
fn recording(name: &str, derivation: &Derivation) -> PathBuf {
    let (moving, forces) = forces(derivation);
    let mechanism = &derivation.mechanism;
    let samples = samples_of(mechanism);
    let active: Vec<&str> = (mechanism.coordinates.iter())
        .filter(|c| !c.passive)
        .map(|c| c.name.as_str())
        .collect();
    let mut text = String::from("t");
    for suffix in ["", "_d", "_dd"] {
        for name in &active {
            let _ = write!(text, ",{name}{suffix}");
        }
    }
    for drive in &mechanism.drives {
        let _ = write!(text, ",{}", drive.name);
    }
    let sizes = forces.iter().map(|force| {
        let squares: f64 = force.iter().map(|f| f * f).sum();
        (squares / samples as f64).sqrt()
    });
    let sizes: Vec<f64> = sizes.collect();
    let mut draws = Draws::new(11);
    for k in 0..samples {
        let _ = write!(text, "\n{}", STEP * k as f64);
        for column in moving.iter().flatten() {
            let _ = write!(text, ",{}", column[k]);
        }
        for (force, size) in forces.iter().zip(&sizes) {
            let _ = write!(text, ",{}", force[k] + NOISE * size * draws.normal());
        }
    }
    let file = scratch(&format!("own-{name}.csv"));
    std::fs::write(&file, text + "\n").expect("a recording");
    file
}

/// Relative error over all drives, also of those with different units, each beside its own force.
fn relative(figures: &ErrorFigures) -> f64 {
    figures.nrms.unwrap_or_else(|| {
        let squares = figures.channels.values().filter_map(|one| one.nrms);
        let squares = squares.map(|nrms| nrms * nrms);
        (squares.sum::<f64>() / figures.channels.len() as f64).sqrt()
    })
}

/// The twist of a free body is recorded, its derivative is made: without decimation, so that figures are of all samples as they
/// are where accelerations are recorded too.
fn reading(mechanism: &Mechanism) -> RecordingOptions {
    let mut reading = RecordingOptions::default();
    let coordinates = &mechanism.coordinates;
    if coordinates.iter().any(|c| c.motion.is_quaternion()) {
        reading.preparation.cutoff_hz = Some(8.0);
    }
    reading
}

fn scratch(name: &str) -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join(name)
}

fn bundled(name: &str) -> PathBuf {
    let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("../model-spec/models");
    models.join(format!("{name}.toml"))
}

fn check(name: &str, path: &Path) {
    let model = Model::open(path).unwrap_or_else(|error| panic!("{name}: {error}"));
    let mechanism = &model.derivation.mechanism;
    let has_values = mechanism.parameters.iter().all(|p| p.nominal != 0.0);
    let run = if has_values {
        recording(name, &model.derivation)
    } else {
        let valued = with_values(mechanism.clone());
        recording(name, &modelmill_codegen::derive(&valued).expect("derived"))
    };
    let fault = |error: modelmill::Error| -> ! { panic!("{name}: {error}") };
    let run = (model.recording(&run, &reading(mechanism))).unwrap_or_else(|e| fault(e));

    let identified = model.identify(&[&run], &[], &EstimatorOptions::default());
    let identified = identified.unwrap_or_else(|e| fault(e)).fit;
    let fit = relative(&identified.fit);
    // Base parameters take a little of the noise along.
    assert!((0.7 * NOISE..1.05 * NOISE).contains(&fit), "{name}: {fit}");
    assert!(identified.condition_number.is_none_or(f64::is_finite), "{name}");

    let values: Vec<f64> = identified.parameters.iter().map(|p| p.value).collect();
    let nrms = |values: &[f64]| -> f64 {
        let compared = model.compare(&[&run], values);
        relative(&compared.unwrap_or_else(|e| fault(e)).figures)
    };
    let compared = nrms(&values);
    assert!((compared / fit - 1.0).abs() < 1e-6, "{name}: {compared} and {fit}");
    let nominal = nrms(&model.values);
    if has_values {
        assert!((0.8 * NOISE..1.05 * NOISE).contains(&nominal), "{name}: {nominal}");
    } else {
        assert!(nominal.is_finite(), "{name}");
    }

    let found = model.diagnose(&[&run], &[], &DiagnosisOptions::default());
    let diagnosis = found.unwrap_or_else(|e| fault(e)).diagnosis;
    let effects: Vec<_> = diagnosis.effects.iter().map(|found| &found.effect).collect();
    assert_eq!(diagnosis.verdict, DiagnosisVerdict::Adequate, "{name}: {effects:?}");
    assert!(effects.is_empty(), "{name}: {effects:?}");
    for error in [diagnosis.steps[0].fit, diagnosis.steps[0].check] {
        assert!((0.7 * NOISE..1.3 * NOISE).contains(&error), "{name}: {error}");
    }
    let floor = diagnosis.noise_floor;
    assert!((0.7 * NOISE..1.3 * NOISE).contains(&floor), "{name}: {floor}");
}

macro_rules! every {
    ($($name:ident $file:literal;)*) => {
        $(
            #[test]
            fn $name() {
                check(stringify!($name), &bundled($file));
            }
        )*

        #[test]
        fn no_bundled_model_is_left_out() {
            let tested = [$($file),*];
            let path = bundled("");
            let folder = path.parent().expect("a folder");
            let mut models = 0;
            for entry in std::fs::read_dir(folder).expect("models") {
                let path = entry.expect("an entry").path();
                if path.extension().is_some_and(|e| e == "toml") {
                    let name = path.file_stem().and_then(|s| s.to_str()).expect("a name");
                    assert!(tested.contains(&name), "{name} is not tested");
                    models += 1;
                }
            }
            assert_eq!(models, tested.len());
        }
    };
}

every! {
    arm_four_bar "arm_four_bar";
    arm_parallelogram "arm_parallelogram";
    cloos "cloos";
    delta "delta";
    delta_tied "delta_tied";
    emps "emps";
    emps_directional "emps-directional";
    drone "drone";
    humanoid "humanoid";
    five_bar "five_bar";
    four_bar "four_bar";
    gough_stewart "gough_stewart";
    gough_stewart_tied "gough_stewart_tied";
    panda "panda";
    parallelogram "parallelogram";
    puma560 "puma560";
    rx90 "rx90";
    quadruped "quadruped";
    scara "scara";
    slider_crank "slider_crank";
    spidermill "spidermill";
    spidermill_paper "spidermill-paper";
    stanford "stanford";
    three_rpr "three_rpr";
    three_rrr "three_rrr";
    two_link "two_link";
    tx40 "tx40";
}

/// A drive may act on a coordinate that follows from the others.
#[test]
fn four_bar_by_its_rocker() {
    let text = std::fs::read_to_string(bundled("four_bar")).expect("a model");
    let by_rocker = text.replace("joint = \"crank\"", "joint = \"rocker\"");
    assert_ne!(by_rocker, text);
    let path = scratch("four_bar_by_its_rocker.toml");
    std::fs::write(&path, by_rocker).expect("a model");
    check("four_bar_by_its_rocker", &path);
}
