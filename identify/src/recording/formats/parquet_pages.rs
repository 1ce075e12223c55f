//! Pages of a Parquet file: checked before decompression, and decompressed if the library has no decoder without C.
//!
//! Only their headers state how large they become, and the library relies on that.
//!
//! The pages of a column follow each other, each with a header in Thrift's compact protocol (apache/parquet-format,
//! `parquet.thrift`, struct `PageHeader`). Only the few numbers that state a size are read from it.

use std::io::{self, BufReader, Read};

use flate2::read::MultiGzDecoder;
use parquet::basic::Encoding;
use parquet::column::page::{Page, PageMetadata, PageReader};
use parquet::errors::{ParquetError, Result};
use parquet::schema::types::ColumnDescPtr;

use crate::recording::formats::packing::CompressionMethod;
use crate::recording::formats::parquet_split::join_streams;

/// Largest page after decompression in bytes; writers usually make pages of one million.
const LARGEST_PAGE: u64 = 128 << 20;
/// Largest page in the old form of LZ4, in bytes as stored. It may grow 255 times before its size is compared with
/// that in the header.
const LARGEST_OLD_LZ4: u64 = 2 << 20;
/// Number of different half floats, which is the largest size of their dictionary. Each takes more memory than bytes.
const MOST_HALVES: u64 = 1 << 16;
/// Deepest nesting of structures in a header; Parquet has four levels.
const DEEPEST: usize = 16;

/// How the size of pages is limited during decompression.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PageGrowth {
    /// By the size in the header, which the decoder respects.
    Declared,
    /// By nothing but the contents.
    Gzip,
    /// By a factor of 255.
    OldLz4,
}

/// Reads the page headers of a column of `length` bytes; returns the largest size after decompression, in bytes.
///
/// Fails when a page is too large, or larger than its header states.
pub(super) fn largest_page(stream: impl Read, length: u64, growth: PageGrowth) -> io::Result<u64> {
    let mut stream = BufReader::with_capacity(1 << 16, stream.take(length)).take(length);
    let mut largest = 0;
    while stream.limit() > 0 {
        let page = PageSizes::read(&mut stream)?;
        // Sizes are checked before the contents are skipped or decompressed.
        if page.packed > stream.limit() {
            return Err(io::Error::other("a page is longer than its column"));
        }
        // A number of a dictionary has four bytes at least; only half floats have two, and not many different values.
        let bytes_of_word = if page.words <= MOST_HALVES { 2 } else { 4 };
        let is_too_large = page.unpacked > LARGEST_PAGE
            || page.words.saturating_mul(bytes_of_word) > page.unpacked
            || (growth == PageGrowth::OldLz4 && page.packed > LARGEST_OLD_LZ4);
        if is_too_large {
            return Err(io::Error::other("a page would take too much memory"));
        }
        let mut body = (&mut stream).take(page.packed);
        // gzip does not limit its output, so it is decompressed once and counted.
        if growth == PageGrowth::Gzip && page.is_packed {
            io::copy(&mut (&mut body).take(page.levels), &mut io::sink())?;
            let inside = page.unpacked.saturating_sub(page.levels);
            let mut all = MultiGzDecoder::new(&mut body).take(inside + 1);
            if io::copy(&mut all, &mut io::sink())? > inside {
                return Err(io::Error::other("a page is larger than its header states"));
            }
        }
        // Skip to the next header.
        io::copy(&mut body, &mut io::sink())?;
        largest = largest.max(page.unpacked);
    }
    Ok(largest)
}

/// The pages of a column, which the library reads as stored and which are decompressed here.
pub(super) struct UnpackedPages<P> {
    /// The pages as stored.
    pub(super) pages: P,
    /// The compression of the column.
    pub(super) packing: CompressionMethod,
}

