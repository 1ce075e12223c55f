//! What errors of the scales of measured forces do to a load. Each drive weighs the load in units of its own force
//! signal: a torque constant that is 8 % too large makes the load 8 % too light on that drive.
//!
//! The load's force is fitted with a factor of its own on each drive. Factors that scatter more than their standard
//! deviations show scales that disagree, and the load is as uncertain as their mean (DerSimonian and Laird, Controlled
//! Clinical Trials 7, 1986). An error that all drives share cannot be seen; only a known load determines it.

use modelmill_identify::changes::{NormalEquations, SelectedChange};
use nalgebra::DVector;

use crate::runs::layout::RunColumnLayout;
use crate::runs::{ChangeEstimate, FittedValue, PhysicalChange};

/// The factors of a load's force on the drives, as weights and scatter.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct DriveScales {
    /// Weight of each drive in what determines the load; the sum is 1.
    pub(crate) weights: Vec<f64>,
    /// Standard deviation of the load relative to its size by scales that disagree (1).
    pub(crate) scatter: f64,
}

/// The factors for a load with the given columns and values. `reference` and `later` are the sums of both runs drive by
/// drive, and `others` the columns of all other changes of the later run.
pub(crate) fn compare_drive_scales(
    [reference, later]: [&[NormalEquations]; 2],
    layout: RunColumnLayout,
    columns: &[usize],
    values: &DVector<f64>,
    others: &[usize],
) -> DriveScales {
    let shared = layout.model_and_drives();
    let own: Vec<usize> = shared.iter().chain(others).copied().collect();
    let drives = later.len();
    let mut all = NormalEquations::new(own.len() + drives);
    for (drive, (before, after)) in reference.iter().zip(later).enumerate() {
        // Columns of the model are shared by both runs, the others belong to the later one.
        add_block(&mut all, before, &shared);
        add_block(&mut all, after, &own);
        let load = &after.gram.select_columns(columns) * values;
        let at = own.len() + drive;
        for (i, column) in own.iter().enumerate() {
            all.gram[(i, at)] += load[*column];
            all.gram[(at, i)] += load[*column];
        }
        let of_load = |all: &DVector<f64>| columns.iter().zip(values.iter()).map(|(k, c)| c * all[*k]).sum::<f64>();
        all.gram[(at, at)] += of_load(&load);
        all.rhs[at] += of_load(&after.rhs);
    }
    let solved = all.solve();
    let noise = (solved.residual_squares / (all.rows as f64 - solved.rank as f64).max(1.0)).max(1.0);
    let factor = |drive: usize| {
        let at = own.len() + drive;
        let variance = noise * solved.covariance[(at, at)];
        (solved.independent[at] && variance > 0.0).then(|| (solved.values[at], variance.recip()))
    };
    scatter_of_factors(&(0..drives).map(factor).collect::<Vec<_>>())
}

/// Adds sums over some columns, which come first in the same order.
fn add_block(all: &mut NormalEquations, sums: &NormalEquations, columns: &[usize]) {
    let some = sums.select_columns(columns);
    let n = columns.len();
    let mut gram = all.gram.view_mut((0, 0), (n, n));
    gram += &some.gram;
    let mut rhs = all.rhs.rows_mut(0, n);
    rhs += &some.rhs;
    all.total += some.total;
    all.rows += some.rows;
}

/// Weights and scatter of factors that are given with the inverse of their variances.
fn scatter_of_factors(factors: &[Option<(f64, f64)>]) -> DriveScales {
    let known = || factors.iter().flatten();
    let weight: f64 = known().map(|(_, w)| w).sum();
    let weights = factors.iter().map(|one| one.map_or(0.0, |(_, w)| w / weight));
    let weights: Vec<f64> = weights.collect();
    let mean = known().map(|(x, w)| x * w).sum::<f64>() / weight;
    let excess = known().map(|(x, w)| w * (x - mean).powi(2)).sum::<f64>() - (known().count() as f64 - 1.0);
    let squares: f64 = weights.iter().map(|w| w * w).sum();
    // With one drive there is nothing to compare.
    let between = excess / (weight * (1.0 - squares));
    let scatter = if between.is_finite() && between > 0.0 {
        (between * squares).sqrt() / mean.abs()
    } else {
        0.0
    };
    DriveScales { weights, scatter }
}

/// Adds the scatter of the scales to the covariance of a load. A wrong scale changes all values of a load by one factor,
/// so that quotients such as its centre keep their deviations.
pub(crate) fn widen_covariance(load: &mut SelectedChange, scales: &DriveScales) {
    load.covariance += scales.scatter.powi(2) * &load.values * load.values.transpose();
}

/// Corrects a load by the factors of the force signals that a known load determines, and adds their uncertainty to it.
/// Without the factors of all drives that weigh it, the load stays as it is.
pub(crate) fn apply_gains(load: &mut PhysicalChange, weights: &[f64], gains: &[(String, FittedValue)]) {
    let PhysicalChange::Payload { mass: Some(mass), .. } = load else {
        return;
    };
    // Errors of the factors are due to the same known load, so that they add up.
    let mut factor = ChangeEstimate { value: 0.0, std: 0.0 };
    for (weight, (_, gain)) in weights.iter().zip(gains).filter(|(weight, _)| **weight > 0.0) {
        let Some(std) = gain.std else { return };
        factor.value += weight * gain.value;
        factor.std += weight * std;
    }
    if factor.value > 0.0 {
        mass.std = (mass.std * factor.value).hypot(mass.value * factor.std);
        mass.value *= factor.value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_that_disagree_make_a_load_uncertain() {
        let factor = |x: f64| Some((x, 1e6));
        let agree = scatter_of_factors(&[factor(1.0), factor(1.0005), None]);
        assert!(agree.scatter < 1e-3, "{agree:?}");
        let apart = scatter_of_factors(&[factor(0.92), factor(1.08), None]);
        // Two factors that differ by 16 %: their mean is uncertain by 8 %.
        assert!((apart.scatter - 0.08).abs() < 1e-3, "{apart:?}");
        assert_eq!(apart.weights, [0.5, 0.5, 0.0]);
        assert!(scatter_of_factors(&[factor(0.9)]).scatter.abs() < f64::EPSILON);
    }

    #[test]
    fn a_load_takes_over_the_uncertainty_of_the_factors() {
        let estimate = |value: f64, std: f64| ChangeEstimate { value, std };
        let mut load = PhysicalChange::Payload {
            frame: "flange".to_owned(),
            mass: Some(estimate(3.0, 0.027)),
            centre: [None; 3],
        };
        let gain = |value: f64| FittedValue { value, std: Some(0.08) };
        let gains = [("a".to_owned(), gain(1.1)), ("b".to_owned(), gain(1.1))];
        apply_gains(&mut load, &[0.5, 0.5], &gains);
        let PhysicalChange::Payload { mass: Some(mass), .. } = load else {
            panic!("{load:?}");
        };
        assert!(
            (mass.value - 3.3).abs() < 1e-12 && (mass.std - 0.2418).abs() < 1e-3,
            "{mass:?}"
        );
    }
}
