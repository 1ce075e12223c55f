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

/// Base parameter `k` written out term by term: what a script reads.
pub(crate) fn written_out(mechanism: &Mechanism, reduction: &Reduction, k: usize) -> Formula {
    let mut terms = vec![product_formula(
        mechanism,
        &reduction.products[reduction.retained[k]],
    )];
    for line in &reduction.dependencies {
        let factors = factors(mechanism, &reduction.products[line.product]);
        for (_, factor) in line.equals.iter().filter(|(at, _)| *at == k) {
            terms.extend(factor.expanded_times(mechanism, &factors));
        }
    }
    Formula::sum(terms)
}

/// What base parameters divide by: a function of the constants that may vanish.
pub(crate) struct Denominator {
    pub(crate) value: Formula,
    /// The sum of the magnitudes of its terms, sines and cosines taken as 1.
    pub(crate) size: Formula,
    /// As people read it.
    pub(crate) text: String,
}

/// Every denominator of eq. (16), powers of a constant by the constant itself.
pub(crate) fn denominators(mechanism: &Mechanism, reduction: &Reduction) -> Vec<Denominator> {
    let mut found: BTreeSet<Polynomial> = BTreeSet::new();
    let factors = reduction.dependencies.iter().flat_map(|line| &line.equals);
    for (_, factor) in factors {
        if factor.denominator.len() > 1 {
            found.insert(factor.denominator.clone());
            continue;
        }
        let variables = factor.denominator.keys().flatten().map(|(v, _)| *v);
        let variables = variables.filter(|v| !matches!(v, Variable::Root(_)));
        found.extend(variables.map(|v| Polynomial::from([(vec![(v, 1)], Rational::ONE)])));
    }
    let one = || Polynomial::from([(Vec::new(), Rational::ONE)]);
    let denominator = |p: Polynomial| Denominator {
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
    for line in &reduction.dependencies {
        let value = product(graph, &reduction.products[line.product]);
        for (k, factor) in &line.equals {
            let factor = factor.expression(graph);
            terms[*k].push(graph.mul(factor, value));
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
