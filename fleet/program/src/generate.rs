//! Simulates a fleet with known changes: robots of one kind that differ slightly. Some wear, carry another load from a
//! day on, or lose a sensor.
//!
//! The robot is a five-bar, simulated as a rig, so that its mechanics are independent of the derived model. The rig
//! follows each motion once and gives the contribution of each mass, first moment and inertia of a body to the forces,
//! which are linear in them. A robot is a set of these numbers, with friction. A recording is one of the motions from
//! some moment on, through the rig's sensors.

use std::fs;
use std::io::BufWriter;
use std::path::Path;
use std::sync::Arc;

use modelmill_fleet::FleetFault;
use modelmill_rig::{GaussianNoise, RigBody, RigState, RigTracker, SensorChannel, forces};
use nalgebra::{Matrix3, Vector3};
use parquet::basic::{Compression, Repetition, Type as Physical};
use parquet::data_type::{DoubleType, FloatType};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use rayon::prelude::*;
use serde_json::{Value, json};

/// The machine as a rig.
const RIG: &str = include_str!("../five_bar.rig.toml");
/// The bundled model.
const MODEL: &str = include_str!("../../../model-spec/models/five_bar.toml");
/// The model of the fleet: the bundled one with friction.
const FRICTION: &str = r#"# The bundled five-bar with friction of both motors.
schema = 1
name = "five_bar_friction"
extends = "five_bar.toml"

[[effect]]
name = "dry_left"
kind = "coulomb_friction"
at = ["motor_left"]
parameters = { Fc = { name = "Fc_left", nominal = 0.8 } }

[[effect]]
name = "dry_right"
kind = "coulomb_friction"
at = ["motor_right"]
parameters = { Fc = { name = "Fc_right", nominal = 0.7 } }

[[effect]]
name = "viscous_left"
kind = "viscous_friction"
at = ["motor_left"]
parameters = { Fv = { name = "Fv_left", nominal = 0.5 } }

[[effect]]
name = "viscous_right"
kind = "viscous_friction"
at = ["motor_right"]
parameters = { Fv = { name = "Fv_right", nominal = 0.6 } }
"#;

/// ZZ, MX, MY and M of each link about its joint, as in the bundled model.
const LINKS: [[f64; 4]; 4] = [
    [0.14, 0.45, 0.01, 2.0],
    [0.13, 0.33, 0.005, 1.1],
    [0.15, 0.47, -0.01, 2.1],
    [0.14, 0.36, 0.004, 1.2],
];
/// Coulomb friction of the motors, N m.
const DRY: [f64; 2] = [0.8, 0.7];
/// Viscous friction of the motors, N m s/rad.
const VISCOUS: [f64; 2] = [0.5, 0.6];
/// Distance from the elbow to the tip, m.
const TO_TIP: f64 = 0.6;
/// Period of each motion, s.
const PERIOD: f64 = 6.0;
/// Harmonics of each motion.
const HARMONICS: usize = 6;
/// Number of motions in the fleet.
const MOTIONS: usize = 4;
/// Mean angles of the motors, rad.
const MIDDLE: [f64; 2] = [1.95, 1.19];
/// Largest deflection from the mean angles, rad.
const REACH: f64 = 0.3;
/// Relative standard deviation of masses and inertias between robots.
const ROBOTS: f64 = 0.01;
/// Relative standard deviation of friction between robots.
const FRICTIONS: f64 = 0.05;
/// Relative standard deviation of friction between recordings of one robot.
const DAILY: f64 = 0.005;
/// Encoders: 17 bits, noise in rad.
const ENCODER: SensorChannel = SensorChannel {
    noise: 2e-5,
    resolution: std::f64::consts::TAU / 131_072.0,
    delay: 0.0,
};
/// Torque sensors, noise and resolution in N m.
const TORQUE: SensorChannel = SensorChannel {
    noise: 0.05,
    resolution: 1.0 / 1024.0,
    delay: 0.0,
};

/// Size and seed of a fleet.
#[derive(Clone, Debug)]
pub struct FleetSize {
    /// Number of robots.
    pub robots: usize,
    /// Number of days, six or more.
    pub days: usize,
    /// Recordings per robot and day.
    pub per_day: usize,
    /// Duration of each recording, s.
    pub seconds: f64,
    /// Sampling rate, Hz.
    pub rate: f64,
    /// Seed; another seed gives another fleet.
    pub seed: u64,
    /// Number of recordings that are cut off.
    pub bad: usize,
    /// Size of the changes of friction and load: 1 as in the guide, less for smaller ones.
    pub changes: f64,
}

