//! The client: a query to a scheduler, or in this process, as CSV.
//!
//! What an executor keeps goes with it. The scheduler then ends the job, and the query is put again; so it is where a job was done
//! and its results cannot be fetched any more.

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
use modelmill_fleet::Ground;
use modelmill_fleet_datafusion::register;

use crate::stores;

/// A query is put so often at most.
const ATTEMPTS: usize = 4;

/// What is asked, and of whom.
pub(crate) struct QueryRequest<'a> {
    pub(crate) sql: &'a str,
    /// `NAME=FOLDER` each.
    pub(crate) tables: &'a [String],
    /// This process answers where there is none.
    pub(crate) scheduler: Option<&'a str>,
    pub(crate) partitions: usize,
}

/// Writes the answer to standard output.
///
/// Fails where the query has no meaning, or nobody can answer it.
pub(crate) async fn run_query(ground: &Arc<Ground>, asked: &QueryRequest<'_>) -> Result<()> {
    let session = open_session(asked).await?;
    register(&session, ground);
    for table in asked.tables {
        register_table(&session, table).await?;
    }
    let frame = flatten_structs(session.sql(asked.sql).await?)?;
    let batches = match asked.scheduler {
        Some(url) => collect_answer(&frame, url).await?,
        None => frame.collect().await?,
    };
    let mut header = true;
    for batch in batches.iter().filter(|batch| batch.num_rows() > 0) {
        let mut writer = WriterBuilder::new()
            .with_header(header)
            .build(std::io::stdout());
        writer.write(batch)?;
        header = false;
    }
    Ok(())
}

async fn open_session(asked: &QueryRequest<'_>) -> Result<SessionContext> {
    let Some(url) = asked.scheduler else {
        let config = SessionConfig::new().with_target_partitions(asked.partitions);
        return Ok(SessionContext::new_with_config_rt(
            config,
            stores::runtime_environment(None)?,
        ));
    };
    let config = SessionConfig::new_with_ballista().with_target_partitions(asked.partitions);
    let state = SessionStateBuilder::new()
        .with_default_features()
        .with_config(config)
        .with_runtime_env(stores::runtime_environment(None)?)
        .build();
    SessionContext::remote_with_state(url, state).await
}

async fn register_table(session: &SessionContext, table: &str) -> Result<()> {
    let Some((name, folder)) = table.split_once('=') else {
        return Err(DataFusionError::Plan(format!(
            "`--table {table}` names no folder; write it as `--table samples=recordings/`"
        )));
    };
    let external = format!(
        "CREATE EXTERNAL TABLE {name}_files STORED AS PARQUET PARTITIONED BY (robot, day, recording) LOCATION '{folder}'"
    );
    session.sql(&external).await?.collect().await?;
    // Parts of paths are dictionaries, which shuffles between processes unpack: groups must be texts from the start.
    let texts =
        ["robot", "day", "recording"].map(|part| format!("arrow_cast({part}, 'Utf8') AS {part}"));
    let view = format!(
        "CREATE VIEW {name} AS SELECT * EXCEPT (robot, day, recording), {} FROM {name}_files",
        texts.join(", ")
    );
    session.sql(&view).await?.collect().await?;
    Ok(())
}

/// The fields of structs as columns, since a struct has no place in CSV.
fn flatten_structs(frame: DataFrame) -> Result<DataFrame> {
    let schema = frame.schema().clone();
    let mut columns = Vec::new();
    for (qualifier, field) in schema.iter() {
        let column = datafusion::prelude::Expr::Column((qualifier, field).into());
        if let DataType::Struct(fields) = field.data_type() {
            for inner in fields {
                let of = datafusion::functions::core::expr_fn::get_field(
                    column.clone(),
                    inner.name().as_str(),
                );
                columns.push(of.alias(inner.name()));
            }
        } else {
            columns.push(column);
        }
    }
    frame.select(columns)
}

/// The answer of executors, put again where one of them was lost.
async fn collect_answer(frame: &DataFrame, url: &str) -> Result<Vec<RecordBatch>> {
    let mut attempt = 1;
    loop {
        let plan = frame.clone().create_physical_plan().await?;
        let error = match collect(plan.clone(), Arc::new(frame.task_ctx())).await {
            Ok(batches) => return Ok(batches),
            Err(error) => error,
        };
        let job = plan
            .downcast_ref::<DistributedQueryExec<LogicalPlanNode>>()
            .and_then(DistributedQueryExec::job_id);
        // What has not become a job has no meaning, or there is no scheduler.
        let Some(job) = job else {
            return Err(error);
        };
        if !was_executor_lost(url, job.into()).await? {
            return Err(error);
        }
        if attempt == ATTEMPTS {
            return Err(DataFusionError::Execution(format!(
                "executors were lost {ATTEMPTS} times while they were at this query; see what ends them, then put it again; at last: \
                 {error}"
            )));
        }
        log::warn!("the query is put again, since an executor was lost: {error}");
        attempt += 1;
    }
}

/// Whether a job of which there is no answer would have one if all executors had stayed: the scheduler ended it, for itself or since
/// results of an earlier stage could not be fetched, or says that it is done.
async fn was_executor_lost(url: &str, job_id: String) -> Result<bool> {
    let fault = |error: &dyn std::fmt::Display| {
        DataFusionError::Execution(format!(
            "the scheduler does not say what became of the query: {error}; see whether it runs, then put the query again"
        ))
    };
    let http = url.replacen("df://", "http://", 1);
    let mut scheduler = SchedulerGrpcClient::connect(http)
        .await
        .map_err(|error| fault(&error))?;
    let told = scheduler
        .get_job_status(GetJobStatusParams { job_id })
        .await
        .map_err(|error| fault(&error))?;
    Ok(
        match told.into_inner().status.and_then(|told| told.status) {
            Some(Status::Successful(_)) => true,
            Some(Status::Failed(job)) => {
                job.error == "Cancelled" || job.error.contains("most recent failure reason")
            }
            _ => false,
        },
    )
}
