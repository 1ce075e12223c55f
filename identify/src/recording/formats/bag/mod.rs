//! Robot logs: messages of several topics go in, one by one. Columns come out, joined on time.
//!
//! A number of a message becomes the column `topic.field`, an element of a list `topic.field_1`. If the message has a
//! list of names of the same length, as `sensor_msgs/JointState`, the column is `topic.position.elbow`. The time of a
//! message is its `header.stamp`, or the time of its arrival if it has none.

mod definition;
mod message;

use std::collections::{BTreeMap, BTreeSet, HashSet};

use indexmap::IndexMap;

use crate::recording::column::SampleField;
use crate::recording::error::RecordingFault;
use crate::recording::formats::{RecordingFormat, RecordingInput};
use crate::recording::intake::{IntakeFlow, SampleIntake};
use crate::recording::join::{JoinPart, join_parts};
use crate::recording::notes::RecordingNote;
use crate::recording::tables::{ColumnInfo, TableInfo};
use crate::recording::{ReadOptions, SignalRecording};
use crate::words::backquoted_list;

use definition::RosVersion;
use message::{RosMessageContent, RosMessageReader};

/// Most forms of messages of a topic, such as sets of joints that are published in turns.
const MOST_LAYOUTS: usize = 64;
/// Most forms of bytes that are remembered.
const MOST_SHAPES: usize = 1024;
/// Most columns of a topic.
const MOST_COLUMNS: usize = 1 << 17;
/// Most topics that are read; each takes some kilobytes. Logs of large robots have some thousand.
const MOST_TOPICS: usize = 10_000;
/// Memory of an arrival, in numbers, including what is sorted and joined later.
const ARRIVAL: usize = 8;
/// Times below this many nanoseconds, 104 days, are exact as seconds. Larger ones are counted from the first one.
const EXACT: i64 = 1 << 53;

/// Collects the columns of a log while its messages are read.
pub(crate) struct BagCollector<'a> {
    /// Topics in the order of registration.
    topics: Vec<BagTopic>,
    /// Whether the numbers of a column are kept, by its name.
    is_kept: &'a dyn Fn(&str) -> bool,
    /// Numbers that are kept so far, with those for arrivals.
    kept_numbers: usize,
    /// Most numbers that may be kept.
    max_numbers: usize,
    /// The last message; kept to use its memory again.
    content: RosMessageContent,
}

/// The encoding of the messages of a topic.
pub(super) struct BagEncoding<'a> {
    /// `cdr` or `ros1`; others are not supported.
    pub(super) messages: &'a str,
    /// `ros2msg`, `ros1msg` or empty; others are not supported.
    pub(super) definition: &'a str,
    /// Text of the definition.
    pub(super) text: &'a str,
}

/// A topic with its messages so far.
struct BagTopic {
    /// Name without a leading slash.
    name: String,
    /// Type of its messages.
    kind: String,
    /// The reader of its messages, or why they are skipped.
    reader: Result<RosMessageReader, String>,
    /// All columns that any of its messages has.
    columns: IndexMap<String, TopicColumn>,
    /// Forms of its messages.
    layouts: Vec<BagMessageLayout>,
    /// Form of each shape of bytes that is remembered.
    shapes: BTreeMap<Vec<u8>, usize>,
    /// Messages whose numbers are kept.
    messages: Vec<MessageArrival>,
    /// Number of messages.
    count: usize,
}

/// A form of messages: those with the same columns.
struct BagMessageLayout {
    /// Indices of its columns.
    places: Vec<usize>,
    /// Whether numbers of any of its columns are kept.
    is_kept: bool,
    /// Number of messages.
    count: usize,
    /// First and last time of arrival, ns.
    log: Option<(i64, i64)>,
    /// First and last time in the messages, ns.
    stamp: Option<(i64, i64)>,
    /// Whether all messages have a time of their own other than zero.
    has_stamps: bool,
}

/// A column of a topic.
struct TopicColumn {
    /// Type of its numbers.
    kind: &'static str,
    /// Forms of messages that have the column.
    layouts: BTreeSet<usize>,
    /// Its numbers, if they are kept.
    values: Option<Vec<f64>>,
}

