//! What a derivation holds.

use modelmill_spec::Mechanism;

use crate::expr::Graph;
use crate::programs::ModelPrograms;
use crate::programs::closing::PassiveClosure;
use crate::reduce::BaseReduction;
use crate::regressor::UnreducedEquations;

/// Everything that the mill knows about a mechanism.
pub struct Derivation {
    /// The mechanism that was derived.
    pub mechanism: Mechanism,
    /// The arena of all expressions.
    pub graph: Graph,
    /// Which products are retained and how the others follow.
    pub reduction: BaseReduction,
    /// Straight-line programs, ready to be emitted or evaluated.
    pub programs: ModelPrograms,
    pub(crate) equations: UnreducedEquations,
    /// How loops are closed: in which order they are solved, and what stands for the passive coordinates.
    pub(crate) closing: PassiveClosure,
}
