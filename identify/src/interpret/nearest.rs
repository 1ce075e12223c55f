//! More base parameters than unknowns: the unknowns that fit best, by weighted least squares. Input: equations and
//! values; output: local minima.
//!
//! Gauss-Newton steps with D. W. Marquardt's damping (1963), from the nominal values and from the exact solutions of
//! subsets of the equations. Linear equations have one minimum; of others those that were found are returned.

use nalgebra::{DMatrix, DVector};

use super::roots::{RealSolutions, solve};
use super::thresholds::{MINIMUM_MOST_GRADIENT, SAME_MINIMUM_NOMINAL_PART, SAME_MINIMUM_PART, SOLUTION_MOST_ERROR};
use super::{
    InterpretationProblem, PhysicalInterpretation, PhysicalSolution, equation, jacobian_at, residuals,
    roots_of_diagonal, whiten_rows,
};
use modelmill_algebra::polynomial::Polynomial;

/// Largest number of subsets of the equations that are solved for starting points.
const MOST_SUBSETS: usize = 40;
/// Largest number of steps of a descent.
const MOST_STEPS: usize = 500;

/// Least squares solutions; `used` are the equations that contain unknowns.
pub(crate) fn solve_least_squares(system: &InterpretationProblem, used: &[usize]) -> PhysicalInterpretation {
    let n = system.nominal.len();
    let (weights, is_weighted) = whiten_rows(system.covariance.as_ref(), used, &system.values);
    // Linear equations have one minimum, so one starting point is enough.
    let is_linear = used.iter().all(|k| system.equations[*k].degree() <= 1);
    let mut starts = vec![system.nominal.clone()];
    if !is_linear {
        for subset in subsets(used, n).into_iter().take(MOST_SUBSETS) {
            let equations: Vec<Polynomial> = subset.iter().map(|k| equation(system, *k)).collect();
            // A subset that is too hard or has no isolated solutions gives no starting point; others do.
            if let Ok(RealSolutions::Finite(points)) = solve(&equations, n) {
                starts.extend(points);
            }
        }
    }
    let mut solutions: Vec<PhysicalSolution> = Vec::new();
    for start in &starts {
        let Some((values, error, covariance)) = descend(system, used, &weights, start) else {
            continue;
        };
        // Minima that agree to six digits are the same.
        let is_known = solutions.iter().any(|known| {
            let pairs = known.values.iter().zip(&values);
            pairs.zip(&system.nominal).all(|((a, b), x0)| {
                (a - b).abs() <= SAME_MINIMUM_PART * (a.abs() + b.abs() + SAME_MINIMUM_NOMINAL_PART * x0.abs())
            })
        });
        if !is_known {
            solutions.push(PhysicalSolution {
                std: is_weighted.then(|| roots_of_diagonal(&covariance)),
                residuals: residuals(system, &values),
                chi_squared: is_weighted.then_some(error),
                values,
            });
        }
    }
    // Sort by the weighted squared error.
    let error = |one: &PhysicalSolution| -> f64 {
        let e = DVector::from_iterator(used.len(), used.iter().map(|k| one.residuals[*k]));
        (&weights * e).norm_squared()
    };
    solutions.sort_by(|a, b| error(a).total_cmp(&error(b)));
    PhysicalInterpretation::LeastSquares {
        solutions,
        is_linear,
        starts: starts.len(),
    }
}

/// A local minimum with its weighted squared error and covariance; `None` if none is reached.
fn descend(
    system: &InterpretationProblem,
    used: &[usize],
    weights: &DMatrix<f64>,
    start: &[f64],
) -> Option<(Vec<f64>, f64, DMatrix<f64>)> {
    let n = start.len();
    // Whitened residuals at a point.
    let errors = |x: &[f64]| {
        let e = used.iter().map(|k| system.values[*k] - system.equations[*k].value(x));
        weights * DVector::from_iterator(used.len(), e)
    };
    let mut x = start.to_vec();
    let mut e = errors(&x);
    let mut damping = 1e-3;
    for _ in 0..MOST_STEPS {
        let jacobian = weights * jacobian_at(system, used, &x);
        let gradient = jacobian.transpose() * &e;
        let normal = jacobian.transpose() * &jacobian;
        // Marquardt's damping scales the diagonal, so units do not matter.
        let mut damped = normal.clone();
        for i in 0..n {
            damped[(i, i)] += damping * normal[(i, i)].max(f64::MIN_POSITIVE);
        }
        let step = damped.cholesky()?.solve(&gradient);
        let next: Vec<f64> = x.iter().zip(step.iter()).map(|(a, b)| a + b).collect();
        let next_e = errors(&next);
        let is_small = x
            .iter()
            .zip(step.iter())
            .all(|(a, b)| b.abs() <= 1e-13 * a.abs().max(1e-300));
        // Accept the step and reduce the damping, or reject it and increase the damping.
        if next_e.norm_squared() <= e.norm_squared() {
            x = next;
            e = next_e;
            damping = (damping * 0.1_f64).max(1e-14);
        } else {
            damping *= 10.0;
        }
        if is_small || damping > 1e12 {
            break;
        }
    }
    let jacobian = weights * jacobian_at(system, used, &x);
    // A point at which the descent stopped without a zero gradient is no minimum.
    let gradient = jacobian.transpose() * &e;
    let scale = jacobian.norm() * e.norm();
    if gradient.norm() > MINIMUM_MOST_GRADIENT * scale && e.norm() > SOLUTION_MOST_ERROR {
        return None;
    }
    // Covariance of a least squares estimate with whitened rows.
    let covariance = (jacobian.transpose() * &jacobian).try_inverse()?;
    Some((x, e.norm_squared(), covariance))
}

/// Choices of `n` of the equations in lexicographic order, up to the largest number.
fn subsets(of: &[usize], n: usize) -> Vec<Vec<usize>> {
    let mut found = Vec::new();
    let mut chosen: Vec<usize> = (0..n).collect();
    while found.len() < MOST_SUBSETS {
        found.push(chosen.iter().map(|i| of[*i]).collect());
        let Some(last) = (0..n).rev().find(|i| chosen[*i] < of.len() - n + i) else {
            break;
        };
        chosen[last] += 1;
        for i in last + 1..n {
            chosen[i] = chosen[i - 1] + 1;
        }
    }
    found
}
