//! Operations per call of the straight-line programs, beside the lowest counts that other tools reach; and that fewer
//! operations give the same values.

use modelmill_codegen::{ModelEvaluator, OperationCount, ProgramStage, StraightLineProgram};
use modelmill_tests::base_parameters::{base, products};
use modelmill_tests::fixtures::derived;
use modelmill_tests::sample::Sample;
use modelmill_tests::stream::Stream;

fn count(program: &StraightLineProgram) -> OperationCount {
    program.count_operations(ProgramStage::State)
}

/// Additions and multiplications per call of inverse dynamics and base regressor, at most what has been reached.
///
/// The best known of others are 38 and 26 for the arm, 539 and 909 for the PUMA, 648 and 1256 for the Panda, 521 and 887
/// for the RX-90.
#[track_caller]
fn check(name: &str, inverse_dynamics: usize, regressor: usize) {
    let programs = derived(name).programs;
    for (what, program, reached) in [
        ("inverse dynamics", &programs.inverse_dynamics, inverse_dynamics),
        ("regressor", &programs.regressor, regressor),
    ] {
        let found = count(program);
        println!("{name}, {what}: {} + {} beside {reached}", found.add, found.mul);
        assert!(
            found.add + found.mul <= reached,
            "{name}, {what}: {found:?}, reached before {reached}"
        );
        assert_eq!(found.div, 0, "{name}, {what}: an open chain divides by nothing");
    }
}

#[test]
fn two_link_arm_is_at_most_what_was_reached() {
    check("two_link", 38, 26);
}

#[test]
fn puma560_is_at_most_what_was_reached() {
    check("puma560", 480, 675);
}

#[test]
fn panda_is_at_most_what_was_reached() {
    check("panda", 549, 1036);
}

#[test]
fn rx90_is_at_most_what_was_reached() {
    check("rx90", 435, 595);
}

#[test]
fn symmetric_five_bar_is_at_most_what_was_reached() {
    // The regressor of five columns with the loop solved inside; others have 130 additions and multiplications, and 4
    // divisions.
    let found = count(&derived("five_bar-tied-tool").programs.regressor);
    println!("symmetric five-bar, regressor: {found:?} beside 130 and 4 divisions");
    assert!(found.add + found.mul <= 119, "{found:?}");
    assert!(found.div <= 2 && found.sqrt <= 1, "{found:?}");
}

/// H_min column by column, and the inverse dynamics, against the plain recursion's H: to 1e-12 of the largest entry.
#[track_caller]
fn check_values(name: &str) {
    let derivation = derived(name);
    let mechanism = &derivation.mechanism;
    let evaluator = ModelEvaluator::new(&derivation);
    let reach = if mechanism.loops.is_empty() { 3.0 } else { 0.25 };
    let mut stream = Stream::new(99);
    let sample = Sample::random(mechanism, 100, reach, &mut stream).reachable(&evaluator);
    assert!(sample.len() > 50, "{name}: too few states");
    let parameters: Vec<f64> = (0..mechanism.parameters.len())
        .map(|_| stream.between(-1.0, 1.0))
        .collect();
    let (p_g, p_min) = (products(&derivation, &parameters), base(&derivation, &parameters));
    let states = sample.states();
    let reachable = "the states are reachable";
    let plain = evaluator.full_regressor(&states).expect(reachable);
    let short = evaluator.regressor(&states).expect(reachable);
    for (k, product) in derivation.reduction.retained.iter().enumerate() {
        let (a, b) = (plain.column(*product), short.column(k));
        let error = (a - b).amax() / a.amax().max(1e-9);
        assert!(error < 1e-12, "{name}, column {k}: error {error:.1e}");
    }
    let forces = evaluator.inverse_dynamics(&states, &p_min).expect(reachable);
    let n_drives = mechanism.drives.len();
    for row in 0..plain.nrows() {
        let terms: Vec<f64> = plain.row(row).iter().zip(&p_g).map(|(a, b)| a * b).collect();
        let scale = terms.iter().map(|t| t.abs()).sum::<f64>().max(1e-9);
        let error = (forces[row % n_drives][row / n_drives] - terms.iter().sum::<f64>()).abs();
        assert!(
            error < 1e-12 * scale,
            "{name}, row {row}: error {error:.1e} of {scale:.1e}"
        );
    }
}

#[test]
fn fewer_operations_give_the_values_of_the_plain_recursion() {
    for name in [
        "arm_four_bar",
        "arm_parallelogram",
        "cloos",
        "delta",
        "delta_tied",
        "emps-directional",
        "five_bar",
        "five_bar-tied-tool",
        "four_bar",
        "gough_stewart_tied",
        "panda",
        "parallelogram",
        "puma560",
        "rx90",
        "scara",
        "slider_crank",
        "spidermill",
        "spidermill-paper",
        "stanford",
        "three_rpr",
        "three_rrr",
        "two_link",
        "tx40",
    ] {
        check_values(name);
    }
}
