//! Periodic runs: positions go in; the period, and how well the forces repeat, come out.
//!
//! Sources: J. Swevers, C. Ganseman, D. B. Tuekel, J. de Schutter, H. Van Brussel, "Optimal robot excitation and
//! identification", IEEE Trans. Robotics and Automation 13 (1997): the spread over the periods is the noise.
//! The motion itself is a finite Fourier series: see [`crate::motion::series`].

use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

use crate::motion::thresholds::{
    FORCE_JUMP_INTERIOR, FORCE_JUMP_RATIO, PERIOD_FEWEST_SAMPLES, PERIOD_LEFT_DIFFERENCE, PERIOD_MOST_DIFFERENCE,
    PERIOD_RETURNED_DIFFERENCE, PHASE_MOST_STEPS,
};
use crate::signal::{float_to_count, median};

/// Points of the coarse search for a period.
const GRID: usize = 2048;

/// How well a periodic run repeats.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunRepeatability {
    /// The period, s.
    pub period: f64,
    /// Complete periods in the run.
    pub periods: usize,
    /// Spread of the forces over the periods, relative to their size (2-norms, all drives together). The error of any
    /// model on one period is at least this.
    pub noise_floor: f64,
    /// The same for each drive.
    pub channels: IndexMap<String, f64>,
}

/// The shortest period after which all positions repeat, s; `None` if there is none with two periods in the run. The
/// last period ends one step after the last sample. Positions that do not move are ignored.
pub(crate) fn find_period(time: &[f64], positions: &[&[f64]]) -> Option<f64> {
    let moving: Vec<(&[f64], f64)> = positions
        .iter()
        .map(|q| (*q, variance(q)))
        .filter(|(q, variance)| *variance > 0.0 && !is_noise(q, *variance))
        .collect();
    if moving.is_empty() || time.len() < PERIOD_FEWEST_SAMPLES {
        return None;
    }
    let (start, end) = (time[0], time[time.len() - 1]);
    // Half a step more, because the period is not known exactly yet.
    let longest = 0.5 * (end - start) * (1.0 + 1.5 / (time.len() - 1) as f64);
    // Segments from the start of the run, longer in each pass, with coarser grids. Short periods are then found in a
    // short segment.
    let mut samples = time.len().min(GRID);
    loop {
        let found = coarse_period(&time[..samples], &moving)
            .map(|(period, step)| refine_period(time, &moving, period, step))
            .filter(|(period, apart)| *apart < PERIOD_MOST_DIFFERENCE && *period <= longest);
        if let Some((period, _)) = found {
            return Some(period);
        }
        if samples == time.len() {
            return None;
        }
        samples = (4 * samples).min(time.len());
    }
}

/// Whether neighbouring samples differ about as much as any two samples, as in a coordinate at standstill. The ratio
/// is that of J. von Neumann (1941), which is twice the limit used here for noise.
fn is_noise(values: &[f64], variance: f64) -> bool {
    let steps: f64 = values.windows(2).map(|w| (w[1] - w[0]).powi(2)).sum();
    steps > variance * (values.len() - 1) as f64
}

/// The period at which the motion first returns to itself on an even grid, and the step of the grid.
fn coarse_period(time: &[f64], moving: &[(&[f64], f64)]) -> Option<(f64, f64)> {
    let (start, end) = (*time.first()?, *time.last()?);
    let m = time.len().min(GRID);
    let step = (end - start) / (m - 1) as f64;
    // Positions on the grid, scaled so that unrelated motions have the distance 1.
    let places: Vec<(usize, f64)> = (0..m).map(|i| place_in_time(time, start + step * i as f64)).collect();
    let grids: Vec<Vec<f64>> = moving
        .iter()
        .map(|(q, variance)| {
            let scale = (2.0 * variance * moving.len() as f64).sqrt();
            places.iter().map(|place| value_at(q, *place) / scale).collect()
        })
        .collect();
    // Distance of the motion from itself some steps later, 1 for unrelated motions.
    let apart = |lag: usize| -> f64 {
        let sum: f64 = grids
            .iter()
            .map(|q| {
                let pairs = q.iter().zip(&q[lag..]);
                pairs.map(|(a, b)| (a - b).powi(2)).sum::<f64>()
            })
            .sum();
        sum / (m - lag) as f64
    };
    // Two lags more than half of the run, so that a minimum at half of the run can be recognised.
    let far: Vec<f64> = (0..=m / 2 + 2).map(apart).collect();
    // The motion must leave its start before it can return.
    let left = far.iter().position(|d| *d > PERIOD_LEFT_DIFFERENCE)?;
    let candidate = (left + 1..far.len() - 1)
        .find(|i| far[*i] < PERIOD_RETURNED_DIFFERENCE && far[*i] <= far[i - 1] && far[*i] <= far[i + 1])?;
    Some((step * candidate as f64, step))
}