/// The known change of a robot.
#[derive(Clone, Debug)]
enum PlantedChange {
    /// No change.
    Nothing,
    /// Friction of a motor grows every day by the share `per_day` of its first value, from a day on.
    Wear {
        /// Index of the motor.
        drive: usize,
        /// Index of the first day.
        day: usize,
        /// Growth per day relative to the first value.
        per_day: f64,
    },
    /// A mass at the tip from a day on.
    Load {
        /// Index of the first day.
        day: usize,
        /// Mass, kg.
        mass: f64,
    },
    /// The torque sensor of a motor is constant from a day on.
    Dead {
        /// Index of the motor.
        drive: usize,
        /// Index of the first day.
        day: usize,
    },
    /// A mass at the tip on all days, so that the robot differs from the others.
    Odd {
        /// Mass, kg.
        mass: f64,
    },
}

impl PlantedChange {
    /// The change as JSON for `truth.json`; `days` are the names of the days.
    fn json(&self, days: &[String]) -> Value {
        let motor = |drive: &usize| ["motor_left", "motor_right"][*drive];
        match self {
            Self::Nothing => json!({ "kind": "none" }),
            Self::Wear { drive, day, per_day } => {
                json!({ "kind": "wear", "at": motor(drive), "day": days[*day], "place": day, "per_day": per_day })
            }
            Self::Load { day, mass } => {
                json!({ "kind": "payload", "at": "link2", "day": days[*day], "place": day, "mass": mass })
            }
            Self::Dead { drive, day } => {
                json!({ "kind": "dead_sensor", "at": motor(drive), "day": days[*day], "place": day })
            }
            Self::Odd { mass } => json!({ "kind": "odd", "at": "link2", "mass": mass }),
        }
    }
}

/// One period of a motion, with the contribution of each number of each link to the torques.
struct FleetMotion {
    /// Positions of the motors, rad.
    q: [Vec<f64>; 2],
    /// Rates of the motors, rad/s.
    qd: [Vec<f64>; 2],
    /// `[link][number][drive][sample]`: torque for a number (ZZ, MX, MY, M) of one.
    columns: Vec<[[Vec<f64>; 2]; 4]>,
}

/// Writes a fleet into a folder: a model file, Parquet by robot, day and recording, and `truth.json`, which is also
/// returned.
///
/// Fails if the size is too small, or the folder cannot be written to.
pub fn generate(folder: &Path, size: &FleetSize) -> Result<Value, FleetFault> {
    let is_large_enough = size.robots > 0
        && size.days >= 6
        && size.per_day > 0
        && size.seconds >= 5.0
        && size.rate >= 20.0
        && size.changes >= 0.0;
    if !is_large_enough {
        return Err(FleetFault::new(
            "the fleet is too small: at least one robot, six days, one recording per day of 5 s at 20 Hz, and changes of at least 0 are needed",
        ));
    }
    write_text(&folder.join("five_bar.toml"), MODEL)?;
    write_text(&folder.join("model.toml"), FRICTION)?;
    let data = folder.join("recordings");
    // The motions that all robots share; then the robots with their changes.
    let motions: Vec<FleetMotion> = (0..MOTIONS)
        .into_par_iter()
        .map(|k| motion(size, k))
        .collect::<Result<_, _>>()?;
    let days: Vec<String> = (0..size.days).map(date).collect();
    let robots: Vec<(String, PlantedChange)> = (0..size.robots)
        .map(|r| (format!("R{r:05}"), planted_change(size, r)))
        .collect();
    let bad = bad_recordings(size);
    robots.par_iter().enumerate().try_for_each(|(r, (name, planted))| {
        // One file for each recording, in folders by robot and day.
        let robot = robot_parameters(size, r);
        for day in 0..size.days {
            for k in 0..size.per_day {
                let path = data
                    .join(format!("robot={name}"))
                    .join(format!("day={}", days[day]))
                    .join(format!("recording={k}"));
                fs::create_dir_all(&path).map_err(|error| write_fault(&path, &error))?;
                let path = path.join("data.parquet");
                write_recording(&path, size, &motions, &robot, planted, (r, day, k))?;
                if bad.contains(&(r, day, k)) {
                    truncate_file(&path)?;
                }
            }
        }
        Ok::<_, FleetFault>(())
    })?;
    // The names of the recordings that were cut off.
    let bad = bad
        .iter()
        .map(|(r, day, k)| format!("robot={}/day={}/recording={k}/data.parquet", robots[*r].0, days[*day]));
    let truth = json!({
        "seed": size.seed,
        "changes": size.changes,
        "robots": robots.iter().map(|(name, planted)| json!({ "robot": name, "planted": planted.json(&days) })).collect::<Vec<_>>(),
        "days": days,
        "per_day": size.per_day,
        "samples": samples(size),
        "bad": bad.collect::<Vec<_>>(),
    });
    write_text(&folder.join("truth.json"), &format!("{truth:#}\n"))?;
    Ok(truth)
}

