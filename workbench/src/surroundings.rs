//! What a sitting needs from where it takes place: files, a clock, somebody who hears of changes, and somewhere to do long work.
//! The server's surroundings are this machine, those of a page its own memory.

use std::path::Path;
use std::sync::Arc;

use modelmill::files::Files;
use serde_json::Value;

/// Where a sitting takes place.
pub(crate) trait Surroundings: Send + Sync {
    /// Where files are read.
    fn files(&self) -> Arc<dyn Files>;

    /// Writes a file as a whole; fails with a sentence, and the old one is as it was.
    fn write(&self, path: &Path, bytes: &[u8]) -> Result<(), String>;

    /// Seconds since some moment.
    fn seconds(&self) -> f64;

    /// Something changed that pages should hear of; `version` counts that.
    fn changed(&self, version: u64);

    /// Long work has come to something else: an object with `what`, `done` and `total` (0 where nobody knows it).
    fn goes_on(&self, told: &Value);

    /// Does long work, beside everything else where that is possible; fails with a sentence when it cannot begin.
    fn begin(&self, work: Box<dyn FnOnce() + Send>) -> Result<(), String>;
}
