//! Value of the criterion of a trajectory, and its distance from the limits. Also condition numbers of regressors.

use std::cell::Cell;

use nalgebra::DMatrix;

use super::{
    ExcitationCriterion, ExcitationLimits, ExcitationMotion, ExcitationPlant, FourierSeries, Options,
    samples_per_period,
};

/// A plant with limits and options; counts evaluations of the criterion.
pub(super) struct TrajectoryEvaluator<'a> {
    /// The mechanism.
    pub(super) plant: &'a dyn ExcitationPlant,
    /// Limits of the active coordinates.
    pub(super) limits: &'a [ExcitationLimits],
    /// Options of the search.
    pub(super) options: &'a Options,
    /// Number of evaluations so far.
    evaluations: Cell<usize>,
}

impl<'a> TrajectoryEvaluator<'a> {
    pub(super) fn new(plant: &'a dyn ExcitationPlant, limits: &'a [ExcitationLimits], options: &'a Options) -> Self {
        Self {
            plant,
            limits,
            options,
            evaluations: Cell::new(0),
        }
    }

    /// Number of evaluations of the criterion so far.
    pub(super) fn evaluations(&self) -> usize {
        self.evaluations.get()
    }

    /// Motion at the samples of the search.
    pub(super) fn sample_motion(&self, series: &[FourierSeries]) -> ExcitationMotion {
        ExcitationMotion::sample(series, samples_per_period(self.options))
    }

    /// Value of the criterion (less is better); infinite if the mechanism cannot follow, columns are dependent, or
    /// effects are indistinguishable.
    pub(super) fn criterion_value(&self, motion: &ExcitationMotion) -> f64 {
        self.evaluations.set(self.evaluations.get() + 1);
        if self.options.criterion == ExcitationCriterion::Separation {
            // Lengths of zero have no logarithm.
            let apart = self.plant.separation(motion).filter(|apart| *apart > 0.0);
            return apart.map_or(f64::INFINITY, |apart| -apart.ln());
        }
        // The other criteria depend on the regressor.
        let Some(w) = self.plant.regressor(motion) else {
            return f64::INFINITY;
        };
        match self.options.criterion {
            ExcitationCriterion::Condition => condition_number(&w).ln(),
            ExcitationCriterion::LogDet | ExcitationCriterion::Separation => log_det(&w),
        }
    }

    /// Limits of the coordinates as `(coordinate, derivative, range)`; derivative 0 is the position.
    pub(super) fn ranges(&self) -> Vec<(usize, usize, [f64; 2])> {
        let of_one = |(i, limits): (usize, &ExcitationLimits)| {
            let all = [Some(limits.position), limits.rate, limits.acceleration];
            let given = all.into_iter().enumerate();
            given.filter_map(|(d, range)| Some((i, d, range?))).collect::<Vec<_>>()
        };
        self.limits.iter().enumerate().flat_map(of_one).collect()
    }
}

/// Half the width of a range.
pub(super) fn half_width([low, high]: [f64; 2]) -> f64 {
    0.5 * (high - low)
}

/// Excess of a value over a range, as a share of half the range: -1 in the middle, 0 at the ends.
pub(super) fn excess(value: f64, range: [f64; 2]) -> f64 {
    (value - 0.5 * (range[0] + range[1])).abs() / half_width(range) - 1.0
}

/// Ratio of the largest to the smallest singular value of a matrix in its units: eq. (13) of the paper with the 2-norm.
/// Infinite if the rank is deficient.
pub fn condition_number(w: &DMatrix<f64>) -> f64 {
    singular_value_ratio(&r_factor(w).singular_values())
}

/// The same with all columns scaled to norm 1, which is independent of units.
pub fn scaled_condition_number(w: &DMatrix<f64>) -> f64 {
    let mut r = r_factor(w);
    for mut column in r.column_iter_mut() {
        let norm = column.norm();
        if norm > 0.0 {
            column.unscale_mut(norm);
        }
    }
    singular_value_ratio(&r.singular_values())
}

/// Smallest singular value of a small matrix given by its rows; infinite without columns.
pub fn least_singular_value(rows: &[Vec<f64>]) -> f64 {
    let columns = rows.first().map_or(0, Vec::len);
    let gram = DMatrix::from_fn(columns, columns, |i, j| {
        rows.iter().map(|row| row[i] * row[j]).sum::<f64>()
    });
    let least = match columns {
        0 => return f64::INFINITY,
        1 => gram[(0, 0)],
        // The smaller root of the characteristic polynomial, without cancellation.
        2 => {
            let (a, b, c) = (gram[(0, 0)], gram[(0, 1)], gram[(1, 1)]);
            let larger = 0.5 * (a + c + ((a - c).powi(2) + 4.0 * b * b).sqrt());
            if larger > 0.0 { (a * c - b * b) / larger } else { 0.0 }
        }
        _ => gram.symmetric_eigenvalues().min(),
    };
    least.max(0.0).sqrt()
}

/// Ratio of the largest to the smallest singular value; infinite if the smallest is rounding.
fn singular_value_ratio(singular: &nalgebra::DVector<f64>) -> f64 {
    let (least, greatest) = (singular.min(), singular.max());
    if least > f64::EPSILON * greatest {
        greatest / least
    } else {
        f64::INFINITY
    }
}

/// `-log det(W'W / N)` for a regressor with N rows.
fn log_det(w: &DMatrix<f64>) -> f64 {
    let singular = r_factor(w).singular_values();
    let rows = w.nrows() as f64;
    let logarithms = singular.iter().map(|s| -(s * s / rows).ln());
    logarithms.sum()
}

/// R factor of the QR factorisation, which has the singular values of the matrix. Blocks gain
/// nothing for few columns.
fn r_factor(w: &DMatrix<f64>) -> DMatrix<f64> {
    w.clone().qr().r()
}
