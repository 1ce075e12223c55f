//! Figures as SVG files: panels of curves over one time axis, one below the other. Lengths are in SVG units.

use std::fmt::Write as _;

/// Width of a figure.
const WIDTH: f64 = 900.0;
/// Height of a panel.
const PANEL: f64 = 150.0;
/// Space between panels, for a line with the title and a line with the names of curves, also in the letters of a narrow
/// screen.
const GAP: f64 = 56.0;
/// Distance of a panel's title from its upper edge.
const TITLE_ABOVE: f64 = 31.0;
/// Distance of the names of curves from the upper edge of their panel.
const NAMES_ABOVE: f64 = 8.0;
/// Width of a letter of a name on a narrow screen.
const LETTER: f64 = 11.0;
/// Margin left of the panels, for the scale.
const LEFT: f64 = 80.0;
/// Margin right of the panels.
const RIGHT: f64 = 16.0;
/// Space above the first panel, for the title.
const TOP: f64 = 44.0;
/// Largest number of points of a curve; more would not be visible.
const POINTS: usize = 820;
/// Number of curve colours in the style.
const COLOURS: usize = 3;
/// Style sheet for light and dark mode, with the colours of all pages; it is part of each figure.
const STYLE: &str = "\
.figure{--paper:#fff;--ink:#1a1d21;--faint:#59636c;--line:#d9dee3;--c0:#1f5fa8;--c1:#b53d26;--c2:#2a7147;font-family:system-ui,sans-serif}
@media screen and (prefers-color-scheme:dark){.figure{--paper:#14171a;--ink:#e4e7ea;--faint:#a2acb5;--line:#343b42;--c0:#74b2f5;--c1:#f0826a;--c2:#6cc492}}
.figure .paper{fill:var(--paper)}
.figure .box{fill:none;stroke:var(--faint)}
.figure .zero{stroke:var(--line)}
.figure .mark{stroke:var(--faint);stroke-dasharray:3 3}
.figure .part{fill:#c9a227;fill-opacity:.2}
.figure circle.c0{fill:var(--c0)}.figure circle.c1{fill:var(--c1)}.figure circle.c2{fill:var(--c2)}
.figure polyline{fill:none;stroke-width:1.2}
.figure polyline.c0{stroke:var(--c0)}.figure polyline.c1{stroke:var(--c1)}.figure polyline.c2{stroke:var(--c2)}
.figure text{font-size:13px;fill:var(--ink)}
.figure text.c0{fill:var(--c0)}.figure text.c1{fill:var(--c1)}.figure text.c2{fill:var(--c2)}
.figure text.title{font-size:17px}
.figure text.scale{font-size:11px;fill:var(--faint)}
@media screen and (max-width:640px){.figure text{font-size:18px}.figure text.title{font-size:20px}.figure text.scale{font-size:16px}.panels text{font-size:22px}.panels text.scale{font-size:20px}}
";

/// Options of a panel.
#[derive(Default)]
pub struct PanelStyle<'a> {
    /// Largest magnitude of the scale; larger values are cut off. `None` takes the largest of the curves.
    pub limit: Option<f64>,
    /// Times of vertical lines, s.
    pub marks: &'a [f64],
    /// Colour of the first curve, 0 to 2; the next curves have the next colours. With it, a quantity has the same
    /// colour in all panels.
    pub first_colour: usize,
}

/// A figure under construction.
pub struct SvgFigure<'a> {
    /// Title as SVG text.
    title: String,
    /// Times of the samples, s.
    time: &'a [f64],
    /// SVG of the panels so far.
    body: String,
    /// Number of panels so far.
    panels: usize,
}

impl<'a> SvgFigure<'a> {
    /// A figure over the given times, s.
    pub fn new(title: &str, time: &'a [f64]) -> Self {
        Self {
            title: escape(title),
            time,
            body: String::new(),
            panels: 0,
        }
    }

    /// Adds a panel with its curves, one value for each time.
    pub fn panel(&mut self, title: &str, curves: &[(&str, &[f64])]) {
        self.panel_with(title, curves, &PanelStyle::default());
    }

    /// As [`Self::panel`], with a fixed scale or marks.
    pub fn panel_with(&mut self, title: &str, curves: &[(&str, &[f64])], look: &PanelStyle<'_>) {
        let top = TOP + GAP + self.panels as f64 * (PANEL + GAP);
        let largest = curves
            .iter()
            .flat_map(|(_, values)| values.iter())
            .fold(0.0_f64, |m, v| m.max(v.abs()));
        let limit = look.limit.unwrap_or(largest).max(f64::MIN_POSITIVE);
        let plot_width = WIDTH - LEFT - RIGHT;
        // Zero is in the middle of the panel; larger values are cut off at its edge.
        let y = |value: f64| top + PANEL * (0.5 - 0.5 * (value / limit).clamp(-1.0, 1.0));
        let body = &mut self.body;
        let _ = writeln!(
            body,
            r#"<rect class="box" x="{LEFT}" y="{top}" width="{plot_width}" height="{PANEL}"/>
<line class="zero" x1="{LEFT}" x2="{:.1}" y1="{1:.1}" y2="{1:.1}"/>
<text x="{LEFT}" y="{2:.1}">{3}</text>"#,
            WIDTH - RIGHT,
            y(0.0),
            top - TITLE_ABOVE,
            escape(title)
        );
        let (first, last) = (
            self.time.first().copied().unwrap_or(0.0),
            self.time.last().copied().unwrap_or(0.0),
        );
        for mark in look.marks {
            let share = (mark - first) / (last - first).max(f64::MIN_POSITIVE);
            let _ = writeln!(
                body,
                r#"<line class="mark" x1="{0:.1}" x2="{0:.1}" y1="{top:.1}" y2="{1:.1}"/>"#,
                LEFT + plot_width * share,
                top + PANEL
            );
        }
        // A given limit is a round number and is printed unchanged.
        let text = |value: f64| match look.limit {
            Some(_) => value.to_string(),
            None => format!("{value:.4}"),
        };
        for (value, label) in [(limit, text(limit)), (0.0, "0".to_owned()), (-limit, text(-limit))] {
            let label = if label.len() > 9 { format!("{value:.2e}") } else { label };
            let _ = writeln!(
                body,
                r#"<text x="{:.1}" y="{:.1}" text-anchor="end" class="scale">{label}</text>"#,
                LEFT - 6.0,
                y(value) + 4.0
            );
        }
        // Names stand side by side, the last at the right end.
        let width = |name: &str| LETTER * name.chars().count() as f64 + 20.0;
        for (k, (name, values)) in curves.iter().enumerate() {
            let behind: f64 = curves[k + 1..].iter().map(|(name, _)| width(name)).sum();
            let colour = (look.first_colour + k) % COLOURS;
            let n = values.len().max(2) - 1;
            // Long curves are thinned out, which keeps all peaks.
            let mut points = String::new();
            for (i, value) in thin_out(values, POINTS) {
                let x = LEFT + plot_width * i as f64 / n as f64;
                let _ = write!(points, "{x:.1},{:.1} ", y(value));
            }
            let _ = writeln!(
                body,
                r#"<polyline class="c{colour}" points="{}"/>
<text class="c{colour}" x="{:.1}" y="{:.1}" text-anchor="end">{}</text>"#,
                points.trim_end(),
                WIDTH - RIGHT - behind,
                top - NAMES_ABOVE,
                escape(name)
            );
        }
        self.panels += 1;
    }

    /// The text of the file, with the time axis below the last panel.
    pub fn finish(self) -> String {
        let bottom = TOP + GAP + self.panels as f64 * (PANEL + GAP);
        let height = bottom + 10.0;
        let (first, last) = (
            self.time.first().copied().unwrap_or(0.0),
            self.time.last().copied().unwrap_or(0.0),
        );
        let body = format!(
            r#"{0}<text x="{LEFT}" y="{1:.1}" class="scale">{first} s</text>
<text x="{2:.1}" y="{1:.1}" text-anchor="end" class="scale">{last} s</text>
"#,
            self.body,
            bottom - GAP + 22.0,
            WIDTH - RIGHT,
        );
        write_sheet("figure panels", &self.title, LEFT, height, &body)
    }
}

/// An SVG file with the colours of all figures, 900 units wide and `height` units high. The title begins `left` units
/// from the left edge. `title` and `body` are SVG text.
///
/// CSS classes for `body`: `c0`, `c1` and `c2` set the colour of curves, of filled circles and of their labels. `zero`
/// is for lines, `scale` for small text, and `part` for marked areas.
pub fn sheet(title: &str, left: f64, height: f64, body: &str) -> String {
    write_sheet("figure", title, left, height, body)
}

/// The same with the classes of the figure; `panels` has larger letters on narrow screens.
fn write_sheet(class: &str, title: &str, left: f64, height: f64, body: &str) -> String {
    format!(
        r#"<svg xmlns="http://www.w3.org/2000/svg" class="{class}" role="img" aria-label="{title}" viewBox="0 0 {WIDTH} {height:.0}">
<style>
{STYLE}</style>
<rect class="paper" width="{WIDTH}" height="{height:.0}"/>
<text class="title" x="{left}" y="26">{title}</text>
{body}</svg>
"#
    )
}

/// A curve in about `wanted` points, each with its index: the smallest and the largest value of each of many
/// segments, so that every peak is kept. All values if they are few enough.
///
/// ```
/// assert_eq!(modelmill::text::svg::thin_out(&[0.0, 5.0], 10), [(0, 0.0), (1, 5.0)]);
/// ```
pub fn thin_out(values: &[f64], wanted: usize) -> Vec<(usize, f64)> {
    if values.len() <= wanted {
        return values.iter().copied().enumerate().collect();
    }
    let segment = values.len().div_ceil((wanted / 2).max(1));
    let mut points = Vec::with_capacity(wanted + 2);
    for (k, span) in values.chunks(segment).enumerate() {
        let at = |i: usize| (k * segment + i, span[i]);
        let by = |a: &usize, b: &usize| span[*a].total_cmp(&span[*b]);
        let low = (0..span.len()).min_by(by).unwrap_or(0);
        let high = (0..span.len()).max_by(by).unwrap_or(0);
        points.push(at(low.min(high)));
        if low != high {
            points.push(at(low.max(high)));
        }
    }
    points
}

/// Text with the characters escaped that HTML and SVG reserve.
pub fn escape(text: &str) -> String {
    modelmill_boundary::text::html(text).into_owned()
}
