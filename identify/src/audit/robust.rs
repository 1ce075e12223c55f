//! Robust least squares, which is not biased by outliers, contacts and friction near reversals. Input: a regressor and
//! measured values; output: estimates and residuals.
//!
//! Huber's function by reweighted rows (Ann. Math. Statist. 35, 1964), with a scale for each channel: 1.4826 times the
//! median of the absolute residuals. Columns may be dependent, since a very small ridge is added to the scaled normal
//! equations.

use nalgebra::DVector;

use super::by_channel::ChannelRegressor;
use super::thresholds::AUDIT_HUBER_BOUND_SIGMAS;
use crate::signal::{ScaledNormalEquations, median};

/// Number of times rows are reweighted.
const ROUNDS: usize = 5;
/// Residuals below this share of the largest force are rounding.
const ROUNDING: f64 = 1e-9;
/// Ridge that is added to the diagonal of the scaled normal equations, which is 1.
pub(super) const NORMAL_RIDGE: f64 = 1e-10;

/// Result of a robust fit.
#[derive(Debug, Clone)]
pub struct RobustFit {
    /// Estimates, one per column.
    pub values: DVector<f64>,
    /// Measured minus fitted values, one per row.
    pub residual: DVector<f64>,
    /// Weights of the squared residuals, one per row.
    pub weights: DVector<f64>,
}

impl RobustFit {
    /// Standard deviation of the fitted value of a channel at some samples, as a multiple of the deviation of its
    /// residual if all errors are independent (1). Rows without weight count as predicted. `None` if the normal equations
    /// are not positive definite.
    pub fn relative_deviations(
        &self,
        regressor: &ChannelRegressor,
        channel: usize,
        samples: &[usize],
    ) -> Option<Vec<f64>> {
        let nothing = DVector::zeros(self.weights.len());
        let (normal, _) = regressor.normal_equations(&self.weights, &nothing, 0..regressor.samples());
        let factor = ScaledNormalEquations::new(normal, NORMAL_RIDGE)?;
        // The weight of a row without error is the inverse variance of its channel.
        let weight = (channel..self.weights.len()).step_by(regressor.channels());
        let weight = weight.fold(0.0_f64, |most, row| most.max(self.weights[row]));
        let deviation = |sample: &usize| {
            let row = regressor.row(channel, *sample);
            (weight * row.dot(&factor.solve(&row)).max(0.0)).sqrt()
        };
        Some(samples.iter().map(deviation).collect())
    }
}

/// Fits measured values that are interleaved per sample, `row = sample * channels + channel`; only rows for which
/// `counts` is true are used. `None` if a number is not finite or no row is used.
pub fn robust_fit(regressor: &ChannelRegressor, measured: &DVector<f64>, counts: &[bool]) -> Option<RobustFit> {
    let channels = regressor.channels();
    let mut rest = measured.clone();
    let mut weights = DVector::zeros(measured.len());
    let mut found = None;
    for round in 0..ROUNDS {
        for channel in 0..channels {
            let rows = || (channel..rest.len()).step_by(channels);
            let counted = || rows().filter(|i| counts[*i]);
            // The scale is limited by rounding relative to the largest force.
            let largest = counted().fold(0.0_f64, |most, i| most.max(measured[i].abs()));
            // A channel of zeros contains no information.
            if largest == 0.0 {
                continue;
            }
            // All rows have equal weights at first: before anything is fitted, large forces are no outliers.
            let scale = if round == 0 {
                largest
            } else {
                1.4826 * median(counted().map(|i| rest[i].abs()).collect())
            };
            let scale = scale.max(ROUNDING * largest);
            for i in counted() {
                // Huber's weight: 1 within the bound, bound / |residual| beyond.
                let within = (AUDIT_HUBER_BOUND_SIGMAS * scale / rest[i].abs().max(scale * 1e-9)).min(1.0);
                weights[i] = within / (scale * scale);
            }
        }
        if weights.iter().all(|weight| *weight == 0.0) {
            return None;
        }
        let (normal, right) = regressor.normal_equations(&weights, measured, 0..regressor.samples());
        let values = ScaledNormalEquations::new(normal, NORMAL_RIDGE)?.solve(&right);
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

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

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
