//! What is derived only for those who ask: mass matrix and forward dynamics, reactions in joints, counts of operations.

pub(crate) mod dynamics;
pub(crate) mod passes;
pub(crate) mod reactions;
