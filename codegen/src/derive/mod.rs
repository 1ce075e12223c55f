//! A mechanism goes in and everything that the mill knows about it comes out.

pub(crate) mod base;
pub(crate) mod checks;
pub(crate) mod self_test;

use modelmill_spec::Mechanism;

use crate::expr::Graph;
use crate::regressor::{self, Equations};
use crate::{DeriveError, Monomial, Programs, Reduction, programs, reduce};

/// Derives the columns of H for some products of parameters alone, each by itself and without reduction: what effects add
/// that a model may never have.
pub fn derive_columns(
    mechanism: &Mechanism,
    wanted: &dyn Fn(&Monomial) -> bool,
) -> Result<Derivation, DeriveError> {
    checks::check_values(mechanism)?;
    let mut graph = Graph::new();
    let equations = regressor::equations(&mut graph, mechanism)?;
    let reduction = reduce::unreduced(&equations.products, &equations.columns, wanted);
    let programs = programs::programs(&mut graph, mechanism, &equations, &reduction)?;
    Ok(Derivation {
        mechanism: mechanism.clone(),
        graph,
        reduction,
        programs,
        equations,
    })
}

/// Everything that the mill knows about a mechanism.
pub struct Derivation {
    /// The mechanism that was derived.
    pub mechanism: Mechanism,
    /// The arena of all expressions.
    pub graph: Graph,
    /// Which products are retained and how the others follow.
    pub reduction: Reduction,
    /// Straight-line programs, ready to be emitted or evaluated.
    pub programs: Programs,
    pub(crate) equations: Equations,
}

/// Derives the inverse dynamics of a mechanism and reduces it to base parameters, whatever these are worth at the file's
/// values.
pub(crate) fn derive(mechanism: &Mechanism) -> Result<Derivation, DeriveError> {
    checks::check_values(mechanism)?;
    let mut graph = Graph::new();
    let equations = regressor::equations(&mut graph, mechanism)?;
    let reduction = reduce::reduce(
        &mut graph,
        mechanism,
        &equations.projection,
        &equations.products,
        &equations.columns,
    )?;
    let programs = programs::programs(&mut graph, mechanism, &equations, &reduction)?;
    let derivation = Derivation {
        mechanism: mechanism.clone(),
        graph,
        reduction,
        programs,
        equations,
    };
    checks::check_results(&derivation)?;
    Ok(derivation)
}
