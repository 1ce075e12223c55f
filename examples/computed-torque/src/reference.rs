//! Desired motions: sums of sines around the nominal pose, with their derivatives.

use std::f64::consts::TAU;

/// Amplitude in rad, number of the harmonic, and phase in rad.
type SineTerm = (f64, f64, f64);

/// A periodic motion of both cranks.
#[derive(Clone, Debug)]
pub(crate) struct ReferenceMotion {
    /// Period of the first harmonic, s.
    period: f64,
    /// Duration of the motion, s.
    pub(crate) duration: f64,
    /// Mean angle of each crank, rad.
    centre: [f64; 2],
    /// Sines of each crank.
    sines: [&'static [SineTerm]; 2],
}

impl ReferenceMotion {
    /// A motion for identification: fast and slow, with both cranks together and separately.
    pub(crate) fn excitation() -> Self {
        Self {
            period: 5.0,
            duration: 5.0,
            centre: [1.82, 1.32],
            sines: [
                &[(0.12, 1.0, 0.3), (0.05, 3.0, 1.9), (0.02, 7.0, 0.5)],
                &[(0.11, 2.0, 1.1), (0.05, 1.0, 2.7), (0.02, 8.0, 4.0)],
            ],
        }
    }

    /// The motion that the controllers have to follow.
    pub(crate) fn task() -> Self {
        Self {
            period: 4.0,
            duration: 5.0,
            centre: [1.80, 1.34],
            sines: [
                &[(0.15, 1.0, 0.0), (0.03, 4.0, 1.0)],
                &[(0.13, 1.0, 1.6), (0.04, 3.0, 0.2)],
            ],
        }
    }

    /// Coordinates, rates and accelerations at time `t` (s): rad, rad/s and rad/s^2.
    pub(crate) fn state_at(&self, t: f64) -> [[f64; 2]; 3] {
        let mut state = [self.centre, [0.0; 2], [0.0; 2]];
        for (k, sines) in self.sines.iter().enumerate() {
            for (amplitude, harmonic, phase) in *sines {
                let w = harmonic * TAU / self.period;
                let (sin, cos) = (w * t + phase).sin_cos();
                state[0][k] += amplitude * sin;
                state[1][k] += amplitude * w * cos;
                state[2][k] -= amplitude * w * w * sin;
            }
        }
        state
    }
}
