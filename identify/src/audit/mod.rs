//! What looks wrong with a recording although every number can be read: columns and signals by themselves, and forces
//! against a model's regressor.

mod columns;
mod signals;
mod suspects;

pub use suspects::{ForceAudit, ForceDelay, Suspect};
