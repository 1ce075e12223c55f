//! `doctor`: what this computer has of the program's own parts and of other programs, and which command needs what is
//! missing.

mod programs;
mod requirements;

use modelmill::text::table::{ColumnAlignment, table};
use modelmill::text::wrap::wrap_words;
use serde_json::{Value, json};

use crate::args::DoctorArgs;
use crate::failure::{CommandFailure, CommandOutcome};
use crate::terminal;

use requirements::RequirementCheck;

/// Letters of a line of text, as in the help.
const LINE_LETTERS: usize = 100;

/// Checks all requirements and prints them. Fails if an essential one is not met.
pub(crate) fn run(args: &DoctorArgs) -> CommandOutcome {
    let checks = requirements::check_all();
    if args.json {
        terminal::print_json(&to_json(&checks))?;
    } else {
        terminal::print(&to_text(&checks))?;
    }
    if is_ready(&checks) {
        Ok(())
    } else {
        Err(CommandFailure::Unusable)
    }
}

/// Whether all essential requirements are met.
fn is_ready(checks: &[RequirementCheck]) -> bool {
    checks.iter().all(|check| !check.is_essential || check.is_met())
}

/// The checks as one JSON object.
fn to_json(checks: &[RequirementCheck]) -> Value {
    let one = |check: &RequirementCheck| {
        json!({
            "name": check.name,
            "essential": check.is_essential,
            "state": check.state.name(),
            "version": check.version,
            "least_version": check.least_version,
            "path": check.path.as_ref().map(|path| path.display().to_string()),
            "needed_for": check.needed_for,
            "remedy": check.remedy,
        })
    };
    json!({
        "version": env!("CARGO_PKG_VERSION"),
        "ready": is_ready(checks),
        "requirements": checks.iter().map(one).collect::<Vec<_>>(),
    })
}

/// The checks as a table, and below it what is not met with its remedy.
fn to_text(checks: &[RequirementCheck]) -> String {
    let style = terminal::style();
    let columns = ["requirement", "state", "version", "needed for"].map(|name| (name, ColumnAlignment::Left));
    let rows: Vec<Vec<String>> = checks
        .iter()
        .map(|check| {
            let version = match (&check.version, check.least_version) {
                (Some(version), Some(least)) => format!("{version} ({least} or newer)"),
                (Some(version), None) => version.clone(),
                (None, Some(least)) => format!("{least} or newer"),
                (None, None) => String::new(),
            };
            vec![
                check.name.to_owned(),
                check.state.name().to_owned(),
                version,
                check.needed_for.join("; "),
            ]
        })
        .collect();
    let mut lines = vec![format!("modelmill {}", env!("CARGO_PKG_VERSION")), String::new()];
    lines.extend(table(0, &columns, &rows));
    lines.push(String::new());
    let unmet: Vec<&RequirementCheck> = checks.iter().filter(|check| !check.is_met()).collect();
    let verdict = match (is_ready(checks), unmet.as_slice()) {
        (false, _) => style.bold_red("The program cannot be used as it is."),
        (true, []) => "Nothing is missing.".to_owned(),
        (true, _) => {
            "The program can be used. What is missing matters only for the commands in the last column.".to_owned()
        }
    };
    lines.push(verdict);
    for check in unmet {
        let Some(remedy) = &check.remedy else { continue };
        let wrapped = wrap_words(&format!("{}: {remedy}", check.name), LINE_LETTERS - 2);
        lines.extend(wrapped.into_iter().map(|line| format!("  {line}")));
    }
    lines.join("\n")
}
