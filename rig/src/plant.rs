//! The rig moved by its drives: forces go in, motion comes out, as a controller sees a machine.
//!
//! The forces of a motion are known (`forces`), and they are affine in the accelerations but for friction that grows with
//! the load; so accelerations for given forces are found by Newton's method with one column per coordinate. Time goes on
//! by the classical rule of Runge and Kutta, with forces held during a step, in the coordinates alone: joints stay closed
//! because every pose is solved.
//!
//! Decision: forward dynamics is Newton's method on the inverse dynamics, so that every effect has one definition
//! for both directions.

use std::fmt;

use nalgebra::{DMatrix, DVector};

use crate::kinematics::{RigMotion, RigPoseError, RigState, RigTracker};
use crate::rig::Rig;
use crate::simulate::forces;

/// Steps of Newton's method before it is given up; one is enough without friction by load.
const MOST_STEPS: usize = 20;
/// Forces agree to this share of their size.
const TOLERANCE: f64 = 1e-10;

/// A rig in motion.
#[derive(Debug)]
pub struct RigPlant<'r> {
    rig: &'r Rig,
    tracker: RigTracker<'r>,
    q: Vec<f64>,
    qd: Vec<f64>,
}

/// Why a rig cannot move on.
#[derive(Clone, Debug, PartialEq)]
pub enum PlantError {
    /// As many numbers as coordinates or drives are expected.
    Count {
        /// How many there are.
        found: usize,
        /// How many are expected.
        expected: usize,
    },
    /// It cannot be where it moved.
    Pose(RigPoseError),
    /// No accelerations go with the forces: a freedom without mass, or friction that jams.
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
    /// Fails where it cannot be.
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

    /// Their rates.
    pub fn qd(&self) -> &[f64] {
        &self.qd
    }

    /// Motion of all bodies, with given accelerations of the coordinates.
    ///
    /// Fails where the rig cannot be.
    pub fn motion(&mut self, qdd: &[f64]) -> Result<RigMotion, PlantError> {
        let (q, qd) = (self.q.clone(), self.qd.clone());
        self.motion_at(&q, &qd, qdd)
    }

    /// Accelerations of the coordinates under forces of the drives, N or N m.
    ///
    /// Fails where no accelerations go with them.
    pub fn accelerations(&mut self, drives: &[f64]) -> Result<Vec<f64>, PlantError> {
        let (q, qd) = (self.q.clone(), self.qd.clone());
        self.accelerations_at(&q, &qd, drives)
    }

    /// Moves on by `dt` seconds with forces of the drives held, N or N m.
    ///
    /// Fails where the rig cannot move on; it stays where it was then.
    pub fn step(&mut self, drives: &[f64], dt: f64) -> Result<(), PlantError> {
        let moved = |x: &[f64], by: &[f64], h: f64| -> Vec<f64> {
            x.iter().zip(by).map(|(x, d)| x + h * d).collect()
        };
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

    fn motion_at(&mut self, q: &[f64], qd: &[f64], qdd: &[f64]) -> Result<RigMotion, PlantError> {
        let [q, qd, qdd] = [q, qd, qdd].map(<[f64]>::to_vec);
        let state = RigState { q, qd, qdd };
        self.tracker.follow(&state).map_err(PlantError::Pose)
    }

    fn accelerations_at(
        &mut self,
        q: &[f64],
        qd: &[f64],
        drives: &[f64],
    ) -> Result<Vec<f64>, PlantError> {
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
        // What may cancel, as where a rig falls freely, says how well zero can be met.
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
