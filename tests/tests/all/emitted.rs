//! The emitted code: every model's module against the block evaluator, and both SpiderMill models against the tables.

use crate::{fixture_models, random_models};
use modelmill_codegen::{Derivation, ModelEvaluator, MotionStates, PoseReason};
use modelmill_generated as generated;
use modelmill_runtime::{PoseError, Real};
use modelmill_tests::base_parameters;
use modelmill_tests::fixtures::{Table, derived};
use modelmill_tests::laws::Case;
use modelmill_tests::random::{self, Matter};
use modelmill_tests::sample::Sample;
use modelmill_tests::stream::Stream;
use nalgebra::DMatrix;

/// What a module computes at all states of a sample, in the shapes of the evaluator.
struct Outputs {
    base: Vec<f64>,
    h_min: DMatrix<f64>,
    /// One vector per drive.
    forces: Vec<Vec<f64>>,
    /// Coordinates and rates of the drives, then their Jacobian row by row.
    drives: Vec<Vec<f64>>,
    /// Passive coordinates, rates, accelerations.
    passive: Vec<Vec<f64>>,
    /// Columns of a model with other names would compare by chance.
    retained: Vec<&'static str>,
}

fn transposed(rows: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let n = rows.first().map_or(0, Vec::len);
    (0..n).map(|k| rows.iter().map(|row| row[k]).collect()).collect()
}

fn state_of<T: Real, const N: usize>(columns: &[Vec<f64>], i: usize) -> [T; N] {
    std::array::from_fn(|k| T::from_f64(columns[k][i]))
}

/// Runs the module `$models::$model` in numbers of type `$T`.
macro_rules! run {
    ($models:ident, $model:ident, $T:ty, $sample:expr) => {
        run!(@ $models, $model, $T, $sample, |_, _| Vec::new())
    };
    ($models:ident, $model:ident, $T:ty, $sample:expr, passive) => {
        run!(@ $models, $model, $T, $sample, |model: &$models::$model::Model<$T>, state| {
            let passive = model.passive(state).expect("a reachable state");
            let all = passive.q.iter().chain(&passive.qd).chain(&passive.qdd);
            all.map(|x| x.to_f64()).collect::<Vec<f64>>()
        })
    };
    (@ $models:ident, $model:ident, $T:ty, $sample:expr, $passive:expr) => {{
        use $models::$model as module;
        let geometry = module::Geometry::<$T>::default();
        let base = module::base_parameters(&geometry, &module::Parameters::default()).unwrap();
        let model = module::Model::new(&geometry);
        let dynamics = module::InverseDynamics::new(&geometry, &base);
        let sample: &Sample = $sample;
        let (mut rows, mut forces, mut drives, mut passive): (Vec<Vec<f64>>, Vec<_>, Vec<_>, Vec<_>) =
            Default::default();
        let passive_of: fn(&module::Model<$T>, &module::State<$T>) -> Vec<f64> = $passive;
        for i in 0..sample.len() {
            let state = module::State {
                q: state_of::<$T, { module::N_ACTIVE }>(&sample.q, i),
                qd: state_of::<$T, { module::N_ACTIVE }>(&sample.qd, i),
                qdd: state_of::<$T, { module::N_ACTIVE }>(&sample.qdd, i),
            };
            for row in model.regressor(&state).expect("a reachable state") {
                rows.push(row.map(|x| x.to_f64()).to_vec());
            }
            forces.push(dynamics.forces(&state).expect("a reachable state").map(|x| x.to_f64()).to_vec());
            let motion = model.drives(&state).expect("a reachable state");
            let all = motion.coordinate.iter().chain(&motion.rate).chain(motion.jacobian.iter().flatten());
            drives.push(all.map(|x| x.to_f64()).collect::<Vec<f64>>());
            passive.push(passive_of(&model, &state));
        }
        Outputs {
            base: base.map(|x| x.to_f64()).to_vec(),
            h_min: DMatrix::from_fn(rows.len(), module::N_BASE, |r, c| rows[r][c]),
            forces: transposed(&forces),
            drives: transposed(&drives),
            passive: transposed(&passive),
            retained: module::BASE_PARAMETERS.iter().map(|p| p.retained).collect(),
        }
    }};
}

/// Largest difference of two columns, relative to the larger of the first's greatest magnitude and `floor`.
fn difference(expected: &[f64], found: &[f64], floor: f64) -> f64 {
    assert_eq!(expected.len(), found.len());
    let scale = expected.iter().fold(floor, |m, x| m.max(x.abs()));
    let differences = expected.iter().zip(found).map(|(a, b)| (a - b).abs() / scale);
    differences.fold(0.0, |m: f64, x| if x.is_nan() { f64::INFINITY } else { m.max(x) })
}

