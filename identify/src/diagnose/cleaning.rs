//! What is taken off the measured forces before anything is looked for, since no least squares bears it: single outliers, and
//! lines of the spectrum that are periodic in time, as the hum of the mains. Both are told by name.
//!
//! Both are looked for in what base parameters and friction leave. An outlier stands above its neighbours' median by many
//! robust deviations, and not where a drive reverses. A line stands above the spectrum about it, beyond the frequencies of the
//! motion; its frequency is where least squares of a sine and a cosine explains most.

use std::f64::consts::TAU;

use super::disturbance::{Disturbance, Quantity};
use super::pool::{On, Pool, dot, solve};
use super::problem::Problem;
use crate::signal::{hann_power, median};

/// Samples whose median an outlier stands out from.
const NEIGHBOURS: usize = 9;
/// By how many robust deviations.
const OUT: f64 = 7.0;
/// What is less than this part of the force is rounding.
const SLIGHT: f64 = 1e-3;
/// What happens more often is how the force is.
const RARE: f64 = 0.05;
/// Samples about a reversal that are left alone.
const REVERSAL: usize = 4;
/// Samples on either side of a reversal that count no more, and the part of all that they may be.
const JUMP: usize = 1;
const MOST_JUMPS: f64 = 0.1;
/// How many times the middle of the spectrum about it a line must reach.
const ABOVE: f64 = 60.0;
/// Half the width of what counts as about it, and of the line itself, in steps of the spectrum.
const ABOUT: usize = 48;
const LINE: usize = 6;
/// Lines below this frequency, Hz, may be those of the motion; so may those of which there are many. Below the second they
/// must be most of what is left of a channel.
const LOWEST: f64 = 3.0;
const LOW: f64 = 8.0;
const MOST_OF: f64 = 0.6;
const MOST_LINES: usize = 6;
/// The part of a channel's squared rest that all of its lines must be.
const LEAST: f64 = 0.02;

/// Takes outliers and lines off the measured forces and says which there were.
pub(crate) fn clean(problem: &mut Problem) -> Vec<Disturbance> {
    let before = problem.measured.clone();
    let mut found = outliers(problem);
    found.extend(lines(problem));
    let squares = |(old, new): (&Option<Vec<f64>>, &Option<Vec<f64>>)| {
        let pairs = old.iter().flatten().zip(new.iter().flatten());
        let sum: f64 = pairs.map(|(a, b)| (a - b).powi(2)).sum();
        sum / old.as_ref().map_or(1, Vec::len).max(1) as f64
    };
    let removed = before.0.iter().zip(&problem.measured.0).map(squares);
    for (all, more) in problem.removed.iter_mut().zip(removed) {
        *all += more;
    }
    found
}

/// What base parameters and friction leave, channels weighed alike.
fn rest(problem: &Problem) -> Vec<Vec<f64>> {
    let mut pool = Pool::new(&problem.layout).without(&problem.undecided());
    let columns = problem.base.iter().chain(&problem.friction);
    let mut which: Vec<usize> = columns.map(|c| pool.add(c)).collect();
    let measured = pool.add(&problem.measured);
    let size = |values: &Option<Vec<f64>>| {
        values
            .as_ref()
            .map_or(0.0, |v| dot(v, v) / v.len().max(1) as f64)
    };
    let weight = |values: &Option<Vec<f64>>| 1.0 / size(values).max(f64::MIN_POSITIVE);
    let mut weights: Vec<f64> = problem.measured.0.iter().map(weight).collect();
    which.push(measured);
    let mut rest = Vec::new();
    for _ in 0..2 {
        let (factors, _) = solve(&pool.gram(&which, &weights, On::All));
        rest = pool.rest(measured, &which[..which.len() - 1], factors.as_slice());
        for (weight, rest) in weights.iter_mut().zip(&rest) {
            // The middle of squares is none of the outliers'.
            let middle = median(rest.iter().map(|r| r * r).collect());
            *weight = 1.0 / middle.max(f64::MIN_POSITIVE);
        }
    }
    rest
}

