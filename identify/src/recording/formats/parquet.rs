//! Recordings as Parquet files: columns of numbers and times, and lists of them, read in batches of samples.
//!
//! Time stamps and times of day become seconds since the first one, exactly, before they are rounded to a float.

use std::fs::File;
use std::io;
use std::sync::Arc;

use bytes::Bytes;
use parquet::basic::{Compression, Type};
use parquet::column::reader::{ColumnReader, get_column_reader};
use parquet::errors::ParquetError;
use parquet::file::metadata::RowGroupMetaData;
use parquet::file::reader::{ChunkReader, FileReader, Length, RowGroupReader, SerializedFileReader};
use parquet::file::serialized_reader::SerializedPageReader;
use parquet::schema::types::{ColumnDescPtr, ColumnDescriptor};

use crate::recording::column::SampleField;
use crate::recording::error::RecordingFault;
use crate::recording::formats::lerobot::{DataSetFiles, EPISODE, ElementNames, EpisodeClock};
use crate::recording::formats::packing::CompressionMethod;
use crate::recording::formats::parquet_columns::{ParquetColumns, ParquetLeaf};
use crate::recording::formats::parquet_pages::{self, OrderedPages, PageGrowth, UnpackedPages};
use crate::recording::formats::parquet_values::{BatchPlace, ParquetValueKind, read_batch};
use crate::recording::formats::{RecordingFormat, RecordingInput, TableInfo, read_all};
use crate::recording::intake::{IntakeFlow, SampleIntake};
use crate::recording::notes::RecordingNote;
use crate::recording::tables::{ColumnInfo, find_time_range};
use crate::recording::thresholds::EPISODE_GAP_STEPS;
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
            RecordingInput::File(stream) => read(&ParquetSource::single(stream), file, options),
            RecordingInput::DataSet(set) => read(&ParquetSource::data_set(set), file, options),
            RecordingInput::Bytes(bytes) => read(&ParquetSource::single(Bytes::copy_from_slice(bytes)), file, options),
            RecordingInput::Stream(stream) => {
                read(&ParquetSource::single(Bytes::from(read_all(stream)?)), file, options)
            }
        }
    }

    fn names(&self, input: RecordingInput<'_>) -> Result<Vec<String>, RecordingFault> {
        match input {
            RecordingInput::File(stream) => names_of(&ParquetSource::single(stream)),
            RecordingInput::DataSet(set) => names_of(&ParquetSource::data_set(set)),
            RecordingInput::Bytes(bytes) => names_of(&ParquetSource::single(Bytes::copy_from_slice(bytes))),
            RecordingInput::Stream(stream) => names_of(&ParquetSource::single(Bytes::from(read_all(stream)?))),
        }
    }

    fn tables(&self, input: RecordingInput<'_>) -> Result<Vec<TableInfo>, RecordingFault> {
        match input {
            RecordingInput::File(stream) => tables_of(&ParquetSource::single(stream)),
            RecordingInput::DataSet(set) => tables_of(&ParquetSource::data_set(set)),
            RecordingInput::Bytes(bytes) => tables_of(&ParquetSource::single(Bytes::copy_from_slice(bytes))),
            RecordingInput::Stream(stream) => tables_of(&ParquetSource::single(Bytes::from(read_all(stream)?))),
        }
    }
}

/// One file, or the files of a data set, which are opened and read one after another.
struct ParquetSource<'a, R> {
    /// Number of files, at least one.
    n_files: usize,
    /// Opens the file at a position.
    open_file: Box<dyn Fn(usize) -> Result<Arc<R>, RecordingFault> + 'a>,
    /// Names of elements of lists.
    elements: ElementNames,
}

/// An open file of a source.
struct OpenParquet<R: ChunkReader> {
    /// Its bytes.
    bytes: Arc<R>,
    /// Its reader.
    reader: SerializedFileReader<SharedChunkReader<R>>,
    /// Its columns.
    columns: ParquetColumns,
}

