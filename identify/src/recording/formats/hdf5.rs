//! Recordings as HDF5 files, including MATLAB's format 7.3 (`save -v7.3`): datasets of numbers become columns.
//!
//! A vector `q1` in the group `run` is the column `run.q1`. The columns of a matrix `q` are `q_1`, `q_2` and so on,
//! and the fields of records are `log.position`. All must have the same number of samples. Datasets of another length
//! are skipped and listed in a note.

use std::io::Cursor;

use hdf5_pure::{
    Dataset, Datatype, DatatypeByteOrder, Error, File, FixedPointLayout, FloatingPointLayout, Group, ReadSeekSource,
};

use modelmill_boundary::nesting::NestingLevel;

use crate::recording::column::SampleField;
use crate::recording::error::RecordingFault;
use crate::recording::formats::{RecordingFormat, RecordingInput, TableInfo, read_all};
use crate::recording::half::decode_half;
use crate::recording::intake::{IntakeFlow, SampleIntake};
use crate::recording::notes::RecordingNote;
use crate::recording::tables::{ColumnInfo, find_time_range};
use crate::recording::{ReadOptions, SignalRecording};
use crate::words::backquoted_list;

/// Largest number of datasets; more are an error of the file.
const MOST_DATASETS: usize = 1 << 14;
/// Largest number of columns.
const MOST_COLUMNS: usize = 1 << 17;
/// Deepest nesting of groups.
const DEEPEST: usize = 16;
/// Bytes of a dataset that are in memory at once, in addition to a chunk.
const WINDOW: u64 = 8 << 20;
/// Largest chunk in bytes; writers usually make chunks of about a megabyte.
const LARGEST_CHUNK: u64 = 64 << 20;
/// The layout of half floats (IEEE 754 binary16), `float16` of h5py.
const BINARY16: FloatingPointLayout = FloatingPointLayout {
    bit_offset: 0,
    bit_precision: 16,
    exponent_location: 10,
    exponent_size: 5,
    mantissa_location: 0,
    mantissa_size: 10,
    exponent_bias: 15,
};
/// Groups of MATLAB with internal data.
const MATLAB_GROUPS: [&str; 2] = ["#refs#", "#subsystem#"];

/// The HDF5 format of any writer.
pub(crate) struct Hdf5Format;

impl RecordingFormat for Hdf5Format {
    fn suffix(&self) -> &'static str {
        " (HDF5)"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["h5", "hdf5", "hdf"]
    }

    // MATLAB puts a text header in front of the signature of HDF5.
    fn has_signature(&self, first: &[u8]) -> bool {
        first.starts_with(b"MATLAB 7.3 MAT-file") || first.starts_with(b"\x89HDF")
    }

    fn read(
        &self,
        input: RecordingInput<'_>,
        file: &str,
        options: &ReadOptions,
    ) -> Result<SignalRecording, RecordingFault> {
        read(&open(input)?, file, options)
    }

    fn names(&self, input: RecordingInput<'_>) -> Result<Vec<String>, RecordingFault> {
        Ok(HdfColumns::new(&open(input)?)?.names())
    }

    fn tables(&self, input: RecordingInput<'_>) -> Result<Vec<TableInfo>, RecordingFault> {
        let file = open(input)?;
        let columns = HdfColumns::new(&file)?;
        let infos = columns.consistent.iter().map(|column| ColumnInfo {
            name: column.name.clone(),
            kind: column.number.name(),
        });
        // Skipped datasets are listed in the remark.
        let remark = (!columns.others.is_empty()).then(|| {
            format!(
                "skipped, of another length or without numbers: {}",
                backquoted_list(&columns.others)
            )
        });
        Ok(vec![TableInfo {
            name: String::new(),
            kind: String::new(),
            samples: columns.samples,
            time: find_time_range(&columns.names(), |name| {
                read(&file, "", &ReadOptions::single_column(name)).ok()
            }),
            columns: infos.collect(),
            remark,
        }])
    }
}

