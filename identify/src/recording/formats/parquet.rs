//! Recordings as Parquet files: the flat columns of numbers and times, read in batches of samples.
//!
//! Time stamps and times of day become seconds from the first one on, exactly, before they are rounded to a float.

use std::io;
use std::sync::Arc;

use bytes::Bytes;
use parquet::basic::{Compression, ConvertedType, LogicalType, TimeUnit, Type};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl, get_column_reader};
use parquet::data_type::DataType;
use parquet::errors::ParquetError;
use parquet::file::metadata::RowGroupMetaData;
use parquet::file::reader::{
    ChunkReader, FileReader, Length, RowGroupReader, SerializedFileReader,
};
use parquet::file::serialized_reader::SerializedPageReader;
use parquet::schema::types::{ColumnDescPtr, ColumnDescriptor};

use crate::recording::column::SampleField;
use crate::recording::error::RecordingFault;
use crate::recording::formats::packing::CompressionMethod;
use crate::recording::formats::parquet_pages::{self, PageGrowth, UnpackedPages};
use crate::recording::formats::{RecordingFormat, RecordingInput, TableInfo, read_all};
use crate::recording::intake::{IntakeFlow, SampleIntake};
use crate::recording::notes::RecordingNote;
use crate::recording::tables::{ColumnInfo, find_time_range};
use crate::recording::{ReadOptions, SignalRecording};

/// Samples that are read at once.
const BATCH: usize = 8192;
/// Fields that are kept at once.
const FIELDS: usize = 1 << 22;
/// Bytes of pages that may be in memory at once.
const MOST_UNPACKED: u64 = 256 << 20;

/// Apache Parquet.
pub(crate) struct ParquetFormat;

impl RecordingFormat for ParquetFormat {
    fn suffix(&self) -> &'static str {
        " (Parquet)"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["parquet", "pq"]
    }

    fn has_signature(&self, first: &[u8]) -> bool {
        first.starts_with(b"PAR1")
    }

    fn read(
        &self,
        input: RecordingInput<'_>,
        file: &str,
        options: &ReadOptions,
    ) -> Result<SignalRecording, RecordingFault> {
        match input {
            RecordingInput::File(stream) => read(stream, file, options),
            RecordingInput::Bytes(bytes) => read(Bytes::copy_from_slice(bytes), file, options),
            RecordingInput::Stream(stream) => read(Bytes::from(read_all(stream)?), file, options),
        }
    }

    fn names(&self, input: RecordingInput<'_>) -> Result<Vec<String>, RecordingFault> {
        match input {
            RecordingInput::File(stream) => names_of(stream),
            RecordingInput::Bytes(bytes) => names_of(Bytes::copy_from_slice(bytes)),
            RecordingInput::Stream(stream) => names_of(Bytes::from(read_all(stream)?)),
        }
    }

    fn tables(&self, input: RecordingInput<'_>) -> Result<Vec<TableInfo>, RecordingFault> {
        match input {
            RecordingInput::File(stream) => tables_of(SharedChunkReader(Arc::new(stream))),
            RecordingInput::Bytes(bytes) => {
                tables_of(SharedChunkReader(Arc::new(Bytes::copy_from_slice(bytes))))
            }
            RecordingInput::Stream(stream) => {
                tables_of(SharedChunkReader(Arc::new(Bytes::from(read_all(stream)?))))
            }
        }
    }
}

