//! Base parameters in terms of the dynamic parameters: as expressions to compute and as formulas to read, eq. (7) and
//! (16).

use std::collections::BTreeSet;

use modelmill_spec::Mechanism;

use super::rational_function::{FactorVariable, RationalFunction, TrigonometricPolynomial};
use super::reduction::BaseReduction;
use crate::expr::print::{FormulaFunction, PrintedFormula};
use crate::expr::{Atom, ExprId, Graph, Rational};
use crate::tree::expressions::ParameterMonomial;

/// Name of the base parameter at position `k`: `p1_min` for `k = 0`.
pub(crate) fn base_parameter_name(k: usize) -> String {
    format!("p{}_min", k + 1)
}

/// Base parameter `k` written out term by term, as a script reads it. It may refer to names of [`dependent_sums`].
pub(crate) fn expanded_formula(mechanism: &Mechanism, reduction: &BaseReduction, k: usize) -> PrintedFormula {
    // The retained product itself.
    let mut terms = vec![product_formula(mechanism, &reduction.products[reduction.retained[k]])];
    // Every dependent product contributes its factor on this retained column.
    for (at, line) in reduction.dependencies.iter().enumerate() {
        for (_, factor) in line.equals.iter().filter(|(at, _)| *at == k) {
            let factors = lumped_formulas(mechanism, reduction, at);
            terms.extend(factor.expanded_terms(mechanism, &factors));
        }
    }
    PrintedFormula::sum(terms)
}

/// Sums of dependent products that others refer to: the product itself and the products that are expressed by it, as
/// Gautier and Khalil (1990) group link by link. Each has a name and stands after the sums that it needs.
pub(crate) fn dependent_sums(mechanism: &Mechanism, reduction: &BaseReduction) -> Vec<(String, PrintedFormula)> {
    // Sums that others need come after those that refer to them.
    let outer_first = reduction.lines_in_dependency_order().into_iter().rev();
    let sum = |line: usize| {
        let name = sum_name(mechanism, reduction, line)?;
        let product = reduction.dependencies[line].product;
        let mut terms = vec![product_formula(mechanism, &reduction.products[product])];
        // Products that are expressed by this one contribute with their factors.
        for (outer, dependency) in reduction.dependencies.iter().enumerate() {
            for (_, factor) in dependency.via.iter().filter(|(p, _)| *p == product) {
                let factors = lumped_formulas(mechanism, reduction, outer);
                terms.extend(factor.expanded_terms(mechanism, &factors));
            }
        }
        Some((name, PrintedFormula::sum(terms)))
    };
    outer_first.filter_map(sum).collect()
}

/// The name of the sum of a dependent product, if other products refer to it.
fn sum_name(mechanism: &Mechanism, reduction: &BaseReduction, line: usize) -> Option<String> {
    let product = reduction.dependencies[line].product;
    let mut via = reduction.dependencies.iter().flat_map(|line| &line.via);
    if !via.any(|(p, _)| *p == product) {
        return None;
    }
    // The name must not collide with names of the model file.
    let constants = mechanism.constants.iter().map(|c| c.name.as_str());
    let parameters = mechanism.parameters.iter().map(|p| p.name.as_str());
    let taken: Vec<&str> = constants.chain(parameters).collect();
    let mut stem = "sum".to_owned();
    // An underscore is added until no name begins with the stem.
    while taken.iter().any(|name| name.starts_with(&stem)) {
        stem.push('_');
    }
    Some(format!("{stem}{}", line + 1))
}

/// The contribution of a dependent product to others: the name of its sum, or the product itself.
pub(crate) fn lumped_formulas(mechanism: &Mechanism, reduction: &BaseReduction, line: usize) -> Vec<PrintedFormula> {
    match sum_name(mechanism, reduction, line) {
        Some(name) => vec![PrintedFormula::name(name)],
        None => parameter_factors(mechanism, &reduction.products[reduction.dependencies[line].product]),
    }
}

/// A divisor of the base parameters: a function of the constants that may vanish.
#[derive(Clone, Debug)]
pub struct BaseDenominator {
    /// The divisor as a formula.
    pub value: PrintedFormula,
    /// The sum of the magnitudes of its terms, where sines and cosines count as 1.
    pub size: PrintedFormula,
    /// The divisor as text for the reader.
    pub text: String,
}

