//! Result of an identification, as JSON for scripts and as text for people: base parameters with standard
//! deviations, errors and the next step.

use modelmill_identify::ParameterStatus;
use serde_json::{Value, json};

use crate::error::{Error, Outcome};
use crate::identify::Identification;
use crate::model::Model;
use crate::print::{RemedyWording, estimation, notes, tables};
use crate::text::TerminalStyle;
use crate::text::table::{count, significant};

impl Identification {
    /// The fit with all figures as one JSON object, from which [`modelmill_identify::FitFile`] is read again.
    ///
    /// Fails when the fit cannot be written as JSON.
    pub fn json(&self, model: &Model, wording: &dyn RemedyWording) -> Outcome<Value> {
        let value = serde_json::to_value(&self.fit);
        let mut value = value.map_err(|error| Error::input(error.to_string()))?;
        if let Some(object) = value.as_object_mut() {
            // Notes contain remedies, which are written for the reader.
            if let Some(data) = object.get_mut("data") {
                *data = notes(&self.fit.data, wording);
            }
            object.insert(
                "nominal".to_owned(),
                json!({ "fit": self.nominal_fit, "check": self.nominal_check }),
            );
            // Figures of the estimator belong to this output only; a fit file is read without them.
            object.insert(
                "estimator".to_owned(),
                estimation::json(model, &self.found, &self.options),
            );
            object.insert("by_rate".to_owned(), json!(self.by_rate));
            object.insert("next".to_owned(), json!(self.next_step().format_for(wording)));
            // Periods exist for periodic recordings only.
            if !self.repeats.is_empty() {
                let repeats = self
                    .repeats
                    .iter()
                    .map(|(file, repeats)| (file.clone(), json!(repeats)));
                let repeats: serde_json::Map<String, Value> = repeats.collect();
                object.insert("repeats".to_owned(), json!(repeats));
            }
        }
        Ok(value)
    }

    /// The result as text: parameters, quality of the estimate, errors, and the next step.
    pub fn text(&self, model: &Model, style: TerminalStyle, wording: &dyn RemedyWording) -> String {
        let fit = &self.fit;
        let estimator = estimation::text(model, &self.found, &model.parameter_infos());
        // Parameters known from the file are not counted as identified.
        let identified = fit.parameters.iter().filter(|p| p.status != ParameterStatus::Known);
        let identified = identified.count();
        let mut lines = vec![style.bold(&format!(
            "{}: {} from {}",
            fit.model,
            count(identified, "base parameter", "base parameters"),
            count(fit.samples, "sample", "samples")
        ))];
        lines.extend(tables::expressions(2, model));
        lines.push(String::new());
        lines.extend(tables::parameters(&fit.parameters));
        lines.push(String::new());
        // The condition number shows whether the motion excites all parameters.
        lines.push(format!(
            "  condition number along the recordings {} ({} after scaling the columns to equal norm; below 100 is good)",
            fit.condition_number
                .map_or_else(|| "infinite".to_owned(), |value| significant(value, 4)),
            fit.scaled_condition_number
                .map_or_else(|| "infinite".to_owned(), |value| significant(value, 3)),
        ));
        lines.extend(estimator.iter().map(|line| format!("  {line}")));
        lines.push(String::new());
        lines.push(style.bold("Error"));
        // Errors with nominal values mean nothing if the file has none.
        let mut figures = Vec::new();
        if self.has_nominal {
            figures.push(("fit, nominal", &self.nominal_fit));
        }
        figures.push(("fit, identified", &fit.fit));
        if let (Some(check), Some(nominal)) = (&fit.check, &self.nominal_check) {
            if self.has_nominal {
                figures.push(("validation, nominal", nominal));
            }
            figures.push(("validation, identified", check));
        }
        lines.extend(tables::figures(&figures));
        lines.push(String::new());
        lines.push(self.next_step().format_for(wording));
        lines.join("\n")
    }
}
