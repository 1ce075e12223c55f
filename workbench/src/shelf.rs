//! Memory as the surroundings of a sitting: files that somebody put there, and nothing beside what is asked.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use modelmill::files::{FileError, FileSource, MemoryFiles, OpenFile, PathKind};
use serde_json::Value;

use crate::surroundings::SessionEnvironment;

/// Files in memory, a clock, and who hears how far long work is. Clones share the files.
#[derive(Clone)]
pub(crate) struct MemoryStore {
    files: Arc<Mutex<MemoryFiles>>,
    seconds: fn() -> f64,
    goes_on: fn(&Value),
}

impl MemoryStore {
    /// No files yet; `seconds` is the clock.
    pub(crate) fn new(seconds: fn() -> f64, goes_on: fn(&Value)) -> Self {
        Self {
            files: Arc::default(),
            seconds,
            goes_on,
        }
    }

    /// Adds a file, which takes the place of one of its name.
    pub(crate) fn insert_file(&self, path: &Path, bytes: &[u8]) {
        self.with_files(|files| files.insert(path, bytes));
    }

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
        // Nobody but who asks changes anything.
    }

    fn report_progress(&self, told: &Value) {
        (self.goes_on)(told);
    }

    fn spawn_work(&self, work: Box<dyn FnOnce() + Send>) -> Result<(), String> {
        // There are no threads: whoever asks waits.
        work();
        Ok(())
    }
}
