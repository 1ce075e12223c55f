//! Recordings: CSV text goes in, named columns of numbers come out.
//!
//! One header line, one line per sample, separated by commas, semicolons or tabs; a UTF-8 byte
//! order mark and CR LF are fine. A column that holds something else than numbers harms only
//! those who ask for it: it is named in the notes, and [`Recording::column`] refuses it with the
//! line at fault. [`Recording::states`](crate::recording::Recording::states) makes a
//! [`Run`](crate::Run) of it.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Cursor, Read};
use std::path::Path;

use indexmap::IndexMap;

use crate::notes::{Note, count_of, nearest};
use crate::recording_error::{Fault, RecordingError};

/// What becomes of samples with NaN, infinite or empty fields.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum NotFinite {
    /// A column that holds such fields is refused when it is asked for.
    #[default]
    Refuse,
    /// Samples where any column holds such a field are left out, counted and said in the notes.
    LeaveOut,
}

/// How a recording is read.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ReadOptions {
    /// `(ours, theirs)`: the column that the file calls `theirs` is known as `ours`.
    pub renames: Vec<(String, String)>,
    /// What becomes of NaN, infinite and empty fields.
    pub not_finite: NotFinite,
}

/// A recording in memory: columns of equal length by name, in the file's order.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    file: String,
    columns: IndexMap<String, Column>,
    lines: Vec<u64>,
    notes: Vec<Note>,
}

#[derive(Debug, Clone, PartialEq, Default)]
struct Column {
    values: Vec<f64>,
    text: Option<Defect>,
    not_finite: Option<Defect>,
}

/// Fields of a column that cannot be used: the first of them and how many there are.
#[derive(Debug, Clone, PartialEq)]
struct Defect {
    line: u64,
    text: String,
    count: usize,
}

