//! The client: sends a query to a scheduler, or runs it in this process, and writes the result as CSV.
//!
//! If an executor is lost, its intermediate results are lost too. The scheduler then cancels the job, and the client
//! sends the query again. It also does so if a job is done and its results cannot be fetched any more.

use std::sync::Arc;

use ballista::prelude::SessionContextExt;
use ballista_core::execution_plans::DistributedQueryExec;
use ballista_core::extension::SessionConfigExt;
use ballista_core::serde::protobuf::GetJobStatusParams;
use ballista_core::serde::protobuf::job_status::Status;
use ballista_core::serde::protobuf::scheduler_grpc_client::SchedulerGrpcClient;
use datafusion::arrow::csv::WriterBuilder;
use datafusion::arrow::datatypes::DataType;
use datafusion::arrow::record_batch::RecordBatch;
use datafusion::dataframe::DataFrame;
use datafusion::error::{DataFusionError, Result};
use datafusion::execution::SessionStateBuilder;
use datafusion::execution::context::SessionContext;
use datafusion::physical_plan::collect;
use datafusion::prelude::SessionConfig;
use datafusion_proto::protobuf::LogicalPlanNode;
use modelmill_fleet::FleetModel;
use modelmill_fleet_datafusion::register;

use crate::stores;

/// Largest number of times that a query is sent.
const ATTEMPTS: usize = 4;

/// A query and where it runs.
pub(crate) struct QueryRequest<'a> {
    /// The query.
    pub(crate) sql: &'a str,
    /// Tables of samples, each as `NAME=FOLDER`.
    pub(crate) tables: &'a [String],
    /// URL of the scheduler; without it the query runs in this process.
    pub(crate) scheduler: Option<&'a str>,
    /// Number of partitions.
    pub(crate) partitions: usize,
}

/// Runs a query and writes the result to standard output.
///
/// Fails if the query is invalid, or the scheduler does not answer.
pub(crate) async fn run_query(ground: &Arc<FleetModel>, asked: &QueryRequest<'_>) -> Result<()> {
    // A session with the functions of the fleet and the tables.
    let session = open_session(asked).await?;
    register(&session, ground);
    for table in asked.tables {
        register_table(&session, table).await?;
    }
    let frame = flatten_structs(session.sql(asked.sql).await?)?;
    // Results of the executors, or of this process.
    let batches = match asked.scheduler {
        Some(url) => collect_answer(&frame, url).await?,
        None => frame.collect().await?,
    };
    // The header stands before the first batch only.
    let mut header = true;
    for batch in batches.iter().filter(|batch| batch.num_rows() > 0) {
        let mut writer = WriterBuilder::new().with_header(header).build(std::io::stdout());
        writer.write(batch)?;
        header = false;
    }
    Ok(())
}

/// A session of the scheduler, or of this process.
async fn open_session(asked: &QueryRequest<'_>) -> Result<SessionContext> {
    let Some(url) = asked.scheduler else {
        let config = SessionConfig::new().with_target_partitions(asked.partitions);
        return Ok(SessionContext::new_with_config_rt(
            config,
            stores::runtime_environment(None)?,
        ));
    };
    // The configuration with Ballista's own extensions.
    let config = SessionConfig::new_with_ballista().with_target_partitions(asked.partitions);
    let state = SessionStateBuilder::new()
        .with_default_features()
        .with_config(config)
        .with_runtime_env(stores::runtime_environment(None)?)
        .build();
    SessionContext::remote_with_state(url, state).await
}

/// Registers a folder of Parquet, given as `NAME=FOLDER`, as a table.
async fn register_table(session: &SessionContext, table: &str) -> Result<()> {
    let Some((name, folder)) = table.split_once('=') else {
        return Err(DataFusionError::Plan(format!(
            "`--table {table}` has no folder; write it as `--table samples=recordings/`"
        )));
    };
    // The files as a table; folders give three more columns.
    let external = format!(
        "CREATE EXTERNAL TABLE {name}_files STORED AS PARQUET PARTITIONED BY (robot, day, recording) LOCATION '{folder}'"
    );
    session.sql(&external).await?.collect().await?;
    // Partition columns have dictionary types, which shuffles between processes change to text; so they are cast to
    // text here.
    let texts = ["robot", "day", "recording"].map(|part| format!("arrow_cast({part}, 'Utf8') AS {part}"));
    let view = format!(
        "CREATE VIEW {name} AS SELECT * EXCEPT (robot, day, recording), {} FROM {name}_files",
        texts.join(", ")
    );
    session.sql(&view).await?.collect().await?;
    Ok(())
}

/// Replaces structs by their fields, because CSV has no structs.
fn flatten_structs(frame: DataFrame) -> Result<DataFrame> {
    let schema = frame.schema().clone();
    let mut columns = Vec::new();
    for (qualifier, field) in schema.iter() {
        let column = datafusion::prelude::Expr::Column((qualifier, field).into());
        if let DataType::Struct(fields) = field.data_type() {
            for inner in fields {
                let of = datafusion::functions::core::expr_fn::get_field(column.clone(), inner.name().as_str());
                columns.push(of.alias(inner.name()));
            }
        } else {
            columns.push(column);
        }
    }
    frame.select(columns)
}

/// Runs a query on the executors, and sends it again if one of them was lost.
async fn collect_answer(frame: &DataFrame, url: &str) -> Result<Vec<RecordBatch>> {
    let mut attempt = 1;
    loop {
        let plan = frame.clone().create_physical_plan().await?;
        let error = match collect(plan.clone(), Arc::new(frame.task_ctx())).await {
            Ok(batches) => return Ok(batches),
            Err(error) => error,
        };
        // The job that the scheduler assigned to the query.
        let job = plan
            .downcast_ref::<DistributedQueryExec<LogicalPlanNode>>()
            .and_then(DistributedQueryExec::job_id);
        // Without a job the query is invalid or the scheduler does not answer; sending it again does not help.
        let Some(job) = job else {
            return Err(error);
        };
        if !was_executor_lost(url, job.into()).await? {
            return Err(error);
        }
        if attempt == ATTEMPTS {
            return Err(DataFusionError::Execution(format!(
                "executors were lost {ATTEMPTS} times during this query; find the reason in their logs, then run it again; last \
                 error: {error}"
            )));
        }
        log::warn!("the query is sent again, because an executor was lost: {error}");
        attempt += 1;
    }
}

/// Whether a job failed because an executor was lost: the scheduler cancelled it, or results of an earlier stage could
/// not be fetched, or the job is done and its results are lost.
async fn was_executor_lost(url: &str, job_id: String) -> Result<bool> {
    let fault = |error: &dyn std::fmt::Display| {
        DataFusionError::Execution(format!(
            "the scheduler does not report the state of the query: {error}; check that it runs, then run the query again"
        ))
    };
    // Ask the scheduler for the state of the job.
    let http = url.replacen("df://", "http://", 1);
    let mut scheduler = SchedulerGrpcClient::connect(http)
        .await
        .map_err(|error| fault(&error))?;
    let told = scheduler
        .get_job_status(GetJobStatusParams { job_id })
        .await
        .map_err(|error| fault(&error))?;
    Ok(match told.into_inner().status.and_then(|told| told.status) {
        Some(Status::Successful(_)) => true,
        Some(Status::Failed(job)) => job.error == "Cancelled" || job.error.contains("most recent failure reason"),
        _ => false,
    })
}
