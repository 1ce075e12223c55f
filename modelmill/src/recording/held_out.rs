//! The residual of forces on held-out parts of a run: the pieces of its computation. Rows of windows go in; normal
//! equations of each fold, the values that fit the other folds, and the power of the residual by octaves come out.

use modelmill_identify::{LowPass, float_to_count, gram};
use nalgebra::{DMatrix, DVector};

use super::friction_rows::solve_scaled;
use super::thresholds::SMOOTHING_ROWS_PER_COLUMN;

/// Number of parts of the time, each of which is held out once.
pub(super) const FOLDS: usize = 5;
/// Periods of the band that are dropped at both ends of a held-out part, and the largest share of it that may be
/// dropped.
const DROPPED: (f64, f64) = (1.5, 0.2);
/// A residual below this fraction of the force is rounding.
pub(super) const ROUNDING: f64 = 1e-6;

/// Force residual on held-out parts.
#[derive(Clone, Copy)]
pub(super) struct HeldOutResidual {
    /// The logarithm of the geometric mean of the residual over the drives, in units of the forces.
    pub(super) figure: f64,
    /// The geometric mean of the relative residuals below the band of the motion over the drives.
    pub(super) relative: f64,
}

/// An interval of time, s.
#[derive(Clone, Copy)]
pub(super) struct TimeWindow {
    /// Index of the recording among those that are chosen for.
    pub(super) recording: usize,
    /// First time.
    pub(super) from: f64,
    /// Last time.
    pub(super) to: f64,
}

/// Rows of the regressor, one per sample and drive, and forces, one row per sample and one column per drive.
pub(super) struct WindowSamples {
    /// Row `sample * n_drives + drive`, with the columns of friction and offset behind those of the model.
    pub(super) regressor: DMatrix<f64>,
    /// `[sample, drive]`.
    pub(super) forces: DMatrix<f64>,
}

impl WindowSamples {
    /// The same rows after a low-pass, Hz; `None` if there are too few samples. `rate` is that of the rows, Hz.
    pub(super) fn low_passed(&self, passed: f64, rate: f64) -> Option<Self> {
        let mut filtered = Self {
            regressor: self.regressor.clone(),
            forces: self.forces.clone(),
        };
        if passed >= 0.45 * rate {
            return Some(filtered);
        }
        let low_pass = LowPass::butterworth(4, passed, rate).ok()?;
        let (n, drives) = self.forces.shape();
        for d in 0..drives {
            let force: Vec<f64> = self.forces.column(d).iter().copied().collect();
            let force = low_pass.zero_phase(&force).ok()?;
            filtered.forces.column_mut(d).copy_from_slice(&force);
            for mut column in filtered.regressor.column_iter_mut() {
                let values: Vec<f64> = (0..n).map(|i| column[i * drives + d]).collect();
                if values.iter().all(|x| *x == 0.0) {
                    continue;
                }
                for (i, value) in low_pass.zero_phase(&values).ok()?.into_iter().enumerate() {
                    column[i * drives + d] = value;
                }
            }
        }
        Some(filtered)
    }
}

/// Inner products of measured force and model force in one octave of one drive.
#[derive(Clone, Default)]
pub(super) struct OctavePower {
    /// Sum of squares of the measured force.
    pub(super) measured: f64,
    /// Inner product of both forces.
    product: f64,
    /// Sum of squares of the model force.
    model: f64,
}

impl OctavePower {
    /// Adds samples of both forces.
    pub(super) fn add(&mut self, measured: &[f64], model: &[f64]) {
        for (y, m) in measured.iter().zip(model) {
            self.measured += y * y;
            self.product += y * m;
            self.model += m * m;
        }
    }

    /// Residual power of the measured force. Where the model overestimates an octave, its force may be damped, as a
    /// filter does above the band of the motion: noise there costs only what it hides.
    pub(super) fn residual_power(&self, may_be_damped: bool) -> f64 {
        let scale = if may_be_damped && self.model > 0.0 {
            (self.product / self.model).clamp(0.0, 1.0)
        } else {
            1.0
        };
        self.measured - 2.0 * scale * self.product + scale * scale * self.model
    }
}

/// Number of samples at both ends of `n` that a low-pass at `band`, Hz, distorts.
pub(super) fn margin(n: usize, rate: f64, band: f64) -> usize {
    float_to_count((DROPPED.0 * rate / band).min(DROPPED.1 * n as f64))
}

/// Sums over the rows of one fold, drive by drive.
#[derive(Clone)]
pub(super) struct FoldSums {
    drives: Vec<DriveNormalEquations>,
}

/// Normal equations of one drive.
#[derive(Clone)]
pub(super) struct DriveNormalEquations {
    /// Gram matrix of the columns.
    normal: DMatrix<f64>,
    /// Inner products of columns and force.
    right: DVector<f64>,
    /// Sum of squares of the force.
    size: f64,
    /// Number of rows.
    rows: usize,
}

impl FoldSums {
    /// Sums without rows.
    pub(super) fn new(drives: usize, width: usize) -> Self {
        let products = DriveNormalEquations {
            normal: DMatrix::zeros(width, width),
            right: DVector::zeros(width),
            size: 0.0,
            rows: 0,
        };
        Self {
            drives: vec![products; drives],
        }
    }

