//! A segment of a recording without gaps in time, prepared for a model. States are visited block by block, and error
//! messages state the time and the line of the recording.

pub(crate) mod computed_forces;
pub(crate) mod picked_states;
pub(crate) mod simulated_actuator;
pub mod variances;

use std::sync::Arc;

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, OptionSetting, Remedy};
use modelmill_codegen::{MotionStates, PoseFault, PoseReason};
use modelmill_identify::decimate_time;
use modelmill_identify::diagnose::Disturbance;
use modelmill_identify::{PreparedRun, RecordingNote, sample_place_word};

use crate::error::{Error, Outcome};
use crate::model::Model;

use computed_forces::ComputedForces;

/// States that are evaluated at once: progress is reported after each block, and memory stays small.
pub const BLOCK: usize = 4096;

/// A segment of a recording, prepared for a model.
#[derive(Clone)]
pub struct RecordingSegment {
    /// States and forces, in SI units.
    pub run: PreparedRun,
    /// Variances of the forces, `[drive][sample]`, N^2 or (N m)^2, if the recording has the columns `DRIVE_var`.
    pub variance: Option<Vec<Vec<f64>>>,
    /// Weights of the equations in addition to the estimator's, interleaved per sample after decimation; `None` if
    /// all are equal.
    pub weights: Option<Vec<f64>>,
    /// Load of the drives, `[drive][sample]`, for effects that depend on it; `None` stands for the measured forces.
    pub load: Option<Vec<Vec<f64>>>,
    /// Remedy if the audit finds that angles are in degrees: the reading options that convert all angles to rad. Empty
    /// if the segment was not read from a file.
    pub maps_from_degrees: Vec<OptionSetting>,
    /// Disturbances that were found in the recording.
    pub faults: Vec<Disturbance>,
    /// What the forces depend on if they were computed from signals.
    pub(crate) computed: Option<Arc<ComputedForces>>,
}

impl From<PreparedRun> for RecordingSegment {
    /// A run without variances, with equal weights.
    fn from(run: PreparedRun) -> Self {
        Self {
            run,
            variance: None,
            weights: None,
            load: None,
            maps_from_degrees: Vec::new(),
            faults: Vec::new(),
            computed: None,
        }
    }
}

impl RecordingSegment {
    /// Number of samples before decimation.
    pub fn samples(&self) -> usize {
        self.run.samples()
    }

    /// Factor of decimation, at least 1.
    pub fn decimation(&self) -> usize {
        self.run.prepared.decimate.max(1)
    }

    /// The segment in pieces of at most `longest` decimated samples, each a segment of its own.
    pub(crate) fn pieces(&self, longest: usize) -> Vec<Self> {
        let every = self.decimation();
        let kept = self.samples().div_ceil(every);
        let n = kept.div_ceil(longest).max(1);
        let drives = self.run.force.as_ref().map_or(0, Vec::len);
        let piece = |k: usize| {
            // Pieces start at samples that decimation keeps, and differ by at most one decimated
            // sample.
            let [from, to] = [k, k + 1].map(|k| k * kept / n);
            let (start, end) = (every * from, (every * to).min(self.samples()));
            // Weights belong to decimated samples, all other columns to recorded ones.
            let cut = |all: &[Vec<f64>]| all.iter().map(|one| one[start..end].to_vec()).collect();
            let run = &self.run;
            Self {
                run: PreparedRun {
                    time: run.time[start..end].to_vec(),
                    q: cut(&run.q),
                    qd: cut(&run.qd),
                    qdd: cut(&run.qdd),
                    force: run.force.as_deref().map(cut),
                    left_out: (run.left_out.iter()).map(|one| one[start..end].to_vec()).collect(),
                    lines: run.lines.get(start..end).unwrap_or_default().to_vec(),
                    file: run.file.clone(),
                    missing_force: run.missing_force.clone(),
                    repeatability: run.repeatability.clone(),
                    prepared: run.prepared.clone(),
                    notes: Vec::new(),
                },
                variance: self.variance.as_deref().map(cut),
                weights: (self.weights.as_ref()).map(|weights| weights[from * drives..to * drives].to_vec()),
                load: self.load.as_deref().map(cut),
                maps_from_degrees: self.maps_from_degrees.clone(),
                faults: Vec::new(),
                computed: self.computed.clone(),
            }
        };
        (0..n).map(piece).collect()
    }

    /// Whether the filter before a decimated sample has used mostly forces of the drive that are excluded. Excluded
    /// forces have interpolated values, so that a few of them change the filtered force by little.
    pub(crate) fn has_excluded_input(&self, drive: usize, kept: usize) -> bool {
        let every = self.decimation();
        self.run.left_out.get(drive).is_some_and(|out| {
            // Most of the filter's weight lies within half a decimated step to either side.
            let half = every / 2;
            let around = (every * kept).saturating_sub(half)..(every * kept + half + 1).min(out.len());
            let excluded = out[around.clone()].iter().filter(|out| **out).count();
            2 * excluded >= around.len().max(1)
        })
    }

