//! Limits of the model files along motions: the use of each limit by two variants.

use modelmill_identify::excite::{ExcitationMotion, ExcitationPlant, LimitMargin};

use super::thresholds::LIMIT_TOLERANCE;
use crate::error::{Error, Outcome};
use crate::excite::plant::{AXES, ModelPlant, used_fraction};
use crate::model::Model;
use crate::segment::{BLOCK, RecordingSegment};

/// The state of a limit in two models.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LimitCrossing {
    /// The second model exceeds it, the first one does not.
    NowExceeded,
    /// Both exceed it.
    StillExceeded,
    /// The first model exceeds it, the second one does not.
    NoLongerExceeded,
    /// Neither exceeds it.
    Kept,
}

/// The use of a limit by two models. Each is compared with the limit of its own file.
#[derive(Clone, Debug, PartialEq)]
pub struct LimitUse {
    /// The limited quantity, with the name that `excite` uses: `theta1`, `theta1_d`, `spindle_left`, `R3m.x`,
    /// `singularity of the loops`.
    pub limit: String,
    /// The ranges of both files, in the unit of the quantity; `None` if a file has none, and for singularities.
    pub ranges: [Option<[f64; 2]>; 2],
    /// The fraction of the limit that each model uses, 1 at the limit, counted from the middle of the range; `None`
    /// without a limit.
    pub used: [Option<f64>; 2],
}

impl LimitUse {
    /// Whether the limit is exceeded, and by which model.
    pub fn crossing(&self) -> LimitCrossing {
        let is_beyond = self
            .used
            .map(|used| used.is_some_and(|used| used > 1.0 + LIMIT_TOLERANCE));
        match is_beyond {
            [false, true] => LimitCrossing::NowExceeded,
            [true, true] => LimitCrossing::StillExceeded,
            [true, false] => LimitCrossing::NoLongerExceeded,
            [false, false] => LimitCrossing::Kept,
        }
    }
}

/// The limits of two models, with their use so far.
pub(super) struct VariantLimits {
    /// One entry for each limit of either file.
    found: Vec<LimitUse>,
    /// Limits that depend on poses, without those of forces: forces are computed under the model's own load.
    of_poses: [modelmill_spec::MotionLimits; 2],
}

impl VariantLimits {
    /// The limits of both files, without motion yet.
    pub(super) fn from_models(models: [&Model; 2]) -> Self {
        let of_poses = models.map(|model| modelmill_spec::MotionLimits {
            forces: Vec::new(),
            ..model.derivation.mechanism.limits.clone()
        });
        Self {
            found: Vec::new(),
            of_poses,
        }
    }

    /// Adds a motion: the states of each model, and its forces `[drive][sample]`, N or N m.
    ///
    /// Fails when a model cannot follow the motion.
    pub(super) fn add(
        &mut self,
        models: [&Model; 2],
        states: &[RecordingSegment; 2],
        forces: [&[Vec<f64>]; 2],
    ) -> Outcome {
        for (m, model) in models.into_iter().enumerate() {
            let mechanism = &model.derivation.mechanism;
            let run = &states[m].run;
            let (active, _) = model.derivation.coordinates();
            // Limits of active coordinates and of their derivatives are compared sample by sample.
            for (i, limits) in &mechanism.limits.coordinates {
                let Some(k) = active.iter().position(|a| *a == i.0) else {
                    continue;
                };
                let name = &mechanism.coordinates[i.0].name;
                let ranges = [
                    (name.clone(), limits.position, &run.q[k]),
                    (format!("{name}_d"), limits.rate, &run.qd[k]),
                    (format!("{name}_dd"), limits.acceleration, &run.qdd[k]),
                ];
                for (name, range, values) in ranges {
                    if let Some(range) = range {
                        self.record_use(m, &name, Some(range), used_share_of_range(values, range));
                    }
                }
            }
            // Limits of forces use the forces of the variant itself.
            for (drive, range) in &mechanism.limits.forces {
                let name = &mechanism.drives[drive.0].name;
                let values = &forces[m][drive.0];
                self.record_use(m, name, Some(*range), used_share_of_range(values, *range));
            }
            self.add_poses(m, model, &states[m])?;
        }
        Ok(())
    }