fn outliers(problem: &mut Problem) -> Vec<Disturbance> {
    let mut flagged: Vec<Vec<bool>> =
        vec![vec![false; problem.layout.samples()]; problem.layout.channels.len()];
    let mut sizes: Vec<Vec<f64>> = vec![Vec::new(); flagged.len()];
    for _ in 0..3 {
        let rest = rest(problem);
        let mut more = false;
        for (d, rest) in rest.iter().enumerate() {
            let reverses = reversals(problem, d, REVERSAL);
            let apart = from_neighbours(problem, rest);
            let spread = 1.4826 * median(apart.iter().map(|x| x.abs()).collect());
            let force = problem.force(d);
            let size = (dot(&force, &force) / force.len().max(1) as f64).sqrt();
            let bound = (OUT * spread.max(problem.noise[d])).max(SLIGHT * size);
            let new: Vec<usize> = (0..rest.len())
                .filter(|i| apart[*i].abs() > bound && !reverses[*i])
                .collect();
            let is_rare = (new.len() as f64) < RARE * rest.len() as f64;
            let Some(values) = problem.measured.0[d].as_mut().filter(|_| is_rare) else {
                continue;
            };
            for i in new {
                values[i] -= apart[i];
                sizes[d].push(apart[i]);
                flagged[d][i] = true;
                more = true;
            }
        }
        if !more {
            break;
        }
    }
    let channels = flagged.iter().zip(&sizes).enumerate();
    let told = channels.filter(|(_, (_, sizes))| !sizes.is_empty());
    told.map(|(d, (flagged, sizes))| {
        let count = flagged.iter().filter(|f| **f).count() as f64;
        let size = (sizes.iter().map(|x| x * x).sum::<f64>() / sizes.len() as f64).sqrt();
        Disturbance {
            kind: "outliers".to_owned(),
            at: vec![problem.layout.channels[d].clone()],
            estimates: vec![
                Quantity::new("share", count / flagged.len().max(1) as f64, "1"),
                Quantity::new("size", size, ""),
            ],
            recordings: Vec::new(),
            interval: None,
            says: None,
        }
    })
    .collect()
}

/// Samples about which a channel's drive reverses, where friction jumps.
fn reversals(problem: &Problem, channel: usize, samples: usize) -> Vec<bool> {
    let n = problem.layout.samples();
    let mut about = vec![false; n];
    let sign = problem.friction.get(3 * channel + 1);
    let Some(sign) = sign.and_then(|column| column.0[channel].as_ref()) else {
        return about;
    };
    for i in 1..n {
        if sign[i] * sign[i - 1] <= 0.0 {
            let end = (i + samples).min(n);
            about[i.saturating_sub(samples)..end].fill(true);
        }
    }
    about
}

/// How far each sample is from the middle of those about it.
fn from_neighbours(problem: &Problem, rest: &[f64]) -> Vec<f64> {
    let mut apart = Vec::with_capacity(rest.len());
    let mut start = 0;
    for stretch in &problem.layout.stretches {
        let part = &rest[start..start + stretch.samples];
        for i in 0..part.len() {
            let low = i.saturating_sub(NEIGHBOURS / 2);
            let high = (low + NEIGHBOURS).min(part.len());
            apart.push(part[i] - median(part[low..high].to_vec()));
        }
        start += stretch.samples;
    }
    apart
}

/// Lines of the spectrum, taken off with a phase of their own in every stretch.
fn lines(problem: &mut Problem) -> Vec<Disturbance> {
    let rest = rest(problem);
    let channels = rest.len();
    let mut left = rest.clone();
    let mut frequencies: Vec<f64> = Vec::new();
    let mut lowest = LOWEST;
    while frequencies.len() <= MOST_LINES {
        let Some(frequency) = (0..channels)
            .filter_map(|d| line(problem, &left[d], lowest))
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, frequency)| frequency)
        else {
            break;
        };
        let frequency = finest(problem, &left, frequency);
        let mut without = left.clone();
        for left in &mut without {
            take_off(problem, left, frequency);
        }
        let is_most = |(before, after): (&Vec<f64>, &Vec<f64>)| {
            dot(after, after) < (1.0 - MOST_OF) * dot(before, before)
        };
        if frequency < LOW && !left.iter().zip(&without).any(is_most) {
            lowest = LOW;
            continue;
        }
        left = without;
        frequencies.push(frequency);
    }
    if frequencies.is_empty() || frequencies.len() > MOST_LINES {
        return Vec::new();
    }
    let mut found = Vec::new();
    for d in 0..channels {
        let squares = dot(&rest[d], &rest[d]);
        let taken: Vec<f64> = rest[d].iter().zip(&left[d]).map(|(a, b)| a - b).collect();
        let own = dot(&taken, &taken);
        let Some(values) = problem.measured.0[d]
            .as_mut()
            .filter(|_| own > LEAST * squares)
        else {
            continue;
        };
        for (value, taken) in values.iter_mut().zip(&taken) {
            *value -= taken;
        }
        let amplitude = (2.0 * own / taken.len().max(1) as f64).sqrt();
        let mut estimates = vec![Quantity::new("amplitude", amplitude, "")];
        let each = frequencies.iter();
        estimates.extend(each.map(|f| Quantity::new("frequency", *f, "Hz")));
        found.push(Disturbance {
            kind: "periodic_in_time".to_owned(),
            at: vec![problem.layout.channels[d].clone()],
            estimates,
            recordings: Vec::new(),
            interval: None,
            says: None,
        });
    }
    found
}