fn check_columns(what: &str, expected: &[Vec<f64>], found: &[Vec<f64>], tolerance: f64) {
    assert_eq!(expected.len(), found.len(), "{what}");
    for (k, (a, b)) in expected.iter().zip(found).enumerate() {
        let error = difference(a, b, 1e-3);
        assert!(error < tolerance, "{what}, column {k}: error {error:.1e}");
    }
}

fn columns(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    matrix.column_iter().map(|c| c.iter().copied().collect()).collect()
}

/// States near the nominal pose, where loops can be closed also in single precision.
fn sample_of(derivation: &Derivation) -> Sample {
    let mechanism = &derivation.mechanism;
    let reach = if mechanism.loops.is_empty() { 3.0 } else { 0.25 };
    Sample::random(mechanism, 50, reach, &mut Stream::new(21)).reachable(&ModelEvaluator::new(derivation))
}

/// Compares a module's outputs with the evaluator's, column by column relative to the column's largest entry.
fn check(derivation: &Derivation, sample: &Sample, found: &Outputs, tolerance: f64) {
    let evaluator = ModelEvaluator::new(derivation);
    let states = sample.states();
    assert!(sample.len() > 30, "too few states");
    let reduction = &derivation.reduction;
    let retained: Vec<String> = reduction
        .retained
        .iter()
        .map(|k| reduction.products[*k].text(&derivation.mechanism))
        .collect();
    assert_eq!(retained, found.retained);
    let base = base_parameters::base(derivation, &base_parameters::nominal(&derivation.mechanism));
    assert!(difference(&base, &found.base, 0.0) < tolerance, "base parameters");
    let reachable = "the states are reachable";
    let h_min = evaluator.regressor(&states).expect(reachable);
    check_columns("H_min", &columns(&h_min), &columns(&found.h_min), tolerance);
    let forces = evaluator.inverse_dynamics(&states, &base).expect(reachable);
    check_columns("forces", &forces, &found.forces, tolerance);
    let drives = evaluator.drive_motion(&states).expect(reachable);
    check_columns("drives", &drives, &found.drives, tolerance);
    let passive = evaluator.passive_motion(&states).expect(reachable);
    check_columns("passive coordinates", &passive, &found.passive, tolerance);
}

/// A test that the module agrees with the evaluator to rounding, in both precisions.
macro_rules! agrees {
    ($($test:ident: $model:ident $name:literal $($passive:ident)?;)+) => {
        $(#[test]
        fn $test() {
            let derivation = derived($name);
            let sample = sample_of(&derivation);
            check(&derivation, &sample, &run!(generated, $model, f64, &sample $(, $passive)?), 1e-12);
            check(&derivation, &sample, &run!(generated, $model, f32, &sample $(, $passive)?), 5e-3);
        })+
    };
}

agrees! {
    arm_four_bar_agrees_with_the_evaluator: arm_four_bar "arm_four_bar" passive;
    arm_parallelogram_agrees_with_the_evaluator: arm_parallelogram "arm_parallelogram" passive;
    delta_agrees_with_the_evaluator: delta "delta" passive;
    delta_tied_agrees_with_the_evaluator: delta_tied "delta_tied" passive;
    drone_agrees_with_the_evaluator: drone "drone";
    humanoid_agrees_with_the_evaluator: humanoid "humanoid";
    quadruped_agrees_with_the_evaluator: quadruped "quadruped";
    emps_agrees_with_the_evaluator: emps "emps";
    five_bar_agrees_with_the_evaluator: five_bar "five_bar" passive;
    four_bar_agrees_with_the_evaluator: four_bar "four_bar" passive;
    panda_agrees_with_the_evaluator: panda "panda";
    gough_stewart_agrees_with_the_evaluator: gough_stewart "gough_stewart" passive;
    gough_stewart_tied_agrees_with_the_evaluator: gough_stewart_tied "gough_stewart_tied" passive;
    parallelogram_agrees_with_the_evaluator: parallelogram "parallelogram";
    puma560_agrees_with_the_evaluator: puma560 "puma560";
    rx90_agrees_with_the_evaluator: rx90 "rx90";
    scara_agrees_with_the_evaluator: scara "scara";
    spidermill_agrees_with_the_evaluator: spidermill "spidermill" passive;
    spidermill_paper_agrees_with_the_evaluator: spidermill_paper "spidermill-paper" passive;
    stanford_agrees_with_the_evaluator: stanford "stanford";
    slider_crank_agrees_with_the_evaluator: slider_crank "slider_crank" passive;
    three_rpr_agrees_with_the_evaluator: three_rpr "three_rpr" passive;
    three_rrr_agrees_with_the_evaluator: three_rrr "three_rrr" passive;
    two_link_agrees_with_the_evaluator: two_link "two_link";
}

