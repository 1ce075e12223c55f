//! Lowering: expressions go in, a straight-line program comes out.
//!
//! The passes rewrite expressions into cheaper ones of equal value; scheduling then writes binary operations.

pub(crate) mod cost;
mod factor_sums;
mod flatten;
mod program;
mod schedule;
mod share;
#[cfg(test)]
mod tests;

pub use program::{OperationCount, PoseGuard, ProgramOp, ProgramStage, SINGULAR, StraightLineProgram, ValueId};
pub(crate) use schedule::{AtomDefinition, AtomRule};

use crate::expr::{ExprId, Graph};

/// What a program computes.
pub(crate) struct LoweringRequest<'a> {
    /// Expressions whose values are the outputs.
    pub(crate) outputs: &'a [ExprId],
    /// Expressions that must not be negative.
    pub(crate) reachable: &'a [ExprId],
    /// Expressions that must not be zero, each with the fixed magnitude of its terms.
    pub(crate) regular: &'a [(ExprId, ExprId)],
    /// Whether outputs may have no finite value at states where everything else is regular.
    pub(crate) may_be_undefined: bool,
    /// Atoms that are computed and not read.
    pub(crate) definitions: &'a [AtomDefinition],
}

/// A rewriting of expressions into cheaper ones of equal value.
pub(crate) struct LoweringPass {
    /// What it does, for tables of operation counts.
    pub(crate) name: &'static str,
    /// Rewrites the roots; the graph may be another one afterwards.
    run: fn(Graph, &[ExprId]) -> (Graph, Vec<ExprId>),
}

/// The passes in the order in which they run. Tests and counts of operations read this list.
pub(crate) static PASSES: [LoweringPass; 3] = [
    LoweringPass {
        name: "nested sums and products flattened first",
        run: |mut graph, roots| {
            let roots = flatten::flatten(&mut graph, roots);
            (graph, roots)
        },
    },
    LoweringPass {
        name: "common factors taken out of sums",
        run: |mut graph, roots| {
            let roots = factor_sums::factor_sums(&mut graph, roots);
            (graph, roots)
        },
    },
    LoweringPass {
        name: "common pairs of terms and factors computed once",
        run: |graph, roots| share::share_pairs(&graph, roots),
    },
];

/// Largest number of rounds of all passes; the rounds end earlier if one makes the program no cheaper.
const MOST_ROUNDS: usize = 4;

/// Lowers the expressions of a request to a program.
pub(crate) fn lower(graph: &Graph, request: &LoweringRequest<'_>) -> StraightLineProgram {
    lower_with_passes(graph, &PASSES, request)
}

/// The same with given passes.
pub(crate) fn lower_with_passes(
    graph: &Graph,
    passes: &[LoweringPass],
    request: &LoweringRequest<'_>,
) -> StraightLineProgram {
    // All expressions that the program needs, in the order in which scheduling takes them.
    let mut roots: Vec<ExprId> = request.outputs.to_vec();
    roots.extend(request.reachable);
    roots.extend(request.regular.iter().flat_map(|(id, size)| [*id, *size]));
    for definition in request.definitions {
        roots.extend(definition.rule.operands());
    }
    // Finished programs are compared, so that no round is kept that makes the program more expensive. Passes visit the
    // whole arena several times, so it holds only needed nodes.
    let (mut graph, mut roots) = graph.compacted(&roots);
    let mut best = schedule::schedule(&graph, &roots, request);
    for round in 0..MOST_ROUNDS {
        if round > 0 {
            (graph, roots) = graph.compacted(&roots);
        }
        for pass in passes {
            (graph, roots) = (pass.run)(graph, &roots);
        }
        let program = schedule::schedule(&graph, &roots, request);
        // A round that gains nothing ends the search.
        if program.weight() >= best.weight() {
            break;
        }
        best = program;
    }
    best
}
