//! Bodies that hang on nothing: another program's numbers for the bundled floating models, in all axes that a file may choose,
//! and laws over random mechanisms taken off their base.
//!
//! The tables come from `fixtures/reference/make_pinocchio_floating.py`, made by Pinocchio 4.1.

use modelmill_codegen::{Derivation, ModelEvaluator};
use modelmill_spec::{FrameStep, Mechanism, TwistAxes};
use modelmill_tests::base_parameters::{base, nominal, products};
use modelmill_tests::fixtures::{Table, derive, derived, model};
use modelmill_tests::laws::{Case, motion};
use modelmill_tests::mechanics::Numbers;
use modelmill_tests::random::{self, Matter, hung_free};
use modelmill_tests::sample::Sample;
use modelmill_tests::stream::Stream;
use nalgebra::{DVector, Quaternion, UnitQuaternion, Vector3};

/// Largest error beside Pinocchio's numbers, relative to the largest of its kind.
const ACCURACY: f64 = 1e-10;

const TWISTS: [(&str, TwistAxes, TwistAxes); 3] = [
    ("body", TwistAxes::Body, TwistAxes::Body),
    ("mixed", TwistAxes::World, TwistAxes::Body),
    ("world", TwistAxes::World, TwistAxes::World),
];

fn free_body(mechanism: &Mechanism) -> modelmill_spec::FreeBody {
    let mut steps = mechanism.frames.iter().flat_map(|frame| &frame.steps);
    let free = steps.find_map(|step| match step {
        FrameStep::Free(body) => Some(*body),
        _ => None,
    });
    free.expect("a floating model")
}

fn with_twist(name: &str, linear: TwistAxes, angular: TwistAxes) -> Derivation {
    let mut mechanism = model(name);
    for step in mechanism.frames.iter_mut().flat_map(|frame| &mut frame.steps) {
        if let FrameStep::Free(body) = step {
            (body.linear, body.angular) = (linear, angular);
        }
    }
    derive(&mechanism)
}

fn largest(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(0.0, |m: f64, x| m.max(x.abs()))
}

fn assert_near(found: f64, expected: f64, scale: f64, what: &str) {
    let error = (found - expected).abs() / scale;
    assert!(
        error < ACCURACY,
        "{what}: {found} instead of {expected}, error {error:.1e}"
    );
}

