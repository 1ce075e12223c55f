//! Actuators in a simulation forward in time: the recorded signal and the simulated state of the drive go in, the force
//! comes out.
//!
//! The force of every kind of actuator is linear in its signal, the position of the drive and their rates, apart from limits.
//! The coefficients are the stiffness and the damping of the servo at once.

use modelmill_spec::ModelActuator;

use super::forces::interpolate_at;
use super::gains::GainValues;
use crate::model::Model;

/// An actuator with its recorded signal.
#[derive(Clone, Debug)]
pub(crate) struct SimulatedActuator {
    /// Place of its drive in the list of the mechanism.
    pub(crate) drive: usize,
    /// Whether its signal is a command.
    pub(crate) is_commanded: bool,
    /// Its limits.
    actuator: ModelActuator,
    /// See [`ModelActuator::slopes`].
    slopes: [f64; 4],
    /// The signal, delayed, by sample.
    signal: Vec<f64>,
    /// Its rate.
    signal_rate: Vec<f64>,
}

impl SimulatedActuator {
    /// An actuator with values of its gains and its signal, delayed and with full turns added.
    pub(super) fn new(
        model: &Model,
        actuator: &ModelActuator,
        gains: &GainValues,
        [signal, signal_rate]: [Vec<f64>; 2],
    ) -> Self {
        let constants = &model.derivation.mechanism.constants;
        Self {
            drive: actuator.drive.0,
            is_commanded: actuator.kind.is_commanded(),
            actuator: actuator.clone(),
            slopes: actuator.slopes(&|c| constants[c].value, &|term| gains.term_value(term)),
            signal,
            signal_rate,
        }
    }

    /// The force, N or N m, at a time and a state of the drive. `time` are the times of the signal, s.
    pub(crate) fn force(&self, time: &[f64], t: f64, [position, rate]: [f64; 2]) -> f64 {
        let [signal, signal_rate] = [&self.signal, &self.signal_rate].map(|column| interpolate_at(time, column, t));
        let states = [
            self.actuator.effective_signal(signal, position),
            signal_rate,
            position,
            rate,
        ];
        let sum: f64 = self.slopes.iter().zip(states).map(|(slope, state)| slope * state).sum();
        self.actuator.limited_force(sum)
    }

    /// Stiffness and damping at the drive, N/m and N s/m, or N m/rad and N m s/rad.
    pub(crate) fn stiffness_and_damping(&self) -> [f64; 2] {
        [-self.slopes[2], -self.slopes[3]]
    }
}