/// One message, without its numbers.
#[derive(Clone, Copy)]
struct MessageArrival {
    /// Index of its form.
    layout: usize,
    /// Time of its arrival, ns.
    log: i64,
    /// Time in the message, ns.
    stamp: Option<i64>,
}

/// Columns of a topic that occur in the same messages.
struct BagTable {
    /// Name of the topic.
    topic: String,
    /// Names, types, and the numbers if they are kept.
    columns: Vec<(String, &'static str, Option<Vec<f64>>)>,
    /// Times of the messages whose numbers are kept, ns, in the order of arrival.
    time: Vec<i64>,
    /// Whether the times are those of the messages; otherwise they are those of arrival.
    has_stamps: bool,
    /// Number of messages.
    samples: usize,
    /// First and last time of all messages, ns.
    span: Option<(i64, i64)>,
}

impl<'a> BagCollector<'a> {
    /// Starts a collection; `most` is the largest number of numbers to keep.
    fn new(is_kept: &'a dyn Fn(&str) -> bool, most: usize) -> Self {
        Self {
            topics: Vec::new(),
            is_kept,
            kept_numbers: 0,
            max_numbers: most,
            content: RosMessageContent::default(),
        }
    }

    /// Registers a topic. The result identifies it in [`Self::take_message`].
    pub(super) fn register_topic(&mut self, name: &str, kind: &str, encoding: &BagEncoding<'_>) -> usize {
        // Encoding and definition decide the version of ROS.
        let ros = match (encoding.messages, encoding.definition) {
            ("cdr", "ros2msg" | "") => Ok(RosVersion::Two),
            ("ros1", "ros1msg") => Ok(RosVersion::One),
            ("cdr" | "ros1", other) => Err(format!("its definition is `{other}`, which is not supported")),
            (other, _) => Err(format!("its messages are encoded as `{other}`, which is not supported")),
        };
        // A topic that cannot be read is kept with the reason and reported only if it is listed.
        let ros = ros.and_then(|ros| {
            if self.topics.len() >= MOST_TOPICS {
                return Err(format!(
                    "the log has more than {MOST_TOPICS} topics, of which the first ones are read"
                ));
            }
            Ok(ros)
        });
        let reader = ros.and_then(|ros| {
            let definition = definition::parse_definition(kind, encoding.text, ros)?;
            let is_common = definition::is_definition_missing(encoding.text);
            Ok(RosMessageReader::new(definition, ros, is_common))
        });
        let name = name.strip_prefix('/').unwrap_or(name);
        self.topics.push(BagTopic {
            name: name.to_owned(),
            kind: kind.to_owned(),
            reader,
            columns: IndexMap::new(),
            layouts: Vec::new(),
            shapes: BTreeMap::new(),
            messages: Vec::new(),
            count: 0,
        });
        self.topics.len() - 1
    }

    /// Takes a message that arrived at `log`, ns.
    ///
    /// Fails when it cannot be read although earlier messages of its topic could be, or when too many numbers would
    /// be kept.
    pub(super) fn take_message(&mut self, topic: usize, log: i64, bytes: &[u8]) -> Result<(), RecordingFault> {
        let topic = &mut self.topics[topic];
        topic.count += 1;
        let Ok(reader) = &topic.reader else {
            return Ok(());
        };
        // Read the numbers, then find the form of the message.
        let layout = reader
            .read(bytes, &mut self.content)
            .and_then(|()| topic.layout_of_message(bytes, &self.content, self.is_kept));
        let layout = match layout {
            Ok(layout) => layout,
            // If the first message fails, the complete topic is skipped.
            Err(says) if topic.count == 1 => {
                topic.reader = Err(format!("its first message cannot be read: {says}"));
                return Ok(());
            }
            Err(says) => {
                return Err(RecordingFault::Format {
                    format: "a log of ROS messages",
                    message: format!(
                        "message {} of `{}` cannot be read: {says}; is the file complete, and the definition its own?",
                        topic.count, topic.name
                    ),
                });
            }
        };
        // Count the message and extend the time ranges of its form.
        let form = &mut topic.layouts[layout];
        let stamp = self.content.stamp;
        form.count += 1;
        extend_span(&mut form.log, log);
        extend_span(&mut form.stamp, stamp.unwrap_or(0));
        form.has_stamps &= stamp.is_some_and(|stamp| stamp != 0);
        if !form.is_kept {
            return Ok(());
        }
        // Keep the numbers of needed columns.
        for (place, value) in form.places.iter().zip(&self.content.numbers) {
            if let Some(values) = &mut topic.columns[*place].values {
                values.push(*value);
                self.kept_numbers += 1;
            }
        }
        topic.messages.push(MessageArrival { layout, log, stamp });
        self.kept_numbers += ARRIVAL;
        // The limit includes memory for sorting and joining.
        if self.kept_numbers > self.max_numbers {
            return Err(RecordingFault::TooLarge {
                line: topic.count as u64,
                samples: topic.count,
                columns: topic.columns.len(),
                until: None,
            });
        }
        Ok(())
    }

