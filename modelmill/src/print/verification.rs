//! Verifications, as a table for people, JSON for scripts, and JUnit XML for services that run tests.

use crate::text::wrap::wrap_words;
use std::fmt::Write as _;

use modelmill_boundary::text::html;
use serde_json::{Value, json};

use crate::print::RemedyWording;
use crate::text::TerminalStyle;
use crate::text::table::{ColumnAlignment, count, number, significant, table};
use crate::verify::thresholds::{
    DEFAULT_ERROR_PERCENT, DEFAULT_FORCE_SHARE, DEFAULT_PROBABILITY, DEFAULT_RELATIVE_DIFFERENCE, DEFAULT_SIGMAS,
};
use crate::verify::{CheckScope, CheckState, FileFingerprint, ModelVerification, VerificationCheck};

/// Name and version of the JSON. The number rises if a field is removed or changes its meaning.
pub const VERIFICATION_SCHEMA: &str = "modelmill.verify/1";
/// Letters of a line of causes.
const LINE_LETTERS: usize = 96;

/// What a verification was made with, for its output.
#[derive(Clone, Copy, Debug)]
pub struct VerificationContext<'a> {
    /// Where the values of the base parameters come from: `nominal`, or the path of a fit.
    pub parameters: &'a str,
    /// Path of the file of limits, if there is one.
    pub limits: Option<&'a str>,
    /// The files that were used.
    pub inputs: &'a [FileFingerprint],
    /// Version of the program.
    pub version: &'a str,
    /// SHA-256 of the program file, if it is known.
    pub program_sha256: Option<&'a str>,
}

impl ModelVerification {
    /// The verification as one JSON object.
    pub fn json(&self, context: &VerificationContext<'_>, wording: &dyn RemedyWording) -> Value {
        let check = |one: &VerificationCheck| {
            json!({
                "scope": one.scope.name(),
                "recording": one.recording,
                "at": one.at,
                "quantity": one.quantity,
                "state": one.state.name(),
                "value": one.value,
                "std": one.std,
                "limit": one.limit,
                "unit": one.unit,
                "default": one.is_default,
                "says": one.says,
                "cause": one.cause.as_ref().map(|cause| cause.format_for(wording)),
            })
        };
        let input = |one: &FileFingerprint| json!({"role": one.role.name(), "file": one.file, "sha256": one.sha256});
        json!({
            "schema": VERIFICATION_SCHEMA,
            "model": self.model,
            "parameters": context.parameters,
            "state": self.state().name(),
            "counts": {
                "pass": self.count(CheckState::Pass),
                "fail": self.count(CheckState::Fail),
                "not_evaluated": self.count(CheckState::NotEvaluated),
            },
            "checks": self.checks.iter().map(check).collect::<Vec<_>>(),
            "limits": {"file": context.limits, "defaults": self.default_limits()},
            "diagnosis": {
                "verdict": self.diagnosis.as_ref().ok().map(|found| found.diagnosis.verdict),
                "says": match &self.diagnosis {
                    Ok(found) => found.verdict_text(),
                    Err(error) => error.format_for(wording),
                },
            },
            "inputs": context.inputs.iter().map(input).collect::<Vec<_>>(),
            "program": {"name": "modelmill", "version": context.version, "sha256": context.program_sha256},
        })
    }

