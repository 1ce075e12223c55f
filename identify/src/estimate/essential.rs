//! Essential parameters. Input: a solution with its uncertainty; output: the parameters that the recording supports.
//! The others are fixed at their prior values, or at zero.
//!
//! Backward elimination by the largest relative standard deviation, following M. Gautier, "Optimal motion planning for
//! robot's inertial parameters identification", CDC 1992, and A. Janot, P.-O. Vandanjon and M. Gautier, "A generic
//! instrumental variable approach for industrial robot identification", IEEE Trans. CST 22 (2014), section V, until the
//! omitted parameters would be significant. Their F-test counts every sample as independent, which finds everything
//! significant on recordings. Here the standard deviations allow for autocorrelation: Wald's statistic `d' C_DD^-1 d /
//! q` of all omitted parameters, with `d` relative to their fixed values, is compared with `F(q, effective samples -
//! n)`.

use nalgebra::{DMatrix, DVector};

use crate::estimate::deviations::ParameterUncertainty;
use crate::estimate::error::LeastSquaresError;
use crate::estimate::r_factor::RFactor;
use crate::estimate::solution::RegressionSolution;
use crate::estimate::thresholds::{ESSENTIAL_SIGNIFICANCE, ESSENTIAL_WELL_DETERMINED};

/// Limits for essential parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EssentialOptions {
    /// Parameters whose relative standard deviation is below this stay without a test.
    pub well_determined: f64,
    /// A set of parameters is not left out if its probability by chance is below this.
    pub significance: f64,
}

impl Default for EssentialOptions {
    fn default() -> Self {
        Self {
            well_determined: ESSENTIAL_WELL_DETERMINED,
            significance: ESSENTIAL_SIGNIFICANCE,
        }
    }
}

/// A parameter that was left out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DroppedParameter {
    /// Its index.
    pub parameter: usize,
    /// Its relative standard deviation when it was left out; infinite if it is not determined.
    pub relative_std: f64,
    /// Probability that all parameters left out so far have their fixed values, and differ from them by chance only.
    pub probability: f64,
}

/// The parameters that a recording supports.
#[derive(Debug, Clone, PartialEq)]
pub struct EssentialParameters {
    /// Indices of those that stay, ascending.
    pub kept: Vec<usize>,
    /// Those that were left out, in that order.
    pub dropped: Vec<DroppedParameter>,
    /// Values of all parameters; those left out have their fixed values.
    pub values: Vec<f64>,
    /// Standard deviations that allow for autocorrelation; infinite for those left out.
    pub std: Vec<f64>,
    /// The same for independent residuals.
    pub classical_std: Vec<f64>,
    /// Condition number of the columns that stay.
    pub condition_number: f64,
    /// The same for columns of norm 1.
    pub scaled_condition_number: f64,
    /// Relative increase of the norm of the residual (0.01 = 1 %).
    pub residual_rise: f64,
}

