//! Recordings for a model: read with the column names given in the model file or by the user, prepared, and checked
//! before any result is computed.
//!
//! 1. `read`: columns, free bodies, repair of sensor faults.
//! 2. `common`, `choice`, `stick`: what recordings of one machine have in common.
//! 3. `states`: the prepared segments.
//! 4. `prepared`: faults and contacts; the result.

mod choice;
mod columns;
mod common;
mod contents;
pub(crate) mod free;
mod friction_rows;
mod held_out;
mod joint_columns;
mod leverage;
mod mapping;
mod options;
mod prepared;
mod proposal;
mod raised_cutoff;
mod rate_limit;
mod read;
mod sensor_faults;
mod shared_drives;
mod smoother;
mod smoother_trials;
mod states;
mod stick;
mod table_range;
mod thresholds;

use std::path::Path;

use modelmill_identify::RecordingNote;

use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::segment::RecordingSegment;

pub(crate) use states::read_as_recorded;

pub use contents::{ColumnInfo, RecordingContents, TableInfo};
pub use modelmill_identify::{DerivativeSource, MAX_FILTER_ORDER, has_recording_extension};
pub use modelmill_identify::{PreparedRun, SmoothingMethod, StatePreparation};
pub use options::{RecordingOptions, StandstillRule};
pub use prepared::PreparedRecording;
pub use proposal::{ColumnProposal, ProposedColumn};
pub use read::UnpreparedRecording;

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
        PreparedRecording::new(self, self.read_recording(paths, reading)?)
    }

    /// As [`Model::recording_of`], for several recordings of one machine: those of a fit, and those of its validation.
    /// Cut-off, smoothing and decimation are chosen from those of the fit together, and are the same for the validation.
    /// The rate below which a drive counts as sticking is the same in all recordings.
    ///
    /// Each recording has its own result, since some of them may be unreadable.
    pub fn prepare_recordings(
        &self,
        runs: [&[Vec<&Path>]; 2],
        reading: &RecordingOptions,
    ) -> [Vec<Outcome<PreparedRecording>>; 2] {
        let read = |paths: &Vec<&Path>| self.read_recording(paths, reading);
        self.prepare_together(runs.map(|runs| runs.iter().map(read).collect()))
    }

    /// As [`Model::prepare_recordings`], for recordings that were already read: those of a fit, and those of its
    /// validation. Recordings with the same options get the same cut-off, smoothing and decimation. A recording that
    /// could not be read keeps its error.
    pub fn prepare_together(
        &self,
        runs: [Vec<Outcome<UnpreparedRecording>>; 2],
    ) -> [Vec<Outcome<PreparedRecording>>; 2] {
        // All are needed at once, since each of the fit matters for the choice.
        let mut read = Vec::new();
        let [fit, check] = runs.map(|run| {
            let errors = run.into_iter().map(|one| one.map(|one| read.push(one)).err());
            errors.collect::<Vec<Option<Error>>>()
        });
        let fitted = fit.iter().filter(|error| error.is_none()).count();
        let mut prepared = PreparedRecording::new_together(self, &read, fitted).into_iter();
        [fit, check].map(|errors| {
            let next = |error: Option<Error>| match error {
                Some(error) => Some(Err(error)),
                None => prepared.next(),
            };
            errors.into_iter().filter_map(next).collect()
        })
    }

    /// As [`Model::recording`], for named columns in memory, such as those of a data frame. NaN marks
    /// missing values. `name` is only used in messages, as the name of the table.
    ///
    /// Fails as [`Model::recording`] does, and when columns differ in length.
    pub fn recording_of_table(
        &self,
        name: &str,
        columns: Vec<(String, Vec<f64>)>,
        reading: &RecordingOptions,
    ) -> Outcome<PreparedRecording> {
        PreparedRecording::new(self, self.read_recording_of_table(name, columns, reading)?)
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
        PreparedRecording::new(self, self.read_recording_of_bytes(name, bytes, reading)?)
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
