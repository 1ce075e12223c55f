//! Drawing of pictures as SVG: axes with round ticks, panels, and paths. Colours are classes of the style, so that
//! a page may be light or dark.

use std::fmt::Write as _;

use modelmill_identify::float_to_count;

use crate::text::svg::{escape, thin_out};

/// Width of a picture in its own units.
pub(crate) const WIDTH: f64 = 860.0;
/// Room for the ticks at the left.
pub(crate) const LEFT: f64 = 66.0;
/// Room at the right.
pub(crate) const RIGHT: f64 = 14.0;

/// An axis from one value to another over a part of the picture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlotAxis {
    /// Value at the start.
    pub from: f64,
    /// Value at the end.
    pub to: f64,
    /// Position of the start in the picture, its own units.
    pub start: f64,
    /// Position of the end in the picture.
    pub end: f64,
    /// Whether decades are of equal length.
    pub log: bool,
}

impl PlotAxis {
    /// A linear axis; a range without length is widened.
    pub(crate) fn new(range: [f64; 2], pixels: [f64; 2]) -> Self {
        let [mut from, mut to] = range;
        if !(from.is_finite() && to.is_finite()) {
            (from, to) = (0.0, 1.0);
        }
        // A constant curve would divide by zero: it gets room on both sides.
        if to - from <= f64::EPSILON * from.abs().max(to.abs()) {
            let room = 0.5 * from.abs().max(f64::MIN_POSITIVE * 1e10);
            (from, to) = (from - room, to + room);
        }
        Self {
            from,
            to,
            start: pixels[0],
            end: pixels[1],
            log: false,
        }
    }

    /// A logarithmic axis; values must be positive.
    pub(crate) fn decades(range: [f64; 2], pixels: [f64; 2]) -> Self {
        // Zero has no logarithm, and a range below a factor of 1.5 has too few ticks.
        let from = range[0].max(1e-300);
        let to = range[1].max(from * 1.5);
        Self {
            log: true,
            ..Self::new([from, to], pixels)
        }
    }

    /// The position of a value, kept within the axis.
    pub(crate) fn position(&self, value: f64) -> f64 {
        // The share of the axis between its ends.
        let share = if self.log {
            (value.max(1e-300) / self.from).ln() / (self.to / self.from).ln()
        } else {
            (value - self.from) / (self.to - self.from)
        };
        self.start + (self.end - self.start) * share.clamp(0.0, 1.0)
    }

    /// Round values along the axis with their labels, about `most` of them.
    pub(crate) fn ticks(&self, most: usize) -> Vec<(f64, String)> {
        if most == 0 {
            return Vec::new();
        }
        if self.log {
            return self.decade_ticks(most);
        }
        let mut step = round_step((self.to - self.from) / most.max(1) as f64);
        // One value alone gives no scale.
        let within = |step: f64| (self.to / step + 1e-9).floor() - (self.from / step - 1e-9).ceil();
        for _ in 0..2 {
            if within(step) < 1.0 && most > 1 {
                step = round_step(0.4 * step);
            }
        }
        // The first multiple of the step within the axis.
        let first = (self.from / step - 1e-9).ceil();
        let mut ticks = Vec::new();
        for k in 0..=2 * most.max(1) {
            let value = (first + k as f64) * step;
            if value > self.to + 1e-9 * step {
                break;
            }
            ticks.push((value, label(value, step)));
        }
        ticks
    }

    /// Powers of ten along the axis, with steps between them if there are few.
    fn decade_ticks(&self, most: usize) -> Vec<(f64, String)> {
        let decades = (self.to / self.from).log10();
        let mut ticks = Vec::new();
        // Up to two decades have room for steps of 1, 2 and 5.
        let steps: &[f64] = if decades <= 2.0 { &[1.0, 2.0, 5.0] } else { &[1.0] };
        #[expect(clippy::cast_possible_truncation, reason = "exponents of ten")]
        let (low, high) = (self.from.log10().floor() as i32, self.to.log10().ceil() as i32);
        let every = float_to_count((decades / most.max(1) as f64).ceil()).max(1);
        for exponent in (low..=high).step_by(every) {
            for step in steps {
                let value = step * 10_f64.powi(exponent);
                if value >= self.from * 0.999 && value <= self.to * 1.001 {
                    ticks.push((value, label(value, value)));
                }
            }
        }
        ticks
    }
}

