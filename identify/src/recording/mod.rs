//! Recordings: a file of any format of the list in `formats` goes in, named columns of numbers come out.
//!
//! A column that holds something else than numbers harms only those who ask for it: it is named in
//! the notes, and [`Recording::column`] refuses it with the line at fault.
//! [`Recording::states`](crate::recording::Recording::states) makes a [`Run`](crate::Run) of it.

mod column;
mod error;
mod file;
mod formats;
mod gaps;
mod intake;
mod join;
pub(crate) mod notes;
mod options;
mod read;
mod repair;
mod table;
mod tables;
mod together;

use indexmap::IndexMap;

use crate::words::nearest;
pub use error::{Fault, RecordingError};
pub use file::RecordingFile;
pub use notes::{Note, Severity};
pub use options::{Computed, NotFinite, ReadOptions};
pub use read::{has_ending_of_a_recording, name_of_bytes, place_word};
pub use tables::{ColumnInfo, TableInfo};
pub use together::RecordingFiles;

use column::{Column, Defect, missing};
pub(crate) use gaps::GAP;

/// A recording in memory: columns of equal length by name, in the file's order.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    pub(crate) file: String,
    pub(crate) columns: IndexMap<String, Column>,
    /// Names of the columns of the file that were not needed.
    pub(crate) others: Vec<String>,
    pub(crate) lines: Vec<u64>,
    pub(crate) notes: Vec<Note>,
}

impl Recording {
    /// What messages call the recording.
    pub fn file(&self) -> &str {
        &self.file
    }

    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.lines.len()
    }

    /// Names of all columns after renaming, those that were not needed at the end.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        let others = self.others.iter().map(String::as_str);
        self.columns.keys().map(String::as_str).chain(others)
    }

    /// Whether there is a column of that name.
    pub fn has(&self, name: &str) -> bool {
        self.columns.contains_key(name)
    }

    /// Samples whose value of a column joins its neighbours, since none was measured or a sensor failed; `None` if there are none.
    pub(crate) fn lost(&self, name: &str) -> Option<&[bool]> {
        let lost = &self.columns.get(name)?.lost;
        lost.contains(&true).then_some(lost.as_slice())
    }

    /// Line of a sample in the file, from 1; for messages.
    pub fn line(&self, sample: usize) -> Option<u64> {
        self.lines.get(sample).copied()
    }

    /// What the user should know about the file.
    pub fn notes(&self) -> &[Note] {
        &self.notes
    }

    /// The numbers of a column, one per sample.
    /// Fails when it is not there or holds fields that are no finite numbers.
    pub fn column(&self, name: &str) -> Result<&[f64], RecordingError> {
        let Some(column) = self.columns.get(name) else {
            return Err(self.fault(missing(name, self.names(), false)));
        };
        if let Some(Defect { line, text, count }) = column.text.clone() {
            return Err(self.fault(Fault::NotANumber {
                column: name.to_owned(),
                line,
                text,
                count,
            }));
        }
        if let Some(Defect { line, text, count }) = column.not_finite.clone() {
            return Err(self.fault(Fault::NotFinite {
                column: name.to_owned(),
                line,
                text,
                count,
            }));
        }
        Ok(&column.values)
    }

    /// The numbers of a column, as [`Recording::column`]; columns of the names `wanted` are not proposed for it.
    pub(crate) fn column_beside(
        &self,
        name: &str,
        wanted: &[String],
    ) -> Result<&[f64], RecordingError> {
        if self.has(name) {
            return self.column(name);
        }
        let others = self
            .names()
            .filter(|name| !wanted.iter().any(|w| w == name));
        let proposed = nearest(name, others).map(str::to_owned);
        let mut fault = missing(name, self.names(), false);
        if let Fault::MissingColumn { nearest, .. } = &mut fault {
            *nearest = proposed;
        }
        Err(self.fault(fault))
    }

    /// Fails when more than one of the names `needed` is no column, and says all of them at once; columns of the names `wanted`
    /// are not proposed, and none twice.
    pub(crate) fn check_columns(
        &self,
        needed: &[String],
        wanted: &[String],
    ) -> Result<(), RecordingError> {
        let missing: Vec<&String> = needed.iter().filter(|name| !self.has(name)).collect();
        if missing.len() < 2 {
            return Ok(());
        }
        let mut others: Vec<&str> = self
            .names()
            .filter(|name| !wanted.iter().any(|w| w == name))
            .collect();
        let missing = missing.into_iter().map(|name| {
            let found = nearest(name, others.iter().copied()).map(str::to_owned);
            others.retain(|other| Some(*other) != found.as_deref());
            (name.clone(), found)
        });
        Err(self.fault(Fault::MissingColumns {
            missing: missing.collect(),
            present: self.names().map(str::to_owned).collect(),
        }))
    }

    /// Puts numbers in the place of a column, or adds one; one for each sample (asserted).
    pub fn put(&mut self, name: &str, values: Vec<f64>) {
        assert_eq!(values.len(), self.samples(), "one number for each sample");
        let column = self.columns.entry(name.to_owned()).or_default();
        column.values = values;
    }

    /// The samples from `start` to before `end` as a recording of its own, without the notes.
    pub(crate) fn stretch(&self, file: String, start: usize, end: usize) -> Self {
        let columns = self.columns.iter().map(|(name, column)| {
            let column = Column {
                values: column.values[start..end].to_vec(),
                lost: column.lost.get(start..end).unwrap_or(&[]).to_vec(),
                text: column.text.clone(),
                not_finite: column.not_finite.clone(),
                as_recorded: None,
            };
            (name.clone(), column)
        });
        Self {
            file,
            columns: columns.collect(),
            others: self.others.clone(),
            lines: self.lines[start..end].to_vec(),
            notes: Vec::new(),
        }
    }

    pub(crate) fn fault(&self, fault: Fault) -> RecordingError {
        RecordingError {
            file: self.file.clone(),
            fault,
        }
    }
}
