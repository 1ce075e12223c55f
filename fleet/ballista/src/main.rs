//! `modelmill-fleet-ballista`: a fleet's aggregates over several computers. Scheduler and executors of Ballista with the functions
//! of a plan in their registries, and a client that puts a query to them.
//!
//! All of them are started with the same plan; summaries bear its mark, so that one that was started with another is found out
//! when summaries are added.
//!
//! An executor may be lost at any time. The scheduler then ends what runs ([`scheduler`]), and the client puts its query again
//! ([`client`]).

mod client;
mod scheduler;
mod stores;
mod warnings;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;

use ballista_core::config::TaskSchedulingPolicy;
use ballista_core::registry::BallistaFunctionRegistry;
use ballista_executor::executor_process::{ExecutorProcessConfig, start_executor_process};
use clap::{Parser, Subcommand};
use datafusion::prelude::SessionConfig;
use modelmill_fleet::{Fault, Ground, Plan};
use modelmill_fleet_datafusion::aggregates;

/// A fleet's aggregates over several computers.
#[derive(Parser)]
#[command(name = "modelmill-fleet-ballista", version)]
struct BallistaCli {
    /// The plan, as `modelmill-fleet plan` writes it; the same for all processes.
    #[arg(long, global = true, default_value = "plan.json")]
    plan: PathBuf,
    #[command(subcommand)]
    command: BallistaCommand,
}

#[derive(Subcommand)]
enum BallistaCommand {
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
        /// Where it keeps what goes to others, in a folder of its own that the next one does not take up.
        #[arg(long)]
        work: Option<PathBuf>,
    },
    /// Put a query to a scheduler, or answer it in this process, as CSV; structs become columns.
    Query {
        /// The query.
        sql: String,
        /// A folder of Parquet, `NAME=FOLDER`, with partitions `robot=`, `day=` and `recording=`; a path, or `s3://BUCKET/FOLDER/`
        /// with what `AWS_ACCESS_KEY_ID` and its like say; may be given again.
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
    let cli = match BallistaCli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            let status = u8::try_from(error.exit_code()).unwrap_or(2);
            let _ = error.print();
            return ExitCode::from(status);
        }
    };
    warnings::show_warnings();
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

fn load_fleet_model(path: &Path) -> Result<Arc<Ground>, Fault> {
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
pub(crate) const LONGEST_MESSAGE: u32 = 256 << 20;

async fn run(cli: BallistaCli) -> Result<(), Fault> {
    let ground = load_fleet_model(&cli.plan)?;
    match cli.command {
        BallistaCommand::Scheduler {
            host,
            port,
            timeout,
        } => scheduler::serve(&ground, &host, port, timeout).await,
        BallistaCommand::Executor {
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
            let usual = ExecutorProcessConfig::default();
            // What one that was killed has left is never handed out by the one that takes its place.
            let work = work.map(|path| path.join(&usual.executor_id));
            if let Some(work) = &work {
                std::fs::create_dir_all(work).map_err(|error| {
                    Fault::new(format!(
                        "{} cannot be made: {error}; choose another folder with `--work`",
                        work.display()
                    ))
                })?;
            }
            let spilled = work.clone();
            let runtime = move |_: &SessionConfig| stores::runtime_environment(spilled.as_deref());
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
                override_runtime_producer: Some(Arc::new(runtime)),
                ..usual
            };
            start_executor_process(Arc::new(config))
                .await
                .map_err(Fault::new)
        }
        BallistaCommand::Query {
            sql,
            tables,
            scheduler,
            partitions,
        } => {
            let asked = client::QueryRequest {
                sql: &sql,
                tables: &tables,
                scheduler: scheduler.as_deref(),
                partitions,
            };
            client::run_query(&ground, &asked).await.map_err(Fault::new)
        }
    }
}
