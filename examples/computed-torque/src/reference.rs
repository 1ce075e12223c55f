//! Motions that are wanted: sums of sines around the nominal pose, with their derivatives.

use std::f64::consts::TAU;

/// Amplitude, rad, number of the harmonic, and phase, rad.
type SineTerm = (f64, f64, f64);

/// A periodic motion of both cranks.
#[derive(Clone, Debug)]
pub(crate) struct ReferenceMotion {
    period: f64,
    /// How long it goes on, s.
    pub(crate) duration: f64,
    centre: [f64; 2],
    sines: [&'static [SineTerm]; 2],
}

impl ReferenceMotion {
    /// A motion that shows what parameters do: fast and slow, both cranks together and apart.
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

    /// The motion that the controllers are asked for.
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

    /// Coordinates, rates and accelerations at a time, s.
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
