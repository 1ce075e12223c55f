//! Logs of robots as rosbag2 wrote them before MCAP: a SQLite database with a table of topics and one of messages.

use std::collections::BTreeMap;
use std::io;

use crate::recording::error::Fault;
use crate::recording::formats::bag::{self, Bag, Encoding};
use crate::recording::formats::packing::Packing;
use crate::recording::formats::sqlite::{self, Database, Value};
use crate::recording::formats::{Format, Input, ReadSeek, TableInfo};
use crate::recording::{ReadOptions, Recording};

/// The longest message that was packed by itself.
const LONGEST_MESSAGE: u64 = 64 << 20;
/// What begins a message that was packed by itself; an unpacked one begins with a zero.
const ZSTD: [u8; 4] = [0x28, 0xB5, 0x2F, 0xFD];

/// What rosbag2 writes into SQLite.
pub(crate) struct Rosbag2;

impl Format for Rosbag2 {
    fn suffix(&self) -> &'static str {
        " (rosbag2)"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["db3"]
    }

    fn begins(&self, first: &[u8]) -> bool {
        first.starts_with(sqlite::MAGIC)
    }

    fn read(
        &self,
        input: Input<'_>,
        file: &str,
        options: &ReadOptions,
    ) -> Result<Recording, Fault> {
        let mut stream = input.seekable()?;
        bag::read(&mut |bag| show(&mut stream, bag), file, options)
    }

    fn names(&self, input: Input<'_>) -> Result<Vec<String>, Fault> {
        let mut stream = input.seekable()?;
        bag::names(&mut |bag| show(&mut stream, bag))
    }

    fn tables(&self, input: Input<'_>) -> Result<Vec<TableInfo>, Fault> {
        let mut stream = input.seekable()?;
        bag::tables(&mut |bag| show(&mut stream, bag))
    }
}

fn show(stream: &mut dyn ReadSeek, bag: &mut Bag<'_>) -> Result<(), Fault> {
    let mut database = Database::open(stream).map_err(|error| unreadable(&error))?;
    let mut definitions = BTreeMap::new();
    let columns = ["topic_type", "encoding", "encoded_message_definition"];
    database
        .show("message_definitions", &columns, &mut |row| {
            let [kind, encoding, text] = &row[..] else {
                return Ok(());
            };
            let says = (encoding.text().to_owned(), text.text().to_owned());
            definitions.insert(kind.text().to_owned(), says);
            Ok(())
        })
        .map_err(|error| unreadable(&error))?;
    let mut topics = BTreeMap::new();
    let columns = ["id", "name", "type", "serialization_format"];
    let has_topics = database
        .show("topics", &columns, &mut |row| {
            if let [Value::Whole(id), name, kind, form] = &row[..] {
                let (definition, text) = definitions.get(kind.text()).cloned().unwrap_or_default();
                let encoding = Encoding {
                    messages: form.text(),
                    definition: &definition,
                    text: &text,
                };
                topics.insert(*id, bag.topic(name.text(), kind.text(), &encoding));
            }
            Ok(())
        })
        .map_err(|error| unreadable(&error))?;
    let mut fault = None;
    let columns = ["topic_id", "timestamp", "data"];
    let has_messages = database.show("messages", &columns, &mut |row| {
        let [topic, Value::Whole(time), Value::Bytes(bytes)] = &row[..] else {
            return Err(io::Error::other("a message in it is none"));
        };
        let Some(topic) = topic.whole().and_then(|id| topics.get(&id)) else {
            return Err(io::Error::other("a message in it is of no topic"));
        };
        let unpacked;
        let bytes = if bytes.starts_with(&ZSTD) {
            unpacked = Packing::Zstd.unpacked(bytes, LONGEST_MESSAGE)?;
            &unpacked
        } else {
            bytes
        };
        bag.message(*topic, *time, bytes).map_err(|found| {
            fault = Some(found);
            io::Error::other("")
        })
    });
    if let Some(fault) = fault {
        return Err(fault);
    }
    if !has_messages.map_err(|error| unreadable(&error))? || !has_topics {
        return Err(broken(
            "it has no tables `topics` and `messages`, so it is no log of a robot",
        ));
    }
    Ok(())
}

fn broken(says: impl Into<String>) -> Fault {
    Fault::Format {
        format: "a SQLite file, as rosbag2 writes them",
        says: says.into(),
    }
}

fn unreadable(error: &io::Error) -> Fault {
    broken(format!("it cannot be read: {error}; is it complete?"))
}
