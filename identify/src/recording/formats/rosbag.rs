//! Robot logs of rosbag2 from before MCAP: a SQLite database with a table of topics and one of messages.
//!
//! The file goes in; its messages go to a [`BagCollector`], which makes columns of them.

use std::collections::BTreeMap;
use std::io;

use crate::recording::error::RecordingFault;
use crate::recording::formats::bag::{BagCollector, BagEncoding, MessageLogFormat};
use crate::recording::formats::packing::CompressionMethod;
use crate::recording::formats::sqlite::{self, SqliteDatabase, SqliteValue};
use crate::recording::formats::{ReadSeek, RecordingInput};

/// Largest message that was compressed by itself, in bytes after decompression.
const LONGEST_MESSAGE: u64 = 64 << 20;
/// First bytes of a message that was compressed by itself; an uncompressed one begins with a zero.
const ZSTD: [u8; 4] = [0x28, 0xB5, 0x2F, 0xFD];

/// The format of rosbag2 in SQLite.
pub(crate) struct Rosbag2Format;

impl MessageLogFormat for Rosbag2Format {
    fn log_suffix(&self) -> &'static str {
        " (rosbag2)"
    }

    fn log_extensions(&self) -> &'static [&'static str] {
        &["db3"]
    }

    // The signature of SQLite; whether it is a log is known only from its tables.
    fn has_log_signature(&self, first: &[u8]) -> bool {
        first.starts_with(sqlite::MAGIC)
    }

    // Rows are read page by page, so a file need not be in memory.
    fn pass_messages(&self, input: RecordingInput<'_>, bag: &mut BagCollector<'_>) -> Result<(), RecordingFault> {
        replay_messages(&mut input.seekable()?, bag)
    }
}

/// Registers the topics of a database and passes all its messages to the collector.
/// Fails when the tables of a log are missing, or when a message cannot be read.
fn replay_messages(stream: &mut dyn ReadSeek, bag: &mut BagCollector<'_>) -> Result<(), RecordingFault> {
    // Definitions of message types; older files do not have this table.
    let mut database = SqliteDatabase::open(stream).map_err(|error| unreadable_fault(&error))?;
    let mut definitions = BTreeMap::new();
    let columns = ["topic_type", "encoding", "encoded_message_definition"];
    database
        .visit_rows("message_definitions", &columns, &mut |row| {
            let [kind, encoding, text] = &row[..] else {
                return Ok(());
            };
            // Encoding and text of the definition, by the name of the type.
            let says = (encoding.as_text().to_owned(), text.as_text().to_owned());
            definitions.insert(kind.as_text().to_owned(), says);
            Ok(())
        })
        .map_err(|error| unreadable_fault(&error))?;
    // Topics: their numbers in the database and in the collector.
    let mut topics = BTreeMap::new();
    let columns = ["id", "name", "type", "serialization_format"];
    let has_topics = database
        .visit_rows("topics", &columns, &mut |row| {
            if let [SqliteValue::Integer(id), name, kind, form] = &row[..] {
                // Without a definition the collector uses its own ones for common types.
                let (definition, text) = definitions.get(kind.as_text()).cloned().unwrap_or_default();
                let encoding = BagEncoding {
                    messages: form.as_text(),
                    definition: &definition,
                    text: &text,
                };
                topics.insert(*id, bag.register_topic(name.as_text(), kind.as_text(), &encoding));
            }
            Ok(())
        })
        .map_err(|error| unreadable_fault(&error))?;
    // Messages; a fault of the collector is kept, because rows can only report errors of reading.
    let mut fault = None;
    let columns = ["topic_id", "timestamp", "data"];
    let has_messages = database.visit_rows("messages", &columns, &mut |row| {
        let [topic, SqliteValue::Integer(time), SqliteValue::Bytes(bytes)] = &row[..] else {
            return Err(io::Error::other("a row of `messages` in it is not a message"));
        };
        // Each message must belong to a topic.
        let Some(topic) = topic.as_integer().and_then(|id| topics.get(&id)) else {
            return Err(io::Error::other("a message in it has no topic"));
        };
        // rosbag2 can compress single messages instead of the file.
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
    // The fault of the collector is more precise than the error of reading.
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

/// The fault of a file that is not a log of rosbag2.
fn format_fault(says: impl Into<String>) -> RecordingFault {
    RecordingFault::Format {
        format: "a SQLite file, as rosbag2 writes them",
        message: says.into(),
    }
}

/// The fault of a database that cannot be read.
fn unreadable_fault(error: &io::Error) -> RecordingFault {
    format_fault(format!("it cannot be read: {error}; is it complete?"))
}
