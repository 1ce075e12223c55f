//! Inverse dynamics: the forces of the drives for a motion.
//!
//! Newton and Euler's equations of each body by itself give the forces `f` that all joints and drives together
//! must supply, `J' lambda + B tau = f`. The reactions `lambda` of redundant joints are not unique, `tau` is:
//! the rates per unit rate of a coordinate are orthogonal to every reaction. The projection of both sides onto them
//! is a small system for `tau` alone.
//! Source: E. Haug, "Computer Aided Kinematics and Dynamics of Mechanical Systems" (1989), sections 11.2 and 11.5.
//!
//! Decision: the rig shares no mechanics with the derivation. It has maximal coordinates, least squares over all
//! joints' equations and Newton-Euler per body. Where both agree, two independent programs agree. Orientation steps
//! need square roots only and sines come from `libm`, so that a seed gives the same recording on every machine.

use nalgebra::linalg::FullPivLU;
use nalgebra::{DMatrix, DVector, Vector3};

use crate::kinematics::{RigMotion, RigPoseError};
use crate::massive;
use crate::pair::PairFunction;
use crate::pose::{BodyMotion, BodyPose};
use crate::rig::Rig;

/// A pivot below this share of the largest means that the drives cannot balance every load.
const LEVERAGE_TOLERANCE: f64 = 1e-10;

/// Value, rate and acceleration of a coordinate, a joint or a drive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ScalarMotion {
    /// Length or angle, m or rad.
    pub value: f64,
    /// Its first derivative.
    pub rate: f64,
    /// Its second derivative.
    pub acceleration: f64,
}

/// Forces or torques of all drives, N or N m, in the rig's order. `loads` are additional forces of effects in the
/// joints, each along the motion of its place.
///
/// Fails if the drives cannot balance a load.
pub(crate) fn drive_forces(
    rig: &Rig,
    motion: &RigMotion,
    loads: &[(&PairFunction, f64)],
) -> Result<Vec<f64>, RigPoseError> {
    // Forces on all bodies, with those of effects in joints.
    let mut needed = body_forces(rig, motion);
    let base = base_motion();
    for (pair, force) in loads {
        let derived = pair.derive(&motion.bodies, &base);
        derived.scatter(pair, |i, slope| needed[i] += force * slope);
    }
    // Power of every drive per unit rate of every coordinate.
    let per_rate = &motion.rates_per_coordinate;
    let n_dof = per_rate.ncols();
    let mut leverage = DMatrix::zeros(n_dof, rig.drives.len());
    for (d, drive) in rig.drives.iter().enumerate() {
        let derived = drive.measures.derive(&motion.bodies, &base);
        for k in 0..n_dof {
            derived.scatter(&drive.measures, |i, slope| {
                leverage[(k, d)] += per_rate[(i, k)] * slope;
            });
        }
    }
    let needed = DVector::from_fn(n_dof, |k, _| per_rate.column(k).dot(&needed));
    let decomposed = FullPivLU::new(leverage);
    let pivots: DVector<f64> = decomposed.u().diagonal();
    let largest = pivots.amax();
    if pivots.iter().any(|p| p.abs() <= LEVERAGE_TOLERANCE * largest) {
        return Err(RigPoseError::DrivesDeadlocked);
    }
    let forces = decomposed.solve(&needed).ok_or(RigPoseError::DrivesDeadlocked)?;
    Ok(forces.iter().copied().collect())
}

/// Value, rate and acceleration of a place.
pub(crate) fn scalar_motion(pair: &PairFunction, motion: &RigMotion) -> ScalarMotion {
    let derived = pair.derive(&motion.bodies, &base_motion());
    let body = |at: Option<usize>| at.map(|b| &motion.bodies[b]);
    let mut rate = 0.0;
    let mut acceleration = derived.bias;
    for (anchor, k) in [(&pair.from, 0), (&pair.to, 2)] {
        if let Some(body) = body(anchor.body) {
            let [linear, angular] = [&derived.gradient[k], &derived.gradient[k + 1]];
            rate += linear.dot(&body.v_WB_W) + angular.dot(&body.w_WB_W);
            acceleration += linear.dot(&body.a_WB_W) + angular.dot(&body.alpha_WB_W);
        }
    }
    ScalarMotion {
        value: derived.value,
        rate,
        acceleration,
    }
}

/// Kinetic plus potential energy of all masses, also those of effects, J. The potential energy is zero at the base
/// frame's origin.
pub fn energy(rig: &Rig, motion: &RigMotion) -> f64 {
    let gravity = massive::gravity(rig);
    let mut sum = massive::energy(rig, motion, &gravity);
    for (body, moves) in rig.bodies.iter().zip(&motion.bodies) {
        let w = moves.R_WB.transpose() * moves.w_WB_W;
        sum += 0.5 * body.mass * moves.point_velocity(&body.centre).norm_squared() + 0.5 * w.dot(&(body.inertia * w))
            - body.mass * gravity.dot(&moves.point_position(&body.centre));
    }
    let base = base_motion();
    for lumped in &rig.lumped_masses {
        let moves = lumped.at.body.map_or(&base, |b| &motion.bodies[b]);
        sum += lumped.mass
            * (0.5 * moves.point_velocity(&lumped.at.at).norm_squared()
                - gravity.dot(&moves.point_position(&lumped.at.at)));
    }
    sum
}

/// Forces and moments that each body needs for its motion in addition to gravity, six per body: the force, N, and the
/// moment about the origin of its frame, N m. Masses of effects are included.
fn body_forces(rig: &Rig, motion: &RigMotion) -> DVector<f64> {
    let gravity = massive::gravity(rig);
    let mut all = DVector::zeros(6 * rig.bodies.len());
    let mut add = |body: usize, force: Vector3<f64>, moment: Vector3<f64>| {
        for i in 0..3 {
            all[6 * body + i] += force[i];
            all[6 * body + 3 + i] += moment[i];
        }
    };
    for (b, (body, moves)) in rig.bodies.iter().zip(&motion.bodies).enumerate() {
        let arm = moves.R_WB * body.centre;
        let force = body.mass * (moves.point_acceleration(&body.centre) - gravity);
        let inertia = moves.R_WB * body.inertia * moves.R_WB.transpose();
        let w = &moves.w_WB_W;
        let euler = inertia * moves.alpha_WB_W + w.cross(&(inertia * w));
        add(b, force, euler + arm.cross(&force));
    }
    for lumped in &rig.lumped_masses {
        if let Some(b) = lumped.at.body {
            let moves = &motion.bodies[b];
            let inertial = |at: &Vector3<f64>| lumped.mass * (moves.point_acceleration(at) - gravity);
            let arm = moves.R_WB * lumped.moment_at;
            add(b, inertial(&lumped.at.at), arm.cross(&inertial(&lumped.moment_at)));
        }
    }
    for effect in &rig.effects {
        massive::inertial_forces(rig, effect, motion, &gravity, &mut add);
    }
    all
}

/// The base as a body at standstill.
pub(crate) fn base_motion() -> BodyMotion {
    BodyMotion::at_standstill(BodyPose::identity())
}
