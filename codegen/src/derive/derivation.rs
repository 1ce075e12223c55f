//! The result of a derivation.

use modelmill_spec::Mechanism;

use crate::expr::Graph;
use crate::programs::ModelPrograms;
use crate::programs::closing::PassiveClosure;
use crate::reduce::BaseReduction;
use crate::regressor::UnreducedEquations;

/// The equations, the reduction and the programs of a mechanism.
pub struct Derivation {
    /// The mechanism that was derived.
    pub mechanism: Mechanism,
    /// The arena of all expressions.
    pub graph: Graph,
    /// Retained products and the dependencies of all others.
    pub reduction: BaseReduction,
    /// Straight-line programs, ready to be emitted or evaluated.
    pub programs: ModelPrograms,
    /// Tree, inertia, loops and columns before reduction.
    pub(crate) equations: UnreducedEquations,
    /// The solution of the loops, which replaces the passive coordinates in programs.
    pub(crate) closing: PassiveClosure,
}
