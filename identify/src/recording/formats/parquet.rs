//! Recordings as Parquet files: columns of numbers and times that are not repeated, read in batches of samples.
//!
//! Time stamps and times of day become seconds since the first one, exactly, before they are rounded to a float.

use std::io;
use std::sync::Arc;

use bytes::Bytes;
use parquet::basic::{Compression, ConvertedType, LogicalType, TimeUnit, Type};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl, get_column_reader};
use parquet::data_type::DataType;
use parquet::errors::ParquetError;
use parquet::file::metadata::RowGroupMetaData;
use parquet::file::reader::{ChunkReader, FileReader, Length, RowGroupReader, SerializedFileReader};
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

/// Most samples that are read at once.
const BATCH: usize = 8192;
/// Most fields of all columns that are kept at once.
const FIELDS: usize = 1 << 22;
/// Most bytes of pages that may be in memory at once.
const MOST_UNPACKED: u64 = 256 << 20;

/// The format of Apache Parquet.
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
        // A file on disk is read in parts; bytes and streams are in memory.
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
            RecordingInput::Bytes(bytes) => tables_of(SharedChunkReader(Arc::new(Bytes::copy_from_slice(bytes)))),
            RecordingInput::Stream(stream) => tables_of(SharedChunkReader(Arc::new(Bytes::from(read_all(stream)?)))),
        }
    }
}

/// Reads the columns that are needed.
fn read(
    stream: impl ChunkReader + 'static,
    file: &str,
    options: &ReadOptions,
) -> Result<SignalRecording, RecordingFault> {
    // The stream is shared between the checks of pages and the reader.
    let bytes = Arc::new(stream);
    let reader = SerializedFileReader::new(SharedChunkReader(bytes.clone())).map_err(parquet_fault)?;
    let schema = reader.metadata().file_metadata().schema_descr_ptr();
    let width = schema.num_columns();
    let mut intake = SampleIntake::new(names(&reader), options)?;
    // The meaning of the numbers in each column.
    let mut kinds: Vec<ParquetValueKind> = (0..width)
        .map(|i| ParquetValueKind::from_column(&schema.column(i)))
        .collect();
    // Columns of time stamps are reported, because their values change.
    for (i, kind) in kinds.iter().enumerate() {
        if intake.is_place_needed(i) && matches!(kind, ParquetValueKind::Ticks { .. }) {
            intake.note(RecordingNote::info(format!(
                "`{}` of {file} has time stamps: it is read as seconds since the first one.",
                schema.column(i).path().string()
            )));
        }
    }
    // Columns without numbers are not read, but reported as text if they are needed.
    let is_read = |i: usize| intake.is_place_needed(i) && !matches!(kinds[i], ParquetValueKind::Unusable);
    let wanted: Vec<bool> = (0..width).map(is_read).collect();
    // The size of a batch keeps the number of fields in memory small.
    let n_read = wanted.iter().filter(|is_read| **is_read).count();
    let most = (FIELDS / n_read.max(1)).clamp(1, BATCH);
    let mut sample = vec![SampleField::Number(0.0); width];
    let mut row = 0;
    // Each group of rows is checked before anything in it is decompressed.
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
        // Read a batch of every needed column, then pass its samples to the intake.
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
                // Fields of columns that are not read are zeros if they are not needed, otherwise text.
                for (i, field) in sample.iter_mut().enumerate() {
                    *field = match fields[i].get(k) {
                        Some(field) => *field,
                        // A column that is not needed.
                        None if columns[i].is_none() && !intake.is_place_needed(i) => SampleField::Number(0.0),
                        None => SampleField::Text,
                    };
                }
                // The text of a field for messages.
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

/// The reader of a column of a row group. For compressions without a decoder in the library, pages are read as if
/// they were uncompressed, and decompressed afterwards.
fn column_reader<R: ChunkReader + 'static>(
    bytes: &Arc<R>,
    group: &dyn RowGroupReader,
    i: usize,
    column: &ColumnDescPtr,
) -> Result<ColumnReader, RecordingFault> {
    let chunk = group.metadata().column(i);
    // The library decodes these two only with C code.
    let packing = match chunk.compression() {
        Compression::ZSTD(_) => CompressionMethod::Zstd,
        Compression::BROTLI(_) => CompressionMethod::Brotli,
        _ => return group.get_column_reader(i).map_err(parquet_fault),
    };
    // The copy of the metadata declares the pages as uncompressed.
    let as_stored = chunk
        .clone()
        .into_builder()
        .set_compression(Compression::UNCOMPRESSED)
        .build()
        .map_err(parquet_fault)?;
    let rows = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
    let pages = SerializedPageReader::new(bytes.clone(), &as_stored, rows, None).map_err(parquet_fault)?;
    let pages = UnpackedPages { pages, packing };
    Ok(get_column_reader(column.clone(), Box::new(pages)))
}

