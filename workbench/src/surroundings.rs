//! What a sitting needs from where it takes place: files, a clock, somebody who hears of changes, and somewhere to do long work.
//! The server's surroundings are this machine, those of a page its own memory.

use std::path::Path;
use std::sync::Arc;

use modelmill::files::FileSource;
use serde_json::Value;

/// Where a sitting takes place.
pub(crate) trait SessionEnvironment: Send + Sync {
    /// Where files are read.
    fn files(&self) -> Arc<dyn FileSource>;

    /// Writes a file as a whole; fails with a sentence, and the old one is as it was.
    fn write(&self, path: &Path, bytes: &[u8]) -> Result<(), String>;

    /// Seconds since some moment.
    fn seconds(&self) -> f64;

    /// Something changed that pages should hear of; `version` counts that.
    fn notify_change(&self, version: u64);

    /// Long work has come to something else: an object with `what`, `done` and `total` (0 where nobody knows it).
    fn report_progress(&self, told: &Value);

    /// Does long work, beside everything else where that is possible; fails with a sentence when it cannot begin.
    fn spawn_work(&self, work: Box<dyn FnOnce() + Send>) -> Result<(), String>;
}
