//! Regimes of a drive, known before any fit: motion, standstill, and samples whose residual shows no contact.
//!
//! At a reversal and at the start of a motion friction switches, and smoothing of the positions spreads the switch.
//! At standstill friction takes any value up to its limit. A reading in a dead band follows no force. Such samples
//! neither start nor end an event.

use std::ops::Range;

use modelmill_identify::float_to_count;

use super::smoothing::{dilate_mask, running_mean, true_ranges, true_share};
use super::trace::ResidualTrace;
use crate::audit::thresholds::{
    DEAD_BAND_LEAST_SHARE, FROZEN_SHORTEST_S, RUN_END_SMEARS, SLOW_RATE_SHARE, STANDSTILL_LONGEST_GAP_S,
    STANDSTILL_RATE_SHARE, STANDSTILL_SHORTEST_S, SWITCH_SMEARS,
};

/// Time over which rates are averaged before they are compared with a limit, s.
const RATE_MEAN_S: f64 = 0.05;

/// Rates below this share of the limit are close to zero (1).
const CALM_RATE_SHARE: f64 = 1.0 / 3.0;

/// Regimes of a drive at each sample.
pub(super) struct DriveRegimes {
    /// Whether the drive is at standstill for some time.
    pub(super) is_standing: Vec<bool>,
    /// Whether all drives are at standstill.
    pub(super) all_stand: Vec<bool>,
    /// Whether it is slower than dry friction can be relied on; includes standstill.
    pub(super) is_slow: Vec<bool>,
    /// Whether its residual shows no contact: a switch of friction, a reading that does not follow, no reading.
    pub(super) is_unknown: Vec<bool>,
    /// Whether its reading has a dead band, so that no sample shows a contact.
    pub(super) has_dead_band: bool,
}

/// The samples at which something stands still for some time. `slowest` is a rate that is standstill in any case.
pub(super) fn standing_mask(rates: &[f64], samples_per_second: f64, slowest: f64) -> Vec<bool> {
    let count = |seconds: f64| float_to_count(seconds * samples_per_second).max(1);
    let magnitudes: Vec<f64> = running_mean(rates, count(RATE_MEAN_S))
        .iter()
        .map(|v| v.abs())
        .collect();
    let fastest = magnitudes.iter().fold(0.0_f64, |most, v| most.max(*v));
    let limit = (STANDSTILL_RATE_SHARE * fastest).max(slowest);
    let mut standing: Vec<bool> = magnitudes.iter().map(|v| *v <= limit).collect();
    // A slow reversal passes evenly through all small rates; at standstill most of them are close to zero.
    let is_calm = |range: &Range<usize>| {
        let inner = magnitudes[range.clone()].iter();
        2 * inner.filter(|v| **v <= CALM_RATE_SHARE * limit).count() >= range.len()
    };
    // A reversal soon after a slow start is no standstill to which the start belongs.
    for range in true_ranges(&standing).into_iter().filter(|range| !is_calm(range)) {
        standing[range].fill(false);
    }
    // A push moves a drive a little that is held at a position: short and slow motion does not end a standstill.
    let moving: Vec<bool> = standing.iter().map(|stands| !stands).collect();
    let (gap, slow) = (count(STANDSTILL_LONGEST_GAP_S), (SLOW_RATE_SHARE * fastest).max(limit));
    for range in true_ranges(&moving) {
        let is_within = range.start > 0 && range.end < rates.len();
        if is_within && range.len() < gap && magnitudes[range.clone()].iter().all(|v| *v <= slow) {
            standing[range].fill(true);
        }
    }
    let shortest = count(STANDSTILL_SHORTEST_S);
    for range in true_ranges(&standing) {
        if range.len() < shortest || !is_calm(&range) {
            standing[range].fill(false);
        }
    }
    standing
}

/// The regimes of all drives of a trace.
pub(super) fn drive_regimes(trace: &ResidualTrace) -> Vec<DriveRegimes> {
    let rate = trace.sample_rate();
    let standing: Vec<Vec<bool>> = (0..trace.drives())
        .map(|d| standing_mask(&trace.motion[1][d], rate, trace.slowest[d]))
        .collect();
    let all_stand: Vec<bool> = (0..trace.samples())
        .map(|i| standing.iter().all(|stands| stands[i]))
        .collect();
    let regimes = standing.into_iter().enumerate();
    regimes
        .map(|(d, is_standing)| regimes_of_one_drive(trace, d, is_standing, all_stand.clone()))
        .collect()
}

