//! An edit of a model file: its difference as text, and the added effect as JSON.

use modelmill_spec::edit::NewEffect;
use serde_json::{Value, json};
use similar::TextDiff;

use crate::text::TerminalStyle;

/// Unchanged lines that the difference shows before and after a change.
const CONTEXT: usize = 3;

/// The change of a text as a unified diff; `before` and `after` are the names in its header.
pub fn difference(old: &str, new: &str, [before, after]: [&str; 2]) -> String {
    TextDiff::from_lines(old, new)
        .unified_diff()
        .context_radius(CONTEXT)
        .header(before, after)
        .to_string()
}

/// A diff with the colours of the terminal.
pub fn colour_diff(difference: &str, style: TerminalStyle) -> String {
    let lines = difference.lines().map(|line| {
        // The lines with file names begin like added and removed lines, so they are tested first.
        if line.starts_with("+++") || line.starts_with("---") {
            style.bold(line)
        } else if line.starts_with('+') {
            style.green(line)
        } else if line.starts_with('-') {
            style.red(line)
        } else if line.starts_with("@@") {
            style.cyan(line)
        } else {
            line.to_owned()
        }
    });
    lines.collect::<Vec<_>>().join("\n")
}

/// An effect as JSON: kind, places, parameters with name and nominal value, constants with value.
pub fn effect_json(effect: &NewEffect) -> Value {
    let parameters = effect.parameters.iter().map(|one| {
        let stated = json!({ "name": one.name, "nominal": one.nominal });
        (one.symbol.clone(), stated)
    });
    let constants = effect.constants.iter();
    json!({
        "name": effect.name,
        "kind": effect.kind,
        "at": effect.at,
        "at_each": effect.is_at_each,
        "without": effect.without,
        "parameters": parameters.collect::<serde_json::Map<String, Value>>(),
        "constants": constants.map(|(s, v)| (s.clone(), json!(v))).collect::<serde_json::Map<String, Value>>(),
    })
}
