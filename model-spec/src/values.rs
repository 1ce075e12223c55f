//! The small values of a model file: names, texts, numbers, vectors, and the words for an axis.
//!
//! Each type reads itself from a node of the document and reports faults with its place.

#[cfg(any(test, feature = "schema"))]
use std::borrow::Cow;

#[cfg(any(test, feature = "schema"))]
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};

use crate::diagnostic::{Diagnostic, DiagnosticLog, SourceSpan};
use crate::document::{TomlNode, TomlValue, quote};
use crate::formula::SourceFormula;
use crate::record::{SchemaValue, wrong_type};
use crate::schema::{SearchRangeEntry, UnitTable};
use crate::unit::ModelUnit;
use crate::words::words;

/// Words with a meaning in expressions, which therefore cannot be names.
const RESERVED: [&str; 17] = [
    "pi",
    "sin",
    "cos",
    "sqrt",
    "abs",
    "sign",
    "tanh",
    "exp",
    "base",
    "coordinate",
    "rate",
    "acceleration",
    "load",
    "other_coordinate",
    "other_rate",
    "other_acceleration",
    "t",
];

/// Whether a text has a meaning of its own in expressions of model files, so that it cannot name anything.
pub fn is_reserved_word(text: &str) -> bool {
    RESERVED.contains(&text)
}

/// A name, where it is defined or where it is used.
#[derive(Clone, Debug)]
pub(crate) struct SpannedName {
    /// The name, checked to be an identifier.
    pub(crate) text: String,
    /// Where it stands.
    pub(crate) span: SourceSpan,
}

impl SchemaValue for SpannedName {
    const EXPECTED: &'static str = "a name in quotes";
    const EXAMPLE: &'static str = "\"S1\"";

    // Text that is not an identifier is reported and not read.
    fn read(node: &TomlNode, log: &mut DiagnosticLog) -> Option<Self> {
        let TomlValue::Text { text, .. } = &node.value else {
            return wrong_type::<Self>(node, log);
        };
        check_name(text, node.span, log).then(|| Self {
            text: text.clone(),
            span: node.span,
        })
    }
}

/// Whether a text is an identifier: a letter, then letters, digits and `_`, at most 60 characters.
///
/// Generated code uses names of models, so they must be identifiers there.
pub(crate) fn is_name(text: &str) -> bool {
    text.len() <= 60
        && text.starts_with(|first: char| first.is_ascii_alphabetic())
        && text.chars().all(|found| found.is_ascii_alphanumeric() || found == '_')
}

/// Reports a name that is not an identifier; true if it is one.
pub(crate) fn check_name(text: &str, span: SourceSpan, log: &mut DiagnosticLog) -> bool {
    let fine = is_name(text);
    if !fine {
        log.push(
            Diagnostic::error(span, format!("`{}` cannot be a name", quote(text)))
                .label("expected a letter, then letters, digits and `_`, at most 60")
                .help_if(similar_name(text).map(|name| format!("write `{name}`, wherever it is used"))),
        );
    }
    fine
}

/// The nearest text that can be a name: `my_arm` for `my arm`.
fn similar_name(text: &str) -> Option<String> {
    let is_allowed = |found: char| found.is_ascii_alphanumeric() || found == '_';
    let words: Vec<&str> = text
        .split(|found| !is_allowed(found))
        .filter(|word| !word.is_empty())
        .collect();
    let joined = words.join("_");
    let name = if joined.starts_with(|first: char| first.is_ascii_digit() || first == '_') {
        format!("n{joined}")
    } else {
        joined
    };
    is_name(&name).then_some(name)
}

/// Reports a name that is a word of the expression language; true if it is not one.
///
/// These are functions, quantities of a place, `base`, and the time `t`.
pub(crate) fn check_not_reserved(text: &str, span: SourceSpan, log: &mut DiagnosticLog) -> bool {
    let reserved = is_reserved_word(text);
    if reserved {
        log.push(
            Diagnostic::error(span, format!("`{text}` cannot name anything new"))
                .label("this word has a meaning of its own in model files")
                .help(format!("call it `{text}_1`, for example")),
        );
    }
    !reserved
}

#[cfg(any(test, feature = "schema"))]
impl JsonSchema for SpannedName {
    fn schema_name() -> Cow<'static, str> {
        "Name".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "A name: a letter, then letters, digits and underscores.",
            "type": "string",
            "pattern": "^[A-Za-z][A-Za-z0-9_]*$",
            "maxLength": 60,
        })
    }
}

