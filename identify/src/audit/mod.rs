//! What looks wrong with a recording although every number can be read: columns and signals by themselves, and forces
//! against a model's regressor.

mod by_channel;
mod clock;
mod columns;
mod delay;
mod exchange;
mod positions;
mod robust;
mod signals;

pub use by_channel::ChannelRegressor;
pub use delay::{DelayAudit, DelayEstimate, ForceDelays};
pub use exchange::{ForceAudit, WiringFault};
pub use positions::PositionFault;
pub use robust::{RobustFit, robust_fit};
