//! Rank of a regressor at given values, eq. (9) of the paper, and the reduction by QR with column pivoting. Both are
//! numeric: valid for these values and samples, up to rounding. The exact reduction is in another crate.
//!
//! Sources: G. H. Golub and C. F. Van Loan, "Matrix Computations", 5.5; M. Gautier, "Numerical
//! calculation of the base inertial parameters of robots", J. Robotic Systems 8 (1991).

use nalgebra::{ColPivQR, DMatrix, DMatrixViewMut};
use serde::{Deserialize, Serialize};

use crate::estimate::error::LeastSquaresError;
use crate::estimate::thresholds::NOISE_COLUMN_TOLERANCE;

/// Rank of a regressor by its singular values.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RegressorRank {
    /// Singular values of the regressor with all columns scaled to norm 1, largest first; columns of zeros add zeros.
    pub singular_values: Vec<f64>,
    /// Number of singular values above the largest gap.
    pub rank: usize,
    /// Ratio of the last singular value that counts to the first that does not (or to the level of rounding, if that is
    /// higher or all count). Below about 1e3 the rank is uncertain.
    pub gap: f64,
    /// Ratio of the largest singular value to the last one that counts, of the scaled columns.
    pub scaled_condition_number: f64,
    /// The same for the regressor as it is, in its units.
    pub condition_number: f64,
}

/// A numeric reduction: columns that are kept, and the others as linear combinations of them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NumericReduction {
    /// Columns kept, in ascending order; as many as the rank.
    pub kept: Vec<usize>,
    /// The other columns, in ascending order.
    pub dependencies: Vec<NumericDependency>,
    /// Largest residual of a dependency, relative to the norm of its column.
    pub largest_residual: f64,
}

/// `column = sum of factor * kept column`; no factors for a column that is zero throughout.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NumericDependency {
    /// The column that is not kept.
    pub column: usize,
    /// `(kept column, factor)`, without factors that are zero to rounding.
    pub factors: Vec<(usize, f64)>,
}

/// The numeric rank of a stacked regressor, or of its [`LeastSquares::r_factor`](crate::LeastSquares::r_factor).
///
/// The rank is where the singular values of the scaled columns decrease by the largest ratio. Values below the level of
/// rounding, `max(rows, columns) * epsilon * largest`, are treated as equal to it.
/// Fails if an entry is not finite or there are no columns.
pub fn numeric_rank(w: &DMatrix<f64>) -> Result<RegressorRank, LeastSquaresError> {
    let norms = column_norms(w)?;
    rank_of_factor(&r_factor(w), &norms, w.nrows())
}

/// Ratio of the largest to the smallest singular value of a matrix in its units; `None` if the smallest is at the level
/// of rounding, so that columns are dependent.
/// Fails if an entry is not finite or there are no columns.
pub fn condition_number(w: &DMatrix<f64>) -> Result<Option<f64>, LeastSquaresError> {
    let norms = column_norms(w)?;
    condition_of_factor(&r_factor(w), &norms, w.nrows())
}

/// The numeric rank of a regressor as by [`numeric_rank`], and the condition number of some of its columns as by
/// [`condition_number`], from one factorisation.
/// Fails if an entry is not finite or there are no columns.
pub fn measure_rank_and_condition(
    w: &DMatrix<f64>,
    columns: &[usize],
) -> Result<(RegressorRank, Option<f64>), LeastSquaresError> {
    let mut norms = column_norms(w)?;
    let factor = r_factor(w);
    let rank = rank_of_factor(&factor, &norms, w.nrows())?;
    // Rounding noise is relative to the largest of the columns that count.
    norms = columns.iter().map(|k| w.column(*k).norm()).collect();
    zero_noise_columns(&mut norms);
    if columns.is_empty() {
        return Err(LeastSquaresError::NoParameters);
    }
    let condition = condition_of_factor(&factor.select_columns(columns), &norms, w.nrows())?;
    Ok((rank, condition))
}

