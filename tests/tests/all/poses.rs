//! Poses: passive coordinates by Newton's method in emitted code and in the evaluator, and what either says where there
//! is no answer.

use std::f64::consts::FRAC_PI_2;

use crate::fixture_models as fixtures;
use modelmill_codegen::{Derivation, ModelEvaluator, MotionStates, PoseFault, PoseReason};
use modelmill_generated::{spidermill, three_rrr};
use modelmill_runtime::{Loops, PoseError};
use modelmill_tests::base_parameters;
use modelmill_tests::fixtures::{derive, derived, model};
use modelmill_tests::sample::Sample;
use modelmill_tests::scaled::scaled;
use modelmill_tests::stream::Stream;

/// States of given active coordinates at rest.
fn at_rest(q: &[Vec<f64>]) -> Sample {
    let zero = vec![vec![0.0; q[0].len()]; q.len()];
    Sample {
        q: q.to_vec(),
        qd: zero.clone(),
        qdd: zero,
        load: Vec::new(),
    }
}

/// Passive coordinates of the evaluator: one vector per coordinate.
fn passive_of(derivation: &Derivation, q: &[Vec<f64>]) -> Result<Vec<Vec<f64>>, PoseFault> {
    let sample = at_rest(q);
    let mut all = ModelEvaluator::new(derivation).passive_motion(&sample.states())?;
    all.truncate(all.len() / 3);
    Ok(all)
}

fn reason_of(error: PoseError) -> PoseReason {
    PoseReason::from(error)
}

/// Passive coordinates of a module's default model.
macro_rules! emitted_passive {
    ($models:ident::$model:ident, $q:expr) => {
        $models::$model::Model::<f64>::default().passive_position(&$q)
    };
}

/// Compares poses of the spatial slider-crank in another unit: angles as they are, the slider's position in that unit.
fn check_slider(one: &[Vec<f64>], other: &[Vec<f64>], unit: f64, tolerance: f64) {
    let factors = [1.0, 1.0, 1.0 / unit];
    for ((one, other), factor) in one.iter().zip(other).zip(factors) {
        for (a, b) in one.iter().zip(other) {
            let error = (a - factor * b).abs();
            assert!(error <= tolerance, "{a} and {b} in units of {unit}");
        }
    }
}

fn columns<const N: usize>(rows: &[[f64; N]]) -> Vec<Vec<f64>> {
    (0..N).map(|k| rows.iter().map(|r| r[k]).collect()).collect()
}

#[test]
fn lengths_in_any_unit_make_the_same_poses() {
    let cranks: Vec<f64> = (0..80).map(|k| 1.2 + 0.37 * f64::from(k)).collect();
    let evaluated = |unit: f64| {
        let mechanism = scaled(&model("spatial_slider"), "slider", unit);
        passive_of(&derive(&mechanism), std::slice::from_ref(&cranks)).expect("the crank turns")
    };
    macro_rules! emitted {
        ($model:ident) => {{
            let model = fixtures::$model::Model::<f64>::default();
            let rows = cranks.iter().map(|q| model.passive_position(&[*q]));
            columns(&rows.collect::<Result<Vec<_>, _>>().expect("the crank turns"))
        }};
    }
    let (one, emitted_one) = (evaluated(1.0), emitted!(spatial_slider));
    // Powers of two round alike, so that nothing but the unit differs.
    for (unit, emitted, tolerance) in [
        (1.0 / 1024.0, emitted!(spatial_slider_small), 0.0),
        (1024.0, emitted!(spatial_slider_large), 0.0),
        (1e3, emitted!(spatial_slider_mm), 1e-13),
        (1e-3, emitted!(spatial_slider_km), 1e-13),
    ] {
        check_slider(&emitted_one, &emitted, unit, tolerance);
        check_slider(&one, &evaluated(unit), unit, tolerance);
    }
    check_slider(&one, &emitted_one, 1.0, 1e-13);
}

