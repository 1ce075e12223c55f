//! The commands of `modelmill-fleet`: [`generate`] simulates a fleet with known changes, [`identify`] summarises a
//! folder of recordings and reports parameters and changes of every robot, and [`score`] compares results with the
//! known changes.

pub mod generate;
pub mod identify;
mod page;
pub mod score;
mod state;
