//! Models with actuators: base parameters, or their ratios, estimated from commands or currents instead of measured forces.
//!
//! A model whose file has `[[actuator]]` goes in, with recordings of commands, currents or voltages. Out come base
//! parameters and gains with standard deviations, the delay of each servo, and the parameters whose values must be
//! known to determine the scale.
//!
//! The equations are `H p - S k = 0`, with the gains `k` and the regressor `S` of the signals, see
//! [`modelmill_spec::Mechanism::with_servo_equations`]. Without a known number
//! they are homogeneous: every multiple of a solution is a solution, so that only ratios can be known.

mod delay;
mod delay_steps;
mod direction;
mod estimate;
mod forces;
mod gains;
mod instruments;
mod logs;
mod model_fit;
mod refine;
mod rows;
mod scale;
mod suspects;
mod thresholds;
mod turns;

use modelmill_spec::ModelActuator;

use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::recording::{DerivativeSource, RecordingOptions, SmoothingMethod, StandstillRule, StatePreparation};

pub use delay::ServoDelay;
pub use estimate::{ServoEstimator, ServoIdentification, ServoParameter, ServoRowError, ServoStatus};
pub use logs::{ReadingChange, ServoLogs};
pub use scale::{ScaleFreedom, ServoScale};

/// A model with its actuators in place of measured forces.
pub struct ServoModel {
    /// The model whose equations contain the forces of the actuators. Its base parameters contain the gains.
    pub equations: Model,
    /// Groups of base parameters of which only ratios can be identified without a measured force; empty if all values
    /// can be identified.
    pub scale: ServoScale,
    /// The model without the forces of its actuators.
    model: Model,
}

impl Model {
    /// The actuators of the model file.
    pub fn actuators(&self) -> &[ModelActuator] {
        &self.loaded.mechanism.actuators
    }

    /// The model with the forces of its actuators in its equations. It also lists the base parameters for which the signals
    /// determine only ratios.
    ///
    /// Fails when the model has no actuators, when an effect depends on the load of a drive, or when the equations
    /// cannot be derived.
    pub fn servo_model(&self) -> Outcome<ServoModel> {
        if self.actuators().is_empty() {
            return Err(Error::input(format!(
                "{}: the model has no `[[actuator]]`; without one, a recording needs the forces of the drives",
                self.path
            )));
        }
        let loads = self.load_dependent_effects();
        if !loads.is_empty() {
            return Err(Error::input(format!(
                "{}: {} depends on the force of the drive, which a servo log does not have; leave it out of the model, or \
                 delete the actuators and record forces",
                self.path,
                loads.join(", ")
            )));
        }
        let mut loaded = (*self.loaded).clone();
        loaded.mechanism = loaded.mechanism.with_servo_equations();
        let mut equations = self.host().derive(&self.path, loaded)?;
        equations.name.clone_from(&self.name);
        let scale = ServoScale::new(&equations)?;
        Ok(ServoModel {
            equations,
            scale,
            model: self.clone(),
        })
    }
}

impl ServoModel {
    /// The actuators, in the order of the file.
    pub fn actuators(&self) -> &[ModelActuator] {
        self.equations.actuators()
    }

    /// The name of the drive of an actuator.
    pub fn drive_name(&self, actuator: &ModelActuator) -> &str {
        &self.mechanism().drives[actuator.drive.0].name
    }

    /// Options for reading recordings of signals: rates are computed from the positions, so that positions, rates and
    /// signals pass through the same filter. The filter of recorded rates is unknown.
    pub fn reading(options: &RecordingOptions) -> RecordingOptions {
        RecordingOptions {
            preparation: StatePreparation {
                source: DerivativeSource::Positions,
                smoothing: SmoothingMethod::Butterworth,
                ..options.preparation.clone()
            },
            standstill: StandstillRule::KeepAll,
            ..options.clone()
        }
    }

    /// The mechanism with its servo equations.
    fn mechanism(&self) -> &modelmill_spec::Mechanism {
        &self.equations.derivation.mechanism
    }

    /// Rows of the regressor that belong to bodies; the others belong to signals and are zero.
    fn body_rows(&self) -> Vec<usize> {
        let mechanism = self.mechanism();
        (0..mechanism.drives.len())
            .filter(|d| !mechanism.is_signal_row(*d))
            .collect()
    }

    /// Position among the active coordinates of the signal of an actuator.
    fn signal_position(&self, actuator: &ModelActuator) -> usize {
        let mut active = self.mechanism().coordinates.iter().filter(|c| !c.passive);
        active.position(|c| c.name == actuator.signal).unwrap_or(0)
    }
}
