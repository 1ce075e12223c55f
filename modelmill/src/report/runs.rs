//! What differs between runs as one self-contained page: what changed and when, and every base parameter over the runs.

use std::fmt::Write as _;

use modelmill_draw::page as pages;
use modelmill_identify::ParameterInfo;

use super::draw::{LEFT, PlotAxis, RIGHT, SvgPicture, WIDTH, range, with_room};
use super::page::end;
use super::tables::{TableCell, table};
use super::units::typographic_unit;
use crate::print::RemedySpelling;
use crate::runs::{FittedValue, RunChange, RunsComparison, SharedFit};
use crate::text::svg::escape;
use crate::text::table::{count, significant};

/// Height of a picture of one parameter.
const HEIGHT: f64 = 170.0;
/// How many standard deviations a bar reaches up and down.
const BARS: f64 = 2.0;

/// The page's text, with advice in the words quantity whoever reads it.
pub fn runs_page(compared: &RunsComparison, spelling: &dyn RemedySpelling) -> String {
    let title = format!("{}: what changed between runs", compared.model);
    let mut page = pages::begin(&title);
    page.push_str(&summary(compared));
    let mut sections = vec![
        (
            "when",
            "When something changed and stayed changed",
            points(compared),
        ),
        (
            "against",
            "Every run against the first",
            changes_table(compared),
        ),
    ];
    if let Some(shared) = &compared.shared {
        sections.push(("own", "One fit of all runs", shared_fit_section(shared)));
    }
    sections.push((
        "parameters",
        "Base parameters over the runs",
        parameters(compared),
    ));
    sections.push(("runs", "The runs", runs(compared, spelling)));
    for (id, title, html) in sections {
        let _ = write!(
            page,
            "<section id=\"runs-{id}\">\n<h2>{title}</h2>\n{html}</section>\n"
        );
    }
    page.push_str(&end());
    page
}

fn summary(compared: &RunsComparison) -> String {
    let later = compared.runs.len() - 1;
    let changed = compared.runs.iter().skip(1);
    let changed = changed.filter(|run| !run.changes.is_empty()).count();
    let class = if changed == 0 && compared.points.is_empty() {
        "adequate"
    } else {
        "missing"
    };
    let mut says = match compared.points.len() {
        0 => String::new(),
        n => format!("{}. ", count(n, "lasting change", "lasting changes")),
    };
    let _ = write!(
        says,
        "{changed} of {later} later runs differ from {} by more than chance, noise and the errors of the model.",
        compared.runs[0].file
    );
    format!("<p class=\"verdict {class}\">{}</p>\n", escape(&says))
}

fn changes_list(changes: &[RunChange]) -> String {
    let mut html = String::from("<ul>\n");
    for one in changes {
        let _ = write!(html, "<li>{}", escape(&one.says));
        if !one.rivals.is_empty() {
            let rivals = escape(&one.rivals.join("; "));
            let _ = write!(html, "<br><small>not told from: {rivals}</small>");
        }
        html.push_str("</li>\n");
    }
    html.push_str("</ul>\n");
    html
}

