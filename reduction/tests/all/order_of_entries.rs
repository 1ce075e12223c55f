//! The model of a rig does not depend on the order of the rig's entries: not on which joints close loops, and not on the
//! rounding of lengths.

use std::path::Path;

use modelmill_boundary::files::{DiskFiles, MemoryFiles};
use modelmill_codegen::{ModelEvaluator, MotionStates};
use modelmill_reduction::{default_plan, reduce, sampled_forces};
use modelmill_rig::Rig;

use crate::{derived, shuffled};

fn bundled() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../model-spec/rigs/spidermill-full.toml");
    std::fs::read_to_string(path).expect("the rig")
}

/// The rig with its entries in a random order.
fn shuffled_rig(text: &str, seed: u64) -> Rig {
    let loaded = modelmill_rig::load("shuffled.toml", &shuffled(text, seed), &DiskFiles::default());
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
    let text = bundled();
    for seed in 0..20 {
        let rig = shuffled_rig(&text, seed);
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

#[test]
fn base_parameters_and_forces_are_those_of_any_other_order() {
    let text = bundled();
    for seed in [3, 11] {
        let rig = shuffled_rig(&text, seed);
        let derivation = derived(&model(&rig));
        assert_eq!(derivation.base_parameters().len(), 9, "seed {seed}");
        let sampled = sampled_forces(&rig, 20, 0.2).expect("forces");
        // Columns in the order of the model, forces of the rig in its own.
        let names = derivation.mechanism.coordinates.iter().filter(|c| !c.passive);
        let at: Vec<usize> = names
            .map(|c| {
                rig.coordinates
                    .iter()
                    .position(|r| r.name == c.name)
                    .expect("the coordinate")
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
        let forces = ModelEvaluator::new(&derivation)
            .inverse_dynamics(&states, &derivation.nominal_base_values())
            .expect("forces");
        for (drive, forces) in derivation.mechanism.drives.iter().zip(&forces) {
            let k = rig.drives.iter().position(|r| r.name == drive.name).expect("the drive");
            for (x, (_, y)) in forces.iter().zip(&sampled) {
                assert!(
                    (x - y[k]).abs() < 1e-7 * y[k].abs().max(100.0),
                    "seed {seed}: {x} instead of {}",
                    y[k]
                );
            }
        }
    }
}
