//! The arrays of a MATLAB file of format 5: names and sizes of all of them, and the numbers of one array at a time.
//!
//! A header of 128 bytes states the byte order at its end. Then elements follow. Each has a tag with its type and its
//! length, and is padded to eight bytes. A compressed element contains another one (MathWorks, "MAT-File Format",
//! R2023b, "Level 5 MAT-Files"). Elements are decompressed only as far as they are read, because a few bytes may
//! expand to billions of numbers.

use std::io::{self, Read, Seek, SeekFrom};

use flate2::read::ZlibDecoder;

/// Bytes of the header.
const HEADER: u64 = 128;
/// Type of an element: an array.
const MATRIX: u32 = 14;
/// Type of an element: a compressed element.
const COMPRESSED: u32 = 15;
/// Most dimensions of an array.
const MOST_SIDES: u32 = 64;
/// Longest name in bytes; MATLAB's own names have at most 63 letters.
const LONGEST_NAME: u32 = 4096;
/// Bytes of numbers that are read at once; a multiple of all sizes of numbers.
const CHUNK: usize = 1 << 16;

/// A numeric array of a file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct MatlabArray {
    /// Name of the variable.
    pub(super) name: String,
    /// Rows, columns and further dimensions.
    pub(super) size: Vec<usize>,
    /// Whether the number of values agrees with the size.
    pub(super) is_consistent: bool,
    /// Whether there are imaginary parts, which follow the real ones.
    pub(super) is_complex: bool,
    /// Position of its element in the file, in bytes.
    at: u64,
    /// Length of its element in bytes.
    length: u64,
    /// Whether its element is compressed.
    is_compressed: bool,
}

/// An open file whose arrays are known.
pub(super) struct MatlabArrayFile<R> {
    /// The file.
    stream: R,
    /// Whether the lowest byte of a number comes first.
    is_little: bool,
    /// The numeric arrays in the order of the file.
    pub(super) arrays: Vec<MatlabArray>,
}

impl<R: Read + Seek> MatlabArrayFile<R> {
    /// Reads the list of arrays. Fails when the file is truncated or has another format.
    pub(super) fn new(mut stream: R) -> io::Result<Self> {
        let end = stream.seek(SeekFrom::End(0))?;
        if end < HEADER {
            return Err(truncated_error());
        }
        // Version and byte order are the last four bytes of the header.
        stream.seek(SeekFrom::Start(HEADER - 4))?;
        let mut version = [0; 4];
        stream.read_exact(&mut version)?;
        let is_little = match version {
            [0, 1, b'I', b'M'] => true,
            [1, 0, b'M', b'I'] => false,
            _ => return Err(io::Error::other("its header is not that of a MATLAB file")),
        };
        // Visit all elements; only arrays are read further.
        let mut arrays = Vec::new();
        let mut at = HEADER;
        while at + 8 <= end {
            stream.seek(SeekFrom::Start(at))?;
            let tag = MatlabElementReader::new(&mut stream, is_little).read_tag()?;
            let is_compressed = tag.kind == COMPRESSED;
            let length = u64::from(tag.length);
            at += 8;
            if length > end - at {
                return Err(truncated_error());
            }
            if is_compressed || tag.kind == MATRIX {
                let place = MatlabElementPlace {
                    at,
                    length,
                    is_compressed,
                };
                // A compressed element whose contents are not an array gives nothing.
                arrays.extend(place.open(&mut stream, is_little, |element| element.read_array(&place))?);
            }
            // Compressed elements have no padding.
            at += if is_compressed {
                length
            } else {
                length.next_multiple_of(8)
            };
        }
        if at != end {
            return Err(truncated_error());
        }
        Ok(Self {
            stream,
            is_little,
            arrays,
        })
    }

