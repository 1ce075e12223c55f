//! Controllers with the same gains and different knowledge, and the loop that runs them on the plant.

use std::error::Error;
use std::f64::consts::TAU;

use modelmill_generated::spidermill;
use modelmill_rig::{Rig, RigPlant};
use modelmill_runtime::PoseError;

use crate::reference::ReferenceMotion;
use crate::spidermill_with_friction as with_friction;

/// Time between two calls of the controller, s; forces are held in between.
pub(crate) const CYCLE: f64 = 2e-3;
/// Frequency of the closed loop, rad/s, critically damped.
const SPEED: f64 = 5.0 * TAU;
/// Turns of 20 bits.
const RESOLUTION: f64 = TAU / 1_048_576.0;

/// Where the robot is and where it should be.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ControlState {
    q: [f64; 2],
    desired: [[f64; 2]; 3],
    /// Rate of the error.
    error_rate: [f64; 2],
}

impl ControlState {
    /// Acceleration that lets the error die out.
    fn correction(&self) -> [f64; 2] {
        std::array::from_fn(|k| {
            let error = self.desired[0][k] - self.q[k];
            SPEED * SPEED * error + 2.0 * SPEED * self.error_rate[k]
        })
    }

    /// Acceleration to ask of the model.
    fn acceleration(&self) -> [f64; 2] {
        let correction = self.correction();
        std::array::from_fn(|k| self.desired[2][k] + correction[k])
    }
}

/// Forces of the spindles for a situation.
pub(crate) struct TorqueController<'a>(Box<ControlLaw<'a>>);

/// Forces of the spindles, N, in a situation.
type ControlLaw<'a> = dyn Fn(&ControlState) -> Result<[f64; 2], PoseError> + 'a;

impl<'a> TorqueController<'a> {
    /// Knows the mass that each crank feels, and the weight, at the nominal pose only.
    pub(crate) fn without_model(
        dynamics: &spidermill::InverseDynamics<f64>,
        drives: &'a spidermill::Model<f64>,
    ) -> Result<Self, PoseError> {
        let q = ReferenceMotion::task().state_at(0.0)[0];
        let still = |qdd| spidermill::State {
            q,
            qd: [0.0; 2],
            qdd,
        };
        let weight = dynamics.forces(&still([0.0; 2]))?;
        let jacobian = drives.drives(&still([0.0; 2]))?.jacobian;
        // Moments at the cranks for one rad/s^2 of each.
        let mut inertia = [0.0; 2];
        for k in 0..2 {
            let mut qdd = [0.0; 2];
            qdd[k] = 1.0;
            let forces = dynamics.forces(&still(qdd))?;
            inertia[k] = (0..2)
                .map(|d| jacobian[d][k] * (forces[d] - weight[d]))
                .sum();
        }
        Ok(Self(Box::new(move |now| {
            let state = spidermill::State {
                q: now.q,
                qd: [0.0; 2],
                qdd: [0.0; 2],
            };
            let jacobian = drives.drives(&state)?.jacobian;
            let correction = now.correction();
            // Each spindle moves its own crank.
            Ok(std::array::from_fn(|k| {
                weight[k] + inertia[k] * correction[k] / jacobian[k][k]
            }))
        })))
    }

    /// Computed torque with the reduced model as it comes from CAD.
    pub(crate) fn with_nominal(dynamics: &'a spidermill::InverseDynamics<f64>) -> Self {
        Self(Box::new(|now| {
            dynamics.forces(&spidermill::State {
                q: now.q,
                qd: now.desired[1],
                qdd: now.acceleration(),
            })
        }))
    }

    /// Computed torque with what was identified. Friction goes by the rates that are wanted, which have no noise.
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

/// What was read and set in each cycle.
#[derive(Clone, Debug, Default)]
pub(crate) struct ControlRecording {
    pub(crate) t: Vec<f64>,
    /// Readings of the encoders, per coordinate.
    pub(crate) q: [Vec<f64>; 2],
    /// Forces that were set, per drive.
    pub(crate) forces: [Vec<f64>; 2],
    /// True error, per coordinate.
    error: [Vec<f64>; 2],
}

impl ControlRecording {
    /// Root mean square of the true error behind the first second, rad.
    pub(crate) fn rms_error(&self) -> [f64; 2] {
        self.error.each_ref().map(|e| {
            let settled = e.iter().zip(&self.t).filter(|(_, t)| **t > 1.0);
            let (sum, n) = settled.fold((0.0, 0.0), |(s, n), (e, _)| (s + e * e, n + 1.0));
            f64::sqrt(sum / n)
        })
    }
}

/// Runs a controller on the rig, from the motion's own start.
pub(crate) fn run(
    rig: &Rig,
    controller: &TorqueController<'_>,
    reference: &ReferenceMotion,
) -> Result<ControlRecording, Box<dyn Error>> {
    let [q, qd, _] = reference.state_at(0.0);
    let mut plant = RigPlant::new(rig, &q, &qd)?;
    let mut recording = ControlRecording::default();
    let read = |q: &[f64]| [0, 1].map(|k| (q[k] / RESOLUTION).round() * RESOLUTION);
    let mut before = [0.0; 2];
    let mut error_rate = [0.0; 2];
    let mut t = 0.0;
    while t < reference.duration {
        let q = read(plant.q());
        let wanted = reference.state_at(t);
        // Differences through a low-pass of 100 Hz: of the error rather than of the reading, whose rate would come late
        // and be taken for an error.
        let share = 1.0 - f64::exp(-TAU * 100.0 * CYCLE);
        for k in 0..2 {
            let error = wanted[0][k] - q[k];
            if t > 0.0 {
                error_rate[k] += share * ((error - before[k]) / CYCLE - error_rate[k]);
            }
            before[k] = error;
        }
        let forces = controller.0(&ControlState {
            q,
            desired: wanted,
            error_rate,
        })?;
        recording.t.push(t);
        for k in 0..2 {
            recording.q[k].push(q[k]);
            recording.forces[k].push(forces[k]);
            recording.error[k].push(wanted[0][k] - plant.q()[k]);
        }
        plant.step(&forces, CYCLE)?;
        t += CYCLE;
    }
    Ok(recording)
}
