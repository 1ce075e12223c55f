//! Oscillations that are periodic in time, such as mains hum: spectral lines of the residual.
//!
//! A line is higher than the spectrum around it, beyond the frequencies of the motion. Its frequency is where a least
//! squares fit of a sine and a cosine explains most. A slow line, among the frequencies of the motion, is visible after
//! everything that is a function of the state has been subtracted: then it is most of the residual, with one frequency
//! in every segment and one phase from its begin to its end.

use std::f64::consts::TAU;

use super::column::ForceColumn;
use super::disturbance::{Disturbance, EstimatedQuantity, is_white};
use super::pool::{ColumnPool, FitScope, solve_gram};
use super::problem::DiagnosisProblem;
use super::thresholds::{
    LINE_LOW_HZ, LINE_LOWEST_HZ, LINE_MAIN_SHARE, MIN_LINE_RATIO, MIN_LINE_SHARE, MOST_LINES, SLOW_LINE_LEAST_PERIODS,
    SLOW_LINE_LEAST_SEGMENT_SHARE, SLOW_LINE_MOST_REMAINING_SHARE, SLOW_LINE_PARTS,
};
use crate::signal::dot;
use crate::signal::{hann_power, median};

/// Half width of the neighbourhood of a line, and of the line itself, in steps of the spectrum.
const NEIGHBOURHOOD: usize = 48;
const LINE: usize = 6;
/// Number of refinements of the frequency of a slow line.
const NARROWED: usize = 10;

/// Removes spectral lines from the measured forces, with their own phase in every segment, and reports them. `rest` is
/// the residual, `[channel][sample]`.
pub(crate) fn remove_lines(problem: &mut DiagnosisProblem, rest: &[Vec<f64>]) -> Vec<Disturbance> {
    let channels = rest.len();
    let unfit = excluded_samples(problem);
    let mut left = rest.to_vec();
    let mut frequencies: Vec<f64> = Vec::new();
    // Subtract one line after the other, the most prominent first.
    let mut lowest = LINE_LOWEST_HZ;
    while frequencies.len() <= MOST_LINES {
        // The most prominent line of all channels.
        let Some(frequency) = (0..channels)
            .filter(|d| has_sensor(problem, *d))
            .filter_map(|d| most_prominent_line(problem, &left[d], lowest))
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, frequency)| frequency)
        else {
            break;
        };
        let frequency = refine_frequency(problem, &left, &unfit, frequency);
        // Subtract it from the residual of every channel.
        let mut without = left.clone();
        for (d, left) in without.iter_mut().enumerate().filter(|(d, _)| has_sensor(problem, *d)) {
            // Samples that were not measured stay as they are.
            let lost = problem.layout.left_out.get(d).map_or(&[][..], Vec::as_slice);
            subtract_sinusoid(problem, left, &unfit[d], lost, frequency);
        }
        // Whether the line is most of the residual of a channel.
        let is_most =
            |(before, after): (&Vec<f64>, &Vec<f64>)| dot(after, after) < (1.0 - LINE_MAIN_SHARE) * dot(before, before);
        // A line at a low frequency that is not most of a residual comes from the motion; look above that range only.
        if frequency < LINE_LOW_HZ && !left.iter().zip(&without).any(is_most) {
            // The least squares fit may move a line from above this bound to below it: it would be found forever.
            if lowest >= LINE_LOW_HZ {
                break;
            }
            lowest = LINE_LOW_HZ;
            continue;
        }
        left = without;
        frequencies.push(frequency);
    }
    // Many lines are a periodic motion and no hum.
    if frequencies.is_empty() || frequencies.len() > MOST_LINES {
        return Vec::new();
    }
    let mut found = Vec::new();
    for d in 0..channels {
        // Only channels on which the lines matter are changed.
        let taken: Vec<f64> = rest[d].iter().zip(&left[d]).map(|(a, b)| a - b).collect();
        if dot(&taken, &taken) > MIN_LINE_SHARE * dot(&rest[d], &rest[d]) {
            found.extend(remove_and_report(problem, d, &taken, &frequencies));
        }
    }
    found
}

