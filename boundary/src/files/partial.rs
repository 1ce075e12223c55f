//! New files that have not replaced their targets yet: `.NAME.PROCESS-NUMBER.part` in the folder of the target.
//!
//! Each is locked while its program runs. Therefore a file without a lock belongs to a program that was stopped, and
//! can be removed.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsStr;
use std::fs::{File, Metadata, OpenOptions, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

/// Characters of the target's name that are used; it may be as long as the system allows.
const NAME_START: usize = 40;

/// A new file that is removed again unless it has replaced its target.
pub(super) struct PartialFile {
    /// The open file, which has the lock.
    file: File,
    /// Its path.
    path: PathBuf,
    /// Whether it has replaced its target.
    is_kept: bool,
}

impl PartialFile {
    /// Creates a file with a new name in the folder of another one.
    pub(super) fn create_next_to(target: &Path) -> io::Result<Self> {
        Self::with_new_name(target, |path| {
            OpenOptions::new().write(true).create_new(true).open(path)
        })
    }

    /// A second name of an existing file, or a copy of it where files have only one name.
    pub(super) fn link_next_to(target: &Path) -> io::Result<Self> {
        Self::with_new_name(target, |path| {
            if let Err(error) = std::fs::hard_link(target, path) {
                if error.kind() == io::ErrorKind::AlreadyExists {
                    return Err(error);
                }
                // A new name is reserved before its file is written over by the copy.
                OpenOptions::new().write(true).create_new(true).open(path)?;
                if let Err(error) = std::fs::copy(target, path) {
                    let _ = std::fs::remove_file(path);
                    return Err(error);
                }
            }
            File::open(path).inspect_err(|_| drop(std::fs::remove_file(path)))
        })
    }

    /// Tries new names until `create` succeeds with one of them.
    fn with_new_name(target: &Path, create: impl Fn(&Path) -> io::Result<File>) -> io::Result<Self> {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let start = name_start(target);
        loop {
            let count = COUNT.fetch_add(1, Ordering::Relaxed);
            let own = format!("{start}{}-{count}.part", std::process::id());
            let path = target.with_file_name(own);
            match create(&path) {
                Ok(file) => {
                    // Where there are no locks, nobody removes the file either. A lock of another program means that it
                    // takes the new file for an abandoned one, and removes it.
                    let is_taken = matches!(file.try_lock(), Err(TryLockError::WouldBlock));
                    if !is_taken && path.exists() {
                        let is_kept = false;
                        return Ok(Self { file, path, is_kept });
                    }
                }
                // A file of that name remains from a program that was stopped.
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
            }
        }
    }

    /// Writes the bytes and flushes them to the disk, with owner and permissions of the old file.
    pub(super) fn fill(&self, bytes: &[u8], old: Option<&Metadata>) -> io::Result<()> {
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

    /// Keeps the file under its name.
    pub(super) fn keep(&mut self) {
        self.is_kept = true;
    }

    /// Replaces the target by this file.
    pub(super) fn rename_to(&mut self, target: &Path) -> io::Result<()> {
        std::fs::rename(&self.path, target)?;
        self.keep();
        // The lock would otherwise last as long as other files are replaced.
        let _ = self.file.unlock();
        Ok(())
    }
}

impl Drop for PartialFile {
    fn drop(&mut self) {
        if !self.is_kept {
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

/// Removes the partial files of these targets that no running program has locked.
pub(super) fn remove_abandoned_files<'a>(targets: impl Iterator<Item = &'a Path>) {
    // Each folder is listed once, also for many targets in it.
    let mut folders: BTreeMap<&Path, BTreeSet<String>> = BTreeMap::new();
    for target in targets {
        let folder = target.parent().filter(|folder| *folder != Path::new(""));
        let starts = folders.entry(folder.unwrap_or(Path::new("."))).or_default();
        starts.insert(name_start(target));
    }
    for (folder, starts) in folders {
        let Ok(entries) = std::fs::read_dir(folder) else {
            continue;
        };
        for entry in entries.flatten() {
            if partial_name_start(&entry.file_name()).is_some_and(|start| starts.contains(start)) {
                remove_if_unlocked(&entry.path());
            }
        }
    }
}

/// Removes a file, unless a running program has locked it.
fn remove_if_unlocked(path: &Path) {
    // A link or a pipe of this name is none of our files.
    if !path.symlink_metadata().is_ok_and(|found| found.is_file()) {
        return;
    }
    // The lock is kept until the file is gone.
    if let Ok(file) = File::open(path)
        && file.try_lock().is_ok()
    {
        let _ = std::fs::remove_file(path);
    }
}

/// The start of the names of partial files of a target: `.NAME.`.
fn name_start(target: &Path) -> String {
    let name = target.file_name().unwrap_or_default().to_string_lossy();
    let name: String = name.chars().take(NAME_START).collect();
    format!(".{name}.")
}

/// The start of a partial file's name; `None` for another name.
fn partial_name_start(name: &OsStr) -> Option<&str> {
    let rest = name.to_str()?.strip_suffix(".part")?;
    let (start, own) = rest.split_at(rest.rfind('.')? + 1);
    let (process, count) = own.split_once('-')?;
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    (is_number(process) && is_number(count)).then_some(start)
}
