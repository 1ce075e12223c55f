//! Tables of the page as HTML: steps, effects, candidates, parameters, recordings with notes.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use modelmill_identify::diagnose::CandidateOutcome;
use modelmill_identify::{FitParameter, NoteSeverity, ParameterStatus};

use super::draw::attribute;
use super::units::{force_unit, typographic_unit};
use super::{DiagnosisFindings, ModelVersion, words};
use crate::diagnose::MissingEffect;
use crate::print::StepWording;
use crate::text::svg::escape;
use crate::text::table::{all_digits, percent, significant};

/// Number of candidates that are shown before the others are folded.
const FIRST: usize = 20;

/// A cell: its HTML, and the number by which a column is sorted.
pub struct TableCell(String, Option<f64>);

impl TableCell {
    /// A cell with text, which is escaped here so that no caller can forget it.
    pub fn text(text: &str) -> Self {
        Self(escape(text), None)
    }

    /// A cell with a number as it is shown, and its value for sorting.
    pub fn number(text: &str, value: f64) -> Self {
        Self(escape(text), Some(value))
    }

    /// A cell with finished HTML.
    pub fn html(html: String) -> Self {
        Self(html, None)
    }
}

/// A table as HTML. Heads that begin with `#` mark columns of numbers, which are aligned right and sorted by value.
pub fn table(class: &str, head: &[&str], rows: &[Vec<TableCell>]) -> String {
    // Wide tables scroll within the page.
    let mut html = format!("<div class=\"wide\"><table class=\"{class}\">\n<thead><tr>");
    // The mark of number columns is not shown.
    for name in head {
        let (class, name) = match name.strip_prefix('#') {
            Some(name) => (" class=\"number\"", name),
            None => ("", *name),
        };
        let _ = write!(html, "<th scope=\"col\"{class}>{}</th>", escape(name));
    }
    html.push_str("</tr></thead>\n<tbody>\n");
    // The value of a number is an attribute, since the shown text has a unit or is rounded.
    for row in rows {
        html.push_str("<tr>");
        for (k, TableCell(text, value)) in row.iter().enumerate() {
            let number = head.get(k).is_some_and(|name| name.starts_with('#'));
            let class = if number { " class=\"number\"" } else { "" };
            let value = value.map_or_else(String::new, |v| format!(" data-value=\"{v:e}\""));
            let _ = write!(html, "<td{class}{value}>{text}</td>");
        }
        html.push_str("</tr>\n");
    }
    html.push_str("</tbody>\n</table></div>\n");
    html
}

/// Error after each step, with the evidence for it.
pub(crate) fn steps(findings: &DiagnosisFindings) -> String {
    let diagnosis = &findings.diagnosis;
    let rows: Vec<Vec<TableCell>> = diagnosis
        .steps
        .iter()
        .map(|step| {
            // Shares are sorted by value, not by text.
            let percents = |v: f64| TableCell::number(&percent(Some(v)), v);
            // Gain, its certainty and the samples on which they are based.
            let evidence = step.evidence;
            // A step without evidence, such as the first, has empty cells.
            let of = |f: &dyn Fn() -> Option<(String, f64)>| match f() {
                Some((text, value)) => TableCell::number(&text, value),
                None => TableCell::text(""),
            };
            vec![
                TableCell::text(&words::step_text(step, &findings.diagnosis, findings.channels())),
                percents(step.fit),
                percents(step.check),
                of(&|| evidence.map(|e| (percent(Some(e.gain)), e.gain))),
                // Without noise the ratio is huge and only its size class matters.
                of(&|| evidence.map(|e| (significant(e.blocks_t.min(999.0), 2), e.blocks_t))),
                of(&|| evidence.map(|e| (format!("{:.0}", e.effective_samples), e.effective_samples))),
            ]
        })
        .collect();
    // The head says on which data errors were judged.
    let check = format!("#error, {}", findings.validation.label());
    table(
        "",
        &[
            "step",
            "#error, fit",
            &check,
            "#decrease of the squared error",
            "#t value of the decrease",
            "#effective samples",
        ],
        &rows,
    )
}

