//! Physically possible parameters. Input: reduced rows and a description of the bodies; output: physical parameters
//! with positive definite pseudo-inertias that fit the recording and are nearest to the nominal ones.
//!
//! A body is possible if and only if its pseudo-inertia `[S h; h' m]`, `S = 1/2 tr(I) 1 - I`, is
//! positive definite: P. M. Wensing, S. Kim and J.-J. E. Slotine, "Linear matrix inequalities for
//! physically consistent inertial parameter identification", IEEE RA-L 3 (2018). The minimum of
//!
//! `1/2 |R p(x) - Q'y|^2 / s^2 + g sum_b D(P_b(x) | P_b(nominal))`,
//! `D(P | P0) = tr(P0^-1 P) - log det(P0^-1 P) - 4`,
//!
//! is taken over the physical parameters `x`, where `s` is the residuals' standard deviation with autocorrelation
//! allowed for. `D` is the entropic (Bregman) divergence of T. Lee, P. M. Wensing and F. C. Park, "Geometric robot
//! dynamic identification", IEEE T-RO 36 (2020). It does not depend on units or on the choice of frames, and it is
//! infinite at the limit of possible bodies, so that all bodies stay possible. Unlike the log-Cholesky parametrisation
//! of C. Rucker and P. M. Wensing (RA-L 7, 2022) it does not need ten parameters per body, so that parameters may be
//! shared between bodies, and planar and lumped ones need no special treatment. With a small `g` it decides only what
//! the recording does not. The minimum is found by Gauss-Newton steps, damped after Levenberg and Marquardt and
//! shortened to stay inside, with `g` decreasing from a value at which both terms are equal.
//!
//! Decision: a physical parameter is determined individually if its unit vector lies in the span of the rows. A lower
//! variance is no proof of that, because the limits of possible bodies and the nominal values of other parameters lower
//! it too.

use nalgebra::{DMatrix, DVector};

use crate::estimate::body_matrices::{BodyMatrix, NominalBodyMatrix};
use crate::estimate::deviations::ParameterUncertainty;
use crate::estimate::divergence::{BaseMap, MisfitFunction, step_scales};
use crate::estimate::error::PhysicalError;
use crate::estimate::prior::variance_inflation;
use crate::estimate::r_factor::RFactor;
use crate::estimate::solution::RegressionSolution;
use crate::estimate::thresholds::{INDIVIDUAL_MOST_OUTSIDE, PHYSICAL_SPAN_TOLERANCE};

/// Final weight `g` of the nominal values.
pub const NOMINAL_WEIGHT: f64 = 0.01;

/// Physically possible parameters with their uncertainty.
#[derive(Debug, Clone, PartialEq)]
pub struct PhysicalParameters {
    /// Values of all physical parameters.
    pub parameters: Vec<f64>,
    /// Their standard deviations if nominal values may be wrong by their own size (`g = 1`).
    pub std: Vec<f64>,
    /// Relative decrease of the variance by the recording, compared with the nominal values alone, 0 to 1; near 0 the
    /// value is the nominal one. For a parameter that is not
    /// [`individually_determined`](Self::individually_determined), a part of it comes from nominal values of others.
    pub from_recording: Vec<f64>,
    /// Whether the recording determines a parameter individually. If not, it determines only combinations with others,
    /// and the limits of possible bodies and the nominal values divide them.
    pub individually_determined: Vec<bool>,
    /// Base parameters of these physical parameters.
    pub base: Vec<f64>,
    /// Their standard deviations.
    pub base_std: Vec<f64>,
    /// Norm of the residual.
    pub residual_norm: f64,
    /// For each body the smallest eigenvalue of its matrix relative to the nominal one; near 0 the body is nearly
    /// impossible.
    pub margins: Vec<f64>,
    /// Number of iterations.
    pub iterations: usize,
}

