//! The model of a rig does not depend on the order of the rig's entries: not on which joints close loops, and not on the
//! rounding of lengths.

use std::path::Path;

use modelmill_boundary::files::{DiskFiles, MemoryFiles};
use modelmill_codegen::{Derivation, ModelEvaluator, MotionStates};
use modelmill_reduction::{default_plan, reduce, sampled_forces};
use modelmill_rig::Rig;

use crate::{derived, shuffled};

/// The whole robot.
const BUNDLED: &str = "model-spec/rigs/spidermill-full.toml";

/// The rigs of the workspace that need no plan. The others have sliding joints, and the plan names what replaces them.
const RIGS: [&str; 3] = [
    BUNDLED,
    "model-spec/rigs/spidermill-seventeen.toml",
    "fleet/program/five_bar.rig.toml",
];

/// The rig of a file of the workspace with its entries in a random order, or in their own order without a seed.
fn rig_in_order(file: &str, seed: Option<u64>) -> Rig {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(file);
    let mut text = std::fs::read_to_string(&path).expect("the rig");
    if let Some(seed) = seed {
        text = shuffled(&text, seed);
    }
    let loaded = modelmill_rig::load(&path.display().to_string(), &text, &DiskFiles::default());
    loaded.unwrap_or_else(|failure| panic!("{failure}")).rig
}

fn model(rig: &Rig) -> String {
    let plan = default_plan(rig).unwrap_or_else(|says| panic!("{says:?}"));
    reduce(plan.rig(rig), &plan)
        .unwrap_or_else(|failure| panic!("{failure}"))
        .model
}

/// Seven of the eleven groups rotate as another one or not at all; two loops of five equations less remain.
#[test]
fn parts_that_move_alike_need_no_coordinate() {
    for seed in 0..20 {
        let rig = rig_in_order(BUNDLED, Some(seed));
        let model = model(&rig);
        let loaded = modelmill_spec::load("model.toml", &model, &MemoryFiles::default()).expect("a model");
        let mechanism = &loaded.mechanism;
        let passive = mechanism.coordinates.iter().filter(|c| c.passive).count();
        assert_eq!(
            (
                mechanism.parts.len(),
                mechanism.coordinates.len(),
                passive,
                mechanism.loops.len()
            ),
            (11, 4, 2, 1),
            "seed {seed}: {model}"
        );
    }
}

/// Reduces a rig with its entries in the orders of some seeds; checks the number of base parameters, and the model's
/// forces against those of the rig.
#[track_caller]
fn check_orders(file: &str, seeds: impl IntoIterator<Item = u64>) {
    let given = derived(&model(&rig_in_order(file, None)));
    let n_base = given.base_parameters().len();
    for seed in seeds {
        let rig = rig_in_order(file, Some(seed));
        let derivation = derived(&model(&rig));
        assert_eq!(derivation.base_parameters().len(), n_base, "{file}, seed {seed}");
        check_forces(&rig, &derivation, &format!("{file}, seed {seed}"));
    }
}

/// The model has the forces of the rig at states that are drawn.
#[track_caller]
fn check_forces(rig: &Rig, derivation: &Derivation, case: &str) {
    let sampled = sampled_forces(rig, 20, 0.2).expect("forces");
    // Columns in the order of the model, forces of the rig in its own.
    let names = derivation.mechanism.coordinates.iter().filter(|c| !c.passive);
    let at: Vec<usize> = names
        .map(|c| {
            let own = rig.coordinates.iter().position(|r| r.name == c.name);
            own.expect("the coordinate")
        })
        .collect();
    let column = |of: fn(&modelmill_rig::RigState) -> &Vec<f64>| -> Vec<Vec<f64>> {
        at.iter()
            .map(|k| sampled.iter().map(|(state, _)| of(state)[*k]).collect())
            .collect()
    };
    let (q, qd, qdd) = (column(|s| &s.q), column(|s| &s.qd), column(|s| &s.qdd));
    let states = MotionStates {
        q: q.iter().map(Vec::as_slice).collect(),
        qd: qd.iter().map(Vec::as_slice).collect(),
        qdd: qdd.iter().map(Vec::as_slice).collect(),
        load: Vec::new(),
    };
    let forces = ModelEvaluator::new(derivation)
        .inverse_dynamics(&states, &derivation.nominal_base_values())
        .expect("forces");
    for (drive, forces) in derivation.mechanism.drives.iter().zip(&forces) {
        let k = rig.drives.iter().position(|r| r.name == drive.name).expect("the drive");
        for (x, (_, y)) in forces.iter().zip(&sampled) {
            let scale = y[k].abs().max(100.0);
            assert!((x - y[k]).abs() < 1e-7 * scale, "{case}: {x} instead of {}", y[k]);
        }
    }
}

#[test]
fn base_parameters_and_forces_are_those_of_any_other_order() {
    assert_eq!(derived(&model(&rig_in_order(BUNDLED, None))).base_parameters().len(), 9);
    check_orders(BUNDLED, [3, 11]);
    check_orders("fleet/program/five_bar.rig.toml", [5]);
}

/// All rigs that need no plan, with 20 orders each.
#[test]
#[ignore = "for a computer with time"]
fn permuted_entries_of_all_rigs_keep_base_and_forces() {
    for file in RIGS {
        check_orders(file, 0..20);
        println!("{file}: 20 orders keep base parameters and forces");
    }
}
