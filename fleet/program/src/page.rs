//! The results as one HTML page. Robots that changed come first, then outliers, dead sensors, usual values and bad
//! recordings.

use std::fmt::Write as _;

use modelmill::report::{TableCell, begin_page, end_page, parameter_history, scripts, table};
use modelmill::runs::RunChange;
use modelmill::text::svg::escape;
use modelmill::text::table::significant;
use modelmill_fleet::robot::RobotHistory;

use crate::identify::{FleetResults, summary_sentence};

/// Largest number of robots with pictures; the others are listed in a table and in the JSON.
const MOST_PICTURED: usize = 60;

/// The page as HTML.
pub(crate) fn page(found: &FleetResults) -> String {
    let title = format!("A fleet of {} robots", found.robots.len());
    let mut page = begin_page(&title);
    // The verdict on top, then one section for each kind of result.
    let is_quiet = found.outliers.found.is_empty() && found.robots.iter().all(RobotHistory::is_quiet);
    let class = if is_quiet { "adequate" } else { "missing" };
    let _ = writeln!(
        page,
        "<p class=\"verdict {class}\">{}.</p>",
        escape(&summary_sentence(found))
    );
    let sections = [
        ("changed", "Robots that changed", changed_robots(found)),
        ("differ", "Robots that differ from the others", outlier_table(found)),
        ("sensors", "Dead sensors", dead_sensor_table(found)),
        ("usual", "Usual values of this fleet", usual_values_table(found)),
        ("bad", "Recordings without a result", bad_recordings_table(found)),
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

/// Physical changes as a list, each with its alternatives.
fn change_list(changes: &[RunChange]) -> String {
    if changes.is_empty() {
        return "<p>No single physical change explains it.</p>\n".to_owned();
    }
    // Alternatives that fit the data as well stand below each change.
    let mut html = String::from("<ul>\n");
    for one in changes {
        let _ = write!(html, "<li>{}", escape(&one.says));
        if !one.rivals.is_empty() {
            let _ = write!(
                html,
                "<br><small>not distinguishable from: {}</small>",
                escape(&one.rivals.join("; "))
            );
        }
        html.push_str("</li>\n");
    }
    html.push_str("</ul>\n");
    html
}

/// The most significant step of a robot, in standard deviations.
fn change_clarity(robot: &RobotHistory) -> f64 {
    // Steps without standard deviations give no finite ratio and do not count.
    let steps = robot.changes.iter().flat_map(|since| &since.steps);
    steps
        .map(|step| (step.now.value - step.before.value).abs() / step.before.difference_std(step.now))
        .filter(|x| x.is_finite())
        .fold(0.0, f64::max)
}

/// The section of robots that changed, the most significant first: days, physical changes, and one picture for each.
fn changed_robots(found: &FleetResults) -> String {
    let mut robots: Vec<&RobotHistory> = found.robots.iter().filter(|robot| !robot.changes.is_empty()).collect();
    if robots.is_empty() {
        return "<p>No robot changed permanently.</p>\n".to_owned();
    }
    robots.sort_by(|a, b| change_clarity(b).total_cmp(&change_clarity(a)));
    // Name, unit and expression of each parameter.
    let infos = found.ground.parameters();
    let mut html = String::new();
    for robot in robots.iter().take(MOST_PICTURED) {
        let _ = writeln!(html, "<h3>{}</h3>", escape(&robot.name));
        for since in &robot.changes {
            // A change that grows has a rate, a step has none.
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
            html.push_str(&change_list(&since.changes));
        }
        // The picture shows the parameter with the most significant step.
        let Some(step) = robot.changes.first().and_then(|since| since.steps.first()) else {
            continue;
        };
        let k = step.parameter;
        // Its value and standard deviation on each day that determines it.
        let known: Vec<(usize, [f64; 2])> = (robot.days.iter().enumerate())
            .filter_map(|(at, day)| {
                let fitted = day.fit.as_ref()?.parameters[k];
                Some((at, [fitted.value, fitted.std?]))
            })
            .collect();
        // Its mean values before and since each change.
        let steps: Vec<(usize, [f64; 2])> = (robot.changes.iter())
            .filter_map(|since| {
                let own = since.steps.iter().find(|step| step.parameter == k)?;
                Some((since.day, [own.before.value, own.now.value]))
            })
            .collect();
        html.push_str(&parameter_history(&infos[k], "day", robot.days.len(), &known, &steps));
    }
    // Further robots are listed without pictures.
    if robots.len() > MOST_PICTURED {
        let _ = writeln!(
            html,
            "<p>And {} more, with details in <code>results.json</code>:</p>",
            robots.len() - MOST_PICTURED
        );
        let rows: Vec<Vec<TableCell>> = robots[MOST_PICTURED..]
            .iter()
            .flat_map(|robot| {
                robot.changes.iter().map(|since| {
                    vec![
                        TableCell::text(&robot.name),
                        TableCell::text(&robot.days[since.day].name),
                        TableCell::html(change_list(&since.changes)),
                    ]
                })
            })
            .collect();
        html.push_str(&table("changes", &["robot", "from", "change"], &rows));
    }
    html
}

/// The table of robots that differ from the others.
fn outlier_table(found: &FleetResults) -> String {
    if found.outliers.found.is_empty() {
        return "<p>No robot differs from the others by much more than they differ from each other.</p>\n".to_owned();
    }
    let rows: Vec<Vec<TableCell>> = (found.outliers.found.iter())
        .map(|one| {
            // The largest distance of any parameter.
            let apart = found.outliers.distances[one.robot]
                .iter()
                .flatten()
                .fold(0.0_f64, |most, x| most.max(x.abs()));
            vec![
                TableCell::text(&found.robots[one.robot].name),
                TableCell::html(change_list(&one.changes)),
                TableCell::number(&significant(apart, 3), apart),
            ]
        })
        .collect();
    let head = [
        "robot",
        "difference from the others",
        "#largest distance of a parameter from the median, standard deviations",
    ];
    table("changes", &head, &rows)
}

/// The table of dead sensors.
fn dead_sensor_table(found: &FleetResults) -> String {
    let rows: Vec<Vec<TableCell>> = (found.robots.iter())
        .flat_map(|robot| {
            robot.dead.iter().map(|dead| {
                vec![
                    TableCell::text(&robot.name),
                    TableCell::text(&dead.sensor),
                    TableCell::text(&robot.days[dead.day].name),
                    TableCell::number(&dead.days.to_string(), dead.days as f64),
                    TableCell::number(&format!("{:.0} %", 100.0 * dead.first.still), dead.first.still),
                    TableCell::text(&dead.first.recording),
                ]
            })
        })
        .collect();
    if rows.is_empty() {
        return "<p>There are none: all readings change while their machines move.</p>\n".to_owned();
    }
    let head = ["robot", "sensor", "from", "#days", "#constant for", "first recording"];
    table("sensors", &head, &rows)
}

/// The table of base parameters with median and spread over the robots.
fn usual_values_table(found: &FleetResults) -> String {
    let infos = found.ground.parameters();
    let rows: Vec<Vec<TableCell>> = (infos.iter().zip(&found.outliers.usual))
        .filter_map(|(info, usual)| {
            // Parameters without a usual value or spread are left out.
            let usual = (*usual)?;
            let spread = usual.std?;
            Some(vec![
                TableCell::text(&info.name),
                TableCell::number(&significant(usual.value, 5), usual.value),
                TableCell::number(&significant(spread, 2), spread),
                TableCell::text(&info.unit),
                TableCell::html(format!(
                    "<code class=\"expression\">{}</code>",
                    escape(&info.expression)
                )),
            ])
        })
        .collect();
    let head = ["parameter", "#median", "#spread of the robots", "unit", "expression"];
    format!(
        "<p>Of each robot only the days before its first change are used.</p>\n{}",
        table("parameters", &head, &rows)
    )
}

/// The table of recordings that could not be evaluated, with the reasons.
fn bad_recordings_table(found: &FleetResults) -> String {
    let rows: Vec<Vec<TableCell>> = found
        .bad()
        .map(|one| vec![TableCell::text(&one.recording), TableCell::text(&one.says)])
        .collect();
    if rows.is_empty() {
        return "<p>There are none: all recordings gave a result.</p>\n".to_owned();
    }
    table("runs", &["recording", "reason"], &rows)
}
