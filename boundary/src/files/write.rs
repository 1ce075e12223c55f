//! Atomic writing: files are written completely and together, or not at all.
//!
//! The bytes are written to new files in the same folders and flushed to the disk. Then the new files replace the old
//! ones. If the program is stopped during writing or the disk is full, the old files stay unchanged. If a file cannot
//! be replaced, those that were replaced before it become the old ones again.

use std::collections::BTreeSet;
use std::fs::{File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::partial::{PartialFile, remove_abandoned_files};
use super::stream::{DEFAULT_PIPE_TIMEOUT, write_stream};
use super::{FileError, FileFault};

/// Most links that are followed one after another.
const MOST_LINKS: usize = 40;

/// Writes a file atomically.
///
/// Links are followed to their file. Its permissions are kept, and its owner where that is allowed. A file with
/// several names (hard links) is replaced under this name only. Devices and pipes, such as `/dev/stdout`, are written
/// to directly; a named pipe that nobody reads is an error after some seconds. Without room or permission it fails,
/// and the old file stays unchanged. If the program is stopped during writing, a file `.NAME.….part` remains next to
/// it; the next write of the same file removes it.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    write_together(&[(path, bytes)])
}

/// Writes several files as one act: all of them, each as [`write()`] does, or none.
///
/// If the program is stopped between the replacements, some files are new and others are old; each is complete.
pub fn write_together(files: &[(&Path, &[u8])]) -> Result<(), FileError> {
    write_with_timeout(files, DEFAULT_PIPE_TIMEOUT)
}

/// The same with a given timeout of named pipes.
pub(super) fn write_with_timeout(files: &[(&Path, &[u8])], patience: Duration) -> Result<(), FileError> {
    let mut staged = Vec::new();
    let mut streams = Vec::new();
    for (path, bytes) in files {
        match StagedFile::new(path, bytes)? {
            Some(file) => staged.push(file),
            None => streams.push((path, bytes)),
        }
    }
    // What was written to a stream cannot be taken back, so that streams follow the step that usually fails.
    for (path, bytes) in streams {
        write_stream(path, bytes, patience)?;
    }
    replace_all(&mut staged)?;
    remove_abandoned_files(staged.iter().map(|file| file.target.as_path()));
    Ok(())
}

/// A complete new file that waits to replace its target.
struct StagedFile {
    /// The path as it was given.
    path: PathBuf,
    /// The path at the end of all links.
    target: PathBuf,
    /// The new file.
    part: PartialFile,
    /// A second name of the old file while files are replaced; `None` without old file.
    backup: Option<PartialFile>,
    /// Whether there is an old file.
    has_old: bool,
}

