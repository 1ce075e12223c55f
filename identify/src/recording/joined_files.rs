//! Several files of one run: opened together, read one by one, and joined on their times.
//!
//! A file without times, such as one with a single variable, is joined row by row to a file that has as many samples
//! and their times. A name in several files is unique with the name of its file: `forces.data`. Files of the same name
//! are distinguished by their extension or their folder: `monday.run.tau`.

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
    /// What stands before the names of the columns of each file where several files have them.
    qualifiers: Vec<String>,
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
            qualifiers: unique_qualifiers(&names),
            files,
        })
    }

    /// Makes a recording of columns in memory; `name` is its name in messages. Fails when columns differ in length.
    pub fn from_table(name: &str, columns: Vec<(String, Vec<f64>)>) -> Result<Self, RecordingError> {
        let file = RecordingFile::from_table(name, columns)?;
        Ok(Self {
            name: file.name().to_owned(),
            qualifiers: unique_qualifiers(&[file.name()]),
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
        format!("{}.{name}", self.qualifiers[file])
    }

    /// The name that a file uses for a column that is requested by its own name, or with the name of the file.
    fn own_name<'a>(&self, file: usize, names: &'a [String], requested: &str) -> Option<&'a String> {
        let find = |wanted: &str| names.iter().find(|name| *name == wanted);
        find(requested).or_else(|| find(requested.strip_prefix(&self.qualifiers[file])?.strip_prefix('.')?))
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
            let mut own = options_for_file(options, |name| self.own_name(k, names, name).cloned());
            // A column of another file under the name of one of this file replaces it.
            for name in replaced_names(options).filter(|name| names.contains(name)) {
                let is_here = own.renames.iter().any(|(ours, theirs)| ours == name || theirs == name);
                if !is_here && !own.computed.iter().any(|one| one.name == *name) {
                    own.renames.push((self.qualified_name(k, name), name.clone()));
                }
            }
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
                if is_time || !options.is_column_needed(name) {
                    continue;
                }
                // A name that the user gives to another column is not needed as itself.
                if replaced_names(options).any(|other| other == name) && !is_source(options, name) {
                    continue;
                }
                if let Some(twin) = names[..k].iter().position(|others| others.contains(name)) {
                    return Err(self.files[k].fault(RecordingFault::ColumnInTwoFiles {
                        name: name.clone(),
                        other: self.files[twin].name().to_owned(),
                        qualified: self.qualified_name(k, name),
                    }));
                }
            }
        }
        // A column of one file may be called as one of another file is with the name of that file.
        let terms = options.computed.iter().flat_map(|one| &one.terms);
        let sources = (options.renames.iter().map(|(_, theirs)| theirs)).chain(terms.map(|(name, _)| name));
        for name in sources.filter(|name| !time.contains(&name.as_str()) && options.is_column_needed(name)) {
            let mut owners = (0..names.len()).filter_map(|k| Some((k, self.own_name(k, &names[k], name)?)));
            if let (Some((first, _)), Some((second, own))) = (owners.next(), owners.next()) {
                return Err(self.files[second].fault(RecordingFault::ColumnInTwoFiles {
                    name: name.clone(),
                    other: self.files[first].name().to_owned(),
                    qualified: self.qualified_name(second, own),
                }));
            }
        }
        // All terms of a sum must be in one file.
        for computed in options.computed.iter().filter(|one| one.name != "t") {
            let is_in = |k: usize, name: &String| self.own_name(k, &names[k], name).is_some();
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

/// Names, other than the time, that the user gives to columns or sums of columns.
fn replaced_names(options: &ReadOptions) -> impl Iterator<Item = &String> {
    let renamed = options.renames.iter().map(|(ours, _)| ours);
    let computed = options.computed.iter().map(|one| &one.name);
    renamed.chain(computed).filter(|name| *name != "t")
}

/// Whether a column is requested by this name, for another name or for a sum.
fn is_source(options: &ReadOptions, name: &String) -> bool {
    let mut terms = options.computed.iter().flat_map(|one| &one.terms);
    options.renames.iter().any(|(_, theirs)| theirs == name) || terms.any(|(term, _)| term == name)
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

/// Unique names of files: the name without its extension, with it, or with folders before it, whatever is unique first.
/// A file that is given twice gets its position.
fn unique_qualifiers(names: &[&str]) -> Vec<String> {
    let choices: Vec<Vec<String>> = names.iter().map(|name| qualifier_choices(name)).collect();
    let mut all: Vec<String> = Vec::new();
    for (k, own) in choices.iter().enumerate() {
        let is_unique = |choice: &&String| {
            let mut others = choices.iter().enumerate().filter(|(other, _)| *other != k);
            others.all(|(_, others)| !others.contains(choice))
        };
        let numbered = || format!("{}_{}", own.first().map_or("", String::as_str), k + 1);
        all.push(own.iter().find(is_unique).cloned().unwrap_or_else(numbered));
    }
    all
}

/// Possible names of a file before those of its columns, the shortest first.
fn qualifier_choices(name: &str) -> Vec<String> {
    let path = Path::new(name);
    let text = |part: Option<&std::ffi::OsStr>| part.unwrap_or_default().to_string_lossy().into_owned();
    let mut choices = vec![text(path.file_stem()), text(path.file_name())];
    let mut before = String::new();
    for folder in path.ancestors().skip(1).filter_map(Path::file_name) {
        before = format!("{}.{before}", folder.to_string_lossy());
        choices.extend([0, 1].map(|k| format!("{before}{}", choices[k])));
    }
    choices
}

/// The options restricted to the columns of one file; `own_name` returns the name in the file of a requested column.
fn options_for_file(options: &ReadOptions, own_name: impl Fn(&str) -> Option<String>) -> ReadOptions {
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

#[cfg(test)]
mod tests {
    use modelmill_boundary::files::MemoryFiles;

    use super::*;

    /// Two files of one name, each with a force; the second one has other positions.
    fn same_names() -> RecordingFiles {
        let text = |columns: &str, force: u32| {
            let lines = (0..20).map(|k| format!("0.0{k:02},{k},{force}\n"));
            format!("t,{columns}\n{}", lines.collect::<String>())
        };
        let files = MemoryFiles::default()
            .with_file("monday/run.csv", text("q,tau", 1))
            .with_file("sunday/run.csv", text("p,tau", 2));
        RecordingFiles::open(&files, &["monday/run.csv".as_ref(), "sunday/run.csv".as_ref()]).unwrap()
    }

    /// Options that read a column as `tau`.
    fn options(theirs: &str) -> ReadOptions {
        ReadOptions {
            renames: vec![("tau".to_owned(), theirs.to_owned())],
            wanted: Some(["t", "q", "tau"].map(str::to_owned).to_vec()),
            ..ReadOptions::default()
        }
    }

    #[test]
    fn columns_of_files_with_the_same_name_are_distinguished_by_folders() {
        let files = same_names();
        let fault = files.read(&options("tau")).unwrap_err().fault;
        let RecordingFault::ColumnInTwoFiles { qualified, .. } = fault else {
            panic!("{fault:?}");
        };
        assert_eq!(qualified, "sunday.run.tau");
        let names = files.names().unwrap();
        for (theirs, force) in [("monday.run.tau", 1.0), ("sunday.run.tau", 2.0)] {
            assert!(names.contains(&theirs.to_owned()), "{names:?}");
            let read = files.read(&options(theirs)).unwrap();
            assert_eq!(read.column("tau").unwrap(), [force; 20], "{theirs}");
        }
    }

    /// The column of the other file with the requested name is neither read nor a reason to refuse the files.
    #[test]
    fn a_requested_column_replaces_one_of_another_file() {
        let files = MemoryFiles::default()
            .with_file("one.csv", "t,q,motor\n0,1,5\n1,2,5\n")
            .with_file("two.csv", "t,tau\n0,7\n1,7\n");
        let files = RecordingFiles::open(&files, &["one.csv".as_ref(), "two.csv".as_ref()]).unwrap();
        assert_eq!(files.read(&options("motor")).unwrap().column("tau").unwrap(), [5.0; 2]);
        let all = ReadOptions {
            wanted: None,
            ..options("motor")
        };
        let read = files.read(&all).unwrap();
        assert_eq!(read.column("tau").unwrap(), [5.0; 2]);
        assert_eq!(read.column("two.tau").unwrap(), [7.0; 2]);
    }

    #[test]
    fn a_column_that_two_files_may_mean_is_refused() {
        let files = MemoryFiles::default()
            .with_file("one.csv", "t,q,tau\n0,1,5\n1,2,5\n")
            .with_file("two.csv", "t,one.tau\n0,7\n1,7\n");
        let files = RecordingFiles::open(&files, &["one.csv".as_ref(), "two.csv".as_ref()]).unwrap();
        let fault = files.read(&options("one.tau")).unwrap_err().fault;
        let RecordingFault::ColumnInTwoFiles { qualified, .. } = fault else {
            panic!("{fault:?}");
        };
        let read = files.read(&options(&qualified)).unwrap();
        assert_eq!(read.column("tau").unwrap(), [7.0; 2]);
    }

    #[test]
    fn qualifiers_are_short_and_unique() {
        for (names, expected) in [
            (vec!["a/angles.mat", "b/forces.mat"], vec!["angles", "forces"]),
            (vec!["a/run.csv", "a/run.mat"], vec!["run.csv", "run.mat"]),
            (vec!["x/a/run.csv", "x/b/run.csv"], vec!["a.run", "b.run"]),
            (vec!["x/a/run.csv", "y/a/run.csv"], vec!["x.a.run", "y.a.run"]),
            (vec!["run.csv", "run.csv"], vec!["run_1", "run_2"]),
        ] {
            assert_eq!(unique_qualifiers(&names), expected);
        }
    }
}
