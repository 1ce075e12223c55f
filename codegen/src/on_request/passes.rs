//! What every pass saves: operations of inverse dynamics and base regressor after each.

use std::collections::BTreeMap;

use modelmill_spec::Mechanism;

use crate::expr::{Atom, ExprId, Graph};
use crate::lower::{OperationCount, Stage};
use crate::programs::cheapest;
use crate::tree::expressions::Monomial;
use crate::{Derivation, DeriveError, lower};

/// Operations per state after a pass and all before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PassCount {
    /// What the pass does.
    pub pass: &'static str,
    /// Of the inverse dynamics with base parameters.
    pub inverse_dynamics: OperationCount,
    /// Of the base regressor.
    pub regressor: OperationCount,
}

impl Derivation {
    /// Operations of the programs pass by pass, from the plain recursion on, in which equal expressions are computed once.
    /// A pass of the recursions is used only where it pays; the last line is what is emitted.
    ///
    /// # Errors
    /// As [`crate::derive`].
    pub fn operations_by_pass(&self) -> Result<Vec<PassCount>, DeriveError> {
        let mut counts = Vec::new();
        let plain = ["plain recursion, equal expressions once"];
        let names = plain.iter().chain(&cheapest::PASSES).chain(&lower::PASSES);
        for (n, pass) in names.enumerate() {
            let of_forms = n.min(cheapest::PASSES.len());
            let [inverse_dynamics, regressor] = counted(self, of_forms, n - of_forms)?;
            counts.push(PassCount {
                pass,
                inverse_dynamics,
                regressor,
            });
        }
        Ok(counts)
    }
}

/// Operations of inverse dynamics and base regressor with so many passes of the recursions and of lowering.
fn counted(
    derivation: &Derivation,
    of_forms: usize,
    of_lowering: usize,
) -> Result<[OperationCount; 2], DeriveError> {
    let mut graph = derivation.graph.clone();
    let (graph, mechanism): (&mut Graph, &Mechanism) = (&mut graph, &derivation.mechanism);
    let (equations, reduction) = (&derivation.equations, &derivation.reduction);
    let mut closing = derivation.closing.clone();
    closing.limit_passes(of_lowering);
    let retained: Vec<Monomial> = reduction
        .retained
        .iter()
        .map(|k| reduction.products[*k].clone())
        .collect();
    let base: BTreeMap<Monomial, ExprId> = retained
        .iter()
        .enumerate()
        .map(|(k, m)| (m.clone(), graph.atom(Atom::Base(k))))
        .collect();
    let value = |m: &Monomial| base.get(m).copied().unwrap_or(Graph::ZERO);
    let nothing = BTreeMap::new();
    let weigh =
        |graph: &mut Graph, outputs: &[ExprId]| closing.weight(graph, equations, outputs, &nothing);
    let forces = cheapest::total(graph, mechanism, equations, &value, of_forms, &weigh)?;
    let columns = cheapest::columns(graph, mechanism, equations, &retained, of_forms, &weigh)?;
    let regressor: Vec<ExprId> = columns.into_iter().flatten().collect();
    Ok([forces, regressor].map(|outputs| {
        let program = closing.program(graph, equations, &outputs);
        program.count(Stage::State)
    }))
}