    /// Times of the samples after decimation, s.
    pub fn time(&self) -> Vec<f64> {
        decimate_time(&self.run.time, self.decimation())
    }

    /// Adds a note, and passes it to the listener.
    pub(crate) fn note(&mut self, model: &Model, note: RecordingNote) {
        model.host().note(&note);
        self.run.notes.push(note);
    }

    /// Whether both segments have the same times, states and forces.
    pub(crate) fn has_same_samples(&self, other: &Self) -> bool {
        let (a, b) = (&self.run, &other.run);
        a.time == b.time && a.q == b.q && a.qd == b.qd && a.qdd == b.qdd && a.force == b.force
    }

    /// Notes on the segment.
    pub fn notes(&self) -> &[RecordingNote] {
        &self.run.notes
    }

    /// Calls `visit` with one block of states after the other. `visit` returns a [`PoseFault`] in its inner result if a
    /// pose has no solution. The error message then states its place in the recording.
    ///
    /// Fails with the first pose without a solution, with any error of `visit`, and when an effect needs a load
    /// that is missing.
    pub fn for_each_block<E: From<Error>>(
        &self,
        model: &Model,
        mut visit: impl FnMut(&MotionStates<'_>) -> Result<Result<(), PoseFault>, E>,
    ) -> Result<(), E> {
        self.check_load(model)?;
        let n = self.samples();
        let mut start = 0;
        while start < n {
            let end = (start + BLOCK).min(n);
            let states = self.states(start, end);
            visit(&states)?.map_err(|fault| self.pose_error(model, fault, start))?;
            start = end;
        }
        Ok(())
    }

    /// The states of the samples from `start` to `end`, exclusive.
    pub fn states(&self, start: usize, end: usize) -> MotionStates<'_> {
        MotionStates {
            q: slices(&self.run.q, start, end),
            qd: slices(&self.run.qd, start, end),
            qdd: slices(&self.run.qdd, start, end),
            load: slices(self.loads(), start, end),
        }
    }

    /// Loads of the drives: those set for the segment, or else the measured forces.
    fn loads(&self) -> &[Vec<f64>] {
        let loads = self.load.as_deref().or(self.run.force.as_deref());
        loads.unwrap_or(&[])
    }

    /// Fails when an effect depends on the load and neither loads nor measured forces exist.
    fn check_load(&self, model: &Model) -> Outcome {
        let effects = model.load_dependent_effects();
        if effects.is_empty() || self.load.is_some() || self.run.force.is_some() {
            return Ok(());
        }
        Err(Error::input(message!(
            "{}: {} depends on the load of the drives, but the recording lacks the measured force of {}; \
             record it, or name its column with {}",
            self.run.file,
            effects.join(", "),
            self.run.missing_force.join(", "),
            Remedy::option(OptionName::Columns)
        )))
    }

    /// The error of a pose without a solution, with its place in the recording. `start` is the sample at which the
    /// block of the fault begins.
    pub fn pose_error(&self, model: &Model, fault: PoseFault, start: usize) -> Error {
        let sample = start + fault.sample;
        let time = self.run.time.get(sample).copied().unwrap_or(f64::NAN);
        let line = self.run.lines.get(sample).copied().unwrap_or(0);
        // The pose is part of the message, since it often shows a wrong column or unit.
        let place = sample_place_word(&self.run.file);
        let pose: Vec<String> = model
            .active_coordinates()
            .iter()
            .zip(&self.run.q)
            .map(|(name, q)| format!("{name} = {:.6}", q.get(sample).copied().unwrap_or(f64::NAN)))
            .collect();
        let columns = Remedy::option(OptionName::Columns);
        // Each reason has its own explanation and remedy.
        let (what, todo) = match fault.reason {
            PoseReason::NotFinite { input } => {
                return Error::input(format!(
                    "{}, {place} {line} (t = {time} s): `{input}` is no finite number",
                    self.run.file
                ));
            }
            PoseReason::OutOfReach => (
                "the loops cannot close at this pose",
                message!(
                    "check the units (rad, m) and the signs of the positions, which column is which \
                     coordinate ({}), and the lengths in the model file",
                    columns
                ),
            ),
            PoseReason::Undefined => (
                "a term of the model has no finite value at this state",
                "check the effects whose expressions contain quotients, roots or exponentials".into(),
            ),
            PoseReason::Singular => (
                "the mechanism is singular at this pose, where forces are not determined",
                message!(
                    "remove the poses around it from the recording, and check which column is which coordinate ({})",
                    columns
                ),
            ),
        };
        Error::input(message!(
            "{}, {place} {line} (t = {time} s): {what} ({}); {}",
            self.run.file,
            pose.join(", "),
            todo
        ))
    }
}

/// Samples `start` to `end` of each column.
fn slices(columns: &[Vec<f64>], start: usize, end: usize) -> Vec<&[f64]> {
    columns.iter().map(|column| &column[start..end]).collect()
}
