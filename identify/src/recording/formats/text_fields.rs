//! Fields of text files: numbers with a decimal point or comma, and time stamps.
//!
//! One file has one decimal sign. A field with the other one counts as text, so that a thousands separator never
//! changes a number silently.

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
    /// For each column: its first time stamp, ns, if its first field is one.
    zeros: Vec<ColumnContents>,
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
            zeros: vec![ColumnContents::Unknown; columns],
        }
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
        if let Some(number) = self.parse_number(text) {
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

    /// Parses a number with the decimal sign of the file; the first one with a sign decides it.
    fn parse_number(&mut self, text: &str) -> Option<f64> {
        let (number, sign) = number_of(text)?;
        match (self.sign, sign) {
            (Some(known), Some(sign)) if known != sign => return None,
            (None, Some(_)) => self.sign = sign,
            _ => {}
        }
        Some(number)
    }
}

/// A number and its decimal sign, if it has one.
fn number_of(text: &str) -> Option<(f64, Option<DecimalSign>)> {
    if let Ok(number) = text.parse::<f64>() {
        return Some((number, text.contains('.').then_some(DecimalSign::Point)));
    }
    // Two signs are a thousands separator and a decimal sign, or a date. A comma at an end separates fields.
    let (before, after) = text.split_once(',')?;
    let is_within = before.ends_with(|c: char| c.is_ascii_digit()) && after.starts_with(|c: char| c.is_ascii_digit());
    if !is_within || after.contains(',') || text.contains('.') {
        return None;
    }
    let number = text.replace(',', ".").parse::<f64>().ok()?;
    Some((number, Some(DecimalSign::Comma)))
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
