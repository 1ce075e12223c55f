//! Delays of forces relative to the motion. Input: a regressor along a recording, its derivative with respect to time,
//! and the measured forces. Output: one delay for all channels and one for each, with 99 % intervals.
//!
//! A force that is recorded at `t` acted at `t - d`: `y(t + d) = W(t) p`. Around a shift `s` by full steps this is
//! `y(t + s) = W p - (d - s) W' p`, which is linear in `p` and `d` (Gauss-Newton). So measured forces are never
//! differentiated or interpolated, which would bias the result by noise, and the parameters fit the delayed forces.
//! Fits are robust. Intervals come from fits that leave out one block of time each, since residuals are correlated in
//! time and differ between blocks.
//!
//! Decision: friction columns that the model may lack are fitted too. The interval is a jackknife over blocks of
//! time, because a single fast move can look like a delay. The delay of a single drive must be three times as clear
//! as a common one, because laws that a model lacks often sit at one drive.

use nalgebra::{DMatrix, DVector};

use super::by_channel::ChannelRegressor;
use super::robust::{NORMAL_RIDGE, RobustFit, robust_fit};
use super::thresholds::{DELAY_RESOLUTION_STEPS, DELAY_STUDENT_FACTOR, FAR_SHIFT_MIN_IMPROVEMENT};
use crate::signal::{ScaledNormalEquations, dot};

/// Number of blocks of time, which are left out one by one.
const BLOCKS: usize = 20;
/// Number of shifts that are tried on either side before the best is refined.
const COARSE: usize = 40;
/// Largest number of Gauss-Newton rounds; a remaining delay below this share of a step does not change the shift.
const ROUNDS: usize = 8;
const WHOLE_STEP_TOLERANCE: f64 = 0.6;
/// Largest change of a delay in one round, in steps.
const MAX_ROUND_STEPS: f64 = 5.0;

/// Input of the estimate: the model along a recording and its measured forces.
#[derive(Debug, Clone)]
pub struct DelayAudit<'a> {
    /// The regressor, with columns of effects that the model may lack.
    pub regressor: ChannelRegressor,
    /// Its derivative with respect to time, 1/s.
    pub slope: ChannelRegressor,
    /// Times of its samples, s.
    pub time: Vec<f64>,
    /// Whether each row is used, `sample * channels + channel`.
    pub used_rows: Vec<bool>,
    /// Times of the complete recording, s.
    pub recording_time: &'a [f64],
    /// Its measured forces, `[channel][sample]`, N or N m.
    pub forces: &'a [Vec<f64>],
    /// Forces that were not measured, `[channel][sample]`; empty if all were.
    pub excluded_forces: &'a [Vec<bool>],
    /// Longest delay that is searched, s.
    pub max_delay: f64,
}

/// Delay of forces relative to the motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DelayEstimate {
    /// The delay, s; negative if the forces lead.
    pub seconds: f64,
    /// Half width of its 99 % interval, s.
    pub half_width: f64,
}

/// Delays of the forces of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct ForceDelays {
    /// One delay for all channels.
    pub common: DelayEstimate,
    /// A delay for each channel, `[channel]`.
    pub by_channel: Vec<DelayEstimate>,
    /// Residual of each channel relative to its force, `[channel]`: without delay, with one for all, and with one for
    /// each.
    pub residuals: [Vec<f64>; 3],
}

/// A fit with delays.
struct DelayFit {
    /// Delay of each channel; empty for a fit without delay.
    delays: Vec<DelayEstimate>,
    /// Residual of each channel relative to its force, `[channel]`.
    residuals: Vec<f64>,
    /// Mean over the channels of the logarithm of the relative residual.
    cost: f64,
}

