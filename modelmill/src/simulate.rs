//! `simulate`: drives a rig along a trajectory and records the readings of its sensors.

use std::path::Path;

use modelmill_boundary::files::PathKind;
use modelmill_boundary::message;
use modelmill_boundary::text::{CommandName, Remedy};
use modelmill_identify::{ReadOptions, RecordingFile, SignalRecording};
pub use modelmill_rig::LoadedRig;
use modelmill_rig::{CoordinateSamples, Rig, RigRecording, SimulationError, Trajectory, TrajectoryError};

use crate::error::{Error, Outcome};
use crate::host::Host;
use crate::text::csv::csv;

/// A simulated run of a rig.
pub struct RigSimulation {
    /// The rig's name.
    pub rig: String,
    /// Names of its drives.
    pub drives: Vec<String>,
    /// Readings of its sensors: columns with their names, all of one length.
    pub run: RigRecording,
    /// Seed of the noise.
    pub seed: u64,
    /// Notes on the trajectory and the run.
    pub notes: Vec<String>,
}

impl RigSimulation {
    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.run.columns.first().map_or(0, |(_, time)| time.len())
    }

    /// The run as a recording (CSV).
    pub fn csv(&self) -> String {
        let columns = self.run.columns.iter();
        let columns = columns.map(|(name, values)| (name.as_str(), values.as_slice()));
        csv(&columns.collect::<Vec<_>>())
    }
}

impl Host {
    /// Reads a rig file.
    ///
    /// Fails with all errors and warnings of the file, each with its place.
    ///
    /// ```
    /// use std::path::Path;
    /// use modelmill::Host;
    ///
    /// let rig = Host::new().rig(Path::new("../model-spec/rigs/spidermill-full.toml"))?.rig;
    /// assert!(!rig.drives.is_empty());
    /// # Ok::<(), modelmill::Error>(())
    /// ```
    pub fn rig(&self, path: &Path) -> Outcome<modelmill_rig::LoadedRig> {
        if self.files().kind(path) == PathKind::Folder {
            return Err(Error::input(format!(
                "{} is a folder; a rig file (TOML) is expected, such as those in model-spec/rigs",
                path.display()
            )));
        }
        // A model file in place of a rig file is a common mistake and gets its own message.
        modelmill_rig::load_file_with(path, self.files()).map_err(|failure| {
            if self.load(path).is_ok() {
                return Error::input(message!(
                    "{} is a model file; a rig file is expected, which describes the whole machine (docs/guide/src/rigs.md; \
                     model-spec/rigs holds some). Forces of a model along a motion come from {}",
                    path.display(),
                    Remedy::command(CommandName::Evaluate)
                ));
            }
            failure.into()
        })
    }

    /// Drives a rig along a trajectory, which is a recording of its coordinates, and records the readings of its
    /// sensors. `columns` are pairs: the name of a coordinate of the rig, and the trajectory's column. `seed` is the
    /// seed of the noise; `None` uses the seed of the rig file.
    ///
    /// Fails when the trajectory lacks a coordinate, or the rig cannot follow it.
    pub fn simulate(
        &self,
        path: &Path,
        trajectory: &Path,
        columns: &[(String, String)],
        seed: Option<u64>,
    ) -> Outcome<RigSimulation> {
        let rig = self.rig(path)?.rig;
        let file = RecordingFile::open(self.files(), trajectory)?;
        let recording = file.read(&ReadOptions {
            renames: columns.to_vec(),
            ..ReadOptions::default()
        })?;
        let mut notes = Vec::new();
        let trajectory = self::trajectory(&rig, &recording, &mut notes)?;
        // The number of instants is the total of the progress.
        let steps = modelmill_rig::n_instants(&rig, &trajectory);
        let run = self
            .run_job(&format!("simulating {}", rig.name), steps, |job| {
                modelmill_rig::simulate(&rig, &trajectory, seed, || job.add(1))
            })?
            .map_err(|error| refusal(&rig, path, &recording, &trajectory, &error))?;
        notes.extend(run.notes.iter().cloned());
        Ok(RigSimulation {
            drives: rig.drives.iter().map(|drive| drive.name.clone()).collect(),
            seed: seed.unwrap_or(rig.seed),
            rig: rig.name,
            run,
            notes,
        })
    }
}

/// The trajectory of a recording: column `t` and, for each coordinate, its positions and those derivatives that are
/// recorded.
///
/// Fails when a column is missing or times do not increase; the message has the line of the file.
fn trajectory(rig: &Rig, recording: &SignalRecording, notes: &mut Vec<String>) -> Outcome<Trajectory> {
    let given = |name: String| -> Outcome<Option<Vec<f64>>> {
        if recording.has_column(&name) {
            Ok(Some(recording.column(&name)?.to_vec()))
        } else {
            Ok(None)
        }
    };
    // Missing derivatives are computed later by differences, which a note states.
    let mut samples = Vec::new();
    let mut found = Vec::new();
    for coordinate in &rig.coordinates {
        let name = &coordinate.name;
        let one = CoordinateSamples {
            q: recording.column(name)?.to_vec(),
            qd: given(format!("{name}_d"))?,
            qdd: given(format!("{name}_dd"))?,
        };
        if one.qd.is_none() || one.qdd.is_none() {
            found.push(name.as_str());
        }
        samples.push(one);
    }
    if !found.is_empty() {
        notes.push(format!(
            "derivatives of {} are differences over five samples: noise and rounding of the positions appear in \
             the forces; add the columns with _d and _dd if they are known",
            found.join(", ")
        ));
    }
    let names: Vec<&str> = rig.coordinates.iter().map(|c| c.name.as_str()).collect();
    // Faults of the trajectory are reported with their line or column in the file.
    Trajectory::new(recording.column("t")?.to_vec(), samples).map_err(|error| {
        let file = recording.file();
        Error::input(match &error {
            TrajectoryError::TimeGoesBack { sample } => {
                format!(
                    "{file}, line {}, column `t`: {error}",
                    recording.line(*sample).unwrap_or(0)
                )
            }
            TrajectoryError::Faulty { coordinate } => {
                format!("{file}, column `{}`: {error}", names.get(*coordinate).unwrap_or(&""))
            }
            TrajectoryError::Empty | TrajectoryError::TooShort => format!("{file}: {error}"),
        })
    })
}

/// The error of a run that failed, with the line of the trajectory at which the rig could not follow.
fn refusal(
    rig: &Rig,
    path: &Path,
    recording: &SignalRecording,
    trajectory: &Trajectory,
    error: &SimulationError,
) -> Error {
    let (SimulationError::Pose { time, .. }
    | SimulationError::NotFinite {
        time, largest: None, ..
    }) = error
    else {
        return Error::input(format!("{}: {error}", path.display()));
    };
    // The last sample before the failure is the one to check.
    let after = trajectory.time().partition_point(|t| t <= time);
    let line = recording.line(after.saturating_sub(1)).unwrap_or(0);
    let state = trajectory.state_at(*time);
    let pose: Vec<String> = rig
        .coordinates
        .iter()
        .zip(&state.q)
        .map(|(coordinate, q)| format!("{} = {q:.6}", coordinate.name))
        .collect();
    Error::input(format!(
        "{}, line {line} ({}): {error}; check units (rad, m) and signs, and which column is which coordinate",
        recording.file(),
        pose.join(", ")
    ))
}
