//! The memory store: the environment of a session in memory. It has the files that were added, a clock, and no threads.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use modelmill::files::{FileError, FileSource, MemoryFiles, OpenFile, PathKind};
use serde_json::Value;

use crate::surrounding_files::SessionEnvironment;

/// Files in memory, a clock, and a listener for progress. Clones share the files.
#[derive(Clone)]
pub(crate) struct MemoryStore {
    /// The files, by path.
    files: Arc<Mutex<MemoryFiles>>,
    /// The clock, s.
    seconds: fn() -> f64,
    /// Receives the progress of long work, as JSON.
    goes_on: fn(&Value),
}

impl MemoryStore {
    /// A store without files; `seconds` is the clock, `goes_on` receives the progress of long work.
    pub(crate) fn new(seconds: fn() -> f64, goes_on: fn(&Value)) -> Self {
        Self {
            files: Arc::default(),
            seconds,
            goes_on,
        }
    }

    /// Adds a file, or replaces the file with this name.
    pub(crate) fn insert_file(&self, path: &Path, bytes: &[u8]) {
        self.with_files(|files| files.insert(path, bytes));
    }

    /// Runs `look` on the files, under the lock.
    fn with_files<T>(&self, look: impl FnOnce(&mut MemoryFiles) -> T) -> T {
        look(&mut self.files.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl FileSource for MemoryStore {
    fn read(&self, path: &Path, most: u64) -> Result<Vec<u8>, FileError> {
        self.with_files(|files| files.read(path, most))
    }

    fn kind(&self, path: &Path) -> PathKind {
        self.with_files(|files| files.kind(path))
    }

    fn list(&self, folder: &Path) -> Result<Vec<PathBuf>, FileError> {
        self.with_files(|files| files.list(folder))
    }

    fn open(&self, path: &Path, most: u64) -> Result<OpenFile, FileError> {
        self.with_files(|files| files.open(path, most))
    }
}

impl SessionEnvironment for MemoryStore {
    fn files(&self) -> Arc<dyn FileSource> {
        Arc::new(self.clone())
    }

    fn write(&self, path: &Path, bytes: &[u8]) -> Result<(), String> {
        self.insert_file(path, bytes);
        Ok(())
    }

    fn seconds(&self) -> f64 {
        (self.seconds)()
    }

    fn notify_change(&self, _: u64) {
        // Only the page itself makes changes, and it gets them as responses.
    }

    fn report_progress(&self, progress: &Value) {
        (self.goes_on)(progress);
    }

    fn spawn_work(&self, work: Box<dyn FnOnce() + Send>) -> Result<(), String> {
        // There are no threads: the work is done before the request returns.
        work();
        Ok(())
    }
}