/// The rank of a matrix of `n_rows` rows from its R factor and the norms of its columns.
fn rank_of_factor(factor: &DMatrix<f64>, norms: &[f64], n_rows: usize) -> Result<RegressorRank, LeastSquaresError> {
    let singular_values = singular_values(&scale(factor, norms))?;
    let largest = singular_values[0];
    if largest == 0.0 {
        return Ok(RegressorRank {
            singular_values,
            rank: 0,
            gap: f64::INFINITY,
            scaled_condition_number: f64::INFINITY,
            condition_number: f64::INFINITY,
        });
    }
    let floor = largest * f64::EPSILON * n_rows.max(factor.ncols()) as f64;
    let level = |i: usize| singular_values.get(i).map_or(floor, |s| s.max(floor));
    let mut best = (1, 0.0);
    for rank in 1..=singular_values.len() {
        let gap = level(rank - 1) / level(rank);
        if gap > best.1 {
            best = (rank, gap);
        }
    }
    let (rank, gap) = best;
    let plain = self::singular_values(factor)?;
    Ok(RegressorRank {
        scaled_condition_number: largest / singular_values[rank - 1],
        condition_number: plain[0] / plain[rank - 1],
        singular_values,
        rank,
        gap,
    })
}

/// The condition number of a matrix of `n_rows` rows from its R factor and the norms of its columns.
fn condition_of_factor(factor: &DMatrix<f64>, norms: &[f64], n_rows: usize) -> Result<Option<f64>, LeastSquaresError> {
    // Different units are no dependence, so this is tested on scaled columns.
    let scaled = singular_values(&scale(factor, norms))?;
    let floor = scaled[0] * f64::EPSILON * n_rows.max(factor.ncols()) as f64;
    if scaled[scaled.len() - 1] <= floor {
        return Ok(None);
    }
    let plain = singular_values(factor)?;
    Ok(Some(plain[0] / plain[plain.len() - 1]).filter(|c| c.is_finite()))
}

/// Chooses `rank` columns by QR with column pivoting on columns of norm 1, with the numeric factors of the others: the
/// fallback without an exact reduction.
/// Fails if an entry is not finite or there are no columns; `rank` is limited to the possible rank.
pub fn reduce_numerically(w: &DMatrix<f64>, rank: usize) -> Result<NumericReduction, LeastSquaresError> {
    let norms = column_norms(w)?;
    let scaled = scale(w, &norms);
    let n = w.ncols();
    let rank = rank
        .min(n)
        .min(w.nrows())
        .min(norms.iter().filter(|norm| **norm > 0.0).count());
    let qr = ColPivQR::new(scaled.clone());
    let mut order = DMatrix::from_fn(1, n, |_, j| j);
    qr.p().permute_columns(&mut order);
    let mut kept: Vec<usize> = order.iter().copied().take(rank).collect();
    kept.sort_unstable();
    // A QR factorisation of the chosen columns in the order of the file gives the factors.
    let basis = scaled.select_columns(&kept).qr();
    let (q, r) = (basis.q(), basis.r());
    let mut largest_residual: f64 = 0.0;
    let mut dependencies = Vec::with_capacity(n - rank);
    for column in (0..n).filter(|column| !kept.contains(column)) {
        let mut factors = Vec::new();
        if norms[column] > 0.0 && rank > 0 {
            let target = scaled.column(column);
            let coordinates = q.transpose() * target;
            let solution = r
                .solve_upper_triangular(&coordinates)
                .ok_or(LeastSquaresError::NoConvergence)?;
            largest_residual = largest_residual.max((target - &q * coordinates).norm());
            for (&column_kept, factor) in kept.iter().zip(solution.iter()) {
                if factor.abs() > 1e-9 {
                    factors.push((column_kept, factor * norms[column] / norms[column_kept]));
                }
            }
        }
        dependencies.push(NumericDependency { column, factors });
    }
    Ok(NumericReduction {
        kept,
        dependencies,
        largest_residual,
    })
}

/// Sets norms to zero that are rounding noise relative to the largest one.
pub(crate) fn zero_noise_columns(norms: &mut [f64]) {
    let largest = norms.iter().copied().fold(0.0, f64::max);
    for norm in norms {
        if *norm < NOISE_COLUMN_TOLERANCE * largest {
            *norm = 0.0;
        }
    }
}

