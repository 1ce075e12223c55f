//! Interpretation as in Table 1 of the paper. Input: identified base parameters and the physical parameters that are
//! taken as unknown. Output: all real solutions for the unknowns, with standard deviations.
//!
//! A base parameter is a polynomial in the unknowns once all other parameters are fixed at their nominal values. The
//! exact rank of the Jacobian at random points decides what the polynomials determine. As many equations as unknowns
//! are solved exactly (`roots`), so that no real solution is missed; more equations than unknowns by weighted least
//! squares (`nearest`). Standard deviations follow from those of the base parameters by the Jacobian.
//!
//! Decision: this is exact. Coefficients are the decimals of the files, a Groebner basis shows whether there are
//! finitely many solutions, and Sturm's theorem isolates all real ones. Nothing depends on a start value or a search
//! range; floating point enters with the standard deviations only.

mod nearest;
mod roots;
mod thresholds;

use std::fmt;

use nalgebra::{DMatrix, DVector};
use num_rational::BigRational;
use num_traits::Zero;

use crate::estimate::{NullDirection, null_directions};
use thresholds::{FREE_DIRECTION_SINGULAR_VALUE, MULTIPLE_SOLUTION_RATIO};

pub use modelmill_algebra::polynomial::{Polynomial, exact_decimal};

/// Input of an interpretation.
#[derive(Clone, Debug)]
pub struct InterpretationProblem {
    /// Each base parameter as a polynomial in the unknowns, all in equally many unknowns.
    pub equations: Vec<Polynomial>,
    /// Identified values of the base parameters, one per equation.
    pub values: Vec<f64>,
    /// Their covariance, in the products of their units; `None` if it is not known.
    pub covariance: Option<DMatrix<f64>>,
    /// Nominal values of the unknowns, in the order of the polynomials.
    pub nominal: Vec<f64>,
}

/// What base parameters determine about the unknowns.
#[derive(Clone, Debug, PartialEq)]
pub enum PhysicalInterpretation {
    /// As many independent equations as unknowns: all real solutions, possibly none.
    Exact {
        /// The solutions, the one nearest to the nominal values first.
        solutions: Vec<PhysicalSolution>,
    },
    /// More equations than unknowns: the best fits.
    LeastSquares {
        /// Local minima of the weighted error, best first; a single one if the equations are linear.
        solutions: Vec<PhysicalSolution>,
        /// Whether the equations are linear in the unknowns, so that there is no other minimum.
        is_linear: bool,
        /// Number of starting points of the search for minima.
        starts: usize,
    },
    /// The base parameters do not determine the unknowns.
    Undetermined {
        /// Changes of the unknowns that change no base parameter, to first order at the nominal values.
        directions: Vec<NullDirection>,
        /// Whether each unknown takes part in none of them.
        determined: Vec<bool>,
    },
}

/// A solution for the unknowns.
#[derive(Clone, Debug, PartialEq)]
pub struct PhysicalSolution {
    /// Values of the unknowns.
    pub values: Vec<f64>,
    /// Their standard deviations; `None` if those of the base parameters are not known, or for a multiple solution.
    pub std: Option<Vec<f64>>,
    /// Base parameter minus its value for the solution, for each equation.
    pub residuals: Vec<f64>,
    /// Sum of squares of the residuals relative to their standard deviations; `None` if these are not known, 0 for
    /// exact solutions.
    pub chi_squared: Option<f64>,
}

/// Why there is no interpretation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum InterpretError {
    /// The degree or the number of the equations is too high for an exact solution.
    TooHard,
}

impl fmt::Display for InterpretError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooHard => f.write_str(
                "the degree of the equations is too high for an exact solution; choose fewer unknowns, for example \
                 those that are coupled least on the page of equations",
            ),
        }
    }
}

impl std::error::Error for InterpretError {}

