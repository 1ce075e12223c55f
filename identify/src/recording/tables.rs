//! What a file holds, before anything is made of it: tables, or topics, with their columns.

use crate::recording::SignalRecording;

/// A table of a file, or a topic of a robot's log.
#[derive(Debug, Clone, PartialEq)]
pub struct TableInfo {
    /// Its name; empty where a file is a single table.
    pub name: String,
    /// Type of its messages; empty where there are none.
    pub kind: String,
    /// Its columns, of as many samples each; none where it cannot be read.
    pub columns: Vec<ColumnInfo>,
    /// How many samples, or messages.
    pub samples: usize,
    /// Time of the first and the last sample, s, where a column or the messages tell it.
    pub time: Option<(f64, f64)>,
    /// What should be known of it, such as why it cannot be read, or which time is taken.
    pub remark: Option<String>,
}

/// A column of a table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ColumnInfo {
    /// Its name, as mappings take it.
    pub name: String,
    /// Type of its values, such as `float64`, as the file says it.
    pub kind: String,
}

impl TableInfo {
    /// Samples per second on average; `None` where no time is known or there is one sample only.
    pub fn rate(&self) -> Option<f64> {
        let (start, end) = self.time?;
        let rate = (self.samples.saturating_sub(1)) as f64 / (end - start);
        (rate.is_finite() && rate > 0.0).then_some(rate)
    }
}

/// Names that time usually has, in small letters.
const TIME_NAMES: [&str; 8] = [
    "t",
    "time",
    "t_s",
    "time_s",
    "timestamp",
    "stamp",
    "seconds",
    "sec",
];

/// The column that is likely to be the time.
pub(crate) fn likely_time_column(names: &[String]) -> Option<&String> {
    let is_called = |name: &String, time: &str| {
        let last = name.rsplit('.').next().unwrap_or(name);
        last.eq_ignore_ascii_case(time)
    };
    TIME_NAMES
        .iter()
        .find_map(|time| names.iter().find(|name| is_called(name, time)))
}

/// First and last time of a table that has a column for it; `read` gives the recording of that column.
pub(crate) fn find_time_range(
    names: &[String],
    read: impl FnOnce(&str) -> Option<SignalRecording>,
) -> Option<(f64, f64)> {
    let name = likely_time_column(names)?;
    let recording = read(name)?;
    let time = recording.column(name).ok()?;
    Some((*time.first()?, *time.last()?))
}
