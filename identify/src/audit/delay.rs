//! How much later than the motion forces were read: a regressor along a recording, its slope in time and the measured forces go
//! in; delays of all channels together and of each by itself come out, with intervals.
//!
//! A force that is read at `t` acted at `t - d`: `y(t + d) = W(t) p`. Around a shift `s` by whole steps that is
//! `y(t + s) = W p - (d - s) W' p`, which is linear in `p` and `d` (Gauss and Newton). So no measured force is ever
//! differentiated or put between samples, where noise would draw the answer to one side, and the parameters are those that the
//! delayed forces ask for. Fits are robust; intervals come from fits without one block of time each, as what a fit
//! leaves resembles its neighbours and is different elsewhere.
//!
//! Decision: friction columns that the model may lack are fitted too. The interval is a jackknife over blocks of
//! time, because a single fast move can look like a delay. The delay of a single drive must be three times as clear
//! as a common one, because laws that a model lacks often sit at one drive.

use nalgebra::{DMatrix, DVector};

use super::by_channel::ByChannel;
use super::robust::{RobustFit, robust_fit, solve_normal};

/// Blocks of time that are left out one by one.
const BLOCKS: usize = 20;
/// Student's factor for 99 % with one degree of freedom less than there are blocks.
const STUDENT: f64 = 2.861;
/// Shifts that are tried on either side before each is refined.
const COARSE: usize = 40;
/// Rounds of Gauss and Newton at most, and the part of a step within which shifts by whole steps are left as they are.
const ROUNDS: usize = 8;
const NEAR: f64 = 0.6;
/// Steps by which a round may move a delay.
const FARTHEST: f64 = 5.0;
/// A shift that is far off must leave less by this part.
const CLEARLY: f64 = 0.05;
/// No delay is known better than to this part of a step.
const FINEST: f64 = 0.05;

/// Rows of a model along a recording, and the forces that they are to explain.
#[derive(Debug, Clone)]
pub struct DelayAudit<'a> {
    /// The regressor, with columns of whatever the model may lack.
    pub regressor: ByChannel,
    /// Its slope in time, per s.
    pub slope: ByChannel,
    /// Times of its samples, s.
    pub time: Vec<f64>,
    /// Rows that count, `sample * channels + channel`.
    pub counts: Vec<bool>,
    /// Times of the whole recording, s.
    pub recorded: &'a [f64],
    /// Its forces, `[channel][sample]`.
    pub forces: &'a [Vec<f64>],
    /// Forces that were not measured, `[channel][sample]`; empty if all were.
    pub left_out: &'a [Vec<bool>],
    /// Longest delay that is looked for, s.
    pub longest: f64,
}

/// By how much forces come later than the motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Delay {
    /// The delay, s; negative where the forces come first.
    pub seconds: f64,
    /// Half of its interval of 99 %, s.
    pub half_width: f64,
}

/// Delays of the forces of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Delays {
    /// One that all forces have.
    pub together: Delay,
    /// One for each channel.
    pub alone: Vec<Delay>,
    /// What is left of each channel, relative to its force: with no delay, with one for all, and with one for each.
    pub left: [Vec<f64>; 3],
}

/// A fit with delays.
struct Fit {
    delays: Vec<Delay>,
    left: Vec<f64>,
    /// Mean over the channels of the logarithm of what is left.
    cost: f64,
}

impl Delays {
    /// Looks for delays; `None` where too little is measured or a number is not finite.
    pub fn of(audit: &DelayAudit<'_>) -> Option<Self> {
        let channels = audit.forces.len();
        let step = audit.step()?;
        let now = audit.refined(&vec![0.0; channels], 0)?;
        let all: Vec<usize> = (0..channels).collect();
        let mut starts = vec![vec![0.0; channels]];
        starts.push(vec![audit.coarse(&all, &now.left)?; channels]);
        if channels > 1 {
            let each = all.iter().map(|c| audit.coarse(&[*c], &now.left));
            starts.push(each.map(Option::unwrap_or_default).collect());
        }
        starts.dedup_by(|a, b| a.iter().zip(b).all(|(a, b)| (*a - *b).abs() < 0.5 * step));
        let best = |groups: usize| {
            let mut fits = (starts.iter()).filter_map(|start| audit.refined(start, groups));
            let near = fits.next()?;
            let far = fits.min_by(|a, b| a.cost.total_cmp(&b.cost));
            let is_better = |far: &Fit| far.cost < near.cost - CLEARLY;
            Some(match far {
                Some(far) if is_better(&far) => far,
                _ => near,
            })
        };
        let together = best(1)?;
        let alone = if channels > 1 {
            best(channels)?
        } else {
            best(1)?
        };
        Some(Self {
            together: together.delays[0],
            alone: alone.delays,
            left: [now.left, together.left, alone.left],
        })
    }
}

