//! Recordings of a case: encoders of 20 bits with noise, forces with noise; and the noise floor that is true.

use std::f64::consts::PI;
use std::fmt::Write as _;

use modelmill_rig::RigState;

use crate::case::{HiddenCase, RATE};
use crate::plant::{DRIVES, PlantMotion};
use crate::random::CaseRandom;
use crate::span::norm;

/// Steps of an encoder per turn.
const STEPS: f64 = 1_048_576.0;
/// Standard deviation of the encoders' noise, rad.
pub const ENCODER_NOISE: f64 = 4e-6;
/// What the files are called.
pub const FILES: [&str; 2] = ["fit.csv", "check.csv"];

/// The step of the encoder that is next to an angle, rad.
pub fn encoder_step(angle: f64) -> f64 {
    let step = 2.0 * PI / STEPS;
    (angle / step).round() * step
}

/// A recording as text.
pub struct RecordingText {
    /// Times, readings and forces, with a header.
    pub csv: String,
    /// Norm of the noise over that of the measured forces: what a model with the truth would leave.
    pub floor: f64,
}

/// A recording before it is written; columns of samples.
pub struct RecordedSamples {
    /// s
    pub times: Vec<f64>,
    /// Readings of the coordinates, rad, before they are rounded to steps of the encoder.
    pub positions: Vec<Vec<f64>>,
    /// Rates and accelerations, where they are recorded.
    pub derivatives: Vec<Vec<f64>>,
    /// Readings of the forces, N.
    pub forces: Vec<Vec<f64>>,
    /// What of them is noise, N.
    pub noise: Vec<Vec<f64>>,
}

impl RecordedSamples {
    /// What the sensors read along a motion: `truth` are the forces (samples times drives), `noise` is added to them, and
    /// `random` gives the noise of each encoder.
    pub fn new(
        along: &PlantMotion,
        truth: &[f64],
        noise: Vec<Vec<f64>>,
        mut random: impl FnMut(usize) -> CaseRandom,
        full: bool,
    ) -> Self {
        let column = |of: fn(&RigState) -> &Vec<f64>, k: usize| -> Vec<f64> {
            along.states.iter().map(|state| of(state)[k]).collect()
        };
        let all = |of: fn(&RigState) -> &Vec<f64>| (0..DRIVES.len()).map(move |k| column(of, k));
        let with_noise = |(k, exact): (usize, Vec<f64>)| {
            let mut random = random(k);
            let read = exact.iter().map(|q| q + ENCODER_NOISE * random.normal());
            read.collect::<Vec<f64>>()
        };
        let read = |(k, noise): (usize, &Vec<f64>)| {
            let exact = truth.iter().skip(k).step_by(DRIVES.len());
            exact.zip(noise).map(|(f, e)| f + e).collect()
        };
        Self {
            times: along.times.clone(),
            positions: all(|s| &s.q).enumerate().map(with_noise).collect(),
            derivatives: if full {
                all(|s| &s.qd).chain(all(|s| &s.qdd)).collect()
            } else {
                Vec::new()
            },
            forces: noise.iter().enumerate().map(read).collect(),
            noise,
        }
    }

    /// As a file.
    pub fn recorded(&self) -> RecordingText {
        let mut csv = String::from("t,theta1,theta2,");
        if !self.derivatives.is_empty() {
            csv.push_str("theta1_d,theta2_d,theta1_dd,theta2_dd,");
        }
        csv.push_str(&DRIVES.join(","));
        csv.push('\n');
        for (i, t) in self.times.iter().enumerate() {
            let _ = write!(csv, "{t}");
            for q in &self.positions {
                let _ = write!(csv, ",{:.9}", encoder_step(q[i]));
            }
            for exact in &self.derivatives {
                let _ = write!(csv, ",{:.9}", exact[i]);
            }
            for force in &self.forces {
                let _ = write!(csv, ",{:.6}", force[i]);
            }
            csv.push('\n');
        }
        RecordingText {
            csv,
            floor: norm(&self.noise.concat()) / norm(&self.forces.concat()),
        }
    }
}

/// Records fit (0) or check (1).
pub fn record(case: &HiddenCase, seed: u64, which: usize) -> Result<RecordingText, String> {
    let course = &case.courses[which];
    let along = PlantMotion::new(&case.rig, course, course.times(RATE))?;
    let truth = case.forces(&along, course)?;
    let random = |channel: usize| CaseRandom::new(seed, case.number, 10 + 10 * which as u64 + channel as u64);
    let noise = (0..DRIVES.len()).map(|k| {
        let mut random = random(DRIVES.len() + k);
        let normal = (0..along.times.len()).map(|_| case.noise * random.normal());
        normal.collect()
    });
    Ok(RecordedSamples::new(&along, &truth, noise.collect(), random, case.full).recorded())
}
