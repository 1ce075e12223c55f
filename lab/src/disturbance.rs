//! Disturbances of recordings by sensors, drives and different days, with sizes drawn at random.
//!
//! A case goes in; its recordings with one disturbance come out, and the claims that are true because of it.

use std::f64::consts::{PI, TAU};

use crate::case::{HiddenCase, RATE};
use crate::coloured::{SpectrumFall, noise};
use crate::hidden::effect;
use crate::placed::{EffectAtom, PlacedEffect};
use crate::plant::{DRIVES, PlantMotion};
use crate::random::{CaseRandom, three_digits};
use crate::record::{RecordedSamples, RecordingText};

/// Kinds of effects whose size may fade during a run and differ between days.
const FRICTION: [&str; 7] = [
    "viscous_friction",
    "coulomb_friction",
    "stribeck_friction",
    "quadratic_friction",
    "load_friction",
    "directional_viscous_friction",
    "directional_coulomb_friction",
];

/// A disturbance with its size.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs, reason = "the comment of each kind describes its numbers")]
pub enum DrawnDisturbance {
    /// White noise only.
    None,
    /// Noise through a low-pass with a corner frequency, Hz.
    Coloured { corner: f64, fall: SpectrumFall },
    /// A sine of 50 Hz on all forces, amplitude in N.
    Hum { size: f64 },
    /// Errors of half a percent of the force samples, rms in N.
    Outliers { size: f64 },
    /// Forces rounded to steps, N.
    Steps { size: f64 },
    /// A force reading whose offset grows linearly to `size` over each run, N.
    Drift { drive: usize, size: f64 },
    /// Friction that falls linearly by a share during each run.
    Fades { part: f64 },
    /// Delayed force signal of one drive or of all, s.
    Late { drive: Option<usize>, by: f64 },
    /// All forces through a low-pass of first order with a corner frequency, Hz.
    Lag { corner: f64 },
    /// A force reading that is too large by a share.
    Scale { drive: usize, part: f64 },
    /// An eccentric encoder: a sine error of amplitude `size`, rad, with `times` periods per revolution.
    Eccentric { coordinate: usize, size: f64, times: u8 },
    /// Sampling steps with accumulating errors, as a share of a step, with evenly spaced time stamps.
    Jitter { part: f64 },
    /// Friction that is lower by a share in the validation run.
    OtherDay { part: f64 },
    /// Additional mass at the platform in the validation run, kg.
    Payload { mass: f64 },
    /// A push of half a second in the validation run, N; `at` is its start as a share of the run.
    Push { size: f64, at: f64 },
}

impl DrawnDisturbance {
    /// Draws a disturbance; those that change friction are drawn only for cases with hidden friction.
    pub fn draw(case: &HiddenCase, random: &mut CaseRandom) -> Self {
        let drive = random.below(DRIVES.len());
        let part = three_digits(random.uniform_between(0.1, 0.3));
        let has_friction = case.hidden.iter().any(is_friction);
        // Without friction, numbers 8 and 9 are a delay and a lag.
        match random.below(16) {
            0 | 1 => Self::None,
            2 | 3 => Self::Coloured {
                corner: three_digits(random.log_between(1.0, 60.0)),
                fall: if random.chance(0.5) {
                    SpectrumFall::Steep
                } else {
                    SpectrumFall::Gentle
                },
            },
            4 => Self::Hum {
                size: three_digits(random.uniform_between(2.0, 8.0)),
            },
            5 => Self::Outliers {
                size: three_digits(random.uniform_between(80.0, 300.0)),
            },
            6 => Self::Steps {
                size: three_digits(random.uniform_between(5.0, 25.0)),
            },
            7 => Self::Drift {
                drive,
                size: three_digits(random.sign() * random.uniform_between(2.0, 8.0)),
            },
            8 if has_friction => Self::Fades { part },
            9 if has_friction => Self::OtherDay { part },
            8 | 10 => Self::Late {
                drive: random.chance(0.5).then_some(drive),
                by: three_digits(random.uniform_between(1e-3, 4e-3)),
            },
            9 | 11 => Self::Lag {
                corner: three_digits(random.log_between(10.0, 40.0)),
            },
            12 => Self::Scale {
                drive,
                part: three_digits(random.sign() * random.uniform_between(0.03, 0.08)),
            },
            13 => Self::Eccentric {
                coordinate: drive,
                size: three_digits(random.uniform_between(0.5e-3, 2e-3)),
                times: [1, 2, 4, 8][random.below(4)],
            },
            14 => Self::Jitter {
                part: three_digits(random.uniform_between(0.02, 0.08)),
            },
            _ if random.chance(0.5) => Self::Payload {
                mass: three_digits(random.uniform_between(1.0, 4.0)),
            },
            _ => Self::Push {
                size: three_digits(random.sign() * random.uniform_between(20.0, 60.0)),
                at: random.uniform_between(0.1, 0.8),
            },
        }
    }

    /// Claims that are true because of it, as kind and place.
    pub fn makes_true(self) -> Vec<EffectAtom> {
        let of = |kind: &str, place: &str| (kind.to_owned(), place.to_owned());
        // An effect on all forces is true for each drive and for `force`, which stands for all drives.
        let everywhere = |kind: &str| {
            let places = DRIVES.iter().chain(&["force"]);
            places.map(|place| of(kind, place)).collect()
        };
        match self {
            Self::Fades { .. } => DRIVES.map(|drive| of("friction_drift", drive)).to_vec(),
            Self::Late { drive: None, .. } => everywhere("time_delay"),
            Self::Late { drive: Some(d), .. } => vec![of("time_delay", DRIVES[d])],
            Self::Lag { .. } => everywhere("force_lag"),
            Self::Scale { drive, .. } => vec![of("drive_gain", DRIVES[drive])],
            _ => Vec::new(),
        }
    }

