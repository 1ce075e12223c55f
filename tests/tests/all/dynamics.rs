//! The equation of motion: terms against the inverse dynamics and against bodies by themselves, energy along simulated
//! motions, emitted code against the evaluator.

use crate::random_models;
use modelmill_codegen::{Derivation, ModelEvaluator};
use modelmill_runtime::{PoseError, Real};
use modelmill_tests::base_parameters::{base, nominal};
use modelmill_tests::equation_of_motion::terms;
use modelmill_tests::fixtures::derived;
use modelmill_tests::laws::{Case, motion};
use modelmill_tests::mechanics::Numbers;
use modelmill_tests::random::{self, Matter};
use modelmill_tests::sample::Sample;
use modelmill_tests::stream::Stream;
use nalgebra::DVector;

/// Checks a law on random trees and loops of a kind of matter.
#[track_caller]
fn check(matter: Matter, n: u64, law: impl Fn(&Case) -> Result<f64, String>) {
    let trees = (0..n).map(|seed| Case::new(&random::tree(seed, matter), 20, 3.0));
    let loops = (0..n / 2).map(|seed| Case::new(&random::planar_loop(seed, matter), 20, 0.4));
    let found: Vec<Result<f64, String>> = trees
        .chain(loops)
        .map(|case| case.and_then(|case| law(&case)))
        .collect();
    let breaches: Vec<&String> = found.iter().filter_map(|f| f.as_ref().err()).collect();
    let worst = found.iter().flatten().copied().fold(0.0, f64::max);
    println!("{} mechanisms, largest error {worst:.1e}", found.len());
    assert!(breaches.is_empty(), "{breaches:#?}");
}

#[test]
fn terms_add_up_to_the_inverse_dynamics_of_anything() {
    check(Matter::Anything, 60, Case::equation_of_motion_is_the_inverse_dynamics);
}

#[test]
fn terms_add_up_to_the_inverse_dynamics_of_bodies() {
    check(Matter::Physical, 40, Case::equation_of_motion_is_the_inverse_dynamics);
}

#[test]
fn mass_matrix_of_anything_is_that_of_bodies_by_themselves() {
    check(Matter::Anything, 60, |case| {
        case.mass_matrix_is_that_of_bodies_by_themselves(false)
    });
}

#[test]
fn mass_matrix_of_bodies_is_symmetric_and_positive() {
    check(Matter::Physical, 40, |case| {
        case.mass_matrix_is_that_of_bodies_by_themselves(true)
    });
}

/// A bundled model at random states.
fn case(name: &str) -> Case {
    let derivation = derived(name);
    let reach = if derivation.mechanism.loops.is_empty() {
        3.0
    } else {
        0.25
    };
    let sample = Sample::random(&derivation.mechanism, 20, reach, &mut Stream::new(5))
        .reachable(&ModelEvaluator::new(&derivation));
    Case { derivation, sample }
}

#[test]
fn bundled_models_obey_the_laws() {
    for name in [
        "arm_four_bar",
        "arm_parallelogram",
        "cloos",
        "delta",
        "delta_tied",
        "emps",
        "five_bar",
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
        let case = case(name);
        let laws = [
            case.equation_of_motion_is_the_inverse_dynamics(),
            case.mass_matrix_is_that_of_bodies_by_themselves(false),
        ];
        for law in laws {
            law.unwrap_or_else(|breach| panic!("{breach}"));
        }
    }
}

/// Motion under given forces by Runge and Kutta's method: what the drives supply is what the energy grows by.
#[track_caller]
fn check_energy(name: &str, force: f64, duration: f64, steps: u32) {
    let derivation = derived(name);
    let mechanism = &derivation.mechanism;
    assert!(mechanism.effects.is_empty(), "{name} dissipates");
    let dynamics = derivation.dynamics().expect("affine in the accelerations");
    let evaluator = ModelEvaluator::new(&derivation);
    let p_min = base(&derivation, &nominal(mechanism));
    let active: Vec<usize> = (0..mechanism.coordinates.len())
        .filter(|i| !mechanism.coordinates[*i].passive)
        .collect();
    let n = active.len();
    let one = |x: &DVector<f64>| Sample {
        q: (0..n).map(|i| vec![x[i]]).collect(),
        qd: (0..n).map(|i| vec![x[n + i]]).collect(),
        qdd: vec![vec![0.0]; n],
        load: vec![vec![0.0]; n],
    };
    // Coordinates, rates, and the work of the drives.
    let slope = |x: &DVector<f64>| -> DVector<f64> {
        let sample = one(x);
        let forces: Vec<[f64; 1]> = (0..n).map(|d| [force * (1.0 + d as f64)]).collect();
        let given: Vec<&[f64]> = forces.iter().map(<[f64; 1]>::as_slice).collect();
        let states = sample.states();
        let accelerations = evaluator
            .forward_dynamics(&dynamics, &states, &p_min, &given)
            .expect("a regular pose");
        let drives = evaluator.drive_motion(&states).expect("a regular pose");
        let power: f64 = (0..n).map(|d| forces[d][0] * drives[n + d][0]).sum();
        let rates = (n..2 * n).map(|i| x[i]);
        let rest = accelerations.iter().map(|a| a[0]).chain([power]);
        DVector::from_iterator(2 * n + 1, rates.chain(rest))
    };
    let energy = |x: &DVector<f64>| {
        let jets = motion(&evaluator, mechanism, &one(x));
        Numbers::new(mechanism, nominal(mechanism)).energy(&jets)
    };
    let mut x = DVector::zeros(2 * n + 1);
    for (k, i) in active.iter().enumerate() {
        x[k] = mechanism.coordinates[*i].nominal;
        x[n + k] = 0.4 - 0.3 * k as f64;
    }
    let first = energy(&x);
    let mut swing: f64 = 0.0;
    let h = duration / f64::from(steps);
    for _ in 0..steps {
        let a = slope(&x);
        let b = slope(&(&x + &a * (h / 2.0)));
        let c = slope(&(&x + &b * (h / 2.0)));
        let d = slope(&(&x + &c * h));
        x += (a + (b + c) * 2.0 + d) * (h / 6.0);
        swing = swing.max((energy(&x) - first - x[2 * n]).abs());
    }
    let scale = first.abs() + x[2 * n].abs() + 1.0;
    println!("{name}: energy is off by {swing:.1e} of {scale:.3}");
    assert!(swing < 1e-6 * scale, "{name}: {swing} of {scale}");
}

