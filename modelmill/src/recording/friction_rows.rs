//! Rows of the model's regressor with friction and an offset of every drive added, as the preparation needs them: a
//! choice must not depend on whether the model file knows friction. States go in; rows come out.

use modelmill_codegen::{ModelEvaluator, MotionStates};
use modelmill_identify::PreparedRun;
use nalgebra::{DMatrix, DVector};

use crate::model::Model;

/// Columns that are added for each drive: rate, its sign, and a constant.
pub(super) const FRICTION_COLUMNS: usize = 3;

/// Positions, rates, accelerations and loads at some samples, `[coordinate or drive][sample]`, SI units.
pub(super) struct PickedStates {
    /// Positions.
    q: Vec<Vec<f64>>,
    /// Rates.
    qd: Vec<Vec<f64>>,
    /// Accelerations.
    qdd: Vec<Vec<f64>>,
    /// Measured forces.
    load: Vec<Vec<f64>>,
}

impl PickedStates {
    /// The states of a run at given samples.
    pub(super) fn new(run: &PreparedRun, samples: &[usize]) -> Self {
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
    pub(super) fn with_scaled_rates(mut self, factor: f64) -> Self {
        for rate in self.qd.iter_mut().flatten() {
            *rate *= factor;
        }
        self
    }

    /// The states as the evaluator reads them.
    fn as_motion(&self) -> MotionStates<'_> {
        MotionStates {
            q: self.q.iter().map(Vec::as_slice).collect(),
            qd: self.qd.iter().map(Vec::as_slice).collect(),
            qdd: self.qdd.iter().map(Vec::as_slice).collect(),
            load: self.load.iter().map(Vec::as_slice).collect(),
        }
    }
}

/// Rates of the drives at some states, `[drive][sample]`, rad/s or m/s; `None` at a pose without solution.
pub(super) fn rates_of_drives(model: &Model, states: &PickedStates) -> Option<Vec<Vec<f64>>> {
    let evaluator = ModelEvaluator::new(&model.derivation);
    let n = model.drives().len();
    // Columns are ordered: positions, rates, Jacobian.
    let motion = evaluator.drive_motion(&states.as_motion()).ok()?;
    Some(motion.get(n..2 * n)?.to_vec())
}

/// The model's regressor with friction and an offset of every drive added; row `sample * n_drives + drive`. `None` at a
/// pose without solution, or if a number is not finite.
pub(super) fn regressor_with_friction(model: &Model, states: &PickedStates) -> Option<DMatrix<f64>> {
    let evaluator = ModelEvaluator::new(&model.derivation);
    let regressor = evaluator.regressor(&states.as_motion()).ok()?;
    let rates = rates_of_drives(model, states)?;
    let n = rates.len();
    let width = regressor.ncols();
    let mut more = regressor.resize_horizontally(width + FRICTION_COLUMNS * n, 0.0);
    for (d, rate) in rates.iter().enumerate() {
        for (i, rate) in rate.iter().enumerate() {
            for (k, value) in [*rate, sign(*rate), 1.0].into_iter().enumerate() {
                more[(i * n + d, width + FRICTION_COLUMNS * d + k)] = value;
            }
        }
    }
    more.iter().all(|x| x.is_finite()).then_some(more)
}

/// The sign of a rate; zero at exact standstill, where dry friction has no direction.
pub(super) fn sign(rate: f64) -> f64 {
    if rate == 0.0 { 0.0 } else { rate.signum() }
}

/// Solves scaled normal equations with a small ridge, since columns may be equal. Only the lower triangle is read.
pub(super) fn solve_scaled(normal: &DMatrix<f64>, right: &DVector<f64>) -> Option<DVector<f64>> {
    let mut normal = symmetric(normal);
    let n = right.len();
    let scale: Vec<f64> = (0..n)
        .map(|i| normal[(i, i)].max(0.0).sqrt())
        .map(|norm| if norm > 0.0 { norm.recip() } else { 0.0 })
        .collect();
    for i in 0..n {
        for j in 0..n {
            normal[(i, j)] *= scale[i] * scale[j];
        }
        normal[(i, i)] += 1e-9;
    }
    let scale = DVector::from_vec(scale);
    let scaled = right.component_mul(&scale);
    Some(normal.cholesky()?.solve(&scaled).component_mul(&scale))
}

/// The symmetric matrix of a lower triangle.
pub(super) fn symmetric(lower: &DMatrix<f64>) -> DMatrix<f64> {
    let mut whole = lower.clone();
    whole.fill_upper_triangle_with_lower_triangle();
    whole
}