    /// The tables of all topics.
    fn tables(self) -> Vec<BagTable> {
        self.topics.into_iter().flat_map(BagTopic::tables).collect()
    }
}

impl BagTopic {
    /// The form of a message with known numbers and shape; new forms and columns are added.
    ///
    /// Fails when columns have equal names, or when there are too many columns or forms.
    fn layout_of_message(
        &mut self,
        bytes: &[u8],
        content: &RosMessageContent,
        is_kept: &dyn Fn(&str) -> bool,
    ) -> Result<usize, String> {
        // Most messages have a shape that is known.
        if let Some(known) = self.shapes.get(&content.shape) {
            return Ok(*known);
        }
        // Otherwise the names of the columns are decoded from the bytes.
        let reader = self.reader.as_ref().map_err(Clone::clone)?;
        let columns = reader.columns(bytes)?;
        if columns.len() != content.numbers.len() {
            return Err("its columns cannot be determined".to_owned());
        }
        // Indices of the columns; new ones are added to the topic.
        let mut places = Vec::with_capacity(columns.len());
        let mut taken = HashSet::with_capacity(columns.len());
        for (name, kind) in columns {
            let name = format!("{}.{name}", self.name);
            let entry = self.columns.entry(name);
            let place = entry.index();
            entry.or_insert_with_key(|name| TopicColumn {
                kind,
                layouts: BTreeSet::new(),
                values: is_kept(name).then(Vec::new),
            });
            if !taken.insert(place) {
                return Err(format!(
                    "two of its numbers are called `{}`",
                    self.columns.get_index(place).map_or("", |(name, _)| name)
                ));
            }
            places.push(place);
        }
        if self.columns.len() > MOST_COLUMNS {
            return Err("it has more columns than any recording".to_owned());
        }
        // Another shape may have the same columns.
        let known = self.layouts.iter().position(|layout| layout.places == places);
        // A new form is registered in all of its columns.
        let layout = known.unwrap_or_else(|| {
            for place in &places {
                self.columns[*place].layouts.insert(self.layouts.len());
            }
            self.layouts.push(BagMessageLayout {
                is_kept: places.iter().any(|place| self.columns[*place].values.is_some()),
                places,
                count: 0,
                log: None,
                stamp: None,
                has_stamps: true,
            });
            self.layouts.len() - 1
        });
        if self.layouts.len() > MOST_LAYOUTS {
            return Err("names or lengths of lists in it change again and again".to_owned());
        }
        // Memory of shapes is limited; they are decoded again when needed.
        if self.shapes.len() >= MOST_SHAPES {
            self.shapes.clear();
        }
        self.shapes.insert(content.shape.clone(), layout);
        Ok(layout)
    }

