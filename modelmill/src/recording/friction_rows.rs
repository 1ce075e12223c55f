//! Rows of the model's regressor with friction and an offset of every drive added, as the preparation needs them: a
//! choice must not depend on whether the model file knows friction. States go in; rows come out.

use modelmill_codegen::ModelEvaluator;
use modelmill_identify::ScaledNormalEquations;
use nalgebra::{DMatrix, DVector};

use crate::model::Model;
use crate::segment::picked_states::{PickedStates, rate_sign};

/// Ridge on the diagonal of scaled normal equations.
const RIDGE: f64 = 1e-9;
/// Columns that are added for each drive: rate, its sign, and a constant.
pub(super) const FRICTION_COLUMNS: usize = 3;

/// Rates of the drives at some states, `[drive][sample]`, rad/s or m/s; `None` at a pose without solution.
pub(super) fn rates_of_drives(model: &Model, states: &PickedStates) -> Option<Vec<Vec<f64>>> {
    states.drive_motion(model).map(|[_, rates]| rates)
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
            for (k, value) in [*rate, rate_sign(*rate), 1.0].into_iter().enumerate() {
                more[(i * n + d, width + FRICTION_COLUMNS * d + k)] = value;
            }
        }
    }
    more.iter().all(|x| x.is_finite()).then_some(more)
}

/// Solves scaled normal equations with a small ridge, since columns may be equal.
pub(super) fn solve_scaled(normal: DMatrix<f64>, right: &DVector<f64>) -> Option<DVector<f64>> {
    Some(ScaledNormalEquations::new(normal, RIDGE)?.solve(right))
}
