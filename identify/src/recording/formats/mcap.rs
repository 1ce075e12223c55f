//! Robot logs as MCAP files (mcap.dev, version 0): records, of which the messages are needed, in chunks that may be
//! compressed.
//!
//! The `mcap` crate decompresses with C libraries and keeps the file in memory. The format is simple enough to be
//! read as a stream.
//!
//! Decision: an own reader of some 250 lines. It needs memory for one record only, regardless of the sizes that the
//! file declares. Messages are decoded by the definitions in the file, in two ways. All messages are decoded quickly
//! to numbers, with the lengths and names that identify their form. Once per form the names of the columns are
//! decoded.

use std::collections::BTreeMap;
use std::io::{self, BufReader, Read};

use crate::recording::error::RecordingFault;
use crate::recording::formats::RecordingInput;
use crate::recording::formats::bag::{BagCollector, BagEncoding, MessageLogFormat};
use crate::recording::formats::packing::{CompressionMethod, check_growth};

/// First bytes of a file.
const MAGIC: [u8; 8] = *b"\x89MCAP0\r\n";
/// Largest record in memory, in bytes; writers usually make chunks of about a megabyte.
const LARGEST: u64 = 128 << 20;

/// The format of ROS 2 and Foxglove.
pub(crate) struct McapFormat;

impl MessageLogFormat for McapFormat {
    fn log_suffix(&self) -> &'static str {
        " (MCAP)"
    }

    fn log_extensions(&self) -> &'static [&'static str] {
        &["mcap"]
    }

    fn has_log_signature(&self, first: &[u8]) -> bool {
        first.starts_with(&MAGIC)
    }

    fn pass_messages(&self, input: RecordingInput<'_>, bag: &mut BagCollector<'_>) -> Result<(), RecordingFault> {
        replay_messages(input.stream(), bag)
    }
}

/// Reads the records of a stream one after another.
fn replay_messages(stream: impl Read, bag: &mut BagCollector<'_>) -> Result<(), RecordingFault> {
    let mut stream = BufReader::with_capacity(1 << 20, stream);
    let mut file = McapFileState::default();
    let mut magic = [0; 8];
    // The signature was checked before, so it is skipped.
    stream
        .read_exact(&mut magic)
        .map_err(|error| unreadable_fault(&error))?;
    // Each record has its kind, the length of its contents, and the contents.
    loop {
        let mut kind = [0];
        stream.read_exact(&mut kind).map_err(|error| unreadable_fault(&error))?;
        let mut length = [0; 8];
        stream
            .read_exact(&mut length)
            .map_err(|error| unreadable_fault(&error))?;
        let length = u64::from_le_bytes(length);
        match kind[0] {
            // The records behind the end of the data repeat it as an index.
            McapRecordKind::DATA_END | McapRecordKind::FOOTER => return Ok(()),
            // These records are needed in memory.
            McapRecordKind::CHUNK | McapRecordKind::SCHEMA | McapRecordKind::CHANNEL | McapRecordKind::MESSAGE => {
                if length > LARGEST {
                    return Err(format_fault("a record in it is larger than 128 MB"));
                }
                // Memory is allocated as bytes arrive, not by the declared length.
                let mut bytes = Vec::new();
                let read = (&mut stream).take(length).read_to_end(&mut bytes);
                if read.map_err(|error| unreadable_fault(&error))? as u64 != length {
                    return Err(unreadable_fault(&io::ErrorKind::UnexpectedEof.into()));
                }
                file.take_record(kind[0], &bytes, bag)?;
            }
            // All other records are skipped.
            _ => {
                let passed = io::copy(&mut (&mut stream).take(length), &mut io::sink());
                if passed.map_err(|error| unreadable_fault(&error))? != length {
                    return Err(unreadable_fault(&io::ErrorKind::UnexpectedEof.into()));
                }
            }
        }
    }
}

/// Kinds of records that are read.
struct McapRecordKind;

impl McapRecordKind {
    /// End of the file.
    const FOOTER: u8 = 0x02;
    /// Definition of a message type.
    const SCHEMA: u8 = 0x03;
    /// Topic with its encoding and its definition.
    const CHANNEL: u8 = 0x04;
    /// One message.
    const MESSAGE: u8 = 0x05;
    /// Several records, possibly compressed.
    const CHUNK: u8 = 0x06;
    /// End of the data.
    const DATA_END: u8 = 0x0F;
}

/// What the records of a file have defined so far.
#[derive(Default)]
struct McapFileState {
    /// Name, encoding and text of definitions, by number.
    schemas: BTreeMap<u16, (String, String, String)>,
    /// Topics of channels, by number; several channels may belong to the same topic.
    channels: BTreeMap<u16, usize>,
    /// Topics in the collector, by their names and definitions.
    topics: BTreeMap<(String, u16), usize>,
    /// Bytes of all chunks so far, as stored.
    packed: u64,
    /// The same after decompression.
    unpacked: u64,
}

