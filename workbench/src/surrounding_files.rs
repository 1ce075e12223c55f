//! The environment of a session: files, a clock, notification of changes, and threads for long work. The server uses
//! this machine, a self-contained page its memory.

use std::path::Path;
use std::sync::Arc;

use modelmill::files::FileSource;
use serde_json::Value;

/// Environment of a session.
pub(crate) trait SessionEnvironment: Send + Sync {
    /// The source of all files that are read.
    fn files(&self) -> Arc<dyn FileSource>;

    /// Writes a file atomically; fails with a sentence, and then the old file is unchanged.
    fn write(&self, path: &Path, bytes: &[u8]) -> Result<(), String>;

    /// Seconds since a fixed but unspecified moment.
    fn seconds(&self) -> f64;

    /// Notifies pages of a change; `version` counts the changes.
    fn notify_change(&self, version: u64);

    /// Reports the current step of long work: an object with `what`, `done` and `total` (0 if unknown).
    fn report_progress(&self, view_json: &Value);

    /// Does long work, in parallel if the environment has threads; fails with a sentence if it cannot start.
    fn spawn_work(&self, work: Box<dyn FnOnce() + Send>) -> Result<(), String>;
}
