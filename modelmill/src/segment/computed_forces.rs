//! What the forces of a recording depend on if they were computed from the signals of actuators and not measured.

use super::RecordingSegment;
use super::simulated_actuator::SimulatedActuator;

/// Forces of a recording that were computed from signals.
#[derive(Clone, Debug, Default)]
pub(crate) struct ComputedForces {
    /// Times of the samples of `delays` and `actuators`, s.
    pub(crate) time: Vec<f64>,
    /// The delays that the forces depend on.
    pub(crate) delays: Vec<DelaySensitivity>,
    /// The actuators, for simulations in which their forces follow from the simulated motion.
    pub(crate) actuators: Vec<SimulatedActuator>,
}

/// How the force of a drive depends on the delay of one of its signals.
#[derive(Clone, Debug)]
pub(crate) struct DelaySensitivity {
    /// Place of the drive in the list of the mechanism.
    pub(crate) drive: usize,
    /// Place of the actuator in the list of the mechanism.
    pub(crate) actuator: usize,
    /// Whether the delay was estimated; otherwise the model file gives it.
    pub(crate) is_estimated: bool,
    /// Whether the signal is a command. The force then contains the position of the drive, and is that of the motor at this
    /// time and not the reading of a sensor.
    pub(crate) is_commanded: bool,
    /// Derivative of the force by the delay, N/s or N m/s, by sample.
    pub(crate) values: Vec<f64>,
}

impl RecordingSegment {
    /// Derivatives of the forces by the delays of their signals at the samples of the segment, not decimated.
    pub(crate) fn delay_sensitivities(&self) -> Vec<Vec<f64>> {
        let Some(computed) = &self.computed else {
            return Vec::new();
        };
        let time = &computed.time;
        let last = time.len().saturating_sub(1);
        let at = |values: &[f64], t: &f64| {
            let b = time.partition_point(|x| x < t).clamp(1.min(last), last);
            let (a, width) = (b.saturating_sub(1), time[b] - time[b.saturating_sub(1)]);
            let share = if width > 0.0 {
                ((t - time[a]) / width).clamp(0.0, 1.0)
            } else {
                1.0
            };
            values[a] + share * (values[b] - values[a])
        };
        let delays = computed.delays.iter().filter(|_| !time.is_empty());
        delays
            .map(|one| self.run.time.iter().map(|t| at(&one.values, t)).collect())
            .collect()
    }
}
