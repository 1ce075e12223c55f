//! Differences between runs of one machine, as JSON for scripts and as text for people.

use modelmill_boundary::message;
use modelmill_boundary::text::{CommandName, Message, OptionName, Remedy};
use modelmill_identify::ParameterInfo;
use serde_json::Value;

use crate::answers::{
    ChangePointAnswer, DriveGainAnswer, EstimateAnswer, MeanStepAnswer, MovedParameterAnswer, ParameterAnswer,
    RunAnswer, RunChangeAnswer, RunValueAnswer, RunValuesAnswer, RunsAnswer, SharedFitAnswer, UndecidedDriveAnswer,
    UnreadRunAnswer, to_json,
};
use crate::print::RemedyWording;
use crate::runs::{
    ChangePoint, FittedValue, PhysicalChange, RunChange, RunReport, RunValue, RunVerdict, RunsComparison, SharedFit,
    UndecidedDrive, UndecidedReason,
};
use crate::text::TerminalStyle;
use crate::text::table::{ColumnAlignment, count, percent, table, with_std};

impl RunsComparison {
    /// All differences as one JSON object; its fields are those of the schema `schema/runs.schema.json`.
    pub fn json(&self, wording: &dyn RemedyWording) -> Value {
        to_json(&self.answer(wording))
    }

    /// All differences as the answer of `runs`.
    fn answer(&self, wording: &dyn RemedyWording) -> RunsAnswer {
        let later = || self.runs.iter().enumerate().skip(1);
        // All figures are relative to the first run.
        let moved = later().flat_map(|(k, run)| run.moved.iter().map(move |p| self.moved_parameter_answer(k, *p)));
        let all = self.runs.iter().enumerate();
        // Events within the first run are listed as well, with the pair of indices 0 and 0.
        let changes = all.flat_map(|(k, run)| run.changes.iter().map(move |one| change_answer([0, k], one)));
        let unread = self.unread.iter().map(|one| UnreadRunAnswer {
            file: one.file.clone(),
            says: one.error.format_for(wording),
        });
        // Each run with its own fit.
        let runs = self.runs.iter().enumerate().map(|(k, run)| RunAnswer {
            file: run.file.clone(),
            samples: run.samples,
            parameters: self.parameter_answers(&run.alone),
            verdict: (k > 0).then(|| run.verdict().keyword()),
            undecided: run.undecided.iter().map(undecided_answer).collect(),
            says: (k > 0).then(|| verdict_text(run).format_for(wording)),
        });
        RunsAnswer {
            model: self.model.clone(),
            together: self.parameter_answers(&self.together),
            runs: runs.collect(),
            moved: moved.collect(),
            changes: changes.collect(),
            change_points: self.points.iter().map(|one| self.point_answer(one)).collect(),
            unread: unread.collect(),
            per_run: self.shared.as_ref().map(|shared| self.shared_answer(shared)),
        }
    }

    /// A lasting change: the run from which on it is there, means before and since, and physical causes.
    fn point_answer(&self, point: &ChangePoint) -> ChangePointAnswer {
        // Means of each parameter before and since the change.
        let steps = point.steps.iter().map(|step| MeanStepAnswer {
            parameter: self.parameters[step.parameter].name.clone(),
            before: step.before.value,
            now: step.now.value,
            std: step.before.difference_std(step.now),
            unit: self.parameters[step.parameter].unit.clone(),
        });
        let changes = point.changes.iter();
        ChangePointAnswer {
            run: point.run,
            file: self.runs[point.run].file.clone(),
            parameters: steps.collect(),
            changes: changes
                .map(|one| change_answer([point.run - 1, point.run], one))
                .collect(),
        }
    }

    /// The joint fit, in which some values are shared and each run has others for itself.
    fn shared_answer(&self, fit: &SharedFit) -> SharedFitAnswer {
        // Names and units come from the model. Base parameters that are separate for each run are not in the shared list.
        let shared = self.parameters.iter().zip(&fit.shared);
        let shared = shared.filter_map(|(info, value)| Some(parameter_answer(info, &(*value)?)));
        // Values of each run, absolute or relative to the first run.
        let runs = fit.runs.iter().map(|(file, values)| {
            let values = values.iter().map(|one| RunValueAnswer {
                quantity: one.quantity.clone(),
                name: one.name.clone(),
                value: one.value.value,
                std: one.value.std,
                unit: one.unit.clone(),
                is_against_first: one.is_against_first,
            });
            RunValuesAnswer {
                file: file.clone(),
                values: values.collect(),
            }
        });
        let gains = fit.gains.iter().map(|(drive, gain)| DriveGainAnswer {
            drive: drive.clone(),
            gain: gain.value,
            std: gain.std,
        });
        SharedFitAnswer {
            shared: shared.collect(),
            gains: gains.collect(),
            runs: runs.collect(),
        }
    }

