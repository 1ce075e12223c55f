//! One TOML text as a tree in which every value and key has its place.
//!
//! Text goes in, a [`TomlTable`] comes out. Syntax errors go to the log, and the readable part is returned.

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, Remedy};
use toml::de::{DeTable, DeValue};

use crate::diagnostic::{Diagnostic, DiagnosticLog, SourceSpan};
use crate::toml_budget::find_toml_excess;
use crate::unclosed::first_unclosed_bracket;

/// Largest file in bytes that is read.
pub const LARGEST_FILE: usize = 4 << 20;
/// A text with more broken lines than this, and without the key `schema`, is not a model file.
const MOST_BROKEN_LINES: usize = 20;
/// Longest quotation of names, paths and texts in messages, in characters.
const LONGEST_QUOTE: usize = 60;

/// A value with its place.
#[derive(Clone, Debug)]
pub(crate) struct TomlNode {
    /// Where the value stands.
    pub(crate) span: SourceSpan,
    /// The value.
    pub(crate) value: TomlValue,
}

/// A value of the file.
#[derive(Clone, Debug)]
pub(crate) enum TomlValue {
    /// A string; `inner` is the byte where its content starts, if it stands there without escapes.
    Text { text: String, inner: Option<usize> },
    /// An integer or a decimal, as written.
    Number { text: String, is_integer: bool },
    /// `true` or `false`.
    Boolean(bool),
    /// A date or time, which no entry of a model accepts.
    Datetime,
    /// A list.
    Array(Vec<TomlNode>),
    /// Keys with values, in the order of the file.
    Table(TomlTable),
}

/// Keys with values, in the order of the file.
pub(crate) type TomlTable = Vec<(TomlKey, TomlNode)>;

/// A key with its place.
#[derive(Clone, Debug)]
pub(crate) struct TomlKey {
    /// The key without quotes.
    pub(crate) name: String,
    /// Where the key stands.
    pub(crate) span: SourceSpan,
}

impl TomlNode {
    /// What kind of value this is, for messages.
    pub(crate) fn kind(&self) -> &'static str {
        match &self.value {
            TomlValue::Text { .. } => "a string",
            TomlValue::Number { is_integer: true, .. } => "an integer",
            TomlValue::Number { .. } => "a number",
            TomlValue::Boolean(_) => "a boolean",
            TomlValue::Datetime => "a date",
            TomlValue::Array(_) => "an array",
            TomlValue::Table(_) => "a table",
        }
    }
}

/// Finds a key of a table.
pub(crate) fn find_key<'a>(table: &'a TomlTable, name: &str) -> Option<&'a (TomlKey, TomlNode)> {
    table.iter().find(|(key, _)| key.name == name)
}

/// A user's text, cut to [`LONGEST_QUOTE`] characters so that a message stays readable.
pub(crate) fn quote(text: &str) -> String {
    if text.chars().count() <= LONGEST_QUOTE {
        return text.to_owned();
    }
    let mut cut: String = text.chars().take(LONGEST_QUOTE).collect();
    cut.push_str("...");
    cut
}

/// Parses a file. Syntax errors go to the log, and the readable part is returned.
pub(crate) fn parse_toml(text: &str, file: usize, log: &mut DiagnosticLog) -> TomlTable {
    if let Some(excess) = find_toml_excess(text) {
        log.syntax_broken = true;
        let place = SourceSpan {
            file,
            start: excess.at,
            end: excess.at,
        };
        log.push(
            Diagnostic::error(place, excess.fault)
                .label(excess.limit)
                .help("a model file describes a mechanism; recordings belong in CSV files"),
        );
        return TomlTable::new();
    }
    // The parser treats all text after an open bracket as its content, so only the text before it is parsed.
    let open = first_unclosed_bracket(text).filter(|_| !DeTable::parse_recoverable(text).1.is_empty());
    let Some(open) = open else {
        return parse_closed(text, file, log);
    };
    let line = text[..open.outermost].rfind('\n').map_or(0, |end| end + 1);
    let table = parse_closed(&text[..line], file, log);
    log.syntax_broken = true;
    let span = |at: usize, length: usize| SourceSpan {
        file,
        start: at,
        end: (at + length).min(text.len()),
    };
    // The bracket that is not closed is reported alone; errors behind it are consequences.
    let close = if open.bracket == '{' { '}' } else { ']' };
    let found = Diagnostic::error(
        span(open.at, 1),
        format!("this is not TOML: this `{}` is not closed", open.bracket),
    )
    .label(format!("expected a `{close}` behind its entries"));
    log.push(match open.next {
        Some((at, length)) => found.related(span(at, length), "the next table begins here"),
        None => found.help("the file ends before it is closed"),
    });
    table
}

