//! Whether a fit to the rest of a recording contradicts forces that may not have been measured.

use modelmill_identify::diagnose::white_noise;
use modelmill_identify::{ChannelRegressor, RobustFit, robust_fit};
use modelmill_spec::DriveKind;
use nalgebra::DVector;

use super::super::RecordingFaultKind;
use super::super::thresholds::{
    BRAKED_FORCE_SHARE, BRAKED_NOISE_FACTOR, LIMIT_LEAST_SHARE_BEYOND, SILENCE_DEPENDENT_SAMPLES,
    SILENCE_LEAST_FORCE_SHARE, SILENCE_MOTION_SHARE, SILENCE_RESIDUAL_FACTOR, SILENCE_STANDSTILL_SHARE,
    SILENCE_VARIATION_FACTOR,
};
use super::{SilenceCandidate, SilenceEvidence};
use crate::audit::rows::AuditRows;
use crate::model::Model;
use crate::segment::RecordingSegment;

/// Samples of a recording at which the model is fitted.
const LOOKED_AT: usize = 3000;

/// A fit of the model to the samples without candidates.
pub(super) struct SilenceFit {
    /// The recording and the time, s, of each sample.
    samples: Vec<(usize, f64)>,
    /// The rows of all samples.
    regressor: ChannelRegressor,
    /// The fit.
    fit: RobustFit,
    /// Fitted forces, interleaved by drive.
    fitted: DVector<f64>,
    /// Magnitude of the dry friction of each drive.
    dry: Vec<f64>,
    /// Residual of each drive outside of the candidates, rms.
    residual: Vec<f64>,
    /// Force of each drive outside of the candidates, rms and largest magnitude.
    size: Vec<[f64; 2]>,
    /// Force of each drive with all candidates, rms.
    complete_rms: Vec<f64>,
}

impl SilenceFit {
    /// Fits the model to recordings, each with its candidates; `None` if forces are missing, a pose has no solution or the
    /// fit fails.
    pub(super) fn new(model: &Model, recordings: &[(&[RecordingSegment], &[SilenceCandidate])]) -> Option<Self> {
        let n = model.derivation.mechanism.drives.len();
        let segments = || recordings.iter().flat_map(|(segments, _)| segments.iter());
        let all: usize = segments().map(RecordingSegment::samples).sum();
        let every = (all / LOOKED_AT).max(1);
        let picked: Vec<Vec<usize>> = segments()
            .map(|data| (0..data.samples()).step_by(every).collect())
            .collect();
        let regressor = AuditRows::joined_regressor(model, segments(), &picked)?;
        let (mut samples, mut measured, mut counts) = (Vec::new(), Vec::new(), Vec::new());
        let mut picked = picked.iter();
        for (recording, (segments, candidates)) in recordings.iter().enumerate() {
            for (data, picked) in segments.iter().zip(picked.by_ref()) {
                let forces = data.run.force.as_deref()?;
                for k in picked {
                    let t = data.run.time[*k];
                    samples.push((recording, t));
                    for (d, force) in forces.iter().enumerate() {
                        let is_candidate = candidates.iter().any(|one| one.drive == d && one.contains(t));
                        measured.push(force[*k]);
                        counts.push(data.run.is_force_measured(d, *k) && !is_candidate);
                    }
                }
            }
        }
        let measured = DVector::from_vec(measured);
        let fit = robust_fit(&regressor, &measured, &counts)?;
        let fitted = regressor.multiply(fit.values.as_slice());
        let more = (regressor.columns() - model.base.len()) / n;
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
        let complete_rms = (0..n)
            .map(|d| {
                (measured.iter().skip(d).step_by(n).map(|f| f * f).sum::<f64>() / samples.len().max(1) as f64).sqrt()
            })
            .collect();
        Some(Self {
            samples,
            regressor,
            fit,
            fitted,
            dry,
            residual,
            size,
            complete_rms,
        })
    }

    /// Whether the level of a candidate is zero, except for noise and a small offset.
    pub(super) fn is_zero(&self, one: &SilenceCandidate) -> bool {
        // A number that repeats is zero or it is not.
        if one.evidence != SilenceEvidence::Flat {
            return one.level == 0.0;
        }
        one.level.abs() <= one.noise.max(0.01 * self.complete_rms[one.drive])
    }

