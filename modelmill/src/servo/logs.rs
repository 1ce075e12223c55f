//! Logs of servos: recordings are read and prepared for the equations with the forces of actuators, if they have the signals.

use super::{ServoIdentification, ServoModel};
use crate::error::Outcome;
use crate::model::Model;
use crate::recording::{PreparedRecording, RecordingOptions, UnpreparedRecording};

/// Recordings of a fit, and those of its validation, each with its own result.
pub(super) type ReadRuns = [Vec<Outcome<UnpreparedRecording>>; 2];

/// Options for reading that follow from those of the user.
pub type ReadingChange = fn(&RecordingOptions) -> RecordingOptions;

/// A model with its actuators in place of forces, with recordings of their signals.
pub struct ServoLogs {
    /// The model.
    servo: ServoModel,
    /// The recordings of the fit, and those of its validation.
    runs: [Vec<PreparedRecording>; 2],
}

impl ServoLogs {
    /// Identifies base parameters and gains; fails as [`ServoModel::identify`] does.
    pub fn identify(&self) -> Outcome<ServoIdentification> {
        let [fit, check] = self.runs.each_ref().map(|all| all.iter().collect::<Vec<_>>());
        self.servo.identify(&fit, &check)
    }

    /// The sentence that refuses options of estimators from forces, which have no effect here; `None` without options.
    pub fn refuse_options(names: &[impl AsRef<str>]) -> Option<String> {
        let names: Vec<&str> = names.iter().map(AsRef::as_ref).collect();
        (!names.is_empty()).then(|| {
            format!(
                "{} cannot be used with actuators: their estimator chooses weights and instruments itself; leave it out",
                names.join(", ")
            )
        })
    }
}

impl Model {
    /// Prepares the recordings of a fit and of its validation as logs of servos. `read` reads them for a model, with a change of
    /// the options. `None` if the model has no actuators, or if a recording has the forces of all drives and lacks a signal
    /// of their actuators.
    ///
    /// Fails with the first error of a recording, and as [`Model::servo_model`] does.
    pub fn prepare_servo_logs(&self, read: impl Fn(&Self, ReadingChange) -> ReadRuns) -> Outcome<Option<ServoLogs>> {
        if self.actuators().is_empty() {
            return Ok(None);
        }
        let servo = self.servo_model()?;
        let equations = &servo.equations;
        let prepared = equations.prepare_together(equations.add_actuator_forces(read(equations, ServoModel::reading)));
        let [fit, check] = prepared.map(|run| run.into_iter().collect::<Outcome<Vec<_>>>());
        match fit.and_then(|fit| Ok([fit, check?])) {
            Ok(runs) => Ok(Some(ServoLogs { servo, runs })),
            // Without the signals, forces do. Any other error is one of the log.
            Err(error) => {
                let recorded = read(self, RecordingOptions::clone);
                let mut recorded = recorded.iter().flatten().flatten();
                if recorded.any(|one| self.has_forces_without_signals(one)) {
                    Ok(None)
                } else {
                    Err(error)
                }
            }
        }
    }

    /// Whether a recording has the forces of all drives and lacks a signal of their actuators.
    fn has_forces_without_signals(&self, recording: &UnpreparedRecording) -> bool {
        let raw = recording.raw();
        let has_forces = self.row_names().iter().all(|drive| raw.has_column(drive));
        has_forces && self.actuators().iter().any(|one| !raw.has_column(&one.signal))
    }
}