    /// The numbers of a consistent array, column by column.
    pub(super) fn read_numbers(&mut self, array: &MatlabArray) -> io::Result<Vec<f64>> {
        let place = MatlabElementPlace {
            at: array.at,
            length: array.length,
            is_compressed: array.is_compressed,
        };
        // The description is read again, up to the numbers.
        place.open(&mut self.stream, self.is_little, |element| {
            element.read_array(&place)?;
            let tag = element.data.ok_or_else(truncated_error)?;
            element.read_numbers(&tag)
        })
    }
}

/// The position of an element.
struct MatlabElementPlace {
    /// First byte behind its tag.
    at: u64,
    /// Length in bytes.
    length: u64,
    /// Whether it is compressed.
    is_compressed: bool,
}

impl MatlabElementPlace {
    /// Calls `read` with the decompressed contents of the element.
    fn open<T>(
        &self,
        stream: &mut (impl Read + Seek),
        is_little: bool,
        read: impl FnOnce(&mut MatlabElementReader<'_>) -> io::Result<T>,
    ) -> io::Result<T> {
        stream.seek(SeekFrom::Start(self.at))?;
        let mut inside = stream.take(self.length);
        if !self.is_compressed {
            return read(&mut MatlabElementReader::new(&mut inside, is_little));
        }
        let mut unpacked = ZlibDecoder::new(inside);
        let mut element = MatlabElementReader::new(&mut unpacked, is_little);
        // The contents start with the tag of the element inside.
        if element.read_tag()?.kind != MATRIX {
            element.is_not_array = true;
        }
        read(&mut element)
    }
}

/// Reads the bytes of an element in order.
struct MatlabElementReader<'a> {
    /// The decompressed bytes.
    stream: &'a mut dyn Read,
    /// Whether the lowest byte of a number comes first.
    is_little: bool,
    /// Whether the element is known not to be an array.
    is_not_array: bool,
    /// The tag of the real numbers, once the stream is behind it.
    data: Option<MatlabTag>,
}

/// Type and length of an element, and the number of padding bytes behind it.
#[derive(Clone, Copy)]
struct MatlabTag {
    /// Type.
    kind: u32,
    /// Length in bytes.
    length: u32,
    /// Padding in bytes.
    padding: u32,
}

impl<'a> MatlabElementReader<'a> {
    /// Starts reading at the contents of an element.
    fn new(stream: &'a mut dyn Read, is_little: bool) -> Self {
        Self {
            stream,
            is_little,
            is_not_array: false,
            data: None,
        }
    }

    /// The next number of four bytes.
    fn read_word(&mut self) -> io::Result<u32> {
        let mut bytes = [0; 4];
        self.stream.read_exact(&mut bytes)?;
        Ok(if self.is_little {
            u32::from_le_bytes(bytes)
        } else {
            u32::from_be_bytes(bytes)
        })
    }

    /// Reads a tag; elements of up to four bytes have type and length in one word.
    fn read_tag(&mut self) -> io::Result<MatlabTag> {
        let first = self.read_word()?;
        if first >> 16 == 0 {
            let length = self.read_word()?;
            let padding = length.wrapping_neg() % 8;
            return Ok(MatlabTag {
                kind: first,
                length,
                padding,
            });
        }
        let length = first >> 16;
        let padding = 4_u32
            .checked_sub(length)
            .ok_or_else(|| io::Error::other("a short element is too long"))?;
        Ok(MatlabTag {
            kind: first & 0xffff,
            length,
            padding,
        })
    }

    /// The bytes of an element; fails when it has more than `most`.
    fn read_bytes(&mut self, tag: MatlabTag, most: u32) -> io::Result<Vec<u8>> {
        if tag.length > most {
            return Err(io::Error::other("a name or a size is too long"));
        }
        let mut bytes = vec![0; (tag.length + tag.padding) as usize];
        self.stream.read_exact(&mut bytes)?;
        bytes.truncate(tag.length as usize);
        Ok(bytes)
    }

