//! Recordings as MATLAB files of format 5 (`save -v7` and before): vectors and matrices of numbers become columns.
//!
//! A vector `q1` is the column `q1`; the columns of a matrix `q` are `q_1`, `q_2` and so on. All must have the same
//! number of samples; what has another length, and what is no numeric array, is left aside and said. Columns of complex
//! numbers are listed, and refused where they are asked for.

use std::io::{BufReader, Read, Seek};

use crate::recording::column::SampleField;
use crate::recording::error::RecordingFault;
use crate::recording::formats::matlab_arrays::MatlabArrayFile;
use crate::recording::formats::{RecordingFormat, RecordingInput, TableInfo};
use crate::recording::intake::{IntakeFlow, SampleIntake};
use crate::recording::notes::RecordingNote;
use crate::recording::tables::{ColumnInfo, find_time_range};
use crate::recording::{ReadOptions, SignalRecording};
use crate::words::backquoted_list;

/// More columns than any recording has.
const MOST_COLUMNS: usize = 1 << 17;

/// What `save -v7` and `-v6` write.
pub(crate) struct Matlab5Format;

impl RecordingFormat for Matlab5Format {
    fn suffix(&self) -> &'static str {
        " (MATLAB)"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["mat"]
    }

    fn has_signature(&self, first: &[u8]) -> bool {
        first.starts_with(b"MATLAB 5.0 MAT-file")
    }

    fn read(
        &self,
        input: RecordingInput<'_>,
        file: &str,
        options: &ReadOptions,
    ) -> Result<SignalRecording, RecordingFault> {
        read(input.seekable()?, file, options)
    }

    fn names(&self, input: RecordingInput<'_>) -> Result<Vec<String>, RecordingFault> {
        Ok(MatlabColumns::new(&open(input.seekable()?)?)?.names())
    }

    fn tables(&self, input: RecordingInput<'_>) -> Result<Vec<TableInfo>, RecordingFault> {
        let mut stream = input.seekable()?;
        let columns = MatlabColumns::new(&open(&mut stream)?)?;
        let info = |column: &MatlabColumn| ColumnInfo {
            name: column.name.clone(),
            kind: if column.is_complex {
                "complex number".to_owned()
            } else {
                "number".to_owned()
            },
        };
        Ok(vec![TableInfo {
            name: String::new(),
            kind: String::new(),
            columns: columns.consistent.iter().map(info).collect(),
            samples: columns.samples,
            time: find_time_range(&columns.names(), |name| {
                stream.rewind().ok()?;
                read(&mut stream, "", &ReadOptions::single_column(name)).ok()
            }),
            remark: (!columns.others.is_empty()).then(|| {
                format!(
                    "skipped, of another length: {}",
                    backquoted_list(&columns.others)
                )
            }),
        }])
    }
}

