//! One stretch of a recording between gaps in time, ready for a model: shown block by block; faults name the time and the
//! line of the recording.

pub mod variances;

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, OptionSetting, Remedy};
use modelmill_codegen::{MotionStates, PoseFault, PoseReason};
use modelmill_identify::decimate_time;
use modelmill_identify::diagnose::Disturbance;
use modelmill_identify::{PreparedRun, RecordingNote, sample_place_word};

use crate::error::{Error, Outcome};
use crate::model::Model;

/// States that are evaluated at once: progress moves on, and memory stays small.
pub const BLOCK: usize = 4096;

/// A stretch of a recording that is ready for a model.
#[derive(Clone)]
pub struct RecordingSegment {
    /// The states and forces.
    pub run: PreparedRun,
    /// Variances of the forces, `[drive][sample]`, where the recording has the columns `DRIVE_var`.
    pub variance: Option<Vec<Vec<f64>>>,
    /// What each equation counts beside the estimator's weights, interleaved per kept sample; all the same if there are
    /// none.
    pub weights: Option<Vec<f64>>,
    /// What the drives carry, `[drive][sample]`, for effects that depend on it; the measured forces if there are none.
    pub load: Option<Vec<Vec<f64>>>,
    /// The options that would read all angles in degrees; empty where no file stands behind.
    pub maps_from_degrees: Vec<OptionSetting>,
    /// What is wrong with the recording, as far as it was seen.
    pub faults: Vec<Disturbance>,
}

impl From<PreparedRun> for RecordingSegment {
    /// A run without variances whose equations count all the same.
    fn from(run: PreparedRun) -> Self {
        Self {
            run,
            variance: None,
            weights: None,
            load: None,
            maps_from_degrees: Vec::new(),
            faults: Vec::new(),
        }
    }
}

impl RecordingSegment {
    /// Samples before decimation.
    pub fn samples(&self) -> usize {
        self.run.samples()
    }

    /// Every how many samples one is kept.
    pub fn decimation(&self) -> usize {
        self.run.prepared.decimate.max(1)
    }

    /// The stretch in pieces of no more than so many kept samples, each of which stands alone.
    pub(crate) fn pieces(&self, longest: usize) -> Vec<Self> {
        let every = self.decimation();
        let kept = self.samples().div_ceil(every);
        let n = kept.div_ceil(longest).max(1);
        let drives = self.run.force.as_ref().map_or(0, Vec::len);
        let piece = |k: usize| {
            let [from, to] = [k, k + 1].map(|k| k * kept / n);
            let (start, end) = (every * from, (every * to).min(self.samples()));
            let cut = |all: &[Vec<f64>]| all.iter().map(|one| one[start..end].to_vec()).collect();
            let run = &self.run;
            Self {
                run: PreparedRun {
                    time: run.time[start..end].to_vec(),
                    q: cut(&run.q),
                    qd: cut(&run.qd),
                    qdd: cut(&run.qdd),
                    force: run.force.as_deref().map(cut),
                    left_out: (run.left_out.iter())
                        .map(|one| one[start..end].to_vec())
                        .collect(),
                    lines: run.lines.get(start..end).unwrap_or_default().to_vec(),
                    file: run.file.clone(),
                    missing_force: run.missing_force.clone(),
                    repeatability: run.repeatability.clone(),
                    prepared: run.prepared.clone(),
                    notes: Vec::new(),
                },
                variance: self.variance.as_deref().map(cut),
                weights: (self.weights.as_ref())
                    .map(|weights| weights[from * drives..to * drives].to_vec()),
                load: self.load.as_deref().map(cut),
                maps_from_degrees: self.maps_from_degrees.clone(),
                faults: Vec::new(),
            }
        };
        (0..n).map(piece).collect()
    }

    /// Whether a kept sample has heard, through the filter before it, of a force of a drive that does not count.
    pub(crate) fn has_excluded_input(&self, drive: usize, kept: usize) -> bool {
        let every = self.decimation();
        self.run.left_out.get(drive).is_some_and(|out| {
            let to = if every == 1 {
                kept + 1
            } else {
                every * (kept + 1) + 1
            };
            let around = (every * kept).saturating_sub(every - 1)..to.min(out.len());
            out[around].contains(&true)
        })
    }

    /// Times of the samples that are kept.
    pub fn time(&self) -> Vec<f64> {
        decimate_time(&self.run.time, self.decimation())
    }

    /// Keeps a remark, and passes it on to whoever watches.
    pub(crate) fn note(&mut self, model: &Model, note: RecordingNote) {
        model.host().note(&note);
        self.run.notes.push(note);
    }

    /// Whether both hold the same numbers.
    pub(crate) fn has_same_samples(&self, other: &Self) -> bool {
        let (a, b) = (&self.run, &other.run);
        a.time == b.time && a.q == b.q && a.qd == b.qd && a.qdd == b.qdd && a.force == b.force
    }

    /// Remarks, for the JSON.
    pub fn notes(&self) -> &[RecordingNote] {
        &self.run.notes
    }

    /// Calls `visit` with one block of states after the other; `visit` may find a pose without answer.
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

    /// Some of the states.
    pub fn states(&self, start: usize, end: usize) -> MotionStates<'_> {
        MotionStates {
            q: slices(&self.run.q, start, end),
            qd: slices(&self.run.qd, start, end),
            qdd: slices(&self.run.qdd, start, end),
            load: slices(self.loads(), start, end),
        }
    }

    fn loads(&self) -> &[Vec<f64>] {
        let loads = self.load.as_deref().or(self.run.force.as_deref());
        loads.unwrap_or(&[])
    }

    fn check_load(&self, model: &Model) -> Outcome {
        let effects = model.load_dependent_effects();
        if effects.is_empty() || self.load.is_some() || self.run.force.is_some() {
            return Ok(());
        }
        Err(Error::input(message!(
            "{}: {} depends on the load that the drives carry, but the recording lacks the measured force of {}; \
             record it, or name its column with {}",
            self.run.file,
            effects.join(", "),
            self.run.missing_force.join(", "),
            Remedy::option(OptionName::Columns)
        )))
    }

    /// A pose without answer, with its place in the recording.
    pub fn pose_error(&self, model: &Model, fault: PoseFault, start: usize) -> Error {
        let sample = start + fault.sample;
        let time = self.run.time.get(sample).copied().unwrap_or(f64::NAN);
        let line = self.run.lines.get(sample).copied().unwrap_or(0);
        let place = sample_place_word(&self.run.file);
        let pose: Vec<String> = model
            .active_coordinates()
            .iter()
            .zip(&self.run.q)
            .map(|(name, q)| format!("{name} = {:.6}", q.get(sample).copied().unwrap_or(f64::NAN)))
            .collect();
        let columns = Remedy::option(OptionName::Columns);
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
                "look at the effects whose expressions hold quotients, roots or exponentials"
                    .into(),
            ),
            PoseReason::Singular => (
                "the mechanism is singular at this pose, so that forces are not determined",
                message!(
                    "leave the poses around it out of the recording, and check which column is which coordinate ({})",
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

fn slices(columns: &[Vec<f64>], start: usize, end: usize) -> Vec<&[f64]> {
    columns.iter().map(|column| &column[start..end]).collect()
}
