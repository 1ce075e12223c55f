//! Recordings for a model: read with the column names given in the model file or by the user, prepared, and checked
//! before any result is computed.

mod choice;
mod columns;
mod common;
mod contents;
pub(crate) mod free;
mod friction_rows;
mod held_out;
mod leverage;
mod options;
mod proposal;
mod raised_cutoff;
mod sensor_faults;
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

use crate::audit::{self, ForceDelayAudit};
use crate::error::{Error, Outcome};
use crate::faults::{
    ColumnOperation, FaultSubject, RecordingFaultKind, SilentInterval, SuspectedFault, find_fault, silent_intervals,
};
use crate::host::kinds_of_files;
use crate::model::Model;
use crate::progress::SilentProgress;
use crate::segment::{RecordingSegment, variances};

use columns::read_options;
use leverage::DriveLeverage;
use stick::StickPhases;
use thresholds::DELAY_LEAST_SHARE_OF_GAIN;

pub use contents::{ColumnInfo, RecordingContents, TableInfo};
pub use modelmill_identify::{DerivativeSource, MAX_FILTER_ORDER, has_recording_extension};
pub use modelmill_identify::{PreparedRun, SmoothingMethod, StatePreparation};
pub use options::{RecordingOptions, StandstillRule};
pub use proposal::{ColumnProposal, ProposedColumn};

/// Reads a recording with the columns that a model needs, completes free bodies and repairs faults of sensors.
///
/// Fails when the file cannot be read or lacks columns.
fn read_raw(model: &Model, file: &RecordingFiles, reading: &RecordingOptions) -> Outcome<Raw> {
    let name = file.name();
    // Names of the file are needed to resolve the mapping.
    let (options, notes) = read_options(model, reading, &file.names()?, name)?;
    for note in &notes {
        model.host().note(note);
    }
    let mut raw = model
        .host()
        .run_job(&format!("reading {name}"), 0, |_| file.read(&options))??;
    for note in free::complete(model, &mut raw)? {
        model.host().note(&note);
    }
    // Turns are added before anything is compared with its neighbours.
    raw.unwrap_angles(&model.active_coordinate_types());
    // Force peaks near singular poses are no outliers.
    let leverage = DriveLeverage::new(model, &raw);
    raw.repair(
        &model.active_coordinates(),
        &model.drives(),
        reading.skip_bad_samples,
        &|drive, sample| leverage.is_peak(drive, sample),
    );
    raw.set_late_rates_aside(&model.active_coordinates());
    Ok(raw)
}

/// The prepared segments of a recording. If the model has a delay of the force signal, each force gets the states of
/// the time at which it acted.
fn prepare_segments(model: &Model, raw: &Raw, reading: &RecordingOptions) -> Outcome<Vec<RecordingSegment>> {
    // The delay is a property of the model, not of the file.
    let delay = model.derivation.mechanism.force_delay;
    let mut data = prepare(model, raw, reading, delay)?;
    note_idle_options(&mut data, reading);
    emit_notes(model, &data);
    Ok(data)
}

/// Passes the notes of all segments to the listener.
fn emit_notes(model: &Model, data: &[RecordingSegment]) {
    for note in data.iter().flat_map(RecordingSegment::notes) {
        model.host().note(note);
    }
}

/// The prepared segments of a recording, without compensation of a delay.
pub(crate) fn read_as_recorded(
    model: &Model,
    path: &Path,
    reading: &RecordingOptions,
) -> Outcome<Vec<RecordingSegment>> {
    let file = RecordingFiles::open(model.host().files(), &[path])?;
    let raw = read_raw(model, &file, reading)?;
    let (_, mut readings) = common::choose(model, &[&raw], 1, reading)?;
    let resolved = readings.pop();
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
        let unwrapped = recording.unwrapped_angles().iter();
        let unwrapped = unwrapped.map(|angle| sensor_faults::wrapped_angle(recording.file(), angle));
        (recording.position_faults(&model.active_coordinates()).into_iter())
            .map(|fault| sensor_faults::position_fault(model, recording.file(), &fault))
            .chain(unwrapped)
            .chain(sensor_faults::late_rates_fault(recording))
            .collect()
    } else {
        Vec::new()
    };
    let with_variance = runs.into_iter().map(|run| {
        let variance = variances::recorded_variances(recording, &run, &model.drives())?;
        Ok(RecordingSegment {
            run,
            variance,
            weights: None,
            load: None,
            maps_from_degrees: maps_from_degrees.clone(),
            faults: faults.clone(),
        })
    });
    with_variance.collect()
}

