//! Actuators in a simulation forward in time: the recorded signal and the simulated state of the drive go in, the force
//! comes out.
//!
//! The force of every kind of actuator is linear in its signal, the position of the drive and their rates, apart from limits.
//! The coefficients are the stiffness and the damping of the servo at once.

use modelmill_spec::ModelActuator;

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
    /// An actuator with its [`ModelActuator::slopes`] and its signal, delayed and with full turns added.
    pub(crate) fn new(actuator: &ModelActuator, slopes: [f64; 4], [signal, signal_rate]: [Vec<f64>; 2]) -> Self {
        Self {
            drive: actuator.drive.0,
            is_commanded: actuator.kind.is_commanded(),
            actuator: actuator.clone(),
            slopes,
            signal,
            signal_rate,
        }
    }

    /// The force, N or N m, at a time and a state of the drive. `time` are the times of the signal, s.
    pub(crate) fn force(&self, time: &[f64], t: f64, [position, rate]: [f64; 2]) -> f64 {
        let [signal, signal_rate] = [&self.signal, &self.signal_rate].map(|column| interpolate_at(time, column, t));
        self.actuator.force(&self.slopes, [signal, signal_rate, position, rate])
    }

    /// Stiffness and damping at the drive, N/m and N s/m, or N m/rad and N m s/rad.
    pub(crate) fn stiffness_and_damping(&self) -> [f64; 2] {
        [-self.slopes[2], -self.slopes[3]]
    }
}

/// A column at one time: between its samples the cubic polynomial through the four nearest, and constant beyond its ends. A
/// line would cut the curves of a command: at 200 Hz and 4 Hz by more than the noise of an encoder.
pub(crate) fn interpolate_at(time: &[f64], column: &[f64], t: f64) -> f64 {
    let last = time.len().saturating_sub(1);
    if last == 0 || t <= time[0] {
        return column.first().copied().unwrap_or(0.0);
    }
    if t >= time[last] {
        return column[last];
    }
    let b = time.partition_point(|x| *x < t).clamp(1, last);
    let nearest = b.saturating_sub(2)..(b + 2).min(last + 1);
    lagrange(&time[nearest.clone()], &column[nearest], t)
}

/// The polynomial through some points at a time. Points with equal times are no polynomial: the first value counts.
fn lagrange(time: &[f64], values: &[f64], t: f64) -> f64 {
    let basis = |k: usize| -> f64 {
        let others = time.iter().enumerate().filter(|(j, _)| *j != k);
        others.map(|(_, other)| (t - other) / (time[k] - other)).product()
    };
    let sum: f64 = values.iter().enumerate().map(|(k, value)| value * basis(k)).sum();
    if sum.is_finite() { sum } else { values[0] }
}