/// Errors of each drive before and after the effects, with the noise of its force.
pub(crate) fn drives(findings: &DiagnosisFindings) -> String {
    // The same figure as in the text: rms of the error over rms of the measured force, on the data that are judged.
    let nrms = |version: &ModelVersion, d: usize| -> f64 {
        // Each model version has its own errors, on the same runs.
        let runs = version.validation_runs();
        let error = version.errors(&runs, d);
        let force = runs.iter().flat_map(|k| &version.runs[*k].measured[d]);
        let size: f64 = force.map(|f| f * f).sum();
        let squares: f64 = error.iter().map(|e| e * e).sum();
        if size > 0.0 { (squares / size).sqrt() } else { 0.0 }
    };
    let before = &findings.before;
    let rows: Vec<Vec<TableCell>> = before
        .model
        .row_names()
        .iter()
        .enumerate()
        .map(|(d, drive)| {
            let unit = force_unit(&before.model, d);
            let noise = findings.answer.problem.noise[d];
            // Error before, error after if there is a model with effects, and noise.
            let mut row = vec![TableCell::text(drive)];
            let first = nrms(before, d);
            row.push(TableCell::number(&percent(Some(first)), first));
            if let Some(after) = findings.after.version() {
                let last = nrms(after, d);
                row.push(TableCell::number(&percent(Some(last)), last));
            }
            row.push(TableCell::number(&format!("{} {unit}", significant(noise, 2)), noise));
            row
        })
        .collect();
    // The column of the model with effects exists only if it could be built.
    let mut head = vec!["drive", "#error of the given model"];
    if findings.after.version().is_some() {
        head.push("#error with the effects");
    }
    head.push("#upper bound of the noise");
    table("", &head, &rows)
}

/// Missing effects: for each kind its meaning once, and for each place values and effects that explain the
/// recordings equally well.
pub(crate) fn effects(findings: &DiagnosisFindings) -> String {
    let answer = &findings.answer;
    // Kinds in the order of their first effect, so that a text about a kind is not repeated for each of its places.
    let mut kinds: Vec<(&str, Vec<&MissingEffect>)> = Vec::new();
    for found in &findings.missing {
        let name = found.effect.kind.as_str();
        match kinds.iter_mut().find(|(kind, _)| *kind == name) {
            Some((_, all)) => all.push(found),
            None => kinds.push((name, vec![found])),
        }
    }
    let mut html = String::new();
    // One section for each kind: meaning, places with values, explanation.
    for (name, all) in kinds {
        // A single place is named in the heading, several are listed.
        let title = match all.as_slice() {
            [one] => words::effect(&one.effect),
            _ => format!("{} ({} times)", words::kind(name), all.len()),
        };
        let _ = writeln!(html, "<h3>{}</h3>", escape(&capitalise(&title)));
        let kind = answer.candidates.kinds.iter().find(|k| k.name == name);
        // What the kind means, in one sentence.
        if let Some(kind) = kind {
            let _ = writeln!(html, "<p>{}</p>", escape(&kind.says));
        }
        // Values of each place.
        if let [one] = all.as_slice() {
            html.push_str(&effect(one, ""));
        } else {
            html.push_str("<ul>\n");
            for one in all {
                let places = format!("{}: ", one.effect.at.join(", "));
                let _ = writeln!(html, "<li>{}</li>", effect(one, &places));
            }
            html.push_str("</ul>\n");
        }
        // Longer explanations are folded.
        if let Some(kind) = kind {
            let texts = [&kind.explains, &kind.confused_with];
            let texts: Vec<String> = texts
                .iter()
                .filter(|text| !text.is_empty())
                .map(|text| format!("<p>{}</p>", escape(text)))
                .collect();
            if !texts.is_empty() {
                let _ = writeln!(
                    html,
                    "<details>\n<summary>What it is, and what it can be confused with</summary>\n{}\n</details>",
                    texts.join("\n")
                );
            }
        }
    }
    html
}