#[test]
fn words_of_rust_may_be_names() {
    let geometry = fixture_models::_f64::Geometry::<f64>::default();
    let fields = [
        geometry._self,
        geometry.self_,
        geometry.r#type,
        geometry.type_,
        geometry.r#gen,
    ];
    let values = [9.81, 0.1, 0.2, 0.4, 12.8_f64];
    assert_eq!(fields.map(f64::to_bits), values.map(f64::to_bits));
    let derivation = derived("names");
    let sample = sample_of(&derivation);
    let found = run!(fixture_models, _f64, f64, &sample);
    check(&derivation, &sample, &found, 1e-12);
}

#[test]
fn loops_in_space_agree_with_the_evaluator() {
    let derivation = derived("spatial_slider");
    let sample = sample_of(&derivation);
    let found = run!(fixture_models, spatial_slider, f64, &sample, passive);
    check(&derivation, &sample, &found, 1e-12);
    let found = run!(fixture_models, spatial_slider, f32, &sample, passive);
    check(&derivation, &sample, &found, 5e-3);
    let derivation = derived("spatial_press");
    let sample = sample_of(&derivation);
    let found = run!(fixture_models, spatial_press, f64, &sample, passive);
    check(&derivation, &sample, &found, 1e-12);
}

/// A rod whose pivot moves in space, a tilted base and coupled drives.
#[test]
fn mechanics_of_effects_agree_with_the_evaluator() {
    let derivation = derived("swinging_cylinder");
    // Beyond this the cylinder's eye comes near its foot, where neither precision means much.
    let sample = Sample::random(&derivation.mechanism, 50, 0.6, &mut Stream::new(21));
    let found = run!(fixture_models, swinging_cylinder, f64, &sample);
    let fresh = fixture_models::swinging_cylinder::Geometry::<f64>::default();
    assert!((fresh.tx_base - 0.04).abs() < 1e-15, "the tilt may be set");
    check(&derivation, &sample, &found, 1e-12);
    let found = run!(fixture_models, swinging_cylinder, f32, &sample);
    check(&derivation, &sample, &found, 5e-3);
}

/// A test that a random mechanism's module agrees with the evaluator.
macro_rules! agrees_at_random {
    ($($model:ident: $function:ident $seed:literal $($passive:ident)?;)+) => {
        $(#[test]
        fn $model() {
            let mechanism = random::$function($seed, Matter::Anything);
            let case = Case::new(&mechanism, 60, 0.3).expect("regular states");
            let found = run!(random_models, $model, f64, &case.sample $(, $passive)?);
            check(&case.derivation, &case.sample, &found, 1e-11);
        })+
    };
}

mod random_models_agree_with_the_evaluator {
    use super::*;
    for_each_random_model!(agrees_at_random);
}

/// Compares a module with an independent table: passive angles, every column of H, forces.
///
/// Columns that are not retained follow from the emitted ones by eq. (6). Entries are held to 1e-11 of the largest in
/// their column of the table.
fn check_table(name: &str, table: &str, run: impl Fn(&Sample) -> Outputs) {
    let derivation = derived(name);
    let mechanism = &derivation.mechanism;
    let table = Table::reference(table);
    let found = run(&Sample::from_table(mechanism, &table));
    let close = |what: &str, column: &[f64]| {
        let error = difference(table.column(what), column, 0.0);
        assert!(error < 1e-11, "{name}, {what}: error {error:.1e}");
    };
    close("gamma1", &found.passive[0]);
    close("gamma2", &found.passive[1]);
    let constants = base_parameters::constants(mechanism);
    let (n_drives, reduction) = (mechanism.drives.len(), &derivation.reduction);
    let mut compared = 0;
    for (k, product) in reduction.products.iter().enumerate() {
        let combination: Vec<(usize, f64)> = if let Some(own) = reduction.retained.iter().position(|r| *r == k) {
            vec![(own, 1.0)]
        } else {
            let line = reduction.dependencies.iter().find(|line| line.product == k);
            let equals = &line.expect("retained or dependent").equals;
            equals.iter().map(|(r, f)| (*r, f.value_f64(&constants))).collect()
        };
        for (d, drive) in mechanism.drives.iter().enumerate() {
            let column: Vec<f64> = (0..table.n_rows())
                .map(|i| {
                    let row = found.h_min.row(i * n_drives + d);
                    combination.iter().map(|(r, f)| f * row[*r]).sum()
                })
                .collect();
            close(&format!("H[{};{}]", drive.name, product.text(mechanism)), &column);
            compared += 1;
        }
    }
    assert_eq!(compared, table.names().iter().filter(|n| n.starts_with("H[")).count());
    for (drive, forces) in mechanism.drives.iter().zip(&found.forces) {
        close(&drive.name, forces);
    }
}

