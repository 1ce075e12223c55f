//! One column of a recording: its numbers, and the defects of fields that are not numbers.
//!
//! Readers of all formats push fields; a column with defects is refused only when it is used.

use crate::recording::error::RecordingFault;
use crate::recording::thresholds::LARGEST_NUMBER;
use crate::words::nearest_name;

/// One field of a sample, whatever the format of the file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum SampleField {
    /// A finite number of at most [`LARGEST_NUMBER`].
    Number(f64),
    /// NaN, infinite, empty or too large.
    NotFinite,
    /// Text that cannot be parsed as a number.
    Text,
}

impl SampleField {
    /// A number, unless it is NaN, infinite or too large.
    pub(crate) fn finite(value: f64) -> Self {
        // The comparison is false for NaN.
        if value.abs() <= LARGEST_NUMBER {
            Self::Number(value)
        } else {
            Self::NotFinite
        }
    }
}

/// How the values of a column follow from one column of the file: `factor * value + offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ColumnScaling {
    /// Factor, in the unit of the model per unit of the file.
    pub factor: f64,
    /// Offset, in the unit of the model.
    pub offset: f64,
}

impl Default for ColumnScaling {
    fn default() -> Self {
        Self {
            factor: 1.0,
            offset: 0.0,
        }
    }
}

impl ColumnScaling {
    /// The scaling that turns values which were read with this scaling into values that are read with `other`.
    pub(crate) fn conversion_to(self, other: Self) -> Self {
        let factor = other.factor / self.factor;
        Self {
            factor,
            offset: other.offset - factor * self.offset,
        }
    }

    /// A value of the file in the unit of the model.
    pub fn scale(self, value: f64) -> f64 {
        self.factor * value + self.offset
    }
}

/// The numbers of a column, NaN where a field has none, and its defects.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SignalColumn {
    /// One value per sample, in the unit of the file.
    pub(crate) values: Vec<f64>,
    /// Fields with text that is not a number.
    pub(crate) text: Option<ColumnDefect>,
    /// Fields that are NaN, infinite or empty.
    pub(crate) not_finite: Option<ColumnDefect>,
    /// Samples with interpolated values, because none was measured or a sensor failed; empty if there are none.
    pub(crate) interpolated: Vec<bool>,
    /// Values and interpolated samples before sensor faults were repaired; `None` if there were none.
    pub(crate) as_recorded: Option<(Vec<f64>, Vec<bool>)>,
    /// How the values follow from the file; `None` if they are no multiple of one column of it.
    pub(crate) scaling: Option<ColumnScaling>,
}

impl Default for SignalColumn {
    fn default() -> Self {
        Self {
            values: Vec::new(),
            text: None,
            not_finite: None,
            interpolated: Vec::new(),
            as_recorded: None,
            scaling: Some(ColumnScaling::default()),
        }
    }
}

/// Fields of a column that cannot be used: the first of them and their number.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ColumnDefect {
    /// Line or row of the first one in the file, from 1.
    pub(crate) line: u64,
    /// The first one as it stands in the file.
    pub(crate) text: String,
    /// Number of such fields.
    pub(crate) count: usize,
}

impl SignalColumn {
    /// Scales all values, together with those before any repair, as if the file had other values.
    pub(crate) fn scale(&mut self, scaling: ColumnScaling) {
        let before_repair = self.as_recorded.iter_mut().flat_map(|(values, _)| values);
        for value in self.values.iter_mut().chain(before_repair) {
            *value = scaling.scale(*value);
        }
    }

    /// Appends a field; `text` returns the field as it stands in the file and is called for the first defect only.
    pub(crate) fn push(&mut self, field: SampleField, line: u64, text: &dyn Fn() -> String) {
        let defect = match field {
            SampleField::Number(number) => {
                self.values.push(number);
                return;
            }
            SampleField::NotFinite => &mut self.not_finite,
            SampleField::Text => &mut self.text,
        };
        // A defect keeps its sample, so that all columns have the same length.
        self.values.push(f64::NAN);
        defect
            .get_or_insert_with(|| ColumnDefect {
                line,
                text: text(),
                count: 0,
            })
            .count += 1;
    }
}

/// The fault of a column that does not exist, with the nearest name that does.
///
/// `by_renaming` is true if the name comes from a renaming of the user.
pub(crate) fn missing_column_fault<'a>(
    name: &str,
    present: impl Iterator<Item = &'a str>,
    by_renaming: bool,
) -> RecordingFault {
    let present: Vec<String> = present.map(str::to_owned).collect();
    RecordingFault::MissingColumn {
        name: name.to_owned(),
        nearest: nearest_name(name, present.iter().map(String::as_str)).map(str::to_owned),
        present,
        by_renaming,
    }
}
