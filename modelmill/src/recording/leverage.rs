//! Force peaks that the mechanism itself causes: near singular poses its drives have little leverage.

use modelmill_codegen::{ModelEvaluator, MotionStates};
use modelmill_identify::SignalRecording as Raw;

use super::thresholds::LEVERAGE_PEAK_RATIO;
use crate::model::Model;

/// Number of samples to either side with which a pose is compared.
const BESIDE: usize = 10;

/// The drives of a mechanism with loops along the positions of a recording, before preparation.
pub(super) struct DriveLeverage<'a> {
    /// The model, whose regressor gives the demand.
    model: &'a Model,
    /// Positions, `[coordinate][sample]`; `None` for open chains and if a column is missing.
    q: Option<Vec<Vec<f64>>>,
}

impl<'a> DriveLeverage<'a> {
    /// Reads the positions of a mechanism with loops.
    pub(super) fn new(model: &'a Model, raw: &Raw) -> Self {
        let columns = || -> Option<Vec<Vec<f64>>> {
            let of = |name: String| raw.column(&name).ok().map(<[f64]>::to_vec);
            model.active_coordinates().into_iter().map(of).collect()
        };
        let has_loops = !model.derivation.mechanism.loops.is_empty();
        Self {
            model,
            q: if has_loops { columns() } else { None },
        }
    }

    /// Whether a drive needs far more force at a sample than around it for equal accelerations of all coordinates.
    pub(super) fn is_peak(&self, drive: usize, sample: usize) -> bool {
        let Some(samples) = self.q.as_ref().and_then(|q| q.first()).map(Vec::len) else {
            return false;
        };
        let from = sample.saturating_sub(BESIDE);
        let until = (sample + BESIDE + 1).min(samples);
        // A pose without a solution is singular.
        let Some(here) = self.force_demand(drive, sample) else {
            return true;
        };
        // The comparison uses the two ends of the range around the sample.
        let around = [from, until - 1].map(|i| self.force_demand(drive, i));
        let least = around.into_iter().flatten().fold(f64::INFINITY, f64::min);
        here > LEVERAGE_PEAK_RATIO * least
    }

    /// The norm of a drive's row of H if all coordinates accelerate by one from standstill; `None` at singular poses.
    fn force_demand(&self, drive: usize, sample: usize) -> Option<f64> {
        let q: Vec<[f64; 1]> = self.q.iter().flatten().map(|q| [q[sample]]).collect();
        let (still, one) = (vec![[0.0]; q.len()], vec![[1.0]; q.len()]);
        let load = vec![[0.0]; self.model.row_names().len()];
        let states = MotionStates {
            q: slices(&q),
            qd: slices(&still),
            qdd: slices(&one),
            load: slices(&load),
        };
        let rows = ModelEvaluator::new(&self.model.derivation).regressor(&states).ok()?;
        let size = rows.row(drive).norm();
        size.is_finite().then_some(size)
    }
}

/// One value of each column, as slices.
fn slices(columns: &[[f64; 1]]) -> Vec<&[f64]> {
    columns.iter().map(<[f64; 1]>::as_slice).collect()
}
