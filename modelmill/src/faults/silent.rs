//! Forces that were not measured for some time: a channel that reads zero, one that is stuck at a value, and joints that
//! brakes hold while the drives are off. A segment goes in, the intervals come out.
//!
//! A candidate is an interval in which a force has no signal but white noise. It counts only if a fit to the rest of
//! the recording predicts another force there.

use std::ops::Range;

use modelmill_boundary::message;
use modelmill_identify::diagnose::{Disturbance, white_noise};
use modelmill_identify::robust_fit;
use modelmill_identify::{RecordingNote, float_to_count};
use modelmill_spec::DriveKind;
use nalgebra::DVector;

use super::RecordingFaultKind;
use super::thresholds::{
    BRAKED_FORCE_SHARE, BRAKED_NOISE_FACTOR, FROZEN_MOST_REPEATS, SILENCE_FEWEST_SAMPLES, SILENCE_LEAST_FORCE_SHARE,
    SILENCE_MOST_INTERVALS, SILENCE_MOTION_SHARE, SILENCE_NOISE_SIGMAS, SILENCE_RESIDUAL_FACTOR, SILENCE_SHORTEST_S,
    SILENCE_STANDSTILL_SHARE, SILENCE_VARIATION_FACTOR,
};
use crate::audit::rows::AuditRows;
use crate::model::Model;
use crate::segment::RecordingSegment;
use crate::text::table::significant;

/// Duration of a block whose mean is compared with the level, s.
const BLOCK_S: f64 = 0.05;
/// Fewest samples of a block.
const BLOCK_FEWEST: usize = 8;
/// Samples of a segment at which the model is fitted.
const LOOKED_AT: usize = 3000;
/// Times of two intervals that differ by less are equal, s.
const SAME_TIME_S: f64 = 0.1;

/// An interval in which forces were not measured.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SilentInterval {
    /// Dead channel, frozen force, or brakes.
    pub(crate) kind: RecordingFaultKind,
    /// Names of the drives.
    pub(crate) drives: Vec<String>,
    /// Start and end, s.
    pub(crate) interval: [f64; 2],
    /// Start and end with samples that were dropped at the ends of the recording, s.
    pub(crate) reach: [f64; 2],
    /// The recording.
    pub(crate) file: String,
    /// The value at which the first drive is, with its unit.
    level: String,
    /// The force that the model predicts for it, rms, with its unit and drive.
    predicted: String,
}

impl SilentInterval {
    /// What was found, as a clause.
    fn clause(&self) -> String {
        let names = super::name_list(&self.drives);
        let (force, reads, is) = if self.drives.len() == 1 {
            ("force", "reads", "is")
        } else {
            ("forces", "read", "are")
        };
        let [from, to] = self.interval.map(|t| significant(t, 4));
        let when = format!("from {from} to {to} s of {}", self.file);
        match self.kind {
            RecordingFaultKind::Brakes => format!(
                "{when} the joints stand and the {force} of {names} {reads} 0, as with brakes on: gravity would require {}",
                self.predicted
            ),
            RecordingFaultKind::DeadChannel => format!(
                "the {force} of {names} {reads} 0 {when}, where the model predicts {}: the channel is dead",
                self.predicted
            ),
            _ => format!(
                "the {force} of {names} {is} stuck at {} {when} while the joints move",
                self.level
            ),
        }
    }

    /// The interval as a disturbance.
    pub(crate) fn disturbance(&self) -> Disturbance {
        Disturbance {
            kind: self.kind.name().to_owned(),
            at: self.drives.clone(),
            estimates: Vec::new(),
            recordings: vec![self.file.clone()],
            interval: Some(self.interval),
            description: Some(format!("{}. These forces are left out", self.clause().replace('`', ""))),
        }
    }