/// The norms of all columns; rounding noise counts as zero.
fn column_norms(w: &DMatrix<f64>) -> Result<Vec<f64>, LeastSquaresError> {
    if w.ncols() == 0 {
        return Err(LeastSquaresError::NoParameters);
    }
    if w.nrows() == 0 {
        return Err(LeastSquaresError::NoRows);
    }
    if let Some(i) = w.iter().position(|value| !value.is_finite()) {
        return Err(LeastSquaresError::NotFinite {
            row: i % w.nrows(),
            column: Some(i / w.nrows()),
        });
    }
    let mut norms: Vec<f64> = w.column_iter().map(|column| column.norm()).collect();
    zero_noise_columns(&mut norms);
    Ok(norms)
}

/// The matrix, or its R factor, with columns of norm 1; columns of norm zero become zero.
fn scale(w: &DMatrix<f64>, norms: &[f64]) -> DMatrix<f64> {
    let mut scaled = w.clone();
    for (mut column, norm) in scaled.column_iter_mut().zip(norms) {
        if *norm > 0.0 {
            column.unscale_mut(*norm);
        } else {
            column.fill(0.0);
        }
    }
    scaled
}

/// The R factor of a tall matrix, or the matrix itself: same singular values, far less work. The factor of scaled columns
/// is the factor with scaled columns, since the errors of Householder's method are relative to each column.
///
/// Reflections of some columns are applied to the others together, `I - V T V'`: products of matrices take a fraction of
/// the time of one reflection after the other (Golub and Van Loan, 5.2.3).
fn r_factor(w: &DMatrix<f64>) -> DMatrix<f64> {
    let (rows, columns) = w.shape();
    if rows <= columns {
        return w.clone();
    }
    let mut reduced = w.clone();
    for start in (0..columns).step_by(REFLECTED_TOGETHER) {
        let width = REFLECTED_TOGETHER.min(columns - start);
        let mut panel = reduced.view_mut((start, start), (rows - start, width));
        let (vectors, factors) = reflect_panel(&mut panel);
        let right = start + width;
        if right < columns {
            let mut rest = reduced.view_mut((start, right), (rows - start, columns - right));
            let products = factors.tr_mul(&(vectors.transpose() * &rest));
            rest.gemm(-1.0, &vectors, &products, 1.0);
        }
    }
    reduced.resize_vertically_mut(columns, 0.0);
    reduced.fill_lower_triangle(0.0, 1);
    reduced
}

/// Number of columns whose reflections are applied to the others together.
const REFLECTED_TOGETHER: usize = 32;

/// Makes a panel upper triangular by reflections. Returns their vectors `V` and the triangle `T` with which their product is
/// `I - V T V'`.
fn reflect_panel(panel: &mut DMatrixViewMut<'_, f64>) -> (DMatrix<f64>, DMatrix<f64>) {
    let (rows, width) = panel.shape();
    let mut vectors = DMatrix::zeros(rows, width);
    let mut factors = DMatrix::zeros(width, width);
    for j in 0..width {
        let mut vector = panel.view((j, j), (rows - j, 1)).into_owned();
        let norm = vector.norm();
        // A column of zeros needs no reflection.
        if norm == 0.0 {
            continue;
        }
        // The sign avoids cancellation.
        let first = vector[0] + norm.copysign(vector[0]);
        vector /= first;
        vector[0] = 1.0;
        let factor = 2.0 / vector.norm_squared();
        for k in j..width {
            let mut column = panel.view_mut((j, k), (rows - j, 1));
            let product = factor * column.dot(&vector);
            column.zip_apply(&vector, |x, v| *x -= product * v);
        }
        vectors.view_mut((j, j), (rows - j, 1)).copy_from(&vector);
        // `H_1 .. H_j = I - V T V'` with one column more of `T`.
        let overlaps = vectors.view((j, 0), (rows - j, j)).tr_mul(&vector);
        let column = factors.view((0, 0), (j, j)) * overlaps * -factor;
        factors.view_mut((0, j), (j, 1)).copy_from(&column);
        factors[(j, j)] = factor;
    }
    (vectors, factors)
}

