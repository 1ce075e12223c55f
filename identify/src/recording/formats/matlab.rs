//! Recordings as MATLAB files of format 5 (`save -v7` and before): vectors and matrices of numbers become columns.
//!
//! A vector `q1` is the column `q1`; the columns of a matrix `q` are `q_1`, `q_2` and so on. All must have the same
//! number of samples. Arrays of another length and other variables are skipped and listed in a note. Columns of
//! complex numbers are listed, but refused when they are used.

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

/// Largest number of columns; more are an error of the file.
const MOST_COLUMNS: usize = 1 << 17;

/// The format of `save -v7` and `-v6`.
pub(crate) struct Matlab5Format;

impl RecordingFormat for Matlab5Format {
    fn suffix(&self) -> &'static str {
        " (MATLAB)"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["mat"]
    }

    // The text at the start of the header states the version.
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
        // The stream is read twice: for the arrays, and for the time range.
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
                // Reading starts at the beginning of the stream.
                stream.rewind().ok()?;
                read(&mut stream, "", &ReadOptions::single_column(name)).ok()
            }),
            remark: (!columns.others.is_empty())
                .then(|| format!("skipped, of another length: {}", backquoted_list(&columns.others))),
        }])
    }
}

/// Reads the columns that are needed.
fn read(stream: impl Read + Seek, file: &str, options: &ReadOptions) -> Result<SignalRecording, RecordingFault> {
    let mut arrays = open(stream)?;
    let columns = MatlabColumns::new(&arrays)?;
    let mut intake = SampleIntake::new(columns.names(), options)?;
    // Variables that are no columns are reported.
    if !columns.others.is_empty() {
        intake.note(RecordingNote::info(format!(
            "{} of {file} {} skipped, because of another number of samples.",
            backquoted_list(&columns.others),
            if columns.others.len() == 1 { "is" } else { "are" },
        )));
    }
    // Only arrays with a needed column are read.
    let mut wanted = vec![false; arrays.arrays.len()];
    for (place, column) in columns.consistent.iter().enumerate() {
        wanted[column.array] |= intake.is_place_needed(place) && !column.is_complex;
    }
    // An array is read completely, and its numbers exist twice until all samples are taken.
    let sizes = arrays.arrays.iter().zip(&wanted).filter(|(_, wanted)| **wanted);
    let numbers: usize = sizes.map(|(array, _)| array.size.iter().product::<usize>()).sum();
    if numbers > options.max_numbers / 2 {
        return Err(format_fault(
            "it is too large to be read completely; save it as CSV or Parquet, which can be read in parts",
        ));
    }
    // The numbers of each needed array; the others stay empty.
    let mut values = Vec::new();
    for (array, wanted) in arrays.arrays.clone().iter().zip(wanted) {
        values.push(if wanted {
            arrays.read_numbers(array).map_err(|error| unreadable_fault(&error))?
        } else {
            Vec::new()
        });
    }
    // Value of a column at a sample; zero for columns that are not read.
    let value = |place: usize, k: usize| {
        let column = &columns.consistent[place];
        let numbers = &values[column.array];
        numbers.get(column.first + k * column.step).copied().unwrap_or(0.0)
    };
    // Pass the samples to the intake, one row after another.
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
        // The text of a field for messages.
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

/// Opens a file and reads the list of its arrays.
fn open<R: Read + Seek>(stream: R) -> Result<MatlabArrayFile<BufReader<R>>, RecordingFault> {
    MatlabArrayFile::new(BufReader::new(stream)).map_err(|error| unreadable_fault(&error))
}

/// The columns of a file, all of the same length, and the names of the arrays that are skipped.
struct MatlabColumns {
    /// Number of samples.
    samples: usize,
    /// Columns with that number of samples.
    consistent: Vec<MatlabColumn>,
    /// Names of arrays of another length.
    others: Vec<String>,
}

/// A column and the positions of its numbers: the first one, then `step` apart.
struct MatlabColumn {
    /// Name of the array, with a number if it has several columns.
    name: String,
    /// Index of its array in the file.
    array: usize,
    /// Position of the first number in the array, column by column.
    first: usize,
    /// Distance of its numbers in the array.
    step: usize,
    /// Whether the array has imaginary parts.
    is_complex: bool,
}

impl MatlabColumns {
    /// Sorts the arrays into columns and others.
    fn new<R>(file: &MatlabArrayFile<R>) -> Result<Self, RecordingFault> {
        // The number of samples is the longest side of any array.
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
        // Only matrices can be columns; arrays with more sides are skipped.
        for (i, array) in file.arrays.iter().enumerate() {
            let (rows, cols) = match array.size.as_slice() {
                [rows, cols] if array.is_consistent => (*rows, *cols),
                _ => (0, 0),
            };
            if rows != samples && cols != samples {
                columns.others.push(array.name.clone());
                continue;
            }
            // Samples are the rows of an upright matrix, otherwise its columns.
            let is_upright = rows == samples;
            let width = if is_upright { cols } else { rows };
            if columns.consistent.len() + width > MOST_COLUMNS {
                return Err(format_fault("it has more columns than any recording"));
            }
            // MATLAB stores matrices column by column, so the step within a row is the number of rows.
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

    /// Names of the columns, in the order of the file.
    fn names(&self) -> Vec<String> {
        self.consistent.iter().map(|column| column.name.clone()).collect()
    }
}

/// The fault of a file with other contents.
fn format_fault(says: impl Into<String>) -> RecordingFault {
    RecordingFault::Format {
        format: "a MATLAB file",
        message: says.into(),
    }
}

/// The fault of a file that cannot be read.
fn unreadable_fault(error: &std::io::Error) -> RecordingFault {
    format_fault(format!("it cannot be read: {error}; save it again with `-v7`"))
}