    /// The note for the user: what was found, what it means, what to do.
    pub(crate) fn note(&self) -> RecordingNote {
        let advice = match self.kind {
            RecordingFaultKind::Brakes => "Nothing is to be done, unless the brakes were off",
            _ => "Check the sensor and its cable before the next recording",
        };
        RecordingNote::warning(message!(
            "Forces were not measured for some time: {}. These forces are left out of all fits and error figures. {advice}.",
            self.clause()
        ))
    }
}

/// The force that the model predicts for a drive, rms.
fn predicted_text(force: f64, unit: &str, drive: &str) -> String {
    format!("{} {unit} rms on `{drive}`", significant(force, 3))
}

/// A candidate: a drive with the samples in which its force is constant except for noise.
struct FlatInterval {
    /// Index of the drive.
    drive: usize,
    /// First sample, and the first behind the last one.
    range: std::ops::Range<usize>,
    /// The mean force.
    level: f64,
    /// Standard deviation of white noise of the force.
    noise: f64,
    /// Whether one number repeats for most of it, while numbers outside of such intervals hardly ever repeat.
    is_frozen: bool,
}

/// Intervals of a segment in which forces were not measured; none if forces are missing or a pose has no solution.
pub(crate) fn silent_intervals(model: &Model, data: &RecordingSegment) -> Vec<SilentInterval> {
    find_intervals(model, data).unwrap_or_default()
}

/// The intervals; `None` if there is nothing to compare with.
fn find_intervals(model: &Model, data: &RecordingSegment) -> Option<Vec<SilentInterval>> {
    let run = &data.run;
    let forces = run.force.as_deref()?;
    let n = run.time.len();
    let duration = run.time.last()? - run.time.first()?;
    let drives = &model.derivation.mechanism.drives;
    let driven = (0..forces.len()).filter(|d| drives[*d].is_driven);
    let flat: Vec<FlatInterval> = driven
        .flat_map(|d| {
            let of_drive = flat_intervals(d, &forces[d], &run.time);
            // A force that is often constant has a dead band, a limit, or coarse steps.
            if of_drive.len() > SILENCE_MOST_INTERVALS {
                Vec::new()
            } else {
                of_drive
            }
        })
        .collect();
    if flat.is_empty() || duration <= 0.0 {
        return None;
    }
    let every = (n / LOOKED_AT).max(1);
    let samples: Vec<usize> = (0..n).step_by(every).collect();
    let rest = SilenceFit::new(model, data, &samples, &flat)?;
    let mut found: Vec<SilentInterval> = Vec::new();
    for one in &flat {
        let Some((kind, predicted)) = rest.judge(model, data, one) else {
            continue;
        };
        let interval = [run.time[one.range.start], run.time[one.range.end - 1]];
        // Samples that were dropped at the ends of the recording belong to an interval that reaches them.
        let step = duration / (n.max(2) - 1) as f64;
        let (start, end) = run.prepared.trimmed;
        let reach = [
            interval[0]
                - if one.range.start == 0 {
                    (start + 1) as f64 * step
                } else {
                    0.0
                },
            interval[1]
                + if one.range.end == n {
                    (end + 1) as f64 * step
                } else {
                    0.0
                },
        ];
        let name = drives[one.drive].name.clone();
        // The same interval of several drives is one fault.
        let is_same = |other: &&mut SilentInterval| {
            other.kind == kind && (0..2).all(|k| (other.interval[k] - interval[k]).abs() < SAME_TIME_S)
        };
        let unit = model.force_unit(one.drive);
        match found.iter_mut().find(is_same) {
            Some(other) => other.drives.push(name),
            None => found.push(SilentInterval {
                kind,
                drives: vec![name],
                interval,
                reach,
                file: run.file.clone(),
                level: format!("{} {unit}", significant(one.level, 3)),
                predicted: predicted_text(predicted, unit, &drives[one.drive].name),
            }),
        }
    }
    // With brakes on, drives without weight read zero as well.
    for brakes in found.iter_mut().filter(|one| one.kind == RecordingFaultKind::Brakes) {
        let [from, to] = brakes.interval;
        for one in flat.iter().filter(|one| one.is_zero(forces)) {
            let [start, end] = [run.time[one.range.start], run.time[one.range.end - 1]];
            let name = &drives[one.drive].name;
            if start < from + SAME_TIME_S && end > to - SAME_TIME_S && !brakes.drives.contains(name) {
                brakes.drives.push(name.clone());
            }
        }
    }
    Some(found)
}

