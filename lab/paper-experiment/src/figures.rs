//! The figures of the page as SVG: forces and errors over time, base parameters, and errors over a length.

use std::fmt::Write as _;

use crate::PaperExperiment;
use crate::lengths::DistanceErrors;
use crate::runs::PeriodicTrajectory;
use crate::study::{DriveColumns, TreatmentRun};
use modelmill::text::svg::{PanelStyle, SvgFigure, sheet};

/// Largest relative error that is drawn.
const RELATIVE: f64 = 1.0;
/// The same in the panels of Fig. 6 and 7, per cent, so that errors of some per cent can be seen.
const PANEL_RELATIVE: f64 = 50.0;

/// The next round number above all magnitudes, so that scales can be read.
fn round_limit(columns: &[&DriveColumns]) -> f64 {
    let values = columns.iter().flat_map(|c| c.iter()).flatten();
    let largest = values.fold(0.0_f64, |m, v| m.max(v.abs()));
    // A round number is a factor from the list times a power of ten.
    let decade = 10_f64.powf(largest.max(f64::MIN_POSITIVE).log10().floor());
    [1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0]
        .into_iter()
        .map(|step| step * decade)
        .find(|limit| *limit >= largest)
        .unwrap_or(largest)
}

/// A panel with a given largest value.
fn scale(limit: f64) -> PanelStyle<'static> {
    PanelStyle {
        limit: Some(limit),
        ..PanelStyle::default()
    }
}

/// A panel without the curve of the rig, in which the other curves keep their colours.
fn without_rig(limit: f64) -> PanelStyle<'static> {
    PanelStyle {
        first_colour: 1,
        ..scale(limit)
    }
}

/// A figure with the six panels of Fig. 6 and 7: angles of the cranks (a, b), forces of the spindles (c, d), and
/// relative errors of the paper's treatment (e, f), left and right.
pub(crate) fn panels(title: &str, periodic: &PeriodicTrajectory, along: &TreatmentRun) -> String {
    let mut figure = SvgFigure::new(title, &along.time);
    let sides = ["left", "right"];
    // Angles relative to their means, so that both cranks have one scale.
    let angles: DriveColumns = periodic
        .series
        .iter()
        .map(|one| {
            let time = along.time.iter();
            time.map(|t| (one.at_time(*t)[0] - one.offset).to_degrees()).collect()
        })
        .collect();
    let limit = round_limit(&[&angles]);
    for (k, (side, letter)) in sides.into_iter().zip(["a", "b"]).enumerate() {
        let mean = periodic.series[k].offset.to_degrees();
        let title = format!("({letter}) {side} active joint: angle about its mean of {mean:.1} degrees, degrees");
        figure.panel_with(&title, &[("", &angles[k])], &scale(limit));
    }
    let (calculated, estimated) = (&along.calculated[0], &along.estimated[0]);
    let limit = round_limit(&[&along.measured, calculated, estimated]);
    for (k, (side, letter)) in sides.into_iter().zip(["c", "d"]).enumerate() {
        figure.panel_with(
            &format!("({letter}) force of the {side} spindle, N"),
            &[
                ("rig", &along.measured[k]),
                ("calculated", &calculated[k]),
                ("estimated", &estimated[k]),
            ],
            &scale(limit),
        );
    }
    for (k, (side, letter)) in sides.into_iter().zip(["e", "f"]).enumerate() {
        let [calculated, estimated] = [calculated, estimated].map(|forces| relative_error(along, forces, k));
        figure.panel_with(
            &format!("({letter}) relative error of the {side} spindle force, per cent, cut off at {PANEL_RELATIVE}"),
            &[("calculated", &calculated), ("estimated", &estimated)],
            &without_rig(PANEL_RELATIVE),
        );
    }
    figure.finish()
}

/// The relative error of a drive, per cent; larger values are cut off by the panel.
fn relative_error(along: &TreatmentRun, modelled: &DriveColumns, drive: usize) -> Vec<f64> {
    let pairs = modelled[drive].iter().zip(&along.measured[drive]);
    pairs
        .map(|(m, y)| if *y == 0.0 { 0.0 } else { 100.0 * (m - y) / y })
        .collect()
}

/// Forces, and errors before and after identification of both treatments on one scale.
pub(crate) fn errors(title: &str, along: &TreatmentRun, drives: &[String]) -> String {
    let mut figure = SvgFigure::new(title, &along.time);
    // Errors of both treatments before and after identification.
    let calculated = [0, 1].map(|t| along.error(&along.calculated[t]));
    let estimated = [0, 1].map(|t| along.error(&along.estimated[t]));
    // One scale for all forces and one for all errors, so that panels can be compared.
    let force = round_limit(&[&along.measured]);
    let error = round_limit(&[&calculated[0], &calculated[1], &estimated[0], &estimated[1]]);
    for (d, drive) in drives.iter().enumerate() {
        figure.panel_with(&format!("{drive}, N"), &[("rig", &along.measured[d])], &scale(force));
        figure.panel_with(
            &format!("{drive}: error of the paper's treatment, N"),
            &[("calculated", &calculated[0][d]), ("estimated", &estimated[0][d])],
            &without_rig(error),
        );
        figure.panel_with(
            &format!("{drive}: error of the consistent treatment, N"),
            &[("calculated", &calculated[1][d]), ("estimated", &estimated[1][d])],
            &without_rig(error),
        );
    }
    figure.finish()
}

