//! Recordings as CSV text: one header line, one line per sample, separated by commas, semicolons or tabs.
//!
//! A UTF-8 byte order mark and CR LF are fine, and so are blank lines.

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

/// The longest header line that is looked at; beyond it the file is no recording.
const LONGEST_HEADER: u64 = 1 << 20;
/// The most bytes of a line, or of lines that a quote makes one, that are kept in memory.
const LONGEST_RECORD: usize = 64 << 20;

/// CSV text, which everything is that no other format knows as its own.
pub(crate) struct CsvFormat;

impl RecordingFormat for CsvFormat {
    fn extensions(&self) -> &'static [&'static str] {
        &["csv", "tsv"]
    }

    fn is_table(&self) -> bool {
        false
    }

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
        let (mut reader, _, header_line) = open(&mut stream, Rc::default())?;
        let names = names(&mut reader, header_line)?;
        let time =
            likely_time_column(&names).and_then(|time| names.iter().position(|name| name == time));
        let mut record = csv::ByteRecord::new();
        let (mut samples, mut span) = (0, None);
        let mut kinds = vec!["number"; names.len()];
        while reader.read_byte_record(&mut record).map_err(unreadable)? {
            samples += 1;
            for (kind, field) in kinds.iter_mut().zip(&record) {
                if samples == 1 && parse(field) == SampleField::Text {
                    *kind = "text";
                }
            }
            if let Some(SampleField::Number(t)) =
                time.and_then(|place| record.get(place)).map(parse)
            {
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

fn read(
    stream: impl Read,
    file: &str,
    options: &ReadOptions,
) -> Result<SignalRecording, RecordingFault> {
    let since = Rc::new(Cell::new(0));
    let (mut reader, separator, header_line) = open(stream, since.clone())?;
    let theirs = names(&mut reader, header_line)?;
    let mut intake = SampleIntake::new(theirs, options)?;
    if separator != b',' {
        let name = if separator == b';' {
            "semicolons"
        } else {
            "tabs"
        };
        intake.note(RecordingNote::info(format!(
            "The columns of {file} are separated by {name}."
        )));
    }
    let mut record = csv::ByteRecord::new();
    let mut sample = Vec::new();
    while reader.read_byte_record(&mut record).map_err(unreadable)? {
        since.set(0);
        // The reader stands behind the line's end here; where it began, blank lines are not
        // passed over yet.
        let line = reader.position().line() - 1;
        if let Some(line) = open_quote_line(&record, line, &intake) {
            return Err(RecordingFault::OpenQuote { line });
        }
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

/// A reader that stands before the header, what separates the columns, and the line of the header;
/// `since` counts the bytes that are read.
fn open(
    stream: impl Read,
    since: Rc<Cell<usize>>,
) -> Result<(csv::Reader<impl Read>, u8, u64), RecordingFault> {
    let mut stream = BufReader::with_capacity(1 << 16, stream);
    let (header, first_lines) = read_header(&mut stream)?;
    let separator = find_separator(&header)?;
    let blank = first_lines.len() - first_lines.trim_ascii_start().len();
    let header_line = 1 + newlines(&first_lines[..blank]);
    let lines_of_text = LineFeedReader::new(Cursor::new(first_lines).chain(stream), since);
    let reader = csv::ReaderBuilder::new()
        .delimiter(separator)
        .flexible(true)
        .trim(csv::Trim::Headers)
        .from_reader(lines_of_text);
    Ok((reader, separator, header_line))
}

fn names(reader: &mut csv::Reader<impl Read>, line: u64) -> Result<Vec<String>, RecordingFault> {
    let header = reader.headers().map_err(unreadable)?;
    if header.iter().any(|name| name.contains('\n')) {
        return Err(RecordingFault::OpenQuote { line });
    }
    let names = header.iter().map(|name| csv_name(name).to_owned());
    Ok(names.collect())
}

/// The line in which a quote opens a field that goes on in the next line and takes in samples: to the end of the text,
/// or so that fields are missing or no numbers. A remark of two lines is none. `last` is the line that ends the record.
fn open_quote_line(record: &csv::ByteRecord, last: u64, intake: &SampleIntake<'_>) -> Option<u64> {
    let first = record.iter().position(|field| field.contains(&b'\n'))?;
    let below: u64 = record.iter().skip(first).map(newlines).sum();
    // A quote that is open to the end of the text has taken in the last line's end too.
    let is_open = record
        .iter()
        .next_back()
        .is_some_and(|field| field.ends_with(b"\n"));
    let harms = is_open || record.len() != intake.width() || intake.is_place_needed(first);
    harms.then(|| last + u64::from(is_open) - below)
}

fn newlines(bytes: &[u8]) -> u64 {
    bytes.split(|byte| *byte == b'\n').count() as u64 - 1
}

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

/// The same text with LF at the end of every line, the last one included, so that the lines of
/// records can be told: the CSV reader counts a line only when it meets its LF.
struct LineFeedReader<R> {
    inner: R,
    last: u8,
    ended: bool,
    /// Bytes since a record was complete.
    since: Rc<Cell<usize>>,
}

impl<R: Read> LineFeedReader<R> {
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
        loop {
            let have = self.inner.read(buffer)?;
            self.since.set(self.since.get() + have);
            if self.since.get() > LONGEST_RECORD {
                return Err(io::Error::other(
                    "a line, or a text from one quote to the next, takes more than 64 MB",
                ));
            }
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
fn read_header(stream: &mut impl BufRead) -> Result<(String, Vec<u8>), RecordingFault> {
    let mut bytes = Vec::new();
    let unreadable = |error: io::Error| RecordingFault::Unreadable {
        reason: error.to_string(),
    };
    // Blank lines on top stay in the text, so that the lines are counted as in the file.
    let mut limited = stream.take(LONGEST_HEADER);
    while bytes.trim_ascii().is_empty() {
        if limited.read_until(b'\n', &mut bytes).map_err(unreadable)? == 0 {
            return Err(RecordingFault::Empty);
        }
    }
    let looks_like = match bytes.as_slice() {
        [b'P', b'A', b'R', b'1', ..] => Some("a Parquet file"),
        [0xFF, 0xFE, ..] | [0xFE, 0xFF, ..] => Some("UTF-16 text"),
        [b'P', b'K', 3, 4, ..] => Some("a spreadsheet or ZIP archive"),
        [b'M', b'A', b'T', b'L', b'A', b'B', ..] => Some("a MATLAB file"),
        _ if bytes.contains(&0) => Some("binary data"),
        line if line.trim_ascii().contains(&b'\r') => {
            Some("text with lone carriage returns as line ends")
        }
        _ if bytes.len() as u64 == LONGEST_HEADER => {
            Some("a file whose first line is longer than 1 MB")
        }
        _ => None,
    };
    if let Some(looks_like) = looks_like {
        return Err(RecordingFault::NotCsv { looks_like });
    }
    let text = bytes
        .strip_prefix(b"\xEF\xBB\xBF")
        .unwrap_or(&bytes)
        .to_vec();
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

fn find_separator(header: &str) -> Result<u8, RecordingFault> {
    // What stands between quotes separates nothing, unless one is left open.
    let parts: Vec<&str> = header.split('"').collect();
    let step = if parts.len().is_multiple_of(2) { 1 } else { 2 };
    let present: Vec<u8> = [b',', b';', b'\t']
        .into_iter()
        .filter(|s| {
            let mut outside = parts.iter().step_by(step);
            outside.any(|part| part.as_bytes().contains(s))
        })
        .collect();
    let is_number = |text: &str| text.trim().trim_matches('"').parse::<f64>().is_ok();
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
        // A single column is hardly a recording, but it is clear what it says.
        [] if !header.contains([' ', '|', ':']) => Ok(b','),
        _ => Err(RecordingFault::UnclearSeparator {
            header: header.chars().take(80).collect(),
        }),
    }
}

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