impl<'a, R: 'a> ParquetSource<'a, R> {
    /// A file on its own.
    fn single(stream: R) -> Self {
        let bytes = Arc::new(stream);
        Self {
            n_files: 1,
            open_file: Box::new(move |_| Ok(bytes.clone())),
            elements: ElementNames::default(),
        }
    }
}

impl<'a> ParquetSource<'a, File> {
    /// The files of a data set.
    fn data_set(set: &'a DataSetFiles) -> Self {
        Self {
            n_files: set.paths.len(),
            open_file: Box::new(|place| Ok(Arc::new(set.open_file(place)?))),
            elements: set.names.clone(),
        }
    }
}

impl<R: ChunkReader + 'static> ParquetSource<'_, R> {
    /// Opens the file at a position; it is closed when the result is dropped.
    fn open(&self, place: usize) -> Result<OpenParquet<R>, RecordingFault> {
        let bytes = (self.open_file)(place)?;
        let reader = SerializedFileReader::new(SharedChunkReader(bytes.clone())).map_err(parquet_fault)?;
        let columns = ParquetColumns::new(&bytes, &reader, &self.elements)?;
        Ok(OpenParquet { bytes, reader, columns })
    }
}

/// Reads the columns that are needed, from all files.
fn read<R: ChunkReader + 'static>(
    source: &ParquetSource<'_, R>,
    file: &str,
    options: &ReadOptions,
) -> Result<SignalRecording, RecordingFault> {
    let columns = source.open(0)?.columns;
    let names = columns.names.clone();
    let mut intake = SampleIntake::new(names.clone(), options)?;
    // Columns of time stamps are reported, because their values change.
    for leaf in &columns.leaves {
        if intake.is_place_needed(leaf.first) && matches!(leaf.kind, ParquetValueKind::Ticks { .. }) {
            intake.note(RecordingNote::info(format!(
                "`{}` of {file} has time stamps: it is read as seconds since the first one.",
                leaf.name
            )));
        }
    }
    let mut progress = ReadProgress {
        row: 0,
        episodes: EpisodeClock::new(&names),
        columns,
    };
    for k in 0..source.n_files {
        // The first stamps are kept over all files, so that their times have one zero.
        let opened = source.open(k)?;
        if opened.columns.names != names {
            return Err(RecordingFault::Format {
                format: "a data set of Parquet files",
                message: format!(
                    "file {} has other columns, or lists of another length, than the first one; read such files separately",
                    k + 1
                ),
            });
        }
        if progress.read_file(&opened, &mut intake)? == IntakeFlow::Stop {
            break;
        }
    }
    if let Some(clock) = progress.episodes.filter(|clock| clock.episodes > 1) {
        intake.note(RecordingNote::info(format!(
            "{file} has {} episodes: they are read one after another, with {EPISODE_GAP_STEPS} sample intervals between them.",
            clock.episodes
        )));
    }
    for leaf in &progress.columns.leaves {
        if let ParquetValueKind::Ticks {
            per_second,
            first: Some(first),
        } = leaf.kind
        {
            // Ticks are milliseconds, microseconds or nanoseconds.
            let nanoseconds = if per_second < 1e4 {
                1_000_000
            } else if per_second < 1e7 {
                1000
            } else {
                1
            };
            intake.set_zero(leaf.first, first.wrapping_mul(nanoseconds));
        }
    }
    intake.finish(file)
}

/// What was read so far.
struct ReadProgress {
    /// Number of samples.
    row: u64,
    /// The times of episodes, if there are any.
    episodes: Option<EpisodeClock>,
    /// The columns, with the first stamps of all files.
    columns: ParquetColumns,
}

