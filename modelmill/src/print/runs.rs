//! What differs between runs as JSON and for people.

use modelmill_identify::ParameterInfo;
use serde_json::{Value, json};

use crate::runs::{Changed, Compared, Fitted, OneRun};
use crate::text::Style;
use crate::text::table::{Align, count, number, table};

impl Compared {
    /// All that was found as one JSON object.
    pub fn json(&self) -> Value {
        let later = || self.runs.iter().enumerate().skip(1);
        let moved =
            later().flat_map(|(k, run)| run.moved.iter().map(move |p| self.moved_json(k, *p)));
        let changes = later()
            .flat_map(|(k, run)| run.changes.iter().map(move |change| change_json(k, change)));
        let runs = self.runs.iter().map(|run| {
            json!({
                "file": run.file,
                "samples": run.samples,
                "parameters": self.parameters_json(&run.alone),
            })
        });
        json!({
            "model": self.model,
            "together": self.parameters_json(&self.together),
            "runs": runs.collect::<Vec<_>>(),
            "moved": moved.collect::<Vec<_>>(),
            "changes": changes.collect::<Vec<_>>(),
        })
    }

    fn parameters_json(&self, fitted: &[Fitted]) -> Vec<Value> {
        let pairs = self.parameters.iter().zip(fitted);
        let one = |(info, fitted): (&ParameterInfo, &Fitted)| {
            json!({
                "name": info.name,
                "expression": info.expression,
                "value": fitted.value,
                "std": fitted.deviation,
                "unit": info.unit,
            })
        };
        pairs.map(one).collect()
    }

    /// A base parameter of a run that differs from that of the first.
    fn moved_json(&self, run: usize, k: usize) -> Value {
        let (before, now) = (self.runs[0].alone[k], self.runs[run].alone[k]);
        let deviation = before.beside(now);
        json!({
            "parameter": self.parameters[k].name,
            "sigmas": (now.value - before.value).abs() / deviation,
            "before": before.value,
            "now": now.value,
            "std": deviation,
            "unit": self.parameters[k].unit,
            "between": [0, run],
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
        let info = &self.parameters[k];
        vec![
            info.name.clone(),
            number(before.value),
            number(now.value),
            number(before.beside(now)),
            info.unit.clone(),
            info.expression.clone(),
        ]
    }
}

fn change_json(run: usize, change: &Changed) -> Value {
    let (kind, at, estimates) = change.what.parts(change.unit);
    let estimates = estimates.iter().map(|(name, estimate, unit)| {
        json!({ "name": name, "value": estimate.value, "std": estimate.deviation, "unit": unit })
    });
    json!({
        "kind": kind,
        "at": [at],
        "estimates": estimates.collect::<Vec<_>>(),
        "between": [0, run],
        "gain": change.gain,
        "indistinguishable_from": change.rivals,
        "says": change.says,
    })
}