/// The line that stands out most from the spectrum about it: by how much, and its frequency, Hz.
fn line(problem: &Problem, rest: &[f64], lowest: f64) -> Option<(f64, f64)> {
    let mut best: Option<(f64, f64)> = None;
    let mut start = 0;
    for stretch in &problem.layout.stretches {
        let power = hann_power(&rest[start..start + stretch.samples]);
        start += stretch.samples;
        if power.len() < 4 * ABOUT {
            continue;
        }
        let per_step = 0.5 / stretch.step / (power.len() - 1) as f64;
        for k in LINE..power.len() {
            let frequency = k as f64 * per_step;
            // A line is the highest of its neighbours.
            let near = &power[k - LINE..(k + LINE + 1).min(power.len())];
            if frequency < lowest || near.iter().any(|p| *p > power[k]) {
                continue;
            }
            let about = (k.saturating_sub(ABOUT)..(k + ABOUT + 1).min(power.len()))
                .filter(|i| i.abs_diff(k) > LINE)
                .map(|i| power[i]);
            let level = median(about.collect());
            let above = power[k] / level.max(f64::MIN_POSITIVE);
            if level > 0.0 && above > ABOVE && best.is_none_or(|(most, _)| above > most) {
                best = Some((above, frequency));
            }
        }
    }
    best
}

/// The frequency about which a sine and a cosine explain most of all channels.
fn finest(problem: &Problem, rest: &[Vec<f64>], about: f64) -> f64 {
    let longest = problem.layout.stretches.iter();
    let longest = longest.map(|s| s.samples as f64 * s.step);
    let width = 1.0 / longest.fold(f64::MIN_POSITIVE, f64::max);
    let explained = |frequency: f64| -> f64 {
        let all = rest.iter().map(|rest| {
            let mut left = rest.clone();
            take_off(problem, &mut left, frequency);
            dot(rest, rest) - dot(&left, &left)
        });
        all.sum()
    };
    let (mut centre, mut step) = (about, 0.5 * width);
    for _ in 0..12 {
        let tried = [centre - step, centre, centre + step].map(|f| (explained(f), f));
        let best = tried.into_iter().max_by(|a, b| a.0.total_cmp(&b.0));
        centre = best.map_or(centre, |(_, f)| f);
        step *= 0.6;
    }
    centre
}

/// Takes the best sine and cosine off a series, stretch by stretch.
fn take_off(problem: &Problem, rest: &mut [f64], frequency: f64) {
    let mut start = 0;
    for stretch in &problem.layout.stretches {
        let part = &mut rest[start..start + stretch.samples];
        let waves: Vec<(f64, f64)> = (0..part.len())
            .map(|i| (TAU * frequency * stretch.step * i as f64).sin_cos())
            .collect();
        let mut sums = [0.0; 5];
        for ((s, c), r) in waves.iter().zip(part.iter()) {
            for (sum, x) in sums.iter_mut().zip([s * s, s * c, c * c, s * r, c * r]) {
                *sum += x;
            }
        }
        let [ss, sc, cc, sr, cr] = sums;
        let determinant = ss * cc - sc * sc;
        if determinant > 1e-9 * ss * cc {
            let a = (sr * cc - cr * sc) / determinant;
            let b = (cr * ss - sr * sc) / determinant;
            for ((s, c), r) in waves.iter().zip(part.iter_mut()) {
                *r -= a * s + b * c;
            }
        }
        start += stretch.samples;
    }
}

/// The step in which a force is read, if all of its values are multiples of one that is coarser than its noise; in its unit.
pub fn step_of_values(values: &[f64], noise: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let largest = sorted.first()?.abs().max(sorted.last()?.abs());
    sorted.dedup_by(|a, b| (*a - *b).abs() <= 1e-9 * largest);
    if sorted.len() < 3 || 4 * sorted.len() > values.len() {
        return None;
    }
    let gaps = sorted.windows(2).map(|pair| pair[1] - pair[0]);
    let step = gaps.fold(f64::INFINITY, f64::min);
    let is_multiple = |gap: f64| (gap / step - (gap / step).round()).abs() < 1e-3;
    let all = sorted.windows(2).all(|pair| is_multiple(pair[1] - pair[0]));
    (all && step / 12.0_f64.sqrt() > 0.3 * noise).then_some(step)
}