/// Intervals in which a force is constant except for white noise.
fn flat_intervals(drive: usize, force: &[f64], time: &[f64]) -> Vec<FlatInterval> {
    let n = force.len();
    let [Some(first), Some(last)] = [time.first(), time.last()] else {
        return Vec::new();
    };
    let step = (last - first) / (n.max(2) - 1) as f64;
    let block = count(BLOCK_S / step).max(BLOCK_FEWEST);
    let shortest = count(SILENCE_SHORTEST_S / step).max(SILENCE_FEWEST_SAMPLES);
    let largest = force.iter().fold(0.0_f64, |most, f| most.max(f.abs()));
    let noise = white_noise(force).max(1e-9 * largest);
    // The mean of a block has less noise than a sample.
    let tolerance = SILENCE_NOISE_SIGMAS * noise / (block as f64).sqrt();
    let near = |sample: usize, level: f64| (force[sample] - level).abs() <= SILENCE_NOISE_SIGMAS * noise;
    let mean = |range: std::ops::Range<usize>| force[range.clone()].iter().sum::<f64>() / range.len() as f64;
    let mut found = Vec::new();
    let mut start = 0;
    while start + block <= n {
        let level = mean(start..start + block);
        let mut end = start;
        // Blocks follow as long as their mean is that of the first, and all samples are noise about it.
        while end + block <= n
            && (mean(end..end + block) - level).abs() <= tolerance
            && (end..end + block).all(|k| near(k, level))
        {
            end += block;
        }
        if end - start < shortest {
            start += block;
            continue;
        }
        // The ends lie within the neighbouring blocks.
        let level = mean(start..end);
        let mut from = start;
        while from > 0 && start - from < block && near(from - 1, level) {
            from -= 1;
        }
        while end < n && near(end, level) {
            end += 1;
        }
        found.push(FlatInterval {
            drive,
            range: from..end,
            level,
            noise,
            is_frozen: false,
        });
        start = end;
    }
    mark_frozen(&mut found, force, shortest);
    found
}

/// Marks intervals in which one number repeats for at least `shortest` samples, while numbers outside of all intervals
/// hardly ever repeat.
fn mark_frozen(intervals: &mut [FlatInterval], force: &[f64], shortest: usize) {
    let repeats = |k: usize| force[k].total_cmp(&force[k - 1]).is_eq();
    let is_outside = |k: &usize| !intervals.iter().any(|one| one.range.contains(k));
    let outside: Vec<usize> = (1..force.len()).filter(is_outside).collect();
    let repeated = outside.iter().filter(|k| repeats(**k)).count();
    if repeated as f64 >= FROZEN_MOST_REPEATS * outside.len() as f64 {
        return;
    }
    for one in intervals {
        let mut run = 1;
        let mut longest = 1;
        for k in one.range.start.max(1)..one.range.end {
            run = if repeats(k) { run + 1 } else { 1 };
            longest = longest.max(run);
        }
        one.is_frozen = longest >= shortest;
    }
}

/// A count that was computed, rounded down; at most a million.
fn count(value: f64) -> usize {
    float_to_count(value.clamp(0.0, 1e6))
}

impl FlatInterval {
    /// Whether the level is zero, except for noise and a small offset.
    fn is_zero(&self, forces: &[Vec<f64>]) -> bool {
        let force = &forces[self.drive];
        let rms = (force.iter().map(|f| f * f).sum::<f64>() / force.len().max(1) as f64).sqrt();
        self.level.abs() <= self.noise.max(0.01 * rms)
    }
}

