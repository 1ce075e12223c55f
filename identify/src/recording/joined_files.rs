//! Several files of one run: opened together, read one by one, and joined on their times.
//!
//! A file without times, such as one with a single variable, is joined row by row to a file that has as many samples
//! and their times. A name in several files is unique with the name of its file: `forces.data`.

use std::path::Path;

use indexmap::IndexMap;
use modelmill_boundary::files::FileSource;

use crate::recording::column::SignalColumn;
use crate::recording::error::{RecordingError, RecordingFault};
use crate::recording::join::{JoinPart, join_parts};
use crate::recording::notes::RecordingNote;
use crate::recording::{ComputedColumn, ReadOptions, RecordingFile, SignalRecording};
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

    /// Names of all columns, those of the first file first; a name in several files occurs once as it is, and with the
    /// name of each of its files.
    pub fn names(&self) -> Result<Vec<String>, RecordingError> {
        let names = self.names_by_file()?;
        // The number of files that have each name; names of a log may be very many.
        let mut counts: IndexMap<&String, usize> = IndexMap::new();
        for name in names.iter().flatten() {
            *counts.entry(name).or_insert(0) += 1;
        }
        let mut all: Vec<String> = counts.keys().map(|name| (*name).clone()).collect();
        for (k, of_file) in names.iter().enumerate() {
            for name in of_file.iter().filter(|name| counts[*name] > 1) {
                let qualified = self.qualified_name(k, name);
                if !counts.contains_key(&qualified) {
                    all.push(qualified);
                }
            }
        }
        Ok(all)
    }

    /// Names of the columns of each file.
    fn names_by_file(&self) -> Result<Vec<Vec<String>>, RecordingError> {
        self.files.iter().map(RecordingFile::names).collect()
    }

    /// The name of a column with that of its file before it.
    fn qualified_name(&self, file: usize, name: &str) -> String {
        let stem = Path::new(self.files[file].name()).file_stem();
        format!("{}.{name}", stem.unwrap_or_default().to_string_lossy())
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
        let names = self.names_by_file()?;
        self.check_unique_sources(&names, options)?;
        let mut parts = self.read_parts(&names, options)?;
        let mut notes: Vec<RecordingNote> = parts.iter().flat_map(|part| part.notes().iter().cloned()).collect();
        let times = times_of_parts(&parts, options.time_interval)?;
        // Columns keep their values in the parts to be joined; the rest of each column is kept here.
        let mut columns: Vec<(String, SignalColumn)> = Vec::new();
        let mut timed = Vec::new();
        let mut idle = Vec::new();
        for (recording, time) in parts.iter_mut().zip(times) {
            let mut values = Vec::new();
            for (name, mut column) in std::mem::take(&mut recording.columns) {
                if name != "t" {
                    let kept = time.samples.iter().map(|k| column.values[*k]).collect();
                    values.push((columns.len(), kept));
                    column.values.clear();
                    columns.push((name, column));
                }
            }
            // A file without a needed column is reported and not joined.
            if values.is_empty() {
                if !time.is_lent {
                    idle.push(recording.file.clone());
                }
                continue;
            }
            timed.push(JoinPart {
                name: recording.file.clone(),
                time: time.values,
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
            zero_stamp: None,
            unwrapped: Vec::new(),
            late_rates: Vec::new(),
        })
    }

    /// Reads every file. If one has no times, none is cut to an interval of time yet.
    fn read_parts(&self, names: &[Vec<String>], options: &ReadOptions) -> Result<Vec<SignalRecording>, RecordingError> {
        let time = time_names(options);
        let has_time = |names: &Vec<String>| names.iter().any(|name| time.contains(&name.as_str()));
        let all_timed = options.rate.is_some() || names.iter().all(has_time);
        let mut parts = Vec::new();
        for (k, (file, names)) in self.files.iter().zip(names).enumerate() {
            let qualified: Vec<String> = names.iter().map(|name| self.qualified_name(k, name)).collect();
            let mut own = options_for_file(options, names, &qualified);
            if !all_timed {
                own.time_interval = None;
            }
            parts.push(file.read(&own)?);
        }
        Ok(parts)
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
                        qualified: self.qualified_name(k, name),
                    }));
                }
            }
        }
        // All terms of a sum must be in one file.
        for computed in options.computed.iter().filter(|one| one.name != "t") {
            let is_in = |k: usize, name: &String| {
                names[k].contains(name) || names[k].iter().any(|own| self.qualified_name(k, own) == *name)
            };
            let is_complete = |k: usize| computed.terms.iter().all(|(name, _)| is_in(k, name));
            if !(0..names.len()).any(is_complete) {
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

/// The times of one of several files.
struct PartTimes {
    /// Times of the samples that are used, s.
    values: Vec<f64>,
    /// Positions of these samples in the file.
    samples: Vec<usize>,
    /// Whether another file without times uses them as well.
    is_lent: bool,
}

/// The times of every file. A file without times gets those of another one with as many samples. Time stamps are
/// counted from the first one of all files.
///
/// Fails when the times of a file have other contents than numbers, or no file can lend its times.
fn times_of_parts(parts: &[SignalRecording], interval: Option<(f64, f64)>) -> Result<Vec<PartTimes>, RecordingError> {
    let earliest = parts.iter().filter_map(|part| part.zero_stamp).min();
    let has_time = |part: &SignalRecording| part.has_column("t");
    let mut is_lent = vec![false; parts.len()];
    let mut times = Vec::new();
    for part in parts {
        let lender = if has_time(part) {
            part
        } else {
            // Rows correspond only if the same ones were read.
            let fits = |other: &SignalRecording| has_time(other) && has_same_rows(part, other);
            let Some(lender) = parts.iter().position(fits) else {
                let timed = parts.iter().filter(|other| has_time(other));
                return Err(part.fault(RecordingFault::NoTimeOfOwn {
                    samples: part.samples(),
                    timed: timed.map(|other| other.file.clone()).collect(),
                }));
            };
            is_lent[lender] = true;
            &parts[lender]
        };
        let shift = match (lender.zero_stamp, earliest) {
            (Some(zero), Some(earliest)) => zero.wrapping_sub(earliest) as f64 / 1e9,
            _ => 0.0,
        };
        let time = lender.column("t")?.iter().map(|t| t + shift);
        let is_within = |t: f64| interval.is_none_or(|(from, to)| from <= t && t <= to);
        let (samples, values) = time.enumerate().filter(|(_, t)| is_within(*t)).unzip();
        times.push(PartTimes {
            values,
            samples,
            is_lent: false,
        });
    }
    for (time, is_lent) in times.iter_mut().zip(is_lent) {
        time.is_lent = is_lent;
    }
    Ok(times)
}

/// Whether two files have as many samples, and the same ones were left out.
fn has_same_rows(one: &SignalRecording, other: &SignalRecording) -> bool {
    let offsets = |recording: &SignalRecording| -> Vec<u64> {
        let first = recording.lines.first().copied().unwrap_or(0);
        recording.lines.iter().map(|line| line - first).collect()
    };
    one.samples() == other.samples() && offsets(one) == offsets(other)
}

/// The options restricted to the columns of one file, whose names with that of the file are `qualified`.
fn options_for_file(options: &ReadOptions, names: &[String], qualified: &[String]) -> ReadOptions {
    let own_name = |name: &String| {
        if names.contains(name) {
            return Some(name.clone());
        }
        let place = qualified.iter().position(|other| other == name);
        place.map(|place| names[place].clone())
    };
    let mut own = options.clone();
    let renames = options.renames.iter();
    own.renames = renames
        .filter_map(|(ours, theirs)| Some((ours.clone(), own_name(theirs)?)))
        .collect();
    own.computed = (options.computed.iter())
        .filter_map(|one| {
            let terms = one.terms.iter();
            let terms = terms.map(|(name, factor)| Some((own_name(name)?, *factor)));
            Some(ComputedColumn {
                terms: terms.collect::<Option<Vec<_>>>()?,
                ..one.clone()
            })
        })
        .collect();
    own
}
