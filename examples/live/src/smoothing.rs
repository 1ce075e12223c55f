//! Motion from the positions that a controller reads: a parabola through the last samples, evaluated at their middle.
//!
//! A. Savitzky, M. Golay, "Smoothing and differentiation of data by simplified least squares procedures" (1964). The
//! same weights smooth positions and forces, so that both sides of the equations have the same low-pass and the same
//! delay.

/// Number of samples on either side of the middle.
const REACH: usize = 15;
/// Number of samples of the parabola.
const LENGTH: usize = 2 * REACH + 1;

/// Position, rate and acceleration of two coordinates, and the forces of two drives, at one time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SmoothedState {
    /// Coordinates, rad.
    pub(crate) q: [f64; 2],
    /// Rates, rad/s.
    pub(crate) qd: [f64; 2],
    /// Accelerations, rad/s^2.
    pub(crate) qdd: [f64; 2],
    /// Forces, N, with the same delay.
    pub(crate) forces: [f64; 2],
}

/// The last readings of two positions and two forces.
#[derive(Clone, Debug)]
pub(crate) struct MotionSmoother {
    /// Weights of the samples for the value, its first and its second derivative.
    weights: [[f64; LENGTH]; 3],
    /// Positions, then forces, in a ring of samples.
    readings: [[f64; 4]; LENGTH],
    /// Number of readings so far.
    n: usize,
}

impl MotionSmoother {
    /// Computes the weights for samples that are `cycle` seconds apart.
    pub(crate) fn new(cycle: f64) -> Self {
        // Least squares of a parabola: sums of even powers of the places; those of odd powers vanish.
        let places: [f64; LENGTH] = std::array::from_fn(|i| i as f64 - REACH as f64);
        let power = |n: i32| places.iter().map(|x| x.powi(n)).sum::<f64>();
        let (s0, s2, s4) = (LENGTH as f64, power(2), power(4));
        let determinant = s0 * s4 - s2 * s2;
        Self {
            weights: [
                places.map(|x| (s4 - s2 * x * x) / determinant),
                places.map(|x| x / s2 / cycle),
                places.map(|x| 2.0 * (s0 * x * x - s2) / determinant / (cycle * cycle)),
            ],
            readings: [[0.0; 4]; LENGTH],
            n: 0,
        }
    }

    /// Adds the readings of a cycle. Returns the state [`REACH`] cycles before it, as soon as there are enough
    /// readings.
    pub(crate) fn add_readings(&mut self, q: [f64; 2], forces: [f64; 2]) -> Option<SmoothedState> {
        self.readings[self.n % LENGTH] = [q[0], q[1], forces[0], forces[1]];
        self.n += 1;
        if self.n < LENGTH {
            return None;
        }
        // Weighted sum of a signal, for the value or a derivative.
        let of = |derivative: usize, signal: usize| -> f64 {
            let oldest_first = (0..LENGTH).map(|i| self.readings[(self.n + i) % LENGTH][signal]);
            let weighted = oldest_first.zip(&self.weights[derivative]);
            weighted.map(|(x, w)| x * w).sum()
        };
        Some(SmoothedState {
            q: [of(0, 0), of(0, 1)],
            qd: [of(1, 0), of(1, 1)],
            qdd: [of(2, 0), of(2, 1)],
            forces: [of(0, 2), of(0, 3)],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_comes_out_as_it_is() {
        let cycle = 1e-3;
        let at = |t: f64| [1.0 + 2.0 * t + 3.0 * t * t, -0.5 * t];
        let mut smoother = MotionSmoother::new(cycle);
        let mut last = None;
        for i in 0..50 {
            let t = f64::from(i) * cycle;
            last = smoother.add_readings(at(t), [7.0, t]);
        }
        let (found, t) = (last.unwrap(), (49 - REACH) as f64 * cycle);
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-9, "{a} {b}");
        for k in 0..2 {
            near(found.q[k], at(t)[k]);
        }
        near(found.qd[0], 2.0 + 6.0 * t);
        near(found.qdd[0], 6.0);
        near(found.forces[0], 7.0);
        near(found.forces[1], t);
    }
}
