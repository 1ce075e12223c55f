//! The files of a plan, and recordings from disk beside them.

use std::path::{Path, PathBuf};

use modelmill::files::{DiskFiles, FileError, FileSource, MemoryFiles, OpenFile, PathKind};

/// What is in the plan comes from memory, all else from disk.
pub(crate) struct PlanFiles {
    pub(crate) memory: MemoryFiles,
    pub(crate) disk: DiskFiles,
}

impl PlanFiles {
    fn files_for(&self, path: &Path) -> &dyn FileSource {
        match self.memory.kind(path) {
            PathKind::File => &self.memory,
            _ => &self.disk,
        }
    }
}

impl FileSource for PlanFiles {
    fn read(&self, path: &Path, most: u64) -> Result<Vec<u8>, FileError> {
        self.files_for(path).read(path, most)
    }

    fn kind(&self, path: &Path) -> PathKind {
        self.files_for(path).kind(path)
    }

    fn list(&self, folder: &Path) -> Result<Vec<PathBuf>, FileError> {
        self.disk.list(folder)
    }

    fn open(&self, path: &Path, most: u64) -> Result<OpenFile, FileError> {
        self.files_for(path).open(path, most)
    }
}
