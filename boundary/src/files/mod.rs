//! Files behind one trait, so that models, libraries and recordings can come from a disk or from memory.
//!
//! Every read has a limit in bytes, because a path may lead to a stream without end. Faults are data with a remedy.

mod disk;
mod error;
mod memory;
mod partial;
mod stream;
mod write;

use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

pub use disk::DiskFiles;
pub use error::{FileError, FileFault};
pub use memory::MemoryFiles;
pub use write::{write, write_together};

/// A source of files.
pub trait FileSource: Send + Sync {
    /// All bytes of a file. Fails when there are more than `most`, or when the path leads to no file.
    fn read(&self, path: &Path, most: u64) -> Result<Vec<u8>, FileError>;

    /// What a path leads to.
    fn kind(&self, path: &Path) -> PathKind;

    /// The paths of the entries of a folder, sorted. Fails where folders cannot be listed.
    fn list(&self, folder: &Path) -> Result<Vec<PathBuf>, FileError> {
        Err(FileError::new(folder, FileFault::NoList))
    }

    /// Opens a file that may be larger than memory, for random access. Streams such as pipes are read up to `most`
    /// bytes. Fails as [`FileSource::read`] does.
    fn open(&self, path: &Path, most: u64) -> Result<OpenFile, FileError> {
        Ok(OpenFile::Memory(self.read(path, most)?.into()))
    }

    /// The text of a file. Fails as [`FileSource::read`] does, and when its bytes are not UTF-8.
    fn read_text(&self, path: &Path, most: u64) -> Result<String, FileError> {
        String::from_utf8(self.read(path, most)?).map_err(|error| {
            let at = error.utf8_error().valid_up_to();
            FileError::new(path, FileFault::NoText { at })
        })
    }
}

/// What a path leads to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PathKind {
    /// An ordinary file, which can be read several times and at any position.
    File,
    /// A folder.
    Folder,
    /// A pipe or standard input, which can be read only once.
    Stream,
    /// A device or a socket, which is not read.
    Device,
    /// Nothing, or nothing that is visible.
    Missing,
}

/// An open file, positioned at its start.
#[derive(Debug)]
pub enum OpenFile {
    /// An ordinary file on a disk.
    File(std::fs::File),
    /// Bytes in memory.
    Memory(Arc<Vec<u8>>),
}

/// Removes `.` and resolves `..` by name, so that each file has one path; links are not followed.
pub fn normalise_path(path: &Path) -> PathBuf {
    let mut parts: Vec<Component<'_>> = Vec::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            // A leading `..` has no folder that it could remove.
            Component::ParentDir if matches!(parts.last(), Some(Component::Normal(_))) => {
                parts.pop();
            }
            part => parts.push(part),
        }
    }
    parts.into_iter().collect()
}
