//! One column of a recording: its numbers, and what is wrong with the fields that are none.

use crate::recording::error::RecordingFault;
use crate::words::nearest_name;

/// No quantity that is measured in SI units comes near this, and squares of smaller numbers do not overflow.
pub(crate) const LARGEST: f64 = 1e100;

/// One field of a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum SampleField {
    Number(f64),
    NotFinite,
    Text,
}

impl SampleField {
    /// A number, unless it is none that can be computed with.
    pub(crate) fn finite(value: f64) -> Self {
        if value.abs() <= LARGEST {
            Self::Number(value)
        } else {
            Self::NotFinite
        }
    }
}

/// The numbers of a column, NaN where there are none, and what is wrong with it.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct SignalColumn {
    pub(crate) values: Vec<f64>,
    pub(crate) text: Option<ColumnDefect>,
    pub(crate) not_finite: Option<ColumnDefect>,
    /// Samples where the value joins its neighbours because none was measured or a sensor failed; empty if there are none.
    pub(crate) interpolated: Vec<bool>,
    /// Values and lost samples before faults of the sensor were taken out, where there were any.
    pub(crate) as_recorded: Option<(Vec<f64>, Vec<bool>)>,
}

/// Fields of a column that cannot be used: the first of them and how many there are.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ColumnDefect {
    pub(crate) line: u64,
    pub(crate) text: String,
    pub(crate) count: usize,
}

impl SignalColumn {
    /// Takes the next field; `text` gives it as it stands in the file.
    pub(crate) fn push(&mut self, field: SampleField, line: u64, text: &dyn Fn() -> String) {
        let defect = match field {
            SampleField::Number(number) => {
                self.values.push(number);
                return;
            }
            SampleField::NotFinite => &mut self.not_finite,
            SampleField::Text => &mut self.text,
        };
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

/// The fault of a column that is not there.
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
