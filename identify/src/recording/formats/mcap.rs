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

use crate::recording::error::Fault;
use crate::recording::formats::bag::{self, Bag, Encoding};
use crate::recording::formats::packing::{Packing, check_growth};
use crate::recording::formats::{Format, Input, TableInfo};
use crate::recording::{ReadOptions, Recording};

const MAGIC: [u8; 8] = *b"\x89MCAP0\r\n";
/// The largest record that is taken into memory, such as a chunk; writers make some of a megabyte.
const LARGEST: u64 = 128 << 20;

/// What ROS 2 and Foxglove write.
pub(crate) struct Mcap;

impl Format for Mcap {
    fn suffix(&self) -> &'static str {
        " (MCAP)"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["mcap"]
    }

    fn begins(&self, first: &[u8]) -> bool {
        first.starts_with(&MAGIC)
    }

    fn read(
        &self,
        input: Input<'_>,
        file: &str,
        options: &ReadOptions,
    ) -> Result<Recording, Fault> {
        bag::read(&mut once(input), file, options)
    }

    fn names(&self, input: Input<'_>) -> Result<Vec<String>, Fault> {
        bag::names(&mut once(input))
    }

    fn tables(&self, input: Input<'_>) -> Result<Vec<TableInfo>, Fault> {
        bag::tables(&mut once(input))
    }
}

/// Shows the messages of a file, which can be done once.
fn once(input: Input<'_>) -> impl FnMut(&mut Bag<'_>) -> Result<(), Fault> + use<'_> {
    let mut stream = Some(input.stream());
    move |bag| match stream.take() {
        Some(stream) => show(stream, bag),
        None => Ok(()),
    }
}

fn show(stream: impl Read, bag: &mut Bag<'_>) -> Result<(), Fault> {
    let mut stream = BufReader::with_capacity(1 << 20, stream);
    let mut file = File::default();
    let mut magic = [0; 8];
    stream
        .read_exact(&mut magic)
        .map_err(|error| unreadable(&error))?;
    loop {
        let mut kind = [0];
        stream
            .read_exact(&mut kind)
            .map_err(|error| unreadable(&error))?;
        let mut length = [0; 8];
        stream
            .read_exact(&mut length)
            .map_err(|error| unreadable(&error))?;
        let length = u64::from_le_bytes(length);
        match kind[0] {
            // What follows the end of the data repeats it, for those who go to and fro.
            Record::DATA_END | Record::FOOTER => return Ok(()),
            Record::CHUNK | Record::SCHEMA | Record::CHANNEL | Record::MESSAGE => {
                if length > LARGEST {
                    return Err(broken("a record in it is larger than 128 MB"));
                }
                // What is not there takes no memory, whatever the length says.
                let mut bytes = Vec::new();
                let read = (&mut stream).take(length).read_to_end(&mut bytes);
                if read.map_err(|error| unreadable(&error))? as u64 != length {
                    return Err(unreadable(&io::ErrorKind::UnexpectedEof.into()));
                }
                file.record(kind[0], &bytes, bag)?;
            }
            _ => {
                let passed = io::copy(&mut (&mut stream).take(length), &mut io::sink());
                if passed.map_err(|error| unreadable(&error))? != length {
                    return Err(unreadable(&io::ErrorKind::UnexpectedEof.into()));
                }
            }
        }
    }
}

/// Kinds of records that are looked at.
struct Record;

impl Record {
    const FOOTER: u8 = 0x02;
    const SCHEMA: u8 = 0x03;
    const CHANNEL: u8 = 0x04;
    const MESSAGE: u8 = 0x05;
    const CHUNK: u8 = 0x06;
    const DATA_END: u8 = 0x0F;
}

/// What is known of a file so far.
#[derive(Default)]
struct File {
    /// Name, encoding and text of definitions.
    schemas: BTreeMap<u16, (String, String, String)>,
    /// Topics of channels; several channels may write on one.
    channels: BTreeMap<u16, usize>,
    topics: BTreeMap<(String, u16), usize>,
    /// Bytes of chunks so far, packed and unpacked.
    packed: u64,
    unpacked: u64,
}

