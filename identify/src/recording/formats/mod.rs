//! The formats of recordings: one list, and for each a reader that passes samples to the intake.
//!
//! To add one, implement [`RecordingFormat`] in a file of its own and add it to [`FORMATS`].

#[cfg(feature = "logs")]
mod bag;
mod csv;
#[cfg(not(all(feature = "parquet", feature = "hdf5", feature = "logs")))]
mod disabled;
#[cfg(feature = "hdf5")]
mod hdf5;
#[cfg(feature = "parquet")]
mod lerobot;
mod matlab;
mod matlab_arrays;
#[cfg(feature = "logs")]
mod mcap;
mod packing;
#[cfg(feature = "parquet")]
mod parquet;
#[cfg(feature = "parquet")]
mod parquet_columns;
#[cfg(feature = "parquet")]
mod parquet_pages;
#[cfg(feature = "parquet")]
mod parquet_split;
#[cfg(feature = "parquet")]
mod parquet_values;
#[cfg(feature = "logs")]
mod rosbag;
#[cfg(feature = "logs")]
mod rosbag1;
#[cfg(feature = "logs")]
mod sqlite;
mod text_fields;
mod text_layout;
mod text_time;

use std::fs::File;
use std::io::{Cursor, Read, Seek};

use crate::recording::error::RecordingFault;
use crate::recording::tables::TableInfo;
use crate::recording::{ReadOptions, SignalRecording};
#[cfg(feature = "parquet")]
pub(crate) use lerobot::DataSetFiles;
#[cfg(feature = "parquet")]
pub(crate) use parquet::ParquetFormat;

/// All formats, in the order in which their signatures are compared. Text is last and accepts everything.
pub(crate) const FORMATS: [&dyn RecordingFormat; 9] = [
    #[cfg(feature = "parquet")]
    &parquet::ParquetFormat,
    #[cfg(not(feature = "parquet"))]
    &disabled::PARQUET,
    &matlab::Matlab5Format,
    #[cfg(feature = "hdf5")]
    &hdf5::Hdf5Format,
    #[cfg(not(feature = "hdf5"))]
    &disabled::HDF5,
    #[cfg(feature = "logs")]
    &mcap::McapFormat,
    #[cfg(not(feature = "logs"))]
    &disabled::MCAP,
    #[cfg(feature = "logs")]
    &rosbag::Rosbag2Format,
    #[cfg(not(feature = "logs"))]
    &disabled::ROSBAG2,
    #[cfg(feature = "logs")]
    &rosbag1::Rosbag1Format,
    #[cfg(not(feature = "logs"))]
    &disabled::ROSBAG1,
    &packing::CompressedFormat(packing::CompressionMethod::Gzip),
    &packing::CompressedFormat(packing::CompressionMethod::Zstd),
    &csv::CsvFormat,
];

/// Number of bytes at the start of a file that identify its format.
pub(crate) const SIGNATURE_BYTES: usize = 32;

/// A format of files: how it is recognised and read.
pub(crate) trait RecordingFormat: Sync {
    /// Suffix of the name of a recording without a file, which states the format in messages.
    fn suffix(&self) -> &'static str {
        ""
    }

    /// Usual extensions of such files, without the point.
    fn extensions(&self) -> &'static [&'static str] {
        &[]
    }

    /// Whether samples are rows of a table; otherwise they are lines of text.
    fn is_table(&self) -> bool {
        true
    }

    /// Whether the contents are a file of another format.
    fn is_compressed(&self) -> bool {
        false
    }

    /// Whether a file that begins with these bytes has this format. There are [`SIGNATURE_BYTES`] of them, or fewer
    /// if the file is shorter.
    fn has_signature(&self, first: &[u8]) -> bool;

    /// Reads a recording; `file` is its name in messages.
    fn read(
        &self,
        input: RecordingInput<'_>,
        file: &str,
        options: &ReadOptions,
    ) -> Result<SignalRecording, RecordingFault>;

    /// Names of the columns as in the file.
    fn names(&self, input: RecordingInput<'_>) -> Result<Vec<String>, RecordingFault>;

    /// The tables or topics of the file.
    fn tables(&self, input: RecordingInput<'_>) -> Result<Vec<TableInfo>, RecordingFault>;
}

/// The format of a file that begins with these bytes.
pub(crate) fn format_of(first: &[u8]) -> &'static dyn RecordingFormat {
    FORMATS
        .into_iter()
        .find(|format| format.has_signature(first))
        .unwrap_or(&csv::CsvFormat)
}

/// The source that a format reads from.
pub(crate) enum RecordingInput<'a> {
    /// A file, positioned at its start.
    File(File),
    /// The files of a data set with their description.
    #[cfg(feature = "parquet")]
    DataSet(&'a DataSetFiles),
    /// Bytes in memory.
    Bytes(&'a [u8]),
    /// A stream that can be read only once, such as a pipe.
    Stream(Box<dyn Read + 'a>),
}

/// A stream with random access.
pub(crate) trait ReadSeek: Read + Seek {}

impl<T: Read + Seek> ReadSeek for T {}

impl<'a> RecordingInput<'a> {
    /// The source as a stream from start to end.
    pub(crate) fn stream(self) -> Box<dyn Read + 'a> {
        match self {
            Self::File(file) => Box::new(file),
            // Only the format of data sets gets them, and it does not read them as streams.
            #[cfg(feature = "parquet")]
            Self::DataSet(_) => Box::new(std::io::empty()),
            Self::Bytes(bytes) => Box::new(bytes),
            Self::Stream(stream) => stream,
        }
    }

    /// The source with random access; a stream is read into memory.
    pub(crate) fn seekable(self) -> Result<Box<dyn ReadSeek + 'a>, RecordingFault> {
        Ok(match self {
            Self::File(file) => Box::new(file),
            #[cfg(feature = "parquet")]
            Self::DataSet(_) => Box::new(Cursor::new(&[])),
            Self::Bytes(bytes) => Box::new(Cursor::new(bytes)),
            Self::Stream(stream) => Box::new(Cursor::new(read_all(stream)?)),
        })
    }
}

/// Most bytes of a stream that are kept in memory.
pub(crate) const LONGEST_STREAM: u64 = 3 << 27;

/// All bytes of a stream. Fails when there are more than [`LONGEST_STREAM`].
pub(crate) fn read_all(stream: impl Read) -> Result<Vec<u8>, RecordingFault> {
    let unreadable = |reason: String| RecordingFault::Unreadable { reason };
    // One byte more than allowed shows that the stream is too long.
    let mut bytes = Vec::new();
    let read = stream.take(LONGEST_STREAM + 1).read_to_end(&mut bytes);
    read.map_err(|error| unreadable(error.to_string()))?;
    if bytes.len() as u64 > LONGEST_STREAM {
        return Err(unreadable(format!("it has more than {LONGEST_STREAM} bytes")));
    }
    Ok(bytes)
}