/// The error of the paper's treatment, the force of the misplaced mass, and the difference of both.
pub(crate) fn decomposition(title: &str, along: &TreatmentRun, drives: &[String]) -> String {
    let mut figure = SvgFigure::new(title, &along.time);
    let error = along.error(&along.calculated[0]);
    let placement = along.placement();
    // One scale for the three panels of every drive.
    let limit = round_limit(&[&error, &placement]);
    for (d, drive) in drives.iter().enumerate() {
        let rest: Vec<f64> = error[d].iter().zip(&placement[d]).map(|(e, p)| e - p).collect();
        // The error, its explanation from the models alone, and the difference.
        for (what, values) in [
            ("error of the paper's treatment, rig minus model", &error[d]),
            ("force of the misplaced m4, from the models alone", &placement[d]),
            ("error minus this force", &rest),
        ] {
            figure.panel_with(&format!("{drive}: {what}, N"), &[("", values)], &scale(limit));
        }
    }
    figure.finish()
}

/// The change of the forces by the paper's own identification, together with the force of the misplaced mass.
pub(crate) fn printed_change(title: &str, along: &TreatmentRun, drives: &[String]) -> String {
    let mut figure = SvgFigure::new(title, &along.time);
    let (change, placement) = (along.printed_change(), along.placement());
    let limit = round_limit(&[&change, &placement]);
    for (d, drive) in drives.iter().enumerate() {
        figure.panel_with(
            &format!("{drive}, N"),
            &[
                ("change by the paper's identification", &change[d]),
                ("force of the misplaced m4", &placement[d]),
            ],
            &scale(limit),
        );
    }
    figure.finish()
}

/// The cause of the peaks of relative errors: force, error and their quotient, with the zeros of the force marked.
pub(crate) fn peaks(title: &str, along: &TreatmentRun, drive: usize, name: &str) -> String {
    let mut figure = SvgFigure::new(title, &along.time);
    let zeros = along.zeros(drive);
    let error = along.error(&along.calculated[0]);
    // Relative errors above the limit are cut off, since they are unbounded where the force is zero.
    let relative: Vec<f64> = error[drive]
        .iter()
        .zip(&along.measured[drive])
        .map(|(e, y)| 100.0 * (e / y).clamp(-RELATIVE, RELATIVE))
        .collect();
    let mut look = scale(round_limit(&[&along.measured]));
    look.marks = &zeros;
    // The same scale for force and error shows that the error has no peaks.
    figure.panel_with(
        &format!("{name}, N; dashed where it passes through zero"),
        &[("rig", &along.measured[drive])],
        &look,
    );
    // Errors of the calculated forces have their colour.
    look.first_colour = 1;
    figure.panel_with(
        "error of the paper's treatment, calculated, N: no peaks",
        &[("error", &error[drive])],
        &look,
    );
    look.limit = Some(100.0 * RELATIVE);
    figure.panel_with(
        "error / force, per cent, cut off at 100: a peak at every dashed line",
        &[("error / force", &relative)],
        &look,
    );
    figure.finish()
}

