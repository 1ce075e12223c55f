//! Recordings for a model: read with the column names given in the model file or by the user, prepared, and checked
//! before any result is computed.

mod choice;
mod columns;
mod contents;
mod faults;
pub(crate) mod free;
mod friction_rows;
mod held_out;
mod leverage;
mod options;
mod smoother;
mod stick;
mod thresholds;

use std::path::Path;
use std::sync::Arc;

use modelmill_boundary::files::MemoryFiles;
use modelmill_boundary::message;
use modelmill_boundary::text::{Message, OptionName, OptionSetting, Remedy};
use modelmill_identify::diagnose::Disturbance;
use modelmill_identify::{RecordingFiles, RecordingNote, SignalRecording as Raw};

use crate::audit;
use crate::error::{Error, Outcome};
use crate::host::kinds_of_files;
use crate::model::Model;
use crate::segment::{RecordingSegment, variances};

use columns::read_options;
use leverage::DriveLeverage;
use stick::StickPhases;

pub use contents::{ColumnInfo, RecordingContents, TableInfo};
pub use modelmill_identify::{DerivativeSource, MAX_FILTER_ORDER, has_recording_extension};
pub use modelmill_identify::{PreparedRun, SmoothingMethod, StatePreparation};
pub use options::{RecordingOptions, StandstillRule};

/// Reads a recording with the columns that a model needs, completes free bodies and repairs faults of sensors.
///
/// Fails when the file cannot be read or lacks columns.
fn read_raw(model: &Model, file: &RecordingFiles, reading: &RecordingOptions) -> Outcome<Raw> {
    let name = file.name();
    // Names of the file are needed to resolve the mapping.
    let options = read_options(model, reading, &file.names()?, name)?;
    let mut raw = model
        .host()
        .run_job(&format!("reading {name}"), 0, |_| file.read(&options))??;
    for note in free::complete(model, &mut raw)? {
        model.host().note(&note);
    }
    // Force peaks near singular poses are no outliers.
    let leverage = DriveLeverage::new(model, &raw);
    raw.repair(
        &model.active_coordinates(),
        &model.drives(),
        reading.skip_bad_samples,
        &|drive, sample| leverage.is_peak(drive, sample),
    );
    // Rates of the file are used by default, so they must belong to the same time as the positions.
    if reading.preparation.source == DerivativeSource::RecordedFirst && !reading.preparation.unexamined {
        raw.set_late_rates_aside(&model.active_coordinates());
    }
    Ok(raw)
}

/// The prepared segments of a recording. If the model has a delay of the force signal, each force gets the states of
/// the time at which it acted.
fn prepare_segments(model: &Model, raw: &Raw, reading: &RecordingOptions) -> Outcome<Vec<RecordingSegment>> {
    // The delay is a property of the model, not of the file.
    let delay = model.derivation.mechanism.force_delay;
    let mut data = prepare(model, raw, reading, delay)?;
    note_idle_options(&mut data, reading);
    for note in data.iter().flat_map(RecordingSegment::notes) {
        model.host().note(note);
    }
    Ok(data)
}

/// The prepared segments of a recording, without compensation of a delay.
pub(crate) fn read_as_recorded(
    model: &Model,
    path: &Path,
    reading: &RecordingOptions,
) -> Outcome<Vec<RecordingSegment>> {
    let file = RecordingFiles::open(model.host().files(), &[path])?;
    let raw = read_raw(model, &file, reading)?;
    let sticks = stick_phases(model, &[&raw], reading)?;
    let resolved = resolve_readings(model, &[&raw], reading, &sticks)?.pop();
    let (mut reading, note) = resolved.unwrap_or_else(|| (reading.clone(), None));
    if reading.preparation.chosen {
        // Decimation was chosen for fits; forces are wanted at every sample.
        reading.preparation.decimate = 1;
    }
    let reading = &reading;
    let mut data = prepare(model, &raw, reading, 0.0)?;
    if let (Some(note), Some(first)) = (note, data.first_mut()) {
        first.run.notes.push(note);
    }
    note_idle_options(&mut data, reading);
    for note in data.iter().flat_map(RecordingSegment::notes) {
        model.host().note(note);
    }
    Ok(data)
}