impl Recording {
    /// Reads a CSV file; `renames` are pairs `(ours, theirs)`.
    ///
    /// Fails when the file cannot be read, is empty, has no header, duplicate or missing names,
    /// or lines of unequal length.
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
        let path = path.as_ref();
        let file = path.display().to_string();
        let is_directory = path.is_dir();
        let unreadable = |reason: String| RecordingError {
            file: file.clone(),
            fault: Fault::Unreadable { reason },
        };
        if is_directory {
            return Err(unreadable("it is a folder, not a file".to_owned()));
        }
        let stream = File::open(path).map_err(|error| unreadable(error.to_string()))?;
        Self::from_reader(stream, &file, options)
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
        read(stream, file, options).map_err(|fault| RecordingError {
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

    /// Names of all columns after renaming, in the file's order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.columns.keys().map(String::as_str)
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

fn missing<'a>(name: &str, present: impl Iterator<Item = &'a str>, by_renaming: bool) -> Fault {
    let present: Vec<String> = present.map(str::to_owned).collect();
    Fault::MissingColumn {
        name: name.to_owned(),
        nearest: nearest(name, present.iter().map(String::as_str)).map(str::to_owned),
        present,
        by_renaming,
    }
}

/// The longest header line that is looked at; beyond it the file is no recording.
const LONGEST_HEADER: u64 = 1 << 20;

fn read(stream: impl Read, file: &str, options: &ReadOptions) -> Result<Recording, Fault> {
    let mut stream = BufReader::with_capacity(1 << 16, stream);
    let (header, first_lines) = read_header(&mut stream)?;
    let mut notes = Vec::new();
    let separator = find_separator(&header)?;
    if separator != b',' {
        let name = if separator == b';' {
            "semicolons"
        } else {
            "tabs"
        };
        notes.push(Note::info(format!(
            "The columns of {file} are separated by {name}."
        )));
    }
    let lines_of_text = EvenLines::new(Cursor::new(first_lines).chain(stream));
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(separator)
        .flexible(true)
        .trim(csv::Trim::All)
        .from_reader(lines_of_text);
    let theirs: Vec<String> = reader
        .headers()
        .map_err(unreadable)?
        .iter()
        .map(str::to_owned)
        .collect();
    let names = {
        check_names(&theirs)?;
        rename(&theirs, &options.renames)?
    };
    let mut columns: Vec<Column> = vec![Column::default(); names.len()];
    let mut lines = Vec::new();
    let mut left_out = Vec::new();
    let mut record = csv::ByteRecord::new();
    let mut sample = Vec::with_capacity(names.len());
    while reader.read_byte_record(&mut record).map_err(unreadable)? {
        // The reader stands behind the line's end here; where it began, blank lines are not
        // passed over yet.
        let line = reader.position().line() - 1;
        if record.len() != names.len() {
            return Err(Fault::RaggedLine {
                line,
                have: record.len(),
                expected: names.len(),
            });
        }
        sample.clear();
        sample.extend(record.iter().map(parse));
        if options.not_finite == NotFinite::LeaveOut
            && sample.iter().any(|field| matches!(field, Field::NotFinite))
        {
            left_out.push(line);
            continue;
        }
        lines.push(line);
        for ((column, field), text) in columns.iter_mut().zip(&sample).zip(&record) {
            column.push(field, line, text);
        }
    }
    if lines.is_empty() {
        return Err(Fault::NoSamples);
    }
    if let Some(first) = left_out.first() {
        notes.push(Note::warning(format!(
            "{} of {} samples of {file} {} NaN, infinite or empty fields and {} left out, the first in line {first}.",
            left_out.len(),
            left_out.len() + lines.len(),
            if left_out.len() == 1 { "holds" } else { "hold" },
            if left_out.len() == 1 { "is" } else { "are" },
        )));
    }
    let columns: IndexMap<String, Column> = names.into_iter().zip(columns).collect();
    for (name, column) in &columns {
        for (defect, what) in [
            (&column.text, "text that is no number"),
            (&column.not_finite, "NaN, infinite or empty fields"),
        ] {
            if let Some(Defect { line, count, .. }) = defect {
                notes.push(Note::warning(format!(
                    "Column `{name}` of {file} holds {what} ({}, the first in line {line}) and cannot be used.",
                    count_of(*count, "field", "fields")
                )));
            }
        }
    }
    Ok(Recording {
        file: file.to_owned(),
        columns,
        lines,
        notes,
    })
}

enum Field {
    Number(f64),
    NotFinite,
    Text,
}

fn parse(bytes: &[u8]) -> Field {
    if bytes.is_empty() {
        return Field::NotFinite;
    }
    match std::str::from_utf8(bytes)
        .ok()
        .and_then(|text| text.parse::<f64>().ok())
    {
        Some(number) if number.is_finite() => Field::Number(number),
        Some(_) => Field::NotFinite,
        None => Field::Text,
    }
}

impl Column {
    fn push(&mut self, field: &Field, line: u64, bytes: &[u8]) {
        let defect = match field {
            Field::Number(number) => {
                self.values.push(*number);
                return;
            }
            Field::NotFinite => &mut self.not_finite,
            Field::Text => &mut self.text,
        };
        self.values.push(f64::NAN);
        defect
            .get_or_insert_with(|| Defect {
                line,
                text: String::from_utf8_lossy(bytes).chars().take(60).collect(),
                count: 0,
            })
            .count += 1;
    }
}

/// The same text with LF at the end of every line, the last one included, so that the lines of
/// records can be told: the CSV reader counts a line only when it meets its LF.
struct EvenLines<R> {
    inner: R,
    last: u8,
    ended: bool,
}

impl<R: Read> EvenLines<R> {
    fn new(inner: R) -> Self {
        Self {
            inner,
            last: b'\n',
            ended: false,
        }
    }
}

impl<R: Read> Read for EvenLines<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if buffer.is_empty() || self.ended {
            return Ok(0);
        }
        loop {
            let have = self.inner.read(buffer)?;
            if have == 0 {
                self.ended = true;
                if self.last == b'\n' {
                    return Ok(0);
                }
                buffer[0] = b'\n';
                return Ok(1);
            }
            let mut kept = 0;
            for i in 0..have {
                if buffer[i] != b'\r' {
                    buffer[kept] = buffer[i];
                    kept += 1;
                }
            }
            // Zero would mean the end of the text.
            if kept > 0 {
                self.last = buffer[kept - 1];
                return Ok(kept);
            }
        }
    }
}