/// A fit of the model to the samples without candidates.
struct SilenceFit<'a> {
    /// The samples.
    samples: &'a [usize],
    /// Fitted forces, interleaved by drive.
    fitted: DVector<f64>,
    /// Magnitude of the dry friction of each drive.
    dry: Vec<f64>,
    /// Residual of each drive outside of the candidates, rms.
    residual: Vec<f64>,
    /// Force of each drive outside of the candidates, rms and largest magnitude.
    size: Vec<[f64; 2]>,
}

impl<'a> SilenceFit<'a> {
    /// Fits the model; `None` if a pose has no solution or the fit fails.
    fn new(model: &Model, data: &RecordingSegment, samples: &'a [usize], flat: &[FlatInterval]) -> Option<Self> {
        let forces = data.run.force.as_deref()?;
        let n = forces.len();
        let rows = AuditRows::new(model, data, samples)?;
        let of_samples = samples.iter().flat_map(|k| forces.iter().map(move |force| force[*k]));
        let measured = DVector::from_iterator(samples.len() * n, of_samples);
        let is_candidate = |d: usize, k: usize| flat.iter().any(|one| one.drive == d && one.range.contains(&k));
        let counts: Vec<bool> = (samples.iter())
            .flat_map(|k| (0..n).map(move |d| (d, *k)))
            .map(|(d, k)| data.run.is_force_measured(d, k) && !is_candidate(d, k))
            .collect();
        let fit = robust_fit(&rows.regressor, &measured, &counts)?;
        let fitted = rows.regressor.multiply(fit.values.as_slice());
        let more = (rows.regressor.columns() - model.base.len()) / n;
        // Model and further columns share the sign of the rate equally if both have it.
        let dry = (0..n)
            .map(|d| 2.0 * fit.values[model.base.len() + more * d + 1].abs())
            .collect();
        let mut residual = vec![0.0; n];
        let mut size = vec![[0.0_f64; 2]; n];
        let mut used = vec![0_usize; n];
        for (row, _) in counts.iter().enumerate().filter(|(_, is_used)| **is_used) {
            let d = row % n;
            used[d] += 1;
            residual[d] += (measured[row] - fitted[row]).powi(2);
            size[d][0] += measured[row].powi(2);
            size[d][1] = size[d][1].max(measured[row].abs());
        }
        for d in 0..n {
            residual[d] = (residual[d] / used[d].max(1) as f64).sqrt();
            size[d][0] = (size[d][0] / used[d].max(1) as f64).sqrt();
        }
        Some(Self {
            samples,
            fitted,
            dry,
            residual,
            size,
        })
    }

    /// The kind of fault of a candidate with the predicted force, rms; `None` if the prediction does not contradict it.
    fn judge(&self, model: &Model, data: &RecordingSegment, one: &FlatInterval) -> Option<(RecordingFaultKind, f64)> {
        let forces = data.run.force.as_deref()?;
        let (n, d) = (forces.len(), one.drive);
        let inside = self.samples.iter().enumerate().filter(|(_, k)| one.range.contains(k));
        let predicted: Vec<f64> = inside.map(|(i, _)| self.fitted[i * n + d]).collect();
        let mean =
            |of: &dyn Fn(f64) -> f64| predicted.iter().map(|x| of(*x)).sum::<f64>() / predicted.len().max(1) as f64;
        let off = mean(&|x| (x - one.level).powi(2)).sqrt();
        let size = mean(&|x| x * x).sqrt();
        let [rms, largest] = self.size[d];
        let is_off =
            off > SILENCE_RESIDUAL_FACTOR * self.residual[d].max(one.noise) && off > SILENCE_LEAST_FORCE_SHARE * rms;
        // A prediction beyond all forces is an extrapolation.
        if !is_off || size > 1.5 * largest {
            return None;
        }
        let moved = moved_share(model, data, one);
        let is_zero = one.is_zero(forces);
        let stands = moved <= SILENCE_STANDSTILL_SHARE;
        if !stands && moved < SILENCE_MOTION_SHARE && !one.is_frozen {
            return None;
        }
        // A stuck channel misses changes, not only a level, which friction may cause.
        let middle = mean(&|x| x);
        let variation = mean(&|x| (x - middle).powi(2)).sqrt();
        if !is_zero && !one.is_frozen && variation < SILENCE_VARIATION_FACTOR * self.residual[d].max(one.noise) {
            return None;
        }
        match (stands, is_zero) {
            // Dry friction may hold a joint without any force.
            (true, true) if mean(&f64::abs) <= self.dry[d] => None,
            (true, true) if is_braked(model, data, &one.range) => Some((RecordingFaultKind::Brakes, size)),
            // At standstill friction may take any part of the force, and another joint may hold this one.
            (true, _) => None,
            (false, true) => Some((RecordingFaultKind::DeadChannel, size)),
            (false, false) => Some((RecordingFaultKind::FrozenForce, size)),
        }
    }
}

