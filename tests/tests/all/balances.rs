//! What `equations --balances` prints is true: its equations hold with the reactions of the evaluator.

use modelmill_codegen::review::{CutFreeError, PageFormat, balance_page, body_balances};
use modelmill_spec::{Mechanism, TwistAxes};
use modelmill_tests::balances::ComparedBalances;
use modelmill_tests::fixtures::{derived, model};
use modelmill_tests::laws::Case;
use modelmill_tests::random::{self, Matter};
use modelmill_tests::stream::Stream;

/// The model with random values of all parameters, so that no term vanishes.
fn with_random_parameters(name: &str) -> Mechanism {
    let mut mechanism = model(name);
    let mut stream = Stream::new(11);
    for parameter in &mut mechanism.parameters {
        parameter.nominal = stream.between(0.2, 2.0);
    }
    mechanism
}

/// Checks a model at states around its nominal pose.
#[track_caller]
fn check_model(name: &str, reach: f64) -> ComparedBalances {
    let case = Case::near_nominal(&with_random_parameters(name), 6, reach).unwrap();
    let compared = case.printed_balances_hold().unwrap();
    println!("{name}: {compared:?}");
    assert!(compared.bodies > 0, "{name}");
    compared
}

#[test]
fn all_six_balances_of_arms_hold() {
    for name in [
        "cloos",
        "emps",
        "emps-directional",
        "puma560",
        "rx90",
        "scara",
        "stanford",
        "tx40",
    ] {
        let compared = check_model(name, 1.0);
        assert!(compared.held > 0 && compared.open == 0, "{name}");
    }
}

#[test]
fn all_six_balances_of_the_panda_hold() {
    let compared = check_model("panda", 1.0);
    assert!(compared.held > 0 && compared.open == 0);
}

/// Three equations for a body, each by components and with vectors, at three states.
#[test]
fn all_three_balances_of_planar_linkages_hold() {
    for name in [
        "two_link",
        "five_bar",
        "four_bar",
        "spidermill",
        "spidermill-paper",
        "three_rrr",
        "parallelogram",
    ] {
        let compared = check_model(name, 0.1);
        assert_eq!([compared.held, compared.open], [18 * compared.bodies, 0], "{name}");
    }
}

#[test]
fn balances_of_linkages_with_prismatic_joints_rods_and_struts_hold() {
    for name in [
        "three_rpr",
        "slider_crank",
        "arm_parallelogram",
        "arm_four_bar",
        "swinging_cylinder",
    ] {
        let compared = check_model(name, 0.1);
        assert!(compared.held > 0, "{name}");
    }
}

#[test]
fn balances_of_parallel_robots_in_space_hold() {
    for name in ["delta", "delta_tied", "gough_stewart", "gough_stewart_tied"] {
        let compared = check_model(name, 0.1);
        assert!(compared.held > 0, "{name}");
    }
}

#[test]
fn balances_of_free_bodies_hold() {
    for name in ["drone", "quadruped"] {
        let compared = check_model(name, 0.3);
        assert!(compared.held > 0, "{name}");
    }
}

/// Checks random trees and planar loops.
#[track_caller]
fn check_random(matter: Matter, n: u64) {
    let trees = (0..n).map(|seed| Case::new(&random::tree(seed, matter), 8, 3.0));
    let loops = (0..n / 2).map(|seed| Case::new(&random::planar_loop(seed, matter), 8, 0.4));
    let found: Vec<Result<ComparedBalances, String>> = trees
        .chain(loops)
        .map(|case| case.and_then(|case| case.printed_balances_hold()))
        .collect();
    let breaches: Vec<&String> = found.iter().filter_map(|f| f.as_ref().err()).collect();
    assert!(breaches.is_empty(), "{breaches:#?}");
    let found: Vec<ComparedBalances> = found.into_iter().flatten().collect();
    let held: usize = found.iter().map(|f| f.held).sum();
    let open: usize = found.iter().map(|f| f.open).sum();
    let worst = found.iter().map(|f| f.error).fold(0.0, f64::max);
    println!(
        "{} mechanisms, {held} equations hold, {open} open, error {worst:.1e}",
        found.len()
    );
    assert!(held > 2 * open);
}