    /// Base parameters with one fitted value each.
    fn parameter_answers(&self, fitted: &[FittedValue]) -> Vec<ParameterAnswer> {
        let pairs = self.parameters.iter().zip(fitted);
        pairs.map(|(info, fitted)| parameter_answer(info, fitted)).collect()
    }

    /// A base parameter of a run that differs from that of the first.
    fn moved_parameter_answer(&self, run: usize, k: usize) -> MovedParameterAnswer {
        // Both values are from separate fits, so their errors are independent.
        let (before, now) = (self.runs[0].alone[k], self.runs[run].alone[k]);
        let std = self.runs[run].difference_std(&self.runs[0], k);
        MovedParameterAnswer {
            parameter: self.parameters[k].name.clone(),
            sigmas: (now.value - before.value).abs() / std,
            before: before.value,
            now: now.value,
            std,
            unit: self.parameters[k].unit.clone(),
            between: [0, run],
        }
    }

    /// The comparison as text: permanent changes, the fit of all runs at once, and each run.
    pub fn text(&self, style: TerminalStyle, wording: &dyn RemedyWording) -> String {
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
            write_many_runs(later, &mut lines, style, wording);
        } else {
            for run in later {
                self.write_run(first, run, &mut lines, style, wording);
            }
            self.write_change_points(&mut lines, style);
        }
        // Files that could not be evaluated come last, with the reason.
        for one in &self.unread {
            lines.push(String::new());
            let why = one.error.format_for(wording);
            lines.push(format!("{} was not evaluated: {why}", one.file));
        }
        lines.push(String::new());
        lines.join("\n")
    }

    /// A run compared with the first one.
    fn write_run(
        &self,
        first: &RunReport,
        run: &RunReport,
        lines: &mut Vec<String>,
        style: TerminalStyle,
        wording: &dyn RemedyWording,
    ) {
        lines.push(String::new());
        lines.push(style.bold(&run.file));
        write_changes(&run.changes, lines);
        let verdict = verdict_text(run).format_for(wording);
        lines.extend((!verdict.is_empty()).then(|| format!("  {verdict}")));
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
            lines.push("  No base parameter took a new value and kept it for two or more runs.".to_owned());
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
            let mut change_lines = Vec::new();
            write_changes(&point.changes, &mut change_lines);
            lines.extend(change_lines.iter().map(|line| format!("  {line}")));
        }
    }

    /// A row of the table of changed base parameters. The standard deviation is that of the difference of both runs.
    fn moved_parameter_row(&self, first: &RunReport, run: &RunReport, k: usize) -> Vec<String> {
        let (before, now) = (first.alone[k], run.alone[k]);
        let info = &self.parameters[k];
        let difference = run.difference_std(first, k);
        let [value, std] = with_std(now.value, difference);
        vec![
            info.name.clone(),
            with_std(before.value, difference)[0].clone(),
            value,
            std,
            info.unit.clone(),
            info.expression.clone(),
        ]
    }
}

/// Up to this number of later runs each run is listed with its base parameters; beyond, only changes are listed.
const MOST_DETAILED_RUNS: usize = 12;

/// The sentences on a run in addition to those on its changes: that nothing changed, that the cause is unknown, or that
/// the runs cannot show it. Empty if the changes are all that there is.
pub(crate) fn verdict_text(run: &RunReport) -> Message {
    let other = if run.changes.is_empty() { "" } else { "other " };
    let unknown = undecided_text(&run.undecided);
    match run.verdict() {
        // Changes of some drives do not show what the undecided drives did.
        RunVerdict::Changed if run.undecided.is_empty() => Message::default(),
        RunVerdict::Changed => message!("For some drives the runs cannot show a change. {}", unknown),
        RunVerdict::Undecided => message!("The runs cannot show whether anything changed. {}", unknown),
        RunVerdict::DifferentWithoutCause => {
            let unknown = if run.undecided.is_empty() {
                Message::default()
            } else {
                message!(" {}", unknown)
            };
            let why = if run.moved.is_empty() {
                "cause is named: each change that was found explains less than the force that stays unexplained, or was found \
                 together with an impossible one, such as friction that would drive the machine. The model lacks an effect."
            } else {
                "single change explains how: the base parameters below differ by more than noise and model error. The model may lack \
                 an effect that depends on the motion."
            };
            message!(
                "The runs differ, but no {other}{why} Find it with {}, then compare the runs again.{}",
                Remedy::command(CommandName::Diagnose),
                unknown
            )
        }
        RunVerdict::Unchanged if run.undecided.is_empty() => {
            format!("No {other}change found that is larger than noise and model error.").into()
        }
        RunVerdict::Unchanged => message!(
            "{} No {other}change found on the other drives that is larger than noise and model error.",
            unknown
        ),
    }
}

