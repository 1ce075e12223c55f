//! Weighted and robust least squares by reweighting. Input: passes over the rows; output: a solution with its
//! uncertainty and weights. Memory does not grow with the rows.
//!
//! Weights of channels are the inverse standard deviations of their residuals, iterated from the
//! unweighted solution: M. Gautier and P. Poignet, Control Engineering Practice 9 (2001), section
//! 3.2. Robust estimates minimise Huber's function of the scaled residual, P. J. Huber, Ann. Math.
//! Statist. 35 (1964), by iteratively reweighted rows; the scale of each channel is 1.4826 times
//! the median of the residuals' magnitudes, which outliers do not move. Deviations of robust
//! estimates follow from `psi' w w'` in place of `w w'` in the inverse: P. J. Huber, "Robust
//! Statistics" (1981), section 7.6.

use crate::estimate::deviations::{ParameterUncertainty, uncertainty_with_autocorrelation};
use crate::estimate::error::LeastSquaresError;
use crate::estimate::least_squares::LeastSquares;
use crate::estimate::r_factor::RFactor;
use crate::estimate::rows::RowVisitor;
use crate::estimate::solution::RegressionSolution;
use crate::estimate::weighted_rows::{
    RowWeighting, WeightedRows, outlier_share, residual_scales, reweight_rows, show_weighted,
};

/// Solutions that change by less than this share of a standard deviation have converged.
const CONVERGENCE_TOLERANCE: f64 = 1e-3;

/// Options of an estimate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EstimateOptions {
    /// Divide each channel by the standard deviation of its residuals.
    pub by_channel: bool,
    /// Huber's bound in standard deviations; `None` for ordinary least squares.
    pub huber: Option<f64>,
    /// Largest number of solutions.
    pub iterations: usize,
}

impl Default for EstimateOptions {
    fn default() -> Self {
        Self {
            by_channel: false,
            huber: None,
            iterations: 50,
        }
    }
}

/// A solution with its uncertainty and weights.
#[derive(Debug, Clone)]
pub struct WeightedEstimate {
    /// The solution; its norms are those of the weighted rows.
    pub solution: RegressionSolution,
    /// Its standard deviations.
    pub uncertainty: ParameterUncertainty,
    /// Weights of the rows.
    pub weighting: RowWeighting,
    /// R factor of the weighted rows.
    pub r_factor: RFactor,
}