/// Free text.
#[derive(Clone, Debug)]
pub(crate) struct SpannedText {
    /// The text without its quotes; at most 4000 bytes.
    pub(crate) text: String,
    /// Where it stands.
    pub(crate) span: SourceSpan,
}

impl SchemaValue for SpannedText {
    const EXPECTED: &'static str = "a text in quotes";
    const EXAMPLE: &'static str = "\"...\"";

    // Titles, notes and paths are such texts.
    fn read(node: &TomlNode, log: &mut DiagnosticLog) -> Option<Self> {
        let TomlValue::Text { text, .. } = &node.value else {
            return wrong_type::<Self>(node, log);
        };
        // Notes are printed on pages and in messages, so their length is limited.
        if text.len() > 4000 {
            log.push(Diagnostic::error(node.span, "this text is too long").label("at most 4000 characters"));
            return None;
        }
        Some(Self {
            text: text.clone(),
            span: node.span,
        })
    }
}

#[cfg(any(test, feature = "schema"))]
impl JsonSchema for SpannedText {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Text".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string" })
    }
}

/// A finite number.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SpannedNumber {
    /// The value in SI units.
    pub(crate) value: f64,
    /// Where it stands.
    pub(crate) span: SourceSpan,
}

impl SchemaValue for SpannedNumber {
    const EXPECTED: &'static str = "a number";
    const EXAMPLE: &'static str = "0.25";

    fn read(node: &TomlNode, log: &mut DiagnosticLog) -> Option<Self> {
        let TomlValue::Number { text, .. } = &node.value else {
            return wrong_type::<Self>(node, log);
        };
        // TOML has `inf` and `nan`, which no quantity of a mechanism may be.
        match text.parse::<f64>() {
            Ok(value) if value.is_finite() => Some(Self { value, span: node.span }),
            _ => {
                log.push(
                    Diagnostic::error(node.span, format!("`{}` is not finite", quote(text)))
                        .label("expected a finite number")
                        .help("quantities of a mechanism are finite; omit the entry if its value is not known"),
                );
                None
            }
        }
    }
}

#[cfg(any(test, feature = "schema"))]
impl JsonSchema for SpannedNumber {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Number".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "number" })
    }
}

/// A point of a table: an argument and the value there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TableRow {
    /// Argument and value, in SI units.
    pub(crate) values: [f64; 2],
    /// Where the point stands.
    pub(crate) span: SourceSpan,
}

impl SchemaValue for TableRow {
    const EXPECTED: &'static str = "a pair of numbers, the argument first";
    const EXAMPLE: &'static str = "[0.5, 0.012]";

    fn read(node: &TomlNode, log: &mut DiagnosticLog) -> Option<Self> {
        let TomlValue::Array(entries) = &node.value else {
            return wrong_type::<Self>(node, log);
        };
        let [argument, value] = entries.as_slice() else {
            return wrong_type::<Self>(node, log);
        };
        // Both are read before either fault ends the reading.
        let (argument, value) = (SpannedNumber::read(argument, log), SpannedNumber::read(value, log));
        Some(Self {
            values: [argument?.value, value?.value],
            span: node.span,
        })
    }
}

#[cfg(any(test, feature = "schema"))]
impl JsonSchema for TableRow {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "TableRow".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "array", "items": { "type": "number" }, "minItems": 2, "maxItems": 2 })
    }
}

/// A boolean.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BooleanFlag(pub(crate) bool);

impl SchemaValue for BooleanFlag {
    const EXPECTED: &'static str = "`true` or `false`";
    const EXAMPLE: &'static str = "true";

    fn read(node: &TomlNode, log: &mut DiagnosticLog) -> Option<Self> {
        let TomlValue::Boolean(value) = node.value else {
            return wrong_type::<Self>(node, log);
        };
        Some(Self(value))
    }
}

#[cfg(any(test, feature = "schema"))]
impl JsonSchema for BooleanFlag {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Flag".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "boolean" })
    }
}

/// A unit that may depend on the load of the place: force, torque or mass.
#[derive(Clone, Debug)]
// `None` where the author gives no unit: the kind does not act at such places.
pub(crate) struct UnitByPlace {
    /// Where the place carries a force.
    pub(crate) force: Option<ModelUnit>,
    /// Where the place carries a torque.
    pub(crate) torque: Option<ModelUnit>,
    /// At a point, which carries a mass.
    pub(crate) point: Option<ModelUnit>,
    /// At all other places; only a single unit for all places applies there.
    pub(crate) elsewhere: Option<ModelUnit>,
}