impl ForceDelays {
    /// Estimates delays; `None` if there are too few samples or a number is not finite.
    pub fn from_audit(audit: &DelayAudit<'_>) -> Option<Self> {
        let channels = audit.forces.len();
        let step = audit.step()?;
        let now = audit.refine_delays(&vec![0.0; channels], 0)?;
        let all: Vec<usize> = (0..channels).collect();
        // Starting points: no delay, the best common shift, and the best shift of each channel.
        let mut starts = vec![vec![0.0; channels]];
        starts.push(vec![audit.coarse_shift(&all, &now.residuals)?; channels]);
        if channels > 1 {
            // One shift for each channel by itself.
            let each = all.iter().map(|c| audit.coarse_shift(&[*c], &now.residuals));
            starts.push(each.map(Option::unwrap_or_default).collect());
        }
        // Equal starting points need one fit only.
        starts.dedup_by(|a, b| a.iter().zip(b).all(|(a, b)| (*a - *b).abs() < 0.5 * step));
        // A distant starting point must be clearly better than the one at zero.
        let best = |groups: usize| {
            let mut fits = (starts.iter()).filter_map(|start| audit.refine_delays(start, groups));
            let near = fits.next()?;
            let far = fits.min_by(|a, b| a.cost.total_cmp(&b.cost));
            let is_better = |far: &DelayFit| far.cost < near.cost - FAR_SHIFT_MIN_IMPROVEMENT;
            Some(match far {
                Some(far) if is_better(&far) => far,
                _ => near,
            })
        };
        let together = best(1)?;
        let alone = if channels > 1 { best(channels)? } else { best(1)? };
        Some(Self {
            common: together.delays[0],
            by_channel: alone.delays,
            residuals: [now.residuals, together.residuals, alone.residuals],
        })
    }
}