/// Fails when the pages of a row group would need too much memory. Nothing is decompressed for this, except gzip.
fn check_pages<R: ChunkReader>(bytes: &R, group: &RowGroupMetaData, wanted: &[bool]) -> Result<(), RecordingFault> {
    let refused = |error: io::Error| parquet_fault(ParquetError::General(error.to_string()));
    let mut sum = 0;
    // The largest pages of all needed columns are added.
    for (column, _) in group.columns().iter().zip(wanted).filter(|(_, is_wanted)| **is_wanted) {
        // The compression decides whether the declared size can be trusted.
        let growth = match column.compression() {
            Compression::GZIP(_) => PageGrowth::Gzip,
            Compression::LZ4 => PageGrowth::OldLz4,
            _ => PageGrowth::Declared,
        };
        // A dictionary page comes before the data pages.
        let start = column
            .dictionary_page_offset()
            .unwrap_or_else(|| column.data_page_offset());
        let (start, length) = (u64::try_from(start), u64::try_from(column.compressed_size()));
        let (Ok(start), Ok(length)) = (start, length) else {
            return Err(refused(io::Error::other("a column has a negative place")));
        };
        let stream = bytes.get_read(start).map_err(parquet_fault)?;
        sum += parquet_pages::largest_page(stream, length, growth).map_err(refused)?;
    }
    // One page of each column is in memory at the same time.
    if sum > MOST_UNPACKED {
        return Err(refused(io::Error::other("its pages would take too much memory")));
    }
    Ok(())
}

/// A stream that is shared by the checks of pages and the reader.
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

    // All methods are those of the stream.
    fn get_read(&self, start: u64) -> parquet::errors::Result<R::T> {
        self.0.get_read(start)
    }

    fn get_bytes(&self, start: u64, length: usize) -> parquet::errors::Result<bytes::Bytes> {
        self.0.get_bytes(start, length)
    }
}

/// The single table of a file.
fn tables_of(stream: SharedChunkReader<impl ChunkReader + 'static>) -> Result<Vec<TableInfo>, RecordingFault> {
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
        // The time column is read completely for its range.
        time: find_time_range(&names, |name| read(stream, "", &ReadOptions::single_column(name)).ok()),
        remark: None,
    }])
}

