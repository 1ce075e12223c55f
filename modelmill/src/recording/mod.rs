//! Recordings of a model: read with the names that the model and the user give, prepared, and looked at before anything is
//! believed.

mod choice;
mod columns;
mod contents;
pub(crate) mod free;
mod leverage;
mod options;
mod smoother;

use std::path::Path;
use std::sync::Arc;

use modelmill_boundary::files::MemoryFiles;
use modelmill_boundary::message;
use modelmill_boundary::text::{Message, OptionName, OptionSetting, Remedy};
use modelmill_identify::diagnose::{Disturbance, EstimatedQuantity};
use modelmill_identify::{PositionFault, RecordingFiles, RecordingNote, SignalRecording as Raw};

use crate::audit;
use crate::error::{Error, Outcome};
use crate::host::kinds_of_files;
use crate::model::Model;
use crate::stretch::{RecordingSegment, variances};
use crate::text::table::significant;

use columns::read_options;
use leverage::DriveLeverage;

pub use contents::{ColumnInfo, RecordingContents, TableInfo};
pub use modelmill_identify::{DerivativeSource, MAX_FILTER_ORDER, has_recording_extension};
pub use modelmill_identify::{PreparedRun, SmoothingMethod, StatePreparation};
pub use options::RecordingOptions;

/// Reads a recording with the columns that a model needs.
fn read_raw(model: &Model, file: &RecordingFiles, reading: &RecordingOptions) -> Outcome<Raw> {
    let name = file.name();
    let options = read_options(model, reading, &file.names()?, name)?;
    let mut raw = model
        .host()
        .run_job(&format!("reading {name}"), 0, |_| file.read(&options))??;
    for note in free::complete(model, &mut raw)? {
        model.host().note(&note);
    }
    let leverage = DriveLeverage::new(model, &raw);
    raw.repair(
        &model.active_coordinates(),
        &model.drives(),
        reading.skip_bad_samples,
        &|drive, sample| leverage.is_peak(drive, sample),
    );
    Ok(raw)
}

/// The stretches of a recording; where the model says that forces are read late, each force has the states of the moment at
/// which it acted.
fn prepare_segments(
    model: &Model,
    raw: &Raw,
    reading: &RecordingOptions,
) -> Outcome<Vec<RecordingSegment>> {
    let delay = model.derivation.mechanism.force_delay;
    let mut data = prepare(model, raw, reading, delay)?;
    note_idle_options(&mut data, reading);
    for note in data.iter().flat_map(RecordingSegment::notes) {
        model.host().note(note);
    }
    Ok(data)
}