/// Opens a file; streams are read into memory first.
fn open(input: RecordingInput<'_>) -> Result<File, RecordingFault> {
    let opened = match input {
        // A file on disk is read in parts as needed.
        RecordingInput::File(stream) => ReadSeekSource::new(stream)
            .map_err(Error::from)
            .and_then(File::from_source),
        // Only Parquet files are read as a data set.
        #[cfg(feature = "parquet")]
        RecordingInput::DataSet(_) => File::from_bytes(Vec::new()),
        RecordingInput::Bytes(bytes) => File::from_bytes(bytes.to_vec()),
        RecordingInput::Stream(stream) => ReadSeekSource::new(Cursor::new(read_all(stream)?))
            .map_err(Error::from)
            .and_then(File::from_source),
    };
    opened.map_err(|error| unreadable_fault(&error))
}

/// Reads the columns that are needed.
fn read(opened: &File, file: &str, options: &ReadOptions) -> Result<SignalRecording, RecordingFault> {
    let columns = HdfColumns::new(opened)?;
    let mut intake = SampleIntake::new(columns.names(), options)?;
    // Datasets that are no columns are reported.
    if !columns.others.is_empty() {
        intake.note(RecordingNote::info(format!(
            "{} of {file} {} skipped, because of another number of samples or without numbers.",
            backquoted_list(&columns.others),
            if columns.others.len() == 1 { "is" } else { "are" },
        )));
    }
    let is_read = |place: &usize| intake.is_place_needed(*place);
    let read: Vec<usize> = (0..columns.consistent.len()).filter(is_read).collect();
    // The numbers exist twice until all samples are taken.
    if read.len().saturating_mul(columns.samples) > options.max_numbers / 2 {
        return Err(format_fault(
            "it is too large to be read completely; save it as CSV or Parquet, which can be read in parts",
        ));
    }
    // The numbers of each needed column; the others stay empty.
    let mut values = vec![Vec::new(); columns.consistent.len()];
    for place in read {
        values[place] = columns.consistent[place].read_numbers(opened, columns.samples)?;
    }
    // Pass the samples to the intake, one row after another.
    let mut sample = vec![SampleField::Number(0.0); columns.consistent.len()];
    for k in 0..columns.samples {
        for (field, values) in sample.iter_mut().zip(&values) {
            if let Some(value) = values.get(k) {
                *field = SampleField::finite(*value);
            }
        }
        // The only bad fields here are not finite, because all numbers have been converted.
        let text = |_: usize| "NaN or infinite".to_owned();
        if intake.take_sample(k as u64 + 1, &sample, &text)? == IntakeFlow::Stop {
            break;
        }
    }
    intake.finish(file)
}

/// The columns of a file, all of the same length, and the names of the datasets that are skipped.
struct HdfColumns {
    /// Number of samples.
    samples: usize,
    /// Columns with that number of samples.
    consistent: Vec<HdfColumn>,
    /// Names of datasets of another length or without numbers.
    others: Vec<String>,
}

/// A column and the position of its numbers.
struct HdfColumn {
    /// Name of the column: its path with points, with a number and a field if there are several.
    name: String,
    /// Path of its dataset in the file.
    path: String,
    /// The elements of the dataset that belong to the column.
    place: HdfColumnPlace,
    /// Position and type of the number within an element.
    number: HdfNumber,
}

/// Which elements of a dataset belong to a column.
#[derive(Clone, Copy)]
enum HdfColumnPlace {
    /// Samples are rows of `of` elements, and the column is element `k` of each.
    Element { of: u64, k: u64 },
    /// The column is one row of the dataset.
    Row(u64),
}

