//! What is emitted on request: reactions against the evaluator, and self-tests, which must see what is wrong.

use modelmill_codegen::ModelEvaluator;
use modelmill_runtime::{SelfTestError, Wrench};
use modelmill_spec::Mechanism;
use modelmill_tests::fixtures::{derive, model};
use modelmill_tests::random::{self, Matter};
use modelmill_tests::sample::Sample;
use modelmill_tests::stream::Stream;

/// Modules with reactions and self-test, see `build.rs`.
#[expect(unreachable_pub, dead_code, reason = "emitted for a crate of its own")]
mod asked_models {
    include!(concat!(env!("OUT_DIR"), "/asked_models.rs"));
}

/// The reactions of an emitted module are those of the evaluator, at the same places, and nothing else.
macro_rules! check_reactions {
    ($model:ident, $mechanism:expr, $reach:expr) => {{
        use asked_models::$model as module;
        let mechanism: Mechanism = $mechanism;
        let derivation = derive(&mechanism);
        let reactions = derivation.reactions().expect("loops can be solved");
        let evaluator = ModelEvaluator::new(&derivation);
        let sample = Sample::random(&mechanism, 12, $reach, &mut Stream::new(3)).reachable(&evaluator);
        assert!(sample.len() > 5, "too few states");
        let emitted = module::Reactions::<f64>::new(&module::Geometry::default(), &module::Parameters::default());
        let names: Vec<&str> = reactions.joints.iter().map(|j| j.name.as_str()).collect();
        assert_eq!(names, module::JOINTS.map(|joint| joint.name));
        let names: Vec<&str> = reactions.loops.iter().map(|l| l.name.as_str()).collect();
        assert_eq!(names, module::LOOPS.map(|closed| closed.name));
        let expected = evaluator.reactions(&reactions, &sample.states()).expect("reachable");
        let scale = expected.iter().flatten().fold(1e-9, |m: f64, x| m.max(x.abs()));
        for i in 0..sample.len() {
            let state = module::State {
                q: std::array::from_fn(|k| sample.q[k][i]),
                qd: std::array::from_fn(|k| sample.qd[k][i]),
                qdd: std::array::from_fn(|k| sample.qdd[k][i]),
            };
            let found = emitted.transmitted(&state).expect("reachable");
            let same = |places: &[Option<usize>; 3], found: &[Option<f64>; 3]| {
                for (place, found) in places.iter().zip(found) {
                    match (place, found) {
                        (Some(k), Some(x)) => {
                            let error = (expected[*k][i] - x).abs() / scale;
                            assert!(error < 1e-11, "{}: error {error:.1e}", mechanism.name);
                        }
                        (None, None) => {}
                        _ => panic!("{}: only one of both is told", mechanism.name),
                    }
                }
            };
            let found_joints: &[Wrench<f64>] = &found.joints;
            assert_eq!(found_joints.len(), reactions.joints.len());
            for (joint, found) in reactions.joints.iter().zip(found_joints) {
                same(&joint.force, &found.force);
                same(&joint.moment, &found.moment);
            }
            for (closed, found) in reactions.loops.iter().zip(&found.loops) {
                same(&closed.force, found);
            }
        }
    }};
}

#[test]
fn emitted_reactions_of_models_agree_with_the_evaluator() {
    check_reactions!(five_bar, model("five_bar"), 0.2);
    check_reactions!(panda, model("panda"), 2.0);
    check_reactions!(delta_tied, model("delta_tied"), 0.2);
    check_reactions!(spatial_press, model("spatial_press"), 0.2);
    check_reactions!(swinging_cylinder, model("swinging_cylinder"), 0.6);
}