/// The header as text without its byte order mark, and the bytes to read again, from the header on.
fn read_header(stream: &mut impl BufRead) -> Result<(String, Vec<u8>), Fault> {
    let mut bytes = Vec::new();
    let unreadable = |error: io::Error| Fault::Unreadable {
        reason: error.to_string(),
    };
    // Blank lines on top stay in the text, so that the lines are counted as in the file.
    let mut limited = stream.take(LONGEST_HEADER);
    while bytes.trim_ascii().is_empty() {
        if limited.read_until(b'\n', &mut bytes).map_err(unreadable)? == 0 {
            return Err(Fault::Empty);
        }
    }
    let looks_like = match bytes.as_slice() {
        [b'P', b'A', b'R', b'1', ..] => Some("a Parquet file"),
        [0xFF, 0xFE, ..] | [0xFE, 0xFF, ..] => Some("UTF-16 text"),
        [b'P', b'K', 3, 4, ..] => Some("a spreadsheet or ZIP archive"),
        [0x1F, 0x8B, ..] => Some("a gzip archive"),
        [b'M', b'A', b'T', b'L', b'A', b'B', ..] => Some("a MATLAB file"),
        _ if bytes.contains(&0) => Some("binary data"),
        line if line.trim_ascii().contains(&b'\r') => {
            Some("text with lone carriage returns as line ends")
        }
        _ if bytes.len() as u64 == LONGEST_HEADER => Some("a file without lines"),
        _ => None,
    };
    if let Some(looks_like) = looks_like {
        return Err(Fault::NotCsv { looks_like });
    }
    let text = bytes
        .strip_prefix(b"\xEF\xBB\xBF")
        .unwrap_or(&bytes)
        .to_vec();
    let Ok(header) = std::str::from_utf8(&text) else {
        return Err(Fault::NotCsv {
            looks_like: "text in another encoding than UTF-8",
        });
    };
    let header = header.trim().to_owned();
    if header.is_empty() {
        return Err(Fault::Empty);
    }
    Ok((header, text))
}

fn find_separator(header: &str) -> Result<u8, Fault> {
    let present: Vec<u8> = [b',', b';', b'\t']
        .into_iter()
        .filter(|s| header.as_bytes().contains(s))
        .collect();
    let is_number = |text: &str| text.trim().trim_matches('"').parse::<f64>().is_ok();
    match present.as_slice() {
        [separator] => {
            let mut fields = header.split(char::from(*separator));
            if fields.all(is_number) {
                Err(Fault::NoHeader)
            } else {
                Ok(*separator)
            }
        }
        [] if is_number(header) => Err(Fault::NoHeader),
        // A single column is hardly a recording, but it is clear what it says.
        [] if !header.contains([' ', '|', ':']) => Ok(b','),
        _ => Err(Fault::UnclearSeparator {
            header: header.chars().take(80).collect(),
        }),
    }
}

fn check_names(names: &[String]) -> Result<(), Fault> {
    for (i, name) in names.iter().enumerate() {
        if name.is_empty() {
            return Err(Fault::UnnamedColumn { place: i + 1 });
        }
    }
    find_duplicate(names, false)
}

fn find_duplicate(names: &[String], by_renaming: bool) -> Result<(), Fault> {
    let mut seen = std::collections::BTreeMap::new();
    for (i, name) in names.iter().enumerate() {
        if let Some(first) = seen.insert(name, i) {
            return Err(Fault::DuplicateColumn {
                name: name.clone(),
                places: [first + 1, i + 1],
                by_renaming,
            });
        }
    }
    Ok(())
}

fn rename(names: &[String], renames: &[(String, String)]) -> Result<Vec<String>, Fault> {
    let mut renamed = names.to_vec();
    for (i, (ours, theirs)) in renames.iter().enumerate() {
        if renames[..i].iter().any(|(o, t)| o == ours || t == theirs) {
            let twice_ours = renames[..i].iter().any(|(o, _)| o == ours);
            return Err(Fault::DuplicateRenaming {
                name: if twice_ours { ours } else { theirs }.clone(),
            });
        }
        match names.iter().position(|name| name == theirs) {
            Some(place) => renamed[place].clone_from(ours),
            None => return Err(missing(theirs, names.iter().map(String::as_str), true)),
        }
    }
    find_duplicate(&renamed, true)?;
    Ok(renamed)
}

fn unreadable(error: csv::Error) -> Fault {
    match error.into_kind() {
        csv::ErrorKind::Io(error) => Fault::Unreadable {
            reason: error.to_string(),
        },
        csv::ErrorKind::Utf8 { .. } => Fault::NotCsv {
            looks_like: "text in another encoding than UTF-8",
        },
        other => Fault::Unreadable {
            reason: format!("{other:?}"),
        },
    }
}
