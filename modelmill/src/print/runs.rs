//! Differences between runs of one machine, as JSON for scripts and as text for people.

use modelmill_identify::ParameterInfo;
use serde_json::{Value, json};

use crate::print::RemedySpelling;
use crate::runs::{
    ChangePoint, FittedValue, PhysicalChange, RunChange, RunReport, RunValue, RunsComparison, SharedFit,
};
use crate::text::TerminalStyle;
use crate::text::table::{ColumnAlignment, count, table, with_deviation};

impl RunsComparison {
    /// All differences as one JSON object; values in SI units.
    ///
    /// - `together`: base parameters of one fit to all runs; `runs`: those of each run fitted separately
    /// - `moved`: base parameters that differ between the first run and another, in standard deviations (`sigmas`)
    /// - `changes`: physical changes of a run relative to the first
    /// - `change_points`: permanent changes; they are searched for if there are at least four runs
    /// - `unread`: files that could not be evaluated, with the reason
    /// - `per_run`: the fit of all runs at once in which some values are separate for each run, if it was requested
    pub fn json(&self, spelling: &dyn RemedySpelling) -> Value {
        let later = || self.runs.iter().enumerate().skip(1);
        // All figures are relative to the first run.
        let moved = later().flat_map(|(k, run)| run.moved.iter().map(move |p| self.moved_parameter_json(k, *p)));
        let all = self.runs.iter().enumerate();
        // Events within the first run are listed as well, with the pair of indices 0 and 0.
        let changes = all.flat_map(|(k, run)| run.changes.iter().map(move |one| change_json([0, k], one)));
        let unread = self.unread.iter();
        let unread = unread.map(|one| json!({ "file": one.file, "says": one.error.spell(spelling) }));
        // Each run with its own fit.
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
            "change_points": self.points.iter().map(|one| self.point_json(one)).collect::<Vec<_>>(),
            "unread": unread.collect::<Vec<_>>(),
            "per_run": self.shared.as_ref().map(|shared| self.shared_json(shared)),
        })
    }

    /// A lasting change as JSON: the run from which on it is there, means before and since, and physical causes.
    fn point_json(&self, point: &ChangePoint) -> Value {
        // Means of each parameter before and since the change.
        let steps = point.steps.iter().map(|step| {
            json!({
                "parameter": self.parameters[step.parameter].name,
                "before": step.before.value,
                "now": step.now.value,
                "std": step.before.difference_deviation(step.now),
                "unit": self.parameters[step.parameter].unit,
            })
        });
        let changes = point.changes.iter();
        json!({
            "run": point.run,
            "file": self.runs[point.run].file,
            "parameters": steps.collect::<Vec<_>>(),
            "changes": changes.map(|one| change_json([point.run - 1, point.run], one)).collect::<Vec<_>>(),
        })
    }

    /// The joint fit, in which some values are shared and each run has others for itself.
    fn shared_json(&self, fit: &SharedFit) -> Value {
        // Names and units come from the model.
        let shared = self.parameters.iter().zip(&fit.shared);
        // Base parameters that are separate for each run are not in the shared list.
        let shared = shared.filter_map(|(info, value)| {
            let value = (*value)?;
            Some(json!({ "name": info.name, "expression": info.expression, "value": value.value, "std": value.deviation, "unit": info.unit }))
        });
        // Factors of force signals, which need a known load.
        let gains = fit
            .gains
            .iter()
            .map(|(drive, gain)| json!({ "drive": drive, "gain": gain.value, "std": gain.deviation }));
        // Values of each run, absolute or relative to the first run.
        let runs = fit.runs.iter().map(|(file, values)| {
            let values = values.iter().map(|one| {
                json!({
                    "of": one.quantity,
                    "name": one.name,
                    "value": one.value.value,
                    "std": one.value.deviation,
                    "unit": one.unit,
                    "against_first": one.is_against_first,
                })
            });
            json!({ "file": file, "values": values.collect::<Vec<_>>() })
        });
        json!({
            "shared": shared.collect::<Vec<_>>(),
            "gains": gains.collect::<Vec<_>>(),
            "runs": runs.collect::<Vec<_>>(),
        })
    }

    /// Base parameters with one fitted value each as JSON.
    fn parameters_json(&self, fitted: &[FittedValue]) -> Vec<Value> {
        // A parameter that the run does not determine has no standard deviation.
        let pairs = self.parameters.iter().zip(fitted);
        let one = |(info, fitted): (&ParameterInfo, &FittedValue)| {
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
    fn moved_parameter_json(&self, run: usize, k: usize) -> Value {
        // Both values are from separate fits, so their errors are independent.
        let (before, now) = (self.runs[0].alone[k], self.runs[run].alone[k]);
        let deviation = before.difference_deviation(now);
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

    /// The comparison as text: permanent changes, the fit of all runs at once, and each run.
    pub fn text(&self, style: TerminalStyle, spelling: &dyn RemedySpelling) -> String {
        let [first, later @ ..] = &self.runs[..] else {
            return String::new();
        };
        let mut lines = vec![style.bold(&format!(
            "{}: {} compared with {}",
            self.model,
            count(later.len(), "run", "runs"),
            first.file
        ))];
        // With many runs the lasting changes come first, since single runs fill pages.
        if later.len() > MOST_DETAILED_RUNS {
            self.write_change_points(&mut lines, style);
        }
        if let Some(shared) = &self.shared {
            write_shared_fit(shared, &mut lines, style);
        }
        // Changes of the first run are its contacts and pushes.
        if !first.changes.is_empty() {
            lines.push(String::new());
            lines.push(style.bold(&first.file));
            lines.extend(first.changes.iter().map(|one| format!("  {}", one.says)));
        }
        if later.len() > MOST_DETAILED_RUNS {
            write_many_runs(later, &mut lines, style);
        } else {
            for run in later {
                self.write_run(first, run, &mut lines, style);
            }
            self.write_change_points(&mut lines, style);
        }
        // Files that could not be evaluated come last, with the reason.
        for one in &self.unread {
            lines.push(String::new());
            let why = one.error.spell(spelling);
            lines.push(format!("{} was not evaluated: {why}", one.file));
        }
        lines.push(String::new());
        lines.join("\n")
    }

    /// A run compared with the first one.
    fn write_run(&self, first: &RunReport, run: &RunReport, lines: &mut Vec<String>, style: TerminalStyle) {
        lines.push(String::new());
        lines.push(style.bold(&run.file));
        write_changes(&run.changes, lines);
        // A contact within a run is no change of the machine.
        let is_event = |one: &RunChange| matches!(one.change, PhysicalChange::ContactEvent { .. });
        if run.changes.iter().all(is_event) {
            let other = if run.changes.is_empty() { "" } else { "other " };
            lines.push(format!(
                "  No {other}change found that is larger than noise and model error."
            ));
        }
        if !run.moved.is_empty() {
            lines.push("  Base parameters that changed (each run fitted separately):".to_owned());
            // Parameters before and now, with the standard deviation of the difference.
            let rows: Vec<Vec<String>> = run
                .moved
                .iter()
                .map(|k| self.moved_parameter_row(first, run, *k))
                .collect();
            let columns = [
                ("name", ColumnAlignment::Left),
                ("before", ColumnAlignment::Right),
                ("now", ColumnAlignment::Right),
                ("std", ColumnAlignment::Right),
                ("unit", ColumnAlignment::Left),
                ("expression", ColumnAlignment::Left),
            ];
            lines.extend(table(4, &columns, &rows));
        }
    }

    /// Changes that last over two or more runs; nothing for fewer than four runs.
    fn write_change_points(&self, lines: &mut Vec<String>, style: TerminalStyle) {
        // A lasting change needs two runs before and two after it.
        if self.runs.len() < 4 {
            return;
        }
        lines.push(String::new());
        lines.push(style.bold("Lasting changes, in the order of the runs"));
        if self.points.is_empty() {
            lines.push("  No base parameter changed for two or more runs.".to_owned());
        }
        for point in &self.points {
            // Six names are enough to recognise the change; the JSON has all.
            let names: Vec<&str> = (point.steps.iter().take(6))
                .map(|step| self.parameters[step.parameter].name.as_str())
                .collect();
            let more = point.steps.len().saturating_sub(names.len());
            lines.push(format!(
                "  from run {} on ({}): {}{} changed",
                point.run + 1,
                self.runs[point.run].file,
                names.join(", "),
                if more > 0 {
                    format!(" and {more} more")
                } else {
                    String::new()
                },
            ));
            let mut said = Vec::new();
            write_changes(&point.changes, &mut said);
            lines.extend(said.iter().map(|line| format!("  {line}")));
        }
    }

    /// A row of the table of changed base parameters. The standard deviation is that of the difference of both runs.
    fn moved_parameter_row(&self, first: &RunReport, run: &RunReport, k: usize) -> Vec<String> {
        let (before, now) = (first.alone[k], run.alone[k]);
        let info = &self.parameters[k];
        let [value, deviation] = with_deviation(now.value, before.difference_deviation(now));
        vec![
            info.name.clone(),
            with_deviation(before.value, before.difference_deviation(now))[0].clone(),
            value,
            deviation,
            info.unit.clone(),
            info.expression.clone(),
        ]
    }
}

/// Up to this number of later runs each run is listed with its base parameters; beyond, only changes are listed.
const MOST_DETAILED_RUNS: usize = 12;

/// Adds one line for each change, with the changes that explain the runs equally well.
fn write_changes(changes: &[RunChange], lines: &mut Vec<String>) {
    for change in changes {
        lines.push(format!("  {}", change.says));
        if !change.rivals.is_empty() {
            lines.push(format!(
                "    with these runs it is not distinguishable from: {}",
                change.rivals.join("; ")
            ));
        }
    }
}

/// Many runs: only those with changes are listed, the others are counted.
fn write_many_runs(later: &[RunReport], lines: &mut Vec<String>, style: TerminalStyle) {
    let unchanged = later.iter().filter(|run| run.changes.is_empty()).count();
    lines.push(String::new());
    lines.push(format!(
        "{unchanged} of {} later runs show no change relative to the first run",
        later.len()
    ));
    for run in later.iter().filter(|run| !run.changes.is_empty()) {
        lines.push(style.bold(&run.file));
        write_changes(&run.changes, lines);
    }
}

/// A change as JSON; `between` are the indices of both runs.
fn change_json(between: [usize; 2], change: &RunChange) -> Value {
    let (kind, at, estimates) = change.change.parts(change.unit);
    // Sizes of the change with standard deviations.
    let estimates = estimates.iter().map(|(name, estimate, unit)| {
        json!({ "name": name, "value": estimate.value, "std": estimate.deviation, "unit": unit })
    });
    // Only contacts have a time.
    let interval = match &change.change {
        PhysicalChange::ContactEvent { interval, .. } => Some(interval),
        _ => None,
    };
    json!({
        "kind": kind,
        "at": at,
        "estimates": estimates.collect::<Vec<_>>(),
        "between": between,
        "interval": interval,
        "gain": change.gain,
        "indistinguishable_from": change.rivals,
        "says": change.says,
    })
}

/// The joint fit: factors of force signals, and values that each run has for itself.
fn write_shared_fit(fit: &SharedFit, lines: &mut Vec<String>, style: TerminalStyle) {
    lines.push(String::new());
    // Base parameters that are separate for each run are not counted.
    let n = fit.shared.iter().flatten().count();
    lines.push(style.bold(&format!(
        "Joint fit of all runs, with {} shared",
        count(n, "base parameter", "base parameters")
    )));
    // A value without standard deviation was not determined.
    let text = |value: FittedValue| match value.deviation {
        Some(deviation) => with_deviation(value.value, deviation),
        None => ["not identifiable".to_owned(), String::new()],
    };
    if !fit.gains.is_empty() {
        lines.push("  Factors of the force signals (true force = factor times measured force):".to_owned());
        // One row for each drive.
        let rows: Vec<Vec<String>> = (fit.gains.iter())
            .map(|(drive, gain)| [vec![drive.clone()], text(*gain).to_vec()].concat())
            .collect();
        let columns = [
            ("drive", ColumnAlignment::Left),
            ("factor", ColumnAlignment::Right),
            ("std", ColumnAlignment::Right),
        ];
        lines.extend(table(4, &columns, &rows));
    }
    // Runs without values of their own are left out.
    for (file, values) in fit.runs.iter().filter(|(_, values)| !values.is_empty()) {
        lines.push(format!("  {file}"));
        // A change relative to the first run is marked as such.
        let row = |one: &RunValue| {
            let [value, deviation] = text(one.value);
            let against = if one.is_against_first {
                "relative to the first run"
            } else {
                ""
            };
            [one.quantity.as_str(), &one.name, &value, &deviation, &one.unit, against]
                .map(str::to_owned)
                .to_vec()
        };
        // Values that a run does not determine are listed below the table.
        let known = values.iter().filter(|one| one.value.deviation.is_some());
        let rows: Vec<Vec<String>> = known.map(row).collect();
        let columns = [
            ("of", ColumnAlignment::Left),
            ("", ColumnAlignment::Left),
            ("value", ColumnAlignment::Right),
            ("std", ColumnAlignment::Right),
            ("unit", ColumnAlignment::Left),
            ("", ColumnAlignment::Left),
        ];
        lines.extend(table(4, &columns, &rows));
        let unknown = values.iter().filter(|one| one.value.deviation.is_none());
        let unknown: Vec<String> = unknown.map(|one| format!("{} of {}", one.name, one.quantity)).collect();
        if !unknown.is_empty() {
            lines.push(format!("    not identifiable: {}", unknown.join(", ")));
        }
    }
}
