//! Recordings as text: one line per sample, usually below a line of names. Fields are separated by commas, semicolons,
//! tabs or blanks.
//!
//! A UTF-8 byte order mark, CR LF, blank lines and comment lines are accepted. The layout is decided by the first lines
//! (`text_layout`), numbers and time stamps are parsed by `text_fields`.

use std::cell::Cell;
use std::io::{self, BufReader, Cursor, Read};
use std::rc::Rc;

use crate::recording::column::{ColumnDefect, SampleField};
use crate::recording::error::RecordingFault;
use crate::recording::formats::text_fields::TextFieldParser;
use crate::recording::formats::text_layout::{COMMENT_MARKS, TextLayout, TextSeparator};
use crate::recording::formats::{RecordingFormat, RecordingInput, TableInfo};
use crate::recording::intake::{IntakeFlow, SampleIntake};
use crate::recording::notes::RecordingNote;
use crate::recording::tables::{ColumnInfo, likely_time_column};
use crate::recording::{ReadOptions, SignalRecording};

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
        let (_, layout) = open(input.stream(), Rc::default())?;
        Ok(layout.names)
    }

    fn tables(&self, input: RecordingInput<'_>) -> Result<Vec<TableInfo>, RecordingFault> {
        let mut stream = input.stream();
        // The complete text is read to count its samples.
        let (mut reader, layout) = open(&mut stream, Rc::default())?;
        let names = layout.names;
        let time = likely_time_column(&names)
            .and_then(|(time, factor)| Some((names.iter().position(|name| name == time)?, factor)));
        let mut record = csv::ByteRecord::new();
        let mut fields = TextFieldParser::new(names.len());
        let (mut samples, mut span) = (0, None);
        // The first sample decides whether a column has text.
        let mut kinds = vec!["number"; names.len()];
        while reader.read_byte_record(&mut record).map_err(unreadable)? {
            samples += 1;
            for (place, (kind, field)) in kinds.iter_mut().zip(&record).enumerate() {
                if samples > 1 {
                    break;
                }
                if fields.parse(field, place) == SampleField::Text {
                    *kind = "text";
                } else if fields.first_stamp(place).is_some() {
                    *kind = "time";
                }
            }
            // The last time that is a number ends the range.
            let now = time.and_then(|(place, _)| Some(fields.parse(record.get(place)?, place)));
            if let (Some(SampleField::Number(t)), Some((_, factor))) = (now, time) {
                let t = factor * t;
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
            remark: (!layout.has_names)
                .then(|| "it has no line of names: columns are called by their numbers".to_owned()),
        }])
    }
}

/// Reads the columns that are needed.
fn read(stream: impl Read, file: &str, options: &ReadOptions) -> Result<SignalRecording, RecordingFault> {
    // Bytes since the last record, which limits the memory of a quoted field.
    let since = Rc::new(Cell::new(0));
    let (mut reader, layout) = open(stream, since.clone())?;
    let names = layout.names.clone();
    let mut fields = TextFieldParser::new(names.len());
    let mut intake = SampleIntake::new(layout.names, options)?;
    // Another separator than a comma is reported.
    if layout.separator != TextSeparator::Comma {
        intake.note(RecordingNote::info(format!(
            "The columns of {file} are separated by {}.",
            layout.separator.name()
        )));
    }
    if !layout.has_names {
        intake.note(RecordingNote::info(format!(
            "{file} has no line of names: its columns are called `column_1` to `column_{}`.",
            names.len()
        )));
    }
    // The first field of each column whose comma may be a decimal sign or separate thousands.
    let mut unclear: Vec<Option<ColumnDefect>> = vec![None; names.len()];
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
                let field = fields.parse(text, place);
                if fields.unclear_fields(place) > 0 && unclear[place].is_none() {
                    let text = quoted_field(text);
                    unclear[place] = Some(ColumnDefect { line, text, count: 0 });
                }
                field
            } else {
                fields.inspect(text);
                SampleField::Number(0.0)
            }
        }));
        let text = |place: usize| quoted_field(record.get(place).unwrap_or_default());
        if intake.take_sample(line, &sample, &text)? == IntakeFlow::Stop {
            break;
        }
    }
    // Without any comma that is clearly decimal, a factor of 1000 would be a guess.
    for (place, first) in unclear.into_iter().enumerate() {
        if let Some(first) = first
            && !fields.has_decimal_commas()
        {
            let count = fields.unclear_fields(place);
            intake.refuse_fields(place, ColumnDefect { count, ..first });
        }
    }
    for (place, name) in names.iter().enumerate() {
        if let Some(zero) = fields.first_stamp(place) {
            intake.note(RecordingNote::info(format!(
                "`{name}` of {file} has time stamps: it is read as seconds since the first one."
            )));
            intake.set_zero(place, zero);
        }
    }
    intake.finish(file)
}

/// A field in messages: at most 60 characters of it.
fn quoted_field(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes.trim_ascii()).chars().take(60).collect()
}