impl<P: PageReader> UnpackedPages<P> {
    /// Decompresses a page; its other fields stay unchanged.
    fn decompress_page(&self, page: Page) -> Result<Page> {
        let unpack = |packed: &[u8]| {
            let unpacked = self.packing.decompress(packed, LARGEST_PAGE);
            unpacked.map_err(|error| ParquetError::General(error.to_string()))
        };
        Ok(match page {
            Page::DataPage {
                buf,
                num_values,
                encoding,
                def_level_encoding,
                rep_level_encoding,
                statistics,
            } => Page::DataPage {
                buf: unpack(&buf)?.into(),
                num_values,
                encoding,
                def_level_encoding,
                rep_level_encoding,
                statistics,
            },
            Page::DictionaryPage {
                buf,
                num_values,
                encoding,
                is_sorted,
            } => Page::DictionaryPage {
                buf: unpack(&buf)?.into(),
                num_values,
                encoding,
                is_sorted,
            },
            Page::DataPageV2 {
                buf,
                num_values,
                encoding,
                num_nulls,
                num_rows,
                def_levels_byte_len,
                rep_levels_byte_len,
                is_compressed,
                statistics,
            } => {
                // Levels come first and are never compressed.
                let levels = u64::from(def_levels_byte_len) + u64::from(rep_levels_byte_len);
                let levels = usize::try_from(levels).unwrap_or(usize::MAX);
                let Some((levels, values)) = buf.split_at_checked(levels) else {
                    return Err(ParquetError::General("a page is shorter than its levels".to_owned()));
                };
                let buf = if is_compressed && !values.is_empty() {
                    [levels, &unpack(values)?].concat().into()
                } else {
                    buf
                };
                Page::DataPageV2 {
                    buf,
                    num_values,
                    encoding,
                    num_nulls,
                    num_rows,
                    def_levels_byte_len,
                    rep_levels_byte_len,
                    is_compressed: false,
                    statistics,
                }
            }
        })
    }
}

impl<P: PageReader> Iterator for UnpackedPages<P> {
    type Item = Result<Page>;

    fn next(&mut self) -> Option<Self::Item> {
        self.get_next_page().transpose()
    }
}

impl<P: PageReader> PageReader for UnpackedPages<P> {
    fn get_next_page(&mut self) -> Result<Option<Page>> {
        let page = self.pages.get_next_page()?;
        page.map(|page| self.decompress_page(page)).transpose()
    }

    fn peek_next_page(&mut self) -> Result<Option<PageMetadata>> {
        self.pages.peek_next_page()
    }

    fn skip_next_page(&mut self) -> Result<()> {
        self.pages.skip_next_page()
    }
}

/// The pages of a column, whose values may refer to a dictionary only behind one, and which have as many values as their
/// levels state. The library takes that for granted, and ends the program otherwise.
pub(super) struct OrderedPages {
    /// The pages.
    pages: Box<dyn PageReader>,
    /// The column.
    column: ColumnDescPtr,
    /// Whether a dictionary was passed on.
    has_dictionary: bool,
}

impl OrderedPages {
    /// Checks the order of these pages.
    pub(super) fn new(pages: Box<dyn PageReader>, column: &ColumnDescPtr) -> Self {
        Self {
            pages,
            column: column.clone(),
            has_dictionary: false,
        }
    }
}

impl Iterator for OrderedPages {
    type Item = Result<Page>;

    fn next(&mut self) -> Option<Self::Item> {
        self.get_next_page().transpose()
    }
}

impl PageReader for OrderedPages {
    fn get_next_page(&mut self) -> Result<Option<Page>> {
        let page = self.pages.get_next_page()?;
        if let Some(page) = &page {
            let needs_dictionary = matches!(page.encoding(), Encoding::PLAIN_DICTIONARY | Encoding::RLE_DICTIONARY);
            if page.is_dictionary_page() {
                self.has_dictionary = true;
            } else if needs_dictionary && !self.has_dictionary {
                return Err(ParquetError::General(
                    "a page refers to a dictionary that its column does not have".to_owned(),
                ));
            }
        }
        page.map(|page| join_streams(page, &self.column)).transpose()
    }

    fn peek_next_page(&mut self) -> Result<Option<PageMetadata>> {
        self.pages.peek_next_page()
    }

    fn skip_next_page(&mut self) -> Result<()> {
        self.pages.skip_next_page()
    }
}