fn read(
    stream: impl ChunkReader + 'static,
    file: &str,
    options: &ReadOptions,
) -> Result<SignalRecording, RecordingFault> {
    let bytes = Arc::new(stream);
    let reader =
        SerializedFileReader::new(SharedChunkReader(bytes.clone())).map_err(parquet_fault)?;
    let schema = reader.metadata().file_metadata().schema_descr_ptr();
    let width = schema.num_columns();
    let mut intake = SampleIntake::new(names(&reader), options)?;
    let mut kinds: Vec<ParquetValueKind> = (0..width)
        .map(|i| ParquetValueKind::from_column(&schema.column(i)))
        .collect();
    for (i, kind) in kinds.iter().enumerate() {
        if intake.is_place_needed(i) && matches!(kind, ParquetValueKind::Ticks { .. }) {
            intake.note(RecordingNote::info(format!(
                "`{}` of {file} has time stamps: it is read as seconds since the first one.",
                schema.column(i).path().string()
            )));
        }
    }
    let is_read =
        |i: usize| intake.is_place_needed(i) && !matches!(kinds[i], ParquetValueKind::Unusable);
    let wanted: Vec<bool> = (0..width).map(is_read).collect();
    // As many samples at once as keep the fields of all columns few.
    let n_read = wanted.iter().filter(|is_read| **is_read).count();
    let most = (FIELDS / n_read.max(1)).clamp(1, BATCH);
    let mut sample = vec![SampleField::Number(0.0); width];
    let mut row = 0;
    for group in 0..reader.num_row_groups() {
        check_pages(bytes.as_ref(), reader.metadata().row_group(group), &wanted)?;
        let group = reader.get_row_group(group).map_err(parquet_fault)?;
        let mut columns = Vec::new();
        for i in 0..width {
            columns.push(if wanted[i] {
                Some(column_reader(&bytes, &*group, i, &schema.column(i))?)
            } else {
                None
            });
        }
        let mut left = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
        while left > 0 {
            let n = left.min(most);
            let mut fields: Vec<Vec<SampleField>> = Vec::with_capacity(width);
            for (column, kind) in columns.iter_mut().zip(&mut kinds) {
                fields.push(match column {
                    Some(column) => read_batch(column, kind, n)?,
                    None => Vec::new(),
                });
            }
            for k in 0..n {
                row += 1;
                for (i, field) in sample.iter_mut().enumerate() {
                    *field = match fields[i].get(k) {
                        Some(field) => *field,
                        // A column that nobody reads, or that holds no numbers.
                        None if columns[i].is_none() && !intake.is_place_needed(i) => {
                            SampleField::Number(0.0)
                        }
                        None => SampleField::Text,
                    };
                }
                let text = |i: usize| match sample[i] {
                    SampleField::Text => "a value of another type".to_owned(),
                    _ => "null or NaN".to_owned(),
                };
                if intake.take_sample(row, &sample, &text)? == IntakeFlow::Stop {
                    return intake.finish(file);
                }
            }
            left -= n;
        }
    }
    intake.finish(file)
}

/// What reads a column of a row group. Pages that the library has no pure decoder for are read as if they were not packed,
/// and unpacked on their way.
fn column_reader<R: ChunkReader + 'static>(
    bytes: &Arc<R>,
    group: &dyn RowGroupReader,
    i: usize,
    column: &ColumnDescPtr,
) -> Result<ColumnReader, RecordingFault> {
    let chunk = group.metadata().column(i);
    let packing = match chunk.compression() {
        Compression::ZSTD(_) => CompressionMethod::Zstd,
        Compression::BROTLI(_) => CompressionMethod::Brotli,
        _ => return group.get_column_reader(i).map_err(parquet_fault),
    };
    let as_stored = chunk
        .clone()
        .into_builder()
        .set_compression(Compression::UNCOMPRESSED)
        .build()
        .map_err(parquet_fault)?;
    let rows = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
    let pages =
        SerializedPageReader::new(bytes.clone(), &as_stored, rows, None).map_err(parquet_fault)?;
    let pages = UnpackedPages { pages, packing };
    Ok(get_column_reader(column.clone(), Box::new(pages)))
}

/// Fails when pages of a row group would take more memory than there may be, before any is unpacked.
fn check_pages<R: ChunkReader>(
    bytes: &R,
    group: &RowGroupMetaData,
    wanted: &[bool],
) -> Result<(), RecordingFault> {
    let refused = |error: io::Error| parquet_fault(ParquetError::General(error.to_string()));
    let mut sum = 0;
    for (column, _) in group
        .columns()
        .iter()
        .zip(wanted)
        .filter(|(_, is_wanted)| **is_wanted)
    {
        let growth = match column.compression() {
            Compression::GZIP(_) => PageGrowth::Gzip,
            Compression::LZ4 => PageGrowth::OldLz4,
            _ => PageGrowth::Declared,
        };
        let start = column
            .dictionary_page_offset()
            .unwrap_or_else(|| column.data_page_offset());
        let (start, length) = (
            u64::try_from(start),
            u64::try_from(column.compressed_size()),
        );
        let (Ok(start), Ok(length)) = (start, length) else {
            return Err(refused(io::Error::other("a column has a negative place")));
        };
        let stream = bytes.get_read(start).map_err(parquet_fault)?;
        sum += parquet_pages::largest_page(stream, length, growth).map_err(refused)?;
    }
    // One page of every column is in memory at once.
    if sum > MOST_UNPACKED {
        return Err(refused(io::Error::other(
            "its pages would take too much memory",
        )));
    }
    Ok(())
}

/// A file of which the pages are looked at before they are read.
struct SharedChunkReader<R>(Arc<R>);

impl<R> Clone for SharedChunkReader<R> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

impl<R: Length> Length for SharedChunkReader<R> {
    fn len(&self) -> u64 {
        self.0.len()
    }
}

