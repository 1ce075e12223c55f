//! The model as it is and with what was found, each identified and run along all recordings.

use crate::along;
use crate::diagnose::FixedParameters;
use crate::error::Outcome;
use crate::identify::{self, Identification};
use crate::identify::{EquationWeights, EstimatorOptions};
use crate::model::Model;
use crate::stretch::RecordingSegment;

/// A model along the recordings.
pub struct ModelVersion {
    /// The model.
    pub model: Model,
    /// How it was identified; `None` where all parameters are held.
    pub identified: Option<Identification>,
    /// The recordings of the fit, then those of the check.
    pub runs: Vec<ForceComparison>,
    /// The recordings themselves.
    pub data: Vec<RecordingSegment>,
}

/// Forces along a recording, `[drive][sample]`.
pub struct ForceComparison {
    /// The recording's name.
    pub name: String,
    /// Whether it was kept for the check.
    pub is_check: bool,
    /// Times of the samples, s.
    pub time: Vec<f64>,
    /// Measured forces.
    pub measured: Vec<Vec<f64>>,
    /// The model's.
    pub forces: Vec<Vec<f64>>,
}

impl ForceComparison {
    /// What is measured and not said by the model.
    pub fn error(&self, drive: usize) -> Vec<f64> {
        let pairs = self.measured[drive].iter().zip(&self.forces[drive]);
        pairs.map(|(y, m)| y - m).collect()
    }
}

impl ModelVersion {
    /// Identifies a model from the recordings of the fit, as the diagnosis does: drives of different size count alike. With
    /// held parameters the nominal values are taken.
    pub fn new(
        model: Model,
        fit: Vec<RecordingSegment>,
        check: Vec<RecordingSegment>,
        held: FixedParameters,
    ) -> Outcome<Self> {
        let identified = match held {
            FixedParameters::All => None,
            FixedParameters::Known => {
                let estimators = EstimatorOptions {
                    weights: EquationWeights::Channels,
                    ..EstimatorOptions::default()
                };
                Some(identify::identify(&model, &fit, &[], &check, &estimators)?)
            }
        };
        let values = match &identified {
            Some(result) => result.values(),
            None => model.nominal.clone(),
        };
        let n_fit = fit.len();
        let data: Vec<RecordingSegment> = fit.into_iter().chain(check).collect();
        let mut runs = Vec::new();
        for (k, one) in data.iter().enumerate() {
            runs.push(ForceComparison {
                name: one.run.file.clone(),
                is_check: k >= n_fit,
                time: one.time(),
                measured: along::measured_forces(one)?,
                forces: along::filter_and_decimate(along::forces(&model, one, &values)?, one)?,
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
    pub fn validation_runs(&self) -> Vec<usize> {
        let has_check = self.runs.iter().any(|run| run.is_check);
        (0..self.runs.len())
            .filter(|k| self.runs[*k].is_check == has_check)
            .collect()
    }

    /// Errors of a drive over some recordings, one after the other.
    pub fn errors(&self, runs: &[usize], drive: usize) -> Vec<f64> {
        runs.iter()
            .flat_map(|k| self.runs[*k].error(drive))
            .collect()
    }
}