/// Leaves out parameters until all remaining ones are needed.
///
/// `solution` and `deviations` belong to `r_factor`; `held` are the values at which omitted parameters are fixed:
/// nominal values, or 0 without one. Fails only if a reduced problem cannot be solved.
pub fn select_essential(
    r_factor: &RFactor,
    solution: &RegressionSolution,
    deviations: &ParameterUncertainty,
    held: &[f64],
    options: &EssentialOptions,
) -> Result<EssentialParameters, LeastSquaresError> {
    let n = r_factor.n_parameters();
    let mut dropped = Vec::new();
    // Each undetermined direction starts with a parameter that no other direction contains: it can be left out without
    // loss.
    let mut kept: Vec<usize> = (0..n).collect();
    for direction in &solution.undetermined {
        let pivot = direction.changes[0].0;
        kept.retain(|j| *j != pivot);
        dropped.push(DroppedParameter {
            parameter: pivot,
            relative_std: f64::INFINITY,
            probability: 1.0,
        });
    }
    let r = r_factor.r();
    let information = r.transpose() * &r;
    // The covariance of the gradients depends on the residuals only; each choice of columns uses its part.
    let scores = &information * &deviations.covariance * &information;
    let full = ReducedRegression::fit(r_factor, &scores, held, kept)?;
    let mut effective: Vec<f64> = deviations
        .effective_samples
        .iter()
        .copied()
        .filter(|x| *x > 0.0)
        .collect();
    effective.sort_by(f64::total_cmp);
    // Degrees of freedom from the median of the effective samples.
    let samples = effective
        .get(effective.len() / 2)
        .copied()
        .unwrap_or(deviations.samples as f64);
    let freedom = (samples - full.columns.len() as f64).max(1.0);
    let mut tested: Vec<usize> = Vec::new();
    let mut choice = full.clone();
    while choice.columns.len() > 1 {
        let relative: Vec<f64> = (0..choice.columns.len())
            .map(|i| choice.relative_std(held, i))
            .collect();
        // Candidate: the parameter with the largest relative standard deviation.
        let worst = (0..relative.len()).fold(0, |best, i| if relative[i] > relative[best] { i } else { best });
        if relative[worst] <= options.well_determined {
            break;
        }
        tested.push(choice.columns[worst]);
        let probability = full.wald_probability(&tested, freedom);
        if probability < options.significance {
            break;
        }
        dropped.push(DroppedParameter {
            parameter: choice.columns[worst],
            relative_std: relative[worst],
            probability,
        });
        let mut columns = choice.columns.clone();
        columns.remove(worst);
        choice = ReducedRegression::fit(r_factor, &scores, held, columns)?;
    }
    let mut found = EssentialParameters {
        kept: choice.columns.clone(),
        dropped,
        values: held.to_vec(),
        std: vec![f64::INFINITY; n],
        classical_std: vec![f64::INFINITY; n],
        condition_number: choice.solution.condition_number,
        scaled_condition_number: choice.solution.scaled_condition_number,
        residual_rise: choice.solution.residual_norm / solution.residual_norm - 1.0,
    };
    for (i, j) in choice.columns.iter().enumerate() {
        found.values[*j] += choice.solution.values[i];
        found.std[*j] = choice.covariance[(i, i)].sqrt();
        found.classical_std[*j] = choice.solution.classical_std[i];
    }
    if !found.residual_rise.is_finite() {
        found.residual_rise = 0.0;
    }
    Ok(found)
}

/// A regression with some of the columns; values are relative to the fixed ones.
#[derive(Debug, Clone)]
struct ReducedRegression {
    /// Indices of the columns.
    columns: Vec<usize>,
    /// Solution for them.
    solution: RegressionSolution,
    /// Covariance that allows for autocorrelation.
    covariance: DMatrix<f64>,
}

impl ReducedRegression {
    /// Solves for some columns with the others fixed.
    fn fit(
        r_factor: &RFactor,
        scores: &DMatrix<f64>,
        held: &[f64],
        columns: Vec<usize>,
    ) -> Result<Self, LeastSquaresError> {
        let solution = r_factor
            .relative_to(held)
            .select_columns(&columns)?
            .solve_near(&vec![0.0; columns.len()])?;
        let inverse = solution.unit_covariance();
        let part = scores.select_rows(&columns).select_columns(&columns);
        Ok(Self {
            covariance: &inverse * part * &inverse,
            columns,
            solution,
        })
    }

    /// Standard deviation relative to the value of the i-th column.
    fn relative_std(&self, held: &[f64], i: usize) -> f64 {
        let value = held[self.columns[i]] + self.solution.values[i];
        let relative = self.covariance[(i, i)].sqrt() / value.abs();
        // A parameter with neither value nor deviation is not needed.
        if relative.is_nan() { f64::INFINITY } else { relative }
    }

