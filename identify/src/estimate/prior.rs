//! Nominal values as soft constraints. Input: a solution and prior values; output: the most probable parameters given
//! both.
//!
//! Each prior value is an additional row, `p_j / s_j = nominal_j / s_j`, in units of the residuals' standard deviation
//! (generalised Tikhonov regularisation; A. Tarantola, "Inverse Problem Theory", 2005, section 3.2). As neighbouring
//! residuals are correlated, a recording counts only with its effective samples: the residuals' variance is multiplied
//! by the median of `(std / classical)^2` before both are balanced.

use nalgebra::DMatrix;

use crate::estimate::deviations::ParameterUncertainty;
use crate::estimate::error::LeastSquaresError;
use crate::estimate::r_factor::RFactor;
use crate::estimate::solution::RegressionSolution;

/// Prior knowledge of one parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParameterPrior {
    /// Index of the parameter.
    pub parameter: usize,
    /// Its prior value.
    pub value: f64,
    /// The standard deviation of that value; positive.
    pub std: f64,
}

/// The solution and its uncertainty with `beliefs` as additional measurements.
///
/// `solution` and `deviations` belong to `r_factor` alone. Parameters without a prior that the rows do not determine
/// stay at `nominal`. The residual norm and the condition numbers remain those of the measured rows.
/// Fails if a list has the wrong length or a number is not finite.
pub fn solve_with_prior(
    r_factor: &RFactor,
    solution: &RegressionSolution,
    deviations: &ParameterUncertainty,
    nominal: &[f64],
    beliefs: &[ParameterPrior],
) -> Result<(RegressionSolution, ParameterUncertainty), LeastSquaresError> {
    let n = r_factor.n_parameters();
    let noise = (solution.residual_variance() * variance_inflation(solution, deviations)).sqrt();
    // Without residuals the recording counts up to its rounding error.
    let least = 1e-9 * solution.measured_norm / (solution.rows.max(1) as f64).sqrt();
    let noise = if noise > least {
        noise
    } else {
        least.max(f64::MIN_POSITIVE.sqrt())
    };
    let (mut rows, mut right) = (Vec::new(), Vec::new());
    for belief in beliefs {
        let factor = noise / belief.std;
        let mut row = vec![0.0; n];
        row[belief.parameter] = factor;
        rows.extend(row);
        right.push(factor * belief.value);
    }
    let both = r_factor.with_rows(&rows, &right)?;
    let mut found = both.solve_near(nominal)?;
    let inverse = found.unit_covariance();
    let r = r_factor.r();
    let information = r.transpose() * &r;
    let scores = &information * &deviations.covariance * &information;
    let mut prior = DMatrix::zeros(n, n);
    for belief in beliefs {
        prior[(belief.parameter, belief.parameter)] += (noise / belief.std).powi(2) * noise * noise;
    }
    // Covariance from the gradients of samples and priors.
    let covariance = &inverse * (scores + prior) * &inverse;
    let mut after = deviations.clone();
    after.std = (0..n)
        .map(|j| {
            if found.determined[j] {
                covariance[(j, j)].sqrt()
            } else {
                f64::INFINITY
            }
        })
        .collect();
    after.covariance = covariance;
    let misfit = r_factor.right_side() - &r * nalgebra::DVector::from_column_slice(&found.values);
    found.residual_norm = misfit.norm().hypot(r_factor.residual_norm());
    found.measured_norm = solution.measured_norm;
    found.condition_number = solution.condition_number;
    found.scaled_condition_number = solution.scaled_condition_number;
    let variance = found.residual_variance();
    found.classical_std = (0..n)
        .map(|j| {
            if found.determined[j] {
                (variance * inverse[(j, j)]).sqrt()
            } else {
                f64::INFINITY
            }
        })
        .collect();
    Ok((found, after))
}

/// Ratio of the variances to those for independent residuals: the median over the parameters, at least 1.
pub(crate) fn variance_inflation(solution: &RegressionSolution, deviations: &ParameterUncertainty) -> f64 {
    let mut ratios: Vec<f64> = deviations
        .std
        .iter()
        .zip(&solution.classical_std)
        .map(|(honest, classical)| (honest / classical).powi(2))
        .filter(|ratio| ratio.is_finite())
        .collect();
    ratios.sort_by(f64::total_cmp);
    ratios.get(ratios.len() / 2).map_or(1.0, |ratio| ratio.max(1.0))
}
