//! Periodic motions as finite Fourier series: samples go in. The period, accurate to a small part of a step, the
//! series with exact derivatives, and whether its residual is noise come out.
//!
//! Sources: J. Swevers, C. Ganseman, D. B. Tuekel, J. de Schutter, H. Van Brussel, "Optimal robot excitation and
//! identification", IEEE Trans. Robotics and Automation 13 (1997), for motions as series; G. H. Golub and V. Pereyra,
//! SIAM J. Numerical Analysis 10 (1973), for the period as the only nonlinear unknown after projection.
//!
//! Decision: the series is tried first and judged by its residual. If positions are a Fourier series plus white
//! noise, differences and filters only lose information.

use std::f64::consts::{LN_2, TAU};

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::motion::derivatives::SmoothedCoordinate;
use crate::motion::periods::find_period;
use crate::motion::thresholds::{
    MIN_LINE_POWER_RATIO, SERIES_CLOSED_SHARE, SERIES_CLOSED_STEPS, SERIES_FEWEST_SAMPLES, SERIES_HIGHEST_SHARE,
    SERIES_MOST_HARMONICS, SERIES_SAMPLES_PER_COLUMN, WHITE_MEAN_SIGMAS,
};
use crate::signal::{float_to_count, hann_power};

/// Longer runs are not tried as a single period, because that takes long and such slow motions do not occur.
const LONGEST_ALONE: usize = 1 << 18;
/// Number of samples at the start of a long run in which harmonics are counted first.
const BEGINNING: usize = 1 << 16;
/// Samples that are processed at the same time.
const LANES: usize = 8;
/// The iteration of the period ends when it changes by less than this part of a step.
const CONVERGENCE_TOLERANCE: f64 = 1e-7;

/// A periodic motion and the noise in its samples.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PeriodicSeries {
    /// The period, s.
    pub(crate) period: f64,
    /// Number of harmonics above the noise.
    pub(crate) harmonics: usize,
    /// Standard deviation of the residual of each signal, in its unit.
    pub(crate) noise: Vec<f64>,
}

/// The least squares projection on a Fourier series of one period: the part that depends on the times only.
struct FourierBasis<'a> {
    /// Times of the samples, s.
    time: &'a [f64],
    /// The period, s.
    period: f64,
    /// Number of harmonics.
    harmonics: usize,
    /// Cholesky factor of the normal equations.
    normal: Cholesky<f64, Dyn>,
}

impl<'a> FourierBasis<'a> {
    /// Prepares the projection. `None` if there are too few samples for the harmonics, or if their times do not
    /// distinguish them.
    fn new(time: &'a [f64], period: f64, harmonics: usize) -> Option<Self> {
        let columns = 2 * harmonics + 1;
        if time.len() < SERIES_SAMPLES_PER_COLUMN * columns || !(period > 0.0 && period.is_finite()) {
            return None;
        }
        // Products of sines and cosines are sums of those of up to twice as many harmonics. So all entries of the
        // normal equations follow from one sum per column.
        let (mut cosines, mut sines) = (vec![0.0; columns], vec![0.0; columns]);
        for chunk in time.chunks(LANES) {
            let angles = lanes(chunk, |t| TAU * (t - time[0]) / period);
            for_each_harmonic(&angles, columns - 1, |k, cos, sin| {
                cosines[k] += cos[..chunk.len()].iter().sum::<f64>();
                sines[k] += sin[..chunk.len()].iter().sum::<f64>();
            });
        }
        let half = |a: f64, b: f64| 0.5 * (a + b);
        let mut normal = DMatrix::zeros(columns, columns);
        normal[(0, 0)] = time.len() as f64;
        cosines[0] = time.len() as f64;
        // Entries for pairs of harmonics, by the product formulas of sine and cosine.
        for j in 1..=harmonics {
            let (cos_j, sin_j) = (2 * j - 1, 2 * j);
            normal[(cos_j, 0)] = cosines[j];
            normal[(sin_j, 0)] = sines[j];
            for k in 1..=j {
                let (cos_k, sin_k) = (2 * k - 1, 2 * k);
                normal[(cos_j, cos_k)] = half(cosines[j - k], cosines[j + k]);
                normal[(sin_j, sin_k)] = half(cosines[j - k], -cosines[j + k]);
                normal[(sin_j, cos_k)] = half(sines[j + k], sines[j - k]);
                // Only the lower triangle is read.
                if k < j {
                    normal[(cos_j, sin_k)] = half(sines[j + k], -sines[j - k]);
                }
            }
        }
        let normal = normal.cholesky()?;
        // Over complete periods the columns are nearly orthogonal. If they are not, normal equations are too
        // inaccurate.
        let diagonal = normal.l_dirty().diagonal();
        let is_sound = diagonal.min() > 1e-3 * diagonal.max();
        is_sound.then_some(Self {
            time,
            period,
            harmonics,
            normal,
        })
    }

