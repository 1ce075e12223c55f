//! What `modelmill-fleet` does: [`generate`] makes a fleet with a truth, [`identify`] sums up a folder of recordings and says what
//! every robot is and what changed, and [`score`] holds that against a truth.

pub mod generate;
pub mod identify;
mod page;
pub mod score;
mod state;