/// The regimes of one drive.
fn regimes_of_one_drive(
    trace: &ResidualTrace,
    drive: usize,
    is_standing: Vec<bool>,
    all_stand: Vec<bool>,
) -> DriveRegimes {
    let n = trace.samples();
    let magnitudes: Vec<f64> = trace.motion[1][drive].iter().map(|v| v.abs()).collect();
    let fastest = magnitudes.iter().fold(0.0_f64, |most, v| most.max(*v));
    let is_slow: Vec<bool> = (magnitudes.iter().zip(&is_standing))
        .map(|(v, stands)| *stands || *v < SLOW_RATE_SHARE * fastest)
        .collect();
    // Reversals, and the samples between standstill and motion.
    let switches: Vec<bool> = (0..n)
        .map(|i| (is_slow[i] && !is_standing[i]) || (i > 0 && is_standing[i] != is_standing[i - 1]))
        .collect();
    let reach = trace.sample_count(SWITCH_SMEARS * trace.smear, 1);
    let mut is_unknown = dilate_mask(&switches, reach);
    // Filters have transients at the ends of a run.
    let end = trace.sample_count(RUN_END_SMEARS * trace.smear, 1).min(n);
    is_unknown[..end].fill(true);
    is_unknown[n - end..].fill(true);
    let unmeasured: Vec<bool> = trace.is_measured[drive].iter().map(|is| !is).collect();
    let frozen = frozen_mask(trace, drive, &is_standing);
    for mask in [dilate_mask(&unmeasured, 1), dilate_mask(&frozen, reach)] {
        for (unknown, is) in is_unknown.iter_mut().zip(mask) {
            *unknown |= is;
        }
    }
    DriveRegimes {
        has_dead_band: has_dead_band(trace, drive, &is_standing),
        is_standing,
        all_stand,
        is_slow,
        is_unknown,
    }
}

/// The samples at which the reading of a drive stays exactly the same while the drive moves.
fn frozen_mask(trace: &ResidualTrace, drive: usize, is_standing: &[bool]) -> Vec<bool> {
    let force = &trace.measured[drive];
    let repeats: Vec<bool> = (0..force.len())
        .map(|i| i > 0 && !is_standing[i] && is_same_reading(force[i], force[i - 1]))
        .collect();
    let shortest = trace.sample_count(FROZEN_SHORTEST_S, 4);
    let mut frozen = vec![false; force.len()];
    for range in true_ranges(&repeats)
        .into_iter()
        .filter(|range| range.len() >= shortest)
    {
        frozen[range].fill(true);
    }
    frozen
}

/// Whether one reading occurs in many samples in which the drive moves: small forces then read as this value.
fn has_dead_band(trace: &ResidualTrace, drive: usize, is_standing: &[bool]) -> bool {
    let force = &trace.measured[drive];
    let moving: Vec<usize> = (0..force.len()).filter(|i| !is_standing[*i]).collect();
    let mut readings: Vec<f64> = moving.iter().map(|i| force[*i]).collect();
    readings.sort_by(f64::total_cmp);
    // The most frequent reading is the longest group of equal values.
    let groups = readings.chunk_by(|a, b| is_same_reading(*a, *b));
    let most = groups.map(<[f64]>::len).max().unwrap_or(0);
    let same: Vec<bool> = (0..readings.len()).map(|i| i < most).collect();
    true_share(&same) > DEAD_BAND_LEAST_SHARE
}

/// Whether two readings are the same number; 0 and -0 are.
fn is_same_reading(a: f64, b: f64) -> bool {
    (a - b).abs() == 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A drive that starts slowly and turns round soon afterwards moves from the start on; one that a push moves a little
    /// stands all the time.
    #[test]
    fn a_slow_start_with_a_reversal_is_motion() {
        let at = |k: usize| 0.01 * k as f64;
        // Standstill for 2 s, then a rate of at most 4 % of the largest one that changes its sign after 0.36 s.
        let starts: Vec<f64> = (0..600)
            .map(|k| match at(k) - 2.0 {
                t if t < 0.0 => 0.0,
                t if t < 0.5 => -0.04 * (std::f64::consts::TAU * t / 0.72).sin(),
                t => 0.04 + (t - 0.5).min(1.0),
            })
            .collect();
        let mask = standing_mask(&starts, 100.0, 1e-4);
        assert!(mask[..195].iter().all(|stands| *stands));
        assert!(mask[206..].iter().all(|stands| !stands));
        // The same bump between two standstills is a push.
        let pushed: Vec<f64> = (0..600)
            .map(|k| match at(k) - 2.0 {
                t if (0.0..0.3).contains(&t) => 0.04 * (std::f64::consts::TAU * t / 0.3).sin(),
                t if t < 2.0 => 0.0,
                t => (t - 2.0).min(1.0),
            })
            .collect();
        let mask = standing_mask(&pushed, 100.0, 1e-4);
        assert!(mask[..395].iter().all(|stands| *stands));
    }
}
