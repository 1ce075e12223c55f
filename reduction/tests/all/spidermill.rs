//! The whole robot reduces to Table 1 of the paper, and the model that comes out is the bundled one.

use std::path::{Path, PathBuf};

use modelmill_boundary::files::MemoryFiles;
use modelmill_codegen::{Derivation, ModelEvaluator, MotionStates};
use modelmill_reduction::{PlanarReduction, plan_file, reduce};
use modelmill_rig::{Rig, RigState, RigTracker, forces};

fn workspace(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path)
}

fn rig() -> Rig {
    let path = workspace("model-spec/rigs/spidermill-full.toml");
    modelmill_rig::load_file(&path)
        .unwrap_or_else(|failure| panic!("{failure}"))
        .rig
}

fn reduced() -> PlanarReduction {
    let plan = plan_file(&workspace("model-spec/rigs/spidermill-plan.toml")).unwrap_or_else(|f| panic!("{f}"));
    reduce(&rig(), &plan).unwrap_or_else(|failure| panic!("{failure}"))
}

fn derived(text: &str) -> Derivation {
    let loaded = modelmill_spec::load("model.toml", text, &MemoryFiles::default());
    let loaded = loaded.unwrap_or_else(|failure| panic!("{failure}"));
    assert_eq!(loaded.render(false), "", "no warnings");
    modelmill_codegen::derive(&loaded.mechanism).expect("a derivation")
}

fn bundled() -> Derivation {
    derived(&std::fs::read_to_string(workspace("model-spec/models/spidermill.toml")).expect("a model"))
}

#[test]
fn the_parameters_are_those_of_table_1() {
    let derivation = derived(&reduced().model);
    let found: Vec<(&str, f64)> = derivation
        .mechanism
        .parameters
        .iter()
        .map(|p| (p.name.as_str(), p.nominal))
        .collect();
    let expected = [
        ("m1", 50.9597),
        ("m2", 7.9538),
        ("m3", 14.5773),
        ("m4", 12.4560),
        ("dc1", 0.565),
        ("dc3", 0.515),
        ("Ic12", 6.3195),
        ("Ic32", 1.6173),
    ];
    assert_eq!(found.len(), expected.len());
    for ((name, value), (expected_name, expected)) in found.iter().zip(expected) {
        assert_eq!(*name, expected_name);
        assert!((value - expected).abs() < 1e-11, "{name} = {value}");
    }
}

#[test]
fn the_base_parameters_are_those_of_the_bundled_model() {
    let (ours, theirs) = (derived(&reduced().model), bundled());
    let expressions = |derivation: &Derivation| -> Vec<(String, String)> {
        let base = derivation.base_parameters().into_iter();
        base.map(|base| (base.name, base.expression)).collect()
    };
    assert_eq!(expressions(&ours), expressions(&theirs));
    for (x, y) in ours.nominal_base_values().iter().zip(theirs.nominal_base_values()) {
        assert!((x - y).abs() < 1e-9 * y.abs(), "{x} {y}");
    }
}

/// Forces of the reduced model beside those of the full robot: nothing is lost but rounding.
#[test]
fn the_forces_are_those_of_the_whole_robot() {
    let reduced = reduced();
    holds_the_forces(&rig(), &reduced);
}

/// Rods of a rig are moments of their mass in a model; coupled drives go over as they are.
#[test]
fn rods_and_coupled_drives_go_over() {
    let mut rig = rig();
    let drives = ["spindle_left", "spindle_right"];
    for (kind, values) in [
        ("rod_inertia", [("m", 8.0), ("c", 0.45), ("I", 0.54)]),
        ("coupled_drive", [("Ia", 2.0), ("Fv", 20.0), ("Fs", 15.0)]),
    ] {
        let effect = rig.effect(kind, &drives, &values);
        rig.effects
            .push(effect.unwrap_or_else(|faults| panic!("{}", faults[0])));
    }
    let plan = plan_file(&workspace("model-spec/rigs/spidermill-plan.toml")).unwrap_or_else(|f| panic!("{f}"));
    let reduced = reduce(&rig, &plan).unwrap_or_else(|failure| panic!("{failure}"));
    holds_the_forces(&rig, &reduced);
}

fn holds_the_forces(rig: &Rig, reduced: &PlanarReduction) {
    let derivation = derived(&reduced.model);
    let mut tracker = RigTracker::new(rig).expect("a pose");
    let mut columns = vec![Vec::new(); 6];
    let mut expected = vec![Vec::new(); 2];
    for i in 0..60 {
        let wave = |k: f64| (k * f64::from(i)).sin();
        let state = RigState {
            q: vec![1.8 + 0.2 * wave(0.7), 1.341_592_653_589_793 + 0.2 * wave(1.1)],
            qd: vec![wave(1.9), wave(2.3)],
            qdd: vec![5.0 * wave(2.9), 5.0 * wave(3.1)],
        };
        let found = forces(rig, &tracker.follow(&state).expect("a pose")).expect("forces");
        for d in 0..2 {
            expected[d].push(found[d]);
            columns[d].push(state.q[d]);
            columns[2 + d].push(state.qd[d]);
            columns[4 + d].push(state.qdd[d]);
        }
    }
    let slices = |range: std::ops::Range<usize>| columns[range].iter().map(Vec::as_slice).collect();
    let states = MotionStates {
        q: slices(0..2),
        qd: slices(2..4),
        qdd: slices(4..6),
        load: Vec::new(),
    };
    let values = derivation.nominal_base_values();
    let found = ModelEvaluator::new(&derivation)
        .inverse_dynamics(&states, &values)
        .expect("forces");
    for (found, expected) in found.iter().zip(&expected) {
        let error: f64 = found.iter().zip(expected).map(|(x, y)| (x - y).powi(2)).sum();
        let norm: f64 = expected.iter().map(|y| y * y).sum();
        let relative = (error / norm).sqrt();
        println!("reduced model against rig: {relative:.1e}");
        assert!(relative < 1e-9, "{relative:.1e}");
    }
}

#[test]
fn the_report_names_every_approximation() {
    let report = reduced().report;
    println!("{}", report.text());
    let finding = |about: &str, says: &str| {
        let found = report
            .findings
            .iter()
            .find(|f| f.about == about && f.says.contains(says));
        found.unwrap_or_else(|| panic!("nothing about {about} {says}")).clone()
    };
    // Step 1: the end effector is mounted beside the plane, as the paper says.
    let platform = finding("G4", "not halved");
    assert!((platform.sizes[0].value - 0.02).abs() < 1e-12);
    assert!(
        finding("G8", "perpendicular")
            .sizes
            .iter()
            .all(|size| !size.is_significant())
    );
    // Step 2: eq. (1) holds for the cranks, not for the coupling, which only translates.
    assert!(finding("S1", "50.9597").sizes.iter().all(|size| !size.is_significant()));
    let elbow = finding("elbow_left", "only translates");
    assert!(!elbow.sizes[0].is_significant() && (elbow.sizes[1].value - 0.018_f64.hypot(0.062)).abs() < 1e-9);
    // A point mass has no inertia about itself.
    assert!((elbow.sizes[2].value - 0.12).abs() < 1e-9);
    // Step 3: both sides are alike.
    assert!(!finding("m1", "S1 and S7").sizes[0].is_significant());
    // Step 4: the spindles push where they did.
    assert!(
        finding("spindle_left", "same points")
            .sizes
            .iter()
            .all(|size| !size.is_significant())
    );
    let steps: Vec<u8> = report.findings.iter().map(|finding| finding.step).collect();
    assert!((1..=4).all(|step| steps.contains(&step)));
}