/// Finds possible physical parameters that fit the rows of `r_factor` and are nearest to `nominal`, at which every body
/// must be possible. `solution` and `deviations` belong to `r_factor`.
pub fn physical_parameters(
    r_factor: &RFactor,
    solution: &RegressionSolution,
    deviations: &ParameterUncertainty,
    nominal: &[f64],
    base: &BaseMap<'_>,
    bodies: &[BodyMatrix<'_>],
) -> Result<PhysicalParameters, PhysicalError> {
    let noise = (solution.residual_variance() * variance_inflation(solution, deviations)).sqrt();
    // Without noise the misfit would have infinite weight, so the noise is limited from below.
    let least = 1e-7 * solution.measured_norm / (solution.rows.max(1) as f64).sqrt();
    let noise = if noise > least {
        noise
    } else {
        least.max(f64::MIN_POSITIVE.sqrt())
    };
    let references = bodies
        .iter()
        .map(|body| NominalBodyMatrix::new(body, nominal))
        .collect::<Result<Vec<_>, _>>()?;
    let problem = MisfitFunction {
        r: r_factor.r() / noise,
        right: r_factor.right_side() / noise,
        base,
        bodies,
        references,
        scales: step_scales(nominal),
    };
    let mut x = DVector::from_column_slice(nominal);
    let mut iterations = 0;
    // Start with equal weights of nominal values and recording, then follow the minima as the weight decreases.
    let mut weight = problem.value(&x, 0.0).unwrap_or(1.0).max(1.0);
    while weight > NOMINAL_WEIGHT {
        weight = (weight * 0.1_f64).max(NOMINAL_WEIGHT);
        iterations += problem.minimise(&mut x, weight)?;
    }
    // Uncertainty if nominal values may be wrong by their own size.
    let point = problem.evaluate_at(&x, 1.0).ok_or(PhysicalError::NoConvergence)?;
    let inverse = pseudo_inverse(&(&point.data + &point.prior));
    let before = pseudo_inverse(&point.prior);
    let (p, slopes) = base(x.as_slice());
    let spread = &slopes * &inverse * slopes.transpose();
    let misfit = r_factor.right_side() - r_factor.r() * &p;
    let n = nominal.len();
    Ok(PhysicalParameters {
        std: (0..n).map(|i| inverse[(i, i)].max(0.0).sqrt()).collect(),
        from_recording: (0..n)
            .map(|i| {
                if before[(i, i)] > 0.0 {
                    (1.0 - inverse[(i, i)] / before[(i, i)]).clamp(0.0, 1.0)
                } else {
                    f64::from(u8::from(point.data[(i, i)] > 0.0))
                }
            })
            .collect(),
        individually_determined: individually_determined(&(&problem.r * &slopes)),
        residual_norm: misfit.norm().hypot(r_factor.residual_norm()),
        base: p.iter().copied().collect(),
        base_std: spread.diagonal().iter().map(|v| v.max(0.0).sqrt()).collect(),
        margins: problem
            .references
            .iter()
            .zip(bodies)
            .map(|(reference, body)| reference.margin(&(body.matrix)(x.as_slice())))
            .collect(),
        parameters: x.iter().copied().collect(),
        iterations,
    })
}

/// Which unknowns of linear equations are determined individually: those whose unit vector lies in the span of the
/// rows.
fn individually_determined(rows: &DMatrix<f64>) -> Vec<bool> {
    let mut scaled = rows.clone();
    for mut column in scaled.column_iter_mut() {
        let norm = column.norm();
        if norm > 0.0 {
            column.unscale_mut(norm);
        }
    }
    let svd = scaled.svd(false, true);
    let largest = svd.singular_values.iter().copied().fold(0.0, f64::max);
    let Some(span) = svd.v_t.filter(|_| largest > 0.0) else {
        return vec![false; rows.ncols()];
    };
    let mut within = vec![0.0; rows.ncols()];
    for (direction, value) in span.row_iter().zip(svd.singular_values.iter()) {
        if *value > PHYSICAL_SPAN_TOLERANCE * largest {
            for (sum, component) in within.iter_mut().zip(direction.iter()) {
                *sum += component * component;
            }
        }
    }
    within
        .iter()
        .map(|share| *share > 1.0 - INDIVIDUAL_MOST_OUTSIDE)
        .collect()
}

/// Pseudo-inverse of a symmetric matrix with its diagonal scaled to 1; directions without information are left out.
fn pseudo_inverse(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let n = matrix.nrows();
    let scale = matrix.diagonal().map(|d| if d > 0.0 { d.sqrt().recip() } else { 0.0 });
    let scaled = DMatrix::from_fn(n, n, |i, j| scale[i] * matrix[(i, j)] * scale[j]);
    let eigen = scaled.symmetric_eigen();
    let mut inverse = DMatrix::zeros(n, n);
    for (k, value) in eigen.eigenvalues.iter().enumerate() {
        if *value > 1e-13 * n as f64 {
            let direction = eigen.eigenvectors.column(k).component_mul(&scale);
            inverse += &direction * direction.transpose() / *value;
        }
    }
    inverse
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimate::deviations::uncertainty_with_autocorrelation;
    use crate::estimate::{planar_pseudo_inertia, pseudo_inertia};
    use crate::test_noise::TestNoise;
    use crate::{LeastSquares, LeastSquaresError};

    /// The pseudo-inertia of point masses: always possible, and exactly what a body is.
    fn random_body(noise: &mut TestNoise) -> [f64; 10] {
        let mut body = [0.0; 10];
        for _ in 0..6 {
            let m = noise.uniform();
            let [x, y, z] = [0.3 * noise.normal(), 0.2 * noise.normal(), 0.1 + 0.4 * noise.normal()];
            let one = [
                m,
                m * x,
                m * y,
                m * z,
                m * (y * y + z * z),
                -m * x * y,
                -m * x * z,
                m * (x * x + z * z),
                -m * y * z,
                m * (x * x + y * y),
            ];
            for (sum, term) in body.iter_mut().zip(one) {
                *sum += term;
            }
        }
        body
    }

    fn matrix_of(x: &[f64]) -> DMatrix<f64> {
        pseudo_inertia(x[0], [x[1], x[2], x[3]], [x[4], x[5], x[6], x[7], x[8], x[9]])
    }

    /// Two bodies; of their 20 parameters 14 combinations are seen through a random regressor with noise.
    struct Case {
        truth: Vec<f64>,
        nominal: Vec<f64>,
        map: DMatrix<f64>,
        regression: LeastSquares,
        w: Vec<f64>,
        y: Vec<f64>,
    }

    fn case(seed: u64, sigma: f64) -> Case {
        let mut noise = TestNoise::new(seed);
        let truth: Vec<f64> = [random_body(&mut noise), random_body(&mut noise)].concat();
        let nominal: Vec<f64> = [random_body(&mut noise), random_body(&mut noise)].concat();
        let map = DMatrix::from_fn(14, 20, |_, _| noise.normal());
        let p = &map * DVector::from_column_slice(&truth);
        let (mut w, mut y) = (Vec::new(), Vec::new());
        for _ in 0..400 {
            let row: Vec<f64> = (0..14).map(|_| noise.normal()).collect();
            y.push(row.iter().zip(p.iter()).map(|(w, p)| w * p).sum::<f64>() + sigma * noise.normal());
            w.extend(row);
        }
        let mut regression = LeastSquares::new(14);
        regression.add_rows(&w, &y).unwrap();
        Case {
            truth,
            nominal,
            map,
            regression,
            w,
            y,
        }
    }

    fn bodies() -> Vec<BodyMatrix<'static>> {
        (0..2)
            .map(|k| BodyMatrix {
                name: format!("body {k}"),
                matrix: Box::new(move |x: &[f64]| matrix_of(&x[10 * k..10 * k + 10])),
                copies: 1.0,
            })
            .collect()
    }

    fn solved(case: &Case) -> (RFactor, RegressionSolution, ParameterUncertainty) {
        let solution = case.regression.solve().unwrap();
        let deviations: Result<ParameterUncertainty, LeastSquaresError> =
            uncertainty_with_autocorrelation(&solution, 1, |visit| visit(&case.w, &case.y));
        (RFactor::new(&case.regression), solution, deviations.unwrap())
    }

    fn find(case: &Case) -> PhysicalParameters {
        let (r_factor, solution, deviations) = solved(case);
        let base = |x: &[f64]| (&case.map * DVector::from_column_slice(x), case.map.clone());
        physical_parameters(&r_factor, &solution, &deviations, &case.nominal, &base, &bodies()).unwrap()
    }

    #[test]
    fn what_comes_out_is_possible_and_fits_as_well_as_least_squares() {
        for seed in 0..12 {
            let case = case(seed, 0.05);
            let (_, solution, _) = solved(&case);
            let found = find(&case);
            for body in found.parameters.chunks_exact(10) {
                assert!(matrix_of(body).cholesky().is_some());
            }
            assert!(found.margins.iter().all(|margin| *margin > 0.0));
            // The truth is possible and fits to the noise, so that possible parameters can as well.
            assert!(found.residual_norm < 1.05 * solution.residual_norm, "seed {seed}");
            assert!(found.residual_norm >= solution.residual_norm * (1.0 - 1e-9));
            let p = &case.map * DVector::from_column_slice(&case.truth);
            for (found, p) in found.base.iter().zip(p.iter()) {
                assert!((found - p).abs() < 0.05, "seed {seed}: {found} and {p}");
            }
        }
    }

    /// With heavy noise least squares is often impossible: no parameters of bodies have its values.
    #[test]
    fn under_heavy_noise_no_possible_neighbour_is_better() {
        let case = case(40, 3.0);
        let (r_factor, solution, deviations) = solved(&case);
        let found = find(&case);
        let noise = (solution.residual_variance() * variance_inflation(&solution, &deviations)).sqrt();
        let references: Vec<NominalBodyMatrix> = bodies()
            .iter()
            .map(|body| NominalBodyMatrix::new(body, &case.nominal).unwrap())
            .collect();
        let objective = |x: &[f64]| -> f64 {
            let misfit = (r_factor.r() * (&case.map * DVector::from_column_slice(x)) - r_factor.right_side()) / noise;
            let prior: f64 = (0..2)
                .map(|k| {
                    let relative = references[k].relative(&matrix_of(&x[10 * k..10 * k + 10]));
                    let eigenvalues = relative.symmetric_eigenvalues();
                    eigenvalues
                        .iter()
                        .map(|l| if *l > 0.0 { l - l.ln() - 1.0 } else { f64::INFINITY })
                        .sum::<f64>()
                })
                .sum();
            0.5 * misfit.norm_squared() + NOMINAL_WEIGHT * prior
        };
        let best = objective(&found.parameters);
        let mut random = TestNoise::new(9);
        for size in [1e-1, 1e-2, 1e-3, 1e-4] {
            for _ in 0..2000 {
                let near: Vec<f64> = found.parameters.iter().map(|x| x + size * random.normal()).collect();
                assert!(objective(&near) >= best - 1e-7 * best.abs().max(1.0));
            }
        }
        assert!(best <= objective(&case.nominal) && best <= objective(&case.truth));
    }

    /// A parameter that the recording does not determine stays at its nominal value, and is marked so.
    #[test]
    fn without_information_the_nominal_values_stay() {
        let mut case = case(7, 1e-4);
        // Only the first body is seen.
        let unseen = case.map.columns(10, 10) * DVector::from_column_slice(&case.truth[10..]);
        for (row, y) in case.w.chunks_exact(14).zip(&mut case.y) {
            *y -= row.iter().zip(unseen.iter()).map(|(w, p)| w * p).sum::<f64>();
        }
        case.regression = LeastSquares::new(14);
        case.regression.add_rows(&case.w, &case.y).unwrap();
        case.map.columns_mut(10, 10).fill(0.0);
        let found = find(&case);
        for j in 10..20 {
            assert!((found.parameters[j] - case.nominal[j]).abs() < 1e-6);
            assert!(found.from_recording[j] < 1e-9);
        }
        assert!(found.from_recording[..10].iter().all(|share| *share > 0.5));
        // Fourteen combinations of ten numbers determine each of them.
        assert_eq!(found.individually_determined, [[true; 10], [false; 10]].concat());
    }

    /// Of `x + y` and `z` only the last is determined individually, whatever the nominal values are.
    #[test]
    fn what_is_told_in_sums_only_is_not_told_alone() {
        let rows = DMatrix::from_row_slice(3, 4, &[1e3, 1e3, 0.0, 0.0, 2e3, 2e3, 1e-3, 0.0, 0.0, 0.0, 1e-3, 0.0]);
        assert_eq!(individually_determined(&rows), [false, false, true, false]);
        assert_eq!(individually_determined(&DMatrix::zeros(2, 2)), [false, false]);
        // Fourteen combinations of twenty numbers determine none of them.
        assert_eq!(find(&case(3, 0.05)).individually_determined, [false; 20]);
    }

    #[test]
    fn planar_bodies_need_inertia_about_their_centre() {
        assert!(planar_pseudo_inertia(2.0, [0.6, 0.8], 0.51).cholesky().is_some());
        assert!(planar_pseudo_inertia(2.0, [0.6, 0.8], 0.49).cholesky().is_none());
        let body = BodyMatrix {
            name: "link".to_owned(),
            matrix: Box::new(|x: &[f64]| planar_pseudo_inertia(x[0], [x[1], 0.0], x[2])),
            copies: 2.0,
        };
        let error = NominalBodyMatrix::new(&body, &[2.0, 1.0, 0.4]).err().unwrap();
        assert!(
            error.to_string().contains("link") && error.to_string().contains("inertia"),
            "{error}"
        );
        let error = NominalBodyMatrix::new(&body, &[0.0, 0.0, 0.4]).err().unwrap();
        assert!(error.to_string().contains("mass"), "{error}");
    }
}
