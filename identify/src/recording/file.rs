//! The file of a recording, opened once: an ordinary file is read from its place, so that it may be longer than memory;
//! what came through a pipe, files that are in memory anyway, and tables are read from there.

use std::fs::File;
use std::io::{Read, Seek};
use std::path::Path;
use std::sync::Arc;

use modelmill_boundary::files::{FileSource, OpenFile};

use crate::recording::error::{RecordingError, RecordingFault};
use crate::recording::formats::{
    LONGEST_STREAM, RecordingFormat, RecordingInput, SIGNATURE_BYTES, format_of,
};
use crate::recording::table::{self, MemoryTable};
use crate::recording::{ReadOptions, SignalRecording, TableInfo, display_name_of_bytes};

/// A recording that is open, to be read as often as needed.
pub struct RecordingFile {
    name: String,
    source: RecordingSource,
}

enum RecordingSource {
    File(&'static dyn RecordingFormat, File),
    Memory(&'static dyn RecordingFormat, Arc<Vec<u8>>),
    Table(MemoryTable),
}

impl RecordingFile {
    /// Opens a recording; fails when it cannot be read, or is a pipe that does not end.
    pub fn open(files: &dyn FileSource, path: &Path) -> Result<Self, RecordingError> {
        let name = path.display().to_string();
        let fail = |reason: String| RecordingError {
            file: path.display().to_string(),
            fault: RecordingFault::Unreadable { reason },
        };
        let opened = files.open(path, LONGEST_STREAM);
        match opened.map_err(|error| fail(error.fault.to_string()))? {
            OpenFile::File(mut file) => {
                let mut first = Vec::new();
                (&mut file)
                    .take(SIGNATURE_BYTES as u64)
                    .read_to_end(&mut first)
                    .map_err(|error| fail(error.to_string()))?;
                Ok(Self {
                    name,
                    source: RecordingSource::File(format_of(&first), file),
                })
            }
            OpenFile::Memory(bytes) => Ok(Self {
                name: display_name_of_bytes(&name, &bytes),
                source: RecordingSource::Memory(format_of(&bytes), bytes),
            }),
        }
    }

    /// A table of columns in memory; `name` is what messages call it. Fails when columns differ in length.
    pub fn from_table(
        name: &str,
        columns: Vec<(String, Vec<f64>)>,
    ) -> Result<Self, RecordingError> {
        let name = format!("{name}{}", table::SUFFIX);
        match MemoryTable::new(columns) {
            Ok(table) => Ok(Self {
                name,
                source: RecordingSource::Table(table),
            }),
            Err(fault) => Err(RecordingError { file: name, fault }),
        }
    }

    /// What messages call it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The names of its columns as the file has them; fails when it cannot be read.
    pub fn names(&self) -> Result<Vec<String>, RecordingError> {
        self.dispatch_to_source(
            |format, input| format.names(input),
            |table| Ok(table.names()),
        )
    }

    /// What it holds, table by table or topic by topic; fails when it cannot be read.
    pub fn tables(&self) -> Result<Vec<TableInfo>, RecordingError> {
        self.dispatch_to_source(
            |format, input| format.tables(input),
            |table| Ok(vec![table.table_info()]),
        )
    }

    /// Reads it; fails as [`SignalRecording::read`] does.
    pub fn read(&self, options: &ReadOptions) -> Result<SignalRecording, RecordingError> {
        self.dispatch_to_source(
            |format, input| format.read(input, &self.name, options),
            |table| table.read(&self.name, options),
        )
    }

    /// What its format says of all of it, from its beginning.
    fn dispatch_to_source<T>(
        &self,
        of_format: impl FnOnce(&dyn RecordingFormat, RecordingInput<'_>) -> Result<T, RecordingFault>,
        of_table: impl FnOnce(&MemoryTable) -> Result<T, RecordingFault>,
    ) -> Result<T, RecordingError> {
        let answer = match &self.source {
            RecordingSource::Table(table) => of_table(table),
            RecordingSource::Memory(format, bytes) => {
                of_format(*format, RecordingInput::Bytes(bytes))
            }
            RecordingSource::File(format, file) => {
                let rewound = file.try_clone().and_then(|mut file| {
                    file.rewind()?;
                    Ok(RecordingInput::File(file))
                });
                rewound
                    .map_err(|error| RecordingFault::Unreadable {
                        reason: error.to_string(),
                    })
                    .and_then(|input| of_format(*format, input))
            }
        };
        answer.map_err(|fault| self.fault(fault))
    }

    pub(crate) fn fault(&self, fault: RecordingFault) -> RecordingError {
        RecordingError {
            file: self.name.clone(),
            fault,
        }
    }
}
