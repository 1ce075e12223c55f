//! Definitions of ROS messages: text of the form `ros2msg` (or `ros1msg`) goes in, a tree of types comes out.
//!
//! The definition of a message is followed by the definitions of the messages in it. Each of those follows a line of
//! `=` and a line `MSG: package/Name` (MCAP registry of schemas, `ros2msg`).

use std::collections::BTreeMap;
use std::rc::Rc;

use modelmill_boundary::nesting::NestingLevel;

/// Deepest nesting of messages; no real definition reaches it.
const DEEPEST: usize = 32;

/// Type of a field of a message.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum RosFieldType {
    /// A number.
    Number(RosNumberType),
    /// A string.
    Text,
    /// Seconds and nanoseconds. The seconds of a duration are signed, those of a time in ROS 1 are not.
    Time {
        /// Whether the seconds are signed.
        is_signed: bool,
    },
    /// Another message.
    Message(Rc<RosMessageDefinition>),
    /// A list: of fixed length if that is given, otherwise each message states the length.
    List(Box<RosFieldType>, Option<usize>),
}

/// Types of numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RosNumberType {
    /// One byte; zero is false.
    Bool,
    /// Signed integers and unsigned ones, by their number of bits.
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

/// A message type: its fields in order, each with its name.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RosMessageDefinition {
    /// Names and types.
    pub(super) fields: Vec<(String, RosFieldType)>,
}

/// The version of ROS, whose rules for types differ.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RosVersion {
    /// ROS 1.
    One,
    /// ROS 2.
    Two,
}

impl RosNumberType {
    // `float` and `double` are the names in IDL.
    const NAMES: [(&'static str, Self); 14] = [
        ("bool", Self::Bool),
        ("boolean", Self::Bool),
        ("int8", Self::I8),
        ("uint8", Self::U8),
        ("int16", Self::I16),
        ("uint16", Self::U16),
        ("int32", Self::I32),
        ("uint32", Self::U32),
        ("int64", Self::I64),
        ("uint64", Self::U64),
        ("float32", Self::F32),
        ("float64", Self::F64),
        ("float", Self::F32),
        ("double", Self::F64),
    ];

    /// The type with a name in a definition; `byte` differs between the versions.
    fn from_name(name: &str, ros: RosVersion) -> Option<Self> {
        match (name, ros) {
            ("byte", RosVersion::One) => return Some(Self::I8),
            ("byte" | "char" | "octet", _) => return Some(Self::U8),
            _ => {}
        }
        let found = Self::NAMES.iter().find(|(known, _)| *known == name);
        found.map(|(_, number)| *number)
    }

    /// Its usual name in definitions.
    pub(super) fn name(self) -> &'static str {
        let found = Self::NAMES.iter().find(|(_, number)| *number == self);
        found.map_or("", |(name, _)| name)
    }

    /// Its size in a message, bytes.
    pub(super) fn size(self) -> usize {
        match self {
            Self::Bool | Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }
}

/// Parses the definition of the message `name` in `text`, and those of the messages in it.
///
/// Fails when a definition is missing or a line cannot be parsed.
pub(super) fn parse_definition(name: &str, text: &str, ros: RosVersion) -> Result<Rc<RosMessageDefinition>, String> {
    let own = short_type_name(name);
    // Older logs have no definitions at all; an empty text defines nothing.
    if is_definition_missing(text) {
        // The common types are those of ROS 2; ROS 1 has other ones with the same names.
        if ros == RosVersion::One && own != "std_msgs/Empty" {
            return Err(format!(
                "the file does not define `{own}`; record it again, or convert it with a program that has its type"
            ));
        }
        let mut reader = RosDefinitionParser {
            texts: BTreeMap::new(),
            done: BTreeMap::new(),
            ros,
        };
        return reader.parse_message(&own, NestingLevel::top(DEEPEST));
    }
    let mut texts = BTreeMap::new();
    // Split the text at the lines of `=` into one list of lines per type.
    let (mut current, mut lines) = (own.clone(), Vec::new());
    for line in text.lines() {
        let trimmed = line.trim();
        if trimmed.len() >= 3 && trimmed.bytes().all(|byte| byte == b'=') {
            texts.entry(current).or_insert_with(|| std::mem::take(&mut lines));
            lines.clear();
            current = String::new();
        } else if let (true, Some(name)) = (current.is_empty(), trimmed.strip_prefix("MSG:")) {
            // The line behind the separator has the name of the next type.
            current = short_type_name(name.trim());
        } else {
            lines.push(trimmed);
        }
    }
    texts.entry(current).or_insert(lines);
    let mut reader = RosDefinitionParser {
        texts,
        done: BTreeMap::new(),
        ros,
    };
    reader.parse_message(&own, NestingLevel::top(DEEPEST))
}

/// Whether a log has no definition of a type, so that the one of a common type is used.
pub(super) fn is_definition_missing(text: &str) -> bool {
    text.trim().is_empty()
}

/// The name without `/msg/`, as `package/Name`.
fn short_type_name(name: &str) -> String {
    name.replace("/msg/", "/")
}

/// Parses definitions and keeps those that are done.
struct RosDefinitionParser<'a> {
    /// Lines of the definitions that are not parsed yet, by type.
    texts: BTreeMap<String, Vec<&'a str>>,
    /// Types that are done.
    done: BTreeMap<String, Rc<RosMessageDefinition>>,
    /// The version of ROS, for names of types.
    ros: RosVersion,
}