impl ReadProgress {
    /// Reads the samples of a file.
    fn read_file<R: ChunkReader + 'static>(
        &mut self,
        file: &OpenParquet<R>,
        intake: &mut SampleIntake<'_>,
    ) -> Result<IntakeFlow, RecordingFault> {
        let OpenParquet { bytes, reader, .. } = file;
        // Leaves without numbers are not read, but reported as text if they are needed.
        let episode = self.episodes.as_ref().map(EpisodeClock::place);
        let is_needed = |leaf: &ParquetLeaf| {
            let mut places = leaf.first..leaf.first + leaf.width;
            places.any(|place| intake.is_place_needed(place) || episode == Some(place))
        };
        let is_read = |leaf: &ParquetLeaf| is_needed(leaf) && !matches!(leaf.kind, ParquetValueKind::Unusable);
        let wanted: Vec<bool> = self.columns.leaves.iter().map(is_read).collect();
        // The size of a batch keeps the number of fields in memory small.
        let leaves = self.columns.leaves.iter().zip(&wanted);
        let n_read: usize = leaves
            .filter(|(_, is_read)| **is_read)
            .map(|(leaf, _)| leaf.width)
            .sum();
        let most = (FIELDS / n_read.max(1)).clamp(1, BATCH);
        let schema = reader.metadata().file_metadata().schema_descr_ptr();
        // Each group of rows is checked before anything in it is decompressed.
        for group in 0..reader.num_row_groups() {
            check_pages(bytes.as_ref(), reader.metadata().row_group(group), &wanted)?;
            let group = reader.get_row_group(group).map_err(parquet_fault)?;
            let mut readers = Vec::new();
            for (i, is_read) in wanted.iter().enumerate() {
                readers.push(if *is_read {
                    Some(column_reader(bytes, &*group, i, &schema.column(i))?)
                } else {
                    None
                });
            }
            // Read a batch of every needed leaf, then pass its samples to the intake.
            let mut left = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
            while left > 0 {
                let n = left.min(most);
                let mut fields: Vec<Vec<SampleField>> = Vec::with_capacity(wanted.len());
                for (reader, leaf) in readers.iter_mut().zip(&mut self.columns.leaves) {
                    let place = BatchPlace {
                        name: &leaf.name,
                        row: self.row,
                        list: leaf.list,
                    };
                    fields.push(match reader {
                        Some(reader) => read_batch(reader, &mut leaf.kind, n, place)?,
                        None => Vec::new(),
                    });
                }
                if self.take_batch(n, &fields, intake)? == IntakeFlow::Stop {
                    return Ok(IntakeFlow::Stop);
                }
                left -= n;
            }
        }
        Ok(IntakeFlow::Go)
    }

    /// Passes the next `n` samples to the intake; `fields` has those of each leaf, or none if it is not read.
    fn take_batch(
        &mut self,
        n: usize,
        fields: &[Vec<SampleField>],
        intake: &mut SampleIntake<'_>,
    ) -> Result<IntakeFlow, RecordingFault> {
        let mut sample = vec![SampleField::Number(0.0); self.columns.names.len()];
        for k in 0..n {
            self.row += 1;
            for (leaf, fields) in self.columns.leaves.iter().zip(fields) {
                for j in 0..leaf.width {
                    let place = leaf.first + j;
                    // Fields that are not read are zeros if they are not needed, otherwise text.
                    sample[place] = match fields.get(k * leaf.width + j) {
                        Some(field) => *field,
                        None if intake.is_place_needed(place) => SampleField::Text,
                        None => SampleField::Number(0.0),
                    };
                }
            }
            if let Some(clock) = &mut self.episodes
                && clock.shift_sample(&mut sample)
            {
                intake.skip_samples(EPISODE_GAP_STEPS);
            }
            // The text of a field for messages.
            let text = |i: usize| match sample[i] {
                SampleField::Text => "a value of another type".to_owned(),
                _ => "null or NaN".to_owned(),
            };
            if intake.take_sample(self.row, &sample, &text)? == IntakeFlow::Stop {
                return Ok(IntakeFlow::Stop);
            }
        }
        Ok(IntakeFlow::Go)
    }
}

