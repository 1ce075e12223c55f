//! The paper's own results: eq. (5), eq. (16), and tables of H that an independent program wrote.

use std::collections::BTreeMap;

use modelmill_codegen::{Derivation, ModelEvaluator};
use modelmill_tests::base_parameters;
use modelmill_tests::fixtures::{Table, derived, fixtures};
use modelmill_tests::published::{Fraction, Map};
use modelmill_tests::sample::Sample;

fn products(derivation: &Derivation) -> Vec<String> {
    let text = |m: &modelmill_codegen::ParameterMonomial| m.text(&derivation.mechanism);
    derivation.reduction.products.iter().map(text).collect()
}

#[test]
fn the_papers_model_has_the_eleven_products_of_eq_5_in_its_order() {
    let derivation = derived("spidermill-paper");
    assert_eq!(
        products(&derivation),
        [
            "m1*dc1", "m1*dc1^2", "m2", "m3", "m3*dc3", "m3*dc3^2", "m4", "m4*dc3", "m4*dc3^2", "Ic12", "Ic32"
        ]
    );
    let without: Vec<String> = derivation
        .reduction
        .without_effect
        .iter()
        .map(|m| m.text(&derivation.mechanism))
        .collect();
    assert_eq!(without, ["m1"], "the joint of m1 stands still");
}

#[test]
fn the_papers_model_has_the_five_expressions_of_eq_16_term_by_term() {
    let derivation = derived("spidermill-paper");
    let text = std::fs::read_to_string(fixtures().join("published/spidermill-paper.txt")).expect("eq. (16)");
    let published = Map::parse(&text, &derivation.mechanism);
    let mill = Map::of_mill(&derivation);
    mill.assert_equals(&published);
    let names = |map: &Map| -> Vec<String> { map.rows.iter().map(|r| r.0.clone()).collect() };
    assert_eq!(names(&mill), names(&published), "in the paper's order");
}

#[test]
fn the_consistent_model_has_four_base_parameters() {
    let derivation = derived("spidermill");
    assert_eq!(derivation.reduction.retained.len(), 4);
    assert_eq!(
        products(&derivation),
        [
            "m1*dc1", "m1*dc1^2", "m2", "m3", "m3*dc3", "m3*dc3^2", "m4", "Ic12", "Ic32"
        ]
    );
}

#[test]
fn the_elbows_mass_acts_like_moments_of_the_crank() {
    for name in ["spidermill", "spidermill-paper"] {
        let derivation = derived(name);
        for (retained, expected) in [("m1*dc1", "d1"), ("m1*dc1^2", "d1^2")] {
            let factor = base_parameters::factor(&derivation, "m2", retained)
                .unwrap_or_else(|| panic!("{name}: m2 is not regrouped into {retained}"));
            let expected = Fraction::parse(expected, &BTreeMap::new());
            assert!(
                Fraction::of_mill(factor, &derivation.mechanism) == expected,
                "{name}: {factor:?}"
            );
        }
        let line = derivation
            .reduction
            .dependencies
            .iter()
            .find(|line| products(&derivation)[line.product] == "m2")
            .expect("m2 depends on others");
        assert_eq!(line.equals.len(), 2, "{name}");
    }
}

/// Compares passive angles, every entry of H and the forces of a table with the block evaluator.
///
/// Entries of H and forces are held to 1e-11 of the largest magnitude in their column of the table:
/// single entries pass through zero, where a relative error says nothing.
fn check_table(name: &str, table: &str) {
    let derivation = derived(name);
    let mechanism = &derivation.mechanism;
    let table = Table::reference(table);
    let evaluator = ModelEvaluator::new(&derivation);
    let sample = Sample::from_table(mechanism, &table);
    let close = |what: &str, expected: &[f64], found: &dyn Fn(usize) -> f64| {
        let scale = expected.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        assert!(scale > 0.0, "{what} is zero throughout the table");
        for (i, x) in expected.iter().enumerate() {
            let error = (found(i) - x).abs() / scale;
            assert!(
                error < 1e-11,
                "{name}, {what}, row {i}: {} instead of {x}, error {error:.1e}",
                found(i)
            );
        }
    };
    let passive = evaluator.passive_motion(&sample.states()).expect("all in reach");
    for (k, angle) in ["gamma1", "gamma2"].into_iter().enumerate() {
        close(angle, table.column(angle), &|i| passive[k][i]);
    }
    let h = evaluator.full_regressor(&sample.states()).expect("all in reach");
    let n_drives = mechanism.drives.len();
    let mut compared = 0;
    for (d, drive) in mechanism.drives.iter().enumerate() {
        for (k, product) in products(&derivation).iter().enumerate() {
            let column = format!("H[{};{product}]", drive.name);
            close(&column, table.column(&column), &|i| h[(i * n_drives + d, k)]);
            compared += 1;
        }
    }
    let in_table = table.names().iter().filter(|n| n.starts_with("H[")).count();
    assert_eq!(compared, in_table, "every column of H is compared");
    let base = base_parameters::base(&derivation, &base_parameters::nominal(mechanism));
    let forces = evaluator
        .inverse_dynamics(&sample.states(), &base)
        .expect("all in reach");
    for (d, drive) in mechanism.drives.iter().enumerate() {
        close(&drive.name, table.column(&drive.name), &|i| forces[d][i]);
    }
}

#[test]
fn the_papers_model_agrees_with_the_independent_table_of_h_to_1e_11() {
    check_table("spidermill-paper", "spidermill-paper-H");
}

#[test]
fn the_consistent_model_agrees_with_the_independent_table_of_h_to_1e_11() {
    check_table("spidermill", "spidermill-consistent-H");
}