/// Whether the force of a channel was measured.
fn has_sensor(problem: &DiagnosisProblem, channel: usize) -> bool {
    problem.without_sensor.get(channel) != Some(&true)
}

/// A slow spectral line in one channel.
pub(crate) struct SlowSpectralLine {
    /// Index of the channel.
    channel: usize,
    /// Frequency, Hz.
    frequency: f64,
    /// Its force at every sample, N or N m.
    force: Vec<f64>,
}

impl SlowSpectralLine {
    /// Subtracts it from the measured force of its channel and reports it; `None` if the channel has no force.
    pub(crate) fn remove_from_force(&self, problem: &mut DiagnosisProblem) -> Option<Disturbance> {
        remove_and_report(problem, self.channel, &self.force, &[self.frequency])
    }
}

/// Slow lines in the residual of a diagnosis, `[channel][sample]`; `again` is the repeatable share of each channel's
/// squares. Where that is more than noise, a line must explain more than a function of the state can: a residual that
/// repeats with the period of the motion is a function of the state, and hum may be nearly so.
pub(crate) fn slow_lines(
    problem: &DiagnosisProblem,
    rest: &[Vec<f64>],
    again: &[f64],
    unexplained: &[usize],
) -> Vec<SlowSpectralLine> {
    let unfit = excluded_samples(problem);
    let mut found = Vec::new();
    for (channel, own) in rest.iter().enumerate() {
        // Squares that are not a function of the state.
        let by_no_state = dot(own, own) * (1.0 - again[channel]);
        // White noise contains no line.
        if !has_sensor(problem, channel) || is_white(problem, channel, by_no_state / own.len().max(1) as f64) {
            continue;
        }
        let Some(frequency) = strongest_frequency(problem, own) else {
            continue;
        };
        let own = std::slice::from_ref(own);
        let frequency = refine_frequency(problem, own, std::slice::from_ref(&unfit[channel]), frequency);
        let Some((frequency, wave)) = SinusoidFitter::new(problem, rest, channel).find_sinusoid(frequency) else {
            continue;
        };
        // In a channel with unexplained repeatable residual, a line must leave less than half of the non-repeatable
        // part.
        let explains_more = dot(&wave.residual, &wave.residual) < SLOW_LINE_MOST_REMAINING_SHARE * by_no_state;
        if explains_more || !unexplained.contains(&channel) {
            found.push(SlowSpectralLine {
                channel,
                frequency,
                force: wave.explained,
            });
        }
    }
    found
}

/// Fits one sinusoid to the residual of a channel, with its own amplitude and phase in every segment, together with
/// base and friction.
struct SinusoidFitter<'a> {
    /// Segments, base columns and friction.
    problem: &'a DiagnosisProblem,
    channel: usize,
    /// Residual of the channel without a sinusoid.
    residual: &'a [f64],
    pool: ColumnPool<'a>,
    /// Pool columns of base and friction.
    base_columns: Vec<usize>,
    /// Pool column of the residual of all channels.
    target: usize,
    /// Weight of each channel: one over the mean square of its residual.
    weights: Vec<f64>,
}

/// A fitted sinusoid.
struct SinusoidFit {
    /// Its force at every sample of the channel, N or N m.
    explained: Vec<f64>,
    /// Residual of its channel.
    residual: Vec<f64>,
    /// Squared residual of all channels, each relative to that without the sinusoid.
    squares: f64,
}