    /// Records the fit (0) or the validation run (1) of a case with this disturbance.
    pub fn record(self, case: &HiddenCase, seed: u64, which: usize) -> Result<RecordingText, String> {
        let course = &case.courses[which];
        let stream = |purpose: u64| CaseRandom::new(seed, case.number, 300 + 50 * which as u64 + purpose);
        let mut random = stream(0);
        let stamps = course.times(RATE);
        // With jitter, the true times are a random walk around the time stamps.
        let times = match self {
            Self::Jitter { part } => {
                let mut late = 0.0;
                let walk = stamps.iter().map(|t| {
                    late += part * random.normal() / RATE;
                    (t + late).max(0.0)
                });
                walk.collect()
            }
            _ => stamps.clone(),
        };
        let along = PlantMotion::new(&case.rig, course, times)?;
        let mut forces = case.forces(&along, course)?;
        // Shares of the friction that are missing at the start and at the end of the run.
        let changes_friction = match self {
            Self::Fades { part } => Some([0.0, part]),
            Self::OtherDay { part } if which == 1 => Some([part, part]),
            _ => None,
        };
        if let Some([first, last]) = changes_friction {
            let effects: Result<Vec<_>, String> = (case.hidden.iter())
                .filter(|one| is_friction(one))
                .map(|one| one.effect(&case.rig))
                .collect();
            let n = along.times.len() as f64;
            for (i, (f, friction)) in forces.iter_mut().zip(along.added(&effects?)?).enumerate() {
                let share = (i / DRIVES.len()) as f64 / n;
                *f -= (first + share * (last - first)) * friction;
            }
        }
        // Disturbances of the forces before noise is added.
        match self {
            Self::Late { drive, by } => {
                let times = along.times.iter().map(|t| t - by).collect();
                let late = case.forces(&PlantMotion::new(&case.rig, course, times)?, course)?;
                for (i, (f, late)) in forces.iter_mut().zip(late).enumerate() {
                    if drive.is_none_or(|d| d == i % DRIVES.len()) {
                        *f = late;
                    }
                }
            }
            Self::Lag { corner } => {
                for d in 0..DRIVES.len() {
                    lag(forces.iter_mut().skip(d).step_by(DRIVES.len()), RATE / (TAU * corner));
                }
            }
            Self::Payload { mass } if which == 1 => {
                let at = PlacedEffect::new("point_mass", &["R3m_right"]);
                let payload = effect(&case.rig, &at, &[("m", mass)])?;
                for (f, more) in forces.iter_mut().zip(along.added(&[payload])?) {
                    *f += more;
                }
            }
            _ => {}
        }
        // An eccentric encoder or jitter would contradict exact derivatives, so they are not recorded.
        let mut samples = RecordedSamples::new(
            &along,
            &forces,
            (0..DRIVES.len())
                .map(|k| {
                    let colour = match self {
                        Self::Coloured { corner, fall } => Some((corner, fall)),
                        _ => None,
                    };
                    noise(&mut stream(10 + k as u64), along.times.len(), RATE, case.noise, colour)
                })
                .collect(),
            |k| stream(20 + k as u64),
            case.full && !matches!(self, Self::Eccentric { .. } | Self::Jitter { .. }),
        );
        samples.times = stamps;
        self.on_readings(&mut samples, &mut random, which);
        Ok(samples.recorded())
    }

    /// Disturbs the readings: forces after noise was added, and positions.
    fn on_readings(self, samples: &mut RecordedSamples, random: &mut CaseRandom, which: usize) {
        let times = &samples.times;
        let duration = times.last().copied().unwrap_or(1.0);
        for (d, force) in samples.forces.iter_mut().enumerate() {
            for (f, t) in force.iter_mut().zip(times) {
                match self {
                    Self::Hum { size } => *f += size * (TAU * 50.0 * t + d as f64).sin(),
                    Self::Outliers { size } if random.chance(0.005) => *f += size * random.normal(),
                    Self::Steps { size } => *f = (*f / size).round() * size,
                    Self::Drift { drive, size } if drive == d => *f += size * t / duration,
                    Self::Scale { drive, part } if drive == d => *f *= 1.0 + part,
                    Self::Push { size, at } if which == 1 => {
                        let phase = (t - at * duration) / 0.5;
                        if (0.0..1.0).contains(&phase) {
                            *f += size * (PI * phase).sin() * [1.0, 0.6][d % 2];
                        }
                    }
                    _ => {}
                }
            }
        }
        // The error of an eccentric encoder is a function of its angle.
        if let Self::Eccentric {
            coordinate,
            size,
            times,
        } = self
        {
            for q in &mut samples.positions[coordinate] {
                *q += size * (f64::from(times) * *q).sin();
            }
        }
    }
}

/// Applies a low-pass of first order in place; `constant` is its time constant in samples.
///
/// It is exact for forces that are linear between samples.
fn lag<'a>(forces: impl Iterator<Item = &'a mut f64>, constant: f64) {
    let keeps = (-constant.recip()).exp();
    // The previous force with the state of the filter; the filter starts in its steady state.
    let mut past: Option<(f64, f64)> = None;
    for force in forces {
        let now = *force;
        let (before, state) = past.unwrap_or((now, now));
        let slope = now - before;
        let state = now - slope * constant + (state - before + slope * constant) * keeps;
        past = Some((now, state));
        *force = state;
    }
}

/// Whether the kind of a hidden effect is one of [`FRICTION`].
fn is_friction(one: &crate::hidden::HiddenEffect) -> bool {
    FRICTION.contains(&one.placed.kind.as_str())
}
