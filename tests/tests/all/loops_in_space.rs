//! Spatial loops: the laws of mechanics on parallel robots and arms with linkages, against code that shares nothing with
//! the mill; closed forms where each leg allows them.

use modelmill_codegen::{ModelEvaluator, PassivePosition, ReductionMethod};
use modelmill_tests::fixtures::{derived, model};
use modelmill_tests::laws::{ACCURACY, Case};

/// Derives a model, shows that its reduction is exact and its passive coordinates have a closed form, and checks every
/// law of mechanics at states around the nominal pose.
#[track_caller]
fn check(name: &str, reach: f64) {
    let case = Case::near_nominal(&model(name), 160, reach).unwrap();
    let reduction = &case.derivation.reduction;
    assert!(
        matches!(reduction.method, ReductionMethod::Exact { .. }),
        "{name}: {:?}",
        reduction.method
    );
    assert!(
        matches!(case.derivation.programs.passive_position, PassivePosition::Closed),
        "{name} has no closed form"
    );
    laws(&case);
}

#[track_caller]
fn laws(case: &Case) {
    for (what, error) in [
        ("reduction", case.reduction_keeps_the_forces()),
        ("d'Alembert", case.forces_satisfy_dalembert(10)),
        ("closed loops", case.loops_stay_closed()),
    ] {
        let error = error.unwrap();
        assert!(error < 100.0 * ACCURACY, "{what}: {error:.1e}");
    }
    let gap = case.exact_rank_is_numeric_rank().unwrap();
    assert!(gap > 1e6, "gap {gap:.1e}");
}

#[test]
fn gough_stewart_platform() {
    check("gough_stewart", 0.2);
}

#[test]
fn gough_stewart_platform_with_legs_alike() {
    check("gough_stewart_tied", 0.2);
}

#[test]
fn delta_robot_and_its_rods_in_four_views() {
    for name in [
        "delta",
        "delta_tied",
        "delta-thin_rods",
        "delta-end_masses",
        "delta-pairs",
    ] {
        check(name, 0.2);
    }
}

#[test]
fn rods_as_two_masses_leave_three_parameters_of_a_delta() {
    // A crank's moment with the elbow's mass, its two first moments, and the platform with the rods' ends.
    assert_eq!(derived("delta-end_masses").reduction.retained.len(), 4);
}

#[test]
fn a_pair_of_thin_rods_is_one_of_twice_the_mass_that_turns_with_its_spacing_in_the_constants() {
    // Each rod of a pair moves as the other, so that the pair has no more base parameters than one thin rod.
    let [pair, one] = ["delta-pairs", "delta-thin_rods"].map(|n| derived(n).reduction.retained.len());
    assert_eq!(pair, one);
}

#[test]
fn planar_mechanisms_with_slides() {
    check("three_rpr", 0.2);
    check("slider_crank", 1.0);
}

#[test]
fn arms_with_linkages() {
    check("arm_parallelogram", 0.3);
    check("arm_four_bar", 0.2);
}

/// Passive coordinates of the platform's legs are found for every pose that the legs reach, and named faults elsewhere.
#[test]
fn a_pose_is_never_no_number() {
    let derivation = derived("gough_stewart_tied");
    let evaluator = ModelEvaluator::new(&derivation);
    let mechanism = &derivation.mechanism;
    let mut stream = modelmill_tests::stream::Stream::new(5);
    let sample = modelmill_tests::sample::Sample::random(mechanism, 500, 6.0, &mut stream);
    let mut found = 0;
    for i in 0..sample.len() {
        if let Ok(passive) = evaluator.passive_motion(&sample.only(i).states()) {
            assert!(passive.iter().flatten().all(|x| x.is_finite()));
            found += 1;
        }
    }
    assert!(found > 300, "{found}");
}

/// What the program was not made for: derived like everything else, and held against numbers.
#[test]
fn cranks_instead_of_slides() {
    check("six_rus", 0.1);
}

/// The drives' coordinates are independent and the platform follows from them: by Newton's method, while points are
/// drawn in the field as if its pose were given.
#[test]
fn drives_may_be_independent_instead_of_the_platform() {
    for (name, same) in [
        ("delta-by_cranks", "delta"),
        ("gough_stewart_tied-by_lengths", "gough_stewart_tied"),
    ] {
        let case = Case::near_nominal(&model(name), 160, 0.05).unwrap();
        let reduction = &case.derivation.reduction;
        assert!(matches!(reduction.method, ReductionMethod::Exact { .. }), "{name}");
        laws(&case);
        // Which coordinates are independent changes neither the products nor their dependences.
        let other = derived(same);
        assert_eq!(reduction.products, other.reduction.products);
        assert_eq!(case.derivation.dependency_texts(), other.dependency_texts());
    }
}

/// Three legs in planes tie a platform together; no leg can be solved by itself. The radicand of the platform's yaw is a
/// square, `(1 + cos(pitch)*cos(roll))^2` for equal legs, so that its two assemblies are two motions.
#[test]
fn platforms_of_three_freedoms() {
    for name in ["three_rrs", "three_prs"] {
        let case = Case::near_nominal(&model(name), 160, 0.1).unwrap();
        let method = &case.derivation.reduction.method;
        assert!(matches!(method, ReductionMethod::Exact { .. }), "{name}: {method:?}");
        for error in [case.forces_satisfy_dalembert(10), case.loops_stay_closed()] {
            assert!(error.unwrap() < 100.0 * ACCURACY);
        }
        case.exact_rank_is_numeric_rank().unwrap();
    }
}

/// Each leg ends in a revolute joint of the platform, so that its loop has an equation too many.
#[test]
fn equations_that_follow_from_others_are_left_out() {
    let case = Case::near_nominal(&model("spherical_wrist"), 160, 0.2).unwrap();
    let method = &case.derivation.reduction.method;
    assert!(matches!(method, ReductionMethod::Exact { .. }), "{method:?}");
    laws(&case);
}
