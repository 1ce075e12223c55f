//! Differences between runs as one self-contained HTML page: changes, when they happened, and every base
//! parameter over the runs.

use std::fmt::Write as _;

use modelmill_draw::page as pages;
use modelmill_identify::ParameterInfo;

use super::draw::{LEFT, PlotAxis, RIGHT, SvgPicture, WIDTH, range, with_room};
use super::page::end;
use super::tables::{TableCell, table};
use super::units::typographic_unit;
use crate::print::RemedyWording;
use crate::print::runs::verdict_text;
use crate::runs::{FittedValue, RunChange, RunReport, RunVerdict, RunsComparison, SharedFit};
use crate::text::svg::escape;
use crate::text::table::{count, significant};

/// Height of a picture of one parameter.
const HEIGHT: f64 = 170.0;
/// Length of a bar to either side, in standard deviations.
const BARS: f64 = 2.0;

/// The HTML of the page; `wording` writes commands or calls for its reader.
pub fn runs_page(compared: &RunsComparison, wording: &dyn RemedyWording) -> String {
    let title = format!("{}: changes between runs", compared.model);
    let mut page = pages::begin(&title);
    page.push_str(&summary(compared));
    // The sections in the order in which a user needs them, each with its id and title.
    let mut sections = vec![
        ("when", "Lasting changes", points(compared)),
        (
            "against",
            "Each run compared with the first",
            changes_table(compared, wording),
        ),
    ];
    // The joint fit exists only if it was requested.
    if let Some(shared) = &compared.shared {
        sections.push(("own", "Joint fit of all runs", shared_fit_section(shared)));
    }
    sections.push(("parameters", "Base parameters over the runs", parameters(compared)));
    sections.push(("runs", "The runs", runs(compared, wording)));
    for (id, title, html) in sections {
        let _ = write!(page, "<section id=\"runs-{id}\">\n<h2>{title}</h2>\n{html}</section>\n");
    }
    page.push_str(&end());
    page
}

/// The verdict: lasting changes, and how many runs differ from the first.
fn summary(compared: &RunsComparison) -> String {
    let later = compared.runs.len() - 1;
    // The first run is the reference.
    let later_runs = || compared.runs.iter().skip(1);
    let with_verdict = |verdict: RunVerdict| later_runs().filter(|run| run.verdict() == verdict).count();
    let changed =
        later_runs().filter(|run| !run.changes.is_empty()).count() + with_verdict(RunVerdict::DifferentWithoutCause);
    let unknown = with_verdict(RunVerdict::Undecided);
    // The colour of the verdict.
    let class = if changed == 0 && unknown == 0 && compared.points.is_empty() {
        "adequate"
    } else {
        "missing"
    };
    // Lasting changes count more than single runs, so they come first.
    let mut says = match compared.points.len() {
        0 => String::new(),
        n => format!("{}. ", count(n, "lasting change", "lasting changes")),
    };
    let _ = write!(
        says,
        "{changed} of {later} later runs differ from {} by more than noise and model error.",
        compared.runs[0].file
    );
    if unknown > 0 {
        let _ = write!(says, " {unknown} of {later} cannot show a change.");
    }
    format!("<p class=\"verdict {class}\">{}</p>\n", escape(&says))
}

/// Changes as a list, each with those that explain the runs equally well.
fn changes_list(changes: &[RunChange]) -> String {
    let mut html = String::from("<ul>\n");
    // One item for each change, with its alternatives in small type.
    for one in changes {
        let _ = write!(html, "<li>{}", escape(&one.says));
        if !one.rivals.is_empty() {
            let rivals = escape(&one.rivals.join("; "));
            let _ = write!(html, "<br><small>not distinguishable from: {rivals}</small>");
        }
        html.push_str("</li>\n");
    }
    html.push_str("</ul>\n");
    html
}

/// Lasting changes, each with its physical causes and the base parameters before and since.
fn points(compared: &RunsComparison) -> String {
    if compared.points.is_empty() {
        return "<p>No base parameter took a new value and kept it for two or more runs.</p>\n".to_owned();
    }
    let mut html = String::new();
    // The file is named, since numbers of runs are hard to find again.
    for point in &compared.points {
        let file = escape(&compared.runs[point.run].file);
        let _ = writeln!(html, "<h3>From run {} on: {file}</h3>", point.run + 1);
        if point.changes.is_empty() {
            html.push_str("<p>No single physical change explains it.</p>\n");
        } else {
            html.push_str(&changes_list(&point.changes));
        }
        // Means of the parameters before and since the change.
        let rows: Vec<Vec<TableCell>> = (point.steps.iter())
            .map(|step| {
                let info = &compared.parameters[step.parameter];
                vec![
                    TableCell::text(&info.name),
                    value(Some(step.before)),
                    value(Some(step.now)),
                    TableCell::text(&typographic_unit(&info.unit)),
                    TableCell::html(format!(
                        "<code class=\"expression\">{}</code>",
                        escape(&info.expression)
                    )),
                ]
            })
            .collect();
        html.push_str(&table(
            "parameters",
            &["parameter", "#before", "#since", "unit", "expression"],
            &rows,
        ));
    }
    html
}

