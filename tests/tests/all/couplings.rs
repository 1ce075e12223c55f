//! Coordinates that follow others, by gears, screws, differentials, cams, ropes and tendons: laws that know nothing of how
//! they are eliminated.

use modelmill_codegen::{ModelEvaluator, ReductionMethod};
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

/// Cams, gears that are not round, ropes, and wheels that roll straight ahead: what follows is a function of the others.
macro_rules! follow_by_functions {
    ($($name:ident),+) => {
        $(#[test]
        fn $name() {
            check(stringify!($name));
        })+
    };
}

follow_by_functions! {
    eccentric_cam,
    gears_not_round,
    scotch_yoke,
    cam_in_a_loop,
    hoist,
    derrick,
    balancer
}

/// Springs and drive inertia act along what follows: on the lift of a cam from a table over one turn, and on tendons that
/// move no body of their own.
#[test]
fn effects_act_along_followers() {
    for name in ["disc_cam", "tendon_finger", "tendon_over_rollers"] {
        let mechanism = coupled(name);
        check_forces(name, &Case::near_nominal(&mechanism, 160, 2.5).unwrap());
    }
}

/// A drive pulls a tendon with the force that moves the joints by its moment arms: with `tendon = r1 q1 + r2 q2`, the forces
/// on the joints are `r1 f` and `r2 f + on_q2`.
#[test]
fn a_tendon_pulls_by_its_moment_arms() {
    let tendon = coupled("tendon_finger");
    let case = Case::near_nominal(&tendon, 20, 2.5).unwrap();
    let evaluator = ModelEvaluator::new(&case.derivation);
    let states = case.sample.states();
    let base = case.derivation.nominal_base_values();
    let forces = evaluator.inverse_dynamics(&states, &base).unwrap();
    assert_eq!(
        tendon.drives.iter().map(|d| &*d.name).collect::<Vec<_>>(),
        ["pull", "on_q2"]
    );
    // The same finger with a motor at each joint, a spring between the joints by hand, and the reflected inertia.
    let by_hand = |k: usize, j: usize| {
        let (q, qd, qdd) = (
            |i: usize| states.q[i][k],
            |i: usize| states.qd[i][k],
            |i: usize| states.qdd[i][k],
        );
        let (g, l, r) = (9.81, 0.05, [0.012, 0.008]);
        // ZZ, MX, MY of both bodies, and the mass of the second one.
        let ([z1, x1, y1], [z2, x2, y2], m2) = ([0.004, 0.02, 0.001], [0.002, 0.01, 0.001], 0.06);
        let (s, c) = q(1).sin_cos();
        let (along, across) = (l * (x2 * c - y2 * s), -l * (x2 * s + y2 * c));
        let gravity = |x: f64, y: f64, angle: f64| g * (x * angle.cos() - y * angle.sin());
        let second = gravity(x2, y2, q(0) + q(1));
        let bodies = [
            (z1 + z2 + m2 * l * l + 2.0 * along) * qdd(0)
                + (z2 + along) * qdd(1)
                + across * (2.0 * qd(0) * qd(1) + qd(1) * qd(1))
                + gravity(x1 + m2 * l, y1, q(0))
                + second,
            (z2 + along) * qdd(0) + z2 * qdd(1) - across * qd(0) * qd(0) + second + 0.3 * q(1),
        ];
        let length = r[0] * q(0) + r[1] * q(1);
        let elastic = 900.0 * length + 0.8 * (r[0] * qdd(0) + r[1] * qdd(1));
        let pull = bodies[0] / r[0] + elastic;
        if j == 0 {
            pull
        } else {
            bodies[1] + r[1] * elastic - r[1] * pull
        }
    };
    for k in 0..case.sample.len() {
        for (j, force) in forces.iter().enumerate() {
            let expected = by_hand(k, j);
            assert!(
                (force[k] - expected).abs() < 1e-9 * (1.0 + expected.abs()),
                "{j}: {} {expected}",
                force[k]
            );
        }
    }
}

/// What follows goes round more than once, and its spring tells how often.
#[test]
fn a_follower_in_a_loop_goes_round() {
    let name = "drag_link_with_tripled_disc";
    let mechanism = coupled(name);
    check_forces(name, &Case::near_nominal(&mechanism, 160, 1.5).unwrap());
}