/// A number of at least zero, rounded to an integer.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "sizes of a fleet"
)]
fn rounded_count(x: f64) -> usize {
    x.round() as usize
}

/// A random index below `n`, uniformly distributed.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "below n, which is one"
)]
fn random_index(noise: &mut GaussianNoise, n: usize) -> usize {
    ((noise.uniform() * n as f64) as usize).min(n - 1)
}

/// Number of samples of a recording.
fn samples(size: &FleetSize) -> usize {
    rounded_count(size.seconds * size.rate)
}

/// The date of a day, counted from 1 March 2026.
fn date(day: usize) -> String {
    // Lengths of the months from March to December.
    let lengths = [31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
    let (mut month, mut left) = (3, day);
    for length in lengths {
        if left < length {
            break;
        }
        left -= length;
        month += 1;
    }
    format!("2026-{month:02}-{:02}", left + 1)
}

/// Writes a text file, and creates its folder.
fn write_text(path: &Path, text: &str) -> Result<(), FleetFault> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder).map_err(|error| write_fault(folder, &error))?;
    }
    fs::write(path, text).map_err(|error| write_fault(path, &error))
}

/// The fault of a file that cannot be written.
fn write_fault(path: &Path, error: &dyn std::fmt::Display) -> FleetFault {
    FleetFault::new(format!(
        "{} cannot be written: {error}; choose another folder, or free disk space",
        path.display()
    ))
}

/// Motion `k` of the fleet: a random Fourier series for each motor, and the torques of the rig along it.
fn motion(size: &FleetSize, k: usize) -> Result<FleetMotion, FleetFault> {
    let files = modelmill::files::MemoryFiles::default();
    let mut rig = modelmill_rig::load("five_bar.rig.toml", RIG, &files)
        .map_err(|failure| FleetFault::new(failure.render(false)))?
        .rig;
    let mut noise = GaussianNoise::new(size.seed, 1_000 + k as u64);
    // Random amplitudes of sine and cosine, scaled so that no deflection exceeds the reach.
    let mut waves = [[[0.0; 2]; HARMONICS]; 2];
    for waves in &mut waves {
        let mut largest = 0.0;
        for (h, wave) in waves.iter_mut().enumerate() {
            *wave = [0, 1].map(|_| noise.normal() / (1.0 + h as f64).sqrt());
            largest += wave[0].hypot(wave[1]);
        }
        for x in waves.iter_mut().flatten() {
            *x *= REACH / largest;
        }
    }
    // Angles, rates and accelerations of the series.
    let state = |t: f64| {
        let mut state = RigState {
            q: MIDDLE.to_vec(),
            qd: vec![0.0; 2],
            qdd: vec![0.0; 2],
        };
        for (j, waves) in waves.iter().enumerate() {
            for (h, [a, b]) in waves.iter().enumerate() {
                let w = std::f64::consts::TAU * (h + 1) as f64 / PERIOD;
                let (s, c) = (libm::sin(w * t), libm::cos(w * t));
                state.q[j] += a * s + b * c;
                state.qd[j] += w * (a * c - b * s);
                state.qdd[j] -= w * w * (a * s + b * c);
            }
        }
        state
    };
    let n = rounded_count(PERIOD * size.rate);
    // Track the motion of all bodies once; then compute the torques for one number after the other.
    let tracked = rig.clone();
    let mut tracker = RigTracker::new(&tracked).map_err(FleetFault::new)?;
    let mut one = FleetMotion {
        q: [Vec::with_capacity(n), Vec::with_capacity(n)],
        qd: [Vec::with_capacity(n), Vec::with_capacity(n)],
        columns: (0..LINKS.len())
            .map(|_| std::array::from_fn(|_| [Vec::new(), Vec::new()]))
            .collect(),
    };
    // All links without mass; then one number of one link at a time.
    for body in &mut rig.bodies {
        set_link(body, [0.0; 4]);
    }
    for i in 0..n {
        let state = state(i as f64 / size.rate);
        let moved = tracker.follow(&state).map_err(FleetFault::new)?;
        for j in 0..2 {
            one.q[j].push(state.q[j]);
            one.qd[j].push(state.qd[j]);
        }
        for link in 0..LINKS.len() {
            let mut of = |numbers: [f64; 4]| {
                set_link(&mut rig.bodies[link], numbers);
                let found = forces(&rig, &moved).map_err(FleetFault::new);
                set_link(&mut rig.bodies[link], [0.0; 4]);
                found
            };
            // Torques are linear in ZZ, MX, MY and M. First moments need a mass, so their columns are differences.
            let zz = of([1.0, 0.0, 0.0, 0.0])?;
            let m = of([0.0, 0.0, 0.0, 1.0])?;
            let with_x = of([1.0, 1.0, 0.0, 1.0])?;
            let with_y = of([1.0, 0.0, 1.0, 1.0])?;
            for d in 0..2 {
                let base = zz[d] + m[d];
                for (number, force) in [zz[d], with_x[d] - base, with_y[d] - base, m[d]]
                    .into_iter()
                    .enumerate()
                {
                    one.columns[link][number][d].push(force);
                }
            }
        }
    }
    Ok(one)
}