/// Values of one effect behind a label, and the effects that explain the recordings equally well.
fn effect(found: &MissingEffect, label: &str) -> String {
    let values = found.estimates.iter().map(|one| {
        let std = (one.std).map_or_else(String::new, |std| format!(" ± {}", significant(std, 2)));
        let unit = typographic_unit(if one.unit == "1" { "" } else { &one.unit });
        let value = format!("{}{std} {unit}", all_digits(one.value));
        format!("<code>{}</code> = {}", escape(&one.name), escape(value.trim_end()))
    });
    // A kind without parameters has no values to show.
    let all: Vec<String> = values.collect();
    let mut html = String::new();
    if !all.is_empty() || !label.is_empty() {
        let _ = writeln!(html, "<p>{}{}</p>", escape(label), all.join(", "));
    }
    if !found.shared_with.is_empty() {
        let says = words::shared_value(&found.effect, &found.shared_with);
        let _ = writeln!(html, "<p>{}</p>", escape(&says));
    }
    // Alternatives belong to the effect, since either may be true.
    if !found.indistinguishable_from.is_empty() {
        let others = found.indistinguishable_from.iter().map(words::effect);
        let others: Vec<String> = others.collect();
        let _ = writeln!(
            html,
            "<p class=\"alias\">With these recordings it is not distinguishable from: {}.</p>",
            escape(&others.join("; "))
        );
    }
    html
}

