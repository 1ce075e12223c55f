//! Forces that were read later than they act, or earlier: all drives together where their clock is another, some of them where
//! theirs is.

use modelmill_identify::{DelayAudit, DelayEstimate, ForceDelays, RecordingNote};

use super::rows::AuditRows;
use crate::model::Model;
use crate::stretch::RecordingSegment;
use crate::text::table::{percent, significant};

/// Samples of all drives that are looked at, spread over the recording, and the fewest of each.
const LOOKED_AT: usize = 9000;
const FEWEST: usize = 1200;
/// Longest delay that is looked for, s, or in samples where these are few, and in parts of the recording.
const LONGEST: f64 = 0.25;
const LONGEST_SAMPLES: f64 = 64.0;
const LONGEST_PART: f64 = 0.1;
/// Part of a drive's fastest rate below which its friction may be about to reverse, which has its own way of coming late.
const SLOW: f64 = 0.1;

/// How many times the half width of its interval a delay must be to be told, as what a model lacks is not quite at random.
const CLEAR: f64 = 1.5;
/// The same of a drive that alone is late: laws that the model lacks are often at one drive.
const CLEAR_ALONE: f64 = 3.0;
/// The shortest delay that is told, in samples: of all drives, and of some.
const LEAST: f64 = 0.2;
const LEAST_ALONE: f64 = 0.3;
/// Delays that differ by less than this part of a sample are alike.
const ALIKE: f64 = 0.1;
/// Parts by which what is left must fall: of all drives, of the drive that alone is late, and for a warning.
const GAIN: f64 = 0.003;
const GAIN_ALONE: f64 = 0.03;
const GRAVE: f64 = 0.1;

/// What the forces come later or earlier than the motion by.
pub(super) struct ForceDelayAudit {
    delays: ForceDelays,
    step: f64,
}

impl ForceDelayAudit {
    pub(super) fn from_segment(model: &Model, data: &RecordingSegment) -> Option<Self> {
        let run = &data.run;
        let forces = run.force.as_deref()?;
        let n = run.time.len();
        let duration = run.time.last()? - run.time.first()?;
        let step = duration / (n - 1) as f64;
        let longest = LONGEST
            .max(LONGEST_SAMPLES * step)
            .min(LONGEST_PART * duration);
        let from = run.time.partition_point(|t| *t < run.time[0] + longest);
        let to = run
            .time
            .partition_point(|t| *t <= run.time[n - 1] - longest);
        let most = (LOOKED_AT / forces.len().max(1)).max(FEWEST);
        let every = ((to - from) / most).max(1);
        let samples: Vec<usize> = (from..to).step_by(every).collect();
        let rows = AuditRows::new(model, data, &samples)?;
        let drives = forces.len();
        let mut counts = vec![false; samples.len() * drives];
        for (d, rates) in rows.motion[1].iter().enumerate() {
            let fastest = rates.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
            for (i, rate) in rates.iter().enumerate() {
                counts[i * drives + d] = rate.abs() > SLOW * fastest;
            }
        }
        let delays = ForceDelays::from_audit(&DelayAudit {
            regressor: rows.regressor,
            slope: AuditRows::slope(model, data, &samples)?,
            time: rows.time,
            used_rows: counts,
            recording_time: &run.time,
            forces,
            excluded_forces: &run.left_out,
            max_delay: longest,
        })?;
        Some(Self { delays, step })
    }

    /// What is left with what is found to be late taken into account, relative to what is left without; the geometric mean over
    /// the drives.
    fn gain(&self, with: usize) -> f64 {
        let [before, after] = [0, with].map(|which| geometric_mean(&self.delays.residuals[which]));
        1.0 - after / before.max(f64::MIN_POSITIVE)
    }

    /// The delay that all drives have, if that is how it is.
    fn common_delay(&self) -> Option<DelayEstimate> {
        let all = self.delays.common;
        let alone = &self.delays.by_channel;
        // A clock delays all forces alike; where drives differ, it is a law that the model lacks.
        let differ = |one: &DelayEstimate, other: &DelayEstimate| {
            let apart = (one.seconds - other.seconds).abs();
            apart > CLEAR * one.half_width.hypot(other.half_width) + ALIKE * self.step
        };
        let agree = (alone.iter().enumerate())
            .all(|(d, one)| !alone[..d].iter().any(|other| differ(one, other)));
        // Two drives at least must tell of themselves.
        let telling = |one: &&DelayEstimate| {
            one.seconds.abs() > one.half_width && one.seconds * all.seconds > 0.0
        };
        let agree = agree && alone.iter().filter(telling).count() >= alone.len().min(2);
        let is_there = self.is_clear(all, CLEAR, LEAST) && self.gain(1) > GAIN;
        (agree && is_there).then_some(all)
    }

