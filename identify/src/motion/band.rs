//! The band of a motion: positions go in; the frequency above which forces are hardly caused by the motion comes out.

use crate::motion::derivatives::mean_rate;
use crate::motion::even::{is_even, resample_evenly};
use crate::motion::thresholds::{BAND_FEWEST_PERIODS, BAND_HIGHEST_SHARE, FORCE_BAND_FACTOR, MOTION_POWER_SHARE};
use crate::signal::hann_power;

/// Highest frequency at which forces follow a motion, Hz; at most a fifth of the sampling rate. `None` if nothing
/// moves.
pub(crate) fn motion_band<'a>(time: &[f64], positions: impl IntoIterator<Item = &'a [f64]>) -> Option<f64> {
    let rate = mean_rate(time);
    // The frequency of each coordinate below which its power lies.
    let reach = positions.into_iter().filter_map(|q| {
        let power = if is_even(time) {
            hann_power(q)
        } else {
            hann_power(&resample_evenly(time, q))
        };
        let total: f64 = power.iter().sum();
        let mut sum = 0.0;
        let within = power.iter().position(|one| {
            sum += one;
            sum > MOTION_POWER_SHARE * total
        })?;
        (total > 0.0).then(|| 0.5 * rate * within.max(1) as f64 / (power.len() - 1) as f64)
    });
    // The coordinate with the highest frequency decides; the result has limits from the length and the rate of the
    // recording.
    let reach = reach.fold(0.0, f64::max);
    let highest = BAND_HIGHEST_SHARE * rate;
    let lowest = (BAND_FEWEST_PERIODS * rate / time.len() as f64).min(highest);
    (reach > 0.0).then(|| (FORCE_BAND_FACTOR * reach).clamp(lowest, highest))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_band_reaches_beyond_the_fastest_motion() {
        let time: Vec<f64> = (0..4000).map(|k| 0.002 * f64::from(k)).collect();
        let tone = |hz: f64| -> Vec<f64> {
            let angle = |t: &f64| (std::f64::consts::TAU * hz * t).sin();
            time.iter().map(angle).collect()
        };
        let motion = [tone(0.3), tone(2.0)];
        let band = motion_band(&time, motion.iter().map(Vec::as_slice)).unwrap();
        assert!((38.0..44.0).contains(&band), "{band}");
        assert_eq!(motion_band(&time, [vec![1.0; 4000].as_slice()]), None);
    }
}