/// Estimates `nominal.len()` parameters from the rows that `show` presents, interleaved per sample, in order of time
/// and the same in every pass. Undetermined directions stay at `nominal`.
///
/// Ordinary least squares needs three passes, each reweighting two more.
/// Fails if `show` fails, if there are no rows, or if a number is not finite.
///
/// ```
/// use modelmill_identify::estimate::{EstimateOptions, HUBER_BOUND, estimate};
/// use modelmill_identify::LeastSquaresError;
/// let regressor: Vec<f64> = (0..400).flat_map(|i| [1.0, f64::from(i)]).collect();
/// let mut measured: Vec<f64> = (0..400).map(|i| 3.0 + 2.0 * f64::from(i) + 0.1 * f64::from(i % 7)).collect();
/// measured[17] = 1e6;
/// let options = EstimateOptions { huber: Some(HUBER_BOUND), ..EstimateOptions::default() };
/// let found = estimate(&[0.0, 0.0], 1, &options, |visit| visit(&regressor, &measured))?;
/// assert!((found.solution.values[1] - 2.0).abs() < 1e-3);
/// # Ok::<(), LeastSquaresError>(())
/// ```
pub fn estimate<E: From<LeastSquaresError>>(
    nominal: &[f64],
    channels: usize,
    options: &EstimateOptions,
    mut show: impl FnMut(&mut RowVisitor<'_>) -> Result<(), E>,
) -> Result<WeightedEstimate, E> {
    let n = nominal.len();
    let channels = channels.max(1);
    let mut regression = LeastSquares::with_channels(n, channels);
    show(&mut |w, y| regression.add_rows(w, y))?;
    let mut solution = regression.solve_near(nominal)?;
    let mut weighting = RowWeighting {
        scales: vec![1.0; channels],
        by_channel: options.by_channel,
        huber: options.huber,
        outliers: 0.0,
        iterations: 1,
        converged: true,
    };
    if options.by_channel || options.huber.is_some() {
        weighting.converged = false;
        while !weighting.converged && weighting.iterations < options.iterations.max(2) {
            weighting.scales = residual_scales(&solution, &weighting, &mut show)?;
            let before = solution;
            regression = reweight_rows(&before.values, channels, &weighting, WeightedRows::Weighted, &mut show)?;
            solution = regression.solve_near(nominal)?;
            weighting.iterations += 1;
            weighting.converged = (0..n).all(|j| {
                let moved = (solution.values[j] - before.values[j]).abs();
                !solution.determined[j]
                    || moved <= CONVERGENCE_TOLERANCE * solution.classical_std[j]
                    || moved <= 1e-13 * solution.values[j].abs()
            });
        }
    }
    // Robust estimates use the second derivatives of Huber's function in the covariance.
    let r_factor = RFactor::new(&regression);
    if weighting.huber.is_some() {
        let curvature = reweight_rows(
            &solution.values,
            channels,
            &weighting,
            WeightedRows::Curvature,
            &mut show,
        )?;
        solution.adopt_inverse(curvature.solve_near(nominal)?);
        weighting.outliers = outlier_share(&solution.values, channels, &weighting, &mut show)?;
    }
    let values = solution.values.clone();
    let deviations = uncertainty_with_autocorrelation(&solution, channels, |visit| {
        show_weighted(&values, channels, &weighting, WeightedRows::Weighted, &mut show, visit)
    })?;
    Ok(WeightedEstimate {
        solution,
        uncertainty: deviations,
        weighting,
        r_factor,
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::*;
    use crate::estimate::prior::{ParameterPrior, solve_with_prior};
    use crate::estimate::thresholds::HUBER_BOUND;
    use crate::signal::dot;
    use crate::test_noise::TestNoise;

    const TRUTH: [f64; 3] = [4.0, -2.0, 1.0];

    struct Rows {
        w: Vec<f64>,
        y: Vec<f64>,
    }

    /// Two channels with errors of different size, correlated in time by `memory`; a share of `spoilt` is far off.
    fn rows(noise: &mut TestNoise, samples: i32, sizes: [f64; 2], memory: f64, spoilt: f64) -> Rows {
        let (mut w, mut y, mut state) = (Vec::new(), Vec::new(), [0.0; 2]);
        for i in 0..samples {
            for channel in 0..2 {
                let t = 0.01 * f64::from(i) + 3.1 * channel as f64;
                let row = [1.0, t.sin(), (1.3 * t).cos().signum()];
                state[channel] = memory * state[channel] + sizes[channel] * noise.normal();
                let mut value = row.iter().zip(TRUTH).map(|(w, p)| w * p).sum::<f64>() + state[channel];
                if noise.uniform() < spoilt {
                    value += 30.0 + 20.0 * noise.uniform();
                }
                w.extend(row);
                y.push(value);
            }
        }
        Rows { w, y }
    }

    fn run(rows: &Rows, options: &EstimateOptions) -> WeightedEstimate {
        estimate(&[0.0; 3], 2, options, |visit| -> Result<(), LeastSquaresError> {
            // Odd blocks, as they come.
            for (w, y) in rows.w.chunks(3 * 2 * 37).zip(rows.y.chunks(2 * 37)) {
                visit(w, y)?;
            }
            Ok(())
        })
        .unwrap()
    }

    const WEIGHTED: EstimateOptions = EstimateOptions {
        by_channel: true,
        huber: None,
        iterations: 50,
    };
    const ROBUST: EstimateOptions = EstimateOptions {
        by_channel: false,
        huber: Some(HUBER_BOUND),
        iterations: 50,
    };

    /// The fixed point is a weighted least squares problem, which normal equations of the dense one solve.
    #[test]
    fn channel_weights_agree_with_a_dense_solution_and_beat_plain_ones() {
        let mut noise = TestNoise::new(21);
        let (mut plain, mut weighted) = (0.0, 0.0);
        for _ in 0..40 {
            let rows = rows(&mut noise, 800, [1.0, 0.05], 0.0, 0.0);
            let found = run(&rows, &WEIGHTED);
            assert!(found.weighting.converged);
            let scales = &found.weighting.scales;
            assert!(
                (scales[0] - 1.0).abs() < 0.15 && (scales[1] - 0.05).abs() < 0.0075,
                "{scales:?}"
            );
            let w = DMatrix::from_fn(1600, 3, |i, j| rows.w[3 * i + j] / scales[i % 2]);
            let y = DVector::from_fn(1600, |i, _| rows.y[i] / scales[i % 2]);
            let dense = w.clone().svd(true, true).solve(&y, 0.0).unwrap();
            for j in 0..3 {
                assert!((found.solution.values[j] - dense[j]).abs() < 1e-10);
                weighted += (dense[j] - TRUTH[j]).powi(2);
            }
            let plain_values = run(&rows, &EstimateOptions::default()).solution.values;
            plain += plain_values
                .iter()
                .zip(TRUTH)
                .map(|(p, t)| (p - t).powi(2))
                .sum::<f64>();
        }
        assert!(weighted < 0.05 * plain, "{weighted} and {plain}");
    }

    /// Rows of zeros among the others change neither the scales nor the values, in one channel or in both.
    #[test]
    fn rows_that_are_left_out_are_no_residuals() {
        let all = rows(&mut TestNoise::new(8), 1200, [1.0, 0.2], 0.0, 0.05);
        let mut with_zeros = Rows {
            w: Vec::new(),
            y: Vec::new(),
        };
        for (k, (w, y)) in all.w.chunks(6).zip(all.y.chunks(2)).enumerate() {
            if k % 3 == 0 {
                with_zeros.w.extend([0.0; 6]);
                with_zeros.y.extend([0.0; 2]);
            }
            with_zeros.w.extend(w);
            with_zeros.y.extend(y);
        }
        for options in [
            WEIGHTED,
            ROBUST,
            EstimateOptions {
                by_channel: true,
                ..ROBUST
            },
        ] {
            let (expected, found) = (run(&all, &options), run(&with_zeros, &options));
            for (found, expected) in found.weighting.scales.iter().zip(&expected.weighting.scales) {
                assert!((found / expected - 1.0).abs() < 1e-6, "{found} {expected}");
            }
            assert!((found.weighting.outliers - expected.weighting.outliers).abs() < 1e-12);
            assert_eq!(found.solution.rows, expected.solution.rows);
            assert_eq!(found.solution.shown, 3200);
            assert_eq!(found.uncertainty.samples, 1200);
            for (found, expected) in found
                .solution
                .classical_std
                .iter()
                .zip(&expected.solution.classical_std)
            {
                assert!((found / expected - 1.0).abs() < 1e-6, "{found} {expected}");
            }
            for j in 0..3 {
                let moved = found.solution.values[j] - expected.solution.values[j];
                assert!(moved.abs() < 1e-6, "{moved}");
            }
        }
        // Half of one channel left out: its scale stays that of the noise.
        let mut half = rows(&mut TestNoise::new(8), 1200, [1.0, 0.2], 0.0, 0.0);
        for row in (1..1200).step_by(2) {
            half.w[3 * row..3 * row + 3].fill(0.0);
            half.y[row] = 0.0;
        }
        let scales = run(&half, &WEIGHTED).weighting.scales;
        assert!((scales[1] - 0.2).abs() < 0.02, "{scales:?}");
    }

    /// A driven channel and one without a drive, whose equation says that two forces cancel: both parameters come back,
    /// and the weight of the second channel stays finite.
    #[test]
    fn equations_without_a_force_do_not_take_all_weight() {
        for seed in 0..8 {
            let mut noise = TestNoise::new(40 + seed);
            let truth = [1.2, 0.06, 0.024];
            let mut rows = Rows {
                w: Vec::new(),
                y: Vec::new(),
            };
            for i in 0..1500 {
                let t = 0.01 * f64::from(i);
                let (a, b, c) = ((3.0 * t).sin(), (5.0 * t).cos(), (1.7 * t).sin());
                rows.w.extend([a, b, 0.0]);
                rows.y.push(truth[0] * a + truth[1] * b + 0.05 * noise.normal());
                // The states have noise, so that zero parameters fit this channel best.
                rows.w
                    .extend([0.0, 0.4 * c + 0.01 * noise.normal(), -c + 0.01 * noise.normal()]);
                rows.y.push(0.0);
            }
            let found = run(&rows, &WEIGHTED);
            for (value, truth) in found.solution.values.iter().zip(truth) {
                assert!((value / truth - 1.0).abs() < 0.2, "{:?}", found.solution.values);
            }
            let scales = &found.weighting.scales;
            assert!(scales[1] >= scales[0], "{scales:?}");
        }
    }

    #[test]
    fn a_robust_estimate_is_not_moved_by_what_is_far_off() {
        let rows = rows(&mut TestNoise::new(4), 2000, [0.5, 0.5], 0.0, 0.08);
        let plain = run(&rows, &EstimateOptions::default());
        let robust = run(&rows, &ROBUST);
        let error = |e: &WeightedEstimate| (e.solution.values[0] - TRUTH[0]).abs();
        assert!(
            error(&plain) > 2.0 && error(&robust) < 0.12,
            "{} and {}",
            error(&plain),
            error(&robust)
        );
        assert!(robust.weighting.converged && robust.weighting.outliers > 0.2);
        // At the minimum of Huber's function its gradient vanishes.
        let (values, scales) = (&robust.solution.values, &robust.weighting.scales);
        let mut gradient = [0.0; 3];
        for (i, (row, y)) in rows.w.chunks(3).zip(&rows.y).enumerate() {
            let bound = HUBER_BOUND * scales[i % 2];
            let seen = (y - dot(row, values)).clamp(-bound, bound);
            for (g, w) in gradient.iter_mut().zip(row) {
                *g += seen * w;
            }
        }
        assert!(gradient.iter().all(|g| g.abs() < 4000.0 * 1e-4), "{gradient:?}");
    }

    /// How often the true value is within two standard deviations, of 200.
    fn coverage(options: &EstimateOptions, memory: f64, spoilt: f64) -> f64 {
        let mut noise = TestNoise::new(77);
        let mut inside = 0;
        for _ in 0..200 {
            let rows = rows(&mut noise, 1200, [0.6, 0.2], memory, spoilt);
            let found = run(&rows, options);
            // A constant force is what one-sided spoilt values look like; the others are free of that bias.
            inside += (1..3)
                .filter(|j| (found.solution.values[*j] - TRUTH[*j]).abs() <= 2.0 * found.uncertainty.std[*j])
                .count();
        }
        f64::from(u32::try_from(inside).unwrap()) / 400.0
    }

    #[test]
    fn two_deviations_cover_95_percent_for_weighted_and_robust_estimates() {
        for (options, memory, spoilt) in [
            (WEIGHTED, 0.0, 0.0),
            (WEIGHTED, 0.9, 0.0),
            (ROBUST, 0.0, 0.05),
            (ROBUST, 0.9, 0.0),
        ] {
            let covered = coverage(&options, memory, spoilt);
            println!("{options:?}, memory {memory}, spoilt {spoilt}: {covered}");
            assert!(
                (0.90..=0.985).contains(&covered),
                "{options:?}, {memory}, {spoilt}: {covered}"
            );
        }
    }

    /// With independent errors of known size the most plausible values have a textbook formula.
    #[test]
    fn a_prior_balances_recording_and_nominal_values() {
        let rows = rows(&mut TestNoise::new(8), 400, [0.5, 0.5], 0.0, 0.0);
        let found = run(&rows, &EstimateOptions::default());
        let beliefs: Vec<ParameterPrior> = (0..3)
            .map(|j| ParameterPrior {
                parameter: j,
                value: 0.5,
                std: [0.02, 0.5, 1e6][j],
            })
            .collect();
        let (solution, deviations) = solve_with_prior(
            &found.r_factor,
            &found.solution,
            &found.uncertainty,
            &[0.0; 3],
            &beliefs,
        )
        .unwrap();
        let inflation = crate::estimate::prior::variance_inflation(&found.solution, &found.uncertainty);
        let variance = found.solution.residual_variance() * inflation;
        let w = DMatrix::from_row_slice(800, 3, &rows.w);
        let y = DVector::from_column_slice(&rows.y);
        let precision = DMatrix::from_diagonal(&DVector::from_fn(3, |j, _| beliefs[j].std.powi(-2)));
        let information = w.transpose() * &w / variance + &precision;
        let right = w.transpose() * y / variance + &precision * DVector::from_element(3, 0.5);
        let expected = information.clone().lu().solve(&right).unwrap();
        for j in 0..3 {
            assert!((solution.values[j] - expected[j]).abs() < 1e-9 * expected[j].abs());
            let std = information.clone().try_inverse().unwrap()[(j, j)].sqrt();
            assert!(
                (deviations.std[j] / std - 1.0).abs() < 0.25,
                "{} and {std}",
                deviations.std[j]
            );
            assert!(deviations.std[j] <= found.uncertainty.std[j] * (1.0 + 1e-9));
        }
        // What is believed firmly stays, what is not believed follows the recording.
        assert!((solution.values[0] - 0.5).abs() < 3.0);
        let apart = (solution.values[2] - found.solution.values[2]).abs();
        assert!(apart < 3.0 * found.uncertainty.std[2] + (solution.values[0] - found.solution.values[0]).abs());
    }
}