/// The stick phases of recordings of one machine, from states that are prepared with the options of the user; none in
/// recordings without forces, or if states cannot be prepared, which is reported where they are needed.
fn stick_phases(model: &Model, raws: &[&Raw], reading: &RecordingOptions) -> Outcome<StickPhases> {
    let drives = model.drives();
    if reading.preparation.unexamined || drives.is_empty() || model.base.is_empty() {
        return Ok(StickPhases::default());
    }
    let preparation = StatePreparation {
        unexamined: true,
        ..reading.preparation.clone()
    };
    model.host().run_job("finding where drives stick", 0, |_| {
        let runs = |raw: &&Raw| {
            let has_forces = drives.iter().all(|drive| raw.has_column(drive));
            let runs = has_forces.then(|| free::runs(model, raw, &preparation).ok());
            runs.flatten().unwrap_or_default()
        };
        let runs: Vec<Vec<PreparedRun>> = raws.iter().map(runs).collect();
        StickPhases::find(model, &runs, reading.standstill)
    })
}

/// The reading options of each recording with all open choices of the preparation made, each with a note on the choice
/// at the first recording that it concerns.
fn resolve_readings(
    model: &Model,
    raws: &[&Raw],
    reading: &RecordingOptions,
    sticks: &StickPhases,
) -> Outcome<Vec<(RecordingOptions, Option<RecordingNote>)>> {
    let files: Vec<&str> = raws.iter().map(|raw| raw.file()).collect();
    let says = format!("choosing how {} is smoothed", files.join(", "));
    let chosen = model
        .host()
        .run_job(&says, 0, |_| choice::choose_preparation(model, raws, reading, sticks))??;
    let mut all = vec![(reading.clone(), None); raws.len()];
    for choice in chosen {
        let mut note = Some(choice.note);
        for (index, reading) in choice.readings {
            all[index] = (reading, note.take());
        }
    }
    Ok(all)
}

/// Assigns to every force the states at the time at which it acted, by the model's delay, s.
fn compensate_delay(run: &mut PreparedRun, delay: f64) -> Outcome {
    if delay == 0.0 {
        return Ok(());
    }
    let ms = 1e3 * delay;
    let Some((start, end)) = run.shift_states_by_delay(delay) else {
        return Err(Error::input(format!(
            "{}: the model's `time_delay` of {ms} ms leaves fewer than four of {} samples with states; check T, \
             which is in seconds",
            run.file,
            run.time.len()
        )));
    };
    // A delay loses samples at the start, a lead at the end.
    let (side, lost) = if start > 0 { ("first", start) } else { ("last", end) };
    let lost = match lost {
        0 => String::new(),
        1 => format!("; the {side} sample has no states and is left out"),
        n => format!("; the {side} {n} samples have no states and are left out"),
    };
    run.notes.push(RecordingNote::info(format!(
        "Forces of {} are compared with the states {ms} ms before, by the model's `time_delay`{lost}.",
        run.file
    )));
    Ok(())
}

/// Prepares all segments of a recording: states, notes on suspicious signals, delay, variances and
/// disturbances.
fn prepare(model: &Model, recording: &Raw, args: &RecordingOptions, delay: f64) -> Outcome<Vec<RecordingSegment>> {
    let preparation = &args.preparation;
    // States are prepared for each segment between gaps.
    let mut runs = model
        .host()
        .run_job(&format!("preparing {}", recording.file()), 0, |_| {
            free::runs(model, recording, preparation)
        })??;
    let is_examined = !preparation.unexamined;
    // Notes on the recording are added to its first segment.
    if let Some(first) = runs.first_mut().filter(|_| is_examined) {
        let mut coordinates = model.active_coordinate_types();
        // Rates of free bodies are twists, no derivatives of the coordinates with their names.
        let free: Vec<&str> = free::free_bodies(&model.derivation.mechanism)
            .flat_map(|body| body.position.iter().chain(&body.quaternion))
            .map(|i| model.derivation.mechanism.coordinates[i.0].name.as_str())
            .collect();
        coordinates.retain(|(name, _)| !free.contains(&name.as_str()));
        let suspicions = recording.suspicious_columns(&coordinates, preparation.source);
        first.notes.splice(0..0, suspicions);
        let oddities = recording.signal_notes(&model.active_coordinate_types(), &model.drives());
        first.notes.splice(0..0, oddities);
    }
    // Remedies for angles in degrees are kept, in case the audit finds such angles.
    let coordinates = model.active_coordinate_types();
    let angles = coordinates.iter().filter(|(_, is_angle)| *is_angle);
    let maps_from_degrees: Vec<OptionSetting> = angles
        .flat_map(|(name, _)| recording.degree_conversion_options(name))
        .collect();
    for run in &mut runs {
        if is_examined {
            let idle = run.zero_force_notes(&model.drives(), &model.undriven_rows());
            run.notes.extend(idle);
        }
        compensate_delay(run, delay)?;
    }
    // Faults of positions count as disturbances of every segment.
    let faults: Vec<Disturbance> = if is_examined {
        (recording.position_faults(&model.active_coordinates()).into_iter())
            .map(|fault| faults::position_fault(model, recording.file(), &fault))
            .chain(faults::late_rates_fault(recording))
            .collect()
    } else {
        Vec::new()
    };
    let with_variance = runs.into_iter().map(|mut run| {
        let mut faults = faults.clone();
        if is_examined && let Some((fault, note)) = faults::dead_band_fault(model, &run) {
            run.notes.push(note);
            faults.push(fault);
        }
        let variance = variances::recorded_variances(recording, &run, &model.drives())?;
        Ok(RecordingSegment {
            run,
            variance,
            weights: None,
            load: None,
            maps_from_degrees: maps_from_degrees.clone(),
            faults,
        })
    });
    with_variance.collect()
}

