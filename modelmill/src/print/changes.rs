//! Differences between two models (entries, parameters, base, operations), as JSON for scripts and as text for people.

use modelmill_codegen::review::NumericMethod;
use serde_json::{Value, json};

use crate::model::{BaseValueChange, EntryChange, Model, ModelChanges};
use crate::text::TerminalStyle;
use crate::text::table;

impl ModelChanges {
    /// All changes as one JSON object: base parameters of both models, changed entries, products (eq. (5)),
    /// dependencies (eq. (6)), base parameters (eq. (16)), and operations for each call.
    pub fn json(&self, before: &Model, after: &Model) -> Value {
        // Each change has a name and its text before and after; null means added or removed.
        // Changes are in the order of the files.
        let list = |changes: &[EntryChange]| -> Vec<Value> {
            changes
                .iter()
                .map(|c| json!({ "name": c.name, "before": c.before, "after": c.after }))
                .collect()
        };
        // The complete base of both models, for comparison.
        let base = |model: &Model| -> Vec<Value> {
            let list = model.base.iter();
            list.map(|b| json!({ "name": b.name, "retained": b.retained, "expression": b.expression }))
                .collect()
        };
        // Keys of JSON have no blanks.
        let operations: serde_json::Map<String, Value> = self
            .operations
            .iter()
            .map(|(name, before, after)| (name.replace(' ', "_"), json!({ "before": before, "after": after })))
            .collect();
        // A numeric reduction is named, since its base is valid for one geometry only.
        let side = |model: &Model| {
            let mut side = json!({ "model": model.name, "base": base(model) });
            if let Some(method) = NumericMethod::from_reduction(&model.derivation.reduction) {
                side["reduction"] = json!(method);
            }
            side
        };
        let values = self.values.iter();
        let values: Vec<Value> = values
            .map(|c| json!({ "name": c.retained, "unit": c.unit, "before": c.before, "after": c.after }))
            .collect();
        json!({
            "before": side(before),
            "after": side(after),
            "entries": list(&self.entries),
            "parameters": list(&self.products),
            "dependencies": list(&self.dependencies),
            "base": list(&self.base),
            "values": values,
            "operations": operations,
        })
    }

    /// The changes as text: removed lines in red with `-`, added ones in green with `+`.
    pub fn text(&self, before: &Model, after: &Model, style: TerminalStyle) -> String {
        let mut lines = vec![style.bold(&format!("{} -> {}", before.path, after.path))];
        // A base that is valid for one geometry only must be known to the reader.
        for model in [before, after] {
            if let Some(caution) = model.derivation.reduction.method.caution() {
                lines.push(format!("  {}: {caution}", model.path));
            }
        }
        // One section for each list of changes; `none` stands for an empty list.
        let mut section = |title: &str, none: &str, changes: &[EntryChange]| {
            lines.push(String::new());
            lines.push(style.bold(title));
            if changes.is_empty() {
                lines.push(format!("  {none}"));
            }
            // A changed entry has a removed and an added line.
            for change in changes {
                let name = &change.name;
                if let Some(text) = &change.before {
                    lines.push(style.red(&format!("  - {name}: {text}")));
                }
                if let Some(text) = &change.after {
                    lines.push(style.green(&format!("  + {name}: {text}")));
                }
            }
        };
        // From the file to the results: entries, products, dependencies, base parameters.
        section("entries of the model file", "no change", &self.entries);
        // Numbers of products of both models.
        let n = |model: &Model| model.derivation.reduction.products.len();
        section(
            &format!("p_g: {} -> {} products of parameters", n(before), n(after)),
            "no change",
            &self.products,
        );
        section("dependencies of regressor columns", "no change", &self.dependencies);
        section(
            &format!(
                "p_min: {} -> {} base parameters, by retained product",
                before.base.len(),
                after.base.len()
            ),
            "no change",
            &self.base,
        );
        // Models often have the same equations with other values.
        if !self.values.is_empty() {
            lines.push(String::new());
            lines.push(style.bold("nominal values of p_min, by retained product"));
            lines.extend(self.values.iter().map(value_text));
        }
        lines.push(String::new());
        // Operations are printed even without a change.
        lines.push(style.bold("Operations per call"));
        for (name, before, after) in &self.operations {
            if before == after {
                lines.push(format!("  {name}: {after} (no change)"));
            } else {
                lines.push(style.red(&format!("  - {name}: {before}")));
                lines.push(style.green(&format!("  + {name}: {after}")));
            }
        }
        lines.join("\n")
    }
}

/// A line for a changed value, with the relative change if there is one.
fn value_text(change: &BaseValueChange) -> String {
    let text = |value: Option<f64>| value.map_or("not given".to_owned(), table::number);
    let relative = match (change.before, change.after) {
        (Some(before), Some(after)) if before != 0.0 => {
            let percent = 100.0 * (after - before) / before.abs();
            format!(
                " ({}{} %)",
                if percent > 0.0 { "+" } else { "" },
                table::significant(percent, 3)
            )
        }
        _ => String::new(),
    };
    format!(
        "  {}: {} -> {} {}{relative}",
        change.retained,
        text(change.before),
        text(change.after),
        change.unit
    )
}
