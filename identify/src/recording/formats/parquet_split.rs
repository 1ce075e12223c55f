//! Pages of Parquet in the encoding BYTE_STREAM_SPLIT, whose first part has the first byte of every value, the second part
//! the second byte, and so on (apache/parquet-format, `Encodings.md`). They become plain pages.
//!
//! The library takes for granted that such a page has as many values as its levels state, and ends the program
//! otherwise. Of plain pages it counts the bytes.

use parquet::basic::{Encoding, Type};
use parquet::column::page::Page;
use parquet::errors::{ParquetError, Result};
use parquet::schema::types::ColumnDescriptor;

/// A page with plain values; pages in other encodings stay as they are.
///
/// Fails when the page is shorter than its levels, or ends within a value.
pub(super) fn join_streams(page: Page, column: &ColumnDescriptor) -> Result<Page> {
    if page.encoding() != Encoding::BYTE_STREAM_SPLIT {
        return Ok(page);
    }
    let width = match column.physical_type() {
        Type::INT32 | Type::FLOAT => 4,
        Type::INT64 | Type::DOUBLE => 8,
        Type::FIXED_LEN_BYTE_ARRAY => usize::try_from(column.type_length()).unwrap_or(0),
        _ => 0,
    };
    Ok(match page {
        Page::DataPage {
            buf,
            num_values,
            encoding: _,
            def_level_encoding,
            rep_level_encoding,
            statistics,
        } => {
            let repetition = length_of_levels(&buf, rep_level_encoding, column.max_rep_level(), num_values)?;
            let after = buf.get(repetition..).unwrap_or_default();
            let definition = length_of_levels(after, def_level_encoding, column.max_def_level(), num_values)?;
            Page::DataPage {
                buf: join(&buf, repetition.saturating_add(definition), width)?.into(),
                num_values,
                encoding: Encoding::PLAIN,
                def_level_encoding,
                rep_level_encoding,
                statistics,
            }
        }
        Page::DataPageV2 {
            buf,
            num_values,
            encoding: _,
            num_nulls,
            num_rows,
            def_levels_byte_len,
            rep_levels_byte_len,
            is_compressed,
            statistics,
        } => {
            let levels = u64::from(def_levels_byte_len) + u64::from(rep_levels_byte_len);
            let levels = usize::try_from(levels).unwrap_or(usize::MAX);
            Page::DataPageV2 {
                buf: join(&buf, levels, width)?.into(),
                num_values,
                encoding: Encoding::PLAIN,
                num_nulls,
                num_rows,
                def_levels_byte_len,
                rep_levels_byte_len,
                is_compressed,
                statistics,
            }
        }
        Page::DictionaryPage { .. } => return Err(fault("a dictionary is split by bytes")),
    })
}

/// Bytes of the levels at the beginning of an older page; none if there is one level only.
fn length_of_levels(bytes: &[u8], encoding: Encoding, most: i16, n_values: u32) -> Result<usize> {
    if most <= 0 {
        return Ok(0);
    }
    // Runs begin with their length in bytes; packed levels have a fixed number of bits.
    #[allow(deprecated, reason = "old files have this encoding")]
    let length = if encoding == Encoding::BIT_PACKED {
        let bits = u64::from(16 - most.leading_zeros());
        (bits * u64::from(n_values)).div_ceil(8)
    } else {
        let head = bytes
            .first_chunk()
            .ok_or_else(|| fault("a page is shorter than its levels"))?;
        4 + u64::from(u32::from_le_bytes(*head))
    };
    usize::try_from(length).map_err(|_| fault("a page is shorter than its levels"))
}

/// The bytes before a place, then those behind it value by value, each of `width` bytes.
fn join(bytes: &[u8], place: usize, width: usize) -> Result<Vec<u8>> {
    let (levels, values) = bytes
        .split_at_checked(place)
        .ok_or_else(|| fault("a page is shorter than its levels"))?;
    if width == 0 || !values.len().is_multiple_of(width) {
        return Err(fault("a page ends within a value"));
    }
    let n = values.len() / width;
    let mut joined = Vec::with_capacity(bytes.len());
    joined.extend(levels);
    joined.extend((0..n).flat_map(|value| (0..width).map(move |part| values[part * n + value])));
    Ok(joined)
}

/// A fault of the file.
fn fault(says: &str) -> ParquetError {
    ParquetError::General(says.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_become_values_behind_the_levels() {
        assert_eq!(join(&[9, 9, 1, 3, 5, 2, 4, 6], 2, 2).unwrap(), [9, 9, 1, 2, 3, 4, 5, 6]);
        assert_eq!(join(&[9], 1, 8).unwrap(), [9]);
        for (bytes, place, width) in [(&[1, 2, 3][..], 0, 2), (&[1], 2, 1), (&[1], 0, 0)] {
            assert!(join(bytes, place, width).is_err(), "{bytes:?}");
        }
        assert_eq!(length_of_levels(&[2, 0, 0, 0, 7, 7], Encoding::RLE, 1, 9).unwrap(), 6);
        assert_eq!(length_of_levels(&[], Encoding::RLE, 0, 9).unwrap(), 0);
        assert!(length_of_levels(&[2, 0], Encoding::RLE, 1, 9).is_err());
        #[allow(deprecated, reason = "old files have this encoding")]
        let packed = Encoding::BIT_PACKED;
        assert_eq!(length_of_levels(&[], packed, 3, 9).unwrap(), 3);
    }
}
