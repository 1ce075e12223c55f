//! Lowering: from expressions to straight-line programs.
//!
//! The passes rewrite expressions into cheaper ones of equal value; the last one writes binary operations.

pub(crate) mod cost;
mod factor_sums;
mod flatten;
mod program;
mod schedule;
mod share;
#[cfg(test)]
mod tests;

pub use program::{Guard, Op, OperationCount, Program, Stage, ValueId};
pub(crate) use schedule::Definition;

use crate::expr::{Atom, ExprId, Graph};

/// Whether an atom is known once the geometry and the parameters are.
pub(crate) fn is_fixed(atom: Atom) -> bool {
    matches!(
        atom,
        Atom::Pi | Atom::Constant(_) | Atom::Parameter(_) | Atom::Base(_)
    )
}

/// What a program computes.
pub(crate) struct Request<'a> {
    /// Expressions whose values come out.
    pub(crate) outputs: &'a [ExprId],
    /// What must not be negative.
    pub(crate) reachable: &'a [ExprId],
    /// What must not vanish, with the magnitude below which it counts as zero.
    pub(crate) regular: &'a [(ExprId, f64)],
    /// Whether outputs may have no finite value at states where everything else is regular.
    pub(crate) may_be_undefined: bool,
    /// Atoms that are computed rather than read.
    pub(crate) definitions: &'a [Definition],
}

/// Lowers the expressions of a request to a program.
pub(crate) fn lower(graph: &Graph, request: &Request<'_>) -> Program {
    let mut roots: Vec<ExprId> = request.outputs.to_vec();
    roots.extend(request.reachable);
    roots.extend(request.regular.iter().map(|(id, _)| *id));
    for definition in request.definitions {
        roots.extend(definition.operands());
    }
    // The passes go through the whole arena again and again, so that only what is needed should be in it.
    let (mut best_graph, mut best) = graph.compacted(&roots);
    let mut best_cost = cost::cost(&best_graph, &best);
    for _ in 0..4 {
        let (mut graph, mut next) = best_graph.compacted(&best);
        next = flatten::flatten(&mut graph, &next);
        next = factor_sums::factor_sums(&mut graph, &next);
        (graph, next) = share::share(&graph, &next);
        let cost = cost::cost(&graph, &next);
        if cost >= best_cost {
            break;
        }
        (best_graph, best, best_cost) = (graph, next, cost);
    }
    schedule::schedule(&best_graph, &best, request)
}
