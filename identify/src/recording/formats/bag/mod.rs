//! Logs of robots: messages of several topics go in, one by one; columns go out, joined on time.
//!
//! A number of a message becomes the column `topic.field`, an element of a list `topic.field_1` or, where names stand
//! beside the list as in `sensor_msgs/JointState`, `topic.position.elbow`. The time of a message is its `header.stamp`, and
//! that of its arrival where it bears none.

mod definition;
mod message;

use std::collections::{BTreeMap, BTreeSet};

use indexmap::IndexMap;

use crate::recording::column::SampleField;
use crate::recording::error::RecordingFault;
use crate::recording::intake::{IntakeFlow, SampleIntake};
use crate::recording::join::{JoinPart, join_parts};
use crate::recording::notes::RecordingNote;
use crate::recording::tables::{ColumnInfo, TableInfo};
use crate::recording::{ReadOptions, SignalRecording};
use crate::words::backquoted_list;

use definition::RosVersion;
use message::{RosMessageContent, RosMessageReader};

/// More forms of messages than any topic has, such as sets of joints that speak on it in turns.
const MOST_LAYOUTS: usize = 64;
/// Forms of bytes that are remembered.
const MOST_SHAPES: usize = 1024;
/// More columns than any recording has.
const MOST_COLUMNS: usize = 1 << 17;
/// The room of an arrival in numbers, with what is sorted and joined of it.
const ARRIVAL: usize = 8;
/// Times below this many nanoseconds, 104 days, are exact as seconds; others count from the first one on.
const EXACT: i64 = 1 << 53;

/// What is taken of a log while its messages go by.
pub(super) struct BagCollector<'a> {
    topics: Vec<BagTopic>,
    /// Columns whose numbers are kept.
    is_kept: &'a dyn Fn(&str) -> bool,
    kept_numbers: usize,
    max_numbers: usize,
    content: RosMessageContent,
}

/// How the messages of a topic are written.
pub(super) struct BagEncoding<'a> {
    /// `cdr`, `ros1`, or what is not read.
    pub(super) messages: &'a str,
    /// `ros2msg`, `ros1msg`, or what is not read.
    pub(super) definition: &'a str,
    pub(super) text: &'a str,
}

struct BagTopic {
    name: String,
    kind: String,
    /// What reads its messages, or why they are left aside.
    reader: Result<RosMessageReader, String>,
    columns: IndexMap<String, TopicColumn>,
    layouts: Vec<BagMessageLayout>,
    shapes: BTreeMap<Vec<u8>, usize>,
    messages: Vec<MessageArrival>,
    count: usize,
}

/// A form of messages, and what is known of those that have it.
struct BagMessageLayout {
    /// Its columns by their places.
    places: Vec<usize>,
    /// Whether numbers of it are kept.
    is_kept: bool,
    count: usize,
    /// First and last time of arrival and in the messages, ns.
    log: Option<(i64, i64)>,
    stamp: Option<(i64, i64)>,
    /// Whether all messages bear a time other than zero.
    has_stamps: bool,
}

struct TopicColumn {
    kind: &'static str,
    layouts: BTreeSet<usize>,
    values: Option<Vec<f64>>,
}

/// One message, beside its numbers.
#[derive(Clone, Copy)]
struct MessageArrival {
    layout: usize,
    /// Times of its arrival and in it, ns.
    log: i64,
    stamp: Option<i64>,
}

/// Columns of a topic that are in the same messages.
struct BagTable {
    topic: String,
    columns: Vec<(String, &'static str, Option<Vec<f64>>)>,
    /// Times of the messages whose numbers are kept, ns.
    time: Vec<i64>,
    has_stamps: bool,
    samples: usize,
    /// First and last time, ns.
    span: Option<(i64, i64)>,
}

impl<'a> BagCollector<'a> {
    fn new(is_kept: &'a dyn Fn(&str) -> bool, most: usize) -> Self {
        Self {
            topics: Vec::new(),
            is_kept,
            kept_numbers: 0,
            max_numbers: most,
            content: RosMessageContent::default(),
        }
    }

