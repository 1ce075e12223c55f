//! Picture of the error after each step, on the fitted and on the validation runs, on a logarithmic
//! axis with the noise of the forces.

use super::draw::{PlotAxis, SvgPicture, WIDTH};
use crate::diagnose::{DiagnosisFindings, words};
use crate::text::table::percent;
use crate::text::wrap::wrap_words;

/// Smallest height of a step.
const ROW: f64 = 46.0;
/// Height of a line of a label.
const LINE: f64 = 14.0;
/// Space above the first step.
const TOP: f64 = 34.0;
/// Space left of the axis, for the labels.
const LEFT: f64 = 290.0;
/// Largest number of letters of a line of a label.
const LETTERS: usize = 38;

/// The picture as SVG.
pub(crate) fn picture(findings: &DiagnosisFindings) -> String {
    let diagnosis = &findings.diagnosis;
    let (steps, noise, judged) = (&diagnosis.steps, diagnosis.noise_floor, findings.validation);
    // The axis covers all errors and the noise.
    let errors = steps.iter().flat_map(|step| [step.fit, step.check]);
    let all: Vec<f64> = errors.chain([noise]).filter(|e| *e > 0.0).collect();
    let low = all.iter().copied().fold(f64::INFINITY, f64::min);
    let high = all.iter().copied().fold(0.0, f64::max);
    if !low.is_finite() {
        return String::new();
    }
    let labels: Vec<Vec<String>> = steps
        .iter()
        .map(|step| wrap_words(&words::step_text(step, diagnosis, findings.channels()), LETTERS))
        .collect();
    // All rows have the height of the longest label.
    let longest = labels.iter().map(Vec::len).max().unwrap_or(1);
    let row = ROW.max(LINE * longest as f64 + 8.0);
    let bottom = TOP + row * steps.len() as f64;
    // The axis has room of a factor 1.6 at both ends.
    let percents = [100.0 * low / 1.6, 100.0 * high * 1.6];
    let x = PlotAxis::decades(percents, [LEFT, WIDTH - 176.0]);
    let y = PlotAxis::new([0.0, 1.0], [bottom, TOP]);
    let mut picture = SvgPicture::new(WIDTH, bottom + 40.0);
    picture.frame(&x, &y, "error / force, %", [7, 0]);
    // The noise is a vertical line with its value.
    if noise > 0.0 {
        let at = x.position(100.0 * noise);
        picture.path("noise", &format!("M{at:.1} {TOP:.1}V{bottom:.1}"));
        // The label stays inside of the picture on either half of the axis.
        let anchor = if at > 0.5 * (x.start + x.end) { "end" } else { "start" };
        let aside = if anchor == "end" { -5.0 } else { 5.0 };
        picture.text(
            "tick",
            [at + aside, TOP - 8.0],
            anchor,
            &format!("{} {}", words::floor_label(noise), percent(Some(noise))),
        );
    }
    let mut last: Option<[f64; 3]> = None;
    // One row for each step: two dots, lines to those of the step before, values at the right, label at the
    // left.
    for (k, step) in steps.iter().enumerate() {
        let middle = TOP + row * (k as f64 + 0.5);
        let [fit, check] = [step.fit, step.check].map(|e| x.position(100.0 * e));
        if let Some([fit_before, check_before, before]) = last {
            picture.path(
                "step-mark c-fit",
                &format!("M{fit_before:.1} {before:.1}L{fit:.1} {:.1}", middle - 7.0),
            );
            picture.path(
                "step-mark c-after",
                &format!("M{check_before:.1} {:.1}L{check:.1} {:.1}", before + 14.0, middle + 7.0),
            );
        }
        picture.dot("dot c-fit", [fit, middle - 7.0], 5.0);
        picture.dot("dot c-after", [check, middle + 7.0], 5.0);
        last = Some([fit, check, middle - 7.0]);
        let right = WIDTH - 170.0;
        picture.text(
            "tick c-fit",
            [right, middle - 3.0],
            "start",
            &format!("fit {}", percent(Some(step.fit))),
        );
        picture.text(
            "tick c-after",
            [right, middle + 12.0],
            "start",
            &format!("{} {}", judged.label(), percent(Some(step.check))),
        );
        for (i, line) in labels[k].iter().enumerate() {
            let up = 0.5 * LINE * (labels[k].len() as f64 - 1.0);
            let at = [LEFT - 12.0, middle + 4.0 - up + LINE * i as f64];
            picture.text("label", at, "end", line);
        }
    }
    picture.finish("error after each step, on fitted and on validation data")
}
