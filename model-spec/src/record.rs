//! How types of the schema read themselves from a file, and how they describe themselves to editors.
//!
//! One declaration by [`record!`] gives the struct, its reader (which reports every fault and goes on)
//! and its JSON Schema, so that the three cannot drift apart.

#[cfg(any(test, feature = "schema"))]
use std::borrow::Cow;

#[cfg(any(test, feature = "schema"))]
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};

use crate::diagnostic::{Diagnostic, DiagnosticLog, SourceSpan};
use crate::document::{TomlKey, TomlNode, TomlTable, TomlValue, find_key, quote};
use crate::suggest;
use crate::values::check_name;

/// Most entries of one list or table.
const MOST_ENTRIES: usize = 1000;
/// Most unknown keys of one table that are read as misspelt ones: comparing names takes time.
const MOST_MISSPELT: usize = 16;

/// A type of the schema.
/// Reading never stops at the first fault: faults go to the log, so that one run reports all of them.
pub(crate) trait SchemaValue: Sized {
    /// What a place of this type must contain, for messages: `a string`.
    const EXPECTED: &'static str;
    /// An example of it as TOML.
    const EXAMPLE: &'static str;
    /// Whether it is a table with fixed keys.
    const IS_RECORD: bool = false;

    /// Reads a value; a fault goes to the log and gives `None`.
    /// The place of the node is kept in the value where later messages need it.
    fn read(node: &TomlNode, log: &mut DiagnosticLog) -> Option<Self>;
}

/// Reports a value of the wrong type.
pub(crate) fn wrong_type<T: SchemaValue>(node: &TomlNode, log: &mut DiagnosticLog) -> Option<T> {
    log.push(
        Diagnostic::error(node.span, format!("{} stands where it does not belong", node.kind()))
            .label(format!("expected {}", T::EXPECTED))
            .help(format!("for example `{}`", T::EXAMPLE)),
    );
    None
}

