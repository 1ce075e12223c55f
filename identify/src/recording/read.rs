//! From a file, bytes or a stream to a [`Recording`], whatever the format.

use std::fs::File;
use std::io::{Read, Seek};
use std::path::Path;

use crate::recording::error::{Fault, RecordingError};
use crate::recording::formats::{FORMATS, Format, Input, TELLING_BYTES, format_of};
use crate::recording::{ReadOptions, Recording};

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
        let (input, file, format) = open(path.as_ref())?;
        let recording = format.read(input, &file, options);
        recording.map_err(|fault| RecordingError { file, fault })
    }

    /// The names of a file's columns as the file has them; fails when it cannot be read.
    pub fn names_in(path: impl AsRef<Path>) -> Result<Vec<String>, RecordingError> {
        let (input, file, format) = open(path.as_ref())?;
        let names = format.names(input);
        names.map_err(|fault| RecordingError { file, fault })
    }

    /// [`Recording::read_with`] of a file that is in memory, as what came through a pipe must be; `file` is what messages
    /// call it.
    pub fn from_bytes(
        bytes: &[u8],
        file: &str,
        options: &ReadOptions,
    ) -> Result<Self, RecordingError> {
        let recording = format_of(bytes).read(Input::Bytes(bytes), file, options);
        recording.map_err(|fault| RecordingError {
            file: file.to_owned(),
            fault,
        })
    }

    /// [`Recording::names_in`] of a file that is in memory.
    pub fn names_in_bytes(bytes: &[u8], file: &str) -> Result<Vec<String>, RecordingError> {
        let names = format_of(bytes).names(Input::Bytes(bytes));
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
        let text = format_of(b"").read(Input::Stream(Box::new(stream)), file, options);
        text.map_err(|fault| RecordingError {
            file: file.to_owned(),
            fault,
        })
    }
}

/// What messages call a recording whose bytes came without a file: its name, and what they are unless they are text.
pub fn name_of_bytes(name: &str, bytes: &[u8]) -> String {
    format!("{name}{}", format_of(bytes).suffix())
}

/// What a sample of a file, or of bytes that [`name_of_bytes`] names, stands in: text has lines, tables have rows.
pub fn place_word(file: &str) -> &'static str {
    let extension = Path::new(file).extension();
    let is_of = |format: &dyn Format| {
        let suffix = format.suffix();
        !suffix.is_empty() && file.ends_with(suffix)
            || extension.is_some_and(|extension| {
                let mut endings = format.extensions().iter();
                endings.any(|ending| extension.eq_ignore_ascii_case(ending))
            })
    };
    if FORMATS
        .into_iter()
        .any(|format| format.is_table() && is_of(format))
    {
        "row"
    } else {
        "line"
    }
}

/// Opens a file: what is read from, what messages call it, and its format.
fn open(path: &Path) -> Result<(Input<'static>, String, &'static dyn Format), RecordingError> {
    let file = path.display().to_string();
    let unreadable = |reason: String| RecordingError {
        file: path.display().to_string(),
        fault: Fault::Unreadable { reason },
    };
    if path.is_dir() {
        return Err(unreadable("it is a folder, not a file".to_owned()));
    }
    let mut stream = File::open(path).map_err(|error| unreadable(error.to_string()))?;
    // What cannot be looked at twice, such as a pipe, can only be text.
    if stream.stream_position().is_err() {
        return Ok((Input::Stream(Box::new(stream)), file, format_of(b"")));
    }
    let mut first = Vec::new();
    (&mut stream)
        .take(TELLING_BYTES as u64)
        .read_to_end(&mut first)
        .and_then(|_| stream.rewind())
        .map_err(|error| unreadable(error.to_string()))?;
    Ok((Input::File(stream), file, format_of(&first)))
}
