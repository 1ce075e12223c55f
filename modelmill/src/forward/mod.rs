//! Forward simulation of a model: a recording goes in, the motion of the model under the recorded forces
//! comes out.
//!
//! `plant` is the equation of motion with dry friction, `integrate` advances a state, `horizons` compares simulated
//! with recorded positions.

mod horizons;
mod integrate;
mod plant;
mod thresholds;

use modelmill_codegen::{DynamicsPrograms, PoseFault, PoseReason};

use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::recording::PreparedRecording;
use crate::segment::RecordingSegment;
use crate::text::csv::csv;

pub use horizons::{ForwardComparison, HorizonError};
use integrate::{ForceInterval, MotionState, advance};
use plant::MotionPlant;
pub(crate) use thresholds::VERIFIED_HORIZON_S;

/// What drives a simulated model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SimulationInput {
    /// The forces of the recording.
    Forces,
    /// The commands of its servos: forces follow from commands and the simulated motion.
    Commands,
    /// Other signals of actuators, such as currents or voltages, alone or with commands: forces follow from them and the
    /// simulated motion.
    Signals,
}

impl SimulationInput {
    /// Its name in JSON and text.
    pub fn name(self) -> &'static str {
        match self {
            Self::Forces => "forces",
            Self::Commands => "commands",
            Self::Signals => "signals",
        }
    }

    /// What drives the simulations of some segments.
    fn from_segments(segments: &[&RecordingSegment]) -> Self {
        let computed = segments.iter().filter_map(|one| one.computed.as_deref());
        let mut actuators = computed.flat_map(|one| &one.actuators).peekable();
        if actuators.peek().is_none() {
            Self::Forces
        } else if actuators.all(|one| one.is_commanded) {
            Self::Commands
        } else {
            Self::Signals
        }
    }
}

/// A simulated motion at the times of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct SimulatedMotion {
    /// Times, s.
    pub time: Vec<f64>,
    /// Names of the independent coordinates.
    pub coordinates: Vec<String>,
    /// `q[coordinate][sample]`, rad or m.
    pub q: Vec<Vec<f64>>,
    /// `qd[coordinate][sample]`, rad/s or m/s.
    pub qd: Vec<Vec<f64>>,
    /// Names of the drives and their forces, N or N m: those of the recording, or those of actuators along the simulated
    /// motion.
    pub forces: Vec<(String, Vec<f64>)>,
    /// What drives the model.
    pub input: SimulationInput,
}

impl SimulatedMotion {
    /// The motion as a recording (CSV): time, positions, rates and forces.
    pub fn csv(&self) -> String {
        let rates: Vec<String> = self.coordinates.iter().map(|name| format!("{name}_d")).collect();
        let mut columns = vec![("t", self.time.as_slice())];
        columns.extend(
            self.coordinates
                .iter()
                .zip(&self.q)
                .map(|(name, q)| (name.as_str(), q.as_slice())),
        );
        columns.extend(
            rates
                .iter()
                .zip(&self.qd)
                .map(|(name, qd)| (name.as_str(), qd.as_slice())),
        );
        columns.extend(
            self.forces
                .iter()
                .map(|(name, force)| (name.as_str(), force.as_slice())),
        );
        csv(&columns)
    }

    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.time.len()
    }
}

impl Model {
    /// Simulates the model under the forces of a recording, from its first state. `values` are those of the base
    /// parameters. Forces are interpolated linearly between samples. Forces that were computed from the signals of actuators
    /// ([`Model::prepare_recordings_from_signals`]) follow from these signals and the simulated motion. Drives and coordinates with dry friction stick
    /// when friction can keep them at standstill.
    ///
    /// Fails if the recording has gaps or no forces, if the model has free bodies, and when the simulated motion
    /// leaves the reach of the mechanism.
    pub fn simulate_motion(&self, recording: &PreparedRecording, values: &[f64]) -> Outcome<SimulatedMotion> {
        let [segment] = recording.segments.as_slice() else {
            return Err(Error::input(format!(
                "{} has {} parts with gaps in time between them; a simulation needs one part without gaps",
                recording.file(),
                recording.segments.len()
            )));
        };
        let dynamics = self.forward_programs()?;
        let plant = MotionPlant::new(self, &dynamics, values, segment);
        let n = segment.samples();
        let found = self
            .host()
            .run_job("simulating", 0, |_| rollout(&plant, segment, [0, n]))?;
        let found = found?;
        if let Some(PoseFault { reason, .. }) = found.fault {
            let end = segment.run.time[found.samples.saturating_sub(1).min(n - 1)];
            return Err(Error::input(format!(
                "{}: the simulated motion leaves the reach of the mechanism after t = {end} s ({}); compare over shorter \
                 horizons, or check the values of the parameters",
                recording.file(),
                reason_text(&reason)
            )));
        }
        let forces = simulated_forces(&plant, segment, &found)?;
        Ok(SimulatedMotion {
            time: segment.run.time.clone(),
            coordinates: self.active_coordinates(),
            q: found.q,
            qd: found.qd,
            forces: self.row_names().into_iter().zip(forces).collect(),
            input: SimulationInput::from_segments(&[segment]),
        })
    }

