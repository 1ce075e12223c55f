//! Faults of a recording, each with its place, what was expected, and what to do.
//!
//! A fault is a value; its message has typed remedies, which each front end writes in its own words.

use std::fmt;

use modelmill_boundary::message;
use modelmill_boundary::text::{Message, OptionName, OptionSetting, Remedy};

use crate::recording::read::sample_place_word;
use crate::signal::FilterError;
use crate::words::{backquoted_list, count_of};

/// A fault of a recording. Its `Display` names the file, the line and the column if they are known, and ends with
/// advice.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordingError {
    /// The file as the user named it, or a name for a stream.
    pub file: String,
    /// What is wrong.
    pub fault: RecordingFault,
}

/// The kinds of faults of a recording. Lines count from 1, including the header.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum RecordingFault {
    /// The file cannot be opened or read.
    Unreadable {
        /// The message of the operating system.
        reason: String,
    },
    /// The file has no bytes, or only white space.
    Empty,
    /// A header, but no sample.
    NoSamples,
    /// The file is not CSV text, but another format or other bytes.
    NotCsv {
        /// The format that the bytes look like.
        looks_like: &'static str,
    },
    /// The format of the file is supported, but not this form of it.
    Format {
        /// The format, with its article.
        format: &'static str,
        /// What is wrong, and what to do.
        message: String,
    },
    /// The recording has more numbers than may be kept in memory.
    TooLarge {
        /// The line at which reading ended.
        line: u64,
        /// Samples before it.
        samples: usize,
        /// Columns that are needed.
        columns: usize,
        /// First and last time of those samples, s, if they are known.
        until: Option<(f64, f64)>,
    },
    /// No sample lies in the requested time interval.
    NoSamplesInInterval {
        /// Start of the interval, s.
        from: f64,
        /// End of the interval, s.
        to: f64,
    },
    /// Topics or files that are needed together were not recorded at the same time.
    NoCommonTime {
        /// Their names in messages.
        parts: Vec<String>,
    },
    /// A needed column is in two files of one run.
    ColumnInTwoFiles {
        /// Its name.
        name: String,
        /// The other file.
        other: String,
        /// The name with that of its file, which is unique.
        qualified: String,
    },
    /// One of several joined files has no times, and no other file has as many samples.
    NoTimeOfOwn {
        /// Its number of samples.
        samples: usize,
        /// The files with times.
        timed: Vec<String>,
    },
    /// A computed column has terms in several files.
    SumAcrossFiles {
        /// The name of the computed column.
        name: String,
    },
    /// The separator cannot be determined from the first line with contents.
    UnclearSeparator {
        /// The line.
        line: u64,
        /// The text of the line, shortened.
        header: String,
    },
    /// A column has no name.
    UnnamedColumn {
        /// Its position, from 1.
        place: usize,
    },
    /// Two columns have the same name.
    DuplicateColumn {
        /// The name.
        name: String,
        /// Positions of the first two that have it, from 1.
        places: [usize; 2],
        /// Whether a mapping caused this.
        by_renaming: bool,
    },
    /// Two renamings have the same name.
    DuplicateRenaming {
        /// The name in question.
        name: String,
    },
    /// A line has another number of fields than the header.
    RaggedLine {
        /// The line.
        line: u64,
        /// Fields there.
        have: usize,
        /// Fields of the header.
        expected: usize,
    },
    /// A needed column does not exist.
    MissingColumn {
        /// The name that was requested.
        name: String,
        /// The nearest name that exists.
        nearest: Option<String>,
        /// All names that exist.
        present: Vec<String>,
        /// Whether the name comes from a mapping of the user.
        by_renaming: bool,
    },
    /// Several needed columns do not exist.
    MissingColumns {
        /// The names that were requested, each with the nearest name that exists.
        missing: Vec<(String, Option<String>)>,
        /// All names that exist.
        present: Vec<String>,
    },
    /// A needed column contains text that is not a number.
    NotANumber {
        /// The column.
        column: String,
        /// The first such line.
        line: u64,
        /// The text there.
        text: String,
        /// How many fields of the column are affected.
        count: usize,
    },
    /// A needed column contains NaN, infinite or empty fields.
    NotFinite {
        /// The column.
        column: String,
        /// The first such line.
        line: u64,
        /// The text there.
        text: String,
        /// How many fields of the column are affected.
        count: usize,
    },
    /// The measured force of a drive is needed, but has no column.
    MissingForce {
        /// The drives without a column.
        drives: Vec<String>,
    },
    /// Time does not increase.
    TimeNotIncreasing {
        /// The line.
        line: u64,
        /// Time before, s.
        previous: f64,
        /// Time there, s.
        here: f64,
    },
    /// A quoted field does not end in its line.
    OpenQuote {
        /// The line in which it opens.
        line: u64,
    },
    /// There are too few samples for an operation.
    TooFewSamples {
        /// Number of samples.
        have: usize,
        /// Least number of samples.
        need: usize,
        /// The operation.
        purpose: Message,
    },
    /// A Fourier series was requested, but no period of the motion was found.
    NoPeriod,
    /// The requested period is too short for the sampling, or too long for the recording.
    Period {
        /// The period, s.
        period: f64,
        /// The shortest period that the samples can resolve, s.
        shortest: f64,
        /// The longest period that the recording can resolve, s.
        longest: f64,
    },
    /// The cut-off's period is longer than the recording.
    CutoffTooLow {
        /// The cut-off, Hz.
        cutoff_hz: f64,
        /// The lowest cut-off that keeps some motion, Hz.
        lowest_hz: f64,
        /// Length of the recording, s.
        duration: f64,
    },
    /// The requested filter does not fit the recording.
    Filter {
        /// The coordinate that was being filtered.
        column: String,
        /// The fault of the filter.
        error: FilterError,
    },
}

