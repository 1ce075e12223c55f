//! The derivation from end to end: a mechanism goes in, equations, base parameters and programs come out.

pub(crate) mod base;
mod checks;
mod derivation;
mod for_code;

use modelmill_spec::Mechanism;

pub use derivation::Derivation;
pub use for_code::BaseFormulas;

use crate::DeriveError;
use crate::expr::Graph;
use crate::programs::cheapest::{FormSearch, PASSES};
use crate::programs::closing::PassiveClosure;
use crate::programs::programs;
use crate::reduce::{BaseReduction, reduce, without_reduction};
use crate::regressor::{UnreducedEquations, unreduced_equations};
use crate::stop::StopRequest;
use crate::tree::checks::check_values;
use crate::tree::expressions::ParameterMonomial;

/// Derives the inverse dynamics of a mechanism and reduces it to base parameters. Digits lost at the file's values are
/// not checked here.
pub(crate) fn derive(mechanism: &Mechanism, stop: StopRequest<'_>) -> Result<Derivation, DeriveError> {
    let search = FormSearch {
        n_passes: PASSES.len(),
        stop,
    };
    let derivation = derive_with(mechanism, search, |graph, equations| {
        reduce(graph, mechanism, equations, stop)
    })?;
    checks::check_results(&derivation)?;
    Ok(derivation)
}

/// Derives the columns of H for some products of parameters only, each by itself and without reduction: for effects
/// that the model may never get.
pub fn derive_columns(
    mechanism: &Mechanism,
    wanted: &dyn Fn(&ParameterMonomial) -> bool,
) -> Result<Derivation, DeriveError> {
    // Columns are evaluated once along each recording, which takes less time than a search for cheaper forms.
    derive_with(mechanism, FormSearch::NONE, |_, equations| {
        Ok(without_reduction(equations, wanted))
    })
}

/// The stages in their order. `reduce` goes from p_g to p_min, and `search` states how cheaper forms are searched.
fn derive_with(
    mechanism: &Mechanism,
    search: FormSearch<'_>,
    reduce: impl FnOnce(&mut Graph, &UnreducedEquations) -> Result<BaseReduction, DeriveError>,
) -> Result<Derivation, DeriveError> {
    check_values(mechanism)?;
    let mut graph = Graph::new();
    // Equations, reduction, closed loops, programs.
    let equations = unreduced_equations(&mut graph, mechanism)?;
    search.stop.check()?;
    let reduction = reduce(&mut graph, &equations)?;
    search.stop.check()?;
    let closing = PassiveClosure::new(&mut graph, mechanism, &equations)?;
    let programs = programs(&mut graph, mechanism, &equations, &reduction, &closing, search)?;
    Ok(Derivation {
        mechanism: mechanism.clone(),
        graph,
        reduction,
        programs,
        equations,
        closing,
    })
}
