//! Memory as the surroundings of a sitting: files that somebody put there, and nothing beside what is asked.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use modelmill::files::{FileError, Files, Kind, Memory, Opened};
use serde_json::Value;

use crate::surroundings::Surroundings;

/// Files in memory, a clock, and who hears how far long work is. Clones share the files.
#[derive(Clone)]
pub(crate) struct Shelf {
    files: Arc<Mutex<Memory>>,
    seconds: fn() -> f64,
    goes_on: fn(&Value),
}

impl Shelf {
    /// No files yet; `seconds` is the clock.
    pub(crate) fn new(seconds: fn() -> f64, goes_on: fn(&Value)) -> Self {
        Self {
            files: Arc::default(),
            seconds,
            goes_on,
        }
    }

    /// Adds a file, which takes the place of one of its name.
    pub(crate) fn put(&self, path: &Path, bytes: &[u8]) {
        self.with(|files| files.insert(path, bytes));
    }

    fn with<T>(&self, look: impl FnOnce(&mut Memory) -> T) -> T {
        look(&mut self.files.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Files for Shelf {
    fn read(&self, path: &Path, most: u64) -> Result<Vec<u8>, FileError> {
        self.with(|files| files.read(path, most))
    }

    fn kind(&self, path: &Path) -> Kind {
        self.with(|files| files.kind(path))
    }

    fn list(&self, folder: &Path) -> Result<Vec<PathBuf>, FileError> {
        self.with(|files| files.list(folder))
    }

    fn open(&self, path: &Path, most: u64) -> Result<Opened, FileError> {
        self.with(|files| files.open(path, most))
    }
}

impl Surroundings for Shelf {
    fn files(&self) -> Arc<dyn Files> {
        Arc::new(self.clone())
    }

    fn write(&self, path: &Path, bytes: &[u8]) -> Result<(), String> {
        self.put(path, bytes);
        Ok(())
    }

    fn seconds(&self) -> f64 {
        (self.seconds)()
    }

    fn changed(&self, _: u64) {
        // Nobody but who asks changes anything.
    }

    fn goes_on(&self, told: &Value) {
        (self.goes_on)(told);
    }

    fn begin(&self, work: Box<dyn FnOnce() + Send>) -> Result<(), String> {
        // There are no threads: whoever asks waits.
        work();
        Ok(())
    }
}