    /// The equation of motion, derived.
    ///
    /// Fails for free bodies, which are not simulated, and when the derivation fails.
    fn forward_programs(&self) -> Outcome<DynamicsPrograms> {
        if self.joint_coordinates().len() < self.active_coordinates().len() {
            return Err(Error::input(format!(
                "{} has a free body, whose orientation is a quaternion; only mechanisms with joints can be simulated",
                self.path
            )));
        }
        let what = "deriving the equation of motion";
        let derived = self.host().run_job(what, 0, |_| self.derivation.dynamics())?;
        derived.map_err(|error| Error::derivation(&self.path, error))
    }
}

/// The motion over some samples of a segment.
struct MotionRollout {
    /// Number of samples that were reached.
    samples: usize,
    /// `q[coordinate][sample]`.
    q: Vec<Vec<f64>>,
    /// `qd[coordinate][sample]`.
    qd: Vec<Vec<f64>>,
    /// Why the motion ended early.
    fault: Option<PoseFault>,
}

/// A simulation between two samples of a segment.
struct SimulationCursor<'a> {
    segment: &'a RecordingSegment,
    forces: &'a [Vec<f64>],
    state: MotionState,
    /// The sample of the state.
    sample: usize,
}

impl<'a> SimulationCursor<'a> {
    /// A simulation that starts at the recorded state of a sample. `offset` is added to its positions; it is empty if
    /// there is none.
    ///
    /// Fails when the recording has no forces.
    fn new(segment: &'a RecordingSegment, sample: usize, offset: &[f64]) -> Outcome<Self> {
        let run = &segment.run;
        let mut q = values_at(&run.q, sample);
        for (q, offset) in q.iter_mut().zip(offset) {
            *q += offset;
        }
        Ok(Self {
            segment,
            forces: run.measured_forces()?,
            state: MotionState::new(q, values_at(&run.qd, sample)),
            sample,
        })
    }

    /// Simulates to the next sample.
    ///
    /// Fails when the motion leaves the reach of the mechanism.
    fn step(&mut self, plant: &MotionPlant<'_>) -> Result<(), PoseFault> {
        let sample = self.sample;
        let [start, end] = [sample, sample + 1].map(|sample| values_at(self.forces, sample));
        let time = &self.segment.run.time;
        let forces = ForceInterval {
            start: &start,
            end: &end,
            time: [time[sample], time[sample + 1]],
            computed: self.segment.computed.as_deref(),
        };
        advance(plant, &mut self.state, time[sample + 1] - time[sample], &forces)?;
        self.sample += 1;
        if self.state.is_finite() {
            return Ok(());
        }
        let reason = PoseReason::Undefined;
        Err(PoseFault { sample, reason })
    }
}

/// The values of all columns at one sample.
fn values_at(columns: &[Vec<f64>], sample: usize) -> Vec<f64> {
    columns.iter().map(|column| column[sample]).collect()
}

/// Simulates from the recorded state at sample `start` to `end`, exclusive.
///
/// Fails when the recording has no forces.
fn rollout(plant: &MotionPlant<'_>, segment: &RecordingSegment, [start, end]: [usize; 2]) -> Outcome<MotionRollout> {
    let n = segment.run.q.len();
    let mut cursor = SimulationCursor::new(segment, start, &[])?;
    let mut found = MotionRollout {
        samples: 0,
        q: vec![Vec::with_capacity(end - start); n],
        qd: vec![Vec::with_capacity(end - start); n],
        fault: None,
    };
    loop {
        for k in 0..n {
            found.q[k].push(cursor.state.q[k]);
            found.qd[k].push(cursor.state.qd[k]);
        }
        found.samples += 1;
        if cursor.sample + 1 >= end {
            return Ok(found);
        }
        if let Err(fault) = cursor.step(plant) {
            found.fault = Some(fault);
            return Ok(found);
        }
    }
}

/// Forces of the drives along a simulated motion of a complete segment, `[drive][sample]`.
///
/// Fails when the recording has no forces.
fn simulated_forces(
    plant: &MotionPlant<'_>,
    segment: &RecordingSegment,
    made: &MotionRollout,
) -> Outcome<Vec<Vec<f64>>> {
    let mut forces = segment.run.measured_forces()?.to_vec();
    for (sample, t) in segment.run.time.iter().enumerate() {
        let recorded = values_at(&forces, sample);
        let interval = ForceInterval {
            start: &recorded,
            end: &recorded,
            time: [*t, *t],
            computed: segment.computed.as_deref(),
        };
        let [q, qd] = [&made.q, &made.qd].map(|columns| values_at(columns, sample));
        // The rollout has reached every state, so that it has a solution.
        let at_state = interval.forces_at(plant, 0.0, [&q, &qd]).unwrap_or(recorded);
        for (column, force) in forces.iter_mut().zip(at_state) {
            column[sample] = force;
        }
    }
    Ok(forces)
}

/// Why a motion ended early, as a clause.
fn reason_text(reason: &PoseReason) -> &'static str {
    match reason {
        PoseReason::OutOfReach => "a loop cannot close",
        PoseReason::Singular => "the mechanism is singular",
        PoseReason::Undefined | PoseReason::NotFinite { .. } => "a value is not finite",
    }
}