/// The sizes in a page header.
#[derive(Debug, Default)]
struct PageSizes {
    /// Bytes as stored.
    packed: u64,
    /// Bytes after decompression.
    unpacked: u64,
    /// Number of values in a dictionary.
    words: u64,
    /// Bytes of levels at the beginning, which are never compressed.
    levels: u64,
    /// Whether the values are compressed; the older page header has no such field.
    is_packed: bool,
}

impl PageSizes {
    /// Reads a header; the numbers of fields are those of `parquet.thrift`.
    fn read(stream: &mut impl Read) -> io::Result<Self> {
        let mut page = Self {
            is_packed: true,
            ..Self::default()
        };
        let mut is_negative = false;
        read_fields(stream, &mut Vec::new(), &mut |path, value| {
            let size = || value.and_then(|n| u64::try_from(n).ok());
            // Sizes of the page, number of dictionary values, sizes of levels, flag of compression.
            match path {
                [2] => page.unpacked = size().unwrap_or(u64::MAX),
                [3] => page.packed = size().unwrap_or(u64::MAX),
                [7, 1] => page.words = size().unwrap_or(u64::MAX),
                [8, 5 | 6] => match size() {
                    Some(n) => page.levels = page.levels.saturating_add(n),
                    None => is_negative = true,
                },
                [8, 7] => page.is_packed = value.is_some(),
                _ => {}
            }
        })?;
        if is_negative {
            return Err(io::Error::other("a page has a negative size"));
        }
        Ok(page)
    }
}

/// Types of values in Thrift's compact protocol.
const TRUE: u8 = 1;
const FALSE: u8 = 2;
const BYTE: u8 = 3;
const DOUBLE: u8 = 7;
const BINARY: u8 = 8;
const LIST: u8 = 9;
const SET: u8 = 10;
const STRUCT: u8 = 12;

/// Reads a structure. `visit` receives every integer and every boolean with the path of its field numbers; a false
/// boolean has no value.
fn read_fields(
    stream: &mut dyn Read,
    path: &mut Vec<i64>,
    visit: &mut dyn FnMut(&[i64], Option<i64>),
) -> io::Result<()> {
    if path.len() > DEEPEST {
        return Err(io::Error::other("a page's header has no end"));
    }
    let mut field = 0_i64;
    loop {
        // A header byte of zero ends the structure.
        let head = byte(stream)?;
        if head == 0 {
            return Ok(());
        }
        // The field number is a difference to the last one, or follows as a number.
        field = match head >> 4 {
            0 => decode_zigzag(varint(stream)?),
            step => field.wrapping_add(i64::from(step)),
        };
        path.push(field);
        // Integers and booleans are passed on, structures are read, all others are skipped.
        match head & 15 {
            TRUE => visit(path, Some(1)),
            FALSE => visit(path, None),
            4..=6 => {
                let number = decode_zigzag(varint(stream)?);
                visit(path, Some(number));
            }
            STRUCT => read_fields(stream, path, visit)?,
            kind => skip_value(stream, kind, path)?,
        }
        path.pop();
    }
}

/// Skips a value that is not needed.
fn skip_value(stream: &mut dyn Read, kind: u8, path: &mut Vec<i64>) -> io::Result<()> {
    match kind {
        // In a list a boolean is one byte.
        TRUE | FALSE | BYTE => skip(stream, 1),
        4..=6 => varint(stream).map(drop),
        DOUBLE => skip(stream, 8),
        BINARY => {
            let length = varint(stream)?;
            skip(stream, length)
        }
        // The length of a list is in its first byte, or follows if it is 15 or more.
        LIST | SET if path.len() <= DEEPEST => {
            path.push(0);
            let head = byte(stream)?;
            let n = match head >> 4 {
                15 => varint(stream)?,
                n => u64::from(n),
            };
            for _ in 0..n {
                skip_value(stream, head & 15, path)?;
            }
            path.pop();
            Ok(())
        }
        STRUCT => read_fields(stream, path, &mut |_, _| {}),
        _ => Err(io::Error::other("a page's header cannot be read")),
    }
}

/// Skips `n` bytes; fails when there are fewer.
fn skip(stream: &mut dyn Read, n: u64) -> io::Result<()> {
    if io::copy(&mut stream.take(n), &mut io::sink())? < n {
        return Err(io::ErrorKind::UnexpectedEof.into());
    }
    Ok(())
}

