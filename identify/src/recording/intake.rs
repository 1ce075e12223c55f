//! Samples of a recording on their way into memory, whatever the format of the file: names are checked and
//! changed, columns that nobody needs are passed over, and fields that are no numbers are noted with their place.

use indexmap::IndexMap;

use crate::recording::SignalRecording;
use crate::recording::column::{ColumnDefect, SampleField, SignalColumn, missing_column_fault};
use crate::recording::error::RecordingFault;
use crate::recording::notes::RecordingNote;
use crate::recording::options::{ComputedColumn, NonFinitePolicy, ReadOptions};
use crate::words::count_of;

/// Whether more samples are wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum IntakeFlow {
    Go,
    Stop,
}

/// Takes samples one by one.
pub(crate) struct SampleIntake<'a> {
    options: &'a ReadOptions,
    theirs: Vec<String>,
    names: Vec<String>,
    /// Places of the columns that are kept.
    kept: Vec<bool>,
    /// Places of columns that only those need of which single values may be missing.
    may_lack: Vec<bool>,
    columns: Vec<SignalColumn>,
    lines: Vec<u64>,
    /// The first sample that was left out, and how many were.
    left_out: Option<(u64, usize)>,
    /// How the time of a sample follows from its fields, where samples are chosen by it.
    time: Option<(Vec<(usize, f64)>, f64)>,
    before: usize,
    /// The line from which on nothing was read.
    stopped: Option<u64>,
    notes: Vec<RecordingNote>,
}