#[test]
fn a_length_that_drives_may_be_in_any_unit() {
    let cranks = |unit: f64, passive: &dyn Fn(f64) -> Result<[f64; 3], PoseError>| -> Vec<f64> {
        let slides = (0..20).map(|k| 0.78 + 0.01 * f64::from(k));
        let found = slides.map(|slide| passive(slide * unit));
        found.map(|p| p.map_or(f64::NAN, |p| p[0])).collect()
    };
    let one = cranks(1.0, &|q| emitted_passive!(fixtures::spatial_press, [q]));
    let large = cranks(1024.0, &|q| emitted_passive!(fixtures::spatial_press_large, [q]));
    let mm = cranks(1e3, &|q| emitted_passive!(fixtures::spatial_press_mm, [q]));
    // The slider's end is within its way: the crank stands across there.
    let reached = one.iter().filter(|x| x.is_finite()).count();
    assert!((10..20).contains(&reached), "{one:?}");
    for ((a, b), c) in one.iter().zip(large).zip(mm) {
        assert_eq!(a.to_bits(), b.to_bits());
        assert!((a - c).abs() < 1e-12 || (a.is_nan() && c.is_nan()), "{a} {c}");
    }
}

/// Holds a module's poses against the evaluator's, near and far from the nominal pose: the same pose, or the same error;
/// and what is found closes the loops.
macro_rules! same_rule {
    ($name:literal, $model:expr, $reach:expr) => {{
        let derivation = derived($name);
        let model = $model;
        let drawn = Sample::random(&derivation.mechanism, 400, $reach, &mut Stream::new(8));
        let (mut found, mut refused) = (0, 0);
        for i in 0..drawn.len() {
            let q = std::array::from_fn(|k| drawn.q[k][i]);
            let columns: Vec<Vec<f64>> = q.iter().map(|x| vec![*x]).collect();
            let evaluated = passive_of(&derivation, &columns);
            match model.passive_position(&q) {
                Ok(passive) => {
                    // The evaluator's guards refuse singular poses besides.
                    if let Ok(evaluated) = evaluated {
                        for (a, b) in passive.iter().zip(&evaluated) {
                            assert!((a - b[0]).abs() < 1e-12, "{passive:?} {evaluated:?}");
                        }
                    }
                    let (residual, _) = model.linearise(&q, &passive);
                    let scales = model.scales(&q, &passive).residual;
                    for (r, scale) in residual.iter().zip(scales) {
                        assert!(r.abs() < 1e-14 * scale, "{residual:?} at {q:?}");
                    }
                    found += 1;
                }
                Err(error) => {
                    let fault = evaluated.expect_err("the emitted code refuses it too");
                    assert_eq!(fault.reason, reason_of(error));
                    refused += 1;
                }
            }
        }
        assert!(found > 100 && refused > 50, "{found} and {refused}");
    }};
}

#[test]
fn emitted_code_and_evaluator_find_and_refuse_the_same_poses() {
    same_rule!("three_rrr", three_rrr::Model::<f64>::default(), 0.6);
    same_rule!("spatial_press", fixtures::spatial_press::Model::<f64>::default(), 0.6);
}

