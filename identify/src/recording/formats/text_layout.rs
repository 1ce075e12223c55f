//! The layout of a text file: its first lines go in; its separator, the names of its columns and the line of its first
//! sample come out.
//!
//! Comment lines begin with `#` or `%`. A header may be missing, or be the last comment before the samples. A row of
//! units below the header is joined to the names: `q1` above `deg` becomes `q1 [deg]`.

use std::io::{BufRead, Read};

use modelmill_boundary::text::csv_name;

use crate::recording::error::RecordingFault;
use crate::recording::formats::text_fields::{is_number_text, is_sample_text};

/// Most bytes up to the first sample; a file with more is not a recording.
const LONGEST_HEAD: u64 = 1 << 20;
/// Most columns of a text file. Names and messages take some hundred bytes for each, while a column of a hostile file
/// takes one byte.
const MOST_COLUMNS: usize = 1 << 16;
/// Lines with contents that decide the layout: header, units and a sample.
const DECIDING_LINES: usize = 3;

/// Marks at the start of a comment line.
pub(super) const COMMENT_MARKS: [char; 2] = ['#', '%'];

/// What separates the fields of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum TextSeparator {
    Comma,
    Semicolon,
    Tab,
    /// One or more blanks or tabs; those at the start of a line do not count.
    Blanks,
}

impl TextSeparator {
    /// The byte between fields; blanks are replaced by one tab before a line is parsed.
    pub(super) fn byte(self) -> u8 {
        match self {
            Self::Comma => b',',
            Self::Semicolon => b';',
            Self::Tab | Self::Blanks => b'\t',
        }
    }

    /// Its name in messages.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Comma => "commas",
            Self::Semicolon => "semicolons",
            Self::Tab => "tabs",
            Self::Blanks => "blanks",
        }
    }

    /// The fields of a line that has no quoted line ends.
    fn split(self, line: &str) -> Vec<String> {
        if self == Self::Blanks {
            return split_at_blanks(line);
        }
        // Quotes protect separators in names.
        let mut reader = csv::ReaderBuilder::new()
            .delimiter(self.byte())
            .has_headers(false)
            .flexible(true)
            .trim(csv::Trim::All)
            .from_reader(line.as_bytes());
        let mut record = csv::StringRecord::new();
        match reader.read_record(&mut record) {
            Ok(true) => record.iter().map(str::to_owned).collect(),
            _ => vec![line.to_owned()],
        }
    }
}

/// How the samples of a text file are written.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct TextLayout {
    /// What separates fields.
    pub(super) separator: TextSeparator,
    /// Names of the columns, possibly with units in brackets.
    pub(super) names: Vec<String>,
    /// Whether the file has names; otherwise the columns have numbers.
    pub(super) has_names: bool,
    /// Number of lines before those that may be samples.
    pub(super) lines_before: u64,
}

/// A line of the start of a file.
struct HeadLine {
    /// Its number, from 1.
    number: u64,
    /// Its text, without its end.
    text: String,
}

