//! The band of a motion that was not filtered: states go in, a frequency comes out below which they are and above which a
//! force can hardly be theirs.

use crate::motion::derivatives::mean_rate;
use crate::signal::hann_power;

/// The part of the power of a rate that lies in its band.
const PART: f64 = 0.999;
/// Forces hold products of rates, and friction that reverses with them: harmonics up to this one count.
const HARMONICS: f64 = 3.0;

/// Up to where forces follow a motion, Hz: three times the frequency below which nearly all of the power of any rate lies, at
/// most a fifth of the sampling rate. `None` if nothing moves.
pub(crate) fn of_motion(time: &[f64], states: &[[Vec<f64>; 3]]) -> Option<f64> {
    let rate = mean_rate(time);
    let reach = states.iter().filter_map(|[_, qd, _]| {
        let power = hann_power(qd);
        let total: f64 = power.iter().sum();
        let mut sum = 0.0;
        let within = power.iter().position(|one| {
            sum += one;
            sum > PART * total
        })?;
        (total > 0.0).then(|| 0.5 * rate * within.max(1) as f64 / (power.len() - 1) as f64)
    });
    let reach = reach.fold(0.0, f64::max);
    (reach > 0.0).then(|| (HARMONICS * reach).clamp(4.0 * rate / time.len() as f64, 0.2 * rate))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_band_reaches_beyond_the_fastest_motion() {
        let time: Vec<f64> = (0..4000).map(|k| 0.005 * f64::from(k)).collect();
        let rate = |hz: f64| -> Vec<f64> {
            let angle = |t: &f64| (std::f64::consts::TAU * hz * t).sin();
            time.iter().map(angle).collect()
        };
        let states = [0.3, 2.0].map(|hz| [vec![0.0; 4000], rate(hz), vec![0.0; 4000]]);
        let band = of_motion(&time, &states).unwrap();
        assert!((5.8..7.0).contains(&band), "{band}");
        let still = [[vec![1.0; 4000], vec![0.0; 4000], vec![0.0; 4000]]];
        assert_eq!(of_motion(&time, &still), None);
    }
}
