//! Takes the samples of a recording into memory, whatever the format of the file. Names are checked and renamed,
//! columns that are not needed are skipped, and fields that are not numbers are recorded with their place.
//!
//! A reader creates a [`SampleIntake`], passes each sample to it, and gets the recording from `finish`.

use indexmap::IndexMap;

use crate::recording::SignalRecording;
use crate::recording::column::{ColumnDefect, ColumnScaling, SampleField, SignalColumn, missing_column_fault};
use crate::recording::error::RecordingFault;
use crate::recording::notes::RecordingNote;
use crate::recording::options::{ComputedColumn, NonFinitePolicy, ReadOptions};
use crate::words::count_of;

/// Whether the reader should continue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum IntakeFlow {
    /// Continue with the next sample.
    Go,
    /// No later sample is needed.
    Stop,
}

/// How the time of a sample is found.
#[derive(Debug, Clone, PartialEq)]
enum SampleClock {
    /// A sum of fields, by position and factor, and a constant.
    Fields(Vec<(usize, f64)>, f64),
    /// The position of the sample over this rate, Hz.
    Rate(f64),
}

/// Takes samples one by one and collects the columns that are needed.
pub(crate) struct SampleIntake<'a> {
    /// What the caller wants to read.
    options: &'a ReadOptions,
    /// Names of the columns in the file.
    theirs: Vec<String>,
    /// Names after renaming, in the order of the file.
    names: Vec<String>,
    /// Whether each column is kept.
    kept: Vec<bool>,
    /// Whether single values of each column may be missing.
    may_lack: Vec<bool>,
    /// The columns by their position in the file; empty if they are not kept.
    columns: Vec<SignalColumn>,
    /// Line or row of each sample that was taken.
    lines: Vec<u64>,
    /// Line of the first sample that was left out for a bad field, and the number of such samples.
    left_out: Option<(u64, usize)>,
    /// The time of a sample, only if samples are selected by time.
    time: Option<SampleClock>,
    /// Number of samples that were passed, with those that were left out.
    passed: usize,
    /// Times of the samples that were taken, s, if they follow from a sampling rate.
    clock: Vec<f64>,
    /// First time stamps of columns, ns since 1970, by position.
    zeros: Vec<(usize, i64)>,
    /// Number of samples before the time interval.
    before: usize,
    /// The line at which reading stopped, because the time interval had ended.
    stopped: Option<u64>,
    /// Notes for the user.
    notes: Vec<RecordingNote>,
}