    /// Its columns, grouped by the messages in which they occur; messages are in the order of their arrival.
    fn tables(self) -> Vec<BagTable> {
        // Columns with the same set of forms belong to one table.
        let mut tables: IndexMap<BTreeSet<usize>, Vec<(String, TopicColumn)>> = IndexMap::new();
        for (name, column) in self.columns {
            tables.entry(column.layouts.clone()).or_default().push((name, column));
        }
        // Publishers without a clock leave the time at zero.
        let has_stamps = self.layouts.iter().all(|layout| layout.has_stamps);
        let time_of = |one: &MessageArrival| match one.stamp {
            Some(stamp) if has_stamps => stamp,
            _ => one.log,
        };
        let mut all = Vec::new();
        for (layouts, columns) in tables {
            // The messages of the table, sorted by arrival.
            let messages: Vec<&MessageArrival> = self
                .messages
                .iter()
                .filter(|one| layouts.contains(&one.layout))
                .collect();
            let mut order: Vec<usize> = (0..messages.len()).collect();
            order.sort_by_key(|k| messages[*k].log);
            let sorted = |values: Vec<f64>| order.iter().map(|k| values[*k]).collect();
            let forms = || layouts.iter().map(|layout| &self.layouts[*layout]);
            // The time range covers all messages, also those that are not kept.
            let mut span = None;
            for (first, last) in forms().filter_map(|form| if has_stamps { form.stamp } else { form.log }) {
                extend_span(&mut span, first);
                extend_span(&mut span, last);
            }
            all.push(BagTable {
                samples: forms().map(|form| form.count).sum(),
                span,
                topic: self.name.clone(),
                time: order.iter().map(|k| time_of(messages[*k])).collect(),
                has_stamps,
                columns: columns
                    .into_iter()
                    .map(|(name, column)| (name, column.kind, column.values.map(sorted)))
                    .collect(),
            });
        }
        all
    }
}

/// A format of robot logs; every one is a format of recordings.
pub(crate) trait MessageLogFormat: Sync {
    /// See [`RecordingFormat::suffix`].
    fn log_suffix(&self) -> &'static str;
    /// See [`RecordingFormat::extensions`].
    fn log_extensions(&self) -> &'static [&'static str];
    /// See [`RecordingFormat::has_signature`].
    fn has_log_signature(&self, first: &[u8]) -> bool;
    /// Passes all messages of a log to a collector.
    fn pass_messages(&self, input: RecordingInput<'_>, bag: &mut BagCollector<'_>) -> Result<(), RecordingFault>;
}

impl<T: MessageLogFormat> RecordingFormat for T {
    fn suffix(&self) -> &'static str {
        self.log_suffix()
    }

    fn extensions(&self) -> &'static [&'static str] {
        self.log_extensions()
    }

    fn has_signature(&self, first: &[u8]) -> bool {
        self.has_log_signature(first)
    }

    fn read(
        &self,
        input: RecordingInput<'_>,
        file: &str,
        options: &ReadOptions,
    ) -> Result<SignalRecording, RecordingFault> {
        read(self, input, file, options)
    }

    fn names(&self, input: RecordingInput<'_>) -> Result<Vec<String>, RecordingFault> {
        let mut bag = BagCollector::new(&|_| false, usize::MAX);
        self.pass_messages(input, &mut bag)?;
        Ok(names_of(&bag.tables()))
    }

    fn tables(&self, input: RecordingInput<'_>) -> Result<Vec<TableInfo>, RecordingFault> {
        let mut bag = BagCollector::new(&|_| false, usize::MAX);
        self.pass_messages(input, &mut bag)?;
        Ok(tables(bag))
    }
}

