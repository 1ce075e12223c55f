//! From a recording to states: times, coordinates with their derivatives, and drive forces.
//!
//! Derivatives that the file lacks are prepared by [`crate::motion::derivatives`]; every choice that is
//! made on the way is written into the notes.

use std::fmt::Write as _;

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, Remedy};

use crate::motion::band;
use crate::motion::even;
use crate::motion::options::{DerivativeSource, SmoothingMethod, StatePreparation};
use crate::motion::periods::RunRepeatability;
use crate::motion::prepare::find_motion_series;
use crate::motion::prepared_as::PreparationRecord;
use crate::motion::smooth::RecordedCoordinate;
use crate::recording::{
    GAP, NoteSeverity, RecordingError, RecordingFault, RecordingNote, SignalRecording,
    sample_place_word,
};
use crate::signal::median;
use crate::words::{backquoted_list, count_of};

/// A gap of this part of a period of the highest frequency at which forces follow a motion is bridged by the spline.
const BRIDGED_GAP_PART: f64 = 0.5;
/// In a step so many times as long as the usual one samples lack.
const MISSING_SAMPLE_STEP: f64 = 1.5;
/// One step in so many is less than half as long as the usual one where times jitter.
const JITTERS: usize = 100;

/// States along a run, ready for the regressor. All columns have the length of `time`.
#[derive(Debug, Clone, PartialEq)]
pub struct PreparedRun {
    /// What messages call the recording.
    pub file: String,
    /// Times, s.
    pub time: Vec<f64>,
    /// `q[coordinate][sample]`, rad or m.
    pub q: Vec<Vec<f64>>,
    /// `qd[coordinate][sample]`, rad/s or m/s.
    pub qd: Vec<Vec<f64>>,
    /// `qdd[coordinate][sample]`, rad/s^2 or m/s^2.
    pub qdd: Vec<Vec<f64>>,
    /// `force[drive][sample]`, N or N m, in the order of the drives that were asked for; `None`
    /// when the file lacks the force of any drive. See [`Run::measured`].
    pub force: Option<Vec<Vec<f64>>>,
    /// Drives whose force the file lacks.
    pub missing_force: Vec<String>,
    /// `left_out[drive][sample]`: forces that were not measured there, or are told apart as faults of a sensor; what stands
    /// in their place joins their neighbours. Empty if every force counts.
    pub left_out: Vec<Vec<bool>>,
    /// Line in the file for each sample.
    pub lines: Vec<u64>,
    /// How well the run repeats itself, if its motion is periodic and the forces are known.
    pub repeatability: Option<RunRepeatability>,
    /// What was done to the recording.
    pub prepared: PreparationRecord,
    /// What the user should know, the recording's own notes included.
    pub notes: Vec<RecordingNote>,
}

impl SignalRecording {
    /// States of the given coordinates and forces of the given drives, with the default
    /// [`Preparation`]: columns `t`, `NAME`, `NAME_d`, `NAME_dd` and the drive's name.
    pub fn states(
        &self,
        coordinates: &[String],
        drives: &[String],
    ) -> Result<PreparedRun, RecordingError> {
        self.states_with(coordinates, drives, &StatePreparation::default())
    }