#[test]
fn a_pose_is_followed_from_the_last_one() {
    use three_rrr::{Geometry, InverseDynamics, Model, PASSIVE, Parameters, State};
    let geometry = Geometry::<f64>::default();
    let model = Model::new(&geometry);
    let base = three_rrr::base_parameters(&geometry, &Parameters::default()).unwrap();
    let dynamics = InverseDynamics::new(&geometry, &base);
    let nominal = [-0.37568, 1.70899, -2.37896];
    let mut passive = model.passive_position(&nominal).expect("the nominal pose");
    for k in 0..200 {
        let t = 0.05 * f64::from(k);
        let state = State {
            q: [
                nominal[0] + 0.15 * t.sin(),
                nominal[1] - 0.1 * t.sin(),
                nominal[2] + 0.1 * (2.0 * t).sin(),
            ],
            qd: [0.3, -0.2, 0.4],
            qdd: [1.0, 2.0, -3.0],
        };
        let before = passive;
        let near = dynamics.forces_near(&state, &mut passive).expect("near by");
        let anew = dynamics.forces(&state).expect("within reach");
        for (a, b) in near.iter().zip(anew) {
            assert!((a - b).abs() < 1e-10, "{near:?} {anew:?}");
        }
        // The guess has become this state's, which the other functions take as it is.
        let found = model.passive(&state).expect("within reach").q;
        for (a, b) in passive.iter().zip(found) {
            assert!((a - b).abs() < 1e-13);
        }
        assert!(k == 0 || before.map(f64::to_bits) != passive.map(f64::to_bits));
        let mut again = passive;
        let h = model.regressor_near(&state, &mut again).expect("near by");
        let difference = h[0][0] - model.regressor(&state).expect("within reach")[0][0];
        assert!(difference.abs() < 1e-10);
    }
    // A guess of no use leads to the walk from the nominal pose; an error leaves the guess alone.
    let expected = model.passive_position(&nominal).expect("the nominal pose");
    for useless in [[0.3; 4], [f64::NAN; 4], [1e9; 4], [0.0; 4]] {
        let found = model.passive_position_near(&nominal, &useless);
        for (a, b) in found.expect("by the walk").iter().zip(expected) {
            assert!((a - b).abs() < 1e-13);
        }
    }
    let mut guess = expected;
    let state = State {
        q: [nominal[0] + 1.5, nominal[1] - 1.5, nominal[2]],
        qd: [0.0; 3],
        qdd: [0.0; 3],
    };
    assert_eq!(model.regressor_near(&state, &mut guess), Err(PoseError::OutOfReach));
    assert_eq!(guess.map(f64::to_bits), expected.map(f64::to_bits));
    assert_eq!(PASSIVE.len(), guess.len());
}

#[test]
fn a_crank_may_turn_many_times() {
    let model = fixtures::spatial_slider::Model::<f64>::default();
    let turns = 500.0 * std::f64::consts::TAU;
    let [once, often] = [1.2, 1.2 + turns].map(|q| model.passive_position(&[q]));
    let (once, often) = (once.expect("within reach"), often.expect("within reach"));
    assert!((once[2] - often[2]).abs() < 1e-12, "{once:?} {often:?}");
    // The coupler's joint turns back with each turn of the crank.
    assert!((once[0] - often[0] - turns).abs() < 1e-9, "{once:?} {often:?}");
}

/// The fault of the evaluator's regressor at some states of `SpiderMill`, given by their crank angles.
fn spidermill_fault(poses: &[[f64; 2]], spoil: impl Fn(&mut Sample)) -> Option<(usize, PoseReason)> {
    let derivation = derived("spidermill");
    let mut sample = at_rest(&columns(poses));
    spoil(&mut sample);
    let found = ModelEvaluator::new(&derivation).regressor(&sample.states());
    found.err().map(|fault| (fault.sample, fault.reason))
}

/// Two poses of `SpiderMill` without answer: the elbows too far apart, and a crank in line with its spindle.
const OUT_OF_REACH: [f64; 2] = [std::f64::consts::PI, 0.0];
fn dead_point() -> [f64; 2] {
    [0.05_f64.atan2(-0.75) - std::f64::consts::PI, 2.0]
}

#[test]
fn the_earliest_fault_is_reported() {
    let nan = PoseReason::NotFinite {
        input: "theta2_d".to_owned(),
    };
    let nothing = |_: &mut Sample| {};
    let fine = [1.8, 1.35];
    for n in [20, 200] {
        for (singular, out_of_reach) in [(3, 11), (11, 3), (3, n - 1), (n - 1, 3)] {
            let mut poses = vec![fine; n];
            poses[singular] = dead_point();
            poses[out_of_reach] = OUT_OF_REACH;
            let expected = if singular < out_of_reach {
                (singular, PoseReason::Singular)
            } else {
                (out_of_reach, PoseReason::OutOfReach)
            };
            assert_eq!(spidermill_fault(&poses, nothing), Some(expected.clone()));
            let with_nan = |at: usize| spidermill_fault(&poses, |s| s.qd[1][at] = f64::NAN);
            assert_eq!(with_nan(1), Some((1, nan.clone())));
            assert_eq!(with_nan(n - 2), Some(expected));
        }
    }
    assert_eq!(spidermill_fault(&[fine; 3], nothing), None);
}