/// Reads a log: the needed columns, joined on time.
fn read(
    format: &dyn MessageLogFormat,
    input: RecordingInput<'_>,
    file: &str,
    options: &ReadOptions,
) -> Result<SignalRecording, RecordingFault> {
    // Numbers of needed columns are kept while the messages are read.
    let is_kept = |name: &str| options.is_column_needed(name);
    let mut bag = BagCollector::new(&is_kept, options.max_numbers);
    format.pass_messages(input, &mut bag)?;
    let tables = bag.tables();
    // The first column is the time; then the columns of all topics follow.
    let mut intake = SampleIntake::new(names_of(&tables), options)?;
    let mut parts = Vec::new();
    let mut place = 1;
    // Each table with needed columns becomes a part to be joined.
    for table in tables {
        let mut columns = Vec::new();
        for (_, _, values) in table.columns {
            if let Some(values) = values.filter(|_| intake.is_place_needed(place)) {
                columns.push((place, values));
            }
            place += 1;
        }
        if !columns.is_empty() {
            parts.push((table.topic, table.has_stamps, table.time, columns));
        }
    }
    // Topics without times of their own are reported.
    let late: Vec<String> = (parts.iter().filter(|part| !part.1))
        .map(|part| part.0.clone())
        .collect();
    if !late.is_empty() {
        intake.note(RecordingNote::info(format!(
            "Messages of {} in {file} have no time of their own: their time is that of arrival.",
            backquoted_list(&late)
        )));
    }
    // Large times are counted from the first one, so that seconds are exact.
    let times = || parts.iter().flat_map(|part| &part.2);
    let is_exact = times().all(|t| (-EXACT..EXACT).contains(t));
    let zero = if is_exact {
        0
    } else {
        times().copied().min().unwrap_or(0)
    };
    let parts = parts.into_iter().map(|(name, _, time, columns)| JoinPart {
        name,
        time: time.iter().map(|t| seconds(t.wrapping_sub(zero))).collect(),
        columns,
    });
    let Some(together) = join_parts(parts.collect(), &mut |note| intake.note(note))? else {
        return Err(RecordingFault::NoSamples);
    };
    // Pass the joined rows to the intake.
    let mut sample = vec![SampleField::Number(0.0); intake.width()];
    for (k, time) in together.time.iter().enumerate() {
        sample[0] = SampleField::finite(*time);
        for (place, values) in &together.columns {
            sample[*place] = SampleField::finite(values[k]);
        }
        let text = |_: usize| "NaN or infinite".to_owned();
        if intake.take_sample(k as u64 + 1, &sample, &text)? == IntakeFlow::Stop {
            break;
        }
    }
    intake.finish(file)
}

/// The topics of a log; no numbers are kept.
fn tables(bag: BagCollector<'_>) -> Vec<TableInfo> {
    let mut found = Vec::new();
    for topic in bag.topics {
        // The part of the description that is the same for all cases.
        let bare = TableInfo {
            name: topic.name.clone(),
            kind: topic.kind.clone(),
            columns: Vec::new(),
            samples: topic.count,
            time: None,
            remark: None,
        };
        // A topic that cannot be read has its reason as a remark.
        if let Err(says) = &topic.reader {
            found.push(TableInfo {
                remark: Some(format!("skipped: {says}")),
                ..bare
            });
            continue;
        }
        let tables = topic.tables();
        // A topic without numbers has no table.
        if tables.is_empty() {
            let holds = if bare.samples == 0 { "no messages" } else { "no numbers" };
            found.push(TableInfo {
                remark: Some(format!("it contains {holds}")),
                ..bare
            });
            continue;
        }
        for table in tables {
            // As for reading: times are counted from the first one, unless they are small.
            let span = table.span.map(|(least, most)| {
                let is_exact = -EXACT < least && most < EXACT;
                let zero = if is_exact { 0 } else { least };
                (seconds(least.wrapping_sub(zero)), seconds(most.wrapping_sub(zero)))
            });
            let columns = table.columns.into_iter().map(|(name, kind, _)| ColumnInfo {
                name,
                kind: kind.to_owned(),
            });
            let remark = if table.has_stamps {
                "the time is that of `header.stamp`"
            } else {
                "the time is that of arrival"
            };
            found.push(TableInfo {
                columns: columns.collect(),
                samples: table.samples,
                time: span,
                remark: Some(remark.to_owned()),
                ..bare.clone()
            });
        }
    }
    found
}

/// Names of the columns of all tables, the time first.
fn names_of(tables: &[BagTable]) -> Vec<String> {
    let names = tables.iter().flat_map(|table| &table.columns);
    let names = names.map(|(name, _, _)| name.clone());
    std::iter::once("t".to_owned()).chain(names).collect()
}

/// Extends a time range to include another time, ns.
fn extend_span(span: &mut Option<(i64, i64)>, time: i64) {
    let (first, last) = span.unwrap_or((time, time));
    *span = Some((first.min(time), last.max(time)));
}

/// Nanoseconds as seconds.
fn seconds(nanoseconds: i64) -> f64 {
    nanoseconds as f64 / 1e9
}
