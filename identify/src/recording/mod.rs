//! Recordings: a file of any format of the list in `formats` goes in, named columns of numbers come out.
//!
//! A column with anything else than numbers is a fault only for callers that use it. The notes name it, and
//! [`SignalRecording::column`] refuses it with the line of the first bad field. `SignalRecording::states` makes a
//! [`PreparedRun`](crate::PreparedRun) of a recording.

mod column;
mod corrections;
mod error;
mod file;
mod formats;
mod gaps;
#[cfg(any(feature = "hdf5", feature = "parquet"))]
mod half;
mod intake;
mod join;
mod joined_files;
pub(crate) mod notes;
mod options;
mod read;
mod repair;
mod table;
mod tables;
mod thresholds;

use indexmap::IndexMap;

use crate::words::nearest_name;
pub use column::ColumnScaling;
pub use corrections::UnwrappedAngle;
pub use error::{RecordingError, RecordingFault};
pub use file::RecordingFile;
pub use joined_files::RecordingFiles;
pub use notes::{NoteSeverity, RecordingNote};
pub use options::{ComputedColumn, NonFinitePolicy, ReadOptions};
pub use read::{display_name_of_bytes, has_recording_extension, sample_place_word};
pub use tables::{ColumnInfo, TableInfo};

use column::{ColumnDefect, SignalColumn, missing_column_fault};
pub(crate) use thresholds::GAP_LEAST_STEPS;

/// A recording in memory: columns of equal length by name, in the order of the file.
#[derive(Debug, Clone, PartialEq)]
pub struct SignalRecording {
    /// Name of the file in messages.
    pub(crate) file: String,
    /// Columns by their names after renaming; computed ones at the end.
    pub(crate) columns: IndexMap<String, SignalColumn>,
    /// Names of the columns of the file that were not needed.
    pub(crate) others: Vec<String>,
    /// Line or row of each sample in the file, from 1.
    pub(crate) lines: Vec<u64>,
    /// Notes on the file and on what was done with it.
    pub(crate) notes: Vec<RecordingNote>,
    /// The time stamp from which `t` is counted, ns since 1970, if the file has stamps.
    pub(crate) zero_stamp: Option<i64>,
    /// Angles from which jumps by a full turn were removed.
    pub(crate) unwrapped: Vec<UnwrappedAngle>,
    /// Coordinates whose recorded rates lag their positions and were removed, each with the delay, s.
    pub(crate) late_rates: Vec<(String, f64)>,
}