impl File {
    fn record(&mut self, kind: u8, bytes: &[u8], bag: &mut Bag<'_>) -> Result<(), Fault> {
        let mut fields = Fields(bytes);
        match kind {
            Record::SCHEMA => {
                let id = fields.u16()?;
                let (name, encoding) = (fields.text()?, fields.text()?);
                let text = fields.text()?;
                self.schemas.insert(id, (name, encoding, text));
            }
            Record::CHANNEL => {
                let (id, schema) = (fields.u16()?, fields.u16()?);
                let (topic, encoding) = (fields.text()?, fields.text()?);
                let nameless = Default::default();
                let (name, definition, text) = self.schemas.get(&schema).unwrap_or(&nameless);
                let encoding = Encoding {
                    messages: &encoding,
                    definition: if schema == 0 { "none" } else { definition },
                    text,
                };
                let known = self.topics.entry((topic.clone(), schema));
                let number = *known.or_insert_with(|| bag.topic(&topic, name, &encoding));
                self.channels.insert(id, number);
            }
            Record::MESSAGE => {
                let channel = fields.u16()?;
                fields.take(4)?;
                let log = fields.u64()?;
                fields.take(8)?;
                let Some(topic) = self.channels.get(&channel) else {
                    return Err(broken("a message in it is of no channel"));
                };
                bag.message(*topic, log.cast_signed(), fields.0)?;
            }
            Record::CHUNK => {
                fields.take(16)?;
                let unpacked = fields.u64()?;
                let sum = fields.u32()?;
                let packing = fields.text()?;
                let length = fields.u64()?;
                if length != fields.0.len() as u64 || unpacked > LARGEST {
                    return Err(broken("a chunk in it is larger than it can be"));
                }
                let packing = match packing.as_str() {
                    "" => None,
                    "zstd" => Some(Packing::Zstd),
                    "lz4" => Some(Packing::Lz4),
                    other => {
                        return Err(broken(format!(
                            "a chunk in it is packed by `{other}`, which is not read"
                        )));
                    }
                };
                self.packed += length;
                self.unpacked = self.unpacked.saturating_add(unpacked);
                check_growth(self.packed, self.unpacked).map_err(|error| unreadable(&error))?;
                match packing {
                    None => self.chunk(fields.0, sum, bag)?,
                    Some(packing) => {
                        let bytes = packing.unpacked(fields.0, unpacked);
                        self.chunk(&bytes.map_err(|error| unreadable(&error))?, sum, bag)?;
                    }
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn chunk(&mut self, bytes: &[u8], sum: u32, bag: &mut Bag<'_>) -> Result<(), Fault> {
        if sum != 0 {
            let mut crc = flate2::Crc::new();
            crc.update(bytes);
            if crc.sum() != sum {
                return Err(broken("the sum over a chunk is not the one that it says"));
            }
        }
        let mut records = Fields(bytes);
        while !records.0.is_empty() {
            let kind = records.take(1)?[0];
            let length = usize::try_from(records.u64()?).unwrap_or(usize::MAX);
            let bytes = records.take(length)?;
            if kind != Record::CHUNK {
                self.record(kind, bytes, bag)?;
            }
        }
        Ok(())
    }
}

/// The fields of a record that are left.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn take(&mut self, n: usize) -> Result<&'a [u8], Fault> {
        let Some((taken, rest)) = self.0.split_at_checked(n) else {
            return Err(broken("a record in it is shorter than what it holds"));
        };
        self.0 = rest;
        Ok(taken)
    }

    fn of_size<const N: usize>(&mut self) -> Result<[u8; N], Fault> {
        let mut bytes = [0; N];
        bytes.copy_from_slice(self.take(N)?);
        Ok(bytes)
    }

    fn u16(&mut self) -> Result<u16, Fault> {
        Ok(u16::from_le_bytes(self.of_size()?))
    }

    fn u32(&mut self) -> Result<u32, Fault> {
        Ok(u32::from_le_bytes(self.of_size()?))
    }

    fn u64(&mut self) -> Result<u64, Fault> {
        Ok(u64::from_le_bytes(self.of_size()?))
    }

    fn text(&mut self) -> Result<String, Fault> {
        let length = self.u32()? as usize;
        Ok(String::from_utf8_lossy(self.take(length)?).into_owned())
    }
}

fn broken(says: impl Into<String>) -> Fault {
    Fault::Format {
        format: "an MCAP file",
        says: says.into(),
    }
}

fn unreadable(error: &io::Error) -> Fault {
    if error.kind() == io::ErrorKind::UnexpectedEof {
        return broken("it ends before its data do; copy it again, or mend it with `mcap recover`");
    }
    broken(format!("it cannot be read: {error}"))
}
