//! The files of a plan, and recordings from disk beside them.

use std::path::{Path, PathBuf};

use modelmill::files::{Disk, FileError, Files, Kind, Memory, Opened};

/// What is in the plan comes from memory, all else from disk.
pub(crate) struct Both {
    pub(crate) memory: Memory,
    pub(crate) disk: Disk,
}

impl Both {
    fn at(&self, path: &Path) -> &dyn Files {
        match self.memory.kind(path) {
            Kind::File => &self.memory,
            _ => &self.disk,
        }
    }
}

impl Files for Both {
    fn read(&self, path: &Path, most: u64) -> Result<Vec<u8>, FileError> {
        self.at(path).read(path, most)
    }

    fn kind(&self, path: &Path) -> Kind {
        self.at(path).kind(path)
    }

    fn list(&self, folder: &Path) -> Result<Vec<PathBuf>, FileError> {
        self.disk.list(folder)
    }

    fn open(&self, path: &Path, most: u64) -> Result<Opened, FileError> {
        self.at(path).open(path, most)
    }
}
