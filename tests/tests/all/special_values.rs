//! Values of a model's constants at which fewer columns are independent than for constants in general.

use modelmill_codegen::ModelEvaluator;
use modelmill_spec::Mechanism;
use modelmill_tests::fixtures::{derive, model};
use modelmill_tests::laws::Case;
use modelmill_tests::rank::rank_of_products;
use modelmill_tests::sample::Sample;
use modelmill_tests::stream::Stream;

fn with_value(mut mechanism: Mechanism, constant: &str, value: f64) -> Mechanism {
    let found = mechanism.constants.iter_mut().find(|c| c.name == constant);
    found.expect("a constant of the model").value = value;
    mechanism
}

/// Exact rank for constants in general and numeric rank at the file's values.
fn ranks(mechanism: &Mechanism) -> (usize, usize) {
    let derivation = derive(mechanism);
    let evaluator = ModelEvaluator::new(&derivation);
    let reach = if mechanism.loops.is_empty() { 3.0 } else { 0.3 };
    let sample = Sample::random(mechanism, 200, reach, &mut Stream::new(8)).reachable(&evaluator);
    let numeric = rank_of_products(&evaluator, &sample).expect("reachable states");
    assert!(numeric.gap > 1e6, "gap {:.1e}", numeric.gap);
    (derivation.reduction.retained.len(), numeric.rank)
}

/// Base parameters for the file's values alone.
fn rank_at_values(mechanism: &Mechanism) -> usize {
    derive(&mechanism.with_numeric_constants()).reduction.retained.len()
}

#[test]
fn the_exact_rank_for_the_files_values_alone_is_the_numeric_one() {
    for (name, constant, general, special) in [
        ("two_link", "g", 6, 4),
        ("two_link-normal", "L", 4, 2),
        ("five_bar", "g", 11, 7),
    ] {
        let mechanism = model(name);
        assert_eq!(rank_at_values(&mechanism), general, "{name}");
        let mechanism = with_value(mechanism, constant, 0.0);
        assert_eq!(ranks(&mechanism), (general, special), "{name}");
        assert_eq!(rank_at_values(&mechanism), special, "{name}");
    }
}

/// Forces for the values alone are those of the general derivation, and no constant is left that could be changed.
#[test]
fn numbers_in_place_of_constants_change_no_force() {
    for name in ["two_link", "tx40", "four_bar", "spidermill", "three_rrr"] {
        let mechanism = model(name).with_numeric_constants();
        assert!(mechanism.constants.is_empty(), "{name}");
        let case = Case::near_nominal(&mechanism, 20, 0.2).unwrap();
        case.forces_satisfy_dalembert(10).unwrap();
        case.reduction_keeps_the_forces().unwrap();
    }
}

#[test]
fn gravity_of_no_strength_takes_the_first_moments_of_the_first_link() {
    let mechanism = model("two_link");
    assert_eq!(ranks(&mechanism), (6, 6));
    assert_eq!(ranks(&with_value(mechanism, "g", 0.0)), (6, 4));
}

#[test]
fn links_of_no_length_put_both_joints_of_an_arm_on_one_axis() {
    let mechanism = model("two_link-normal");
    assert_eq!(ranks(&mechanism), (4, 4));
    // Two inertias about the same axis are all that is left.
    assert_eq!(ranks(&with_value(mechanism, "L", 0.0)), (4, 2));
}

#[test]
fn a_five_bar_without_gravity_by_value_has_the_rank_of_one_without_gravity_by_form() {
    let mechanism = model("five_bar");
    assert_eq!(ranks(&mechanism), (11, 11));
    assert_eq!(ranks(&with_value(mechanism, "g", 0.0)), (11, 7));
}