impl StagedFile {
    /// Writes the new file next to its target; `None` for a device or a pipe.
    fn new(path: &Path, bytes: &[u8]) -> Result<Option<Self>, FileError> {
        let fail = |error: io::Error| FileError::from_io_error(path, &error);
        let old = match path.metadata() {
            Ok(found) if found.is_dir() => return Err(FileError::new(path, FileFault::Folder)),
            Ok(found) if !found.is_file() => return Ok(None),
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
        Ok(Some(Self {
            path: path.to_owned(),
            target,
            part,
            backup: None,
            has_old: old.is_some(),
        }))
    }

    /// Gives the old file a second name, under which it is found if a later file cannot be replaced.
    fn keep_old(&mut self) -> io::Result<()> {
        if self.has_old {
            self.backup = Some(PartialFile::link_next_to(&self.target)?);
        }
        Ok(())
    }

    /// Replaces the new file by the old one again, or removes it.
    fn restore(&mut self) {
        match self.backup.take() {
            Some(mut backup) => {
                // The old contents are more important than a clean folder.
                if backup.rename_to(&self.target).is_err() {
                    backup.keep();
                }
            }
            None => drop(std::fs::remove_file(&self.target)),
        }
    }
}

/// Replaces all targets. If one cannot be replaced, all have their old contents again.
fn replace_all(staged: &mut [StagedFile]) -> Result<(), FileError> {
    // A single file is replaced at once; second names of old files are only needed for several.
    if staged.len() > 1 {
        for file in staged.iter_mut() {
            file.keep_old()
                .map_err(|error| FileError::from_io_error(&file.path, &error))?;
        }
    }
    for k in 0..staged.len() {
        let file = &mut staged[k];
        if let Err(error) = file.part.rename_to(&file.target) {
            let fault = FileError::from_io_error(&file.path, &error);
            staged[..k].iter_mut().for_each(StagedFile::restore);
            return Err(fault);
        }
    }
    // Files of one command are usually in one folder.
    let folders: BTreeSet<Option<&Path>> = staged.iter().map(|file| file.target.parent()).collect();
    folders.into_iter().for_each(sync_folder);
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

/// Flushes the folder, so that the renaming is on the disk, too; not all systems allow that.
fn sync_folder(parent: Option<&Path>) {
    let folder = parent.filter(|folder| *folder != Path::new(""));
    if let Ok(folder) = File::open(folder.unwrap_or(Path::new("."))) {
        let _ = folder.sync_all();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An empty folder for one test.
    fn empty_folder(name: &str) -> PathBuf {
        let path = std::env::temp_dir().join(format!("modelmill-write-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir_all(&path).unwrap();
        path
    }

    /// Names and contents of the files of a folder, in order.
    fn contents(folder: &Path) -> Vec<(String, String)> {
        let mut found: Vec<_> = std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .filter(|path| path.is_file())
            .map(|path| {
                let name = path.file_name().unwrap().to_string_lossy().into_owned();
                (name, std::fs::read_to_string(path).unwrap())
            })
            .collect();
        found.sort();
        found
    }

    #[test]
    fn several_files_are_written_together_or_not_at_all() {
        let folder = empty_folder("together");
        let [old, new, late] = ["old", "new", "late"].map(|name| folder.join(name));
        std::fs::write(&old, "1").unwrap();
        let write = |text: &'static str| {
            let bytes = text.as_bytes();
            write_together(&[(&old, bytes), (&new, bytes), (&late, bytes)])
        };
        // Staging the last one fails.
        std::fs::create_dir(&late).unwrap();
        assert_eq!(write("2").unwrap_err().fault, FileFault::Folder);
        assert_eq!(contents(&folder), [("old".to_owned(), "1".to_owned())]);
        std::fs::remove_dir(&late).unwrap();
        write("3").unwrap();
        let names: Vec<String> = contents(&folder).into_iter().map(|(name, text)| name + &text).collect();
        assert_eq!(names, ["late3", "new3", "old3"]);
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn replaced_files_become_the_old_ones_if_a_later_one_cannot_be_replaced() {
        let folder = empty_folder("restore");
        let [old, new, late] = ["old", "new", "late"].map(|name| folder.join(name));
        std::fs::write(&old, "1").unwrap();
        let stage = |path: &Path| StagedFile::new(path, b"2").unwrap().unwrap();
        let mut staged = [stage(&old), stage(&new), stage(&late)];
        // A folder that appears at the last moment cannot be replaced by a file.
        std::fs::create_dir(&late).unwrap();
        assert_eq!(replace_all(&mut staged).unwrap_err().path, late);
        drop(staged);
        assert_eq!(contents(&folder), [("old".to_owned(), "1".to_owned())]);
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn remains_of_a_stopped_program_are_removed_and_those_of_a_running_one_are_kept() {
        let folder = empty_folder("remains");
        let target = folder.join("model.toml");
        for name in [".model.toml.1-0.part", ".model.toml.part", ".other.toml.1-0.part"] {
            std::fs::write(folder.join(name), "half").unwrap();
        }
        let running = PartialFile::create_next_to(&target).unwrap();
        write(&target, b"new").unwrap();
        let names = || -> Vec<String> { contents(&folder).into_iter().map(|(name, _)| name).collect() };
        assert_eq!(names().len(), 4, "{:?}", names());
        assert!(!names().contains(&".model.toml.1-0.part".to_owned()));
        drop(running);
        assert_eq!(names(), [".model.toml.part", ".other.toml.1-0.part", "model.toml"]);
        std::fs::remove_dir_all(folder).unwrap();
    }
}
