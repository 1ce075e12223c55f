//! Errors of a model on recordings, as JSON for scripts and as text for people.

use serde_json::{Value, json};

use crate::compare::ModelComparison;
use crate::error::{Error, Outcome};
use crate::print::{RemedyWording, notes, tables};
use crate::text::TerminalStyle;
use crate::text::table::count;

impl ModelComparison {
    /// Errors, regions, dependence on the rates and notes as one JSON object; `parameters` is `nominal` or the file that
    /// the values come from.
    pub fn json(&self, parameters: &str, wording: &dyn RemedyWording) -> Outcome<Value> {
        let mut object = json!({ "model": self.model, "parameters": parameters });
        let figures = serde_json::to_value(&self.figures);
        let figures = figures.map_err(|error| Error::input(error.to_string()))?;
        // The figures are part of the object itself, not a member of it.
        if let (Some(object), Some(figures)) = (object.as_object_mut(), figures.as_object()) {
            object.extend(figures.clone());
            object.insert("where".to_owned(), json!(self.error_locations.regions));
            object.insert("by_rate".to_owned(), json!(self.error_locations.by_rate));
            object.insert("data".to_owned(), notes(&self.notes, wording));
            let next = self.next_step().map(|step| step.format_for(wording));
            object.insert("next".to_owned(), json!(next));
        }
        Ok(object)
    }

    /// The comparison as text: figures of each drive, the regions of the error, and how it depends on the rates.
    pub fn text(&self, parameters: &str, style: TerminalStyle, wording: &dyn RemedyWording) -> String {
        let mut lines = vec![style.bold(&format!(
            "{} with {parameters} parameters on {}",
            self.model,
            self.files.join(", "),
        ))];
        let samples = count(self.figures.samples, "sample", "samples");
        lines.push(format!("  {samples}"));
        lines.push(String::new());
        lines.extend(tables::figures(&[("error", &self.figures)]));
        lines.push(String::new());
        lines.push(style.bold("Where the error is largest"));
        lines.extend(tables::places(&self.error_locations));
        let by_rate = tables::by_rate(&self.error_locations);
        if !by_rate.is_empty() {
            lines.push(String::new());
            lines.push(style.bold("How the residual depends on the velocity of its drive"));
            lines.extend(by_rate);
        }
        if let Some(step) = self.next_step() {
            lines.push(String::new());
            lines.push(step.format_for(wording));
        }
        lines.join("\n")
    }
}
