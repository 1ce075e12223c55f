//! Fields of text files: numbers with a decimal point or comma, and time stamps.
//!
//! One file has one decimal sign. A field with the other one counts as text, so that a thousands separator never
//! changes a number silently.
//!
//! A field such as `12,345` may have either meaning. It is read with a decimal comma, and counts as text if no field of
//! the file shows that commas are decimal signs.

use crate::recording::column::SampleField;
use crate::recording::formats::text_time::parse_time_stamp;

/// The decimal sign of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum DecimalSign {
    Point,
    Comma,
}

/// Parses the fields of a file, and remembers what its earlier fields have shown.
pub(super) struct TextFieldParser {
    /// The decimal sign, once a field has one.
    sign: Option<DecimalSign>,
    /// Whether a field that was not needed has a comma that can only be a decimal sign.
    has_clear_comma: bool,
    /// For each column: its first time stamp, ns, if its first field is one.
    zeros: Vec<ColumnContents>,
    /// For each column: number of its fields with a comma of either meaning, until the sign was known.
    unclear: Vec<usize>,
}

/// What the first field of a column has shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ColumnContents {
    /// There was no field yet.
    Unknown,
    /// Numbers.
    Numbers,
    /// Time stamps, counted from this one, ns since 1970.
    Stamps(i64),
}

impl TextFieldParser {
    /// A parser for so many columns.
    pub(super) fn new(columns: usize) -> Self {
        Self {
            sign: None,
            has_clear_comma: false,
            zeros: vec![ColumnContents::Unknown; columns],
            unclear: vec![0; columns],
        }
    }

    /// Looks at a field that is not needed for the meaning of commas.
    pub(super) fn inspect(&mut self, bytes: &[u8]) {
        if self.sign.is_some() || self.has_clear_comma || !bytes.contains(&b',') {
            return;
        }
        let number = std::str::from_utf8(bytes.trim_ascii()).ok().and_then(number_of);
        self.has_clear_comma = matches!(number, Some((_, NumberSign::Clear(DecimalSign::Comma))));
    }

    /// Number of fields of a column whose comma may separate thousands as well, as far as they were parsed.
    pub(super) fn unclear_fields(&self, place: usize) -> usize {
        self.unclear[place]
    }

    /// Whether the fields so far show that commas are decimal signs.
    pub(super) fn has_decimal_commas(&self) -> bool {
        self.sign == Some(DecimalSign::Comma) || (self.sign.is_none() && self.has_clear_comma)
    }

    /// The first time stamp of a column, ns since 1970; `None` for other columns.
    pub(super) fn first_stamp(&self, place: usize) -> Option<i64> {
        match self.zeros.get(place) {
            Some(ColumnContents::Stamps(zero)) => Some(*zero),
            _ => None,
        }
    }

    /// Parses a field of a column; an empty one counts as not finite.
    pub(super) fn parse(&mut self, bytes: &[u8], place: usize) -> SampleField {
        let bytes = bytes.trim_ascii();
        if bytes.is_empty() {
            return SampleField::NotFinite;
        }
        let Ok(text) = std::str::from_utf8(bytes) else {
            return SampleField::Text;
        };
        if let Some(number) = self.parse_number(text, place) {
            // Numbers between time stamps have another meaning.
            if matches!(self.zeros[place], ColumnContents::Stamps(_)) {
                return SampleField::Text;
            }
            self.zeros[place] = ColumnContents::Numbers;
            return SampleField::finite(number);
        }
        let Some(stamp) = parse_time_stamp(text.trim_matches('"')) else {
            return SampleField::Text;
        };
        match self.zeros[place] {
            ColumnContents::Numbers => SampleField::Text,
            ColumnContents::Unknown => {
                self.zeros[place] = ColumnContents::Stamps(stamp);
                SampleField::Number(0.0)
            }
            // Differences in a recording are far below 2^53 ns, so that floats are exact.
            ColumnContents::Stamps(zero) => SampleField::finite(stamp.wrapping_sub(zero) as f64 / 1e9),
        }
    }

    /// Parses a number with the decimal sign of the file; the first one with a clear sign decides it.
    fn parse_number(&mut self, text: &str, place: usize) -> Option<f64> {
        let (number, sign) = number_of(text)?;
        match (self.sign, sign) {
            (Some(known), NumberSign::Clear(sign)) if known != sign => return None,
            (Some(DecimalSign::Point), NumberSign::Unclear) => return None,
            (None, NumberSign::Clear(sign)) => self.sign = Some(sign),
            (None, NumberSign::Unclear) => self.unclear[place] += 1,
            _ => {}
        }
        Some(number)
    }
}

/// The sign in the text of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum NumberSign {
    /// There is none.
    Absent,
    /// It is the decimal sign.
    Clear(DecimalSign),
    /// A comma that may be the decimal sign or separate thousands.
    Unclear,
}

/// A number and its sign; a comma is read as the decimal sign.
fn number_of(text: &str) -> Option<(f64, NumberSign)> {
    if let Ok(number) = text.parse::<f64>() {
        let has_point = text.contains('.');
        let sign = if has_point {
            NumberSign::Clear(DecimalSign::Point)
        } else {
            NumberSign::Absent
        };
        return Some((number, sign));
    }
    // Two signs are a thousands separator and a decimal sign, or a date. A comma at an end separates fields.
    let (before, after) = text.split_once(',')?;
    let is_within = before.ends_with(|c: char| c.is_ascii_digit()) && after.starts_with(|c: char| c.is_ascii_digit());
    if !is_within || after.contains(',') || text.contains('.') {
        return None;
    }
    let number = text.replace(',', ".").parse::<f64>().ok()?;
    // Thousands have one to three digits before the comma, of which the first is not 0, and three behind it.
    let leading = before.trim_start_matches(['+', '-']);
    let is_unclear = leading.len() <= 3
        && !leading.starts_with('0')
        && after.len() == 3
        && after.bytes().all(|byte| byte.is_ascii_digit());
    let sign = if is_unclear {
        NumberSign::Unclear
    } else {
        NumberSign::Clear(DecimalSign::Comma)
    };
    Some((number, sign))
}

/// Whether a field is a number, with either decimal sign.
pub(super) fn is_number_text(text: &str) -> bool {
    number_of(text.trim().trim_matches('"')).is_some() || is_time_text(text)
}

/// Whether a field may stand in a sample: a number, a time stamp, or nothing.
pub(super) fn is_sample_text(text: &str) -> bool {
    text.trim().is_empty() || is_number_text(text)
}

/// Whether a field is a time stamp.
fn is_time_text(text: &str) -> bool {
    parse_time_stamp(text.trim().trim_matches('"')).is_some()
}
