//! What joints transmit: against bodies by themselves, on bundled models and on random mechanisms, and in emitted code.

use modelmill_codegen::ModelEvaluator;
use modelmill_tests::fixtures::{derived, model};
use modelmill_tests::free_bodies::Found;
use modelmill_tests::laws::Case;
use modelmill_tests::random::{self, Matter};

/// Checks random trees and planar loops; returns what was found on each kind.
#[track_caller]
fn check(matter: Matter, n: u64) {
    let trees = (0..n).map(|seed| Case::new(&random::tree(seed, matter), 20, 3.0));
    let loops = (0..n / 2).map(|seed| Case::new(&random::planar_loop(seed, matter), 20, 0.4));
    let found: Vec<Result<Found, String>> = trees
        .chain(loops)
        .map(|case| case.and_then(|case| case.reactions_hold_every_body()))
        .collect();
    let breaches: Vec<&String> = found.iter().filter_map(|f| f.as_ref().err()).collect();
    assert!(breaches.is_empty(), "{breaches:#?}");
    let found: Vec<Found> = found.into_iter().flatten().collect();
    let worst = found.iter().map(|f| f.error).fold(0.0, f64::max);
    let told: usize = found.iter().map(|f| f.told).sum();
    let left_out: usize = found.iter().map(|f| f.left_out).sum();
    println!(
        "{} mechanisms, {told} components told, {left_out} left out, largest error {worst:.1e}",
        found.len()
    );
    assert!(told > 0 && left_out > 0);
}

#[test]
fn reactions_of_anything_hold_every_body() {
    check(Matter::Anything, 60);
}

#[test]
fn reactions_of_bodies_hold_every_body() {
    check(Matter::Physical, 30);
}

/// A model at states around its nominal pose: how many components are told and left out.
#[track_caller]
fn check_model(name: &str, reach: f64) -> [usize; 2] {
    let case = Case::near_nominal(&model(name), 12, reach).unwrap();
    let found = case.reactions_hold_every_body().unwrap();
    println!(
        "{name}: {} told, {} left out, largest error {:.1e}",
        found.told, found.left_out, found.error
    );
    [found.told, found.left_out]
}

#[test]
fn arms_determine_everything() {
    for (name, joints) in [
        ("cloos", 6),
        ("emps", 1),
        ("panda", 7),
        ("parallelogram", 3),
        ("puma560", 6),
        ("rx90", 6),
        ("scara", 4),
        ("stanford", 6),
        ("two_link", 2),
        ("tx40", 6),
    ] {
        assert_eq!(check_model(name, 2.0), [6 * joints, 0], "{name}");
    }
}

/// Across their plane nothing is determined: a force and two moments in each joint, and a force in each cut.
#[test]
fn planar_loops_determine_what_lies_in_their_plane() {
    for (name, joints, loops) in [
        ("five_bar", 4, 1),
        ("four_bar", 3, 1),
        ("spidermill", 4, 1),
        ("spidermill-paper", 4, 1),
        ("three_rrr", 7, 2),
    ] {
        let [told, left_out] = check_model(name, 0.2);
        assert_eq!([told, left_out], [3 * joints + 2 * loops, 3 * joints + loops], "{name}");
    }
}

#[test]
fn linkages_and_slides() {
    for name in ["three_rpr", "slider_crank", "arm_parallelogram", "arm_four_bar"] {
        let [told, left_out] = check_model(name, 0.2);
        assert!(told > 0 && left_out > 0, "{name}");
    }
}

/// Ball joints at the ends of the legs leave nothing open but what a leg may turn about itself.
#[test]
fn parallel_robots_in_space() {
    for name in ["delta", "delta_tied", "gough_stewart", "gough_stewart_tied"] {
        let [told, left_out] = check_model(name, 0.2);
        assert!(told > 0, "{name}: {left_out} left out");
    }
}

/// A rod whose pivot moves, loops followed by Newton's method, and loops whose drives are independent.
#[test]
fn rods_and_loops_without_a_closed_form() {
    for (name, reach) in [
        ("swinging_cylinder", 0.6),
        ("spatial_slider", 0.2),
        ("spatial_press", 0.2),
        ("delta-by_cranks", 0.05),
    ] {
        check_model(name, reach);
    }
}

/// A bar on a pivot, by hand: at rest the bearing holds the weight, in motion also what keeps the bar on its circle.
#[test]
fn a_bearing_by_hand() {
    let derivation = derived("two_link");
    let reactions = derivation.reactions().unwrap();
    let names: Vec<&str> = reactions.joints.iter().map(|j| j.name.as_str()).collect();
    assert_eq!(names.len(), 2, "{names:?}");
    let mechanism = &derivation.mechanism;
    let evaluator = ModelEvaluator::new(&derivation);
    let at_rest = modelmill_codegen::MotionStates {
        q: vec![&[0.0], &[0.0]],
        qd: vec![&[0.0], &[0.0]],
        qdd: vec![&[0.0], &[0.0]],
        load: Vec::new(),
    };
    let values = evaluator.reactions(&reactions, &at_rest).unwrap();
    let numbers =
        modelmill_tests::mechanics::Numbers::new(mechanism, modelmill_tests::base_parameters::nominal(mechanism));
    let mass: f64 = numbers.bodies().iter().map(|(_, inertia)| inertia[(3, 3)]).sum();
    let weight = numbers.gravity() * -mass;
    for k in 0..3 {
        let place = reactions.joints[0].force[k].unwrap();
        assert!(
            (values[place][0] - weight[k]).abs() < 1e-12 * weight.norm(),
            "{values:?}"
        );
    }
}
