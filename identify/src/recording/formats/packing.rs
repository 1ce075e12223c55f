//! What is packed: gzip, zstd, brotli and lz4 go in, bytes come out, never more than were asked for.
//!
//! A file that is packed as a whole, such as `run.csv.gz`, is read as what is in it.

use std::cell::Cell;
use std::io::{self, BufRead, BufReader, Read};
use std::rc::Rc;

use flate2::read::MultiGzDecoder;
use ruzstd::decoding::errors::{FrameDecoderError, ReadFrameHeaderError};
use ruzstd::decoding::{BlockDecodingStrategy, FrameDecoder};

use crate::recording::error::Fault;
use crate::recording::formats::{Format, Input, TELLING_BYTES, TableInfo, format_of};
use crate::recording::{ReadOptions, Recording};

/// The longest stretch of bytes that zstd may look back over; its own program allows as much.
const LONGEST_WINDOW: u64 = 128 << 20;
/// Up to here what is packed may grow as it likes, and beyond it so many times.
const HARMLESS: u64 = 64 << 20;
const MOST_GROWTH: u64 = 200;

/// Fails when a file grows as no recording does.
pub(super) fn check_growth(packed: u64, unpacked: u64) -> io::Result<()> {
    if unpacked > HARMLESS.max(MOST_GROWTH.saturating_mul(packed)) {
        return Err(io::Error::other(
            "it unpacks to more than two hundred times its size, as no recording does",
        ));
    }
    Ok(())
}

/// The ways in which bytes are packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Packing {
    Gzip,
    Zstd,
    #[cfg(feature = "parquet")]
    Brotli,
    #[cfg(any(feature = "parquet", feature = "logs"))]
    Lz4,
}

impl Packing {
    /// The bytes of a stream, unpacked.
    pub(super) fn reader<'a>(self, packed: impl Read + 'a) -> Box<dyn Read + 'a> {
        match self {
            Self::Gzip => Box::new(MultiGzDecoder::new(packed)),
            Self::Zstd => Box::new(Zstd::new(packed)),
            #[cfg(feature = "parquet")]
            Self::Brotli => Box::new(brotli_decompressor::Decompressor::new(packed, 1 << 16)),
            #[cfg(any(feature = "parquet", feature = "logs"))]
            Self::Lz4 => Box::new(lz4_flex::frame::FrameDecoder::new(packed)),
        }
    }

    /// Bytes unpacked; fails when they are more than `most`.
    #[cfg(any(feature = "parquet", feature = "logs"))]
    pub(super) fn unpacked(self, packed: &[u8], most: u64) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        self.reader(packed)
            .take(most.saturating_add(1))
            .read_to_end(&mut bytes)?;
        if bytes.len() as u64 > most {
            return Err(io::Error::other("it unpacks to more than the file says"));
        }
        Ok(bytes)
    }

    fn name(self) -> &'static str {
        match self {
            Self::Gzip => "a file packed by gzip",
            Self::Zstd => "a file packed by zstd",
            #[cfg(feature = "parquet")]
            Self::Brotli => "a file packed by brotli",
            #[cfg(any(feature = "parquet", feature = "logs"))]
            Self::Lz4 => "a file packed by lz4",
        }
    }
}

/// Frames of zstd, one behind the other, as its program writes them.
struct Zstd<R> {
    packed: BufReader<R>,
    decoder: FrameDecoder,
    is_in_frame: bool,
}

impl<R: Read> Zstd<R> {
    fn new(packed: R) -> Self {
        let mut decoder = FrameDecoder::new();
        decoder.set_max_window_size(LONGEST_WINDOW);
        Self {
            packed: BufReader::with_capacity(1 << 16, packed),
            decoder,
            is_in_frame: false,
        }
    }

    /// Goes to the next frame that holds something; false where there is none.
    fn next_frame(&mut self) -> io::Result<bool> {
        loop {
            if self.packed.fill_buf()?.is_empty() {
                return Ok(false);
            }
            match self.decoder.init(&mut self.packed) {
                Ok(()) => return Ok(true),
                Err(FrameDecoderError::ReadFrameHeaderError(ReadFrameHeaderError::SkipFrame {
                    length,
                    ..
                })) => {
                    let mut passed = (&mut self.packed).take(u64::from(length));
                    io::copy(&mut passed, &mut io::sink())?;
                }
                Err(error) => return Err(io::Error::other(error.to_string())),
            }
        }
    }

    fn check_sum(&self) -> io::Result<()> {
        let said = self.decoder.get_checksum_from_data();
        if said.is_some() && said != self.decoder.get_calculated_checksum() {
            return Err(io::Error::other(
                "a sum over its bytes is not the one it says",
            ));
        }
        Ok(())
    }
}