/// Warns about filter options that have no effect because all derivatives are recorded.
fn note_idle_options(data: &mut [RecordingSegment], args: &RecordingOptions) {
    let usual = StatePreparation::default();
    // Only options that the user changed are named.
    let given: Vec<Message> = [
        args.preparation.cutoff_hz.map(|_| OptionName::CutoffHz),
        (args.preparation.order != usual.order).then_some(OptionName::Order),
    ]
    .into_iter()
    .flatten()
    .map(|name| Remedy::option(name).into())
    .collect();
    if given.is_empty() || data.iter().any(|one| one.run.prepared.cutoff_hz.is_some()) {
        return;
    }
    if let Some(one) = data.first_mut() {
        let does = if given.len() == 1 { "does" } else { "do" };
        one.run.notes.push(RecordingNote::warning(message!(
            "{} {does} nothing to {}: it has all rates and accelerations, so none are computed from positions; request \
             that with {}.",
            Message::join(given, " and "),
            one.run.file,
            Remedy::option(OptionName::Source).with_value("positions")
        )));
    }
}

/// Adds warnings about recordings that are given twice, as the same file or as a copy. A recording that is twice in the
/// fit (`data`) has double weight. One that is in both fit and validation (`check`) gives no independent validation.
pub fn note_duplicates(model: &Model, data: &mut [RecordingSegment], check: &mut [RecordingSegment]) {
    // A recording is compared with all earlier ones.
    for k in 1..data.len() {
        let (before, rest) = data.split_at_mut(k);
        if let Some(twin) = before.iter().find(|other| other.has_same_samples(&rest[0])) {
            let says = format!(
                "{} and {} are the same recording: it has double weight, and standard deviations become too small; give it once.",
                twin.run.file, rest[0].run.file
            );
            rest[0].note(model, RecordingNote::warning(says));
        }
    }
    for one in check {
        if let Some(twin) = data.iter().find(|other| other.has_same_samples(one)) {
            let says = format!(
                "{} is used for the fit and {} for validation, but they are the same recording: such a validation proves nothing; \
                 validate with another motion.",
                twin.run.file, one.run.file
            );
            one.note(model, RecordingNote::warning(says));
        }
    }
}

/// A recording that was read and prepared for a model.
#[derive(Clone)]
pub struct PreparedRecording {
    /// The parts of the recording without gaps in time, each with its states and forces. There is one if the recording
    /// has no gaps.
    pub segments: Vec<RecordingSegment>,
    /// The recording before preparation.
    raw: Arc<Raw>,
    /// The options with which it was prepared, including automatic choices.
    reading: RecordingOptions,
    /// Intervals in which drives stick.
    sticks: RecordingSticks,
}

/// The stick phases of one of several recordings.
#[derive(Clone, Default)]
struct RecordingSticks {
    /// Those of all recordings.
    all: Arc<StickPhases>,
    /// Index of this recording.
    index: usize,
}

impl Model {
    /// Reads a recording (CSV, Parquet, MATLAB, HDF5, MCAP, rosbag2), computes positions, rates and accelerations from
    /// it (filtered, differentiated and decimated as needed), and checks it. Its notes list these steps and all
    /// suspicious signals.
    ///
    /// Fails when a column is missing or contains no numbers, or when time does not increase. The error states the
    /// place and the remedy.
    ///
    /// ```no_run
    /// use modelmill::Model;
    /// use modelmill::recording::RecordingOptions;
    ///
    /// let model = Model::open("arm.toml")?;
    /// // The recording calls the first joint `pos1`, in degrees.
    /// let options = RecordingOptions {
    ///     columns: vec![("q1".to_owned(), "pos1 [deg]".to_owned())],
    ///     ..RecordingOptions::default()
    /// };
    /// let run = model.recording("run.csv", &options)?;
    /// // `says` is the text of a note. It can recommend options; `in_library_words` writes their names as in Rust.
    /// for note in run.notes() {
    ///     println!("{}", note.says.in_library_words());
    /// }
    /// # Ok::<(), modelmill::Error>(())
    /// ```
    pub fn recording(&self, path: impl AsRef<Path>, reading: &RecordingOptions) -> Outcome<PreparedRecording> {
        self.recording_of(&[path.as_ref()], reading)
    }

