//! The models without and with the effects found, each identified and evaluated along all recordings.

use crate::along;
use crate::diagnose::FixedParameters;
use crate::error::Outcome;
use crate::identify::{self, Identification};
use crate::identify::{EquationWeights, EstimatorOptions};
use crate::model::Model;
use crate::segment::RecordingSegment;

/// A model with its forces along all recordings.
pub struct ModelVersion {
    /// The model.
    pub model: Model,
    /// Result of the identification; `None` if all parameters are fixed.
    pub identified: Option<Identification>,
    /// Forces along the fitted recordings, then along the validation runs.
    pub runs: Vec<ForceComparison>,
    /// The segments of the recordings, in the order of `runs`.
    pub data: Vec<RecordingSegment>,
}

/// Measured and calculated forces along a segment of a recording, `[drive][sample]`.
pub struct ForceComparison {
    /// The recording's name.
    pub name: String,
    /// Whether it is a validation run.
    pub is_check: bool,
    /// Times of the samples, s.
    pub time: Vec<f64>,
    /// Measured forces, N or N m.
    pub measured: Vec<Vec<f64>>,
    /// Forces of the model, N or N m.
    pub forces: Vec<Vec<f64>>,
}

impl ForceComparison {
    /// Measured minus calculated force of a drive, N or N m.
    pub fn error(&self, drive: usize) -> Vec<f64> {
        let pairs = self.measured[drive].iter().zip(&self.forces[drive]);
        pairs.map(|(y, m)| y - m).collect()
    }
}

impl ModelVersion {
    /// Identifies a model from the recordings `fit`, with each drive weighted by the standard deviation of its
    /// residual, as in the diagnosis. If all parameters are fixed, the nominal values are used.
    ///
    /// Fails when the identification fails, or when a pose has no solution.
    pub fn new(
        model: Model,
        fit: Vec<RecordingSegment>,
        check: Vec<RecordingSegment>,
        held: FixedParameters,
    ) -> Outcome<Self> {
        // Fixed parameters leave nothing to identify.
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
        // Base parameters of the fit, or nominal ones.
        let values = match &identified {
            Some(result) => result.values(),
            None => model.values.clone(),
        };
        // Fitted recordings come first, so the index shows which are validation runs.
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

    /// Indices in `runs` of the recordings on which errors are evaluated: the validation runs, or the fitted recordings
    /// if there are none.
    pub fn validation_runs(&self) -> Vec<usize> {
        let has_check = self.runs.iter().any(|run| run.is_check);
        (0..self.runs.len())
            .filter(|k| self.runs[*k].is_check == has_check)
            .collect()
    }

    /// Errors of a drive over some recordings, one after the other.
    pub fn errors(&self, runs: &[usize], drive: usize) -> Vec<f64> {
        runs.iter().flat_map(|k| self.runs[*k].error(drive)).collect()
    }
}
