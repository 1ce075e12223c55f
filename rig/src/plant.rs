//! The rig moved by its drives: forces go in, and motion comes out, as a controller experiences a machine.
//!
//! The forces of a motion are known (`forces`). They are affine in the accelerations, except for friction that depends
//! on the load. So the accelerations for given forces are computed by Newton's method with one column per coordinate.
//! Time is integrated by the classical Runge-Kutta method, with constant forces during a step, in the coordinates
//! alone. Joints stay closed, because every pose is solved.
//!
//! Decision: forward dynamics is Newton's method on the inverse dynamics, so that every effect has one definition
//! for both directions.

use std::fmt;

use nalgebra::{DMatrix, DVector};

use crate::kinematics::{RigMotion, RigPoseError, RigState, RigTracker};
use crate::rig::Rig;
use crate::simulate::forces;

/// Largest number of Newton steps; one is sufficient without load-dependent friction.
const MOST_STEPS: usize = 20;
/// Relative accuracy of the forces.
const TOLERANCE: f64 = 1e-10;

/// A rig in motion.
#[derive(Debug)]
pub struct RigPlant<'r> {
    /// The rig.
    rig: &'r Rig,
    /// Motion of its bodies.
    tracker: RigTracker<'r>,
    /// Coordinates, rad or m.
    q: Vec<f64>,
    /// Their rates, rad/s or m/s.
    qd: Vec<f64>,
}

/// Why a rig cannot move further.
#[derive(Clone, Debug, PartialEq)]
pub enum PlantError {
    /// As many numbers as coordinates or drives are expected.
    Count {
        /// Number of values.
        found: usize,
        /// Expected number.
        expected: usize,
    },
    /// It cannot be at the pose that it reached.
    Pose(RigPoseError),
    /// The forces determine no accelerations: a degree of freedom without mass, or self-locking friction.
    NoAcceleration,
}

impl fmt::Display for PlantError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Count { found, expected } => write!(
                f,
                "found {found} numbers, but expected one for each of {expected} coordinates or drives"
            ),
            Self::Pose(reason) => reason.fmt(f),
            Self::NoAcceleration => write!(
                f,
                "these forces determine no accelerations; give every degree of freedom a mass, and keep \
                 load-dependent friction below self-locking"
            ),
        }
    }
}

impl std::error::Error for PlantError {}

impl<'r> RigPlant<'r> {
    /// A rig with given coordinates and rates.
    ///
    /// Fails if the rig cannot be at this pose.
    pub fn new(rig: &'r Rig, q: &[f64], qd: &[f64]) -> Result<Self, PlantError> {
        let expected = rig.coordinates.len();
        for found in [q.len(), qd.len()] {
            if found != expected {
                return Err(PlantError::Count { found, expected });
            }
        }
        let mut plant = Self {
            rig,
            tracker: RigTracker::new(rig).map_err(PlantError::Pose)?,
            q: q.to_vec(),
            qd: qd.to_vec(),
        };
        plant.motion(&vec![0.0; expected])?;
        Ok(plant)
    }

    /// Coordinates, rad or m.
    pub fn q(&self) -> &[f64] {
        &self.q
    }

    /// Their rates, rad/s or m/s.
    pub fn qd(&self) -> &[f64] {
        &self.qd
    }

    /// Motion of all bodies, with given accelerations of the coordinates.
    ///
    /// Fails if the rig cannot be at this pose.
    pub fn motion(&mut self, qdd: &[f64]) -> Result<RigMotion, PlantError> {
        let (q, qd) = (self.q.clone(), self.qd.clone());
        self.motion_at(&q, &qd, qdd)
    }

    /// Accelerations of the coordinates under forces of the drives, N or N m.
    ///
    /// Fails if the forces determine no accelerations.
    pub fn accelerations(&mut self, drives: &[f64]) -> Result<Vec<f64>, PlantError> {
        let (q, qd) = (self.q.clone(), self.qd.clone());
        self.accelerations_at(&q, &qd, drives)
    }

    /// Moves forward by `dt` seconds with constant forces of the drives, N or N m.
    ///
    /// Fails if the rig cannot move further; its state is then unchanged.
    pub fn step(&mut self, drives: &[f64], dt: f64) -> Result<(), PlantError> {
        let moved = |x: &[f64], by: &[f64], h: f64| -> Vec<f64> { x.iter().zip(by).map(|(x, d)| x + h * d).collect() };
        let (q, qd) = (self.q.clone(), self.qd.clone());
        let mut slopes: Vec<(Vec<f64>, Vec<f64>)> = Vec::new();
        for share in [0.0, 0.5, 0.5, 1.0] {
            let (at, rate) = match slopes.last() {
                Some((rate, acceleration)) => {
                    let h = share * dt;
                    (moved(&q, rate, h), moved(&qd, acceleration, h))
                }
                None => (q.clone(), qd.clone()),
            };
            let acceleration = self.accelerations_at(&at, &rate, drives)?;
            slopes.push((rate, acceleration));
        }
        for ((rate, acceleration), weight) in slopes.iter().zip([1.0, 2.0, 2.0, 1.0]) {
            self.q = moved(&self.q, rate, weight * dt / 6.0);
            self.qd = moved(&self.qd, acceleration, weight * dt / 6.0);
        }
        Ok(())
    }

    /// Motion of all bodies in a state.
    fn motion_at(&mut self, q: &[f64], qd: &[f64], qdd: &[f64]) -> Result<RigMotion, PlantError> {
        let [q, qd, qdd] = [q, qd, qdd].map(<[f64]>::to_vec);
        let state = RigState { q, qd, qdd };
        self.tracker.follow(&state).map_err(PlantError::Pose)
    }

    /// Accelerations in a state, by Newton's method on the inverse dynamics.
    fn accelerations_at(&mut self, q: &[f64], qd: &[f64], drives: &[f64]) -> Result<Vec<f64>, PlantError> {
        let (n, expected) = (q.len(), self.rig.drives.len());
        if drives.len() != expected {
            let found = drives.len();
            return Err(PlantError::Count { found, expected });
        }
        let given = DVector::from_column_slice(drives);
        let needed = |plant: &mut Self, qdd: &DVector<f64>| {
            let motion = plant.motion_at(q, qd, qdd.as_slice())?;
            let found = forces(plant.rig, &motion).map_err(PlantError::Pose)?;
            Ok::<_, PlantError>(DVector::from_vec(found))
        };
        let mut qdd = DVector::zeros(n);
        let mut found = needed(self, &qdd)?;
        let mut per_acceleration = DMatrix::zeros(expected, n);
        for k in 0..n {
            let mut unit = qdd.clone();
            unit[k] = 1.0;
            per_acceleration.set_column(k, &(needed(self, &unit)? - &found));
        }
        let decomposed = per_acceleration.lu();
        // The magnitude of terms that may cancel, as in free fall, limits how accurately zero can be reached.
        let size = given.amax().max(found.amax()).max(f64::MIN_POSITIVE);
        for _ in 0..MOST_STEPS {
            let missing = &given - &found;
            if missing.amax() <= TOLERANCE * size {
                return Ok(qdd.as_slice().to_vec());
            }
            let step = decomposed.solve(&missing);
            qdd += step.ok_or(PlantError::NoAcceleration)?;
            found = needed(self, &qdd)?;
        }
        Err(PlantError::NoAcceleration)
    }
}