    /// As [`Model::recording`], for one recording that consists of several files. Their columns are joined on time: the
    /// file with the lowest sampling rate determines the sample times, and the others are interpolated to them.
    pub fn recording_of(&self, paths: &[&Path], reading: &RecordingOptions) -> Outcome<PreparedRecording> {
        PreparedRecording::new(self, self.read_raw_files(paths, reading)?, reading)
    }

    /// As [`Model::recording_of`], for several recordings of one machine, such as those of a fit and of its validation.
    /// Cut-off, smoothing and decimation are chosen for all of them together, and drives stick at the same rate in all.
    ///
    /// Each recording has its own result, since some of them may be unreadable.
    pub fn prepare_recordings(
        &self,
        runs: &[Vec<&Path>],
        reading: &RecordingOptions,
    ) -> Vec<Outcome<PreparedRecording>> {
        // All files are read first, since each of them matters for the choice.
        let mut raws = Vec::new();
        let mut results: Vec<Option<Error>> = Vec::new();
        for paths in runs {
            match self.read_raw_files(paths, reading) {
                Ok(raw) => {
                    raws.push(raw);
                    results.push(None);
                }
                Err(error) => results.push(Some(error)),
            }
        }
        let mut prepared = PreparedRecording::new_together(self, raws, reading).into_iter();
        let next = |error: Option<Error>| match error {
            Some(error) => Some(Err(error)),
            None => prepared.next(),
        };
        results.into_iter().filter_map(next).collect()
    }

    /// Reads the files of one recording.
    fn read_raw_files(&self, paths: &[&Path], reading: &RecordingOptions) -> Outcome<Raw> {
        let opened = RecordingFiles::open(self.host().files(), paths);
        let read = opened
            .map_err(Error::from)
            .and_then(|file| read_raw(self, &file, reading));
        // A file of another kind, such as a model file, gets a message that names the kind.
        read.map_err(|failure| {
            let kinds = paths.iter().map(|path| (path, kinds_of_files::file_kind(self.host(), path)));
            let mut others = kinds.filter_map(|(path, kind)| Some((path.display(), kind?)));
            others.next().map_or(failure, |(path, kind)| {
                Error::input(format!(
                    "{path} is {kind}; a recording is expected (CSV, Parquet, MATLAB, HDF5, MCAP or rosbag2), with a column \
                     `t` and one for each coordinate and drive"
                ))
            })
        })
    }

    /// As [`Model::recording`], for named columns in memory, such as those of a data frame. NaN marks
    /// missing values. `name` is the name of the table in messages.
    ///
    /// Fails as [`Model::recording`] does, and when columns differ in length.
    pub fn recording_of_table(
        &self,
        name: &str,
        columns: Vec<(String, Vec<f64>)>,
        reading: &RecordingOptions,
    ) -> Outcome<PreparedRecording> {
        let raw = read_raw(self, &RecordingFiles::from_table(name, columns)?, reading)?;
        PreparedRecording::new(self, raw, reading)
    }

    /// As [`Model::recording`], for a file in memory, such as one downloaded from object storage. `name` is its name in
    /// messages, and its extension determines the format.
    ///
    /// Fails as [`Model::recording`] does.
    pub fn recording_of_bytes(
        &self,
        name: &str,
        bytes: Vec<u8>,
        reading: &RecordingOptions,
    ) -> Outcome<PreparedRecording> {
        let files = MemoryFiles::default().with_file(name, bytes);
        let file = RecordingFiles::open(&files, &[Path::new(name)])?;
        let raw = read_raw(self, &file, reading)?;
        PreparedRecording::new(self, raw, reading)
    }
}

impl PreparedRecording {
    /// Prepares a raw recording; unless it is `unexamined`, open choices are made and the audit runs.
    fn new(model: &Model, raw: Raw, reading: &RecordingOptions) -> Outcome<Self> {
        let file = raw.file().to_owned();
        let only = Self::new_together(model, vec![raw], reading).pop();
        only.unwrap_or_else(|| Err(Error::input(format!("{file} cannot be prepared"))))
    }

