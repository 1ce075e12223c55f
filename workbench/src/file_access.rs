//! The file access policy of a session. A text that is edited in a page may name any path, so only these files are
//! read: those in the model's folder, those named at the start, and the files that these used at the start.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::{Arc, RwLock};

use modelmill::files::{DiskFiles, FileError, FileFault, FileSource, OpenFile, PathKind};
use modelmill::{Error, Host};

use crate::options::Options;

/// The part of the disk that a session may read.
pub(crate) struct FileAccessPolicy {
    /// The disk.
    disk: DiskFiles,
    /// Folder of the model, as a canonical path.
    folder: PathBuf,
    /// Permitted files outside of the folder, as canonical paths.
    named: RwLock<Vec<PathBuf>>,
}

impl FileAccessPolicy {
    /// A policy that permits the folder of the model only.
    fn for_model_folder(model: &Path) -> Arc<Self> {
        let folder = match model.parent() {
            Some(parent) if parent != Path::new("") => parent,
            _ => Path::new("."),
        };
        Arc::new(Self {
            disk: DiskFiles::default(),
            folder: canonical_path(folder).unwrap_or_else(|| folder.to_owned()),
            named: RwLock::default(),
        })
    }

    /// A policy that also permits the files named at the start, and the files that the model files on disk include.
    pub(crate) fn for_session(host: &Host, options: &Options) -> Arc<Self> {
        let file_access = Self::for_model_folder(&options.model);
        let named = (options.data.iter().chain(&options.check).flatten())
            .chain(host.libraries())
            .chain([&options.model])
            .chain(&options.beside);
        named.for_each(|path| file_access.allow_file(path));
        for model in [Some(&options.model), options.beside.as_ref()].into_iter().flatten() {
            match host.load(model) {
                Ok(loaded) => loaded.sources.paths().for_each(|path| file_access.allow_file(path)),
                // A model with faults may be edited as well, so its files are permitted too.
                Err(Error::Model(fault)) => {
                    fault.sources.paths().for_each(|path| file_access.allow_file(path));
                }
                Err(_) => {}
            }
        }
        file_access
    }

    /// Permits one file.
    fn allow_file(&self, path: &Path) {
        let mut named = match self.named.write() {
            Ok(named) => named,
            Err(poisoned) => poisoned.into_inner(),
        };
        named.extend(canonical_path(path));
    }

    /// Fails if a path leads to a file that is not permitted, also through links.
    fn check_access(&self, path: &Path) -> Result<(), FileError> {
        let real = canonical_path(path);
        let named = match self.named.read() {
            Ok(named) => named,
            Err(poisoned) => poisoned.into_inner(),
        };
        if real.is_some_and(|real| real.starts_with(&self.folder) || named.contains(&real)) {
            return Ok(());
        }
        let says = format!(
            "it is outside of {}, the folder of the model, and was not named when the workbench was started",
            self.folder.display()
        );
        let kind = ErrorKind::PermissionDenied;
        Err(FileError::new(path, FileFault::System { kind, says }))
    }
}

/// The path without links and `..`. If nothing exists there, its folder decides, so that a missing file in the folder
/// of the model counts as missing, not as forbidden. `None` if it cannot be known where the path leads.
fn canonical_path(path: &Path) -> Option<PathBuf> {
    if let Ok(real) = path.canonicalize() {
        return Some(real);
    }
    // A link to a missing file may lead anywhere.
    if path.is_symlink() {
        return None;
    }
    let (parent, name) = (path.parent()?, path.file_name()?);
    let parent = if parent == Path::new("") {
        Path::new(".")
    } else {
        parent
    };
    Some(canonical_path(parent)?.join(name))
}

impl FileSource for FileAccessPolicy {
    fn read(&self, path: &Path, most: u64) -> Result<Vec<u8>, FileError> {
        self.check_access(path)?;
        self.disk.read(path, most)
    }

    fn kind(&self, path: &Path) -> PathKind {
        match self.check_access(path) {
            Ok(()) => self.disk.kind(path),
            Err(_) => PathKind::Missing,
        }
    }

    fn list(&self, folder: &Path) -> Result<Vec<PathBuf>, FileError> {
        self.check_access(folder)?;
        self.disk.list(folder)
    }

    fn open(&self, path: &Path, most: u64) -> Result<OpenFile, FileError> {
        self.check_access(path)?;
        self.disk.open(path, most)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_outside_and_was_not_named_is_not_read() {
        let folder = std::env::temp_dir().join(format!("modelmill-fence-{}", std::process::id()));
        let inside = folder.join("models");
        std::fs::create_dir_all(&inside).unwrap();
        for name in ["models/arm.toml", "models/base.toml", "secret", "run.csv"] {
            std::fs::write(folder.join(name), name).unwrap();
        }
        let file_access = FileAccessPolicy::for_model_folder(&inside.join("arm.toml"));
        let read = |name: &str| file_access.read(&inside.join(name), 100).is_ok();
        assert!(read("arm.toml") && read("base.toml"));
        assert!(!read("../secret") && !read("../run.csv") && !read("/etc/passwd"));
        // A missing file in the folder is missing, and one outside of it is outside.
        let says = |name: &str| {
            let error = file_access.read(&inside.join(name), 100).unwrap_err();
            error.to_string()
        };
        for name in ["none.toml", "sub/none.toml", "../models/none.toml"] {
            assert!(!says(name).contains("outside of"), "{}", says(name));
        }
        for name in ["../none.toml", "../../none/none.toml", "none/../../run.csv"] {
            assert!(says(name).contains("outside of"), "{}", says(name));
        }
        file_access.allow_file(&folder.join("run.csv"));
        assert!(read("../run.csv") && !read("../secret"));
        #[cfg(unix)]
        {
            for (to, link) in [("../secret", "link"), ("../none", "dangling")] {
                std::os::unix::fs::symlink(to, inside.join(link)).unwrap();
                assert!(!read(link) && says(link).contains("outside of"));
            }
        }
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
