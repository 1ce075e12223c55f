//! States of a run at some samples, as the evaluator of a model reads them, and the motion of the drives there.

use modelmill_codegen::{ModelEvaluator, MotionStates};
use modelmill_identify::PreparedRun;

use crate::model::Model;

/// Positions, rates, accelerations and loads at some samples, `[coordinate or drive][sample]`, SI units.
pub(crate) struct PickedStates {
    /// Positions.
    q: Vec<Vec<f64>>,
    /// Rates.
    pub(crate) qd: Vec<Vec<f64>>,
    /// Accelerations.
    pub(crate) qdd: Vec<Vec<f64>>,
    /// Measured forces.
    load: Vec<Vec<f64>>,
}

impl PickedStates {
    /// The states of a run at given samples.
    pub(crate) fn new(run: &PreparedRun, samples: &[usize]) -> Self {
        let pick = |columns: &[Vec<f64>]| -> Vec<Vec<f64>> {
            let pick = |column: &Vec<f64>| samples.iter().map(|k| column[*k]).collect();
            columns.iter().map(pick).collect()
        };
        Self {
            q: pick(&run.q),
            qd: pick(&run.qd),
            qdd: pick(&run.qdd),
            load: pick(run.force.as_deref().unwrap_or(&[])),
        }
    }

    /// The same states with all rates multiplied by a factor.
    pub(crate) fn with_scaled_rates(mut self, factor: f64) -> Self {
        for rate in self.qd.iter_mut().flatten() {
            *rate *= factor;
        }
        self
    }

    /// The states as the evaluator reads them.
    pub(crate) fn as_motion(&self) -> MotionStates<'_> {
        MotionStates {
            q: self.q.iter().map(Vec::as_slice).collect(),
            qd: self.qd.iter().map(Vec::as_slice).collect(),
            qdd: self.qdd.iter().map(Vec::as_slice).collect(),
            load: self.load.iter().map(Vec::as_slice).collect(),
        }
    }

    /// Positions and rates of the drives, `[order][drive][sample]`, rad or m, per s; `None` at a pose without solution.
    pub(crate) fn drive_motion(&self, model: &Model) -> Option<[Vec<Vec<f64>>; 2]> {
        let n = model.row_names().len();
        // Positions come first, rates behind them, the Jacobian last.
        let mut positions = ModelEvaluator::new(&model.derivation)
            .drive_motion(&self.as_motion())
            .ok()?;
        positions.truncate(2 * n);
        (positions.len() == 2 * n).then(|| {
            let rates = positions.split_off(n);
            [positions, rates]
        })
    }
}

/// The sign of a rate; zero at exact standstill, where dry friction has no direction.
pub(crate) fn rate_sign(rate: f64) -> f64 {
    if rate == 0.0 { 0.0 } else { rate.signum() }
}
