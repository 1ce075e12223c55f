//! This machine as the environment of a session: its disk under the file access policy, its clock, its threads.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use modelmill::files::{self, FileSource};
use serde_json::Value;
use tokio::sync::watch;

use crate::file_access::FileAccessPolicy;
use crate::surrounding_files::SessionEnvironment;

/// Bytes of stack for long work, as the program itself has.
pub(crate) const STACK: usize = 16 << 20;

/// The part of this machine that a session may use.
pub(crate) struct LocalMachine {
    /// The files that may be read.
    file_access: Arc<FileAccessPolicy>,
    /// Zero of the clock.
    since: Instant,
    /// Last version of the session, for waiting pages.
    changes: watch::Sender<u64>,
}

impl LocalMachine {
    /// Files are read as `file_access` permits.
    pub(crate) fn new(file_access: Arc<FileAccessPolicy>) -> Self {
        Self {
            file_access,
            since: Instant::now(),
            changes: watch::channel(0).0,
        }
    }

    /// A receiver of the last version of the session.
    pub(crate) fn changes(&self) -> watch::Receiver<u64> {
        self.changes.subscribe()
    }
}

impl SessionEnvironment for LocalMachine {
    fn files(&self) -> Arc<dyn FileSource> {
        Arc::clone(&self.file_access) as _
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
        // Pages request the progress by themselves.
    }

    fn spawn_work(&self, work: Box<dyn FnOnce() + Send>) -> Result<(), String> {
        let thread = std::thread::Builder::new().name("diagnosis".to_owned());
        let begun = thread.stack_size(STACK).spawn(work);
        begun.map(|_| ()).map_err(|error| error.to_string())
    }
}
