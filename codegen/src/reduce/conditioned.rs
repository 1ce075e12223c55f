//! Retained columns whose factors stay moderate at the model file's values.
//!
//! Independence of columns is determined for general constants. Near the file's own values some columns may nearly
//! coincide, and factors of columns that are written by these become very large. So the factors are computed in double
//! precision, at constants slightly different from the file's (exactly at special values it would not be visible that
//! columns coincide). A retained column with a large factor is exchanged for that dependent column, until all factors
//! are moderate (the exchanges of M. Gu and S. C. Eisenstat, "Efficient algorithms for computing a strong
//! rank-revealing QR factorization", 1996, over a base that is given).

use std::collections::BTreeMap;

use modelmill_algebra::field::RandomStream;
use modelmill_spec::Mechanism;
use nalgebra::DMatrix;

use super::numeric::{REACH, sample_observations};
use super::reduction::BaseReduction;
use crate::expr::independent::SEED;
use crate::expr::{ExprId, Graph};
use crate::loops::numeric_poses::uniform_symmetric;
use crate::regressor::projection::LoopProjection;

/// Largest factor without an exchange, where each column is measured by the largest column with the same unit. Factors
/// of usual bases are far below, and a base within this limit loses three of sixteen digits.
const MOST_GROWTH: f64 = 1e3;

/// How far constants are moved, in rad or relative to their size. Columns that coincide at the file's values then
/// differ by more than rounding errors, even if they differ only to second order.
const BESIDE: f64 = 1e-5;

/// Largest residual, relative to its size, of a column that is a combination of others.
const MADE_UP: f64 = 1e-6;

/// Columns of the regressor.
pub(super) struct RegressorColumns<'a> {
    /// Their expressions, drive by drive.
    pub(super) values: &'a [Vec<ExprId>],
    /// SI units of their products.
    pub(super) units: &'a [String],
}

/// Least relative residual of every retained column on those before it at which factors in double precision are
/// meaningful.
const CERTAIN: f64 = 1e-7;

/// Another selection of retained columns.
pub(super) struct ColumnExchange {
    /// The retained columns.
    pub(super) retained: Vec<usize>,
    /// Whether the large factors that caused it are known to some digits. If retained columns nearly depend on each
    /// other at the file's values, these factors may be rounding errors, and the true ones moderate.
    pub(super) is_certain: bool,
}

/// The retained columns, some exchanged for dependent ones; `None` if no exchange is needed or nothing can be sampled.
/// Columns in `named` are never exchanged.
pub(super) fn exchange_columns(
    graph: &mut Graph,
    mechanism: &Mechanism,
    projection: &LoopProjection,
    columns: &RegressorColumns<'_>,
    retained: &[usize],
    dependent: &[usize],
    named: &[usize],
) -> Option<ColumnExchange> {
    if dependent.is_empty() {
        return None;
    }
    // At the file's own constants only if the moved ones cannot be sampled.
    let moved = perturb_constants(mechanism);
    let n_rows = columns.values.len() + columns.values.len() / 2;
    let mut sampled = |mechanism: &Mechanism| {
        let w = sample_observations(graph, mechanism, projection, columns.values, n_rows, REACH).ok()?;
        DependenceFactors::new(&w, columns.units, retained, dependent)
    };
    let mut factors = sampled(&moved).or_else(|| sampled(mechanism))?;
    let fixed: Vec<bool> = retained.iter().map(|k| named.contains(k)).collect();
    let mut has_changed = false;
    // Each exchange increases the volume that the retained columns span, so this ends.
    while let Some((i, j)) = factors.largest_factor(&fixed) {
        factors.exchange_pair(i, j);
        has_changed = true;
    }
    has_changed.then_some(ColumnExchange {
        retained: factors.retained,
        is_certain: factors.least_kept > CERTAIN,
    })
}

/// Whether the factors of a reduction are moderate at the file's values. `shown` has the positions of its columns.
pub(super) fn is_moderate(
    graph: &mut Graph,
    mechanism: &Mechanism,
    projection: &LoopProjection,
    columns: &RegressorColumns<'_>,
    reduction: &BaseReduction,
    shown: &[usize],
) -> bool {
    let n_rows = columns.values.len() + columns.values.len() / 2;
    let Ok(w) = sample_observations(graph, mechanism, projection, columns.values, n_rows, REACH) else {
        return false;
    };
    let shares = relative_column_sizes(&w, columns.units);
    let share = |product: usize| shares[shown[product]];
    let constants: Vec<f64> = mechanism.constants.iter().map(|c| c.value).collect();
    let lines = reduction.factors(&constants);
    reduction.dependencies.iter().zip(lines).all(|(line, by)| {
        by.into_iter().all(|(k, factor)| {
            let growth = factor * share(line.product) / share(reduction.retained[k]);
            growth.abs() <= MOST_GROWTH
        })
    })
}

