//! Delay of the force signals relative to the motion, positive or negative: of all drives if their clock differs, of
//! some drives if the clocks of these differ. A segment goes in, a note with the delay comes out.

use modelmill_identify::{DelayAudit, DelayEstimate, ForceDelays, RecordingNote};

use super::rows::AuditRows;
use super::thresholds::{
    COMMON_DELAY_FEWEST_DRIVES, DELAY_LEAST_GAIN, DELAY_LEAST_HALF_WIDTHS, DELAY_LEAST_STEPS, DELAY_MOST_RESIDUAL,
    DELAY_REVERSAL_RATE_SHARE, DELAY_WARNING_GAIN, LONG_DELAY_LEAST_GAIN, LONG_DELAY_S, LONG_DELAY_STEPS,
    LONGEST_DELAY_S, LONGEST_DELAY_SHARE, LONGEST_DELAY_STEPS, PROMPT_DRIVE_MOST_HALF_WIDTH,
    SAME_DELAY_TOLERANCE_STEPS, SINGLE_DELAY_LEAST_GAIN, SINGLE_DELAY_LEAST_HALF_WIDTHS, SINGLE_DELAY_LEAST_STEPS,
};
use crate::model::Model;
use crate::segment::RecordingSegment;
use crate::text::table::{percent, significant};

/// Largest number of samples over all drives, spread over the recording.
const LOOKED_AT: usize = 9000;
/// Smallest number of samples for each drive.
const FEWEST: usize = 1200;

/// Delays of the force signals of a segment.
pub(crate) struct ForceDelayAudit {
    /// Delays of all drives together and of each drive, with residuals.
    delays: ForceDelays,
    /// Time between samples, s.
    step: f64,
    /// Names of the drives with a force signal, in the order of the delays.
    drives: Vec<String>,
}

/// Some of the columns; none if there are none at all.
fn pick<T: Clone>(columns: &[Vec<T>], which: &[usize]) -> Vec<Vec<T>> {
    which.iter().filter_map(|d| columns.get(*d).cloned()).collect()
}

impl ForceDelayAudit {
    /// Estimates the delays; `None` if forces are missing, the segment is too short, or a pose has no
    /// solution.
    pub(crate) fn from_segment(model: &Model, data: &RecordingSegment) -> Option<Self> {
        let run = &data.run;
        let forces = run.force.as_deref()?;
        let n = run.time.len();
        let duration = run.time.last()? - run.time.first()?;
        let step = duration / (n - 1) as f64;
        let longest = LONGEST_DELAY_S
            .max(LONGEST_DELAY_STEPS * step)
            .min(LONGEST_DELAY_SHARE * duration);
        // Both ends are excluded by the longest delay, so that every shifted sample exists.
        let from = run.time.partition_point(|t| *t < run.time[0] + longest);
        let to = run.time.partition_point(|t| *t <= run.time[n - 1] - longest);
        let most = (LOOKED_AT / forces.len().max(1)).max(FEWEST);
        let every = ((to - from) / most).max(1);
        let samples: Vec<usize> = (from..to).step_by(every).collect();
        let rows = AuditRows::new(model, data, &samples)?;
        // A drive without any force, as in the row of an undriven joint, has no signal that could be late.
        let is_read = |d: &usize| forces[*d].iter().any(|force| *force != 0.0);
        let read: Vec<usize> = (0..forces.len()).filter(is_read).collect();
        // Samples near reversals of a drive are not used.
        let mut counts = vec![false; samples.len() * read.len()];
        for (k, rates) in read.iter().map(|d| &rows.motion[1][*d]).enumerate() {
            let fastest = rates.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
            for (i, rate) in rates.iter().enumerate() {
                counts[i * read.len() + k] = rate.abs() > DELAY_REVERSAL_RATE_SHARE * fastest;
            }
        }
        let delays = ForceDelays::from_audit(&DelayAudit {
            regressor: rows.regressor.select_channels(&read),
            slope: AuditRows::slope(model, data, &samples)?.select_channels(&read),
            time: rows.time,
            used_rows: counts,
            recording_time: &run.time,
            forces: &pick(forces, &read),
            excluded_forces: &pick(&run.left_out, &read),
            max_delay: longest,
        })?;
        let names = model.row_names();
        Some(Self {
            delays,
            step,
            drives: read.iter().map(|d| names[*d].clone()).collect(),
        })
    }