/// Declares a table of the schema: a struct whose fields are all optional once read (faults are reported, not fatal),
/// its reader and its JSON Schema.
macro_rules! record {
    // One table: docs, type, title for messages, then key, field, whether it is required, and type per field.
    (
        $(#[doc = $about:literal])*
        $name:ident = $title:literal {
            $( $(#[doc = $doc:literal])* $key:literal $field:ident: $need:ident $type:ty, )*
        }
    ) => {
        $(#[doc = $about])*
        #[derive(Clone, Debug)]
        #[allow(dead_code)] // Remarks, for example, are there for people and for the schema.
        // All fields are optional here, because a missing required field is reported and reading continues.
        pub(crate) struct $name {
            /// The place of the table.
            pub(crate) span: $crate::diagnostic::SourceSpan,
            $( $(#[doc = $doc])* pub(crate) $field: Option<$type>, )*
            /// True if something in the table was faulty, so that what seems to be missing may be there.
            pub(crate) faulty: bool,
        }

        // The reader.
        impl $name {
            /// The keys of the table.
            pub(crate) const KEYS: &'static [&'static str] = &[$($key),*];

            /// Reads a table; every fault is reported, and the fields without faults are returned.
            pub(crate) fn from_table(
                table: &$crate::document::TomlTable,
                span: $crate::diagnostic::SourceSpan,
                log: &mut $crate::diagnostic::DiagnosticLog,
            ) -> Self {
                let n_errors = log.n_errors();
                $crate::record::check_keys(table, Self::KEYS, $title, log);
                Self {
                    span,
                    $( $field: $crate::record::read_field::<$type>(
                        table,
                        $key,
                        $crate::record::need!($need),
                        ($title, Self::KEYS),
                        span,
                        log,
                    ), )*
                    faulty: log.n_errors() > n_errors,
                }
            }
        }

        // A table as the value of a field of another table.
        impl $crate::record::SchemaValue for $name {
            const EXPECTED: &'static str = concat!("a table: ", $title);
            const EXAMPLE: &'static str = concat!("{ ", $crate::record::first!($($key),*), " = ... }");
            const IS_RECORD: bool = true;

            fn read(node: &$crate::document::TomlNode, log: &mut $crate::diagnostic::DiagnosticLog) -> Option<Self> {
                let $crate::document::TomlValue::Table(table) = &node.value else {
                    return $crate::record::wrong_type::<Self>(node, log);
                };
                Some(Self::from_table(table, node.span, log))
            }
        }

        // The JSON Schema: docs of the fields become descriptions in editors.
        #[cfg(any(test, feature = "schema"))]
        impl schemars::JsonSchema for $name {
            fn schema_name() -> std::borrow::Cow<'static, str> {
                stringify!($name).trim_end_matches("Entry").to_owned().into()
            }

            fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
                let mut properties = serde_json::Map::new();
                let mut required: Vec<&str> = Vec::new();
                $(
                    let schema = $crate::record::with_description(
                        generator.subschema_for::<$type>(), concat!($($doc, "\n"),*));
                    properties.insert($key.to_owned(), schema);
                    if $crate::record::need!($need) {
                        required.push($key);
                    }
                )*
                schemars::json_schema!({
                    "description": $crate::record::tidy(concat!($($about, "\n"),*)),
                    "type": "object",
                    "properties": properties,
                    "required": required,
                    "additionalProperties": false,
                })
            }
        }
    };
}
// Whether a field is required.
macro_rules! need {
    (required) => {
        true
    };
    (optional) => {
        false
    };
}
// The first key, for examples.
macro_rules! first {
    ($first:tt $(, $rest:tt)*) => {
        $first
    };
}
pub(crate) use {first, need, record};

/// Reads one field of a table, of which `title` is the name in messages and `keys` are all keys.
///
/// Returns `None` if the field is absent or faulty. A misspelt key, which [`check_keys`] reports, is read as the one
/// that is meant, so that one mistake gives one error. A missing required field is reported.
pub(crate) fn read_field<T: SchemaValue>(
    table: &TomlTable,
    key: &str,
    is_required: bool,
    (title, keys): (&str, &[&str]),
    span: SourceSpan,
    log: &mut DiagnosticLog,
) -> Option<T> {
    if let Some((_, node)) = find_key(table, key) {
        return T::read(node, log);
    }
    if log.syntax_broken {
        return None;
    }
    if let Some(node) = find_misspelt(table, key, keys) {
        // A table is certainly meant, so its faults are reported; a single value may belong to something else.
        return match node.value {
            TomlValue::Table(_) | TomlValue::Array(_) => T::read(node, log),
            _ => T::read(node, &mut DiagnosticLog::default()),
        };
    }
    if is_required {
        log.push(
            Diagnostic::error(span, format!("{title} lacks `{key}`"))
                .label(format!("expected `{key}`, {}", T::EXPECTED))
                .help(format!("add `{key} = {}`", T::EXAMPLE)),
        );
    }
    None
}

/// The value under an unknown key that is close to `key`.
fn find_misspelt<'a>(table: &'a TomlTable, key: &str, keys: &[&str]) -> Option<&'a TomlNode> {
    let mut unknown = table.iter().filter(|(other, _)| !keys.contains(&other.name.as_str()));
    let meant = |(other, _): &&(TomlKey, TomlNode)| suggest::nearest(&other.name, keys.iter().copied()) == Some(key);
    unknown.by_ref().take(MOST_MISSPELT).find(meant).map(|(_, node)| node)
}

/// Reports keys that a table does not have.
/// `known` are all keys of the table, and `title` names the table in messages.
pub(crate) fn check_keys(table: &TomlTable, known: &[&str], title: &str, log: &mut DiagnosticLog) {
    for (key, _) in table {
        // Broken text leaves scraps that look like keys.
        if known.contains(&key.name.as_str()) || log.is_full() || log.syntax_broken {
            continue;
        }
        log.push(
            Diagnostic::error(key.span, format!("unknown key `{}`", quote(&key.name)))
                .label(format!("{title} has no such key"))
                .help(suggest::advice(&key.name, "keys", known.iter().copied())),
        );
    }
}

/// Adds a description to a schema, also to a reference.
#[cfg(any(test, feature = "schema"))]
pub(crate) fn with_description(mut schema: Schema, text: &str) -> serde_json::Value {
    if !text.trim().is_empty() {
        schema.insert("description".to_owned(), tidy(text).into());
    }
    schema.to_value()
}

/// Joins the lines of a doc comment.
#[cfg(any(test, feature = "schema"))]
pub(crate) fn tidy(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// A list; faulty entries are left out once they are reported.
#[derive(Clone, Debug)]
pub(crate) struct EntryList<T> {
    /// The entries that could be read.
    pub(crate) entries: Vec<T>,
    /// Where the list stands.
    pub(crate) span: SourceSpan,
    /// True if any entry was faulty.
    pub(crate) faulty: bool,
}

impl<T: SchemaValue> SchemaValue for EntryList<T> {
    const EXPECTED: &'static str = "a list";
    const EXAMPLE: &'static str = "[ ... ]";

    fn read(node: &TomlNode, log: &mut DiagnosticLog) -> Option<Self> {
        let TomlValue::Array(array) = &node.value else {
            log.push(
                Diagnostic::error(node.span, format!("{} stands where it does not belong", node.kind()))
                    .label(format!("expected a list, each entry {}", T::EXPECTED))
                    .help("lists of tables are headed by double brackets, `[[frame]]`; short ones stand in `[ ]`"),
            );
            // A table in single brackets is its only entry, so that what it defines is known.
            let is_entry = T::IS_RECORD && matches!(node.value, TomlValue::Table(_));
            let only = is_entry.then(|| T::read(node, log)).flatten()?;
            return Some(Self {
                entries: vec![only],
                span: node.span,
                faulty: true,
            });
        };
        // Very long lists are refused as a unit, so that reading stays fast.
        if too_many(array.len(), node.span, log) {
            return None;
        }
        // Faulty entries are detected by the number of errors that reading them adds.
        let n_errors = log.n_errors();
        Some(Self {
            entries: array.iter().filter_map(|entry| T::read(entry, log)).collect(),
            span: node.span,
            faulty: log.n_errors() > n_errors,
        })
    }
}

/// Reports a list or table with more than [`MOST_ENTRIES`] entries; true if it has more.
fn too_many(n: usize, span: SourceSpan, log: &mut DiagnosticLog) -> bool {
    if n > MOST_ENTRIES {
        log.push(
            Diagnostic::error(span, format!("there are {n} entries here")).label(format!("at most {MOST_ENTRIES}")),
        );
    }
    n > MOST_ENTRIES
}

#[cfg(any(test, feature = "schema"))]
impl<T: JsonSchema> JsonSchema for EntryList<T> {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        format!("ListOf{}", T::schema_name()).into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "array", "items": generator.subschema_for::<T>() })
    }
}

