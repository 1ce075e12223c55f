//! Retained columns that keep their digits at the model file's values.
//!
//! Which columns are independent is found for general constants. Near the file's own values some may all but coincide, and
//! others are then written by them with factors that grow without bound. So the factors are looked at in floating point, at
//! constants a little beside the file's (where special values would hide that columns coincide there), and a retained column
//! is exchanged for the dependent one of which it makes the largest part, until all factors are of reasonable size (the
//! exchanges of M. Gu and S. C. Eisenstat, "Efficient algorithms for computing a strong rank-revealing QR factorization",
//! 1996, over a base that is given).

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

/// Largest factor that calls for no exchange, each column measured by the longest of a parameter of its unit: bases that
/// are sound stay far below, and a base within it loses three digits of sixteen.
const MOST_GROWTH: f64 = 1e3;

/// How far constants are moved, in rad or relative to their size: far enough that columns which coincide differ by more than
/// rounding, even to second order.
const BESIDE: f64 = 1e-5;

/// What must be left of a column beside others, relative to its size, that they make it up.
const MADE_UP: f64 = 1e-6;

/// Columns of the regressor.
pub(super) struct RegressorColumns<'a> {
    /// What stands in them, drive by drive.
    pub(super) values: &'a [Vec<ExprId>],
    /// SI units of their products.
    pub(super) units: &'a [String],
}

/// What must be left of every retained column beside those before it, relative to its size, so that factors found in
/// floating point mean anything.
const CERTAIN: f64 = 1e-7;

/// Another choice of retained columns.
pub(super) struct ColumnExchange {
    pub(super) retained: Vec<usize>,
    /// Whether the factors that asked for it are known to some digits. Where retained columns all but depend on each other at
    /// the file's values, they may be rounding alone, and the true ones of reasonable size.
    pub(super) is_certain: bool,
}

/// The retained columns, some exchanged for dependent ones; `None` if all can stay. Columns in `named` stay in any case.
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
    let moved = perturb_constants(mechanism);
    let n_rows = columns.values.len() + columns.values.len() / 2;
    let mut sampled = |mechanism: &Mechanism| {
        let w = sample_observations(graph, mechanism, projection, columns.values, n_rows, REACH)
            .ok()?;
        DependenceFactors::new(&w, columns.units, retained, dependent)
    };
    let mut factors = sampled(&moved).or_else(|| sampled(mechanism))?;
    let fixed: Vec<bool> = retained.iter().map(|k| named.contains(k)).collect();
    let mut has_changed = false;
    while let Some((i, j)) = factors.largest_factor(&fixed) {
        factors.exchange_pair(i, j);
        has_changed = true;
    }
    has_changed.then_some(ColumnExchange {
        retained: factors.retained,
        is_certain: factors.least_kept > CERTAIN,
    })
}

/// Whether the factors of a reduction are of reasonable size at the file's values. `shown` are its columns' positions.
pub(super) fn is_moderate(
    graph: &mut Graph,
    mechanism: &Mechanism,
    projection: &LoopProjection,
    columns: &RegressorColumns<'_>,
    reduction: &BaseReduction,
    shown: &[usize],
) -> bool {
    let n_rows = columns.values.len() + columns.values.len() / 2;
    let Ok(w) = sample_observations(graph, mechanism, projection, columns.values, n_rows, REACH)
    else {
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

/// The size of each column beside the longest of a parameter of its unit.
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

/// The mechanism with constants a little beside its own.
fn perturb_constants(mechanism: &Mechanism) -> Mechanism {
    let mut moved = mechanism.clone();
    let mut stream = RandomStream::new(SEED);
    for constant in &mut moved.constants {
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

/// Dependent columns by retained ones, each measured by the longest of its unit.
struct DependenceFactors {
    retained: Vec<usize>,
    dependent: Vec<usize>,
    values: DMatrix<f64>,
    /// What is left of a retained column beside those before it: the least.
    least_kept: f64,
}

impl DependenceFactors {
    /// `None` where the sampled columns are no numbers, or where retained columns do not make up the others.
    fn new(
        w: &DMatrix<f64>,
        units: &[String],
        retained: &[usize],
        dependent: &[usize],
    ) -> Option<Self> {
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
        let qr = basis.clone().qr();
        let mut values = others.clone();
        qr.q_tr_mul(&mut values);
        let values = values.rows(0, retained.len()).into_owned();
        let r = qr.unpack_r();
        let least_kept = r.diagonal().amin();
        let mut values = r.solve_upper_triangular(&values)?;
        let left = others - basis * &values;
        let is_made_up = left.column_iter().zip(values.column_iter());
        let is_made_up = is_made_up
            .into_iter()
            .all(|(left, factors)| left.norm() <= MADE_UP * (1.0 + factors.amax()));
        if !is_made_up {
            return None;
        }
        // A column that all but vanishes is written by others with large factors, and others by it.
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

    /// Where the largest factor beyond measure stands.
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

    /// Retained column `i` and dependent column `j` change places.
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
