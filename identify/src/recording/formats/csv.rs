//! Recordings as CSV text: one header line, then one line per sample. Fields are separated by commas, semicolons or
//! tabs.
//!
//! A UTF-8 byte order mark, CR LF and blank lines are accepted.

use std::cell::Cell;
use std::io::{self, BufRead, BufReader, Cursor, Read};
use std::rc::Rc;

use modelmill_boundary::text::csv_name;

use crate::recording::column::SampleField;
use crate::recording::error::RecordingFault;
use crate::recording::formats::{RecordingFormat, RecordingInput, TableInfo};
use crate::recording::intake::{IntakeFlow, SampleIntake};
use crate::recording::notes::RecordingNote;
use crate::recording::tables::{ColumnInfo, likely_time_column};
use crate::recording::{ReadOptions, SignalRecording};

/// Longest header line in bytes; a file with a longer one is not a recording.
const LONGEST_HEADER: u64 = 1 << 20;
/// Most bytes of a record in memory; a record has several lines if a field is quoted.
const LONGEST_RECORD: usize = 64 << 20;

/// CSV text, the format of all files without another signature.
pub(crate) struct CsvFormat;

impl RecordingFormat for CsvFormat {
    fn extensions(&self) -> &'static [&'static str] {
        &["csv", "tsv"]
    }

    fn is_table(&self) -> bool {
        false
    }

    // Every file is accepted, because this format is the last one in the list.
    fn has_signature(&self, _first: &[u8]) -> bool {
        true
    }

    fn read(
        &self,
        input: RecordingInput<'_>,
        file: &str,
        options: &ReadOptions,
    ) -> Result<SignalRecording, RecordingFault> {
        read(input.stream(), file, options)
    }

    fn names(&self, input: RecordingInput<'_>) -> Result<Vec<String>, RecordingFault> {
        let (mut reader, _, header_line) = open(input.stream(), Rc::default())?;
        names(&mut reader, header_line)
    }

    fn tables(&self, input: RecordingInput<'_>) -> Result<Vec<TableInfo>, RecordingFault> {
        let mut stream = input.stream();
        // The complete text is read to count its samples.
        let (mut reader, _, header_line) = open(&mut stream, Rc::default())?;
        let names = names(&mut reader, header_line)?;
        let time = likely_time_column(&names).and_then(|time| names.iter().position(|name| name == time));
        let mut record = csv::ByteRecord::new();
        let (mut samples, mut span) = (0, None);
        // The first sample decides whether a column has text.
        let mut kinds = vec!["number"; names.len()];
        while reader.read_byte_record(&mut record).map_err(unreadable)? {
            samples += 1;
            for (kind, field) in kinds.iter_mut().zip(&record) {
                if samples == 1 && parse(field) == SampleField::Text {
                    *kind = "text";
                }
            }
            // The last time that is a number ends the range.
            if let Some(SampleField::Number(t)) = time.and_then(|place| record.get(place)).map(parse) {
                span = Some((span.map_or(t, |(first, _)| first), t));
            }
        }
        let info = |(name, kind): (String, &str)| ColumnInfo {
            name,
            kind: kind.to_owned(),
        };
        Ok(vec![TableInfo {
            name: String::new(),
            kind: String::new(),
            columns: names.into_iter().zip(kinds).map(info).collect(),
            samples,
            time: span,
            remark: None,
        }])
    }
}

/// Reads the columns that are needed.
fn read(stream: impl Read, file: &str, options: &ReadOptions) -> Result<SignalRecording, RecordingFault> {
    // Bytes since the last record, which limits the memory of a quoted field.
    let since = Rc::new(Cell::new(0));
    let (mut reader, separator, header_line) = open(stream, since.clone())?;
    let theirs = names(&mut reader, header_line)?;
    let mut intake = SampleIntake::new(theirs, options)?;
    // Another separator than a comma is reported.
    if separator != b',' {
        let name = if separator == b';' { "semicolons" } else { "tabs" };
        intake.note(RecordingNote::info(format!(
            "The columns of {file} are separated by {name}."
        )));
    }
    // Records are parsed into fields, and only needed ones into numbers.
    let mut record = csv::ByteRecord::new();
    let mut sample = Vec::new();
    while reader.read_byte_record(&mut record).map_err(unreadable)? {
        since.set(0);
        // The reader is behind the end of the line here. At its start, blank lines would not be skipped yet.
        let line = reader.position().line() - 1;
        if let Some(line) = open_quote_line(&record, line, &intake) {
            return Err(RecordingFault::OpenQuote { line });
        }
        // All lines must have as many fields as the header.
        if record.len() != intake.width() {
            return Err(RecordingFault::RaggedLine {
                line,
                have: record.len(),
                expected: intake.width(),
            });
        }
        sample.clear();
        sample.extend(record.iter().enumerate().map(|(place, text)| {
            if intake.is_place_needed(place) {
                parse(text)
            } else {
                SampleField::Number(0.0)
            }
        }));
        // At most 60 characters of a field are quoted in messages.
        let text = |place: usize| {
            let bytes = record.get(place).unwrap_or_default().trim_ascii();
            String::from_utf8_lossy(bytes).chars().take(60).collect()
        };
        if intake.take_sample(line, &sample, &text)? == IntakeFlow::Stop {
            break;
        }
    }
    intake.finish(file)
}