/// As many singular values as there are columns, largest first.
fn singular_values(factor: &DMatrix<f64>) -> Result<Vec<f64>, LeastSquaresError> {
    let n = factor.ncols();
    // Some columns of an R factor are tall again.
    let svd = r_factor(factor)
        .try_svd(false, false, f64::EPSILON, 10_000)
        .ok_or(LeastSquaresError::NoConvergence)?;
    let mut values: Vec<f64> = svd.singular_values.iter().copied().collect();
    values.resize(n, 0.0);
    values.sort_by(|a, b| b.total_cmp(a));
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::LeastSquares;
    use crate::test_noise::TestNoise;

    /// The factor has the products of the columns, and its rows are those of one reflection after the other but for their
    /// signs.
    #[test]
    fn the_factor_has_the_products_of_the_columns() {
        let mut noise = TestNoise::new(4);
        for (rows, columns) in [(3, 2), (40, 31), (100, 32), (150, 65), (300, 140), (5, 9)] {
            let mut w = DMatrix::from_fn(rows, columns, |_, _| noise.normal());
            let check = |w: &DMatrix<f64>| {
                let factor = r_factor(w);
                assert!((factor.tr_mul(&factor) - w.tr_mul(w)).amax() < 1e-14 * w.norm_squared());
                assert!(rows <= columns || factor == factor.upper_triangle());
                factor
            };
            let factor = check(&w);
            if rows > columns {
                let textbook = w.clone().qr().r();
                assert!(
                    (textbook.abs() - factor.abs()).amax() < 1e-13 * w.norm(),
                    "{rows}, {columns}"
                );
            }
            if columns > 3 {
                // A column of zeros, and one that depends on others: the rows behind it are any.
                w.column_mut(1).fill(0.0);
                let sum = w.column(0) + w.column(2);
                w.set_column(3, &sum);
                check(&w);
            }
        }
    }

    /// Six columns of rank 3 in very different units, one of them zero.
    fn sample() -> DMatrix<f64> {
        let mut noise = TestNoise::new(8);
        let free = DMatrix::from_fn(80, 3, |_, _| noise.normal());
        DMatrix::from_fn(80, 6, |i, j| match j {
            0 => free[(i, 0)],
            1 => 1e-4 * free[(i, 1)],
            2 => 1e3 * free[(i, 2)],
            3 => 2.0 * free[(i, 0)] - 3.0 * free[(i, 1)],
            4 => 0.0,
            _ => 1e-2 * (free[(i, 2)] + 0.5 * free[(i, 1)]),
        })
    }

    #[test]
    fn the_rank_stands_at_the_gap() {
        let rank = numeric_rank(&sample()).unwrap();
        assert_eq!(rank.rank, 3);
        assert!(rank.gap > 1e10 && rank.scaled_condition_number < 10.0, "{rank:?}");
        assert_eq!(rank.singular_values.len(), 6);
        let full = numeric_rank(&sample().columns(0, 3).into_owned()).unwrap();
        assert_eq!(full.rank, 3);
        assert!(full.gap > 1e10);
        assert!((full.condition_number / 1e7 - 1.0).abs() < 0.5);
    }

    /// The last column that counts is not where a condition number ends: a column that depends on others has none.
    #[test]
    fn the_condition_is_that_of_all_columns() {
        let free = sample().columns(0, 3).into_owned();
        let condition = condition_number(&free).unwrap().unwrap();
        assert!((condition / 1e7 - 1.0).abs() < 0.5, "{condition:e}");
        assert_eq!(condition_number(&sample()).unwrap(), None);
        let mut near = free.columns(0, 2).into_owned();
        near.column_mut(1).copy_from(&free.column(0));
        assert_eq!(condition_number(&near).unwrap(), None);
        near[(0, 1)] += 1e-6;
        let condition = condition_number(&near).unwrap().unwrap();
        assert!(condition > 1e6 && condition < 1e9, "{condition:e}");
    }

    #[test]
    fn one_factorisation_gives_rank_and_condition() {
        let w = sample();
        for columns in [&[0, 1, 2][..], &[1, 5], &[0, 1, 2, 3], &[4]] {
            let (rank, condition) = measure_rank_and_condition(&w, columns).unwrap();
            assert_eq!(rank, numeric_rank(&w).unwrap());
            let alone = condition_number(&w.select_columns(columns)).unwrap();
            match (condition, alone) {
                (Some(a), Some(b)) => assert!((a / b - 1.0).abs() < 1e-9, "{columns:?}: {a} and {b}"),
                (a, b) => assert_eq!(a, b, "{columns:?}"),
            }
        }
        assert!(measure_rank_and_condition(&w, &[]).is_err());
    }

    #[test]
    fn the_triangle_of_a_stream_has_the_rank_of_its_rows() {
        let w = sample();
        let mut regression = LeastSquares::new(6);
        for row in w.row_iter() {
            let row: Vec<f64> = row.iter().copied().collect();
            regression.add_rows(&row, &[0.0]).unwrap();
        }
        let (direct, streamed) = (numeric_rank(&w).unwrap(), numeric_rank(&regression.r_factor()).unwrap());
        assert_eq!(direct.rank, streamed.rank);
        for (a, b) in direct.singular_values.iter().zip(&streamed.singular_values) {
            assert!((a - b).abs() < 1e-13);
        }
    }

    #[test]
    fn pivoted_qr_gives_dependencies_that_hold() {
        let w = sample();
        let reduction = reduce_numerically(&w, 3).unwrap();
        assert_eq!(reduction.kept.len(), 3);
        assert!(reduction.largest_residual < 1e-13);
        assert!(
            reduction
                .dependencies
                .iter()
                .any(|d| d.column == 4 && d.factors.is_empty())
        );
        for dependency in &reduction.dependencies {
            for i in 0..w.nrows() {
                let sum: f64 = dependency.factors.iter().map(|(k, a)| a * w[(i, *k)]).sum();
                let scale = w.column(dependency.column).amax().max(1e-300);
                assert!((sum - w[(i, dependency.column)]).abs() < 1e-12 * scale.max(1e-12));
            }
        }
    }

    /// A column of rounding noise was scaled to norm 1 and counted.
    #[test]
    fn rounding_noise_is_no_column() {
        let mut noise = TestNoise::new(5);
        let w = DMatrix::from_fn(80, 3, |_, j| noise.normal() * [1e3, 1e-4, 1e-13][j]);
        let rank = numeric_rank(&w).unwrap();
        assert_eq!(rank.rank, 2);
        assert!(rank.gap > 1e10);
        let reduction = reduce_numerically(&w, 3).unwrap();
        assert_eq!(reduction.kept, [0, 1]);
        assert_eq!(reduction.dependencies[0].factors, []);
        let mut regression = LeastSquares::new(3);
        for row in w.row_iter() {
            let row: Vec<f64> = row.iter().copied().collect();
            regression.add_rows(&row, &[row[0] + 2.0 * row[1]]).unwrap();
        }
        let solution = regression.solve_near(&[0.0, 0.0, 7.0]).unwrap();
        assert_eq!((solution.rank, solution.values[2].to_bits()), (2, 7.0_f64.to_bits()));
        assert_eq!(solution.determined, [true, true, false]);
        assert!((solution.values[1] - 2.0).abs() < 1e-6);
    }

    #[test]
    fn degenerate_matrices_are_no_trouble() {
        assert!(numeric_rank(&DMatrix::zeros(3, 0)).is_err());
        assert!(numeric_rank(&DMatrix::zeros(0, 3)).is_err());
        assert!(numeric_rank(&DMatrix::from_element(3, 2, f64::NAN)).is_err());
        assert_eq!(numeric_rank(&DMatrix::zeros(5, 3)).unwrap().rank, 0);
        assert_eq!(reduce_numerically(&DMatrix::zeros(5, 3), 2).unwrap().kept.len(), 0);
        assert_eq!(numeric_rank(&DMatrix::from_element(2, 5, 1.0)).unwrap().rank, 1);
    }
}