impl<'a> SinusoidFitter<'a> {
    fn new(problem: &'a DiagnosisProblem, rest: &'a [Vec<f64>], channel: usize) -> Self {
        let mut pool = ColumnPool::new(&problem.layout).exclude_samples(&problem.undecided_samples());
        let columns = problem.base.iter().chain(&problem.friction);
        let known = columns.map(|c| pool.add(c)).collect();
        let target = pool.add(ForceColumn(rest.iter().cloned().map(Some).collect()));
        // Channels are weighted by their residual before the fit.
        let weight = |rest: &Vec<f64>| {
            let squares = dot(rest, rest) / rest.len().max(1) as f64;
            // A channel without residual gets no weight, since it contains no information on the noise of others.
            if squares > 0.0 { 1.0 / squares } else { 0.0 }
        };
        Self {
            problem,
            channel,
            residual: &rest[channel],
            pool,
            base_columns: known,
            target,
            weights: rest.iter().map(weight).collect(),
        }
    }

    /// Fits a sinusoid of one frequency, Hz.
    fn fit_sinusoid(&mut self, frequency: f64) -> SinusoidFit {
        let layout = &self.problem.layout;
        let mut which = self.base_columns.clone();
        let mut start = 0;
        for segment in &layout.segments {
            // A sine and a cosine in every segment.
            for shift in [0.0, 0.25] {
                let mut wave = vec![0.0; layout.samples()];
                for (i, x) in wave[start..start + segment.samples].iter_mut().enumerate() {
                    *x = (TAU * (frequency * segment.step * i as f64 + shift)).sin();
                }
                let mut column = ForceColumn(vec![None; self.weights.len()]);
                column.0[self.channel] = Some(wave);
                which.push(self.pool.add(column));
            }
            start += segment.samples;
        }
        which.push(self.target);
        let (factors, _) = solve_gram(&self.pool.gram(&which, &self.weights, FitScope::All));
        which.pop();
        let mut left = self.pool.residual(self.target, &which, factors.as_slice());
        // Squared residual relative to that before the fit, summed over the channels.
        let weighed = left.iter().zip(&self.weights);
        let squares = weighed.map(|(left, weight)| weight * dot(left, left)).sum();
        // Force of the sinusoid: its columns times their factors.
        let mut taken = vec![0.0; layout.samples()];
        let waves = self.pool.split_off(self.target + 1);
        for (wave, factor) in waves.iter().zip(factors.iter().skip(self.base_columns.len())) {
            for (sum, x) in taken.iter_mut().zip(wave.0[self.channel].iter().flatten()) {
                *sum += factor * x;
            }
        }
        SinusoidFit {
            explained: taken,
            residual: left.swap_remove(self.channel),
            squares,
        }
    }

    /// Share of the channel's squared residual that a sinusoid explains, in the part of a segment in which it explains
    /// least. Each segment is divided into `parts`.
    fn least_explained_share(&self, wave: &SinusoidFit, parts: usize) -> f64 {
        let mut start = 0;
        let mut least: Option<f64> = None;
        for segment in &self.problem.layout.segments {
            for part in 0..parts {
                let [from, to] = [part, part + 1].map(|k| start + k * segment.samples / parts);
                let [before, after] = [self.residual, &wave.residual].map(|r| dot(&r[from..to], &r[from..to]));
                // Share of the squares that the sinusoid explains in this part.
                if before > 0.0 {
                    let taken = 1.0 - after / before;
                    least = Some(least.map_or(taken, |least| least.min(taken)));
                }
            }
            start += segment.samples;
        }
        least.unwrap_or(0.0)
    }