#[test]
fn the_papers_emitted_model_agrees_with_the_independent_table_to_1e_11() {
    check_table("spidermill-paper", "spidermill-paper-H", |sample| {
        run!(generated, spidermill_paper, f64, sample, passive)
    });
}

#[test]
fn the_consistent_emitted_model_agrees_with_the_independent_table_to_1e_11() {
    check_table("spidermill", "spidermill-consistent-H", |sample| {
        run!(generated, spidermill, f64, sample, passive)
    });
}

#[test]
fn another_geometry_needs_no_new_code() {
    use generated::spidermill::{Geometry, Model, State};
    let derivation = derived("spidermill");
    let geometry = Geometry::<f64> {
        d1: 1.2,
        d3: 1.1,
        b: 0.8,
        dA: 0.5,
        Bx: -0.7,
        By: 0.1,
        g: 9.8,
    };
    let constants = derivation
        .mechanism
        .constants
        .iter()
        .map(|c| match c.name.as_str() {
            "d1" => 1.2,
            "d3" => 1.1,
            "b" => 0.8,
            "dA" => 0.5,
            "Bx" => -0.7,
            "By" => 0.1,
            "g" => 9.8,
            other => panic!("a new constant {other}"),
        })
        .collect();
    let evaluator = ModelEvaluator::with_constants(&derivation, constants);
    let sample = sample_of(&derivation);
    let expected = evaluator.regressor(&sample.states()).expect("reachable states");
    let model = Model::new(&geometry);
    for i in 0..sample.len() {
        let state = State {
            q: state_of(&sample.q, i),
            qd: state_of(&sample.qd, i),
            qdd: state_of(&sample.qdd, i),
        };
        let found = model.regressor(&state).expect("reachable states");
        for (d, row) in found.iter().enumerate() {
            let expected: Vec<f64> = expected.row(2 * i + d).iter().copied().collect();
            assert!(difference(&expected, row, 0.0) < 1e-12);
        }
    }
}

#[test]
fn poses_without_an_answer_are_errors_in_both() {
    use generated::spidermill::{Geometry, Model, State};
    use std::f64::consts::PI;
    let derivation = derived("spidermill");
    let evaluator = ModelEvaluator::new(&derivation);
    let model = Model::new(&Geometry::<f64>::default());
    // The elbows too far apart, and the left crank in line with its spindle.
    let stretched = [PI, 0.0];
    let dead_point = [0.05_f64.atan2(-0.75) - PI, 2.0];
    for (q, reason, error) in [
        (stretched, PoseReason::OutOfReach, PoseError::OutOfReach),
        (dead_point, PoseReason::Singular, PoseError::Singular),
    ] {
        let state = State {
            q,
            qd: [0.1, 0.2],
            qdd: [0.3, 0.4],
        };
        assert_eq!(model.regressor(&state), Err(error));
        let [q1, q2] = [[q[0]], [q[1]]];
        let states = MotionStates {
            q: vec![&q1, &q2],
            qd: vec![&[0.1], &[0.2]],
            qdd: vec![&[0.3], &[0.4]],
            load: Vec::new(),
        };
        let fault = evaluator.regressor(&states).expect_err("no answer there");
        assert_eq!((fault.sample, fault.reason), (0, reason));
    }
}

#[test]
fn base_parameters_are_refused_where_a_denominator_of_theirs_vanishes() {
    use modelmill_generated::four_bar::{Geometry, Parameters, base_parameters};
    let of = |l3: f64| {
        let geometry = Geometry {
            L3: l3,
            ..Geometry::default()
        };
        base_parameters(&geometry, &Parameters::default())
    };
    assert!(of(0.7).is_ok() && of(1e-12).is_ok());
    for special in [0.0, f64::NAN] {
        assert_eq!(of(special).unwrap_err().denominator, "L3");
    }
}
