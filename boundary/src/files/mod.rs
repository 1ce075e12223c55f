//! Files behind one trait, so that models, libraries and recordings come from a disk or from memory alike.
//!
//! Every read has a cap in bytes: what a path leads to may never end. What cannot be read is told as data, with what to
//! do about it.

mod disk;
mod error;
mod memory;
mod write;

use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

pub use disk::DiskFiles;
pub use error::{FileError, FileFault};
pub use memory::MemoryFiles;
pub use write::write;

/// Where files come from.
pub trait FileSource: Send + Sync {
    /// All bytes of a file; fails when there are more than `most`, or the path leads to no file.
    fn read(&self, path: &Path, most: u64) -> Result<Vec<u8>, FileError>;

    /// What a path leads to.
    fn kind(&self, path: &Path) -> PathKind;

    /// The paths of what is in a folder, sorted; fails where folders cannot be listed.
    fn list(&self, folder: &Path) -> Result<Vec<PathBuf>, FileError> {
        Err(FileError::new(folder, FileFault::NoList))
    }

    /// A file that may be longer than memory, to be read from any place; what can be read only once, such as a pipe, is
    /// read up to `most` bytes. Fails as [`FileSource::read`] does.
    fn open(&self, path: &Path, most: u64) -> Result<OpenFile, FileError> {
        Ok(OpenFile::Memory(self.read(path, most)?.into()))
    }

    /// All text of a file; fails as [`FileSource::read`] does, and when its bytes are no UTF-8.
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
    /// An ordinary file, which can be read more than once and from any place.
    File,
    /// A folder.
    Folder,
    /// A pipe or standard input, which can be read once.
    Stream,
    /// A device or a socket, which is not read.
    Device,
    /// Nothing that can be seen.
    Missing,
}

/// A file that was opened, at its beginning.
#[derive(Debug)]
pub enum OpenFile {
    /// An ordinary file on a disk.
    File(std::fs::File),
    /// Bytes in memory.
    Memory(Arc<Vec<u8>>),
}

/// Drops `.` and resolves `..` by name, so that one file has one path.
pub fn normalise_path(path: &Path) -> PathBuf {
    let mut parts: Vec<Component<'_>> = Vec::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir if matches!(parts.last(), Some(Component::Normal(_))) => {
                parts.pop();
            }
            part => parts.push(part),
        }
    }
    parts.into_iter().collect()
}
