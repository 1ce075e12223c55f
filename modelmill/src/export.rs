//! `export`: a model as a robot description of other programs.

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, Remedy};
use modelmill_identify::{FitFile, RecordingNote};
use modelmill_spec::LoadedModel;

pub use modelmill_reduction::ExportFormat as Format;

use crate::error::{Error, Outcome};
use crate::model::Model;

/// A robot description that was made of a model.
#[derive(Clone, Debug, PartialEq)]
pub struct ExportedRobot {
    /// Its text.
    pub text: String,
    /// What the format does not say, and what no body can be.
    pub notes: Vec<RecordingNote>,
}

/// Writes a model file that was read from `path` with its nominal values as a URDF or MJCF. Nothing is derived for it.
///
/// Fails when the format does not know how a joint or a lumped mass of the model is.
pub fn description(path: &str, loaded: &LoadedModel, format: Format) -> Outcome<ExportedRobot> {
    let exported = modelmill_reduction::export(&loaded.mechanism, format)
        .map_err(|error| Error::input(format!("{path}: {error}")))?;
    Ok(ExportedRobot {
        text: exported.text,
        notes: exported
            .remarks
            .into_iter()
            .map(RecordingNote::warning)
            .collect(),
    })
}

impl Model {
    /// Writes the model with its nominal values, or with the physical parameters of a fit, as a URDF or MJCF. `fit` comes with
    /// what messages call it.
    ///
    /// Fails when a fit has base parameters only, since these say nothing of single bodies, and as [`description`] does.
    pub fn export(&self, format: Format, fit: Option<(&FitFile, &str)>) -> Outcome<ExportedRobot> {
        let Some((fit, file)) = fit else {
            return description(&self.path, &self.loaded, format);
        };
        if fit.physical_parameters().is_empty() {
            return Err(Error::input(message!(
                "{file} has base parameters only, and simulators need ten numbers of every body; identify with {}",
                Remedy::option(OptionName::Physical)
            )));
        }
        let adopted = self.adopt(fit, file)?;
        let mut exported = description(&self.path, &adopted.loaded, format)?;
        exported.notes.splice(0..0, adopted.notes);
        Ok(exported)
    }
}
