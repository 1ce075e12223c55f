//! The scheduler. If an executor is lost, it cancels all running jobs, and clients send their queries again.
//!
//! Ballista 55 would continue such a job, and its result may be wrong: a stage that is repeated because it lost its
//! input does not remove what it had already delivered, so groups occur twice. (Its adaptive planner does not continue
//! at all: it "does not cover executor failure".) So no stage is ever repeated here. A job is cancelled as soon as
//! results cannot be fetched, and before Ballista removes an executor that is lost or stops.

use std::collections::{HashMap, HashSet};
use std::net::SocketAddr;
use std::sync::Arc;

use async_trait::async_trait;
use ballista_core::JobId;
use ballista_core::config::TaskSchedulingPolicy;
use ballista_core::error::Result;
use ballista_core::extension::SessionConfigExt;
use ballista_core::serde::protobuf::job_status::Status;
use ballista_core::serde::protobuf::scheduler_grpc_client::SchedulerGrpcClient;
use ballista_core::serde::protobuf::{CancelJobParams, ExecutorHeartbeat};
use ballista_core::serde::scheduler::{ExecutorData, ExecutorMetadata};
use ballista_core::utils::{default_config_producer, default_session_builder};
use ballista_scheduler::cluster::memory::{InMemoryClusterState, InMemoryJobState};
use ballista_scheduler::cluster::{
    BallistaCluster, BoundTask, ClusterState, ClusterStateEventStream, ExecutorSlot, JobState,
};
use ballista_scheduler::config::{SchedulerConfig, TaskDistributionPolicy};
use ballista_scheduler::scheduler_process::start_server;
use ballista_scheduler::state::task_manager::JobInfoCache;
use datafusion::execution::SessionStateBuilder;
use datafusion::prelude::SessionConfig;
use modelmill_fleet::{FleetFault, FleetModel};
use modelmill_fleet_datafusion::aggregates;

use crate::{LONGEST_MESSAGE, stores};

/// Serves until the process ends. Executors without a message for `timeout` seconds count as lost.
///
/// Fails if it cannot listen on the address.
pub(crate) async fn serve(
    ground: &Arc<FleetModel>,
    host: &str,
    port: u16,
    timeout: u64,
) -> std::result::Result<(), FleetFault> {
    let functions = ground.clone();
    // Sessions of the scheduler know the functions of the fleet.
    let session = move |config: SessionConfig| {
        let state = default_session_builder(config.with_ballista_adaptive_query_planner(false))?;
        let known = state.aggregate_functions().values().cloned();
        let all = known.chain(aggregates(&functions)).collect();
        Ok(SessionStateBuilder::new_from_existing(state)
            .with_aggregate_functions(all)
            .with_runtime_env(stores::runtime_environment(None)?)
            .build())
    };
    let config = SchedulerConfig {
        bind_host: host.to_owned(),
        external_host: host.to_owned(),
        bind_port: port,
        // Executors request work, and each request shows that they are alive.
        scheduling_policy: TaskSchedulingPolicy::PullStaged,
        executor_timeout_seconds: timeout,
        expire_dead_executor_interval_seconds: (timeout / 4).max(1),
        grpc_server_max_decoding_message_size: LONGEST_MESSAGE,
        grpc_server_max_encoding_message_size: LONGEST_MESSAGE,
        grpc_client_max_message_size: LONGEST_MESSAGE,
        // A job is cancelled if results cannot be fetched.
        stage_max_failures: 1,
        override_session_builder: Some(Arc::new(session)),
        ..SchedulerConfig::default()
    };
    // Names of hosts are not resolved here.
    let address = format!("{host}:{port}").parse().map_err(|error| {
        FleetFault::new(format!(
            "`{host}:{port}` is not an address: {error}; give a numeric host such as 127.0.0.1"
        ))
    })?;
    let session = config.override_session_builder.clone();
    let jobs = Arc::new(InMemoryJobState::new(
        config.scheduler_id.clone(),
        session.unwrap_or_else(|| Arc::new(default_session_builder)),
        Arc::new(default_config_producer),
    ));
    // Jobs and executors are in memory; a restart of the scheduler loses them.
    let cluster = ExecutorCluster {
        known: InMemoryClusterState::default(),
        jobs: jobs.clone(),
        address,
    };
    start_server(BallistaCluster::new(Arc::new(cluster), jobs), address, Arc::new(config))
        .await
        .map_err(FleetFault::new)
}

