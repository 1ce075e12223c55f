//! Recordings as MATLAB files of format 5 (`save -v7` and before): vectors and matrices of numbers become columns.
//!
//! A vector `q1` is the column `q1`; the columns of a matrix `q` are `q_1`, `q_2` and so on. All must have the same
//! number of samples; what has another length, and what is no numeric array, is left aside and said. Columns of complex
//! numbers are listed, and refused where they are asked for.

use std::io::{BufReader, Read, Seek};

use crate::recording::column::Field;
use crate::recording::error::Fault;
use crate::recording::formats::matlab_arrays::Arrays;
use crate::recording::formats::{Format, Input, TableInfo};
use crate::recording::intake::{Flow, Intake};
use crate::recording::notes::Note;
use crate::recording::tables::{ColumnInfo, found_time};
use crate::recording::{ReadOptions, Recording};
use crate::words::list;

/// More columns than any recording has.
const MOST_COLUMNS: usize = 1 << 17;

/// What `save -v7` and `-v6` write.
pub(crate) struct Matlab5;

impl Format for Matlab5 {
    fn suffix(&self) -> &'static str {
        " (MATLAB)"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["mat"]
    }

    fn begins(&self, first: &[u8]) -> bool {
        first.starts_with(b"MATLAB 5.0 MAT-file")
    }

    fn read(
        &self,
        input: Input<'_>,
        file: &str,
        options: &ReadOptions,
    ) -> Result<Recording, Fault> {
        read(input.seekable()?, file, options)
    }

    fn names(&self, input: Input<'_>) -> Result<Vec<String>, Fault> {
        Ok(Columns::new(&open(input.seekable()?)?)?.names())
    }

    fn tables(&self, input: Input<'_>) -> Result<Vec<TableInfo>, Fault> {
        let mut stream = input.seekable()?;
        let columns = Columns::new(&open(&mut stream)?)?;
        let info = |column: &Column| ColumnInfo {
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
            columns: columns.sound.iter().map(info).collect(),
            samples: columns.samples,
            time: found_time(&columns.names(), |name| {
                stream.rewind().ok()?;
                read(&mut stream, "", &ReadOptions::only(name)).ok()
            }),
            remark: (!columns.others.is_empty())
                .then(|| format!("left aside, of another length: {}", list(&columns.others))),
        }])
    }
}

fn read(stream: impl Read + Seek, file: &str, options: &ReadOptions) -> Result<Recording, Fault> {
    let mut arrays = open(stream)?;
    let columns = Columns::new(&arrays)?;
    let mut intake = Intake::new(columns.names(), options)?;
    if !columns.others.is_empty() {
        intake.note(Note::info(format!(
            "{} of {file} {} not of as many samples as the others, and left aside.",
            list(&columns.others),
            if columns.others.len() == 1 {
                "is"
            } else {
                "are"
            },
        )));
    }
    let mut wanted = vec![false; arrays.found.len()];
    for (place, column) in columns.sound.iter().enumerate() {
        wanted[column.array] |= intake.reads(place) && !column.is_complex;
    }
    // An array is read as a whole, and its numbers are kept twice until all are taken in.
    let sizes = arrays
        .found
        .iter()
        .zip(&wanted)
        .filter(|(_, wanted)| **wanted);
    let numbers: usize = sizes
        .map(|(array, _)| array.size.iter().product::<usize>())
        .sum();
    if numbers > options.most_numbers / 2 {
        return Err(broken(
            "it is too large to be read as a whole; save it as CSV or Parquet, of which parts can be read",
        ));
    }
    let mut values = Vec::new();
    for (array, wanted) in arrays.found.clone().iter().zip(wanted) {
        values.push(if wanted {
            arrays.numbers(array).map_err(|error| unreadable(&error))?
        } else {
            Vec::new()
        });
    }
    let value = |place: usize, k: usize| {
        let column = &columns.sound[place];
        let numbers = &values[column.array];
        numbers
            .get(column.first + k * column.step)
            .copied()
            .unwrap_or(0.0)
    };
    let mut sample = Vec::new();
    for k in 0..columns.samples {
        sample.clear();
        sample.extend((0..columns.sound.len()).map(|place| {
            if columns.sound[place].is_complex {
                Field::Text
            } else {
                Field::finite(value(place, k))
            }
        }));
        let text = |place: usize| {
            if columns.sound[place].is_complex {
                "a complex number".to_owned()
            } else {
                value(place, k).to_string()
            }
        };
        if intake.take(k as u64 + 1, &sample, &text)? == Flow::Stop {
            break;
        }
    }
    intake.finish(file)
}

fn open<R: Read + Seek>(stream: R) -> Result<Arrays<BufReader<R>>, Fault> {
    Arrays::new(BufReader::new(stream)).map_err(|error| unreadable(&error))
}

/// The columns of a file, all of one length, and the names of what is none.
struct Columns {
    samples: usize,
    sound: Vec<Column>,
    others: Vec<String>,
}

/// A column, and where its numbers stand: from `first` on, `step` apart.
struct Column {
    name: String,
    array: usize,
    first: usize,
    step: usize,
    is_complex: bool,
}

impl Columns {
    fn new<R>(file: &Arrays<R>) -> Result<Self, Fault> {
        // The number of samples is the longest side that any array has.
        let sides = file.found.iter().flat_map(|array| &array.size);
        let samples = sides.copied().max().unwrap_or(0);
        if samples == 0 {
            return Err(broken(
                "it holds no numeric arrays at its top level; structures and tables cannot be read: save their fields as \
                 variables of their own, or as CSV or Parquet",
            ));
        }
        let mut columns = Self {
            samples,
            sound: Vec::new(),
            others: Vec::new(),
        };
        for (i, array) in file.found.iter().enumerate() {
            let (rows, cols) = match array.size.as_slice() {
                [rows, cols] if array.is_sound => (*rows, *cols),
                _ => (0, 0),
            };
            if rows != samples && cols != samples {
                columns.others.push(array.name.clone());
                continue;
            }
            let is_upright = rows == samples;
            let width = if is_upright { cols } else { rows };
            if columns.sound.len() + width > MOST_COLUMNS {
                return Err(broken("it has more columns than any recording"));
            }
            for j in 0..width {
                columns.sound.push(Column {
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
        self.sound
            .iter()
            .map(|column| column.name.clone())
            .collect()
    }
}

fn broken(says: impl Into<String>) -> Fault {
    Fault::Format {
        format: "a MATLAB file",
        says: says.into(),
    }
}

fn unreadable(error: &std::io::Error) -> Fault {
    broken(format!(
        "it cannot be read: {error}; save it again with `-v7`"
    ))
}
