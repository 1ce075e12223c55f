//! p_g and p_min in numbers, straight from eq. (7): a second way beside whatever the mill offers.

use modelmill_codegen::{Derivation, RationalFunction};
use modelmill_spec::Mechanism;

/// Values of the constants in the order of the file.
pub fn constants(mechanism: &Mechanism) -> Vec<f64> {
    mechanism.constants.iter().map(|c| c.value).collect()
}

/// Nominal values of the dynamic parameters in the order of the file.
pub fn nominal(mechanism: &Mechanism) -> Vec<f64> {
    mechanism.parameters.iter().map(|p| p.nominal).collect()
}

/// Values of the products p_g.
pub fn products(derivation: &Derivation, parameters: &[f64]) -> Vec<f64> {
    let products = &derivation.reduction.products;
    products.iter().map(|m| m.value(parameters)).collect()
}

/// Values of the base parameters p_min, with the file's constants.
pub fn base(derivation: &Derivation, parameters: &[f64]) -> Vec<f64> {
    let constants = constants(&derivation.mechanism);
    let products = products(derivation, parameters);
    let reduction = &derivation.reduction;
    let mut base: Vec<f64> = reduction.retained.iter().map(|k| products[*k]).collect();
    for (line, factors) in reduction.dependencies.iter().zip(reduction.factors(&constants)) {
        for (k, factor) in factors {
            base[k] += factor * products[line.product];
        }
    }
    base
}

/// The factor of a product in a base parameter, both by their text; `None` if the product is not regrouped into it.
pub fn factor<'a>(derivation: &'a Derivation, product: &str, retained: &str) -> Option<&'a RationalFunction> {
    let reduction = &derivation.reduction;
    let text = |k: usize| reduction.products[k].text(&derivation.mechanism);
    let line = reduction
        .dependencies
        .iter()
        .find(|line| text(line.product) == product)?;
    line.equals
        .iter()
        .find(|(k, _)| text(reduction.retained[*k]) == retained)
        .map(|(_, factor)| factor)
}
