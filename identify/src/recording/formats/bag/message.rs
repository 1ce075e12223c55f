//! Messages of ROS: bytes go in; numbers in the order of the definition come out, with the names of their columns.
//!
//! ROS 2 writes CDR (OMG, Common Data Representation; DDS-XTypes 1.3, section 7.4): four bytes state the byte order,
//! then every number is aligned to a multiple of its size. ROS 1 writes the same without padding.

use std::rc::Rc;

use super::definition::{RosFieldType, RosMessageDefinition, RosNumberType, RosVersion};

/// Longest list of numbers that becomes columns; a longer one is an image or a scan.
const MOST_ELEMENTS: usize = 256;
/// Longest list of messages within a message.
const MOST_MESSAGES: usize = 4096;
/// Most bytes behind a message that only fill it up.
const MOST_PADDING: usize = 3;
/// Stands for the length of a list that is skipped.
const SKIPPED_LENGTH: u32 = u32::MAX;

/// The contents of a message.
#[derive(Debug, Default)]
pub(super) struct RosMessageContent {
    /// All numbers, in the order of [`RosMessageReader::columns`].
    pub(super) numbers: Vec<f64>,
    /// Identifies messages with the same columns: lengths of lists, and names in them.
    pub(super) shape: Vec<u8>,
    /// The time in the message, ns.
    pub(super) stamp: Option<i64>,
}

/// Reads messages of one type.
#[derive(Debug)]
pub(super) struct RosMessageReader {
    /// The type of the messages.
    definition: Rc<RosMessageDefinition>,
    /// The version of ROS, which decides the encoding.
    ros: RosVersion,
    /// Index of the field with the time of the message.
    stamp: Option<usize>,
    /// Whether the definition is that of a common type and not from the file. A message must then have no other bytes,
    /// because the type may have changed since.
    is_common: bool,
}

impl RosMessageReader {
    /// Finds the field of the time: `stamp`, or a `header` that contains it.
    pub(super) fn new(definition: Rc<RosMessageDefinition>, ros: RosVersion, is_common: bool) -> Self {
        let is_time =
            |field: &(String, RosFieldType)| matches!(field, (name, RosFieldType::Time { .. }) if name == "stamp");
        let stamp = definition.fields.iter().position(|field| match field {
            (name, RosFieldType::Message(header)) if name == "header" => header.fields.iter().any(is_time),
            other => is_time(other),
        });
        Self {
            definition,
            ros,
            stamp,
            is_common,
        }
    }

    /// Reads a message into `content`, whose earlier contents are dropped.
    ///
    /// Fails when the bytes do not fit the type.
    pub(super) fn read(&self, bytes: &[u8], content: &mut RosMessageContent) -> Result<(), String> {
        content.numbers.clear();
        content.shape.clear();
        content.stamp = None;
        let mut bytes = RosByteReader::new(bytes, self.ros)?;
        // A message without fields has no numbers.
        if self.definition.fields.is_empty() {
            return Ok(());
        }
        for (i, (name, kind)) in self.definition.fields.iter().enumerate() {
            // The field of the time gives no columns, so its numbers are dropped.
            if self.stamp == Some(i) {
                let numbers = content.numbers.len();
                bytes.first_time = None;
                numbers_of(kind, name, &mut bytes, content)?;
                content.stamp = bytes.first_time;
                content.numbers.truncate(numbers);
            } else {
                numbers_of(kind, name, &mut bytes, content)?;
            }
        }
        if self.is_common && bytes.rest() > MOST_PADDING {
            return Err(format!(
                "{} bytes of it are left over, so its type differs from the common one of this name; convert the log to MCAP \
                 where this type is installed (`ros2 bag convert`)",
                bytes.rest()
            ));
        }
        Ok(())
    }

    /// Names and types of the columns of a message, one per number, in the same order as [`Self::read`] gives them.
    pub(super) fn columns(&self, bytes: &[u8]) -> Result<Vec<(String, &'static str)>, String> {
        let mut bytes = RosByteReader::new(bytes, self.ros)?;
        let mut fields = Vec::new();
        // Decode the values with their names, except for the time.
        for (i, (name, kind)) in self.definition.fields.iter().enumerate() {
            let value = value_of(kind, &mut bytes)?;
            if self.stamp != Some(i) {
                fields.push((name.as_str(), value));
            }
        }
        let mut columns = Vec::new();
        RosValue::Message(fields).name(String::new(), &[], &mut columns);
        Ok(columns)
    }
}