/// The period at the recorded times of the complete run, accurate to a small part of a step, and the distance of the
/// motion from itself after it.
fn refine_period(time: &[f64], moving: &[(&[f64], f64)], period: f64, step: f64) -> (f64, f64) {
    let end = time[time.len() - 1];
    // A long run is thinned out, because a few thousand samples determine the period.
    let stride = (time.len() / (4 * GRID)).max(1);
    let apart = |period: f64| -> f64 {
        let (mut sum, mut n) = (0.0, 0);
        for i in (0..time.len()).step_by(stride) {
            if time[i] + period > end {
                break;
            }
            // One place in time for all coordinates.
            let place = place_in_time(time, time[i] + period);
            for (q, variance) in moving {
                sum += (value_at(q, place) - q[i]).powi(2) / (2.0 * variance * moving.len() as f64);
            }
            n += 1;
        }
        sum / f64::from(n.max(1))
    };
    // One and a half steps on each side contain the minimum.
    let period = minimise_by_golden_sections(apart, period - 1.5 * step, period + 1.5 * step);
    (period, apart(period))
}

/// The spread of forces over the periods of a run; `None` if there are fewer than two periods, or no force.
pub(crate) fn measure_repeatability(
    time: &[f64],
    period: f64,
    names: &[String],
    forces: &[Vec<f64>],
) -> Option<RunRepeatability> {
    let (start, end) = (*time.first()?, *time.last()?);
    let step = (end - start) / (time.len() - 1) as f64;
    // The last sample of the last period is one step before the next period. The period is known to a part of a step.
    let periods = float_to_count((end + 1.5 * step - start) / period);
    let phases = float_to_count((period / step).round());
    if periods < 2 || phases < 2 {
        return None;
    }
    // Samples of different periods seldom have the same phase, so forces are interpolated between neighbours. This
    // reduces white noise by a known factor, which is corrected. Phases without neighbours are ignored.
    let mut places = Vec::with_capacity(phases);
    for phase in 0..phases {
        let all = (0..periods).map(|k| {
            let t = start + period * (k as f64 + phase as f64 / phases as f64);
            bracketing_sample(time, t, PHASE_MOST_STEPS * step)
        });
        places.extend(all.collect::<Option<Vec<_>>>());
    }
    // For one force: the variance over the periods, corrected for the interpolation, and the mean square.
    let spread = |force: &[f64]| {
        let (mut error, mut noise, mut size) = (0.0, 0.0, 0.0);
        // At a reversal of friction a force between two samples is not known.
        let usual = median(force.windows(2).map(|w| (w[1] - w[0]).abs()).collect());
        let jumps = |(i, part): &(usize, f64)| {
            FORCE_JUMP_INTERIOR.contains(part) && (force[i + 1] - force[*i]).abs() > FORCE_JUMP_RATIO * usual
        };
        let mut values = 0;
        for place in places.iter().filter(|place| !place.iter().any(jumps)) {
            values += periods;
            let at = |(i, part): &(usize, f64)| (1.0 - part) * force[*i] + part * force[*i + 1];
            let mean = place.iter().map(at).sum::<f64>() / periods as f64;
            let lowered = |(_, part): &(usize, f64)| (1.0 - part).powi(2) + part.powi(2);
            noise += place.iter().map(lowered).sum::<f64>() * (1.0 - 1.0 / periods as f64);
            error += place.iter().map(|p| (at(p) - mean).powi(2)).sum::<f64>();
            size += place.iter().map(|p| at(p).powi(2)).sum::<f64>();
        }
        if values == 0 {
            return (0.0, 0.0);
        }
        (error / noise, size / values as f64)
    };
    let sums: Vec<(f64, f64)> = forces.iter().map(|force| spread(force)).collect();
    let ratio = |(error, size): (f64, f64)| (size > 0.0).then(|| (error / size).sqrt());
    let total = sums
        .iter()
        .fold((0.0, 0.0), |(e, s), (error, size)| (e + error, s + size));
    Some(RunRepeatability {
        period,
        periods,
        noise_floor: ratio(total)?,
        channels: names
            .iter()
            .cloned()
            .zip(sums)
            .filter_map(|(name, sums)| Some((name, ratio(sums)?)))
            .collect(),
    })
}

/// Variance of numbers around their mean.
fn variance(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n
}

/// The sample before a time, and the share of the way to the next one. `None` if these two are more than `apart`
/// apart, s. Outside of the samples the first or last pair is used up to half that distance.
fn bracketing_sample(time: &[f64], at: f64, apart: f64) -> Option<(usize, f64)> {
    let after = first_not_before(time, at).clamp(1, time.len() - 1);
    let (t0, t1) = (time[after - 1], time[after]);
    let is_near = t1 - t0 <= apart && at >= t0 - 0.5 * apart && at <= t1 + 0.5 * apart;
    is_near.then(|| (after - 1, ((at - t0) / (t1 - t0)).clamp(0.0, 1.0)))
}