impl<R: Read> Read for Zstd<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if buffer.is_empty() {
            return Ok(0);
        }
        loop {
            if !self.is_in_frame && !self.next_frame()? {
                return Ok(0);
            }
            self.is_in_frame = true;
            while self.decoder.can_collect() == 0 && !self.decoder.is_finished() {
                let one = BlockDecodingStrategy::UptoBlocks(1);
                let decoded = self.decoder.decode_blocks(&mut self.packed, one);
                decoded.map_err(|error| io::Error::other(error.to_string()))?;
            }
            let n = self.decoder.read(buffer)?;
            if n > 0 {
                return Ok(n);
            }
            self.check_sum()?;
            self.is_in_frame = false;
        }
    }
}

/// A stream that is not allowed to grow without bounds.
struct Bounded<R> {
    unpacked: R,
    so_far: u64,
    /// Bytes that it was made of.
    packed: Rc<Cell<u64>>,
}

/// A stream whose bytes are counted.
struct Counted<R> {
    stream: R,
    count: Rc<Cell<u64>>,
}

impl<R: Read> Read for Counted<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let n = self.stream.read(buffer)?;
        self.count.set(self.count.get() + n as u64);
        Ok(n)
    }
}

impl<R: Read> Read for Bounded<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let n = self.unpacked.read(buffer)?;
        self.so_far += n as u64;
        check_growth(self.packed.get(), self.so_far)?;
        Ok(n)
    }
}

/// A file that is packed as a whole.
pub(super) struct Packed(pub(super) Packing);

impl Packed {
    /// What reads the inside says that it cannot go on; here it is clear why.
    fn fault(&self, fault: Fault) -> Fault {
        match fault {
            Fault::Unreadable { reason } => self.not_unpacked(&reason),
            other => other,
        }
    }

    fn not_unpacked(&self, reason: &str) -> Fault {
        Fault::Format {
            format: self.0.name(),
            says: format!("it cannot be unpacked: {reason}; is it complete?"),
        }
    }

    /// What is in the file, by its first bytes, and all of them.
    fn inside<'a>(&self, input: Input<'a>) -> Result<(&'static dyn Format, Input<'a>), Fault> {
        let packed = Rc::new(Cell::new(0));
        let mut stream = Bounded {
            unpacked: self.0.reader(Counted {
                stream: BufReader::with_capacity(1 << 16, input.stream()),
                count: packed.clone(),
            }),
            so_far: 0,
            packed,
        };
        let mut first = Vec::new();
        let head = (&mut stream)
            .take(TELLING_BYTES as u64)
            .read_to_end(&mut first);
        head.map_err(|error| self.not_unpacked(&error.to_string()))?;
        let format = format_of(&first);
        if format.is_packed() {
            return Err(Fault::Format {
                format: self.0.name(),
                says: "what is in it is packed again; unpack it once".to_owned(),
            });
        }
        Ok((
            format,
            Input::Stream(Box::new(io::Cursor::new(first).chain(stream))),
        ))
    }
}

impl Format for Packed {
    fn extensions(&self) -> &'static [&'static str] {
        &["gz", "zst"]
    }

    fn is_table(&self) -> bool {
        false
    }

    fn is_packed(&self) -> bool {
        true
    }

    fn begins(&self, first: &[u8]) -> bool {
        match self.0 {
            Packing::Gzip => first.starts_with(&[0x1F, 0x8B]),
            Packing::Zstd => {
                // A frame, or one to be passed over in front of it.
                first.starts_with(&[0x28, 0xB5, 0x2F, 0xFD])
                    || (first.len() > 3 && first[0] >> 4 == 5 && first[1..4] == [0x2A, 0x4D, 0x18])
            }
            // Pages of Parquet and chunks of MCAP alone are packed so.
            #[cfg(feature = "parquet")]
            Packing::Brotli => false,
            #[cfg(any(feature = "parquet", feature = "logs"))]
            Packing::Lz4 => false,
        }
    }

    fn read(
        &self,
        input: Input<'_>,
        file: &str,
        options: &ReadOptions,
    ) -> Result<Recording, Fault> {
        let (format, inside) = self.inside(input)?;
        let found = format.read(inside, file, options);
        found.map_err(|fault| self.fault(fault))
    }

    fn names(&self, input: Input<'_>) -> Result<Vec<String>, Fault> {
        let (format, inside) = self.inside(input)?;
        let found = format.names(inside);
        found.map_err(|fault| self.fault(fault))
    }

    fn tables(&self, input: Input<'_>) -> Result<Vec<TableInfo>, Fault> {
        let (format, inside) = self.inside(input)?;
        let found = format.tables(inside);
        found.map_err(|fault| self.fault(fault))
    }
}
