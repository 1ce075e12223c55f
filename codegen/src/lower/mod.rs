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

pub(crate) use program::SINGULAR;
pub use program::{Guard, Op, OperationCount, Program, Stage, ValueId};
pub(crate) use schedule::Definition;

use crate::expr::{ExprId, Graph};

/// What a program computes.
pub(crate) struct Request<'a> {
    /// Expressions whose values come out.
    pub(crate) outputs: &'a [ExprId],
    /// What must not be negative.
    pub(crate) reachable: &'a [ExprId],
    /// What must not vanish, with the magnitude of its terms, which is fixed.
    pub(crate) regular: &'a [(ExprId, ExprId)],
    /// Whether outputs may have no finite value at states where everything else is regular.
    pub(crate) may_be_undefined: bool,
    /// Atoms that are computed rather than read.
    pub(crate) definitions: &'a [Definition],
}

/// The passes of lowering, by name, in their order.
pub(crate) const PASSES: [&str; 3] = [
    "common factors out of sums",
    "common pairs of terms and factors once",
    "nested sums and products opened first",
];

/// Lowers the expressions of a request to a program.
pub(crate) fn lower(graph: &Graph, request: &Request<'_>) -> Program {
    lower_by(graph, PASSES.len(), request)
}

/// Lowers them with the first passes of [`PASSES`] only.
pub(crate) fn lower_by(graph: &Graph, n_passes: usize, request: &Request<'_>) -> Program {
    let mut roots: Vec<ExprId> = request.outputs.to_vec();
    roots.extend(request.reachable);
    roots.extend(request.regular.iter().flat_map(|(id, size)| [*id, *size]));
    for definition in request.definitions {
        roots.extend(definition.operands());
    }
    // Costs are the finished programs', so that no pass is kept that does not pay. The passes go through the whole arena again and again, so that only what is needed should be in it.
    let (mut graph, mut next) = graph.compacted(&roots);
    let mut best = schedule::schedule(&graph, &next, request);
    for _ in 0..4 {
        (graph, next) = graph.compacted(&next);
        if n_passes > 2 {
            next = flatten::flatten(&mut graph, &next);
        }
        if n_passes > 0 {
            next = factor_sums::factor_sums(&mut graph, &next);
        }
        if n_passes > 1 {
            (graph, next) = share::share(&graph, &next);
        }
        let program = schedule::schedule(&graph, &next, request);
        if program.weight() >= best.weight() {
            break;
        }
        best = program;
    }
    best
}