/// The next byte.
fn byte(stream: &mut dyn Read) -> io::Result<u8> {
    let mut one = [0];
    stream.read_exact(&mut one)?;
    Ok(one[0])
}

/// The next number of variable length: seven bits per byte, the lowest first.
fn varint(stream: &mut dyn Read) -> io::Result<u64> {
    let mut value = 0;
    for shift in (0..64).step_by(7) {
        let one = byte(stream)?;
        value |= u64::from(one & 0x7f) << shift;
        if one & 0x80 == 0 {
            return Ok(value);
        }
    }
    Err(io::Error::other("a number in a page's header has no end"))
}

/// Decodes a signed number, whose sign is in the lowest bit.
fn decode_zigzag(value: u64) -> i64 {
    (value >> 1).cast_signed() ^ -(value & 1).cast_signed()
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use flate2::Compression;
    use flate2::write::GzEncoder;

    use super::*;

    /// A small whole number as the protocol writes it.
    fn whole(n: usize) -> Vec<u8> {
        let mut left = 2 * n;
        let mut bytes = Vec::new();
        while left > 127 {
            bytes.push(u8::try_from(left % 128).unwrap() | 128);
            left /= 128;
        }
        bytes.push(u8::try_from(left).unwrap());
        bytes
    }

    /// A page of data with its header: sizes, then how many values in which encodings.
    fn page(unpacked: usize, body: &[u8]) -> Vec<u8> {
        let mut bytes = vec![0x15, 0, 0x15];
        bytes.extend(whole(unpacked));
        bytes.push(0x15);
        bytes.extend(whole(body.len()));
        bytes.extend([0x2c, 0x15, 2, 0x15, 0, 0x15, 6, 0x15, 6, 0, 0]);
        bytes.extend(body);
        bytes
    }

    fn gzip(n: usize) -> Vec<u8> {
        let mut packed = GzEncoder::new(Vec::new(), Compression::fast());
        packed.write_all(&vec![0; n]).unwrap();
        packed.finish().unwrap()
    }

    fn look(bytes: &[u8], growth: PageGrowth) -> Result<u64, String> {
        largest_page(bytes, bytes.len() as u64, growth).map_err(|error| error.to_string())
    }

    #[test]
    fn honest_pages_tell_the_largest() {
        let two = [page(5, b"abcde"), page(300, b"xyz")].concat();
        assert_eq!(look(&two, PageGrowth::Declared), Ok(300));
        let three = [page(70_000, &gzip(70_000)), page(9, &gzip(9))].concat();
        assert_eq!(look(&three, PageGrowth::Gzip), Ok(70_000));
        // The second form has its levels unpacked in front, and may leave all unpacked.
        let mut second = vec![0x15, 6, 0x15];
        second.extend(whole(6));
        second.push(0x15);
        second.extend(whole(6));
        second.extend([0x5c, 0x15, 2, 0x15, 0, 0x15, 2, 0x15, 0, 0x15, 4, 0x15, 0, 0x12, 0, 0]);
        second.extend(b"llabcd");
        assert_eq!(look(&second, PageGrowth::Gzip), Ok(6));
    }

    #[test]
    fn pages_that_lie_are_refused() {
        let huge = look(&page(1 << 30, b"abc"), PageGrowth::Declared).unwrap_err();
        assert!(huge.contains("too much memory"), "{huge}");
        let bomb = look(&page(100, &gzip(1 << 20)), PageGrowth::Gzip).unwrap_err();
        assert!(bomb.contains("larger than its header"), "{bomb}");
        let cut = page(100, b"abc");
        assert!(look(&cut[..cut.len() - 1], PageGrowth::Declared).is_err());
        // A dictionary of more numbers than it has bytes for.
        let mut dictionary = vec![0x15, 4, 0x15, 16, 0x15, 0, 0x4c, 0x15];
        dictionary.extend(whole(1 << 20));
        dictionary.extend([0x15, 0, 0, 0]);
        assert!(look(&dictionary, PageGrowth::Declared).is_err());
        assert!(look(&[0x1c; 100], PageGrowth::Declared).is_err());
    }
}
