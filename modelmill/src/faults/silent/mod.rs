//! Forces that were not measured for some time: a channel that reads zero, one that is stuck at a value, and joints that
//! brakes hold while the drives are off. A recording goes in, the intervals come out.
//!
//! A candidate is an interval in which a force has no signal but white noise, or one in which it repeats one number
//! exactly, or a value that it never exceeds. It counts only if a fit to the rest of the recording predicts another
//! force there. An exact repetition needs no prediction where the machine moves and all other readings have noise.

mod fit;
mod flat;
mod repeats;

use modelmill_boundary::message;
use modelmill_identify::diagnose::Disturbance;
use modelmill_identify::{RecordingNote, SignalRecording};

use super::RecordingFaultKind;
use super::thresholds::SILENCE_MOST_INTERVALS;
use crate::model::Model;
use crate::segment::RecordingSegment;
use crate::text::table::significant;

use fit::SilenceFit;
use flat::flat_intervals;
use repeats::{IntactReadings, find_repeats};

/// Times of two intervals that differ by less are equal, s.
const SAME_TIME_S: f64 = 0.1;

/// An interval in which forces were not measured.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SilentInterval {
    /// Dead channel, frozen force, saturation, or brakes.
    pub(crate) kind: RecordingFaultKind,
    /// Names of the drives.
    pub(crate) drives: Vec<String>,
    /// Start and end, s.
    pub(crate) interval: [f64; 2],
    /// Starts and ends of the times that fits do not use, s. They include samples that were dropped at the ends of the
    /// recording. For a limit they are the samples at it.
    pub(crate) reach: Vec<[f64; 2]>,
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
            RecordingFaultKind::Saturation => {
                format!(
                    "the {force} of {names} {is} cut off at {}, again and again {when}",
                    self.level
                )
            }
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
            RecordingFaultKind::Saturation => "Choose a larger range of the sensor, or look for the limit of the drive",
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

/// Samples of a drive whose force may not have been measured.
struct SilenceCandidate {
    /// Index of the drive.
    drive: usize,
    /// Starts and ends, s.
    intervals: Vec<[f64; 2]>,
    /// Times that fits do not use if the fault is confirmed, s.
    reach: Vec<[f64; 2]>,
    /// The mean force.
    level: f64,
    /// Standard deviation of white noise of the force.
    noise: f64,
    /// How it was found.
    evidence: SilenceEvidence,
}

/// How a candidate was found.
#[derive(Clone, Copy, PartialEq, Eq)]
enum SilenceEvidence {
    /// White noise about a level.
    Flat,
    /// One number repeats for a time.
    Repeated {
        /// Whether all other readings have noise.
        others_have_noise: bool,
    },
    /// One number repeats, and no reading is beyond.
    Limit {
        /// Whether all other readings have noise.
        others_have_noise: bool,
    },
}

impl SilenceCandidate {
    /// Whether a time lies within.
    fn contains(&self, time: f64) -> bool {
        self.intervals.iter().any(|[from, to]| (*from..=*to).contains(&time))
    }

    /// Start of the first and end of the last interval, s.
    fn span(&self) -> [f64; 2] {
        let of = |k: usize| self.intervals.iter().map(move |interval| interval[k]);
        [
            of(0).fold(f64::INFINITY, f64::min),
            of(1).fold(f64::NEG_INFINITY, f64::max),
        ]
    }
}

/// Intervals of recordings of one machine in which forces were not measured; none if forces are missing or a pose has no
/// solution.
pub(crate) fn silent_intervals(
    model: &Model,
    recordings: &[Option<(&SignalRecording, &[RecordingSegment])>],
) -> Vec<Vec<SilentInterval>> {
    let drives = &model.derivation.mechanism.drives;
    let driven = || (0..drives.len()).filter(|d| drives[*d].is_driven);
    let candidates: Vec<Vec<SilenceCandidate>> = (recordings.iter())
        .map(|one| {
            let one = one.iter();
            one.flat_map(|(raw, segments)| driven().flat_map(|d| find_candidates(d, model, raw, segments)))
                .collect()
        })
        .collect();
    if candidates.iter().all(Vec::is_empty) {
        return vec![Vec::new(); recordings.len()];
    }
    let parts: Vec<(&[RecordingSegment], &[SilenceCandidate])> = (recordings.iter().zip(&candidates))
        .map(|(one, candidates)| (one.map_or(&[][..], |(_, segments)| segments), candidates.as_slice()))
        .collect();
    // A recording that misses forces for most of its time is predicted by all others. A recording with another load is
    // predicted by itself.
    let of_all = SilenceFit::new(model, &parts);
    let each = recordings.iter().zip(&candidates).enumerate();
    each.map(|(k, (one, candidates))| {
        let Some((raw, segments)) = one.filter(|_| !candidates.is_empty()) else {
            return Vec::new();
        };
        let own = SilenceFit::new(model, &parts[k..=k]);
        let judges = [own.as_ref().map(|fit| (fit, 0)), of_all.as_ref().map(|fit| (fit, k))];
        let judges: Vec<(&SilenceFit, usize)> = judges.into_iter().flatten().collect();
        judged_intervals(model, raw.file(), segments, candidates, &judges)
    })
    .collect()
}