/// Whether brakes hold the machine during an interval: all joints stand, and no drive works.
fn is_braked(model: &Model, data: &RecordingSegment, range: &Range<usize>) -> bool {
    let forces = data.run.force.as_deref().unwrap_or_default();
    let drives = model.derivation.mechanism.drives.iter();
    let works = |force: &[f64]| {
        let rms = |force: &[f64]| (force.iter().map(|f| f * f).sum::<f64>() / force.len().max(1) as f64).sqrt();
        let noise = white_noise(force);
        rms(&force[range.clone()]) > (BRAKED_NOISE_FACTOR * noise).max(BRAKED_FORCE_SHARE * rms(force))
    };
    let is_driven = drives.map(|drive| drive.is_driven);
    data.run
        .q
        .iter()
        .all(|q| travel_share(q, range) <= SILENCE_STANDSTILL_SHARE)
        && !forces
            .iter()
            .zip(is_driven)
            .any(|(force, is_driven)| is_driven && works(force))
}

/// The share of its travel by which the joint of a drive moves during an interval; for a drive between points the
/// largest share of all joints.
fn moved_share(model: &Model, data: &RecordingSegment, one: &FlatInterval) -> f64 {
    let mechanism = &model.derivation.mechanism;
    let names = model.active_coordinates();
    let own = match mechanism.drives[one.drive].kind {
        DriveKind::Joint(i) => names.iter().position(|name| *name == mechanism.coordinates[i.0].name),
        DriveKind::Linear { .. } => None,
    };
    match own {
        Some(i) => travel_share(&data.run.q[i], &one.range),
        None => (data.run.q.iter()).fold(0.0, |most, q| most.max(travel_share(q, &one.range))),
    }
}

/// The share of its travel by which a coordinate moves during an interval, 0 to 1.
fn travel_share(q: &[f64], range: &Range<usize>) -> f64 {
    let travel = |q: &[f64]| {
        let low = q.iter().copied().fold(f64::INFINITY, f64::min);
        q.iter().copied().fold(f64::NEG_INFINITY, f64::max) - low
    };
    travel(&q[range.clone()]) / travel(q).max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clauses_state_the_force_with_its_unit_and_reference() {
        let clause = |kind: RecordingFaultKind| {
            let interval = SilentInterval {
                kind,
                drives: vec!["a".to_owned()],
                interval: [1.0, 2.0],
                reach: [1.0, 2.0],
                file: "run.csv".to_owned(),
                level: "0 N m".to_owned(),
                predicted: predicted_text(12.0, "N m", "a"),
            };
            interval.clause()
        };
        let dead = clause(RecordingFaultKind::DeadChannel);
        assert!(
            dead.ends_with("the model predicts 12.0 N m rms on `a`: the channel is dead"),
            "{dead}"
        );
        let brakes = clause(RecordingFaultKind::Brakes);
        assert!(
            brakes.ends_with("gravity would require 12.0 N m rms on `a`"),
            "{brakes}"
        );
    }
}
