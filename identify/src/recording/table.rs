//! Columns of numbers in memory, such as those of a data frame, read like those of a file.

use crate::recording::column::SampleField;
use crate::recording::error::RecordingFault;
use crate::recording::intake::{IntakeFlow, SampleIntake};
use crate::recording::tables::{ColumnInfo, TableInfo, find_time_range};
use crate::recording::{ReadOptions, SignalRecording};

/// Suffix of the name of a table in messages; it also makes its samples rows.
pub(crate) const SUFFIX: &str = " (table)";

/// Columns of equal length with their names. NaN stands for a missing value.
pub(crate) struct MemoryTable(Vec<(String, Vec<f64>)>);

impl MemoryTable {
    /// Makes a table. Fails when columns differ in length.
    pub(crate) fn new(columns: Vec<(String, Vec<f64>)>) -> Result<Self, RecordingFault> {
        if let [(first, values), others @ ..] = columns.as_slice()
            && let Some((name, other)) = others.iter().find(|(_, v)| v.len() != values.len())
        {
            return Err(RecordingFault::Unreadable {
                reason: format!(
                    "column `{first}` has {} numbers and column `{name}` has {}; all columns need one for each sample",
                    values.len(),
                    other.len()
                ),
            });
        }
        Ok(Self(columns))
    }

    /// Names of the columns.
    pub(crate) fn names(&self) -> Vec<String> {
        self.0.iter().map(|(name, _)| name.clone()).collect()
    }

    /// Reads it as [`SignalRecording::read`] reads a file, with the same faults.
    pub(crate) fn read(&self, file: &str, options: &ReadOptions) -> Result<SignalRecording, RecordingFault> {
        // Each row becomes a sample; columns that are not needed are skipped by the intake.
        let mut intake = SampleIntake::new(self.names(), options)?;
        let samples = self.0.first().map_or(0, |(_, values)| values.len());
        let mut fields = vec![SampleField::NotFinite; self.0.len()];
        for sample in 0..samples {
            for (field, (_, values)) in fields.iter_mut().zip(&self.0) {
                let value = values[sample];
                *field = if value.is_finite() {
                    SampleField::Number(value)
                } else {
                    SampleField::NotFinite
                };
            }
            let text = |place: usize| self.0[place].1[sample].to_string();
            if intake.take_sample(sample as u64 + 1, &fields, &text)? == IntakeFlow::Stop {
                break;
            }
        }
        intake.finish(file)
    }

    /// Its columns, its number of samples and its time range.
    pub(crate) fn table_info(&self) -> TableInfo {
        let names = self.names();
        TableInfo {
            time: find_time_range(&names, |name| self.read("", &ReadOptions::single_column(name)).ok()),
            columns: names
                .into_iter()
                .map(|name| ColumnInfo {
                    name,
                    kind: "float64".to_owned(),
                })
                .collect(),
            name: String::new(),
            kind: String::new(),
            samples: self.0.first().map_or(0, |(_, values)| values.len()),
            remark: None,
        }
    }
}
