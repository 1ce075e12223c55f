//! Errors of the geometry that explain as much as the effects found, in the answer and as text.

use crate::answers::{GeometryAlternativeAnswer, GeometryErrorAnswer};
use crate::diagnose::{DiagnosisFindings, words};
use crate::text::TerminalStyle;
use crate::text::names::joined_by_and;
use crate::text::wrap::wrap_words;

impl DiagnosisFindings {
    /// Errors of the geometry that explain as much as the effects found.
    pub(super) fn geometry_answers(&self) -> Vec<GeometryAlternativeAnswer> {
        let alternatives = self.geometry_alternatives.iter().map(|one| {
            let errors = one.errors.iter().map(|error| {
                let (point, axis) = error.zero.as_ref().map(|(point, axis)| (point, axis)).unzip();
                GeometryErrorAnswer {
                    constant: error.constant.clone(),
                    point: point.cloned(),
                    axis: axis.map(|axis| (*axis).to_owned()),
                    value: error.value,
                    unit: error.unit.clone(),
                }
            });
            GeometryAlternativeAnswer {
                errors: errors.collect(),
                share: one.share,
            }
        });
        alternatives.collect()
    }

    /// Errors of the geometry that explain as much as the effects found, as lines.
    pub(super) fn geometry_alternatives_text(&self, style: TerminalStyle, lines: &mut Vec<String>) {
        if self.geometry_alternatives.is_empty() {
            return;
        }
        lines.push(String::new());
        // Without effects, a clock was found that wrong lengths explain too.
        let (what, explain, them) = if self.missing.is_empty() {
            (
                "the time base",
                "the time base explains",
                "the time base: check the clock and measure the lengths.",
            )
        } else {
            (
                "the effects found",
                "the effects explain",
                "the effects: measure the lengths.",
            )
        };
        lines.push(style.bold(&format!("Errors of the geometry that explain as much as {what}")));
        for one in &self.geometry_alternatives {
            let errors: Vec<String> = one.errors.iter().map(words::geometry_error_text).collect();
            lines.push(format!(
                "  {} ({:.1} % of what {explain})",
                joined_by_and(&errors),
                100.0 * one.share
            ));
        }
        let advice = format!("These recordings do not distinguish them from {them}");
        lines.extend(wrap_words(&advice, 98).iter().map(|line| format!("  {line}")));
    }
}