impl HdfColumns {
    /// Sorts the datasets of a file into columns and others.
    fn new(file: &File) -> Result<Self, RecordingFault> {
        let mut found = Vec::new();
        let mut others = Vec::new();
        collect_datasets(&file.root(), "", NestingLevel::top(DEEPEST), &mut found, &mut others)?;
        // The number of samples is the longest side of any dataset.
        let samples = found.iter().flat_map(|one| &one.shape).copied().max().unwrap_or(0);
        if samples == 0 {
            return Err(format_fault("it contains no datasets of numbers"));
        }
        let mut columns = Self {
            samples: usize::try_from(samples)
                .map_err(|_| format_fault("it declares more samples than fit into memory"))?,
            consistent: Vec::new(),
            others,
        };
        // Vectors and matrices can be columns; a vector is a matrix with one column.
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
            // Samples are the rows of an upright matrix, otherwise its columns.
            let is_upright = rows == samples;
            let n = if is_upright { width } else { rows };
            if columns.consistent.len() as u64 + n * one.numbers.len() as u64 > MOST_COLUMNS as u64 {
                return Err(format_fault("it has more columns than any recording"));
            }
            // Each column of the matrix has one column for each number of its elements.
            for k in 0..n {
                for (field, number) in &one.numbers {
                    // A dataset with a single column needs no number in the name.
                    let number_of = if n == 1 { String::new() } else { format!("_{}", k + 1) };
                    columns.consistent.push(HdfColumn {
                        name: format!("{}{number_of}{field}", one.name),
                        path: one.path.clone(),
                        place: if is_upright {
                            HdfColumnPlace::Element { of: width, k }
                        } else {
                            HdfColumnPlace::Row(k)
                        },
                        number: *number,
                    });
                }
            }
        }
        Ok(columns)
    }

    /// Names of the columns, in the order of the file.
    fn names(&self) -> Vec<String> {
        self.consistent.iter().map(|column| column.name.clone()).collect()
    }
}

/// A dataset of numbers.
struct HdfDataset {
    /// Its path, with points instead of slashes.
    name: String,
    /// Its path in the file.
    path: String,
    /// Its sides; their number is one for a vector.
    shape: Vec<u64>,
    /// The numbers of an element: one without a name, or one for each field of a record.
    numbers: Vec<(String, HdfNumber)>,
}

/// Collects the datasets of a group and of all groups in it.
///
/// Datasets without numbers go to `others` by name. Fails when groups are nested without end, or a chunk is too
/// large.
fn collect_datasets(
    group: &Group,
    path: &str,
    level: NestingLevel,
    found: &mut Vec<HdfDataset>,
    others: &mut Vec<String>,
) -> Result<(), RecordingFault> {
    // All members are opened at once: to find each by its name would search the group again.
    let datasets = group.iter_datasets().map_err(|error| unreadable_fault(&error))?;
    for (name, dataset) in datasets {
        if found.len() + others.len() >= MOST_DATASETS {
            return Err(format_fault(format!("it has more than {MOST_DATASETS} datasets")));
        }
        let path = format!("{path}/{name}");
        let name = path[1..].replace('/', ".");
        match HdfDataset::new(name.clone(), path, &dataset)? {
            Some(dataset) => found.push(dataset),
            None => others.push(name),
        }
    }
    // Then the groups in this group.
    let groups = group.iter_groups().map_err(|error| unreadable_fault(&error))?;
    for (name, within) in groups {
        if MATLAB_GROUPS.contains(&name.as_str()) {
            continue;
        }
        let level = level
            .enter()
            .map_err(|fault| format_fault(format!("its group `{name}` is too deep; {fault}")))?;
        collect_datasets(&within, &format!("{path}/{name}"), level, found, others)?;
    }
    Ok(())
}

impl HdfDataset {
    /// The dataset, if it has numbers; other types are skipped.
    ///
    /// Fails when it is stored in chunks that are too large to be read, or larger than the file.
    fn new(name: String, path: String, dataset: &Dataset) -> Result<Option<Self>, RecordingFault> {
        // A type that the library does not know is skipped.
        let (Ok(kind), Ok(shape)) = (dataset.datatype(), dataset.shape()) else {
            return Ok(None);
        };
        // The numbers within an element, with the names of their fields.
        let mut numbers = Vec::new();
        HdfNumber::collect_numbers(&kind, String::new(), 0, u64::from(kind.type_size()), &mut numbers);
        if numbers.is_empty() || numbers.len() > MOST_COLUMNS {
            return Ok(None);
        }
        // The library reads complete chunks, so their size is limited.
        let chunk = dataset.chunk_shape().map_err(|error| unreadable_fault(&error))?;
        let size = chunk
            .unwrap_or_default()
            .iter()
            .fold(u64::from(kind.type_size()), |size, side| size.saturating_mul(*side));
        if size > LARGEST_CHUNK {
            return Err(format_fault(format!(
                "`{name}` is stored in chunks of {size} bytes; store it in smaller ones"
            )));
        }
        Ok(Some(Self {
            name,
            path,
            shape,
            numbers,
        }))
    }
}