    /// Probability by Wald's test that several parameters have their fixed values.
    fn wald_probability(&self, parameters: &[usize], freedom: f64) -> f64 {
        let at: Vec<usize> = parameters
            .iter()
            .filter_map(|p| self.columns.iter().position(|column| column == p))
            .collect();
        let values = DVector::from_fn(at.len(), |i, _| self.solution.values[at[i]]);
        let covariance = self.covariance.select_rows(&at).select_columns(&at);
        let Some(cholesky) = covariance.cholesky() else {
            // Without noise every value that differs at all is needed.
            return if values.norm() > 0.0 { 0.0 } else { 1.0 };
        };
        let wald = values.dot(&cholesky.solve(&values));
        f_tail(wald / at.len() as f64, at.len() as f64, freedom)
    }
}

/// Probability that a variable of the F distribution exceeds `value`.
fn f_tail(value: f64, above: f64, below: f64) -> f64 {
    incomplete_beta(below / (below + above * value), below / 2.0, above / 2.0)
}

/// The regularised incomplete beta function `I_x(a, b)` by its continued fraction (Abramowitz and Stegun, 26.5.8),
/// evaluated after W. J. Lentz (1976).
fn incomplete_beta(x: f64, a: f64, b: f64) -> f64 {
    if x <= 0.0 {
        return 0.0;
    }
    if x >= 1.0 {
        return 1.0;
    }
    if x > (a + 1.0) / (a + b + 2.0) {
        return 1.0 - incomplete_beta(1.0 - x, b, a);
    }
    let front = (a * x.ln() + b * (1.0 - x).ln() + log_gamma(a + b) - log_gamma(a) - log_gamma(b)).exp() / a;
    let tiny = 1e-300;
    let away = |value: f64| if value.abs() < tiny { tiny } else { value };
    let (mut c, mut d) = (1.0, 1.0 / away(1.0 - (a + b) * x / (a + 1.0)));
    let mut fraction = d;
    for m in 1..500 {
        let m = f64::from(m);
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        d = 1.0 / away(1.0 + even * d);
        c = away(1.0 + even / c);
        fraction *= d * c;
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        d = 1.0 / away(1.0 + odd * d);
        c = away(1.0 + odd / c);
        fraction *= d * c;
        if (d * c - 1.0).abs() < 1e-14 {
            break;
        }
    }
    front * fraction
}