/// Opens a stream: returns a reader before the header, the separator, and the line of the header. `since` counts the
/// bytes that are read.
fn open(stream: impl Read, since: Rc<Cell<usize>>) -> Result<(csv::Reader<impl Read>, u8, u64), RecordingFault> {
    // The header is read first, because it decides the separator.
    let mut stream = BufReader::with_capacity(1 << 16, stream);
    let (header, first_lines) = read_header(&mut stream)?;
    let separator = find_separator(&header)?;
    // Blank lines before the header count as lines.
    let blank = first_lines.len() - first_lines.trim_ascii_start().len();
    let header_line = 1 + newlines(&first_lines[..blank]);
    // The bytes of the header are read again by the CSV reader.
    let lines_of_text = LineFeedReader::new(Cursor::new(first_lines).chain(stream), since);
    let reader = csv::ReaderBuilder::new()
        .delimiter(separator)
        .flexible(true)
        .trim(csv::Trim::Headers)
        .from_reader(lines_of_text);
    Ok((reader, separator, header_line))
}

/// Names of the columns from the header at `line`.
fn names(reader: &mut csv::Reader<impl Read>, line: u64) -> Result<Vec<String>, RecordingFault> {
    let header = reader.headers().map_err(unreadable)?;
    // A name with a line end means that a quote was not closed.
    if header.iter().any(|name| name.contains('\n')) {
        return Err(RecordingFault::OpenQuote { line });
    }
    let names = header.iter().map(|name| csv_name(name).to_owned());
    Ok(names.collect())
}

/// The line in which a quote opens a field that continues in later lines and contains samples: it extends to the end
/// of the text, or other fields are missing. `None` for a harmless remark of several lines. `last` is the line that
/// ends the record.
fn open_quote_line(record: &csv::ByteRecord, last: u64, intake: &SampleIntake<'_>) -> Option<u64> {
    // Lines behind the first field with a line end belong to the record as well.
    let first = record.iter().position(|field| field.contains(&b'\n'))?;
    let below: u64 = record.iter().skip(first).map(newlines).sum();
    // A quote that is open to the end of the text contains the end of the last line, too.
    let is_open = record.iter().next_back().is_some_and(|field| field.ends_with(b"\n"));
    // A remark in a column that is not needed is harmless.
    let harms = is_open || record.len() != intake.width() || intake.is_place_needed(first);
    harms.then(|| last + u64::from(is_open) - below)
}

/// Number of line feeds.
fn newlines(bytes: &[u8]) -> u64 {
    bytes.split(|byte| *byte == b'\n').count() as u64 - 1
}

/// Parses a field; an empty one counts as not finite.
fn parse(bytes: &[u8]) -> SampleField {
    let bytes = bytes.trim_ascii();
    if bytes.is_empty() {
        return SampleField::NotFinite;
    }
    match std::str::from_utf8(bytes)
        .ok()
        .and_then(|text| text.parse::<f64>().ok())
    {
        Some(number) => SampleField::finite(number),
        None => SampleField::Text,
    }
}

/// The same text with LF at the end of every line, including the last one. The CSV reader counts a line at its LF
/// only.
struct LineFeedReader<R> {
    /// The original stream.
    inner: R,
    /// The last byte that was passed on.
    last: u8,
    /// Whether the stream has ended.
    ended: bool,
    /// Bytes since the last complete record.
    since: Rc<Cell<usize>>,
}

impl<R: Read> LineFeedReader<R> {
    /// Wraps a stream; `since` is set to zero by the user after each record.
    fn new(inner: R, since: Rc<Cell<usize>>) -> Self {
        Self {
            since,
            inner,
            last: b'\n',
            ended: false,
        }
    }
}