/// A value with its standard deviation as a cell.
fn value(fitted: Option<FittedValue>) -> TableCell {
    // A value without standard deviation was not determined.
    match fitted {
        Some(FittedValue { value, std: Some(std) }) => {
            TableCell::number(&format!("{} ± {}", significant(value, 5), significant(std, 2)), value)
        }
        _ => TableCell::text("not identifiable"),
    }
}

/// Runs that differ from the first one or cannot be compared, with their changes and verdicts.
fn changes_table(compared: &RunsComparison, wording: &dyn RemedyWording) -> String {
    let is_quiet = |k: usize, run: &RunReport| {
        run.changes.is_empty() && (k == 0 || run.verdict() == RunVerdict::Unchanged && run.undecided.is_empty())
    };
    let rows: Vec<Vec<TableCell>> = (compared.runs.iter().enumerate())
        .filter(|(k, run)| !is_quiet(*k, run))
        .map(|(k, run)| {
            let mut html = if run.changes.is_empty() {
                String::new()
            } else {
                changes_list(&run.changes)
            };
            // The first run is compared with nothing.
            let verdict = if k > 0 {
                verdict_text(run).format_for(wording)
            } else {
                String::new()
            };
            if !verdict.is_empty() {
                let _ = write!(html, "<p>{}</p>", escape(&verdict));
            }
            vec![
                TableCell::number(&format!("{}", k + 1), k as f64),
                TableCell::text(&run.file),
                TableCell::html(html),
            ]
        })
        .collect();
    if rows.is_empty() {
        return "<p>No run differs from the first.</p>\n".to_owned();
    }
    table("changes", &["#run", "recording", "differences"], &rows)
}

/// Values that each run has for itself in the joint fit.
fn shared_fit_section(shared: &SharedFit) -> String {
    let mut html =
        String::from("<p>All runs share their base parameters. The values below belong to one run each.</p>\n");
    // Factors of force signals exist only with a known load.
    if !shared.gains.is_empty() {
        html.push_str("<p>True force = factor times measured force, determined by the known load.</p>\n");
        let rows: Vec<Vec<TableCell>> = (shared.gains.iter())
            .map(|(drive, gain)| vec![TableCell::text(drive), value(Some(*gain))])
            .collect();
        html.push_str(&table("gains", &["drive", "#factor"], &rows));
    }
    // One row for each value of each run.
    let rows: Vec<Vec<TableCell>> = (shared.runs.iter())
        .flat_map(|(file, values)| {
            values.iter().map(move |one| {
                vec![
                    TableCell::text(file),
                    TableCell::text(&one.quantity),
                    TableCell::text(&one.name),
                    value(Some(one.value)),
                    TableCell::text(&typographic_unit(&one.unit)),
                ]
            })
        })
        .collect();
    html.push_str(&table("own", &["recording", "of", "name", "#value", "unit"], &rows));
    html
}

/// Pictures of base parameters over the runs: those that changed for good or in single runs first, the others folded.
fn parameters(compared: &RunsComparison) -> String {
    let has_lasting_change = |k: &usize| {
        let mut steps = compared.points.iter().flat_map(|point| &point.steps);
        steps.any(|step| step.parameter == *k)
    };
    // A change that did not last is a change too: it must not be folded among those that did not change.
    let differs_in_a_run = |k: &usize| compared.runs.iter().any(|run| run.moved.contains(k));
    // A parameter that no run determines has no picture.
    let is_determined = |k: &usize| compared.runs.iter().any(|run| determined(run.alone[*k]).is_some());
    let all = (0..compared.parameters.len()).filter(is_determined);
    let (lasting, others): (Vec<usize>, Vec<usize>) = all.partition(has_lasting_change);
    let (single, same): (Vec<usize>, Vec<usize>) = others.into_iter().partition(differs_in_a_run);
    let mut html = String::from(
        "<p>Each run is fitted separately. Bars are two standard deviations, lines are means between the changes above.</p>\n",
    );
    for k in lasting {
        html.push_str(&picture(compared, k));
    }
    if !single.is_empty() {
        html.push_str("<h3>Different in single runs</h3>\n");
        for k in single {
            html.push_str(&picture(compared, k));
        }
    }
    if !same.is_empty() {
        html.push_str("<details>\n<summary>Parameters without a detected change</summary>\n");
        for k in same {
            html.push_str(&picture(compared, k));
        }
        html.push_str("</details>\n");
    }
    html
}

