//! Faults of files as data, each with a remedy.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

/// A file that cannot be read or written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileError {
    /// The path as it was given.
    pub path: PathBuf,
    /// The reason.
    pub fault: FileFault,
}

/// Why a file cannot be read or written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FileFault {
    /// Nothing has this path.
    Missing,
    /// The path leads to a folder.
    Folder,
    /// The path leads to a device or a socket, which might never end.
    Device,
    /// The file is too large.
    TooLarge {
        /// The limit in bytes.
        most: u64,
    },
    /// A named pipe gave no bytes in time.
    Silent {
        /// The timeout, s.
        seconds: u64,
    },
    /// Nobody read bytes from a named pipe in time.
    Unread {
        /// The timeout, s.
        seconds: u64,
    },
    /// The bytes are not UTF-8.
    NoText {
        /// Position of the first invalid byte.
        at: usize,
    },
    /// The file has other contents than expected.
    OtherKind {
        /// The keys of which it has none.
        lacks: String,
    },
    /// Folders cannot be listed here.
    NoList,
    /// The file was read by this program and would be overwritten.
    Input,
    /// Any other error of the operating system.
    System {
        /// The kind of error.
        kind: io::ErrorKind,
        /// Its message.
        says: String,
    },
}

impl FileError {
    /// A fault of this file.
    pub fn new(path: &Path, fault: FileFault) -> Self {
        Self {
            path: path.to_owned(),
            fault,
        }
    }

    /// The fault for an error of the operating system on this file.
    pub fn from_io_error(path: &Path, error: &io::Error) -> Self {
        let fault = match error.kind() {
            io::ErrorKind::NotFound => FileFault::Missing,
            io::ErrorKind::IsADirectory => FileFault::Folder,
            kind => FileFault::System {
                kind,
                says: error.to_string(),
            },
        };
        Self::new(path, fault)
    }
}

impl FileFault {
    /// What to do, as the end of a sentence.
    pub fn remedy(&self) -> &'static str {
        match self {
            Self::Missing => "check the path",
            Self::Folder => "name a file in it",
            Self::Device => "give an ordinary file, or a pipe that ends",
            Self::TooLarge { .. } => "check that this is the intended file, and that the pipe ends",
            Self::Silent { .. } => "start the program that writes into the pipe first",
            Self::Unread { .. } => "start the program that reads from the pipe first",
            Self::NoText { .. } => "save it as UTF-8",
            Self::OtherKind { .. } => "name a file that was written for this",
            Self::NoList => "name the files one by one",
            Self::Input => "choose another name",
            Self::System { kind, .. } => match kind {
                io::ErrorKind::PermissionDenied => "check the permissions of the file and its folder",
                io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded | io::ErrorKind::FileTooLarge => {
                    "make room, or choose another place"
                }
                _ => "check that the folder exists and may be read and written to",
            },
        }
    }
}

impl fmt::Display for FileFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing => f.write_str("no such file"),
            Self::Folder => f.write_str("it is a folder, not a file"),
            Self::Device => f.write_str("it is a device, not a file"),
            Self::TooLarge { most } => write!(f, "it has more than {most} bytes"),
            Self::Silent { seconds } => {
                write!(f, "nothing came through this pipe for {seconds} s")
            }
            Self::Unread { seconds } => {
                write!(f, "nothing was read from this pipe for {seconds} s")
            }
            Self::NoText { at } => write!(f, "byte {at} is not UTF-8 text"),
            Self::OtherKind { lacks } => {
                write!(f, "it is something else: it has no `{lacks}` at its top")
            }
            Self::NoList => f.write_str("its files cannot be listed"),
            Self::Input => f.write_str("it was read, and would be overwritten"),
            Self::System { says, .. } => f.write_str(says),
        }
    }
}

impl fmt::Display for FileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (path, fault) = (self.path.display(), &self.fault);
        write!(f, "{path}: {fault}; {}", fault.remedy())
    }
}

impl std::error::Error for FileError {}
