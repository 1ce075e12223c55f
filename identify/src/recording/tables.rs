//! The contents of a file before it is used: tables or topics, with their columns.

use crate::recording::SignalRecording;

/// A table of a file, or a topic of a log.
#[derive(Debug, Clone, PartialEq)]
pub struct TableInfo {
    /// Its name; empty if the file is a single table.
    pub name: String,
    /// Type of its messages; empty for a table.
    pub kind: String,
    /// Its columns, all with the same number of samples; none if the table cannot be read.
    pub columns: Vec<ColumnInfo>,
    /// Number of samples or messages.
    pub samples: usize,
    /// Time of the first and the last sample, s, if a column or the messages have it.
    pub time: Option<(f64, f64)>,
    /// A remark, such as why it cannot be read, or which time is used.
    pub remark: Option<String>,
}

/// A column of a table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ColumnInfo {
    /// Its name, as mappings use it.
    pub name: String,
    /// Type of its values as in the file, such as `float64`.
    pub kind: String,
}

impl TableInfo {
    /// Mean number of samples per second; `None` without a time, or with one sample only.
    pub fn rate(&self) -> Option<f64> {
        let (start, end) = self.time?;
        let rate = (self.samples.saturating_sub(1)) as f64 / (end - start);
        (rate.is_finite() && rate > 0.0).then_some(rate)
    }
}

/// Usual names of the time, in lower case, the most likely first.
const TIME_NAMES: [&str; 8] = ["t", "time", "t_s", "time_s", "timestamp", "stamp", "seconds", "sec"];

/// Units of time in names, with their factors to s.
const TIME_UNITS: [(&str, f64); 6] = [
    ("s", 1.0),
    ("sec", 1.0),
    ("ms", 1e-3),
    ("us", 1e-6),
    ("ns", 1e-9),
    ("min", 60.0),
];

/// The column that is most likely the time, by its name behind the last point, and the factor of its unit to s.
pub(crate) fn likely_time_column(names: &[String]) -> Option<(&String, f64)> {
    let is_called = |name: &String, time: &str| {
        let (bare, factor) = split_time_unit(name);
        let last = bare.rsplit('.').next().unwrap_or(bare);
        last.eq_ignore_ascii_case(time).then_some(factor)
    };
    TIME_NAMES.iter().find_map(|time| {
        names
            .iter()
            .find_map(|name| is_called(name, time).map(|factor| (name, factor)))
    })
}

/// A name without a unit of time in brackets, and the factor of the unit.
fn split_time_unit(name: &str) -> (&str, f64) {
    let inner = name
        .strip_suffix([']', ')'])
        .and_then(|name| name.rsplit_once(['[', '(']));
    let unit = inner.and_then(|(bare, unit)| {
        let found = TIME_UNITS.iter().find(|(known, _)| *known == unit.trim());
        found.map(|(_, factor)| (bare.trim_end(), *factor))
    });
    unit.unwrap_or((name, 1.0))
}

/// First and last time of a table, s; `read` reads the recording of a single column.
pub(crate) fn find_time_range(
    names: &[String],
    read: impl FnOnce(&str) -> Option<SignalRecording>,
) -> Option<(f64, f64)> {
    let (name, factor) = likely_time_column(names)?;
    let recording = read(name)?;
    let time = recording.column(name).ok()?;
    Some((factor * time.first()?, factor * time.last()?))
}