/// Appends the numbers of a value to `content`, and its lengths and names to the shape.
///
/// `name` is the name of the field. The order of the numbers must be that of [`value_of`].
fn numbers_of(
    kind: &RosFieldType,
    name: &str,
    bytes: &mut RosByteReader<'_>,
    content: &mut RosMessageContent,
) -> Result<(), String> {
    match kind {
        RosFieldType::Number(number) => content.numbers.push(bytes.read_number(*number)?),
        RosFieldType::Text => {
            let text = bytes.read_text()?;
            // Names identify the columns, so they belong to the shape.
            if name == "name" {
                content.shape.extend(text);
                content.shape.push(0);
            }
        }
        RosFieldType::Time { is_signed } => content.numbers.push(bytes.read_time(*is_signed)?),
        RosFieldType::Message(definition) => {
            bytes.skip_empty_message(definition)?;
            for (name, kind) in &definition.fields {
                numbers_of(kind, name, bytes, content)?;
            }
        }
        RosFieldType::List(of, length) => {
            // Long lists of numbers are skipped, and their lengths do not matter.
            let length = bytes.read_length(of, *length)?;
            let shown = u32::try_from(length).unwrap_or(SKIPPED_LENGTH);
            if let Some(number) = long_list_number(of, length) {
                bytes.skip_numbers(number, length)?;
                content.shape.extend(SKIPPED_LENGTH.to_le_bytes());
                return Ok(());
            }
            // The length of a list decides how many columns there are.
            content.shape.extend(shown.to_le_bytes());
            for _ in 0..length {
                numbers_of(of, "name", bytes, content)?;
            }
        }
    }
    Ok(())
}

/// The type of the numbers of a list that is too long for columns; `None` for all other lists.
fn long_list_number(of: &RosFieldType, length: usize) -> Option<RosNumberType> {
    match of {
        RosFieldType::Number(number) if length > MOST_ELEMENTS => Some(*number),
        _ => None,
    }
}

