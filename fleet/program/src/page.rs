//! What was found as one page, which opens on the robots that are not as they should be.

use std::fmt::Write as _;

use modelmill::report::{Cell, begin_page, end_page, over_runs, scripts, table};
use modelmill::runs::Changed;
use modelmill::text::svg::escape;
use modelmill::text::table::significant;
use modelmill_fleet::robot::Robot;

use crate::identify::{Found, says};

/// Robots that are shown with pictures; all others stand in the tables and in the JSON.
const SHOWN: usize = 60;

/// The page's text.
pub(crate) fn page(found: &Found) -> String {
    let title = format!("A fleet of {} robots", found.robots.len());
    let mut page = begin_page(&title);
    let is_quiet = found.outliers.found.is_empty() && found.robots.iter().all(Robot::is_quiet);
    let class = if is_quiet { "adequate" } else { "missing" };
    let _ = writeln!(
        page,
        "<p class=\"verdict {class}\">{}.</p>",
        escape(&says(found))
    );
    let sections = [
        ("changed", "Robots that changed", changed(found)),
        (
            "differ",
            "Robots that differ from the others",
            differ(found),
        ),
        ("sensors", "Sensors that died", sensors(found)),
        ("usual", "What is usual in this fleet", usual(found)),
        ("bad", "Recordings that gave no answer", bad(found)),
    ];
    for (id, title, html) in sections {
        let _ = write!(
            page,
            "<section id=\"fleet-{id}\">\n<h2>{title}</h2>\n{html}</section>\n"
        );
    }
    page.push_str(&end_page(&scripts().collect::<Vec<_>>()));
    page
}

fn said(changes: &[Changed]) -> String {
    if changes.is_empty() {
        return "<p>No single change in physics explains it.</p>\n".to_owned();
    }
    let mut html = String::from("<ul>\n");
    for one in changes {
        let _ = write!(html, "<li>{}", escape(&one.says));
        if !one.rivals.is_empty() {
            let _ = write!(
                html,
                "<br><small>not told from: {}</small>",
                escape(&one.rivals.join("; "))
            );
        }
        html.push_str("</li>\n");
    }
    html.push_str("</ul>\n");
    html
}

/// How clear the changes of a robot are.
fn clear(robot: &Robot) -> f64 {
    let steps = robot.since.iter().flat_map(|since| &since.steps);
    steps
        .map(|step| (step.now.value - step.before.value).abs() / step.before.beside(step.now))
        .filter(|x| x.is_finite())
        .fold(0.0, f64::max)
}

fn changed(found: &Found) -> String {
    let mut robots: Vec<&Robot> = found
        .robots
        .iter()
        .filter(|robot| !robot.since.is_empty())
        .collect();
    if robots.is_empty() {
        return "<p>No robot changed and stayed changed.</p>\n".to_owned();
    }
    robots.sort_by(|a, b| clear(b).total_cmp(&clear(a)));
    let infos = found.ground.parameters();
    let mut html = String::new();
    for robot in robots.iter().take(SHOWN) {
        let _ = writeln!(html, "<h3>{}</h3>", escape(&robot.name));
        for since in &robot.since {
            let grows = match (since.per_day, since.steps.first()) {
                (Some(per_day), Some(step)) => {
                    let info = &infos[step.parameter];
                    format!(
                        ", {} growing by {} {} a day",
                        info.expression,
                        significant(per_day, 2),
                        info.unit
                    )
                }
                _ => String::new(),
            };
            let _ = writeln!(
                html,
                "<p>From <b>{}</b> on{}:</p>",
                escape(&robot.days[since.day].name),
                escape(&grows)
            );
            html.push_str(&said(&since.changes));
        }
        // The clearest parameter says it in one picture.
        let Some(step) = robot.since.first().and_then(|since| since.steps.first()) else {
            continue;
        };
        let k = step.parameter;
        let known: Vec<(usize, [f64; 2])> = (robot.days.iter().enumerate())
            .filter_map(|(at, day)| {
                let fitted = day.fit.as_ref()?.parameters[k];
                Some((at, [fitted.value, fitted.deviation?]))
            })
            .collect();
        let steps: Vec<(usize, [f64; 2])> = (robot.since.iter())
            .filter_map(|since| {
                let own = since.steps.iter().find(|step| step.parameter == k)?;
                Some((since.day, [own.before.value, own.now.value]))
            })
            .collect();
        html.push_str(&over_runs(
            &infos[k],
            "day",
            robot.days.len(),
            &known,
            &steps,
        ));
    }
    if robots.len() > SHOWN {
        let _ = writeln!(
            html,
            "<p>And {} more, which stand in <code>results.json</code>:</p>",
            robots.len() - SHOWN
        );
        let rows: Vec<Vec<Cell>> = robots[SHOWN..]
            .iter()
            .flat_map(|robot| {
                robot.since.iter().map(|since| {
                    vec![
                        Cell::text(&robot.name),
                        Cell::text(&robot.days[since.day].name),
                        Cell::html(said(&since.changes)),
                    ]
                })
            })
            .collect();
        html.push_str(&table(
            "changes",
            &["robot", "from", "what is different"],
            &rows,
        ));
    }
    html
}

