//! `modelmill-fleet-ballista`: the aggregates of a fleet on several computers. It has a scheduler and an executor of
//! Ballista with the functions of a plan, and a client that sends queries.
//!
//! All processes are started with the same plan. Summaries have the checksum of their plan, so a process with another
//! plan is detected when summaries are added.
//!
//! An executor may be lost at any time. The scheduler then cancels running jobs ([`scheduler`]), and the client sends
//! its query again ([`client`]).

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
use modelmill_fleet::{FleetFault, FleetModel, FleetPlan};
use modelmill_fleet_datafusion::aggregates;

/// Compute aggregates of a fleet on several computers.
#[derive(Parser)]
#[command(name = "modelmill-fleet-ballista", version)]
struct BallistaCli {
    /// The plan that `modelmill-fleet plan` wrote; the same for all processes.
    #[arg(long, global = true, default_value = "plan.json")]
    plan: PathBuf,
    /// The command to run.
    #[command(subcommand)]
    command: BallistaCommand,
}

/// The commands.
#[derive(Subcommand)]
enum BallistaCommand {
    /// Run the scheduler.
    Scheduler {
        /// Host on which it listens.
        #[arg(long, default_value = "127.0.0.1")]
        host: String,
        /// Port on which it listens.
        #[arg(long, default_value_t = 50050)]
        port: u16,
        /// Time without a message after which an executor counts as lost, s. A working executor sends a message every
        /// five seconds.
        #[arg(long, default_value_t = 20)]
        timeout: u64,
    },
    /// Run an executor.
    Executor {
        /// Host on which it listens.
        #[arg(long, default_value = "127.0.0.1")]
        host: String,
        /// Port for its data; the next port is for its tasks.
        #[arg(long, default_value_t = 50051)]
        port: u16,
        /// Host of the scheduler.
        #[arg(long, default_value = "127.0.0.1")]
        scheduler: String,
        /// Port of the scheduler.
        #[arg(long, default_value_t = 50050)]
        scheduler_port: u16,
        /// Number of tasks at a time.
        #[arg(long, default_value_t = 1)]
        tasks: usize,
        /// Folder for intermediate results. Each executor uses a new folder inside it.
        #[arg(long)]
        work: Option<PathBuf>,
    },
    /// Send a query to a scheduler, or run it in this process, and print the result as CSV; structs become columns.
    Query {
        /// The query.
        sql: String,
        /// A folder of Parquet, `NAME=FOLDER`, with partitions `robot=`, `day=` and `recording=`: a path, or
        /// `s3://BUCKET/FOLDER/` with the variables `AWS_ACCESS_KEY_ID` etc.; may be repeated.
        #[arg(long = "table", value_name = "NAME=FOLDER")]
        tables: Vec<String>,
        /// The scheduler, such as `df://127.0.0.1:50050`; without it the query runs in this process.
        #[arg(long)]
        scheduler: Option<String>,
        /// Number of partitions of the work.
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
    // Query plans are deep and planners recurse, so threads need a large stack.
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .thread_stack_size(16 << 20)
        .build();
    let done = runtime
        .map_err(FleetFault::new)
        .and_then(|runtime| runtime.block_on(run(cli)));
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(fault) => {
            eprintln!("error: {fault}");
            ExitCode::from(1)
        }
    }
}

/// Reads a plan and derives its model.
fn load_fleet_model(path: &Path) -> Result<Arc<FleetModel>, FleetFault> {
    let text = std::fs::read_to_string(path).map_err(|error| {
        FleetFault::new(format!(
            "{} cannot be read: {error}; make a plan with `modelmill-fleet plan`",
            path.display()
        ))
    })?;
    Ok(Arc::new(
        FleetPlan::parse(&path.display().to_string(), &text)?.derive_model()?,
    ))
}

/// Largest message between processes, bytes; it must have room for the samples of a recording.
pub(crate) const LONGEST_MESSAGE: u32 = 256 << 20;

/// Runs a command.
async fn run(cli: BallistaCli) -> Result<(), FleetFault> {
    let ground = load_fleet_model(&cli.plan)?;
    match cli.command {
        BallistaCommand::Scheduler { host, port, timeout } => scheduler::serve(&ground, &host, port, timeout).await,
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
            // A new folder for each executor, so that it never delivers results of a killed one.
            let work = work.map(|path| path.join(&usual.executor_id));
            if let Some(work) = &work {
                std::fs::create_dir_all(work).map_err(|error| {
                    FleetFault::new(format!(
                        "{} cannot be created: {error}; choose another folder with `--work`",
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
            start_executor_process(Arc::new(config)).await.map_err(FleetFault::new)
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
            client::run_query(&ground, &asked).await.map_err(FleetFault::new)
        }
    }
}