/// A value and its standard deviation, if the run determines it.
fn determined(fitted: FittedValue) -> Option<[f64; 2]> {
    Some([fitted.value, fitted.std.filter(|d| *d > 0.0)?])
}

/// One base parameter over the runs.
fn picture(compared: &RunsComparison, k: usize) -> String {
    let runs = &compared.runs;
    // Runs that do not determine the parameter leave a gap.
    let known: Vec<(usize, [f64; 2])> = (runs.iter().enumerate())
        .filter_map(|(at, run)| Some((at, determined(run.alone[k])?)))
        .collect();
    // Levels before and since each lasting change.
    let steps = compared.points.iter().flat_map(|point| {
        let own = point.steps.iter().filter(|step| step.parameter == k);
        own.map(move |step| (point.run, [step.before.value, step.now.value]))
    });
    let steps: Vec<(usize, [f64; 2])> = steps.collect();
    parameter_history(&compared.parameters[k], "run", runs.len(), &known, &steps)
}

/// Picture of a base parameter over `n` runs or days; `what` is the label of this axis. An entry of `known` is the
/// index of a run, with value and standard deviation. An entry of `steps` is the index of the first run after a change,
/// with the means before and after it.
pub fn parameter_history(
    info: &ParameterInfo,
    what: &str,
    n: usize,
    known: &[(usize, [f64; 2])],
    steps: &[(usize, [f64; 2])],
) -> String {
    // The axis has room for all bars.
    let ends: Vec<f64> = (known.iter())
        .flat_map(|(_, [x, d])| [x - BARS * d, x + BARS * d])
        .collect();
    // The first run is at 1, with half a step of room at each end.
    let x = PlotAxis::new([0.5, n as f64 + 0.5], [LEFT, WIDTH - RIGHT]);
    let y = PlotAxis::new(with_room(range(&ends), 0.05), [HEIGHT - 40.0, 8.0]);
    let mut picture = SvgPicture::new(WIDTH, HEIGHT);
    picture.frame(&x, &y, what, [n.min(12), 4]);
    // One bar and one dot for each run that determines the parameter.
    for (at, [value, std]) in known {
        let across = x.position(*at as f64 + 1.0);
        let [low, high] = [-BARS, BARS].map(|b| y.position(value + b * std));
        picture.path("curve c-fit", &format!("M{across:.1} {low:.1}V{high:.1}"));
        picture.dot("dot c-before", [across, y.position(*value)], 2.4);
    }
    // Levels between the changes, and a vertical line at each of them.
    for (i, (run, [before, now])) in steps.iter().enumerate() {
        let start = if i == 0 { 0 } else { steps[i - 1].0 };
        let end = steps.get(i + 1).map_or(n, |next| next.0);
        let at = |run: usize| x.position(run as f64 + 0.5);
        // The level before the first change belongs to no step.
        if i == 0 {
            let level = y.position(*before);
            let d = format!("M{:.1} {level:.1}H{:.1}", at(start), at(*run));
            picture.path("curve c-after", &d);
        }
        // The level lasts until the next change.
        let level = y.position(*now);
        picture.path("curve c-after", &format!("M{:.1} {level:.1}H{:.1}", at(*run), at(end)));
        picture.path("cursor", &format!("M{:.1} {:.1}V{:.1}", at(*run), y.start, y.end));
    }
    let says = format!("{} over {n} {what}s", info.name);
    format!(
        "<figure class=\"still\"><figcaption><b>{}</b> {} <code class=\"expression\">{}</code></figcaption>\n{}</figure>\n",
        escape(&info.name),
        escape(&typographic_unit(&info.unit)),
        escape(&info.expression),
        picture.finish(&says)
    )
}

/// All runs with their sizes, and those that could not be evaluated with the reason.
fn runs(compared: &RunsComparison, wording: &dyn RemedyWording) -> String {
    // Runs are numbered from 1, as everywhere in the output.
    let mut rows: Vec<Vec<TableCell>> = (compared.runs.iter().enumerate())
        .map(|(k, run)| {
            vec![
                TableCell::number(&format!("{}", k + 1), k as f64),
                TableCell::text(&run.file),
                TableCell::number(&run.samples.to_string(), run.samples as f64),
                TableCell::number(&run.moved.len().to_string(), run.moved.len() as f64),
            ]
        })
        .collect();
    // Failed runs are listed too, so that none is missed.
    rows.extend(compared.unread.iter().map(|one| {
        let says = TableCell::text(&format!("not evaluated: {}", one.error.format_for(wording)));
        vec![
            TableCell::text(""),
            TableCell::text(&one.file),
            TableCell::text(""),
            says,
        ]
    }));
    table(
        "runs",
        &["#run", "recording", "#samples", "#parameters that changed"],
        &rows,
    )
}
