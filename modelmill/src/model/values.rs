//! Values of base parameters: the file's nominal ones, or those of a fit.

use modelmill_identify::{FitFile, FitParameter, RecordingNote};
use nalgebra::DMatrix;

use crate::error::Outcome;
use crate::model::Model;

/// Values of the base parameters of a model, in its order, and what there is to know about them.
#[derive(Clone, Debug, PartialEq)]
pub struct BaseParameterValues {
    /// The values, in the units of the base parameters.
    pub values: Vec<f64>,
    /// Their covariance where a fit tells it; rows and columns of what the model file knows are zero.
    pub covariance: Option<DMatrix<f64>>,
    /// Remarks.
    pub notes: Vec<RecordingNote>,
}

impl Model {
    /// The nominal values; 0 stands for what the file does not give, and a note says so.
    pub fn nominal_values(&self) -> BaseParameterValues {
        let without: Vec<&str> = (0..self.base.len())
            .filter(|k| !self.has_nominal(*k))
            .map(|k| self.base[k].expression.as_str())
            .collect();
        let mut notes = Vec::new();
        if !without.is_empty() {
            notes.push(RecordingNote::warning(format!(
                "{} gives no nominal value for {}; 0 is taken",
                self.path,
                without.join(", ")
            )));
        }
        BaseParameterValues {
            values: self.nominal.clone(),
            covariance: None,
            notes,
        }
    }

    /// The values of a fit; `file` is what messages call it.
    ///
    /// Fails when the fit lacks a base parameter of this model.
    pub fn values_of(&self, fit: &FitFile, file: &str) -> Outcome<BaseParameterValues> {
        let names: Vec<(&str, &str)> = self
            .base
            .iter()
            .map(|base| (base.name.as_str(), base.expression.as_str()))
            .collect();
        let values = fit.values_for(&names, file)?;
        let constants = self.derivation.mechanism.constants.iter();
        let constants: Vec<(&str, f64)> = constants.map(|c| (c.name.as_str(), c.value)).collect();
        let others = fit.differing_constants(&constants, file)?;
        let notes = others.into_iter().map(|(name, then, now)| {
            RecordingNote::warning(format!(
                "{file} was made with {name} = {then}, but {} has {name} = {now}; identify again unless this is meant",
                self.path
            ))
        });
        Ok(BaseParameterValues {
            values,
            covariance: self.covariance_of(fit),
            notes: notes.collect(),
        })
    }

    /// The covariance of a fit's values in the order of the model; `None` where a deviation is not known.
    fn covariance_of(&self, fit: &FitFile) -> Option<DMatrix<f64>> {
        let unknown: Vec<usize> = (0..self.base.len())
            .filter(|k| !self.is_known(*k))
            .collect();
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
