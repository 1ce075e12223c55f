//! What a derivation holds.

use modelmill_spec::Mechanism;

use crate::expr::Graph;
use crate::programs::Programs;
use crate::programs::closing::Closing;
use crate::reduce::Reduction;
use crate::regressor::Equations;

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
    /// How loops are closed: in which order they are solved, and what stands for the passive coordinates.
    pub(crate) closing: Closing,
}