fn differ(found: &Found) -> String {
    if found.outliers.found.is_empty() {
        return "<p>No robot differs from the others by far more than they differ by among themselves.</p>\n".to_owned();
    }
    let rows: Vec<Vec<Cell>> = (found.outliers.found.iter())
        .map(|one| {
            let apart = found.outliers.apart[one.which]
                .iter()
                .flatten()
                .fold(0.0_f64, |most, x| most.max(x.abs()));
            vec![
                Cell::text(&found.robots[one.which].name),
                Cell::html(said(&one.changes)),
                Cell::number(&significant(apart, 3), apart),
            ]
        })
        .collect();
    let head = [
        "robot",
        "what is different from the others",
        "#parameter farthest from the median, deviations",
    ];
    table("changes", &head, &rows)
}

fn sensors(found: &Found) -> String {
    let rows: Vec<Vec<Cell>> = (found.robots.iter())
        .flat_map(|robot| {
            robot.dead.iter().map(|dead| {
                vec![
                    Cell::text(&robot.name),
                    Cell::text(&dead.of),
                    Cell::text(&robot.days[dead.day].name),
                    Cell::number(&dead.days.to_string(), dead.days as f64),
                    Cell::number(
                        &format!("{:.0} %", 100.0 * dead.first.still),
                        dead.first.still,
                    ),
                    Cell::text(&dead.first.recording),
                ]
            })
        })
        .collect();
    if rows.is_empty() {
        return "<p>All sensors move while their machines do.</p>\n".to_owned();
    }
    let head = [
        "robot",
        "sensor",
        "from",
        "#days",
        "#stood still for",
        "first recording",
    ];
    table("sensors", &head, &rows)
}

fn usual(found: &Found) -> String {
    let infos = found.ground.parameters();
    let rows: Vec<Vec<Cell>> = (infos.iter().zip(&found.outliers.usual))
        .filter_map(|(info, usual)| {
            let usual = (*usual)?;
            let spread = usual.deviation?;
            Some(vec![
                Cell::text(&info.name),
                Cell::number(&significant(usual.value, 5), usual.value),
                Cell::number(&significant(spread, 2), spread),
                Cell::text(&info.unit),
                Cell::html(format!(
                    "<code class=\"expression\">{}</code>",
                    escape(&info.expression)
                )),
            ])
        })
        .collect();
    let head = [
        "parameter",
        "#median",
        "#spread of the robots",
        "unit",
        "expression",
    ];
    format!(
        "<p>Of each robot the days before anything changed.</p>\n{}",
        table("parameters", &head, &rows)
    )
}

fn bad(found: &Found) -> String {
    let rows: Vec<Vec<Cell>> = found
        .bad()
        .map(|one| vec![Cell::text(&one.recording), Cell::text(&one.says)])
        .collect();
    if rows.is_empty() {
        return "<p>All gave one.</p>\n".to_owned();
    }
    table("runs", &["recording", "why"], &rows)
}
