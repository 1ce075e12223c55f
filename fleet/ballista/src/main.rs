//! `modelmill-fleet-ballista`: a fleet's aggregates over several computers. Scheduler and executors of Ballista with the functions
//! of a plan in their registries, and a client that puts a query to them.
//!
//! All of them are started with the same plan; summaries bear its mark, so that one that was started with another is found out
//! when summaries are added.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;

use ballista::prelude::SessionContextExt;
use ballista_core::config::TaskSchedulingPolicy;
use ballista_core::extension::SessionConfigExt;
use ballista_core::registry::BallistaFunctionRegistry;
use ballista_core::utils::default_session_builder;
use ballista_executor::executor_process::{ExecutorProcessConfig, start_executor_process};
use ballista_scheduler::cluster::BallistaCluster;
use ballista_scheduler::config::SchedulerConfig;
use ballista_scheduler::scheduler_process::start_server;
use clap::{Parser, Subcommand};
use datafusion::arrow::csv::WriterBuilder;
use datafusion::error::DataFusionError;
use datafusion::execution::SessionStateBuilder;
use datafusion::execution::context::SessionContext;
use datafusion::prelude::SessionConfig;
use modelmill_fleet::{Fault, Ground, Plan};
use modelmill_fleet_datafusion::{aggregates, register};

/// A fleet's aggregates over several computers.
#[derive(Parser)]
#[command(name = "modelmill-fleet-ballista", version)]
struct Cli {
    /// The plan, as `modelmill-fleet plan` writes it; the same for all processes.
    #[arg(long, global = true, default_value = "plan.json")]
    plan: PathBuf,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// The scheduler.
    Scheduler {
        /// Host that it listens on.
        #[arg(long, default_value = "127.0.0.1")]
        host: String,
        /// Its port.
        #[arg(long, default_value_t = 50050)]
        port: u16,
        /// An executor that is not heard of for so long is taken for dead, s; one that works is heard of every five.
        #[arg(long, default_value_t = 20)]
        timeout: u64,
    },
    /// An executor.
    Executor {
        /// Host that it listens on.
        #[arg(long, default_value = "127.0.0.1")]
        host: String,
        /// Port of its data; the next one is for its tasks.
        #[arg(long, default_value_t = 50051)]
        port: u16,
        /// Host of the scheduler.
        #[arg(long, default_value = "127.0.0.1")]
        scheduler: String,
        /// Port of the scheduler.
        #[arg(long, default_value_t = 50050)]
        scheduler_port: u16,
        /// Tasks at a time.
        #[arg(long, default_value_t = 1)]
        tasks: usize,
        /// Where it keeps what goes to others.
        #[arg(long)]
        work: Option<PathBuf>,
    },
    /// Put a query to a scheduler, or answer it in this process, as CSV; structs become columns.
    Query {
        /// The query.
        sql: String,
        /// A folder of Parquet, `NAME=FOLDER`, with partitions `robot=`, `day=` and `recording=`; may be given again.
        #[arg(long = "table", value_name = "NAME=FOLDER")]
        tables: Vec<String>,
        /// The scheduler, such as `df://127.0.0.1:50050`; this process where it is not given.
        #[arg(long)]
        scheduler: Option<String>,
        /// Into how many partitions the work falls.
        #[arg(long, default_value_t = 4)]
        partitions: usize,
    },
}

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            let status = u8::try_from(error.exit_code()).unwrap_or(2);
            let _ = error.print();
            return ExitCode::from(status);
        }
    };
    // Plans are deep, and planners recurse.
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .thread_stack_size(16 << 20)
        .build();
    let done = runtime
        .map_err(Fault::new)
        .and_then(|runtime| runtime.block_on(run(cli)));
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(fault) => {
            eprintln!("error: {fault}");
            ExitCode::from(1)
        }
    }
}

fn ground(path: &Path) -> Result<Arc<Ground>, Fault> {
    let text = std::fs::read_to_string(path).map_err(|error| {
        Fault::new(format!(
            "{} cannot be read: {error}; make a plan with `modelmill-fleet plan`",
            path.display()
        ))
    })?;
    Ok(Arc::new(
        Plan::parse(&path.display().to_string(), &text)?.ground()?,
    ))
}

/// Samples of a recording are long: messages between processes may be so large, in bytes.
const LONGEST_MESSAGE: u32 = 256 << 20;