/// The norm of each column divided by the largest norm of a column with the same unit.
fn relative_column_sizes(w: &DMatrix<f64>, units: &[String]) -> Vec<f64> {
    let mut longest: BTreeMap<&str, f64> = BTreeMap::new();
    for (column, unit) in w.column_iter().zip(units) {
        let most = longest.entry(unit).or_default();
        *most = most.max(column.norm());
    }
    let columns = w.column_iter().zip(units);
    columns
        .map(|(column, unit)| column.norm() / longest[unit.as_str()])
        .collect()
}

/// The mechanism with constants that differ slightly from its own.
fn perturb_constants(mechanism: &Mechanism) -> Mechanism {
    let mut moved = mechanism.clone();
    let mut stream = RandomStream::new(SEED);
    for constant in &mut moved.constants {
        // The size that a relative change refers to; a constant of zero takes that of others with its unit.
        let size = if constant.is_angle {
            1.0
        } else if constant.value == 0.0 {
            let alike = mechanism.constants.iter();
            let alike = alike.filter(|other| other.unit == constant.unit);
            let largest = alike.map(|other| other.value.abs()).fold(0.0, f64::max);
            if largest > 0.0 { largest } else { 1.0 }
        } else {
            constant.value.abs()
        };
        constant.value += BESIDE * size * uniform_symmetric(&mut stream);
    }
    moved
}

/// Factors of dependent columns on retained ones, each column measured by the largest one with its unit.
struct DependenceFactors {
    /// Retained columns, one per row of `values`.
    retained: Vec<usize>,
    /// Dependent columns, one per column of `values`.
    dependent: Vec<usize>,
    /// The factors.
    values: DMatrix<f64>,
    /// Least residual of a retained column on those before it, relative to its size.
    least_kept: f64,
}

impl DependenceFactors {
    /// `None` if the sampled columns are not finite, or if the retained columns do not determine the others.
    fn new(w: &DMatrix<f64>, units: &[String], retained: &[usize], dependent: &[usize]) -> Option<Self> {
        // Columns of length one, so that residuals are relative.
        let of_unit_length = |columns: &[usize]| {
            let mut picked = w.select_columns(columns);
            for mut column in picked.column_iter_mut() {
                let norm = column.norm();
                if norm > 0.0 {
                    column /= norm;
                }
            }
            picked
        };
        let (basis, others) = (of_unit_length(retained), of_unit_length(dependent));
        // Least squares by QR factorisation.
        let qr = basis.clone().qr();
        let mut values = others.clone();
        qr.q_tr_mul(&mut values);
        let values = values.rows(0, retained.len()).into_owned();
        let r = qr.unpack_r();
        let least_kept = r.diagonal().amin();
        let mut values = r.solve_upper_triangular(&values)?;
        // The residual shows whether the columns depend on the retained ones here.
        let left = others - basis * &values;
        let is_made_up = left.column_iter().zip(values.column_iter());
        let is_made_up = is_made_up
            .into_iter()
            .all(|(left, factors)| left.norm() <= MADE_UP * (1.0 + factors.amax()));
        if !is_made_up {
            return None;
        }
        // A nearly vanishing column has large factors on others, and others have large factors on it; the sizes correct
        // for this.
        let shares = relative_column_sizes(w, units);
        for (j, mut column) in values.column_iter_mut().enumerate() {
            for (factor, k) in column.iter_mut().zip(retained) {
                *factor *= shares[dependent[j]] / shares[*k];
            }
        }
        Some(Self {
            retained: retained.to_vec(),
            dependent: dependent.to_vec(),
            values,
            least_kept,
        })
    }

    /// Row and column of the largest factor above the limit, outside of `fixed` rows; `None` if there is none.
    fn largest_factor(&self, fixed: &[bool]) -> Option<(usize, usize)> {
        let (mut found, mut most) = (None, MOST_GROWTH);
        for j in 0..self.values.ncols() {
            for i in (0..self.values.nrows()).filter(|i| !fixed[*i]) {
                if self.values[(i, j)].abs() > most {
                    (found, most) = (Some((i, j)), self.values[(i, j)].abs());
                }
            }
        }
        found
    }

    /// Exchanges retained column `i` and dependent column `j`, as a pivot step on the matrix of factors.
    fn exchange_pair(&mut self, i: usize, j: usize) {
        std::mem::swap(&mut self.retained[i], &mut self.dependent[j]);
        let pivot = self.values[(i, j)];
        let row = self.values.row(i) / pivot;
        let column = self.values.column(j).into_owned();
        for (k, factor) in column.iter().enumerate().filter(|(k, _)| *k != i) {
            for (l, share) in row.iter().enumerate() {
                self.values[(k, l)] -= factor * share;
            }
            self.values[(k, j)] = -factor / pivot;
        }
        self.values.set_row(i, &row);
        self.values[(i, j)] = 1.0 / pivot;
    }
}
