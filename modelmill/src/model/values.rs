//! Values of base parameters: the file's nominal ones, or those of a fit.

use modelmill_identify::{FitFile, Note};

use crate::error::Outcome;
use crate::model::Model;

/// Values of the base parameters of a model, in its order, and what there is to know about them.
#[derive(Clone, Debug, PartialEq)]
pub struct Values {
    /// The values, in the units of the base parameters.
    pub values: Vec<f64>,
    /// Remarks.
    pub notes: Vec<Note>,
}

impl Model {
    /// The nominal values; 0 stands for what the file does not give, and a note says so.
    pub fn nominal_values(&self) -> Values {
        let without: Vec<&str> = (0..self.base.len())
            .filter(|k| !self.has_nominal(*k))
            .map(|k| self.base[k].expression.as_str())
            .collect();
        let mut notes = Vec::new();
        if !without.is_empty() {
            notes.push(Note::warning(format!(
                "{} gives no nominal value for {}; 0 is taken",
                self.path,
                without.join(", ")
            )));
        }
        Values {
            values: self.nominal.clone(),
            notes,
        }
    }

    /// The values of a fit; `file` is what messages call it.
    ///
    /// Fails when the fit lacks a base parameter of this model.
    pub fn values_of(&self, fit: &FitFile, file: &str) -> Outcome<Values> {
        let names: Vec<(&str, &str)> = self
            .base
            .iter()
            .map(|base| (base.name.as_str(), base.expression.as_str()))
            .collect();
        let values = fit.values_for(&names, file)?;
        let constants = self.derivation.mechanism.constants.iter();
        let constants: Vec<(&str, f64)> = constants.map(|c| (c.name.as_str(), c.value)).collect();
        let others = fit.other_constants(&constants, file)?;
        let notes = others.into_iter().map(|(name, then, now)| {
            Note::warning(format!(
                "{file} was made with {name} = {then}, but {} has {name} = {now}; identify again unless this is meant",
                self.path
            ))
        });
        Ok(Values {
            values,
            notes: notes.collect(),
        })
    }
}