impl<'a> SampleIntake<'a> {
    /// Prepares for samples of columns that the file calls `theirs`. Fails when names are missing or duplicate, or
    /// when a renaming or computed column refers to a column that does not exist.
    pub(crate) fn new(theirs: Vec<String>, options: &'a ReadOptions) -> Result<Self, RecordingFault> {
        check_names(&theirs)?;
        let place = |name: &String| {
            let place = theirs.iter().position(|other| other == name);
            place.ok_or_else(|| missing_column_fault(name, theirs.iter().map(String::as_str), true))
        };
        // Columns that computed ones are made of are read even if they are not wanted.
        let mut sources = Vec::new();
        for computed in &options.computed {
            for (name, _) in &computed.terms {
                sources.push(place(name)?);
            }
        }
        let mut names = rename(&theirs, &options.renames)?;
        // A computed column replaces a column of the same name in the file, which gets another name.
        for computed in &options.computed {
            for (name, of_theirs) in names.iter_mut().zip(&theirs) {
                if *name == computed.name {
                    *name = format!("{of_theirs} (as recorded)");
                }
            }
        }
        // A rate replaces the times of the file.
        if options.rate.is_some() {
            for (name, of_theirs) in names.iter_mut().zip(&theirs) {
                if name == "t" {
                    *name = format!("{of_theirs} (as recorded)");
                }
            }
        }
        find_duplicate(&names, true)?;
        // Without a list of wanted columns all of them are wanted.
        let is_wanted = |name: &String| {
            let wanted = options.wanted.as_ref();
            wanted.is_none_or(|wanted| wanted.contains(name))
        };
        // Wanted columns are kept; columns that may lack values do not cause a sample to be left out.
        let mut kept: Vec<bool> = names.iter().map(is_wanted).collect();
        let is_optional = |name: &String| options.may_be_missing.contains(name);
        let mut may_lack: Vec<bool> = names.iter().map(is_optional).collect();
        for (name, may_lack) in names.iter().zip(&mut may_lack) {
            // An unwanted column is only a source of computed ones, which decide below whether it may lack values.
            *may_lack |= !is_wanted(name);
        }
        // A source must be complete if any computed column that needs it must be.
        for computed in &options.computed {
            for (name, _) in &computed.terms {
                may_lack[place(name)?] &= is_optional(&computed.name);
            }
        }
        for place in sources {
            kept[place] = true;
        }
        // The time is needed to select samples; it may be computed itself.
        let time = match (options.time_interval, options.rate) {
            (None, _) => None,
            (Some(_), Some(rate)) => Some(SampleClock::Rate(rate)),
            (Some(_), None) => match options.computed.iter().find(|one| one.name == "t") {
                Some(ComputedColumn { terms, offset, .. }) => {
                    let terms = terms.iter().map(|(name, factor)| Ok((place(name)?, *factor)));
                    let terms = terms.collect::<Result<Vec<_>, RecordingFault>>()?;
                    Some(SampleClock::Fields(terms, *offset))
                }
                None => match names.iter().position(|name| name == "t") {
                    Some(place) => Some(SampleClock::Fields(vec![(place, 1.0)], 0.0)),
                    None => {
                        return Err(missing_column_fault("t", names.iter().map(String::as_str), false));
                    }
                },
            },
        };
        Ok(Self {
            options,
            columns: vec![SignalColumn::default(); names.len()],
            theirs,
            names,
            kept,
            may_lack,
            lines: Vec::new(),
            left_out: None,
            time,
            passed: 0,
            clock: Vec::new(),
            zeros: Vec::new(),
            before: 0,
            stopped: None,
            notes: Vec::new(),
        })
    }

    /// Number of fields of a sample.
    pub(crate) fn width(&self) -> usize {
        self.names.len()
    }

    /// Whether the field at this position is used; readers may skip all others.
    pub(crate) fn is_place_needed(&self, place: usize) -> bool {
        self.kept[place] || is_time_place(self.time.as_ref(), place)
    }

    /// Adds a note about the file.
    pub(crate) fn note(&mut self, note: RecordingNote) {
        self.notes.push(note);
    }

    /// Takes a sample from a line; `text` returns a field as it stands in the file, for messages. Fails when more
    /// numbers would be kept than allowed.
    pub(crate) fn take_sample(
        &mut self,
        line: u64,
        sample: &[SampleField],
        text: &dyn Fn(usize) -> String,
    ) -> Result<IntakeFlow, RecordingFault> {
        let position = self.passed;
        self.passed += 1;
        // First the time interval: times increase, so the first time behind it ends the reading.
        if let (Some((from, to)), Some(time)) = (self.options.time_interval, self.time_of(sample, position)) {
            if time < from {
                self.before += 1;
                return Ok(IntakeFlow::Go);
            }
            if time > to {
                self.stopped = Some(line);
                return Ok(IntakeFlow::Stop);
            }
        }
        // Then bad fields: a sample is left out if a field that must be present is bad.
        let is_read = |place: usize| self.kept[place] && !self.may_lack[place];
        if self.options.not_finite == NonFinitePolicy::LeaveOut
            && (0..sample.len()).any(|i| is_read(i) && sample[i] == SampleField::NotFinite)
        {
            self.left_out.get_or_insert((line, 0)).1 += 1;
            return Ok(IntakeFlow::Go);
        }
        let n_kept = self.kept.iter().filter(|kept| **kept).count() + self.options.computed.len();
        // The line of each sample is kept with its numbers, so it counts, too.
        if (self.lines.len() + 1) * (n_kept + 1) > self.options.max_numbers {
            return Err(RecordingFault::TooLarge {
                line,
                samples: self.lines.len(),
                columns: n_kept,
                until: self.last_time(),
            });
        }
        self.lines.push(line);
        if let Some(rate) = self.options.rate {
            self.clock.push(position as f64 / rate);
        }
        for place in 0..sample.len() {
            if self.kept[place] {
                self.columns[place].push(sample[place], line, &|| text(place));
            }
        }
        Ok(IntakeFlow::Go)
    }

