//! From a recording to states: times, coordinates with their derivatives, and drive forces.
//!
//! Derivatives that the file lacks are prepared by [`crate::motion::prepare`]; the notes state every choice.

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
use crate::motion::thresholds::{
    BRIDGED_GAP_PART, JITTER_LONG_STEPS_PER_SHORT, JITTER_ONE_IN, JITTER_STEP_MARGIN, MISSING_SAMPLE_STEP, SHORT_STEP,
};
use crate::recording::{
    GAP_LEAST_STEPS, NoteSeverity, RecordingError, RecordingFault, RecordingNote, SignalRecording, sample_place_word,
};
use crate::signal::median;
use crate::words::{backquoted_list, count_of};

/// States along a run, ready for the regressor. All columns have the length of `time`.
#[derive(Debug, Clone, PartialEq)]
pub struct PreparedRun {
    /// Name of the recording in messages.
    pub file: String,
    /// Times, s.
    pub time: Vec<f64>,
    /// `q[coordinate][sample]`, rad or m.
    pub q: Vec<Vec<f64>>,
    /// `qd[coordinate][sample]`, rad/s or m/s.
    pub qd: Vec<Vec<f64>>,
    /// `qdd[coordinate][sample]`, rad/s^2 or m/s^2.
    pub qdd: Vec<Vec<f64>>,
    /// `force[drive][sample]`, N or N m, in the order of the requested drives; `None` if the file lacks the force of
    /// any drive. See [`Self::measured_forces`].
    pub force: Option<Vec<Vec<f64>>>,
    /// Drives whose force the file lacks.
    pub missing_force: Vec<String>,
    /// `left_out[drive][sample]`: forces that were not measured there, or that were identified as sensor faults.
    /// Their values are interpolated. Empty if every force counts.
    pub left_out: Vec<Vec<bool>>,
    /// Line in the file for each sample.
    pub lines: Vec<u64>,
    /// How well the run repeats, if its motion is periodic and the forces are known.
    pub repeatability: Option<RunRepeatability>,
    /// How the run was prepared.
    pub prepared: PreparationRecord,
    /// Notes for the user, including those of the recording.
    pub notes: Vec<RecordingNote>,
}

impl SignalRecording {
    /// States of the given coordinates and forces of the given drives with the default [`StatePreparation`]. The
    /// columns are `t`, `NAME`, `NAME_d`, `NAME_dd` and the name of the drive.
    pub fn states(&self, coordinates: &[String], drives: &[String]) -> Result<PreparedRun, RecordingError> {
        self.states_with(coordinates, drives, &StatePreparation::default())
    }

