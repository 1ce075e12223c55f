//! `adopt`: a fit goes into a model file, so that whoever reads the file has its values.
//!
//! A fit of physical parameters (`identify --physical`) becomes values of parameters, which bodies can have; any other one
//! becomes values of base parameters, which say nothing of single bodies.

use modelmill_identify::{FitFile, Note, Status};
use modelmill_spec::Loaded;
use modelmill_spec::edit::{Adopted, adopt};

use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::text::table::count;

/// A model file with the values of a fit.
pub struct Adoption {
    /// Its text.
    pub text: String,
    /// What it means now.
    pub loaded: Loaded,
    /// What was written.
    pub adopted: Adopted,
    /// What there is to know about the values.
    pub notes: Vec<Note>,
}

impl Model {
    /// Writes the values of a fit into the text of the model's file, in the place of those of an earlier one; everything
    /// else stays as it is, byte for byte. `file` is what messages call the fit.
    ///
    /// Fails when the fit is one of another model.
    pub fn adopt(&self, fit: &FitFile, file: &str) -> Outcome<Adoption> {
        let values = self.values_of(fit, file)?;
        let mut notes = values.notes;
        let by_expression = self.derivation.base_parameters();
        let mut adopted = Adopted {
            comment: format!(
                "From {file}: {} from {}.",
                count(fit.parameters.len(), "base parameter", "base parameters"),
                count(fit.samples, "sample", "samples")
            ),
            ..Adopted::default()
        };
        if fit.physical().is_empty() {
            let undetermined = fit.parameters.iter();
            let undetermined: Vec<&str> = undetermined
                .filter(|p| p.status == Status::Undetermined)
                .map(|p| p.name.as_str())
                .collect();
            if !undetermined.is_empty() {
                notes.push(Note::warning(format!(
                    "{file} does not determine {}: the values that it took for them are written with the others.",
                    undetermined.join(", ")
                )));
            }
            for (k, value) in values.values.iter().enumerate() {
                if !self.is_known(k) {
                    adopted
                        .base
                        .push((by_expression[k].expression.clone(), *value));
                }
            }
        } else {
            let known = &self.derivation.mechanism.parameters;
            for (name, value) in fit.physical() {
                if !known.iter().any(|parameter| parameter.name == name) {
                    return Err(Error::input(format!(
                        "{file}: the model has no parameter `{name}`; identify this model again"
                    )));
                }
                adopted.parameters.push((name, value));
            }
        }
        let text = adopt(self.text(), &adopted)
            .map_err(|says| Error::input(format!("{}: {says}", self.path)))?;
        let loaded = self.host().load_text(self.path.as_ref(), &text)?;
        Ok(Adoption {
            text,
            loaded,
            adopted,
            notes,
        })
    }
}