    /// The verification as text: the result, a table of the checks, and the causes of failures.
    pub fn text(&self, context: &VerificationContext<'_>, style: TerminalStyle, wording: &dyn RemedyWording) -> String {
        let mut lines = vec![style.bold(&self.headline(context)), String::new()];
        lines.extend(self.table());
        let failed: Vec<&VerificationCheck> = self.checks.iter().filter(|one| one.state == CheckState::Fail).collect();
        if !failed.is_empty() {
            lines.push(String::new());
            lines.push(style.bold("Failures and their causes"));
            for one in failed {
                push_lines(&mut lines, "  ", &sentence(&located(one)));
                if let Some(cause) = &one.cause {
                    push_lines(
                        &mut lines,
                        "    ",
                        &sentence(&format!("Cause: {}", cause.format_for(wording))),
                    );
                }
            }
        }
        let mut open: Vec<&VerificationCheck> = Vec::new();
        for one in self.checks.iter().filter(|one| one.state == CheckState::NotEvaluated) {
            if open.iter().all(|other| other.says != one.says) {
                open.push(one);
            }
        }
        if !open.is_empty() {
            lines.push(String::new());
            lines.push(style.bold("Not evaluated"));
            for one in open {
                push_lines(&mut lines, "  ", &sentence(&located(one)));
            }
        }
        let defaults = self.default_limits();
        if !defaults.is_empty() {
            lines.push(String::new());
            lines.push(style.bold("Default limits were used; a file of limits replaces them"));
            for says in &defaults {
                push_lines(&mut lines, "  ", &sentence(says));
            }
        }
        lines.join("\n")
    }

