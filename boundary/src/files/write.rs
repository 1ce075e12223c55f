//! Atomic writing: a file is written completely or not at all.
//!
//! The bytes are written to a new file in the same folder and flushed to the disk. Then the new file replaces the old
//! one. If the program is stopped or the disk is full, the old file stays unchanged.

use std::fs::{File, Metadata, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use super::{FileError, FileFault};

/// Most links that are followed one after another.
const MOST_LINKS: usize = 40;

/// Writes a file atomically.
///
/// Links are followed to their file. Its permissions are kept, and its owner where that is allowed. A file with
/// several names (hard links) is replaced under this name only. Devices and pipes, such as `/dev/stdout`, are written
/// to directly. Without room or permission it fails, and the old file stays unchanged. If the program is stopped
/// during writing, a file `.NAME.….part` remains next to it.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    let fail = |error: io::Error| FileError::from_io_error(path, &error);
    let old = match path.metadata() {
        Ok(found) if found.is_dir() => return Err(FileError::new(path, FileFault::Folder)),
        Ok(found) if !found.is_file() => {
            let mut stream = OpenOptions::new().write(true).open(path).map_err(fail)?;
            return stream.write_all(bytes).map_err(fail);
        }
        Ok(found) => {
            // A write-protected file is not replaced, even if its folder would allow that.
            OpenOptions::new().write(true).open(path).map_err(fail)?;
            Some(found)
        }
        Err(_) => None,
    };
    // Write next to the target, so that renaming stays on one disk.
    let target = resolve_links(path).map_err(fail)?;
    let part = PartialFile::create_next_to(&target).map_err(fail)?;
    part.fill(bytes, old.as_ref()).map_err(fail)?;
    std::fs::rename(&part.path, &target).map_err(fail)?;
    part.keep();
    sync_folder(&target);
    Ok(())
}

/// The path at the end of all links, whether it exists or not.
fn resolve_links(path: &Path) -> io::Result<PathBuf> {
    let mut path = path.to_owned();
    for _ in 0..MOST_LINKS {
        match path.read_link() {
            Ok(next) => path = path.parent().unwrap_or(Path::new("")).join(next),
            Err(_) => return Ok(path),
        }
    }
    Err(io::Error::other("too many symbolic links lead to each other"))
}

/// A new file that is removed again unless it is kept.
struct PartialFile {
    /// The open file.
    file: File,
    /// Its path.
    path: PathBuf,
    /// Whether it has replaced its target.
    is_kept: bool,
}

impl PartialFile {
    /// Creates a file with a new name in the folder of another one.
    fn create_next_to(target: &Path) -> io::Result<Self> {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let name = target.file_name().unwrap_or_default().to_string_lossy();
        // The name of the target may be as long as the system allows, so only its start is used.
        let name: String = name.chars().take(40).collect();
        loop {
            let count = COUNT.fetch_add(1, Ordering::Relaxed);
            let own = format!(".{name}.{}-{count}.part", std::process::id());
            let path = target.with_file_name(own);
            match OpenOptions::new().write(true).create_new(true).open(&path) {
                Ok(file) => {
                    return Ok(Self {
                        file,
                        path,
                        is_kept: false,
                    });
                }
                // A file of that name remains from a program that was stopped.
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
            }
        }
    }

    /// Writes the bytes and flushes them to the disk, with owner and permissions of the old file.
    fn fill(&self, bytes: &[u8], old: Option<&Metadata>) -> io::Result<()> {
        (&self.file).write_all(bytes)?;
        if let Some(old) = old {
            #[cfg(unix)]
            {
                use std::os::unix::fs::{MetadataExt, fchown};
                // Only the superuser can change the owner; without that right the owner stays the current user.
                let _ = fchown(&self.file, Some(old.uid()), Some(old.gid()));
            }
            self.file.set_permissions(old.permissions())?;
        }
        self.file.sync_all()
    }

    /// Keeps the file under its new name.
    fn keep(mut self) {
        self.is_kept = true;
    }
}

impl Drop for PartialFile {
    fn drop(&mut self) {
        if !self.is_kept {
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

/// Flushes the folder, so that the renaming is on the disk, too; not all systems allow that.
fn sync_folder(target: &Path) {
    let folder = target.parent().filter(|folder| *folder != Path::new(""));
    if let Ok(folder) = File::open(folder.unwrap_or(Path::new("."))) {
        let _ = folder.sync_all();
    }
}