    /// [`Recording::states_with`] for each stretch between gaps in time, so that no filter and no difference reaches
    /// across a gap. Stretches that are too short to be prepared are left out, which the notes say; where nothing is
    /// to be filtered the recording stays whole.
    pub fn runs_with(
        &self,
        coordinates: &[String],
        drives: &[String],
        preparation: &StatePreparation,
    ) -> Result<Vec<PreparedRun>, RecordingError> {
        // What is wrong with the whole is said of the whole, before it is cut.
        let wanted = expected_column_names(coordinates, drives);
        let needed: Vec<String> = std::iter::once("t".to_owned())
            .chain(coordinates.iter().cloned())
            .collect();
        self.check_columns(&needed, &wanted)?;
        self.check_time(
            self.column_without_suggesting("t", &wanted)?,
            &mut Vec::new(),
        )?;
        let columns: Result<Vec<RecordedCoordinate<'_>>, _> = coordinates
            .iter()
            .map(|name| self.recorded_coordinate(name, preparation.source, &wanted))
            .collect();
        let columns = columns?;
        let is_filtered = preparation.decimate > 1 || columns.iter().any(|c| !c.is_complete());
        let time = self.column("t")?;
        let stretches = if is_filtered && !even::is_even(time) {
            let positions = columns.iter().map(|c| c.q);
            let bridged = band::motion_band(time, positions).map(|band| BRIDGED_GAP_PART / band);
            self.split_at_gaps(bridged.unwrap_or(0.0))
        } else {
            Vec::new()
        };
        // A series is fitted on the true times, so gaps do it no harm; only decimation would reach across them.
        let is_whole = stretches.len() < 2
            || preparation.decimate <= 1
                && find_motion_series(self.column("t")?, &columns, preparation).is_some();
        if is_whole {
            return Ok(vec![self.states_with(coordinates, drives, preparation)?]);
        }
        let preparation = &StatePreparation {
            smoothing: match preparation.smoothing {
                SmoothingMethod::Automatic => SmoothingMethod::Butterworth,
                chosen => chosen,
            },
            ..preparation.clone()
        };
        let longest = (0..stretches.len()).max_by_key(|i| stretches[*i].samples());
        let longest = longest.unwrap_or(0);
        let first = stretches[longest].states_with(coordinates, drives, preparation)?;
        // One cut-off for all: that which suits the longest.
        let preparation = StatePreparation {
            cutoff_hz: preparation.cutoff_hz.or(first.prepared.cutoff_hz),
            ..preparation.clone()
        };
        let mut runs = Vec::new();
        let (mut short, mut left_out) = (0, 0);
        for (i, stretch) in stretches.iter().enumerate() {
            let run = if i == longest {
                Ok(first.clone())
            } else {
                stretch.states_with(coordinates, drives, &preparation)
            };
            match run {
                Ok(run) => runs.push(run),
                Err(error)
                    if matches!(
                        error.fault,
                        RecordingFault::TooFewSamples { .. } | RecordingFault::CutoffTooLow { .. }
                    ) =>
                {
                    short += 1;
                    left_out += stretch.samples();
                }
                Err(error) => return Err(error),
            }
        }
        let mut notes = self.notes().to_vec();
        let breaks = stretches[..stretches.len() - 1].iter();
        let places = breaks.filter_map(|stretch| stretch.line(stretch.samples() - 1));
        let mut says = format!(
            "{} has {} in time of more than {GAP} usual steps that {} too long for this motion to be bridged, the first after \
             line {}: the {} segments are filtered and differentiated separately.",
            self.file(),
            count_of(stretches.len() - 1, "gap", "gaps"),
            if stretches.len() == 2 { "is" } else { "are" },
            places.min().unwrap_or(0),
            stretches.len(),
        );
        if short > 0 {
            let _ = write!(
                says,
                " {} too short for that and left out, {} of {} samples.",
                if short == 1 {
                    "One is".to_owned()
                } else {
                    format!("{short} are")
                },
                left_out,
                self.samples()
            );
        }
        notes.push(RecordingNote::warning(says));
        for (i, run) in runs.iter_mut().enumerate() {
            if i > 0 {
                run.notes
                    .retain(|note| note.severity == NoteSeverity::Warning);
            }
        }
        if let Some(run) = runs.first_mut() {
            notes.append(&mut run.notes);
            run.notes = notes;
        }
        Ok(runs)
    }