#[test]
fn newtons_method_reports_the_earliest_fault() {
    let derivation = derived("three_rrr");
    let nominal = [-0.37568, 1.70899, -2.37896];
    let far = [nominal[0] + 1.5, nominal[1] - 1.5, nominal[2]];
    for (far_at, nan_at) in [(5, 90), (90, 5)] {
        let mut poses = vec![nominal; 100];
        poses[far_at] = far;
        let mut sample = at_rest(&columns(&poses));
        sample.qdd[2][nan_at] = f64::INFINITY;
        let fault = ModelEvaluator::new(&derivation).regressor(&sample.states());
        let fault = fault.expect_err("two states are at fault");
        let reason = if far_at < nan_at {
            PoseReason::OutOfReach
        } else {
            PoseReason::NotFinite {
                input: "q3_dd".to_owned(),
            }
        };
        assert_eq!((fault.sample, fault.reason), (5, reason));
    }
}

#[test]
fn inputs_that_are_no_numbers_are_named() {
    use spidermill::{Geometry, InverseDynamics, Model, Parameters, State};
    let geometry = Geometry::<f64>::default();
    let base = spidermill::base_parameters(&geometry, &Parameters::default()).unwrap();
    let fine = State {
        q: [1.8, 1.35],
        qd: [0.1, 0.2],
        qdd: [0.3, 0.4],
    };
    let forces = |geometry: &Geometry<f64>, base: &[f64; spidermill::N_BASE], state: &State<f64>| {
        let found = InverseDynamics::new(geometry, base).forces(state);
        let of_model = Model::new(geometry);
        if found != Err(PoseError::NotFinite("p2_min")) {
            assert_eq!(of_model.regressor(state).err(), found.err());
            assert_eq!(of_model.drives(state).err(), found.err());
            assert_eq!(of_model.passive(state).err(), found.err());
        }
        found.map(|_| ())
    };
    assert_eq!(forces(&geometry, &base, &fine), Ok(()));
    for no_number in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1e61] {
        let [mut q, mut qd, mut qdd] = [fine; 3];
        (q.q[1], qd.qd[0], qdd.qdd[1]) = (no_number, no_number, no_number);
        for (state, name) in [(q, "theta2"), (qd, "theta1_d"), (qdd, "theta2_dd")] {
            let found = forces(&geometry, &base, &state);
            assert_eq!(found, Err(PoseError::NotFinite(name)));
        }
        let mut wrong = geometry;
        wrong.d3 = no_number;
        let found = forces(&wrong, &base, &fine);
        assert_eq!(found, Err(PoseError::NotFinite("d3")));
        let mut wrong = base;
        wrong[1] = no_number;
        let found = forces(&geometry, &wrong, &fine);
        assert_eq!(found, Err(PoseError::NotFinite("p2_min")));
    }
    // Whatever is below that has an answer, though the sum of all inputs is not.
    let mut huge = fine;
    huge.qd = [0.9e60; 2];
    huge.qdd = [0.9e60; 2];
    let found = InverseDynamics::new(&geometry, &base).forces(&huge);
    assert!(found.is_ok_and(|forces| forces.iter().all(|f| f.is_finite())));

    let derivation = derived("spidermill");
    let sample = at_rest(&columns(&[[1.8, 1.35]]));
    let fault = |constants: Vec<f64>, base: &[f64]| {
        let evaluator = ModelEvaluator::with_constants(&derivation, constants);
        let fault = evaluator.inverse_dynamics(&sample.states(), base);
        fault.map_err(|f| f.to_string()).err()
    };
    let constants = base_parameters::constants(&derivation.mechanism);
    let mut wrong = base.to_vec();
    assert_eq!(fault(constants.clone(), &wrong), None);
    wrong[0] = f64::NAN;
    let found = fault(constants.clone(), &wrong).expect("no number");
    assert_eq!(found, "at sample 0 `p1_min` is no finite number");
    let mut wrong = constants;
    wrong[0] = f64::NAN;
    let found = fault(wrong, &base).expect("no number");
    assert_eq!(found, "at sample 0 `d1` is no finite number");
}

