//! What a higher cut-off of the positions changes in the forces of a model: motion, or noise of the positions. Rows at
//! both cut-offs go in; whether the higher one is harmless comes out.
//!
//! Decision: the residual does not show the noise that a cut-off lets in where the model lacks an effect, since the
//! residual is then much larger. The change of the model's forces shows it. Motion is in the measured forces too, so
//! that the residual falls by this change; noise of the positions is not, and must be small relative to the noise of
//! the forces.

use modelmill_identify::float_to_count;

use super::held_out::{FOLDS, FoldSums, WindowSamples, add_to_folds, fit_folds, margin};
use super::thresholds::{RAISED_LEAST_MOTION_SHARE, RAISED_MOST_NOISE_RATIO, RAISED_MOTION_SIGMAS};

/// Rows of one window at both cut-offs.
pub(super) struct RaisedWindow {
    /// At the lower cut-off.
    pub(super) lower: WindowSamples,
    /// At the higher one.
    pub(super) higher: WindowSamples,
}

/// The band in which both are compared.
#[derive(Clone, Copy)]
pub(super) struct ComparedBand {
    /// Highest frequency, Hz.
    pub(super) passed: f64,
    /// Rate of the rows, Hz.
    pub(super) rate: f64,
}

/// Mean squares over the drives, each relative to the measured force.
#[derive(Default)]
struct CutoffForceChange {
    /// Residual at the lower cut-off.
    residual: f64,
    /// Product of that residual and of the change of the model's force.
    product: f64,
    /// Change of the model's force.
    change: f64,
    /// White noise of the measured force within the band.
    noise: f64,
}

/// Whether the higher cut-off lets in motion, or no more noise than the forces have. `white_noise` is that of the
/// forces, N or N m, one per drive, at a sampling rate, Hz. `None` if the rows are too few for a fit.
pub(super) fn is_harmless(
    windows: &[RaisedWindow],
    band: ComparedBand,
    white_noise: &[f64],
    sampling_rate: f64,
) -> Option<bool> {
    let passed: Vec<RaisedWindow> = windows
        .iter()
        .map(|one| {
            Some(RaisedWindow {
                lower: one.lower.low_passed(band.passed, band.rate)?,
                higher: one.higher.low_passed(band.passed, band.rate)?,
            })
        })
        .collect::<Option<_>>()?;
    let are_alike = |one: &RaisedWindow| one.lower.forces.nrows() == one.higher.forces.nrows();
    if !passed.iter().all(are_alike) {
        return None;
    }
    let first = &passed.first()?.lower;
    let drives = first.forces.ncols();
    // One fit to all rows: the values of a model that is fitted without any of the folds.
    let mut folds = vec![FoldSums::new(drives, first.regressor.ncols()); FOLDS];
    let thin = float_to_count(band.rate / (4.0 * band.passed)).max(1);
    let mut counted = 0;
    for one in &passed {
        let edge = margin(one.lower.forces.nrows(), band.rate, band.passed);
        let added = (edge..one.lower.forces.nrows() - edge).step_by(thin);
        let first = counted;
        counted += added.len();
        let pairs = added.enumerate().map(|(k, i)| ((first + k) % FOLDS, i));
        add_to_folds(&mut folds, &one.lower, pairs);
    }
    let values = fit_folds(&folds)?.into_iter().next()?;
    let mut sums = CutoffForceChange::default();
    let mut independent = 0.0;
    for (d, white) in white_noise.iter().enumerate() {
        let mut own = CutoffForceChange::default();
        let (mut size, mut rows) = (0.0, 0.0);
        for one in &passed {
            let edge = margin(one.lower.forces.nrows(), band.rate, band.passed);
            for i in edge..one.lower.forces.nrows() - edge {
                let row = i * drives + d;
                let [lower, higher] =
                    [&one.lower, &one.higher].map(|rows| rows.regressor.row(row).transpose().dot(&values));
                let residual = one.lower.forces[(i, d)] - lower;
                let change = higher - lower;
                own.residual += residual * residual;
                own.product += residual * change;
                own.change += change * change;
                size += one.lower.forces[(i, d)].powi(2);
                rows += 1.0;
            }
        }
        // A drive without a force has no noise to compare with.
        if size <= 0.0 {
            continue;
        }
        sums.residual += own.residual / size;
        sums.product += own.product / size;
        sums.change += own.change / size;
        // White noise has the same power at all frequencies.
        sums.noise += white * white * rows * (2.0 * band.passed / sampling_rate).min(1.0) / size;
        // Two independent values per period of the highest frequency.
        independent += rows * (2.0 * band.passed / band.rate).min(1.0);
    }
    Some(sums.is_harmless(independent))
}

impl CutoffForceChange {
    /// Whether the change is motion, by its share in the residual, or small; `independent` is the number of independent
    /// values.
    fn is_harmless(&self, independent: f64) -> bool {
        if self.change <= RAISED_MOST_NOISE_RATIO * self.noise {
            return true;
        }
        // The share of the change by which the residual falls: 1 for motion, 0 for noise.
        let share = self.product / self.change;
        let deviation = (self.residual / (self.change * independent.max(1.0))).sqrt();
        share >= RAISED_LEAST_MOTION_SHARE + RAISED_MOTION_SIGMAS * deviation
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use modelmill_runtime::RandomBits;
    use nalgebra::DMatrix;

    /// A mass whose acceleration has noise at the higher cut-off, or lacks motion at the lower one, beside a force that
    /// the model lacks.
    fn harmless(lost_motion: f64, noise: f64, lacking: f64) -> bool {
        let (rate, n) = (100.0, 3000);
        let mut random = RandomBits::new(7);
        let time = |i: usize| i as f64 / rate;
        let slow: Vec<f64> = (0..n)
            .map(|i| (2.0 * time(i)).sin() + 0.5 * (5.3 * time(i)).cos())
            .collect();
        let fast: Vec<f64> = (0..n).map(|i| lost_motion * (31.0 * time(i)).sin()).collect();
        let white: Vec<f64> = (0..n).map(|_| noise * random.normal()).collect();
        let rows = |of: &dyn Fn(usize) -> f64| DMatrix::from_fn(n, 1, |i, _| of(i));
        let forces = DMatrix::from_fn(n, 1, |i, _| {
            3.0 * (slow[i] + fast[i]) + lacking * (3.7 * time(i)).sin() + 0.01 * (0.1 + 1.3 * i as f64).sin()
        });
        let window = RaisedWindow {
            lower: WindowSamples {
                regressor: rows(&|i| slow[i]),
                forces: forces.clone(),
            },
            higher: WindowSamples {
                regressor: rows(&|i| slow[i] + fast[i] + white[i]),
                forces,
            },
        };
        let band = ComparedBand { passed: 20.0, rate };
        is_harmless(&[window], band, &[0.01], rate).unwrap()
    }

    /// Noise of the positions counts however large the residual is; motion that a low cut-off removes counts as well.
    #[test]
    fn a_missing_effect_hides_no_noise() {
        for lacking in [0.0, 0.1, 1.0] {
            assert!(!harmless(0.0, 0.05, lacking), "noise, beside a force of {lacking}");
            assert!(
                harmless(0.0, 1e-3, lacking),
                "little noise, beside a force of {lacking}"
            );
            assert!(harmless(0.2, 1e-3, lacking), "motion, beside a force of {lacking}");
        }
    }
}