/// The reader of a column of a row group. For compressions without a decoder in the library, pages are read as if
/// they were uncompressed, and decompressed afterwards.
pub(super) fn column_reader<R: ChunkReader + 'static>(
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
        _ => {
            let pages = OrderedPages::new(group.get_column_page_reader(i).map_err(parquet_fault)?, column);
            return Ok(get_column_reader(column.clone(), Box::new(pages)));
        }
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
    let pages = OrderedPages::new(Box::new(UnpackedPages { pages, packing }), column);
    Ok(get_column_reader(column.clone(), Box::new(pages)))
}

/// Fails when the pages of a row group would need too much memory. Nothing is decompressed for this, except gzip.
pub(super) fn check_pages<R: ChunkReader>(
    bytes: &R,
    group: &RowGroupMetaData,
    wanted: &[bool],
) -> Result<(), RecordingFault> {
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
pub(super) struct SharedChunkReader<R>(Arc<R>);

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

/// The single table of a file or of a data set.
fn tables_of<R: ChunkReader + 'static>(source: &ParquetSource<'_, R>) -> Result<Vec<TableInfo>, RecordingFault> {
    let OpenParquet { reader, columns, .. } = source.open(0)?;
    let schema = reader.metadata().file_metadata().schema_descr_ptr();
    let mut infos = Vec::new();
    for (leaf, column) in columns.leaves.iter().zip(schema.columns()) {
        let kind = if matches!(leaf.kind, ParquetValueKind::Unusable) {
            "no number".to_owned()
        } else {
            kind_of(column)
        };
        infos.extend(
            columns.names[leaf.first..leaf.first + leaf.width]
                .iter()
                .map(|name| ColumnInfo {
                    name: name.clone(),
                    kind: kind.clone(),
                }),
        );
    }
    drop(reader);
    let mut samples = 0;
    for k in 0..source.n_files {
        let rows = source.open(k)?.reader.metadata().file_metadata().num_rows();
        samples += usize::try_from(rows).unwrap_or(0);
    }
    // The time column is read completely for its range.
    let read_one = |name: &str| read(source, "", &ReadOptions::single_column(name)).ok();
    let episodes = if columns.names.iter().any(|name| name == EPISODE) {
        read_one(EPISODE).and_then(|recording| count_changes(recording.column(EPISODE).ok()?))
    } else {
        None
    };
    let several = episodes.filter(|n| *n > 1);
    Ok(vec![TableInfo {
        name: String::new(),
        kind: String::new(),
        columns: infos,
        samples,
        // Each episode has times of its own.
        time: if several.is_some() {
            None
        } else {
            find_time_range(&columns.names, read_one)
        },
        remark: several.map(|n| format!("it has {n} episodes, each with times of its own")),
    }])
}

/// Number of runs of equal values; `None` without any.
fn count_changes(values: &[f64]) -> Option<usize> {
    values.first()?;
    Some(
        1 + values
            .windows(2)
            .filter(|pair| pair[0].total_cmp(&pair[1]).is_ne())
            .count(),
    )
}

/// Type of a column, in the words that other formats use.
fn kind_of(column: &ColumnDescriptor) -> String {
    let kind = match (ParquetValueKind::from_column(column), column.physical_type()) {
        (ParquetValueKind::Ticks { .. }, _) | (_, Type::INT96) => "time",
        (ParquetValueKind::Decimal(_), _) => "decimal",
        (ParquetValueKind::HalfFloats, _) => "float16",
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
fn names_of<R: ChunkReader + 'static>(source: &ParquetSource<'_, R>) -> Result<Vec<String>, RecordingFault> {
    Ok(source.open(0)?.columns.names)
}

/// The fault of a file that the library cannot read.
pub(super) fn parquet_fault(error: ParquetError) -> RecordingFault {
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
