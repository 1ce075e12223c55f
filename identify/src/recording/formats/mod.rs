//! The formats of recordings: one list, and a reader for each that hands samples to the intake.
//!
//! To add one, write its [`Format`] in a file of its own and put it into [`FORMATS`].

mod bag;
mod csv;
mod hdf5;
mod matlab;
mod matlab_arrays;
mod mcap;
mod packing;
mod parquet;
mod parquet_pages;
mod rosbag;
mod sqlite;

use std::fs::File;
use std::io::{Cursor, Read, Seek};

use crate::recording::error::RecordingFault;
use crate::recording::tables::TableInfo;
use crate::recording::{ReadOptions, SignalRecording};

/// All formats, in the order in which they are asked whether a file is theirs; text comes last and takes what is left.
pub(crate) const FORMATS: [&dyn RecordingFormat; 8] = [
    &parquet::ParquetFormat,
    &matlab::Matlab5Format,
    &hdf5::Hdf5Format,
    &mcap::McapFormat,
    &rosbag::Rosbag2Format,
    &packing::CompressedFormat(packing::CompressionMethod::Gzip),
    &packing::CompressedFormat(packing::CompressionMethod::Zstd),
    &csv::CsvFormat,
];

/// As many bytes from the beginning of a file as tell its format.
pub(crate) const SIGNATURE_BYTES: usize = 32;

/// How files of one kind are known and read.
pub(crate) trait RecordingFormat: Sync {
    /// What follows the name of a recording that came without a file, so that one sees what it is taken for.
    fn suffix(&self) -> &'static str {
        ""
    }

    /// Endings of the names of such files.
    fn extensions(&self) -> &'static [&'static str] {
        &[]
    }

    /// Whether samples are rows of a table rather than lines of a text.
    fn is_table(&self) -> bool {
        true
    }

    /// Whether a file of another format is in it.
    fn is_compressed(&self) -> bool {
        false
    }

    /// Whether a file that begins with these bytes, [`TELLING_BYTES`] of them if it has as many, is of this kind.
    fn has_signature(&self, first: &[u8]) -> bool;

    /// Reads a recording; `file` is what messages call it.
    fn read(
        &self,
        input: RecordingInput<'_>,
        file: &str,
        options: &ReadOptions,
    ) -> Result<SignalRecording, RecordingFault>;

    /// Names of the columns as the file has them.
    fn names(&self, input: RecordingInput<'_>) -> Result<Vec<String>, RecordingFault>;

    /// What it holds, table by table.
    fn tables(&self, input: RecordingInput<'_>) -> Result<Vec<TableInfo>, RecordingFault>;
}

/// The format of what begins with these bytes.
pub(crate) fn format_of(first: &[u8]) -> &'static dyn RecordingFormat {
    FORMATS
        .into_iter()
        .find(|format| format.has_signature(first))
        .unwrap_or(&csv::CsvFormat)
}

/// Where a format reads from.
pub(crate) enum RecordingInput<'a> {
    /// A file, at its beginning.
    File(File),
    /// What is in memory.
    Bytes(&'a [u8]),
    /// What can be looked at once only, such as a pipe.
    Stream(Box<dyn Read + 'a>),
}

/// A stream that can be looked at anywhere.
pub(crate) trait ReadSeek: Read + Seek {}

impl<T: Read + Seek> ReadSeek for T {}

impl<'a> RecordingInput<'a> {
    /// For those who read from the beginning to the end.
    pub(crate) fn stream(self) -> Box<dyn Read + 'a> {
        match self {
            Self::File(file) => Box::new(file),
            Self::Bytes(bytes) => Box::new(bytes),
            Self::Stream(stream) => stream,
        }
    }

    /// For those who go to and fro; what can be looked at once only is taken into memory.
    pub(crate) fn seekable(self) -> Result<Box<dyn ReadSeek + 'a>, RecordingFault> {
        Ok(match self {
            Self::File(file) => Box::new(file),
            Self::Bytes(bytes) => Box::new(Cursor::new(bytes)),
            Self::Stream(stream) => Box::new(Cursor::new(read_all(stream)?)),
        })
    }
}

/// The most bytes that are kept of what can be looked at once only.
pub(crate) const LONGEST_STREAM: u64 = 3 << 27;

/// All bytes of a stream, which must have an end.
pub(crate) fn read_all(stream: impl Read) -> Result<Vec<u8>, RecordingFault> {
    let unreadable = |reason: String| RecordingFault::Unreadable { reason };
    let mut bytes = Vec::new();
    let read = stream.take(LONGEST_STREAM + 1).read_to_end(&mut bytes);
    read.map_err(|error| unreadable(error.to_string()))?;
    if bytes.len() as u64 > LONGEST_STREAM {
        return Err(unreadable(format!(
            "it has more than {LONGEST_STREAM} bytes"
        )));
    }
    Ok(bytes)
}
