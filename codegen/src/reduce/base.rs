//! Base parameters by what they are made of: as expressions to compute and as formulas to read, eq. (7) and (16).

use std::collections::BTreeSet;

use modelmill_spec::Mechanism;

use super::rational_function::{Polynomial, RationalFunction, Variable};
use super::reduction::Reduction;
use crate::expr::print::{Formula, Function};
use crate::expr::{Atom, ExprId, Graph, Rational};
use crate::tree::expressions::Monomial;

/// Name of the base parameter at position `k`.
pub(crate) fn name(k: usize) -> String {
    format!("p{}_min", k + 1)
}

/// Base parameter `k` written out term by term: what a script reads. It refers to [`sums`].
pub(crate) fn written_out(mechanism: &Mechanism, reduction: &Reduction, k: usize) -> Formula {
    let mut terms = vec![product_formula(
        mechanism,
        &reduction.products[reduction.retained[k]],
    )];
    for (at, line) in reduction.dependencies.iter().enumerate() {
        for (_, factor) in line.equals.iter().filter(|(at, _)| *at == k) {
            let factors = lumped(mechanism, reduction, at);
            terms.extend(factor.expanded_times(mechanism, &factors));
        }
    }
    Formula::sum(terms)
}

/// What dependent products stand for that others go by: the product itself and theirs, as Gautier and Khalil (1990) group
/// link by link. Each with its name, after those that it needs.
pub(crate) fn sums(mechanism: &Mechanism, reduction: &Reduction) -> Vec<(String, Formula)> {
    let outer_first = reduction.inner_first().into_iter().rev();
    let sum = |line: usize| {
        let name = sum_name(mechanism, reduction, line)?;
        let product = reduction.dependencies[line].product;
        let mut terms = vec![product_formula(mechanism, &reduction.products[product])];
        for (outer, dependency) in reduction.dependencies.iter().enumerate() {
            for (_, factor) in dependency.via.iter().filter(|(p, _)| *p == product) {
                let factors = lumped(mechanism, reduction, outer);
                terms.extend(factor.expanded_times(mechanism, &factors));
            }
        }
        Some((name, Formula::sum(terms)))
    };
    outer_first.filter_map(sum).collect()
}

/// The name of the sum that a dependent product stands for, if others go by it.
fn sum_name(mechanism: &Mechanism, reduction: &Reduction, line: usize) -> Option<String> {
    let product = reduction.dependencies[line].product;
    let mut via = reduction.dependencies.iter().flat_map(|line| &line.via);
    if !via.any(|(p, _)| *p == product) {
        return None;
    }
    let constants = mechanism.constants.iter().map(|c| c.name.as_str());
    let parameters = mechanism.parameters.iter().map(|p| p.name.as_str());
    let taken: Vec<&str> = constants.chain(parameters).collect();
    let mut stem = "sum".to_owned();
    while taken.iter().any(|name| name.starts_with(&stem)) {
        stem.push('_');
    }
    Some(format!("{stem}{}", line + 1))
}

/// What a dependent product brings into others: its sum, or the product itself.
pub(crate) fn lumped(mechanism: &Mechanism, reduction: &Reduction, line: usize) -> Vec<Formula> {
    match sum_name(mechanism, reduction, line) {
        Some(name) => vec![Formula::name(name)],
        None => factors(
            mechanism,
            &reduction.products[reduction.dependencies[line].product],
        ),
    }
}

/// What base parameters divide by: a function of the constants that may vanish.
#[derive(Clone, Debug)]
pub struct BaseDenominator {
    /// The function.
    pub value: Formula,
    /// The sum of the magnitudes of its terms, sines and cosines taken as 1.
    pub size: Formula,
    /// As people read it.
    pub text: String,
}

/// Every denominator of eq. (16), powers of a constant by the constant itself.
pub(crate) fn denominators(mechanism: &Mechanism, reduction: &Reduction) -> Vec<BaseDenominator> {
    let mut found: BTreeSet<Polynomial> = BTreeSet::new();
    let lines = reduction.dependencies.iter();
    for (_, factor) in lines.flat_map(|line| line.equals.iter().chain(&line.via)) {
        if factor.denominator.len() > 1 {
            found.insert(factor.denominator.clone());
            continue;
        }
        let variables = factor.denominator.keys().flatten().map(|(v, _)| *v);
        let variables = variables.filter(|v| !matches!(v, Variable::Root(_)));
        found.extend(variables.map(|v| Polynomial::from([(vec![(v, 1)], Rational::ONE)])));
    }
    let one = || Polynomial::from([(Vec::new(), Rational::ONE)]);
    let denominator = |p: Polynomial| BaseDenominator {
        size: Formula::sum(p.iter().map(|(powers, k)| {
            let magnitude = |v: Variable| match v {
                Variable::Cos(_) | Variable::Sin(_) => None,
                Variable::Constant(_) => {
                    let operand = vec![v.formula(mechanism)];
                    Some(Formula::Apply(Function::Abs, operand))
                }
                Variable::Root(_) => Some(v.formula(mechanism)),
            };
            let factors = powers.iter().filter_map(|(v, n)| {
                let power = i32::try_from(*n).unwrap_or(i32::MAX);
                Some(magnitude(*v)?.power(power))
            });
            Formula::product(k.abs(), factors.collect::<Vec<_>>())
        })),
        text: RationalFunction::new(p.clone(), one())
            .formula(mechanism)
            .text(),
        value: RationalFunction::new(p, one()).expanded(mechanism),
    };
    found.into_iter().map(denominator).collect()
}

fn factors(mechanism: &Mechanism, product: &Monomial) -> Vec<Formula> {
    product
        .0
        .iter()
        .map(|(p, n)| {
            let name = Formula::name(&*mechanism.parameters[*p].name);
            name.power(i32::try_from(*n).unwrap_or(i32::MAX))
        })
        .collect()
}

/// A product of parameters as a formula.
pub(crate) fn product_formula(mechanism: &Mechanism, product: &Monomial) -> Formula {
    Formula::product(Rational::ONE, factors(mechanism, product))
}

/// The base parameters as expressions of the graph: eq. (7) carried out.
pub(crate) fn expressions(graph: &mut Graph, reduction: &Reduction) -> Vec<ExprId> {
    let mut terms: Vec<Vec<ExprId>> = reduction
        .retained
        .iter()
        .map(|k| vec![product(graph, &reduction.products[*k])])
        .collect();
    // What each dependent product is worth with those that go by it, outer ones first.
    let lines = &reduction.dependencies;
    let mut worth: Vec<Vec<ExprId>> = (lines.iter())
        .map(|line| vec![product(graph, &reduction.products[line.product])])
        .collect();
    for i in reduction.inner_first().into_iter().rev() {
        let value = graph.add_all(&worth[i]);
        for (k, factor) in &lines[i].equals {
            let factor = factor.expression(graph);
            terms[*k].push(graph.mul(factor, value));
        }
        for (inner, factor) in &lines[i].via {
            let factor = factor.expression(graph);
            worth[reduction.line_of(*inner)].push(graph.mul(factor, value));
        }
    }
    terms.iter().map(|terms| graph.add_all(terms)).collect()
}

/// A product of parameters as an expression.
pub(crate) fn product(graph: &mut Graph, product: &Monomial) -> ExprId {
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

/// Unit of a product of parameters.
pub(crate) fn unit(mechanism: &Mechanism, product: &Monomial) -> String {
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