    /// Coefficients of the series: the constant, then cosine and sine of each harmonic.
    fn fit_coefficients(&self, values: &[f64]) -> DVector<f64> {
        let mut sums = vec![[0.0; LANES]; 2 * self.harmonics + 1];
        for (chunk, values) in self.time.chunks(LANES).zip(values.chunks(LANES)) {
            let angles = lanes(chunk, |t| self.angle(*t));
            // Lanes behind the last sample have the value zero, so they do not contribute.
            let values = lanes(values, |value| *value);
            for (sum, value) in sums[0].iter_mut().zip(&values) {
                *sum += value;
            }
            for_each_harmonic(&angles, self.harmonics, |k, cos, sin| {
                for lane in 0..LANES {
                    sums[2 * k - 1][lane] += values[lane] * cos[lane];
                    sums[2 * k][lane] += values[lane] * sin[lane];
                }
            });
        }
        let right = sums.iter().map(|sum| sum.iter().sum());
        self.normal.solve(&DVector::from_iterator(sums.len(), right))
    }

    /// Angle of the first harmonic at a time, rad.
    fn angle(&self, t: f64) -> f64 {
        TAU * (t - self.time[0]) / self.period
    }

    /// Values, rates and accelerations of the series at all times.
    fn evaluate_series(&self, series: &DVector<f64>) -> [Vec<f64>; 3] {
        let w = TAU / self.period;
        let mut along = [(); 3].map(|()| Vec::with_capacity(self.time.len()));
        for chunk in self.time.chunks(LANES) {
            let angles = lanes(chunk, |t| self.angle(*t));
            let mut sums = [[series[0]; LANES], [0.0; LANES], [0.0; LANES]];
            for_each_harmonic(&angles, self.harmonics, |k, cos, sin| {
                let (a, b) = (series[2 * k - 1], series[2 * k]);
                let w = w * k as f64;
                for lane in 0..LANES {
                    let value = a * cos[lane] + b * sin[lane];
                    sums[0][lane] += value;
                    sums[1][lane] += w * (b * cos[lane] - a * sin[lane]);
                    sums[2][lane] -= w * w * value;
                }
            });
            for (column, sum) in along.iter_mut().zip(&sums) {
                column.extend_from_slice(&sum[..chunk.len()]);
            }
        }
        along
    }

    /// The residual of the values, and the rates of the series.
    fn residual(&self, series: &DVector<f64>, values: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let [along, rates, _] = self.evaluate_series(series);
        let pairs = values.iter().zip(along);
        (pairs.map(|(value, fitted)| value - fitted).collect(), rates)
    }

