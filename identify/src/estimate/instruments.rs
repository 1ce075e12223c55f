//! Instrumental variables, for noisy states. Input: rows of instruments and of the regressor; output: a solution
//! without the bias of least squares.
//!
//! In a closed loop the noise of the encoders passes through the controller into the forces, and the regressor is
//! computed from the same noisy states. Least squares is then biased, however long the recording is. The remedy is a
//! second regressor `Z` whose errors are independent of those of the forces, `p = (Z'W)^-1 Z'y`: from the reference
//! motion of the robot, or from another period of the same motion. Source: A. Janot, P.-O. Vandanjon and M. Gautier, "A
//! generic instrumental variable approach for industrial robot identification", IEEE Trans. CST 22 (2014), who compute
//! `Z` by simulating the closed loop, which needs its controller; P. C. Young, "Recursive Estimation and Time-Series
//! Analysis" (2011), chapter 6.
//!
//! The stacked rows `[Z W y]` are reduced by reflections as in [`LeastSquares`](crate::LeastSquares); with
//! `Q'Z = R`, `Q'W = B` and `Q'y = b` the solution is `B^-1 b`, and no products of rows are formed.

use nalgebra::{DMatrix, DVector};

use crate::estimate::deviations::{ParameterUncertainty, from_influences};
use crate::estimate::error::LeastSquaresError;
use crate::estimate::least_squares::LeastSquares;
use crate::estimate::rows::{RowVisitor, check_rows};
use crate::estimate::solution::RegressionSolution;
use crate::estimate::thresholds::INSTRUMENT_LEAST_CORRELATION;

/// Result of an estimate with instruments.
#[derive(Debug, Clone)]
pub struct InstrumentalEstimate {
    /// The solution.
    pub solution: RegressionSolution,
    /// Its standard deviations, which allow for autocorrelation.
    pub uncertainty: ParameterUncertainty,
    /// Least squares solution of the same rows.
    pub least_squares: RegressionSolution,
    /// Smallest canonical correlation between instruments and regressor, 0 to 1: near 1 the instruments are as
    /// informative as the regressor, below 0.2 they are weak.
    pub strength: f64,
}

