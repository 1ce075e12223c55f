//! Recordings of a case by realistic sensors: encoders of 20 bits, forces with noise, and one fault of the recordings.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use modelmill_rig::{RigState, RigTracker};

use modelmill_lab::plant::{DRIVES, PlantMotion, SpidermillPlant};
use modelmill_lab::random::{CaseRandom, three_digits};
use modelmill_lab::record::{ENCODER_NOISE, encoder_step};
use modelmill_lab::span::norm;

use super::drawn::Drawn;

/// Samples per second.
const RATE: f64 = 250.0;
/// Standard deviation of white force noise, N.
const NOISE: f64 = 1.0;
/// Standard deviation of coloured noise, N.
const COLOURED: f64 = 2.0;
/// Lead of the screw per revolution, m.
const SCREW: f64 = 0.02;
/// Steps of a filter per sample.
const FINE: usize = 4;
/// Steps of a filter before the first sample.
const LEAD: usize = 400;
/// Rates below this value, rad/s, are too small for the ratio of drive rate to coordinate rate.
const SLOW: f64 = 1e-3;

/// A fault of the recordings, or a difference between them. Drives and coordinates are indices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Fault {
    Nothing,
    /// Coloured force noise with a corner frequency, Hz.
    Coloured(f64),
    /// A sine on all forces: frequency (Hz) and amplitude (N).
    Hum(f64, f64),
    /// Share of the samples with outliers, and their standard deviation, N.
    Outliers(f64, f64),
    /// Forces rounded to steps, N.
    Steps(f64),
    /// Uneven sampling by a share of a step, with true or with evenly spaced time stamps.
    Uneven {
        by: f64,
        is_stamped: bool,
    },
    /// Delay of one drive's force or of all, s.
    Late {
        drive: Option<usize>,
        by: f64,
    },
    /// Both forces through a low-pass of first order with a corner frequency, Hz.
    Lag(f64),
    /// Excess of a force reading, as a share.
    Scale {
        drive: usize,
        by: f64,
    },
    /// Offset of a force that grows linearly to this value over each run, N.
    OffsetDrift {
        drive: usize,
        by: f64,
    },
    /// Share of all friction that has faded at the end of each run.
    Fades(f64),
    /// Share of all friction that is missing in the validation run.
    OtherDay(f64),
    /// Additional mass at the platform in the validation run, kg.
    Payload(f64),
    /// A push down on the platform in the validation run: force (N), duration (s) and start as a share of the run.
    Push {
        force: f64,
        lasts: f64,
        at: f64,
    },
    /// Sine error of an encoder: amplitude (rad), periods per revolution and phase (rad).
    EccentricJoint {
        at: usize,
        by: f64,
        times: f64,
        phase: f64,
    },
    /// Sine error of the drive's length once per revolution of the screw: amplitude (m) and phase (rad).
    EccentricScrew {
        at: usize,
        by: f64,
        phase: f64,
    },
    /// Backlash of the screw, m.
    Backlash {
        at: usize,
        by: f64,
    },
}