/// Positions of the base parameters between calculated (0) and consistent (1) values.
pub(crate) fn base_parameter_positions(experiment: &PaperExperiment) -> String {
    const ROW: f64 = 46.0;
    let [calculated, consistent, estimated] = &experiment.base;
    let ours = [
        experiment.benches[0].fits[0].values(),
        experiment.benches[1].fits[0].values(),
    ];
    // Estimates with their colours in the style of the pages.
    let series: [(&str, &str, &[f64]); 3] = [
        ("the paper's estimate, Table 1", "c1", estimated),
        ("ours, rig as in Table 1", "c0", &ours[0]),
        ("ours, rig with spindle rods", "c2", &ours[1]),
    ];
    // Horizontal position of a value, and the lower end of the chart.
    let x = |share: f64| 150.0 + 220.0 * (share + 0.2);
    let bottom = 70.0 + ROW * calculated.len() as f64;
    let mut body = String::new();
    // Vertical lines for calculated, consistent, and twice the distance.
    for (share, label) in [(0.0, "calculated"), (1.0, "consistent"), (2.0, "twice as far")] {
        let _ = writeln!(
            body,
            r#"<line class="zero" x1="{0:.1}" x2="{0:.1}" y1="62" y2="{bottom:.1}"/><text x="{0:.1}" y="54" text-anchor="middle" class="scale">{label}</text>"#,
            x(share)
        );
    }
    // One row per base parameter, with a point per estimate.
    for k in 0..calculated.len() {
        let y = 90.0 + ROW * k as f64;
        let _ = writeln!(
            body,
            r#"<text x="30" y="{:.1}">p{},min</text><line class="zero" x1="{:.1}" x2="{:.1}" y1="{y:.1}" y2="{y:.1}"/>"#,
            y + 4.0,
            k + 1,
            x(-0.1),
            x(3.0)
        );
        // The position of every estimate between the two values, limited to the chart.
        let span = consistent[k] - calculated[k];
        for (i, (_, colour, values)) in series.iter().enumerate() {
            let share = ((values[k] - calculated[k]) / span).clamp(-0.1, 3.0);
            let _ = writeln!(
                body,
                r#"<circle cx="{:.1}" cy="{:.1}" r="6" class="{colour}"/>"#,
                x(share),
                y + 9.0 * (i as f64 - 1.0)
            );
        }
    }
    // The legend.
    for (i, (name, colour, _)) in series.iter().enumerate() {
        let at = 40.0 + 280.0 * i as f64;
        let _ = writeln!(
            body,
            r#"<circle cx="{at:.1}" cy="{0:.1}" r="6" class="{colour}"/><text x="{1:.1}" y="{2:.1}">{name}</text>"#,
            bottom + 24.0,
            at + 12.0,
            bottom + 28.0
        );
    }
    frame(
        "Position of each base parameter between the calculated (0) and the consistent value (1)",
        bottom + 44.0,
        &body,
    )
}

/// The error for other distances of the base joints; empty if there are fewer than two.
pub(crate) fn lengths(lengths: &[DistanceErrors], paper: [f64; 2]) -> String {
    let (top, height, left, width) = (60.0, 240.0, 80.0, 780.0);
    let most = 0.35;
    let (first, last) = match (lengths.first(), lengths.last()) {
        (Some(first), Some(last)) if last.distance > first.distance => (first.distance, last.distance),
        _ => return String::new(),
    };
    // Coordinates of the chart for a distance and an error.
    let x = |distance: f64| left + width * (distance - first) / (last - first);
    let y = |share: f64| top + height * (1.0 - share.min(most) / most);
    let mut body = String::new();
    // The band of the paper's errors.
    let _ = writeln!(
        body,
        r#"<rect class="part" x="{left}" y="{:.1}" width="{width}" height="{:.1}"/><text x="{:.1}" y="{:.1}" class="scale">the paper's calculated 7.8 to 10.2 % (mean relative)</text>"#,
        y(paper[1]),
        y(paper[0]) - y(paper[1]),
        left + 8.0,
        y(paper[0]) + 14.0
    );
    // Horizontal lines at every 5 %.
    for k in 0..=7 {
        let share = most * f64::from(k) / 7.0;
        let _ = writeln!(
            body,
            r#"<line class="zero" x1="{left}" x2="{:.1}" y1="{1:.1}" y2="{1:.1}"/><text x="{2:.1}" y="{3:.1}" text-anchor="end" class="scale">{4:.0} %</text>"#,
            left + width,
            y(share),
            left - 6.0,
            y(share) + 4.0,
            100.0 * share
        );
    }
    // Labels of the distances.
    for length in lengths {
        let _ = writeln!(
            body,
            r#"<text x="{:.1}" y="{:.1}" text-anchor="middle" class="scale">{}</text>"#,
            x(length.distance),
            top + height + 16.0,
            length.distance
        );
    }
    // One curve per spindle.
    for (d, (name, colour)) in [("left spindle", "c0"), ("right spindle", "c2")]
        .into_iter()
        .enumerate()
    {
        let points: Vec<String> = lengths
            .iter()
            .filter_map(|length| {
                let error = length.errors.get(d)?;
                Some(format!("{:.1},{:.1}", x(length.distance), y(error.nrms)))
            })
            .collect();
        let _ = writeln!(
            body,
            r#"<polyline class="{colour}" points="{}"/><text class="{colour}" x="{:.1}" y="52">{name}</text>"#,
            points.join(" "),
            left + 560.0 + 120.0 * d as f64
        );
    }
    let _ = writeln!(
        body,
        r#"<text x="{left}" y="52">nrms</text><text x="{:.1}" y="{:.1}" text-anchor="end" class="scale">b, distance of the base joints, m</text>"#,
        left + width,
        top + height + 34.0
    );
    frame(
        "Error of the paper's treatment, calculated, over the distance of the base joints",
        top + height + 46.0,
        &body,
    )
}

/// A sheet with a title.
fn frame(title: &str, height: f64, body: &str) -> String {
    sheet(title, 30.0, height, body)
}
