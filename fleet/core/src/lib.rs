//! Evaluates recordings of many machines of one kind. Each recording becomes a small summary with additive statistics;
//! the parameters of a robot, a day or a part are solved from the sum of its summaries.
//!
//! 1. [`FleetPlan`]: how every recording is prepared and what its columns mean, made once from a few reference
//!    recordings. It is one JSON document; with the same plan, every computer makes the same summaries.
//! 2. [`FleetModel::summarise`]: one recording, its rows in any order, to a [`FleetSummary`]: R factor of the base
//!    columns, products of all columns, counts, and faults. A recording that cannot be evaluated gives a summary with
//!    the reason.
//! 3. [`FleetSummary::merge`]: adds summaries; associative and commutative up to rounding.
//! 4. [`FleetModel::solve`]: base parameters with standard deviations.
//! 5. [`robot`]: the days of one robot, with permanent changes and dead sensors. [`outliers`]: which robots differ from
//!    the others, and in what. Neither reads a recording again.
//!
//! This needs no query engine; crates for engines on several computers are next to this one.

mod bytes;
mod files;
mod fleet_model;
pub mod folder;
mod onset;
pub mod outliers;
mod plan;
pub mod robot;
mod sensors;
mod summary;

use modelmill::print::Message;

pub use fleet_model::{FleetFit, FleetModel};
pub use modelmill::runs::FittedValue;
pub use plan::{FleetPlan, FleetReference};
pub use sensors::{FrozenReading, SensorFault};
pub use summary::{BadRecording, FleetSummary};

/// A fault: one sentence with the reason and a remedy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FleetFault(Message);

impl FleetFault {
    /// A fault with a text.
    pub fn new(says: impl std::fmt::Display) -> Self {
        Self(says.to_string().into())
    }

    /// The message, in which a front end writes options and commands in its own way.
    pub fn message(&self) -> &Message {
        &self.0
    }
}

impl std::fmt::Display for FleetFault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0.in_library_words())
    }
}

impl std::error::Error for FleetFault {}

impl From<modelmill::Error> for FleetFault {
    fn from(error: modelmill::Error) -> Self {
        Self(error.message())
    }
}
