//! Recordings of a case: encoders of 20 bits with noise and forces with noise, together with the true noise floor.

use std::f64::consts::PI;
use std::fmt::Write as _;

use modelmill_rig::RigState;

use crate::case::{HiddenCase, RATE};
use crate::plant::{DRIVES, PlantMotion};
use crate::random::CaseRandom;
use crate::span::norm;

/// Steps of an encoder per revolution, 2^20.
const STEPS: f64 = 1_048_576.0;
/// Standard deviation of the encoders' noise, rad.
pub const ENCODER_NOISE: f64 = 4e-6;
/// File names of the fit and of the validation run.
pub const FILES: [&str; 2] = ["fit.csv", "check.csv"];

/// An angle rounded to the nearest step of the encoder, rad.
pub fn encoder_step(angle: f64) -> f64 {
    let step = 2.0 * PI / STEPS;
    (angle / step).round() * step
}

/// A recording as CSV text.
pub struct RecordingText {
    /// Times, readings and forces, with a header.
    pub csv: String,
    /// 2-norm of the noise divided by that of the measured forces: the residual of a model with the true effects.
    pub floor: f64,
}

/// A recording before it is written, as columns of samples.
pub struct RecordedSamples {
    /// Times of the samples, s.
    pub times: Vec<f64>,
    /// Readings of the coordinates before rounding to encoder steps, `[coordinate][sample]`, rad.
    pub positions: Vec<Vec<f64>>,
    /// Exact rates (rad/s), then accelerations (rad/s^2), `[column][sample]`; empty if they are not recorded.
    pub derivatives: Vec<Vec<f64>>,
    /// Readings of the forces with noise, `[drive][sample]`, N.
    pub forces: Vec<Vec<f64>>,
    /// The noise in these readings, `[drive][sample]`, N.
    pub noise: Vec<Vec<f64>>,
}

impl RecordedSamples {
    /// Readings of the sensors along a motion.
    ///
    /// `truth` has the forces (samples times drives), `noise` is added to them, and `random` returns the random numbers
    /// of each encoder. With `full`, rates and accelerations are recorded.
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
        // Positions have noise of the encoder; derivatives are exact.
        let with_noise = |(k, exact): (usize, Vec<f64>)| {
            let mut random = random(k);
            let read = exact.iter().map(|q| q + ENCODER_NOISE * random.normal());
            read.collect::<Vec<f64>>()
        };
        // Forces of one drive are every n-th row for n drives.
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

    /// The recording as CSV, with its noise floor.
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

/// Records the fit (0) or the validation run (1) of a case; fails if the rig cannot follow the motion.
pub fn record(case: &HiddenCase, seed: u64, which: usize) -> Result<RecordingText, String> {
    let course = &case.courses[which];
    let along = PlantMotion::new(&case.rig, course, course.times(RATE))?;
    let truth = case.forces(&along, course)?;
    // Every channel has its own stream of random numbers: encoders first, then forces.
    let random = |channel: usize| CaseRandom::new(seed, case.number, 10 + 10 * which as u64 + channel as u64);
    let noise = (0..DRIVES.len()).map(|k| {
        let mut random = random(DRIVES.len() + k);
        let normal = (0..along.times.len()).map(|_| case.noise * random.normal());
        normal.collect()
    });
    Ok(RecordedSamples::new(&along, &truth, noise.collect(), random, case.full).recorded())
}
