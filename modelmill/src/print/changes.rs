//! Differences between two models (entries, parameters, base, operations), as JSON for scripts and as text for people.

use modelmill_codegen::review::NumericMethod;
use serde_json::{Value, json};

use crate::model::{EntryChange, Model, ModelChanges};
use crate::text::TerminalStyle;

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
        json!({
            "before": side(before),
            "after": side(after),
            "entries": list(&self.entries),
            "parameters": list(&self.products),
            "dependencies": list(&self.dependencies),
            "base": list(&self.base),
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
            &format!("p_g, eq. (5): {} -> {} products", n(before), n(after)),
            "no change",
            &self.products,
        );
        section("dependencies, eq. (6)", "no change", &self.dependencies);
        section(
            &format!(
                "p_min, eq. (16), by retained product: {} -> {}",
                before.base.len(),
                after.base.len()
            ),
            "no change",
            &self.base,
        );
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
