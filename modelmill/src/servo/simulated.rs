//! Actuators in a simulation forward in time: the recorded signal and the simulated state of the drive go in, the force
//! comes out.
//!
//! Decision: the force of every kind of actuator is linear in its signal, the position of the drive and their rates, apart
//! from limits. Five states give the coefficients, which are the stiffness and the damping of the servo at once.

use modelmill_spec::ModelActuator;

use super::forces::{ActuatorStates, interpolate_at};
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
    /// The force at zero states, N or N m.
    offset: f64,
    /// Change of the force per unit of the signal, of its rate, of the position and of its rate.
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
        let unlimited = ModelActuator {
            saturation: None,
            dead_band: None,
            ..actuator.clone()
        };
        let unit = |place: usize| -> Vec<f64> { (0..5).map(|k| if k == place { 1.0 } else { 0.0 }).collect() };
        let states = ActuatorStates {
            signal: unit(1),
            signal_rate: unit(2),
            position: unit(3),
            rate: unit(4),
        };
        let forces = states.forces(model, &unlimited, gains);
        Self {
            drive: actuator.drive.0,
            is_commanded: actuator.kind.is_commanded(),
            actuator: actuator.clone(),
            offset: forces[0],
            slopes: std::array::from_fn(|k| forces[k + 1] - forces[0]),
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
        self.actuator.limited_force(self.offset + sum)
    }

    /// Stiffness and damping at the drive, N/m and N s/m, or N m/rad and N m s/rad.
    pub(crate) fn stiffness_and_damping(&self) -> [f64; 2] {
        [-self.slopes[2], -self.slopes[3]]
    }
}