    /// Drives whose forces are late where others tell that they are not.
    fn delayed_drives(&self) -> Vec<usize> {
        let ForceDelays {
            by_channel: alone,
            residuals: left,
            ..
        } = &self.delays;
        let late: Vec<usize> = (0..alone.len())
            .filter(|d| self.is_clear(alone[*d], CLEAR_ALONE, LEAST_ALONE))
            .filter(|d| left[2][*d] < (1.0 - GAIN_ALONE) * left[0][*d])
            .collect();
        let Some(least) = (late.iter().map(|d| alone[*d].seconds.abs())).min_by(f64::total_cmp)
        else {
            return Vec::new();
        };
        let is_late = |d: usize| late.contains(&d);
        let others = || (0..alone.len()).filter(|d| !is_late(*d)).map(|d| alone[d]);
        let in_time =
            others().all(|one| one.seconds.abs() < CLEAR * one.half_width + ALIKE * self.step);
        let known = others().any(|one| one.half_width < 0.5 * least);
        let same_side = late.iter().all(|d| alone[*d].seconds > 0.0)
            || late.iter().all(|d| alone[*d].seconds < 0.0);
        if in_time && known && same_side {
            late
        } else {
            Vec::new()
        }
    }

    fn is_clear(&self, delay: DelayEstimate, clear: f64, least: f64) -> bool {
        delay.seconds.abs() > (clear * delay.half_width).max(least * self.step)
    }

    /// What is left with the delay, as the geometric mean over the drives of their relative errors, where one is told.
    pub(super) fn residual_with_delay(&self) -> Option<f64> {
        if self.common_delay().is_some() {
            Some(geometric_mean(&self.delays.residuals[1]))
        } else {
            (!self.delayed_drives().is_empty()).then(|| geometric_mean(&self.delays.residuals[2]))
        }
    }

    /// What is to be said.
    pub(super) fn delay_note(&self, model: &Model, file: &str) -> Option<RecordingNote> {
        let names = model.drives();
        if let Some(all) = self.common_delay() {
            return Some(self.common_delay_note(all, &names, file));
        }
        let late = self.delayed_drives();
        if late.is_empty() {
            return None;
        }
        let each: Vec<String> = late
            .iter()
            .map(|d| {
                let one = self.delays.by_channel[*d];
                format!(
                    "The force of `{}` comes {} than the motion that the model explains it by: {}.",
                    names[*d],
                    direction_word(one),
                    self.delay_text(one)
                )
            })
            .collect();
        let says = format!(
            "{} That is so in {file}; forces of the other drives are in time.{} Look at how its samples are stamped, and shift \
             its column.",
            each.join(" "),
            self.gain_text(2)
        );
        Some(self.graded_note(2, says))
    }

    /// The note of a delay that all drives have.
    fn common_delay_note(&self, all: DelayEstimate, names: &[String], file: &str) -> RecordingNote {
        let amount = self.delay_text(all);
        let mut each = String::new();
        if names.len() > 1 {
            let of = names
                .iter()
                .zip(&self.delays.by_channel)
                .map(|(name, one)| {
                    format!(
                        "`{name}` {} +- {}",
                        rounded_text(one.seconds / self.step),
                        significant(one.half_width / self.step, 2)
                    )
                });
            let of: Vec<String> = of.collect();
            each = format!(" Each drive by itself, in samples: {}.", of.join(", "));
        }
        let worth = self.gain_text(1);
        if all.seconds < 0.0 && -all.seconds < self.step + all.half_width {
            return RecordingNote::info(format!(
                "The forces in {file} lead the motion by {amount}, as where a controller sets them after it has read the \
                 positions.{each}{worth}"
            ));
        }
        let mend = if all.seconds > 0.0 {
            format!(
                " An effect `time_delay` at `force` with T = {} s in the model file takes it out.",
                significant(all.seconds, 3)
            )
        } else {
            String::new()
        };
        let says = format!(
            "The forces in {file} come {} than the motion that the model explains them by: {amount}.{each}{worth}{mend}",
            direction_word(all)
        );
        self.graded_note(1, says)
    }

    fn delay_text(&self, delay: DelayEstimate) -> String {
        format!(
            "{} samples or {} ms (+- {} ms, 99 %)",
            rounded_text(delay.seconds.abs() / self.step),
            rounded_text(1e3 * delay.seconds.abs()),
            significant(1e3 * delay.half_width, 2)
        )
    }

    /// What taking a delay out gains.
    fn gain_text(&self, with: usize) -> String {
        let [before, after] =
            [0, with].map(|which| percent(Some(geometric_mean(&self.delays.residuals[which]))));
        format!(
            " With that the best fit is off by {after} rather than {before} (geometric mean over the drives, away from reversals)."
        )
    }

    fn graded_note(&self, with: usize, says: String) -> RecordingNote {
        if self.gain(with) > GRAVE {
            RecordingNote::warning(says)
        } else {
            RecordingNote::info(says)
        }
    }
}

fn direction_word(delay: DelayEstimate) -> &'static str {
    if delay.seconds > 0.0 {
        "later"
    } else {
        "earlier"
    }
}

/// The geometric mean.
fn geometric_mean(parts: &[f64]) -> f64 {
    let logarithms = parts.iter().map(|part| part.max(f64::MIN_POSITIVE).ln());
    (logarithms.sum::<f64>() / parts.len().max(1) as f64).exp()
}

/// Two decimals where they say something.
fn rounded_text(value: f64) -> String {
    if value.abs() < 10.0 {
        format!("{value:.2}")
    } else {
        format!("{value:.1}")
    }
}