/// The stretches of a recording with states and forces as it has them side by side.
pub(crate) fn read_as_recorded(
    model: &Model,
    path: &Path,
    reading: &RecordingOptions,
) -> Outcome<Vec<RecordingSegment>> {
    let file = RecordingFiles::open(model.host().files(), &[path])?;
    let raw = read_raw(model, &file, reading)?;
    let (mut reading, note) = resolve_reading(model, &raw, reading)?;
    if reading.preparation.chosen {
        // Rows of a fit are of no interest here.
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

/// The reading with what it leaves open of the preparation chosen, and what was chosen.
fn resolve_reading(
    model: &Model,
    raw: &Raw,
    reading: &RecordingOptions,
) -> Outcome<(RecordingOptions, Option<RecordingNote>)> {
    let says = format!("choosing how {} is smoothed", raw.file());
    let chosen = model.host().run_job(&says, 0, |_| {
        choice::choose_preparation(model, raw, reading)
    })??;
    Ok(match chosen {
        Some((reading, note)) => (reading, Some(note)),
        None => (reading.clone(), None),
    })
}

/// Gives every force the states of the moment at which it acted, by the model's delay.
fn compensate_delay(run: &mut PreparedRun, delay: f64) -> Outcome {
    if delay == 0.0 {
        return Ok(());
    }
    let ms = 1e3 * delay;
    let Some((start, end)) = run.shift_states_by_delay(delay) else {
        return Err(Error::input(format!(
            "{}: the model's `time_delay` of {ms} ms leaves fewer than four of {} samples with states to go with; check T, \
             which is in seconds",
            run.file,
            run.time.len()
        )));
    };
    let (side, lost) = if start > 0 {
        ("first", start)
    } else {
        ("last", end)
    };
    let lost = match lost {
        0 => String::new(),
        1 => format!("; the {side} sample has no states to go with and is left out"),
        n => format!("; the {side} {n} samples have no states to go with and are left out"),
    };
    run.notes.push(RecordingNote::info(format!(
        "Forces of {} are held against the states of {ms} ms before, as the model's `time_delay` says{lost}.",
        run.file
    )));
    Ok(())
}

fn prepare(
    model: &Model,
    recording: &Raw,
    args: &RecordingOptions,
    delay: f64,
) -> Outcome<Vec<RecordingSegment>> {
    let preparation = &args.preparation;
    let mut runs =
        model
            .host()
            .run_job(&format!("preparing {}", recording.file()), 0, |_| {
                free::runs(model, recording, preparation)
            })??;
    let is_examined = !preparation.unexamined;
    if let Some(first) = runs.first_mut().filter(|_| is_examined) {
        let mut motions = model.motions();
        // Twists are no derivatives of the coordinates whose names they have.
        let free: Vec<&str> = free::free_bodies(&model.derivation.mechanism)
            .flat_map(|body| body.position.iter().chain(&body.quaternion))
            .map(|i| model.derivation.mechanism.coordinates[i.0].name.as_str())
            .collect();
        motions.retain(|(name, _)| !free.contains(&name.as_str()));
        let suspicions = recording.suspicious_columns(&motions, preparation.source);
        first.notes.splice(0..0, suspicions);
        let oddities = recording.signal_notes(&model.motions(), &model.drives());
        first.notes.splice(0..0, oddities);
    }
    let motions = model.motions();
    let angles = motions.iter().filter(|(_, is_angle)| *is_angle);
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
    let faults: Vec<Disturbance> = if is_examined {
        (recording
            .position_faults(&model.active_coordinates())
            .into_iter())
        .map(|fault| position_fault(model, recording.file(), &fault))
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

/// A fault of positions as a diagnosis tells it.
fn position_fault(model: &Model, file: &str, fault: &PositionFault) -> Disturbance {
    let (kind, at, name, value, unit, says) = match fault {
        PositionFault::Jitter { time } => (
            "time_jitter",
            "t",
            "jitter",
            *time,
            "s",
            format!(
                "the time stamps of {file} jitter: positions err in proportion to the rate, all coordinates by the same time, \
                 {} ms in the mean square",
                significant(1e3 * time, 2)
            ),
        ),
        PositionFault::Backlash { coordinate, width } => {
            let is_angle = |(name, is): &(String, bool)| name == coordinate && *is;
            let unit = if model.motions().iter().any(is_angle) {
                "rad"
            } else {
                "m"
            };
            (
                "backlash",
                coordinate.as_str(),
                "width",
                *width,
                unit,
                format!(
                    "backlash between the encoder of {coordinate} and its load: in {file} the reading jumps to and fro by {} {unit}",
                    significant(*width, 2)
                ),
            )
        }
    };
    Disturbance {
        kind: kind.to_owned(),
        at: vec![at.to_owned()],
        estimates: vec![EstimatedQuantity::new(name, value, unit)],
        recordings: vec![file.to_owned()],
        interval: None,
        description: Some(says),
    }
}

/// Says that options of the filter do nothing where all derivatives are recorded.
fn note_idle_options(data: &mut [RecordingSegment], args: &RecordingOptions) {
    let usual = StatePreparation::default();
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
            "{} {does} nothing to {}: it holds all rates and accelerations, so none are made from positions; ask for \
             that with {}.",
            Message::join(given, " and "),
            one.run.file,
            Remedy::option(OptionName::Source).with_value("positions")
        )));
    }
}

/// Warns of recordings that are given twice, also as copies: they count twice, or make a check that proves nothing.
pub fn note_duplicates(
    model: &Model,
    data: &mut [RecordingSegment],
    check: &mut [RecordingSegment],
) {
    for k in 1..data.len() {
        let (before, rest) = data.split_at_mut(k);
        if let Some(twin) = before.iter().find(|other| other.has_same_samples(&rest[0])) {
            let says = format!(
                "{} and {} are the same recording: it counts twice, and deviations come out too small; give it once.",
                twin.run.file, rest[0].run.file
            );
            rest[0].note(model, RecordingNote::warning(says));
        }
    }
    for one in check {
        if let Some(twin) = data.iter().find(|other| other.has_same_samples(one)) {
            let says = format!(
                "{} is used for the fit and {} for the check, but they are the same recording: such a check proves \
                 nothing; check on another motion.",
                twin.run.file, one.run.file
            );
            one.note(model, RecordingNote::warning(says));
        }
    }
}

/// A recording of a model: as it was read, and its stretches between gaps in time, prepared for the model.
#[derive(Clone)]
pub struct PreparedRecording {
    /// One stretch or, where the recording is cut at gaps in time, several.
    pub segments: Vec<RecordingSegment>,
    raw: Arc<Raw>,
    reading: RecordingOptions,
}

