//! More base parameters than unknowns: the values that fit best, by weighted least squares.
//!
//! Gauss-Newton steps with D. W. Marquardt's damping (1963), from the nominal values and from the exact solutions of
//! subsets of the equations. Linear equations have one minimum; of others those that were met are told.

use nalgebra::{DMatrix, DVector};

use super::roots::{RealSolutions, solve};
use super::{
    InterpretationProblem, PhysicalInterpretation, PhysicalSolution, equation, jacobian_at,
    residuals, roots_of_diagonal, whiten_rows,
};
use modelmill_algebra::polynomial::Polynomial;

/// Subsets of the equations that are solved for starts.
const MOST_SUBSETS: usize = 40;
const MOST_STEPS: usize = 500;

/// Solutions of least squares; `used` are the equations in which unknowns stand.
pub(crate) fn solve_least_squares(
    system: &InterpretationProblem,
    used: &[usize],
) -> PhysicalInterpretation {
    let n = system.nominal.len();
    let (weights, is_weighted) = whiten_rows(system.covariance.as_ref(), used, &system.values);
    let is_linear = used.iter().all(|k| system.equations[*k].degree() <= 1);
    let mut starts = vec![system.nominal.clone()];
    if !is_linear {
        for subset in subsets(used, n).into_iter().take(MOST_SUBSETS) {
            let equations: Vec<Polynomial> = subset.iter().map(|k| equation(system, *k)).collect();
            // A subset that is too hard or has no isolated solutions gives no start, and nothing is lost.
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
        let is_known = solutions.iter().any(|known| {
            let pairs = known.values.iter().zip(&values);
            pairs
                .zip(&system.nominal)
                .all(|((a, b), x0)| (a - b).abs() <= 1e-6 * (a.abs() + b.abs() + 1e-3 * x0.abs()))
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

/// A local minimum with its error and covariance; `None` where none is reached.
fn descend(
    system: &InterpretationProblem,
    used: &[usize],
    weights: &DMatrix<f64>,
    start: &[f64],
) -> Option<(Vec<f64>, f64, DMatrix<f64>)> {
    let n = start.len();
    let errors = |x: &[f64]| {
        let e = used
            .iter()
            .map(|k| system.values[*k] - system.equations[*k].value(x));
        weights * DVector::from_iterator(used.len(), e)
    };
    let mut x = start.to_vec();
    let mut e = errors(&x);
    let mut damping = 1e-3;
    for _ in 0..MOST_STEPS {
        let jacobian = weights * jacobian_at(system, used, &x);
        let gradient = jacobian.transpose() * &e;
        let normal = jacobian.transpose() * &jacobian;
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
    // A point that is no minimum but where the descent came to rest is none of the answers.
    let gradient = jacobian.transpose() * &e;
    let scale = jacobian.norm() * e.norm();
    if gradient.norm() > 1e-6 * scale && e.norm() > 1e-9 {
        return None;
    }
    let covariance = (jacobian.transpose() * &jacobian).try_inverse()?;
    Some((x, e.norm_squared(), covariance))
}

/// All choices of `n` of the equations, in the order of a dictionary, as far as anybody asks.
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
