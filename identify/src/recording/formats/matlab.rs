//! Recordings as MATLAB files of format 5 (`save -v7` and before): vectors and matrices of numbers become columns.
//!
//! A vector `q1` is the column `q1`; the columns of a matrix `q` are `q_1`, `q_2` and so on. All must have the same
//! number of samples; what has another length, and what is no real numeric array, is left aside and said.

use std::io::{self, BufReader, Read, Seek, SeekFrom};

use matfile::{Array, MatFile, NumericData};

use crate::recording::column::Field;
use crate::recording::error::Fault;
use crate::recording::formats::{Format, Input};
use crate::recording::intake::{Flow, Intake};
use crate::recording::notes::Note;
use crate::recording::{ReadOptions, Recording};
use crate::words::list;

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
        let columns = columns(input.seekable()?)?;
        Ok(columns.sound.into_iter().map(|(name, _)| name).collect())
    }
}

/// What `save -v7.3` writes, which is HDF5: known, so that it can be said what to do, and not read.
pub(crate) struct Matlab73;

impl Format for Matlab73 {
    fn begins(&self, first: &[u8]) -> bool {
        first.starts_with(b"MATLAB 7.3 MAT-file") || first.starts_with(b"\x89HDF")
    }

    fn read(&self, _: Input<'_>, _: &str, _: &ReadOptions) -> Result<Recording, Fault> {
        Err(not_read())
    }

    fn names(&self, _: Input<'_>) -> Result<Vec<String>, Fault> {
        Err(not_read())
    }
}

fn not_read() -> Fault {
    Fault::Format {
        format: "a MATLAB 7.3 or HDF5 file",
        says: "only MATLAB's format 5 is read; save it again with `save(name, ..., '-v7')`, or as CSV or Parquet"
            .to_owned(),
    }
}

fn read(
    mut stream: impl Read + Seek,
    file: &str,
    options: &ReadOptions,
) -> Result<Recording, Fault> {
    // The file is read as a whole, and its numbers take eight bytes each once read.
    let bytes = stream.seek(SeekFrom::End(0)).unwrap_or(0);
    if bytes / 8 > options.most_numbers as u64 {
        return Err(Fault::Format {
            format: "a MATLAB file",
            says: "it is too large to be read as a whole; save it as CSV or Parquet, of which parts can be read"
                .to_owned(),
        });
    }
    let columns = columns(stream)?;
    let names = columns.sound.iter().map(|(name, _)| name.clone()).collect();
    let mut intake = Intake::new(names, options)?;
    if !columns.others.is_empty() {
        intake.note(Note::info(format!(
            "{} of {file} {} not of as many samples as the others, or not real, and left aside.",
            list(&columns.others),
            if columns.others.len() == 1 {
                "is"
            } else {
                "are"
            },
        )));
    }
    let samples = columns.sound.first().map_or(0, |(_, values)| values.len());
    let mut sample = Vec::new();
    for k in 0..samples {
        sample.clear();
        let numbers = columns.sound.iter().map(|(_, values)| values[k]);
        sample.extend(numbers.map(Field::of));
        let text = |place: usize| columns.sound[place].1[k].to_string();
        if intake.take(k as u64 + 1, &sample, &text)? == Flow::Stop {
            break;
        }
    }
    intake.finish(file)
}

/// The columns of a file, all of one length, and the names of what is none.
struct Columns {
    sound: Vec<(String, Vec<f64>)>,
    others: Vec<String>,
}

fn columns(stream: impl Read + Seek) -> Result<Columns, Fault> {
    let broken = |says: String| Fault::Format {
        format: "a MATLAB file",
        says,
    };
    let mut stream = BufReader::new(stream);
    if !is_whole(&mut stream).map_err(|error| broken(format!("it cannot be read: {error}")))? {
        return Err(broken(
            "it breaks off within a variable; copy or save it again".to_owned(),
        ));
    }
    let file = MatFile::parse(stream).map_err(|error| {
        broken(format!(
            "it cannot be read: {error}; save it again with `-v7`"
        ))
    })?;
    // The number of samples is the longest side that any array has.
    let longest = |array: &Array| array.size().iter().copied().max().unwrap_or(0);
    let samples = file.arrays().iter().map(longest).max().unwrap_or(0);
    if samples == 0 {
        return Err(broken(
            "it holds no numeric arrays at its top level; structures and tables cannot be read: save their fields as \
             variables of their own, or as CSV or Parquet"
                .to_owned(),
        ));
    }
    let mut columns = Columns {
        sound: Vec::new(),
        others: Vec::new(),
    };
    for array in file.arrays() {
        let (rows, cols) = match array.size().as_slice() {
            [rows, cols] => (*rows, *cols),
            _ => (0, 0),
        };
        let values = numbers(array.data()).filter(|values| values.len() == rows * cols);
        let Some(values) = values.filter(|_| rows == samples || cols == samples) else {
            columns.others.push(array.name().to_owned());
            continue;
        };
        let is_upright = rows == samples;
        let width = if is_upright { cols } else { rows };
        for j in 0..width {
            let name = if width == 1 {
                array.name().to_owned()
            } else {
                format!("{}_{}", array.name(), j + 1)
            };
            let value = |k: usize| {
                values[if is_upright {
                    j * rows + k
                } else {
                    k * rows + j
                }]
            };
            columns
                .sound
                .push((name, (0..samples).map(value).collect()));
        }
    }
    Ok(columns)
}

/// Whether the last variable of a file is complete, which the library does not say; the stream ends at its beginning.
///
/// After a header of 128 bytes, whose last two tell the byte order, each variable has a tag of its type and its length
/// (MathWorks, "MAT-File Format"); lengths are padded to eight bytes unless the variable is compressed.
fn is_whole(stream: &mut (impl Read + Seek)) -> io::Result<bool> {
    const HEADER: u64 = 128;
    const COMPRESSED: u32 = 15;
    let end = stream.seek(SeekFrom::End(0))?;
    if end < HEADER {
        return Ok(false);
    }
    stream.seek(SeekFrom::Start(HEADER - 2))?;
    let mut order = [0; 2];
    stream.read_exact(&mut order)?;
    let number = |bytes: [u8; 4]| {
        if order == *b"IM" {
            u32::from_le_bytes(bytes)
        } else {
            u32::from_be_bytes(bytes)
        }
    };
    let mut at = HEADER;
    while at + 8 <= end {
        stream.seek(SeekFrom::Start(at))?;
        let (mut kind, mut length) = ([0; 4], [0; 4]);
        stream.read_exact(&mut kind)?;
        stream.read_exact(&mut length)?;
        let length = u64::from(number(length));
        at += 8 + if number(kind) == COMPRESSED {
            length
        } else {
            length.next_multiple_of(8)
        };
    }
    stream.rewind()?;
    Ok(at == end)
}

/// The numbers of a real array, column by column.
fn numbers(data: &NumericData) -> Option<Vec<f64>> {
    macro_rules! of {
        ($($variant:ident),*) => {
            match data {
                NumericData::Double { real, imag: None } => Some(real.clone()),
                $(NumericData::$variant { real, imag: None } => Some(real.iter().map(|x| f64::from(*x)).collect()),)*
                NumericData::Int64 { real, imag: None } => Some(real.iter().map(|x| *x as f64).collect()),
                NumericData::UInt64 { real, imag: None } => Some(real.iter().map(|x| *x as f64).collect()),
                _ => None,
            }
        };
    }
    of!(Int8, UInt8, Int16, UInt16, Int32, UInt32, Single)
}
