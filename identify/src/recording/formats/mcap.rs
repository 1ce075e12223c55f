//! Logs of robots as MCAP files (mcap.dev, version 0): records of which messages are kept, in chunks that may be packed.
//!
//! The `mcap` crate unpacks with C libraries and holds the file in memory; the format is simple enough to be read as it
//! comes.
//!
//! Decision: a reader of our own, some 250 lines. It takes no more memory than one record, whatever the file
//! states. Messages are decoded by the definitions in the file, twice: quickly to numbers with the lengths and
//! names that identify the form of the message, and once per form to the names of its columns.

use std::collections::BTreeMap;
use std::io::{self, BufReader, Read};

use crate::recording::error::RecordingFault;
use crate::recording::formats::bag::{self, BagCollector, BagEncoding};
use crate::recording::formats::packing::{CompressionMethod, check_growth};
use crate::recording::formats::{RecordingFormat, RecordingInput, TableInfo};
use crate::recording::{ReadOptions, SignalRecording};

const MAGIC: [u8; 8] = *b"\x89MCAP0\r\n";
/// The largest record that is taken into memory, such as a chunk; writers make some of a megabyte.
const LARGEST: u64 = 128 << 20;

/// What ROS 2 and Foxglove write.
pub(crate) struct McapFormat;

impl RecordingFormat for McapFormat {
    fn suffix(&self) -> &'static str {
        " (MCAP)"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["mcap"]
    }

    fn has_signature(&self, first: &[u8]) -> bool {
        first.starts_with(&MAGIC)
    }

    fn read(
        &self,
        input: RecordingInput<'_>,
        file: &str,
        options: &ReadOptions,
    ) -> Result<SignalRecording, RecordingFault> {
        bag::read(&mut replay_once(input), file, options)
    }

    fn names(&self, input: RecordingInput<'_>) -> Result<Vec<String>, RecordingFault> {
        bag::names(&mut replay_once(input))
    }

    fn tables(&self, input: RecordingInput<'_>) -> Result<Vec<TableInfo>, RecordingFault> {
        bag::tables(&mut replay_once(input))
    }
}