async fn run(cli: Cli) -> Result<(), Fault> {
    let ground = ground(&cli.plan)?;
    match cli.command {
        Command::Scheduler {
            host,
            port,
            timeout,
        } => scheduler(&ground, &host, port, timeout).await,
        Command::Executor {
            host,
            port,
            scheduler,
            scheduler_port,
            tasks,
            work,
        } => {
            let mut registry = BallistaFunctionRegistry::default();
            for function in aggregates(&ground) {
                registry
                    .aggregate_functions
                    .insert(function.name().to_owned(), function);
            }
            let longest = LONGEST_MESSAGE;
            let config = ExecutorProcessConfig {
                bind_host: host,
                port,
                grpc_port: port + 1,
                scheduler_host: scheduler,
                scheduler_port,
                scheduler_connect_timeout_seconds: 30,
                vcores: tasks,
                work_dir: work.map(|path| path.display().to_string()),
                task_scheduling_policy: TaskSchedulingPolicy::PullStaged,
                grpc_max_decoding_message_size: longest,
                grpc_max_encoding_message_size: longest,
                override_function_registry: Some(Arc::new(registry)),
                ..ExecutorProcessConfig::default()
            };
            start_executor_process(Arc::new(config))
                .await
                .map_err(Fault::new)
        }
        Command::Query {
            sql,
            tables,
            scheduler,
            partitions,
        } => query(&ground, &sql, &tables, scheduler.as_deref(), partitions)
            .await
            .map_err(Fault::new),
    }
}

async fn scheduler(ground: &Arc<Ground>, host: &str, port: u16, timeout: u64) -> Result<(), Fault> {
    let functions = ground.clone();
    let session = move |config: SessionConfig| {
        let state = default_session_builder(config)?;
        let known = state.aggregate_functions().values().cloned();
        let all = known.chain(aggregates(&functions)).collect();
        Ok(SessionStateBuilder::new_from_existing(state)
            .with_aggregate_functions(all)
            .build())
    };
    let config = SchedulerConfig {
        bind_host: host.to_owned(),
        external_host: host.to_owned(),
        bind_port: port,
        // Executors ask for work, and whoever asks is alive: tasks of one that asks no more go to the others.
        scheduling_policy: TaskSchedulingPolicy::PullStaged,
        executor_timeout_seconds: timeout,
        expire_dead_executor_interval_seconds: (timeout / 4).max(1),
        grpc_server_max_decoding_message_size: LONGEST_MESSAGE,
        grpc_server_max_encoding_message_size: LONGEST_MESSAGE,
        grpc_client_max_message_size: LONGEST_MESSAGE,
        override_session_builder: Some(Arc::new(session)),
        ..SchedulerConfig::default()
    };
    let address = format!("{host}:{port}").parse().map_err(|error| {
        Fault::new(format!(
            "`{host}:{port}` is no address: {error}; give a number such as 127.0.0.1"
        ))
    })?;
    let cluster = BallistaCluster::new_from_config(&config)
        .await
        .map_err(Fault::new)?;
    start_server(cluster, address, Arc::new(config))
        .await
        .map_err(Fault::new)
}

async fn query(
    ground: &Arc<Ground>,
    sql: &str,
    tables: &[String],
    scheduler: Option<&str>,
    partitions: usize,
) -> Result<(), DataFusionError> {
    let session = match scheduler {
        Some(url) => {
            let config = SessionConfig::new_with_ballista().with_target_partitions(partitions);
            let state = SessionStateBuilder::new()
                .with_default_features()
                .with_config(config)
                .build();
            SessionContext::remote_with_state(url, state).await?
        }
        None => {
            SessionContext::new_with_config(SessionConfig::new().with_target_partitions(partitions))
        }
    };
    register(&session, ground);
    for table in tables {
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
        let texts = ["robot", "day", "recording"]
            .map(|part| format!("arrow_cast({part}, 'Utf8') AS {part}"));
        let view = format!(
            "CREATE VIEW {name} AS SELECT * EXCEPT (robot, day, recording), {} FROM {name}_files",
            texts.join(", ")
        );
        session.sql(&view).await?.collect().await?;
    }
    let frame = session.sql(sql).await?;
    // A struct has no place in CSV; its fields have.
    let schema = frame.schema().clone();
    let mut columns = Vec::new();
    for (qualifier, field) in schema.iter() {
        let column = datafusion::prelude::Expr::Column((qualifier, field).into());
        if let datafusion::arrow::datatypes::DataType::Struct(fields) = field.data_type() {
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
    let batches = frame.select(columns)?.collect().await?;
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
