//! Robot logs of ROS 1: bags of version 2.0, which consist of records with a header of named fields and data.
//!
//! Messages are in chunks, which may be compressed by bz2 or LZ4; their types are defined by records of connections
//! (wiki.ros.org/Bags/Format/2.0). Records are read one after another, and the index is skipped.
//!
//! Decision: an own reader of some 200 lines. The crate `rosbag` maps a file into memory and decompresses with C
//! libraries, so that it reads neither pipes nor in a browser.

use std::collections::BTreeMap;
use std::io::{self, BufReader, Read};

use crate::recording::error::RecordingFault;
use crate::recording::formats::RecordingInput;
use crate::recording::formats::bag::{BagCollector, BagEncoding, MessageLogFormat};
use crate::recording::formats::packing::{CompressionMethod, check_growth};

/// First bytes of a bag.
const MAGIC: &[u8] = b"#ROSBAG V2.0\n";
/// First bytes of a bag of any version.
const ANY_VERSION: &[u8] = b"#ROSBAG V";
/// Largest header or data of a record in memory, in bytes; writers make chunks of about a megabyte.
const LARGEST: u32 = 256 << 20;

/// The format of ROS 1.
pub(crate) struct Rosbag1Format;

impl MessageLogFormat for Rosbag1Format {
    fn log_suffix(&self) -> &'static str {
        " (ROS 1 bag)"
    }

    fn log_extensions(&self) -> &'static [&'static str] {
        &["bag"]
    }

    fn has_log_signature(&self, first: &[u8]) -> bool {
        first.starts_with(ANY_VERSION)
    }

    fn pass_messages(&self, input: RecordingInput<'_>, bag: &mut BagCollector<'_>) -> Result<(), RecordingFault> {
        replay_messages(input.stream(), bag)
    }
}

/// Codes of records that are read.
struct BagRecordCode;

impl BagRecordCode {
    /// One message.
    const MESSAGE: u8 = 0x02;
    /// Properties of the bag.
    const BAG: u8 = 0x03;
    /// Several records, possibly compressed.
    const CHUNK: u8 = 0x05;
    /// Topic with the definition of its messages.
    const CONNECTION: u8 = 0x07;
}

/// Reads the records of a stream one after another.
fn replay_messages(stream: impl Read, bag: &mut BagCollector<'_>) -> Result<(), RecordingFault> {
    let mut stream = BufReader::with_capacity(1 << 20, stream);
    let mut magic = vec![0; MAGIC.len()];
    stream
        .read_exact(&mut magic)
        .map_err(|error| unreadable_fault(&error))?;
    if magic != MAGIC {
        return Err(format_fault(
            "only version 2.0 is supported; convert it with `rosbag fix` or record it again",
        ));
    }
    let mut state = BagFileState::default();
    while let Some(BagRecord { header, data }) = read_record(&mut stream, &mut state.place)? {
        let fields = BagFields::parse(&header, state.place)?;
        state.take_record(&fields, &data, false, bag)?;
    }
    // A bag that was not closed has its messages, but not its end.
    if state.connections.is_empty() {
        return Err(format_fault(
            "it has no topics; if its recording was interrupted, repair it with `rosbag reindex`",
        ));
    }
    Ok(())
}

/// A record: its header of named fields, and its data.
struct BagRecord {
    /// Named fields, each with its length before it.
    header: Vec<u8>,
    /// The data.
    data: Vec<u8>,
}

/// The next record of a stream; `None` at the end. `place` is the position in the file, in bytes.
fn read_record(stream: &mut impl Read, place: &mut u64) -> Result<Option<BagRecord>, RecordingFault> {
    let mut first = [0];
    if stream.read(&mut first).map_err(|error| unreadable_fault(&error))? == 0 {
        return Ok(None);
    }
    let mut rest = [0; 3];
    stream.read_exact(&mut rest).map_err(|error| unreadable_fault(&error))?;
    let length = u32::from_le_bytes([first[0], rest[0], rest[1], rest[2]]);
    let header = read_bytes(stream, length, *place)?;
    let mut length = [0; 4];
    stream
        .read_exact(&mut length)
        .map_err(|error| unreadable_fault(&error))?;
    let data = read_bytes(stream, u32::from_le_bytes(length), *place)?;
    *place += 8 + header.len() as u64 + data.len() as u64;
    Ok(Some(BagRecord { header, data }))
}

