//! The file of a recording, opened once: an ordinary file is read from its place, so that it may be longer than memory;
//! what came through a pipe, and files that are in memory anyway, are read from there.

use std::fs::File;
use std::io::{Read, Seek};
use std::path::Path;
use std::sync::Arc;

use modelmill_boundary::files::{Files, Opened};

use crate::recording::error::{Fault, RecordingError};
use crate::recording::formats::{Format, Input, LONGEST_STREAM, TELLING_BYTES, format_of};
use crate::recording::{ReadOptions, Recording, TableInfo, name_of_bytes};

/// A recording that is open, to be read as often as needed.
pub struct RecordingFile {
    name: String,
    format: &'static dyn Format,
    source: Source,
}

enum Source {
    File(File),
    Memory(Arc<Vec<u8>>),
}

impl RecordingFile {
    /// Opens a recording; fails when it cannot be read, or is a pipe that does not end.
    pub fn open(files: &dyn Files, path: &Path) -> Result<Self, RecordingError> {
        let name = path.display().to_string();
        let fail = |reason: String| RecordingError {
            file: path.display().to_string(),
            fault: Fault::Unreadable { reason },
        };
        let opened = files.open(path, LONGEST_STREAM);
        match opened.map_err(|error| fail(error.fault.to_string()))? {
            Opened::File(mut file) => {
                let mut first = Vec::new();
                (&mut file)
                    .take(TELLING_BYTES as u64)
                    .read_to_end(&mut first)
                    .map_err(|error| fail(error.to_string()))?;
                Ok(Self {
                    name,
                    format: format_of(&first),
                    source: Source::File(file),
                })
            }
            Opened::Memory(bytes) => Ok(Self {
                name: name_of_bytes(&name, &bytes),
                format: format_of(&bytes),
                source: Source::Memory(bytes),
            }),
        }
    }

    /// What messages call it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The names of its columns as the file has them; fails when it cannot be read.
    pub fn names(&self) -> Result<Vec<String>, RecordingError> {
        let names = self.input().and_then(|input| self.format.names(input));
        names.map_err(|fault| self.fault(fault))
    }

    /// What it holds, table by table or topic by topic; fails when it cannot be read.
    pub fn tables(&self) -> Result<Vec<TableInfo>, RecordingError> {
        let tables = self.input().and_then(|input| self.format.tables(input));
        tables.map_err(|fault| self.fault(fault))
    }

    /// Reads it; fails as [`Recording::read`] does.
    pub fn read(&self, options: &ReadOptions) -> Result<Recording, RecordingError> {
        let input = self.input();
        let recording = input.and_then(|input| self.format.read(input, &self.name, options));
        recording.map_err(|fault| self.fault(fault))
    }

    /// All of it, from its beginning.
    fn input(&self) -> Result<Input<'_>, Fault> {
        match &self.source {
            Source::Memory(bytes) => Ok(Input::Bytes(bytes)),
            Source::File(file) => {
                let rewound = file.try_clone().and_then(|mut file| {
                    file.rewind()?;
                    Ok(Input::File(file))
                });
                rewound.map_err(|error| Fault::Unreadable {
                    reason: error.to_string(),
                })
            }
        }
    }

    pub(crate) fn fault(&self, fault: Fault) -> RecordingError {
        RecordingError {
            file: self.name.clone(),
            fault,
        }
    }
}
