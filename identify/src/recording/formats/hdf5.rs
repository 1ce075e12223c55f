//! Recordings as HDF5 files, MATLAB's format 7.3 (`save -v7.3`) among them: datasets of numbers become columns.
//!
//! A vector `q1` in the group `run` is the column `run.q1`; the columns of a matrix `q` are `q_1`, `q_2` and so on, and the
//! fields of records `log.position`. All must have the same number of samples; what has another length is left aside and
//! said.

use std::io::Cursor;

use hdf5_pure::{
    Datatype, DatatypeByteOrder, Error, File, FixedPointLayout, FloatingPointLayout, Group,
    ReadSeekSource,
};

use crate::recording::column::Field;
use crate::recording::error::Fault;
use crate::recording::formats::{Format, Input, TableInfo, all_of};
use crate::recording::intake::{Flow, Intake};
use crate::recording::notes::Note;
use crate::recording::tables::{ColumnInfo, found_time};
use crate::recording::{ReadOptions, Recording};
use crate::words::list;

/// More datasets than any recording has.
const MOST_DATASETS: usize = 1 << 14;
const MOST_COLUMNS: usize = 1 << 17;
/// Groups within one another.
const DEEPEST: usize = 16;
/// Bytes of a dataset that are in memory at once, besides a chunk.
const WINDOW: u64 = 8 << 20;
/// The largest chunk; writers make some of a megabyte.
const LARGEST_CHUNK: u64 = 64 << 20;
/// Groups in which MATLAB keeps what is none of the user's.
const OF_MATLAB: [&str; 2] = ["#refs#", "#subsystem#"];

/// HDF5, whoever wrote it.
pub(crate) struct Hdf5;

impl Format for Hdf5 {
    fn suffix(&self) -> &'static str {
        " (HDF5)"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["h5", "hdf5", "hdf"]
    }

    fn begins(&self, first: &[u8]) -> bool {
        first.starts_with(b"MATLAB 7.3 MAT-file") || first.starts_with(b"\x89HDF")
    }

    fn read(
        &self,
        input: Input<'_>,
        file: &str,
        options: &ReadOptions,
    ) -> Result<Recording, Fault> {
        read(&open(input)?, file, options)
    }

    fn names(&self, input: Input<'_>) -> Result<Vec<String>, Fault> {
        Ok(Columns::new(&open(input)?)?.names())
    }

    fn tables(&self, input: Input<'_>) -> Result<Vec<TableInfo>, Fault> {
        let file = open(input)?;
        let columns = Columns::new(&file)?;
        let infos = columns.sound.iter().map(|column| ColumnInfo {
            name: column.name.clone(),
            kind: column.number.name(),
        });
        let remark = (!columns.others.is_empty()).then(|| {
            format!(
                "left aside, of another length or no numbers: {}",
                list(&columns.others)
            )
        });
        Ok(vec![TableInfo {
            name: String::new(),
            kind: String::new(),
            samples: columns.samples,
            time: found_time(&columns.names(), |name| {
                read(&file, "", &ReadOptions::only(name)).ok()
            }),
            columns: infos.collect(),
            remark,
        }])
    }
}

fn open(input: Input<'_>) -> Result<File, Fault> {
    let opened = match input {
        Input::File(stream) => ReadSeekSource::new(stream)
            .map_err(Error::from)
            .and_then(File::from_source),
        Input::Bytes(bytes) => File::from_bytes(bytes.to_vec()),
        Input::Stream(stream) => ReadSeekSource::new(Cursor::new(all_of(stream)?))
            .map_err(Error::from)
            .and_then(File::from_source),
    };
    opened.map_err(|error| unreadable(&error))
}

fn read(opened: &File, file: &str, options: &ReadOptions) -> Result<Recording, Fault> {
    let columns = Columns::new(opened)?;
    let mut intake = Intake::new(columns.names(), options)?;
    if !columns.others.is_empty() {
        intake.note(Note::info(format!(
            "{} of {file} {} not of as many samples as the others, or no numbers, and left aside.",
            list(&columns.others),
            if columns.others.len() == 1 {
                "is"
            } else {
                "are"
            },
        )));
    }
    let is_read = |place: &usize| intake.reads(*place);
    let read: Vec<usize> = (0..columns.sound.len()).filter(is_read).collect();
    // Numbers are kept twice until all are taken in.
    if read.len().saturating_mul(columns.samples) > options.most_numbers / 2 {
        return Err(broken(
            "it is too large to be read as a whole; save it as CSV or Parquet, of which parts can be read",
        ));
    }
    let mut values = vec![Vec::new(); columns.sound.len()];
    for place in read {
        values[place] = columns.sound[place].numbers(opened, columns.samples)?;
    }
    let mut sample = vec![Field::Number(0.0); columns.sound.len()];
    for k in 0..columns.samples {
        for (field, values) in sample.iter_mut().zip(&values) {
            if let Some(value) = values.get(k) {
                *field = Field::finite(*value);
            }
        }
        let text = |_: usize| "NaN or infinite".to_owned();
        if intake.take(k as u64 + 1, &sample, &text)? == Flow::Stop {
            break;
        }
    }
    intake.finish(file)
}

