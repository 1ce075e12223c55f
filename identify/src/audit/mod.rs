//! What looks wrong with a recording although every number can be read: columns and signals by themselves, and forces
//! against a model's regressor.

mod clock;
mod columns;
mod delay_and_exchange;
mod positions;
mod signals;

pub use delay_and_exchange::{ForceAudit, ForceDelay, Suspect};
pub use positions::PositionFault;
