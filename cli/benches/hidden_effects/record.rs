//! Recordings of a case: encoders of 20 bits with noise, forces with noise; and the noise floor that is true.

use std::f64::consts::PI;
use std::fmt::Write as _;

use super::case::{Case, RATE};
use super::plant::{Along, DRIVES};
use super::random::Random;
use super::span::norm;

/// Steps of an encoder per turn.
const STEPS: f64 = 1_048_576.0;
/// Standard deviation of the encoders' noise, rad.
const ENCODER_NOISE: f64 = 4e-6;
/// What the files are called.
pub(crate) const FILES: [&str; 2] = ["fit.csv", "check.csv"];

/// A recording as text.
pub(crate) struct Recorded {
    pub(crate) csv: String,
    /// Norm of the noise over that of the measured forces: what a model with the truth would leave.
    pub(crate) floor: f64,
}

/// Records fit (0) or check (1).
pub(crate) fn record(case: &Case, seed: u64, which: usize) -> Result<Recorded, String> {
    let course = &case.courses[which];
    let along = Along::new(&case.rig, course, course.times(RATE))?;
    let truth = case.forces(&along, course)?;
    let mut noises: Vec<Random> = (0..2 * DRIVES.len() as u64)
        .map(|channel| Random::new(seed, case.number, 10 + 10 * which as u64 + channel))
        .collect();
    let mut csv = String::from("t,theta1,theta2,");
    if case.full {
        csv.push_str("theta1_d,theta2_d,theta1_dd,theta2_dd,");
    }
    csv.push_str(&DRIVES.join(","));
    csv.push('\n');
    let mut noise_of_forces = Vec::with_capacity(truth.len());
    let mut measured = Vec::with_capacity(truth.len());
    for (i, (t, state)) in along.times.iter().zip(&along.states).enumerate() {
        let _ = write!(csv, "{t}");
        for (q, noise) in state.q.iter().zip(&mut noises) {
            let step = 2.0 * PI / STEPS;
            let reading = ((q + ENCODER_NOISE * noise.normal()) / step).round() * step;
            let _ = write!(csv, ",{reading:.9}");
        }
        if case.full {
            for exact in state.qd.iter().chain(&state.qdd) {
                let _ = write!(csv, ",{exact:.9}");
            }
        }
        for (k, noise) in noises[DRIVES.len()..].iter_mut().enumerate() {
            let error = case.noise * noise.normal();
            let force = truth[DRIVES.len() * i + k] + error;
            let _ = write!(csv, ",{force:.6}");
            noise_of_forces.push(error);
            measured.push(force);
        }
        csv.push('\n');
    }
    Ok(Recorded {
        csv,
        floor: norm(&noise_of_forces) / norm(&measured),
    })
}