/// Estimates `n` parameters. `show` presents rows of `2 n` numbers, instruments first, interleaved per sample, in order
/// of time, and the same in each of three passes.
/// Fails if `show` fails, a number is not finite, or the instruments do not determine the parameters.
pub fn estimate_with_instruments<E: From<LeastSquaresError>>(
    n: usize,
    channels: usize,
    mut show: impl FnMut(&mut RowVisitor<'_>) -> Result<(), E>,
) -> Result<InstrumentalEstimate, E> {
    if n == 0 {
        return Err(LeastSquaresError::NoParameters.into());
    }
    let channels = channels.max(1);
    let mut regression = LeastSquares::with_channels(2 * n, channels);
    show(&mut |rows, y| regression.add_rows(rows, y))?;
    if regression.rows() == 0 {
        return Err(LeastSquaresError::NoRows.into());
    }
    let found = solve_instrumental(&regression, n)?;
    let mut gradient = DVector::zeros(n);
    let mut influence = DVector::zeros(n);
    let mut errors = vec![0.0; channels];
    let deviations = from_influences::<E>(&found.solution, channels, |take| {
        let mut rows = 0;
        show(&mut |block, measured| {
            check_rows(block, measured, 2 * n, rows)?;
            rows += measured.len();
            let samples = block
                .chunks_exact(2 * n * channels)
                .zip(measured.chunks_exact(channels));
            for (sample, measured) in samples {
                gradient.fill(0.0);
                for (channel, row) in sample.chunks_exact(2 * n).enumerate() {
                    let (z, w) = row.split_at(n);
                    let model: f64 = w.iter().zip(&found.solution.values).map(|(w, p)| w * p).sum();
                    errors[channel] = measured[channel] - model;
                    for (g, z) in gradient.iter_mut().zip(z) {
                        *g += z * errors[channel];
                    }
                }
                influence.gemv(1.0, &found.to_parameters, &gradient, 0.0);
                take(influence.as_slice(), &errors);
            }
            Ok(())
        })?;
        if rows == regression.rows() {
            Ok(())
        } else {
            let (first, now) = (regression.rows(), rows);
            Err(LeastSquaresError::PassesDiffer { first, this_pass: now }.into())
        }
    })?;
    Ok(InstrumentalEstimate {
        solution: found.solution,
        uncertainty: deviations,
        least_squares: found.least_squares,
        strength: found.strength,
    })
}

/// Solution from the R factor of instruments and regressor.
struct InstrumentalSolution {
    solution: RegressionSolution,
    least_squares: RegressionSolution,
    strength: f64,
    /// `(Z'W)^-1`, from gradients to parameters.
    to_parameters: DMatrix<f64>,
}

/// Solves for `n` parameters; fails if the instruments are too weak.
fn solve_instrumental(regression: &LeastSquares, n: usize) -> Result<InstrumentalSolution, LeastSquaresError> {
    let width = 2 * n + 1;
    let r_factor = regression.augmented_factor();
    let entry = |i: usize, j: usize| r_factor[i * width + j];
    let r_z = DMatrix::from_fn(n, n, &entry);
    let b = DMatrix::from_fn(n, n, |i, j| entry(i, n + j));
    let right = DVector::from_fn(n, |i, _| entry(i, 2 * n));
    // Rows of W and y alone, for ordinary least squares.
    let mut plain = LeastSquares::new(n);
    for row in r_factor.chunks_exact(width) {
        plain.add_rows(&row[n..2 * n], &row[2 * n..])?;
    }
    let mut least_squares = crate::RFactor::new(&plain);
    least_squares.set_row_count(regression.row_count());
    let least_squares = least_squares.solve_near(&vec![0.0; n])?;
    let weak = |correlation| LeastSquaresError::WeakInstruments { correlation };
    if least_squares.rank < n {
        return Err(weak(0.0));
    }
    // Q'W R_W^-1 has the cosines between both spans as singular values.
    let cosines = (&b * &least_squares.r_inverse)
        .try_svd(false, false, f64::EPSILON, 10_000)
        .ok_or(LeastSquaresError::NoConvergence)?;
    let strength = cosines.singular_values.min();
    let b_inverse = b
        .clone()
        .try_inverse()
        .filter(|_| strength > INSTRUMENT_LEAST_CORRELATION)
        .ok_or(weak(strength))?;
    let r_inverse = r_z
        .solve_upper_triangular(&DMatrix::identity(n, n))
        .filter(|inverse| inverse.iter().all(|x| x.is_finite()))
        .ok_or(weak(strength))?;
    let values = b.lu().solve(&right).ok_or(weak(strength))?;
    let mut solution = least_squares.clone();
    let r_w = crate::RFactor::new(&plain);
    let misfit = r_w.right_side() - r_w.r() * &values;
    solution.residual_norm = misfit.norm().hypot(r_w.residual_norm());
    solution.values = values.iter().copied().collect();
    let to_parameters = &b_inverse * r_inverse.transpose();
    solution.r_inverse = b_inverse;
    let sigma = solution.residual_variance().sqrt();
    solution.classical_std = (0..n).map(|i| sigma * solution.r_inverse.row(i).norm()).collect();
    Ok(InstrumentalSolution {
        solution,
        least_squares,
        strength,
        to_parameters,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_noise::TestNoise;

    type Rows = (Vec<f64>, Vec<f64>);

    /// A spring and a constant force on a coordinate whose encoder is noisy. The force follows the noisy coordinate
    /// through a controller, so that both errors are the same. Instruments: the reference coordinate.
    fn rows(seed: u64, samples: i32) -> Rows {
        let mut noise = TestNoise::new(seed);
        let (mut rows, mut y) = (Vec::new(), Vec::new());
        for i in 0..samples {
            let t = 0.02 * f64::from(i);
            let reference = t.sin() + 0.5 * (2.3 * t).sin();
            let seen = reference + 0.3 * noise.normal();
            rows.extend([reference, 1.0, seen, 1.0]);
            y.push(4.0 * reference - 1.0 - 0.5 * (seen - reference) + 0.1 * noise.normal());
        }
        (rows, y)
    }

    fn found((rows, y): &Rows) -> InstrumentalEstimate {
        estimate_with_instruments(2, 1, |visit| -> Result<(), LeastSquaresError> { visit(rows, y) }).unwrap()
    }

    #[test]
    fn instruments_remove_the_bias_that_more_samples_do_not() {
        let (mut worst, mut inside) = (0.0_f64, 0.0);
        for seed in 0..100 {
            let data = rows(seed, 2000);
            let one = found(&data);
            let bias = one.least_squares.values[0] - 4.0;
            assert!(bias < -0.4, "least squares is off by {bias} only");
            worst = worst.max((one.solution.values[0] - 4.0).abs());
            let error = (one.solution.values[0] - 4.0).abs();
            inside += f64::from(u8::from(error <= 2.0 * one.uncertainty.std[0]));
            assert!(one.strength > 0.9);
        }
        assert!(worst < 0.2, "{worst}");
        assert!(
            (88.0..=100.0).contains(&inside),
            "{inside} of 100 within two deviations"
        );
    }

    /// The formula with products of rows, which the reflections avoid.
    #[test]
    fn reflections_give_the_textbook_solution() {
        let (rows, y) = rows(3, 500);
        let table = DMatrix::from_row_slice(500, 4, &rows);
        let (z, w) = (table.columns(0, 2).clone_owned(), table.columns(2, 2).clone_owned());
        let y_vector = DVector::from_column_slice(&y);
        let expected = (z.transpose() * &w).lu().solve(&(z.transpose() * y_vector)).unwrap();
        let one = found(&(rows, y));
        for j in 0..2 {
            assert!((one.solution.values[j] - expected[j]).abs() < 1e-12 * expected[j].abs());
        }
        let same: Vec<f64> = table.row_iter().flat_map(|r| [r[2], r[3], r[2], r[3]]).collect();
        let plain = found(&(same, one_right(3)));
        for j in 0..2 {
            assert!((plain.solution.values[j] - plain.least_squares.values[j]).abs() < 1e-10);
        }
    }

    fn one_right(seed: u64) -> Vec<f64> {
        rows(seed, 500).1
    }

    #[test]
    fn instruments_of_another_motion_are_refused() {
        let rows: Vec<f64> = (0..1000)
            .flat_map(|i| {
                let t = f64::from(i) * std::f64::consts::PI / 500.0;
                [(2.0 * t).sin(), t.sin()]
            })
            .collect();
        let y: Vec<f64> = (0..1000).map(f64::from).collect();
        let error = estimate_with_instruments(1, 1, |visit| visit(&rows, &y)).unwrap_err();
        assert!(matches!(error, LeastSquaresError::WeakInstruments { .. }), "{error}");
    }
}
