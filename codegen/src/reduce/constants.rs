//! The numbers and constants of the model that factors of eq. (6) can contain.

use std::collections::BTreeSet;

use super::oracle::ConstantOccurrence;
use crate::expr::{Atom, ExprId, Graph, Node, Unary};

/// All ways in which constants occur in the columns and in the residuals of the loops, each once and in order.
pub(super) fn constant_occurrences(graph: &Graph, outputs: &[ExprId], residual: &[ExprId]) -> Vec<ConstantOccurrence> {
    let mut roots = outputs.to_vec();
    roots.extend(residual);
    // Atoms outside of angles, and atoms in sines and cosines.
    let mut found = BTreeSet::new();
    for node in graph.nodes_of(&roots) {
        // Atoms outside of angles are values; atoms in angles are angles.
        match node {
            Node::Atom(Atom::Constant(i)) => _ = found.insert((*i, false)),
            Node::Sin(angle) | Node::Cos(angle) => {
                found.extend(angle.atoms().filter_map(|atom| match atom {
                    Atom::Constant(i) => Some((i, true)),
                    _ => None,
                }));
            }
            _ => {}
        }
    }
    found.into_iter().collect()
}

/// Integers whose square roots occur, each once: they come from sines and cosines of multiples of pi/12.
pub(super) fn root_radicands(graph: &Graph, outputs: &[ExprId], residual: &[ExprId]) -> Vec<i64> {
    let mut roots = outputs.to_vec();
    roots.extend(residual);
    let mut found = Vec::new();
    // Roots of constants that are no integers do not occur here.
    for node in graph.nodes_of(&roots) {
        if let Node::Unary(Unary::Sqrt, inner) = node
            && let Node::Rational(value) = graph.node(*inner)
            && let Some((n, 1)) = value.as_small()
            && !found.contains(&n)
        {
            found.push(n);
        }
    }
    found
}
