//! Recordings: a file of CSV text, Parquet or MATLAB's format 5 goes in, named columns of numbers come out.
//!
//! A column that holds something else than numbers harms only those who ask for it: it is named in
//! the notes, and [`Recording::column`] refuses it with the line at fault.
//! [`Recording::states`](crate::recording::Recording::states) makes a [`Run`](crate::Run) of it.

pub(crate) mod error;
mod formats;
mod intake;
pub(crate) mod notes;

use std::fs::File;
use std::io::{Cursor, Read, Seek};
use std::path::Path;

use bytes::Bytes;
use indexmap::IndexMap;

use error::{Fault, RecordingError};
use formats::{csv, matlab, parquet};
use notes::{Note, nearest};

/// What becomes of samples with NaN, infinite or empty fields.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum NotFinite {
    /// A column that holds such fields is refused when it is asked for.
    #[default]
    Refuse,
    /// Samples where any column holds such a field are left out, counted and said in the notes.
    LeaveOut,
}

/// A column of ours that is an affine sum of the file's: `offset + sum of factor * column`.
#[derive(Debug, Clone, PartialEq)]
pub struct Computed {
    /// Our name.
    pub name: String,
    /// The file's columns with their factors.
    pub terms: Vec<(String, f64)>,
    /// What is added.
    pub offset: f64,
}

/// How a recording is read.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadOptions {
    /// `(ours, theirs)`: the column that the file calls `theirs` is known as `ours`.
    pub renames: Vec<(String, String)>,
    /// Columns that are computed from the file's; each replaces one of its name.
    pub computed: Vec<Computed>,
    /// What becomes of NaN, infinite and empty fields.
    pub not_finite: NotFinite,
    /// Our names of the columns that are needed; the others are neither looked at nor kept.
    /// All are kept if there is no such list.
    pub wanted: Option<Vec<String>>,
    /// Only samples whose time `t` lies between these two, s; the others are passed over, counted and said.
    pub between: Option<(f64, f64)>,
    /// Most numbers that are kept; a recording that holds more is refused before memory runs out.
    pub most_numbers: usize,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self {
            renames: Vec::new(),
            computed: Vec::new(),
            not_finite: NotFinite::default(),
            wanted: None,
            between: None,
            most_numbers: 1 << 26,
        }
    }
}

/// A recording in memory: columns of equal length by name, in the file's order.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    pub(crate) file: String,
    pub(crate) columns: IndexMap<String, Column>,
    /// Names of the columns of the file that were not needed.
    pub(crate) others: Vec<String>,
    pub(crate) lines: Vec<u64>,
    pub(crate) notes: Vec<Note>,
}

/// The numbers of a column, NaN where there are none, and what is wrong with it.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Column {
    pub(crate) values: Vec<f64>,
    pub(crate) text: Option<Defect>,
    pub(crate) not_finite: Option<Defect>,
}

/// Fields of a column that cannot be used: the first of them and how many there are.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Defect {
    pub(crate) line: u64,
    pub(crate) text: String,
    pub(crate) count: usize,
}

impl Recording {
    /// Reads a file; `renames` are pairs `(ours, theirs)`.
    /// Parquet and MATLAB's format 5 are told from CSV text by their first bytes.
    ///
    /// Fails when the file cannot be read, is empty, has no header, duplicate or missing names,
    /// lines of unequal length, or more numbers than [`ReadOptions::most_numbers`].
    pub fn read(path: impl AsRef<Path>, renames: &[(&str, &str)]) -> Result<Self, RecordingError> {
        let renames = renames
            .iter()
            .map(|(ours, theirs)| ((*ours).to_owned(), (*theirs).to_owned()))
            .collect();
        Self::read_with(
            path,
            &ReadOptions {
                renames,
                ..ReadOptions::default()
            },
        )
    }