/// A recording without the forces in some intervals.
fn without_intervals(raw: &Arc<Raw>, silent: &[SilentInterval]) -> Arc<Raw> {
    if silent.is_empty() {
        return raw.clone();
    }
    let mut raw = (**raw).clone();
    for one in silent {
        let [from, to] = one.reach;
        for drive in &one.drives {
            raw.leave_out_samples(drive, &|t| (from..=to).contains(&t));
        }
    }
    Arc::new(raw)
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
    /// The options as they were requested.
    requested: RecordingOptions,
    /// The suspected fault of the recording that explains it best.
    suspect: Option<SuspectedFault>,
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
    /// Reads a recording (CSV, Parquet, MATLAB, HDF5, MCAP, ROS bags), computes positions, rates and accelerations from
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

    /// As [`Model::recording_of`], for several recordings of one machine: those of a fit, and those of its validation.
    /// Cut-off, smoothing and decimation are chosen for those of the fit together, and are the same for the validation;
    /// drives stick below the same rate in all.
    ///
    /// Each recording has its own result, since some of them may be unreadable.
    pub fn prepare_recordings(
        &self,
        [fit, check]: [&[Vec<&Path>]; 2],
        reading: &RecordingOptions,
    ) -> [Vec<Outcome<PreparedRecording>>; 2] {
        // All files are read first, since each of them matters for the choice.
        let mut raws = Vec::new();
        let [fit, check] = [fit, check].map(|runs| {
            let mut errors: Vec<Option<Error>> = Vec::new();
            for paths in runs {
                match self.read_raw_files(paths, reading) {
                    Ok(raw) => {
                        raws.push(raw);
                        errors.push(None);
                    }
                    Err(error) => errors.push(Some(error)),
                }
            }
            errors
        });
        let fitted = fit.iter().filter(|error| error.is_none()).count();
        let mut prepared = PreparedRecording::new_together(self, raws, fitted, reading).into_iter();
        [fit, check].map(|errors| {
            let next = |error: Option<Error>| match error {
                Some(error) => Some(Err(error)),
                None => prepared.next(),
            };
            errors.into_iter().filter_map(next).collect()
        })
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
                    "{path} is {kind}; a recording is expected (CSV, Parquet, MATLAB, HDF5, MCAP or ROS bags), with a column \
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
        let only = Self::new_together(model, vec![raw], 1, reading).pop();
        only.unwrap_or_else(|| Err(Error::input(format!("{file} cannot be prepared"))))
    }

    /// As [`Self::new`], for recordings of one machine, with choices that are common to all of them. The first `fitted`
    /// of them belong to a fit.
    fn new_together(model: &Model, raws: Vec<Raw>, fitted: usize, reading: &RecordingOptions) -> Vec<Outcome<Self>> {
        let raws: Vec<Arc<Raw>> = raws.into_iter().map(Arc::new).collect();
        let mut prepared = Self::prepare_together(model, &raws, fitted, reading);
        if reading.preparation.unexamined {
            for one in prepared.iter().flatten() {
                emit_notes(model, &one.segments);
            }
            return prepared;
        }
        // Forces that were not measured would spoil the choice of the preparation and every fit.
        let silent: Vec<Vec<SilentInterval>> = (prepared.iter())
            .map(|one| {
                let segments = one.iter().flat_map(|one| &one.segments);
                segments.flat_map(|one| silent_intervals(model, one)).collect()
            })
            .collect();
        if silent.iter().any(|silent| !silent.is_empty()) {
            let without: Vec<Arc<Raw>> = (raws.iter().zip(&silent))
                .map(|(raw, silent)| without_intervals(raw, silent))
                .collect();
            prepared = Self::prepare_together(model, &without, fitted, reading);
        }
        for (one, silent) in prepared.iter_mut().zip(&silent) {
            let Ok(one) = one else { continue };
            if let Some(first) = one.segments.first_mut() {
                first.run.notes.extend(silent.iter().map(SilentInterval::note));
                first.faults.extend(silent.iter().map(SilentInterval::disturbance));
            }
            emit_notes(model, &one.segments);
            one.examine(model);
            // Events are searched in all forces, so that a push during standstill is found.
            one.sticks.all.leave_out(model, one.sticks.index, &mut one.segments);
        }
        prepared
    }

    /// Makes open choices for recordings of one machine and prepares them, without passing notes to the listener.
    fn prepare_together(
        model: &Model,
        raws: &[Arc<Raw>],
        fitted: usize,
        requested: &RecordingOptions,
    ) -> Vec<Outcome<Self>> {
        let all: Vec<&Raw> = raws.iter().map(Arc::as_ref).collect();
        match common::choose(model, &all, fitted, requested) {
            Ok((sticks, readings)) => {
                let sticks = Arc::new(sticks);
                let each = raws.iter().zip(readings).enumerate();
                each.map(|(index, (raw, choice))| {
                    let sticks = RecordingSticks {
                        all: sticks.clone(),
                        index,
                    };
                    Self::with_choices(model, raw, requested, choice, sticks)
                })
                .collect()
            }
            Err(error) if raws.len() < 2 => vec![Err(error)],
            Err(Error::Cancelled) => raws.iter().map(|_| Err(Error::Cancelled)).collect(),
            // A fault of one recording belongs to it alone, so that each is prepared by itself.
            Err(_) => {
                let each = raws.iter().map(std::slice::from_ref);
                each.flat_map(|raw| Self::prepare_together(model, raw, 1, requested))
                    .collect()
            }
        }
    }

    /// Prepares a recording with all choices made.
    fn with_choices(
        model: &Model,
        raw: &Arc<Raw>,
        requested: &RecordingOptions,
        (reading, note): (RecordingOptions, Option<RecordingNote>),
        sticks: RecordingSticks,
    ) -> Outcome<Self> {
        let delay = model.derivation.mechanism.force_delay;
        let mut segments = prepare(model, raw, &reading, delay)?;
        note_idle_options(&mut segments, &reading);
        if let (Some(note), Some(first)) = (note, segments.first_mut()) {
            first.run.notes.push(note);
        }
        Ok(Self {
            segments,
            raw: raw.clone(),
            reading,
            requested: requested.clone(),
            suspect: None,
            sticks,
        })
    }

    /// Looks for faults that make the numbers meaningless; without one also for delays, contacts and pushes.
    fn examine(&mut self, model: &Model) {
        let source = self.reading.preparation.source;
        let suspect = find_fault(&FaultSubject {
            model,
            raw: &self.raw,
            segments: &self.segments,
            uses_recorded_derivatives: source == DerivativeSource::RecordedFirst,
            has_mapping: !self.requested.columns.is_empty() || !model.derivation.mechanism.recording.columns.is_empty(),
        });
        let of_segment = |one: &RecordingSegment| ForceDelayAudit::from_segment(model, one);
        let delays: Vec<Option<ForceDelayAudit>> = self.segments.iter().map(of_segment).collect();
        // Forces that are delayed by a large part of a period resemble those of another drive, or of another sign.
        let delay_gain = delays
            .iter()
            .flatten()
            .map(ForceDelayAudit::log_gain)
            .fold(0.0, f64::max);
        self.suspect = suspect.filter(|fault| {
            let may_be_delay =
                [RecordingFaultKind::ExchangedColumns, RecordingFaultKind::WrongSign].contains(&fault.kind);
            !may_be_delay || delay_gain < DELAY_LEAST_SHARE_OF_GAIN * fault.fit_gain.max(1.0)
        });
        // Forces before a gear have a sign beside their factor, which the note on the gear states for each drive.
        if self
            .suspect
            .as_ref()
            .is_some_and(|fault| self.is_sign_of_gears(model, fault))
        {
            self.suspect = None;
        }
        if let (Some(fault), Some(first)) = (&self.suspect, self.segments.first_mut()) {
            first.note(model, RecordingNote::warning(fault.note_text()));
            first.faults.push(fault.disturbance());
            return;
        }
        for (one, delays) in self.segments.iter_mut().zip(delays) {
            for note in audit::examine_forces(model, one, delays.as_ref()) {
                one.note(model, note);
            }
            audit::examine_events(model, one, self.reading.leave_out_events);
        }
    }

    /// The suspected fault of the recording that explains it best.
    pub fn suspected_fault(&self) -> Option<&SuspectedFault> {
        self.suspect.as_ref()
    }

    /// Whether a fault is a wrong sign of forces that are smaller than the nominal ones by a factor typical of a gear.
    fn is_sign_of_gears(&self, model: &Model, fault: &SuspectedFault) -> bool {
        let Some(first) = self
            .segments
            .first()
            .filter(|_| fault.kind == RecordingFaultKind::WrongSign)
        else {
            return false;
        };
        let (drives, factors) = (model.drives(), audit::gear_factors(model, first));
        let is_geared = |at: &String| {
            let mut pairs = drives.iter().zip(&factors);
            pairs.any(|(drive, factor)| drive == at && factor.is_some())
        };
        fault.at.iter().all(is_geared)
    }

    /// The recording as it would be after operations on its columns, prepared and examined again for a model. Its notes
    /// stay in it and are not passed to the listener.
    ///
    /// Fails if it cannot be prepared then.
    pub(crate) fn corrected(&self, model: &Model, operations: &[ColumnOperation]) -> Outcome<Self> {
        let mut raw = (*self.raw).clone();
        for operation in operations {
            operation.apply(&mut raw);
        }
        let silent = model.host().clone().with_progress(Arc::new(SilentProgress));
        Self::new(&model.clone().with_host(&silent), raw, &self.requested)
    }

    /// The same recording with other segments.
    pub(crate) fn with_segments(&self, stretches: Vec<RecordingSegment>) -> Self {
        Self {
            segments: stretches,
            raw: self.raw.clone(),
            reading: self.reading.clone(),
            requested: self.requested.clone(),
            suspect: self.suspect.clone(),
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

    /// Where its rates and accelerations were taken from.
    pub(crate) fn derivative_source(&self) -> DerivativeSource {
        self.reading.preparation.source
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
