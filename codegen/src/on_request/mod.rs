//! Programs that are derived only on request: equation of motion and forward dynamics, reactions in joints, counts of
//! operations.

pub(crate) mod dynamics;
pub(crate) mod passes;
pub(crate) mod reactions;