/// Ballista's state of the executors, extended: the loss of an executor cancels all running jobs.
struct ExecutorCluster {
    /// Ballista's own state, to which all calls are forwarded.
    known: InMemoryClusterState,
    /// The jobs of the scheduler.
    jobs: Arc<dyn JobState>,
    /// Address of the scheduler itself.
    address: SocketAddr,
}

impl ExecutorCluster {
    /// Cancels all running jobs and returns their number. The scheduler has processed the requests when this returns.
    async fn end_jobs(&self) -> std::result::Result<usize, FleetFault> {
        // All jobs that run, in a fixed sequence.
        let mut running = Vec::new();
        let all = self.jobs.get_all_jobs().await.map_err(FleetFault::new)?;
        let mut all: Vec<JobId> = all.into_iter().collect();
        all.sort_by_key(JobId::to_string);
        for job in all {
            let told = self.jobs.get_job_status(&job).await.map_err(FleetFault::new)?;
            if matches!(told.and_then(|told| told.status), Some(Status::Running(_))) {
                running.push(job);
            }
        }
        if running.is_empty() {
            return Ok(0);
        }
        // Cancel them by the scheduler's own interface.
        let mut scheduler = SchedulerGrpcClient::connect(format!("http://{}", self.address))
            .await
            .map_err(FleetFault::new)?;
        for job in &running {
            let ended = CancelJobParams {
                job_id: job.to_string(),
            };
            scheduler.cancel_job(ended).await.map_err(FleetFault::new)?;
        }
        Ok(running.len())
    }
}

#[async_trait]
impl ClusterState for ExecutorCluster {
    /// Cancels all running jobs before Ballista removes an executor.
    async fn remove_executor(&self, executor_id: &str) -> Result<()> {
        match self.end_jobs().await {
            Ok(ended) => {
                log::warn!("executor {executor_id} is lost; {ended} jobs are cancelled, and clients send them again");
            }
            // Without cancelling, a result could be wrong; it is better to give none.
            Err(fault) => {
                log::error!(
                    "executor {executor_id} is lost, and jobs cannot be cancelled: {fault}; the scheduler stops"
                );
                std::process::exit(1);
            }
        }
        self.known.remove_executor(executor_id).await
    }

    async fn init(&self) -> Result<()> {
        self.known.init().await
    }

    async fn bind_schedulable_tasks(
        &self,
        distribution: TaskDistributionPolicy,
        active_jobs: Arc<HashMap<JobId, JobInfoCache>>,
        executors: Option<HashSet<String>>,
    ) -> Result<Vec<BoundTask>> {
        self.known
            .bind_schedulable_tasks(distribution, active_jobs, executors)
            .await
    }

    async fn unbind_tasks(&self, executor_slots: Vec<ExecutorSlot>) -> Result<()> {
        self.known.unbind_tasks(executor_slots).await
    }

    async fn register_executor(&self, metadata: ExecutorMetadata, spec: ExecutorData) -> Result<()> {
        self.known.register_executor(metadata, spec).await
    }

    async fn save_executor_metadata(&self, metadata: ExecutorMetadata) -> Result<()> {
        self.known.save_executor_metadata(metadata).await
    }

    async fn get_executor_metadata(&self, executor_id: &str) -> Result<ExecutorMetadata> {
        self.known.get_executor_metadata(executor_id).await
    }

    async fn registered_executor_metadata(&self) -> Vec<ExecutorMetadata> {
        self.known.registered_executor_metadata().await
    }

    async fn save_executor_heartbeat(&self, heartbeat: ExecutorHeartbeat) -> Result<()> {
        self.known.save_executor_heartbeat(heartbeat).await
    }

    fn executor_heartbeats(&self) -> HashMap<String, ExecutorHeartbeat> {
        self.known.executor_heartbeats()
    }

    fn get_executor_heartbeat(&self, executor_id: &str) -> Option<ExecutorHeartbeat> {
        self.known.get_executor_heartbeat(executor_id)
    }

    async fn cluster_state_events(&self) -> Result<ClusterStateEventStream> {
        self.known.cluster_state_events().await
    }
}
