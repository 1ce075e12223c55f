//! Values of a model's constants at which fewer columns are independent than for constants in general.

use modelmill_codegen::Evaluator;
use modelmill_spec::Mechanism;
use modelmill_tests::fixtures::{derive, model};
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
    let evaluator = Evaluator::new(&derivation);
    let reach = if mechanism.loops.is_empty() { 3.0 } else { 0.3 };
    let sample = Sample::random(mechanism, 200, reach, &mut Stream::new(8)).reachable(&evaluator);
    let numeric = rank_of_products(&evaluator, &sample).expect("reachable states");
    assert!(numeric.gap > 1e6, "gap {:.1e}", numeric.gap);
    (derivation.reduction.retained.len(), numeric.rank)
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
