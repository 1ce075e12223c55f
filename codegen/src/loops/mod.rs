//! Loops are cut for the recursion and closed again here: which coordinates follow from which, in closed form where that
//! is known, and poses at which all loops are closed.

pub(crate) mod branches;
pub(crate) mod choose;
pub(crate) mod closure;
pub(crate) mod field_poses;
pub(crate) mod magnitude;
pub(crate) mod numeric_poses;
pub(crate) mod parallelogram;
pub(crate) mod plan;
pub(crate) mod planar;
pub(crate) mod spatial;
pub(crate) mod whole_root;

/// Seed of the draws: the same model gives the same text on any machine.
pub(crate) const SEED: u64 = 0x6D6F_6465_6C6D_696C;