impl<'a> SampleIntake<'a> {
    /// Ready for samples of columns that the file calls `theirs`.
    /// Fails when names are missing or double, or a renaming or computed column asks for one that is not there.
    pub(crate) fn new(
        theirs: Vec<String>,
        options: &'a ReadOptions,
    ) -> Result<Self, RecordingFault> {
        check_names(&theirs)?;
        let place = |name: &String| {
            let place = theirs.iter().position(|other| other == name);
            place.ok_or_else(|| missing_column_fault(name, theirs.iter().map(String::as_str), true))
        };
        let mut sources = Vec::new();
        for computed in &options.computed {
            for (name, _) in &computed.terms {
                sources.push(place(name)?);
            }
        }
        let mut names = rename(&theirs, &options.renames)?;
        // A computed column takes the place of one that the file calls so.
        for computed in &options.computed {
            for (name, of_theirs) in names.iter_mut().zip(&theirs) {
                if *name == computed.name {
                    *name = format!("{of_theirs} (as recorded)");
                }
            }
        }
        find_duplicate(&names, true)?;
        let is_wanted = |name: &String| {
            let wanted = options.wanted.as_ref();
            wanted.is_none_or(|wanted| wanted.contains(name))
        };
        let mut kept: Vec<bool> = names.iter().map(is_wanted).collect();
        let is_optional = |name: &String| options.may_be_missing.contains(name);
        let mut may_lack: Vec<bool> = names.iter().map(is_optional).collect();
        for (name, may_lack) in names.iter().zip(&mut may_lack) {
            // A column that nobody wants by itself is a source of computed ones.
            *may_lack |= !is_wanted(name);
        }
        for computed in &options.computed {
            for (name, _) in &computed.terms {
                may_lack[place(name)?] &= is_optional(&computed.name);
            }
        }
        for place in sources {
            kept[place] = true;
        }
        let time = match options.time_interval {
            None => None,
            Some(_) => match options.computed.iter().find(|one| one.name == "t") {
                Some(ComputedColumn { terms, offset, .. }) => {
                    let terms = terms
                        .iter()
                        .map(|(name, factor)| Ok((place(name)?, *factor)));
                    Some((terms.collect::<Result<Vec<_>, RecordingFault>>()?, *offset))
                }
                None => match names.iter().position(|name| name == "t") {
                    Some(place) => Some((vec![(place, 1.0)], 0.0)),
                    None => {
                        return Err(missing_column_fault(
                            "t",
                            names.iter().map(String::as_str),
                            false,
                        ));
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
            before: 0,
            stopped: None,
            notes: Vec::new(),
        })
    }

    /// Fields of a sample.
    pub(crate) fn width(&self) -> usize {
        self.names.len()
    }

    /// Whether the fields at this place are looked at.
    pub(crate) fn is_place_needed(&self, place: usize) -> bool {
        self.kept[place] || is_time_place(self.time.as_ref(), place)
    }

    /// A remark on the file.
    pub(crate) fn note(&mut self, note: RecordingNote) {
        self.notes.push(note);
    }

    /// Takes a sample; `text` gives a field as it stands in the file, for messages.
    /// Fails when more numbers would be kept than allowed.
    pub(crate) fn take_sample(
        &mut self,
        line: u64,
        sample: &[SampleField],
        text: &dyn Fn(usize) -> String,
    ) -> Result<IntakeFlow, RecordingFault> {
        if let (Some((from, to)), Some(time)) = (self.options.time_interval, self.time_of(sample)) {
            if time < from {
                self.before += 1;
                return Ok(IntakeFlow::Go);
            }
            if time > to {
                self.stopped = Some(line);
                return Ok(IntakeFlow::Stop);
            }
        }
        let is_read = |place: usize| self.kept[place] && !self.may_lack[place];
        if self.options.not_finite == NonFinitePolicy::LeaveOut
            && (0..sample.len()).any(|i| is_read(i) && sample[i] == SampleField::NotFinite)
        {
            self.left_out.get_or_insert((line, 0)).1 += 1;
            return Ok(IntakeFlow::Go);
        }
        let n_kept = self.kept.iter().filter(|kept| **kept).count() + self.options.computed.len();
        // The line of each sample is kept with its numbers.
        if (self.lines.len() + 1) * (n_kept + 1) > self.options.max_numbers {
            return Err(RecordingFault::TooLarge {
                line,
                samples: self.lines.len(),
                columns: n_kept,
                until: self.last_time(),
            });
        }
        self.lines.push(line);
        for place in 0..sample.len() {
            if self.kept[place] {
                self.columns[place].push(sample[place], line, &|| text(place));
            }
        }
        Ok(IntakeFlow::Go)
    }

    fn time_of(&self, sample: &[SampleField]) -> Option<f64> {
        let (terms, offset) = self.time.as_ref()?;
        let mut time = *offset;
        for (place, factor) in terms {
            match sample[*place] {
                SampleField::Number(value) => time += factor * value,
                // What has no time is kept: the check of time will name it.
                SampleField::NotFinite | SampleField::Text => return None,
            }
        }
        Some(time)
    }

    /// First and last time that were taken, where they are known.
    fn last_time(&self) -> Option<(f64, f64)> {
        let place = self.names.iter().position(|name| name == "t")?;
        let column = &self.columns[place].values;
        Some((*column.first()?, *column.last()?))
    }

    /// The recording; fails when there are no samples.
    pub(crate) fn finish(self, file: &str) -> Result<SignalRecording, RecordingFault> {
        if self.lines.is_empty() {
            if let (Some((from, to)), true) = (
                self.options.time_interval,
                self.before > 0 || self.stopped.is_some(),
            ) {
                return Err(RecordingFault::NoSamplesInInterval { from, to });
            }
            return Err(RecordingFault::NoSamples);
        }
        let mut notes = self.notes;
        if let Some((from, to)) = self.options.time_interval {
            let rest = match self.stopped {
                Some(line) => format!(", and nothing from line {line} on"),
                None => String::new(),
            };
            notes.push(RecordingNote::info(format!(
                "Of {file} the {} from t = {from} s to {to} s are read; {} before{rest} {} not.",
                count_of(self.lines.len(), "sample", "samples"),
                count_of(self.before, "sample", "samples"),
                if self.before == 1 { "is" } else { "are" },
            )));
        }
        if let Some((first, n)) = self.left_out {
            notes.push(RecordingNote::warning(format!(
                "{n} of {} samples of {file} {} NaN, infinite or empty fields and {} left out, the first in line {first}.",
                n + self.lines.len(),
                if n == 1 { "holds" } else { "hold" },
                if n == 1 { "is" } else { "are" },
            )));
        }
        let mut computed = IndexMap::new();
        for one in &self.options.computed {
            computed.insert(
                one.name.clone(),
                compute_column(one, &self.theirs, &self.columns),
            );
        }
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
        for (name, column) in &columns {
            for (defect, what) in [
                (&column.text, "text that is no number"),
                (&column.not_finite, "NaN, infinite or empty fields"),
            ] {
                if let Some(ColumnDefect { line, count, .. }) = defect {
                    notes.push(RecordingNote::warning(format!(
                        "Column `{name}` of {file} holds {what} ({}, the first in line {line}) and cannot be used.",
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
        })
    }
}

fn is_time_place(time: Option<&(Vec<(usize, f64)>, f64)>, place: usize) -> bool {
    time.is_some_and(|(terms, _)| terms.iter().any(|(other, _)| *other == place))
}

/// The sum of columns; what is wrong with any of them is wrong with the sum.
fn compute_column(
    computed: &ComputedColumn,
    theirs: &[String],
    columns: &[SignalColumn],
) -> SignalColumn {
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
    sum
}

fn check_names(names: &[String]) -> Result<(), RecordingFault> {
    for (i, name) in names.iter().enumerate() {
        if name.is_empty() {
            return Err(RecordingFault::UnnamedColumn { place: i + 1 });
        }
    }
    find_duplicate(names, false)
}

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

fn rename(names: &[String], renames: &[(String, String)]) -> Result<Vec<String>, RecordingFault> {
    let mut renamed = names.to_vec();
    for (i, (ours, theirs)) in renames.iter().enumerate() {
        if renames[..i].iter().any(|(o, t)| o == ours || t == theirs) {
            let twice_ours = renames[..i].iter().any(|(o, _)| o == ours);
            return Err(RecordingFault::DuplicateRenaming {
                name: if twice_ours { ours } else { theirs }.clone(),
            });
        }
        match names.iter().position(|name| name == theirs) {
            Some(place) => renamed[place].clone_from(ours),
            None => {
                return Err(missing_column_fault(
                    theirs,
                    names.iter().map(String::as_str),
                    true,
                ));
            }
        }
    }
    Ok(renamed)
}
