//! Magnitudes of loop residuals and coordinates: what Newton's method holds residuals and steps against, so that it does
//! not depend on the unit of length.

use std::collections::HashMap;

use modelmill_spec::{Mechanism, Motion};

use crate::closure::coordinates_of;
use crate::expr::{Atom, ExprId, Graph, Node, Unary};
use crate::projection::Projection;

/// Scales of the residuals, of the passive coordinates and of the active ones, one after the other.
///
/// A residual's scale is the sum of the magnitudes of its terms, a sine counting as 1. A coordinate's is 1 for an angle,
/// the sum of its residuals' scales for a length, and 0 if no loop depends on it.
pub(crate) fn scales(
    graph: &mut Graph,
    mechanism: &Mechanism,
    projection: &Projection,
) -> Vec<ExprId> {
    let mut known = HashMap::new();
    let residuals: Vec<ExprId> = projection
        .residual
        .iter()
        .map(|r| magnitude(graph, mechanism, &mut known, *r))
        .collect();
    let of: Vec<Vec<usize>> = projection
        .residual
        .iter()
        .map(|r| coordinates_of(graph, &[*r]))
        .collect();
    let mut scales = residuals.clone();
    for i in projection.passive.iter().chain(&projection.active) {
        let rows = residuals.iter().zip(&of).filter(|(_, of)| of.contains(i));
        let rows: Vec<ExprId> = rows.map(|(scale, _)| *scale).collect();
        scales.push(match mechanism.coordinates[*i].motion {
            Motion::Revolute if !rows.is_empty() => Graph::ONE,
            _ => graph.add_all(&rows),
        });
    }
    scales
}

/// An expression with every term taken by its magnitude.
fn magnitude(
    graph: &mut Graph,
    mechanism: &Mechanism,
    known: &mut HashMap<ExprId, ExprId>,
    id: ExprId,
) -> ExprId {
    if let Some(found) = known.get(&id) {
        return *found;
    }
    let found = match graph.node(id).clone() {
        Node::Rational(value) => graph.rational(value.abs()),
        Node::Sin(_)
        | Node::Cos(_)
        | Node::Unary(Unary::Sign | Unary::Tanh | Unary::Sin | Unary::Cos, _) => Graph::ONE,
        // An angle that stands for itself; its turns are known to Newton's method.
        Node::Atom(Atom::Coordinate(i)) if mechanism.coordinates[i].motion == Motion::Revolute => {
            Graph::ONE
        }
        Node::Atom(_) | Node::Unary(Unary::Exp, _) => graph.unary(Unary::Abs, id),
        Node::Unary(Unary::Abs, inner) => magnitude(graph, mechanism, known, inner),
        Node::Unary(Unary::Sqrt, inner) => {
            let inner = magnitude(graph, mechanism, known, inner);
            graph.unary(Unary::Sqrt, inner)
        }
        Node::Sum(terms) => {
            let terms: Vec<_> = terms
                .into_iter()
                .map(|(term, factor)| (magnitude(graph, mechanism, known, term), factor.abs()))
                .collect();
            graph.sum(&terms)
        }
        Node::Product(factors) => {
            let factors: Vec<_> = factors
                .into_iter()
                .map(|(base, n)| {
                    let base = if n > 0 {
                        magnitude(graph, mechanism, known, base)
                    } else {
                        graph.unary(Unary::Abs, base)
                    };
                    (base, n)
                })
                .collect();
            graph.product(&factors)
        }
    };
    known.insert(id, found);
    found
}