fn points(compared: &RunsComparison) -> String {
    if compared.points.is_empty() {
        return "<p>No base parameter changed and stayed changed over two or more runs.</p>\n"
            .to_owned();
    }
    let mut html = String::new();
    for point in &compared.points {
        let file = escape(&compared.runs[point.run].file);
        let _ = writeln!(html, "<h3>From run {} on: {file}</h3>", point.run + 1);
        if point.changes.is_empty() {
            html.push_str("<p>No single change in physics explains it.</p>\n");
        } else {
            html.push_str(&changes_list(&point.changes));
        }
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

fn value(fitted: Option<FittedValue>) -> TableCell {
    match fitted {
        Some(FittedValue {
            value,
            deviation: Some(deviation),
        }) => TableCell::number(
            &format!("{} ± {}", significant(value, 5), significant(deviation, 2)),
            value,
        ),
        _ => TableCell::text("not told"),
    }
}

fn changes_table(compared: &RunsComparison) -> String {
    let rows: Vec<Vec<TableCell>> = (compared.runs.iter().enumerate())
        .filter(|(_, run)| !run.changes.is_empty())
        .map(|(k, run)| {
            vec![
                TableCell::number(&format!("{}", k + 1), k as f64),
                TableCell::text(&run.file),
                TableCell::html(changes_list(&run.changes)),
            ]
        })
        .collect();
    if rows.is_empty() {
        return "<p>No run differs from the first.</p>\n".to_owned();
    }
    table(
        "changes",
        &["#run", "recording", "what is different"],
        &rows,
    )
}

fn shared_fit_section(shared: &SharedFit) -> String {
    let mut html = String::from(
        "<p>Base parameters are shared by all runs; these values are each run's own.</p>\n",
    );
    if !shared.gains.is_empty() {
        html.push_str(
            "<p>True forces are the measured ones times these factors, by the known load.</p>\n",
        );
        let rows: Vec<Vec<TableCell>> = (shared.gains.iter())
            .map(|(drive, gain)| vec![TableCell::text(drive), value(Some(*gain))])
            .collect();
        html.push_str(&table("gains", &["drive", "#factor"], &rows));
    }
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
    html.push_str(&table(
        "own",
        &["recording", "of", "name", "#value", "unit"],
        &rows,
    ));
    html
}

fn parameters(compared: &RunsComparison) -> String {
    let has_changed = |k: &usize| {
        let mut steps = compared.points.iter().flat_map(|point| &point.steps);
        steps.any(|step| step.parameter == *k)
    };
    let is_told = |k: &usize| {
        compared
            .runs
            .iter()
            .any(|run| known_value(run.alone[*k]).is_some())
    };
    let all = (0..compared.parameters.len()).filter(is_told);
    let (changed, same): (Vec<usize>, Vec<usize>) = all.partition(has_changed);
    let mut html = String::from(
        "<p>Each run fitted alone, with bars of two standard deviations; lines are means between the changes above.</p>\n",
    );
    for k in changed {
        html.push_str(&picture(compared, k));
    }
    if !same.is_empty() {
        html.push_str("<details>\n<summary>Those that did not change</summary>\n");
        for k in same {
            html.push_str(&picture(compared, k));
        }
        html.push_str("</details>\n");
    }
    html
}

/// A value that the run tells, with its deviation.
fn known_value(fitted: FittedValue) -> Option<[f64; 2]> {
    Some([fitted.value, fitted.deviation.filter(|d| *d > 0.0)?])
}

/// One base parameter over the runs.
fn picture(compared: &RunsComparison, k: usize) -> String {
    let runs = &compared.runs;
    let known: Vec<(usize, [f64; 2])> = (runs.iter().enumerate())
        .filter_map(|(at, run)| Some((at, known_value(run.alone[k])?)))
        .collect();
    let steps = compared.points.iter().flat_map(|point| {
        let own = point.steps.iter().filter(|step| step.parameter == k);
        own.map(move |step| (point.run, [step.before.value, step.now.value]))
    });
    let steps: Vec<(usize, [f64; 2])> = steps.collect();
    parameter_history(&compared.parameters[k], "run", runs.len(), &known, &steps)
}

/// A base parameter over `n` runs or days as a picture: values that are known, by place and with their deviations, and levels
/// before and since each change, by the place from which on it is there.
pub fn parameter_history(
    info: &ParameterInfo,
    what: &str,
    n: usize,
    known: &[(usize, [f64; 2])],
    steps: &[(usize, [f64; 2])],
) -> String {
    let ends: Vec<f64> = (known.iter())
        .flat_map(|(_, [x, d])| [x - BARS * d, x + BARS * d])
        .collect();
    let x = PlotAxis::new([0.5, n as f64 + 0.5], [LEFT, WIDTH - RIGHT]);
    let y = PlotAxis::new(with_room(range(&ends), 0.05), [HEIGHT - 40.0, 8.0]);
    let mut picture = SvgPicture::new(WIDTH, HEIGHT);
    picture.frame(&x, &y, what, [n.min(12), 4]);
    for (at, [value, deviation]) in known {
        let across = x.position(*at as f64 + 1.0);
        let [low, high] = [-BARS, BARS].map(|b| y.position(value + b * deviation));
        picture.path("curve c-fit", &format!("M{across:.1} {low:.1}V{high:.1}"));
        picture.dot("dot c-before", [across, y.position(*value)], 2.4);
    }
    for (i, (run, [before, now])) in steps.iter().enumerate() {
        let start = if i == 0 { 0 } else { steps[i - 1].0 };
        let end = steps.get(i + 1).map_or(n, |next| next.0);
        let at = |run: usize| x.position(run as f64 + 0.5);
        if i == 0 {
            let level = y.position(*before);
            let d = format!("M{:.1} {level:.1}H{:.1}", at(start), at(*run));
            picture.path("curve c-after", &d);
        }
        let level = y.position(*now);
        picture.path(
            "curve c-after",
            &format!("M{:.1} {level:.1}H{:.1}", at(*run), at(end)),
        );
        picture.path(
            "cursor",
            &format!("M{:.1} {:.1}V{:.1}", at(*run), y.start, y.end),
        );
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

fn runs(compared: &RunsComparison, spelling: &dyn RemedySpelling) -> String {
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
    rows.extend(compared.unread.iter().map(|one| {
        let says = TableCell::text(&format!("gave no answer: {}", one.error.spell(spelling)));
        vec![
            TableCell::text(""),
            TableCell::text(&one.file),
            TableCell::text(""),
            says,
        ]
    }));
    table(
        "runs",
        &["#run", "recording", "#samples", "#parameters that moved"],
        &rows,
    )
}
