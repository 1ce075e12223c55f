//! Controllers with the same gains and different models, and the loop that runs them on the plant.

use std::error::Error;
use std::f64::consts::TAU;

use modelmill_generated::spidermill;
use modelmill_rig::{Rig, RigPlant};
use modelmill_runtime::PoseError;

use crate::reference::ReferenceMotion;
use crate::spidermill_with_friction as with_friction;

/// Time between two calls of the controller, s; forces are constant in between.
pub(crate) const CYCLE: f64 = 2e-3;
/// Natural frequency of the closed loop, rad/s; it is critically damped.
const SPEED: f64 = 5.0 * TAU;
/// Smallest step of the encoders, rad: one revolution has 2^20 steps.
const RESOLUTION: f64 = TAU / 1_048_576.0;

/// Measured and desired motion at one time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ControlState {
    /// Measured coordinates, rad.
    q: [f64; 2],
    /// Desired coordinates, rates and accelerations: rad, rad/s and rad/s^2.
    desired: [[f64; 2]; 3],
    /// Rate of the tracking error, rad/s.
    error_rate: [f64; 2],
}

impl ControlState {
    /// Acceleration that reduces the tracking error to zero, rad/s^2.
    fn correction(&self) -> [f64; 2] {
        std::array::from_fn(|k| {
            let error = self.desired[0][k] - self.q[k];
            SPEED * SPEED * error + 2.0 * SPEED * self.error_rate[k]
        })
    }

    /// Acceleration that the model has to produce, rad/s^2: the desired one plus the correction.
    fn acceleration(&self) -> [f64; 2] {
        let correction = self.correction();
        std::array::from_fn(|k| self.desired[2][k] + correction[k])
    }
}

/// A controller: it computes the forces of the spindles.
pub(crate) struct TorqueController<'a>(Box<ControlLaw<'a>>);

/// Forces of the spindles, N, for the measured and desired motion.
type ControlLaw<'a> = dyn Fn(&ControlState) -> Result<[f64; 2], PoseError> + Sync + 'a;

impl<'a> TorqueController<'a> {
    /// Without a model: it uses the effective inertia of each crank, and the weight, at one pose only.
    pub(crate) fn without_model(
        dynamics: &spidermill::InverseDynamics<f64>,
        drives: &'a spidermill::Model<f64>,
    ) -> Result<Self, PoseError> {
        // Everything is computed once, at the beginning of the task.
        let q = ReferenceMotion::task().state_at(0.0)[0];
        let still = |qdd| spidermill::State { q, qd: [0.0; 2], qdd };
        let weight = dynamics.forces(&still([0.0; 2]))?;
        let jacobian = drives.drives(&still([0.0; 2]))?.jacobian;
        // Moments at the cranks for one rad/s^2 of each.
        let mut inertia = [0.0; 2];
        for k in 0..2 {
            let mut qdd = [0.0; 2];
            qdd[k] = 1.0;
            let forces = dynamics.forces(&still(qdd))?;
            inertia[k] = (0..2).map(|d| jacobian[d][k] * (forces[d] - weight[d])).sum();
        }
        Ok(Self(Box::new(move |now| {
            let state = spidermill::State {
                q: now.q,
                qd: [0.0; 2],
                qdd: [0.0; 2],
            };
            let jacobian = drives.drives(&state)?.jacobian;
            let correction = now.correction();
            // Each spindle moves its own crank, so the coupling of the cranks is neglected.
            Ok(std::array::from_fn(|k| {
                weight[k] + inertia[k] * correction[k] / jacobian[k][k]
            }))
        })))
    }

    /// Computed torque with the reduced model and its nominal parameters, as from CAD.
    pub(crate) fn with_nominal(dynamics: &'a spidermill::InverseDynamics<f64>) -> Self {
        Self(Box::new(|now| {
            dynamics.forces(&spidermill::State {
                q: now.q,
                qd: now.desired[1],
                qdd: now.acceleration(),
            })
        }))
    }

    /// Computed torque with the identified parameters. Friction is computed from the desired rates, which have no
    /// noise.
    pub(crate) fn with_identified(dynamics: &'a with_friction::InverseDynamics<f64>) -> Self {
        Self(Box::new(|now| {
            dynamics.forces(&with_friction::State {
                q: now.q,
                qd: now.desired[1],
                qdd: now.acceleration(),
            })
        }))
    }
}

/// Measured coordinates and forces of all cycles.
#[derive(Clone, Debug, Default)]
pub(crate) struct ControlRecording {
    /// Times of the cycles, s.
    pub(crate) t: Vec<f64>,
    /// Readings of the encoders, per coordinate, rad.
    pub(crate) q: [Vec<f64>; 2],
    /// Forces that were set, per drive, N.
    pub(crate) forces: [Vec<f64>; 2],
    /// True tracking error, per coordinate, rad.
    error: [Vec<f64>; 2],
}

impl ControlRecording {
    /// Root mean square of the true tracking error after the first second, rad.
    pub(crate) fn rms_error(&self) -> [f64; 2] {
        self.error.each_ref().map(|e| {
            let settled = e.iter().zip(&self.t).filter(|(_, t)| **t > 1.0);
            let (sum, n) = settled.fold((0.0, 0.0), |(s, n), (e, _)| (s + e * e, n + 1.0));
            f64::sqrt(sum / n)
        })
    }
}

/// Runs a controller on the rig, from the start of the reference motion.
pub(crate) fn run(
    rig: &Rig,
    controller: &TorqueController<'_>,
    reference: &ReferenceMotion,
) -> Result<ControlRecording, Box<dyn Error>> {
    let [q, qd, _] = reference.state_at(0.0);
    let mut plant = RigPlant::new(rig, &q, &qd)?;
    let mut recording = ControlRecording::default();
    // Encoders round to their resolution.
    let read = |q: &[f64]| [0, 1].map(|k| (q[k] / RESOLUTION).round() * RESOLUTION);
    let mut before = [0.0; 2];
    let mut error_rate = [0.0; 2];
    let mut t = 0.0;
    while t < reference.duration {
        let q = read(plant.q());
        let wanted = reference.state_at(t);
        // The rate is a difference through a low-pass of 100 Hz. It is taken of the error and not of the reading: the
        // delayed rate of the reading would appear as an error.
        let share = 1.0 - f64::exp(-TAU * 100.0 * CYCLE);
        for k in 0..2 {
            let error = wanted[0][k] - q[k];
            if t > 0.0 {
                error_rate[k] += share * ((error - before[k]) / CYCLE - error_rate[k]);
            }
            before[k] = error;
        }
        // The forces are constant during the cycle.
        let forces = controller.0(&ControlState {
            q,
            desired: wanted,
            error_rate,
        })?;
        recording.t.push(t);
        for k in 0..2 {
            recording.q[k].push(q[k]);
            recording.forces[k].push(forces[k]);
            // The true error is known here because the plant is simulated.
            recording.error[k].push(wanted[0][k] - plant.q()[k]);
        }
        plant.step(&forces, CYCLE)?;
        t += CYCLE;
    }
    Ok(recording)
}