/// A value with everything that names of columns depend on.
enum RosValue<'a> {
    /// A number, with the name of its type.
    Number(&'static str),
    /// A text, which may be a name.
    Text(String),
    /// Names and values of the fields.
    Message(Vec<(&'a str, RosValue<'a>)>),
    /// The elements of a list.
    List(Vec<RosValue<'a>>),
    /// A list that is too long for columns.
    Skipped,
}

/// Decodes a value for the names of its columns.
fn value_of<'a>(kind: &'a RosFieldType, bytes: &mut RosByteReader<'_>) -> Result<RosValue<'a>, String> {
    Ok(match kind {
        RosFieldType::Number(number) => {
            bytes.read_number(*number)?;
            RosValue::Number(number.name())
        }
        RosFieldType::Text => RosValue::Text(String::from_utf8_lossy(bytes.read_text()?).into_owned()),
        RosFieldType::Time { is_signed } => {
            bytes.read_time(*is_signed)?;
            RosValue::Number("time")
        }
        RosFieldType::Message(definition) => {
            bytes.skip_empty_message(definition)?;
            let fields = definition.fields.iter();
            let fields = fields.map(|(name, kind)| Ok((name.as_str(), value_of(kind, bytes)?)));
            RosValue::Message(fields.collect::<Result<_, String>>()?)
        }
        RosFieldType::List(of, length) => {
            let length = bytes.read_length(of, *length)?;
            if let Some(number) = long_list_number(of, length) {
                bytes.skip_numbers(number, length)?;
                return Ok(RosValue::Skipped);
            }
            let values = (0..length).map(|_| value_of(of, bytes));
            RosValue::List(values.collect::<Result<_, String>>()?)
        }
    })
}

impl RosValue<'_> {
    /// Collects the names of all numbers in a value. Elements of a list are named by a list of as many texts next to
    /// it or around it, by their own field `name`, or else by their positions.
    fn name(&self, path: String, names: &[Vec<String>], columns: &mut Vec<(String, &'static str)>) {
        match self {
            // A number ends the path.
            Self::Number(kind) => columns.push((path, kind)),
            Self::Text(_) | Self::Skipped => {}
            Self::Message(fields) => {
                // Lists of texts in this message may name the elements of its other lists.
                let mut known: Vec<Vec<String>> = fields.iter().filter_map(|(_, value)| value.list_texts()).collect();
                known.extend(names.iter().cloned());
                for (name, value) in fields {
                    let path = if path.is_empty() {
                        (*name).to_owned()
                    } else {
                        format!("{path}.{name}")
                    };
                    value.name(path, &known, columns);
                }
            }
            Self::List(values) => {
                // Names of the elements themselves take precedence.
                let own = values.iter().map(Self::own_name).collect::<Option<Vec<_>>>();
                let own = own.filter(|own| are_unique_names(own));
                // Then lists of names of the same length, and at the end positions from 1.
                let beside = names.iter().find(|names| names.len() == values.len());
                for (i, value) in values.iter().enumerate() {
                    let path = match own.as_ref().or(beside) {
                        Some(names) => format!("{path}.{}", names[i]),
                        None => format!("{path}_{}", i + 1),
                    };
                    value.name(path, names, columns);
                }
            }
        }
    }

    /// The texts of a list if they can be names; `None` for other values.
    fn list_texts(&self) -> Option<Vec<String>> {
        let Self::List(values) = self else {
            return None;
        };
        let texts = values.iter().map(|value| match value {
            Self::Text(text) => Some(text.clone()),
            _ => None,
        });
        let texts = texts.collect::<Option<Vec<_>>>()?;
        are_unique_names(&texts).then_some(texts)
    }

    /// The field `name` of a message, if it is a text.
    fn own_name(&self) -> Option<String> {
        let Self::Message(fields) = self else {
            return None;
        };
        fields.iter().find_map(|(name, value)| match value {
            Self::Text(text) if *name == "name" => Some(text.clone()),
            _ => None,
        })
    }
}

/// Whether texts are not empty and differ from each other.
fn are_unique_names(texts: &[String]) -> bool {
    !texts.is_empty() && (0..texts.len()).all(|i| !texts[i].is_empty() && !texts[..i].contains(&texts[i]))
}

/// Reads the bytes of a message in order.
struct RosByteReader<'a> {
    /// All bytes behind the header of the encoding.
    all: &'a [u8],
    /// Position of the next byte.
    at: usize,
    /// Whether the first byte of a number is the highest one.
    is_big: bool,
    /// Largest alignment of numbers, in bytes.
    alignment: usize,
    /// The version of ROS.
    ros: RosVersion,
    /// The first time that was read, ns.
    first_time: Option<i64>,
}

impl<'a> RosByteReader<'a> {
    /// Reads the header of the encoding, which only ROS 2 has.
    fn new(bytes: &'a [u8], ros: RosVersion) -> Result<Self, String> {
        let (bytes, is_big, alignment) = match (ros, bytes) {
            (RosVersion::One, bytes) => (bytes, false, 1),
            (RosVersion::Two, [0, form @ (0 | 1), _, _, bytes @ ..]) => (bytes, *form == 0, 8),
            // The second version of CDR, in its plain form.
            (RosVersion::Two, [0, form @ (6 | 7), _, _, bytes @ ..]) => (bytes, *form == 6, 4),
            (RosVersion::Two, [a, b, ..]) => {
                return Err(format!(
                    "it is encoded in the form {a:02x}{b:02x} of CDR, which is not supported"
                ));
            }
            (RosVersion::Two, _) => {
                return Err("it is shorter than its first four bytes".to_owned());
            }
        };
        Ok(Self {
            all: bytes,
            at: 0,
            is_big,
            alignment,
            ros,
            first_time: None,
        })
    }

    /// Number of bytes that were not read.
    fn rest(&self) -> usize {
        self.all.len().saturating_sub(self.at)
    }

