//! Regroupings from the literature, compared as exact maps over rational functions of the constants.

use modelmill_tests::fixtures::{derive, fixtures, model};
use modelmill_tests::published::Map;

/// Compares with `fixtures/published/<name>.txt`.
///
/// With the mill's own choice of retained products the two sets must be linear combinations of each other;
/// with the published choice asked for, every factor must be the same rational function.
#[track_caller]
fn check(name: &str) {
    check_model(name, name);
}

/// Compares a model with the published map of another that should have the same.
#[track_caller]
fn check_model(name: &str, map: &str) {
    let text = std::fs::read_to_string(fixtures().join(format!("published/{map}.txt"))).expect("a published map");
    let mut mechanism = model(name);
    let published = Map::parse(&text, &mechanism);
    let own_choice = Map::of_mill(&derive(&mechanism));
    own_choice.assert_spans_like(&published, &mechanism);
    mechanism.retain = published.retained(&mechanism);
    Map::of_mill(&derive(&mechanism)).assert_equals(&published);
}

#[test]
fn rx90_groups_as_in_khalil_and_dombre() {
    check("rx90");
}

#[test]
fn puma560_groups_as_published() {
    check("puma560");
}

#[test]
fn two_link_arm_groups_as_published() {
    check("two_link");
}

#[test]
fn four_bar_groups_as_published() {
    check("four_bar");
}

#[test]
fn parallelogram_groups_as_published() {
    check("parallelogram");
}

#[test]
fn five_bar_groups_as_published() {
    check("five_bar");
}

#[test]
fn tied_five_bar_has_the_set_of_a_two_link_arm() {
    check("five_bar-tied");
}

#[test]
fn tied_three_rrr_groups_as_published() {
    check("three_rrr-tied");
}

#[test]
fn a_parallelogram_closed_by_a_loop_groups_like_one_whose_angles_are_written_down() {
    check_model("parallelogram-loop", "parallelogram");
}

#[test]
fn the_comparison_sees_a_wrong_factor() {
    let mechanism = model("two_link");
    let mill = Map::of_mill(&derive(&mechanism));
    let wrong = Map::parse(
        "ZZ1 <- ZZ1 + L^2*M2 \n MX1 <- MX1 + 2*L*M2 \n MY1 ZZ2 MX2 MY2",
        &mechanism,
    );
    let outcome = std::panic::catch_unwind(|| mill.assert_spans_like(&wrong, &mechanism));
    assert!(outcome.is_err(), "L is not 2 L");
    let outcome = std::panic::catch_unwind(|| mill.assert_equals(&wrong));
    assert!(outcome.is_err(), "L is not 2 L");
}