impl<R: Read> Read for LineFeedReader<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if buffer.is_empty() || self.ended {
            return Ok(0);
        }
        // A buffer of CR only would have no bytes left, so reading is repeated.
        loop {
            let have = self.inner.read(buffer)?;
            self.since.set(self.since.get() + have);
            // An open quote would otherwise read the rest of the file into memory.
            if self.since.get() > LONGEST_RECORD {
                return Err(io::Error::other(
                    "a line, or a text from one quote to the next, takes more than 64 MB",
                ));
            }
            // At the end, a missing line feed is added once.
            if have == 0 {
                self.ended = true;
                if self.last == b'\n' {
                    return Ok(0);
                }
                buffer[0] = b'\n';
                return Ok(1);
            }
            // Remove the carriage returns in place.
            let mut kept = 0;
            for i in 0..have {
                if buffer[i] != b'\r' {
                    buffer[kept] = buffer[i];
                    kept += 1;
                }
            }
            // Returning zero would mean the end of the text.
            if kept > 0 {
                self.last = buffer[kept - 1];
                return Ok(kept);
            }
        }
    }
}

/// The header as text without byte order mark, and the bytes from the start of the stream to its end.
fn read_header(stream: &mut impl BufRead) -> Result<(String, Vec<u8>), RecordingFault> {
    let mut bytes = Vec::new();
    let unreadable = |error: io::Error| RecordingFault::Unreadable {
        reason: error.to_string(),
    };
    // Blank lines before the header are kept, so that lines count as in the file.
    let mut limited = stream.take(LONGEST_HEADER);
    while bytes.trim_ascii().is_empty() {
        if limited.read_until(b'\n', &mut bytes).map_err(unreadable)? == 0 {
            return Err(RecordingFault::Empty);
        }
    }
    // Recognise other formats and encodings by their bytes.
    let looks_like = match bytes.as_slice() {
        [b'P', b'A', b'R', b'1', ..] => Some("a Parquet file"),
        [0xFF, 0xFE, ..] | [0xFE, 0xFF, ..] => Some("UTF-16 text"),
        [b'P', b'K', 3, 4, ..] => Some("a spreadsheet or ZIP archive"),
        [b'M', b'A', b'T', b'L', b'A', b'B', ..] => Some("a MATLAB file"),
        _ if bytes.contains(&0) => Some("binary data"),
        line if line.trim_ascii().contains(&b'\r') => Some("text with lone carriage returns as line ends"),
        _ if bytes.len() as u64 == LONGEST_HEADER => Some("a file whose first line is longer than 1 MB"),
        _ => None,
    };
    if let Some(looks_like) = looks_like {
        return Err(RecordingFault::NotCsv { looks_like });
    }
    // Remove the byte order mark.
    let text = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(&bytes).to_vec();
    let Ok(header) = std::str::from_utf8(&text) else {
        return Err(RecordingFault::NotCsv {
            looks_like: "text in another encoding than UTF-8",
        });
    };
    let header = header.trim().to_owned();
    if header.is_empty() {
        return Err(RecordingFault::Empty);
    }
    Ok((header, text))
}

/// The separator of a header line; fails when it is not clear, or when the line consists of numbers.
fn find_separator(header: &str) -> Result<u8, RecordingFault> {
    // Separators between quotes do not count, unless a quote is not closed.
    let parts: Vec<&str> = header.split('"').collect();
    let step = if parts.len().is_multiple_of(2) { 1 } else { 2 };
    // The separators that occur outside of quotes.
    let present: Vec<u8> = [b',', b';', b'\t']
        .into_iter()
        .filter(|s| {
            let mut outside = parts.iter().step_by(step);
            outside.any(|part| part.as_bytes().contains(s))
        })
        .collect();
    let is_number = |text: &str| text.trim().trim_matches('"').parse::<f64>().is_ok();
    // Exactly one kind of separator must occur.
    match present.as_slice() {
        [separator] => {
            let mut fields = header.split(char::from(*separator));
            if fields.all(is_number) {
                Err(RecordingFault::NoHeader)
            } else {
                Ok(*separator)
            }
        }
        [] if is_number(header) => Err(RecordingFault::NoHeader),
        // A single column is unusual, but its name is clear.
        [] if !header.contains([' ', '|', ':']) => Ok(b','),
        _ => Err(RecordingFault::UnclearSeparator {
            header: header.chars().take(80).collect(),
        }),
    }
}

/// The fault of text that cannot be read.
fn unreadable(error: csv::Error) -> RecordingFault {
    match error.into_kind() {
        csv::ErrorKind::Io(error) => RecordingFault::Unreadable {
            reason: error.to_string(),
        },
        csv::ErrorKind::Utf8 { .. } => RecordingFault::NotCsv {
            looks_like: "text in another encoding than UTF-8",
        },
        other => RecordingFault::Unreadable {
            reason: format!("{other:?}"),
        },
    }
}