impl SignalRecording {
    /// Name of the recording in messages.
    pub fn file(&self) -> &str {
        &self.file
    }

    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.lines.len()
    }

    /// Names of all columns after renaming; those that were not needed come last.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        let others = self.others.iter().map(String::as_str);
        self.columns.keys().map(String::as_str).chain(others)
    }

    /// Whether there is a column of that name.
    pub fn has_column(&self, name: &str) -> bool {
        self.columns.contains_key(name)
    }

    /// Samples of a column with interpolated values, because none was measured or a sensor failed; `None` if there
    /// are none.
    pub fn lost_samples(&self, name: &str) -> Option<&[bool]> {
        let lost = &self.columns.get(name)?.interpolated;
        lost.contains(&true).then_some(lost.as_slice())
    }

    /// Line of a sample in the file, from 1; for messages.
    pub fn line(&self, sample: usize) -> Option<u64> {
        self.lines.get(sample).copied()
    }

    /// Notes on the file for the user.
    pub fn notes(&self) -> &[RecordingNote] {
        &self.notes
    }

    /// Adds a note on the recording.
    pub fn add_note(&mut self, note: RecordingNote) {
        self.notes.push(note);
    }

    /// The numbers of a column, one per sample. Fails when the column does not exist, or has fields that are not
    /// finite numbers.
    pub fn column(&self, name: &str) -> Result<&[f64], RecordingError> {
        let Some(column) = self.columns.get(name) else {
            return Err(self.fault(missing_column_fault(name, self.names(), false)));
        };
        // Text is reported before missing values, because it is the more serious defect.
        if let Some(ColumnDefect { line, text, count }) = column.text.clone() {
            return Err(self.fault(RecordingFault::NotANumber {
                column: name.to_owned(),
                line,
                text,
                count,
            }));
        }
        if let Some(ColumnDefect { line, text, count }) = column.not_finite.clone() {
            return Err(self.fault(RecordingFault::NotFinite {
                column: name.to_owned(),
                line,
                text,
                count,
            }));
        }
        Ok(&column.values)
    }

    /// The numbers of a column, as [`Self::column`]. Columns named in `wanted` are not suggested for a missing one.
    pub(crate) fn column_without_suggesting(&self, name: &str, wanted: &[String]) -> Result<&[f64], RecordingError> {
        if self.has_column(name) {
            return self.column(name);
        }
        let others = self.names().filter(|name| !wanted.iter().any(|w| w == name));
        let proposed = nearest_name(name, others).map(str::to_owned);
        let mut fault = missing_column_fault(name, self.names(), false);
        if let RecordingFault::MissingColumn { nearest, .. } = &mut fault {
            *nearest = proposed;
        }
        Err(self.fault(fault))
    }

    /// Fails when more than one of the columns `needed` does not exist, and reports all of them at once. Columns
    /// named in `wanted` are not suggested, and no column is suggested twice.
    pub(crate) fn check_columns(&self, needed: &[String], wanted: &[String]) -> Result<(), RecordingError> {
        let missing: Vec<&String> = needed.iter().filter(|name| !self.has_column(name)).collect();
        // A single missing column has its own fault.
        if missing.len() < 2 {
            return Ok(());
        }
        let mut others: Vec<&str> = self.names().filter(|name| !wanted.iter().any(|w| w == name)).collect();
        let missing = missing.into_iter().map(|name| {
            let found = nearest_name(name, others.iter().copied()).map(str::to_owned);
            others.retain(|other| Some(*other) != found.as_deref());
            (name.clone(), found)
        });
        Err(self.fault(RecordingFault::MissingColumns {
            missing: missing.collect(),
            present: self.names().map(str::to_owned).collect(),
        }))
    }

    /// Replaces the numbers of a column, or adds a column.
    ///
    /// Panics unless there is one number for each sample.
    pub fn set_column(&mut self, name: &str, values: Vec<f64>) {
        assert_eq!(values.len(), self.samples(), "one number for each sample");
        let column = self.columns.entry(name.to_owned()).or_default();
        column.values = values;
    }

    /// Removes a column, if there is one of this name.
    pub fn remove_column(&mut self, name: &str) {
        self.columns.shift_remove(name);
    }

    /// The samples from `start` up to, but not including `end` as a recording of its own, without notes.
    pub(crate) fn extract_segment(&self, file: String, start: usize, end: usize) -> Self {
        let columns = self.columns.iter().map(|(name, column)| {
            let column = SignalColumn {
                values: column.values[start..end].to_vec(),
                interpolated: column.interpolated.get(start..end).unwrap_or(&[]).to_vec(),
                text: column.text.clone(),
                not_finite: column.not_finite.clone(),
                as_recorded: None,
                scaling: column.scaling,
            };
            (name.clone(), column)
        });
        Self {
            file,
            columns: columns.collect(),
            others: self.others.clone(),
            lines: self.lines[start..end].to_vec(),
            notes: Vec::new(),
            zero_stamp: self.zero_stamp,
            unwrapped: self.unwrapped.clone(),
            late_rates: self.late_rates.clone(),
        }
    }

    /// A fault of this recording.
    pub(crate) fn fault(&self, fault: RecordingFault) -> RecordingError {
        RecordingError {
            file: self.file.clone(),
            fault,
        }
    }
}
