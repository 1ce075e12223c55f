//! A run of the rig along a trajectory: motion, forces of the drives with all effects, and readings of the sensors.

use std::fmt;

use crate::dynamics::{ScalarMotion, drive_forces, scalar_motion};
use crate::effect::{RigLaw, RigPlace};
use crate::kinematics::{RigMotion, RigPoseError, RigState, RigTracker};
use crate::noise::GaussianNoise;
use crate::pair::PairFunction;
use crate::rig::Rig;
use crate::trajectory::Trajectory;

/// Largest number of samples of a run; a higher sampling rate is probably a mistake.
const MOST_SAMPLES: f64 = 1e7;

/// Exact forces and motion at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct SimulatedInstant {
    /// Coordinates with derivatives, as prescribed.
    pub state: RigState,
    /// Force or torque of each drive, N or N m, effects included.
    pub forces: Vec<f64>,
}

/// A recording of the rig.
#[derive(Clone, Debug, PartialEq)]
pub struct RigRecording {
    /// Names and numbers of the columns: `t`, coordinates, their derivatives, drives; all of the same length.
    pub columns: Vec<(String, Vec<f64>)>,
    /// Remarks for the user.
    pub notes: Vec<String>,
}

/// Why a rig cannot follow a trajectory.
#[derive(Clone, Debug, PartialEq)]
pub enum SimulationError {
    /// The trajectory has another number of coordinates than the rig.
    Coordinates {
        /// Those of the rig.
        rig: usize,
        /// Those of the trajectory.
        trajectory: usize,
    },
    /// The rig cannot be assembled in its nominal configuration.
    Nominal(RigPoseError),
    /// It cannot reach a pose of the trajectory.
    Pose {
        /// Time, s.
        time: f64,
        /// Reason.
        reason: RigPoseError,
    },
    /// A force or a reading is infinite or NaN.
    NotFinite {
        /// Time, s.
        time: f64,
        /// Name of the column.
        column: String,
        /// The body with the largest number, by name, and that number.
        largest: Option<String>,
    },
    /// There is no sample, because the delay is longer than the trajectory.
    NothingLeft {
        /// The longest delay, s.
        delay: f64,
    },
    /// The sampling rate gives too many samples.
    TooManySamples {
        /// Samples per second.
        rate: f64,
    },
}

impl fmt::Display for SimulationError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Coordinates { rig, trajectory } => write!(
                f,
                "the rig has {rig} coordinates and the trajectory {trajectory}; give one column for each"
            ),
            Self::Nominal(reason) => write!(f, "in the nominal configuration {reason}"),
            Self::Pose { time, reason } => write!(f, "at t = {time} s {reason}"),
            Self::NotFinite { time, column, largest } => {
                write!(f, "at t = {time} s `{column}` is not finite; ")?;
                match largest {
                    Some(largest) => write!(f, "{largest} is too large to compute with"),
                    None => f.write_str("look for very large numbers in the rig and in the trajectory"),
                }
            }
            Self::NothingLeft { delay } => write!(
                f,
                "the delay of a sensor, {delay} s, is longer than the trajectory; shorten the delay"
            ),
            Self::TooManySamples { rate } => write!(
                f,
                "{rate} samples per second make more than {MOST_SAMPLES:.0} samples; lower the rate"
            ),
        }
    }
}

impl std::error::Error for SimulationError {}

/// The exact motion and forces at given times, without sensors; `progress` is called after each.
///
/// Fails if the rig cannot follow the trajectory.
pub fn forces_along(
    rig: &Rig,
    trajectory: &Trajectory,
    times: &[f64],
    mut progress: impl FnMut(),
) -> Result<Vec<SimulatedInstant>, SimulationError> {
    if trajectory.n_coordinates() != rig.coordinates.len() {
        return Err(SimulationError::Coordinates {
            rig: rig.coordinates.len(),
            trajectory: trajectory.n_coordinates(),
        });
    }
    let mut tracker = RigTracker::new(rig).map_err(SimulationError::Nominal)?;
    let mut instants = Vec::with_capacity(times.len());
    for &time in times {
        let state = trajectory.state_at(time);
        let forces = tracker
            .follow(&state)
            .and_then(|motion| forces(rig, &motion))
            .map_err(|reason| SimulationError::Pose { time, reason })?;
        instants.push(SimulatedInstant { state, forces });
        progress();
    }
    Ok(instants)
}