impl<R: ChunkReader> ChunkReader for SharedChunkReader<R> {
    type T = R::T;

    fn get_read(&self, start: u64) -> parquet::errors::Result<R::T> {
        self.0.get_read(start)
    }

    fn get_bytes(&self, start: u64, length: usize) -> parquet::errors::Result<bytes::Bytes> {
        self.0.get_bytes(start, length)
    }
}

/// The one table of a file.
fn tables_of(
    stream: SharedChunkReader<impl ChunkReader + 'static>,
) -> Result<Vec<TableInfo>, RecordingFault> {
    let reader = SerializedFileReader::new(stream.clone()).map_err(parquet_fault)?;
    let schema = reader.metadata().file_metadata().schema_descr_ptr();
    let info = |column: &ColumnDescPtr| ColumnInfo {
        name: column.path().string(),
        kind: kind_of(column),
    };
    let rows = reader.metadata().file_metadata().num_rows();
    let names = names(&reader);
    Ok(vec![TableInfo {
        name: String::new(),
        kind: String::new(),
        columns: schema.columns().iter().map(info).collect(),
        samples: usize::try_from(rows).unwrap_or(0),
        time: find_time_range(&names, |name| {
            read(stream, "", &ReadOptions::single_column(name)).ok()
        }),
        remark: None,
    }])
}

/// Type of a column, in the words of the others.
fn kind_of(column: &ColumnDescriptor) -> String {
    let kind = match (
        ParquetValueKind::from_column(column),
        column.physical_type(),
    ) {
        (ParquetValueKind::Ticks { .. }, _) | (_, Type::INT96) => "time",
        (ParquetValueKind::Decimal(_), _) => "decimal",
        (ParquetValueKind::Unusable, _) => "no number",
        (ParquetValueKind::Unsigned, Type::INT32) => "uint32",
        (ParquetValueKind::Unsigned, _) => "uint64",
        (ParquetValueKind::Numbers, Type::BOOLEAN) => "bool",
        (ParquetValueKind::Numbers, Type::INT32) => "int32",
        (ParquetValueKind::Numbers, Type::INT64) => "int64",
        (ParquetValueKind::Numbers, Type::FLOAT) => "float32",
        (ParquetValueKind::Numbers, _) => "float64",
    };
    kind.to_owned()
}

/// Names of the columns; those of nested ones hold points.
fn names_of(stream: impl ChunkReader + 'static) -> Result<Vec<String>, RecordingFault> {
    Ok(names(
        &SerializedFileReader::new(stream).map_err(parquet_fault)?,
    ))
}

fn names<R: ChunkReader + 'static>(reader: &SerializedFileReader<R>) -> Vec<String> {
    let schema = reader.metadata().file_metadata().schema_descr();
    let columns = schema.columns().iter();
    columns.map(|column| column.path().string()).collect()
}

/// What the numbers of a column mean.
enum ParquetValueKind {
    Numbers,
    /// Whole numbers without a sign, in all bits of what they are stored in.
    Unsigned,
    /// Whole numbers of this many to the second; the first one is zero once it is known.
    Ticks {
        per_second: f64,
        first: Option<i64>,
    },
    /// Whole numbers with so many decimals.
    Decimal(i32),
    Unusable,
}

impl ParquetValueKind {
    fn from_column(column: &ColumnDescriptor) -> Self {
        let ticks = |per_second| Self::Ticks {
            per_second,
            first: None,
        };
        // Texts are no numbers, and a few bytes may stand for very long ones.
        let is_text = matches!(
            column.physical_type(),
            Type::BYTE_ARRAY | Type::FIXED_LEN_BYTE_ARRAY
        );
        if column.max_rep_level() > 0 || is_text {
            return Self::Unusable;
        }
        match column.logical_type_ref() {
            Some(LogicalType::Timestamp(stamp)) => return ticks(per_second(stamp.unit)),
            Some(LogicalType::Time(time)) => return ticks(per_second(time.unit)),
            Some(LogicalType::Decimal(decimal)) => return Self::Decimal(decimal.scale),
            Some(LogicalType::Integer(whole)) if !whole.is_signed => return Self::Unsigned,
            _ => {}
        }
        match column.converted_type() {
            ConvertedType::TIMESTAMP_MILLIS | ConvertedType::TIME_MILLIS => ticks(1e3),
            ConvertedType::TIMESTAMP_MICROS | ConvertedType::TIME_MICROS => ticks(1e6),
            ConvertedType::DECIMAL => Self::Decimal(column.type_scale()),
            ConvertedType::UINT_8
            | ConvertedType::UINT_16
            | ConvertedType::UINT_32
            | ConvertedType::UINT_64 => Self::Unsigned,
            _ => Self::Numbers,
        }
    }

