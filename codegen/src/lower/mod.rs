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

pub use program::{
    OperationCount, PoseGuard, ProgramOp, ProgramStage, SINGULAR, StraightLineProgram, ValueId,
};
pub(crate) use schedule::{AtomDefinition, AtomRule};

use crate::expr::{ExprId, Graph};

/// What a program computes.
pub(crate) struct LoweringRequest<'a> {
    /// Expressions whose values come out.
    pub(crate) outputs: &'a [ExprId],
    /// What must not be negative.
    pub(crate) reachable: &'a [ExprId],
    /// What must not vanish, with the magnitude of its terms, which is fixed.
    pub(crate) regular: &'a [(ExprId, ExprId)],
    /// Whether outputs may have no finite value at states where everything else is regular.
    pub(crate) may_be_undefined: bool,
    /// Atoms that are computed rather than read.
    pub(crate) definitions: &'a [AtomDefinition],
}

/// A rewriting of expressions into cheaper ones of equal value.
pub(crate) struct LoweringPass {
    /// What it does.
    pub(crate) name: &'static str,
    run: fn(Graph, &[ExprId]) -> (Graph, Vec<ExprId>),
}

/// The passes of lowering in the order in which they run. What stands here is checked and counted with all others.
pub(crate) static PASSES: [LoweringPass; 3] = [
    LoweringPass {
        name: "nested sums and products opened first",
        run: |mut graph, roots| {
            let roots = flatten::flatten(&mut graph, roots);
            (graph, roots)
        },
    },
    LoweringPass {
        name: "common factors out of sums",
        run: |mut graph, roots| {
            let roots = factor_sums::factor_sums(&mut graph, roots);
            (graph, roots)
        },
    },
    LoweringPass {
        name: "common pairs of terms and factors once",
        run: |graph, roots| share::share_pairs(&graph, roots),
    },
];

/// How often all passes are run at most; they stop where a round makes the program no cheaper.
const MOST_ROUNDS: usize = 4;

/// Lowers the expressions of a request to a program.
pub(crate) fn lower(graph: &Graph, request: &LoweringRequest<'_>) -> StraightLineProgram {
    lower_with_passes(graph, &PASSES, request)
}

/// Lowers them with some passes only.
pub(crate) fn lower_with_passes(
    graph: &Graph,
    passes: &[LoweringPass],
    request: &LoweringRequest<'_>,
) -> StraightLineProgram {
    let mut roots: Vec<ExprId> = request.outputs.to_vec();
    roots.extend(request.reachable);
    roots.extend(request.regular.iter().flat_map(|(id, size)| [*id, *size]));
    for definition in request.definitions {
        roots.extend(definition.rule.operands());
    }
    // Costs are the finished programs', so that no round is kept that does not pay. The passes go through the whole arena
    // again and again, so that only what is needed should be in it.
    let (mut graph, mut roots) = graph.compacted(&roots);
    let mut best = schedule::schedule(&graph, &roots, request);
    for _ in 0..MOST_ROUNDS {
        (graph, roots) = graph.compacted(&roots);
        for pass in passes {
            (graph, roots) = (pass.run)(graph, &roots);
        }
        let program = schedule::schedule(&graph, &roots, request);
        if program.weight() >= best.weight() {
            break;
        }
        best = program;
    }
    best
}
