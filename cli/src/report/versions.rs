//! The model as it is and with what was found, each identified and run along all recordings.

use crate::along;
use crate::commands::identify::{self, Result as Identified};
use crate::data::Data;
use crate::diagnosis::Held;
use crate::estimators::{EstimatorArgs, Weights};
use crate::failure::Outcome;
use crate::model::Model;

/// A model along the recordings.
pub(crate) struct Version {
    /// The model.
    pub(crate) model: Model,
    /// How it was identified; `None` where all parameters are held.
    pub(crate) identified: Option<Identified>,
    /// The recordings of the fit, then those of the check.
    pub(crate) runs: Vec<Along>,
    /// The recordings themselves.
    pub(crate) data: Vec<Data>,
}

/// Forces along a recording, `[drive][sample]`.
pub(crate) struct Along {
    /// The recording's name.
    pub(crate) name: String,
    /// Whether it was kept for the check.
    pub(crate) is_check: bool,
    /// Times of the samples, s.
    pub(crate) time: Vec<f64>,
    /// Measured forces.
    pub(crate) measured: Vec<Vec<f64>>,
    /// The model's.
    pub(crate) forces: Vec<Vec<f64>>,
}

impl Along {
    /// What is measured and not said by the model.
    pub(crate) fn error(&self, drive: usize) -> Vec<f64> {
        let pairs = self.measured[drive].iter().zip(&self.forces[drive]);
        pairs.map(|(y, m)| y - m).collect()
    }
}

impl Version {
    /// Identifies a model from the recordings of the fit, as the diagnosis does: drives of different size count alike. With
    /// held parameters the nominal values are taken.
    pub(crate) fn new(model: Model, fit: Vec<Data>, check: Vec<Data>, held: Held) -> Outcome<Self> {
        let identified = match held {
            Held::All => None,
            Held::Known => {
                let estimators = EstimatorArgs {
                    weights: Weights::Channels,
                    ..EstimatorArgs::default()
                };
                Some(identify::identify(&model, &fit, &[], &check, &estimators)?)
            }
        };
        let values = match &identified {
            Some(result) => result.values(),
            None => model.nominal.clone(),
        };
        let n_fit = fit.len();
        let data: Vec<Data> = fit.into_iter().chain(check).collect();
        let mut runs = Vec::new();
        for (k, one) in data.iter().enumerate() {
            runs.push(Along {
                name: one.run.file.clone(),
                is_check: k >= n_fit,
                time: one.time(),
                measured: along::measured(one)?,
                forces: along::forces(&model, one, &values)?,
            });
        }
        Ok(Self {
            model,
            identified,
            runs,
            data,
        })
    }

    /// The recordings on which errors are judged: those of the check, or those of the fit if there are none.
    pub(crate) fn judged(&self) -> Vec<usize> {
        let has_check = self.runs.iter().any(|run| run.is_check);
        (0..self.runs.len())
            .filter(|k| self.runs[*k].is_check == has_check)
            .collect()
    }

    /// Errors of a drive over some recordings, one after the other.
    pub(crate) fn errors(&self, runs: &[usize], drive: usize) -> Vec<f64> {
        runs.iter()
            .flat_map(|k| self.runs[*k].error(drive))
            .collect()
    }
}
