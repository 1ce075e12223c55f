//! Logs of robots as rosbag2 wrote them before MCAP: a SQLite database with a table of topics and one of messages.

use std::collections::BTreeMap;
use std::io;

use crate::recording::error::RecordingFault;
use crate::recording::formats::bag::{self, BagCollector, BagEncoding};
use crate::recording::formats::packing::CompressionMethod;
use crate::recording::formats::sqlite::{self, SqliteDatabase, SqliteValue};
use crate::recording::formats::{ReadSeek, RecordingFormat, RecordingInput, TableInfo};
use crate::recording::{ReadOptions, SignalRecording};

/// The longest message that was packed by itself.
const LONGEST_MESSAGE: u64 = 64 << 20;
/// What begins a message that was packed by itself; an unpacked one begins with a zero.
const ZSTD: [u8; 4] = [0x28, 0xB5, 0x2F, 0xFD];

/// What rosbag2 writes into SQLite.
pub(crate) struct Rosbag2Format;

impl RecordingFormat for Rosbag2Format {
    fn suffix(&self) -> &'static str {
        " (rosbag2)"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["db3"]
    }

    fn has_signature(&self, first: &[u8]) -> bool {
        first.starts_with(sqlite::MAGIC)
    }

    fn read(
        &self,
        input: RecordingInput<'_>,
        file: &str,
        options: &ReadOptions,
    ) -> Result<SignalRecording, RecordingFault> {
        let mut stream = input.seekable()?;
        bag::read(&mut |bag| replay_messages(&mut stream, bag), file, options)
    }

    fn names(&self, input: RecordingInput<'_>) -> Result<Vec<String>, RecordingFault> {
        let mut stream = input.seekable()?;
        bag::names(&mut |bag| replay_messages(&mut stream, bag))
    }

    fn tables(&self, input: RecordingInput<'_>) -> Result<Vec<TableInfo>, RecordingFault> {
        let mut stream = input.seekable()?;
        bag::tables(&mut |bag| replay_messages(&mut stream, bag))
    }
}

fn replay_messages(
    stream: &mut dyn ReadSeek,
    bag: &mut BagCollector<'_>,
) -> Result<(), RecordingFault> {
    let mut database = SqliteDatabase::open(stream).map_err(|error| unreadable_fault(&error))?;
    let mut definitions = BTreeMap::new();
    let columns = ["topic_type", "encoding", "encoded_message_definition"];
    database
        .visit_rows("message_definitions", &columns, &mut |row| {
            let [kind, encoding, text] = &row[..] else {
                return Ok(());
            };
            let says = (encoding.as_text().to_owned(), text.as_text().to_owned());
            definitions.insert(kind.as_text().to_owned(), says);
            Ok(())
        })
        .map_err(|error| unreadable_fault(&error))?;
    let mut topics = BTreeMap::new();
    let columns = ["id", "name", "type", "serialization_format"];
    let has_topics = database
        .visit_rows("topics", &columns, &mut |row| {
            if let [SqliteValue::Integer(id), name, kind, form] = &row[..] {
                let (definition, text) =
                    definitions.get(kind.as_text()).cloned().unwrap_or_default();
                let encoding = BagEncoding {
                    messages: form.as_text(),
                    definition: &definition,
                    text: &text,
                };
                topics.insert(
                    *id,
                    bag.register_topic(name.as_text(), kind.as_text(), &encoding),
                );
            }
            Ok(())
        })
        .map_err(|error| unreadable_fault(&error))?;
    let mut fault = None;
    let columns = ["topic_id", "timestamp", "data"];
    let has_messages = database.visit_rows("messages", &columns, &mut |row| {
        let [topic, SqliteValue::Integer(time), SqliteValue::Bytes(bytes)] = &row[..] else {
            return Err(io::Error::other(
                "a row of `messages` in it is not a message",
            ));
        };
        let Some(topic) = topic.as_integer().and_then(|id| topics.get(&id)) else {
            return Err(io::Error::other("a message in it has no topic"));
        };
        let unpacked;
        let bytes = if bytes.starts_with(&ZSTD) {
            unpacked = CompressionMethod::Zstd.decompress(bytes, LONGEST_MESSAGE)?;
            &unpacked
        } else {
            bytes
        };
        bag.take_message(*topic, *time, bytes).map_err(|found| {
            fault = Some(found);
            io::Error::other("")
        })
    });
    if let Some(fault) = fault {
        return Err(fault);
    }
    if !has_messages.map_err(|error| unreadable_fault(&error))? || !has_topics {
        return Err(format_fault(
            "it has no tables `topics` and `messages`, so it is not a robot log",
        ));
    }
    Ok(())
}

fn format_fault(says: impl Into<String>) -> RecordingFault {
    RecordingFault::Format {
        format: "a SQLite file, as rosbag2 writes them",
        message: says.into(),
    }
}

fn unreadable_fault(error: &io::Error) -> RecordingFault {
    format_fault(format!("it cannot be read: {error}; is it complete?"))
}