impl DelayAudit<'_> {
    /// Mean step of the recording, s.
    fn step(&self) -> Option<f64> {
        match self.recorded {
            [first, .., last] => Some((last - first) / (self.recorded.len() - 1) as f64),
            _ => None,
        }
    }

    /// The forces of some channels at times later by a shift of each, and rows that count; the forces of others are zero.
    fn shifted(&self, shifts: impl Iterator<Item = (usize, f64)>) -> (DVector<f64>, Vec<bool>) {
        let channels = self.forces.len();
        let mut forces = DVector::zeros(self.counts.len());
        let mut counts = self.counts.clone();
        let last = self.recorded.len() - 1;
        for (c, shift) in shifts {
            let mut above = 1;
            for (k, time) in self.time.iter().enumerate() {
                let row = k * channels + c;
                let at = time + shift;
                above += self.recorded[above..last]
                    .iter()
                    .take_while(|t| **t < at)
                    .count();
                let [t, next] = [self.recorded[above - 1], self.recorded[above]];
                let part = (at - t) / (next - t);
                let is_in = (-1e-6..=1.0 + 1e-6).contains(&part);
                // Whole steps must not touch their neighbours by rounding.
                let part = if (part - part.round()).abs() < 1e-6 {
                    part.round()
                } else {
                    part
                };
                let force = &self.forces[c];
                forces[row] = (1.0 - part) * force[above - 1] + part * force[above];
                let lost = |i: usize| self.left_out.get(c).is_some_and(|out| out[i]);
                let is_lost = (part < 1.0 && lost(above - 1)) || (part > 0.0 && lost(above));
                counts[row] &= is_in && !is_lost;
            }
        }
        (forces, counts)
    }

    /// The forces at times later by the shift of each channel, and rows that count.
    fn all_shifted(&self, shifts: &[f64]) -> (DVector<f64>, Vec<bool>) {
        self.shifted(shifts.iter().copied().enumerate())
    }

    /// The shift by whole steps that leaves least of some channels, each divided by what is left without a shift.
    fn coarse(&self, channels: &[usize], left: &[f64]) -> Option<f64> {
        let n = self.forces.len();
        let step = self.step()?;
        let weight = |c: usize| {
            let size = self.forces[c].iter().map(|f| f * f).sum::<f64>().sqrt();
            (left[c] * size).max(f64::MIN_POSITIVE.sqrt()).recip()
        };
        let weights: Vec<f64> = (0..n).map(weight).collect();
        let (mut weighted, rows) = self.regressor.dense(channels, &self.counts, &weights);
        for mut column in weighted.column_iter_mut() {
            let norm = column.norm();
            if norm > 0.0 {
                column /= norm;
            }
        }
        let transposed = weighted.transpose();
        let mut normal = &transposed * &weighted;
        for i in 0..normal.ncols() {
            normal[(i, i)] += 1e-9;
        }
        let normal = normal.cholesky()?;
        let error = |steps: f64| {
            let (forces, _) = self.shifted(channels.iter().map(|c| (*c, steps * step)));
            let of_row = rows.iter().map(|row| forces[*row] * weights[row % n]);
            let forces = DVector::from_iterator(rows.len(), of_row);
            let right = &transposed * &forces;
            let size = forces.norm_squared();
            (size > 0.0).then(|| 1.0 - right.dot(&normal.solve(&right)) / size)
        };
        let most = (self.longest / step).floor();
        let mut stride = (most / COARSE as f64).ceil().max(1.0);
        let mut best = (0.0, error(0.0)?);
        let mut span = COARSE;
        // Smaller strides around what the larger ones found.
        loop {
            let centre = best.0;
            for k in 1..=span {
                for steps in [centre - stride * k as f64, centre + stride * k as f64] {
                    if steps.abs() <= most {
                        let error = error(steps)?;
                        if error < best.1 {
                            best = (steps, error);
                        }
                    }
                }
            }
            if stride <= 1.0 {
                return Some(best.0 * step);
            }
            stride = (stride / 3.0).ceil();
            span = 3;
        }
    }

    /// A fit with so many delays, none, one or one for each channel, from some shifts on.
    fn refined(&self, start: &[f64], delays: usize) -> Option<Fit> {
        let channels = self.forces.len();
        let step = self.step()?;
        let mut shifts: Vec<f64> = start.iter().map(|s| (s / step).round() * step).collect();
        if delays == 1 {
            let mean = shifts.iter().sum::<f64>() / channels as f64;
            shifts = vec![(mean / step).round() * step; channels];
        }
        let (mut forces, mut counts) = self.all_shifted(&shifts);
        let mut fit = robust_fit(&self.regressor, &forces, &counts)?;
        let width = self.regressor.columns();
        if delays == 0 {
            return Some(self.judged(&fit, &forces, &counts, Vec::new()));
        }
        for round in 0..ROUNDS {
            let late = -self.slope.times(&fit.values.as_slice()[..width]);
            let columns = self.regressor.with(delays, |c| c % delays, &late);
            fit = robust_fit(&columns, &forces, &counts)?;
            let further: Vec<f64> = (0..channels)
                .map(|c| fit.values[width + c % delays])
                .collect();
            let is_near = further.iter().all(|f| f.abs() < NEAR * step);
            if (is_near && round > 0) || round + 1 == ROUNDS {
                let widths = Self::half_widths(&columns, &fit, &forces, delays)?;
                let of = |c: usize| Delay {
                    seconds: shifts[c] + further[c],
                    half_width: widths[c % delays].hypot(FINEST * step),
                };
                let found = (0..channels).map(of).collect();
                return Some(self.judged(&fit, &forces, &counts, found));
            }
            for (shift, further) in shifts.iter_mut().zip(&further) {
                let steps = (further / step).clamp(-FARTHEST, FARTHEST).round();
                *shift = (*shift + steps * step).clamp(-self.longest, self.longest);
            }
            (forces, counts) = self.all_shifted(&shifts);
        }
        None
    }

    fn judged(
        &self,
        fit: &RobustFit,
        forces: &DVector<f64>,
        counts: &[bool],
        delays: Vec<Delay>,
    ) -> Fit {
        let channels = self.forces.len();
        let sum = |values: &DVector<f64>, c: usize, power: i32| -> f64 {
            let rows = (c..values.len())
                .step_by(channels)
                .filter(|row| counts[*row]);
            rows.map(|row| values[row].abs().powi(power)).sum()
        };
        let part = |c: usize, power: i32| {
            let size = sum(forces, c, power);
            if size > 0.0 {
                sum(&fit.rest, c, power) / size
            } else {
                0.0
            }
        };
        // Magnitudes rather than squares decide, as a contact is in both fits.
        let costs = (0..channels).map(|c| part(c, 1).max(f64::EPSILON).ln());
        Fit {
            delays,
            left: (0..channels).map(|c| part(c, 2).sqrt()).collect(),
            cost: costs.sum::<f64>() / channels as f64,
        }
    }

    /// Half widths of the last columns of a fit, from the fits that leave out one block of time each (Quenouille's and Tukey's
    /// jackknife): a swift move that alone tells the delay makes it wide.
    fn half_widths(
        columns: &ByChannel,
        fit: &RobustFit,
        forces: &DVector<f64>,
        last: usize,
    ) -> Option<Vec<f64>> {
        let samples = columns.samples();
        let blocks: Vec<(DMatrix<f64>, DVector<f64>)> = (0..samples)
            .step_by(samples.div_ceil(BLOCKS))
            .map(|from| {
                let to = (from + samples.div_ceil(BLOCKS)).min(samples);
                columns.normal(&fit.weights, forces, from..to)
            })
            .collect();
        let n = columns.columns();
        let mut all = (DMatrix::zeros(n, n), DVector::zeros(n));
        for (normal, right) in &blocks {
            all.0 += normal;
            all.1 += right;
        }
        let without = blocks.iter().map(|(normal, right)| {
            let values = solve_normal(&all.0 - normal, &(&all.1 - right))?;
            Some(values.rows(n - last, last).into_owned())
        });
        let without: Vec<DVector<f64>> = without.collect::<Option<_>>()?;
        let count = without.len() as f64;
        let of = |k: usize| {
            let mean = without.iter().map(|values| values[k]).sum::<f64>() / count;
            let sum: f64 = without
                .iter()
                .map(|values| (values[k] - mean).powi(2))
                .sum();
            STUDENT * ((count - 1.0) / count * sum).sqrt()
        };
        Some((0..last).map(of).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_noise::Noise;

    const STEP: f64 = 0.004;
    const TRUTH: [f64; 3] = [2.0, -1.5, 0.7];

    /// Two joints with inertia and gravity, and how fast both change.
    fn row(t: f64) -> [[[f64; 3]; 2]; 2] {
        let (a, b, c) = (3.1 * t, 4.7 * t + 0.3, 1.9 * t);
        let [[a, a_d], [b, b_d], [c, c_d]] = [
            [a.sin(), 3.1 * a.cos()],
            [b.cos(), -4.7 * b.sin()],
            [c.sin(), 1.9 * c.cos()],
        ];
        [
            [[a, b, 0.2 * a], [0.5 * b, c, 0.1]],
            [[a_d, b_d, 0.2 * a_d], [0.5 * b_d, c_d, 0.0]],
        ]
    }

    /// Forces that are late by some steps each, with noise that has a memory.
    fn found(late: [f64; 2], noise: f64, seed: u64) -> Delays {
        let n = 3000;
        let recorded: Vec<f64> = (0..n).map(|k| STEP * k as f64).collect();
        let mut random = Noise::new(seed);
        let forces: Vec<Vec<f64>> = (0..2)
            .map(|c| {
                let mut coloured = 0.0;
                let force = recorded.iter().map(|t| {
                    coloured = 0.9 * coloured + noise * (1.0 - 0.81_f64).sqrt() * random.normal();
                    let [rows, _] = row(t - late[c] * STEP);
                    rows[c].iter().zip(TRUTH).map(|(w, p)| w * p).sum::<f64>() + coloured
                });
                force.collect()
            })
            .collect();
        let time: Vec<f64> = recorded[200..n - 200].iter().copied().step_by(2).collect();
        let matrix = |which: usize| {
            let rows = time
                .iter()
                .flat_map(|t| row(*t)[which].into_iter().flatten());
            ByChannel::new(&DMatrix::from_row_iterator(2 * time.len(), 3, rows), 2)
        };
        let audit = DelayAudit {
            regressor: matrix(0),
            slope: matrix(1),
            counts: vec![true; 2 * time.len()],
            time: time.clone(),
            recorded: &recorded,
            forces: &forces,
            left_out: &[],
            longest: 150.0 * STEP,
        };
        Delays::of(&audit).expect("delays")
    }

    #[test]
    fn delays_are_found_to_a_small_part_of_a_step() {
        for late in [0.0, 0.25, 0.5, 1.0, 7.4, -2.6, 30.0, 100.0] {
            let both = found([late; 2], 0.0, 1);
            let off = (both.together.seconds / STEP - late).abs();
            assert!(off < 0.02, "{late}: {both:?}");
            let first = found([late, 0.0], 0.0, 1);
            for (delay, late) in first.alone.iter().zip([late, 0.0]) {
                assert!(
                    (delay.seconds / STEP - late).abs() < 0.02,
                    "{late}: {first:?}"
                );
            }
        }
    }

    /// Of a hundred intervals of 99 % hardly any misses, and their widths are those of what is found.
    #[test]
    fn intervals_hold_what_they_promise() {
        let (mut missed, mut sum, mut widths) = (0, 0.0, 0.0);
        for seed in 0..100 {
            let delays = found([0.5, 0.5], 0.05, seed);
            let off = delays.together.seconds - 0.5 * STEP;
            missed += usize::from(off.abs() > delays.together.half_width);
            sum += off * off;
            widths += delays.together.half_width;
        }
        let deviation = (sum / 100.0_f64).sqrt();
        assert!(missed <= 5, "{missed}");
        let wide = widths / 100.0 / deviation;
        assert!((1.5..4.5).contains(&wide), "{wide} {deviation}");
    }
}