/// Solves for the unknowns. The lists of the system must have matching lengths (asserted) and finite values.
///
/// ```
/// use modelmill_identify::interpret::{InterpretationProblem, PhysicalInterpretation};
/// use modelmill_identify::interpret::{Polynomial, exact_decimal, interpret};
/// // p1 = m c and p2 = m c^2, with m = 2 kg and c = 0.5 m.
/// let product = |powers: &[(usize, u32)]| {
///     let mut p = Polynomial::new(2);
///     p.add_term(powers, &exact_decimal(1.0));
///     p
/// };
/// let system = InterpretationProblem {
///     equations: vec![product(&[(0, 1), (1, 1)]), product(&[(0, 1), (1, 2)])],
///     values: vec![1.0, 0.5],
///     covariance: None,
///     nominal: vec![1.0, 1.0],
/// };
/// let Ok(PhysicalInterpretation::Exact { solutions }) = interpret(&system) else { panic!() };
/// assert_eq!(solutions[0].values, [2.0, 0.5]);
/// ```
pub fn interpret(system: &InterpretationProblem) -> Result<PhysicalInterpretation, InterpretError> {
    let n = system.nominal.len();
    assert_eq!(system.equations.len(), system.values.len(), "one value per equation");
    assert!(
        system.equations.iter().all(|p| p.n == n),
        "one nominal value per unknown"
    );
    // Equations without any unknown contain no information.
    let used: Vec<usize> = (0..system.equations.len())
        .filter(|k| (0..n).any(|i| system.equations[*k].has_unknown(i)))
        .collect();
    let jacobian = |k: &usize| -> Vec<Polynomial> { (0..n).map(|i| system.equations[*k].derivative(i)).collect() };
    let jacobian: Vec<Vec<Polynomial>> = used.iter().map(jacobian).collect();
    // The rank of the Jacobian decides between undetermined, exact and least squares.
    let rank = generic_rank(&jacobian, n);
    if rank < n {
        return Ok(find_undetermined(system, &jacobian, n - rank));
    }
    if used.len() > n {
        return Ok(nearest::solve_least_squares(system, &used));
    }
    let equations: Vec<Polynomial> = used.iter().map(|k| equation(system, *k)).collect();
    let points = match roots::solve(&equations, n).map_err(|_| InterpretError::TooHard)? {
        roots::RealSolutions::Finite(points) => points,
        // Solutions form a curve although the rank is full almost everywhere: the values are a special case.
        roots::RealSolutions::Infinite => return Ok(find_undetermined(system, &jacobian, 0)),
    };
    let mut solutions: Vec<PhysicalSolution> = points
        .into_iter()
        .map(|values| PhysicalSolution {
            std: standard_deviations(system, &used, &values),
            residuals: residuals(system, &values),
            chi_squared: system.covariance.is_some().then_some(0.0),
            values,
        })
        .collect();
    // The solution nearest to the nominal values comes first, by relative differences.
    let distance = |one: &PhysicalSolution| -> f64 {
        let pairs = one.values.iter().zip(&system.nominal);
        pairs
            .map(|(x, x0)| ((x - x0) / (x0.abs() + x.abs()).max(f64::MIN_POSITIVE)).powi(2))
            .sum()
    };
    solutions.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
    Ok(PhysicalInterpretation::Exact { solutions })
}

/// Base parameter minus its identified value, as a polynomial.
fn equation(system: &InterpretationProblem, k: usize) -> Polynomial {
    let mut equation = system.equations[k].clone();
    equation.add_term(&[], &-exact_decimal(system.values[k]));
    equation
}

/// Identified values minus the values of all equations at a point.
fn residuals(system: &InterpretationProblem, at: &[f64]) -> Vec<f64> {
    let pairs = system.equations.iter().zip(&system.values);
    pairs.map(|(p, value)| value - p.value(at)).collect()
}

/// The Jacobian of some equations at a point.
fn jacobian_at(system: &InterpretationProblem, equations: &[usize], at: &[f64]) -> DMatrix<f64> {
    DMatrix::from_fn(equations.len(), at.len(), |r, i| {
        system.equations[equations[r]].derivative(i).value(at)
    })
}

/// Standard deviations of a solution of as many equations as unknowns: `J x' = p'` gives `cov x = J^-1 cov p J^-T`.
fn standard_deviations(system: &InterpretationProblem, used: &[usize], at: &[f64]) -> Option<Vec<f64>> {
    let covariance = system.covariance.as_ref()?;
    let mut jacobian = jacobian_at(system, used, at);
    // Scale rows and columns, so that units do not decide whether the matrix is singular.
    let scales: Vec<f64> = (0..used.len()).map(|r| jacobian.row(r).norm()).collect();
    for (r, scale) in scales.iter().enumerate() {
        if *scale == 0.0 {
            return None;
        }
        jacobian.row_mut(r).unscale_mut(*scale);
    }
    let columns: Vec<f64> = (0..at.len()).map(|i| jacobian.column(i).norm()).collect();
    for (i, scale) in columns.iter().enumerate() {
        jacobian.column_mut(i).unscale_mut(*scale);
    }
    let singular = jacobian.clone().singular_values();
    if singular.min() < MULTIPLE_SOLUTION_RATIO * singular.max() {
        return None;
    }
    // Undo the scaling.
    let inverse = jacobian.try_inverse()?;
    let inverse = DMatrix::from_fn(at.len(), used.len(), |i, r| inverse[(i, r)] / (columns[i] * scales[r]));
    let part = DMatrix::from_fn(used.len(), used.len(), |a, b| covariance[(used[a], used[b])]);
    let result = &inverse * part * inverse.transpose();
    Some(roots_of_diagonal(&result))
}

/// Roots of the diagonal of a covariance matrix; rounding below zero counts as zero.
fn roots_of_diagonal(covariance: &DMatrix<f64>) -> Vec<f64> {
    let diagonal = covariance.diagonal();
    diagonal.iter().map(|v| v.max(0.0).sqrt()).collect()
}