    /// The frequency, Hz, near `about` with the smallest residual, and its sinusoid. `None` unless it explains most of
    /// the residual in every part of every segment: a resonance has no such constant phase.
    fn find_sinusoid(&mut self, about: f64) -> Option<(f64, SinusoidFit)> {
        let lasts = self.problem.layout.segments.iter();
        let lasts: Vec<f64> = lasts.map(|s| s.samples as f64 * s.step).collect();
        // Fewer periods than this could be a motion or a drift.
        if lasts.iter().any(|lasts| lasts * about < SLOW_LINE_LEAST_PERIODS) {
            return None;
        }
        // The starting frequency must already explain a part of every segment.
        let mut best = (about, self.fit_sinusoid(about));
        if self.least_explained_share(&best.1, 1) < SLOW_LINE_LEAST_SEGMENT_SHARE {
            return None;
        }
        // Narrow the frequency, starting below the resolution of the longest segment.
        let mut step = 0.4 / lasts.iter().fold(f64::MIN_POSITIVE, |a, b| a.max(*b));
        for _ in 0..NARROWED {
            for frequency in [best.0 - step, best.0 + step] {
                let wave = self.fit_sinusoid(frequency);
                if wave.squares < best.1.squares {
                    best = (frequency, wave);
                }
            }
            step *= 0.6;
        }
        (self.least_explained_share(&best.1, SLOW_LINE_PARTS) >= LINE_MAIN_SHARE).then_some(best)
    }
}

/// Samples that are not used to find lines, `[channel][sample]`: those that were not measured and those that decide
/// nothing.
fn excluded_samples(problem: &DiagnosisProblem) -> Vec<Vec<bool>> {
    let mut unfit = problem.undecided_samples();
    for (unfit, lost) in unfit.iter_mut().zip(&problem.layout.left_out) {
        // Samples that were not measured have no residual.
        for (unfit, lost) in unfit.iter_mut().zip(lost) {
            *unfit |= lost;
        }
    }
    unfit
}

/// Subtracts lines from the measured force of a channel and reports amplitude and frequencies.
fn remove_and_report(
    problem: &mut DiagnosisProblem,
    channel: usize,
    taken: &[f64],
    frequencies: &[f64],
) -> Option<Disturbance> {
    let values = problem.measured.0[channel].as_mut()?;
    let lost = problem.layout.left_out.get(channel);
    for (i, (value, taken)) in values.iter_mut().zip(taken).enumerate() {
        if lost.is_none_or(|lost| lost.get(i) != Some(&true)) {
            *value -= taken;
        }
    }
    // Samples at which the lines were subtracted.
    let acts = taken.iter().filter(|x| **x != 0.0).count();
    // A sine of amplitude A has the mean square A^2 / 2.
    let amplitude = (2.0 * dot(taken, taken) / acts.max(1) as f64).sqrt();
    let mut estimates = vec![EstimatedQuantity::new("amplitude", amplitude, "")];
    let each = frequencies.iter();
    estimates.extend(each.map(|f| EstimatedQuantity::new("frequency", *f, "Hz")));
    Some(Disturbance {
        kind: "periodic_in_time".to_owned(),
        at: vec![problem.layout.channels[channel].clone()],
        estimates,
        recordings: Vec::new(),
        interval: None,
        description: None,
    })
}

/// The frequency of the highest peak in the spectrum of the longest segment, Hz.
fn strongest_frequency(problem: &DiagnosisProblem, rest: &[f64]) -> Option<f64> {
    let mut start = 0;
    let mut longest: Option<(f64, &[f64], f64)> = None;
    for segment in &problem.layout.segments {
        let part = &rest[start..start + segment.samples];
        start += segment.samples;
        let lasts = segment.samples as f64 * segment.step;
        if longest.is_none_or(|(most, ..)| lasts > most) {
            longest = Some((lasts, part, segment.step));
        }
    }
    let (_, part, step) = longest?;
    // Power spectrum with a Hann window; index times the frequency step is the frequency.
    let power = hann_power(part);
    let highest = (1..power.len()).max_by(|a, b| power[*a].total_cmp(&power[*b]))?;
    Some(highest as f64 * 0.5 / step / (power.len() - 1) as f64)
}