    /// [`Recording::read`] with all options.
    pub fn read_with(
        path: impl AsRef<Path>,
        options: &ReadOptions,
    ) -> Result<Self, RecordingError> {
        let (stream, file, format) = open(path.as_ref())?;
        let recording = match format {
            Format::Csv => csv::read(stream, &file, options),
            Format::Parquet => parquet::read(stream, &file, options),
            Format::Mat => matlab::read(stream, &file, options),
        };
        recording.map_err(|fault| RecordingError { file, fault })
    }

    /// The names of a file's columns as the file has them; fails when it cannot be read.
    pub fn names_in(path: impl AsRef<Path>) -> Result<Vec<String>, RecordingError> {
        let (stream, file, format) = open(path.as_ref())?;
        let names = match format {
            Format::Csv => csv::names_of(stream),
            Format::Parquet => parquet::names_of(stream),
            Format::Mat => matlab::names_of(stream),
        };
        names.map_err(|fault| RecordingError { file, fault })
    }

    /// [`Recording::read_with`] of a file that is in memory, as what came through a pipe must be; `file` is what messages
    /// call it.
    pub fn from_bytes(
        bytes: &[u8],
        file: &str,
        options: &ReadOptions,
    ) -> Result<Self, RecordingError> {
        let recording = format_of(bytes).and_then(|format| match format {
            Format::Csv => csv::read(bytes, file, options),
            Format::Parquet => parquet::read(Bytes::copy_from_slice(bytes), file, options),
            Format::Mat => matlab::read(Cursor::new(bytes), file, options),
        });
        recording.map_err(|fault| RecordingError {
            file: file.to_owned(),
            fault,
        })
    }

    /// [`Recording::names_in`] of a file that is in memory.
    pub fn names_in_bytes(bytes: &[u8], file: &str) -> Result<Vec<String>, RecordingError> {
        let names = format_of(bytes).and_then(|format| match format {
            Format::Csv => csv::names_of(bytes),
            Format::Parquet => parquet::names_of(Bytes::copy_from_slice(bytes)),
            Format::Mat => matlab::names_of(Cursor::new(bytes)),
        });
        names.map_err(|fault| RecordingError {
            file: file.to_owned(),
            fault,
        })
    }

    /// Reads CSV text from a stream; `file` is what messages call it.
    ///
    /// ```
    /// use modelmill_identify::{ReadOptions, Recording};
    /// let text = "t,theta1\n0,1.5\n0.1,1.6\n";
    /// let recording = Recording::from_reader(text.as_bytes(), "a text", &ReadOptions::default())?;
    /// assert_eq!(recording.column("theta1")?, [1.5, 1.6]);
    /// # Ok::<(), modelmill_identify::RecordingError>(())
    /// ```
    pub fn from_reader(
        stream: impl Read,
        file: &str,
        options: &ReadOptions,
    ) -> Result<Self, RecordingError> {
        csv::read(stream, file, options).map_err(|fault| RecordingError {
            file: file.to_owned(),
            fault,
        })
    }

