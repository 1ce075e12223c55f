//! Decompression of gzip, zstd, brotli, bzip2 and lz4. Compressed bytes go in, bytes come out, never more than requested.
//!
//! A compressed file, such as `run.csv.gz`, is read as the file in it.

use std::cell::Cell;
use std::io::{self, BufRead, BufReader, Read};
use std::rc::Rc;

use flate2::read::MultiGzDecoder;
use ruzstd::decoding::errors::{FrameDecoderError, ReadFrameHeaderError};
use ruzstd::decoding::{BlockDecodingStrategy, FrameDecoder};

use crate::recording::error::RecordingFault;
use crate::recording::formats::{RecordingFormat, RecordingInput, SIGNATURE_BYTES, TableInfo, format_of};
use crate::recording::{ReadOptions, SignalRecording};

/// Largest window of zstd in bytes; its own program allows the same.
const LONGEST_WINDOW: u64 = 128 << 20;
/// Decompressed sizes up to this limit are not checked, in bytes.
const UNCHECKED_GROWTH: u64 = 64 << 20;
/// Largest ratio of the decompressed size to the compressed one beyond that.
const MOST_GROWTH: u64 = 200;

/// Fails when the decompressed size is too large for a recording. Both sizes are in bytes.
pub(super) fn check_growth(packed: u64, unpacked: u64) -> io::Result<()> {
    if unpacked > UNCHECKED_GROWTH.max(MOST_GROWTH.saturating_mul(packed)) {
        return Err(io::Error::other(
            "it decompresses to more than two hundred times its size, as no recording does",
        ));
    }
    Ok(())
}

/// Methods of compression.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum CompressionMethod {
    /// gzip, possibly with several members.
    Gzip,
    /// Zstandard, possibly with several frames.
    Zstd,
    /// Brotli, in Parquet files.
    #[cfg(feature = "parquet")]
    Brotli,
    /// bzip2, in bags of ROS 1.
    #[cfg(feature = "logs")]
    Bzip2,
    /// LZ4 frames, in MCAP files and bags of ROS 1.
    #[cfg(any(feature = "parquet", feature = "logs"))]
    Lz4,
}

impl CompressionMethod {
    /// A reader of the decompressed bytes of a stream.
    pub(super) fn decompressing_reader<'a>(self, packed: impl Read + 'a) -> Box<dyn Read + 'a> {
        match self {
            Self::Gzip => Box::new(MultiGzDecoder::new(packed)),
            Self::Zstd => Box::new(ZstdReader::new(packed)),
            #[cfg(feature = "parquet")]
            Self::Brotli => Box::new(brotli_decompressor::Decompressor::new(packed, 1 << 16)),
            #[cfg(feature = "logs")]
            Self::Bzip2 => Box::new(bzip2_rs::DecoderReader::new(packed)),
            #[cfg(any(feature = "parquet", feature = "logs"))]
            Self::Lz4 => Box::new(lz4_flex::frame::FrameDecoder::new(packed)),
        }
    }

    /// Decompresses bytes; fails when the result is longer than `most` bytes.
    #[cfg(any(feature = "parquet", feature = "logs"))]
    pub(super) fn decompress(self, packed: &[u8], most: u64) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        // One byte more than allowed shows that the result is too long.
        self.decompressing_reader(packed)
            .take(most.saturating_add(1))
            .read_to_end(&mut bytes)?;
        if bytes.len() as u64 > most {
            return Err(io::Error::other("it decompresses to more than the file declares"));
        }
        Ok(bytes)
    }

    /// Description of such a file, for messages.
    fn name(self) -> &'static str {
        match self {
            Self::Gzip => "a file compressed by gzip",
            Self::Zstd => "a file compressed by zstd",
            #[cfg(feature = "parquet")]
            Self::Brotli => "a file compressed by brotli",
            #[cfg(feature = "logs")]
            Self::Bzip2 => "a file compressed by bzip2",
            #[cfg(any(feature = "parquet", feature = "logs"))]
            Self::Lz4 => "a file compressed by lz4",
        }
    }
}

/// A reader of zstd frames, which may follow each other, as in files of its own program.
struct ZstdReader<R> {
    /// The compressed stream.
    packed: BufReader<R>,
    /// The decoder of the current frame.
    decoder: FrameDecoder,
    /// Whether a frame is being decoded.
    is_in_frame: bool,
}

impl<R: Read> ZstdReader<R> {
    /// Wraps a compressed stream.
    fn new(packed: R) -> Self {
        let mut decoder = FrameDecoder::new();
        decoder.set_max_window_size(LONGEST_WINDOW);
        Self {
            packed: BufReader::with_capacity(1 << 16, packed),
            decoder,
            is_in_frame: false,
        }
    }

    /// Moves to the next frame with data; false at the end of the stream.
    fn next_frame(&mut self) -> io::Result<bool> {
        loop {
            if self.packed.fill_buf()?.is_empty() {
                return Ok(false);
            }
            match self.decoder.init(&mut self.packed) {
                Ok(()) => return Ok(true),
                // Skippable frames contain data of other programs.
                Err(FrameDecoderError::ReadFrameHeaderError(ReadFrameHeaderError::SkipFrame { length, .. })) => {
                    let mut passed = (&mut self.packed).take(u64::from(length));
                    io::copy(&mut passed, &mut io::sink())?;
                }
                Err(error) => return Err(io::Error::other(error.to_string())),
            }
        }
    }

    /// Compares the checksum of a frame, if it has one.
    fn check_sum(&self) -> io::Result<()> {
        let stored = self.decoder.get_checksum_from_data();
        if stored.is_some() && stored != self.decoder.get_calculated_checksum() {
            return Err(io::Error::other("its checksum is wrong"));
        }
        Ok(())
    }
}

