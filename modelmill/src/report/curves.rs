//! Measured and calculated forces over time: pictures that need no script, and the same numbers packed for the
//! script that zooms.
//!
//! Long recordings keep the least and the largest value of each of many segments, so that no peak is lost and the page
//! stays small; values are packed as 16-bit steps between the least and the largest of a curve.
//!
//! Decision: every picture is an SVG that is complete without its script, so that the page reads on paper and under
//! a policy that forbids scripts. The script only redraws curves from the same numbers. There is no framework and
//! no crate for it.

use std::fmt::Write as _;

use serde_json::json;

use super::draw::{LEFT, PlotAxis, RIGHT, SvgPicture, WIDTH, attribute, line, range, with_room};
use super::units::force_unit;
use crate::diagnose::{ForceComparison, ModelVersion};
use crate::text::svg::{escape, thin_out};

/// Largest number of values of all curves of a page.
const BUDGET: usize = 420_000;
/// Smallest number of values of a curve, if the recording has as many.
const LEAST: usize = 1200;
/// Largest number of points of a curve in the picture without script.
const STILL: usize = 600;
/// Largest number of recordings whose curves are shown.
pub(crate) const MOST_RUNS: usize = 6;
/// Height of a panel.
const HEIGHT: f64 = 190.0;

/// A curve of one panel.
struct PlotCurve {
    /// Name in the key.
    name: String,
    /// Class of the style, which gives the colour.
    class: &'static str,
    /// Times of the first and the last value, s.
    span: [f64; 2],
    /// Evenly spaced values, N or N m.
    values: Vec<f64>,
}

/// Measured and calculated forces over time and their errors for each recording, validation runs first. `names`
/// are the names of the curves before and after. The same numbers follow as JSON for the script of pages.
pub fn section(before: &ModelVersion, after: Option<&ModelVersion>, names: [&str; 2]) -> String {
    // Validation runs come first, since they decide.
    let mut order: Vec<usize> = (0..before.runs.len()).collect();
    order.sort_by_key(|k| !before.runs[*k].is_check);
    let shown = order.len().min(MOST_RUNS);
    let drives = before.model.row_names().len();
    let curves = shown * drives * if after.is_some() { 5 } else { 3 };
    // Many recordings and drives share the budget, so that the page stays small.
    let most = (BUDGET / curves.max(1)).max(LEAST);
    let mut html = String::new();
    for (place, k) in order[..shown].iter().enumerate() {
        // Each recording is folded, with the first one open.
        let run = &before.runs[*k];
        let title = format!(
            "{} {}",
            if run.is_check {
                "Validation run"
            } else {
                "Run used for the fit"
            },
            run.name
        );
        let open = if place == 0 { " open" } else { "" };
        let _ = writeln!(
            html,
            "<details class=\"run\"{open} data-curves=\"run{k}\">\n<summary>{}</summary>",
            escape(&title)
        );
        html.push_str(&run_panels(before, after, names, *k, most));
        html.push_str("</details>\n");
    }
    // Recordings without curves are counted.
    if shown < order.len() {
        let _ = writeln!(
            html,
            "<p>{} more recordings are part of the error figures, but are not drawn here.</p>",
            order.len() - shown
        );
    }
    html
}

/// All panels of one recording, and their numbers as JSON for the script. `most` bounds the values of a curve.
fn run_panels(before: &ModelVersion, after: Option<&ModelVersion>, names: [&str; 2], k: usize, most: usize) -> String {
    let mut html = String::new();
    let mut packed = Vec::new();
    for (d, drive) in before.model.row_names().iter().enumerate() {
        let unit = force_unit(&before.model, d);
        // Two panels for each drive: forces, and their errors.
        for (title, curves) in panels(before, after, names, k, d, drive) {
            let title = format!("{title}, {unit}");
            html.push_str(&static_picture(&title, &curves));
            let curves: Vec<_> = curves.iter().map(|curve| pack(curve, most)).collect();
            packed.push(json!({ "title": title, "unit": unit, "curves": curves }));
        }
    }
    // Text of a script must not contain `</`, which would end it.
    let text = json!({ "panels": packed }).to_string();
    let text = text.replace('<', "\\u003c");
    let _ = writeln!(html, "<script type=\"application/json\" id=\"run{k}\">{text}</script>");
    html
}

