//! `export`: a model as a robot description of other programs.

use modelmill_identify::{FitFile, Note};

pub use modelmill_reduction::ExportFormat as Format;

use crate::error::{Error, Outcome};
use crate::model::Model;

/// A robot description that was made of a model.
#[derive(Clone, Debug, PartialEq)]
pub struct Exported {
    /// Its text.
    pub text: String,
    /// What the format does not say, and what no body can be.
    pub notes: Vec<Note>,
}

impl Model {
    /// Writes the model with its nominal values, or with the physical parameters of a fit, as a URDF or MJCF. `file` is what
    /// messages call the fit.
    ///
    /// Fails when a fit has base parameters only, since these say nothing of single bodies, and when the format does not know
    /// how a joint or a lumped mass of the model is.
    pub fn export(&self, format: Format, fit: Option<(&FitFile, &str)>) -> Outcome<Exported> {
        let adopted = match fit {
            Some((fit, file)) if fit.physical().is_empty() => {
                return Err(Error::input(format!(
                    "{file} has base parameters only, and simulators need ten numbers of every body; identify with option `physical`"
                )));
            }
            Some((fit, file)) => Some(self.adopt(fit, file)?),
            None => None,
        };
        let mechanism = match &adopted {
            Some(adopted) => &adopted.loaded.mechanism,
            None => &self.loaded.mechanism,
        };
        let exported = modelmill_reduction::export(mechanism, format)
            .map_err(|error| Error::input(format!("{}: {error}", self.path)))?;
        let mut notes = adopted.map_or_else(Vec::new, |adopted| adopted.notes);
        notes.extend(exported.remarks.into_iter().map(Note::warning));
        Ok(Exported {
            text: exported.text,
            notes,
        })
    }
}
