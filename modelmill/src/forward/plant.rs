//! The equation of motion at one state, with drives that stick. State, forces of the drives and sticking places go
//! in, accelerations come out.
//!
//! With the independent coordinates z: `M z'' + b(z, z') = J' f`, where b has dry friction. At a sticking place, dry
//! friction may take any value between those of the two directions. It takes the value that keeps the place at
//! standstill (F. Pfeiffer and C. Glocker 1996, "Multibody Dynamics with Unilateral Contacts", chapter 5).
//!
//! Decision: dry friction is not read from the effects. It is the jump of b between two small rates of opposite sign,
//! so that every kind of friction is included, also those of a user's library.

use modelmill_codegen::{DynamicsPrograms, ModelEvaluator, MotionStates, PoseFault};
use modelmill_spec::{DriveKind, EffectPlace, ModelDrive};
use nalgebra::{DMatrix, DVector};

use crate::model::Model;

use super::thresholds::{DIRECTION_RATE, LEAST_DRY_FRICTION, LONGEST_STEP_S, SHORTEST_STEP_S, STEP_OF_SERVO};
use crate::segment::RecordingSegment;
use crate::segment::computed_forces::ComputedForces;

/// A place where dry friction may act.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum FrictionPlace {
    /// An independent coordinate.
    Coordinate(usize),
    /// A drive whose rate is a combination of the rates of coordinates.
    Drive(usize),
}

/// A model with values of its base parameters, ready for simulation.
pub(super) struct MotionPlant<'a> {
    evaluator: ModelEvaluator<'a>,
    dynamics: &'a DynamicsPrograms,
    values: &'a [f64],
    /// Number of independent coordinates.
    n: usize,
    n_drives: usize,
    places: Vec<FrictionPlace>,
    /// The independent coordinate of each drive; `None` if a drive moves another coordinate.
    drive_coordinates: Option<Vec<usize>>,
    /// The rate that decides a direction at standstill, rad/s or m/s.
    direction_rate: f64,
    /// Longest step of the integration, s.
    longest_step: f64,
}

/// Friction at sticking places that would keep them at standstill.
pub(super) struct StickBalance {
    /// Accelerations of the independent coordinates.
    pub(super) accelerations: Vec<f64>,
    /// The dry friction that is needed at each sticking place, relative to the largest possible one (1).
    pub(super) loads: Vec<f64>,
}

/// The equation of motion at one state, with all sticking places at the positive side.
struct StickEquation {
    mass: DMatrix<f64>,
    /// `J' f - b` without the dry friction of the sticking places.
    driving: DVector<f64>,
    /// Dry friction of each sticking place, as generalised forces.
    friction: DMatrix<f64>,
    /// Rates of the sticking places as functions of the rates of the coordinates.
    rows: DMatrix<f64>,
}

impl<'a> MotionPlant<'a> {
    /// Prepares a model for a segment whose motion or signals it is to follow.
    pub(super) fn new(
        model: &'a Model,
        dynamics: &'a DynamicsPrograms,
        values: &'a [f64],
        segment: &RecordingSegment,
    ) -> Self {
        let mechanism = &model.derivation.mechanism;
        let active: Vec<usize> = (0..mechanism.coordinates.len())
            .filter(|i| !mechanism.coordinates[*i].passive)
            .collect();
        let coordinate = |drive: &ModelDrive| match drive.kind {
            DriveKind::Joint(c) => active.iter().position(|i| *i == c.0),
            DriveKind::Linear { .. } => None,
        };
        let mut places = Vec::new();
        let effects = mechanism.effects.iter().filter(|effect| effect.mechanics.is_none());
        for place in effects.flat_map(|effect| &effect.places) {
            let found = match place {
                EffectPlace::Drive(d) => {
                    let own = coordinate(&mechanism.drives[d.0]).map(FrictionPlace::Coordinate);
                    Some(own.unwrap_or(FrictionPlace::Drive(d.0)))
                }
                EffectPlace::Coordinate(c) => active.iter().position(|i| *i == c.0).map(FrictionPlace::Coordinate),
                _ => None,
            };
            places.extend(found.filter(|one| !places.contains(one)));
        }
        let mut plant = Self {
            evaluator: ModelEvaluator::new(&model.derivation),
            dynamics,
            values,
            n: active.len(),
            n_drives: mechanism.drives.len(),
            places,
            drive_coordinates: mechanism.drives.iter().map(coordinate).collect(),
            direction_rate: fastest_rate(segment) * DIRECTION_RATE,
            longest_step: LONGEST_STEP_S,
        };
        if let Some(computed) = &segment.computed
            && let Some(fastest) = plant.servo_rate(segment, computed)
            && fastest > 0.0
        {
            plant.longest_step = (STEP_OF_SERVO / fastest).clamp(SHORTEST_STEP_S, LONGEST_STEP_S);
        }
        plant
    }