/// Rank that the Jacobian has almost everywhere: the highest of the exact ranks at three random points.
fn generic_rank(jacobian: &[Vec<Polynomial>], n: usize) -> usize {
    let mut state = 0x6d69_6c6c_u64;
    let mut draw = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        BigRational::from_integer((1 + (state >> 44)).into())
    };
    (0..3)
        .map(|_| {
            let point: Vec<BigRational> = (0..n).map(|_| draw()).collect();
            exact_rank(exact_jacobian(jacobian, &point))
        })
        .max()
        .unwrap_or(0)
}

/// Values of a polynomial Jacobian at a rational point.
fn exact_jacobian(jacobian: &[Vec<Polynomial>], point: &[BigRational]) -> Vec<Vec<BigRational>> {
    // Exact values, so that the rank does not depend on a tolerance.
    let row = |row: &Vec<Polynomial>| row.iter().map(|p| p.exact_value(point)).collect();
    jacobian.iter().map(row).collect()
}

/// Rank of a rational matrix by Gaussian elimination.
fn exact_rank(mut rows: Vec<Vec<BigRational>>) -> usize {
    let n = rows.first().map_or(0, Vec::len);
    let mut rank = 0;
    for c in 0..n {
        // Any entry that is not zero is a valid pivot in exact arithmetic.
        let Some(pivot) = (rank..rows.len()).find(|r| !rows[*r][c].is_zero()) else {
            continue;
        };
        rows.swap(rank, pivot);
        let (above, below) = rows.split_at_mut(rank + 1);
        let first = &above[rank];
        for row in below {
            if row[c].is_zero() {
                continue;
            }
            let factor = &row[c] / &first[c];
            for (entry, k) in row.iter_mut().zip(first).skip(c) {
                *entry -= &factor * k;
            }
        }
        rank += 1;
    }
    rank
}

/// Directions that are not determined, at the nominal values; unknowns that are nominally zero are moved to 1. There
/// are at least `at_least` directions.
fn find_undetermined(
    system: &InterpretationProblem,
    jacobian: &[Vec<Polynomial>],
    at_least: usize,
) -> PhysicalInterpretation {
    let n = system.nominal.len();
    // The derivative of a product vanishes where one factor is nominally zero, which would hide the dependence.
    let point: Vec<f64> = system
        .nominal
        .iter()
        .map(|x| if *x == 0.0 { 1.0 } else { *x })
        .collect();
    let scales = &point;
    let rows = jacobian.len().max(n);
    let mut matrix = DMatrix::zeros(rows, n);
    for (r, row) in jacobian.iter().enumerate() {
        for (i, p) in row.iter().enumerate() {
            matrix[(r, i)] = p.value(&point) * scales[i].abs();
        }
        let norm = matrix.row(r).norm();
        if norm > 0.0 {
            matrix.row_mut(r).unscale_mut(norm);
        }
    }
    // The null space from the smallest singular values.
    let svd = matrix.svd(false, true);
    let v_t = svd.v_t.expect("right singular vectors were requested");
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|a, b| svd.singular_values[*a].total_cmp(&svd.singular_values[*b]));
    let n_null = order
        .iter()
        .filter(|i| svd.singular_values[**i] < FREE_DIRECTION_SINGULAR_VALUE)
        .count()
        .max(at_least);
    let null_space = DMatrix::from_fn(n_null, n, |r, i| v_t[(order[r], i)]);
    let norms: Vec<f64> = scales.iter().map(|s| 1.0 / s.abs()).collect();
    let (determined, directions) = null_directions(&null_space, &norms);
    PhysicalInterpretation::Undetermined { directions, determined }
}

/// Matrix that whitens the equations: `L^-1` of the covariance's Cholesky factor, or one over the values if there is no
/// usable covariance. The flag states which.
fn whiten_rows(covariance: Option<&DMatrix<f64>>, used: &[usize], values: &[f64]) -> (DMatrix<f64>, bool) {
    let n = used.len();
    let part = covariance.map(|c| DMatrix::from_fn(n, n, |a, b| c[(used[a], used[b])]));
    let factor = part
        .and_then(nalgebra::Cholesky::new)
        .and_then(|cholesky| cholesky.l().try_inverse());
    match factor {
        Some(inverse) => (inverse, true),
        None => {
            let scale = |k: &usize| 1.0 / values[*k].abs().max(f64::MIN_POSITIVE);
            let weights: Vec<f64> = used.iter().map(scale).collect();
            let largest = weights.iter().copied().fold(0.0, f64::max);
            // A value of zero has no scale of its own.
            let weights = weights.iter().map(|w| {
                if *w >= 1.0 / f64::MIN_POSITIVE {
                    1.0_f64.min(largest)
                } else {
                    *w
                }
            });
            (DMatrix::from_diagonal(&DVector::from_iterator(n, weights)), false)
        }
    }
}

#[cfg(test)]
mod tests;