    /// One Gauss-Newton step towards the period with the smallest residual of all signals, s. Each signal is weighted
    /// by its residual, so that units do not matter.
    fn period_step(&self, signals: &[&[f64]]) -> Option<f64> {
        let (mut slope, mut curvature) = (0.0, 0.0);
        for values in signals {
            let series = self.fit_coefficients(values);
            let (residual, rates) = self.residual(&series, values);
            let size: f64 = residual.iter().map(|r| r * r).sum();
            if size == 0.0 {
                continue;
            }
            // A longer period slows the motion down relative to its start. The part of this change that the
            // coefficients can compensate is removed.
            let slower = |(t, rate): (&f64, f64)| -(t - self.time[0]) / self.period * rate;
            let changes: Vec<f64> = self.time.iter().zip(rates).map(slower).collect();
            let (changes, _) = self.residual(&self.fit_coefficients(&changes), &changes);
            let pairs = changes.iter().zip(&residual);
            slope += pairs.map(|(c, r)| c * r).sum::<f64>() / size;
            curvature += changes.iter().map(|c| c * c).sum::<f64>() / size;
        }
        let step = slope / curvature;
        step.is_finite().then_some(step)
    }
}

/// The values of a function of up to [`LANES`] numbers; zero in the remaining lanes.
fn lanes(some: &[f64], of: impl Fn(&f64) -> f64) -> [f64; LANES] {
    let mut lanes = [0.0; LANES];
    for (lane, x) in lanes.iter_mut().zip(some) {
        *lane = of(x);
    }
    lanes
}

/// Calls `visit` with `k`, `cos(k angle)` and `sin(k angle)` for `k` from 1 to `harmonics`, by repeated rotation.
fn for_each_harmonic(
    angles: &[f64; LANES],
    harmonics: usize,
    mut visit: impl FnMut(usize, &[f64; LANES], &[f64; LANES]),
) {
    let (sin1, cos1) = (angles.map(f64::sin), angles.map(f64::cos));
    let (mut cos, mut sin) = ([1.0; LANES], [0.0; LANES]);
    for k in 1..=harmonics {
        for lane in 0..LANES {
            (cos[lane], sin[lane]) = (
                cos[lane] * cos1[lane] - sin[lane] * sin1[lane],
                sin[lane] * cos1[lane] + cos[lane] * sin1[lane],
            );
        }
        visit(k, &cos, &sin);
    }
}

/// The least squares projection of positions on a Fourier series of `harmonics` harmonics, with exact derivatives.
/// `None` if there are too few samples for the harmonics, or if the run is much shorter than the period.
pub(crate) fn project_on_series(
    time: &[f64],
    positions: &[f64],
    period: f64,
    harmonics: usize,
) -> Option<SmoothedCoordinate> {
    let basis = FourierBasis::new(time, period, harmonics)?;
    let series = basis.fit_coefficients(positions);
    let [q, qd, qdd] = basis.evaluate_series(&series);
    Some(SmoothedCoordinate { q, qd, qdd })
}

/// The series of which the signals are samples with white noise only; `None` if there is none.
///
/// The period is the shortest one after which the run repeats, from [`find_period`]. Otherwise it is the length of
/// the run, with or without a repetition of the first sample at the end, if all positions and rates return to their
/// start: signals that are rates may return while the `positions` do not, as in a swing-up. It is then refined for the
/// smallest residual. Harmonics count up to the last one above the noise. The residual is noise if its spectrum is flat: no
/// line may exceed the noise at the harmonics, and the mean must be that of the upper half of the band.
pub(crate) fn find_series(time: &[f64], signals: &[&[f64]], positions: &[&[f64]]) -> Option<PeriodicSeries> {
    // Constant signals have no period.
    let moving: Vec<&[f64]> = signals
        .iter()
        .copied()
        .filter(|values| values.iter().any(|v| v.total_cmp(&values[0]).is_ne()))
        .collect();
    if moving.is_empty() || time.len() < SERIES_FEWEST_SAMPLES {
        return None;
    }
    let duration = time[time.len() - 1] - time[0];
    let step = duration / (time.len() - 1) as f64;
    // Candidates for the period: one that repeats in the run, otherwise the run as one period.
    // Rates may repeat while positions advance, so both must.
    let returning: Vec<&[f64]> = moving.iter().chain(positions).copied().collect();
    let found = find_period(time, &returning);
    let whole = [duration + step, duration]
        .into_iter()
        .filter(|_| found.is_none() && time.len() <= LONGEST_ALONE)
        .filter(|_| returning.iter().all(|values| is_closed(values)));
    let (period, harmonics) = found
        .into_iter()
        .chain(whole)
        .find_map(|period| refine_series(time, &moving, period, duration + 1.5 * step))?;
    // The noise of each signal is the residual of its series.
    let basis = FourierBasis::new(time, period, harmonics)?;
    let noise = signals
        .iter()
        .map(|values| {
            let (residual, _) = basis.residual(&basis.fit_coefficients(values), values);
            let left = (time.len() - 2 * harmonics - 1) as f64;
            (residual.iter().map(|r| r * r).sum::<f64>() / left).sqrt()
        })
        .collect();
    Some(PeriodicSeries {
        period,
        harmonics,
        noise,
    })
}

