//! This machine as the surroundings of a sitting: its disk behind a fence, its clock, threads.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use modelmill::files::{self, FileSource};
use serde_json::Value;
use tokio::sync::watch;

use crate::fence::FileAccessPolicy;
use crate::surroundings::SessionEnvironment;

/// Bytes of stack for long work, as the program itself has.
pub(crate) const STACK: usize = 16 << 20;

/// This machine, as far as a sitting may use it.
pub(crate) struct LocalMachine {
    fence: Arc<FileAccessPolicy>,
    since: Instant,
    changes: watch::Sender<u64>,
}

impl LocalMachine {
    /// Files come through the fence.
    pub(crate) fn new(fence: Arc<FileAccessPolicy>) -> Self {
        Self {
            fence,
            since: Instant::now(),
            changes: watch::channel(0).0,
        }
    }

    /// The last version that pages should hear of.
    pub(crate) fn changes(&self) -> watch::Receiver<u64> {
        self.changes.subscribe()
    }
}

impl SessionEnvironment for LocalMachine {
    fn files(&self) -> Arc<dyn FileSource> {
        Arc::clone(&self.fence) as _
    }

    fn write(&self, path: &Path, bytes: &[u8]) -> Result<(), String> {
        files::write(path, bytes).map_err(|error| error.to_string())
    }

    fn seconds(&self) -> f64 {
        self.since.elapsed().as_secs_f64()
    }

    fn notify_change(&self, version: u64) {
        self.changes.send_replace(version);
    }

    fn report_progress(&self, _: &Value) {
        // Pages ask how far it is.
    }

    fn spawn_work(&self, work: Box<dyn FnOnce() + Send>) -> Result<(), String> {
        let thread = std::thread::Builder::new().name("diagnosis".to_owned());
        let begun = thread.stack_size(STACK).spawn(work);
        begun.map(|_| ()).map_err(|error| error.to_string())
    }
}