impl McapFileState {
    /// Takes a record; definitions and channels are remembered, messages are passed on.
    fn take_record(&mut self, kind: u8, bytes: &[u8], bag: &mut BagCollector<'_>) -> Result<(), RecordingFault> {
        let mut fields = McapFieldReader(bytes);
        match kind {
            // Number, name, encoding and text of the definition.
            McapRecordKind::SCHEMA => {
                let id = fields.u16()?;
                let (name, encoding) = (fields.text()?, fields.text()?);
                let text = fields.text()?;
                self.schemas.insert(id, (name, encoding, text));
            }
            // Channels without a definition have the schema 0.
            McapRecordKind::CHANNEL => {
                let (id, schema) = (fields.u16()?, fields.u16()?);
                let (topic, encoding) = (fields.text()?, fields.text()?);
                let nameless = Default::default();
                let (name, definition, text) = self.schemas.get(&schema).unwrap_or(&nameless);
                let encoding = BagEncoding {
                    messages: &encoding,
                    definition: if schema == 0 { "none" } else { definition },
                    text,
                };
                // Each pair of topic and definition is registered once.
                let known = self.topics.entry((topic.clone(), schema));
                let number = *known.or_insert_with(|| bag.register_topic(&topic, name, &encoding));
                self.channels.insert(id, number);
            }
            // Number of the channel, sequence number, time of logging, time of publishing, data.
            McapRecordKind::MESSAGE => {
                let channel = fields.u16()?;
                fields.take(4)?;
                let log = fields.u64()?;
                fields.take(8)?;
                let Some(topic) = self.channels.get(&channel) else {
                    return Err(format_fault("a message in it has no channel"));
                };
                bag.take_message(*topic, log.cast_signed(), fields.0)?;
            }
            // First and last time, size after decompression, checksum, compression, size as stored.
            McapRecordKind::CHUNK => {
                fields.take(16)?;
                let unpacked = fields.u64()?;
                let sum = fields.u32()?;
                let packing = fields.text()?;
                let length = fields.u64()?;
                // Declared sizes are checked before anything is allocated.
                if length != fields.0.len() as u64 || unpacked > LARGEST {
                    return Err(format_fault("a chunk in it is larger than it can be"));
                }
                let packing = match packing.as_str() {
                    "" => None,
                    "zstd" => Some(CompressionMethod::Zstd),
                    "lz4" => Some(CompressionMethod::Lz4),
                    other => {
                        return Err(format_fault(format!(
                            "a chunk in it is compressed by `{other}`, which is not supported"
                        )));
                    }
                };
                // The ratio of both sums is limited over the complete file.
                self.packed += length;
                self.unpacked = self.unpacked.saturating_add(unpacked);
                check_growth(self.packed, self.unpacked).map_err(|error| unreadable_fault(&error))?;
                match packing {
                    None => self.take_chunk(fields.0, sum, bag)?,
                    Some(packing) => {
                        let bytes = packing.decompress(fields.0, unpacked);
                        self.take_chunk(&bytes.map_err(|error| unreadable_fault(&error))?, sum, bag)?;
                    }
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// Takes the records in a chunk; `sum` is its CRC-32, or zero if there is none.
    fn take_chunk(&mut self, bytes: &[u8], sum: u32, bag: &mut BagCollector<'_>) -> Result<(), RecordingFault> {
        if sum != 0 {
            let mut crc = flate2::Crc::new();
            crc.update(bytes);
            if crc.sum() != sum {
                return Err(format_fault("the checksum of a chunk is wrong"));
            }
        }
        // Chunks cannot contain chunks.
        let mut records = McapFieldReader(bytes);
        while !records.0.is_empty() {
            let kind = records.take(1)?[0];
            let length = usize::try_from(records.u64()?).unwrap_or(usize::MAX);
            let bytes = records.take(length)?;
            if kind != McapRecordKind::CHUNK {
                self.take_record(kind, bytes, bag)?;
            }
        }
        Ok(())
    }
}

/// The remaining fields of a record.
struct McapFieldReader<'a>(&'a [u8]);

impl<'a> McapFieldReader<'a> {
    /// The next `n` bytes; fails when there are fewer.
    fn take(&mut self, n: usize) -> Result<&'a [u8], RecordingFault> {
        let Some((taken, rest)) = self.0.split_at_checked(n) else {
            return Err(format_fault("a record in it is shorter than its contents"));
        };
        self.0 = rest;
        Ok(taken)
    }

    /// The next `N` bytes as an array.
    fn read_array<const N: usize>(&mut self) -> Result<[u8; N], RecordingFault> {
        let mut bytes = [0; N];
        bytes.copy_from_slice(self.take(N)?);
        Ok(bytes)
    }

    /// The next number of two bytes.
    fn u16(&mut self) -> Result<u16, RecordingFault> {
        Ok(u16::from_le_bytes(self.read_array()?))
    }

    /// The next number of four bytes.
    fn u32(&mut self) -> Result<u32, RecordingFault> {
        Ok(u32::from_le_bytes(self.read_array()?))
    }

    /// The next number of eight bytes.
    fn u64(&mut self) -> Result<u64, RecordingFault> {
        Ok(u64::from_le_bytes(self.read_array()?))
    }

    /// The next text: its length, then its bytes.
    fn text(&mut self) -> Result<String, RecordingFault> {
        let length = self.u32()? as usize;
        Ok(String::from_utf8_lossy(self.take(length)?).into_owned())
    }
}

/// The fault of a file with other contents.
fn format_fault(says: impl Into<String>) -> RecordingFault {
    RecordingFault::Format {
        format: "an MCAP file",
        message: says.into(),
    }
}

/// The fault of a stream that cannot be read or ends too early.
fn unreadable_fault(error: &io::Error) -> RecordingFault {
    if error.kind() == io::ErrorKind::UnexpectedEof {
        return format_fault("it ends before the end of its data; copy it again, or repair it with `mcap recover`");
    }
    format_fault(format!("it cannot be read: {error}"))
}