/// All denominators of eq. (16), each once. Powers of a constant are represented by the constant.
pub(crate) fn denominators(mechanism: &Mechanism, reduction: &BaseReduction) -> Vec<BaseDenominator> {
    // A set, because many factors have the same denominator.
    let mut found: BTreeSet<TrigonometricPolynomial> = BTreeSet::new();
    let lines = reduction.dependencies.iter();
    for (_, factor) in lines.flat_map(|line| line.equals.iter().chain(&line.via)) {
        // The value of a sum may vanish; a product vanishes where one of its factors does.
        if factor.denominator.len() > 1 {
            found.insert(factor.denominator.clone());
            continue;
        }
        let variables = factor.denominator.keys().flatten().map(|(v, _)| *v);
        let variables = variables.filter(|v| !matches!(v, FactorVariable::Root(_)));
        found.extend(variables.map(|v| TrigonometricPolynomial::from([(vec![(v, 1)], Rational::ONE)])));
    }
    // Denominators are printed as functions with denominator 1.
    let one = || TrigonometricPolynomial::from([(Vec::new(), Rational::ONE)]);
    let denominator = |p: TrigonometricPolynomial| BaseDenominator {
        size: PrintedFormula::sum(p.iter().map(|(powers, k)| {
            // Sines and cosines count as 1, so they are left out.
            let magnitude = |v: FactorVariable| match v {
                FactorVariable::Cos(_) | FactorVariable::Sin(_) => None,
                FactorVariable::Constant(_) => {
                    let operand = vec![v.formula(mechanism)];
                    Some(PrintedFormula::Apply(FormulaFunction::Abs, operand))
                }
                FactorVariable::Root(_) => Some(v.formula(mechanism)),
            };
            let factors = powers.iter().filter_map(|(v, n)| {
                let power = i32::try_from(*n).unwrap_or(i32::MAX);
                Some(magnitude(*v)?.power(power))
            });
            PrintedFormula::product(k.abs(), factors.collect::<Vec<_>>())
        })),
        text: RationalFunction::new(p.clone(), one()).formula(mechanism).text(),
        value: RationalFunction::new(p, one()).expanded_formula(mechanism),
    };
    found.into_iter().map(denominator).collect()
}

/// The factors of a product of parameters.
fn parameter_factors(mechanism: &Mechanism, product: &ParameterMonomial) -> Vec<PrintedFormula> {
    product
        .0
        .iter()
        .map(|(p, n)| {
            let name = PrintedFormula::name(&*mechanism.parameters[*p].name);
            name.power(i32::try_from(*n).unwrap_or(i32::MAX))
        })
        .collect()
}

/// A product of parameters as a formula.
pub(crate) fn product_formula(mechanism: &Mechanism, product: &ParameterMonomial) -> PrintedFormula {
    PrintedFormula::product(Rational::ONE, parameter_factors(mechanism, product))
}

/// The base parameters as expressions of the graph, by eq. (7).
pub(crate) fn base_expressions(graph: &mut Graph, reduction: &BaseReduction) -> Vec<ExprId> {
    // Every base parameter begins with its retained product.
    let mut terms: Vec<Vec<ExprId>> = reduction
        .retained
        .iter()
        .map(|k| vec![product_expression(graph, &reduction.products[*k])])
        .collect();
    // The sum of each dependent product with the products that are expressed by it, outer ones first.
    let lines = &reduction.dependencies;
    let mut worth: Vec<Vec<ExprId>> = (lines.iter())
        .map(|line| vec![product_expression(graph, &reduction.products[line.product])])
        .collect();
    for i in reduction.lines_in_dependency_order().into_iter().rev() {
        let value = graph.add_all(&worth[i]);
        // Contributions to base parameters.
        for (k, factor) in &lines[i].equals {
            let factor = factor.expression(graph);
            terms[*k].push(graph.mul(factor, value));
        }
        // Contributions to the sums of other dependent products.
        for (inner, factor) in &lines[i].via {
            let factor = factor.expression(graph);
            worth[reduction.line_of(*inner)].push(graph.mul(factor, value));
        }
    }
    terms.iter().map(|terms| graph.add_all(terms)).collect()
}

/// A product of parameters as an expression.
pub(crate) fn product_expression(graph: &mut Graph, product: &ParameterMonomial) -> ExprId {
    let factors: Vec<_> = product
        .0
        .iter()
        .map(|(p, n)| {
            let power = i32::try_from(*n).expect("a small power");
            (graph.atom(Atom::Parameter(*p)), power)
        })
        .collect();
    graph.product(&factors)
}

/// SI unit of a product of parameters.
pub(crate) fn product_unit(mechanism: &Mechanism, product: &ParameterMonomial) -> String {
    let factors: Vec<(&str, i32)> = product
        .0
        .iter()
        .map(|(p, n)| {
            (
                mechanism.parameters[*p].unit.as_str(),
                i32::try_from(*n).expect("a small power"),
            )
        })
        .collect();
    modelmill_spec::unit_product(&factors)
}
