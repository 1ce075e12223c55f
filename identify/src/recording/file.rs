//! A recording that is opened once and read as often as needed. An ordinary file is read from disk each time, so that
//! it may be larger than memory. The contents of pipes, files in memory and tables are kept in memory.

use std::fs::File;
use std::io::{Read, Seek};
use std::path::Path;
use std::sync::Arc;

use modelmill_boundary::files::{FileSource, OpenFile};

use crate::recording::error::{RecordingError, RecordingFault};
#[cfg(feature = "parquet")]
use crate::recording::formats::{DataSetFiles, ParquetFormat};
use crate::recording::formats::{LONGEST_STREAM, RecordingFormat, RecordingInput, SIGNATURE_BYTES, format_of};
use crate::recording::table::{self, MemoryTable};
use crate::recording::{ReadOptions, SignalRecording, TableInfo, display_name_of_bytes};

/// An open recording.
pub struct RecordingFile {
    /// Its name in messages.
    name: String,
    /// Where its bytes are.
    source: RecordingSource,
}

/// Where the samples come from.
enum RecordingSource {
    /// A file on disk with its format.
    File(&'static dyn RecordingFormat, File),
    /// Files of a data set with their description.
    #[cfg(feature = "parquet")]
    DataSet(DataSetFiles),
    /// A complete file in memory with its format.
    Memory(&'static dyn RecordingFormat, Arc<Vec<u8>>),
    /// Columns in memory.
    Table(MemoryTable),
}

impl RecordingFile {
    /// Opens a recording. Fails when it cannot be read, or when a pipe has more bytes than `LONGEST_STREAM`.
    pub fn open(files: &dyn FileSource, path: &Path) -> Result<Self, RecordingError> {
        let name = path.display().to_string();
        let fail = |reason: String| RecordingError {
            file: path.display().to_string(),
            fault: RecordingFault::Unreadable { reason },
        };
        #[cfg(feature = "parquet")]
        if let Some(set) = DataSetFiles::open(files, path).map_err(|fault| RecordingError {
            file: name.clone(),
            fault,
        })? {
            return Ok(Self {
                name,
                source: RecordingSource::DataSet(set),
            });
        }
        let opened = files.open(path, LONGEST_STREAM);
        match opened.map_err(|error| fail(error.fault.to_string()))? {
            OpenFile::File(mut file) => {
                // The first bytes decide the format.
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

    /// Makes a recording of columns in memory; `name` is its name in messages. Fails when columns differ in length.
    pub fn from_table(name: &str, columns: Vec<(String, Vec<f64>)>) -> Result<Self, RecordingError> {
        let name = format!("{name}{}", table::SUFFIX);
        match MemoryTable::new(columns) {
            Ok(table) => Ok(Self {
                name,
                source: RecordingSource::Table(table),
            }),
            Err(fault) => Err(RecordingError { file: name, fault }),
        }
    }

    /// Its name in messages.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The names of its columns as in the file. Fails when the file cannot be read.
    pub fn names(&self) -> Result<Vec<String>, RecordingError> {
        self.dispatch_to_source(|format, input| format.names(input), |table| Ok(table.names()))
    }

    /// Its tables or topics with their columns. Fails when the file cannot be read.
    pub fn tables(&self) -> Result<Vec<TableInfo>, RecordingError> {
        self.dispatch_to_source(
            |format, input| format.tables(input),
            |table| Ok(vec![table.table_info()]),
        )
    }

    /// Reads it with the given options. Fails as [`SignalRecording::read`] does.
    pub fn read(&self, options: &ReadOptions) -> Result<SignalRecording, RecordingError> {
        self.dispatch_to_source(
            |format, input| format.read(input, &self.name, options),
            |table| table.read(&self.name, options),
        )
    }

    /// Calls the function for its kind of source, with input that starts at the first byte; adds the name to faults.
    fn dispatch_to_source<T>(
        &self,
        of_format: impl FnOnce(&dyn RecordingFormat, RecordingInput<'_>) -> Result<T, RecordingFault>,
        of_table: impl FnOnce(&MemoryTable) -> Result<T, RecordingFault>,
    ) -> Result<T, RecordingError> {
        let answer = match &self.source {
            RecordingSource::Table(table) => of_table(table),
            #[cfg(feature = "parquet")]
            RecordingSource::DataSet(set) => of_format(&ParquetFormat, RecordingInput::DataSet(set)),
            RecordingSource::Memory(format, bytes) => of_format(*format, RecordingInput::Bytes(bytes)),
            // The handle is shared, so the position must be reset before each read.
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

    /// A fault of this recording.
    pub(crate) fn fault(&self, fault: RecordingFault) -> RecordingError {
        RecordingError {
            file: self.name.clone(),
            fault,
        }
    }
}