/// The sample before a time, and the share of the way to the next one; outside of the samples the first or last one.
fn place_in_time(time: &[f64], at: f64) -> (usize, f64) {
    let after = first_not_before(time, at).clamp(1, time.len() - 1);
    let (t0, t1) = (time[after - 1], time[after]);
    (after - 1, ((at - t0) / (t1 - t0)).clamp(0.0, 1.0))
}

/// Index of the first of ascending times that is not before `at`; their number if all are.
fn first_not_before(time: &[f64], at: f64) -> usize {
    let last = time.len() - 1;
    // Steps are mostly equal, so that the index is known but for a few samples.
    let guess = float_to_count((at - time[0]) / (time[last] - time[0]) * last as f64).clamp(1, last);
    let (from, to) = (guess.saturating_sub(2), (guess + 2).min(last));
    if time[from] < at && at <= time[to] {
        from + time[from..=to].partition_point(|t| *t < at)
    } else {
        time.partition_point(|t| *t < at)
    }
}

/// Linear interpolation of samples at a place.
fn value_at(values: &[f64], (before, part): (usize, f64)) -> f64 {
    values[before] + part * (values[before + 1] - values[before])
}

/// The minimum of a function with a single minimum between `low` and `high`, by golden section search.
fn minimise_by_golden_sections(f: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    for _ in 0..40 {
        let (a, b) = (high - golden * (high - low), low + golden * (high - low));
        if f(a) < f(b) {
            high = b;
        } else {
            low = a;
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::test_noise::TestNoise;

    const PERIOD: f64 = 2.37;

    fn motion(t: f64) -> f64 {
        let w = TAU / PERIOD;
        0.8 * (w * t + 0.3).sin() + 0.3 * (3.0 * w * t + 1.1).sin()
    }

    /// Uneven times, as a clock that drifts gives them.
    fn times(n: u32) -> Vec<f64> {
        (0..n)
            .map(|i| f64::from(i) * 0.004 + 0.0009 * (f64::from(i) * 0.7).sin())
            .collect()
    }

    #[test]
    fn the_period_is_found_on_the_true_time_base() {
        let time = times(2500);
        let mut noise = TestNoise::new(4);
        let q: Vec<f64> = time.iter().map(|t| motion(*t) + 1e-4 * noise.normal()).collect();
        let period = find_period(&time, &[&q, &vec![1.0; q.len()]]).expect("a period");
        assert!((period - PERIOD).abs() < 1e-3, "{period}");
        // Less than two periods, or none at all.
        assert_eq!(find_period(&time[..1100], &[&q[..1100]]), None);
        let drifting: Vec<f64> = time.iter().map(|t| t * t).collect();
        assert_eq!(find_period(&time, &[&drifting]), None);
        assert_eq!(find_period(&time, &[&vec![1.0; q.len()]]), None);
    }

    #[test]
    fn a_place_in_time_is_the_same_as_by_bisection() {
        let mut time = times(500);
        // A gap, and times that repeat.
        for t in &mut time[200..] {
            *t += 3.0;
        }
        time[300] = time[299];
        let mut noise = TestNoise::new(6);
        let edges = [time[0] - 1.0, time[499] + 1.0, 2.0];
        let inside = (0..2000).map(|_| time[0] + 5.0 * noise.uniform());
        for at in inside.chain(time.clone()).chain(edges) {
            assert_eq!(first_not_before(&time, at), time.partition_point(|t| *t < at), "{at}");
        }
    }

    #[test]
    fn many_short_periods_are_not_taken_for_few_long_ones() {
        let time = times(200_000);
        let q: Vec<f64> = time.iter().map(|t| motion(*t)).collect();
        let period = find_period(&time, &[&q]).expect("a period");
        assert!((period - PERIOD).abs() < 1e-3, "{period}");
    }

    /// The period is half a step longer than 592 steps, so that samples of two periods never have the same phase; forces
    /// jump with the sign of a rate, and a piece of the run is missing.
    #[test]
    fn the_spread_over_periods_is_the_noise() {
        let mut noise = TestNoise::new(9);
        for (jump, missing) in [(0.0, 0), (20.0, 0), (20.0, 100)] {
            let time: Vec<f64> = (0..5925)
                .filter(|i| !(1500..1500 + missing).contains(i))
                .map(|i| f64::from(i) * 0.004)
                .collect();
            let force: Vec<f64> = time
                .iter()
                .map(|t| {
                    let rate = motion(t + 1e-4) - motion(*t);
                    100.0 * motion(*t) + jump * rate.signum() + 0.3 * noise.normal()
                })
                .collect();
            let size = (force.iter().map(|f| f * f).sum::<f64>() / force.len() as f64).sqrt();
            let found = measure_repeatability(&time, PERIOD, &["a".to_owned()], &[force]).expect("ten periods");
            assert_eq!(found.periods, 10);
            assert!(
                (found.noise_floor * size / 0.3 - 1.0).abs() < 0.05,
                "{jump} {missing}: {found:?}"
            );
            assert!((found.channels["a"] - found.noise_floor).abs() < 1e-12);
        }
    }
}