    /// A whole number in seconds or with its decimals.
    fn convert_integer(&mut self, value: i64) -> f64 {
        match self {
            // Differences of ticks within a recording are far below 2^53, where floats are exact.
            Self::Ticks { per_second, first } => {
                value.wrapping_sub(*first.get_or_insert(value)) as f64 / *per_second
            }
            Self::Decimal(scale) => value as f64 / 10.0_f64.powi(*scale),
            Self::Unsigned => value.cast_unsigned() as f64,
            Self::Numbers | Self::Unusable => value as f64,
        }
    }

    /// The same of a number that is stored in four bytes.
    fn convert_short_integer(&mut self, value: i32) -> f64 {
        match self {
            Self::Unsigned => f64::from(value.cast_unsigned()),
            _ => self.convert_integer(i64::from(value)),
        }
    }
}

fn per_second(unit: TimeUnit) -> f64 {
    match unit {
        TimeUnit::MILLIS => 1e3,
        TimeUnit::MICROS => 1e6,
        TimeUnit::NANOS => 1e9,
    }
}

/// The next `n` fields of a column.
fn read_batch(
    column: &mut ColumnReader,
    kind: &mut ParquetValueKind,
    n: usize,
) -> Result<Vec<SampleField>, RecordingFault> {
    match column {
        ColumnReader::BoolColumnReader(reader) => read_values(reader, n, |value| {
            SampleField::Number(f64::from(u8::from(*value)))
        }),
        ColumnReader::Int32ColumnReader(reader) => read_values(reader, n, |value| {
            SampleField::finite(kind.convert_short_integer(*value))
        }),
        ColumnReader::Int64ColumnReader(reader) => read_values(reader, n, |value| {
            SampleField::finite(kind.convert_integer(*value))
        }),
        ColumnReader::Int96ColumnReader(reader) => {
            let mut ticks = ParquetValueKind::Ticks {
                per_second: 1e9,
                first: match kind {
                    ParquetValueKind::Ticks { first, .. } => *first,
                    _ => None,
                },
            };
            let fields = read_values(reader, n, |value| {
                SampleField::finite(ticks.convert_integer(value.to_nanos()))
            });
            *kind = ticks;
            fields
        }
        ColumnReader::FloatColumnReader(reader) => {
            read_values(reader, n, |value| SampleField::finite(f64::from(*value)))
        }
        ColumnReader::DoubleColumnReader(reader) => {
            read_values(reader, n, |value| SampleField::finite(*value))
        }
        // Columns of texts are not read.
        ColumnReader::ByteArrayColumnReader(_) | ColumnReader::FixedLenByteArrayColumnReader(_) => {
            Ok(vec![SampleField::Text; n])
        }
    }
}

/// The next `n` values of a column, those that are null among them.
fn read_values<T: DataType>(
    reader: &mut ColumnReaderImpl<T>,
    n: usize,
    mut field: impl FnMut(&T::T) -> SampleField,
) -> Result<Vec<SampleField>, RecordingFault> {
    let mut fields = Vec::with_capacity(n);
    while fields.len() < n {
        let (mut levels, mut values) = (Vec::new(), Vec::new());
        let wanted = n - fields.len();
        let (records, n_values, n_levels) = reader
            .read_records(wanted, Some(&mut levels), None, &mut values)
            .map_err(parquet_fault)?;
        if records == 0 {
            return Err(RecordingFault::Format {
                format: "a Parquet file",
                message: "a column ends before the others do; write the file again".to_owned(),
            });
        }
        if n_values == records || n_levels == 0 {
            fields.extend(values.iter().map(&mut field));
            continue;
        }
        let most = levels.iter().copied().max().unwrap_or(0);
        let mut values = values.iter();
        fields.extend(levels.iter().map(|level| {
            // Fewer values than levels: the highest level is that of a value, unless all are null.
            if *level == most && n_values > 0 {
                values.next().map_or(SampleField::NotFinite, &mut field)
            } else {
                SampleField::NotFinite
            }
        }));
    }
    Ok(fields)
}

fn parquet_fault(error: ParquetError) -> RecordingFault {
    let says = match error {
        ParquetError::General(says) | ParquetError::NYI(says) | ParquetError::EOF(says) => says,
        other => other.to_string(),
    };
    RecordingFault::Format {
        format: "a Parquet file",
        message: format!(
            "it cannot be read: {says}; write it again, uncompressed or compressed by snappy, gzip, zstd, brotli or lz4"
        ),
    }
}
