//! Takes common factors out of sums: `a x + a y` becomes `a (x + y)`.

use std::collections::BTreeMap;

use super::flatten::{rebuild, rewrite, use_counts};
use crate::expr::{ExprId, Graph, Node, Rational};

/// Factors every sum greedily, most frequent factor first. Returns the rewritten roots.
pub(crate) fn factor_sums(graph: &mut Graph, roots: &[ExprId]) -> Vec<ExprId> {
    let uses = use_counts(graph, roots);
    // Products that are used elsewhere as well are not broken up.
    let mut shared: BTreeMap<ExprId, bool> = BTreeMap::new();
    rewrite(graph, roots, |graph, id, node| {
        let value = match &node {
            Node::Sum(terms) if terms.len() > 1 => factor_terms(graph, terms, &shared),
            _ => rebuild(graph, id, &node),
        };
        // Whether the new node is used more than once, for the sums above it.
        let many = uses[id.index()] > 1;
        shared.entry(value).and_modify(|s| *s = true).or_insert(many);
        value
    })
}

/// A term: its rational factor, and its other factors with exponents, any of which may be taken out.
type FactoredTerm = (Rational, Vec<(ExprId, i32)>);

/// A sum with its common factors taken out.
fn factor_terms(graph: &mut Graph, terms: &[(ExprId, Rational)], shared: &BTreeMap<ExprId, bool>) -> ExprId {
    let open: Vec<FactoredTerm> = terms
        .iter()
        .map(|(id, k)| {
            // The number of a term is split off.
            let (base, inner) = graph.split_factor(*id);
            let k = k * &inner;
            match graph.node(base) {
                Node::Product(factors) if !shared.get(&base).copied().unwrap_or(false) => (k, factors.clone()),
                _ => (k, vec![(base, 1)]),
            }
        })
        .collect();
    gather_terms(graph, open)
}

/// Takes out the factor that most terms have, then treats the quotient and the remaining terms in the same way.
fn gather_terms(graph: &mut Graph, terms: Vec<FactoredTerm>) -> ExprId {
    // Number of terms per factor with a positive exponent.
    let mut counts: BTreeMap<ExprId, usize> = BTreeMap::new();
    for (_, factors) in &terms {
        for (id, n) in factors {
            if *n > 0 && *id != Graph::ONE {
                *counts.entry(*id).or_insert(0) += 1;
            }
        }
    }
    let best = counts
        .into_iter()
        .filter(|(_, n)| *n > 1)
        // Ties go to the older node, so that the result does not depend on the order of a map.
        .max_by_key(|(id, n)| (*n, std::cmp::Reverse(*id)));
    let Some((common, _)) = best else {
        let terms: Vec<_> = terms
            .into_iter()
            .map(|(k, factors)| (graph.product(&factors), k))
            .collect();
        return graph.sum(&terms);
    };
    // The common factor is divided out of its terms; the others are left as they are.
    let (with, without): (Vec<FactoredTerm>, Vec<FactoredTerm>) = terms
        .into_iter()
        .partition(|(_, factors)| factors.iter().any(|(id, n)| *id == common && *n > 0));
    let inner = with
        .into_iter()
        .map(|(k, mut factors)| {
            for factor in &mut factors {
                if factor.0 == common {
                    factor.1 -= 1;
                }
            }
            factors.retain(|(_, n)| *n != 0);
            (k, factors)
        })
        .collect();
    // The quotient may have common factors of its own.
    let inner = gather_terms(graph, inner);
    let product = graph.mul(common, inner);
    if without.is_empty() {
        return product;
    }
    // The new product is a term of the remaining sum, which may have further common factors.
    let (base, k) = graph.split_factor(product);
    let mut rest = without;
    rest.push((k, vec![(base, 1)]));
    gather_terms(graph, rest)
}