    /// Adds passive coordinates, points and singular values, which need the pose of every sample.
    ///
    /// Fails when the model cannot follow the motion.
    fn add_poses(&mut self, m: usize, model: &Model, states: &RecordingSegment) -> Outcome {
        let limits = self.of_poses[m].clone();
        let plant = ModelPlant::new(model, &limits);
        let names = plant.limits();
        if names.is_empty() {
            return Ok(());
        }
        let what = format!("comparing {} with its limits", model.name);
        let run = &states.run;
        let samples = states.samples();
        let found = model.host().run_job(&what, samples, |job| {
            let mut most = vec![f64::NEG_INFINITY; names.len()];
            // The motion is evaluated in blocks, so that progress is reported and memory stays small.
            for start in (0..samples).step_by(BLOCK) {
                let end = (start + BLOCK).min(samples);
                job.step(end - start)?;
                let piece = |all: &[Vec<f64>]| all.iter().map(|one| one[start..end].to_vec()).collect();
                let motion = ExcitationMotion {
                    q: piece(&run.q),
                    qd: piece(&run.qd),
                    qdd: piece(&run.qdd),
                };
                let excess = plant
                    .excess(&motion)
                    .ok_or_else(|| Error::input(format!("{} cannot follow the motion of {}", model.path, run.file)))?;
                for (most, excess) in most.iter_mut().zip(excess) {
                    *most = excess.into_iter().fold(*most, f64::max);
                }
            }
            Ok::<_, Error>(most)
        })??;
        for (name, excess) in names.into_iter().zip(found) {
            let range = range_of(model, &limits, &name);
            let margin = LimitMargin {
                name,
                excess,
                proven: false,
            };
            self.record_use(m, &margin.name, range, used_fraction(&margin));
        }
        Ok(())
    }

    /// Keeps the largest fraction of a limit that a model uses, over all motions.
    fn record_use(&mut self, m: usize, name: &str, range: Option<[f64; 2]>, used: f64) {
        // The first use of a limit adds its entry.
        let known = self.found.iter().position(|one| one.limit == name);
        let k = known.unwrap_or_else(|| {
            self.found.push(LimitUse {
                limit: name.to_owned(),
                ranges: [None; 2],
                used: [None; 2],
            });
            self.found.len() - 1
        });
        let one = &mut self.found[k];
        one.ranges[m] = range;
        one.used[m] = Some(one.used[m].map_or(used, |before| before.max(used)));
    }

    /// The uses of all limits.
    pub(super) fn into_uses(self) -> Vec<LimitUse> {
        self.found
    }
}

/// The largest fraction of a range that values use, from its middle.
fn used_share_of_range(values: &[f64], [low, high]: [f64; 2]) -> f64 {
    let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
    let far = values.iter().map(|v| (v - middle).abs() / half);
    far.fold(0.0, f64::max)
}

/// The range of a passive coordinate or of a point along an axis, by the name of its limit; `None` for other
/// limits.
fn range_of(model: &Model, limits: &modelmill_spec::MotionLimits, name: &str) -> Option<[f64; 2]> {
    let mechanism = &model.derivation.mechanism;
    let coordinates = limits.coordinates.iter();
    let mut coordinates = coordinates.filter(|(i, _)| mechanism.coordinates[i.0].name == name);
    if let Some((_, limits)) = coordinates.next() {
        return limits.position;
    }
    // Points have names such as `R3m.x`.
    let (point, axis) = name.rsplit_once('.')?;
    let axis = AXES.iter().position(|a| *a == axis)?;
    let mut points = limits.points.iter();
    let (_, ranges) = points.find(|(i, _)| mechanism.points[i.0].name == point)?;
    ranges[axis]
}