impl SchemaValue for UnitByPlace {
    const EXPECTED: &'static str = "a unit in quotes, or units by place";
    const EXAMPLE: &'static str = "{ force = \"N\", torque = \"N m\" }";

    fn read(node: &TomlNode, log: &mut DiagnosticLog) -> Option<Self> {
        // One unit serves all places.
        match &node.value {
            TomlValue::Text { .. } => {
                let unit = ModelUnit::read(node, log)?;
                Some(Self {
                    force: Some(unit.clone()),
                    torque: Some(unit.clone()),
                    point: Some(unit.clone()),
                    elsewhere: Some(unit),
                })
            }
            // Units by place leave other places without a unit.
            TomlValue::Table(table) => {
                let table = UnitTable::from_table(table, node.span, log);
                Some(Self {
                    force: table.force,
                    torque: table.torque,
                    point: table.point,
                    elsewhere: None,
                })
            }
            _ => wrong_type::<Self>(node, log),
        }
    }
}

#[cfg(any(test, feature = "schema"))]
impl JsonSchema for UnitByPlace {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "UnitByPlace".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let unit = generator.subschema_for::<ModelUnit>();
        let table = generator.subschema_for::<UnitTable>();
        json_schema!({ "anyOf": [unit, table] })
    }
}

/// The version of the file format; only 1 exists.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SchemaVersion;

impl SchemaValue for SchemaVersion {
    const EXPECTED: &'static str = "the version of the file format";
    const EXAMPLE: &'static str = "1";

    fn read(node: &TomlNode, log: &mut DiagnosticLog) -> Option<Self> {
        let TomlValue::Number { text, .. } = &node.value else {
            return wrong_type::<Self>(node, log);
        };
        // Another version is reported, and reading continues with the rules of this one.
        if text != "1" {
            log.push(
                Diagnostic::error(node.span, format!("file format {} is not known", quote(text)))
                    .label("expected 1")
                    .help("a newer modelmill may read this file; this one reads `schema = 1`"),
            );
        }
        Some(Self)
    }
}

#[cfg(any(test, feature = "schema"))]
impl JsonSchema for SchemaVersion {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Version".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "const": 1 })
    }
}

/// Three expressions, or two in the x-y plane.
///
/// In the x-y plane the third entry is zero.
#[derive(Clone, Debug)]
pub(crate) struct FormulaVector {
    /// The entries; absent where one was faulty.
    pub(crate) entries: Vec<Option<SourceFormula>>,
    /// Where the vector stands.
    pub(crate) span: SourceSpan,
}

impl SchemaValue for FormulaVector {
    const EXPECTED: &'static str = "a vector of three expressions, or of two in the x-y plane";
    const EXAMPLE: &'static str = "[\"d1\", 0, 0]";

    fn read(node: &TomlNode, log: &mut DiagnosticLog) -> Option<Self> {
        let TomlValue::Array(array) = &node.value else {
            return wrong_type::<Self>(node, log);
        };
        // Other lengths are refused, because it is unclear which entry is missing.
        if !(2..=3).contains(&array.len()) {
            log.push(
                Diagnostic::error(
                    node.span,
                    match array.len() {
                        1 => "this vector has 1 entry".to_owned(),
                        n => format!("this vector has {n} entries"),
                    },
                )
                .label("expected x, y and z, or x and y")
                .help(format!("for example `{}`", Self::EXAMPLE)),
            );
            return None;
        }
        // A faulty entry is `None`; its fault is reported by the reader of expressions.
        Some(Self {
            entries: array.iter().map(|entry| SourceFormula::read(entry, log)).collect(),
            span: node.span,
        })
    }
}

#[cfg(any(test, feature = "schema"))]
impl JsonSchema for FormulaVector {
    fn schema_name() -> Cow<'static, str> {
        "Vector".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "x, y and z; z may be omitted.",
            "type": "array",
            "items": generator.subschema_for::<SourceFormula>(),
            "minItems": 2,
            "maxItems": 3,
        })
    }
}

/// The place of a lumped mass.
#[derive(Clone, Debug)]
pub(crate) enum LumpedMassPlace {
    /// A named point.
    Point(SpannedName),
    /// A position in the frame.
    Vector(FormulaVector),
}

// Both forms know their place.
impl LumpedMassPlace {
    /// Where it stands in the file.
    pub(crate) fn span(&self) -> SourceSpan {
        match self {
            Self::Point(name) => name.span,
            Self::Vector(vector) => vector.span,
        }
    }
}

impl SchemaValue for LumpedMassPlace {
    const EXPECTED: &'static str = "the name of a point, or a vector";
    const EXAMPLE: &'static str = "\"R3m\"";

