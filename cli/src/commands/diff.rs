//! `diff`: what a variant changes, for people who review it.

use modelmill_codegen::review::Equations;
use modelmill_codegen::{OperationCount, Stage};
use serde_json::{Value, json};

use crate::args::DiffArgs;
use crate::entries::entries;
use crate::failure::Outcome;
use crate::model::{self, Model};
use crate::terminal::{self, Style};

/// Prints what changed between two models.
pub(crate) fn run(args: &DiffArgs) -> Outcome {
    let before = model::derive(&args.before)?;
    let after = model::derive(&args.after)?;
    let changes = Changes::new(&before, &after);
    if args.json {
        return terminal::print_json(&changes.json(&before, &after));
    }
    terminal::print(&changes.text(&before, &after, terminal::style()))
}

/// A named entry before and after; equal ones are left out.
struct Change {
    name: String,
    before: Option<String>,
    after: Option<String>,
}

/// Named entries that differ, in the order of the first list, then of the second.
fn changed(before: &[(String, String)], after: &[(String, String)]) -> Vec<Change> {
    let find = |list: &[(String, String)], name: &str| {
        list.iter()
            .find(|(n, _)| n == name)
            .map(|(_, text)| text.clone())
    };
    let added = after
        .iter()
        .filter(|(name, _)| find(before, name).is_none());
    before
        .iter()
        .chain(added)
        .map(|(name, _)| Change {
            name: name.clone(),
            before: find(before, name),
            after: find(after, name),
        })
        .filter(|change| change.before != change.after)
        .collect()
}

/// Everything that differs.
struct Changes {
    entries: Vec<Change>,
    products: Vec<Change>,
    dependencies: Vec<Change>,
    base: Vec<Change>,
    operations: Vec<(&'static str, OperationCount, OperationCount)>,
}

impl Changes {
    fn new(before: &Model, after: &Model) -> Self {
        let products = |model: &Model| -> Vec<(String, String)> {
            let reduction = &model.derivation.reduction;
            let mechanism = &model.derivation.mechanism;
            let with = reduction.products.iter().map(|p| (p, "in p_g"));
            let without = reduction
                .without_effect
                .iter()
                .map(|p| (p, "without effect"));
            with.chain(without)
                .map(|(p, text)| (p.text(mechanism), text.to_owned()))
                .collect()
        };
        let base = |model: &Model| -> Vec<(String, String)> {
            let list = model.base.iter();
            list.map(|b| (b.retained.clone(), b.expression.clone()))
                .collect()
        };
        let count = |pick: &dyn Fn(&Model) -> OperationCount| (pick(before), pick(after));
        let regressor = count(&|m| m.derivation.programs.regressor.count(Stage::State));
        let dynamics = count(&|m| m.derivation.programs.inverse_dynamics.count(Stage::State));
        Self {
            entries: changed(
                &entries(&before.derivation.mechanism),
                &entries(&after.derivation.mechanism),
            ),
            products: changed(&products(before), &products(after)),
            dependencies: changed(&dependencies(before), &dependencies(after)),
            base: changed(&base(before), &base(after)),
            operations: vec![
                ("regressor", regressor.0, regressor.1),
                ("inverse dynamics", dynamics.0, dynamics.1),
            ],
        }
    }

    fn json(&self, before: &Model, after: &Model) -> Value {
        let list = |changes: &[Change]| -> Vec<Value> {
            changes
                .iter()
                .map(|c| json!({ "name": c.name, "before": c.before, "after": c.after }))
                .collect()
        };
        let base = |model: &Model| -> Vec<Value> {
            let list = model.base.iter();
            list.map(
                |b| json!({ "name": b.name, "retained": b.retained, "expression": b.expression }),
            )
            .collect()
        };
        let operations: serde_json::Map<String, Value> = self
            .operations
            .iter()
            .map(|(name, before, after)| {
                (
                    name.replace(' ', "_"),
                    json!({ "before": before, "after": after }),
                )
            })
            .collect();
        json!({
            "before": { "model": before.name, "base": base(before) },
            "after": { "model": after.name, "base": base(after) },
            "entries": list(&self.entries),
            "parameters": list(&self.products),
            "dependencies": list(&self.dependencies),
            "base": list(&self.base),
            "operations": operations,
        })
    }

    fn text(&self, before: &Model, after: &Model, style: Style) -> String {
        let mut lines = vec![style.bold(&format!("{} -> {}", before.path, after.path))];
        let mut section = |title: &str, none: &str, changes: &[Change]| {
            lines.push(String::new());
            lines.push(style.bold(title));
            if changes.is_empty() {
                lines.push(format!("  {none}"));
            }
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
        section("entries of the model", "no change", &self.entries);
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
        lines.push(style.bold("operations per call"));
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

/// The dependencies by product: `d1*h[m1*dc1] + d1^2*h[m1*dc1^2]`.
fn dependencies(model: &Model) -> Vec<(String, String)> {
    let equations = Equations::new(&model.derivation, None);
    equations
        .dependencies
        .into_iter()
        .filter(|line| !line.equals.is_empty())
        .map(|line| {
            let terms: Vec<String> = line
                .equals
                .iter()
                .map(|(retained, factor)| match factor.as_str() {
                    "1" => format!("h[{retained}]"),
                    "-1" => format!("-h[{retained}]"),
                    factor if factor.contains(" + ") || factor.contains(" - ") => {
                        format!("({factor})*h[{retained}]")
                    }
                    factor => format!("{factor}*h[{retained}]"),
                })
                .collect();
            let right = terms.join(" + ").replace("+ -", "- ");
            (format!("h[{}]", line.parameter), right)
        })
        .collect()
}