/// Whether a signal could continue at its end with its start: the difference is at most a few of its steps, and so
/// small beside its range that it is no part of the motion. A signal that crosses most of its range in one step is noise
/// about a constant.
fn is_closed(values: &[f64]) -> bool {
    let largest = values.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f64::max);
    let [low, high] = [f64::min, f64::max].map(|choose| values.iter().copied().fold(values[0], choose));
    let apart = (values[values.len() - 1] - values[0]).abs();
    let is_noise = largest > 0.5 * (high - low);
    apart <= SERIES_CLOSED_STEPS * largest && (is_noise || apart <= SERIES_CLOSED_SHARE * (high - low))
}

/// The period near the given one, and the number of significant harmonics; `None` if their residual is not noise.
///
/// `longest` is the upper limit of the period, s.
fn refine_series(time: &[f64], signals: &[&[f64]], mut period: f64, longest: f64) -> Option<(f64, usize)> {
    let n = time.len();
    let step = (time[n - 1] - time[0]) / (n - 1) as f64;
    let most = float_to_count(SERIES_HIGHEST_SHARE * period / step).min(SERIES_MOST_HARMONICS);
    if most == 0 {
        return None;
    }
    // Up to four Gauss-Newton steps on the first `samples` samples.
    let refined = |period: f64, samples: usize, harmonics: usize| {
        let signals: Vec<&[f64]> = signals.iter().map(|values| &values[..samples]).collect();
        let mut period = period;
        for _ in 0..4 {
            let change = FourierBasis::new(&time[..samples], period, harmonics)?.period_step(&signals)?;
            period = (period + change.clamp(-step, step)).clamp(2.0 * step, longest);
            if change.abs() < CONVERGENCE_TOLERANCE * step {
                break;
            }
        }
        Some(period)
    };
    // The number of significant harmonics in the first `samples` samples.
    let harmonics_in = |samples: usize, period: f64, most: usize| {
        let signals: Vec<&[f64]> = signals.iter().map(|values| &values[..samples]).collect();
        last_significant_harmonic(&time[..samples], &signals, period, most)
    };
    // The start of a long run shows its harmonics; using all of it would take minutes for a hundred harmonics.
    let mut samples = float_to_count(3.0 * period / step).max(BEGINNING).min(n);
    // Few harmonics come first, because an error of the period shifts the phase of high harmonics after many periods.
    // Only significant ones are used at the end, because others make the period uncertain, and a wrong period adds
    // harmonics.
    period = refined(period, samples, most.min(20))?;
    period = refined(period, samples, most)?;
    let few = harmonics_in(samples, period, most)?;
    period = refined(period, samples, few)?;
    if samples == n {
        return Some((period, harmonics_in(n, period, most)?.min(few)));
    }
    while samples < n {
        samples = (4 * samples).min(n);
        period = refined(period, samples, few)?;
    }
    // A longer run has less noise per line, so a few more harmonics may be significant.
    Some((period, harmonics_in(n, period, most.min(2 * few + 8))?))
}