/// The smallest of 1, 2 or 5 times a power of ten that is not below a number.
fn round_step(rough: f64) -> f64 {
    let rough = rough.max(f64::MIN_POSITIVE * 1e10);
    let decade = 10_f64.powf(rough.log10().floor());
    // Readers can interpolate between these steps.
    let steps = [1.0, 2.0, 5.0, 10.0];
    let step = steps.into_iter().find(|s| s * decade >= rough * 0.999);
    step.unwrap_or(10.0) * decade
}

/// The label of a tick, with as many digits as steps need.
fn label(value: f64, step: f64) -> String {
    // A sum of steps may miss zero by rounding.
    if value.abs() < 1e-9 * step.abs() {
        return "0".to_owned();
    }
    // Longer numbers would not fit in front of the axis.
    if value.abs() >= 1e5 || step.abs() < 1e-4 {
        let text = format!("{value:.1e}");
        return text.replace(".0e", "e");
    }
    let decimals = float_to_count((-(step.abs() * 1.001).log10().floor()).max(0.0));
    format!("{value:.decimals$}").replace('-', "−")
}

/// A picture under construction.
pub(crate) struct SvgPicture {
    /// SVG elements so far.
    body: String,
    /// Width of the picture, in its own units.
    width: f64,
    /// Height of the picture.
    height: f64,
}

impl SvgPicture {
    /// An empty picture.
    pub(crate) fn new(width: f64, height: f64) -> Self {
        Self {
            body: String::new(),
            width,
            height,
        }
    }

    /// Draws grid, ticks and a frame for a pair of axes. `n_ticks` are the numbers of ticks of both; `title` is
    /// that of the axis across.
    pub(crate) fn frame(&mut self, x: &PlotAxis, y: &PlotAxis, title: &str, n_ticks: [usize; 2]) {
        let (left, right) = (x.start, x.end);
        let (bottom, top) = (y.start, y.end);
        // Lines and labels of the axis across.
        for (value, label) in x.ticks(n_ticks[0]) {
            let at = x.position(value);
            let _ = write!(
                self.body,
                r#"<path class="grid" d="M{at:.1} {top:.1}V{bottom:.1}"/><text class="tick" x="{at:.1}" y="{:.1}" text-anchor="middle">{label}</text>"#,
                bottom + 15.0
            );
        }
        // Lines and labels of the axis upwards.
        for (value, label) in y.ticks(n_ticks[1]) {
            let at = y.position(value);
            let _ = write!(
                self.body,
                r#"<path class="grid" d="M{left:.1} {at:.1}H{right:.1}"/><text class="tick" x="{:.1}" y="{:.1}" text-anchor="end">{label}</text>"#,
                left - 6.0,
                at + 4.0
            );
        }
        let _ = write!(
            self.body,
            r#"<path class="frame" d="M{left:.1} {top:.1}H{right:.1}V{bottom:.1}H{left:.1}Z"/>"#
        );
        if !title.is_empty() {
            let _ = write!(
                self.body,
                r#"<text class="tick" x="{right:.1}" y="{:.1}" text-anchor="end">{}</text>"#,
                bottom + 31.0,
                escape(title)
            );
        }
    }