    /// [`Recording::states`] with another preparation.
    ///
    /// Fails when a column is missing or unusable, when time does not increase, or when the
    /// recording is too short for the filter.
    /// Forces may be missing: `evaluate` needs none.
    pub fn states_with(
        &self,
        coordinates: &[String],
        drives: &[String],
        preparation: &StatePreparation,
    ) -> Result<PreparedRun, RecordingError> {
        let wanted = expected_column_names(coordinates, drives);
        let needed: Vec<String> = std::iter::once("t".to_owned())
            .chain(coordinates.iter().cloned())
            .collect();
        self.check_columns(&needed, &wanted)?;
        let time = self.column_without_suggesting("t", &wanted)?;
        let mut notes = self.notes().to_vec();
        self.check_time(time, &mut notes)?;
        let missing_force: Vec<String> = drives
            .iter()
            .filter(|drive| !self.has_column(drive))
            .cloned()
            .collect();
        let force = if missing_force.is_empty() {
            let columns: Result<Vec<Vec<f64>>, _> = drives
                .iter()
                .map(|drive| self.column(drive).map(<[f64]>::to_vec))
                .collect();
            Some(columns?)
        } else {
            notes.push(RecordingNote::info(format!(
                "{} has no column for the force of {}.",
                self.file(),
                backquoted_list(&missing_force)
            )));
            None
        };
        let columns: Result<Vec<RecordedCoordinate<'_>>, _> = coordinates
            .iter()
            .map(|name| self.recorded_coordinate(name, preparation.source, &wanted))
            .collect();
        let columns = columns?;
        let mut prepared = PreparationRecord {
            decimate: preparation.decimate,
            ..PreparationRecord::default()
        };
        let states = self.prepare_states(time, &columns, preparation, &mut prepared, &mut notes)?;
        prepared.band_hz = preparation
            .band_hz
            .or_else(|| band::motion_band(time, columns.iter().map(|c| c.q)));
        prepared.decimate_chosen = preparation.chosen;
        prepared.trimmed = preparation.trim.unwrap_or(prepared.trimmed);
        prepared.trim_asked_for = preparation.trim.is_some();
        let mut run = PreparedRun {
            file: self.file().to_owned(),
            time: time.to_vec(),
            q: Vec::new(),
            qd: Vec::new(),
            qdd: Vec::new(),
            force,
            missing_force,
            left_out: if drives
                .iter()
                .any(|drive| self.lost_samples(drive).is_some())
            {
                let lost = |drive: &String| {
                    let lost = self.lost_samples(drive).map(<[bool]>::to_vec);
                    lost.unwrap_or_else(|| vec![false; time.len()])
                };
                drives.iter().map(lost).collect()
            } else {
                Vec::new()
            },
            lines: (0..time.len()).map(|i| self.line(i).unwrap_or(0)).collect(),
            repeatability: None,
            prepared,
            notes,
        };
        if !preparation.unexamined {
            self.note_repeatability(&columns, drives, &mut run);
        }
        for [q, qd, qdd] in states {
            run.q.push(q);
            run.qd.push(qd);
            run.qdd.push(qdd);
        }
        self.trim_transients(&mut run)?;
        self.note_encoder_steps(&columns, &mut run);
        self.note_standstill(coordinates, &mut run);
        Ok(run)
    }

