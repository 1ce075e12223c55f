//! The values in columns of a Parquet file: typed numbers, times, decimals and lists of them become fields of samples.

use parquet::basic::{ConvertedType, LogicalType, TimeUnit, Type};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::DataType;
use parquet::schema::types::ColumnDescriptor;

use crate::recording::column::SampleField;
use crate::recording::error::RecordingFault;
use crate::recording::formats::parquet::parquet_fault;
use crate::recording::half::decode_half;

/// The meaning of the numbers of a column.
pub(super) enum ParquetValueKind {
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
    /// Half floats, stored as two bytes.
    HalfFloats,
    /// Texts, lists, and anything else that is not a number.
    Unusable,
}

impl ParquetValueKind {
    /// The meaning from the types in the schema; the logical type takes precedence over the older converted type.
    pub(super) fn from_column(column: &ColumnDescriptor) -> Self {
        let ticks = |per_second| Self::Ticks {
            per_second,
            first: None,
        };
        // Half floats have a type of two bytes in the schema.
        if column.max_rep_level() <= 1
            && column.physical_type() == Type::FIXED_LEN_BYTE_ARRAY
            && column.type_length() == 2
            && matches!(column.logical_type_ref(), Some(LogicalType::Float16))
        {
            return Self::HalfFloats;
        }
        // Texts are not numbers, and a few bytes of a dictionary may expand to very long ones.
        let is_text = matches!(column.physical_type(), Type::BYTE_ARRAY | Type::FIXED_LEN_BYTE_ARRAY);
        // Lists of lists have no fixed place for their numbers.
        if column.max_rep_level() > 1 || is_text {
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
            Self::Numbers | Self::HalfFloats | Self::Unusable => value as f64,
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

/// The lists in a column: one for each sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ListShape {
    /// Number of elements that become columns.
    pub(super) width: usize,
    /// Least definition level of an element, also of one that is null.
    pub(super) element_level: i16,
    /// Definition level of a value.
    pub(super) value_level: i16,
}

/// Where the numbers of a column stand.
#[derive(Clone, Copy, Debug)]
pub(super) struct BatchPlace<'a> {
    /// Name of the column, for messages.
    pub(super) name: &'a str,
    /// Samples before those that are read.
    pub(super) row: u64,
    /// The lists, if the column has lists.
    pub(super) list: Option<ListShape>,
}

/// Reads the fields of the next `n` samples of a column: one for each, or as many as its lists are wide.
pub(super) fn read_batch(
    column: &mut ColumnReader,
    kind: &mut ParquetValueKind,
    n: usize,
    place: BatchPlace<'_>,
) -> Result<Vec<SampleField>, RecordingFault> {
    match column {
        ColumnReader::BoolColumnReader(reader) => read_values(reader, n, place, |value| {
            SampleField::Number(f64::from(u8::from(*value)))
        }),
        ColumnReader::Int32ColumnReader(reader) => read_values(reader, n, place, |value| {
            SampleField::finite(kind.convert_short_integer(*value))
        }),
        ColumnReader::Int64ColumnReader(reader) => read_values(reader, n, place, |value| {
            SampleField::finite(kind.convert_integer(*value))
        }),
        // Times of 12 bytes are converted to nanoseconds.
        ColumnReader::Int96ColumnReader(reader) => {
            let mut ticks = ParquetValueKind::Ticks {
                per_second: 1e9,
                first: match kind {
                    ParquetValueKind::Ticks { first, .. } => *first,
                    _ => None,
                },
            };
            let fields = read_values(reader, n, place, |value| {
                SampleField::finite(ticks.convert_integer(value.to_nanos()))
            });
            // The first value must be kept for the next batch.
            *kind = ticks;
            fields
        }
        ColumnReader::FloatColumnReader(reader) => {
            read_values(reader, n, place, |value| SampleField::finite(f64::from(*value)))
        }
        ColumnReader::DoubleColumnReader(reader) => read_values(reader, n, place, |value| SampleField::finite(*value)),
        ColumnReader::FixedLenByteArrayColumnReader(reader) if matches!(kind, ParquetValueKind::HalfFloats) => {
            read_values(reader, n, place, |value| match value.data() {
                [low, high] => SampleField::finite(decode_half(u16::from_le_bytes([*low, *high]))),
                _ => SampleField::Text,
            })
        }
        // Columns of texts are never read.
        ColumnReader::ByteArrayColumnReader(_) | ColumnReader::FixedLenByteArrayColumnReader(_) => {
            Ok(vec![SampleField::Text; n * place.list.map_or(1, |list| list.width)])
        }
    }
}

/// Reads the values of the next `n` samples of a column, including nulls.
///
/// Fails when the column ends before the others, or when a list is longer than the first ones.
fn read_values<T: DataType>(
    reader: &mut ColumnReaderImpl<T>,
    n: usize,
    place: BatchPlace<'_>,
    mut field: impl FnMut(&T::T) -> SampleField,
) -> Result<Vec<SampleField>, RecordingFault> {
    if let Some(list) = place.list {
        return read_lists(reader, n, place, list, field);
    }
    let mut fields = Vec::with_capacity(n);
    // A call may return fewer records than requested.
    while fields.len() < n {
        let (mut levels, mut values) = (Vec::new(), Vec::new());
        let wanted = n - fields.len();
        let (records, n_values, n_levels) = reader
            .read_records(wanted, Some(&mut levels), None, &mut values)
            .map_err(parquet_fault)?;
        if records == 0 {
            return Err(short_column_fault(place));
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

/// Reads the lists of the next `n` samples; elements that a list lacks count as missing.
fn read_lists<T: DataType>(
    reader: &mut ColumnReaderImpl<T>,
    n: usize,
    place: BatchPlace<'_>,
    list: ListShape,
    mut field: impl FnMut(&T::T) -> SampleField,
) -> Result<Vec<SampleField>, RecordingFault> {
    let mut fields = vec![SampleField::NotFinite; n * list.width];
    let mut done = 0;
    while done < n {
        let (mut defined, mut repeated, mut values) = (Vec::new(), Vec::new(), Vec::new());
        let (records, _, _) = reader
            .read_records(n - done, Some(&mut defined), Some(&mut repeated), &mut values)
            .map_err(parquet_fault)?;
        if records == 0 {
            return Err(short_column_fault(place));
        }
        let mut values = values.iter();
        // The sample and the element of the next level; a repetition level of zero begins a sample.
        let (mut sample, mut element) = (done, 0);
        for (k, (defined, repeated)) in defined.iter().zip(&repeated).enumerate() {
            if *repeated == 0 {
                sample = if k == 0 { done } else { sample + 1 };
                element = 0;
            }
            // An empty list or none at all has a level, but no element.
            if *defined < list.element_level {
                continue;
            }
            if element >= list.width {
                return Err(RecordingFault::Format {
                    format: "a Parquet file",
                    message: format!(
                        "the list of `{}` in row {} has more than the {} elements of the lists before it; write lists of one \
                         length",
                        place.name,
                        place.row + sample as u64 + 1,
                        list.width
                    ),
                });
            }
            if *defined == list.value_level
                && let (Some(value), Some(slot)) = (values.next(), fields.get_mut(sample * list.width + element))
            {
                *slot = field(value);
            }
            element += 1;
        }
        done += records;
    }
    Ok(fields)
}

/// Number of elements of the longest list among the next `n` samples of a column.
pub(super) fn longest_list(column: &mut ColumnReader, n: usize, element_level: i16) -> Result<usize, RecordingFault> {
    /// Levels of the next samples of a typed column.
    fn levels<T: DataType>(reader: &mut ColumnReaderImpl<T>, n: usize) -> Result<(Vec<i16>, Vec<i16>), RecordingFault> {
        let (mut defined, mut repeated) = (Vec::new(), Vec::new());
        let read = reader.read_records(n, Some(&mut defined), Some(&mut repeated), &mut Vec::new());
        read.map_err(parquet_fault)?;
        Ok((defined, repeated))
    }
    let (defined, repeated) = match column {
        ColumnReader::BoolColumnReader(reader) => levels(reader, n)?,
        ColumnReader::Int32ColumnReader(reader) => levels(reader, n)?,
        ColumnReader::Int64ColumnReader(reader) => levels(reader, n)?,
        ColumnReader::Int96ColumnReader(reader) => levels(reader, n)?,
        ColumnReader::FloatColumnReader(reader) => levels(reader, n)?,
        ColumnReader::DoubleColumnReader(reader) => levels(reader, n)?,
        // Half floats; other columns of bytes are never read.
        ColumnReader::FixedLenByteArrayColumnReader(reader) => levels(reader, n)?,
        ColumnReader::ByteArrayColumnReader(_) => return Ok(0),
    };
    let (mut longest, mut length) = (0, 0);
    for (defined, repeated) in defined.iter().zip(&repeated) {
        if *repeated == 0 {
            length = 0;
        }
        length += usize::from(*defined >= element_level);
        longest = longest.max(length);
    }
    Ok(longest)
}

/// The fault of a column with fewer samples than the others.
fn short_column_fault(place: BatchPlace<'_>) -> RecordingFault {
    RecordingFault::Format {
        format: "a Parquet file",
        message: format!(
            "the column `{}` ends before the others do; write the file again",
            place.name
        ),
    }
}