    /// Longest step of the integration, s.
    pub(super) fn longest_step(&self) -> f64 {
        self.longest_step
    }

    /// The fastest rate at which servos move the mechanism at the first state of a segment, 1/s: bounds of the eigenvalues
    /// of `M^-1 J' D J` and of the square root of those of `M^-1 J' K J`, with stiffnesses K and dampings D. `None` at a
    /// singular pose.
    fn servo_rate(&self, segment: &RecordingSegment, computed: &ComputedForces) -> Option<f64> {
        let q: Vec<f64> = segment.run.q.iter().map(|column| column[0]).collect();
        let zeros = vec![0.0; self.n];
        let states = single(&q, &zeros, &[]);
        let mass = self.evaluator.mass_matrix(self.dynamics, &states, self.values).ok()?;
        let inverse = solved(&self.square(&mass)).ok()?;
        let jacobian = self.drive_jacobian(&q).ok()?;
        let bound = |property: usize| {
            let mut diagonal = DVector::zeros(self.n_drives);
            for actuator in &computed.actuators {
                diagonal[actuator.drive] += actuator.stiffness_and_damping()[property];
            }
            let product = &inverse * jacobian.transpose() * DMatrix::from_diagonal(&diagonal) * &jacobian;
            let sums = product.row_iter().map(|row| row.iter().map(|x| x.abs()).sum::<f64>());
            sums.fold(0.0, f64::max)
        };
        Some(bound(1).max(bound(0).sqrt())).filter(|rate| rate.is_finite())
    }

    /// Position and rate of each drive at a state.
    pub(super) fn drive_motion(&self, q: &[f64], qd: &[f64]) -> Result<Vec<[f64; 2]>, PoseFault> {
        if let Some(coordinates) = &self.drive_coordinates {
            return Ok(coordinates.iter().map(|k| [q[*k], qd[*k]]).collect());
        }
        let found = (self.evaluator).drive_motion(&single(q, qd, &vec![0.0; self.n_drives]))?;
        let drives = 0..self.n_drives;
        Ok(drives.map(|d| [found[d][0], found[self.n_drives + d][0]]).collect())
    }

    /// Number of places where dry friction may act.
    pub(super) fn n_places(&self) -> usize {
        self.places.len()
    }

    /// Accelerations of the independent coordinates at a state; the places of `stuck` stay at standstill.
    pub(super) fn accelerations(
        &self,
        q: &[f64],
        qd: &[f64],
        forces: &[f64],
        stuck: &[usize],
    ) -> Result<Vec<f64>, PoseFault> {
        if stuck.is_empty() {
            let load: Vec<&[f64]> = forces.iter().map(std::slice::from_ref).collect();
            let states = single(q, qd, forces);
            let found = self
                .evaluator
                .forward_dynamics(self.dynamics, &states, self.values, &load)?;
            return Ok(found.iter().map(|column| column[0]).collect());
        }
        Ok(self.stick_balance(q, qd, forces, stuck)?.accelerations)
    }

    /// Accelerations at a state with sticking places, and the friction that keeps them at standstill.
    pub(super) fn stick_balance(
        &self,
        q: &[f64],
        qd: &[f64],
        forces: &[f64],
        stuck: &[usize],
    ) -> Result<StickBalance, PoseFault> {
        let equation = self.stick_equation(q, qd, forces, stuck)?;
        let inverse = solved(&equation.mass)?;
        let drift = self.row_drift(q, qd, stuck)?;
        // The place does not accelerate: rows z'' + drift = 0.
        let free = &inverse * &equation.driving;
        let effect = &equation.rows * &inverse * &equation.friction;
        let wanted = &equation.rows * &free + drift;
        let loads = pseudo_solved(effect, &wanted);
        let accelerations = free - inverse * &equation.friction * &loads;
        Ok(StickBalance {
            accelerations: accelerations.iter().copied().collect(),
            loads: loads.iter().copied().collect(),
        })
    }

    /// Rates of all places where dry friction may act.
    pub(super) fn place_rates(&self, q: &[f64], qd: &[f64]) -> Result<Vec<f64>, PoseFault> {
        let all: Vec<usize> = (0..self.places.len()).collect();
        let rows = self.rows(q, &all)?;
        Ok((rows * DVector::from_column_slice(qd)).iter().copied().collect())
    }