/// Forces of the drives for a motion, N or N m, with all effects; in the rig's order.
///
/// Effects at drives add to their forces. Effects in joints are loads that the drives balance, and effects with
/// mass are loads like those of bodies. A `time_delay` belongs to the sensors and has no effect here.
/// Fails if the drives cannot balance a load.
pub fn forces(rig: &Rig, motion: &RigMotion) -> Result<Vec<f64>, RigPoseError> {
    let mechanical = drive_forces(rig, motion, &[])?;
    // Without effects the mechanics alone gives the forces.
    if rig.effects.is_empty() {
        return Ok(mechanical);
    }
    // Motion at a place; a place without a coordinate has none.
    let measured = |place: RigPlace| {
        place
            .pair(rig)
            .map_or_else(ScalarMotion::default, |pair| scalar_motion(pair, motion))
    };
    // Programs may construct places directly: an index out of range has no effect.
    let load = |drive: usize| mechanical.get(drive).copied().unwrap_or(0.0);
    let mut at_drives = vec![0.0; rig.drives.len()];
    // Effects at drives add to the result; those in joints become loads of a second solution.
    let mut in_joints: Vec<(&PairFunction, f64)> = Vec::new();
    for effect in &rig.effects {
        for (place, force) in effect.forces(measured, load) {
            match place {
                RigPlace::Drive(drive) => {
                    if let Some(sum) = at_drives.get_mut(drive) {
                        *sum += force;
                    }
                }
                place => in_joints.extend(place.pair(rig).map(|pair| (pair, force))),
            }
        }
    }
    let mut forces = if in_joints.is_empty() {
        mechanical
    // With loads in joints the balance is solved once more.
    } else {
        drive_forces(rig, motion, &in_joints)?
    };
    for (force, added) in forces.iter_mut().zip(&at_drives) {
        *force += added;
    }
    Ok(forces)
}

/// Value, rate and acceleration of a drive or of a joint with one coordinate; `None` elsewhere.
pub fn place_motion(rig: &Rig, place: RigPlace, motion: &RigMotion) -> Option<ScalarMotion> {
    Some(scalar_motion(place.pair(rig)?, motion))
}

/// Number of times that the mechanics is solved in a run, for progress.
pub fn n_instants(rig: &Rig, trajectory: &Trajectory) -> usize {
    let (times, _) = sample_times(rig, trajectory).unwrap_or_default();
    times.len() * (1 + delays(rig).len())
}

/// Simulates the rig along a trajectory and reads its sensors; `seed` replaces the rig's own.
///
/// Fails if the rig cannot follow, or if delays or the sampling rate give no useful recording.
pub fn simulate(
    rig: &Rig,
    trajectory: &Trajectory,
    seed: Option<u64>,
    mut progress: impl FnMut(),
) -> Result<RigRecording, SimulationError> {
    let (times, mut notes) = sample_times(rig, trajectory)?;
    let present = forces_along(rig, trajectory, &times, &mut progress)?;
    // Delayed sensors read the motion of earlier times, which is computed for every different delay.
    let mut past: Vec<(f64, Vec<SimulatedInstant>)> = Vec::new();
    for delay in delays(rig) {
        let earlier: Vec<f64> = times.iter().map(|t| t - delay).collect();
        past.push((delay, forces_along(rig, trajectory, &earlier, &mut progress)?));
    }
    // Delays are compared bit by bit, since they come from the same numbers.
    let at = |delay: f64| {
        past.iter()
            .find(|(known, _)| known.to_bits() == delay.to_bits())
            .map_or(&present, |(_, instants)| instants)
    };
    let seed = seed.unwrap_or(rig.seed);
    // Every channel has an independent stream of noise.
    let mut channel = 0;
    let mut noise = || {
        channel += 1;
        GaussianNoise::new(seed, channel)
    };
    let names = rig.coordinates.iter().map(|c| c.name.as_str());
    // Columns: time, readings of the encoders, derivatives, readings of the force sensors.
    let mut columns = vec![("t".to_owned(), times)];
    for (k, (name, encoder)) in names.clone().zip(&rig.sensors.encoders).enumerate() {
        let mut noise = noise();
        let values = at(encoder.delay).iter();
        let read = values.map(|instant| encoder.read(instant.state.q[k], &mut noise));
        columns.push((name.to_owned(), read.collect()));
    }
    if rig.sensors.derivatives {
        for (suffix, of) in [
            ("_d", (|s: &RigState| &s.qd) as fn(&RigState) -> &Vec<f64>),
            ("_dd", |s: &RigState| &s.qdd),
        ] {
            for (k, (name, encoder)) in names.clone().zip(&rig.sensors.encoders).enumerate() {
                let values = at(encoder.delay).iter().map(|instant| of(&instant.state)[k]);
                columns.push((format!("{name}{suffix}"), values.collect()));
            }
        }
    } else {
        notes.push(
            "positions only, as encoders give them; `derivatives = true` in `[sampling]` adds exact derivatives"
                .to_owned(),
        );
    }
    for (d, (drive, sensor)) in rig.drives.iter().zip(&rig.sensors.force_sensors).enumerate() {
        let mut noise = noise();
        let values = at(sensor.delay + force_delay(rig)).iter();
        let read = values.map(|instant| sensor.read(instant.forces[d], &mut noise));
        columns.push((drive.name.clone(), read.collect()));
    }
    check_finite(rig, &columns)?;
    Ok(RigRecording { columns, notes })
}