impl TextLayout {
    /// Reads the first lines of a stream and decides the layout; all bytes that were read come back with it.
    ///
    /// Fails when the bytes are no text in UTF-8, or when there is no clear separator.
    pub(super) fn read(stream: &mut impl BufRead) -> Result<(Self, Vec<u8>), RecordingFault> {
        let TextHead { lines, comment, bytes } = read_head(stream)?;
        let [first, others @ ..] = lines.as_slice() else {
            return Err(match comment {
                Some(_) => RecordingFault::NoSamples,
                None => RecordingFault::Empty,
            });
        };
        let widest = lines.iter().map(|line| count_separators(&line.text)).max();
        if widest.is_some_and(|n| n >= MOST_COLUMNS) {
            return Err(RecordingFault::NotCsv {
                looks_like: "a file with more than 65536 columns",
            });
        }
        let separator = find_separator(first, others)?;
        let fields = separator.split(&first.text);
        // A line end in a name means that a quote was not closed.
        if first.text.matches('"').count() % 2 == 1 && separator != TextSeparator::Blanks {
            return Err(RecordingFault::OpenQuote { line: first.number });
        }
        if fields.iter().all(|field| is_sample_text(field)) && fields.iter().any(|field| is_number_text(field)) {
            let names = comment.and_then(|comment| names_in_comment(&comment, separator, &fields));
            let has_names = names.is_some();
            let numbers = (1..=fields.len()).map(|place| format!("column_{place}")).collect();
            let layout = Self {
                separator,
                names: names.unwrap_or(numbers),
                has_names,
                lines_before: first.number - 1,
            };
            return Ok((layout, bytes));
        }
        let mut names: Vec<String> = fields.iter().map(|name| csv_name(name).to_owned()).collect();
        let mut lines_before = first.number;
        // A row of units can be recognised only if samples follow.
        if let [below, _, ..] = others
            && let Some(units) = units_of_row(&separator.split(&below.text), names.len())
        {
            lines_before = below.number;
            for (name, unit) in names.iter_mut().zip(units) {
                if !unit.is_empty() && !name.is_empty() && !name.ends_with([']', ')']) {
                    *name = format!("{name} [{unit}]");
                }
            }
        }
        let layout = Self {
            separator,
            names,
            has_names: true,
            lines_before,
        };
        Ok((layout, bytes))
    }
}

/// The start of a file.
struct TextHead {
    /// The first lines with contents.
    lines: Vec<HeadLine>,
    /// The last comment before them.
    comment: Option<String>,
    /// All bytes that were read, without byte order mark.
    bytes: Vec<u8>,
}

/// Reads the start of a file.
fn read_head(stream: &mut impl BufRead) -> Result<TextHead, RecordingFault> {
    let (mut lines, mut comment, mut bytes) = (Vec::new(), None, Vec::new());
    let mut limited = stream.take(LONGEST_HEAD);
    let mut number = 0;
    while lines.len() < DECIDING_LINES {
        let start = bytes.len();
        let read = limited.read_until(b'\n', &mut bytes);
        if read.map_err(|error| unreadable(&error))? == 0 {
            break;
        }
        number += 1;
        if number == 1
            && let Some(looks_like) = foreign_format(&bytes)
        {
            return Err(RecordingFault::NotCsv { looks_like });
        }
        let line = bytes[start..].strip_prefix(b"\xEF\xBB\xBF").unwrap_or(&bytes[start..]);
        if line.trim_ascii().is_empty() {
            continue;
        }
        // Later lines may have remarks in any encoding.
        let line = if lines.is_empty() && !line.trim_ascii_start().starts_with(b"#") {
            decode_line(line)?
        } else {
            String::from_utf8_lossy(line).trim_end_matches(['\n', '\r']).to_owned()
        };
        if let Some(says) = line.trim_start().strip_prefix(COMMENT_MARKS) {
            // Comments between the samples are no header.
            if lines.is_empty() {
                comment = Some(says.to_owned());
            }
            continue;
        }
        let is_first = lines.is_empty();
        lines.push(HeadLine { number, text: line });
        // A first line without end is a file of one line, or none of text.
        if is_first && bytes.len() as u64 == LONGEST_HEAD {
            return Err(RecordingFault::NotCsv {
                looks_like: "a file whose first line is longer than 1 MB",
            });
        }
    }
    if bytes.starts_with(b"\xEF\xBB\xBF") {
        bytes.drain(..3);
    }
    Ok(TextHead { lines, comment, bytes })
}

/// A line as text without its end.
fn decode_line(line: &[u8]) -> Result<String, RecordingFault> {
    if line.trim_ascii().contains(&b'\r') {
        return Err(RecordingFault::NotCsv {
            looks_like: "text with lone carriage returns as line ends",
        });
    }
    if line.contains(&0) {
        return Err(RecordingFault::NotCsv {
            looks_like: "binary data",
        });
    }
    let text = std::str::from_utf8(line).map_err(|_| RecordingFault::NotCsv {
        looks_like: "text in another encoding than UTF-8",
    })?;
    // Tabs at the end separate empty fields.
    Ok(text.trim_end_matches(['\n', '\r']).to_owned())
}