    /// Whether a place has dry friction at a state.
    pub(super) fn has_dry_friction(
        &self,
        q: &[f64],
        qd: &[f64],
        forces: &[f64],
        place: usize,
    ) -> Result<bool, PoseFault> {
        let equation = self.stick_equation(q, qd, forces, &[place])?;
        let scale = equation.driving.amax().max(equation.friction.amax());
        // Friction resists: with the sign of the rate it is on the other side of the equation.
        let work = (&equation.rows * &equation.friction)[(0, 0)];
        Ok(work > 0.0 && equation.friction.amax() > LEAST_DRY_FRICTION * scale)
    }

    /// The rates nearest to `qd`, in kinetic energy, at which the places of `stuck` are at standstill.
    pub(super) fn stopped(&self, q: &[f64], qd: &[f64], stuck: &[usize]) -> Result<Vec<f64>, PoseFault> {
        let states = single(q, qd, &[]);
        let mass = self.square(&self.evaluator.mass_matrix(self.dynamics, &states, self.values)?);
        let inverse = solved(&mass)?;
        let rows = self.rows(q, stuck)?;
        let rates = DVector::from_column_slice(qd);
        let impulse = pseudo_solved(&rows * &inverse * rows.transpose(), &(&rows * &rates));
        let stopped = rates - inverse * rows.transpose() * impulse;
        let mut stopped: Vec<f64> = stopped.iter().copied().collect();
        // Coordinates that stick themselves are exactly at standstill.
        for place in stuck {
            if let FrictionPlace::Coordinate(k) = self.places[*place] {
                stopped[k] = 0.0;
            }
        }
        Ok(stopped)
    }

    /// Small rates of the coordinates that move the place `moving` in a direction and none of `stuck`.
    pub(super) fn direction(
        &self,
        q: &[f64],
        moving: usize,
        stuck: &[usize],
        sign: f64,
    ) -> Result<Vec<f64>, PoseFault> {
        let mut all = stuck.to_vec();
        all.push(moving);
        let rows = self.rows(q, &all)?;
        let mut wanted = DVector::zeros(all.len());
        wanted[all.len() - 1] = sign * self.direction_rate;
        Ok(pseudo_solved(rows, &wanted).iter().copied().collect())
    }

    /// The equation of motion with the dry friction of the sticking places apart.
    fn stick_equation(
        &self,
        q: &[f64],
        qd: &[f64],
        forces: &[f64],
        stuck: &[usize],
    ) -> Result<StickEquation, PoseFault> {
        let rows = self.rows(q, stuck)?;
        // The first state has all places at the positive side; in each further one, one place is at the negative
        // side.
        let mut offsets = DMatrix::from_element(stuck.len(), stuck.len() + 1, self.direction_rate);
        for i in 0..stuck.len() {
            offsets[(i, i + 1)] = -self.direction_rate;
        }
        let still = DVector::from_column_slice(&self.stopped(q, qd, stuck)?);
        let moves = pseudo_inverse(rows.clone()) * offsets;
        let rates: Vec<Vec<f64>> = (0..self.n)
            .map(|k| moves.row(k).iter().map(|offset| still[k] + offset).collect())
            .collect();
        let repeated =
            |values: &[f64]| -> Vec<Vec<f64>> { values.iter().map(|value| vec![*value; stuck.len() + 1]).collect() };
        let (positions, loads, zeros) = (repeated(q), repeated(forces), repeated(&vec![0.0; self.n]));
        let states = MotionStates {
            q: positions.iter().map(Vec::as_slice).collect(),
            qd: rates.iter().map(Vec::as_slice).collect(),
            qdd: zeros.iter().map(Vec::as_slice).collect(),
            load: loads.iter().map(Vec::as_slice).collect(),
        };
        let bias = self.evaluator.bias(self.dynamics, &states, self.values)?;
        let one = single(q, qd, forces);
        let mass = self.square(&self.evaluator.mass_matrix(self.dynamics, &one, self.values)?);
        let friction = DMatrix::from_fn(self.n, stuck.len(), |k, i| 0.5 * (bias[k][0] - bias[k][i + 1]));
        let jacobian = self.drive_jacobian(q)?;
        let driven = jacobian.transpose() * DVector::from_column_slice(forces);
        let driving = DVector::from_fn(self.n, |k, _| driven[k] - bias[k][0] + friction.row(k).sum());
        Ok(StickEquation {
            mass,
            driving,
            friction,
            rows,
        })
    }

