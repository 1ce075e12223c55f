//! Several files of one run: opened together, read one by one, and joined on their times.

use std::path::Path;

use modelmill_boundary::files::FileSource;

use crate::recording::column::SignalColumn;
use crate::recording::error::{RecordingError, RecordingFault};
use crate::recording::join::{JoinPart, join_parts};
use crate::recording::notes::RecordingNote;
use crate::recording::{ReadOptions, RecordingFile, SignalRecording};
use crate::words::backquoted_list;

/// The files of one run, whose columns are joined on time; usually there is one.
pub struct RecordingFiles {
    /// Names of all files, joined by `+`, for messages.
    name: String,
    /// The open files, in the order of the user.
    files: Vec<RecordingFile>,
}

impl RecordingFiles {
    /// Opens files. Fails when one of them cannot be read, or when there is none.
    pub fn open(files: &dyn FileSource, paths: &[&Path]) -> Result<Self, RecordingError> {
        let opened = paths.iter().map(|path| RecordingFile::open(files, path));
        let files = opened.collect::<Result<Vec<_>, _>>()?;
        if files.is_empty() {
            return Err(RecordingError {
                file: "a recording".to_owned(),
                fault: RecordingFault::Unreadable {
                    reason: "no file is given".to_owned(),
                },
            });
        }
        let names: Vec<&str> = files.iter().map(RecordingFile::name).collect();
        Ok(Self {
            name: names.join("+"),
            files,
        })
    }

    /// Makes a recording of columns in memory; `name` is its name in messages. Fails when columns differ in length.
    pub fn from_table(name: &str, columns: Vec<(String, Vec<f64>)>) -> Result<Self, RecordingError> {
        let file = RecordingFile::from_table(name, columns)?;
        Ok(Self {
            name: file.name().to_owned(),
            files: vec![file],
        })
    }

    /// Name of the files in messages.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Names of all columns, those of the first file first; a name in several files occurs once.
    pub fn names(&self) -> Result<Vec<String>, RecordingError> {
        let mut all = Vec::new();
        for file in &self.files {
            let names = file.names()?;
            all.extend(names.into_iter().filter(|name| !all.contains(name)).collect::<Vec<_>>());
        }
        Ok(all)
    }

    /// Reads the files and joins them by their column `t`, or by the one that stands for it.
    ///
    /// Fails as [`SignalRecording::read`] does, when two files have a needed column, when a sum of columns has terms
    /// in several files, or when the files have no time in common.
    pub fn read(&self, options: &ReadOptions) -> Result<SignalRecording, RecordingError> {
        // A single file needs no joining.
        if let [file] = self.files.as_slice() {
            return file.read(options);
        }
        // Names are compared before anything is read.
        let names = self.files.iter().map(RecordingFile::names);
        let names = names.collect::<Result<Vec<_>, _>>()?;
        self.check_unique_sources(&names, options)?;
        let mut parts = Vec::new();
        let mut notes = Vec::new();
        for (file, names) in self.files.iter().zip(&names) {
            let recording = file.read(&options_for_file(options, names))?;
            notes.extend(recording.notes().iter().cloned());
            parts.push(recording);
        }
        // Columns keep their values in the parts to be joined; the rest of each column is kept here.
        let mut columns: Vec<(String, SignalColumn)> = Vec::new();
        let mut timed = Vec::new();
        let mut idle = Vec::new();
        for recording in &mut parts {
            let time = recording.column("t")?.to_vec();
            let mut values = Vec::new();
            for (name, mut column) in std::mem::take(&mut recording.columns) {
                if name != "t" {
                    values.push((columns.len(), std::mem::take(&mut column.values)));
                    columns.push((name, column));
                }
            }
            // A file without a needed column is reported and not joined.
            if values.is_empty() {
                idle.push(recording.file.clone());
                continue;
            }
            timed.push(JoinPart {
                name: recording.file.clone(),
                time,
                columns: values,
            });
        }
        if !idle.is_empty() {
            notes.push(RecordingNote::warning(format!(
                "No column of {} is needed.",
                backquoted_list(&idle)
            )));
        }
        let together = join_parts(timed, &mut |note| notes.push(note));
        let Some(together) = together.map_err(|fault| self.fault(fault))? else {
            return Err(self.fault(RecordingFault::NoSamples));
        };
        // Rows of the joined recording have numbers of their own.
        let lines = (1..=together.time.len() as u64).collect();
        for (place, values) in together.columns {
            columns[place].1.values = values;
        }
        let time = SignalColumn {
            values: together.time,
            ..SignalColumn::default()
        };
        let others = parts.into_iter().flat_map(|part| part.others);
        Ok(SignalRecording {
            file: self.name.clone(),
            others: others.collect(),
            columns: std::iter::once(("t".to_owned(), time)).chain(columns).collect(),
            lines,
            notes,
            late_rates: Vec::new(),
        })
    }

    /// Fails when a needed column or a computed column has no unique file.
    fn check_unique_sources(&self, names: &[Vec<String>], options: &ReadOptions) -> Result<(), RecordingError> {
        // The time may be in every file, because it joins them.
        let time: Vec<&str> = time_names(options);
        for (k, of_file) in names.iter().enumerate() {
            for name in of_file {
                let is_time = time.contains(&name.as_str());
                let twin = names[..k].iter().position(|others| others.contains(name));
                if let (false, true, Some(twin)) = (is_time, options.is_column_needed(name), twin) {
                    return Err(self.files[k].fault(RecordingFault::ColumnInTwoFiles {
                        name: name.clone(),
                        other: self.files[twin].name().to_owned(),
                    }));
                }
            }
        }
        // All terms of a sum must be in one file.
        for computed in options.computed.iter().filter(|one| one.name != "t") {
            let is_whole = |names: &Vec<String>| {
                let mut terms = computed.terms.iter();
                terms.all(|(name, _)| names.contains(name))
            };
            if !names.iter().any(is_whole) {
                return Err(self.fault(RecordingFault::SumAcrossFiles {
                    name: computed.name.clone(),
                }));
            }
        }
        Ok(())
    }

    /// A fault of the joined recording.
    fn fault(&self, fault: RecordingFault) -> RecordingError {
        RecordingError {
            file: self.name.clone(),
            fault,
        }
    }
}

/// Names of columns that files may use for the time.
fn time_names(options: &ReadOptions) -> Vec<&str> {
    let renamed = options.renames.iter().filter(|(ours, _)| ours == "t");
    let computed = options.computed.iter().filter(|one| one.name == "t");
    let terms = computed.flat_map(|one| one.terms.iter().map(|(name, _)| name.as_str()));
    let theirs = renamed.map(|(_, theirs)| theirs.as_str());
    theirs.chain(terms).chain(std::iter::once("t")).collect()
}

/// The options restricted to the columns of one file.
fn options_for_file(options: &ReadOptions, names: &[String]) -> ReadOptions {
    let mut own = options.clone();
    own.renames.retain(|(_, theirs)| names.contains(theirs));
    own.computed
        .retain(|one| one.terms.iter().all(|(name, _)| names.contains(name)));
    own
}