/// Forces of a drive, and below them their errors.
fn panels(
    before: &ModelVersion,
    after: Option<&ModelVersion>,
    names: [&str; 2],
    k: usize,
    d: usize,
    drive: &str,
) -> [(String, Vec<PlotCurve>); 2] {
    let curve = |name: &str, class, run: &ForceComparison, values: Vec<f64>| PlotCurve {
        name: name.to_owned(),
        class,
        span: [
            run.time.first().copied().unwrap_or(0.0),
            run.time.last().copied().unwrap_or(1.0),
        ],
        values,
    };
    let error = |name: &str| format!("error of the {name}");
    // The measured force, the model as it is, and the model with effects.
    let run = &before.runs[k];
    let mut forces = vec![
        curve("measured", "c-measured", run, run.measured[d].clone()),
        curve(names[0], "c-before", run, run.forces[d].clone()),
    ];
    let mut errors = vec![curve(&error(names[0]), "c-before", run, run.error(d))];
    if let Some(run) = after.and_then(|after| after.runs.get(k)) {
        let values = run.forces[d].clone();
        forces.push(curve(names[1], "c-after", run, values));
        errors.push(curve(&error(names[1]), "c-after", run, run.error(d)));
    }
    [
        (drive.to_owned(), forces),
        (format!("{drive}: measured minus model"), errors),
    ]
}

/// The picture without any script.
fn static_picture(title: &str, curves: &[PlotCurve]) -> String {
    // Both axes cover all curves of the panel.
    let spans: Vec<f64> = curves.iter().flat_map(|c| c.span).collect();
    let time = range(&spans);
    let values = with_room(range(curves.iter().flat_map(|c| &c.values)), 0.05);
    let x = PlotAxis::new(time, [LEFT, WIDTH - RIGHT]);
    let y = PlotAxis::new(values, [HEIGHT - 34.0, 8.0]);
    let mut picture = SvgPicture::new(WIDTH, HEIGHT);
    picture.frame(&x, &y, "time, s", [9, 4]);
    for curve in curves {
        picture.path(
            &format!("curve {}", curve.class),
            &line(&curve.values, &x, curve.span, &y, STILL),
        );
    }
    // The names of the curves are their key, with the class that gives the colour.
    let names: Vec<String> = curves
        .iter()
        .map(|c| {
            format!(
                "<span class=\"key {}\" data-curve=\"{}\">{}</span>",
                c.class,
                attribute(&c.name),
                escape(&c.name)
            )
        })
        .collect();
    format!(
        "<figure class=\"plot\"><figcaption><b>{}</b> {}</figcaption>\n{}</figure>\n",
        escape(title),
        names.join(" "),
        picture.finish(&format!("{title} over time"))
    )
}

/// A curve for the script: the number that a step stands for, and the steps.
fn pack(curve: &PlotCurve, most: usize) -> serde_json::Value {
    let values = &curve.values;
    // Extremes of each segment are kept.
    let kept: Vec<f64> = thin_out(values, most).into_iter().map(|(_, v)| v).collect();
    let [low, high] = range(&kept);
    // A constant curve has a step of zero.
    let (low, step) = if high > low {
        (low, (high - low) / 65_534.0)
    } else {
        (if low.is_finite() { low } else { 0.0 }, 0.0)
    };
    let mut bytes = Vec::with_capacity(2 * kept.len());
    for value in &kept {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "between 0 and 65534"
        )]
        // The largest number marks values that are not finite.
        let steps = if !value.is_finite() {
            u16::MAX
        } else if step > 0.0 {
            ((value - low) / step).round() as u16
        } else {
            0
        };
        bytes.extend(steps.to_le_bytes());
    }
    json!({
        "name": curve.name,
        "class": curve.class,
        "span": curve.span,
        "low": low,
        "step": step,
        "samples": values.len(),
        "data": base64(&bytes),
    })
}

/// Bytes as text (RFC 4648).
fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for three in bytes.chunks(3) {
        // Three bytes are four letters; missing bytes at the end are padded.
        let byte = |i: usize| u32::from(three.get(i).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        for i in 0..4 {
            if i <= three.len() {
                let letter = LETTERS[(bits >> (18 - 6 * i) & 63) as usize];
                text.push(char::from(letter));
            } else {
                text.push('=');
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_written_as_the_standard_has_it() {
        // Test vectors of RFC 4648, section 10.
        for (bytes, text) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(base64(bytes.as_bytes()), text);
        }
    }

    #[test]
    fn packing_keeps_every_peak() {
        let mut values = vec![0.0; 50_000];
        values[31_234] = 7.0;
        values[100] = -3.0;
        let curve = PlotCurve {
            name: "error".to_owned(),
            class: "c-before",
            span: [0.0, 10.0],
            values,
        };
        let packed = pack(&curve, 2000);
        assert_eq!(packed["low"], -3.0);
        assert!((packed["step"].as_f64().unwrap() * 65_534.0 - 10.0).abs() < 1e-9);
        assert!(packed["data"].as_str().unwrap().len() < 6000);
    }
}