impl RosDefinitionParser<'_> {
    /// Parses the definition of one type at a level of nesting.
    fn parse_message(&mut self, name: &str, level: NestingLevel) -> Result<Rc<RosMessageDefinition>, String> {
        if let Some(done) = self.done.get(name) {
            return Ok(done.clone());
        }
        // A type that the file does not define may be a common one.
        let Some(lines) = self.texts.get(name).cloned() else {
            return match common_definition(name) {
                Some(text) => {
                    let lines = text.lines().collect();
                    self.texts.insert(name.to_owned(), lines);
                    self.parse_message(name, level)
                }
                None => Err(format!(
                    "the file does not define `{name}`, and it is not one of the common types; convert the log to MCAP where \
                     this type is installed (`ros2 bag convert`), so that the file has its definition"
                )),
            };
        };
        let mut fields = Vec::new();
        // One field per line: type, name, and possibly a default value.
        for line in lines {
            // Comments start with `#`.
            let line = line.split('#').next().unwrap_or("").trim();
            let Some((kind, rest)) = line.split_once(char::is_whitespace) else {
                if line.is_empty() {
                    continue;
                }
                return Err(format!("the line `{line}` of `{name}` cannot be read"));
            };
            let rest = rest.trim();
            let end = rest
                .find(|c: char| !(c.is_ascii_alphanumeric() || c == '_'))
                .unwrap_or(rest.len());
            // A constant is not part of a message.
            if rest[end..].trim_start().starts_with('=') {
                continue;
            }
            if end == 0 {
                return Err(format!("the line `{line}` of `{name}` cannot be read"));
            }
            fields.push((rest[..end].to_owned(), self.parse_field_type(kind, name, level)?));
        }
        let definition = Rc::new(RosMessageDefinition { fields });
        self.done.insert(name.to_owned(), definition.clone());
        Ok(definition)
    }

    /// Parses the type of a field in the message `within`.
    fn parse_field_type(&mut self, text: &str, within: &str, level: NestingLevel) -> Result<RosFieldType, String> {
        // A type that contains itself would recurse without end.
        let inner = || {
            level
                .enter()
                .map_err(|_| format!("`{within}` contains itself, or lists of lists"))
        };
        // `type[]`, `type[n]` and `type[<=n]` are lists; the last one has a variable length.
        if let Some((of, length)) = text.strip_suffix(']').and_then(|text| text.rsplit_once('[')) {
            let of = self.parse_field_type(of, within, inner()?)?;
            let length = match length {
                "" => None,
                most if most.starts_with("<=") => None,
                length => Some(
                    length
                        .parse()
                        .map_err(|_| format!("`{text}` in `{within}` has no length"))?,
                ),
            };
            return Ok(RosFieldType::List(Box::new(of), length));
        }
        // A string may have a bound, as in `string<=10`.
        let bare = text.split("<=").next().unwrap_or(text);
        if let Some(number) = RosNumberType::from_name(bare, self.ros) {
            return Ok(RosFieldType::Number(number));
        }
        // Types with a name of their own.
        match (bare, self.ros) {
            ("string", _) => return Ok(RosFieldType::Text),
            ("wstring", _) => {
                return Err(format!("`{within}` contains a `wstring`, which is not supported"));
            }
            ("time", RosVersion::One) => return Ok(RosFieldType::Time { is_signed: false }),
            ("duration", RosVersion::One) => return Ok(RosFieldType::Time { is_signed: true }),
            _ => {}
        }
        // Names without a package belong to the package of the message.
        let full = match short_type_name(bare) {
            header if header == "Header" => "std_msgs/Header".to_owned(),
            full if full.contains('/') => full,
            short => {
                let package = within.split('/').next().unwrap_or("");
                format!("{package}/{short}")
            }
        };
        // Times of ROS 2 are messages with a fixed meaning.
        if full == "builtin_interfaces/Time" || full == "builtin_interfaces/Duration" {
            return Ok(RosFieldType::Time { is_signed: true });
        }
        Ok(RosFieldType::Message(self.parse_message(&full, inner()?)?))
    }
}

/// Definitions of common types, for files without definitions, as rosbag2 wrote them from Foxy to Humble.
const COMMON_TYPES: &str = include_str!("common_types.msg");

/// The definition of a common type of ROS 2 by its name, without those of the messages in it.
fn common_definition(name: &str) -> Option<&'static str> {
    // Each definition follows a line with the name of its type.
    let mut sections = COMMON_TYPES.split("\nMSG: ").skip(1);
    sections.find_map(|section| section.strip_prefix(name)?.strip_prefix('\n'))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every common type is complete: the types of its fields are common too.
    #[test]
    fn common_types_are_defined_without_a_file() {
        let names: Vec<&str> = COMMON_TYPES
            .lines()
            .filter_map(|line| line.strip_prefix("MSG: "))
            .collect();
        assert!(names.len() > 80, "{}", names.len());
        for name in names {
            let parsed = parse_definition(name, "", RosVersion::Two);
            assert!(parsed.is_ok(), "{name}: {parsed:?}");
        }
        let state = parse_definition("sensor_msgs/msg/JointState", " \n", RosVersion::Two).unwrap();
        let fields: Vec<&str> = state.fields.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(fields, ["header", "name", "position", "velocity", "effort"]);
        let unknown = parse_definition("lab_msgs/msg/Torques", "", RosVersion::Two).unwrap_err();
        assert!(unknown.contains("`lab_msgs/Torques`"), "{unknown}");
    }

    #[test]
    fn lists_of_lists_and_types_in_themselves_are_refused_before_they_use_up_the_stack() {
        let parse = |text: &str| parse_definition("a/B", text, RosVersion::Two).map(drop);
        assert_eq!(parse(&format!("float64{} x\n", "[2]".repeat(DEEPEST))), Ok(()));
        let own = "a/B x\n".to_owned();
        for text in [format!("float64{} x\n", "[]".repeat(500_000)), own] {
            let says = parse(&text).unwrap_err();
            assert!(says.contains("`a/B` contains itself"), "{says}");
        }
    }
}