    /// A topic, to which [`Bag::message`] refers by the number that comes back.
    pub(super) fn register_topic(
        &mut self,
        name: &str,
        kind: &str,
        encoding: &BagEncoding<'_>,
    ) -> usize {
        let ros = match (encoding.messages, encoding.definition) {
            ("cdr", "ros2msg" | "") => Ok(RosVersion::Two),
            ("ros1", "ros1msg") => Ok(RosVersion::One),
            ("cdr" | "ros1", other) => Err(format!(
                "its definition is `{other}`, which is not supported"
            )),
            (other, _) => Err(format!(
                "its messages are encoded as `{other}`, which is not supported"
            )),
        };
        let reader = ros.and_then(|ros| {
            let definition = definition::parse_definition(kind, encoding.text, ros)?;
            Ok(RosMessageReader::new(definition, ros))
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
    /// Fails when it cannot be read although others of its topic could, and when more numbers would be kept than allowed.
    pub(super) fn take_message(
        &mut self,
        topic: usize,
        log: i64,
        bytes: &[u8],
    ) -> Result<(), RecordingFault> {
        let topic = &mut self.topics[topic];
        topic.count += 1;
        let Ok(reader) = &topic.reader else {
            return Ok(());
        };
        let layout = reader
            .read(bytes, &mut self.content)
            .and_then(|()| topic.layout_of_message(bytes, &self.content, self.is_kept));
        let layout = match layout {
            Ok(layout) => layout,
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
        let form = &mut topic.layouts[layout];
        let stamp = self.content.stamp;
        form.count += 1;
        extend_span(&mut form.log, log);
        extend_span(&mut form.stamp, stamp.unwrap_or(0));
        form.has_stamps &= stamp.is_some_and(|stamp| stamp != 0);
        if !form.is_kept {
            return Ok(());
        }
        for (place, value) in form.places.iter().zip(&self.content.numbers) {
            if let Some(values) = &mut topic.columns[*place].values {
                values.push(*value);
                self.kept_numbers += 1;
            }
        }
        topic.messages.push(MessageArrival { layout, log, stamp });
        self.kept_numbers += ARRIVAL;
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

    fn tables(self) -> Vec<BagTable> {
        self.topics.into_iter().flat_map(BagTopic::tables).collect()
    }
}

impl BagTopic {
    /// The form of a message whose numbers and shape are known.
    fn layout_of_message(
        &mut self,
        bytes: &[u8],
        content: &RosMessageContent,
        is_kept: &dyn Fn(&str) -> bool,
    ) -> Result<usize, String> {
        if let Some(known) = self.shapes.get(&content.shape) {
            return Ok(*known);
        }
        let reader = self.reader.as_ref().map_err(Clone::clone)?;
        let columns = reader.columns(bytes)?;
        if columns.len() != content.numbers.len() {
            return Err("its columns cannot be determined".to_owned());
        }
        let mut places = Vec::with_capacity(columns.len());
        for (name, kind) in columns {
            let name = format!("{}.{name}", self.name);
            let entry = self.columns.entry(name);
            let place = entry.index();
            entry.or_insert_with_key(|name| TopicColumn {
                kind,
                layouts: BTreeSet::new(),
                values: is_kept(name).then(Vec::new),
            });
            if places.contains(&place) {
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
        let known = self
            .layouts
            .iter()
            .position(|layout| layout.places == places);
        let layout = known.unwrap_or_else(|| {
            for place in &places {
                self.columns[*place].layouts.insert(self.layouts.len());
            }
            self.layouts.push(BagMessageLayout {
                is_kept: places
                    .iter()
                    .any(|place| self.columns[*place].values.is_some()),
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
        if self.shapes.len() >= MOST_SHAPES {
            self.shapes.clear();
        }
        self.shapes.insert(content.shape.clone(), layout);
        Ok(layout)
    }

    /// Its columns, those of the same messages together; messages in the order in which they arrived.
    fn tables(self) -> Vec<BagTable> {
        let mut tables: IndexMap<BTreeSet<usize>, Vec<(String, TopicColumn)>> = IndexMap::new();
        for (name, column) in self.columns {
            tables
                .entry(column.layouts.clone())
                .or_default()
                .push((name, column));
        }
        // Publishers that know no time leave it at zero.
        let has_stamps = self.layouts.iter().all(|layout| layout.has_stamps);
        let time_of = |one: &MessageArrival| match one.stamp {
            Some(stamp) if has_stamps => stamp,
            _ => one.log,
        };
        let mut all = Vec::new();
        for (layouts, columns) in tables {
            let messages: Vec<&MessageArrival> = self
                .messages
                .iter()
                .filter(|one| layouts.contains(&one.layout))
                .collect();
            let mut order: Vec<usize> = (0..messages.len()).collect();
            order.sort_by_key(|k| messages[*k].log);
            let sorted = |values: Vec<f64>| order.iter().map(|k| values[*k]).collect();
            let forms = || layouts.iter().map(|layout| &self.layouts[*layout]);
            let mut span = None;
            for (first, last) in
                forms().filter_map(|form| if has_stamps { form.stamp } else { form.log })
            {
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

/// Shows all messages of a log to a [`Bag`].
pub(super) type BagReplay<'a> =
    &'a mut dyn FnMut(&mut BagCollector<'_>) -> Result<(), RecordingFault>;

/// The recording of a log: the columns that are needed, joined on time.
pub(super) fn read(
    show: BagReplay<'_>,
    file: &str,
    options: &ReadOptions,
) -> Result<SignalRecording, RecordingFault> {
    let is_kept = |name: &str| options.is_column_needed(name);
    let mut bag = BagCollector::new(&is_kept, options.max_numbers);
    show(&mut bag)?;
    let tables = bag.tables();
    let mut intake = SampleIntake::new(names_of(&tables), options)?;
    let mut parts = Vec::new();
    let mut place = 1;
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
    let late: Vec<String> = (parts.iter().filter(|part| !part.1))
        .map(|part| part.0.clone())
        .collect();
    if !late.is_empty() {
        intake.note(RecordingNote::info(format!(
            "Messages of {} in {file} have no time of their own: their time is that of arrival.",
            backquoted_list(&late)
        )));
    }
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

/// Names of the columns of a log, the time in front.
pub(super) fn names(show: BagReplay<'_>) -> Result<Vec<String>, RecordingFault> {
    let mut bag = BagCollector::new(&|_| false, usize::MAX);
    show(&mut bag)?;
    Ok(names_of(&bag.tables()))
}

/// The topics of a log.
pub(super) fn tables(show: BagReplay<'_>) -> Result<Vec<TableInfo>, RecordingFault> {
    let mut bag = BagCollector::new(&|_| false, usize::MAX);
    show(&mut bag)?;
    let mut found = Vec::new();
    for topic in bag.topics {
        let bare = TableInfo {
            name: topic.name.clone(),
            kind: topic.kind.clone(),
            columns: Vec::new(),
            samples: topic.count,
            time: None,
            remark: None,
        };
        if let Err(says) = &topic.reader {
            found.push(TableInfo {
                remark: Some(format!("skipped: {says}")),
                ..bare
            });
            continue;
        }
        let tables = topic.tables();
        if tables.is_empty() {
            let holds = if bare.samples == 0 {
                "no messages"
            } else {
                "no numbers"
            };
            found.push(TableInfo {
                remark: Some(format!("it contains {holds}")),
                ..bare
            });
            continue;
        }
        for table in tables {
            // As it is read: from the first sample on, unless the numbers are small.
            let span = table.span.map(|(least, most)| {
                let is_exact = -EXACT < least && most < EXACT;
                let zero = if is_exact { 0 } else { least };
                (
                    seconds(least.wrapping_sub(zero)),
                    seconds(most.wrapping_sub(zero)),
                )
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
    Ok(found)
}

fn names_of(tables: &[BagTable]) -> Vec<String> {
    let names = tables.iter().flat_map(|table| &table.columns);
    let names = names.map(|(name, _, _)| name.clone());
    std::iter::once("t".to_owned()).chain(names).collect()
}

/// Widens a span of times to hold another one.
fn extend_span(span: &mut Option<(i64, i64)>, time: i64) {
    let (first, last) = span.unwrap_or((time, time));
    *span = Some((first.min(time), last.max(time)));
}

fn seconds(nanoseconds: i64) -> f64 {
    nanoseconds as f64 / 1e9
}