#[test]
fn an_effect_that_takes_signs_names_what_is_no_number() {
    // Coulomb friction takes the sign of a rate, which would hide what is no number.
    let derivation = derived("emps");
    let n_active = derivation.coordinates().0.len();
    let mut sample = at_rest(&vec![vec![0.1; 5]; n_active]);
    sample.qd[0][2] = f64::NAN;
    let states: MotionStates<'_> = sample.states();
    let fault = ModelEvaluator::new(&derivation).regressor(&states);
    let fault = fault.expect_err("a rate is no number");
    assert_eq!(fault.sample, 2);
    assert!(matches!(fault.reason, PoseReason::NotFinite { input } if input.ends_with("_d")));
}

#[test]
fn terms_without_a_finite_value_are_errors() {
    use fixtures::undefined_effects::{Geometry, InverseDynamics, Model, Parameters, State, base_parameters};
    let derivation = derived("undefined_effects");
    let geometry = Geometry::<f64>::default();
    let model = Model::new(&geometry);
    let base = base_parameters(&geometry, &Parameters::default()).unwrap();
    let dynamics = InverseDynamics::new(&geometry, &base);
    // At a quotient's pole, beyond what an exponential reaches, and where a root is imaginary.
    for (q, is_fine) in [
        ([0.5, 0.5], true),
        ([0.0, 0.5], false),
        ([1000.0, 0.5], false),
        ([0.5, -0.5], false),
    ] {
        let state = State {
            q,
            qd: [0.1, 0.2],
            qdd: [0.3, 0.4],
        };
        let expected = if is_fine { None } else { Some(PoseError::Undefined) };
        assert_eq!(model.regressor(&state).err(), expected, "{q:?}");
        assert_eq!(dynamics.forces(&state).err(), expected, "{q:?}");
        let sample = at_rest(&columns(&[q]));
        let found = ModelEvaluator::new(&derivation).regressor(&sample.states());
        assert_eq!(
            found.err().map(|fault| fault.reason),
            expected.map(PoseReason::from),
            "{q:?}"
        );
    }
}

/// Holds the regressor of a mechanism that is made larger or smaller at run time against that of the file: every entry
/// grows with a power of the length, at the same poses.
macro_rules! any_size {
    ($model:ident, $reach:expr, [$($length:ident),*]) => {{
        use modelmill_generated::$model as module;
        let name = stringify!($model).replace("spidermill_paper", "spidermill-paper");
        let derivation = derived(&name);
        let active = derivation.mechanism.coordinates.iter().filter(|c| !c.passive);
        let slides: Vec<bool> = active.map(|c| !c.motion.is_angle()).collect();
        let drawn = Sample::random(&derivation.mechanism, 40, $reach, &mut Stream::new(4));
        let regressors = |unit: f64| -> Vec<Vec<f64>> {
            let default = module::Geometry::<f64>::default();
            let model = module::Model::new(&module::Geometry { $($length: unit * default.$length),* });
            let of = |columns: &[Vec<f64>], i: usize| {
                std::array::from_fn(|k| columns[k][i] * if slides[k] { unit } else { 1.0 })
            };
            let states = (0..drawn.len()).map(|i| module::State {
                q: of(&drawn.q, i),
                qd: of(&drawn.qd, i),
                qdd: of(&drawn.qdd, i),
            });
            states
                .map(|state| match model.regressor(&state) {
                    Ok(h) => h.as_flattened().to_vec(),
                    Err(error) => panic!("{name}, {unit} times as large: {error} at {:?}", state.q),
                })
                .collect()
        };
        let one = regressors(1.0);
        for unit in [1e-3, 0.04, 25.0, 1e3] {
            let other = regressors(unit);
            for k in 0..one[0].len() {
                let largest = (0..one.len()).max_by(|a, b| one[*a][k].abs().total_cmp(&one[*b][k].abs()));
                let at = largest.expect("states");
                let size = one[at][k].abs();
                if size == 0.0 {
                    continue;
                }
                let power = ((other[at][k] / one[at][k]).ln() / unit.ln()).round();
                for (a, b) in one.iter().zip(&other) {
                    let b = b[k] / unit.powf(power);
                    assert!((a[k] - b).abs() < 1e-9 * size, "{name}, {unit}, entry {k}: {} {b}", a[k]);
                }
            }
        }
    }};
}