    /// The verification as JUnit XML: a test suite for each scope, a test case for each check. Checks that were not
    /// evaluated are skipped test cases.
    pub fn junit(&self, wording: &dyn RemedyWording) -> String {
        let suites: Vec<(CheckScope, Vec<&VerificationCheck>)> = (CheckScope::ALL.iter())
            .map(|scope| (*scope, self.checks.iter().filter(|one| one.scope == *scope).collect()))
            .collect();
        let counts = |checks: &[&VerificationCheck]| {
            let of = |state: CheckState| checks.iter().filter(|one| one.state == state).count();
            let [failures, skipped] = [of(CheckState::Fail), of(CheckState::NotEvaluated)];
            format!(
                r#"tests="{}" failures="{failures}" errors="0" skipped="{skipped}""#,
                checks.len()
            )
        };
        let all: Vec<&VerificationCheck> = self.checks.iter().collect();
        let mut text = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n".to_owned();
        let _ = writeln!(text, r#"<testsuites name="{}" {}>"#, xml(&self.model), counts(&all));
        for (scope, checks) in suites.iter().filter(|(_, checks)| !checks.is_empty()) {
            let class = format!("{}.{}", self.model, scope.name());
            let _ = writeln!(text, r#"  <testsuite name="{}" {}>"#, xml(&class), counts(checks));
            for one in checks {
                let _ = write!(
                    text,
                    r#"    <testcase classname="{}" name="{}""#,
                    xml(&class),
                    xml(&case_name(one))
                );
                match one.state {
                    CheckState::Pass => text.push_str("/>\n"),
                    CheckState::NotEvaluated => {
                        let _ = writeln!(
                            text,
                            ">\n      <skipped message=\"{}\"/>\n    </testcase>",
                            xml(&one.says)
                        );
                    }
                    CheckState::Fail => {
                        let cause = one.cause.as_ref().map(|cause| cause.format_for(wording));
                        let cause = cause.map_or_else(String::new, |cause| sentence(&format!("Cause: {cause}")));
                        let _ = writeln!(
                            text,
                            ">\n      <failure type=\"{}\" message=\"{}\">{}</failure>\n    </testcase>",
                            one.quantity,
                            xml(&one.says),
                            xml(&cause)
                        );
                    }
                }
            }
            text.push_str("  </testsuite>\n");
        }
        text.push_str("</testsuites>\n");
        text
    }

    /// The first line: the result with the numbers of checks.
    fn headline(&self, context: &VerificationContext<'_>) -> String {
        let state = match self.state() {
            CheckState::Pass => "passes",
            CheckState::Fail => "fails",
            CheckState::NotEvaluated => "is not evaluated",
        };
        let [pass, fail, open] =
            [CheckState::Pass, CheckState::Fail, CheckState::NotEvaluated].map(|state| self.count(state));
        format!(
            "{} with {} parameters {state}: {} ({pass} pass, {fail} fail, {open} not evaluated)",
            self.model,
            context.parameters,
            count(self.checks.len(), "check", "checks")
        )
    }

    /// The checks as a table.
    fn table(&self) -> Vec<String> {
        let value = |value: f64, one: &VerificationCheck| match one.scope {
            CheckScope::Parameter => number(value),
            _ => significant(value, 3),
        };
        let limit = |one: &VerificationCheck| match one.limit {
            [None, None] => String::new(),
            [None, Some(high)] => value(high, one),
            [Some(low), None] => format!("{} ...", value(low, one)),
            [Some(low), Some(high)] => format!("{} ... {}", value(low, one), value(high, one)),
        };
        let row = |one: &VerificationCheck| {
            vec![
                one.state.word().to_owned(),
                one.scope.name().to_owned(),
                one.at.clone(),
                match one.scope {
                    CheckScope::Recording => String::new(),
                    _ => one.recording.clone().unwrap_or_default(),
                },
                one.value.map_or_else(String::new, |found| value(found, one)),
                limit(one),
                one.unit.clone(),
            ]
        };
        let columns = [
            ("state", ColumnAlignment::Left),
            ("scope", ColumnAlignment::Left),
            ("of", ColumnAlignment::Left),
            ("recording", ColumnAlignment::Left),
            ("value", ColumnAlignment::Right),
            ("limit", ColumnAlignment::Right),
            ("unit", ColumnAlignment::Left),
        ];
        table(2, &columns, &self.checks.iter().map(row).collect::<Vec<_>>())
    }

    /// Default limits that were used, as sentences without full stop.
    fn default_limits(&self) -> Vec<String> {
        let has_default = |scope: CheckScope| self.checks.iter().any(|one| one.scope == scope && one.is_default);
        let mut says = Vec::new();
        if has_default(CheckScope::Drive) {
            says.push(format!(
                "drives: rms error up to {DEFAULT_ERROR_PERCENT} % of the rms force, in addition to the noise"
            ));
        }
        if has_default(CheckScope::Parameter) {
            says.push(format!(
                "parameters: estimates within {} % of the model's value. A larger difference fails if it changes the force of a \
                 drive by more than {} % and exceeds {DEFAULT_SIGMAS} standard deviations",
                100.0 * DEFAULT_RELATIVE_DIFFERENCE,
                100.0 * DEFAULT_FORCE_SHARE
            ));
        }
        if has_default(CheckScope::Effect) {
            says.push(format!(
                "effects: no new effect with a probability above {DEFAULT_PROBABILITY}"
            ));
        }
        says
    }
}

/// What a check found, with its recording.
fn located(one: &VerificationCheck) -> String {
    match &one.recording {
        Some(file) => format!("{file}: {}", one.says),
        None => one.says.clone(),
    }
}

/// The name of a test case, unique within its suite.
fn case_name(one: &VerificationCheck) -> String {
    let place = match (one.scope, &one.recording) {
        (CheckScope::Drive, Some(file)) => format!("{} {} [{file}]", one.at, one.quantity),
        _ => format!("{} {}", one.at, one.quantity),
    };
    place.trim().to_owned()
}

/// A text with a full stop.
fn sentence(text: &str) -> String {
    if text.ends_with('.') {
        text.to_owned()
    } else {
        format!("{text}.")
    }
}

/// Appends a text in lines with an indent.
fn push_lines(lines: &mut Vec<String>, indent: &str, text: &str) {
    let wrapped = wrap_words(text, LINE_LETTERS);
    lines.extend(wrapped.iter().map(|line| format!("{indent}{line}")));
}

/// A text for XML. Control characters are not allowed there, even escaped.
fn xml(text: &str) -> String {
    let allowed: String = text
        .chars()
        .filter(|c| !c.is_control() || matches!(c, '\n' | '\t'))
        .collect();
    html(&allowed).into_owned()
}