    /// [`Self::states_with`] for each segment between gaps in time, so that no filter and no difference extends
    /// across a gap. Segments that are too short are left out and reported. If nothing is filtered the recording is
    /// not split.
    pub fn runs_with(
        &self,
        coordinates: &[String],
        drives: &[String],
        preparation: &StatePreparation,
    ) -> Result<Vec<PreparedRun>, RecordingError> {
        // Faults of the complete recording are reported before it is split.
        let wanted = expected_column_names(coordinates, drives);
        let needed: Vec<String> = std::iter::once("t".to_owned())
            .chain(coordinates.iter().cloned())
            .collect();
        self.check_columns(&needed, &wanted)?;
        self.check_time(self.column_without_suggesting("t", &wanted)?, &mut Vec::new())?;
        let columns: Result<Vec<RecordedCoordinate<'_>>, _> = coordinates
            .iter()
            .map(|name| self.recorded_coordinate(name, preparation.source, &wanted))
            .collect();
        let columns = columns?;
        // Splitting is needed only if a filter would extend across a gap.
        let is_filtered = preparation.decimate > 1 || columns.iter().any(|c| !c.is_complete());
        let time = self.column("t")?;
        let segments = if is_filtered && !even::is_even(time) {
            let positions = columns.iter().map(|c| c.q);
            let bridged = band::motion_band(time, positions).map(|band| BRIDGED_GAP_PART / band);
            self.split_at_gaps(bridged.unwrap_or(0.0))
        } else {
            Vec::new()
        };
        // A series is fitted at the true times, so gaps do not matter; only decimation would extend across them.
        let is_whole = segments.len() < 2
            || preparation.decimate <= 1 && find_motion_series(self.column("t")?, &columns, preparation).is_some();
        if is_whole {
            return Ok(vec![self.states_with(coordinates, drives, preparation)?]);
        }
        // No series was found, so an automatic choice means the low-pass.
        let preparation = &StatePreparation {
            smoothing: match preparation.smoothing {
                SmoothingMethod::Automatic => SmoothingMethod::Butterworth,
                chosen => chosen,
            },
            ..preparation.clone()
        };
        // The longest segment decides about the cut-off.
        let longest = (0..segments.len()).max_by_key(|i| segments[*i].samples());
        let longest = longest.unwrap_or(0);
        let first = segments[longest].states_with(coordinates, drives, preparation)?;
        // All segments have the cut-off of the longest one.
        let preparation = StatePreparation {
            cutoff_hz: preparation.cutoff_hz.or(first.prepared.cutoff_hz),
            ..preparation.clone()
        };
        // Segments that are too short are counted, all other faults end the preparation.
        let mut runs = Vec::new();
        let (mut short, mut left_out) = (0, 0);
        for (i, segment) in segments.iter().enumerate() {
            let run = if i == longest {
                Ok(first.clone())
            } else {
                segment.states_with(coordinates, drives, &preparation)
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
                    left_out += segment.samples();
                }
                Err(error) => return Err(error),
            }
        }
        // The notes of the recording come first, then one on the gaps.
        let mut notes = self.notes().to_vec();
        let breaks = segments[..segments.len() - 1].iter();
        let places = breaks.filter_map(|segment| segment.line(segment.samples() - 1));
        let mut says = format!(
            "{} has {} in time of more than {GAP_LEAST_STEPS} usual steps that {} too long for this motion to be bridged, the first after \
             line {}: the {} segments are filtered and differentiated separately.",
            self.file(),
            count_of(segments.len() - 1, "gap", "gaps"),
            if segments.len() == 2 { "is" } else { "are" },
            places.min().unwrap_or(0),
            segments.len(),
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
        // Notes that all segments share are kept for the first one only.
        for (i, run) in runs.iter_mut().enumerate() {
            if i > 0 {
                run.notes.retain(|note| note.severity == NoteSeverity::Warning);
            }
        }
        if let Some(run) = runs.first_mut() {
            notes.append(&mut run.notes);
            run.notes = notes;
        }
        Ok(runs)
    }