/// Checks that the stored chunks of a dataset lie in the file. The library reserves memory of their stated sizes before
/// it reads them, so that a damaged size of some bytes would reserve gigabytes.
fn check_stored_chunks(dataset: &Dataset, name: &str, file_size: u64) -> Result<(), RecordingFault> {
    // Other datasets are one block, whose size the library compares with the file. An index that cannot be listed
    // cannot be read either, which its error states later.
    if !dataset.is_chunked() {
        return Ok(());
    }
    let Ok(chunks) = dataset.chunks() else {
        return Ok(());
    };
    for chunk in chunks {
        let end = chunk.address.saturating_add(chunk.storage_size);
        if end > file_size {
            return Err(format_fault(format!(
                "a part of `{name}` has {} bytes at position {}, but the file has {file_size} bytes; it is damaged or incomplete",
                chunk.storage_size, chunk.address
            )));
        }
    }
    Ok(())
}

impl HdfColumn {
    /// Its numbers, one per sample, read in parts of at most [`WINDOW`] bytes.
    ///
    /// Fails when the dataset is shorter than its declared size.
    fn read_numbers(&self, file: &File, samples: usize) -> Result<Vec<f64>, RecordingFault> {
        let dataset = file.dataset(&self.path).map_err(|error| unreadable_fault(&error))?;
        check_stored_chunks(&dataset, &self.name, file.file_size())?;
        let mut values = Vec::new();
        // Bytes of an element of the dataset.
        let size = usize::try_from(self.number.element).unwrap_or(usize::MAX);
        // Appends every `every`-th element from `from` on.
        let mut take = |bytes: &[u8], every: usize, from: usize| {
            let elements = bytes.chunks_exact(size).skip(from).step_by(every);
            values.extend(elements.map(|element| self.number.value(element)));
        };
        // A row is read at once; a column is read in groups of rows.
        match self.place {
            HdfColumnPlace::Row(k) => {
                let bytes = dataset.read_raw_rows(k, 1).map_err(|error| unreadable_fault(&error))?;
                take(&bytes, 1, 0);
            }
            // Bytes of a row, and the number of rows per part.
            HdfColumnPlace::Element { of, k } => {
                let row = of.saturating_mul(self.number.element).max(1);
                let most = (WINDOW / row).max(1);
                let mut from = 0;
                while from < samples as u64 {
                    let rows = most.min(samples as u64 - from);
                    let bytes = dataset
                        .read_raw_rows(from, rows)
                        .map_err(|error| unreadable_fault(&error))?;
                    let width = usize::try_from(of).unwrap_or(usize::MAX);
                    take(&bytes, width, usize::try_from(k).unwrap_or(0));
                    from += rows;
                }
            }
        }
        // A truncated file gives fewer numbers than declared.
        if values.len() != samples {
            return Err(format_fault(format!(
                "`{}` is shorter than its declared size",
                self.name
            )));
        }
        Ok(values)
    }
}

/// The position and type of a number within an element of a dataset.
#[derive(Clone, Copy, Debug, PartialEq)]
struct HdfNumber {
    /// Bytes of an element.
    element: u64,
    /// Position of the number in the element, in bytes.
    at: usize,
    /// Bytes of the number.
    size: usize,
    /// Whether the first byte is the highest one.
    is_big: bool,
    /// How the bytes are interpreted.
    kind: HdfNumberKind,
}

/// How the bytes of a number are interpreted.
#[derive(Clone, Copy, Debug, PartialEq)]
enum HdfNumberKind {
    /// Integer with a sign, in two's complement.
    Signed,
    /// Integer without a sign.
    Unsigned,
    /// IEEE 754 float of 2, 4 or 8 bytes.
    Float,
}

