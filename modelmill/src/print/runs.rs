//! What differs between runs as JSON and for people.

use serde_json::{Map, Value, json};

use crate::runs::{Compared, Estimate, Fitted, OneRun, What};
use crate::text::Style;
use crate::text::table::{Align, count, number, table};

impl Compared {
    /// All that was found as one JSON object.
    pub fn json(&self) -> Value {
        json!({
            "model": self.model,
            "reference": self.runs.first().map(|run| &run.file),
            "together": self.parameters_json(&self.together),
            "runs": self.runs.iter().map(|run| self.run_json(run)).collect::<Vec<_>>(),
        })
    }

    fn parameters_json(&self, fitted: &[Fitted]) -> Value {
        let entries = self.parameters.iter().zip(fitted).map(|(info, fitted)| {
            let value = json!({
                "value": fitted.value,
                "std": fitted.deviation,
                "unit": info.unit,
                "expression": info.expression,
            });
            (info.name.clone(), value)
        });
        Value::Object(entries.collect::<Map<_, _>>())
    }

    fn run_json(&self, run: &OneRun) -> Value {
        let changes = run.changes.iter().map(|change| {
            let mut object = what_json(&change.what);
            object["says"] = json!(change.says);
            object["gain"] = json!(change.gain);
            object["instead"] = json!(change.rivals);
            object
        });
        json!({
            "file": run.file,
            "samples": run.samples,
            "parameters": self.parameters_json(&run.alone),
            "moved": run.moved.iter().map(|k| &self.parameters[*k].name).collect::<Vec<_>>(),
            "changes": changes.collect::<Vec<_>>(),
        })
    }

    /// The same for people.
    pub fn text(&self, style: Style) -> String {
        let [first, later @ ..] = &self.runs[..] else {
            return String::new();
        };
        let mut lines = vec![style.bold(&format!(
            "{}: {} against {}",
            self.model,
            count(later.len(), "run", "runs"),
            first.file
        ))];
        for run in later {
            lines.push(String::new());
            lines.push(style.bold(&run.file));
            if run.changes.is_empty() {
                lines.push(
                    "  nothing changed beyond what chance and the noise of the runs make"
                        .to_owned(),
                );
            }
            for change in &run.changes {
                lines.push(format!("  {}", change.says));
                if !change.rivals.is_empty() {
                    lines.push(format!(
                        "    these runs cannot tell it from: {}",
                        change.rivals.join("; ")
                    ));
                }
            }
            if !run.moved.is_empty() {
                lines.push("  Base parameters that moved, each run fitted alone:".to_owned());
                let rows: Vec<Vec<String>> = run
                    .moved
                    .iter()
                    .map(|k| self.moved(first, run, *k))
                    .collect();
                let columns = [
                    ("name", Align::Left),
                    ("before", Align::Right),
                    ("now", Align::Right),
                    ("+-", Align::Right),
                    ("unit", Align::Left),
                    ("expression", Align::Left),
                ];
                lines.extend(table(4, &columns, &rows));
            }
        }
        lines.push(String::new());
        lines.join("\n")
    }

    fn moved(&self, first: &OneRun, run: &OneRun, k: usize) -> Vec<String> {
        let (before, now) = (first.alone[k], run.alone[k]);
        let deviation = before
            .deviation
            .unwrap_or(0.0)
            .hypot(now.deviation.unwrap_or(0.0));
        let info = &self.parameters[k];
        vec![
            info.name.clone(),
            number(before.value),
            number(now.value),
            number(deviation),
            info.unit.clone(),
            info.expression.clone(),
        ]
    }
}

fn estimate(estimate: &Estimate) -> Value {
    json!({ "value": estimate.value, "std": estimate.deviation })
}

fn what_json(what: &What) -> Value {
    match what {
        What::Payload {
            frame,
            mass,
            centre,
        } => json!({
            "kind": "payload",
            "at": frame,
            "mass": mass.as_ref().map(estimate),
            "centre": centre.each_ref().map(|at| at.as_ref().map(estimate)),
        }),
        What::Friction {
            drive,
            dry,
            viscous,
            parts,
        } => json!({
            "kind": "friction",
            "at": drive,
            "dry": estimate(dry),
            "viscous": estimate(viscous),
            "dry_part": parts[0],
            "viscous_part": parts[1],
        }),
        What::Offset { drive, force } => {
            json!({ "kind": "offset", "at": drive, "force": estimate(force) })
        }
        What::Scale { drive, factor } => {
            json!({ "kind": "scale", "at": drive, "factor": estimate(factor) })
        }
        What::Clock { factor } => json!({ "kind": "clock", "factor": estimate(factor) }),
    }
}
