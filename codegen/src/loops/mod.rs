//! Loops are cut for the recursion and closed again here. The mechanism and its tree go in. The closure equations come
//! out, with passive coordinates in closed form where one is known, and poses at which all loops are closed.

mod all;
pub(crate) mod branches;
mod choose;
pub(crate) mod closure;
pub(crate) mod coupling;
pub(crate) mod field_poses;
pub(crate) mod independent;
pub(crate) mod magnitude;
pub(crate) mod numeric_poses;
mod parallelogram;
pub(crate) mod plan;
mod planar;
pub(crate) mod relation;
pub(crate) mod segment;
pub(crate) mod solve_step;
pub(crate) mod solved;
mod spatial;
pub(crate) mod walk;
mod whole_root;

pub(crate) use all::KinematicLoops;