    // A text is the name of a point, a list is a position.
    fn read(node: &TomlNode, log: &mut DiagnosticLog) -> Option<Self> {
        match &node.value {
            TomlValue::Text { .. } => SpannedName::read(node, log).map(Self::Point),
            TomlValue::Array(_) => FormulaVector::read(node, log).map(Self::Vector),
            _ => wrong_type::<Self>(node, log),
        }
    }
}

#[cfg(any(test, feature = "schema"))]
impl JsonSchema for LumpedMassPlace {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Spot".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let name = generator.subschema_for::<SpannedName>();
        let vector = generator.subschema_for::<FormulaVector>();
        json_schema!({ "anyOf": [name, vector] })
    }
}

/// The end of a parameter's name, such as `1` in `M1`.
#[derive(Clone, Debug)]
pub(crate) struct NameSuffix {
    /// The suffix: letters, digits and `_`, at most 40; it may be empty.
    pub(crate) text: String,
    /// Where it stands.
    pub(crate) span: SourceSpan,
}

impl SchemaValue for NameSuffix {
    const EXPECTED: &'static str = "the end of a name in quotes";
    const EXAMPLE: &'static str = "\"1\"";

    fn read(node: &TomlNode, log: &mut DiagnosticLog) -> Option<Self> {
        // Numbers are allowed, because suffixes are often indices.
        let (TomlValue::Text { text, .. } | TomlValue::Number { text, is_integer: true }) = &node.value else {
            return wrong_type::<Self>(node, log);
        };
        // The suffix may start with a digit, unlike a name.
        let fine = text.len() <= 40 && text.chars().all(|found| found.is_ascii_alphanumeric() || found == '_');
        if !fine {
            log.push(
                Diagnostic::error(node.span, "this cannot end a name")
                    .label("expected letters, digits and `_`, at most 40"),
            );
            return None;
        }
        Some(Self {
            text: text.clone(),
            span: node.span,
        })
    }
}

#[cfg(any(test, feature = "schema"))]
impl JsonSchema for NameSuffix {
    fn schema_name() -> Cow<'static, str> {
        "Suffix".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "The end of a name, such as 1 in M1.",
            "anyOf": [{ "type": "string", "pattern": "^[A-Za-z0-9_]*$", "maxLength": 40 }, { "type": "integer", "minimum": 0 }],
        })
    }
}

// The direction of an axis of a joint; a minus sign reverses it.
words! {
    /// An axis with its direction.
    pub(crate) AxisName: "an axis",
    "x" => X, "y" => Y, "z" => Z, "-x" => MinusX, "-y" => MinusY, "-z" => MinusZ
}

// The scalar part w comes last or first.
words! {
    /// The order in which a quaternion is written.
    pub(crate) QuaternionOrder: "the order of a quaternion",
    "xyzw" => Xyzw, "wxyz" => Wxyz
}

// The axes of velocity and force, and of angular velocity and moment.
words! {
    /// The axes of the twist of a free body.
    pub(crate) TwistName: "the axes of a twist",
    "body" => Body, "world" => World, "mixed" => Mixed
}

/// How the value of an unknown constant is found.
#[derive(Clone, Debug)]
pub(crate) enum SearchEntry {
    /// The expression is affine in it.
    Linear,
    /// A grid of values in a range is tried.
    Range(SearchRangeEntry),
}

impl SchemaValue for SearchEntry {
    const EXPECTED: &'static str = "a range to search, or `linear`";
    const EXAMPLE: &'static str = "{ from = 0.01, to = 1, of = \"rate\" }";

    fn read(node: &TomlNode, log: &mut DiagnosticLog) -> Option<Self> {
        // The word `linear`, or a table with a range.
        match &node.value {
            TomlValue::Text { text, .. } if text == "linear" => Some(Self::Linear),
            TomlValue::Table(table) => {
                let range = SearchRangeEntry::from_table(table, node.span, log);
                // Both bounds must be present to be compared.
                if let (Some(from), Some(to)) = (range.from, range.to)
                    && from.value >= to.value
                {
                    log.push(
                        Diagnostic::error(to.span, "this range is empty")
                            .label(format!("expected more than {}", from.value)),
                    );
                }
                Some(Self::Range(range))
            }
            _ => wrong_type::<Self>(node, log),
        }
    }
}

#[cfg(any(test, feature = "schema"))]
impl JsonSchema for SearchEntry {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Search".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let range = generator.subschema_for::<SearchRangeEntry>();
        json_schema!({ "anyOf": [{ "const": "linear" }, range] })
    }
}