/// Shows the messages of a file, which can be done once.
fn replay_once(
    input: RecordingInput<'_>,
) -> impl FnMut(&mut BagCollector<'_>) -> Result<(), RecordingFault> + use<'_> {
    let mut stream = Some(input.stream());
    move |bag| match stream.take() {
        Some(stream) => replay_messages(stream, bag),
        None => Ok(()),
    }
}

fn replay_messages(stream: impl Read, bag: &mut BagCollector<'_>) -> Result<(), RecordingFault> {
    let mut stream = BufReader::with_capacity(1 << 20, stream);
    let mut file = McapFileState::default();
    let mut magic = [0; 8];
    stream
        .read_exact(&mut magic)
        .map_err(|error| unreadable_fault(&error))?;
    loop {
        let mut kind = [0];
        stream
            .read_exact(&mut kind)
            .map_err(|error| unreadable_fault(&error))?;
        let mut length = [0; 8];
        stream
            .read_exact(&mut length)
            .map_err(|error| unreadable_fault(&error))?;
        let length = u64::from_le_bytes(length);
        match kind[0] {
            // What follows the end of the data repeats it, for those who go to and fro.
            McapRecordKind::DATA_END | McapRecordKind::FOOTER => return Ok(()),
            McapRecordKind::CHUNK
            | McapRecordKind::SCHEMA
            | McapRecordKind::CHANNEL
            | McapRecordKind::MESSAGE => {
                if length > LARGEST {
                    return Err(format_fault("a record in it is larger than 128 MB"));
                }
                // What is not there takes no memory, whatever the length says.
                let mut bytes = Vec::new();
                let read = (&mut stream).take(length).read_to_end(&mut bytes);
                if read.map_err(|error| unreadable_fault(&error))? as u64 != length {
                    return Err(unreadable_fault(&io::ErrorKind::UnexpectedEof.into()));
                }
                file.take_record(kind[0], &bytes, bag)?;
            }
            _ => {
                let passed = io::copy(&mut (&mut stream).take(length), &mut io::sink());
                if passed.map_err(|error| unreadable_fault(&error))? != length {
                    return Err(unreadable_fault(&io::ErrorKind::UnexpectedEof.into()));
                }
            }
        }
    }
}

/// Kinds of records that are looked at.
struct McapRecordKind;

impl McapRecordKind {
    const FOOTER: u8 = 0x02;
    const SCHEMA: u8 = 0x03;
    const CHANNEL: u8 = 0x04;
    const MESSAGE: u8 = 0x05;
    const CHUNK: u8 = 0x06;
    const DATA_END: u8 = 0x0F;
}

/// What is known of a file so far.
#[derive(Default)]
struct McapFileState {
    /// Name, encoding and text of definitions.
    schemas: BTreeMap<u16, (String, String, String)>,
    /// Topics of channels; several channels may write on one.
    channels: BTreeMap<u16, usize>,
    topics: BTreeMap<(String, u16), usize>,
    /// Bytes of chunks so far, packed and unpacked.
    packed: u64,
    unpacked: u64,
}

impl McapFileState {
    fn take_record(
        &mut self,
        kind: u8,
        bytes: &[u8],
        bag: &mut BagCollector<'_>,
    ) -> Result<(), RecordingFault> {
        let mut fields = McapFieldReader(bytes);
        match kind {
            McapRecordKind::SCHEMA => {
                let id = fields.u16()?;
                let (name, encoding) = (fields.text()?, fields.text()?);
                let text = fields.text()?;
                self.schemas.insert(id, (name, encoding, text));
            }
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
                let known = self.topics.entry((topic.clone(), schema));
                let number = *known.or_insert_with(|| bag.register_topic(&topic, name, &encoding));
                self.channels.insert(id, number);
            }
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
            McapRecordKind::CHUNK => {
                fields.take(16)?;
                let unpacked = fields.u64()?;
                let sum = fields.u32()?;
                let packing = fields.text()?;
                let length = fields.u64()?;
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
                self.packed += length;
                self.unpacked = self.unpacked.saturating_add(unpacked);
                check_growth(self.packed, self.unpacked)
                    .map_err(|error| unreadable_fault(&error))?;
                match packing {
                    None => self.take_chunk(fields.0, sum, bag)?,
                    Some(packing) => {
                        let bytes = packing.decompress(fields.0, unpacked);
                        self.take_chunk(
                            &bytes.map_err(|error| unreadable_fault(&error))?,
                            sum,
                            bag,
                        )?;
                    }
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn take_chunk(
        &mut self,
        bytes: &[u8],
        sum: u32,
        bag: &mut BagCollector<'_>,
    ) -> Result<(), RecordingFault> {
        if sum != 0 {
            let mut crc = flate2::Crc::new();
            crc.update(bytes);
            if crc.sum() != sum {
                return Err(format_fault("the checksum of a chunk is wrong"));
            }
        }
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

/// The fields of a record that are left.
struct McapFieldReader<'a>(&'a [u8]);

impl<'a> McapFieldReader<'a> {
    fn take(&mut self, n: usize) -> Result<&'a [u8], RecordingFault> {
        let Some((taken, rest)) = self.0.split_at_checked(n) else {
            return Err(format_fault("a record in it is shorter than its contents"));
        };
        self.0 = rest;
        Ok(taken)
    }

    fn read_array<const N: usize>(&mut self) -> Result<[u8; N], RecordingFault> {
        let mut bytes = [0; N];
        bytes.copy_from_slice(self.take(N)?);
        Ok(bytes)
    }

    fn u16(&mut self) -> Result<u16, RecordingFault> {
        Ok(u16::from_le_bytes(self.read_array()?))
    }

    fn u32(&mut self) -> Result<u32, RecordingFault> {
        Ok(u32::from_le_bytes(self.read_array()?))
    }

    fn u64(&mut self) -> Result<u64, RecordingFault> {
        Ok(u64::from_le_bytes(self.read_array()?))
    }

    fn text(&mut self) -> Result<String, RecordingFault> {
        let length = self.u32()? as usize;
        Ok(String::from_utf8_lossy(self.take(length)?).into_owned())
    }
}

fn format_fault(says: impl Into<String>) -> RecordingFault {
    RecordingFault::Format {
        format: "an MCAP file",
        message: says.into(),
    }
}

fn unreadable_fault(error: &io::Error) -> RecordingFault {
    if error.kind() == io::ErrorKind::UnexpectedEof {
        return format_fault(
            "it ends before the end of its data; copy it again, or repair it with `mcap recover`",
        );
    }
    format_fault(format!("it cannot be read: {error}"))
}