/// The format that the first line of other files shows.
fn foreign_format(bytes: &[u8]) -> Option<&'static str> {
    match bytes {
        [b'P', b'A', b'R', b'1', ..] => Some("a Parquet file"),
        [0xFF, 0xFE, ..] | [0xFE, 0xFF, ..] => Some("UTF-16 text"),
        [b'P', b'K', 3, 4, ..] => Some("a spreadsheet or ZIP archive"),
        [b'M', b'A', b'T', b'L', b'A', b'B', ..] => Some("a MATLAB file"),
        _ if bytes.contains(&0) => Some("binary data"),
        _ => None,
    }
}

/// The number of bytes in a line that can separate fields, of the most frequent kind.
fn count_separators(line: &str) -> usize {
    let mut counts = [0; 4];
    for byte in line.bytes() {
        if let Some(k) = b",;\t ".iter().position(|separator| *separator == byte) {
            counts[k] += 1;
        }
    }
    counts.into_iter().max().unwrap_or(0)
}

/// The separator of the lines; fails when it is not clear.
fn find_separator(first: &HeadLine, others: &[HeadLine]) -> Result<TextSeparator, RecordingFault> {
    let header = first.text.trim();
    // Separators between quotes do not count, unless a quote is not closed.
    let parts: Vec<&str> = header.split('"').collect();
    let step = if parts.len().is_multiple_of(2) { 1 } else { 2 };
    let all = [TextSeparator::Comma, TextSeparator::Semicolon, TextSeparator::Tab];
    let present: Vec<TextSeparator> = all
        .into_iter()
        .filter(|one| {
            let mut outside = parts.iter().step_by(step);
            outside.any(|part| part.as_bytes().contains(&one.byte()))
        })
        .collect();
    let last = others.last().unwrap_or(first);
    // All lines have as many fields, and the last one has those of a sample.
    let fits = |separator: TextSeparator| {
        let n = separator.split(&first.text).len();
        let sample = separator.split(&last.text);
        n > 1 && sample.len() == n && sample.iter().all(|field| is_sample_text(field))
    };
    let unclear = || RecordingFault::UnclearSeparator {
        line: first.number,
        header: header.chars().take(80).collect(),
    };
    match present.as_slice() {
        // Decimal commas in columns that blanks separate, as in `0,5  1,25`.
        [TextSeparator::Comma] if is_split_by_blanks_only(header, last) => Ok(TextSeparator::Blanks),
        [separator] => Ok(*separator),
        [] if !header.contains([' ', '|', ':']) => Ok(TextSeparator::Comma),
        // A line that is one sample of one column, such as a time stamp.
        [] if is_sample_text(header) => Ok(TextSeparator::Comma),
        [] if fits(TextSeparator::Blanks) => Ok(TextSeparator::Blanks),
        [] => Err(unclear()),
        several => {
            let fitting: Vec<&TextSeparator> = several.iter().filter(|one| fits(**one)).collect();
            match fitting.as_slice() {
                [one] => Ok(**one),
                // A comma may be the decimal sign where another separator fits as well.
                [TextSeparator::Comma, other] => Ok(**other),
                _ => Err(unclear()),
            }
        }
    }
}

/// Whether commas of a first line of numbers are decimal signs, and blanks separate them.
fn is_split_by_blanks_only(header: &str, last: &HeadLine) -> bool {
    let is_number_list = |text: &str| {
        let fields: Vec<&str> = text.split_ascii_whitespace().collect();
        fields.len() > 1 && fields.iter().all(|field| is_number_text(field))
    };
    is_number_list(header) && is_number_list(&last.text)
}

