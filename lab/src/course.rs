//! Motions of the active coordinates: sums of sines within the limits of the model file.

use std::f64::consts::PI;

use modelmill_rig::RigState;
use modelmill_spec::MotionLimits;

use crate::random::CaseRandom;

/// Period of the paper's trajectories, s.
const PERIOD: f64 = 7.29;
/// Harmonics of the paper's trajectories.
const HARMONICS: u32 = 7;
/// Number of times per motion at which limits are checked.
const CHECKS: usize = 1500;

/// Number of periods of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CourseRepeats {
    /// Three periods.
    Thrice,
    /// Two periods.
    Twice,
    /// One period.
    Once,
    /// Frequencies without a common period.
    Never,
}

impl CourseRepeats {
    /// The number of periods as text, as printed and as stored in `truth.json`.
    pub fn word(self) -> &'static str {
        match self {
            Self::Thrice => "three periods",
            Self::Twice => "two periods",
            Self::Once => "one period",
            Self::Never => "not periodic",
        }
    }
}

/// A motion of all active coordinates with its duration.
pub struct DrawnCourse {
    /// One sum of sines per active coordinate.
    sums: Vec<HarmonicSum>,
    /// Duration of the recording, s.
    pub duration: f64,
}

/// The motion of one coordinate, rad: `offset + sum of sine*sin(omega t) + cosine*cos(omega t)`.
struct HarmonicSum {
    /// Mean value, rad.
    offset: f64,
    /// Angular frequency (rad/s), coefficient of sine and coefficient of cosine (rad) of each term.
    terms: Vec<[f64; 3]>,
}

impl HarmonicSum {
    /// Value, rate and acceleration at a time in s.
    fn motion_at(&self, t: f64) -> [f64; 3] {
        let mut motion = [self.offset, 0.0, 0.0];
        for [w, a, b] in &self.terms {
            let (sin, cos) = libm::sincos(w * t);
            let value = a * sin + b * cos;
            motion[0] += value;
            motion[1] += w * (a * cos - b * sin);
            motion[2] -= w * w * value;
        }
        motion
    }

    /// Multiplies all amplitudes by a factor; the offset stays.
    fn scale(&mut self, factor: f64) {
        for [_, a, b] in &mut self.terms {
            *a *= factor;
            *b *= factor;
        }
    }
}

impl DrawnCourse {
    /// Draws a motion that uses most of the position limits and satisfies those of rate and acceleration.
    pub fn draw(random: &mut CaseRandom, limits: &MotionLimits, repeats: CourseRepeats) -> Self {
        let duration = match repeats {
            CourseRepeats::Thrice => 3.0 * PERIOD,
            CourseRepeats::Twice => 2.0 * PERIOD,
            CourseRepeats::Once => PERIOD,
            CourseRepeats::Never => random.uniform_between(7.0, 12.0),
        };
        // Without a common period, the harmonics are shifted at random by up to 16 %.
        let mut frequencies = Vec::new();
        for k in 1..=HARMONICS {
            let frequency_scale = match repeats {
                CourseRepeats::Never => 1.0 + 0.08 * random.normal().clamp(-2.0, 2.0),
                _ => 1.0,
            };
            frequencies.push(f64::from(k) * frequency_scale * 2.0 * PI / PERIOD);
        }
        let sums = limits.coordinates.iter().map(|(_, of_one)| {
            let fill = random.uniform_between(0.75, 0.97);
            let [low, high] = of_one.position.unwrap_or([-1.0, 1.0]);
            let mut sum = HarmonicSum {
                offset: 0.0,
                terms: Vec::new(),
            };
            // Amplitudes fall with the number of the harmonic.
            for (k, w) in (1..).zip(&frequencies) {
                let size = 1.0 / f64::from(k);
                sum.terms.push([*w, size * random.normal(), size * random.normal()]);
            }
            // Least and greatest value of the motion or of one of its derivatives.
            let ends = |sum: &HarmonicSum, derivative: usize| {
                let times = (0..CHECKS).map(|i| duration * i as f64 / CHECKS as f64);
                times.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], t| {
                    let x = sum.motion_at(t)[derivative];
                    [low.min(x), high.max(x)]
                })
            };
            // The travel is 75 to 97 % of the range of positions, less if rate or acceleration require it.
            let [least, greatest] = ends(&sum, 0);
            sum.scale(fill * (high - low) / (greatest - least));
            for (derivative, range) in [(1, of_one.rate), (2, of_one.acceleration)] {
                if let Some(range) = range {
                    let [least, greatest] = ends(&sum, derivative);
                    let reach = (least / range[0]).max(greatest / range[1]);
                    if reach > 0.98 {
                        sum.scale(0.98 / reach);
                    }
                }
            }
            // Coefficients are rounded to five decimals before the mean is drawn.
            for [_, a, b] in &mut sum.terms {
                [*a, *b] = [*a, *b].map(|x| (1e5 * x).round() / 1e5);
            }
            let [least, greatest] = ends(&sum, 0);
            let room = (high - low) - (greatest - least);
            let place = low + random.uniform_between(0.05, 0.95) * room - least;
            sum.offset = (1e5 * place).round() / 1e5;
            sum
        });
        Self {
            sums: sums.collect(),
            duration,
        }
    }

    /// Times of the samples for a sampling frequency in Hz, s.
    pub fn times(&self, rate: f64) -> Vec<f64> {
        let mut times = Vec::new();
        while times.len() as f64 <= rate * self.duration {
            times.push(times.len() as f64 / rate);
        }
        times
    }

    /// Coordinates, rates and accelerations at a time in s.
    pub fn state_at(&self, t: f64) -> RigState {
        let mut state = RigState::default();
        for sum in &self.sums {
            let [q, qd, qdd] = sum.motion_at(t);
            state.q.push(q);
            state.qd.push(qd);
            state.qdd.push(qdd);
        }
        state
    }
}