impl Fault {
    /// The fault of a kind of case, with drawn numbers; `side` is the drive.
    pub(crate) fn draw(kind: &str, side: usize, random: &mut CaseRandom) -> Self {
        let mut size = |low, high| three_digits(random.log_between(low, high));
        match kind {
            "noise-fast" => Self::Coloured(size(15.0, 40.0)),
            "noise-medium" => Self::Coloured(size(3.0, 8.0)),
            "noise-slow" => Self::Coloured(size(0.5, 2.0)),
            "hum" => Self::Hum([50.0, 60.0][usize::from(size(1.0, 2.0) > 1.41)], size(3.0, 10.0)),
            "outliers" => Self::Outliers(size(0.002, 0.01), size(80.0, 400.0)),
            "quantised-coarse" => Self::Steps(size(8.0, 30.0)),
            "jitter-stamped" => Self::Uneven {
                by: size(0.08, 0.2),
                is_stamped: true,
            },
            "jitter-unstamped" => Self::Uneven {
                by: size(0.03, 0.1),
                is_stamped: false,
            },
            "delay-medium" => Self::Late {
                drive: None,
                by: size(0.0017, 0.004),
            },
            "delay-small" => Self::Late {
                drive: None,
                by: size(0.0008, 0.0014),
            },
            "delay-one-drive" => Self::Late {
                drive: Some(side),
                by: size(0.002, 0.005),
            },
            "lag" => Self::Lag(size(12.0, 40.0)),
            "scale-one-drive" => Self::Scale {
                drive: side,
                by: size(0.03, 0.1),
            },
            "offset-drift" => Self::OffsetDrift {
                drive: side,
                by: size(3.0, 10.0),
            },
            "friction-fades" => Self::Fades(size(0.15, 0.4)),
            "other-day" => Self::OtherDay(size(0.1, 0.3)),
            "payload-check" => Self::Payload(size(1.5, 6.0)),
            "contact-check" => Self::Push {
                force: size(45.0, 120.0),
                lasts: size(0.3, 0.8),
                at: random.uniform_between(0.15, 0.8),
            },
            "eccentric-joint" => Self::EccentricJoint {
                at: side,
                by: size(0.8e-3, 2.5e-3),
                times: random.uniform_between(2.0, 7.0).floor(),
                phase: random.uniform_between(0.0, TAU),
            },
            "eccentric-screw" => Self::EccentricScrew {
                at: side,
                by: size(6e-6, 15e-6),
                phase: random.uniform_between(0.0, TAU),
            },
            "backlash" => Self::Backlash {
                at: side,
                by: size(0.15e-3, 0.4e-3),
            },
            _ => Self::Nothing,
        }
    }

    /// The fault as text for the truth; empty if there is none.
    pub(crate) fn says(&self) -> String {
        match self {
            Self::Nothing => String::new(),
            fault => format!("{fault:?}"),
        }
    }

    /// Whether a right answer must name it, because it is neither noise nor an effect.
    pub(crate) fn must_be_named(&self) -> bool {
        !matches!(
            self,
            Self::Nothing
                | Self::Coloured(_)
                | Self::Hum(..)
                | Self::Outliers(..)
                | Self::Steps(_)
                | Self::Late { drive: None, .. }
                | Self::Uneven { is_stamped: true, .. }
        )
    }

    /// Whether positions or times are wrong; good smoothing may remove such errors.
    pub(crate) fn is_of_positions(&self) -> bool {
        matches!(
            self,
            Self::EccentricJoint { .. } | Self::EccentricScrew { .. } | Self::Backlash { .. } | Self::Uneven { .. }
        )
    }

    /// Patterns of words that name it.
    pub(crate) fn named_by(&self) -> Vec<String> {
        let drive = |d: &usize| DRIVES[*d];
        let one = |words: &str| vec![words.to_owned()];
        let between = r"(differ|change|other|not the same)[^.]{0,50}(between|recording|run|day)|between (the )?(recording|run|day)";
        match self {
            Self::Hum(..) => one(r"\b[56]0(\.\d+)? ?hz|\bhum\b|mains|periodic in time"),
            Self::Outliers(..) => one("outlier|spike|wild"),
            Self::Steps(_) => one("quanti[sz]|in steps of|resol"),
            Self::Uneven { .. } => one("time stamps?|clock|jitter|uneven"),
            Self::Late { drive: Some(d), .. } => {
                let d = drive(d);
                vec![format!("(late|delay)[^.]{{0,60}}{d}|{d}[^.]{{0,60}}(late|delay)")]
            }
            Self::Lag(_) => one(r"low-?pass|\blag(s|ging)?\b|bandwidth"),
            Self::Scale { .. } => one(r"\bscale\b|\bgain\b|calibrat"),
            Self::OffsetDrift { .. } => one("drift|creep"),
            Self::Fades(_) => one("drift|fad(e|es|ing)|warm|with time|in time|over time|during the (run|recording)"),
            Self::OtherDay(_) => one(between),
            Self::Payload(_) => vec![format!("{between}|payload")],
            Self::Push { .. } => one(r"contact|push|collision|\bevent\b|burst|only (between|from|around) t"),
            Self::EccentricJoint { .. } | Self::EccentricScrew { .. } => {
                one("encoder|eccentric|reading of .{0,12}theta|position error|error of (the )?position")
            }
            Self::Backlash { .. } => one(r"backlash|lost motion|\bplay\b"),
            _ => Vec::new(),
        }
    }

