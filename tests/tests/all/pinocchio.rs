//! Another program's numbers: inverse dynamics of five arms by Pinocchio 4.1, for bodies that could exist.
//!
//! The tables come from `fixtures/reference/make_pinocchio_tables.py`; they cover modified and standard
//! Denavit-Hartenberg frames and frames by roll, pitch and yaw.

use modelmill_codegen::ModelEvaluator;
use modelmill_tests::base_parameters;
use modelmill_tests::fixtures::{Table, derived};
use modelmill_tests::sample::Sample;
use nalgebra::DVector;

/// Compares torques from H p_g and from the inverse dynamics with p_min; errors are relative to the largest torque
/// of the joint in the table.
fn check(name: &str) {
    let derivation = derived(name);
    let mechanism = &derivation.mechanism;
    let table = Table::reference(&format!("pinocchio-{name}"));
    let values = Table::reference(&format!("pinocchio-{name}-parameters"));
    let parameters: Vec<f64> = mechanism.parameters.iter().map(|p| values.column(&p.name)[0]).collect();
    assert_eq!(parameters.len(), values.names().len());
    let sample = Sample::from_table(mechanism, &table);
    let evaluator = ModelEvaluator::new(&derivation);
    let h = evaluator.full_regressor(&sample.states()).expect("an open chain");
    let by_products = h * DVector::from_vec(base_parameters::products(&derivation, &parameters));
    let by_base = evaluator
        .inverse_dynamics(&sample.states(), &base_parameters::base(&derivation, &parameters))
        .expect("an open chain");
    let n_drives = mechanism.drives.len();
    for (d, drive) in mechanism.drives.iter().enumerate() {
        let expected = table.column(&drive.name);
        let scale = expected.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        for (i, x) in expected.iter().enumerate() {
            for found in [by_products[i * n_drives + d], by_base[d][i]] {
                let error = (found - x).abs() / scale;
                assert!(
                    error < 1e-11,
                    "{name}, {}, row {i}: {found} instead of {x}, error {error:.1e}",
                    drive.name
                );
            }
        }
    }
    assert_eq!(table.n_rows(), 40);
}

#[test]
fn puma560_agrees_with_pinocchio() {
    check("puma560");
}

#[test]
fn rx90_agrees_with_pinocchio() {
    check("rx90");
}

#[test]
fn panda_agrees_with_pinocchio() {
    check("panda");
}

#[test]
fn ur5_in_standard_denavit_hartenberg_agrees_with_pinocchio() {
    check("ur5");
}

#[test]
fn tx40_in_roll_pitch_yaw_agrees_with_pinocchio() {
    check("tx40-rigid");
}