    /// Relative decrease of the residual with the delay, as a geometric mean over the drives. `with` is 1 for the
    /// common delay and 2 for delays of single drives.
    fn gain(&self, with: usize) -> f64 {
        let [before, after] = [0, with].map(|which| geometric_mean(&self.delays.residuals[which]));
        1.0 - after / before.max(f64::MIN_POSITIVE)
    }

    /// The delay that all drives share; `None` if they differ, or if it is not clear.
    fn common_delay(&self) -> Option<DelayEstimate> {
        let all = self.delays.common;
        let alone = &self.delays.by_channel;
        // A clock delays all forces alike; if drives differ, the model lacks a law.
        let differ = |one: &DelayEstimate, other: &DelayEstimate| {
            let apart = (one.seconds - other.seconds).abs();
            apart
                > DELAY_LEAST_HALF_WIDTHS * one.half_width.hypot(other.half_width)
                    + SAME_DELAY_TOLERANCE_STEPS * self.step
        };
        let agree = (alone.iter().enumerate()).all(|(d, one)| !alone[..d].iter().any(|other| differ(one, other)));
        // At least two drives must show the delay on their own.
        let telling = |one: &&DelayEstimate| one.seconds.abs() > one.half_width && one.seconds * all.seconds > 0.0;
        let agree = agree && alone.iter().filter(telling).count() >= alone.len().min(COMMON_DELAY_FEWEST_DRIVES);
        let is_there = self.is_clear(all, DELAY_LEAST_HALF_WIDTHS, DELAY_LEAST_STEPS)
            && self.gain(1) > self.least_gain(all)
            && geometric_mean(&self.delays.residuals[1]) < DELAY_MOST_RESIDUAL;
        (agree && is_there).then_some(all)
    }

    /// How much a delay of all drives must lower the residual (1): a long one must explain a large part.
    fn least_gain(&self, delay: DelayEstimate) -> f64 {
        let is_long = delay.seconds.abs() > LONG_DELAY_S.max(LONG_DELAY_STEPS * self.step);
        if is_long {
            LONG_DELAY_LEAST_GAIN
        } else {
            DELAY_LEAST_GAIN
        }
    }

    /// Drives whose force signals are delayed while those of the other drives are clearly not.
    fn delayed_drives(&self) -> Vec<usize> {
        let ForceDelays {
            by_channel: alone,
            residuals: left,
            ..
        } = &self.delays;
        // A delayed drive must be clear and must reduce its own residual.
        let late: Vec<usize> = (0..alone.len())
            .filter(|d| self.is_clear(alone[*d], SINGLE_DELAY_LEAST_HALF_WIDTHS, SINGLE_DELAY_LEAST_STEPS))
            .filter(|d| left[2][*d] < (1.0 - SINGLE_DELAY_LEAST_GAIN) * left[0][*d])
            .collect();
        let Some(least) = (late.iter().map(|d| alone[*d].seconds.abs())).min_by(f64::total_cmp) else {
            return Vec::new();
        };
        let is_late = |d: usize| late.contains(&d);
        // The other drives must show that the common clock is correct.
        let others = || (0..alone.len()).filter(|d| !is_late(*d)).map(|d| alone[d]);
        let in_time = others().all(|one| {
            one.seconds.abs() < DELAY_LEAST_HALF_WIDTHS * one.half_width + SAME_DELAY_TOLERANCE_STEPS * self.step
        });
        let known = others().any(|one| one.half_width < PROMPT_DRIVE_MOST_HALF_WIDTH * least);
        let same_side = late.iter().all(|d| alone[*d].seconds > 0.0) || late.iter().all(|d| alone[*d].seconds < 0.0);
        if in_time && known && same_side {
            late
        } else {
            Vec::new()
        }
    }

    /// Whether a delay exceeds its uncertainty by the factor `clear`, and `least` samples.
    fn is_clear(&self, delay: DelayEstimate, clear: f64, least: f64) -> bool {
        delay.seconds.abs() > (clear * delay.half_width).max(least * self.step)
    }

