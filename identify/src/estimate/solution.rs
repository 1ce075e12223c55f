//! Solution of a regression. Input: its R factor. Output: parameters, rank, condition numbers and classical standard
//! deviations, with a list of what is not determined.

use nalgebra::{DMatrix, DVector};

use crate::estimate::error::LeastSquaresError;
use crate::estimate::numeric_rank::zero_noise_columns;
use crate::estimate::thresholds::RANK_TOLERANCE;
use crate::estimate::undetermined::{NullDirection, null_directions};

/// Number of rows of a regression.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct RowCount {
    /// All of them.
    pub(crate) shown: usize,
    /// Those that are not zero: `0 = 0` is no equation.
    pub(crate) informative: usize,
}

/// Solution of a regression. Lists are in the order of the regressor's columns.
#[derive(Debug, Clone, PartialEq)]
pub struct RegressionSolution {
    /// Parameters, in the units of measured value per unit of the column.
    pub values: Vec<f64>,
    /// Standard deviations for independent residuals of equal variance, which recordings hardly ever have; infinite for
    /// undetermined parameters, NaN if there are no more rows than parameters. See
    /// [`ParameterUncertainty`](crate::ParameterUncertainty) for realistic ones.
    pub classical_std: Vec<f64>,
    /// Ratio of the largest to the smallest singular value of the regressor (2-norm); infinite if the rank is
    /// deficient.
    pub condition_number: f64,
    /// The same after scaling all columns to norm 1, which is independent of units.
    pub scaled_condition_number: f64,
    /// `|W p - y|`, 2-norm.
    pub residual_norm: f64,
    /// `|y|`, 2-norm.
    pub measured_norm: f64,
    /// Number of rows with information; rows of zeros, such as those with weight 0, do not count.
    pub rows: usize,
    /// Number of all rows.
    pub shown: usize,
    /// Numeric rank of the column-scaled regressor.
    pub rank: usize,
    /// Whether the rows determine each parameter.
    pub determined: Vec<bool>,
    /// Directions along which parameters may change without any effect on the rows;
    /// `n - rank` of them.
    pub undetermined: Vec<NullDirection>,
    /// Pseudo-inverse of `R`, so that `(W'W)^+ = r_inverse * r_inverse'`.
    pub(crate) r_inverse: DMatrix<f64>,
}

impl RegressionSolution {
    /// `(W'W)^+`, the classical covariance for residuals of variance 1.
    pub fn unit_covariance(&self) -> DMatrix<f64> {
        &self.r_inverse * self.r_inverse.transpose()
    }

    /// Adopts the inverse and the classical standard deviations of another solution for the same parameters, which
    /// relates values to gradients.
    pub(crate) fn adopt_inverse(&mut self, other: Self) {
        self.r_inverse = other.r_inverse;
        self.classical_std = other.classical_std;
        for (mine, theirs) in self.determined.iter_mut().zip(other.determined) {
            *mine &= theirs;
        }
    }

    /// Variance of the residuals, corrected for the degrees of freedom; NaN without any.
    pub fn residual_variance(&self) -> f64 {
        match self.rows.saturating_sub(self.rank) {
            0 => f64::NAN,
            freedom => self.residual_norm.powi(2) / freedom as f64,
        }
    }

    /// One sentence for each undetermined direction, with the parameters' names.
    ///
    /// ```
    /// # use modelmill_identify::LeastSquares;
    /// let mut regression = LeastSquares::new(2);
    /// regression.add_rows(&[1.0, 2.0, 3.0, 6.0], &[1.0, 3.0])?;
    /// let names = ["a".to_owned(), "b".to_owned()];
    /// let says = regression.solve()?.describe_undetermined(&names);
    /// assert_eq!(says, ["only a combination of a and b is determined: a + 1 with b - 0.5 changes nothing"]);
    /// # Ok::<(), modelmill_identify::LeastSquaresError>(())
    /// ```
    pub fn describe_undetermined(&self, names: &[String]) -> Vec<String> {
        self.undetermined
            .iter()
            .map(|direction| direction.describe(names))
            .collect()
    }
}

