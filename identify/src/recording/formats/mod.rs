//! The formats of recordings: one list, and a reader for each that hands samples to the intake.
//!
//! To add one, write its [`Format`] in a file of its own and put it into [`FORMATS`].

#[cfg(feature = "logs")]
mod bag;
mod csv;
#[cfg(feature = "hdf5")]
mod hdf5;
#[cfg(not(all(feature = "parquet", feature = "hdf5", feature = "logs")))]
mod left_out;
mod matlab;
mod matlab_arrays;
#[cfg(feature = "logs")]
mod mcap;
mod packing;
#[cfg(feature = "parquet")]
mod parquet;
#[cfg(feature = "parquet")]
mod parquet_pages;
#[cfg(feature = "logs")]
mod rosbag;
#[cfg(feature = "logs")]
mod sqlite;

use std::fs::File;
use std::io::{Cursor, Read, Seek};

use crate::recording::error::Fault;
use crate::recording::tables::TableInfo;
use crate::recording::{ReadOptions, Recording};

/// All formats, in the order in which they are asked whether a file is theirs; text comes last and takes what is left.
pub(crate) const FORMATS: [&dyn Format; 8] = [
    #[cfg(feature = "parquet")]
    &parquet::Parquet,
    #[cfg(not(feature = "parquet"))]
    &left_out::PARQUET,
    &matlab::Matlab5,
    #[cfg(feature = "hdf5")]
    &hdf5::Hdf5,
    #[cfg(not(feature = "hdf5"))]
    &left_out::HDF5,
    #[cfg(feature = "logs")]
    &mcap::Mcap,
    #[cfg(not(feature = "logs"))]
    &left_out::MCAP,
    #[cfg(feature = "logs")]
    &rosbag::Rosbag2,
    #[cfg(not(feature = "logs"))]
    &left_out::ROSBAG2,
    &packing::Packed(packing::Packing::Gzip),
    &packing::Packed(packing::Packing::Zstd),
    &csv::Csv,
];

/// As many bytes from the beginning of a file as tell its format.
pub(crate) const TELLING_BYTES: usize = 32;

/// How files of one kind are known and read.
pub(crate) trait Format: Sync {
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
    fn is_packed(&self) -> bool {
        false
    }

    /// Whether a file that begins with these bytes, [`TELLING_BYTES`] of them if it has as many, is of this kind.
    fn begins(&self, first: &[u8]) -> bool;

    /// Reads a recording; `file` is what messages call it.
    fn read(&self, input: Input<'_>, file: &str, options: &ReadOptions)
    -> Result<Recording, Fault>;

    /// Names of the columns as the file has them.
    fn names(&self, input: Input<'_>) -> Result<Vec<String>, Fault>;

    /// What it holds, table by table.
    fn tables(&self, input: Input<'_>) -> Result<Vec<TableInfo>, Fault>;
}

/// The format of what begins with these bytes.
pub(crate) fn format_of(first: &[u8]) -> &'static dyn Format {
    FORMATS
        .into_iter()
        .find(|format| format.begins(first))
        .unwrap_or(&csv::Csv)
}

/// Where a format reads from.
pub(crate) enum Input<'a> {
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

impl<'a> Input<'a> {
    /// For those who read from the beginning to the end.
    pub(crate) fn stream(self) -> Box<dyn Read + 'a> {
        match self {
            Self::File(file) => Box::new(file),
            Self::Bytes(bytes) => Box::new(bytes),
            Self::Stream(stream) => stream,
        }
    }

    /// For those who go to and fro; what can be looked at once only is taken into memory.
    pub(crate) fn seekable(self) -> Result<Box<dyn ReadSeek + 'a>, Fault> {
        Ok(match self {
            Self::File(file) => Box::new(file),
            Self::Bytes(bytes) => Box::new(Cursor::new(bytes)),
            Self::Stream(stream) => Box::new(Cursor::new(all_of(stream)?)),
        })
    }
}

/// The most bytes that are kept of what can be looked at once only.
pub(crate) const LONGEST_STREAM: u64 = 3 << 27;

/// All bytes of a stream, which must have an end.
pub(crate) fn all_of(stream: impl Read) -> Result<Vec<u8>, Fault> {
    let unreadable = |reason: String| Fault::Unreadable { reason };
    let mut bytes = Vec::new();
    let read = stream.take(LONGEST_STREAM + 1).read_to_end(&mut bytes);
    read.map_err(|error| unreadable(error.to_string()))?;
    if bytes.len() as u64 > LONGEST_STREAM {
        return Err(unreadable(format!(
            "it holds more than {LONGEST_STREAM} bytes"
        )));
    }
    Ok(bytes)
}