    /// Rates of places as rows over the rates of the coordinates.
    fn rows(&self, q: &[f64], places: &[usize]) -> Result<DMatrix<f64>, PoseFault> {
        let mut rows = DMatrix::zeros(places.len(), self.n);
        let of_drives = places
            .iter()
            .any(|place| matches!(self.places[*place], FrictionPlace::Drive(_)));
        let jacobian = if of_drives { Some(self.drive_jacobian(q)?) } else { None };
        for (i, place) in places.iter().enumerate() {
            match (self.places[*place], &jacobian) {
                (FrictionPlace::Coordinate(k), _) => rows[(i, k)] = 1.0,
                (FrictionPlace::Drive(d), Some(jacobian)) => rows.set_row(i, &jacobian.row(d)),
                (FrictionPlace::Drive(_), None) => {}
            }
        }
        Ok(rows)
    }

    /// Accelerations of places without accelerations of the coordinates, by a central difference along the motion.
    fn row_drift(&self, q: &[f64], qd: &[f64], places: &[usize]) -> Result<DVector<f64>, PoseFault> {
        let rates = DVector::from_column_slice(qd);
        let fastest = rates.amax();
        let of_coordinates = |place: &usize| matches!(self.places[*place], FrictionPlace::Coordinate(_));
        if fastest <= self.direction_rate || places.iter().all(of_coordinates) {
            return Ok(DVector::zeros(places.len()));
        }
        // Half of the digits is the best step of a difference.
        let step = 1e-6 / fastest;
        let moved = |sign: f64| -> Vec<f64> { q.iter().zip(qd).map(|(q, v)| q + sign * step * v).collect() };
        let [after, before] = [self.rows(&moved(1.0), places)?, self.rows(&moved(-1.0), places)?];
        Ok((after - before) * rates / (2.0 * step))
    }

    /// Rates of the drives over rates of the coordinates.
    fn drive_jacobian(&self, q: &[f64]) -> Result<DMatrix<f64>, PoseFault> {
        let zeros = vec![0.0; self.n];
        let found = self
            .evaluator
            .drive_motion(&single(q, &zeros, &vec![0.0; self.n_drives]))?;
        let entries = &found[2 * self.n_drives..];
        Ok(DMatrix::from_fn(self.n_drives, self.n, |d, k| {
            entries[d * self.n + k][0]
        }))
    }

    /// A square matrix from its entries row by row at one state.
    fn square(&self, entries: &[Vec<f64>]) -> DMatrix<f64> {
        DMatrix::from_fn(self.n, self.n, |i, k| entries[i * self.n + k][0])
    }
}

/// One state as input of the evaluator. Accelerations are not read.
fn single<'s>(q: &'s [f64], qd: &'s [f64], forces: &'s [f64]) -> MotionStates<'s> {
    let columns = |values: &'s [f64]| values.iter().map(std::slice::from_ref).collect::<Vec<_>>();
    MotionStates {
        q: columns(q),
        qd: columns(qd),
        qdd: columns(qd),
        load: columns(forces),
    }
}

/// The inverse of a mass matrix.
fn solved(mass: &DMatrix<f64>) -> Result<DMatrix<f64>, PoseFault> {
    mass.clone().try_inverse().ok_or(PoseFault {
        sample: 0,
        reason: modelmill_codegen::PoseReason::Singular,
    })
}

/// The pseudo-inverse: redundant places share their friction.
fn pseudo_inverse(matrix: DMatrix<f64>) -> DMatrix<f64> {
    let (rows, columns) = matrix.shape();
    let largest = matrix.amax();
    let found = matrix.pseudo_inverse(1e-12 * largest.max(f64::MIN_POSITIVE));
    found.unwrap_or_else(|_| DMatrix::zeros(columns, rows))
}

/// The solution of a linear system with the least norm.
fn pseudo_solved(matrix: DMatrix<f64>, right: &DVector<f64>) -> DVector<f64> {
    pseudo_inverse(matrix) * right
}

/// The fastest rate of a coordinate in a segment, rad/s or m/s; 1 if nothing moves.
fn fastest_rate(segment: &RecordingSegment) -> f64 {
    let rates = segment.run.qd.iter().flatten().map(|rate| rate.abs());
    let fastest = rates.fold(0.0, f64::max);
    if fastest > 0.0 { fastest } else { 1.0 }
}