#[test]
fn balances_of_random_mechanisms_hold() {
    check_random(Matter::Anything, 24);
}

#[test]
fn balances_of_random_bodies_hold() {
    check_random(Matter::Physical, 16);
}

#[test]
fn balances_of_mechanisms_on_a_free_body_hold() {
    for seed in 0..3 {
        let tree = random::tree(seed, Matter::Physical);
        for axes in [TwistAxes::Body, TwistAxes::World] {
            let case = Case::near_nominal(&random::hung_free(tree.clone(), axes, axes), 6, 0.4).unwrap();
            let compared = case.printed_balances_hold().unwrap();
            assert!(compared.held > 0 && compared.open == 0, "{seed}: {compared:?}");
        }
    }
}

/// Eq. (2) and (3) of the paper, for its substitution part one, with the signs of the paper.
#[test]
fn the_crank_has_the_balances_of_the_paper() {
    let derivation = derived("spidermill-paper");
    let balances = body_balances(&derivation, "crank_left").unwrap();
    assert_eq!(balances.forces.left, "m1*a_c1 + m2*a_c2");
    assert_eq!(
        balances.forces.right,
        "f_S1 + F_spindle_left*u_spindle_left - f_S3 + m1*a_g + m2*a_g"
    );
    assert_eq!(
        balances.moments.left,
        "m1*cross(r_c1, a_c1) + I_c1*alpha + cross(omega, I_c1*omega) + m2*cross(r_c2, a_c2)"
    );
    assert_eq!(
        balances.moments.right,
        "F_spindle_left*cross(r_A_left, u_spindle_left) - cross(r_S3, f_S3) + m1*cross(r_c1, a_g) + m2*cross(r_c2, a_g)"
    );
}

#[test]
fn an_unknown_part_is_answered_with_all_parts() {
    let derivation = derived("five_bar");
    for name in ["no such part", ""] {
        let error = body_balances(&derivation, name).expect_err("no such part");
        let CutFreeError::UnknownPart { parts, .. } = &error else {
            panic!("{error}")
        };
        assert!(!parts.is_empty());
        for part in parts {
            body_balances(&derivation, part).unwrap();
            assert!(error.to_string().contains(part.as_str()), "{error}");
        }
    }
    let error = body_balances(&derivation, "base").expect_err("fixed");
    assert!(matches!(error, CutFreeError::FixedToBase { .. }), "{error}");
}

/// Names of the model file are never those of a vector.
#[test]
fn names_of_the_model_are_not_taken() {
    let mut mechanism = model("two_link");
    for (parameter, name) in mechanism.parameters.iter_mut().zip(["a_g", "r_c1_x", "omega", "alpha"]) {
        name.clone_into(&mut parameter.name);
    }
    let case = Case::near_nominal(&mechanism, 4, 0.5).unwrap();
    let compared = case.printed_balances_hold().unwrap();
    assert_eq!(compared.open, 0);
}

#[test]
fn pages_show_the_body_with_its_forces() {
    for (name, part) in [
        ("spidermill", "crank_left"),
        ("panda", "link3"),
        ("drone", "frame"),
        ("delta", "platform"),
    ] {
        let derivation = derived(name);
        let part = match body_balances(&derivation, part) {
            Ok(_) => part.to_owned(),
            Err(CutFreeError::UnknownPart { parts, .. }) => parts[0].clone(),
            Err(error) => panic!("{error}"),
        };
        let balances = body_balances(&derivation, &part).unwrap();
        let page = balance_page(&derivation, &part, PageFormat::Html).unwrap();
        let picture = page
            .split("<svg")
            .nth(1)
            .expect("a picture")
            .split("</svg>")
            .next()
            .unwrap();
        for vector in balances
            .vectors
            .iter()
            .filter(|v| v.transmitted_by.is_some() && !v.components.is_empty())
        {
            assert!(
                picture.contains(&vector.symbol),
                "{name}: {} is not shown",
                vector.symbol
            );
        }
        assert!(!picture.contains("NaN") && !picture.contains("inf"), "{name}");
        let latex = balance_page(&derivation, &part, PageFormat::Latex).unwrap();
        assert!(latex.contains("\\times"), "{name}");
    }
}