impl HdfNumber {
    /// Collects the numbers of a type, each with the suffix that it adds to the name of the dataset.
    ///
    /// `at` is the position of the type in an element of `element` bytes. Other types are ignored.
    fn collect_numbers(kind: &Datatype, name: String, at: u64, element: u64, numbers: &mut Vec<(String, Self)>) {
        let size = kind.type_size();
        let (order, kind) = match kind {
            // Integers that fill their bytes.
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
                    HdfNumberKind::Signed
                } else {
                    HdfNumberKind::Unsigned
                };
                (*byte_order, kind)
            }
            // IEEE floats; other layouts are not supported.
            Datatype::FloatingPoint { byte_order, layout, .. }
                if *layout == BINARY16
                    || *layout == FloatingPointLayout::IEEE754_BINARY32
                    || *layout == FloatingPointLayout::IEEE754_BINARY64 =>
            {
                (*byte_order, HdfNumberKind::Float)
            }
            // Booleans of h5py are enumerations of 0 and 1.
            Datatype::Enumeration { base_type, .. } => {
                return Self::collect_numbers(base_type, name, at, element, numbers);
            }
            // The fields of a record.
            Datatype::Compound { members, .. } => {
                for member in members {
                    let name = format!("{name}.{}", member.name);
                    let at = at.saturating_add(member.byte_offset);
                    Self::collect_numbers(&member.datatype, name, at, element, numbers);
                }
                return;
            }
            // The elements of an array, numbered from 1.
            Datatype::Array { base_type, dimensions } => {
                let n = dimensions.iter().fold(1_u64, |n, d| n.saturating_mul(u64::from(*d)));
                for k in 0..n.min(MOST_COLUMNS as u64) {
                    let at = at.saturating_add(k * u64::from(base_type.type_size()));
                    Self::collect_numbers(base_type, format!("{name}_{}", k + 1), at, element, numbers);
                }
                return;
            }
            _ => return,
        };
        // A number must lie within its element.
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

    /// Its value in the bytes of an element.
    fn value(self, element: &[u8]) -> f64 {
        // The bytes in little-endian order, padded with zeros.
        let mut bytes = [0; 8];
        let stored = &element[self.at..self.at + self.size];
        for (k, byte) in bytes.iter_mut().zip(0..self.size) {
            *k = stored[if self.is_big { self.size - 1 - byte } else { byte }];
        }
        // Shifting left and back extends the sign.
        let bits = u64::from_le_bytes(bytes);
        let above = 64 - 8 * self.size;
        match (self.kind, self.size) {
            (HdfNumberKind::Unsigned, _) => bits as f64,
            (HdfNumberKind::Signed, _) => ((bits << above).cast_signed() >> above) as f64,
            (HdfNumberKind::Float, 2) => {
                let [a, b, ..] = bytes;
                decode_half(u16::from_le_bytes([a, b]))
            }
            (HdfNumberKind::Float, 4) => {
                let [a, b, c, d, ..] = bytes;
                f64::from(f32::from_le_bytes([a, b, c, d]))
            }
            (HdfNumberKind::Float, _) => f64::from_bits(bits),
        }
    }

    /// The name of its type, such as `float64`.
    fn name(self) -> String {
        let kind = match self.kind {
            HdfNumberKind::Signed => "int",
            HdfNumberKind::Unsigned => "uint",
            HdfNumberKind::Float => "float",
        };
        format!("{kind}{}", 8 * self.size)
    }
}

/// The fault of a file with other contents.
fn format_fault(says: impl Into<String>) -> RecordingFault {
    RecordingFault::Format {
        format: "an HDF5 or MATLAB 7.3 file",
        message: says.into(),
    }
}

/// The fault of a file that cannot be read.
fn unreadable_fault(error: &Error) -> RecordingFault {
    // In groups of the older layout, the library takes the undefined address of a soft link for that of an object.
    if error.to_string().contains(&u64::MAX.to_string()) {
        return format_fault(
            "one of its groups has a soft or external link, which cannot be followed in the older layout of groups; copy the \
             file without links, or with the newer layout (`libver=\"latest\"` of h5py)",
        );
    }
    format_fault(format!(
        "it cannot be read: {error}; is it complete, and was it closed by the program that wrote it?"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_floats_are_numbers() {
        let kind = Datatype::FloatingPoint {
            size: 2,
            byte_order: DatatypeByteOrder::BigEndian,
            layout: BINARY16,
        };
        let mut numbers = Vec::new();
        HdfNumber::collect_numbers(&kind, String::new(), 0, 2, &mut numbers);
        let [(_, number)] = numbers.as_slice() else {
            panic!("{numbers:?}");
        };
        assert_eq!(number.name(), "float16");
        // 1.5 is the exponent 15 and half of the fraction.
        assert!((number.value(&[0x3e, 0x00]) - 1.5).abs() < 1e-15);
    }
}
