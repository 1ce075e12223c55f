//! Functions of DataFusion for the summaries of a fleet.
//!
//! | function | argument | result |
//! |---|---|---|
//! | `modelmill_summarise(recording, t, q..., force...)` | aggregate over samples | the summary of all recordings of a group, as bytes |
//! | `modelmill_merge(summary)` | aggregate over summaries | their sum, as bytes |
//! | `modelmill_identify(summary)` | aggregate over summaries | base parameters with standard deviations, as a struct |
//! | `modelmill_identify(recording, t, q..., force...)` | aggregate over samples | the same in one step |
//! | `modelmill_recordings('folder')` | a folder of files | a table: `robot`, `day`, `recording`, `summary`, `bad` |
//!
//! Columns after the recording's name are those of [`Ground::columns`], in that order and in SI units. Samples may come in any
//! order from any partition: the samples of a recording are sorted by time when all are there, so that the result does not depend on
//! the partitions. An aggregate over samples therefore keeps the samples of unfinished groups in memory; the table function keeps
//! one file per core.
//!
//! ```sql
//! SELECT robot, day, modelmill_identify(summary) FROM modelmill_recordings('recordings') GROUP BY robot, day;
//! SELECT robot, day, modelmill_identify(recording, t, q1, q3, motor_left, motor_right) FROM samples GROUP BY robot, day;
//! ```

mod aggregates;
mod recordings;
mod samples;

use std::sync::Arc;

use datafusion::execution::context::SessionContext;
use datafusion::logical_expr::AggregateUDF;
use modelmill_fleet::FleetModel;

pub use aggregates::{AggregateKind, FleetAggregate};
pub use recordings::RecordingsFunction;

/// All aggregates over a plan, for the function registries of schedulers and executors.
pub fn aggregates(ground: &Arc<FleetModel>) -> Vec<Arc<AggregateUDF>> {
    [AggregateKind::Summary, AggregateKind::Merged, AggregateKind::Parameters]
        .into_iter()
        .map(|answer| Arc::new(AggregateUDF::from(FleetAggregate::new(ground.clone(), answer))))
        .collect()
}

/// Registers all functions over a plan with a session.
pub fn register(session: &SessionContext, ground: &Arc<FleetModel>) {
    for function in aggregates(ground) {
        session.register_udaf(function.as_ref().clone());
    }
    session.register_udtf(
        "modelmill_recordings",
        Arc::new(RecordingsFunction::new(ground.clone())),
    );
}