/// The columns of a file, all of one length, and the names of what is none.
struct Columns {
    samples: usize,
    sound: Vec<Column>,
    others: Vec<String>,
}

/// A column, and where its numbers stand.
struct Column {
    name: String,
    path: String,
    /// Elements of a row of the dataset, and which of them is this column; or else the row that it is.
    place: Place,
    number: Number,
}

#[derive(Clone, Copy)]
enum Place {
    /// Samples are rows of so many elements, and the column is one of them.
    Element { of: u64, k: u64 },
    /// The column is a row.
    Row(u64),
}

impl Columns {
    fn new(file: &File) -> Result<Self, Fault> {
        let mut found = Vec::new();
        let mut others = Vec::new();
        collect(&file.root(), "", 0, &mut found, &mut others)?;
        // The number of samples is the longest side that any dataset has.
        let samples = found
            .iter()
            .flat_map(|one| &one.shape)
            .copied()
            .max()
            .unwrap_or(0);
        if samples == 0 {
            return Err(broken("it holds no datasets of numbers"));
        }
        let mut columns = Self {
            samples: usize::try_from(samples)
                .map_err(|_| broken("it says to have more samples than any memory holds"))?,
            sound: Vec::new(),
            others,
        };
        for one in found {
            let (rows, width) = match one.shape.as_slice() {
                [rows] => (*rows, 1),
                [rows, width] => (*rows, *width),
                _ => (0, 0),
            };
            if rows != samples && width != samples {
                columns.others.push(one.name);
                continue;
            }
            let is_upright = rows == samples;
            let n = if is_upright { width } else { rows };
            if columns.sound.len() as u64 + n * one.numbers.len() as u64 > MOST_COLUMNS as u64 {
                return Err(broken("it has more columns than any recording"));
            }
            for k in 0..n {
                for (field, number) in &one.numbers {
                    let number_of = if n == 1 {
                        String::new()
                    } else {
                        format!("_{}", k + 1)
                    };
                    columns.sound.push(Column {
                        name: format!("{}{number_of}{field}", one.name),
                        path: one.path.clone(),
                        place: if is_upright {
                            Place::Element { of: width, k }
                        } else {
                            Place::Row(k)
                        },
                        number: *number,
                    });
                }
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

/// A dataset of numbers.
struct Found {
    /// Its path with points.
    name: String,
    path: String,
    shape: Vec<u64>,
    /// The numbers of an element: one without a name, or the fields of a record.
    numbers: Vec<(String, Number)>,
}

/// Collects the datasets of a group and of those within it.
fn collect(
    group: &Group,
    path: &str,
    depth: usize,
    found: &mut Vec<Found>,
    others: &mut Vec<String>,
) -> Result<(), Fault> {
    if depth > DEEPEST || found.len() + others.len() > MOST_DATASETS {
        return Err(broken("its groups have no end"));
    }
    for dataset in group.datasets().map_err(|error| unreadable(&error))? {
        let path = format!("{path}/{dataset}");
        let name = path[1..].replace('/', ".");
        let dataset = group
            .dataset(&dataset)
            .map_err(|error| unreadable(&error))?;
        let (Ok(kind), Ok(shape)) = (dataset.datatype(), dataset.shape()) else {
            others.push(name);
            continue;
        };
        let mut numbers = Vec::new();
        Number::collect(
            &kind,
            String::new(),
            0,
            u64::from(kind.type_size()),
            &mut numbers,
        );
        if numbers.is_empty() || numbers.len() > MOST_COLUMNS {
            others.push(name);
            continue;
        }
        let chunk = dataset.chunk_shape().map_err(|error| unreadable(&error))?;
        let size = chunk
            .unwrap_or_default()
            .iter()
            .fold(u64::from(kind.type_size()), |size, side| {
                size.saturating_mul(*side)
            });
        if size > LARGEST_CHUNK {
            return Err(broken(format!(
                "`{name}` is stored in chunks of {size} bytes; store it in smaller ones"
            )));
        }
        found.push(Found {
            name,
            path,
            shape,
            numbers,
        });
    }
    for inner in group.groups().map_err(|error| unreadable(&error))? {
        if OF_MATLAB.contains(&inner.as_str()) {
            continue;
        }
        let within = group.group(&inner).map_err(|error| unreadable(&error))?;
        collect(
            &within,
            &format!("{path}/{inner}"),
            depth + 1,
            found,
            others,
        )?;
    }
    Ok(())
}

impl Column {
    /// Its numbers, read in windows that fit into memory.
    fn numbers(&self, file: &File, samples: usize) -> Result<Vec<f64>, Fault> {
        let dataset = file
            .dataset(&self.path)
            .map_err(|error| unreadable(&error))?;
        let mut values = Vec::new();
        let size = usize::try_from(self.number.element).unwrap_or(usize::MAX);
        let mut take = |bytes: &[u8], every: usize, from: usize| {
            let elements = bytes.chunks_exact(size).skip(from).step_by(every);
            values.extend(elements.map(|element| self.number.value(element)));
        };
        match self.place {
            Place::Row(k) => {
                let bytes = dataset
                    .read_raw_rows(k, 1)
                    .map_err(|error| unreadable(&error))?;
                take(&bytes, 1, 0);
            }
            Place::Element { of, k } => {
                let row = of.saturating_mul(self.number.element).max(1);
                let most = (WINDOW / row).max(1);
                let mut from = 0;
                while from < samples as u64 {
                    let rows = most.min(samples as u64 - from);
                    let bytes = dataset
                        .read_raw_rows(from, rows)
                        .map_err(|error| unreadable(&error))?;
                    let width = usize::try_from(of).unwrap_or(usize::MAX);
                    take(&bytes, width, usize::try_from(k).unwrap_or(0));
                    from += rows;
                }
            }
        }
        if values.len() != samples {
            return Err(broken(format!("`{}` is shorter than it says", self.name)));
        }
        Ok(values)
    }
}

/// A number within an element of a dataset.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Number {
    /// Bytes of an element, and where the number begins in it.
    element: u64,
    at: usize,
    size: usize,
    is_big: bool,
    kind: Kind,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Signed,
    Unsigned,
    Float,
}

impl Number {
    /// Finds the numbers of a type, each with the name that it adds to that of the dataset.
    fn collect(
        kind: &Datatype,
        name: String,
        at: u64,
        element: u64,
        numbers: &mut Vec<(String, Self)>,
    ) {
        let size = kind.type_size();
        let (order, kind) = match kind {
            Datatype::FixedPoint {
                byte_order,
                layout:
                    FixedPointLayout {
                        signed,
                        bit_offset: 0,
                        bit_precision,
                    },
                ..
            } if u32::from(*bit_precision) == 8 * size && matches!(size, 1 | 2 | 4 | 8) => {
                let kind = if *signed {
                    Kind::Signed
                } else {
                    Kind::Unsigned
                };
                (*byte_order, kind)
            }
            Datatype::FloatingPoint {
                byte_order, layout, ..
            } if *layout == FloatingPointLayout::IEEE754_BINARY32
                || *layout == FloatingPointLayout::IEEE754_BINARY64 =>
            {
                (*byte_order, Kind::Float)
            }
            // Truths of h5py are words for 0 and 1.
            Datatype::Enumeration { base_type, .. } => {
                return Self::collect(base_type, name, at, element, numbers);
            }
            Datatype::Compound { members, .. } => {
                for member in members {
                    let name = format!("{name}.{}", member.name);
                    let at = at.saturating_add(member.byte_offset);
                    Self::collect(&member.datatype, name, at, element, numbers);
                }
                return;
            }
            Datatype::Array {
                base_type,
                dimensions,
            } => {
                let n = dimensions
                    .iter()
                    .fold(1_u64, |n, d| n.saturating_mul(u64::from(*d)));
                for k in 0..n.min(MOST_COLUMNS as u64) {
                    let at = at.saturating_add(k * u64::from(base_type.type_size()));
                    Self::collect(base_type, format!("{name}_{}", k + 1), at, element, numbers);
                }
                return;
            }
            _ => return,
        };
        if order == DatatypeByteOrder::Vax || at + u64::from(size) > element {
            return;
        }
        let number = Self {
            element,
            at: usize::try_from(at).unwrap_or(usize::MAX),
            size: size as usize,
            is_big: order == DatatypeByteOrder::BigEndian,
            kind,
        };
        numbers.push((name, number));
    }

    /// Its value in an element.
    fn value(self, element: &[u8]) -> f64 {
        let mut bytes = [0; 8];
        let stored = &element[self.at..self.at + self.size];
        for (k, byte) in bytes.iter_mut().zip(0..self.size) {
            *k = stored[if self.is_big {
                self.size - 1 - byte
            } else {
                byte
            }];
        }
        let bits = u64::from_le_bytes(bytes);
        let above = 64 - 8 * self.size;
        match (self.kind, self.size) {
            (Kind::Unsigned, _) => bits as f64,
            (Kind::Signed, _) => ((bits << above).cast_signed() >> above) as f64,
            (Kind::Float, 4) => {
                let [a, b, c, d, ..] = bytes;
                f64::from(f32::from_le_bytes([a, b, c, d]))
            }
            (Kind::Float, _) => f64::from_bits(bits),
        }
    }

    fn name(self) -> String {
        let kind = match self.kind {
            Kind::Signed => "int",
            Kind::Unsigned => "uint",
            Kind::Float => "float",
        };
        format!("{kind}{}", 8 * self.size)
    }
}

fn broken(says: impl Into<String>) -> Fault {
    Fault::Format {
        format: "an HDF5 or MATLAB 7.3 file",
        says: says.into(),
    }
}

fn unreadable(error: &Error) -> Fault {
    broken(format!(
        "it cannot be read: {error}; is it complete, and closed by whoever wrote it?"
    ))
}