    /// What messages call the recording.
    pub fn file(&self) -> &str {
        &self.file
    }

    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.lines.len()
    }

    /// Names of all columns after renaming, those that were not needed at the end.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        let others = self.others.iter().map(String::as_str);
        self.columns.keys().map(String::as_str).chain(others)
    }

    /// Whether there is a column of that name.
    pub fn has(&self, name: &str) -> bool {
        self.columns.contains_key(name)
    }

    /// Line of a sample in the file, from 1; for messages.
    pub fn line(&self, sample: usize) -> Option<u64> {
        self.lines.get(sample).copied()
    }

    /// What the user should know about the file.
    pub fn notes(&self) -> &[Note] {
        &self.notes
    }

    /// The numbers of a column, one per sample.
    /// Fails when it is not there or holds fields that are no finite numbers.
    pub fn column(&self, name: &str) -> Result<&[f64], RecordingError> {
        let Some(column) = self.columns.get(name) else {
            return Err(self.fault(missing(name, self.names(), false)));
        };
        if let Some(Defect { line, text, count }) = column.text.clone() {
            return Err(self.fault(Fault::NotANumber {
                column: name.to_owned(),
                line,
                text,
                count,
            }));
        }
        if let Some(Defect { line, text, count }) = column.not_finite.clone() {
            return Err(self.fault(Fault::NotFinite {
                column: name.to_owned(),
                line,
                text,
                count,
            }));
        }
        Ok(&column.values)
    }

    /// The numbers of a column, as [`Recording::column`]; columns of the names `wanted` are not proposed for it.
    pub(crate) fn column_beside(
        &self,
        name: &str,
        wanted: &[String],
    ) -> Result<&[f64], RecordingError> {
        if self.has(name) {
            return self.column(name);
        }
        let others = self
            .names()
            .filter(|name| !wanted.iter().any(|w| w == name));
        let proposed = nearest(name, others).map(str::to_owned);
        let mut fault = missing(name, self.names(), false);
        if let Fault::MissingColumn { nearest, .. } = &mut fault {
            *nearest = proposed;
        }
        Err(self.fault(fault))
    }

    /// The samples from `start` to before `end` as a recording of its own, without the notes.
    pub(crate) fn stretch(&self, file: String, start: usize, end: usize) -> Self {
        let columns = self.columns.iter().map(|(name, column)| {
            let column = Column {
                values: column.values[start..end].to_vec(),
                ..column.clone()
            };
            (name.clone(), column)
        });
        Self {
            file,
            columns: columns.collect(),
            others: self.others.clone(),
            lines: self.lines[start..end].to_vec(),
            notes: Vec::new(),
        }
    }

    pub(crate) fn fault(&self, fault: Fault) -> RecordingError {
        RecordingError {
            file: self.file.clone(),
            fault,
        }
    }
}

/// The fault of a column that is not there.
pub(crate) fn missing<'a>(
    name: &str,
    present: impl Iterator<Item = &'a str>,
    by_renaming: bool,
) -> Fault {
    let present: Vec<String> = present.map(str::to_owned).collect();
    Fault::MissingColumn {
        name: name.to_owned(),
        nearest: nearest(name, present.iter().map(String::as_str)).map(str::to_owned),
        present,
        by_renaming,
    }
}

/// What a file holds, told by its first bytes.
enum Format {
    Csv,
    Parquet,
    Mat,
}

/// Opens a file: the stream at its beginning, what messages call it, and its format.
fn open(path: &Path) -> Result<(File, String, Format), RecordingError> {
    let file = path.display().to_string();
    let fail = |fault| RecordingError {
        file: path.display().to_string(),
        fault,
    };
    let unreadable = |reason: String| fail(Fault::Unreadable { reason });
    if path.is_dir() {
        return Err(unreadable("it is a folder, not a file".to_owned()));
    }
    let mut stream = File::open(path).map_err(|error| unreadable(error.to_string()))?;
    let mut first = Vec::new();
    // What cannot be looked at twice, such as a pipe, can only be text.
    if stream.stream_position().is_err() {
        return Ok((stream, file, Format::Csv));
    }
    (&mut stream)
        .take(19)
        .read_to_end(&mut first)
        .and_then(|_| stream.rewind())
        .map_err(|error| unreadable(error.to_string()))?;
    let format = format_of(&first).map_err(fail)?;
    Ok((stream, file, format))
}

/// The format that the first bytes of a file tell; fails for those that are known and not read.
fn format_of(bytes: &[u8]) -> Result<Format, Fault> {
    match bytes.get(..19).unwrap_or(bytes) {
        [b'P', b'A', b'R', b'1', ..] => Ok(Format::Parquet),
        b"MATLAB 5.0 MAT-file" => Ok(Format::Mat),
        b"MATLAB 7.3 MAT-file" | [0x89, b'H', b'D', b'F', ..] => Err(Fault::Format {
            format: "a MATLAB 7.3 or HDF5 file",
            says: "only MATLAB's format 5 is read; save it again with `save(name, ..., '-v7')`, or as CSV or Parquet"
                .to_owned(),
        }),
        _ => Ok(Format::Csv),
    }
}
