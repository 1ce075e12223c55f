//! A fit that outliers, contacts and friction near reversals do not pull to themselves: rows of a regressor go in, values and
//! what they leave of each row come out.
//!
//! Huber's function by reweighted rows (Ann. Math. Statist. 35, 1964), each channel by its own scale: 1.4826 times the median of
//! what is left. Columns may depend on each other, since a trace of a ridge stands on the scaled normal equations.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::by_channel::ChannelRegressor;
use crate::signal::median;

/// Huber's bound in standard deviations, and how often rows are reweighted.
const BOUND: f64 = 1.345;
const ROUNDS: usize = 5;
/// What is left below this part of the largest force is rounding.
const ROUNDING: f64 = 1e-9;
/// The ridge on scaled normal equations.
const RIDGE: f64 = 1e-10;

/// Values that fit rows, and what they leave.
#[derive(Debug, Clone)]
pub struct RobustFit {
    /// One for each column.
    pub values: DVector<f64>,
    /// Measured less fitted, for each row.
    pub residual: DVector<f64>,
    /// Squares of what rows were multiplied by.
    pub weights: DVector<f64>,
}

/// Fits measured values interleaved per sample, `row = sample * channels + channel`, of which those count that `counts` says so.
/// `None` where a number is not finite or nothing counts.
pub fn robust_fit(
    regressor: &ChannelRegressor,
    measured: &DVector<f64>,
    counts: &[bool],
) -> Option<RobustFit> {
    let channels = regressor.channels();
    let mut rest = measured.clone();
    let mut weights = DVector::zeros(measured.len());
    let mut found = None;
    for round in 0..ROUNDS {
        for channel in 0..channels {
            let rows = || (channel..rest.len()).step_by(channels);
            let counted = || rows().filter(|i| counts[*i]);
            let largest = counted().fold(0.0_f64, |most, i| most.max(measured[i].abs()));
            // A channel of zeros says nothing.
            if largest == 0.0 {
                continue;
            }
            // All rows count alike at first: before anything is fitted, large forces are no outliers.
            let scale = if round == 0 {
                largest
            } else {
                1.4826 * median(counted().map(|i| rest[i].abs()).collect())
            };
            let scale = scale.max(ROUNDING * largest);
            for i in counted() {
                let within = (BOUND * scale / rest[i].abs().max(scale * 1e-9)).min(1.0);
                weights[i] = within / (scale * scale);
            }
        }
        if weights.iter().all(|weight| *weight == 0.0) {
            return None;
        }
        let (normal, right) =
            regressor.normal_equations(&weights, measured, 0..regressor.samples());
        let values = solve_normal(normal, &right)?;
        rest = measured - regressor.multiply(values.as_slice());
        found = Some(values);
    }
    let values = found?;
    let is_finite = rest.iter().all(|x| x.is_finite());
    is_finite.then_some(RobustFit {
        values,
        residual: rest,
        weights,
    })
}

/// Values that solve normal equations with a trace of a ridge.
pub(super) fn solve_normal(normal: DMatrix<f64>, right: &DVector<f64>) -> Option<DVector<f64>> {
    let (factor, scale) = factor_normal(normal)?;
    let solved = factor.solve(&right.component_mul(&scale));
    Some(solved.component_mul(&scale))
}

/// Normal equations of columns scaled to one, with a trace of a ridge: their factor and the scales.
pub(super) fn factor_normal(
    mut normal: DMatrix<f64>,
) -> Option<(Cholesky<f64, Dyn>, DVector<f64>)> {
    let scale = normal
        .diagonal()
        .map(|x| if x > 0.0 { x.sqrt().recip() } else { 0.0 });
    for i in 0..scale.len() {
        for j in 0..scale.len() {
            normal[(i, j)] *= scale[i] * scale[j];
        }
        normal[(i, i)] += RIDGE;
    }
    Some((normal.cholesky()?, scale))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_noise::TestNoise;

    #[test]
    fn a_contact_pulls_nothing_and_equal_columns_share() {
        let mut noise = TestNoise::new(3);
        let n = 2000;
        let regressor = DMatrix::from_fn(n, 3, |i, j| match j {
            0 => (0.01 * i as f64).sin(),
            _ => 1.0,
        });
        let measured = DVector::from_fn(n, |i, _| {
            let push = if (600..700).contains(&i) { 50.0 } else { 0.0 };
            2.0 * regressor[(i, 0)] - 3.0 + push + 0.1 * noise.normal()
        });
        let regressor = ChannelRegressor::new(&regressor, 1);
        let found = robust_fit(&regressor, &measured, &vec![true; n]).unwrap();
        assert!((found.values[0] - 2.0).abs() < 0.02, "{found:?}");
        assert!((found.values[1] + found.values[2] + 3.0).abs() < 0.02);
        assert!((found.residual[650] - 50.0).abs() < 1.0);
        assert!(robust_fit(&regressor, &measured, &vec![false; n]).is_none());
    }
}