    /// Leaves a gap of so many samples in times that follow from a sampling rate.
    #[cfg(feature = "parquet")]
    pub(crate) fn skip_samples(&mut self, samples: usize) {
        self.passed += samples;
    }

    /// Declares fields of a column that were taken as numbers to be text; `first` describes them.
    pub(crate) fn refuse_fields(&mut self, place: usize, first: ColumnDefect) {
        let text = &mut self.columns[place].text;
        let later = text.as_ref().map_or(0, |text| text.count);
        let count = first.count + later;
        *text = Some(ColumnDefect { count, ..first });
    }

    /// States the first time stamp of a column, ns since 1970, from which its times are counted.
    pub(crate) fn set_zero(&mut self, place: usize, stamp: i64) {
        self.zeros.push((place, stamp));
    }

    /// The time of the sample at a position; `None` if a field of it is not a number.
    fn time_of(&self, sample: &[SampleField], position: usize) -> Option<f64> {
        let (terms, offset) = match self.time.as_ref()? {
            SampleClock::Rate(rate) => return Some(position as f64 / rate),
            SampleClock::Fields(terms, offset) => (terms, offset),
        };
        let mut time = *offset;
        for (place, factor) in terms {
            match sample[*place] {
                SampleField::Number(value) => time += factor * value,
                // A sample without a time is kept; the check of the time column reports it.
                SampleField::NotFinite | SampleField::Text => return None,
            }
        }
        Some(time)
    }

    /// First and last time that were taken, if the file has a column `t`.
    fn last_time(&self) -> Option<(f64, f64)> {
        if self.options.rate.is_some() {
            return Some((*self.clock.first()?, *self.clock.last()?));
        }
        let place = self.names.iter().position(|name| name == "t")?;
        let column = &self.columns[place].values;
        Some((*column.first()?, *column.last()?))
    }

    /// Completes the recording, which messages call `file`. Fails when there are no samples.
    pub(crate) fn finish(self, file: &str) -> Result<SignalRecording, RecordingFault> {
        // An empty result has another cause if a time interval was requested.
        if self.lines.is_empty() {
            if let (Some((from, to)), true) = (self.options.time_interval, self.before > 0 || self.stopped.is_some()) {
                return Err(RecordingFault::NoSamplesInInterval { from, to });
            }
            return Err(RecordingFault::NoSamples);
        }
        // Notes on samples that were skipped or left out.
        let mut notes = self.notes;
        if let Some((from, to)) = self.options.time_interval {
            let rest = match self.stopped {
                Some(line) => format!(", and all from line {line} on"),
                None => String::new(),
            };
            notes.push(RecordingNote::info(format!(
                "Of {file} only the {} from t = {from} s to {to} s are read; {} before{rest} {} skipped.",
                count_of(self.lines.len(), "sample", "samples"),
                count_of(self.before, "sample", "samples"),
                if self.before == 1 { "is" } else { "are" },
            )));
        }
        if let Some((first, n)) = self.left_out {
            notes.push(RecordingNote::warning(format!(
                "{n} of {} samples of {file} {} NaN, infinite or empty fields and {} left out, the first in line {first}.",
                n + self.lines.len(),
                if n == 1 { "contains" } else { "contain" },
                if n == 1 { "is" } else { "are" },
            )));
        }
        // Computed columns come from the kept columns, before these are sorted by whether they are wanted.
        let mut computed = IndexMap::new();
        for one in &self.options.computed {
            // A rate has priority over a sum of columns for the time.
            if self.options.rate.is_some() && one.name == "t" {
                continue;
            }
            computed.insert(one.name.clone(), compute_column(one, &self.theirs, &self.columns));
        }
        if let Some(rate) = self.options.rate {
            notes.push(RecordingNote::info(format!(
                "The times of {file} are computed from the sampling rate of {rate} Hz."
            )));
            let time = SignalColumn {
                values: self.clock,
                ..SignalColumn::default()
            };
            computed.insert("t".to_owned(), time);
        }
        // The stamp from which the times of the recording are counted.
        let zero_stamp = (self.zeros.iter().find(|(place, _)| self.names[*place] == "t")).map(|(_, stamp)| *stamp);
        let wanted = self.options.wanted.as_ref();
        let mut columns = IndexMap::new();
        let mut others = Vec::new();
        for (name, column) in self.names.into_iter().zip(self.columns) {
            if wanted.is_none_or(|wanted| wanted.contains(&name)) {
                columns.insert(name, column);
            } else {
                others.push(name);
            }
        }
        columns.extend(computed);
        // Columns with defects are reported now, and refused when they are used.
        for (name, column) in &columns {
            for (defect, what) in [
                (&column.text, "text that is not a number"),
                (&column.not_finite, "NaN, infinite or empty fields"),
            ] {
                if let Some(ColumnDefect { line, count, .. }) = defect {
                    notes.push(RecordingNote::warning(format!(
                        "Column `{name}` of {file} contains {what} ({}, the first in line {line}) and cannot be used.",
                        count_of(*count, "field", "fields")
                    )));
                }
            }
        }
        Ok(SignalRecording {
            file: file.to_owned(),
            columns,
            others,
            lines: self.lines,
            notes,
            zero_stamp,
            unwrapped: Vec::new(),
            late_rates: Vec::new(),
        })
    }
}

