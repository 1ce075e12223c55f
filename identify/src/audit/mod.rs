//! Faults of recordings whose numbers can all be read. Input: a recording, for some checks with a model's regressor.
//! Output: warnings about columns, clocks and signals, and estimates of delays and position faults.

mod by_channel;
mod clock;
mod columns;
mod dead_band;
mod delay;
mod late_rates;
mod positions;
mod robust;
mod signals;
mod thresholds;

pub use by_channel::ChannelRegressor;
pub use dead_band::DeadBand;
pub use delay::{DelayAudit, DelayEstimate, ForceDelays};
pub use positions::PositionFault;
pub use robust::{RobustFit, robust_fit};
