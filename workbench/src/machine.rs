//! This machine as the surroundings of a sitting: its disk behind a fence, its clock, threads.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use modelmill::files::{self, Files};
use serde_json::Value;
use tokio::sync::watch;

use crate::fence::Fence;
use crate::surroundings::Surroundings;

/// Bytes of stack for long work, as the program itself has.
pub(crate) const STACK: usize = 16 << 20;

/// This machine, as far as a sitting may use it.
pub(crate) struct Machine {
    fence: Arc<Fence>,
    since: Instant,
    changes: watch::Sender<u64>,
}

impl Machine {
    /// Files come through the fence.
    pub(crate) fn new(fence: Arc<Fence>) -> Self {
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

impl Surroundings for Machine {
    fn files(&self) -> Arc<dyn Files> {
        Arc::clone(&self.fence) as _
    }

    fn write(&self, path: &Path, bytes: &[u8]) -> Result<(), String> {
        files::write(path, bytes).map_err(|error| error.to_string())
    }

    fn seconds(&self) -> f64 {
        self.since.elapsed().as_secs_f64()
    }

    fn changed(&self, version: u64) {
        self.changes.send_replace(version);
    }

    fn goes_on(&self, _: &Value) {
        // Pages ask how far it is.
    }

    fn begin(&self, work: Box<dyn FnOnce() + Send>) -> Result<(), String> {
        let thread = std::thread::Builder::new().name("diagnosis".to_owned());
        let begun = thread.stack_size(STACK).spawn(work);
        begun.map(|_| ()).map_err(|error| error.to_string())
    }
}