/// The next bytes of a stream; memory is allocated as they arrive, not by the declared length.
fn read_bytes(stream: &mut impl Read, length: u32, place: u64) -> Result<Vec<u8>, RecordingFault> {
    if length > LARGEST {
        return Err(format_fault(format!(
            "the record at byte {place} is larger than 256 MB, so the file is damaged there"
        )));
    }
    let mut bytes = Vec::new();
    let read = stream.take(u64::from(length)).read_to_end(&mut bytes);
    if read.map_err(|error| unreadable_fault(&error))? as u64 != u64::from(length) {
        return Err(unreadable_fault(&io::ErrorKind::UnexpectedEof.into()));
    }
    Ok(bytes)
}

/// What the records of a bag have defined so far.
struct BagFileState {
    /// Topics in the collector, by the number of their connection.
    connections: BTreeMap<u32, usize>,
    /// Topics in the collector, by name and type; several publishers are several connections.
    topics: BTreeMap<(String, String, String), usize>,
    /// Bytes of all chunks so far, as stored.
    packed: u64,
    /// The same after decompression.
    unpacked: u64,
    /// Position of the next record in the file, in bytes.
    place: u64,
}

impl Default for BagFileState {
    fn default() -> Self {
        Self {
            connections: BTreeMap::new(),
            topics: BTreeMap::new(),
            packed: 0,
            unpacked: 0,
            place: MAGIC.len() as u64,
        }
    }
}

impl BagFileState {
    /// Takes a record; connections are remembered, messages are passed on. Chunks cannot contain chunks.
    fn take_record(
        &mut self,
        fields: &BagFields<'_>,
        data: &[u8],
        is_in_chunk: bool,
        bag: &mut BagCollector<'_>,
    ) -> Result<(), RecordingFault> {
        match fields.code()? {
            BagRecordCode::BAG if fields.get("encryptor").is_some_and(|name| !name.is_empty()) => {
                return Err(format_fault("it is encrypted; decrypt it with `rosbag decrypt`"));
            }
            BagRecordCode::CONNECTION => self.take_connection(fields, data, bag)?,
            BagRecordCode::MESSAGE => {
                let connection = fields.u32("conn")?;
                // Seconds and nanoseconds since 1970.
                let [seconds, nanoseconds] = fields.time()?;
                let log = i64::from(seconds) * 1_000_000_000 + i64::from(nanoseconds);
                let Some(topic) = self.connections.get(&connection) else {
                    return Err(fields.fault("is a message of an unknown connection"));
                };
                bag.take_message(*topic, log, data)?;
            }
            BagRecordCode::CHUNK if !is_in_chunk => {
                let bytes = self.unpack_chunk(fields, data)?;
                let mut records = bytes.as_deref().unwrap_or(data);
                let mut within = 0;
                let damaged = |_| fields.fault("is a chunk with a damaged record in it");
                while let Some(BagRecord { header, data }) = read_record(&mut records, &mut within).map_err(damaged)? {
                    let inner = BagFields::parse(&header, fields.place)?;
                    self.take_record(&inner, &data, true, bag)?;
                }
            }
            // Indices and statistics are not needed.
            _ => {}
        }
        Ok(())
    }

