//! Exchanged or reversed force columns. Input: a regressor and measured forces. Output: the exchange or change of sign
//! that lowers the error of the best fit most.
//!
//! The squared residual of the best fit to any forces `y` is `|y|^2 - y'W (W'W)^-1 W'y`, so that one factorisation of
//! the normal equations serves every permutation of the forces.

use nalgebra::{Cholesky, DVector, Dyn};

use super::by_channel::ChannelRegressor;
use super::robust::factor_normal;
use super::thresholds::WIRING_ROWS_PER_COLUMN;

/// A factorised regressor, which gives the error of the best fit to any forces.
#[derive(Debug, Clone)]
pub struct ForceAudit {
    /// The regressor.
    regressor: ChannelRegressor,
    /// Factor of the normal equations of scaled columns.
    factor: Cholesky<f64, Dyn>,
    /// Scales of the columns.
    scale: DVector<f64>,
}

/// A fault of the force columns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WiringFault {
    /// Two channels are exchanged; their indices.
    Swapped(usize, usize),
    /// A channel has the opposite sign of the others; its index. With two channels it is not known which of them.
    Reversed(usize),
}

impl ForceAudit {
    /// Factorises a regressor; `None` if it has fewer rows than twice its columns, or a number that is not finite.
    pub fn new(regressor: ChannelRegressor) -> Option<Self> {
        let rows = regressor.samples() * regressor.channels();
        if rows == 0 || rows < WIRING_ROWS_PER_COLUMN * regressor.columns() {
            return None;
        }
        // All rows have equal weight; the forces are not needed for the factor.
        let alike = DVector::from_element(rows, 1.0);
        let none = DVector::zeros(rows);
        let (normal, _) = regressor.normal_equations(&alike, &none, 0..regressor.samples());
        let (factor, scale) = factor_normal(normal)?;
        Some(Self {
            regressor,
            factor,
            scale,
        })
    }

    /// Relative error of the best fit to forces interleaved per sample; `None` where they are all zero.
    pub fn error(&self, forces: &DVector<f64>) -> Option<f64> {
        let size = forces.norm_squared();
        let right = (self.regressor.multiply_transposed(forces)).component_mul(&self.scale);
        let explained = right.dot(&self.factor.solve(&right));
        (size > 0.0).then(|| ((size - explained).max(0.0) / size).sqrt())
    }

    /// The exchange or change of sign of forces that lowers the error most, with the error without and with it.
    pub fn find_wiring_fault(&self, forces: &DVector<f64>) -> Option<(WiringFault, [f64; 2])> {
        let n = self.regressor.channels();
        let now = self.error(forces)?;
        // Apply a change to a copy of the forces.
        let changed = |change: WiringFault| {
            let mut changed = forces.clone();
            for row in 0..forces.len() / n {
                match change {
                    WiringFault::Swapped(a, b) => changed.swap((row * n + a, 0), (row * n + b, 0)),
                    WiringFault::Reversed(a) => changed[row * n + a] *= -1.0,
                }
            }
            changed
        };
        // Try all exchanges of two channels and all changes of one sign, and take the best.
        let swaps = (0..n).flat_map(|a| (a + 1..n).map(move |b| WiringFault::Swapped(a, b)));
        swaps
            .chain((0..n).map(WiringFault::Reversed))
            .filter_map(|change| Some((change, [now, self.error(&changed(change))?])))
            .min_by(|a, b| a.1[1].total_cmp(&b.1[1]))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;
    use crate::test_noise::TestNoise;

    /// Two joints with inertia and friction each, coupled by gravity.
    fn rows(time: impl Fn(usize) -> f64, samples: &[usize]) -> DMatrix<f64> {
        DMatrix::from_row_iterator(
            2 * samples.len(),
            3,
            samples.iter().flat_map(|k| {
                let t = time(*k);
                let (a, b) = ((3.1 * t).sin(), (4.7 * t + 0.3).cos());
                [a, b, 0.2 * a, 0.5 * b, (1.9 * t).sin(), 0.1]
            }),
        )
    }

    const TRUTH: [f64; 3] = [2.0, -1.5, 0.7];

    fn forces() -> (Vec<usize>, Vec<Vec<f64>>) {
        let n = 3000;
        let all: Vec<usize> = (0..n).collect();
        let y = rows(|k| k as f64 * 0.002, &all) * DVector::from_row_slice(&TRUTH);
        let mut random = TestNoise::new(7);
        let channels = (0..2).map(|c| {
            let values = (0..n).map(|k| y[2 * k + c] + 0.01 * random.normal());
            values.collect()
        });
        let channels = channels.collect();
        ((0..n).step_by(3).collect(), channels)
    }

    #[test]
    fn exchanged_and_turned_forces_are_found() {
        let (samples, forces) = forces();
        let explained = ForceAudit::new(ChannelRegressor::new(&rows(|k| k as f64 * 0.002, &samples), 2)).unwrap();
        let interleaved = |channels: [&Vec<f64>; 2], sign: f64| {
            let rows = samples.iter().flat_map(|k| [channels[0][*k], sign * channels[1][*k]]);
            DVector::from_iterator(2 * samples.len(), rows)
        };
        let swapped = interleaved([&forces[1], &forces[0]], 1.0);
        let (found, [before, after]) = explained.find_wiring_fault(&swapped).unwrap();
        assert_eq!(found, WiringFault::Swapped(0, 1));
        assert!(before > 0.2 && after < 0.02, "{before} {after}");
        let turned = interleaved([&forces[0], &forces[1]], -1.0);
        // With two channels it is not known which is reversed: all parameters may change their signs.
        let (found, [before, after]) = explained.find_wiring_fault(&turned).unwrap();
        assert!(matches!(found, WiringFault::Reversed(_)));
        assert!(before > 0.2 && after < 0.02, "{before} {after}");
    }
}