    /// The next `n` bytes; fails when there are fewer.
    fn take(&mut self, n: usize) -> Result<&'a [u8], String> {
        let end = self.at.checked_add(n).filter(|end| *end <= self.all.len());
        let Some(end) = end else {
            return Err("it is shorter than its type requires".to_owned());
        };
        let taken = &self.all[self.at..end];
        self.at = end;
        Ok(taken)
    }

    /// The next number of `N` bytes after alignment, the lowest byte first.
    fn read_array<const N: usize>(&mut self) -> Result<[u8; N], String> {
        self.at = self.at.next_multiple_of(N.min(self.alignment));
        let mut bytes = [0; N];
        bytes.copy_from_slice(self.take(N)?);
        if self.is_big {
            bytes.reverse();
        }
        Ok(bytes)
    }

    /// The next number as a float; large integers are rounded.
    fn read_number(&mut self, number: RosNumberType) -> Result<f64, String> {
        Ok(match number {
            RosNumberType::Bool => f64::from(u8::from(self.take(1)?[0] != 0)),
            RosNumberType::U8 => f64::from(self.take(1)?[0]),
            RosNumberType::I8 => f64::from(i8::from_le_bytes(self.read_array()?)),
            RosNumberType::I16 => f64::from(i16::from_le_bytes(self.read_array()?)),
            RosNumberType::U16 => f64::from(u16::from_le_bytes(self.read_array()?)),
            RosNumberType::I32 => f64::from(i32::from_le_bytes(self.read_array()?)),
            RosNumberType::U32 => f64::from(u32::from_le_bytes(self.read_array()?)),
            RosNumberType::I64 => i64::from_le_bytes(self.read_array()?) as f64,
            RosNumberType::U64 => u64::from_le_bytes(self.read_array()?) as f64,
            RosNumberType::F32 => f64::from(f32::from_le_bytes(self.read_array()?)),
            RosNumberType::F64 => f64::from_le_bytes(self.read_array()?),
        })
    }

    /// The next text: its length, then its bytes.
    fn read_text(&mut self) -> Result<&'a [u8], String> {
        let length = u32::from_le_bytes(self.read_array()?) as usize;
        let text = self.take(length)?;
        // ROS 2 ends a text with a zero byte.
        Ok(text.strip_suffix(&[0]).unwrap_or(text))
    }

    /// The next time, s; the first one of a message is remembered in ns.
    fn read_time(&mut self, is_signed: bool) -> Result<f64, String> {
        let seconds: [u8; 4] = self.read_array()?;
        let seconds = if is_signed {
            i64::from(i32::from_le_bytes(seconds))
        } else {
            i64::from(u32::from_le_bytes(seconds))
        };
        let nanoseconds = u32::from_le_bytes(self.read_array()?);
        let time = seconds * 1_000_000_000 + i64::from(nanoseconds);
        self.first_time.get_or_insert(time);
        Ok(time as f64 / 1e9)
    }

    /// Skips the byte that a message without fields has in ROS 2.
    fn skip_empty_message(&mut self, definition: &RosMessageDefinition) -> Result<(), String> {
        if definition.fields.is_empty() && self.ros == RosVersion::Two {
            self.take(1)?;
        }
        Ok(())
    }

    /// The number of elements of a list. Fails when it exceeds the number of bytes, or when there are too many
    /// messages.
    fn read_length(&mut self, of: &RosFieldType, fixed: Option<usize>) -> Result<usize, String> {
        let length = match fixed {
            Some(length) => length,
            None => u32::from_le_bytes(self.read_array()?) as usize,
        };
        // An element has at least one byte, so a longer list is a fault.
        let is_number = matches!(of, RosFieldType::Number(_));
        if length > self.all.len() - self.at.min(self.all.len()) {
            return Err("a list in it is longer than the message".to_owned());
        }
        if !is_number && length > MOST_MESSAGES {
            return Err(format!("a list in it has {length} elements"));
        }
        Ok(length)
    }

    /// Skips numbers of a list.
    fn skip_numbers(&mut self, number: RosNumberType, length: usize) -> Result<(), String> {
        self.at = self.at.next_multiple_of(number.size().min(self.alignment));
        self.take(number.size().saturating_mul(length))?;
        Ok(())
    }
}