/// Type of a column, in the words that other formats use.
fn kind_of(column: &ColumnDescriptor) -> String {
    let kind = match (ParquetValueKind::from_column(column), column.physical_type()) {
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

/// Names of the columns; names of nested ones contain points.
fn names_of(stream: impl ChunkReader + 'static) -> Result<Vec<String>, RecordingFault> {
    Ok(names(&SerializedFileReader::new(stream).map_err(parquet_fault)?))
}

/// Names of the columns of an open file, by their paths.
fn names<R: ChunkReader + 'static>(reader: &SerializedFileReader<R>) -> Vec<String> {
    let schema = reader.metadata().file_metadata().schema_descr();
    let columns = schema.columns().iter();
    columns.map(|column| column.path().string()).collect()
}

/// The meaning of the numbers of a column.
enum ParquetValueKind {
    /// Numbers without a conversion.
    Numbers,
    /// Integers without a sign, which use all bits of their type.
    Unsigned,
    /// Times as integers; the first one becomes zero.
    Ticks {
        /// Ticks per second.
        per_second: f64,
        /// The first value, once it has been read.
        first: Option<i64>,
    },
    /// Integers with this many decimal places.
    Decimal(i32),
    /// Texts, lists, and anything else that is not a number.
    Unusable,
}

impl ParquetValueKind {
    /// The meaning from the types in the schema; the logical type takes precedence over the older converted type.
    fn from_column(column: &ColumnDescriptor) -> Self {
        let ticks = |per_second| Self::Ticks {
            per_second,
            first: None,
        };
        // Texts are not numbers, and a few bytes of a dictionary may expand to very long ones.
        let is_text = matches!(column.physical_type(), Type::BYTE_ARRAY | Type::FIXED_LEN_BYTE_ARRAY);
        // Repeated fields have no value per sample.
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
            ConvertedType::UINT_8 | ConvertedType::UINT_16 | ConvertedType::UINT_32 | ConvertedType::UINT_64 => {
                Self::Unsigned
            }
            _ => Self::Numbers,
        }
    }

    /// Converts an integer: ticks to seconds, decimals to their value.
    fn convert_integer(&mut self, value: i64) -> f64 {
        match self {
            // Differences of ticks in a recording are far below 2^53, so that floats are exact.
            Self::Ticks { per_second, first } => value.wrapping_sub(*first.get_or_insert(value)) as f64 / *per_second,
            Self::Decimal(scale) => value as f64 / 10.0_f64.powi(*scale),
            Self::Unsigned => value.cast_unsigned() as f64,
            Self::Numbers | Self::Unusable => value as f64,
        }
    }

    /// Converts an integer of four bytes.
    fn convert_short_integer(&mut self, value: i32) -> f64 {
        match self {
            // The sign bit belongs to the value, so it must be removed before the conversion.
            Self::Unsigned => f64::from(value.cast_unsigned()),
            _ => self.convert_integer(i64::from(value)),
        }
    }
}

/// Ticks per second of a unit.
fn per_second(unit: TimeUnit) -> f64 {
    match unit {
        TimeUnit::MILLIS => 1e3,
        TimeUnit::MICROS => 1e6,
        TimeUnit::NANOS => 1e9,
    }
}

/// Reads the next `n` fields of a column.
fn read_batch(
    column: &mut ColumnReader,
    kind: &mut ParquetValueKind,
    n: usize,
) -> Result<Vec<SampleField>, RecordingFault> {
    match column {
        ColumnReader::BoolColumnReader(reader) => {
            read_values(reader, n, |value| SampleField::Number(f64::from(u8::from(*value))))
        }
        ColumnReader::Int32ColumnReader(reader) => read_values(reader, n, |value| {
            SampleField::finite(kind.convert_short_integer(*value))
        }),
        ColumnReader::Int64ColumnReader(reader) => {
            read_values(reader, n, |value| SampleField::finite(kind.convert_integer(*value)))
        }
        // Times of 12 bytes are converted to nanoseconds.
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
            // The first value must be kept for the next batch.
            *kind = ticks;
            fields
        }
        ColumnReader::FloatColumnReader(reader) => {
            read_values(reader, n, |value| SampleField::finite(f64::from(*value)))
        }
        ColumnReader::DoubleColumnReader(reader) => read_values(reader, n, |value| SampleField::finite(*value)),
        // Columns of texts are never read.
        ColumnReader::ByteArrayColumnReader(_) | ColumnReader::FixedLenByteArrayColumnReader(_) => {
            Ok(vec![SampleField::Text; n])
        }
    }
}

/// Reads the next `n` values of a column, including nulls.
///
/// Fails when the column ends before the others.
fn read_values<T: DataType>(
    reader: &mut ColumnReaderImpl<T>,
    n: usize,
    mut field: impl FnMut(&T::T) -> SampleField,
) -> Result<Vec<SampleField>, RecordingFault> {
    let mut fields = Vec::with_capacity(n);
    // A call may return fewer records than requested.
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
        // Without nulls there is one value for each record.
        if n_values == records || n_levels == 0 {
            fields.extend(values.iter().map(&mut field));
            continue;
        }
        // Otherwise the definition levels state which records have a value.
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

/// The fault of a file that the library cannot read.
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