    /// Effects, kind and place, that describe it correctly.
    pub(crate) fn also(&self) -> Vec<[String; 2]> {
        let place = |kind: &str, at: &str| [kind.to_owned(), at.to_owned()];
        match self {
            Self::Late { drive: Some(d), .. } => ["time_delay", "force_lag"].map(|kind| place(kind, DRIVES[*d])).into(),
            Self::Lag(_) => ["force", DRIVES[0], DRIVES[1]].map(|at| place("force_lag", at)).into(),
            Self::Scale { drive, .. } => vec![place("drive_gain", DRIVES[*drive])],
            Self::Backlash { at, .. } => vec![
                place("backlash", DRIVES[*at]),
                place("backlash", &format!("theta{}", at + 1)),
            ],
            _ => Vec::new(),
        }
    }

    /// Approximations that are accepted if the verdict is `unexplained`.
    pub(crate) fn tolerated(&self) -> Vec<[String; 2]> {
        match self {
            Self::Late { drive: Some(_), .. } | Self::Lag(_) => {
                vec![["time_delay".to_owned(), "force".to_owned()]]
            }
            _ => Vec::new(),
        }
    }
}

/// Records the fit (0) or the validation run (1): CSV, and 2-norm of the true noise relative to the forces.
pub(crate) fn record(case: &Drawn, plant: &SpidermillPlant, seed: u64, which: usize) -> Result<(String, f64), String> {
    let course = &case.courses[which];
    let duration = f64::from(case.periods) * course.duration;
    let stream = |purpose: u64| CaseRandom::new(seed, case.number, 10 + 20 * which as u64 + purpose);
    let mut clock = stream(0);
    let mut stamps: Vec<f64> = Vec::new();
    while stamps.len() as f64 <= RATE * duration {
        stamps.push(stamps.len() as f64 / RATE);
    }
    let mut times = stamps.clone();
    if let Fault::Uneven { by, is_stamped } = case.fault {
        let mut sum = 0.0;
        for time in &mut times {
            let error = by * clock.normal() / RATE;
            sum += error;
            *time += if is_stamped { error } else { sum };
        }
        if is_stamped {
            stamps.clone_from(&times);
        }
    }
    let along = PlantMotion::new(&plant.rig, course, times.clone())?;
    let truth = read(case, plant, &along, which, duration)?;
    let mut csv = format!("t,theta1,theta2,{}\n", DRIVES.join(","));
    let readings = readings(case, &along);
    let mut noises: Vec<CaseRandom> = (1..=4).map(stream).collect();
    let mut memories = [0.0; 2].map(|_: f64| noises[2].normal());
    let phase = [noises[2].uniform_between(0.0, TAU), noises[3].uniform_between(0.0, TAU)];
    let (mut errors, mut measured) = (Vec::new(), Vec::new());
    for (i, time) in stamps.iter().enumerate() {
        let _ = write!(csv, "{time:.9}");
        for (q, noise) in readings[i].iter().zip(&mut noises) {
            let reading = encoder_step(q + ENCODER_NOISE * noise.normal());
            let _ = write!(csv, ",{reading:.9}");
        }
        for (d, noise) in noises[2..].iter_mut().enumerate() {
            let force = truth[DRIVES.len() * i + d];
            let white = noise.normal();
            let mut error = NOISE * white;
            let mut read = force;
            match case.fault {
                Fault::Coloured(corner) => {
                    let kept = libm::exp(-TAU * corner / RATE);
                    memories[d] = kept * memories[d] + (1.0 - kept * kept).sqrt() * white;
                    error = COLOURED * memories[d];
                }
                Fault::Hum(frequency, size) => {
                    error += size * libm::sin(TAU * frequency * times[i] + phase[d]);
                }
                Fault::Outliers(share, size) if noise.chance(share) => {
                    error += size * noise.normal();
                }
                Fault::Steps(step) => {
                    let coarse = step * ((force + error) / step).round();
                    error = coarse - force;
                }
                Fault::Scale { drive, by } if drive == d => {
                    read *= 1.0 + by;
                }
                Fault::OffsetDrift { drive, by } if drive == d => {
                    read += by * times[i] / duration;
                }
                _ => {}
            }
            let _ = write!(csv, ",{:.6}", read + error);
            errors.push(error);
            measured.push(read + error);
        }
        csv.push('\n');
    }
    Ok((csv, norm(&errors) / norm(&measured)))
}