    /// Sum over the drives of the logarithms by which the delay lowers the residual; 0 without a delay.
    pub(crate) fn log_gain(&self) -> f64 {
        let with = if self.common_delay().is_some() {
            1
        } else if self.delayed_drives().is_empty() {
            return 0.0;
        } else {
            2
        };
        let [before, after] = [0, with].map(|which| geometric_mean(&self.delays.residuals[which]));
        let drives = self.delays.residuals[0].len() as f64;
        drives * (before / after.max(f64::MIN_POSITIVE)).ln()
    }

    /// The note on the delay; `None` without one. `file` is the name of the recording.
    pub(super) fn delay_note(&self, file: &str) -> Option<RecordingNote> {
        let names = &self.drives;
        if let Some(all) = self.common_delay() {
            return Some(self.common_delay_note(all, names, file));
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
                    "The force of `{}` comes {} than the motion that causes it in the model: {}.",
                    names[*d],
                    direction_word(one),
                    self.delay_text(one)
                )
            })
            .collect();
        let says = format!(
            "{} This holds for {file}; the forces of the other drives are not delayed.{} Check its time stamps, and shift \
             its column.",
            each.join(" "),
            self.gain_text(2)
        );
        Some(self.graded_note(2, says))
    }

    /// The note on a delay that all drives share.
    fn common_delay_note(&self, all: DelayEstimate, names: &[String], file: &str) -> RecordingNote {
        let amount = self.delay_text(all);
        // The delays of single drives show how well they agree.
        let mut each = String::new();
        if names.len() > 1 {
            let of = names.iter().zip(&self.delays.by_channel).map(|(name, one)| {
                format!(
                    "`{name}` {} +- {}",
                    rounded_text(one.seconds / self.step),
                    significant(one.half_width / self.step, 2)
                )
            });
            let of: Vec<String> = of.collect();
            each = format!(" Delay of each drive, in samples: {}.", of.join(", "));
        }
        let worth = self.gain_text(1);
        // A lead of up to one sample is normal for controllers, and only noted.
        if all.seconds < 0.0 && -all.seconds < self.step + all.half_width {
            return RecordingNote::info(format!(
                "The forces in {file} lead the motion by {amount}, which is normal if a controller sets them after reading the \
                 positions.{each}{worth}"
            ));
        }
        // Only a delay can be modelled by `time_delay`.
        let mend = if all.seconds > 0.0 {
            format!(
                " An effect `time_delay` at `force` with T = {} s in the model file compensates for it.",
                significant(all.seconds, 3)
            )
        } else {
            String::new()
        };
        let says = format!(
            "The forces in {file} come {} than the motion that causes them in the model: {amount}.{each}{worth}{mend}",
            direction_word(all)
        );
        self.graded_note(1, says)
    }

    /// The size of a delay in samples and ms with its interval.
    fn delay_text(&self, delay: DelayEstimate) -> String {
        format!(
            "{} samples or {} ms (+- {} ms, 99 %)",
            rounded_text(delay.seconds.abs() / self.step),
            rounded_text(1e3 * delay.seconds.abs()),
            significant(1e3 * delay.half_width, 2)
        )
    }

    /// The residuals with and without the delay, as a sentence.
    fn gain_text(&self, with: usize) -> String {
        let [before, after] = [0, with].map(|which| percent(Some(geometric_mean(&self.delays.residuals[which]))));
        format!(
            " With the delay the best fit has an error of {after} instead of {before} (geometric mean over the drives, away from reversals)."
        )
    }

    /// The note as a warning if the delay causes a large part of the residual.
    fn graded_note(&self, with: usize, says: String) -> RecordingNote {
        if self.gain(with) > DELAY_WARNING_GAIN {
            RecordingNote::warning(says)
        } else {
            RecordingNote::info(says)
        }
    }
}

/// The sign of a delay as a word.
fn direction_word(delay: DelayEstimate) -> &'static str {
    if delay.seconds > 0.0 { "later" } else { "earlier" }
}

/// The geometric mean of positive numbers.
fn geometric_mean(parts: &[f64]) -> f64 {
    let logarithms = parts.iter().map(|part| part.max(f64::MIN_POSITIVE).ln());
    (logarithms.sum::<f64>() / parts.len().max(1) as f64).exp()
}

/// A number with two decimals, or one from 10 on.
fn rounded_text(value: f64) -> String {
    if value.abs() < 10.0 {
        format!("{value:.2}")
    } else {
        format!("{value:.1}")
    }
}
