//! Reading a recording for a model: columns by the names of the model file or of the user, free bodies completed, faults
//! of sensors repaired. The result is not yet prepared.

use std::path::Path;
use std::sync::Arc;

use modelmill_boundary::files::MemoryFiles;
use modelmill_identify::diagnose::Disturbance;
use modelmill_identify::{RecordingFiles, SignalRecording as Raw, StatePreparation};

use super::columns::read_options;
use super::free;
use super::leverage::DriveLeverage;
use super::options::RecordingOptions;
use super::{rate_limit, shared_drives, table_range};
use crate::error::{Error, Outcome};
use crate::host::kinds_of_files;
use crate::model::Model;
use crate::segment::computed_forces::ComputedForces;

/// A recording that was read for a model, with the options for its preparation.
/// [`Model::prepare_together`](crate::Model::prepare_together) prepares it with others.
#[derive(Clone)]
pub struct UnpreparedRecording {
    /// The signals of the recording.
    pub(super) raw: Arc<Raw>,
    /// The options as they were requested.
    pub(super) reading: RecordingOptions,
    /// Faults that were found before the preparation.
    pub(super) faults: Vec<Disturbance>,
    /// What the forces depend on if they were computed from signals.
    pub(super) computed: Option<Arc<ComputedForces>>,
}

impl UnpreparedRecording {
    /// A recording with the options for its preparation.
    pub(super) fn new(raw: Raw, reading: &RecordingOptions) -> Self {
        Self {
            raw: Arc::new(raw),
            reading: reading.clone(),
            faults: Vec::new(),
            computed: None,
        }
    }

    /// The signals of the recording.
    pub(crate) fn raw(&self) -> &Raw {
        &self.raw
    }

    /// The options as they were requested.
    pub(crate) fn options(&self) -> &RecordingOptions {
        &self.reading
    }

    /// The same recording with another preparation.
    pub(crate) fn with_preparation(&self, preparation: StatePreparation) -> Self {
        let mut other = self.clone();
        other.reading.preparation = preparation;
        other
    }

    /// The same recording with other signals.
    pub(crate) fn with_signals(&self, raw: Raw) -> Self {
        Self {
            raw: Arc::new(raw),
            ..self.clone()
        }
    }

    /// The same recording with forces that were computed from its signals, and with further faults.
    pub(crate) fn with_computed_forces(&self, raw: Raw, computed: ComputedForces, faults: Vec<Disturbance>) -> Self {
        Self {
            faults: [self.faults.clone(), faults].concat(),
            computed: Some(Arc::new(computed)),
            ..Self::new(raw, &self.reading)
        }
    }

    /// The same recording for another model with the same columns, such as one with servo equations.
    ///
    /// Fails when a quaternion is far from unit length, or when a twist is incomplete.
    pub(crate) fn for_model(&self, model: &Model, reading: &RecordingOptions) -> Outcome<Self> {
        let mut raw = (*self.raw).clone();
        free::complete(model, &mut raw)?;
        raw.unwrap_angles(&model.active_coordinate_types());
        Ok(Self::new(raw, reading))
    }

    /// Whether it may have its preparation in common with another recording: both are prepared with the same options.
    pub(super) fn has_same_preparation(&self, other: &Self) -> bool {
        let [own, others] = [self, other].map(|one| (&one.reading.preparation, one.reading.standstill));
        own == others
    }
}

impl Model {
    /// Reads the files of one recording without preparing it, for [`Model::prepare_together`]. The columns of several
    /// files are joined on time, as by [`Model::recording_of`].
    ///
    /// Fails as [`Model::recording`] does.
    pub fn read_recording(&self, paths: &[&Path], reading: &RecordingOptions) -> Outcome<UnpreparedRecording> {
        let opened = RecordingFiles::open(self.host().files(), paths);
        let read = opened
            .map_err(Error::from)
            .and_then(|file| read_raw(self, &file, reading));
        // A file of another kind, such as a model file, gets a message that names the kind.
        let raw = read.map_err(|failure| {
            let kinds = paths.iter().map(|path| (path, kinds_of_files::file_kind(self.host(), path)));
            let mut others = kinds.filter_map(|(path, kind)| Some((path.display(), kind?)));
            others.next().map_or(failure, |(path, kind)| {
                Error::input(format!(
                    "{path} is {kind}; a recording is expected (CSV, Parquet, MATLAB, HDF5, MCAP or ROS bags), with a column \
                     `t` and one for each coordinate and drive"
                ))
            })
        })?;
        Ok(UnpreparedRecording::new(raw, reading))
    }

    /// As [`Model::read_recording`], for named columns in memory, as [`Model::recording_of_table`] takes them.
    pub fn read_recording_of_table(
        &self,
        name: &str,
        columns: Vec<(String, Vec<f64>)>,
        reading: &RecordingOptions,
    ) -> Outcome<UnpreparedRecording> {
        let raw = read_raw(self, &RecordingFiles::from_table(name, columns)?, reading)?;
        Ok(UnpreparedRecording::new(raw, reading))
    }

    /// As [`Model::read_recording`], for a file in memory, as [`Model::recording_of_bytes`] takes it.
    pub(super) fn read_recording_of_bytes(
        &self,
        name: &str,
        bytes: Vec<u8>,
        reading: &RecordingOptions,
    ) -> Outcome<UnpreparedRecording> {
        let files = MemoryFiles::default().with_file(name, bytes);
        let file = RecordingFiles::open(&files, &[Path::new(name)])?;
        Ok(UnpreparedRecording::new(read_raw(self, &file, reading)?, reading))
    }
}

/// Reads a recording with the columns that a model needs, completes free bodies and repairs faults of sensors.
///
/// Fails when the file cannot be read or lacks columns.
pub(super) fn read_raw(model: &Model, file: &RecordingFiles, reading: &RecordingOptions) -> Outcome<Raw> {
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
    // These notes concern the result, so that they stay with the recording.
    for note in rate_limit::limit_commands(&model.derivation.mechanism, &mut raw) {
        raw.add_note(note);
    }
    if let Some(note) = shared_drives::add_projected_forces(model, &mut raw)? {
        raw.add_note(note);
    }
    for note in table_range::note_beyond_tables(&model.derivation.mechanism, &raw) {
        raw.add_note(note);
    }
    // Force peaks near singular poses are no outliers.
    let leverage = DriveLeverage::new(model, &raw);
    let coordinates = model.measured_coordinates();
    raw.repair(
        &coordinates,
        &model.row_names(),
        reading.skip_bad_samples,
        &|drive, sample| leverage.is_peak(drive, sample),
    );
    raw.set_late_rates_aside(&coordinates);
    Ok(raw)
}
