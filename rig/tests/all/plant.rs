//! Rigs moved by forces: the way back from the forces of a motion, and the balance of energy.

use std::path::Path;

use modelmill_rig::{PlantError, Rig, RigPlant, RigState, RigTracker, energy, forces, load_file};

fn rig(name: &str) -> Rig {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../model-spec/rigs");
    match load_file(&folder.join(format!("{name}.toml"))) {
        Ok(loaded) => loaded.rig,
        Err(failure) => panic!("{}", failure.render(false)),
    }
}

#[test]
fn accelerations_are_those_whose_forces_were_given() {
    // With rods and dry friction: forces depend on rates and accelerations in many ways.
    let rig = rig("spidermill-worn");
    for (k, qdd) in [[0.0, 0.0], [3.0, -1.0], [-7.0, 12.0]].into_iter().enumerate() {
        let state = RigState {
            q: vec![1.8 + 0.05 * k as f64, 1.34],
            qd: vec![0.4, -0.3],
            qdd: qdd.to_vec(),
        };
        let motion = RigTracker::new(&rig).unwrap().follow(&state).unwrap();
        let given = forces(&rig, &motion).unwrap();
        let mut plant = RigPlant::new(&rig, &state.q, &state.qd).unwrap();
        let found = plant.accelerations(&given).unwrap();
        for (found, expected) in found.iter().zip(qdd) {
            assert!((found - expected).abs() < 1e-8, "{found} instead of {expected}");
        }
    }
}

/// Work of held forces over the way of the drives becomes energy of the bodies: fourth order in the step.
#[test]
fn what_moves_by_itself_keeps_its_energy() {
    let rig = rig("spidermill-full");
    let drift = |dt: f64| {
        let mut plant = RigPlant::new(&rig, &[1.8, 1.341_593], &[0.3, -0.2]).unwrap();
        let of = |plant: &mut RigPlant<'_>| energy(&rig, &plant.motion(&[0.0, 0.0]).unwrap());
        let before = of(&mut plant);
        let mut t = 0.0;
        while t < 0.1 - 1e-9 {
            plant.step(&[0.0, 0.0], dt).unwrap();
            t += dt;
        }
        assert!((plant.q()[0] - 1.8).abs() > 0.02, "it hardly moved");
        (of(&mut plant) - before).abs() / before.abs()
    };
    let (coarse, fine) = (drift(0.02), drift(0.01));
    assert!(fine < 1e-6, "{fine}");
    assert!(fine < coarse / 8.0, "{coarse} and {fine}");
}

#[test]
fn forces_of_another_number_are_refused() {
    let rig = rig("spidermill-full");
    let mut plant = RigPlant::new(&rig, &[1.8, 1.341_593], &[0.0, 0.0]).unwrap();
    let fault = PlantError::Count { found: 1, expected: 2 };
    assert_eq!(plant.step(&[0.0], 0.01), Err(fault.clone()));
    assert_eq!(RigPlant::new(&rig, &[1.8], &[0.0, 0.0]).err(), Some(fault));
    let far = RigPlant::new(&rig, &[1.8, 5.0], &[0.0, 0.0]).err();
    assert!(matches!(far, Some(PlantError::Pose(_))), "{far:?}");
}