    /// The kind of fault of a candidate in a recording with its segments, and the predicted force, rms; `None` if the
    /// prediction does not contradict it.
    pub(super) fn judge(
        &self,
        model: &Model,
        (recording, segments): (usize, &[RecordingSegment]),
        one: &SilenceCandidate,
    ) -> Option<(RecordingFaultKind, f64)> {
        let (n, d) = (self.size.len(), one.drive);
        let is_inside = |(of, time): (usize, f64)| of == recording && one.contains(time);
        let inside: Vec<usize> = (0..self.samples.len())
            .filter(|i| is_inside(self.samples[*i]))
            .collect();
        let predicted: Vec<f64> = inside.iter().map(|i| self.fitted[i * n + d]).collect();
        let mean =
            |of: &dyn Fn(f64) -> f64| predicted.iter().map(|x| of(*x)).sum::<f64>() / predicted.len().max(1) as f64;
        let size = mean(&|x| x * x).sqrt();
        let is_zero = self.is_zero(one);
        // No motion gives one number again and again where all others have noise.
        let kind_by_itself = match one.evidence {
            SilenceEvidence::Repeated {
                others_have_noise: true,
            } if !is_zero => Some(RecordingFaultKind::FrozenForce),
            SilenceEvidence::Limit {
                others_have_noise: true,
            } => Some(RecordingFaultKind::Saturation),
            _ => None,
        };
        if kind_by_itself.is_some() {
            let moves = travel_shares(segments, one).any(|share| share > SILENCE_STANDSTILL_SHARE);
            return kind_by_itself.filter(|_| moves).map(|kind| (kind, size));
        }
        let off = mean(&|x| (x - one.level).powi(2)).sqrt();
        let [rms, largest] = self.size[d];
        // Errors of neighbouring samples are alike, so that a fit is less certain than with independent errors.
        let relative = self.fit.relative_deviations(&self.regressor, d, &inside)?;
        let variance = relative.iter().map(|x| x * x).sum::<f64>() / relative.len().max(1) as f64;
        let uncertain = self.residual[d] * (1.0 + SILENCE_DEPENDENT_SAMPLES * variance).sqrt();
        if off <= SILENCE_RESIDUAL_FACTOR * uncertain.max(one.noise) {
            return None;
        }
        if matches!(one.evidence, SilenceEvidence::Limit { .. }) {
            let beyond = mean(&|x| {
                if x * one.level.signum() > one.level.abs() {
                    1.0
                } else {
                    0.0
                }
            });
            return (beyond > LIMIT_LEAST_SHARE_BEYOND).then_some((RecordingFaultKind::Saturation, size));
        }
        // A prediction beyond all forces is an extrapolation.
        if off <= SILENCE_LEAST_FORCE_SHARE * rms || size > 1.5 * largest {
            return None;
        }
        let moved = moved_share(model, segments, one);
        let stands = moved <= SILENCE_STANDSTILL_SHARE;
        let is_repeated = one.evidence != SilenceEvidence::Flat;
        if !stands && moved < SILENCE_MOTION_SHARE && !is_repeated {
            return None;
        }
        // A stuck channel misses changes, not only a level, which friction may cause.
        let middle = mean(&|x| x);
        let variation = mean(&|x| (x - middle).powi(2)).sqrt();
        if !is_zero && !is_repeated && variation < SILENCE_VARIATION_FACTOR * uncertain.max(one.noise) {
            return None;
        }
        match (stands, is_zero) {
            // Dry friction may hold a joint without any force.
            (true, true) if mean(&f64::abs) <= self.dry[d] => None,
            (true, true) if is_braked(model, segments, one) => Some((RecordingFaultKind::Brakes, size)),
            // At standstill friction may take any part of the force, and another joint may hold this one.
            (true, _) => None,
            (false, true) => Some((RecordingFaultKind::DeadChannel, size)),
            (false, false) => Some((RecordingFaultKind::FrozenForce, size)),
        }
    }
}

/// Whether brakes hold the machine during a candidate: all joints stand, and no drive works.
fn is_braked(model: &Model, segments: &[RecordingSegment], one: &SilenceCandidate) -> bool {
    let rms = |sum: f64, count: usize| (sum / count.max(1) as f64).sqrt();
    let works = |d: usize| {
        let (mut inside, mut all, mut noise) = ((0.0, 0), (0.0, 0), 0.0_f64);
        for data in segments {
            let Some(forces) = data.run.force.as_deref() else {
                continue;
            };
            noise = noise.max(white_noise(&forces[d]));
            for (t, force) in data.run.time.iter().zip(&forces[d]) {
                all = (all.0 + force * force, all.1 + 1);
                if one.contains(*t) {
                    inside = (inside.0 + force * force, inside.1 + 1);
                }
            }
        }
        rms(inside.0, inside.1) > (BRAKED_NOISE_FACTOR * noise).max(BRAKED_FORCE_SHARE * rms(all.0, all.1))
    };
    let drives = model.derivation.mechanism.drives.iter().enumerate();
    travel_shares(segments, one).all(|share| share <= SILENCE_STANDSTILL_SHARE)
        && !drives.filter(|(_, drive)| drive.is_driven).any(|(d, _)| works(d))
}

/// The share of its travel by which the joint of a drive moves during a candidate; for a drive between points the
/// largest share of all joints.
fn moved_share(model: &Model, segments: &[RecordingSegment], one: &SilenceCandidate) -> f64 {
    let mechanism = &model.derivation.mechanism;
    let names = model.active_coordinates();
    let own = match mechanism.drives[one.drive].kind {
        DriveKind::Joint(i) => names.iter().position(|name| *name == mechanism.coordinates[i.0].name),
        DriveKind::Linear { .. } => None,
    };
    let mut shares = travel_shares(segments, one);
    match own {
        Some(i) => shares.nth(i).unwrap_or(0.0),
        None => shares.fold(0.0, f64::max),
    }
}

/// The share of its travel in the whole recording by which each coordinate moves during a candidate, 0 to 1.
fn travel_shares(segments: &[RecordingSegment], one: &SilenceCandidate) -> impl Iterator<Item = f64> {
    let coordinates = segments.first().map_or(0, |data| data.run.q.len());
    (0..coordinates).map(move |i| {
        let values = segments
            .iter()
            .flat_map(|data| data.run.time.iter().zip(&data.run.q[i]));
        let travel = |values: &mut dyn Iterator<Item = f64>| {
            let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), q| {
                (low.min(q), high.max(q))
            });
            (high - low).max(0.0)
        };
        let inside = travel(&mut values.clone().filter(|(t, _)| one.contains(**t)).map(|(_, q)| *q));
        inside / travel(&mut values.map(|(_, q)| *q)).max(f64::MIN_POSITIVE)
    })
}