impl<R: Read> Read for ZstdReader<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if buffer.is_empty() {
            return Ok(0);
        }
        // Read frames until there are bytes or the stream ends.
        loop {
            if !self.is_in_frame && !self.next_frame()? {
                return Ok(0);
            }
            self.is_in_frame = true;
            // Decode one block at a time, so that little memory is needed.
            while self.decoder.can_collect() == 0 && !self.decoder.is_finished() {
                let one = BlockDecodingStrategy::UptoBlocks(1);
                let decoded = self.decoder.decode_blocks(&mut self.packed, one);
                decoded.map_err(|error| io::Error::other(error.to_string()))?;
            }
            let n = self.decoder.read(buffer)?;
            if n > 0 {
                return Ok(n);
            }
            // The frame is complete.
            self.check_sum()?;
            self.is_in_frame = false;
        }
    }
}

/// A reader that fails when its stream grows too much.
struct BoundedReader<R> {
    /// The decompressed stream.
    unpacked: R,
    /// Bytes that were read from it so far.
    so_far: u64,
    /// Compressed bytes that were read so far.
    packed: Rc<Cell<u64>>,
}

/// A reader that counts its bytes.
struct CountingReader<R> {
    /// The original stream.
    stream: R,
    /// Number of bytes so far, shared with the user.
    count: Rc<Cell<u64>>,
}

impl<R: Read> Read for CountingReader<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let n = self.stream.read(buffer)?;
        self.count.set(self.count.get() + n as u64);
        Ok(n)
    }
}

impl<R: Read> Read for BoundedReader<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let n = self.unpacked.read(buffer)?;
        self.so_far += n as u64;
        check_growth(self.packed.get(), self.so_far)?;
        Ok(n)
    }
}

/// A compressed file with one of these methods.
pub(super) struct CompressedFormat(pub(super) CompressionMethod);

impl CompressedFormat {
    /// Replaces an error of reading the contents by one that names the compression as its cause.
    fn explain_fault(&self, fault: RecordingFault) -> RecordingFault {
        match fault {
            RecordingFault::Unreadable { reason } => self.decompression_fault(&reason),
            other => other,
        }
    }

    /// The fault of a file that cannot be decompressed.
    fn decompression_fault(&self, reason: &str) -> RecordingFault {
        RecordingFault::Format {
            format: self.0.name(),
            message: format!("it cannot be decompressed: {reason}; is it complete?"),
        }
    }

    /// The format of the contents, recognised by their first bytes, and the contents from the start.
    ///
    /// Fails when the contents are compressed again.
    fn open_content<'a>(
        &self,
        input: RecordingInput<'a>,
    ) -> Result<(&'static dyn RecordingFormat, RecordingInput<'a>), RecordingFault> {
        // Count compressed bytes below the decoder, and compare them above it.
        let packed = Rc::new(Cell::new(0));
        let mut stream = BoundedReader {
            unpacked: self.0.decompressing_reader(CountingReader {
                stream: BufReader::with_capacity(1 << 16, input.stream()),
                count: packed.clone(),
            }),
            so_far: 0,
            packed,
        };
        // Read the first bytes to recognise the format, and put them back in front.
        let mut first = Vec::new();
        let head = (&mut stream).take(SIGNATURE_BYTES as u64).read_to_end(&mut first);
        head.map_err(|error| self.decompression_fault(&error.to_string()))?;
        let format = format_of(&first);
        if format.is_compressed() {
            return Err(RecordingFault::Format {
                format: self.0.name(),
                message: "its content is compressed again; decompress it once".to_owned(),
            });
        }
        Ok((
            format,
            RecordingInput::Stream(Box::new(io::Cursor::new(first).chain(stream))),
        ))
    }
}

impl RecordingFormat for CompressedFormat {
    fn extensions(&self) -> &'static [&'static str] {
        &["gz", "zst"]
    }

    fn is_table(&self) -> bool {
        false
    }

    fn is_compressed(&self) -> bool {
        true
    }

    fn has_signature(&self, first: &[u8]) -> bool {
        match self.0 {
            CompressionMethod::Gzip => first.starts_with(&[0x1F, 0x8B]),
            CompressionMethod::Zstd => {
                // A frame, or a skippable frame before it.
                first.starts_with(&[0x28, 0xB5, 0x2F, 0xFD])
                    || (first.len() > 3 && first[0] >> 4 == 5 && first[1..4] == [0x2A, 0x4D, 0x18])
            }
            // Only pages of Parquet and chunks of logs are compressed in these ways.
            #[cfg(feature = "parquet")]
            CompressionMethod::Brotli => false,
            #[cfg(feature = "logs")]
            CompressionMethod::Bzip2 => false,
            #[cfg(any(feature = "parquet", feature = "logs"))]
            CompressionMethod::Lz4 => false,
        }
    }

    fn read(
        &self,
        input: RecordingInput<'_>,
        file: &str,
        options: &ReadOptions,
    ) -> Result<SignalRecording, RecordingFault> {
        let (format, inside) = self.open_content(input)?;
        let found = format.read(inside, file, options);
        found.map_err(|fault| self.explain_fault(fault))
    }

    fn names(&self, input: RecordingInput<'_>) -> Result<Vec<String>, RecordingFault> {
        let (format, inside) = self.open_content(input)?;
        let found = format.names(inside);
        found.map_err(|fault| self.explain_fault(fault))
    }

    fn tables(&self, input: RecordingInput<'_>) -> Result<Vec<TableInfo>, RecordingFault> {
        let (format, inside) = self.open_content(input)?;
        let found = format.tables(inside);
        found.map_err(|fault| self.explain_fault(fault))
    }
}
