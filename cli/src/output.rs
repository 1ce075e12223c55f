//! Files that commands write. A path and a text go in; the file, or a message with the reason and a remedy, comes out.
//! A command never writes over a file that it reads, unless the user requests it.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use modelmill_boundary::files::{DiskFiles, FileError, FileFault};

use crate::failure::{CommandFailure, CommandOutcome};
use crate::terminal::time_limit::begin_write;

/// The disk of this run. It remembers which files were read, so that they are not written over.
pub(crate) fn disk() -> &'static DiskFiles {
    static DISK: LazyLock<DiskFiles> = LazyLock::new(DiskFiles::default);
    &DISK
}

/// A place to write to that is none of the inputs.
#[derive(Debug, Clone)]
pub(crate) struct OutputFile(PathBuf);

impl OutputFile {
    /// Refuses a target that is one of the files that the command reads, or a folder.
    pub(crate) fn new<'a>(path: &Path, inputs: impl IntoIterator<Item = &'a Path>) -> CommandOutcome<Self> {
        Self::for_flag("--out", path, inputs)
    }

    /// The same for a target that another flag names.
    pub(crate) fn for_flag<'a>(
        flag: &str,
        path: &Path,
        inputs: impl IntoIterator<Item = &'a Path>,
    ) -> CommandOutcome<Self> {
        refuse_dash(flag, path)?;
        // A folder would be an obscure error of the operating system later.
        if path.is_dir() {
            return Err(CommandFailure::Usage(format!(
                "{flag} {}: this is a folder; give the name of a file in it",
                path.display()
            )));
        }
        // A long command would fail at its end.
        if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty())
            && !folder.is_dir()
        {
            return Err(CommandFailure::Input(format!(
                "{flag} {} cannot be written: there is no folder {}; create it first",
                path.display(),
                folder.display()
            )));
        }
        for input in inputs {
            if is_same_file(path, input) {
                return Err(CommandFailure::Usage(format!(
                    "{flag} {} would overwrite a file that this command reads; choose another name",
                    path.display()
                )));
            }
        }
        Ok(Self(path.to_owned()))
    }

    /// Refuses two targets that are the same file: the second would replace the first.
    pub(crate) fn refuse_equal(pair: [(&str, &Self); 2]) -> CommandOutcome {
        let [(flag, one), (other_flag, other)] = pair;
        // A file that does not exist yet has a folder that does.
        let place = |path: &Path| {
            let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
            let folder = folder.unwrap_or(Path::new(".")).canonicalize().ok();
            folder.zip(path.file_name().map(std::ffi::OsStr::to_owned))
        };
        if one.0 == other.0
            || is_same_file(&one.0, &other.0)
            || place(&one.0).is_some_and(|p| Some(p) == place(&other.0))
        {
            return Err(CommandFailure::Usage(format!(
                "{flag} and {other_flag} are the same file, {}; choose two names",
                one.0.display()
            )));
        }
        Ok(())
    }

    /// Writes the file.
    pub(crate) fn write(&self, text: &str) -> CommandOutcome {
        write(&self.0, text)
    }

    /// The path as the user gave it.
    pub(crate) fn path(&self) -> &Path {
        &self.0
    }
}

/// Files that a command writes together: all of them or none.
#[derive(Debug, Default)]
pub(crate) struct OutputSet(Vec<(PathBuf, String)>);

impl OutputSet {
    /// Adds a file; nothing is written yet.
    pub(crate) fn add(&mut self, target: &OutputFile, text: impl Into<String>) {
        self.0.push((target.0.clone(), text.into()));
    }

    /// Adds a file of a folder that belongs to the program.
    pub(crate) fn add_path(&mut self, path: PathBuf, text: impl Into<String>) {
        self.0.push((path, text.into()));
    }

    /// Writes all files. If one cannot be written, all keep their old contents.
    pub(crate) fn write(&self) -> CommandOutcome {
        let files = self.0.iter();
        let files: Vec<(&Path, &[u8])> = files.map(|(path, text)| (path.as_path(), text.as_bytes())).collect();
        let _writing = begin_write();
        disk().write_together(&files).map_err(|error| write_failure(&error))
    }
}

/// Creates the folder of `--out` with its parents. A folder that exists is no error.
pub(crate) fn make_folder(folder: &Path) -> CommandOutcome {
    refuse_dash("--out", folder)?;
    if folder.exists() && !folder.is_dir() {
        return Err(CommandFailure::Input(format!(
            "--out {}: this is a file, but a folder is expected; give the name of a folder, which is created if it does not \
             exist",
            folder.display()
        )));
    }
    std::fs::create_dir_all(folder).map_err(|error| {
        CommandFailure::Input(format!(
            "the folder {} cannot be created: {error}; give another one with --out",
            folder.display()
        ))
    })
}

/// Refuses `-` as a path: many programs use it for standard output, and nobody expects a file of this name.
pub(crate) fn refuse_dash(flag: &str, path: &Path) -> CommandOutcome {
    if path.as_os_str() != "-" {
        return Ok(());
    }
    Err(CommandFailure::Usage(format!(
        "{flag} -: the name of a file is expected; commands that can print to standard output do so without {flag} (a file with \
         this name is `./-`)"
    )))
}

/// Writes a file atomically, but not over one that was read. Fails with the reason and a remedy.
pub(crate) fn write(path: &Path, text: &str) -> CommandOutcome {
    let _writing = begin_write();
    disk()
        .write(path, text.as_bytes())
        .map_err(|error| write_failure(&error))
}

/// Writes a file atomically over one that was read, as the user requested.
pub(crate) fn replace(path: &Path, text: &str) -> CommandOutcome {
    let _writing = begin_write();
    disk()
        .replace(path, text.as_bytes())
        .map_err(|error| write_failure(&error))
}

/// The message for a file that could not be written: path, reason, remedy.
fn write_failure(error: &FileError) -> CommandFailure {
    let path = error.path.display();
    CommandFailure::Input(match &error.fault {
        // Some systems have folders in which no file can be made.
        FileFault::Missing if error.path.parent().is_some_and(Path::is_dir) => {
            format!("{path} cannot be written: its folder does not accept this file; choose another folder")
        }
        FileFault::Missing => format!(
            "{path} cannot be written: there is no such folder; check that the folder exists and may be written to"
        ),
        FileFault::Input => {
            format!("{path} would be overwritten, but this command reads it; choose another name")
        }
        fault => format!("{path} cannot be written: {fault}; {}", fault.remedy()),
    })
}

/// Whether two paths lead to the same file, also through symbolic or hard links.
fn is_same_file(a: &Path, b: &Path) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        // A hard link is the same file under a path of its own.
        if let (Ok(a), Ok(b)) = (a.metadata(), b.metadata())
            && (a.dev(), a.ino()) == (b.dev(), b.ino())
        {
            return true;
        }
    }
    // Symbolic links and `..` disappear in canonical paths. A file that does not exist yet has none.
    match (a.canonicalize(), b.canonicalize()) {
        (Ok(a), Ok(b)) => a == b,
        _ => false,
    }
}