    /// Reads the description of an array up to its numbers; `None` if it is not numeric, such as texts and
    /// structures.
    fn read_array(&mut self, place: &MatlabElementPlace) -> io::Result<Option<MatlabArray>> {
        if self.is_not_array {
            return Ok(None);
        }
        // Flags with the class, then the dimensions, the name, and the tag of the numbers.
        let flags = self.read_tag()?;
        if flags.length != 8 {
            return Err(io::Error::other("an array has no class"));
        }
        let class = self.read_word()?;
        self.read_word()?;
        // Numeric classes are 6 (`double`) to 15 (`uint64`).
        if !(6..=15).contains(&(class & 0xff)) {
            return Ok(None);
        }
        let is_complex = class & 0x0800 != 0;
        let sides = self.read_tag()?;
        let sides = self.read_bytes(sides, 4 * MOST_SIDES)?;
        let size = sides.chunks_exact(4).map(|side| {
            let bytes = [side[0], side[1], side[2], side[3]];
            let side = if self.is_little {
                i32::from_le_bytes(bytes)
            } else {
                i32::from_be_bytes(bytes)
            };
            usize::try_from(side).map_err(|_| io::Error::other("an array has a negative size"))
        });
        let size = size.collect::<io::Result<Vec<usize>>>()?;
        let name = self.read_tag()?;
        let name = self.read_bytes(name, LONGEST_NAME)?;
        let data = self.read_tag()?;
        self.data = Some(data);
        // A product that overflows cannot agree with the length.
        let numbers = size.iter().try_fold(1, |n: usize, side| n.checked_mul(*side));
        let bytes = numbers.and_then(|n| n.checked_mul(number_width(data.kind)?));
        Ok(Some(MatlabArray {
            name: String::from_utf8_lossy(&name).into_owned(),
            is_consistent: bytes == Some(data.length as usize),
            is_complex,
            size,
            at: place.at,
            length: place.length,
            is_compressed: place.is_compressed,
        }))
    }

    /// Reads the numbers of an element, converted from any type.
    fn read_numbers(&mut self, tag: &MatlabTag) -> io::Result<Vec<f64>> {
        let width = number_width(tag.kind).ok_or_else(|| io::Error::other("it contains no numbers"))?;
        let mut numbers = Vec::new();
        let mut left = tag.length as usize;
        let mut chunk = vec![0; CHUNK.min(left)];
        // Numbers are read in parts, so that memory grows with the bytes that exist.
        while left > 0 {
            let chunk = &mut chunk[..CHUNK.min(left)];
            self.stream.read_exact(chunk)?;
            if !self.is_little {
                chunk.chunks_exact_mut(width).for_each(<[u8]>::reverse);
            }
            push_numbers(tag.kind, chunk, &mut numbers);
            left -= chunk.len();
        }
        Ok(numbers)
    }
}

/// Bytes of a number of a type; `None` if the type is not numeric.
fn number_width(kind: u32) -> Option<usize> {
    match kind {
        1 | 2 => Some(1),
        3 | 4 => Some(2),
        5..=7 => Some(4),
        9 | 12 | 13 => Some(8),
        _ => None,
    }
}

/// Appends numbers of a type from their bytes, the lowest byte first.
fn push_numbers(kind: u32, bytes: &[u8], numbers: &mut Vec<f64>) {
    // Converts all numbers of one Rust type.
    macro_rules! of {
        ($number:ty, $float:expr) => {{
            let (all, _) = bytes.as_chunks::<{ size_of::<$number>() }>();
            numbers.extend(all.iter().map(|b| $float(<$number>::from_le_bytes(*b))));
        }};
    }
    match kind {
        1 => of!(i8, f64::from),
        2 => of!(u8, f64::from),
        3 => of!(i16, f64::from),
        4 => of!(u16, f64::from),
        5 => of!(i32, f64::from),
        6 => of!(u32, f64::from),
        7 => of!(f32, f64::from),
        9 => of!(f64, f64::from),
        12 => of!(i64, |x| x as f64),
        _ => of!(u64, |x| x as f64),
    }
}

/// The error of a file that ends too early.
fn truncated_error() -> io::Error {
    io::Error::other("it ends within a variable")
}
