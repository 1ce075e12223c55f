//! Files in memory, for browsers and tests.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::{FileError, FileFault, FileSource, OpenFile, PathKind, normalise_path};

/// Files in memory by their paths. A folder exists if it contains a file.
///
/// ```
/// use modelmill_boundary::files::{FileSource, MemoryFiles};
/// let files = MemoryFiles::default().with_file("models/arm.toml", "schema = 1");
/// assert_eq!(files.read_text("models/./arm.toml".as_ref(), 100)?, "schema = 1");
/// assert!(files.read("models/leg.toml".as_ref(), 100).is_err());
/// # Ok::<(), modelmill_boundary::files::FileError>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct MemoryFiles {
    /// Contents by normalised path.
    files: BTreeMap<PathBuf, Arc<Vec<u8>>>,
}

impl MemoryFiles {
    /// These files and one more, which replaces a file of the same path.
    #[must_use]
    pub fn with_file(mut self, path: impl AsRef<Path>, bytes: impl Into<Vec<u8>>) -> Self {
        self.insert(path, bytes);
        self
    }

    /// Adds a file, which replaces a file of the same path.
    pub fn insert(&mut self, path: impl AsRef<Path>, bytes: impl Into<Vec<u8>>) {
        self.files.insert(normalise_path(path.as_ref()), Arc::new(bytes.into()));
    }

    /// The contents of a file of at most `most` bytes.
    fn find(&self, path: &Path, most: u64) -> Result<&Arc<Vec<u8>>, FileError> {
        let fail = |fault| Err(FileError::new(path, fault));
        match self.files.get(&normalise_path(path)) {
            Some(bytes) if bytes.len() as u64 > most => fail(FileFault::TooLarge { most }),
            Some(bytes) => Ok(bytes),
            None if self.kind(path) == PathKind::Folder => fail(FileFault::Folder),
            None => fail(FileFault::Missing),
        }
    }
}

impl FileSource for MemoryFiles {
    fn read(&self, path: &Path, most: u64) -> Result<Vec<u8>, FileError> {
        self.find(path, most).map(|bytes| bytes.to_vec())
    }

    fn kind(&self, path: &Path) -> PathKind {
        let path = normalise_path(path);
        if self.files.contains_key(&path) {
            PathKind::File
        } else if self.files.keys().any(|other| other.starts_with(&path)) {
            PathKind::Folder
        } else {
            PathKind::Missing
        }
    }

    fn list(&self, folder: &Path) -> Result<Vec<PathBuf>, FileError> {
        let folder = normalise_path(folder);
        let mut found: Vec<PathBuf> = self
            .files
            .keys()
            .filter_map(|path| path.strip_prefix(&folder).ok()?.components().next())
            .map(|first| folder.join(first))
            .collect();
        // The keys are sorted, so entries of the same subfolder follow each other.
        found.dedup();
        if found.is_empty() {
            return Err(FileError::new(&folder, FileFault::Missing));
        }
        Ok(found)
    }

    fn open(&self, path: &Path, _: u64) -> Result<OpenFile, FileError> {
        // The contents are in memory already, so there is no limit.
        self.find(path, u64::MAX).cloned().map(OpenFile::Memory)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_and_folders_are_found_by_any_of_their_names() {
        let files = MemoryFiles::default()
            .with_file("a/one.toml", "1")
            .with_file("a/b/two.toml", "22");
        assert_eq!(files.read(Path::new("a/b/../one.toml"), 1).unwrap(), b"1");
        assert_eq!(files.kind(Path::new("./a")), PathKind::Folder);
        assert_eq!(files.kind(Path::new("b")), PathKind::Missing);
        let listed = files.list(Path::new("a")).unwrap();
        assert_eq!(listed, [PathBuf::from("a/b"), PathBuf::from("a/one.toml")]);
        let fault = |path: &str| files.read(Path::new(path), 1).unwrap_err().fault;
        assert_eq!(fault("a"), FileFault::Folder);
        assert_eq!(fault("a/b/two.toml"), FileFault::TooLarge { most: 1 });
        assert_eq!(fault("c"), FileFault::Missing);
    }
}