    /// Adds a path with a class of the style.
    pub(crate) fn path(&mut self, class: &str, d: &str) {
        let _ = write!(self.body, r#"<path class="{class}" d="{d}"/>"#);
    }

    /// Adds a text at a place; `anchor` is `start`, `middle` or `end`.
    pub(crate) fn text(&mut self, class: &str, at: [f64; 2], anchor: &str, text: &str) {
        let _ = write!(
            self.body,
            r#"<text class="{class}" x="{:.1}" y="{:.1}" text-anchor="{anchor}">{}</text>"#,
            at[0],
            at[1],
            escape(text)
        );
    }

    /// Adds a rectangle between two opposite corners.
    pub(crate) fn rect(&mut self, class: &str, a: [f64; 2], b: [f64; 2]) {
        let _ = write!(
            self.body,
            r#"<rect class="{class}" x="{:.1}" y="{:.1}" width="{:.1}" height="{:.1}"/>"#,
            a[0].min(b[0]),
            a[1].min(b[1]),
            (a[0] - b[0]).abs(),
            (a[1] - b[1]).abs()
        );
    }

    /// Adds a dot.
    pub(crate) fn dot(&mut self, class: &str, at: [f64; 2], radius: f64) {
        let _ = write!(
            self.body,
            r#"<circle class="{class}" cx="{:.1}" cy="{:.1}" r="{radius}"/>"#,
            at[0], at[1]
        );
    }

    /// The picture as SVG; `says` describes it for screen readers.
    pub(crate) fn finish(self, says: &str) -> String {
        format!(
            r#"<svg role="img" aria-label="{}" viewBox="0 0 {:.0} {:.0}">{}</svg>"#,
            attribute(says),
            self.width,
            self.height,
            self.body
        )
    }
}

/// A text as the value of an attribute.
pub(crate) fn attribute(text: &str) -> String {
    escape(text)
}

/// The path of a curve, thinned out to `points` points; values that are not finite are gaps. `span` are the values
/// of `x` at both ends.
pub(crate) fn line(values: &[f64], x: &PlotAxis, span: [f64; 2], y: &PlotAxis, points: usize) -> String {
    let last = values.len().max(2) - 1;
    let mut d = String::new();
    let mut pen = 'M';
    for (i, value) in thin_out(values, points) {
        if !value.is_finite() {
            // A value that is not finite interrupts the line.
            pen = 'M';
            continue;
        }
        let at = span[0] + (span[1] - span[0]) * i as f64 / last as f64;
        let _ = write!(d, "{pen}{:.0} {:.1}", x.position(at), y.position(value));
        pen = 'L';
    }
    d
}

/// Smallest and largest of all finite values.
pub(crate) fn range<'a>(values: impl IntoIterator<Item = &'a f64>) -> [f64; 2] {
    let finite = values.into_iter().filter(|v| v.is_finite());
    finite.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| {
        [low.min(*v), high.max(*v)]
    })
}

/// The range extended at both ends by a share of its length.
pub(crate) fn with_room([low, high]: [f64; 2], share: f64) -> [f64; 2] {
    let room = share * (high - low);
    [low - room, high + room]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_within_the_axis() {
        let axis = PlotAxis::new([-0.37, 1.13], [0.0, 100.0]);
        let labels: Vec<String> = axis.ticks(6).into_iter().map(|(_, l)| l).collect();
        assert_eq!(labels, ["0", "0.5", "1.0"]);
        // Few ticks are two at least.
        let axis = PlotAxis::new([-4.5, 4.5], [0.0, 100.0]);
        let labels: Vec<String> = axis.ticks(2).into_iter().map(|(_, l)| l).collect();
        assert_eq!(
            labels,
            ["-4", "-2", "0", "2", "4"].map(|l| l.replace('-', "\u{2212}"))[..]
        );
        let axis = PlotAxis::decades([3e-4, 0.2], [0.0, 100.0]);
        let ticks: Vec<f64> = axis.ticks(6).into_iter().map(|(v, _)| v).collect();
        assert_eq!(ticks.len(), 3);
        assert!((axis.position(0.2) - 100.0).abs() < 1e-9 && axis.position(3e-4).abs() < 1e-9);
    }

    #[test]
    fn odd_ranges_do_no_harm() {
        for range in [[0.0, 0.0], [f64::NAN, 1.0], [5.0, 5.0], [1e300, -1e300]] {
            let axis = PlotAxis::new(range, [0.0, 100.0]);
            assert!(axis.position(0.0).is_finite() && axis.ticks(5).len() < 20, "{range:?}");
        }
    }
}