/// The last harmonic above the noise in any signal. `None` if the residual of all harmonics is not white noise, or if
/// none is significant.
fn last_significant_harmonic(time: &[f64], signals: &[&[f64]], period: f64, most: usize) -> Option<usize> {
    let step = (time[time.len() - 1] - time[0]) / (time.len() - 1) as f64;
    let basis = FourierBasis::new(time, period, most)?;
    let mut harmonics = 0;
    for values in signals {
        let series = basis.fit_coefficients(values);
        let (residual, _) = basis.residual(&series, values);
        let variance = white_variance(&residual, step, 2.0 * most as f64 / period)?;
        // The series has fitted a part of the noise as well.
        let variance = variance * time.len() as f64 / (time.len() - 2 * most - 1) as f64;
        // Mean square of the amplitude of a line that white noise causes.
        let average = 4.0 * variance / time.len() as f64;
        let stands_out = |k: &usize| series[2 * k - 1].powi(2) + series[2 * k].powi(2) > MIN_LINE_POWER_RATIO * average;
        harmonics = harmonics.max((1..=most).rev().find(stands_out).unwrap_or(0));
    }
    (harmonics > 0).then_some(harmonics)
}

/// The variance of a residual if it is white; `None` if not. Lines and the mean are checked up to `up_to`, Hz, where
/// motion can be.
fn white_variance(residual: &[f64], step: f64, up_to: f64) -> Option<f64> {
    let power = hann_power(residual);
    let bins = power.len();
    // The level of the noise from the median of the upper half of the band.
    let mut upper = power[bins / 2..].to_vec();
    upper.sort_by(f64::total_cmp);
    let level = upper[upper.len() / 2] / LN_2;
    let low = float_to_count((2.0 * step * up_to * (bins - 1) as f64).ceil()).clamp(8, bins / 2);
    let lower = &power[1..low];
    let mean = lower.iter().sum::<f64>() / lower.len() as f64;
    // Padding and window correlate neighbouring bins; this is the number of independent ones.
    let independent = lower.len() as f64 * residual.len() as f64 / (3 * bins) as f64;
    let is_flat = mean <= level * (1.0 + WHITE_MEAN_SIGMAS / independent.sqrt().max(1.0));
    let stands_out = lower.iter().any(|p| *p > MIN_LINE_POWER_RATIO * level);
    let variance = residual.iter().map(|r| r * r).sum::<f64>() / residual.len() as f64;
    (is_flat && !stands_out && variance > 0.0).then_some(variance)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_noise::TestNoise;

    const PERIOD: f64 = 2.37;

    fn motion(t: f64) -> [f64; 3] {
        let w = TAU / PERIOD;
        let term = |k: f64, a: f64, phase: f64| {
            let angle = k * w * t + phase;
            [
                a * angle.sin(),
                a * k * w * angle.cos(),
                -a * (k * w).powi(2) * angle.sin(),
            ]
        };
        let (a, b) = (term(1.0, 0.8, 0.3), term(3.0, 0.3, 1.1));
        [0, 1, 2].map(|i| a[i] + b[i])
    }

    /// Uneven times, as a clock that drifts gives them.
    fn times(n: u32) -> Vec<f64> {
        (0..n)
            .map(|i| f64::from(i) * 0.004 + 0.0009 * (f64::from(i) * 0.7).sin())
            .collect()
    }

    fn noisy(time: &[f64], sigma: f64, truth: impl Fn(f64) -> f64) -> Vec<f64> {
        let mut noise = TestNoise::new(11);
        let sample = |t: &f64| truth(*t) + sigma * noise.normal();
        time.iter().map(sample).collect()
    }

    #[test]
    fn a_series_gives_exact_derivatives() {
        let time = times(2500);
        let q: Vec<f64> = time.iter().map(|t| motion(*t)[0]).collect();
        let prepared = project_on_series(&time, &q, PERIOD, 5).expect("enough samples");
        for (i, t) in time.iter().enumerate() {
            let truth = motion(*t);
            assert!((prepared.q[i] - truth[0]).abs() < 1e-9);
            assert!((prepared.qd[i] - truth[1]).abs() < 1e-8);
            assert!((prepared.qdd[i] - truth[2]).abs() < 1e-7);
        }
        assert_eq!(project_on_series(&time[..10], &q[..10], PERIOD, 5), None);
    }

    /// Over part of a period the columns are far from orthogonal; the shortcut for their products stays right.
    #[test]
    fn products_of_columns_are_those_of_the_columns() {
        let time = times(400);
        let basis = FourierBasis::new(&time, PERIOD, 3).expect("two thirds of a period");
        let rows = DMatrix::from_fn(time.len(), 7, |i, j| {
            let angle = TAU * j.div_ceil(2) as f64 * (time[i] - time[0]) / PERIOD;
            if j % 2 == 0 && j > 0 { angle.sin() } else { angle.cos() }
        });
        let factor = basis.normal.l();
        let difference = &factor * factor.transpose() - rows.transpose() * &rows;
        assert!(difference.amax() < 1e-9, "{difference}");
    }

    /// Two and a half periods, two to the sample, and one: with and without the first sample repeated.
    #[test]
    fn a_periodic_run_is_a_series_and_noise() {
        for n in [1482, 1185, 593, 594] {
            let step = if n < 600 { PERIOD / 593.0 } else { 0.004 };
            let time: Vec<f64> = (0..n).map(|i| f64::from(i) * step).collect();
            let q = noisy(&time, 1e-5, |t| motion(t)[0]);
            let still = noisy(&time, 1e-6, |_| 0.2);
            let found = find_series(&time, &[&q, &still], &[]).expect("a series");
            assert!((found.period - PERIOD).abs() < 3e-5, "{n}: {found:?}");
            assert_eq!(found.harmonics, 3, "{n}");
            assert!((found.noise[0] / 1e-5 - 1.0).abs() < 0.1, "{n}: {found:?}");
            assert!((found.noise[1] / 1e-6 - 1.0).abs() < 0.1, "{n}: {found:?}");
        }
    }

    /// A swing-up: the rate starts and ends at zero and is smooth, and the position ends elsewhere.
    #[test]
    fn a_motion_that_ends_elsewhere_is_no_period() {
        let time: Vec<f64> = (0..594).map(|i| f64::from(i) * PERIOD / 593.0).collect();
        let rate = |t: f64| (TAU / PERIOD * t).cos() - 1.0 + 0.3 * (TAU * 2.0 / PERIOD * t).sin();
        let rates = noisy(&time, 1e-4, rate);
        let mut position = vec![0.0];
        for i in 1..time.len() {
            position.push(position[i - 1] + 0.5 * (rate(time[i]) + rate(time[i - 1])) * (time[i] - time[i - 1]));
        }
        assert!(find_series(&time, &[&rates], &[]).is_some());
        assert_eq!(find_series(&time, &[&rates], &[&position]), None);
    }

    #[test]
    fn what_leaves_more_than_noise_is_no_series() {
        let refused = |time: &[f64], truth: &dyn Fn(f64) -> f64| {
            let q = noisy(time, 1e-5, truth);
            assert_eq!(find_series(time, &[&q], &[]), None);
        };
        let long = times(1482);
        // A vibration beside the period, a drift, a controller that does not repeat itself.
        refused(&long, &|t| motion(t)[0] + 1e-5 * (11.3 * t).sin());
        refused(&long, &|t| motion(t)[0] + 2e-5 * t);
        refused(&long, &|t| motion(t)[0] * (1.0 + 1e-4 * (0.9 * t).sin()));
        // Part of a period; one that ends where it began, but not as fast.
        refused(&times(430), &|t| motion(t)[0]);
        refused(&times(593), &|t| (t - 1.186).powi(2));
        refused(&long, &|_| 0.0);
    }
}