/// Forces, accelerations, mass matrix and, where there is a table, regressor of a model in one choice of axes.
#[allow(
    clippy::too_many_lines,
    reason = "one table after the other against one set of states"
)]
fn check(name: &str, twist: &str, linear: TwistAxes, angular: TwistAxes) {
    let derivation = with_twist(name, linear, angular);
    let mechanism = &derivation.mechanism;
    let table = Table::reference(&format!("pinocchio-{name}-{twist}"));
    let masses = Table::reference(&format!("pinocchio-{name}-{twist}-mass"));
    let values = Table::reference(&format!("pinocchio-{name}-parameters"));
    let parameters: Vec<f64> = mechanism.parameters.iter().map(|p| values.column(&p.name)[0]).collect();
    assert_eq!(parameters.len(), values.names().len());
    let sample = Sample::from_table(mechanism, &table);
    let (states, evaluator) = (sample.states(), ModelEvaluator::new(&derivation));
    let p_min = base(&derivation, &parameters);
    let h = evaluator.full_regressor(&states).expect("a pose");
    let by_products = h * DVector::from_vec(products(&derivation, &parameters));
    let h_min = evaluator.regressor(&states).expect("a pose");
    let by_columns = h_min * DVector::from_vec(p_min.clone());
    let by_base = evaluator.inverse_dynamics(&states, &p_min).expect("a pose");
    let n_drives = mechanism.drives.len();
    let forces: Vec<&[f64]> = mechanism.drives.iter().map(|d| table.column(&d.name)).collect();
    for (d, expected) in forces.iter().enumerate() {
        let scale = largest(expected.iter().copied());
        for (i, x) in expected.iter().enumerate() {
            let row = i * n_drives + d;
            for found in [by_products[row], by_columns[row], by_base[d][i]] {
                let what = format!("{name}, {twist}, {}, row {i}", mechanism.drives[d].name);
                assert_near(found, *x, scale, &what);
            }
        }
    }
    assert_eq!(table.n_rows(), 12);

    let dynamics = derivation.dynamics().expect("an equation of motion");
    let accelerations = evaluator
        .forward_dynamics(&dynamics, &states, &p_min, &forces)
        .expect("a regular mass matrix");
    let found = evaluator.mass_matrix(&dynamics, &states, &p_min).expect("a pose");
    let n = mechanism.coordinates.len();
    // Light hands amplify what forces lack in digits.
    let scale = 1e3 * largest(sample.qdd.iter().flatten().copied());
    let rated = |k: &usize| mechanism.coordinates[*k].motion.has_rate();
    for k in (0..n).filter(rated) {
        for (i, x) in accelerations[k].iter().enumerate() {
            let what = format!("{name}, {twist}, acceleration {k}, row {i}");
            assert_near(*x, sample.qdd[k][i], scale, &what);
        }
    }
    let of_drive = |d: usize| match mechanism.drives[d].kind {
        modelmill_spec::DriveKind::Joint(i) => i.0,
        modelmill_spec::DriveKind::Linear { .. } => unreachable!("all are joints"),
    };
    let n_masses = masses.n_rows() / n_drives;
    let scale = largest(mechanism.drives.iter().flat_map(|d| masses.column(&d.name).to_vec()));
    for state in 0..n_masses {
        for a in 0..n_drives {
            for b in 0..n_drives {
                let expected = masses.column(&mechanism.drives[b].name)[state * n_drives + a];
                let entry = found[of_drive(a) * n + of_drive(b)][state];
                assert_near(entry, expected, scale, &format!("{name}, {twist}, M {a}, {b}"));
            }
        }
        // The scalar part stands for itself.
        for k in (0..n).filter(|k| !rated(k)) {
            for j in 0..n {
                let one = f64::from(u8::from(j == k));
                let is_one = |x: f64| (x - one).abs() < f64::EPSILON;
                assert!(is_one(found[k * n + j][state]) && is_one(found[j * n + k][state]));
            }
        }
    }
    if name == "quadruped" {
        let columns = Table::reference(&format!("pinocchio-{name}-{twist}-regressor"));
        assert_eq!(columns.n_rows(), n_masses * n_drives);
        let h = evaluator.full_regressor(&states).expect("a pose");
        for (k, product) in derivation.reduction.products.iter().enumerate() {
            let [(parameter, 1)] = product.0[..] else {
                panic!("the parameters are linear");
            };
            let expected = columns.column(&mechanism.parameters[parameter].name);
            let scale = largest(expected.iter().copied()).max(1e-3);
            for (row, x) in expected.iter().enumerate() {
                assert_near(h[(row, k)], *x, scale, &format!("{name}, {twist}, H {row}, {k}"));
            }
        }
    }
}

#[test]
fn the_quadruped_agrees_with_pinocchio() {
    for (twist, linear, angular) in TWISTS {
        check("quadruped", twist, linear, angular);
    }
}

#[test]
fn the_humanoid_agrees_with_pinocchio() {
    for (twist, linear, angular) in TWISTS {
        check("humanoid", twist, linear, angular);
    }
}

#[test]
fn the_drone_agrees_with_pinocchio() {
    for (twist, linear, angular) in [TWISTS[0], TWISTS[2]] {
        check("drone", twist, linear, angular);
    }
}

/// A body that hangs on nothing is known with all ten of its numbers, and each revolute joint adds seven.
#[test]
fn all_ten_of_a_free_body_and_seven_of_each_joint_are_known() {
    for (name, joints) in [("drone", 4), ("quadruped", 12), ("humanoid", 30)] {
        let derivation = derived(name);
        assert_eq!(derivation.base_parameters().len(), 10 + 7 * joints, "{name}");
        let case = Case::near_nominal(&derivation.mechanism, 60, 1.0);
        case.and_then(|case| case.exact_rank_is_numeric_rank()).expect(name);
    }
}

fn random_cases() -> impl Iterator<Item = Case> {
    (0..24).flat_map(|seed| {
        let matter = if seed % 3 == 0 {
            Matter::Physical
        } else {
            Matter::Anything
        };
        let (_, linear, angular) = TWISTS[usize::try_from(seed % 3).expect("below 3")];
        [random::tree(seed, matter), random::planar_loop(seed, matter)].map(|mechanism| {
            let free = hung_free(mechanism, linear, angular);
            Case::near_nominal(&free, 80, 0.4).expect("a floating mechanism")
        })
    })
}

