//! What can be wrong with a recording, each with the place, what was expected and what to do.

use std::fmt;

use modelmill_boundary::message;
use modelmill_boundary::text::{Message, OptionName, OptionSetting, Remedy};

use crate::recording::read::sample_place_word;
use crate::signal::FilterError;
use crate::words::{backquoted_list, count_of};

/// A fault of a recording. Its `Display` names the file, the line and the column where they are
/// known, and ends with what to do.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordingError {
    /// The file as the user named it, or a word for a stream.
    pub file: String,
    /// What is wrong.
    pub fault: RecordingFault,
}

/// The kinds of faults of a recording. Lines count from 1 with the header.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum RecordingFault {
    /// The file cannot be opened or read.
    Unreadable {
        /// The operating system's words.
        reason: String,
    },
    /// The file has no bytes, or only white space.
    Empty,
    /// A header, but no sample.
    NoSamples,
    /// The file is not CSV text: another known format or other bytes.
    NotCsv {
        /// What it looks like.
        looks_like: &'static str,
    },
    /// The file is of a format that is read, but not in this form.
    Format {
        /// What it is.
        format: &'static str,
        /// What is wrong, and what to do.
        message: String,
    },
    /// The recording holds more numbers than may be kept in memory.
    TooLarge {
        /// The line at which reading ended.
        line: u64,
        /// Samples before it.
        samples: usize,
        /// Columns that are needed.
        columns: usize,
        /// First and last time of those samples, s, where they are known.
        until: Option<(f64, f64)>,
    },
    /// No sample lies in the time that was asked for.
    NoSamplesInInterval {
        /// From, s.
        from: f64,
        /// To, s.
        to: f64,
    },
    /// Topics or files that are needed together were not recorded at the same time.
    NoCommonTime {
        /// What messages call them.
        parts: Vec<String>,
    },
    /// Two files of one run have a column that is needed.
    ColumnInTwoFiles {
        /// Its name.
        name: String,
        /// The other file.
        other: String,
    },
    /// A sum of columns takes them from several files.
    SumAcrossFiles {
        /// The column that it makes.
        name: String,
    },
    /// The first line holds numbers where column names are expected.
    NoHeader,
    /// The separator cannot be told from the first line.
    UnclearSeparator {
        /// The first line, shortened.
        header: String,
    },
    /// A column has no name.
    UnnamedColumn {
        /// Its place, from 1.
        place: usize,
    },
    /// Two columns have the same name.
    DuplicateColumn {
        /// The name.
        name: String,
        /// Places of the first two that have it, from 1.
        places: [usize; 2],
        /// Whether a renaming brought this about.
        by_renaming: bool,
    },
    /// A renaming is given twice for the same name.
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
    /// A column that is needed is not there.
    MissingColumn {
        /// The name that was looked for.
        name: String,
        /// The closest name that is there.
        nearest: Option<String>,
        /// All names that are there.
        present: Vec<String>,
        /// Whether the name comes from a renaming (`theirs`).
        by_renaming: bool,
    },
    /// Several columns that are needed are not there.
    MissingColumns {
        /// The names that were looked for, each with the closest name that is there.
        missing: Vec<(String, Option<String>)>,
        /// All names that are there.
        present: Vec<String>,
    },
    /// A needed column holds text that is no number.
    NotANumber {
        /// The column.
        column: String,
        /// The first such line.
        line: u64,
        /// The text there.
        text: String,
        /// How many fields of the column are concerned.
        count: usize,
    },
    /// A needed column holds NaN, infinite or empty fields.
    NotFinite {
        /// The column.
        column: String,
        /// The first such line.
        line: u64,
        /// The text there.
        text: String,
        /// How many fields of the column are concerned.
        count: usize,
    },
    /// The measured force of a drive is needed and not there.
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
    /// A quote opens a field that does not end in its line.
    OpenQuote {
        /// The line in which it opens.
        line: u64,
    },
    /// Too few samples for what is asked.
    TooFewSamples {
        /// Samples there are.
        have: usize,
        /// Samples there must be.
        need: usize,
        /// What they are needed for.
        purpose: Message,
    },
    /// A Fourier series was asked for, but the motion has no period that could be found.
    NoPeriod,
    /// The period asked for is too short for the samples, or too long for the recording.
    Period {
        /// The period, s.
        period: f64,
        /// The shortest that samples can show, s.
        shortest: f64,
        /// The longest that the recording can show, s.
        longest: f64,
    },
    /// The cut-off's period is longer than the recording.
    CutoffTooLow {
        /// The cut-off, Hz.
        cutoff_hz: f64,
        /// The lowest that leaves something, Hz.
        lowest_hz: f64,
        /// Length of the recording, s.
        duration: f64,
    },
    /// The filter that was asked for does not suit the recording.
    Filter {
        /// The coordinate that was being prepared.
        column: String,
        /// The filter's complaint.
        error: FilterError,
    },
}