/// Readings of force sensors without noise, N: delayed or filtered if that is the fault.
fn read(
    case: &Drawn,
    plant: &SpidermillPlant,
    along: &PlantMotion,
    which: usize,
    duration: f64,
) -> Result<Vec<f64>, String> {
    let course = &case.courses[which];
    let times = &along.times;
    let mut truth = forces(case, plant, along, which, duration)?;
    match case.fault {
        Fault::Late { drive, by } => {
            let then = times.iter().map(|t| t - by).collect();
            let late = PlantMotion::new(&plant.rig, course, then)?;
            let late = forces(case, plant, &late, which, duration)?;
            for (row, (force, late)) in truth.iter_mut().zip(late).enumerate() {
                if drive.is_none_or(|d| d == row % DRIVES.len()) {
                    *force = late;
                }
            }
        }
        Fault::Lag(corner) => {
            let fine = RATE * FINE as f64;
            let count = LEAD + FINE * (times.len() - 1);
            let time = |i: usize| (i as f64 - LEAD as f64) / fine;
            let finely = PlantMotion::new(&plant.rig, course, (0..=count).map(time).collect())?;
            let finely = forces(case, plant, &finely, which, duration)?;
            let kept = libm::exp(-TAU * corner / fine);
            let mut state = finely[..DRIVES.len()].to_vec();
            let mut filtered = Vec::new();
            for (i, row) in finely.chunks(DRIVES.len()).enumerate() {
                for (x, force) in state.iter_mut().zip(row) {
                    *x = force + (*x - force) * kept;
                }
                if i >= LEAD && (i - LEAD).is_multiple_of(FINE) {
                    filtered.extend_from_slice(&state);
                }
            }
            truth = filtered;
        }
        _ => {}
    }
    Ok(truth)
}

/// True forces of a run, N, samples times drives, with its differences to the other run.
fn forces(
    case: &Drawn,
    plant: &SpidermillPlant,
    along: &PlantMotion,
    which: usize,
    duration: f64,
) -> Result<Vec<f64>, String> {
    let is_check = which == 1;
    let friction = match case.fault {
        Fault::OtherDay(by) if is_check => 1.0 - by,
        _ => 1.0,
    };
    let mut effects = case.effects(plant, friction)?;
    if let Fault::Payload(mass) = case.fault
        && is_check
    {
        effects.push(payload(plant, mass)?);
    }
    let mut rows = along.forces(&effects)?;
    if let Some(law) = &case.law {
        for (sum, x) in rows.iter_mut().zip(law.added(along)) {
            *sum += x;
        }
    }
    if let Fault::Fades(by) = case.fault {
        let added = along.added(&case.friction(plant, 1.0)?)?;
        for (row, (sum, x)) in rows.iter_mut().zip(added).enumerate() {
            *sum -= by * along.times[row / DRIVES.len()].max(0.0) / duration * x;
        }
    }
    if let Fault::Push { force, lasts, at } = case.fault
        && is_check
    {
        let from = at * duration;
        for (i, time) in along.times.iter().enumerate() {
            if (from..from + lasts).contains(time) {
                let pushed = weight(plant, &along.states[i].q)?;
                for (d, of_one) in pushed.iter().enumerate() {
                    rows[DRIVES.len() * i + d] += force * of_one;
                }
            }
        }
    }
    Ok(rows)
}

