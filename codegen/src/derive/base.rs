//! Base parameters of a derivation: names, expressions, units and values.

use num_rational::BigRational;
use num_traits::One;

use crate::Derivation;
use crate::expr::Rational;
use crate::expr::print::PrintedFormula;
use crate::reduce::base;
use crate::tree::expressions::ParameterMonomial;

/// One base parameter as texts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BaseParameterEntry {
    /// `p1_min`, `p2_min`, ...
    pub name: String,
    /// The product whose column is retained.
    pub retained: String,
    /// Eq. (16): the parameter as an expression of dynamic parameters and constants.
    pub expression: String,
    /// Its SI unit.
    pub unit: String,
}

impl Derivation {
    /// Indices of the active coordinates and of the passive coordinates, in the order of the model file.
    pub fn coordinates(&self) -> (Vec<usize>, Vec<usize>) {
        (
            self.equations.projection.loops.active.clone(),
            self.equations.projection.loops.passive.clone(),
        )
    }

    /// The base parameters in the order of p_min.
    pub fn base_parameters(&self) -> Vec<BaseParameterEntry> {
        let reduction = &self.reduction;
        (0..reduction.retained.len())
            .map(|k| {
                // Unit and name are those of the retained product.
                let product = &reduction.products[reduction.retained[k]];
                BaseParameterEntry {
                    name: base::base_parameter_name(k),
                    retained: product.text(&self.mechanism),
                    expression: base::expanded_formula(&self.mechanism, reduction, k).text(),
                    unit: base::product_unit(&self.mechanism, product),
                }
            })
            .collect()
    }

    /// Named sums that base parameters refer to, with their expressions, each after those that it needs. Empty unless
    /// expanded base parameters would be too long to read.
    pub fn base_sums(&self) -> Vec<(String, String)> {
        let sums = base::dependent_sums(&self.mechanism, &self.reduction).into_iter();
        sums.map(|(name, formula)| (name, formula.text())).collect()
    }

    /// Eq. (6), one line per dependent product: `h[m2] = d1*h[m1*dc1] + ...`.
    pub fn dependency_texts(&self) -> Vec<String> {
        let column = |product: usize| format!("h[{}]", self.reduction.products[product].text(&self.mechanism));
        let lines = self.reduction.dependencies.iter().map(|line| {
            // Retained products first, then dependent ones.
            let retained = line.equals.iter();
            let retained = retained.map(|(k, factor)| (self.reduction.retained[*k], factor));
            let via = line.via.iter().map(|(product, factor)| (*product, factor));
            let terms = retained.chain(via).map(|(product, factor)| {
                let column = PrintedFormula::name(column(product));
                PrintedFormula::product(Rational::ONE, [factor.formula(&self.mechanism), column])
            });
            format!("{} = {}", column(line.product), PrintedFormula::sum(terms).text())
        });
        lines.collect()
    }

    /// Values of the base parameters for given parameters and constants, both in the order of the model file, in SI
    /// units.
    pub fn base_values(&self, parameters: &[f64], constants: &[f64]) -> Vec<f64> {
        let reduction = &self.reduction;
        let value = |product: usize| reduction.products[product].value(parameters);
        // The retained product itself, then the dependent ones with their factors.
        let mut base: Vec<f64> = reduction.retained.iter().map(|k| value(*k)).collect();
        for (line, factors) in reduction.dependencies.iter().zip(reduction.factors(constants)) {
            for (k, factor) in factors {
                base[k] += factor * value(line.product);
            }
        }
        base
    }

    /// Eq. (7) for given values of the constants, in the order of the model file: each base parameter as a sum of
    /// products of dynamic parameters with exact factors. Sines, cosines and roots of constants are those of floating
    /// point.
    pub fn base_polynomials(&self, constants: &[BigRational]) -> Vec<Vec<(ParameterMonomial, BigRational)>> {
        let reduction = &self.reduction;
        let product = |k: usize| reduction.products[k].clone();
        let retained = reduction.retained.iter();
        let mut polynomials: Vec<Vec<(ParameterMonomial, BigRational)>> =
            retained.map(|k| vec![(product(*k), BigRational::one())]).collect();
        // Factors by exact values of the constants.
        let factors = reduction.factors_by(&|factor| Some(factor.value_exact(constants)));
        let factors = factors.expect("numbers have a value for everything");
        for (line, factors) in reduction.dependencies.iter().zip(factors) {
            for (k, factor) in factors {
                polynomials[k].push((product(line.product), factor));
            }
        }
        polynomials
    }

    /// Values of the base parameters for the model file's values. Identified values are used where the file has them,
    /// matched by expression; all others follow from the nominal parameters.
    pub fn nominal_base_values(&self) -> Vec<f64> {
        let parameters: Vec<f64> = self.mechanism.parameters.iter().map(|p| p.nominal).collect();
        let constants: Vec<f64> = self.mechanism.constants.iter().map(|c| c.value).collect();
        let mut values = self.base_values(&parameters, &constants);
        for (k, value) in self.identified_base() {
            values[k] = value;
        }
        values
    }

    /// The identified values of the model file, by index of the base parameter.
    pub fn identified_base(&self) -> Vec<(usize, f64)> {
        let identified = &self.mechanism.identified_base;
        if identified.is_empty() {
            return Vec::new();
        }
        let base = self.base_parameters().into_iter().enumerate();
        let value = |expression: &String| {
            let mut known = identified.iter();
            known.find(|(other, _)| other == expression)
        };
        base.filter_map(|(k, base)| Some((k, value(&base.expression)?.1)))
            .collect()
    }
}