    /// Adds the rows of all drives at some samples.
    fn add(&mut self, samples: &WindowSamples, indices: &[usize]) {
        let drives = self.drives.len();
        for (d, one) in self.drives.iter_mut().enumerate() {
            let rows = samples
                .regressor
                .select_rows(&indices.iter().map(|i| i * drives + d).collect::<Vec<_>>());
            // Most columns of friction belong to other drives, and are zero here.
            let nonzero: Vec<usize> = (0..rows.ncols())
                .filter(|k| rows.column(*k).iter().any(|x| *x != 0.0))
                .collect();
            let rows = rows.select_columns(&nonzero);
            let forces = DVector::from_iterator(indices.len(), indices.iter().map(|i| samples.forces[(*i, d)]));
            let (normal, right) = (gram(&rows), rows.tr_mul(&forces));
            for (j, column) in nonzero.iter().enumerate() {
                one.right[*column] += right[j];
                for (i, row) in nonzero.iter().enumerate() {
                    one.normal[(*row, *column)] += normal[(i, j)];
                }
            }
            one.size += forces.norm_squared();
            one.rows += indices.len();
        }
    }
}

/// Adds samples to folds: the index of a fold, and that of a sample.
pub(super) fn add_to_folds(
    folds: &mut [FoldSums],
    samples: &WindowSamples,
    pairs: impl Iterator<Item = (usize, usize)>,
) {
    let mut samples_of_fold = vec![Vec::new(); folds.len()];
    pairs.for_each(|(fold, sample)| samples_of_fold[fold].push(sample));
    for (fold, indices) in folds.iter_mut().zip(&samples_of_fold) {
        fold.add(samples, indices);
    }
}

/// For each fold the values that fit the others; `None` if there are too few rows, or all forces are zero.
pub(super) fn fit_folds(folds: &[FoldSums]) -> Option<Vec<DVector<f64>>> {
    let n = folds.first()?.drives.len();
    let width = folds[0].drives[0].right.len();
    let total = |d: usize| -> f64 { folds.iter().map(|fold| fold.drives[d].size).sum() };
    let sizes: Vec<f64> = (0..n).map(total).collect();
    let largest = sizes.iter().copied().fold(0.0, f64::max);
    // A drive without a force, as in the row of an undriven joint, has the scale of the others.
    let sizes: Vec<f64> = sizes
        .into_iter()
        .map(|size| if size > 0.0 { size } else { largest })
        .collect();
    let rows: usize = folds.iter().map(|fold| fold.drives[0].rows).sum();
    if rows * n < SMOOTHING_ROWS_PER_COLUMN * width || largest <= 0.0 {
        return None;
    }
    // All drives have equal relative weights first, then weights from their residuals.
    let mut left = sizes.clone();
    let mut values = Vec::new();
    for _ in 0..2 {
        let weights: Vec<f64> = (left.iter().zip(&sizes))
            .map(|(left, size)| rows as f64 / left.max(ROUNDING * ROUNDING * size))
            .collect();
        left = vec![0.0; n];
        values.clear();
        // All folds except the one that is held out.
        for (out, judged) in folds.iter().enumerate() {
            let mut normal = DMatrix::zeros(width, width);
            let mut right = DVector::zeros(width);
            for (_, fold) in folds.iter().enumerate().filter(|(k, _)| *k != out) {
                for (one, weight) in fold.drives.iter().zip(&weights) {
                    normal += &one.normal * *weight;
                    right += &one.right * *weight;
                }
            }
            let found = solve_scaled(normal, &right)?;
            // The sum of squares of the residual follows from the sums of the fold.
            for (left, one) in left.iter_mut().zip(&judged.drives) {
                let explained = 2.0 * one.right.dot(&found) - (&one.normal * &found).dot(&found);
                *left += (one.size - explained).max(0.0);
            }
            values.push(found);
        }
    }
    Some(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_are_those_of_one_row_after_the_other() {
        let (samples, drives, width) = (40, 2, 7);
        // The last column is that of no drive, and the one before it of the second.
        let value = |row: usize, k: usize| match k {
            6 => 0.0,
            5 if row.is_multiple_of(drives) => 0.0,
            _ => (0.7 * row as f64 * (k as f64 + 1.0)).sin(),
        };
        let rows = WindowSamples {
            regressor: DMatrix::from_fn(samples * drives, width, value),
            forces: DMatrix::from_fn(samples, drives, |i, d| (i as f64 - 3.0) * (d as f64 + 0.5)),
        };
        let mut sums = FoldSums::new(drives, width);
        let parts: [Vec<usize>; 3] = [(0..9).collect(), Vec::new(), (20..33).step_by(3).collect()];
        for part in &parts {
            sums.add(&rows, part);
        }
        for (d, found) in sums.drives.iter().enumerate() {
            let mut expected = DriveNormalEquations {
                normal: DMatrix::zeros(width, width),
                right: DVector::zeros(width),
                size: 0.0,
                rows: 0,
            };
            for i in parts.iter().flatten() {
                let row = rows.regressor.row(i * drives + d).transpose();
                expected.normal += &row * row.transpose();
                expected.right += &row * rows.forces[(*i, d)];
                expected.size += rows.forces[(*i, d)].powi(2);
                expected.rows += 1;
            }
            assert!((&found.normal - expected.normal).amax() < 1e-12);
            assert!((&found.right - expected.right).amax() < 1e-11);
            assert!((found.size - expected.size).abs() < 1e-11);
            assert_eq!(found.rows, expected.rows);
        }
    }
}