fn read(
    stream: impl Read + Seek,
    file: &str,
    options: &ReadOptions,
) -> Result<SignalRecording, RecordingFault> {
    let mut arrays = open(stream)?;
    let columns = MatlabColumns::new(&arrays)?;
    let mut intake = SampleIntake::new(columns.names(), options)?;
    if !columns.others.is_empty() {
        intake.note(RecordingNote::info(format!(
            "{} of {file} {} skipped, because of another number of samples.",
            backquoted_list(&columns.others),
            if columns.others.len() == 1 {
                "is"
            } else {
                "are"
            },
        )));
    }
    let mut wanted = vec![false; arrays.arrays.len()];
    for (place, column) in columns.consistent.iter().enumerate() {
        wanted[column.array] |= intake.is_place_needed(place) && !column.is_complex;
    }
    // An array is read as a whole, and its numbers are kept twice until all are taken in.
    let sizes = arrays
        .arrays
        .iter()
        .zip(&wanted)
        .filter(|(_, wanted)| **wanted);
    let numbers: usize = sizes
        .map(|(array, _)| array.size.iter().product::<usize>())
        .sum();
    if numbers > options.max_numbers / 2 {
        return Err(format_fault(
            "it is too large to be read completely; save it as CSV or Parquet, of which parts can be read",
        ));
    }
    let mut values = Vec::new();
    for (array, wanted) in arrays.arrays.clone().iter().zip(wanted) {
        values.push(if wanted {
            arrays
                .read_numbers(array)
                .map_err(|error| unreadable_fault(&error))?
        } else {
            Vec::new()
        });
    }
    let value = |place: usize, k: usize| {
        let column = &columns.consistent[place];
        let numbers = &values[column.array];
        numbers
            .get(column.first + k * column.step)
            .copied()
            .unwrap_or(0.0)
    };
    let mut sample = Vec::new();
    for k in 0..columns.samples {
        sample.clear();
        sample.extend((0..columns.consistent.len()).map(|place| {
            if columns.consistent[place].is_complex {
                SampleField::Text
            } else {
                SampleField::finite(value(place, k))
            }
        }));
        let text = |place: usize| {
            if columns.consistent[place].is_complex {
                "a complex number".to_owned()
            } else {
                value(place, k).to_string()
            }
        };
        if intake.take_sample(k as u64 + 1, &sample, &text)? == IntakeFlow::Stop {
            break;
        }
    }
    intake.finish(file)
}

fn open<R: Read + Seek>(stream: R) -> Result<MatlabArrayFile<BufReader<R>>, RecordingFault> {
    MatlabArrayFile::new(BufReader::new(stream)).map_err(|error| unreadable_fault(&error))
}

/// The columns of a file, all of one length, and the names of what is none.
struct MatlabColumns {
    samples: usize,
    consistent: Vec<MatlabColumn>,
    others: Vec<String>,
}

/// A column, and where its numbers stand: from `first` on, `step` apart.
struct MatlabColumn {
    name: String,
    array: usize,
    first: usize,
    step: usize,
    is_complex: bool,
}

impl MatlabColumns {
    fn new<R>(file: &MatlabArrayFile<R>) -> Result<Self, RecordingFault> {
        // The number of samples is the longest side that any array has.
        let sides = file.arrays.iter().flat_map(|array| &array.size);
        let samples = sides.copied().max().unwrap_or(0);
        if samples == 0 {
            return Err(format_fault(
                "it contains no numeric arrays at its top level; structures and tables cannot be read: save their fields as \
                 variables of their own, or as CSV or Parquet",
            ));
        }
        let mut columns = Self {
            samples,
            consistent: Vec::new(),
            others: Vec::new(),
        };
        for (i, array) in file.arrays.iter().enumerate() {
            let (rows, cols) = match array.size.as_slice() {
                [rows, cols] if array.is_consistent => (*rows, *cols),
                _ => (0, 0),
            };
            if rows != samples && cols != samples {
                columns.others.push(array.name.clone());
                continue;
            }
            let is_upright = rows == samples;
            let width = if is_upright { cols } else { rows };
            if columns.consistent.len() + width > MOST_COLUMNS {
                return Err(format_fault("it has more columns than any recording"));
            }
            for j in 0..width {
                columns.consistent.push(MatlabColumn {
                    name: if width == 1 {
                        array.name.clone()
                    } else {
                        format!("{}_{}", array.name, j + 1)
                    },
                    array: i,
                    first: if is_upright { j * rows } else { j },
                    step: if is_upright { 1 } else { rows },
                    is_complex: array.is_complex,
                });
            }
        }
        Ok(columns)
    }

    fn names(&self) -> Vec<String> {
        self.consistent
            .iter()
            .map(|column| column.name.clone())
            .collect()
    }
}

fn format_fault(says: impl Into<String>) -> RecordingFault {
    RecordingFault::Format {
        format: "a MATLAB file",
        message: says.into(),
    }
}

fn unreadable_fault(error: &std::io::Error) -> RecordingFault {
    format_fault(format!(
        "it cannot be read: {error}; save it again with `-v7`"
    ))
}