impl RecordingError {
    /// Where and what is wrong, and what to do.
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
    /// The line concerned, where there is one.
    pub fn line(&self) -> Option<u64> {
        match self {
            Self::RaggedLine { line, .. }
            | Self::NotANumber { line, .. }
            | Self::NotFinite { line, .. }
            | Self::OpenQuote { line }
            | Self::TimeNotIncreasing { line, .. }
            | Self::TooLarge { line, .. } => Some(*line),
            Self::NoHeader | Self::UnclearSeparator { .. } => Some(1),
            _ => None,
        }
    }
}

impl RecordingFault {
    /// What is wrong, and what to do.
    #[allow(clippy::too_many_lines, reason = "one arm per fault, each a sentence")]
    pub fn message(&self) -> Message {
        let map = |ours: &str, theirs: &str| {
            OptionSetting::new(OptionName::Columns, format!("{ours}={theirs}"))
        };
        match self {
            Self::Unreadable { reason } => message!(
                "the recording cannot be read: {reason}; check the path and the permissions"
            ),
            Self::Empty => {
                "the recording is empty; a header line and one line per sample are expected".into()
            }
            Self::NoSamples => {
                "there is a header but no sample; one line of numbers per sample is expected".into()
            }
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
                     {:.1} GB; take a part of it{comma} {}",
                    8e-9 * (*samples as f64) * (*columns as f64 + 1.0),
                    part
                )
            }
            Self::NoSamplesInInterval { from, to } => message!(
                "no sample lies between t = {from} s and {to} s, as {} asks; give times that the recording has",
                Remedy::option(OptionName::Between)
            ),
            Self::NoCommonTime { parts } => message!(
                "{} have no samples at the same time, so they cannot be joined; are their clocks the same?",
                backquoted_list(parts)
            ),
            Self::ColumnInTwoFiles { name, other } => message!(
                "the column `{name}` is in {other} too; rename it in one of the two files, or leave one of them out"
            ),
            Self::SumAcrossFiles { name } => message!(
                "`{name}` is a sum of columns of several files, which is read from one file only; add them up in a file before"
            ),
            Self::NoHeader => "the first line holds numbers, but column names are expected there; \
                 put a line such as `t,theta1,spindle_left` on top"
                .into(),
            Self::UnclearSeparator { header } if header.starts_with('#') => message!(
                "the first line must name the columns, but it is `{header}`; comment lines are not read, delete them"
            ),
            Self::UnclearSeparator { header } => message!(
                "it cannot be told what separates the columns of `{header}`; \
                 use a comma (or `;` or a tab) throughout and a point for decimals"
            ),
            Self::UnnamedColumn { place } => message!(
                "column {place} has no name; name it, or remove a separator at the end of the lines"
            ),
            Self::DuplicateColumn {
                name,
                places: [a, b],
                by_renaming,
            } => {
                let what = if *by_renaming {
                    "a renaming brings this about: leave it out, or rename the other column too"
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
                let missing = if *by_renaming {
                    format!("a renaming asks for the column `{name}`, which is not there")
                } else {
                    format!("there is no column `{name}`")
                };
                let meant = match nearest {
                    Some(nearest) => format!("; did you mean `{nearest}`?"),
                    None => ".".to_owned(),
                };
                let how = if *by_renaming {
                    message!(
                        "Renamings read {}.",
                        Remedy::options([map("ours", "theirs")])
                    )
                } else {
                    let theirs = nearest.as_deref().unwrap_or("THEIRS");
                    message!(
                        "Map one onto it with {}.",
                        Remedy::options([map(name, theirs)])
                    )
                };
                message!("{missing}{meant}{} {}", columns_there(present), how)
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
                    .map(|(name, nearest)| map(name, nearest.as_deref().unwrap_or("THEIRS")));
                message!(
                    "there are no columns {}.{} Map one onto each of them with {}.",
                    all.join(", "),
                    columns_there(present),
                    Remedy::options(maps)
                )
            }
            Self::NotANumber {
                column,
                text,
                count,
                ..
            } => {
                let write_other_count = write_other_count(*count, "fields of the column are no numbers");
                let what = if looks_like_decimal_comma(text) {
                    "write decimals with a point"
                } else {
                    "correct or remove it"
                };
                message!(
                    "column `{column}` holds `{text}` where a number is expected{write_other_count}; {what}"
                )
            }
            Self::NotFinite {
                column,
                text,
                count,
                ..
            } => {
                let holds = if text.is_empty() {
                    format!("column `{column}` is empty where a number is expected")
                } else {
                    let expected = match text.parse::<f64>() {
                        Ok(value) if value.is_finite() => "a number that was measured",
                        _ => "a finite number",
                    };
                    format!("column `{column}` holds `{text}` where {expected} is expected")
                };
                message!(
                    "{holds}{}; repair the recording, or leave such samples out with {} (they are counted)",
                    write_other_count(*count, "fields of the column are not finite or empty"),
                    Remedy::option(OptionName::SkipBadSamples)
                )
            }
            Self::MissingForce { drives } => message!(
                "the measured force of {} is needed, but there is no such column; \
                 map one onto it with {}",
                backquoted_list(drives),
                Remedy::options([map(
                    drives.first().map_or("DRIVE", String::as_str),
                    "THEIRS"
                )])
            ),
            Self::TimeNotIncreasing { previous, here, .. } => message!(
                "time goes from {previous} s to {here} s, but must increase from sample to sample; \
                 remove repeated samples, or split the file where the clock was reset"
            ),
            Self::TooFewSamples {
                have,
                need,
                purpose,
            } => message!(
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
                "a period of {period} s was asked for, but this recording can show periods from {shortest:.6} s to \
                 {longest:.6} s only; choose one of them, or another smoothing"
            ),
            Self::CutoffTooLow {
                cutoff_hz,
                lowest_hz,
                duration,
            } => message!(
                "a cut-off of {cutoff_hz} Hz is too low for a recording of {duration:.4} s, of which no motion would be \
                 left; choose one above {lowest_hz:.4} Hz, or leave {} away and have it chosen from the signal",
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

/// Names the columns that are there.
fn columns_there(present: &[String]) -> String {
    let mut says = format!(" The columns are: {}.", backquoted_list(present));
    if present.first().is_some_and(|first| first.starts_with('#')) {
        says.push_str(
            " The first line must name the columns: comment lines are not read, delete them.",
        );
    }
    says
}

/// Says how many other fields share the fault.
fn write_other_count(count: usize, what: &str) -> String {
    if count > 1 {
        format!(" ({count} {what})")
    } else {
        String::new()
    }
}

fn looks_like_decimal_comma(text: &str) -> bool {
    text.matches(',').count() == 1 && text.replace(',', ".").parse::<f64>().is_ok()
}
