//! A fleet's summaries as functions of DataFusion.
//!
//! | function | of | gives |
//! |---|---|---|
//! | `modelmill_summarise(recording, t, q..., force...)` | aggregate over samples | the summary of all recordings of a group, as bytes |
//! | `modelmill_merge(summary)` | aggregate over summaries | their sum, as bytes |
//! | `modelmill_identify(summary)` | aggregate over summaries | base parameters with deviations, as a struct |
//! | `modelmill_identify(recording, t, q..., force...)` | aggregate over samples | the same in one step |
//! | `modelmill_recordings('folder')` | a folder of files | a table: `robot`, `day`, `recording`, `summary`, `bad` |
//!
//! Columns behind the recording's name are those of [`Ground::columns`], in that order and in SI units. Samples may come in any
//! order from any partition: those of a recording are put in the order of time when all are there, so that the same data gives the
//! same result whatever the partitioning. An aggregate over samples therefore holds the samples of the groups that are not
//! finished; the table function holds one file for each core and no more.
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
use modelmill_fleet::Ground;

pub use aggregates::{AggregateKind, FleetAggregate};
pub use recordings::RecordingsFunction;

/// All aggregates over a plan, by which function registries of schedulers and executors are filled.
pub fn aggregates(ground: &Arc<Ground>) -> Vec<Arc<AggregateUDF>> {
    [AggregateKind::Summary, AggregateKind::Merged, AggregateKind::Parameters]
        .into_iter()
        .map(|answer| Arc::new(AggregateUDF::from(FleetAggregate::new(ground.clone(), answer))))
        .collect()
}

/// Registers all functions over a plan with a session.
pub fn register(session: &SessionContext, ground: &Arc<Ground>) {
    for function in aggregates(ground) {
        session.register_udaf(function.as_ref().clone());
    }
    session.register_udtf(
        "modelmill_recordings",
        Arc::new(RecordingsFunction::new(ground.clone())),
    );
}
