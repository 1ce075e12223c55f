//! Operations of inverse dynamics and base regressor after each pass: what every pass saves.

use std::collections::BTreeMap;

use modelmill_spec::Mechanism;

use crate::expr::{Atom, ExprId, Graph};
use crate::lower::{OperationCount, ProgramStage};
use crate::programs::cheapest;
use crate::tree::expressions::ParameterMonomial;
use crate::{Derivation, DeriveError, lower};

/// Operations per state after a pass and all passes before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PassCount {
    /// What the pass does.
    pub pass: &'static str,
    /// Operations of the inverse dynamics with base parameters.
    pub inverse_dynamics: OperationCount,
    /// Operations of the base regressor.
    pub regressor: OperationCount,
}

impl Derivation {
    /// Operations of the programs pass by pass, beginning with the plain recursion in which equal expressions are
    /// computed once. A pass of the recursions is used only where it lowers the count; the last line is the emitted
    /// program.
    ///
    /// # Errors
    /// As [`crate::derive`].
    pub fn operations_by_pass(&self) -> Result<Vec<PassCount>, DeriveError> {
        let mut counts = Vec::new();
        let plain = ["plain recursion, equal expressions computed once"];
        let forms = plain.iter().chain(&cheapest::PASSES).enumerate();
        let forms = forms.map(|(n, pass)| (*pass, n, &lower::PASSES[..0]));
        let all_forms = cheapest::PASSES.len();
        // The first pass of lowering only helps the others, so it is counted last.
        let lowering = [(1, 1..2), (2, 1..3), (0, 0..3)];
        let lowering = lowering.map(|(last, used)| (lower::PASSES[last].name, all_forms, &lower::PASSES[used]));
        for (pass, of_forms, of_lowering) in forms.chain(lowering) {
            let [inverse_dynamics, regressor] = count_operations(self, of_forms, of_lowering)?;
            counts.push(PassCount {
                pass,
                inverse_dynamics,
                regressor,
            });
        }
        Ok(counts)
    }
}

/// Operations of inverse dynamics and base regressor, with the first `of_forms` passes of the recursions and the passes
/// `of_lowering`.
fn count_operations(
    derivation: &Derivation,
    of_forms: usize,
    of_lowering: &'static [lower::LoweringPass],
) -> Result<[OperationCount; 2], DeriveError> {
    let mut graph = derivation.graph.clone();
    let (graph, mechanism): (&mut Graph, &Mechanism) = (&mut graph, &derivation.mechanism);
    let (equations, reduction) = (&derivation.equations, &derivation.reduction);
    // The closure lowers with these passes only.
    let mut closing = derivation.closing.clone();
    closing.limit_passes(of_lowering);
    let retained: Vec<ParameterMonomial> = reduction
        .retained
        .iter()
        .map(|k| reduction.products[*k].clone())
        .collect();
    // Base parameters take the place of the retained products.
    let base: BTreeMap<ParameterMonomial, ExprId> = retained
        .iter()
        .enumerate()
        .map(|(k, m)| (m.clone(), graph.atom(Atom::Base(k))))
        .collect();
    let value = |m: &ParameterMonomial| base.get(m).copied().unwrap_or(Graph::ZERO);
    let nothing = BTreeMap::new();
    let weigh = |graph: &mut Graph, outputs: &[ExprId]| closing.program_cost(graph, equations, outputs, &nothing);
    let search = cheapest::FormSearch {
        n_passes: of_forms,
        ..cheapest::FormSearch::NONE
    };
    let forces = cheapest::cheapest_total(graph, mechanism, equations, &value, search, &weigh)?;
    let columns = cheapest::cheapest_columns(graph, mechanism, equations, &retained, search, &weigh)?;
    let regressor: Vec<ExprId> = columns.into_iter().flatten().collect();
    Ok([forces, regressor].map(|outputs| {
        let program = closing.program(graph, equations, &outputs);
        program.count_operations(ProgramStage::State)
    }))
}
