//! Values that are no finite numbers, and values that lead to such, are errors of the derivation that say which.

use modelmill_codegen::derive;
use modelmill_emit::emit;
use modelmill_spec::Mechanism;
use modelmill_tests::fixtures::model;

/// What the derivation of a changed two-link arm says.
fn refused(change: impl FnOnce(&mut Mechanism)) -> String {
    let mut mechanism = model("two_link");
    change(&mut mechanism);
    match derive(&mechanism) {
        Ok(_) => panic!("this has no derivation"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn values_that_are_no_numbers_are_named() {
    for value in [f64::NAN, f64::INFINITY] {
        let says = refused(|m| m.constants[0].value = value);
        assert!(says.starts_with(&format!("the value of `L`, {value}, is no")), "{says}");
        let says = refused(|m| m.parameters[0].nominal = value);
        assert!(says.starts_with("the value of `ZZ1`"), "{says}");
        let says = refused(|m| m.coordinates[1].nominal = value);
        assert!(says.starts_with("the value of `q2`"), "{says}");
    }
}

#[test]
fn a_base_parameter_that_a_constant_divides_by_zero_is_named() {
    let says = refused(|m| {
        let mass = m.parameters.iter().position(|p| p.name == "M2");
        let mass = modelmill_spec::ParameterIdx(mass.expect("the fore arm has a mass"));
        m.retain = vec![vec![(mass, 1)]];
        m.constants[0].value = 0.0;
    });
    assert!(says.contains("M2 + 1/L*MX1") || says.contains("M2 + MX1/L"), "{says}");
    assert!(says.contains("denominator"), "{says}");
}

#[test]
fn a_base_parameter_beyond_floating_point_is_named() {
    let says = refused(|m| {
        m.constants[0].value = 2.0;
        for parameter in &mut m.parameters {
            parameter.nominal = 1e308;
        }
    });
    assert!(says.contains("p1_min = ZZ1"), "{says}");
}

#[test]
fn zero_where_nothing_is_divided_is_fine() {
    let mut mechanism = model("two_link");
    mechanism.constants[0].value = 0.0;
    let derivation = derive(&mechanism).expect("no factor divides by L");
    assert!(emit(&derivation).module().contains("L: \"m\" = 0"));
}
