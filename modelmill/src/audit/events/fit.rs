//! The fit of a first look: samples that stand out are left out of the next round, so that long pushes do not bias it.

use modelmill_identify::{ChannelRegressor, robust_fit};
use nalgebra::DVector;

use super::levels::SearchedResidual;
use super::regimes::{DriveRegimes, drive_regimes};
use super::smoothing::{dilate_mask, true_share};
use super::trace::ResidualTrace;
use crate::audit::thresholds::{EVENT_LEAST_FORCE_SHARE, FIT_CUT_DEVIATIONS, FIT_LEAST_SHARE};

/// Number of samples that are fitted; residuals are computed for all.
const FITTED: usize = 2500;
/// Rounds of fits, each without the samples that stand out in the one before.
const ROUNDS: usize = 4;
/// Time about a sample that stands out that is left out with it, s.
const CUT_MARGIN_S: f64 = 0.1;

/// Fits the regressor in rounds and writes the residual of the last one; `None` if a fit fails.
pub(super) fn fit_without_events(trace: &mut ResidualTrace, regressor: &ChannelRegressor) -> Option<()> {
    let (n, drives) = (trace.samples(), trace.drives());
    let measured = DVector::from_fn(n * drives, |row, _| trace.measured[row % drives][row / drives]);
    let every = (n / FITTED).max(1);
    let thinned = regressor.subsample(every);
    let rows: Vec<usize> = (0..n)
        .step_by(every)
        .flat_map(|i| i * drives..(i + 1) * drives)
        .collect();
    let thinned_forces = measured.select_rows(&rows);
    let mut out = vec![vec![false; n]; drives];
    for round in 0..ROUNDS {
        let regimes = drive_regimes(trace);
        let used: Vec<Vec<bool>> = (0..drives)
            .map(|d| used_samples(trace, &regimes[d], d, &out[d]))
            .collect();
        let counts: Vec<bool> = rows.iter().map(|row| used[row % drives][row / drives]).collect();
        let fit = robust_fit(&thinned, &thinned_forces, &counts)?;
        let fitted = regressor.multiply(fit.values.as_slice());
        for d in 0..drives {
            for i in 0..n {
                trace.residual[d][i] = trace.measured[d][i] - fitted[i * drives + d];
            }
        }
        if round + 1 == ROUNDS {
            break;
        }
        let rests = regimes.into_iter().enumerate();
        let next: Vec<Vec<bool>> = rests
            .map(|(d, regimes)| outstanding_samples(trace, &SearchedResidual::new(trace, d, regimes)))
            .collect();
        if next == out {
            break;
        }
        out = next;
    }
    Some(())
}

/// The samples of a drive that are fitted: in motion, away from switches of friction and from what stands out. A drive
/// that hardly moves is fitted at standstill too.
fn used_samples(trace: &ResidualTrace, regimes: &DriveRegimes, drive: usize, out: &[bool]) -> Vec<bool> {
    let is_usable = |i: usize| trace.is_measured[drive][i] && !out[i];
    let moving: Vec<bool> = (0..out.len())
        .map(|i| is_usable(i) && !regimes.is_unknown[i] && !regimes.is_slow[i])
        .collect();
    if true_share(&moving) < FIT_LEAST_SHARE {
        (0..out.len()).map(is_usable).collect()
    } else {
        moving
    }
}

/// The samples at which a residual stands out, and those about them; none if they are most of the run.
fn outstanding_samples(trace: &ResidualTrace, rest: &SearchedResidual) -> Vec<bool> {
    let least = 0.5 * EVENT_LEAST_FORCE_SHARE * rest.force_rms;
    let stands_out: Vec<bool> = (0..trace.samples())
        .map(|i| {
            rest.forms
                .iter()
                .any(|form| form.values[i].abs() > (FIT_CUT_DEVIATIONS * form.level).max(least))
        })
        .collect();
    let wide = dilate_mask(&stands_out, trace.sample_count(CUT_MARGIN_S, 1));
    if true_share(&wide) > 1.0 - FIT_LEAST_SHARE {
        vec![false; wide.len()]
    } else {
        wide
    }
}
