//! `adopt`: writes a fit into a model file, so that every reader of the file uses its values.
//!
//! A fit of physical parameters (`identify --physical`) becomes values of the physical parameters of the bodies. Any
//! other fit becomes values of base parameters, which do not determine the parameters of single bodies.

use modelmill_identify::{FitFile, ParameterStatus, RecordingNote};
use modelmill_spec::LoadedModel;
use modelmill_spec::edit::{AdoptedValues, write_identified};

use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::text::table::count;

/// A model file with the values of a fit.
pub struct FitAdoption {
    /// Text of the file.
    pub text: String,
    /// The edited file, read and validated.
    pub loaded: LoadedModel,
    /// The values that were written.
    pub adopted: AdoptedValues,
    /// Notes on the values.
    pub notes: Vec<RecordingNote>,
}

impl Model {
    /// Writes the values of a fit into the text of the model's file, in place of those of an earlier fit; everything
    /// else stays as it is, byte for byte. `file` is only used as the name of the fit: in messages, and in a comment of
    /// the text.
    ///
    /// Fails if the fit belongs to another model.
    ///
    /// ```no_run
    /// use std::path::Path;
    /// use modelmill::{Host, Model};
    ///
    /// let model = Model::open("arm.toml")?;
    /// let fit = Host::new().fit(Path::new("fit.json"))?;
    /// let adopted = model.adopt(&fit, "fit.json")?;
    /// std::fs::write("arm.toml", adopted.text).unwrap();
    /// # Ok::<(), modelmill::Error>(())
    /// ```
    pub fn adopt(&self, fit: &FitFile, file: &str) -> Outcome<FitAdoption> {
        let values = self.values_of(fit, file)?;
        let mut notes = values.notes;
        let by_expression = self.derivation.base_parameters();
        let mut adopted = AdoptedValues {
            comment: format!(
                "From {file}: {} from {}.",
                count(fit.parameters.len(), "base parameter", "base parameters"),
                count(fit.samples, "sample", "samples")
            ),
            ..AdoptedValues::default()
        };
        // A fit without physical parameters writes base parameters; those known from the file alone are not
        // written.
        if fit.physical_parameters().is_empty() {
            let undetermined = fit.parameters.iter();
            let undetermined: Vec<&str> = undetermined
                .filter(|p| p.status == ParameterStatus::Undetermined)
                .map(|p| p.name.as_str())
                .collect();
            if !undetermined.is_empty() {
                notes.push(RecordingNote::warning(format!(
                    "{file} does not determine {}: the values assumed for them are written with the others.",
                    undetermined.join(", ")
                )));
            }
            // Base parameters are written by their expressions, which do not depend on their numbers.
            for (k, value) in values.values.iter().enumerate() {
                if !self.is_known(k) {
                    adopted.base.push((by_expression[k].expression.clone(), *value));
                }
            }
        } else {
            // Physical parameters must exist under the same names in this model.
            let known = &self.derivation.mechanism.parameters;
            for (name, value) in fit.physical_parameters() {
                if !known.iter().any(|parameter| parameter.name == name) {
                    return Err(Error::input(format!(
                        "{file}: the model has no parameter `{name}`; identify this model again"
                    )));
                }
                adopted.parameters.push((name, value));
            }
        }
        // Gains are no part of the base parameters of bodies. An assumed gain is written only if the file has no value.
        let parameters = &self.loaded.mechanism.parameters;
        let has_nominal = |name: &str| parameters.iter().any(|one| one.name == name && one.has_nominal);
        let gains = fit
            .gains
            .iter()
            .filter(|gain| gain.std.is_some() || !has_nominal(&gain.name));
        adopted
            .parameters
            .extend(gains.map(|gain| (gain.name.clone(), gain.value)));
        let delays = fit
            .delays
            .iter()
            .map(|delay| (delay.drive.clone(), delay.value.max(0.0)));
        adopted.delays = delays.collect();
        let text =
            write_identified(self.text(), &adopted).map_err(|says| Error::input(format!("{}: {says}", self.path)))?;
        // The edited text is read again, so that an invalid edit cannot be returned.
        let loaded = self.host().load_text(self.path.as_ref(), &text)?;
        Ok(FitAdoption {
            text,
            loaded,
            adopted,
            notes,
        })
    }
}
