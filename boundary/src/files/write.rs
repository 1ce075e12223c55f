//! Files are written as a whole or not at all.
//!
//! The bytes go into a new file in the same folder, from there to the disk, and only then does the new file take the
//! place of the old one: whoever stops the program, or the disk that is full, leaves the old file as it was.

use std::fs::{File, Metadata, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use super::{FileError, FileFault};

/// Links that lead on to others are followed so far.
const MOST_LINKS: usize = 40;

/// Writes a file as a whole.
///
/// Links are followed to the file that they lead to, and its permissions are kept, its owner too where that is allowed.
/// A file under several names (hard links) is replaced under this one. What is no ordinary file, such as
/// `/dev/stdout`, is written to as it is. Fails with the file as it was, and without a trace, when there is no room or no
/// permission; who stops the program on the way leaves a file `.NAME.….part` beside it.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    let fail = |error: io::Error| FileError::from_io_error(path, &error);
    let old = match path.metadata() {
        Ok(found) if found.is_dir() => return Err(FileError::new(path, FileFault::Folder)),
        Ok(found) if !found.is_file() => {
            let mut stream = OpenOptions::new().write(true).open(path).map_err(fail)?;
            return stream.write_all(bytes).map_err(fail);
        }
        Ok(found) => {
            // A file that may not be written to is not replaced either, though its folder would allow it.
            OpenOptions::new().write(true).open(path).map_err(fail)?;
            Some(found)
        }
        Err(_) => None,
    };
    let target = resolve_links(path).map_err(fail)?;
    let part = PartialFile::create_next_to(&target).map_err(fail)?;
    part.fill(bytes, old.as_ref()).map_err(fail)?;
    std::fs::rename(&part.path, &target).map_err(fail)?;
    part.keep();
    sync_folder(&target);
    Ok(())
}

/// Where the links end that a path leads to, whether something is there or not.
fn resolve_links(path: &Path) -> io::Result<PathBuf> {
    let mut path = path.to_owned();
    for _ in 0..MOST_LINKS {
        match path.read_link() {
            Ok(next) => path = path.parent().unwrap_or(Path::new("")).join(next),
            Err(_) => return Ok(path),
        }
    }
    Err(io::Error::other("too many links lead on to one another"))
}

/// A file that is gone again unless it is kept.
struct PartialFile {
    file: File,
    path: PathBuf,
    is_kept: bool,
}

impl PartialFile {
    /// A new file in the folder of another one.
    fn create_next_to(target: &Path) -> io::Result<Self> {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let name = target.file_name().unwrap_or_default().to_string_lossy();
        // A name may be as long as the system allows, so only its start comes in.
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
                // One of that name is left from a program that was stopped.
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
            }
        }
    }

    /// Writes the bytes through to the disk, with owner and permissions of the old file.
    fn fill(&self, bytes: &[u8], old: Option<&Metadata>) -> io::Result<()> {
        (&self.file).write_all(bytes)?;
        if let Some(old) = old {
            #[cfg(unix)]
            {
                use std::os::unix::fs::{MetadataExt, fchown};
                // Only a superuser may give files away; to others they belong already, or it does not matter.
                let _ = fchown(&self.file, Some(old.uid()), Some(old.gid()));
            }
            self.file.set_permissions(old.permissions())?;
        }
        self.file.sync_all()
    }

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

/// That a file has another name now goes to the disk as well, where the system allows it.
fn sync_folder(target: &Path) {
    let folder = target.parent().filter(|folder| *folder != Path::new(""));
    if let Ok(folder) = File::open(folder.unwrap_or(Path::new("."))) {
        let _ = folder.sync_all();
    }
}