    /// [`Self::states`] with another preparation.
    ///
    /// Fails when a column is missing or unusable, when time does not increase, or when the recording is too short
    /// for the filter. Forces may be missing, because not every use needs them.
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
        // Forces are complete or absent: with one missing force none is used.
        let missing_force: Vec<String> = drives.iter().filter(|drive| !self.has_column(drive)).cloned().collect();
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
        // Prepare the states, then record band, decimation and trimming.
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
        prepared.trim_requested = preparation.trim.is_some();
        // The run with all samples; it is trimmed at the end.
        let mut run = PreparedRun {
            file: self.file().to_owned(),
            time: time.to_vec(),
            q: Vec::new(),
            qd: Vec::new(),
            qdd: Vec::new(),
            force,
            missing_force,
            left_out: if drives.iter().any(|drive| self.lost_samples(drive).is_some()) {
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
        // Periods are found on the recorded positions before samples are dropped.
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

    /// The recorded columns of a coordinate: its position, and its derivatives if the source allows them.
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

    /// Fails unless time increases; uneven steps and gaps are reported.
    fn check_time(&self, time: &[f64], notes: &mut Vec<RecordingNote>) -> Result<(), RecordingError> {
        if let Some(i) = time.windows(2).position(|w| w[1] <= w[0]) {
            let line = self.line(i + 1).unwrap_or(0);
            return Err(self.fault(RecordingFault::TimeNotIncreasing {
                line,
                previous: time[i],
                here: time[i + 1],
            }));
        }
        // Statistics of the steps decide between even, jittering and missing samples.
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
        // With jitter there are as many short steps as long ones, and no step is longer than the shortest one
        // suggests.
        let many = |is: &dyn Fn(f64) -> bool| steps.iter().filter(|step| is(**step)).count();
        let short = many(&|step| step < SHORT_STEP * median);
        let jitters = JITTER_LONG_STEPS_PER_SHORT * short > many(&|step| step > MISSING_SAMPLE_STEP * median)
            && JITTER_ONE_IN * short > steps.len();
        let longer = if jitters {
            (JITTER_STEP_MARGIN * (2.0 * median - shortest)).max(MISSING_SAMPLE_STEP * median)
        } else {
            MISSING_SAMPLE_STEP * median
        };
        let gaps = many(&|step| step > longer);
        let how = "Before anything is filtered, positions are interpolated to even times by a spline, and states are \
                   interpolated back to the recorded times.";
        // The number of missing samples follows from the length of each gap.
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

    /// Drops the samples with transients at both ends; fails when no sample would remain.
    fn trim_transients(&self, run: &mut PreparedRun) -> Result<(), RecordingError> {
        let (start, end) = run.prepared.trimmed;
        let have = run.time.len();
        let trim = Remedy::option(OptionName::Trim);
        if have < start.saturating_add(end).saturating_add(1) {
            return Err(self.fault(RecordingFault::TooFewSamples {
                have,
                need: start.saturating_add(end).saturating_add(1),
                purpose: if run.prepared.trim_requested {
                    message!("dropping as many at both ends as {} requests", trim)
                } else {
                    "dropping the filter's transients at both ends".into()
                },
            }));
        }
        if start + end == 0 {
            return Ok(());
        }
        // All columns of the run lose the same samples.
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
        for column in run.q.iter_mut().chain(&mut run.qd).chain(&mut run.qdd).chain(forces) {
            cut(column);
        }
        run.notes.push(RecordingNote::info(message!(
            "The first {start} and the last {end} of {have} samples of {} are dropped ({}).",
            self.file(),
            if run.prepared.trim_requested {
                message!("as requested by {}", trim)
            } else {
                "transients of the filter".into()
            }
        )));
        Ok(())
    }
}

impl PreparedRun {
    /// A run with known states `[q, qd, qdd]`, which need no preparation.
    pub fn from_states(
        file: String,
        time: Vec<f64>,
        [q, qd, qdd]: [Vec<Vec<f64>>; 3],
        force: Option<Vec<Vec<f64>>>,
    ) -> Self {
        Self {
            file,
            q,
            qd,
            qdd,
            force,
            missing_force: Vec::new(),
            left_out: Vec::new(),
            lines: (0..time.len() as u64).collect(),
            time,
            repeatability: None,
            prepared: PreparationRecord::default(),
            notes: Vec::new(),
        }
    }

    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.time.len()
    }

    /// The measured forces, `force[drive][sample]`. Fails when the file lacks any of them.
    pub fn measured_forces(&self) -> Result<&[Vec<f64>], RecordingError> {
        self.force.as_deref().ok_or_else(|| RecordingError {
            file: self.file.clone(),
            fault: RecordingFault::MissingForce {
                drives: self.missing_force.clone(),
            },
        })
    }

    /// Whether the force of a drive was measured in a sample. If not, it does not count.
    pub fn is_force_measured(&self, drive: usize, sample: usize) -> bool {
        self.left_out.get(drive).is_none_or(|out| !out[sample])
    }

    /// The measured forces interleaved per sample, `[sample * n_drives + drive]`, in the order of the rows of the
    /// regression. Fails when the file lacks any of them.
    pub fn measured_interleaved(&self) -> Result<Vec<f64>, RecordingError> {
        let force = self.measured_forces()?;
        Ok((0..self.samples())
            .flat_map(|sample| force.iter().map(move |channel| channel[sample]))
            .collect())
    }
}

/// All names that the model has for columns: time, coordinates with derivatives, drives with variances.
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