/// What the runs cannot show, why, and what to do.
fn undecided_text(undecided: &[UndecidedDrive]) -> Message {
    let mut sentences = Vec::new();
    let named = |is: &dyn Fn(UndecidedReason) -> bool| -> Vec<&UndecidedDrive> {
        undecided.iter().filter(|one| is(one.reason)).collect()
    };
    // Drives with the same reason share a sentence.
    let list = |some: &[&UndecidedDrive]| {
        let names = some.iter().map(|one| {
            let part = match one.reason {
                UndecidedReason::UnexplainedForce { share } => format!(" ({})", percent(Some(share))),
                UndecidedReason::SmallestChange { share } if share.is_finite() => {
                    format!(" ({})", percent(Some(share)))
                }
                _ => String::new(),
            };
            format!("{}{part}", one.drive)
        });
        names.collect::<Vec<_>>().join(", ")
    };
    if let Some(UndecidedReason::TooFewEquations { equations, parameters }) = undecided.first().map(|one| one.reason) {
        return message!(
            "A run has {equations} equations for {parameters} base parameters, which is too few. Record longer runs, or keep more \
             samples ({}).",
            Remedy::option(OptionName::Decimate)
        );
    }
    let unexplained = named(&|one| matches!(one, UndecidedReason::UnexplainedForce { .. }));
    if !unexplained.is_empty() {
        sentences.push(message!(
            "The model leaves most of the force of {} unexplained, so its fitted parameters mean nothing. Find the cause with {}, \
             then compare the runs again.",
            list(&unexplained),
            Remedy::command(CommandName::Diagnose)
        ));
    }
    let standing = named(&|one| matches!(one, UndecidedReason::Standstill));
    if !standing.is_empty() {
        sentences.push(message!(
            "At standstill friction may have any value: {} hardly moves in one of the runs. Record runs in which it moves.",
            list(&standing)
        ));
    }
    let insensitive = named(&|one| matches!(one, UndecidedReason::SmallestChange { .. }));
    if !insensitive.is_empty() {
        sentences.push(message!(
            "Even a change of most of its force would be within noise and model error at {}. Run {} first; if it finds nothing, \
             record longer or faster motions.",
            list(&insensitive),
            Remedy::command(CommandName::Diagnose)
        ));
    }
    Message::join(sentences, " ")
}

/// A drive whose forces cannot show a change: the reason with its number.
fn undecided_answer(one: &UndecidedDrive) -> UndecidedDriveAnswer {
    let share = match one.reason {
        UndecidedReason::UnexplainedForce { share } | UndecidedReason::SmallestChange { share } => {
            Some(share).filter(|share| share.is_finite())
        }
        UndecidedReason::TooFewEquations { .. } | UndecidedReason::Standstill => None,
    };
    UndecidedDriveAnswer {
        drive: one.drive.clone(),
        reason: one.reason.keyword(),
        share,
    }
}

/// A base parameter with a fitted value; one that the run does not determine has no standard deviation.
fn parameter_answer(info: &ParameterInfo, fitted: &FittedValue) -> ParameterAnswer {
    ParameterAnswer {
        name: info.name.clone(),
        expression: info.expression.clone(),
        value: fitted.value,
        std: fitted.std,
        unit: info.unit.clone(),
    }
}

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

/// Many runs: only those with another verdict than "no change" are listed, the others are counted.
fn write_many_runs(later: &[RunReport], lines: &mut Vec<String>, style: TerminalStyle, wording: &dyn RemedyWording) {
    let is_quiet = |run: &&RunReport| run.changes.is_empty() && run.verdict() == RunVerdict::Unchanged;
    let unchanged = later.iter().filter(is_quiet).count();
    lines.push(String::new());
    lines.push(format!(
        "{unchanged} of {} later runs show no change relative to the first run",
        later.len()
    ));
    for run in later.iter().filter(|run| !is_quiet(run)) {
        lines.push(style.bold(&run.file));
        write_changes(&run.changes, lines);
        let verdict = verdict_text(run).format_for(wording);
        lines.extend((!verdict.is_empty()).then(|| format!("  {verdict}")));
    }
}