/// Names from a comment before the samples: one for each field of a sample, at least one of which is no number.
fn names_in_comment(comment: &str, separator: TextSeparator, sample: &[String]) -> Option<Vec<String>> {
    // Some writers separate the names in another way than the samples.
    let candidates = [
        separator,
        TextSeparator::Comma,
        TextSeparator::Semicolon,
        TextSeparator::Blanks,
    ];
    candidates.into_iter().find_map(|separator| {
        let names = separator.split(comment.trim());
        let names: Vec<String> = names.iter().map(|name| csv_name(name).trim().to_owned()).collect();
        let is_header = names.len() == sample.len()
            && names.iter().all(|name| !name.is_empty())
            && !names.iter().all(|name| is_sample_text(name));
        is_header.then_some(names)
    })
}

/// Fields between blanks; a unit in brackets belongs to the name before it.
fn split_at_blanks(line: &str) -> Vec<String> {
    let mut fields: Vec<String> = Vec::new();
    let mut is_open = false;
    for word in line.split_ascii_whitespace() {
        let opens = word.starts_with(['[', '(']) && !fields.is_empty();
        match fields.last_mut() {
            Some(last) if is_open || opens => {
                last.push(' ');
                last.push_str(word);
            }
            _ => fields.push(word.trim_matches('"').to_owned()),
        }
        is_open = (is_open || opens) && !word.ends_with([']', ')']);
    }
    fields
}

/// The units of a row below the header, empty where a column has none; `None` if the row is none of units.
fn units_of_row(fields: &[String], width: usize) -> Option<Vec<String>> {
    if fields.len() != width {
        return None;
    }
    let bare = |field: &String| {
        let text = csv_name(field).trim();
        let inner = text.strip_prefix('[').and_then(|text| text.strip_suffix(']'));
        let inner = inner.or_else(|| text.strip_prefix('(').and_then(|text| text.strip_suffix(')')));
        inner.unwrap_or(text).trim().to_owned()
    };
    let units: Vec<String> = fields.iter().map(bare).collect();
    let is_empty = |unit: &String| unit.is_empty() || unit == "-";
    let are_units = units.iter().all(|unit| is_empty(unit) || is_unit_text(unit));
    let has_unit = units.iter().any(|unit| !is_empty(unit) && is_unit_text(unit));
    let shown = units
        .iter()
        .map(|unit| if is_empty(unit) { String::new() } else { unit.clone() });
    (are_units && has_unit).then(|| shown.collect())
}

/// Units that may stand in a row below the header; products, quotients and powers of them, too.
const UNIT_WORDS: [&str; 63] = [
    "s", "sec", "second", "seconds", "ms", "us", "µs", "μs", "ns", "min", "h", "m", "mm", "cm", "um", "µm", "rad",
    "mrad", "radian", "radians", "deg", "degree", "degrees", "°", "rev", "turn", "N", "kN", "mN", "Nm", "kNm", "mNm",
    "Nmm", "Ncm", "J", "W", "kW", "V", "mV", "A", "mA", "Hz", "kHz", "rpm", "kg", "g", "Pa", "kPa", "MPa", "bar", "K",
    "C", "°C", "%", "1", "count", "counts", "cnt", "inc", "ticks", "tick", "pulse", "bool",
];

/// Whether a text is a unit, such as `rad/s^2` or `N m`.
pub(super) fn is_unit_text(text: &str) -> bool {
    // A plain number is a sample; only as a factor it may be part of a unit.
    if text == "1" || text.parse::<f64>().is_ok() {
        return false;
    }
    let mut words = text
        .split(['/', '*', '·', '.', ' ', '(', ')'])
        .filter(|word| !word.is_empty());
    text.chars().count() <= 16
        && words.all(|word| {
            let base = word.trim_end_matches(['²', '³', '^', '-', '2', '3']);
            UNIT_WORDS.contains(&base) || UNIT_WORDS.contains(&word)
        })
}

/// The fault of a stream that cannot be read.
fn unreadable(error: &std::io::Error) -> RecordingFault {
    RecordingFault::Unreadable {
        reason: error.to_string(),
    }
}
