//! Values of base parameters: nominal values of the file, or those of a fit.

use modelmill_identify::{FitFile, FitParameter, RecordingNote};
use nalgebra::DMatrix;

use crate::error::Outcome;
use crate::model::Model;

/// Values of the base parameters of a model, in its order, with notes on them.
#[derive(Clone, Debug, PartialEq)]
pub struct BaseParameterValues {
    /// The values, in the units of the base parameters.
    pub values: Vec<f64>,
    /// Their covariance, if a fit has it; rows and columns of parameters known from the file are zero.
    pub covariance: Option<DMatrix<f64>>,
    /// Values of gains of actuators by name, if a fit has any.
    pub gains: Vec<(String, f64)>,
    /// Notes on the values.
    pub notes: Vec<RecordingNote>,
}

impl Model {
    /// The values that the model uses (identified or nominal), with their covariance if they come from a fit that has
    /// one. Base parameters for which the file gives no value are 0, which a note states.
    pub fn base_parameter_values(&self) -> BaseParameterValues {
        let without: Vec<&str> = (0..self.base.len())
            .filter(|k| !self.has_values(*k))
            .map(|k| self.base[k].expression.as_str())
            .collect();
        let mut notes = Vec::new();
        if !without.is_empty() {
            notes.push(RecordingNote::warning(format!(
                "{} gives no nominal value for {}; 0 is used",
                self.path,
                without.join(", ")
            )));
        }
        BaseParameterValues {
            values: self.values.clone(),
            covariance: self.covariance.as_deref().cloned(),
            gains: Vec::new(),
            notes,
        }
    }

    /// The values of a fit. `file` is only used in messages, as the name of the fit.
    ///
    /// Fails when the fit lacks a base parameter of this model, or was made with other equations.
    pub fn values_of(&self, fit: &FitFile, file: &str) -> Outcome<BaseParameterValues> {
        let names: Vec<(&str, &str)> = self
            .base
            .iter()
            .map(|base| (base.name.as_str(), base.expression.as_str()))
            .collect();
        // Parameters are matched by name, and their expressions must be equal.
        let values = fit.values_for(&names, file)?;
        let constants = self.derivation.mechanism.constants.iter();
        let constants: Vec<(&str, f64)> = constants.map(|c| (c.name.as_str(), c.value)).collect();
        // Other constants of geometry change the meaning of base parameters, but not their number.
        let others = fit.differing_constants(&constants, file)?;
        // With other constants the forces differ too, which the notes state.
        if others.is_empty() {
            self.check_equations(fit, file)?;
        }
        let notes = others.into_iter().map(|(name, then, now)| {
            RecordingNote::warning(format!(
                "{file} was made with {name} = {then}, but {} has {name} = {now}; identify again unless this is intended",
                self.path
            ))
        });
        Ok(BaseParameterValues {
            values,
            covariance: self.covariance_of(fit),
            gains: fit.gains.iter().map(|gain| (gain.name.clone(), gain.value)).collect(),
            notes: notes.collect(),
        })
    }

    /// The covariance of a fit's values in the order of the model; `None` if a standard deviation is unknown.
    fn covariance_of(&self, fit: &FitFile) -> Option<DMatrix<f64>> {
        let unknown: Vec<usize> = (0..self.base.len()).filter(|k| !self.is_known(*k)).collect();
        // The fit may list its parameters in another order.
        let place = |k: &usize| {
            let named = |one: &FitParameter| one.name == self.base[*k].name;
            fit.parameters.iter().position(named)
        };
        let places: Vec<usize> = unknown.iter().map(place).collect::<Option<_>>()?;
        let (found, _) = fit.covariance_of(&places)?;
        let mut covariance = DMatrix::zeros(self.base.len(), self.base.len());
        for (i, a) in unknown.iter().enumerate() {
            for (j, b) in unknown.iter().enumerate() {
                covariance[(*a, *b)] = found[(i, j)];
            }
        }
        Some(covariance)
    }
}