/// Opens a stream: returns a reader of its samples, and the layout. `since` counts the bytes that are read.
fn open(stream: impl Read, since: Rc<Cell<usize>>) -> Result<(csv::Reader<impl Read>, TextLayout), RecordingFault> {
    // The first lines are read first, because they decide the layout.
    let mut stream = BufReader::with_capacity(1 << 16, stream);
    let (layout, first_lines) = TextLayout::read(&mut stream)?;
    // Their bytes are read again by the reader of samples.
    let plain = PlainLineReader::new(Cursor::new(first_lines).chain(stream), since, &layout);
    let reader = csv::ReaderBuilder::new()
        .delimiter(layout.separator.byte())
        .has_headers(false)
        .flexible(true)
        .from_reader(plain);
    Ok((reader, layout))
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

/// The same text with only samples in it: lines before them and comments become blank lines, so that lines count as in
/// the file. Every line ends with LF, including the last one, because the CSV reader counts a line at its LF only.
struct PlainLineReader<R> {
    /// The original stream.
    inner: R,
    /// Bytes as they were read.
    raw: Vec<u8>,
    /// Bytes to pass on, and how many of them were passed on.
    ready: (Vec<u8>, usize),
    /// Whether the stream has ended.
    has_ended: bool,
    /// Bytes since the last complete record.
    since: Rc<Cell<usize>>,
    /// Lines that are still to be left out at the start.
    lines_before: u64,
    /// Whether runs of blanks become one tab.
    joins_blanks: bool,
    /// Whether tabs at the start of a line separate fields.
    keeps_tabs: bool,
    /// The place in the current line.
    place: LinePlace,
}

/// Where a reader is in a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum LinePlace {
    /// Before its first character that is no blank.
    Start,
    /// In a sample.
    Sample,
    /// In a sample, behind blanks that separate fields if another one follows.
    Blanks,
    /// In a comment.
    Comment,
}

impl<R: Read> PlainLineReader<R> {
    /// Wraps a stream; `since` is set to zero by the user after each record.
    fn new(inner: R, since: Rc<Cell<usize>>, layout: &TextLayout) -> Self {
        Self {
            inner,
            raw: vec![0; 1 << 16],
            ready: (Vec::new(), 0),
            has_ended: false,
            since,
            lines_before: layout.lines_before,
            joins_blanks: layout.separator == TextSeparator::Blanks,
            keeps_tabs: layout.separator == TextSeparator::Tab,
            place: LinePlace::Start,
        }
    }

    /// Takes one byte of the text.
    fn push(&mut self, byte: u8) {
        if byte == b'\n' {
            self.lines_before = self.lines_before.saturating_sub(1);
            self.place = LinePlace::Start;
            self.ready.0.push(byte);
            return;
        }
        if byte == b'\r' || self.lines_before > 0 || self.place == LinePlace::Comment {
            return;
        }
        let is_blank = byte == b' ' || byte == b'\t';
        if self.place == LinePlace::Start {
            // Blanks at the start of a line are no field; tabs are, if they separate fields.
            if is_blank && !(byte == b'\t' && self.keeps_tabs) {
                return;
            }
            if COMMENT_MARKS.contains(&char::from(byte)) {
                self.place = LinePlace::Comment;
                return;
            }
            self.place = LinePlace::Sample;
        }
        if self.joins_blanks && is_blank {
            self.place = LinePlace::Blanks;
            return;
        }
        if self.place == LinePlace::Blanks {
            self.ready.0.push(b'\t');
            self.place = LinePlace::Sample;
        }
        self.ready.0.push(byte);
    }
}

impl<R: Read> Read for PlainLineReader<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        // A block of comments would have no bytes left, so reading is repeated.
        while self.ready.1 == self.ready.0.len() && !self.has_ended {
            self.ready = (std::mem::take(&mut self.ready.0), 0);
            self.ready.0.clear();
            let mut raw = std::mem::take(&mut self.raw);
            let read = self.inner.read(&mut raw);
            let have = read.as_ref().map_or(0, |n| *n);
            raw[..have].iter().for_each(|byte| self.push(*byte));
            self.raw = raw;
            read?;
            self.since.set(self.since.get() + self.ready.0.len());
            // An open quote would otherwise read the rest of the file into memory.
            if self.since.get() > LONGEST_RECORD {
                return Err(io::Error::other(
                    "a line, or a text from one quote to the next, takes more than 64 MB",
                ));
            }
            if have == 0 {
                self.has_ended = true;
                // A missing line feed is added once.
                if self.place != LinePlace::Start {
                    self.ready.0.push(b'\n');
                }
            }
        }
        let rest = &self.ready.0[self.ready.1..];
        let n = rest.len().min(buffer.len());
        buffer[..n].copy_from_slice(&rest[..n]);
        self.ready.1 += n;
        Ok(n)
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Reads a text of columns that semicolons separate.
    fn recording(text: &str, wanted: &[&str]) -> SignalRecording {
        let options = ReadOptions {
            wanted: Some(wanted.iter().map(|name| (*name).to_owned()).collect()),
            ..ReadOptions::default()
        };
        read(text.as_bytes(), "run.csv", &options).unwrap()
    }

    #[test]
    fn commas_that_may_separate_thousands_are_no_decimal_signs() {
        for text in [
            // Counts of an encoder, with thousands or a point elsewhere.
            "t;q\n0;12,345\n1;12,346\n2;999\n",
            "t;q\n0;12,345\n0.5;12,346\n",
        ] {
            let fault = recording(text, &["t", "q"]).column("q").unwrap_err();
            assert!(fault.to_string().contains("`12,345`"), "{fault}");
            assert!(fault.to_string().contains("thousands"), "{fault}");
            assert!(recording(text, &["t", "q"]).column("t").is_ok());
        }
        let quoted = "t,q\n0,\"12,345\"\n1,\"-12,346\"\n";
        assert!(recording(quoted, &["t", "q"]).column("q").is_err());
    }

    #[test]
    fn decimal_commas_with_three_digits_are_read_if_any_field_shows_them() {
        for text in [
            "t;q\n0;12,345\n1;12,3\n",
            "t;q\n0,000;12,345\n0,010;12,346\n",
            // A column that is not needed shows it.
            "t;q;tau\n0;12,345;0,5\n1;12,346;0,6\n",
            "t;q\n0;12,345\n1;1234,567\n",
        ] {
            let read = recording(text, &["t", "q"]);
            let first = read.column("q").unwrap()[0];
            assert!((first - 12.345).abs() < 1e-12, "{text}");
        }
    }
}