/// One entry, or a list of them.
#[derive(Clone, Debug)]
pub(crate) struct OneOrMany<T> {
    /// The entries; exactly one if the file gives no list.
    pub(crate) entries: Vec<T>,
    /// Where the value stands.
    pub(crate) span: SourceSpan,
}

impl<T: SchemaValue> SchemaValue for OneOrMany<T> {
    const EXPECTED: &'static str = T::EXPECTED;
    const EXAMPLE: &'static str = T::EXAMPLE;

    fn read(node: &TomlNode, log: &mut DiagnosticLog) -> Option<Self> {
        if let TomlValue::Array(_) = node.value {
            let list = EntryList::<T>::read(node, log)?;
            return Some(Self {
                entries: list.entries,
                span: list.span,
            });
        }
        Some(Self {
            entries: vec![T::read(node, log)?],
            span: node.span,
        })
    }
}

#[cfg(any(test, feature = "schema"))]
impl<T: JsonSchema> JsonSchema for OneOrMany<T> {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        format!("OneOrMany{}", T::schema_name()).into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let one = generator.subschema_for::<T>();
        json_schema!({ "anyOf": [one, { "type": "array", "minItems": 1, "items": one }] })
    }
}

/// Entries under names of the author's choice, in the order of the file.
#[derive(Clone, Debug)]
pub(crate) struct NamedEntries<T> {
    /// The entries that could be read, with their names and the places of these.
    pub(crate) entries: Vec<(TomlKey, T)>,
    /// Names whose entries could not be read; they count as known.
    pub(crate) faulty: Vec<TomlKey>,
}

impl<T: SchemaValue> SchemaValue for NamedEntries<T> {
    const EXPECTED: &'static str = "a table of names";
    const EXAMPLE: &'static str = "{ name = ... }";

    fn read(node: &TomlNode, log: &mut DiagnosticLog) -> Option<Self> {
        let TomlValue::Table(table) = &node.value else {
            return wrong_type::<Self>(node, log);
        };
        if too_many(table.len(), node.span, log) {
            return None;
        }
        let mut named = Self {
            entries: Vec::new(),
            faulty: Vec::new(),
        };
        // An entry with a faulty name is read too, so that its own faults are reported.
        for (key, entry) in table {
            let fine = check_name(&key.name, key.span, log);
            match T::read(entry, log) {
                Some(entry) if fine => named.entries.push((key.clone(), entry)),
                _ => named.faulty.push(key.clone()),
            }
        }
        Some(named)
    }
}

#[cfg(any(test, feature = "schema"))]
impl<T: JsonSchema> JsonSchema for NamedEntries<T> {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        format!("Named{}", T::schema_name()).into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "type": "object",
            "propertyNames": { "pattern": "^[A-Za-z][A-Za-z0-9_]*$" },
            "additionalProperties": generator.subschema_for::<T>(),
        })
    }
}