#[test]
fn energy_grows_by_the_work_of_the_drives() {
    check_energy("two_link", 0.5, 1.0, 1000);
    check_energy("puma560", 1e-3, 0.3, 600);
    check_energy("five_bar", 0.1, 0.1, 200);
}

/// What an emitted module says of the equation of motion, beside the evaluator.
macro_rules! agrees_at_random {
    ($($model:ident: $function:ident $seed:literal $($passive:ident)?;)+) => {
        $(#[test]
        fn $model() {
            use random_models::$model as module;
            let mechanism = random::$function($seed, Matter::Anything);
            let case = Case::new(&mechanism, 12, 0.3).expect("regular states");
            let geometry = module::Geometry::<f64>::default();
            let p_min = module::base_parameters(&geometry, &module::Parameters::default()).unwrap();
            let emitted = module::Dynamics::new(&geometry, &p_min);
            let inverse = module::InverseDynamics::new(&geometry, &p_min);
            for i in 0..case.sample.len() {
                let sample = &case.sample;
                let mut state = module::State {
                    q: state_of::<f64, { module::N_ACTIVE }>(&sample.q, i),
                    qd: state_of::<f64, { module::N_ACTIVE }>(&sample.qd, i),
                    qdd: state_of::<f64, { module::N_ACTIVE }>(&sample.qdd, i),
                };
                let forces = inverse.forces(&state).expect("a reachable state");
                let expected = state.qdd;
                state.qdd = [1.0; module::N_ACTIVE];
                let mass = emitted.mass_matrix(&state).expect("a reachable state");
                let rest = [emitted.coriolis(&state), emitted.gravity(&state), emitted.effects(&state)];
                let rest = rest.map(|r| r.expect("a reachable state"));
                let bias = emitted.bias(&state).expect("a reachable state");
                compare(&case.derivation, &sample.only(i), &mass.concat(), &rest.map(|r| r.to_vec()), &bias);
                match emitted.forward(&state, &forces) {
                    Ok(found) => {
                        let scale = largest(&expected) * condition(&case.derivation, &sample.only(i));
                        for (a, b) in found.iter().zip(&expected) {
                            assert!((a - b).abs() <= 1e-10 * scale, "{found:?} beside {expected:?}");
                        }
                    }
                    // Parameters are anything: there may be no mass that resists.
                    Err(error) => assert_eq!(error, PoseError::Singular),
                }
            }
        })+
    };
}

fn state_of<T: Real, const N: usize>(columns: &[Vec<f64>], i: usize) -> [T; N] {
    std::array::from_fn(|k| T::from_f64(columns[k][i]))
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(1e-9, |m, x| m.max(x.abs()))
}

/// How much larger accelerations may get wrong than forces: of the mass matrix, with the forces beside it.
fn condition(derivation: &Derivation, one: &Sample) -> f64 {
    let dynamics = derivation.dynamics().expect("affine in the accelerations");
    let p_min = base(derivation, &nominal(&derivation.mechanism));
    let found = terms(&ModelEvaluator::new(derivation), &dynamics, one, &p_min).expect("a state");
    let values = found.mass.clone().singular_values();
    let rest = found.coriolis.amax() + found.gravity.amax() + found.effects.amax();
    (values.max() + rest) / values.min().max(1e-300)
}

fn compare(derivation: &Derivation, one: &Sample, mass: &[f64], rest: &[Vec<f64>; 3], bias: &[f64]) {
    let dynamics = derivation.dynamics().expect("affine in the accelerations");
    let p_min = base(derivation, &nominal(&derivation.mechanism));
    let expected = terms(&ModelEvaluator::new(derivation), &dynamics, one, &p_min).expect("a state");
    let close = |what: &str, a: &[f64], b: &[f64]| {
        let scale = largest(a);
        for (x, y) in a.iter().zip(b) {
            assert!((x - y).abs() <= 1e-11 * scale, "{what}: {a:?} beside {b:?}");
        }
    };
    close("mass matrix", expected.mass.transpose().as_slice(), mass);
    let parts = [&expected.coriolis, &expected.gravity, &expected.effects];
    for ((what, a), b) in ["coriolis", "gravity", "effects"].iter().zip(parts).zip(rest) {
        close(what, a.as_slice(), b);
    }
    let sum: Vec<f64> = (0..bias.len()).map(|a| rest.iter().map(|r| r[a]).sum()).collect();
    let scale = rest.iter().map(|r| largest(r)).sum::<f64>();
    for (x, y) in bias.iter().zip(&sum) {
        assert!((x - y).abs() <= 1e-11 * scale, "bias: {bias:?} beside {sum:?}");
    }
}

mod random_models_agree_with_the_evaluator {
    use super::*;
    for_each_random_model!(agrees_at_random);
}
