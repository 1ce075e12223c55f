//! The source of files for a plan: model files come from the plan, recordings from disk.

use std::path::{Path, PathBuf};

use modelmill::files::{DiskFiles, FileError, FileSource, MemoryFiles, OpenFile, PathKind};

/// Files of the plan in memory, and all others on disk.
pub(crate) struct PlanFiles {
    /// The model files of the plan.
    pub(crate) memory: MemoryFiles,
    /// The disk.
    pub(crate) disk: DiskFiles,
}

impl PlanFiles {
    /// The source of a path: memory if the plan has the file, else the disk.
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

    /// Folders are on disk only.
    fn list(&self, folder: &Path) -> Result<Vec<PathBuf>, FileError> {
        self.disk.list(folder)
    }

    fn open(&self, path: &Path, most: u64) -> Result<OpenFile, FileError> {
        self.files_for(path).open(path, most)
    }
}
