//! `export`: writes a model as a robot description (URDF or MJCF).

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, Remedy};
use modelmill_identify::{FitFile, FitParameter, ParameterStatus, RecordingNote};
use modelmill_spec::LoadedModel;

pub use modelmill_reduction::ExportFormat as Format;

use crate::error::{Error, Outcome};
use crate::model::Model;

/// A robot description written from a model.
#[derive(Clone, Debug, PartialEq)]
pub struct ExportedRobot {
    /// Its text.
    pub text: String,
    /// What the format cannot express, and inertias that no body can have.
    pub notes: Vec<RecordingNote>,
}

/// Writes a model file that was read from `path` with its nominal values as a URDF or MJCF. The model is not derived.
///
/// Fails when the format cannot express a joint or a lumped mass of the model.
pub fn description(path: &str, loaded: &LoadedModel, format: Format) -> Outcome<ExportedRobot> {
    let exported = modelmill_reduction::export(&loaded.mechanism, format)
        .map_err(|error| Error::input(format!("{path}: {error}")))?;
    Ok(ExportedRobot {
        text: exported.text,
        notes: exported.remarks.into_iter().map(RecordingNote::warning).collect(),
    })
}

impl Model {
    /// Writes the model as a URDF or MJCF, with its nominal values or with those of a fit: its physical parameters, or base
    /// parameters and gains if each base parameter is a single parameter. The text in `fit` is only used in messages, as
    /// the name of the fit.
    ///
    /// Fails when a fit has sums of parameters only, since these do not determine single bodies; also in all cases in
    /// which [`description`] fails.
    pub fn export(&self, format: Format, fit: Option<(&FitFile, &str)>) -> Outcome<ExportedRobot> {
        let Some((fit, file)) = fit else {
            return description(&self.path, &self.loaded, format);
        };
        if fit.physical_parameters().is_empty() && !self.determines_parameters(fit) {
            return Err(Error::input(message!(
                "{file} has sums of parameters, and simulators need ten parameters of every body; identify with {}, or let the \
                 bodies be known numbers (import with {}) and identify the rest",
                Remedy::option(OptionName::Physical),
                Remedy::option(OptionName::KnownBodies)
            )));
        }
        // The fit is written into the model file first, so that the export uses one source of values.
        let adopted = self.adopt(fit, file)?;
        let mut exported = description(&self.path, &adopted.loaded, format)?;
        exported.notes.splice(0..0, adopted.notes);
        Ok(exported)
    }

    /// Whether each value of a fit is that of a parameter of an effect or of a number of the file.
    fn determines_parameters(&self, fit: &FitFile) -> bool {
        let mechanism = &self.derivation.mechanism;
        let is_single = |one: &FitParameter| mechanism.effect_parameter(&one.expression).is_some();
        let mut all = fit.parameters.iter();
        all.all(|one| one.status == ParameterStatus::Known || is_single(one))
    }
}
