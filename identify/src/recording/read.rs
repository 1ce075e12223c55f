//! Reads a [`SignalRecording`] from a file, from bytes or from a stream, in any supported format.

use std::io::Read;
use std::path::Path;

use modelmill_boundary::files::DiskFiles;

use crate::recording::error::RecordingError;
use crate::recording::file::RecordingFile;
use crate::recording::formats::{FORMATS, RecordingFormat, RecordingInput, format_of};
use crate::recording::table;
use crate::recording::{ReadOptions, SignalRecording};

impl SignalRecording {
    /// Reads a file; `renames` are pairs `(ours, theirs)`. The first bytes decide the format; CSV text is the
    /// default.
    ///
    /// Fails when the file cannot be read, is empty, has no header, has duplicate or missing names, has lines of
    /// unequal length, or has more numbers than [`ReadOptions::max_numbers`].
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

    /// [`SignalRecording::read`] with all options.
    pub fn read_with(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Self, RecordingError> {
        RecordingFile::open(&DiskFiles::default(), path.as_ref())?.read(options)
    }

    /// The names of the columns as in the file. Fails when it cannot be read.
    pub fn names_in(path: impl AsRef<Path>) -> Result<Vec<String>, RecordingError> {
        RecordingFile::open(&DiskFiles::default(), path.as_ref())?.names()
    }

    /// [`SignalRecording::read_with`] for a file in memory; `file` is its name in messages.
    pub fn from_bytes(bytes: &[u8], file: &str, options: &ReadOptions) -> Result<Self, RecordingError> {
        let recording = format_of(bytes).read(RecordingInput::Bytes(bytes), file, options);
        recording.map_err(|fault| RecordingError {
            file: file.to_owned(),
            fault,
        })
    }

    /// [`SignalRecording::names_in`] for a file in memory.
    pub fn names_in_bytes(bytes: &[u8], file: &str) -> Result<Vec<String>, RecordingError> {
        let names = format_of(bytes).names(RecordingInput::Bytes(bytes));
        names.map_err(|fault| RecordingError {
            file: file.to_owned(),
            fault,
        })
    }

    /// Reads CSV text from a stream; `file` is its name in messages.
    ///
    /// ```
    /// use modelmill_identify::{ReadOptions, SignalRecording};
    /// let text = "t,theta1\n0,1.5\n0.1,1.6\n";
    /// let recording = SignalRecording::from_reader(text.as_bytes(), "a text", &ReadOptions::default())?;
    /// assert_eq!(recording.column("theta1")?, [1.5, 1.6]);
    /// # Ok::<(), modelmill_identify::RecordingError>(())
    /// ```
    pub fn from_reader(stream: impl Read, file: &str, options: &ReadOptions) -> Result<Self, RecordingError> {
        let text = format_of(b"").read(RecordingInput::Stream(Box::new(stream)), file, options);
        text.map_err(|fault| RecordingError {
            file: file.to_owned(),
            fault,
        })
    }
}

/// The name in messages of a recording whose bytes came without a file. A suffix states the format, unless it is
/// text.
pub fn display_name_of_bytes(name: &str, bytes: &[u8]) -> String {
    format!("{name}{}", format_of(bytes).suffix())
}

/// Whether a file has the extension of a supported format; case does not matter.
pub fn has_recording_extension(path: &Path) -> bool {
    let mut endings = FORMATS.into_iter().flat_map(<dyn RecordingFormat>::extensions);
    path.extension()
        .is_some_and(|extension| endings.any(|ending| extension.eq_ignore_ascii_case(ending)))
}

/// The word for the place of a sample in messages: `line` for text, `row` for tables.
///
/// `file` is the name of a file, or one made by [`display_name_of_bytes`].
pub fn sample_place_word(file: &str) -> &'static str {
    let extension = Path::new(file).extension();
    let is_of = |format: &dyn RecordingFormat| {
        let suffix = format.suffix();
        !suffix.is_empty() && file.ends_with(suffix)
            || extension.is_some_and(|extension| {
                let mut endings = format.extensions().iter();
                endings.any(|ending| extension.eq_ignore_ascii_case(ending))
            })
    };
    let mut tables = FORMATS.into_iter().filter(|format| format.is_table());
    if file.ends_with(table::SUFFIX) || tables.any(is_of) {
        "row"
    } else {
        "line"
    }
}