#[test]
fn emitted_reactions_of_random_mechanisms_agree_with_the_evaluator() {
    check_reactions!(tree_0, random::tree(0, Matter::Physical), 2.0);
    check_reactions!(tree_1, random::tree(1, Matter::Physical), 2.0);
    check_reactions!(tree_2, random::tree(2, Matter::Physical), 2.0);
    check_reactions!(loop_0, random::planar_loop(0, Matter::Physical), 0.2);
    check_reactions!(loop_1, random::planar_loop(1, Matter::Physical), 0.2);
    check_reactions!(loop_2, random::planar_loop(2, Matter::Physical), 0.2);
}

#[test]
fn parameters_that_are_no_numbers_are_named() {
    use asked_models::swinging_cylinder as module;
    let parameters = module::Parameters::<f64> {
        ma: f64::NAN,
        ..module::Parameters::default()
    };
    let state = module::State {
        q: [0.3, 0.5],
        qd: [0.0; 2],
        qdd: [0.0; 2],
    };
    let reactions = module::Reactions::new(&module::Geometry::default(), &parameters);
    let error = reactions.transmitted(&state).expect_err("not a number");
    assert_eq!(error, modelmill_runtime::PoseError::NotFinite("ma"));
}

/// What modules say of their base parameters, for the geometry of their files.
macro_rules! self_tests {
    ($($model:ident),+) => {
        [$((stringify!($model), asked_models::$model::self_test(&asked_models::$model::Geometry::default()))),+]
    };
}

#[test]
fn base_parameters_pass_their_own_tests() {
    for (name, result) in self_tests!(
        five_bar,
        panda,
        delta_tied,
        spatial_press,
        swinging_cylinder,
        tree_0,
        tree_1,
        tree_2,
        loop_0,
        loop_1,
        loop_2
    ) {
        assert_eq!(result, Ok(()), "{name}");
    }
}

/// A machine that is built a hundred times smaller, with the code of the large one.
#[test]
fn base_parameters_pass_their_own_tests_for_other_geometry() {
    use asked_models::{delta_tied, five_bar, swinging_cylinder};
    let large = delta_tied::Geometry::<f64>::default();
    let small = delta_tied::Geometry {
        R: 0.01 * large.R,
        r: 0.01 * large.r,
        L1: 0.01 * large.L1,
        L2: 0.01 * large.L2,
        g: large.g,
    };
    assert_eq!(delta_tied::self_test(&small), Ok(()));
    // One whose coordinate is a length.
    let large = swinging_cylinder::Geometry::<f64>::default();
    for unit in [1e-9, 1e9] {
        let other = swinging_cylinder::Geometry {
            h: unit * large.h,
            ax: unit * large.ax,
            az: unit * large.az,
            bx: unit * large.bx,
            by: unit * large.by,
            g: unit * large.g,
            ..large
        };
        assert_eq!(swinging_cylinder::self_test(&other), Ok(()), "{unit}");
    }
    let large = five_bar::Geometry::<f64>::default();
    let uneven = five_bar::Geometry {
        L1: 1.03 * large.L1,
        ..large
    };
    assert_eq!(five_bar::self_test(&uneven), Ok(()));
    let unreachable = five_bar::Geometry {
        L1: 100.0 * large.L1,
        ..large
    };
    let error = five_bar::self_test(&unreachable).expect_err("no loop closes");
    println!("{error}");
    assert!(matches!(error, SelfTestError::TooFewStates { .. }), "{error}");
}

#[test]
fn a_term_that_is_missing_is_seen() {
    let error = self_tests!(five_bar_without_a_term)[0]
        .1
        .expect_err("a term is missing");
    println!("{error}");
    assert!(matches!(error, SelfTestError::Forces { .. }), "{error}");
}

#[test]
fn a_column_that_stands_twice_is_seen() {
    use asked_models::panda_with_a_column_twice as module;
    let error = module::self_test(&module::Geometry::default()).expect_err("a column is missing");
    println!("{error}");
    let expected = SelfTestError::Rank {
        of: "H_min",
        found: module::N_BASE - 1,
        expected: module::N_BASE,
    };
    assert_eq!(error, expected);
}