    fn recorded_coordinate(
        &self,
        name: &str,
        source: DerivativeSource,
        wanted: &[String],
    ) -> Result<RecordedCoordinate<'_>, RecordingError> {
        let optional = |suffix: &str| {
            let derivative = format!("{name}{suffix}");
            let wanted = source == DerivativeSource::RecordedFirst && self.has_column(&derivative);
            wanted.then(|| self.column(&derivative)).transpose()
        };
        Ok(RecordedCoordinate {
            name: name.to_owned(),
            q: self.column_without_suggesting(name, wanted)?,
            qd: optional("_d")?,
            qdd: optional("_dd")?,
        })
    }

    /// Time must increase; uneven steps and gaps are worth a note.
    fn check_time(
        &self,
        time: &[f64],
        notes: &mut Vec<RecordingNote>,
    ) -> Result<(), RecordingError> {
        if let Some(i) = time.windows(2).position(|w| w[1] <= w[0]) {
            let line = self.line(i + 1).unwrap_or(0);
            return Err(self.fault(RecordingFault::TimeNotIncreasing {
                line,
                previous: time[i],
                here: time[i + 1],
            }));
        }
        let steps: Vec<f64> = time.windows(2).map(|w| w[1] - w[0]).collect();
        if steps.is_empty() {
            return Ok(());
        }
        let median = median(steps.clone());
        let shortest = steps.iter().copied().fold(f64::INFINITY, f64::min);
        let longest = steps.iter().copied().fold(0.0, f64::max);
        if even::is_even(time) {
            return Ok(());
        }
        // Where times only jitter, short steps are many and as many as long ones, and none is longer than the shortest lets expect.
        let many = |is: &dyn Fn(f64) -> bool| steps.iter().filter(|step| is(**step)).count();
        let short = many(&|step| step < 0.5 * median);
        let jitters = 2 * short > many(&|step| step > MISSING_SAMPLE_STEP * median)
            && JITTERS * short > steps.len();
        let longer = if jitters {
            (1.05 * (2.0 * median - shortest)).max(MISSING_SAMPLE_STEP * median)
        } else {
            MISSING_SAMPLE_STEP * median
        };
        let gaps = many(&|step| step > longer);
        let how = "Before anything is filtered, positions are interpolated to even times by a spline, and states are \
                   interpolated back to the recorded times.";
        notes.push(if gaps > 0 {
            let lost = steps.iter().filter(|step| **step > longer);
            let lost = lost.map(|step| (step / median).round() - 1.0);
            let first = steps.iter().position(|step| *step > longer);
            RecordingNote::warning(format!(
                "{} has {} in time: steps up to {longest:.6} s where {median:.6} s is usual, {} samples too few, the first \
                 after {} {}. {how}",
                self.file(),
                count_of(gaps, "gap", "gaps"),
                lost.fold(0.0, |sum, n| sum + n.max(0.0)),
                sample_place_word(self.file()),
                self.line(first.unwrap_or(0)).unwrap_or(0)
            ))
        } else {
            RecordingNote::info(format!(
                "The steps of {} are uneven, from {shortest:.6} s to {longest:.6} s. {how}",
                self.file(),
            ))
        });
        Ok(())
    }

    fn trim_transients(&self, run: &mut PreparedRun) -> Result<(), RecordingError> {
        let (start, end) = run.prepared.trimmed;
        let have = run.time.len();
        let trim = Remedy::option(OptionName::Trim);
        if have < start.saturating_add(end).saturating_add(1) {
            return Err(self.fault(RecordingFault::TooFewSamples {
                have,
                need: start.saturating_add(end).saturating_add(1),
                purpose: if run.prepared.trim_asked_for {
                    message!("dropping as many at both ends as {} requests", trim)
                } else {
                    "dropping the filter's transients at both ends".into()
                },
            }));
        }
        if start + end == 0 {
            return Ok(());
        }
        let cut = |column: &mut Vec<f64>| {
            column.truncate(have - end);
            column.drain(..start);
        };
        cut(&mut run.time);
        run.lines.truncate(have - end);
        run.lines.drain(..start);
        for out in &mut run.left_out {
            out.truncate(have - end);
            out.drain(..start);
        }
        let forces = run.force.iter_mut().flatten();
        for column in run
            .q
            .iter_mut()
            .chain(&mut run.qd)
            .chain(&mut run.qdd)
            .chain(forces)
        {
            cut(column);
        }
        run.notes.push(RecordingNote::info(message!(
            "The first {start} and the last {end} of {have} samples of {} are dropped ({}).",
            self.file(),
            if run.prepared.trim_asked_for {
                message!("as requested by {}", trim)
            } else {
                "transients of the filter".into()
            }
        )));
        Ok(())
    }
}

impl PreparedRun {
    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.time.len()
    }

    /// The measured forces, `force[drive][sample]`; fails when the file lacks any of them.
    pub fn measured_forces(&self) -> Result<&[Vec<f64>], RecordingError> {
        self.force.as_deref().ok_or_else(|| RecordingError {
            file: self.file.clone(),
            fault: RecordingFault::MissingForce {
                drives: self.missing_force.clone(),
            },
        })
    }

    /// Whether the force of a drive was measured in a sample, so that it counts.
    pub fn is_force_measured(&self, drive: usize, sample: usize) -> bool {
        self.left_out.get(drive).is_none_or(|out| !out[sample])
    }

    /// The measured forces interleaved per sample, `[sample * n_drives + drive]`, as the rows of
    /// the regression are; fails when the file lacks any of them.
    pub fn measured_interleaved(&self) -> Result<Vec<f64>, RecordingError> {
        let force = self.measured_forces()?;
        Ok((0..self.samples())
            .flat_map(|sample| force.iter().map(move |channel| channel[sample]))
            .collect())
    }
}

/// All names that a model has for columns.
fn expected_column_names(coordinates: &[String], drives: &[String]) -> Vec<String> {
    let mut names = vec!["t".to_owned()];
    for name in coordinates {
        names.extend([name.clone(), format!("{name}_d"), format!("{name}_dd")]);
    }
    for drive in drives {
        names.extend([drive.clone(), format!("{drive}_var")]);
    }
    names
}