/// Parses a text without open brackets; reports syntax errors, one per line.
fn parse_closed(text: &str, file: usize, log: &mut DiagnosticLog) -> TomlTable {
    let whole = SourceSpan { file, start: 0, end: 0 };
    let (root, mut errors) = DeTable::parse_recoverable(text);
    errors.sort_by_key(|error| error.span().map_or(0, |range| range.start));
    let is_model = root.get_ref().contains_key("schema");
    let mut last: Option<usize> = None;
    // Faults are kept in a list first, and reported below.
    let mut found = Vec::new();
    for error in &errors {
        log.syntax_broken = true;
        // A second error on the same line is usually a consequence of the first.
        let at = error.span().map_or(0, |range| range.start.min(text.len()));
        let before = last.replace(at);
        if before.is_some_and(|before| before <= at && !text.as_bytes()[before..at].contains(&b'\n')) {
            continue;
        }
        let span = error.span().map_or(whole, |range| SourceSpan {
            file,
            start: range.start.min(text.len()),
            end: range.end.min(text.len()).max(range.start.min(text.len())),
        });
        // Errors are collected first: with very many of them only one summary is reported.
        found.push(syntax_error(span, error.message()));
        if !is_model && found.len() > MOST_BROKEN_LINES {
            let first = found[0].span.unwrap_or(whole);
            log.push(
                Diagnostic::error(first, "this is not a model file")
                    .label("expected TOML, such as `schema = 1`")
                    .help(message!(
                        "if it is a recording, pass it with {}",
                        Remedy::option(OptionName::Data)
                    )),
            );
            return TomlTable::new();
        }
        // More errors help nobody; the log keeps fewer than this.
        if found.len() > 200 {
            break;
        }
    }
    for error in found {
        log.push(error);
    }
    table(root.into_inner(), text, file)
}

/// The diagnostic of a syntax error, with advice chosen by the parser's message.
fn syntax_error(span: SourceSpan, message: &str) -> Diagnostic {
    if message.starts_with("string values must be quoted") {
        return Diagnostic::error(span, "this is not TOML: this value cannot be read")
            .label("expected one value, texts and expressions in quotes")
            .help("separate the entries of `{ }` and `[ ]` by commas");
    }
    // Advice depends on words in the message of the parser.
    let help = if message.contains("recurs") {
        "nest arrays and tables at most 80 deep; a model needs four levels"
    } else if message.contains("duplicate key") {
        "each name may be defined once; rename or delete one of the two"
    } else if message.contains("string") || message.contains("quote") {
        "expressions and names stand in quotes: `a = \"2*d1\"`"
    } else {
        "see https://toml.io for the syntax of TOML"
    };
    Diagnostic::error(span, format!("this is not TOML: {}", quote(message)))
        .label(
            message
                .split(", expected ")
                .nth(1)
                .map_or_else(|| "here".to_owned(), |expected| format!("expected {}", quote(expected))),
        )
        .help(help)
}

/// Converts a table of the parser; `text` is the complete file.
fn table(table: DeTable<'_>, text: &str, file: usize) -> TomlTable {
    table
        .into_iter()
        .map(|(key, value)| {
            let span = SourceSpan {
                file,
                start: key.span().start,
                end: key.span().end,
            };
            let name = key.into_inner().into_owned();
            (TomlKey { name, span }, node(value, text, file))
        })
        .collect()
}

/// Converts a value of the parser with its place.
fn node(value: toml::Spanned<DeValue<'_>>, text: &str, file: usize) -> TomlNode {
    let range = value.span();
    let span = SourceSpan {
        file,
        start: range.start,
        end: range.end,
    };
    let value = match value.into_inner() {
        // The place of the content is needed to mark parts of expressions.
        DeValue::String(string) => {
            // The content starts behind one, three or four characters of quotes (and line feed), if it has no
            // escapes.
            let inner = [1, 3, 4]
                .into_iter()
                .map(|skip| range.start + skip)
                .find(|&at| text.get(at..at + string.len()).is_some_and(|found| found == string));
            TomlValue::Text {
                text: string.into_owned(),
                inner,
            }
        }
        DeValue::Integer(integer) => {
            let digits = integer.as_str();
            // Hexadecimal, octal and binary integers are rewritten in base 10, as later readers expect.
            let text = if integer.radix() == 10 {
                digits.to_owned()
            } else {
                i128::from_str_radix(digits, integer.radix())
                    .map_or_else(|_| digits.to_owned(), |value| value.to_string())
            };
            TomlValue::Number { text, is_integer: true }
        }
        DeValue::Float(float) => TomlValue::Number {
            text: float.as_str().to_owned(),
            is_integer: false,
        },
        DeValue::Boolean(value) => TomlValue::Boolean(value),
        DeValue::Datetime(_) => TomlValue::Datetime,
        DeValue::Array(array) => TomlValue::Array(array.into_iter().map(|entry| node(entry, text, file)).collect()),
        DeValue::Table(inner) => TomlValue::Table(table(inner, text, file)),
    };
    TomlNode { span, value }
}