impl DelayAudit<'_> {
    /// Mean step of the recording, s.
    fn step(&self) -> Option<f64> {
        match self.recording_time {
            [first, .., last] => Some((last - first) / (self.recording_time.len() - 1) as f64),
            _ => None,
        }
    }

    /// Forces of some channels at times that are later by a shift (s) of each, and whether each row counts; forces of
    /// other channels are zero.
    fn shift_forces(&self, shifts: impl Iterator<Item = (usize, f64)>) -> (DVector<f64>, Vec<bool>) {
        let channels = self.forces.len();
        let mut forces = DVector::zeros(self.used_rows.len());
        let mut counts = self.used_rows.clone();
        // Interpolate the recorded forces linearly at the shifted times.
        let last = self.recording_time.len() - 1;
        for (c, shift) in shifts {
            let mut above = 1;
            for (k, time) in self.time.iter().enumerate() {
                let row = k * channels + c;
                let at = time + shift;
                // First recorded sample that is not before the shifted time; times ascend.
                above += self.recording_time[above..last].iter().take_while(|t| **t < at).count();
                let [t, next] = [self.recording_time[above - 1], self.recording_time[above]];
                let part = (at - t) / (next - t);
                let is_in = (-1e-6..=1.0 + 1e-6).contains(&part);
                // A shift by full steps must not use the neighbouring sample because of rounding.
                let part = if (part - part.round()).abs() < 1e-6 {
                    part.round()
                } else {
                    part
                };
                let force = &self.forces[c];
                forces[row] = (1.0 - part) * force[above - 1] + part * force[above];
                // Interpolation needs two measured samples, unless one has no weight.
                let lost = |i: usize| self.excluded_forces.get(c).is_some_and(|out| out[i]);
                let is_lost = (part < 1.0 && lost(above - 1)) || (part > 0.0 && lost(above));
                counts[row] &= is_in && !is_lost;
            }
        }
        (forces, counts)
    }

    /// The same for all channels, with the shift (s) of each.
    fn shift_all_forces(&self, shifts: &[f64]) -> (DVector<f64>, Vec<bool>) {
        self.shift_forces(shifts.iter().copied().enumerate())
    }

    /// The shift by full steps, in s, with the smallest residual of some channels. Channels are weighted by their
    /// residual without shift, `left`.
    fn coarse_shift(&self, channels: &[usize], left: &[f64]) -> Option<f64> {
        let n = self.forces.len();
        let step = self.step()?;
        // Each channel counts relative to its residual.
        let weight = |c: usize| {
            let size = self.forces[c].iter().map(|f| f * f).sum::<f64>().sqrt();
            (left[c] * size).max(f64::MIN_POSITIVE.sqrt()).recip()
        };
        let weights: Vec<f64> = (0..n).map(weight).collect();
        let (mut weighted, rows) = self.regressor.dense_rows(channels, &self.used_rows, &weights);
        for mut column in weighted.column_iter_mut() {
            let norm = column.norm();
            if norm > 0.0 {
                column /= norm;
            }
        }
        // The regressor does not change with the shift, so one factorisation serves all shifts.
        let mut normal = weighted.transpose() * &weighted;
        // A small ridge keeps dependent columns solvable.
        for i in 0..normal.ncols() {
            normal[(i, i)] += 1e-9;
        }
        let normal = normal.cholesky()?;
        let error = |steps: f64| {
            let (forces, _) = self.shift_forces(channels.iter().map(|c| (*c, steps * step)));
            let of_row = rows.iter().map(|row| forces[*row] * weights[row % n]);
            let forces = DVector::from_iterator(rows.len(), of_row);
            let products = weighted
                .column_iter()
                .map(|column| dot(column.as_slice(), forces.as_slice()));
            let right = DVector::from_iterator(weighted.ncols(), products);
            let size = forces.norm_squared();
            (size > 0.0).then(|| 1.0 - right.dot(&normal.solve(&right)) / size)
        };
        // Start with about COARSE strides on either side.
        let most = (self.max_delay / step).floor();
        let mut stride = (most / COARSE as f64).ceil().max(1.0);
        let mut best = (0.0, error(0.0)?);
        let mut span = COARSE;
        // Search with smaller strides around the best shift so far.
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

    /// Fits the model with 0, 1 or one delay per channel, starting from shifts (s) of the channels.
    fn refine_delays(&self, start: &[f64], delays: usize) -> Option<DelayFit> {
        let channels = self.forces.len();
        let step = self.step()?;
        let mut shifts: Vec<f64> = start.iter().map(|s| (s / step).round() * step).collect();
        // One delay for all starts from the mean of the shifts.
        if delays == 1 {
            let mean = shifts.iter().sum::<f64>() / channels as f64;
            shifts = vec![(mean / step).round() * step; channels];
        }
        let (mut forces, mut counts) = self.shift_all_forces(&shifts);
        let mut fit = robust_fit(&self.regressor, &forces, &counts)?;
        let width = self.regressor.columns();
        if delays == 0 {
            return Some(self.evaluate_fit(&fit, &forces, &counts, Vec::new()));
        }
        for round in 0..ROUNDS {
            // Derivative of the fitted forces with respect to the delay: an additional column per delay.
            let late = -self.slope.multiply(&fit.values.as_slice()[..width]);
            let columns = self.regressor.append_columns(delays, |c| c % delays, &late);
            fit = robust_fit(&columns, &forces, &counts)?;
            let further: Vec<f64> = (0..channels).map(|c| fit.values[width + c % delays]).collect();
            // Finish if the remaining delay is within the range of the linearisation.
            let is_near = further.iter().all(|f| f.abs() < WHOLE_STEP_TOLERANCE * step);
            if (is_near && round > 0) || round + 1 == ROUNDS {
                let widths = Self::half_widths(&columns, &fit, &forces, delays)?;
                let of = |c: usize| DelayEstimate {
                    seconds: shifts[c] + further[c],
                    half_width: widths[c % delays].hypot(DELAY_RESOLUTION_STEPS * step),
                };
                let found = (0..channels).map(of).collect();
                return Some(self.evaluate_fit(&fit, &forces, &counts, found));
            }
            // Otherwise move the shifts by full steps and fit again.
            for (shift, further) in shifts.iter_mut().zip(&further) {
                let steps = (further / step).clamp(-MAX_ROUND_STEPS, MAX_ROUND_STEPS).round();
                *shift = (*shift + steps * step).clamp(-self.max_delay, self.max_delay);
            }
            (forces, counts) = self.shift_all_forces(&shifts);
        }
        None
    }

    /// Residuals and cost of a fit.
    fn evaluate_fit(
        &self,
        fit: &RobustFit,
        forces: &DVector<f64>,
        counts: &[bool],
        delays: Vec<DelayEstimate>,
    ) -> DelayFit {
        let channels = self.forces.len();
        let sum = |values: &DVector<f64>, c: usize, power: i32| -> f64 {
            let rows = (c..values.len()).step_by(channels).filter(|row| counts[*row]);
            rows.map(|row| values[row].abs().powi(power)).sum()
        };
        let part = |c: usize, power: i32| {
            let size = sum(forces, c, power);
            if size > 0.0 {
                sum(&fit.residual, c, power) / size
            } else {
                0.0
            }
        };
        // Magnitudes instead of squares limit the influence of contacts, which are in both fits.
        let costs = (0..channels).map(|c| part(c, 1).max(f64::EPSILON).ln());
        DelayFit {
            delays,
            residuals: (0..channels).map(|c| part(c, 2).sqrt()).collect(),
            cost: costs.sum::<f64>() / channels as f64,
        }
    }

    /// Half widths of the 99 % intervals of the last columns of a fit, s, from fits that leave out one block of time
    /// each (Quenouille's and Tukey's jackknife). If a single fast move determines the delay, the interval becomes
    /// wide.
    fn half_widths(
        columns: &ChannelRegressor,
        fit: &RobustFit,
        forces: &DVector<f64>,
        last: usize,
    ) -> Option<Vec<f64>> {
        let samples = columns.samples();
        // Normal equations of each block; their sum minus one block leaves this block out.
        let blocks: Vec<(DMatrix<f64>, DVector<f64>)> = (0..samples)
            .step_by(samples.div_ceil(BLOCKS))
            .map(|from| {
                let to = (from + samples.div_ceil(BLOCKS)).min(samples);
                columns.normal_equations(&fit.weights, forces, from..to)
            })
            .collect();
        let n = columns.columns();
        let mut all = (DMatrix::zeros(n, n), DVector::zeros(n));
        for (normal, right) in &blocks {
            all.0 += normal;
            all.1 += right;
        }
        let without = blocks.iter().map(|(normal, right)| {
            let values = ScaledNormalEquations::new(&all.0 - normal, NORMAL_RIDGE)?.solve(&(&all.1 - right));
            Some(values.rows(n - last, last).into_owned())
        });
        let without: Vec<DVector<f64>> = without.collect::<Option<_>>()?;
        let count = without.len() as f64;
        let of = |k: usize| {
            let mean = without.iter().map(|values| values[k]).sum::<f64>() / count;
            let sum: f64 = without.iter().map(|values| (values[k] - mean).powi(2)).sum();
            DELAY_STUDENT_FACTOR * ((count - 1.0) / count * sum).sqrt()
        };
        Some((0..last).map(of).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_noise::TestNoise;

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
    fn found(late: [f64; 2], noise: f64, seed: u64) -> ForceDelays {
        let n = 3000;
        let recorded: Vec<f64> = (0..n).map(|k| STEP * k as f64).collect();
        let mut random = TestNoise::new(seed);
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
            let rows = time.iter().flat_map(|t| row(*t)[which].into_iter().flatten());
            ChannelRegressor::new(&DMatrix::from_row_iterator(2 * time.len(), 3, rows), 2)
        };
        let audit = DelayAudit {
            regressor: matrix(0),
            slope: matrix(1),
            used_rows: vec![true; 2 * time.len()],
            time: time.clone(),
            recording_time: &recorded,
            forces: &forces,
            excluded_forces: &[],
            max_delay: 150.0 * STEP,
        };
        ForceDelays::from_audit(&audit).expect("delays")
    }

    #[test]
    fn delays_are_found_to_a_small_part_of_a_step() {
        for late in [0.0, 0.25, 0.5, 1.0, 7.4, -2.6, 30.0, 100.0] {
            let both = found([late; 2], 0.0, 1);
            let off = (both.common.seconds / STEP - late).abs();
            assert!(off < 0.02, "{late}: {both:?}");
            let first = found([late, 0.0], 0.0, 1);
            for (delay, late) in first.by_channel.iter().zip([late, 0.0]) {
                assert!((delay.seconds / STEP - late).abs() < 0.02, "{late}: {first:?}");
            }
        }
    }

    /// Of a hundred intervals of 99 % hardly any misses, and their widths are those of what is found.
    #[test]
    fn intervals_hold_what_they_promise() {
        let (mut missed, mut sum, mut widths) = (0, 0.0, 0.0);
        for seed in 0..100 {
            let delays = found([0.5, 0.5], 0.05, seed);
            let off = delays.common.seconds - 0.5 * STEP;
            missed += usize::from(off.abs() > delays.common.half_width);
            sum += off * off;
            widths += delays.common.half_width;
        }
        let deviation = (sum / 100.0_f64).sqrt();
        assert!(missed <= 5, "{missed}");
        let wide = widths / 100.0 / deviation;
        assert!((1.5..4.5).contains(&wide), "{wide} {deviation}");
    }
}
