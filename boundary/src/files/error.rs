//! Why a file cannot be read or written, as data with a remedy.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

/// A file that cannot be read or written, and why.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileError {
    /// The path as it was given.
    pub path: PathBuf,
    /// What is wrong with it.
    pub fault: FileFault,
}

/// What is wrong with a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FileFault {
    /// There is nothing of that name.
    Missing,
    /// A folder stands where a file is expected.
    Folder,
    /// A device or a socket, which might never end.
    Device,
    /// More bytes than `most` were there.
    TooLarge {
        /// The most bytes that would have been read.
        most: u64,
    },
    /// Nothing came through a named pipe.
    Silent {
        /// How long it was waited for, s.
        seconds: u64,
    },
    /// The bytes are no text in UTF-8.
    NoText {
        /// Place of the first byte that is not.
        at: usize,
    },
    /// The file holds something else than what it is named for.
    OtherKind {
        /// Keys of which it has none.
        lacks: String,
    },
    /// Folders cannot be listed here.
    NoList,
    /// The file is one that was read, and would be lost.
    Input,
    /// What the system says otherwise.
    System {
        /// The kind of error.
        kind: io::ErrorKind,
        /// In the system's words.
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

    /// What the system says of this file.
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
    /// What to do about it.
    pub fn remedy(&self) -> &'static str {
        match self {
            Self::Missing => "check the path",
            Self::Folder => "name a file in it",
            Self::Device => "give an ordinary file, or a pipe that ends",
            Self::TooLarge { .. } => {
                "check that this is the file that is meant, and that what is piped in ends"
            }
            Self::Silent { .. } => "start the program that writes into the pipe first",
            Self::NoText { .. } => "save it as UTF-8",
            Self::OtherKind { .. } => "name a file that was written for this",
            Self::NoList => "name the files one by one",
            Self::Input => "choose another name",
            Self::System { kind, .. } => match kind {
                io::ErrorKind::PermissionDenied => "check who may read and write it and its folder",
                io::ErrorKind::StorageFull
                | io::ErrorKind::QuotaExceeded
                | io::ErrorKind::FileTooLarge => "make room, or choose another place",
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
            Self::TooLarge { most } => write!(f, "it holds more than {most} bytes"),
            Self::Silent { seconds } => {
                write!(f, "nothing came through this pipe for {seconds} s")
            }
            Self::NoText { at } => write!(f, "byte {at} is no text in UTF-8"),
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