#[test]
fn geometry_at_run_time_may_be_of_any_size() {
    any_size!(spidermill, 0.3, [d1, d3, b, dA, Bx, By, g]);
    any_size!(five_bar, 0.3, [L0, L1, L2, L3, L4, g]);
    any_size!(arm_four_bar, 0.2, [d2, d3, d4, r4, d8, b, c, g]);
    any_size!(slider_crank, 1.0, [L1, L2, e, g]);
    any_size!(three_rrr, 0.02, [l1, l2, c2x, c3x, c3y, b2x, b3x, b3y, g]);
    any_size!(three_rpr, 0.02, [c2x, c3x, c3y, b1x, b1y, b2x, b2y, b3y, g]);
    any_size!(delta_tied, 0.2, [R, r, L1, L2, g]);
    any_size!(
        gough_stewart_tied,
        0.02,
        [
            bx1, by1, bx2, by2, bx3, by3, bx4, by4, bx5, by5, bx6, by6, ax1, ay1, ax2, ay2, ax3, ay3, ax4, ay4, ax5,
            ay5, ax6, ay6, g
        ]
    );
}

/// A rod across its slide is as singular in a small machine as in a large one, and a millionth of a radian from there it
/// is not.
#[test]
fn singular_poses_are_singular_at_any_size() {
    use modelmill_generated::slider_crank::{Geometry, Model, State};
    let default = Geometry::<f64>::default();
    for unit in [1e-4, 1.0, 1e4] {
        let geometry = Geometry {
            L1: unit,
            L2: unit,
            e: 0.0,
            g: default.g,
        };
        let model = Model::new(&geometry);
        let of = |q: f64| {
            model.regressor(&State {
                q: [q],
                qd: [0.0],
                qdd: [0.0],
            })
        };
        assert_eq!(of(FRAC_PI_2), Err(PoseError::Singular), "{unit}");
        assert!(of(FRAC_PI_2 - 1e-6).is_ok(), "{unit}");
    }
}

/// `check_states` refuses the states that the regressor refuses, for the same reason, and no other.
#[test]
fn a_check_of_states_refuses_what_the_regressor_refuses() {
    let mut refused = 0;
    let mut accepted = 0;
    for name in [
        "five_bar",
        "four_bar",
        "three_rrr",
        "spidermill",
        "slider_crank",
        "delta",
        "gough_stewart",
    ] {
        let derivation = derived(name);
        let evaluator = ModelEvaluator::new(&derivation);
        // Poses near the nominal one, and far beyond what the lengths allow.
        for (reach, seed) in [(0.2, 1), (3.0, 2)] {
            let all = Sample::random(&derivation.mechanism, 60, reach, &mut Stream::new(seed));
            for i in 0..all.len() {
                let one = all.only(i);
                let found = evaluator.check_states(&one.states());
                assert_eq!(
                    found,
                    evaluator.full_regressor(&one.states()).map(|_| ()),
                    "{name}, {reach}, state {i}"
                );
                match found {
                    Ok(()) => accepted += 1,
                    Err(_) => refused += 1,
                }
            }
            // Of many states the first that has no solution is named.
            let whole = evaluator.check_states(&all.states());
            assert_eq!(
                whole,
                evaluator.full_regressor(&all.states()).map(|_| ()),
                "{name}, {reach}"
            );
        }
        // A number that is none is named by both.
        let mut lost = Sample::random(&derivation.mechanism, 3, 0.1, &mut Stream::new(3));
        lost.q[0][1] = f64::NAN;
        let whole = evaluator.check_states(&lost.states());
        assert_eq!(whole, evaluator.full_regressor(&lost.states()).map(|_| ()), "{name}");
        assert!(whole.is_err(), "{name}");
    }
    assert!(
        refused > 100 && accepted > 200,
        "{refused} refused, {accepted} accepted"
    );
}