impl Problem {
    /// Finds the samples next to a reversal of their drive, unless these are many: friction jumps there, and on which side of the
    /// jump a sample lies no derivative of positions tells.
    pub(crate) fn find_jumps(&mut self) {
        let of = |d: usize| {
            let jumps = reversals(self, d, JUMP);
            let count = jumps.iter().filter(|jumps| **jumps).count() as f64;
            if count < MOST_JUMPS * jumps.len() as f64 {
                jumps
            } else {
                Vec::new()
            }
        };
        self.jumps = (0..self.layout.channels.len()).map(of).collect();
    }

    /// Samples that decide nothing, by channel.
    pub(crate) fn undecided(&self) -> Vec<Vec<bool>> {
        let of = |d: usize| {
            let out = |all: &[Vec<bool>], i: usize| {
                all.get(d)
                    .and_then(|out| out.get(i))
                    .copied()
                    .unwrap_or(false)
            };
            let samples = 0..self.layout.samples();
            samples
                .map(|i| out(&self.left_out, i) || out(&self.jumps, i))
                .collect()
        };
        (0..self.layout.channels.len()).map(of).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::column::Column;
    use crate::diagnose::problem::{Layout, Stretch};
    use crate::test_noise::Noise;

    fn problem(seed: u64, more: impl Fn(usize, &mut Noise) -> f64) -> Problem {
        let mut noise = Noise::new(seed);
        let n = 2000;
        let base: Vec<f64> = (0..n).map(|i| (0.02 * f64::from(i)).sin()).collect();
        let measured: Vec<f64> = base
            .iter()
            .enumerate()
            .map(|(i, b)| 50.0 * b + noise.normal() + more(i, &mut noise))
            .collect();
        Problem {
            layout: Layout {
                channels: vec!["a".into()],
                stretches: vec![Stretch {
                    name: "run".into(),
                    samples: base.len(),
                    step: 0.004,
                    sampled: 0.004,
                    is_check: false,
                }],
                left_out: Vec::new(),
            },
            measured: Column(vec![Some(measured)]),
            base: vec![Column(vec![Some(base)])],
            noise: vec![1.0],
            removed: vec![0.0],
            ..Problem::default()
        }
    }

    #[test]
    fn noise_has_neither_outliers_nor_lines() {
        for seed in 0..40 {
            assert_eq!(clean(&mut problem(seed, |_, _| 0.0)), [], "seed {seed}");
        }
    }

    #[test]
    fn outliers_and_hum_are_taken_off() {
        for seed in 0..10 {
            let hum = |i: usize| 3.0 * (TAU * 50.02 * 0.004 * i as f64 + 0.4).sin();
            let wild = |i: usize| if i % 211 == 17 { 90.0 } else { 0.0 };
            let mut problem = problem(seed, |i, _| hum(i) + wild(i));
            let found = clean(&mut problem);
            let kinds: Vec<&str> = found.iter().map(|one| one.kind.as_str()).collect();
            assert_eq!(kinds, ["outliers", "periodic_in_time"], "seed {seed}");
            let values = &found[1].estimates;
            assert!((values[0].value - 3.0).abs() < 0.2, "{values:?}");
            assert!((values[1].value - 50.02).abs() < 0.02, "{values:?}");
            let rest = rest(&problem);
            let left = dot(&rest[0], &rest[0]) / rest[0].len() as f64;
            assert!((0.85..1.15).contains(&left), "{left}");
        }
    }

    #[test]
    fn steps_of_a_reading_are_seen() {
        let mut noise = Noise::new(5);
        let force: Vec<f64> = (0..3000)
            .map(|i| 300.0 * (0.01 * f64::from(i)).sin() + noise.normal())
            .collect();
        let coarse: Vec<f64> = force.iter().map(|f| 20.0 * (f / 20.0).round()).collect();
        assert_eq!(step_of_values(&coarse, 1.0), Some(20.0));
        assert_eq!(step_of_values(&force, 1.0), None);
        let fine: Vec<f64> = force.iter().map(|f| 0.1 * (f / 0.1).round()).collect();
        assert_eq!(step_of_values(&fine, 1.0), None);
    }
}
