//! Standard deviations that allow for autocorrelated residuals. Input: a solution and a second pass over its rows;
//! output: the covariance of the parameters.
//!
//! The residual of an identified mechanism is mostly model error and not white noise. Neighbouring samples are
//! therefore correlated, and the classical formula gives far too small standard deviations. Each sample's influence on
//! the parameters is `u_t = (W'W)^-1 sum_channels w_tc e_tc`, and the covariance of their sum is estimated from all
//! `E[u_t u_(t+l)']`:
//!
//! 1. Prewhitening of each parameter's influence by its own AR(1) coefficient `a`, at most 0.97
//!    in size: D. W. K. Andrews and J. C. Monahan, Econometrica 60 (1992).
//! 2. Bartlett's kernel, `sum_l (1 - |l|/L) Gamma_l`, positive semidefinite: W. K. Newey and
//!    K. D. West, Econometrica 55 (1987).
//! 3. Automatic bandwidth `L = 1.1447 (alpha T)^(1/3)`, `alpha = (s1/s0)^2`,
//!    `s_q = sum_(|l| <= n) |l|^q gamma_l`, `n = 4 (T/100)^(2/9)`: Newey and West, Review of
//!    Economic Studies 61 (1994), eq. (3.8) to (3.15), with the parameters' series in equal
//!    weights; never below `n + 1`, and never above a tenth of the samples.
//! 4. Recolouring by `1/(1 - a)` and the factor `T/(T - n_parameters)`.
//!
//! This is valid for many samples. Residuals of a fit are orthogonal to its columns, so with few samples their
//! influences cancel and the estimate approaches zero. [`ParameterUncertainty::few_samples`] shows this case; then a
//! standard deviation is never below the classical one, which uses the exact degrees of freedom.
//!
//! Bartlett's sum over lags is computed as the sum over all windows of `L` samples of `S_t S_t'/L`, where `S_t` is the
//! sum of the window: the same number, at a cost and a memory that do not grow with the lags times the parameters
//! squared.

use nalgebra::DMatrix;

use crate::estimate::error::LeastSquaresError;
use crate::estimate::lags::{BartlettWindows, LagProducts, bandwidth, lags_for_bandwidth};
use crate::estimate::rows::{RowVisitor, check_rows};
use crate::estimate::solution::RegressionSolution;
use crate::estimate::thresholds::FEWEST_ROWS;
use crate::signal::dot;

/// Uncertainty of a solution. Lists are in the order of the regressor's columns.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterUncertainty {
    /// Standard deviations; infinite for parameters that are not determined. NaN if there are no more rows than
    /// parameters, since residuals are then rounding.
    pub std: Vec<f64>,
    /// Covariance of the parameters; for an undetermined parameter only of the determined part.
    pub covariance: DMatrix<f64>,
    /// For each parameter, the number of independent samples that would give the same standard deviation by the
    /// classical formula: `samples * (classical / std)^2`.
    pub effective_samples: Vec<f64>,
    /// Correlation of each channel's residual with itself one sample later, `[channel]`.
    pub residual_lag1: Vec<f64>,
    /// Bandwidth of Bartlett's kernel, samples.
    pub bandwidth: usize,
    /// Number of samples, each of all channels; rows of zeros do not count.
    pub samples: usize,
    /// True if there are fewer than [`FEWEST_ROWS`] equations for each parameter. The standard deviations are then at
    /// least the classical ones, and still too small if neighbouring residuals are correlated.
    pub few_samples: bool,
}

