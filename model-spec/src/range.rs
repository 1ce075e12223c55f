//! Ranges of values: `2.5` for the range from -2.5 to 2.5, `[-1, 2.5]` for two ends.

#[cfg(any(test, feature = "schema"))]
use std::borrow::Cow;

#[cfg(any(test, feature = "schema"))]
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};

use crate::diagnostic::{Diagnostic, DiagnosticLog, SourceSpan};
use crate::document::{TomlNode, TomlValue};
use crate::record::{SchemaValue, wrong_type};
use crate::values::SpannedNumber;

/// A range with its place.
/// The file gives two ends, or one positive number for a symmetric range.
#[derive(Clone, Debug)]
pub(crate) struct ValueRange {
    /// Lower and upper end, in SI units; the lower one is smaller.
    pub(crate) ends: [f64; 2],
    /// Where the range stands.
    pub(crate) span: SourceSpan,
}

impl SchemaValue for ValueRange {
    const EXPECTED: &'static str = "two numbers, the lower one first, or one for both directions";
    const EXAMPLE: &'static str = "[-1.5, 2]";

    fn read(node: &TomlNode, log: &mut DiagnosticLog) -> Option<Self> {
        let span = node.span;
        let ends = match &node.value {
            // One number stands for both directions, so it must be positive.
            TomlValue::Number { .. } => {
                let size = SpannedNumber::read(node, log)?.value;
                if size <= 0.0 {
                    log.push(
                        Diagnostic::error(span, "this range is empty")
                            .label("expected a number above 0, which is meant in both directions")
                            .help("write a range as `[low, high]`, such as `[-2, -1]`"),
                    );
                    return None;
                }
                [-size, size]
            }
            // Two numbers: both are read before either fault ends the reading.
            TomlValue::Array(entries) if entries.len() == 2 => {
                let low = SpannedNumber::read(&entries[0], log);
                let high = SpannedNumber::read(&entries[1], log);
                [low?.value, high?.value]
            }
            _ => return wrong_type::<Self>(node, log),
        };
        // An empty range is often one with swapped ends.
        if ends[0] >= ends[1] {
            log.push(
                Diagnostic::error(span, "this range is empty")
                    .label("expected the lower end first")
                    .help(format!("for example `[{}, {}]`", ends[1], ends[0])),
            );
            return None;
        }
        Some(Self { ends, span })
    }
}

#[cfg(any(test, feature = "schema"))]
impl JsonSchema for ValueRange {
    fn schema_name() -> Cow<'static, str> {
        "Range".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "Two numbers, the lower one first; one number stands for both directions.",
            "oneOf": [
                { "type": "number", "exclusiveMinimum": 0 },
                { "type": "array", "items": { "type": "number" }, "minItems": 2, "maxItems": 2 },
            ],
        })
    }
}