/// A change; `between` are the indices of both runs.
fn change_answer(between: [usize; 2], change: &RunChange) -> RunChangeAnswer {
    let (kind, at, estimates) = change.change.parts(change.unit);
    // Sizes of the change with standard deviations.
    let estimates = estimates.iter().map(|(name, estimate, unit)| EstimateAnswer {
        name: (*name).to_owned(),
        value: estimate.value,
        std: Some(estimate.std),
        unit: (*unit).to_owned(),
    });
    // Only contacts have a time.
    let interval = match &change.change {
        PhysicalChange::ContactEvent { interval, .. } => Some(*interval),
        _ => None,
    };
    RunChangeAnswer {
        kind: kind.to_owned(),
        at: at.into_iter().map(str::to_owned).collect(),
        estimates: estimates.collect(),
        between,
        interval,
        gain: change.gain,
        indistinguishable_from: change.rivals.clone(),
        says: change.says.clone(),
    }
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
    let text = |value: FittedValue| match value.std {
        Some(std) => with_std(value.value, std),
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
            let [value, std] = text(one.value);
            let against = if one.is_against_first {
                "relative to the first run"
            } else {
                ""
            };
            [one.quantity.as_str(), &one.name, &value, &std, &one.unit, against]
                .map(str::to_owned)
                .to_vec()
        };
        // Values that a run does not determine are listed below the table.
        let known = values.iter().filter(|one| one.value.std.is_some());
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
        let unknown = values.iter().filter(|one| one.value.std.is_none());
        let unknown: Vec<String> = unknown.map(|one| format!("{} of {}", one.name, one.quantity)).collect();
        if !unknown.is_empty() {
            lines.push(format!("    not identifiable: {}", unknown.join(", ")));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::print::RustWording;
    use crate::runs::ChangeEstimate;

    /// A report with given numbers of moved parameters and of undecided drives of two.
    fn report(moved: usize, undecided: usize, changes: Vec<RunChange>) -> RunReport {
        RunReport {
            file: "later.csv".to_owned(),
            samples: 100,
            alone: Vec::new(),
            moved: (0..moved).collect(),
            drives: 2,
            undecided: (0..undecided)
                .map(|d| UndecidedDrive {
                    drive: format!("joint{d}"),
                    reason: UndecidedReason::UnexplainedForce { share: 0.94 },
                })
                .collect(),
            difference_factor: 1.0,
            has_rejected_changes: false,
            changes,
        }
    }

    /// No sentence denies a change above a table of moved parameters, or where nothing can be known.
    #[test]
    fn no_sentence_contradicts_the_table_below_it() {
        let offset = RunChange {
            change: PhysicalChange::Offset {
                drive: "joint0".to_owned(),
                force: ChangeEstimate { value: 2.0, std: 0.1 },
            },
            gain: 400.0,
            unit: "N m",
            rivals: Vec::new(),
            drive_weights: Vec::new(),
            says: "a constant force".to_owned(),
        };
        for moved in [0, 3] {
            for undecided in 0..=2 {
                for changes in [Vec::new(), vec![offset.clone()]] {
                    let is_changed = !changes.is_empty();
                    let one = report(moved, undecided, changes);
                    let says = verdict_text(&one).format_for(&RustWording);
                    let denies = says.contains("No change found") || says.contains("No other change found");
                    assert_eq!(denies, !is_changed && moved == 0 && undecided < 2, "{says}");
                    let is_unknown = !is_changed && undecided == 2;
                    assert_eq!(says.contains("cannot show whether"), is_unknown, "{says}");
                    assert_eq!(says.contains("94.0 %"), undecided > 0, "{says}");
                    // A change that was found and rejected is not denied either.
                    let rejected = RunReport {
                        has_rejected_changes: true,
                        ..one
                    };
                    let says = verdict_text(&rejected).format_for(&RustWording);
                    assert!(!says.contains("change found"), "{says}");
                    let is_named = !is_changed && moved == 0 && undecided < 2;
                    assert_eq!(says.contains("no cause is named"), is_named, "{says}");
                    assert_eq!(says.contains("94.0 %"), undecided > 0, "{says}");
                }
            }
        }
    }
}