/// Checks that a recording contains finite numbers only.
fn check_finite(rig: &Rig, columns: &[(String, Vec<f64>)]) -> Result<(), SimulationError> {
    let first = columns.iter().filter_map(|(name, values)| {
        let at = values.iter().position(|value| !value.is_finite())?;
        Some((at, name))
    });
    // The earliest fault of all columns is reported.
    let Some((at, column)) = first.min_by_key(|(at, _)| *at) else {
        return Ok(());
    };
    Err(SimulationError::NotFinite {
        time: columns[0].1[at],
        column: column.clone(),
        largest: largest_number(rig),
    })
}

/// The largest number of a body that makes forces overflow, as text, if there is one.
fn largest_number(rig: &Rig) -> Option<String> {
    /// Forces are products of masses, squares of lengths and of rates.
    const TOO_LARGE: f64 = 1e60;
    let numbers = rig.bodies.iter().flat_map(|body| {
        [
            ("mass", body.mass.abs()),
            ("centre", body.centre.amax()),
            ("inertia", body.inertia.amax()),
            ("place", body.nominal.p_WB_W.amax()),
        ]
        .map(|(what, value)| (body, what, value))
    });
    let (body, what, value) = numbers.max_by(|a, b| a.2.total_cmp(&b.2))?;
    (value > TOO_LARGE).then(|| format!("the {what} of the body `{}` ({value:e})", body.name))
}

/// Times of the samples, those of the trajectory or evenly spaced, with notes. Times at which a delayed reading would
/// lie before the trajectory are left out.
fn sample_times(rig: &Rig, trajectory: &Trajectory) -> Result<(Vec<f64>, Vec<String>), SimulationError> {
    let given = trajectory.time();
    let (start, end) = (given[0], given[given.len() - 1]);
    let all = match rig.sensors.rate {
        None => given.to_vec(),
        Some(rate) => {
            // A last sample that rounding moves just behind the end is included.
            let n = ((end - start) * rate + 1e-6).floor();
            if n > MOST_SAMPLES {
                return Err(SimulationError::TooManySamples { rate });
            }
            let mut times = Vec::new();
            while times.len() as f64 <= n {
                times.push((start + times.len() as f64 / rate).min(end));
            }
            times
        }
    };
    let longest = delays(rig).into_iter().fold(0.0, f64::max);
    let n_all = all.len();
    let times: Vec<f64> = all.into_iter().filter(|t| t - longest >= start).collect();
    if times.is_empty() {
        return Err(SimulationError::NothingLeft { delay: longest });
    }
    let mut notes = Vec::new();
    if times.len() < n_all {
        notes.push(format!(
            "the first {} samples are left out: a sensor has a delay of {longest} s, and the trajectory starts at t = \
             {start} s",
            n_all - times.len()
        ));
    }
    Ok((times, notes))
}

/// The different delays of all sensors, without zero, s.
fn delays(rig: &Rig) -> Vec<f64> {
    let encoders = rig.sensors.encoders.iter().map(|channel| channel.delay);
    let lag = force_delay(rig);
    let forces = rig.sensors.force_sensors.iter().map(|channel| channel.delay + lag);
    let mut delays: Vec<f64> = encoders.chain(forces).filter(|d| *d > 0.0).collect();
    delays.sort_by(f64::total_cmp);
    delays.dedup();
    delays
}

/// Delay of all forces by effects, s.
fn force_delay(rig: &Rig) -> f64 {
    let lag = |law: &RigLaw| match law {
        RigLaw::TimeDelay { T } => *T,
        _ => 0.0,
    };
    rig.effects.iter().map(|effect| lag(&effect.law)).sum()
}