/// Text with a capital first letter.
fn capitalise(text: &str) -> String {
    let mut letters = text.chars();
    letters
        .next()
        .map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// All candidates with the result of the search; those after the first `FIRST` are folded.
pub(crate) fn candidates(findings: &DiagnosisFindings) -> String {
    let all = &findings.diagnosis.candidates;
    let head = [
        "kind",
        "places",
        "#squared error explained if added alone",
        "#gain in addition to the effects found",
        "result",
    ];
    // The reason of a rejection depends on whether any effect was found.
    let has_findings = findings.diagnosis.steps.len() > 1;
    // Candidates that were found have no reason of rejection.
    let row = |c: &CandidateOutcome| -> Vec<TableCell> {
        let verdict = match &c.rejection_reason {
            None => TableCell::html("<b>found</b>".to_owned()),
            Some(why) => TableCell::text(words::refusal(*why, has_findings)),
        };
        vec![
            TableCell::text(&words::kind(&c.effect.kind)),
            TableCell::text(&c.effect.at.join(", ")),
            percent_cell(c.explained),
            percent_cell(c.gain),
            verdict,
        ]
    };
    let rows: Vec<Vec<TableCell>> = all.iter().map(row).collect();
    // The table is folded after the first candidates, since a machine may have hundreds.
    let split = FIRST.min(rows.len());
    let mut html = table("sortable", &head, &rows[..split]);
    if split < rows.len() {
        let _ = writeln!(
            html,
            "<details>\n<summary>{} more</summary>\n{}</details>",
            rows.len() - split,
            table("sortable", &head, &rows[split..])
        );
    }
    html + &kind_meanings(findings)
}

/// What the kinds of the candidates mean, as a folded list; empty if no kind has a text.
fn kind_meanings(findings: &DiagnosisFindings) -> String {
    let names: BTreeSet<&str> = (findings.diagnosis.candidates.iter())
        .map(|one| one.effect.kind.as_str())
        .collect();
    let row = |name: &&str| {
        let meaning = findings.kind_meaning(name)?;
        Some(vec![TableCell::text(&words::kind(name)), TableCell::text(meaning)])
    };
    let rows: Vec<Vec<TableCell>> = names.iter().filter_map(row).collect();
    if rows.is_empty() {
        return String::new();
    }
    let table = table("", &["kind", "meaning"], &rows);
    format!("<details>\n<summary>What the kinds mean</summary>\n{table}</details>\n")
}

/// A share in per cent; less than 0.05 % is printed as 0.
fn percent_cell(value: f64) -> TableCell {
    // One digit after the point for small shares.
    let percents = 100.0 * value;
    let text = if percents.abs() < 0.05 {
        "0 %".to_owned()
    } else if percents.abs() < 10.0 {
        format!("{percents:.1} %")
    } else {
        percent(Some(value))
    };
    TableCell::number(&text.replace('-', "−"), value)
}

/// Identified base parameters, their nominal values and standard deviations.
pub(crate) fn parameters(version: &ModelVersion) -> String {
    // With fixed parameters there is nothing to list.
    let Some(result) = &version.identified else {
        return "<p>All parameters are fixed at their nominal values.</p>\n".to_owned();
    };
    let row = |(k, p): (usize, &FitParameter)| -> Vec<TableCell> {
        // The nominal value of an effect that was just added is its estimate.
        let nominal = p
            .nominal
            .filter(|_| !version.model.is_effect(k) && version.model.has_values(k));
        // Four digits are enough for comparison; JSON has all of them.
        let number = |v: f64| TableCell::number(&significant(v, 4), v);
        let none = || TableCell::text("");
        // A standard deviation has a meaning for identified values only.
        let std = p.std.filter(|_| p.status == ParameterStatus::Identified);
        // How far the value is from the file.
        let off = match (nominal, std) {
            (Some(nominal), Some(std)) if std > 0.0 => Some((p.value - nominal).abs() / std),
            _ => None,
        };
        vec![
            TableCell::text(&p.name),
            TableCell::html(format!(
                "<code class=\"expression\" title=\"{}\">{}</code>",
                attribute(&p.expression),
                escape(&p.expression)
            )),
            nominal.map_or_else(none, number),
            number(p.value),
            match (p.status, std) {
                (ParameterStatus::Identified, Some(std)) => {
                    TableCell::number(&format!("± {}", significant(std, 2)), std)
                }
                (ParameterStatus::Known, _) => TableCell::text("known"),
                (ParameterStatus::Undetermined, _) => TableCell::text("not determined"),
                _ => none(),
            },
            TableCell::text(&typographic_unit(&p.unit)),
            off.map_or_else(none, |off| {
                // Beyond this the exact number has no meaning.
                let text = if off >= 1000.0 {
                    "> 1000".to_owned()
                } else {
                    significant(off, 2)
                };
                TableCell::number(&text, off)
            }),
        ]
    };
    let rows: Vec<Vec<TableCell>> = result.fit.parameters.iter().enumerate().map(row).collect();
    table(
        "sortable",
        &[
            "name",
            "expression",
            "#nominal",
            "#identified",
            "#std",
            "unit",
            "#|identified − nominal| / std",
        ],
        &rows,
    )
}

/// Recordings with their sizes, and notes on faults and preparation.
pub(crate) fn data(findings: &DiagnosisFindings, wording: &dyn StepWording) -> String {
    let rows: Vec<Vec<TableCell>> = findings
        .before
        .runs
        .iter()
        .map(|run| {
            let n = run.time.len();
            // Duration and mean sample rate.
            let span = match (run.time.first(), run.time.last()) {
                (Some(first), Some(last)) => last - first,
                _ => 0.0,
            };
            let rate = if span > 0.0 { (n.max(2) - 1) as f64 / span } else { 0.0 };
            vec![
                TableCell::text(&run.name),
                TableCell::text(if run.is_check { "validation" } else { "fit" }),
                TableCell::number(&n.to_string(), n as f64),
                TableCell::number(&format!("{} s", significant(span, 3)), span),
                TableCell::number(&format!("{} Hz", significant(rate, 4)), rate),
            ]
        })
        .collect();
    let mut html = table(
        "",
        &["recording", "used for", "#samples", "#duration", "#sample rate"],
        &rows,
    );
    if findings.notes.is_empty() {
        html.push_str("<p>The recordings were used unchanged. No fault was found in them.</p>\n");
        return html;
    }
    html.push_str("<ul class=\"notes\">\n");
    for note in &findings.notes {
        let (class, word) = match note.severity {
            NoteSeverity::Warning => ("warning", "Warning: "),
            NoteSeverity::Info => ("info", ""),
        };
        let _ = writeln!(
            html,
            "<li class=\"{class}\">{word}{}</li>",
            escape(&note.says.format_for(wording))
        );
    }
    html.push_str("</ul>\n");
    html
}