/// Solves the factor `[R, Q'y; 0, +-|residual|]`, row-major, of a number of rows. Undetermined parameters stay at
/// `nominal`, whose length is the number of parameters.
pub(crate) fn solve_r_factor(
    triangle: &[f64],
    rows: RowCount,
    nominal: &[f64],
) -> Result<RegressionSolution, LeastSquaresError> {
    let n = nominal.len();
    let width = n + 1;
    let r = DMatrix::from_fn(n, n, |i, j| triangle[i * width + j]);
    let qty = DVector::from_fn(n, |i, _| triangle[i * width + n]);
    let corner = triangle[n * width + n];
    let mut norms: Vec<f64> = r.column_iter().map(|column| column.norm()).collect();
    zero_noise_columns(&mut norms);
    let scaled = DMatrix::from_fn(n, n, |i, j| if norms[j] > 0.0 { r[(i, j)] / norms[j] } else { 0.0 });
    for norm in &mut norms {
        if *norm == 0.0 {
            *norm = 1.0;
        }
    }
    // The rank follows from the singular values of the scaled columns.
    let svd =
        nalgebra::SVD::try_new(scaled, true, true, f64::EPSILON, 10_000).ok_or(LeastSquaresError::NoConvergence)?;
    let (Some(u), Some(vt)) = (&svd.u, &svd.v_t) else {
        return Err(LeastSquaresError::NoConvergence);
    };
    let s = &svd.singular_values;
    let largest = s.max();
    let kept: Vec<usize> = (0..n).filter(|&i| s[i] > RANK_TOLERANCE * largest).collect();
    let rank = kept.len();
    let r_inverse = if rank == n {
        // Back substitution keeps the small parameters accurate.
        r.clone()
            .solve_upper_triangular(&DMatrix::identity(n, n))
            .ok_or(LeastSquaresError::NoConvergence)?
    } else {
        DMatrix::from_fn(n, n, |i, j| {
            kept.iter().map(|&k| vt[(k, i)] * u[(j, k)] / s[k]).sum::<f64>() / norms[i]
        })
    };
    let dropped: Vec<usize> = (0..n).filter(|i| !kept.contains(i)).collect();
    // Right singular vectors of the zero singular values are the undetermined directions.
    let null_space = DMatrix::from_fn(dropped.len(), n, |i, j| vt[(dropped[i], j)]);
    let (determined, undetermined) = null_directions(&null_space, &norms);
    let start = DVector::from_column_slice(nominal);
    let misfit = &qty - &r * &start;
    let values: DVector<f64> = if rank == n {
        r.solve_upper_triangular(&qty).ok_or(LeastSquaresError::NoConvergence)?
    } else {
        start + &r_inverse * &misfit
    };
    let left_over = &qty - &r * &values;
    let residual_norm = left_over.norm().hypot(corner);
    let ratio = |values: &DVector<f64>| {
        if rank == n {
            values.max() / values.min()
        } else {
            f64::INFINITY
        }
    };
    let plain = r
        .clone()
        .try_svd(false, false, f64::EPSILON, 10_000)
        .ok_or(LeastSquaresError::NoConvergence)?;
    let mut solution = RegressionSolution {
        values: values.iter().copied().collect(),
        classical_std: Vec::new(),
        condition_number: ratio(&plain.singular_values),
        scaled_condition_number: ratio(s),
        residual_norm,
        measured_norm: qty.norm().hypot(corner),
        rows: rows.informative,
        shown: rows.shown,
        rank,
        determined,
        undetermined,
        r_inverse,
    };
    let variance = solution.residual_variance();
    solution.classical_std = (0..n)
        .map(|i| {
            if solution.determined[i] {
                variance.sqrt() * solution.r_inverse.row(i).norm()
            } else {
                f64::INFINITY
            }
        })
        .collect();
    Ok(solution)
}
