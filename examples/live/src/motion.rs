//! The usual motion of the machine: sums of sines around the nominal pose, with their derivatives.

use std::f64::consts::TAU;

/// Period, s.
pub(crate) const PERIOD: f64 = 5.0;
/// Mean angle of each crank, rad.
const CENTRE: [f64; 2] = [1.82, 1.32];
/// Amplitude in rad, number of the harmonic, and phase in rad, for each crank.
const SINES: [[(f64, f64, f64); 3]; 2] = [
    [(0.12, 1.0, 0.3), (0.05, 3.0, 1.9), (0.02, 7.0, 0.5)],
    [(0.11, 2.0, 1.1), (0.05, 1.0, 2.7), (0.02, 8.0, 4.0)],
];

/// Coordinates, rates and accelerations of the cranks at time `t` (s): rad, rad/s and rad/s^2.
pub(crate) fn motion(t: f64) -> [[f64; 2]; 3] {
    let mut state = [CENTRE, [0.0; 2], [0.0; 2]];
    for (k, sines) in SINES.iter().enumerate() {
        for (amplitude, harmonic, phase) in sines {
            let w = harmonic * TAU / PERIOD;
            let (sin, cos) = (w * t + phase).sin_cos();
            state[0][k] += amplitude * sin;
            state[1][k] += amplitude * w * cos;
            state[2][k] -= amplitude * w * w * sin;
        }
    }
    state
}