    /// Registers the topic of a connection with the definition of its messages.
    fn take_connection(
        &mut self,
        fields: &BagFields<'_>,
        data: &[u8],
        bag: &mut BagCollector<'_>,
    ) -> Result<(), RecordingFault> {
        let connection = fields.u32("conn")?;
        // The index at the end of the file repeats all connections.
        if self.connections.contains_key(&connection) {
            return Ok(());
        }
        let about = BagFields::parse(data, fields.place)?;
        let text = |fields: &BagFields<'_>, name: &str| {
            fields
                .get(name)
                .map(|bytes| String::from_utf8_lossy(bytes).into_owned())
        };
        let topic = text(fields, "topic").or_else(|| text(&about, "topic"));
        let (Some(topic), Some(kind)) = (topic, text(&about, "type")) else {
            return Err(fields.fault("is a connection without topic or type"));
        };
        let definition = text(&about, "message_definition").unwrap_or_default();
        let known = self.topics.entry((topic.clone(), kind.clone(), definition.clone()));
        let number = *known.or_insert_with(|| {
            let encoding = BagEncoding {
                messages: "ros1",
                definition: "ros1msg",
                text: &definition,
            };
            bag.register_topic(&topic, &kind, &encoding)
        });
        self.connections.insert(connection, number);
        Ok(())
    }

    /// The records of a chunk; `None` if it is not compressed.
    fn unpack_chunk(&mut self, fields: &BagFields<'_>, data: &[u8]) -> Result<Option<Vec<u8>>, RecordingFault> {
        let size = fields.u32("size")?;
        let packing = match fields.get("compression").unwrap_or(b"none") {
            b"none" => return Ok(None),
            b"bz2" => CompressionMethod::Bzip2,
            b"lz4" => CompressionMethod::Lz4,
            other => {
                return Err(fields.fault(&format!(
                    "is a chunk compressed by `{}`, which is not supported; decompress the file with `rosbag decompress`",
                    String::from_utf8_lossy(other)
                )));
            }
        };
        if size > LARGEST {
            return Err(fields.fault("is a chunk larger than 256 MB"));
        }
        // The ratio of both sums is limited over the complete file.
        self.packed += data.len() as u64;
        self.unpacked = self.unpacked.saturating_add(u64::from(size));
        check_growth(self.packed, self.unpacked).map_err(|error| unreadable_fault(&error))?;
        let bytes = packing.decompress(data, u64::from(size));
        let bytes = bytes.map_err(|error| fields.fault(&format!("is a chunk that cannot be decompressed: {error}")))?;
        if bytes.len() as u64 != u64::from(size) {
            return Err(fields.fault("is a chunk with fewer bytes than it declares"));
        }
        Ok(Some(bytes))
    }
}

/// The named fields of a header.
struct BagFields<'a> {
    /// Names and values.
    fields: Vec<(&'a [u8], &'a [u8])>,
    /// Position in the file behind the record, in bytes; in a chunk that behind the chunk.
    place: u64,
}

impl<'a> BagFields<'a> {
    /// Splits a header into `name=value`, each with its length before it.
    fn parse(header: &'a [u8], place: u64) -> Result<Self, RecordingFault> {
        let mut fields = Self {
            fields: Vec::new(),
            place,
        };
        let mut rest = header;
        while !rest.is_empty() {
            let split = rest.split_first_chunk::<4>().and_then(|(length, rest)| {
                let length = usize::try_from(u32::from_le_bytes(*length)).ok()?;
                rest.split_at_checked(length)
            });
            let Some((field, after)) = split else {
                return Err(fields.fault("has a header that is shorter than its fields"));
            };
            let Some(at) = field.iter().position(|byte| *byte == b'=') else {
                return Err(fields.fault("has a field without a name"));
            };
            fields.fields.push((&field[..at], &field[at + 1..]));
            rest = after;
        }
        Ok(fields)
    }

    /// The value of a field.
    fn get(&self, name: &str) -> Option<&'a [u8]> {
        let found = self.fields.iter().find(|(known, _)| *known == name.as_bytes());
        found.map(|(_, value)| *value)
    }

    /// The code of the record.
    fn code(&self) -> Result<u8, RecordingFault> {
        match self.get("op") {
            Some([code]) => Ok(*code),
            _ => Err(self.fault("has no code")),
        }
    }

    /// A field of four bytes.
    fn u32(&self, name: &str) -> Result<u32, RecordingFault> {
        let bytes = self.get(name).and_then(|value| value.try_into().ok());
        let missing = || self.fault(&format!("has no number `{name}`"));
        bytes.map(u32::from_le_bytes).ok_or_else(missing)
    }

    /// The time of a message: seconds and nanoseconds.
    fn time(&self) -> Result<[u32; 2], RecordingFault> {
        let Some(bytes) = self.get("time").and_then(|value| <[u8; 8]>::try_from(value).ok()) else {
            return Err(self.fault("has no time"));
        };
        let [a, b, c, d, e, f, g, h] = bytes;
        Ok([u32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, h])])
    }

    /// A fault of the record.
    fn fault(&self, says: &str) -> RecordingFault {
        format_fault(format!("the record before byte {} {says}", self.place))
    }
}

/// The fault of a file with other contents.
fn format_fault(says: impl Into<String>) -> RecordingFault {
    RecordingFault::Format {
        format: "a bag of ROS 1",
        message: says.into(),
    }
}

/// The fault of a stream that cannot be read or ends too early.
fn unreadable_fault(error: &io::Error) -> RecordingFault {
    if error.kind() == io::ErrorKind::UnexpectedEof {
        return format_fault("it ends in the middle of a record; copy it again, or repair it with `rosbag reindex`");
    }
    format_fault(format!("it cannot be read: {error}"))
}