    /// Prepares recordings of one machine, with choices that are common to all of them.
    fn new_together(model: &Model, raws: Vec<Raw>, reading: &RecordingOptions) -> Vec<Outcome<Self>> {
        let all: Vec<&Raw> = raws.iter().collect();
        let chosen = if reading.preparation.unexamined {
            Ok((StickPhases::default(), vec![(reading.clone(), None); raws.len()]))
        } else {
            stick_phases(model, &all, reading).and_then(|sticks| {
                let readings = resolve_readings(model, &all, reading, &sticks)?;
                Ok((sticks, readings))
            })
        };
        match chosen {
            Ok((sticks, readings)) => {
                let sticks = Arc::new(sticks);
                let each = raws.into_iter().zip(readings).enumerate();
                each.map(|(index, (raw, (reading, note)))| {
                    let sticks = RecordingSticks {
                        all: sticks.clone(),
                        index,
                    };
                    Self::with_choices(model, raw, reading, note, sticks)
                })
                .collect()
            }
            // A fault of one recording belongs to it alone, so that each is prepared by itself.
            Err(error) if raws.len() < 2 => vec![Err(error)],
            Err(_) => raws.into_iter().map(|raw| Self::new(model, raw, reading)).collect(),
        }
    }

    /// Prepares a raw recording with all choices made.
    fn with_choices(
        model: &Model,
        raw: Raw,
        reading: RecordingOptions,
        note: Option<RecordingNote>,
        sticks: RecordingSticks,
    ) -> Outcome<Self> {
        let mut stretches = prepare_segments(model, &raw, &reading)?;
        if let (Some(note), Some(first)) = (note, stretches.first_mut()) {
            first.note(model, note);
        }
        if !reading.preparation.unexamined {
            audit::examine(model, &mut stretches, reading.leave_out_events);
            // Events are searched in all forces, so that a push during standstill is found.
            sticks.all.leave_out(model, sticks.index, &mut stretches);
        }
        Ok(Self {
            segments: stretches,
            raw: Arc::new(raw),
            reading,
            sticks,
        })
    }

    /// The same recording with other segments.
    pub(crate) fn with_segments(&self, stretches: Vec<RecordingSegment>) -> Self {
        Self {
            segments: stretches,
            raw: self.raw.clone(),
            reading: self.reading.clone(),
            sticks: self.sticks.clone(),
        }
    }

    /// Name of the file in messages.
    pub fn file(&self) -> &str {
        self.raw.file()
    }

    /// The values of a column as they were recorded, one for each sample, before any filter. `name` is its name in the
    /// model. `None` if there is no such column, or if it has values that are not finite.
    pub fn raw_column(&self, name: &str) -> Option<&[f64]> {
        self.raw.column(name).ok()
    }

    /// The notes of all segments.
    pub fn notes(&self) -> impl Iterator<Item = &RecordingNote> {
        self.segments.iter().flat_map(RecordingSegment::notes)
    }

    /// The segments without repair of sensor faults; `None` if nothing was repaired, or they cannot be prepared
    /// without.
    pub(crate) fn with_faults(&self, model: &Model) -> Option<Vec<RecordingSegment>> {
        let faulty = self.raw.restore_sensor_faults()?;
        let delay = model.derivation.mechanism.force_delay;
        let mut stretches = prepare(model, &faulty, &self.reading, delay).ok()?;
        self.sticks.all.mark(self.sticks.index, &mut stretches);
        // Weights of other exclusions are kept.
        for (faulty, sound) in stretches.iter_mut().zip(&self.segments) {
            if faulty.samples() == sound.samples() {
                faulty.weights.clone_from(&sound.weights);
            }
        }
        Some(stretches)
    }

    /// The segments prepared again for another model of the same machine, which may have another delay of the force
    /// signal.
    pub(crate) fn prepare_for(&self, model: &Model) -> Outcome<Vec<RecordingSegment>> {
        let mut stretches = prepare_segments(model, &self.raw, &self.reading)?;
        self.sticks.all.mark(self.sticks.index, &mut stretches);
        Ok(stretches)
    }
}

/// The segments of recordings for fit and validation, with notes on recordings that are given twice.
pub(crate) fn segments(
    model: &Model,
    fit: &[&PreparedRecording],
    check: &[&PreparedRecording],
) -> [Vec<RecordingSegment>; 2] {
    let [mut fit, mut check] =
        [fit, check].map(|all| all.iter().flat_map(|one| one.segments.clone()).collect::<Vec<_>>());
    note_duplicates(model, &mut fit, &mut check);
    [fit, check]
}