/// The most prominent line of a series above a frequency `lowest`, Hz: its ratio to the spectrum around it, and its
/// frequency, Hz. `None` if none is above the least ratio.
fn most_prominent_line(problem: &DiagnosisProblem, rest: &[f64], lowest: f64) -> Option<(f64, f64)> {
    let mut best: Option<(f64, f64)> = None;
    let mut start = 0;
    for segment in &problem.layout.segments {
        let power = hann_power(&rest[start..start + segment.samples]);
        start += segment.samples;
        // A short segment has too few frequencies for a neighbourhood.
        if power.len() < 4 * NEIGHBOURHOOD {
            continue;
        }
        let per_step = 0.5 / segment.step / (power.len() - 1) as f64;
        for k in LINE..power.len() {
            let frequency = k as f64 * per_step;
            // A line is the highest of its neighbours.
            let near = &power[k - LINE..(k + LINE + 1).min(power.len())];
            if frequency < lowest || near.iter().any(|p| *p > power[k]) {
                continue;
            }
            let about = (k.saturating_sub(NEIGHBOURHOOD)..(k + NEIGHBOURHOOD + 1).min(power.len()))
                .filter(|i| i.abs_diff(k) > LINE)
                .map(|i| power[i]);
            // The median of the neighbourhood is not affected by other lines.
            let level = median(about.collect());
            let above = power[k] / level.max(f64::MIN_POSITIVE);
            if level > 0.0 && above > MIN_LINE_RATIO && best.is_none_or(|(most, _)| above > most) {
                best = Some((above, frequency));
            }
        }
    }
    best
}

/// The frequency, Hz, near `about` at which a sine and a cosine explain most of all channels.
fn refine_frequency(problem: &DiagnosisProblem, rest: &[Vec<f64>], unfit: &[Vec<bool>], about: f64) -> f64 {
    let longest = problem.layout.segments.iter();
    let longest = longest.map(|s| s.samples as f64 * s.step);
    // Frequency resolution of the longest segment.
    let width = 1.0 / longest.fold(f64::MIN_POSITIVE, f64::max);
    // Squares that a sinusoid explains in all channels together.
    let explained = |frequency: f64| -> f64 {
        let all = rest.iter().zip(unfit).map(|(rest, unfit)| {
            let mut left = rest.clone();
            subtract_sinusoid(problem, &mut left, unfit, unfit, frequency);
            dot(rest, rest) - dot(&left, &left)
        });
        all.sum()
    };
    let (mut centre, mut step) = (about, 0.5 * width);
    // Pattern search: move to the best of three frequencies and reduce the step.
    for _ in 0..12 {
        let tried = [centre - step, centre, centre + step].map(|f| (explained(f), f));
        let best = tried.into_iter().max_by(|a, b| a.0.total_cmp(&b.0));
        centre = best.map_or(centre, |(_, f)| f);
        step *= 0.6;
    }
    centre
}