/// Whether the time is computed from the field at this position.
fn is_time_place(time: Option<&SampleClock>, place: usize) -> bool {
    matches!(time, Some(SampleClock::Fields(terms, _)) if terms.iter().any(|(other, _)| *other == place))
}

/// A computed column: `offset + sum of factor * column`. Defects of any term are defects of the sum.
fn compute_column(computed: &ComputedColumn, theirs: &[String], columns: &[SignalColumn]) -> SignalColumn {
    let mut sum = SignalColumn::default();
    for (name, factor) in &computed.terms {
        let Some(place) = theirs.iter().position(|other| other == name) else {
            continue;
        };
        let column = &columns[place];
        if sum.values.is_empty() {
            sum.values = vec![computed.offset; column.values.len()];
        }
        for (total, value) in sum.values.iter_mut().zip(&column.values) {
            *total += factor * value;
        }
        sum.text = sum.text.or_else(|| column.text.clone());
        sum.not_finite = sum.not_finite.or_else(|| column.not_finite.clone());
    }
    sum.scaling = match computed.terms.as_slice() {
        [(_, factor)] if *factor != 0.0 => Some(ColumnScaling {
            factor: *factor,
            offset: computed.offset,
        }),
        _ => None,
    };
    sum
}

/// Fails when a column has no name, or two have the same.
fn check_names(names: &[String]) -> Result<(), RecordingFault> {
    for (i, name) in names.iter().enumerate() {
        if name.is_empty() {
            return Err(RecordingFault::UnnamedColumn { place: i + 1 });
        }
    }
    find_duplicate(names, false)
}

/// Fails when two names are equal; positions in the fault count from 1.
fn find_duplicate(names: &[String], by_renaming: bool) -> Result<(), RecordingFault> {
    let mut seen = std::collections::BTreeMap::new();
    for (i, name) in names.iter().enumerate() {
        if let Some(first) = seen.insert(name, i) {
            return Err(RecordingFault::DuplicateColumn {
                name: name.clone(),
                places: [first + 1, i + 1],
                by_renaming,
            });
        }
    }
    Ok(())
}

/// Applies renamings `(ours, theirs)`. Fails when a name occurs twice in them, or a column does not exist.
fn rename(names: &[String], renames: &[(String, String)]) -> Result<Vec<String>, RecordingFault> {
    let mut renamed = names.to_vec();
    for (i, (ours, theirs)) in renames.iter().enumerate() {
        // Each column and each new name may occur once.
        if renames[..i].iter().any(|(o, t)| o == ours || t == theirs) {
            let twice_ours = renames[..i].iter().any(|(o, _)| o == ours);
            return Err(RecordingFault::DuplicateRenaming {
                name: if twice_ours { ours } else { theirs }.clone(),
            });
        }
        match names.iter().position(|name| name == theirs) {
            Some(place) => renamed[place].clone_from(ours),
            None => {
                return Err(missing_column_fault(theirs, names.iter().map(String::as_str), true));
            }
        }
    }
    Ok(renamed)
}