/// Logarithm of the gamma function for positive arguments: Stirling's series (Abramowitz and Stegun, 6.1.41), shifted
/// to arguments where it is exact.
fn log_gamma(x: f64) -> f64 {
    let (mut x, mut shift) = (x, 0.0);
    while x < 12.0 {
        shift -= x.ln();
        x += 1.0;
    }
    let z = 1.0 / (x * x);
    let series = (1.0 / 12.0 - z * (1.0 / 360.0 - z * (1.0 / 1260.0 - z / 1680.0))) / x;
    shift + (x - 0.5) * x.ln() - x + 0.5 * (2.0 * std::f64::consts::PI).ln() + series
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimate::deviations::uncertainty_with_autocorrelation;
    use crate::test_noise::TestNoise;
    use crate::{LeastSquares, LeastSquaresError};

    /// Tables of the F distribution (5 and 1 %), and its closed form for two degrees of freedom above.
    #[test]
    fn the_tail_of_f_is_that_of_the_tables() {
        for (value, above, below, tail) in [
            (4.35, 1.0, 20.0, 0.05),
            (8.10, 1.0, 20.0, 0.01),
            (2.71, 5.0, 20.0, 0.05),
            (3.02, 3.0, 58.0, 0.0368),
        ] {
            assert!((f_tail(value, above, below) - tail).abs() < 4e-4, "{value}");
        }
        for x in [0.1_f64, 1.0, 3.0, 9.0] {
            let exact = (1.0 + 2.0 * x / 37.0_f64).powf(-18.5);
            assert!((f_tail(x, 2.0, 37.0) - exact).abs() < 1e-12);
        }
    }

    /// Seven columns, of which two have no effect on the force and one repeats another; AR(1) noise. How often is the
    /// right set found? A test that takes samples for independent would keep both null columns nearly always.
    #[test]
    fn what_has_no_effect_is_left_out_also_under_autocorrelated_noise() {
        let truth = [4.0, -2.0, 0.0, 1.5, 0.0, 3.0, 0.0];
        let mut noise = TestNoise::new(5);
        let (mut right, trials) = (0, 60);
        for _ in 0..trials {
            let (mut w, mut y, mut e) = (Vec::new(), Vec::new(), 0.0);
            for i in 0..3000 {
                let t = 0.01 * f64::from(i);
                e = 0.9 * e + 0.3 * noise.normal();
                let mut row = [
                    t.sin(),
                    (0.31 * t).cos(),
                    (1.7 * t).sin(),
                    (1.1 * t).cos().signum(),
                    (0.77 * t).cos(),
                    1.0,
                    0.0,
                ];
                row[6] = 2.0 * row[0];
                y.push(row.iter().zip(truth).map(|(w, p)| w * p).sum::<f64>() + e);
                w.extend(row);
            }
            let mut regression = LeastSquares::new(7);
            regression.add_rows(&w, &y).unwrap();
            let solution = regression.solve().unwrap();
            let deviations: Result<_, LeastSquaresError> =
                uncertainty_with_autocorrelation(&solution, 1, |visit| visit(&w, &y));
            let r_factor = RFactor::new(&regression);
            let found = select_essential(
                &r_factor,
                &solution,
                &deviations.unwrap(),
                &[0.0; 7],
                &EssentialOptions::default(),
            )
            .unwrap();
            assert!(found.dropped.iter().any(|d| d.relative_std.is_infinite()));
            // Of the two equal columns one stays, whichever.
            let kept: Vec<usize> = found.kept.iter().map(|j| if *j == 6 { 0 } else { *j }).collect();
            right += i32::from([1, 3, 5, 0].iter().all(|j| kept.contains(j)) && kept.len() == 4);
            for j in [1, 3, 5] {
                assert!((found.values[j] - truth[j]).abs() < 5.0 * found.std[j]);
            }
            assert!(found.residual_rise < 0.02);
        }
        assert!(right >= trials * 85 / 100, "{right} of {trials}");
    }

    /// A parameter that the rows hardly determine stays at its prior value, even if another column could replace it in
    /// part.
    #[test]
    fn what_is_not_supported_stays_where_it_is_held() {
        let truth = [4.0, 8.0, -3.0];
        let mut noise = TestNoise::new(11);
        let (mut w, mut y) = (Vec::new(), Vec::new());
        for i in 0..4000 {
            let t = 0.01 * f64::from(i);
            // The second column moves next to nothing by itself.
            let row = [t.sin(), 1e-4 * (2.3 * t).cos(), (1.7 * t).sin()];
            y.push(row.iter().zip(truth).map(|(w, p)| w * p).sum::<f64>() + noise.normal());
            w.extend(row);
        }
        let mut regression = LeastSquares::new(3);
        regression.add_rows(&w, &y).unwrap();
        let solution = regression.solve().unwrap();
        let deviations: Result<_, LeastSquaresError> =
            uncertainty_with_autocorrelation(&solution, 1, |visit| visit(&w, &y));
        let deviations = deviations.unwrap();
        let r_factor = RFactor::new(&regression);
        let options = EssentialOptions::default();
        let held = [0.0, 8.0, 0.0];
        let found = select_essential(&r_factor, &solution, &deviations, &held, &options).unwrap();
        assert_eq!(found.kept, [0, 2]);
        assert_eq!(found.values[1].to_bits(), 8.0_f64.to_bits());
        for j in [0, 2] {
            assert!((found.values[j] - truth[j]).abs() < 5.0 * found.std[j]);
        }
        // A well determined parameter moves away from its fixed value.
        let found = select_essential(&r_factor, &solution, &deviations, &[1.0, 8.0, 5.0], &options).unwrap();
        assert_eq!(found.kept, [0, 2]);
    }
}