impl RecordingError {
    /// The message: place, fault and advice.
    pub fn message(&self) -> Message {
        let file = &self.file;
        let says = self.fault.message();
        match self.fault.line() {
            Some(line) => message!("{file}, {} {line}: {}", sample_place_word(file), says),
            None => message!("{file}: {}", says),
        }
    }
}

impl fmt::Display for RecordingError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message().in_library_words())
    }
}

impl std::error::Error for RecordingError {}

impl RecordingFault {
    /// The line of the fault, if it has one.
    pub fn line(&self) -> Option<u64> {
        match self {
            Self::RaggedLine { line, .. }
            | Self::NotANumber { line, .. }
            | Self::NotFinite { line, .. }
            | Self::OpenQuote { line }
            | Self::UnclearSeparator { line, .. }
            | Self::TimeNotIncreasing { line, .. }
            | Self::TooLarge { line, .. } => Some(*line),
            _ => None,
        }
    }
}

impl RecordingFault {
    /// What is wrong, and what to do, without the place.
    #[allow(clippy::too_many_lines, reason = "one arm per fault, each a sentence")]
    pub fn message(&self) -> Message {
        // The option that maps a name of the model to a column of the file.
        let map = |ours: &str, theirs: &str| OptionSetting::new(OptionName::Columns, format!("{ours}={theirs}"));
        match self {
            Self::Unreadable { reason } => {
                message!("the recording cannot be read: {reason}; check the path and the permissions")
            }
            Self::Empty => "the recording is empty; a header line and one line per sample are expected".into(),
            Self::NoSamples => "there is a header but no sample; one line of numbers per sample is expected".into(),
            Self::NotCsv { looks_like } => message!(
                "this looks like {looks_like}, not like a recording; save it as CSV (UTF-8, with a header), Parquet, HDF5, MCAP or a MATLAB file"
            ),
            Self::Format { format, message: says } => message!("this is {format}: {says}"),
            Self::TooLarge {
                samples,
                columns,
                until,
                ..
            } => {
                // The advice is a concrete part of the recording, if its times are known.
                let part = Remedy::option(OptionName::Between);
                let part = match until {
                    Some((from, to)) => message!(
                        "for example {}, or several such parts one after the other",
                        part.with_value(format!("{from},{to}"))
                    ),
                    None => message!("with {} (s)", part.with_value("FROM,TO")),
                };
                let comma = if until.is_some() { "," } else { "" };
                message!(
                    "the recording is too large to be kept in memory: up to here {samples} samples of {columns} columns are \
                     {:.1} GB; read a part of it{comma} {}",
                    // The size is 8 bytes per number; the line of each sample counts as one number.
                    8e-9 * (*samples as f64) * (*columns as f64 + 1.0),
                    part
                )
            }
            Self::NoSamplesInInterval { from, to } => message!(
                "no sample lies between t = {from} s and {to} s, as {} requests; give times within the recording",
                Remedy::option(OptionName::Between)
            ),
            Self::NoCommonTime { parts } => message!(
                "{} have no samples at the same time, so they cannot be joined; are their clocks the same?",
                backquoted_list(parts)
            ),
            Self::ColumnInTwoFiles { name, other, qualified } => message!(
                "the column `{name}` is in {other} too, so it is not clear which one is meant; name its file, as in {}, or \
                 leave one of the files out",
                Remedy::options([map(name, qualified)])
            ),
            Self::NoTimeOfOwn { samples, timed } => message!(
                "it has no column of times, and its {} are not those of {}; add a column of times to it, or give the sampling \
                 rate with {}",
                count_of(*samples, "sample", "samples"),
                match timed.as_slice() {
                    [] => "another file with times".to_owned(),
                    some => backquoted_list(some),
                },
                Remedy::option(OptionName::Rate).with_value("HZ")
            ),
            Self::SumAcrossFiles { name } => message!(
                "`{name}` is a sum of columns of several files, but a sum is read from one file only; compute it in one file first"
            ),
            Self::UnclearSeparator { header, .. } => message!(
                "the separator of the columns is not clear in `{header}`; separate all lines by a comma, or all by `;`, a tab \
                 or blanks"
            ),
            Self::UnnamedColumn { place } => {
                message!("column {place} has no name; name it, or remove a separator at the end of the lines")
            }
            Self::DuplicateColumn {
                name,
                places: [a, b],
                by_renaming,
            } => {
                // The advice depends on whether the file or a mapping has the duplicate.
                let what = if *by_renaming {
                    "a mapping causes this: remove it, or map the other column too"
                } else {
                    "give every column a name of its own"
                };
                message!("columns {a} and {b} are both called `{name}`; {what}")
            }
            Self::DuplicateRenaming { name } => message!(
                "`{name}` is renamed twice; give each name and each column one renaming ({})",
                Remedy::options([map("ours", "theirs")])
            ),
            Self::RaggedLine { have, expected, .. } => message!(
                "{} where the header has {expected}; complete or remove the line",
                count_of(*have, "field", "fields")
            ),
            Self::MissingColumn {
                name,
                nearest,
                present,
                by_renaming,
            } => {
                // First what is missing, then the nearest name, all names, and how to map one.
                let missing = if *by_renaming {
                    format!("a mapping names the column `{name}`, which does not exist")
                } else {
                    format!("there is no column `{name}`")
                };
                let meant = match nearest {
                    Some(nearest) => format!("; did you mean `{nearest}`?"),
                    None => ".".to_owned(),
                };
                let how = if *by_renaming {
                    message!("A mapping has the form {}.", Remedy::options([map("NAME", "COLUMN")]))
                } else {
                    let theirs = nearest.as_deref().unwrap_or("COLUMN");
                    message!("Assign one of them with {}.", Remedy::options([map(name, theirs)]))
                };
                // A recording without times may still have a rate.
                let rate = if name == "t" && nearest.is_none() && !by_renaming {
                    message!(
                        " If no column has times, give the sampling rate with {}.",
                        Remedy::option(OptionName::Rate).with_value("HZ")
                    )
                } else {
                    Message::from("")
                };
                message!("{missing}{meant}{} {}{}", columns_there(present), how, rate)
            }
            Self::MissingColumns { missing, present } => {
                let all: Vec<String> = missing
                    .iter()
                    .map(|(name, nearest)| match nearest {
                        Some(nearest) => format!("`{name}` (did you mean `{nearest}`?)"),
                        None => format!("`{name}`"),
                    })
                    .collect();
                let maps = missing
                    .iter()
                    .map(|(name, nearest)| map(name, nearest.as_deref().unwrap_or("COLUMN")));
                message!(
                    "there are no columns {}.{} Assign a column to each name with {}.",
                    all.join(", "),
                    columns_there(present),
                    Remedy::options(maps)
                )
            }
            Self::NotANumber {
                column, text, count, ..
            } => {
                let write_other_count = write_other_count(*count, "fields of the column are not numbers");
                // A comma between two integers is most likely a decimal comma, in a file with points elsewhere.
                let what = if has_unclear_comma(text) {
                    "its comma may separate thousands or be the decimal sign, so write it with a decimal point or without \
                     the comma"
                } else if looks_like_decimal_comma(text) {
                    "other numbers of the file have a decimal point, so write decimals with a point"
                } else if text.parse::<f64>().is_ok() {
                    "other fields have a decimal comma or are time stamps, so write all of them in one way"
                } else {
                    "correct or remove it"
                };
                message!("column `{column}` contains `{text}` where a number is expected{write_other_count}; {what}")
            }
            Self::NotFinite {
                column, text, count, ..
            } => {
                // Finite numbers get here only if they are too large to be measurements.
                let holds = if text.is_empty() {
                    format!("column `{column}` is empty where a number is expected")
                } else {
                    let expected = match text.parse::<f64>() {
                        Ok(value) if value.is_finite() => "a number that was measured",
                        _ => "a finite number",
                    };
                    format!("column `{column}` contains `{text}` where {expected} is expected")
                };
                message!(
                    "{holds}{}; repair the recording, or leave such samples out with {} (they are counted)",
                    write_other_count(*count, "fields of the column are not finite or empty"),
                    Remedy::option(OptionName::SkipBadSamples)
                )
            }
            Self::MissingForce { drives } => message!(
                "the measured force of {} is needed, but there is no such column; \
                 assign a column with {}",
                backquoted_list(drives),
                Remedy::options([map(drives.first().map_or("DRIVE", String::as_str), "COLUMN")])
            ),
            Self::TimeNotIncreasing { previous, here, .. } => message!(
                "time goes from {previous} s to {here} s, but must increase from sample to sample; \
                 remove repeated samples, or split the file where the clock was reset"
            ),
            Self::TooFewSamples { have, need, purpose } => message!(
                "{} too few for {}, which takes at least {need}; use a longer recording",
                match have {
                    1 => "1 sample is".to_owned(),
                    n => format!("{n} samples are"),
                },
                purpose
            ),
            Self::OpenQuote { .. } => {
                "a quote opens here, but the field that it begins does not end in the same line; delete the quote, or \
                 close it"
                    .into()
            }
            Self::NoPeriod => message!(
                "the motion does not repeat itself within the recording, so no period can be found; give it with \
                 {}, or take another smoothing",
                Remedy::option(OptionName::Period).with_value("S")
            ),
            Self::Period {
                period,
                shortest,
                longest,
            } => message!(
                "a period of {period} s was requested, but this recording can show periods from {shortest:.6} s to \
                 {longest:.6} s only; choose one of them, or another smoothing"
            ),
            Self::CutoffTooLow {
                cutoff_hz,
                lowest_hz,
                duration,
            } => message!(
                "a cut-off of {cutoff_hz} Hz is too low for a recording of {duration:.4} s, because it would remove all \
                 motion; choose one above {lowest_hz:.4} Hz, or omit {} so that it is chosen from the signal",
                Remedy::option(OptionName::CutoffHz)
            ),
            Self::Filter { column, error } => {
                message!("`{column}` cannot be filtered: {error}")
            }
        }
    }
}

impl fmt::Display for RecordingFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message().in_library_words())
    }
}

/// A sentence that lists the existing columns.
fn columns_there(present: &[String]) -> String {
    format!(" The columns are: {}.", backquoted_list(present))
}

/// The number of affected fields in parentheses; empty if there is only one.
fn write_other_count(count: usize, what: &str) -> String {
    if count > 1 {
        format!(" ({count} {what})")
    } else {
        String::new()
    }
}

/// Whether the only comma of a number has three digits behind it, as between thousands.
fn has_unclear_comma(text: &str) -> bool {
    let is_number = looks_like_decimal_comma(text) && !text.starts_with('0');
    is_number && text.split_once(',').is_some_and(|(_, after)| after.len() == 3)
}

/// Whether a text becomes a number if its only comma is replaced by a point.
fn looks_like_decimal_comma(text: &str) -> bool {
    text.matches(',').count() == 1 && text.replace(',', ".").parse::<f64>().is_ok()
}