/// Sets the numbers ZZ, MX, MY and M of a body of the rig, about its joint.
fn set_link(body: &mut RigBody, [zz, mx, my, m]: [f64; 4]) {
    body.mass = m;
    body.centre = if m == 0.0 {
        Vector3::zeros()
    } else {
        Vector3::new(mx / m, my / m, 0.0)
    };
    let about_centre = zz - m * body.centre.norm_squared();
    body.inertia = Matrix3::from_diagonal(&Vector3::new(0.0, 0.0, about_centre));
}

/// Parameters of a robot.
struct RobotParameters {
    /// ZZ, MX, MY and M of each link.
    links: [[f64; 4]; 4],
    /// Coulomb friction of each motor, N m.
    dry: [f64; 2],
    /// Viscous friction of each motor, N m s/rad.
    viscous: [f64; 2],
}

/// Random parameters of robot `r` around those of the model.
fn robot_parameters(size: &FleetSize, r: usize) -> RobotParameters {
    let mut noise = GaussianNoise::new(size.seed, 10_000 + r as u64);
    let mut links = LINKS;
    for link in &mut links {
        // All numbers of a link vary together, and a little by themselves.
        let heavier = 1.0 + ROBOTS * noise.normal();
        for number in link {
            *number *= heavier * (1.0 + 0.3 * ROBOTS * noise.normal());
        }
    }
    let mut friction = |of: [f64; 2]| of.map(|f| f * (1.0 + FRICTIONS * noise.normal()));
    RobotParameters {
        links,
        dry: friction(DRY),
        viscous: friction(VISCOUS),
    }
}

/// The change of robot `r`: of a hundred robots three wear, three get a load, two lose a sensor, and one has a load on
/// all days.
fn planted_change(size: &FleetSize, r: usize) -> PlantedChange {
    let mut noise = GaussianNoise::new(size.seed, 5_000_000 + r as u64);
    let drive = usize::from(noise.uniform() < 0.5);
    // At least two days before and some after, so that the change can be detected.
    let day = 2 + random_index(&mut noise, size.days - 4);
    let much = noise.uniform();
    // Small fleets have one of each as well.
    match r % 100 {
        7 | 38 | 71 => PlantedChange::Wear {
            drive,
            day,
            per_day: size.changes * (0.08 + 0.10 * much),
        },
        3 | 45 | 82 => PlantedChange::Load {
            day,
            mass: size.changes * (0.15 + 0.25 * much),
        },
        5 | 60 => PlantedChange::Dead { drive, day },
        9 => PlantedChange::Odd {
            mass: size.changes * (0.25 + 0.2 * much),
        },
        _ => PlantedChange::Nothing,
    }
}

