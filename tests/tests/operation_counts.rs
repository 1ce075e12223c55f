//! Operations per call of the straight-line programs, beside the lowest counts that other tools reach.

use modelmill_codegen::{OperationCount, Program, Stage};
use modelmill_tests::fixtures::derived;

fn count(program: &Program) -> OperationCount {
    program.count(Stage::State)
}

/// Additions and multiplications per call of inverse dynamics and base regressor, at most the best known ones.
#[track_caller]
fn check(name: &str, inverse_dynamics: usize, regressor: usize) {
    let programs = derived(name).programs;
    for (what, program, best_known) in [
        (
            "inverse dynamics",
            &programs.inverse_dynamics,
            inverse_dynamics,
        ),
        ("regressor", &programs.regressor, regressor),
    ] {
        let found = count(program);
        println!(
            "{name}, {what}: {} + {} beside {best_known}",
            found.add, found.mul
        );
        assert!(
            found.add + found.mul <= best_known,
            "{name}, {what}: {found:?}, best known {best_known}"
        );
        assert_eq!(
            found.div, 0,
            "{name}, {what}: an open chain divides by nothing"
        );
    }
}

#[test]
fn two_link_arm_is_at_most_the_best_known() {
    check("two_link", 38, 26);
}

#[test]
fn puma560_is_at_most_the_best_known() {
    check("puma560", 539, 909);
}

#[test]
fn panda_is_at_most_the_best_known() {
    check("panda", 648, 1256);
}

#[test]
fn rx90_is_at_most_the_best_known() {
    check("rx90", 521, 887);
}

#[test]
fn symmetric_five_bar_is_at_most_the_best_known() {
    // The regressor of five columns with the loop solved inside: 130 additions and multiplications, 4 divisions.
    let found = count(&derived("five_bar-tied-tool").programs.regressor);
    println!("symmetric five-bar, regressor: {found:?} beside 130 and 4 divisions");
    assert!(found.add + found.mul <= 130, "{found:?}");
    assert!(found.div <= 4, "{found:?}");
}
