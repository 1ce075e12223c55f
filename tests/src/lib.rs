//! What the tests and benchmarks of the workspace share.
//!
//! [`fixtures`] finds models and reference tables, [`random`] builds mechanisms from a seed, [`mechanics`] is a second
//! opinion on their dynamics that shares no code with the mill, and [`published`] reads regroupings from the literature
//! as exact linear maps.

pub mod balances;
pub mod base_parameters;
pub mod callgrind;
pub mod counts;
pub mod drawn_states;
pub mod equation_of_motion;
pub mod fixtures;
pub mod free_bodies;
pub mod infix;
pub mod laws;
pub mod mechanics;
pub mod published;
pub mod random;
pub mod rank;
pub mod sample;
pub mod scaled;
pub mod stream;
