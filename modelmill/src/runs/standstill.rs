//! Equations of a run at standstill. While a drive hardly moves, its friction may have any value up to the dry friction,
//! and smoothing of positions has moved the time at which the rate changes its sign. Two runs of one machine would then
//! differ in dry and viscous friction only because they reverse at different speeds.

use modelmill_identify::diagnose::top_speed;

use crate::along::drive_rates;
use crate::error::Outcome;
use crate::model::Model;
use crate::runs::thresholds::{
    NOISE_REVERSALS_PER_CUTOFF, RECORDED_CUTOFF_SHARE, ROUNDING_RATE, RUN_STANDSTILL_SHARE,
    STANDING_FEWEST_MOVING_SHARE,
};
use crate::segment::RecordingSegment;

/// Gives equations at standstill the weight 0. Returns for each drive whether it stands nearly all the time: then its
/// equations are kept, as they are all that there is, and its friction is unknown.
///
/// Fails when a pose has no solution.
pub(crate) fn exclude_uncertain_friction(model: &Model, segments: &mut [RecordingSegment]) -> Outcome<Vec<bool>> {
    let drives = model.row_names().len();
    let rates: Vec<Vec<Vec<f64>>> = (segments.iter())
        .map(|one| drive_rates(model, one))
        .collect::<Outcome<_>>()?;
    let mut stands = vec![false; drives];
    for (drive, stands) in stands.iter_mut().enumerate() {
        let own: Vec<&[f64]> = rates.iter().map(|run| run[drive].as_slice()).collect();
        let bound = RUN_STANDSTILL_SHARE * top_speed(own.iter().copied().flatten());
        let moving: Vec<Vec<bool>> = (segments.iter().zip(&own))
            .map(|(segment, rate)| moving_rows(rate, segment.decimation(), bound))
            .collect();
        let kept = moving.iter().flatten().filter(|moves| **moves).count();
        let all: usize = moving.iter().map(Vec::len).sum();
        let is_noise = segments
            .iter()
            .zip(&own)
            .all(|(segment, rate)| is_rate_noise(segment, rate, bound));
        if is_noise || (kept as f64) < STANDING_FEWEST_MOVING_SHARE * all as f64 {
            *stands = true;
            continue;
        }
        for (segment, moving) in segments.iter_mut().zip(&moving) {
            // Weights of other exclusions are kept.
            let weights = segment.weights.get_or_insert_with(|| vec![1.0; moving.len() * drives]);
            for (row, _) in moving.iter().enumerate().filter(|(_, moves)| !**moves) {
                weights[row * drives + drive] = 0.0;
            }
        }
    }
    Ok(stands)
}

/// Whether a rate is noise that the low-pass has let through. Noise reverses as fast as the cut-off allows, and motions
/// below the cut-off reverse more slowly. Rates up to `bound` do not count: they are noise in pauses of a motion.
fn is_rate_noise(segment: &RecordingSegment, rate: &[f64], bound: f64) -> bool {
    let time = &segment.run.time;
    let duration = match time.as_slice() {
        [first, .., last] => last - first,
        _ => return true,
    };
    let recorded = RECORDED_CUTOFF_SHARE * time.len() as f64 / duration;
    let cutoff = segment.run.prepared.cutoff_hz.unwrap_or(recorded);
    let moving: Vec<f64> = rate.iter().copied().filter(|rate| rate.abs() > bound).collect();
    let reversals = moving.windows(2).filter(|pair| pair[0] * pair[1] < 0.0).count();
    // The rate of a constant position is rounding, which may reverse slowly.
    let is_zero = rate.iter().all(|rate| rate.abs() < ROUNDING_RATE);
    // A Fourier series ends where the motion ends, so that the motion itself may reverse as fast as its last harmonic.
    let is_series = segment.run.prepared.period.is_some();
    is_zero || !is_series && reversals as f64 > NOISE_REVERSALS_PER_CUTOFF * cutoff * duration
}

/// Whether a drive moves in each decimated row. The low-pass before decimation also uses the samples around a row.
fn moving_rows(rate: &[f64], every: usize, bound: f64) -> Vec<bool> {
    let moves = |row: usize| {
        let from = (row * every).saturating_sub(every - 1);
        let to = (row * every + every).min(rate.len());
        rate[from..to].iter().all(|rate| rate.abs() > bound)
    };
    (0..rate.len().div_ceil(every)).map(moves).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_around_a_reversal_are_left_out() {
        let rate: Vec<f64> = (0..40).map(|i| 0.1 * (f64::from(i) - 20.0)).collect();
        assert_eq!(moving_rows(&rate, 1, 0.05).iter().filter(|moves| !**moves).count(), 1);
        // Row 5 is the reversal; rows 4 and 6 have it within one decimated step only if the filter reaches it.
        let rows = moving_rows(&rate, 4, 0.05);
        let standing: Vec<usize> = (0..rows.len()).filter(|k| !rows[*k]).collect();
        assert_eq!(standing, [5]);
        assert!((top_speed(&rate) - 1.9).abs() < 1e-9);
    }
}