impl Model {
    /// Reads a recording (CSV, Parquet, MATLAB, HDF5, MCAP, rosbag2), prepares its states, and looks at it before anything is believed:
    /// what was done and what looks odd stands in the notes of its stretches.
    ///
    /// Fails with place and remedy when a column is missing or holds no number, or time stands still.
    pub fn recording(
        &self,
        path: impl AsRef<Path>,
        reading: &RecordingOptions,
    ) -> Outcome<PreparedRecording> {
        self.recording_of(&[path.as_ref()], reading)
    }

    /// As [`Model::recording`], of several files of one run, whose columns are joined on time: the slowest gives the
    /// samples, and the others are interpolated.
    pub fn recording_of(
        &self,
        paths: &[&Path],
        reading: &RecordingOptions,
    ) -> Outcome<PreparedRecording> {
        let opened = RecordingFiles::open(self.host().files(), paths);
        let read = opened
            .map_err(Error::from)
            .and_then(|file| read_raw(self, &file, reading));
        let raw = read.map_err(|failure| {
            let kinds = paths.iter().map(|path| (path, kinds_of_files::file_kind(self.host(), path)));
            let mut others = kinds.filter_map(|(path, kind)| Some((path.display(), kind?)));
            others.next().map_or(failure, |(path, kind)| {
                Error::input(format!(
                    "{path} is {kind}; a recording is expected (CSV, Parquet, MATLAB, HDF5, MCAP or rosbag2), with a column \
                     `t` and one for each coordinate and drive"
                ))
            })
        })?;
        PreparedRecording::new(self, raw, reading)
    }

    /// As [`Model::recording`], of columns that are in memory, such as those of a data frame, with their names; NaN stands
    /// for what is missing. `name` is what messages call them.
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

    /// As [`Model::recording`], of a file that is in memory, such as an object of a store. `name` is what messages call it, and its
    /// ending says what it is.
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
    fn new(model: &Model, raw: Raw, reading: &RecordingOptions) -> Outcome<Self> {
        let raw = Arc::new(raw);
        if reading.preparation.unexamined {
            return Ok(Self {
                segments: prepare_segments(model, &raw, reading)?,
                raw,
                reading: reading.clone(),
            });
        }
        let (reading, note) = resolve_reading(model, &raw, reading)?;
        let mut stretches = prepare_segments(model, &raw, &reading)?;
        if let (Some(note), Some(first)) = (note, stretches.first_mut()) {
            first.note(model, note);
        }
        audit::examine(model, &mut stretches, reading.leave_out_events);
        Ok(Self {
            segments: stretches,
            raw,
            reading,
        })
    }

    /// The same recording with other stretches.
    pub(crate) fn with_segments(&self, stretches: Vec<RecordingSegment>) -> Self {
        Self {
            segments: stretches,
            raw: self.raw.clone(),
            reading: self.reading.clone(),
        }
    }

    /// What messages call its file.
    pub fn file(&self) -> &str {
        self.raw.file()
    }

    /// The readings of a column by our name, one for each sample, as they were before anything was filtered; `None` where there
    /// is none that holds numbers alone.
    pub fn raw_column(&self, name: &str) -> Option<&[f64]> {
        self.raw.column(name).ok()
    }

    /// Remarks on all stretches.
    pub fn notes(&self) -> impl Iterator<Item = &RecordingNote> {
        self.segments.iter().flat_map(RecordingSegment::notes)
    }

    /// The stretches with the faults of its sensors left in; `None` where none were taken out, or they cannot be prepared then.
    pub(crate) fn with_faults(&self, model: &Model) -> Option<Vec<RecordingSegment>> {
        let faulty = self.raw.restore_sensor_faults()?;
        let delay = model.derivation.mechanism.force_delay;
        let mut stretches = prepare(model, &faulty, &self.reading, delay).ok()?;
        // What else was left out of them stays so.
        for (faulty, sound) in stretches.iter_mut().zip(&self.segments) {
            if faulty.samples() == sound.samples() {
                faulty.weights.clone_from(&sound.weights);
            }
        }
        Some(stretches)
    }

    /// The stretches prepared once more, for another model of the same machine, whose forces may act later.
    pub(crate) fn prepare_for(&self, model: &Model) -> Outcome<Vec<RecordingSegment>> {
        prepare_segments(model, &self.raw, &self.reading)
    }
}

/// The stretches of recordings for fit and check, with remarks on those that are given twice.
pub(crate) fn segments(
    model: &Model,
    fit: &[&PreparedRecording],
    check: &[&PreparedRecording],
) -> [Vec<RecordingSegment>; 2] {
    let [mut fit, mut check] = [fit, check].map(|all| {
        all.iter()
            .flat_map(|one| one.segments.clone())
            .collect::<Vec<_>>()
    });
    note_duplicates(model, &mut fit, &mut check);
    [fit, check]
}