/// Standard deviations of `solution`. `show` presents its rows again, block by block and in order of time; it is called
/// twice.
///
/// Several recordings may be shown one after the other: the few products across their borders do not matter.
/// Fails if `show` fails, or shows other rows than those of the solution.
///
/// ```
/// use modelmill_identify::{LeastSquares, LeastSquaresError, estimate::uncertainty_with_autocorrelation};
/// let regressor: Vec<f64> = (0..400).flat_map(|i| [1.0, f64::from(i)]).collect();
/// let measured: Vec<f64> = (0..400).map(|i| 3.0 + 2.0 * f64::from(i) + f64::from(i % 7)).collect();
/// let mut regression = LeastSquares::new(2);
/// regression.add_rows(&regressor, &measured)?;
/// let solution = regression.solve()?;
/// let deviations = uncertainty_with_autocorrelation(&solution, 1, |visit| visit(&regressor, &measured))?;
/// assert!(deviations.std[1] < 1e-2);
/// # Ok::<(), LeastSquaresError>(())
/// ```
pub fn uncertainty_with_autocorrelation<E: From<LeastSquaresError>>(
    solution: &RegressionSolution,
    channels: usize,
    mut show: impl FnMut(&mut RowVisitor<'_>) -> Result<(), E>,
) -> Result<ParameterUncertainty, E> {
    let mut scores = InfluenceScores::new(solution, channels.max(1));
    from_influences(solution, channels, |take| scores.show_influences(&mut show, take))
}

/// Receives each sample's influence on the parameters and its residuals.
pub(crate) type InfluenceSink<'a> = dyn FnMut(&[f64], &[f64]) + 'a;

/// Standard deviations from each sample's influence; `run` presents the influences and is called twice.
pub(crate) fn from_influences<E>(
    solution: &RegressionSolution,
    channels: usize,
    mut run: impl FnMut(&mut InfluenceSink<'_>) -> Result<(), E>,
) -> Result<ParameterUncertainty, E> {
    let n = solution.values.len();
    let channels = channels.max(1);
    // Lags are counted in time, including rows that are left out; the number of samples excludes these.
    let samples = solution.rows.div_ceil(channels);
    let steps = solution.shown / channels;
    let lags = lags_for_bandwidth(steps);
    let mut memory = LagProducts::new(n, lags + 1);
    let mut residuals = LagProducts::new(channels, 1);
    run(&mut |influence, errors| {
        memory.push(influence);
        residuals.push(errors);
    })?;
    let (memory, residuals) = (memory.finish(), residuals.finish());

    // Second pass: prewhitened influences, summed with Bartlett's kernel.
    let whitening: Vec<f64> = (0..n).map(|j| memory.correlation(1, j).clamp(-0.97, 0.97)).collect();
    let bandwidth = bandwidth(&memory, &whitening, lags, steps);

    let mut windows = BartlettWindows::new(n, bandwidth);
    let mut previous = vec![0.0; n];
    let mut white = vec![0.0; n];
    let mut first = true;
    run(&mut |influence, _| {
        for j in 0..n {
            white[j] = influence[j] - if first { 0.0 } else { whitening[j] * previous[j] };
        }
        previous.copy_from_slice(influence);
        first = false;
        windows.push(&white);
    })?;

    // Recolour, and correct for the degrees of freedom.
    let freedom = samples.saturating_sub(n.div_ceil(channels)).max(1);
    let correction = samples as f64 / freedom as f64;
    let sum = windows.finish();
    let mut covariance = DMatrix::from_fn(n, n, |i, j| {
        correction * sum[(i, j)] / ((1.0 - whitening[i]) * (1.0 - whitening[j]))
    });
    let few_samples = solution.rows < FEWEST_ROWS * solution.rank;
    if few_samples {
        raise_to_classical(&mut covariance, solution);
    }
    let std: Vec<f64> = (0..n)
        .map(|j| {
            if solution.rows <= solution.rank {
                f64::NAN
            } else if solution.determined[j] {
                covariance[(j, j)].sqrt()
            } else {
                f64::INFINITY
            }
        })
        .collect();
    let effective_samples = std
        .iter()
        .zip(&solution.classical_std)
        .map(|(std, classical)| {
            if std.is_finite() {
                // Residuals that alternate in sign reduce the standard deviation, but do not add samples.
                samples as f64 * (classical / std).powi(2).min(1.0)
            } else {
                0.0
            }
        })
        .collect();
    Ok(ParameterUncertainty {
        std,
        covariance,
        effective_samples,
        residual_lag1: (0..channels).map(|channel| residuals.correlation(1, channel)).collect(),
        bandwidth,
        samples,
        few_samples,
    })
}

/// Raises variances that are below the classical ones; correlations stay.
fn raise_to_classical(covariance: &mut DMatrix<f64>, solution: &RegressionSolution) {
    for i in 0..solution.values.len() {
        let classical = solution.classical_std[i].powi(2);
        let variance = covariance[(i, i)];
        if !solution.determined[i] || !classical.is_finite() || variance >= classical {
            continue;
        }
        let factor = if variance > 0.0 {
            (classical / variance).sqrt()
        } else {
            0.0
        };
        covariance.row_mut(i).scale_mut(factor);
        covariance.column_mut(i).scale_mut(factor);
        covariance[(i, i)] = classical;
    }
}

/// Computes each sample's influence on the parameters and its residuals.
struct InfluenceScores<'a> {
    solution: &'a RegressionSolution,
    channels: usize,
}

impl<'a> InfluenceScores<'a> {
    fn new(solution: &'a RegressionSolution, channels: usize) -> Self {
        Self { solution, channels }
    }

    /// Passes influence and residuals of every sample to `take`; fails if the rows differ from those of the solution.
    fn show_influences<E: From<LeastSquaresError>>(
        &mut self,
        show: &mut impl FnMut(&mut RowVisitor<'_>) -> Result<(), E>,
        take: &mut InfluenceSink<'_>,
    ) -> Result<(), E> {
        let n = self.solution.values.len();
        let to_parameters = self.solution.unit_covariance();
        let mut gradient = vec![0.0; n];
        let mut influence = vec![0.0; n];
        let mut errors = vec![0.0; self.channels];
        let mut rows = 0;
        show(&mut |regressor, measured| {
            check_rows(regressor, measured, n, rows)?;
            if !measured.len().is_multiple_of(self.channels) {
                return Err(LeastSquaresError::Channels {
                    rows: measured.len(),
                    channels: self.channels,
                });
            }
            rows += measured.len();
            let samples = regressor
                .chunks_exact(n * self.channels)
                .zip(measured.chunks_exact(self.channels));
            for (sample, measured) in samples {
                // Gradient of the sample: its rows times their residuals, summed over the channels.
                gradient.fill(0.0);
                for (channel, row) in sample.chunks_exact(n).enumerate() {
                    let error = measured[channel] - dot(row, &self.solution.values);
                    errors[channel] = error;
                    for (g, w) in gradient.iter_mut().zip(row) {
                        *g += w * error;
                    }
                }
                // The matrix is symmetric, so that its columns are its rows.
                for (influence, row) in influence.iter_mut().zip(to_parameters.as_slice().chunks_exact(n)) {
                    *influence = dot(row, &gradient);
                }
                take(&influence, &errors);
            }
            Ok(())
        })?;
        if rows == self.solution.shown {
            Ok(())
        } else {
            Err(LeastSquaresError::PassesDiffer {
                first: self.solution.shown,
                this_pass: rows,
            }
            .into())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::LeastSquares;
    use crate::test_noise::TestNoise;

    /// With as many rows as parameters, residuals are rounding and contain no information.
    #[test]
    fn without_a_row_to_spare_there_is_no_deviation() {
        let (w, y) = ([1.0, 0.0, 1.0, 1.0], [1.0, 3.0]);
        let mut regression = LeastSquares::new(2);
        regression.add_rows(&w, &y).unwrap();
        let solution = regression.solve().unwrap();
        let found: Result<ParameterUncertainty, LeastSquaresError> =
            uncertainty_with_autocorrelation(&solution, 1, |visit| visit(&w, &y));
        assert!(found.unwrap().std.iter().all(|std| std.is_nan()));
    }

    /// The classical deviation is exact for independent residuals, however few: `(y - W p) / std` then follows
    /// Student's distribution, whose 2-sigma coverage for two degrees of freedom is 81.6 %, for eight 91.9 % (any table
    /// of t).
    #[test]
    fn few_samples_cover_as_students_distribution_says() {
        for (samples, expected) in [(4, 0.816), (10, 0.919)] {
            let mut noise = TestNoise::new(5);
            let trials = 4000;
            let mut hits = 0;
            for _ in 0..trials {
                let w: Vec<f64> = (0..samples).flat_map(|i| [1.0, f64::from(i)]).collect();
                let y: Vec<f64> = (0..samples)
                    .map(|i| 3.0 + 2.0 * f64::from(i) + noise.normal())
                    .collect();
                let mut regression = LeastSquares::new(2);
                regression.add_rows(&w, &y).unwrap();
                let solution = regression.solve().unwrap();
                let found: Result<ParameterUncertainty, LeastSquaresError> =
                    uncertainty_with_autocorrelation(&solution, 1, |visit| visit(&w, &y));
                let found = found.unwrap();
                assert!(found.few_samples);
                for j in 0..2 {
                    assert!(found.std[j] >= solution.classical_std[j] * (1.0 - 1e-12));
                    assert!((found.covariance[(j, j)].sqrt() / found.std[j] - 1.0).abs() < 1e-12);
                }
                assert!(found.covariance.clone().symmetric_eigenvalues().min() > -1e-12);
                hits += usize::from((solution.values[1] - 2.0).abs() <= 2.0 * found.std[1]);
            }
            let coverage = hits as f64 / f64::from(trials);
            println!("{samples} samples: {coverage:.3}, expected at least {expected}");
            assert!(coverage > expected - 0.02, "{samples} samples: {coverage}");
        }
    }

    #[test]
    fn windows_are_bartletts_sum_over_lags() {
        let mut noise = TestNoise::new(3);
        let u: Vec<[f64; 2]> = (0..50).map(|_| [noise.normal(), noise.normal()]).collect();
        let length = 7;
        let mut windows = BartlettWindows::new(2, length);
        for values in &u {
            windows.push(values);
        }
        let sum = windows.finish();
        for (i, j) in [(0, 0), (0, 1), (1, 1)] {
            let mut expected = 0.0;
            for s in 0..50_usize {
                for t in 0..50_usize {
                    expected += (1.0 - s.abs_diff(t) as f64 / length as f64).max(0.0) * u[s][i] * u[t][j];
                }
            }
            assert!((sum[(i, j)] - expected).abs() < 1e-10);
            assert_eq!(sum[(i, j)].to_bits(), sum[(j, i)].to_bits());
        }
    }

    /// How often `|estimate - truth| <= 2 std` is true, by the autocorrelated and by the classical formula.
    fn coverage(correlation: f64, channels: usize) -> ([f64; 3], [f64; 3]) {
        let (trials, samples) = (400, 1500);
        let truth = [4.0, -2.0, 1.0];
        let mut hits = ([0.0; 3], [0.0; 3]);
        let mut noise = TestNoise::new(11);
        for _ in 0..trials {
            let (mut w, mut y) = (Vec::new(), Vec::new());
            let mut state = vec![0.0; channels];
            for i in 0..samples + 100 {
                for (channel, e) in state.iter_mut().enumerate() {
                    // The second channel shares half of the first one's noise.
                    *e = correlation * *e + noise.normal();
                    if i < 100 {
                        continue;
                    }
                    let t = f64::from(i) + 31.0 * channel as f64;
                    let row = [1.0, (0.01 * t).sin(), (0.013 * t + 1.0).cos().signum()];
                    w.extend(row);
                    y.push(row.iter().zip(truth).map(|(w, p)| w * p).sum::<f64>() + *e);
                }
            }
            let mut regression = LeastSquares::new(3);
            regression.add_rows(&w, &y).unwrap();
            let solution = regression.solve().unwrap();
            let honest = uncertainty_with_autocorrelation(&solution, channels, |visit| visit(&w, &y)).unwrap();
            for j in 0..3 {
                let error = (solution.values[j] - truth[j]).abs();
                hits.0[j] += f64::from(u8::from(error <= 2.0 * honest.std[j])) / f64::from(trials);
                hits.1[j] += f64::from(u8::from(error <= 2.0 * solution.classical_std[j])) / f64::from(trials);
            }
        }
        hits
    }

    #[test]
    fn two_deviations_cover_95_percent_under_autocorrelation() {
        for (correlation, channels) in [(0.0, 1), (0.7, 1), (0.9, 1), (0.9, 2)] {
            let (honest, classical) = coverage(correlation, channels);
            println!("correlation {correlation}, {channels} channels: honest {honest:.3?}, classical {classical:.3?}");
            for j in 0..3 {
                assert!(
                    (0.90..=0.985).contains(&honest[j]),
                    "correlation {correlation}: {honest:?}"
                );
                if correlation >= 0.7 {
                    assert!(classical[j] < 0.80, "correlation {correlation}: {classical:?}");
                }
            }
        }
    }

    #[test]
    fn what_is_not_determined_has_no_finite_deviation() {
        let w: Vec<f64> = (0..100).flat_map(|i| [1.0, f64::from(i % 3), 0.0]).collect();
        let y: Vec<f64> = (0..100).map(|i| f64::from(i % 5)).collect();
        let mut regression = LeastSquares::new(3);
        regression.add_rows(&w, &y).unwrap();
        let solution = regression.solve().unwrap();
        let deviations = uncertainty_with_autocorrelation(&solution, 1, |visit| visit(&w, &y)).unwrap();
        assert!(deviations.std[0].is_finite() && deviations.std[1].is_finite());
        assert!(deviations.std[2].is_infinite());
        let other = uncertainty_with_autocorrelation(&solution, 1, |visit| visit(&w[..30], &y[..10])).unwrap_err();
        assert_eq!(
            other,
            LeastSquaresError::PassesDiffer {
                first: 100,
                this_pass: 10
            }
        );
    }
}
