//! Recordings of many machines of one kind, each as a small summary; summaries add, and what a robot, a day or a part says is
//! solved from their sum.
//!
//! 1. [`FleetPlan`] - how every recording is prepared and what its columns mean, made once from a few reference recordings. It is
//!    one JSON document: whoever has it, on whichever computer, makes the same summaries.
//! 2. [`FleetModel::summarise`] - one recording, its rows in any order, to a [`FleetSummary`]: triangle of the base columns, products of
//!    all columns, counts, and what was wrong. A recording that gives no answer is a summary that says so.
//! 3. [`FleetSummary::merge`] - the summary of both; associative and commutative up to rounding.
//! 4. [`FleetModel::solve`] - base parameters with deviations.
//! 5. [`robot`] - the days of one robot: when something changed and stayed changed, and which sensors died;
//!    [`outliers`] - which robots differ from the others, and in what. Neither looks at a recording again.
//!
//! No engine is needed for any of this; those that spread it over computers stand in crates beside this one.

mod bytes;
mod files;
pub mod folder;
mod ground;
mod onset;
pub mod outliers;
mod plan;
pub mod robot;
mod sensors;
mod summary;

use modelmill::print::Message;

pub use ground::{FleetFit, FleetModel};
pub use modelmill::runs::FittedValue;
pub use plan::{FleetPlan, FleetReference};
pub use sensors::{FrozenReading, SensorFault};
pub use summary::{BadRecording, FleetSummary};

/// Why something cannot be done, in one sentence with a remedy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FleetFault(Message);

impl FleetFault {
    /// A fault from anything that can say what it is.
    pub fn new(says: impl std::fmt::Display) -> Self {
        Self(says.to_string().into())
    }

    /// What is wrong, with what a front end spells in its own words.
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
