//! Coordinates that follow others, by gears, screws and differentials: laws that know nothing of how they are eliminated.

use modelmill_codegen::ReductionMethod;
use modelmill_spec::Mechanism;
use modelmill_tests::fixtures::fixtures;
use modelmill_tests::laws::Case;

fn coupled(name: &str) -> Mechanism {
    let file = fixtures().join("coupled").join(format!("{name}.toml"));
    match modelmill_spec::load_file(&file) {
        Ok(loaded) => loaded.mechanism,
        Err(failure) => panic!("{name}: {}", failure.render(false)),
    }
}

/// Forces, power, masses and reactions are right, and the base is exact, with as many parameters as numbers tell.
#[track_caller]
fn check(name: &str) {
    let mechanism = coupled(name);
    let reach = if mechanism.loops.is_empty() { 2.5 } else { 0.2 };
    let case = Case::near_nominal(&mechanism, 160, reach).unwrap();
    case.power_is_the_rate_of_energy().unwrap();
    check_forces(name, &case);
}

#[track_caller]
fn check_forces(name: &str, case: &Case) {
    let method = &case.derivation.reduction.method;
    assert!(matches!(method, ReductionMethod::Exact { .. }), "{name}: {method:?}");
    for law in [
        case.reduction_keeps_the_forces(),
        case.forces_satisfy_dalembert(40),
        case.mass_matrix_is_symmetric_and_positive_definite(),
        case.loops_stay_closed(),
        case.exact_rank_is_numeric_rank(),
    ] {
        law.unwrap();
    }
    case.reactions_hold_every_body().unwrap();
}

macro_rules! coupled {
    ($($name:ident),+) => {
        $(#[test]
        fn $name() {
            check(stringify!($name));
        })+
    };
}

coupled! {
    geared_arm,
    geared_arm_any_ratio,
    half_turning_arm,
    differential_wrist,
    ball_screw,
    helical_joint,
    rack_and_pinion,
    geared_five_bar,
    five_bar_with_geared_tool,
    chain_of_gears
}

/// What follows goes round more than once, and its spring tells how often.
#[test]
fn a_follower_in_a_loop_goes_round() {
    let name = "drag_link_with_tripled_disc";
    let mechanism = coupled(name);
    check_forces(name, &Case::near_nominal(&mechanism, 160, 1.5).unwrap());
}
