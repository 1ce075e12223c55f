//! Stick phases on one axis: found and left out where the axis sticks, and nothing is left out where friction is a
//! function of the state or of the distance.

use modelmill::Model;
use modelmill::identify::EstimatorOptions;
use modelmill::recording::{PreparedRecording, RecordingOptions, StandstillRule};

use crate::draws::Draws;
use crate::made::bundled;

/// Mass, kg; viscous friction, N s/m; dry friction, N; offset, N.
const TRUTH: [f64; 4] = [95.0, 200.0, 25.0, -3.0];
/// Time between samples, s.
const STEP: f64 = 0.001;
/// Number of samples.
const SAMPLES: usize = 12_000;

/// How the axis rubs.
#[derive(Clone, Copy)]
enum Friction {
    /// Sticks below a small rate, m/s, at which dry friction has its full size, as a simulator or a bent tooth makes
    /// it.
    Sticks(f64),
    /// Dry friction is a function of the sign of the rate.
    BySign,
}

/// A controlled axis that follows a sum of sines: times, positions, rates, accelerations and forces.
fn simulate(friction: Friction, seed: u64) -> [Vec<f64>; 5] {
    let mut draws = Draws::new(seed);
    let waves: Vec<[f64; 3]> = (1..6)
        .map(|k| {
            let w = 0.9 * f64::from(k) * (0.8 + 0.4 * draws.uniform());
            [0.06 / f64::from(k), w, 6.3 * draws.uniform()]
        })
        .collect();
    let reference = |t: f64, order: i32| -> f64 {
        let wave = |[a, w, p]: &[f64; 3]| {
            a * w.powi(order) * (w * t + p + 0.5 * std::f64::consts::PI * f64::from(order)).sin()
        };
        waves.iter().map(wave).sum()
    };
    let [mass, viscous, dry, offset] = TRUTH;
    let mut columns = [const { Vec::new() }; 5];
    let (mut x, mut v) = (reference(0.0, 0), reference(0.0, 1));
    for i in 0..SAMPLES {
        let t = STEP * i as f64;
        if let Friction::BySign = friction {
            // The motion is prescribed, so that the force follows from it.
            (x, v) = (reference(t, 0), reference(t, 1));
        }
        let (acceleration, force) = match friction {
            Friction::Sticks(least) => {
                let force = 2e5 * (reference(t, 0) - x) + 4e3 * (reference(t, 1) - v);
                let rubs = viscous * v + dry * (v / least).clamp(-1.0, 1.0);
                ((force - rubs - offset) / mass, force)
            }
            Friction::BySign => {
                let a = reference(t, 2);
                (a, mass * a + viscous * v + dry * v.signum() + offset)
            }
        };
        for (column, value) in columns.iter_mut().zip([t, x, v, acceleration, force]) {
            column.push(value);
        }
        // Small steps, since friction is stiff.
        if let Friction::Sticks(least) = friction {
            let fine = STEP / 20.0;
            for k in 0..20 {
                let t = t + fine * f64::from(k);
                let force = 2e5 * (reference(t, 0) - x) + 4e3 * (reference(t, 1) - v);
                let a = (force - viscous * v - dry * (v / least).clamp(-1.0, 1.0) - offset) / mass;
                v += fine * a;
                x += fine * v;
            }
        }
    }
    columns
}

/// Reads the columns; with `noise` positions only, with 2e-6 m and 0.5 N of noise.
fn read(model: &Model, columns: &[Vec<f64>; 5], noise: bool, rule: StandstillRule) -> PreparedRecording {
    let mut draws = Draws::new(9);
    let [t, x, v, a, force] = columns.clone();
    let mut noisy = |values: Vec<f64>, size: f64| -> Vec<f64> {
        let size = if noise { size } else { 0.0 };
        values.into_iter().map(|value| value + size * draws.normal()).collect()
    };
    let mut all = vec![
        ("t".to_owned(), t),
        ("x".to_owned(), noisy(x, 2e-6)),
        ("motor".to_owned(), noisy(force, 0.5)),
    ];
    if !noise {
        all.extend([("x_d".to_owned(), v), ("x_dd".to_owned(), a)]);
    }
    let reading = RecordingOptions {
        columns: ["t", "x", "motor"]
            .map(|name| (name.to_owned(), name.to_owned()))
            .to_vec(),
        standstill: rule,
        ..RecordingOptions::default()
    };
    model.recording_of_table("axis", all, &reading).expect("the recording")
}

/// Identified values relative to the truth, less one.
fn errors(model: &Model, recording: &PreparedRecording) -> Vec<f64> {
    let found = model.identify(&[recording], &[], &EstimatorOptions::default());
    let found = found.expect("an identification").fit;
    let value = |name: &str| {
        let wanted = found.parameters.iter().find(|p| p.expression == name);
        wanted.map(|p| p.value).expect("the parameter")
    };
    let values = ["M", "Fv", "Fc", "offset"].map(value);
    values
        .iter()
        .zip(TRUTH)
        .map(|(value, truth)| value / truth - 1.0)
        .collect()
}

/// Share of the forces that are left out.
fn left_out(recording: &PreparedRecording) -> f64 {
    let all: Vec<bool> = recording
        .segments
        .iter()
        .flat_map(|one| one.run.left_out.concat())
        .collect();
    all.iter().filter(|out| **out).count() as f64 / SAMPLES as f64
}

#[test]
fn an_axis_that_sticks_is_identified_as_if_it_did_not() {
    let model = Model::open(bundled("emps")).expect("the model");
    for seed in 1..4 {
        let columns = simulate(Friction::Sticks(2e-3), seed);
        for (noise, most) in [(false, 1e-6), (true, 0.03)] {
            let automatic = read(&model, &columns, noise, StandstillRule::Automatic);
            let share = left_out(&automatic);
            assert!((0.001..0.3).contains(&share), "{seed}: {share}");
            let found = errors(&model, &automatic);
            assert!(
                found.iter().all(|error| error.abs() < most),
                "{seed}, {noise}: {found:?}"
            );
            let kept = read(&model, &columns, noise, StandstillRule::KeepAll);
            assert!(left_out(&kept) <= 0.0);
            // Friction of the full size at every sample is wrong, and other parameters pay for it. Under noise this may
            // be smaller than the noise.
            let worse = errors(&model, &kept);
            assert!(
                noise || worse.iter().any(|error| error.abs() > 1e-3),
                "{seed}, {noise}: {worse:?}"
            );
        }
    }
}

#[test]
fn friction_by_sign_leaves_nothing_out() {
    let model = Model::open(bundled("emps")).expect("the model");
    for seed in 1..4 {
        let columns = simulate(Friction::BySign, seed);
        let recording = read(&model, &columns, false, StandstillRule::Automatic);
        assert!(left_out(&recording) <= 0.0, "{seed}");
    }
}