/// Subtracts the best sine and cosine from a series, segment by segment. They are fitted without the samples in
/// `unfit`, and subtracted from all samples that are not `spared`.
fn subtract_sinusoid(problem: &DiagnosisProblem, rest: &mut [f64], unfit: &[bool], spared: &[bool], frequency: f64) {
    let mut start = 0;
    for segment in &problem.layout.segments {
        let part = &mut rest[start..start + segment.samples];
        let is_out = |out: &[bool], i: usize| out.get(start + i) == Some(&true);
        // Sine and cosine at the samples of the segment.
        let waves: Vec<(f64, f64)> = (0..part.len())
            .map(|i| (TAU * frequency * segment.step * i as f64).sin_cos())
            .collect();
        let mut sums = [0.0; 5];
        for i in (0..part.len()).filter(|i| !is_out(unfit, *i)) {
            let ((s, c), r) = (waves[i], part[i]);
            for (sum, x) in sums.iter_mut().zip([s * s, s * c, c * c, s * r, c * r]) {
                *sum += x;
            }
        }
        // Normal equations of two unknowns.
        let [ss, sc, cc, sr, cr] = sums;
        let determinant = ss * cc - sc * sc;
        if determinant > 1e-9 * ss * cc {
            let a = (sr * cc - cr * sc) / determinant;
            let b = (cr * ss - sr * sc) / determinant;
            for i in (0..part.len()).filter(|i| !is_out(spared, *i)) {
                let (s, c) = waves[i];
                part[i] -= a * s + b * c;
            }
        }
        start += segment.samples;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::problem::{SampleLayout, SampleSegment};
    use crate::test_noise::TestNoise;

    /// Two segments of 300 samples at 44 Hz, with the residual of a force.
    fn problem(rest: &[f64]) -> DiagnosisProblem {
        let segment = |name: &str, is_check: bool| SampleSegment {
            name: name.into(),
            samples: rest.len() / 2,
            start: 0.0,
            step: 1.0 / 44.0,
            recorded_step: 1.0 / 44.0,
            is_check,
        };
        DiagnosisProblem {
            layout: SampleLayout {
                channels: vec!["a".into()],
                segments: vec![segment("fit", false), segment("check", true)],
                left_out: Vec::new(),
            },
            measured: ForceColumn(vec![Some(rest.to_vec())]),
            noise: vec![0.3],
            ..DiagnosisProblem::default()
        }
    }

    fn taken_off(problem: &mut DiagnosisProblem, rest: &[Vec<f64>]) -> Vec<Disturbance> {
        let lines = slow_lines(problem, rest, &vec![0.0; rest.len()], &[]);
        let off = lines.iter().filter_map(|line| line.remove_from_force(problem));
        off.collect()
    }

    #[test]
    fn a_slow_hum_is_taken_off() {
        for seed in 0..10 {
            let mut noise = TestNoise::new(seed);
            let rest: Vec<f64> = (0..600)
                .map(|i| {
                    let phase = if i < 300 { 0.4 } else { 2.0 };
                    5.0 * (TAU * 2.31 / 44.0 * f64::from(i) + phase).sin() + noise.normal()
                })
                .collect();
            let mut problem = problem(&rest);
            let found = taken_off(&mut problem, &[rest]);
            let values = &found[0].estimates;
            assert!((values[0].value - 5.0).abs() < 0.3, "{values:?}");
            assert!((values[1].value - 2.31).abs() < 0.02, "{values:?}");
            let left = problem.measured.0[0].as_ref().unwrap();
            let left = dot(left, left) / left.len() as f64;
            assert!((0.8..1.2).contains(&left), "{left}");
        }
    }

    /// A repeatable residual may be a hum too, if the hum explains more than any function of the state.
    #[test]
    fn a_hum_that_nearly_comes_again_is_told_and_a_law_is_not() {
        let mut noise = TestNoise::new(3);
        let rest: Vec<f64> = (0..600)
            .map(|i| 5.0 * (TAU * 2.31 / 44.0 * f64::from(i)).sin() + noise.normal())
            .collect();
        let noise_share = 1.0 / (12.5 + 1.0);
        for (again, lines) in [(0.6, 1), (1.0 - noise_share, 0)] {
            let found = slow_lines(&problem(&rest), std::slice::from_ref(&rest), &[again], &[0]);
            assert_eq!(found.len(), lines, "{again}");
        }
    }

    #[test]
    fn noise_of_few_hertz_is_no_hum() {
        for corner in [3.0, 1.0, 0.3] {
            for seed in 0..100 {
                let mut noise = TestNoise::new(seed);
                let keeps = (-TAU * corner / 44.0_f64).exp();
                let mut last = [0.0; 2];
                let rest: Vec<f64> = (0..600)
                    .map(|_| {
                        last[0] = keeps * last[0] + noise.normal();
                        last[1] = keeps * last[1] + last[0];
                        last[1]
                    })
                    .collect();
                let found = taken_off(&mut problem(&rest), std::slice::from_ref(&rest));
                assert_eq!(found, [], "{corner} Hz, seed {seed}");
            }
        }
    }

    /// A lightly damped mode that noise drives has a frequency, but neither amplitude nor phase.
    #[test]
    fn what_swings_by_itself_is_no_hum() {
        for damping in [0.05, 0.02, 0.01] {
            let mut taken = 0;
            for seed in 0..50 {
                let mut noise = TestNoise::new(seed);
                let omega = TAU * 2.0 / 44.0;
                let keeps = (-damping * omega).exp();
                let mut last = [0.0; 2];
                let swings: Vec<f64> = (0..1200)
                    .map(|_| {
                        let now = 2.0 * keeps * omega.cos() * last[0] - keeps * keeps * last[1] + noise.normal();
                        last = [now, last[0]];
                        now
                    })
                    .collect();
                let rest = &swings[600..];
                let found = taken_off(&mut problem(rest), &[rest.to_vec()]);
                taken += found.len();
            }
            assert!(taken <= 1, "damping {damping}: {taken} of 50");
        }
    }

    /// The spectrum shows a line at the frequency of its next step, which may lie above the bound that the line itself is
    /// below. It is then neither subtracted nor searched forever.
    #[test]
    fn a_line_just_below_the_bound_ends_the_search() {
        let mut skipped = 0;
        for k in 0..60 {
            let mut noise = TestNoise::new(k);
            let rate = 43.0 + 0.03 * k as f64;
            let rest: Vec<f64> = (0..1200)
                .map(|i| (TAU * (LINE_LOW_HZ - 0.01) / rate * f64::from(i)).sin() + noise.normal())
                .collect();
            let mut problem = problem(&rest);
            for segment in &mut problem.layout.segments {
                segment.step = 1.0 / rate;
            }
            problem.removed = vec![0.0];
            let above = most_prominent_line(&problem, &rest, LINE_LOW_HZ);
            skipped += usize::from(above.is_some());
            let found = remove_lines(&mut problem, &[rest]);
            assert!(found.len() <= 1, "{found:?}");
        }
        assert!(skipped > 0, "no line was shown above the bound");
    }

    /// A third of a segment was not measured, and a column of the base has nearly the frequency of the hum.
    #[test]
    fn a_hum_is_told_by_its_size_beside_the_model_and_lost_samples() {
        let mut noise = TestNoise::new(4);
        let n = 600;
        let base: Vec<f64> = (0..n).map(|i| (TAU * 0.7 / 44.0 * f64::from(i)).sin()).collect();
        let hum = |i: i32| 1.0 * (TAU * 0.78 / 44.0 * f64::from(i) + 0.3).sin();
        let measured: Vec<f64> = (0..n)
            .map(|i| 4.0 * base[usize::try_from(i).unwrap()] + hum(i) + 0.1 * noise.normal())
            .collect();
        let lost: Vec<bool> = (0..n).map(|i| (100..200).contains(&i)).collect();
        let measured: Vec<f64> = measured
            .iter()
            .zip(&lost)
            .map(|(y, lost)| if *lost { 0.0 } else { *y })
            .collect();
        let mut problem = problem(&measured);
        problem.base = vec![ForceColumn(vec![Some(base)])];
        problem.layout.left_out = vec![lost.clone()];
        problem.removed = vec![0.0];
        let mut pool = ColumnPool::new(&problem.layout);
        let which = [pool.add(&problem.base[0]), pool.add(&problem.measured)];
        let (factors, _) = solve_gram(&pool.gram(&which, &[1.0], FitScope::All));
        let rest = pool.residual(which[1], &which[..1], factors.as_slice());
        drop(pool);
        let found = taken_off(&mut problem, &rest);
        let values = &found[0].estimates;
        assert!((values[0].value - 1.0).abs() < 0.03, "{values:?}");
        assert!((values[1].value - 0.78).abs() < 0.005, "{values:?}");
        for (i, lost) in lost.iter().enumerate() {
            let value = problem.measured.0[0].as_ref().unwrap()[i];
            assert!(!lost || value == 0.0, "{i}: {value}");
        }
    }
}