#[test]
fn random_mechanisms_off_their_base_keep_the_laws() {
    for case in random_cases() {
        case.forces_satisfy_dalembert(4).expect("d'Alembert's principle");
        case.reduction_keeps_the_forces().expect("H p_g = H_min p_min");
        case.exact_rank_is_numeric_rank().expect("a rank");
    }
}

/// The same with the mass matrix as bodies by themselves have it.
#[test]
fn random_mass_matrices_off_their_base_are_those_of_bodies() {
    for case in random_cases() {
        case.equation_of_motion_is_the_inverse_dynamics()
            .expect("the equation of motion");
    }
}

/// The drives' and the wrench's power is the rate of energy along a path of the body itself.
#[test]
fn power_of_the_wrench_is_the_rate_of_energy() {
    for (name, (_, linear, angular)) in ["drone", "quadruped", "humanoid"].into_iter().zip(TWISTS) {
        let derivation = with_twist(name, linear, angular);
        let mechanism = &derivation.mechanism;
        let body = free_body(mechanism);
        let parameters = nominal(mechanism);
        let evaluator = ModelEvaluator::new(&derivation);
        let numbers = Numbers::new(mechanism, parameters.clone());
        let p_min = base(&derivation, &parameters);
        let mut stream = Stream::new(5);
        let sample = Sample::random(mechanism, 4, 1.0, &mut stream);
        for i in 0..sample.len() {
            let one = sample.only(i);
            let energy = |t: f64| {
                let later = along(&one, &body, t);
                numbers.energy(&motion(&evaluator, mechanism, &later))
            };
            let forces = evaluator.inverse_dynamics(&one.states(), &p_min).expect("a pose");
            let rates = evaluator.drive_motion(&one.states()).expect("a pose");
            let n = forces.len();
            let power: f64 = (0..n).map(|d| forces[d][0] * rates[n + d][0]).sum();
            let size: f64 = (0..n).map(|d| (forces[d][0] * rates[n + d][0]).abs()).sum();
            let step = 1e-4;
            let rate = (energy(step) - energy(-step)) / (2.0 * step);
            let error = (power - rate).abs() / size;
            assert!(error < 1e-6, "{name}: power {power}, rate of energy {rate}");
        }
    }
}

/// The state a little later along its own motion: exact to first order of time in rates, to second in the pose.
fn along(one: &Sample, body: &modelmill_spec::FreeBody, t: f64) -> Sample {
    let mut later = one.clone();
    for k in 0..one.q.len() {
        let (q, v, a) = (one.q[k][0], one.qd[k][0], one.qdd[k][0]);
        later.q[k][0] = q + v * t + 0.5 * a * t * t;
        later.qd[k][0] = v + a * t;
    }
    let [w, x, y, z] = body.quaternion.map(|i| one.q[i.0][0]);
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    let vector = |all: &[modelmill_spec::CoordinateIdx], of: &[Vec<f64>]| Vector3::from_fn(|k, _| of[all[k].0][0]);
    let [omega, alpha] = [&one.qd, &one.qdd].map(|of| {
        let given = vector(&body.quaternion[1..], of);
        match body.angular {
            TwistAxes::Body => given,
            TwistAxes::World => turn.inverse() * given,
        }
    });
    let [velocity, mut acceleration] = [&one.qd, &one.qdd].map(|of| {
        let given = vector(&body.position, of);
        match body.linear {
            TwistAxes::World => given,
            TwistAxes::Body => turn * given,
        }
    });
    if body.linear == TwistAxes::Body {
        acceleration += (turn * omega).cross(&velocity);
    }
    let turned = turn * UnitQuaternion::from_scaled_axis(omega * t + alpha * (0.5 * t * t));
    for (k, i) in body.position.iter().enumerate() {
        later.q[i.0][0] = one.q[i.0][0] + velocity[k] * t + 0.5 * acceleration[k] * t * t;
    }
    let turned = [turned.w, turned.i, turned.j, turned.k];
    for (i, value) in body.quaternion.iter().zip(turned) {
        later.q[i.0][0] = value;
    }
    later
}