/// The candidates of a recording that count by one of the fits; each fit has the recording's index in it.
fn judged_intervals(
    model: &Model,
    file: &str,
    segments: &[RecordingSegment],
    candidates: &[SilenceCandidate],
    judges: &[(&SilenceFit, usize)],
) -> Vec<SilentInterval> {
    let drives = &model.derivation.mechanism.drives;
    let mut found: Vec<SilentInterval> = Vec::new();
    for one in candidates {
        let mut verdicts = judges
            .iter()
            .filter_map(|(fit, k)| fit.judge(model, (*k, segments), one));
        let Some((kind, predicted)) = verdicts.next() else {
            continue;
        };
        let interval = one.span();
        let name = drives[one.drive].name.clone();
        // The same interval of several drives is one fault, unless each drive has a value of its own.
        let has_level = matches!(kind, RecordingFaultKind::Saturation | RecordingFaultKind::FrozenForce);
        let is_same = |other: &&mut SilentInterval| {
            other.kind == kind && !has_level && (0..2).all(|k| (other.interval[k] - interval[k]).abs() < SAME_TIME_S)
        };
        let unit = model.force_unit(one.drive);
        match found.iter_mut().find(is_same) {
            Some(other) => other.drives.push(name),
            None => found.push(SilentInterval {
                kind,
                drives: vec![name],
                interval,
                reach: one.reach.clone(),
                file: file.to_owned(),
                level: format!("{} {unit}", significant(one.level, 3)),
                predicted: predicted_text(predicted, unit, &drives[one.drive].name),
            }),
        }
    }
    // With brakes on, drives without weight read zero as well.
    for brakes in found.iter_mut().filter(|one| one.kind == RecordingFaultKind::Brakes) {
        let [from, to] = brakes.interval;
        for one in candidates
            .iter()
            .filter(|one| judges.iter().any(|(fit, _)| fit.is_zero(one)))
        {
            let [start, end] = one.span();
            let name = &drives[one.drive].name;
            if start < from + SAME_TIME_S && end > to - SAME_TIME_S && !brakes.drives.contains(name) {
                brakes.drives.push(name.clone());
            }
        }
    }
    found
}

/// Candidates of a drive.
fn find_candidates(
    drive: usize,
    model: &Model,
    raw: &SignalRecording,
    segments: &[RecordingSegment],
) -> Vec<SilenceCandidate> {
    let name = &model.derivation.mechanism.drives[drive].name;
    // Forces that follow from commands have no sensor, and may be at a limit or zero exactly.
    let is_computed = |data: &RecordingSegment| {
        (data.computed.iter()).any(|computed| computed.delays.iter().any(|delay| delay.drive == drive))
    };
    if segments.iter().any(is_computed) {
        return Vec::new();
    }
    // Filters change numbers: repetitions are searched in the recording as it was read.
    let repeats = match (raw.column(name), raw.column("t")) {
        (Ok(force), Ok(time)) => find_repeats(&IntactReadings::new(force, time, raw.lost_samples(name))),
        _ => return Vec::new(),
    };
    let flat: Vec<SilenceCandidate> = segments.iter().flat_map(|data| flat_intervals(drive, data)).collect();
    let noise = flat.iter().fold(0.0_f64, |most, one| most.max(one.noise));
    let others_have_noise = repeats.others_have_noise;
    let stuck = repeats.stuck.into_iter().map(|(interval, level)| SilenceCandidate {
        drive,
        intervals: vec![interval],
        reach: vec![interval],
        level,
        noise,
        evidence: SilenceEvidence::Repeated { others_have_noise },
    });
    let limits = repeats.limits.into_iter().map(|(level, intervals)| SilenceCandidate {
        drive,
        reach: intervals.clone(),
        intervals,
        level,
        noise,
        evidence: SilenceEvidence::Limit { others_have_noise },
    });
    let mut candidates: Vec<SilenceCandidate> = stuck.chain(limits).collect();
    // A force that is often constant has a dead band, a limit, or coarse steps.
    if flat.len() <= SILENCE_MOST_INTERVALS {
        let is_known = |one: &SilenceCandidate| {
            let [from, to] = one.span();
            candidates
                .iter()
                .any(|other| other.intervals.iter().any(|[start, end]| *start < to && *end > from))
        };
        let unknown: Vec<SilenceCandidate> = flat.into_iter().filter(|one| !is_known(one)).collect();
        candidates.extend(unknown);
    }
    candidates
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
                reach: vec![[1.0, 2.0]],
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