/// A point mass at the platform, kg, as an effect of the rig.
fn payload(plant: &SpidermillPlant, mass: f64) -> Result<modelmill_rig::RigEffect, String> {
    let made = plant.rig.effect("point_mass", &["R3m_right"], &[("m", mass)]);
    made.map_err(|faults| faults.iter().map(ToString::to_string).collect())
}

/// Force of each drive per N of downward force on the platform, computed from the weight of a unit mass.
fn weight(plant: &SpidermillPlant, q: &[f64]) -> Result<Vec<f64>, String> {
    let still = RigState {
        q: q.to_vec(),
        qd: vec![0.0; q.len()],
        qdd: vec![0.0; q.len()],
    };
    let mut tracker = RigTracker::new(&plant.rig).map_err(|error| error.to_string())?;
    let motion = tracker.follow(&still).map_err(|error| error.to_string())?;
    let mut rig = plant.rig.clone();
    let of = |rig: &modelmill_rig::Rig| modelmill_rig::forces(rig, &motion).map_err(|error| error.to_string());
    rig.effects = Vec::new();
    let without = of(&rig)?;
    rig.effects = vec![payload(plant, 1.0)?];
    let with = of(&rig)?;
    let gravity = 9.81;
    Ok(with.iter().zip(without).map(|(a, b)| (a - b) / gravity).collect())
}

/// Readings of the encoders without noise, `[sample][coordinate]`, rad.
fn readings(case: &Drawn, along: &PlantMotion) -> Vec<Vec<f64>> {
    let mut readings: Vec<Vec<f64>> = along.states.iter().map(|state| state.q.clone()).collect();
    match case.fault {
        Fault::EccentricJoint { at, by, times, phase } => {
            for q in &mut readings {
                q[at] += by * libm::sin(times * q[at] + phase);
            }
        }
        Fault::EccentricScrew { at, by, phase } => {
            let drive = along.of_drive(at);
            for ((q, slope), one) in readings.iter_mut().zip(slopes(along, at)).zip(&drive) {
                q[at] += by * libm::sin(TAU * one.value / SCREW + phase) / slope;
            }
        }
        Fault::Backlash { at, by } => {
            let drive = along.of_drive(at);
            let mut screw = drive.first().map_or(0.0, |one| one.value);
            for ((q, slope), one) in readings.iter_mut().zip(slopes(along, at)).zip(&drive) {
                screw = screw.clamp(one.value - 0.5 * by, one.value + 0.5 * by);
                q[at] += (screw - one.value) / slope;
            }
        }
        _ => {}
    }
    readings
}

/// Derivative of a drive's length with respect to its coordinate at each sample, m/rad.
fn slopes(along: &PlantMotion, at: usize) -> Vec<f64> {
    let drive = along.of_drive(at);
    let mut last = 1.0;
    let mut slopes: Vec<f64> = (along.states.iter().zip(&drive))
        .map(|(state, one)| {
            if state.qd[at].abs() > SLOW {
                last = one.rate / state.qd[at];
            }
            last
        })
        .collect();
    // Samples before the first motion have its value.
    if let Some(first) = along.states.iter().position(|s| s.qd[at].abs() > SLOW) {
        let slope = slopes[first];
        slopes[..first].fill(slope);
    }
    slopes
}