/// Robot, day and number of the recordings that are cut off, as by a full disk.
fn bad_recordings(size: &FleetSize) -> Vec<(usize, usize, usize)> {
    let mut noise = GaussianNoise::new(size.seed, 9_000_000);
    let mut place = |n: usize| random_index(&mut noise, n);
    let mut all: Vec<_> = (0..size.bad)
        .map(|_| (place(size.robots), place(size.days), place(size.per_day)))
        .collect();
    all.sort_unstable();
    all.dedup();
    all
}

/// Cuts off the last third of a file.
fn truncate_file(path: &Path) -> Result<(), FleetFault> {
    let file = fs::OpenOptions::new().write(true).open(path);
    let cut = file.and_then(|file| file.set_len(file.metadata()?.len() * 2 / 3));
    cut.map_err(|error| write_fault(path, &error))
}

/// Writes recording `k` of robot `r` on a day: torques from its parameters and change, then noise and resolution of the
/// sensors.
fn write_recording(
    path: &Path,
    size: &FleetSize,
    motions: &[FleetMotion],
    robot: &RobotParameters,
    planted: &PlantedChange,
    (r, day, k): (usize, usize, usize),
) -> Result<(), FleetFault> {
    let seed = size.seed ^ ((r as u64) << 24 | (day as u64) << 8 | k as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    // A different part of one of the motions for each recording.
    let mut noise = GaussianNoise::new(seed, 3);
    let motion = &motions[random_index(&mut noise, MOTIONS)];
    let n = motion.q[0].len();
    let start = random_index(&mut noise, n);
    let mut links = robot.links;
    // Friction varies from recording to recording.
    let daily = 1.0 + DAILY * noise.normal();
    let [mut dry, mut viscous] = [robot.dry, robot.viscous].map(|f| f.map(|f| f * daily));
    // The change of the robot, if it is present on this day.
    let mut dead = None;
    let mut load = 0.0;
    match planted {
        PlantedChange::Wear {
            drive,
            day: from,
            per_day,
        } if day >= *from => {
            let grown = 1.0 + per_day * (day - from + 1) as f64;
            dry[*drive] *= grown;
            viscous[*drive] *= grown;
        }
        PlantedChange::Load { day: from, mass } if day >= *from => load = *mass,
        PlantedChange::Dead { drive, day: from } if day >= *from => dead = Some(*drive),
        PlantedChange::Odd { mass } => load = *mass,
        _ => {}
    }
    // The load at the tip of the second link changes ZZ, MX and M.
    links[1][0] += load * TO_TIP * TO_TIP;
    links[1][1] += load * TO_TIP;
    links[1][3] += load;
    // Torques over one period, without noise.
    let torque: Vec<Vec<f64>> = (0..2)
        .map(|d| {
            let mut sum: Vec<f64> = (motion.qd[d].iter())
                .map(|rate| dry[d] * sign(*rate) + viscous[d] * rate)
                .collect();
            for (numbers, columns) in links.iter().zip(&motion.columns) {
                for (number, column) in numbers.iter().zip(columns) {
                    for (sum, x) in sum.iter_mut().zip(&column[d]) {
                        *sum += number * x;
                    }
                }
            }
            sum
        })
        .collect();
    // Readings of the sensors; the motion is repeated after its period.
    let all = samples(size);
    let time: Vec<f64> = (0..all).map(|i| i as f64 / size.rate).collect();
    let mut positions = [Vec::with_capacity(all), Vec::with_capacity(all)];
    let mut torques = [Vec::with_capacity(all), Vec::with_capacity(all)];
    for i in 0..all {
        let at = (start + i) % n;
        for j in 0..2 {
            positions[j].push(ENCODER.read(motion.q[j][at], &mut noise));
            #[allow(clippy::cast_possible_truncation, reason = "torques are stored with fewer digits")]
            torques[j].push(TORQUE.read(torque[j][at], &mut noise) as f32);
        }
    }
    if let Some(drive) = dead {
        // The sensor fails after a tenth of the first recording of its first day, and keeps its last reading.
        let from = match planted {
            PlantedChange::Dead { day: first, .. } if day == *first && k == 0 => all / 10,
            _ => 0,
        };
        let last = torques[drive][from];
        torques[drive][from..].fill(last);
    }
    write_parquet(path, &time, &positions, &torques)
}

/// The sign of a number; zero for zero.
fn sign(x: f64) -> f64 {
    if x == 0.0 { 0.0 } else { x.signum() }
}

/// Writes the columns as Parquet: time in s, positions in rad, torques in N m.
fn write_parquet(
    path: &Path,
    time: &[f64],
    positions: &[Vec<f64>; 2],
    torques: &[Vec<f32>; 2],
) -> Result<(), FleetFault> {
    let fault = |error: &dyn std::fmt::Display| write_fault(path, error);
    // No column has empty values.
    let column = |name: &str, kind: Physical| {
        Type::primitive_type_builder(name, kind)
            .with_repetition(Repetition::REQUIRED)
            .build()
            .map(Arc::new)
    };
    let fields: Result<Vec<_>, _> = [
        ("t", Physical::DOUBLE),
        ("q1", Physical::DOUBLE),
        ("q3", Physical::DOUBLE),
        ("motor_left", Physical::FLOAT),
        ("motor_right", Physical::FLOAT),
    ]
    .into_iter()
    .map(|(name, kind)| column(name, kind))
    .collect();
    let schema = fields.and_then(|fields| Type::group_type_builder("recording").with_fields(fields).build());
    let schema = Arc::new(schema.map_err(|error| fault(&error))?);
    let properties = WriterProperties::builder()
        .set_compression(Compression::UNCOMPRESSED)
        .set_dictionary_enabled(false)
        .build();
    let file = fs::File::create(path).map_err(|error| fault(&error))?;
    // One row group, with the columns in the order of the schema.
    let written = (|| {
        let mut writer = SerializedFileWriter::new(BufWriter::new(file), schema, Arc::new(properties))?;
        let mut group = writer.next_row_group()?;
        for values in [time, &positions[0], &positions[1]] {
            if let Some(mut column) = group.next_column()? {
                column.typed::<DoubleType>().write_batch(values, None, None)?;
                column.close()?;
            }
        }
        for values in torques {
            if let Some(mut column) = group.next_column()? {
                column.typed::<FloatType>().write_batch(values, None, None)?;
                column.close()?;
            }
        }
        group.close()?;
        writer.close().map(|_| ())
    })();
    written.map_err(|error: parquet::errors::ParquetError| fault(&error))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rig's columns add up to the rig's forces with all links as they are.
    #[test]
    fn columns_of_the_rig_add_up_to_its_forces() {
        let size = FleetSize {
            robots: 1,
            days: 6,
            per_day: 1,
            seconds: 6.0,
            rate: 25.0,
            seed: 4,
            bad: 0,
            changes: 1.0,
        };
        let motion = motion(&size, 1).expect("a motion");
        let files = modelmill::files::MemoryFiles::default();
        let mut rig = modelmill_rig::load("rig", RIG, &files).expect("a rig").rig;
        for (body, numbers) in rig.bodies.iter_mut().zip(LINKS) {
            set_link(body, numbers);
        }
        // Positions and rates of a sample; accelerations from their neighbours.
        let i = 40;
        let qdd = (0..2).map(|j| (motion.qd[j][i + 1] - motion.qd[j][i - 1]) * size.rate / 2.0);
        let state = RigState {
            q: vec![motion.q[0][i], motion.q[1][i]],
            qd: vec![motion.qd[0][i], motion.qd[1][i]],
            qdd: qdd.collect(),
        };
        let moved = RigTracker::new(&rig).unwrap().follow(&state).unwrap();
        let expected = forces(&rig, &moved).unwrap();
        for d in 0..2 {
            let sum: f64 = LINKS
                .iter()
                .zip(&motion.columns)
                .flat_map(|(numbers, columns)| numbers.iter().zip(columns))
                .map(|(number, column)| number * column[d][i])
                .sum();
            assert!(
                (sum - expected[d]).abs() < 0.02 * expected[d].abs().max(1.0),
                "{sum} is not {}",
                expected[d]
            );
        }
    }

    #[test]
    fn days_follow_each_other() {
        assert_eq!(
            [date(0), date(30), date(31), date(61)],
            ["2026-03-01", "2026-03-31", "2026-04-01", "2026-05-01"]
        );
    }
}
